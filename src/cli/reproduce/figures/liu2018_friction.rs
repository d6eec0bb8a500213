//! [Liu2018] Figs. 8 and 9: influence of friction on strength, volume and contacts. Part of J-1.

use super::liu2018::{Biaxial, FAILURE, biaxial, falls, rises};
use crate::cli::reproduce::prelude::*;

const FRICTIONS: [f64; 3] = [0.2, 0.4, 0.6];

/// Peak stress ratios of an independent code, three periodic samples of 228 discs, and their standard deviations (G-10).
const CELLS: [(f64, f64); 3] = [(0.298, 0.026), (0.406, 0.010), (0.455, 0.002)];

/// Anisotropies of the contacts of the same samples at 7.3 % strain, which have no standard deviation (G-10).
const ANISOTROPIES: [f64; 3] = [0.14, 0.17, 0.17];

/// Strains before the peak ([Liu2018] section 4.2).
const EARLY: [f64; 2] = [0.0, 0.05];

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-friction",
    source: "[Liu2018] Figs. 8, 9",
    shows: "stress ratio, volume, contacts and their anisotropy over strain for friction 0.2, 0.4, 0.6",
    run_time: ("10 s", "1 min"),
    entries: &[("J-1", "")],
    runs,
    evaluate,
};

fn name(friction: f64) -> String {
    format!("friction-{friction}")
}

fn runs(size: Size) -> Vec<Run> {
    let run = |friction: f64| {
        Run::new(name(friction), "scenes/liu2018/biaxial.toml", Command::Scene, size)
            .set(format!("contact.friction={friction}"))
    };
    FRICTIONS.map(run).into()
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let x = ("axial compression", Scale::Linear);
    let mut stress = Chart::new("[Liu2018] Fig. 8a: friction", x, ("|(s11 - s22) / (s11 + s22)|", Scale::Linear));
    let mut volume = Chart::new("[Liu2018] Fig. 8b: friction", x, ("relative change of volume", Scale::Linear));
    let mut contacts = Chart::new("[Liu2018] Fig. 9a: friction", x, ("coordination number", Scale::Linear));
    let mut anisotropy = Chart::new("[Liu2018] Fig. 9b: friction", x, ("anisotropy of the contacts", Scale::Linear));
    let mut comparisons = Vec::new();
    let mut fabrics = Vec::new();
    let mut peaks = Vec::new();
    let mut contractions = Vec::new();
    let mut numbers = Vec::new();
    for (friction, (mean, deviation)) in FRICTIONS.into_iter().zip(CELLS) {
        let Biaxial { ratio, volume: change, contacts: number, anisotropy: fabric, .. } =
            biaxial(results.run(&name(friction))?)?;
        let label = format!("friction {friction}");
        let top = peak(&ratio)?;
        comparisons.push(Comparison::new(
            format!("peak stress ratio, {label}"),
            "-",
            Theirs::Value(mean),
            "periodic cells, independent code",
            top[1],
            Tolerance::Absolute(2.0 * deviation),
        ));
        if friction == 0.4 {
            comparisons.extend(at_their_friction(&ratio, &change, top));
        }
        comparisons.push(Comparison::reported(format!("strain at the peak, {label}"), "-", top[0]));
        peaks.push(top[1]);
        contractions.push(-trough(&change)?[1]);
        numbers.push(value_at(&number, 0.05));
        stress.curve(&label, ratio);
        volume.curve(&label, change);
        contacts.curve(&label, number);
        anisotropy.curve(&label, fabric.clone());
        fabrics.push(fabric);
    }
    stress.published("[Liu2018]: largest value 0.39 at 7.3 %, friction 0.4", [[0.073, 0.39]]);
    volume.published("[Liu2018]: turns to dilation near 8 %", [[0.08, 0.0]]);
    anisotropy.published("[Liu2018]: 0.27 at 7.3 %, friction 0.4", [[0.073, 0.27]]);
    comparisons.push(Comparison::holds("strength grows with friction", "[Liu2018] section 4.3", rises(&peaks)));
    comparisons.push(Comparison::holds(
        "early compaction grows with friction",
        "[Liu2018] section 4.3",
        rises(&contractions),
    ));
    comparisons.push(Comparison::holds(
        "contacts at 5 % strain fall with friction",
        "[Liu2018] section 4.3",
        falls(&numbers),
    ));
    comparisons.extend(of_anisotropy(&fabrics)?);
    let charts = vec![("", stress), ("volume", volume), ("contacts", contacts), ("anisotropy", anisotropy)];
    Ok(Outcome { charts, comparisons, notes: results.notes(), ..Outcome::default() })
}

/// Anisotropy of the contacts, a curve for each friction.
fn of_anisotropy(fabrics: &[Curve]) -> Result<Vec<Comparison>, ReproduceError> {
    let mut rows = Vec::new();
    for ((friction, theirs), fabric) in FRICTIONS.into_iter().zip(ANISOTROPIES).zip(fabrics) {
        let at_their_strain = value_at(fabric, 0.073);
        let quantity = format!("anisotropy at 7.3 % strain, friction {friction}");
        let mut row = |theirs: f64, source: &'static str, tolerance: Tolerance| {
            rows.push(Comparison::new(
                quantity.clone(),
                "-",
                Theirs::Value(theirs),
                source,
                at_their_strain,
                tolerance,
            ));
        };
        row(theirs, "periodic cells, independent code", Tolerance::Nothing);
        if friction == 0.4 {
            row(0.27, "[Liu2018] section 4.3.2", Tolerance::Absolute(0.05));
        }
        rows.push(Comparison::reported(format!("largest anisotropy, friction {friction}"), "-", peak(fabric)?[1]));
    }
    rows.push(Comparison::holds(
        "the anisotropy differs less between frictions up to 5 % strain than from 6 to 8 %",
        "[Liu2018] section 4.3.1",
        range(&means(fabrics, EARLY)) < range(&means(fabrics, FAILURE)),
    ));
    rows.push(Comparison::holds(
        "mean anisotropy from 6 to 8 % strain grows with friction",
        "[Liu2018] section 4.3.1",
        rises(&means(fabrics, FAILURE)),
    ));
    Ok(rows)
}

/// Mean of each curve between two strains.
fn means(curves: &[Curve], [low, high]: [f64; 2]) -> Vec<f64> {
    curves.iter().map(|curve| mean_between(curve, low, high)).collect()
}

/// Largest value less the smallest.
fn range(values: &[f64]) -> f64 {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest - values.iter().copied().fold(f64::INFINITY, f64::min)
}

/// The paper's own numbers, which are for friction 0.4.
fn at_their_friction(ratio: &[[f64; 2]], change: &[[f64; 2]], top: [f64; 2]) -> Vec<Comparison> {
    let lowest = trough(change).map_or(f64::NAN, |point| point[0]);
    vec![
        Comparison::new(
            "peak stress ratio, friction 0.4",
            "-",
            Theirs::Value(0.39),
            "[Liu2018] section 4.3.2",
            top[1],
            Tolerance::Absolute(0.03),
        ),
        Comparison::new(
            "strain at the peak, friction 0.4",
            "-",
            Theirs::Between(0.05, 0.08),
            "[Liu2018] section 4.3.2, band of J-1",
            top[0],
            Tolerance::Absolute(0.0),
        ),
        Comparison::new(
            "stress ratio at 7.3 % strain, friction 0.4",
            "-",
            Theirs::Value(0.39),
            "[Liu2018] section 4.3.2",
            value_at(ratio, 0.073),
            Tolerance::Absolute(0.03),
        ),
        Comparison::new(
            "strain at the change of sign of J, friction 0.4",
            "-",
            Theirs::Between(0.07, 0.11),
            "[Liu2018] section 4.3, band of J-1",
            crossing(change, 0.0, lowest),
            Tolerance::Absolute(0.0),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frictions_are_compared_by_the_means_of_their_curves() {
        let level =
            |early: f64, late: f64| -> Curve { vec![[0.0, early], [0.05, early], [0.06, late], [0.08, late]] };
        let curves = [level(0.10, 0.20), level(0.11, 0.24), level(0.10, 0.28)];
        assert!((range(&means(&curves, EARLY)) - 0.01).abs() < 1e-12);
        assert!((range(&means(&curves, FAILURE)) - 0.08).abs() < 1e-12);
        assert!(rises(&means(&curves, FAILURE)) && !rises(&means(&curves, EARLY)));
    }
}
