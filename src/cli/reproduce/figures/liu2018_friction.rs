//! [Liu2018] Figs. 8 and 9: influence of friction on strength, volume and contacts. Part of J-1.

use super::liu2018::{Biaxial, biaxial};
use crate::cli::reproduce::prelude::*;

const FRICTIONS: [f64; 3] = [0.2, 0.4, 0.6];

/// Peak stress ratios of an independent code, three periodic samples of 228 discs, and their standard deviations (G-10).
const CELLS: [(f64, f64); 3] = [(0.298, 0.026), (0.406, 0.010), (0.455, 0.002)];

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-friction",
    source: "[Liu2018] Figs. 8, 9",
    shows: "stress ratio, volume and contacts over strain for friction 0.2, 0.4, 0.6",
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
    let mut contacts = Chart::new("[Liu2018] Fig. 9a: friction", x, ("contacts per grain", Scale::Linear));
    let mut comparisons = Vec::new();
    let mut peaks = Vec::new();
    let mut contractions = Vec::new();
    let mut numbers = Vec::new();
    for (friction, (mean, deviation)) in FRICTIONS.into_iter().zip(CELLS) {
        let Biaxial { ratio, volume: change, contacts: number, .. } = biaxial(results.run(&name(friction))?)?;
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
    }
    stress.published("[Liu2018]: largest value 0.39 at 7.3 %, friction 0.4", [[0.073, 0.39]]);
    volume.published("[Liu2018]: turns to dilation near 8 %", [[0.08, 0.0]]);
    let rises = |values: &[f64]| values.windows(2).all(|pair| pair[1] > pair[0]);
    let falls = |values: &[f64]| values.windows(2).all(|pair| pair[1] < pair[0]);
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
    let charts = vec![("", stress), ("volume", volume), ("contacts", contacts)];
    Ok(Outcome { charts, comparisons, notes: results.notes(), ..Outcome::default() })
}

/// The paper's own numbers, which are for friction 0.4.
fn at_their_friction(ratio: &[[f64; 2]], change: &[[f64; 2]], top: [f64; 2]) -> Vec<Comparison> {
    let lowest = trough(change).map_or(f64::NAN, |point| point[0]);
    vec![
        Comparison::new(
            "peak stress ratio, friction 0.4",
            "-",
            Theirs::Value(0.39),
            "[Liu2018] section 4.4",
            top[1],
            Tolerance::Absolute(0.03),
        ),
        Comparison::new(
            "strain at the peak, friction 0.4",
            "-",
            Theirs::Between(0.05, 0.08),
            "[Liu2018] section 4.4, band of J-1",
            top[0],
            Tolerance::Absolute(0.0),
        ),
        Comparison::new(
            "stress ratio at 7.3 % strain, friction 0.4",
            "-",
            Theirs::Value(0.39),
            "[Liu2018] section 4.4",
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
