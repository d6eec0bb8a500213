//! [Liu2018] Figs. 12 to 14: influence of the initial anisotropy of the contacts.

use super::liu2018::{Biaxial, FAILURE, biaxial, falls};
use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-anisotropy",
    source: "[Liu2018] Figs. 12 to 14",
    shows: "stress ratio, volume, contacts and their anisotropy over strain for initial anisotropies of 0.02, 0.05, 0.08",
    run_time: ("20 s", "1 min"),
    entries: &[],
    runs,
    evaluate,
};

/// Initial anisotropy and the packing that has it, as the scene names it.
const PACKINGS: [(f64, &str); 3] = [
    (0.02, "../../packings/discs-liu2018.json"),
    (0.05, "../../packings/discs-liu2018-a05.json"),
    (0.08, "../../packings/discs-liu2018-a08.json"),
];

fn name(anisotropy: f64) -> String {
    format!("anisotropy-{anisotropy}")
}

fn runs(size: Size) -> Vec<Run> {
    let run = |(anisotropy, packing): (f64, &str)| {
        Run::new(name(anisotropy), "scenes/liu2018/biaxial.toml", Command::Scene, size)
            .set(format!("packing=\"{packing}\""))
    };
    PACKINGS.map(run).into()
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let x = ("axial compression", Scale::Linear);
    let y = ("|(s11 - s22) / (s11 + s22)|", Scale::Linear);
    let mut stress = Chart::new("[Liu2018] Fig. 13a: initial anisotropy", x, y);
    let mut volume =
        Chart::new("[Liu2018] Fig. 13b: initial anisotropy", x, ("relative change of volume", Scale::Linear));
    let mut contacts =
        Chart::new("[Liu2018] Fig. 14a: initial anisotropy", x, ("coordination number", Scale::Linear));
    let mut induced =
        Chart::new("[Liu2018] Fig. 14b: initial anisotropy", x, ("anisotropy of the contacts", Scale::Linear));
    let mut comparisons = Vec::new();
    let mut numbers = Vec::new();
    let (mut strengths_at_failure, mut fabrics_at_failure) = (Vec::new(), Vec::new());
    let mut tops = Vec::new();
    let mut contractions = Vec::new();
    for (anisotropy, _) in PACKINGS {
        let Biaxial { ratio, volume: change, contacts: number, anisotropy: fabric, .. } =
            biaxial(results.run(&name(anisotropy))?)?;
        let top = peak(&ratio)?;
        let label = format!("initial anisotropy {anisotropy}");
        comparisons.push(Comparison::reported(format!("peak stress ratio, {label}"), "-", top[1]));
        comparisons.push(Comparison::reported(format!("strain at the peak, {label}"), "-", top[0]));
        comparisons.push(Comparison::reported(
            format!("coordination number at 7 % strain, {label}"),
            "-",
            value_at(&number, 0.07),
        ));
        comparisons.push(Comparison::reported(format!("largest anisotropy, {label}"), "-", peak(&fabric)?[1]));
        tops.push(top);
        numbers.push(value_at(&number, 0.07));
        strengths_at_failure.push(mean_between(&ratio, FAILURE[0], FAILURE[1]));
        fabrics_at_failure.push(mean_between(&fabric, FAILURE[0], FAILURE[1]));
        contractions.push(-trough(&change)?[1]);
        stress.curve(&label, ratio);
        volume.curve(&label, change);
        contacts.curve(&label, number);
        induced.curve(&label, fabric);
    }
    stress.published("[Liu2018]: largest value 0.39 at 7.3 %, anisotropy 0.02", [[0.073, 0.39]]);
    let source = "[Liu2018] section 4.3.3";
    induced.published("[Liu2018]: 0.27 at 7.3 %, anisotropy 0.02", [[0.073, 0.27]]);
    let falls_along = |axis: usize| falls(&tops.iter().map(|top| top[axis]).collect::<Vec<f64>>());
    let (strengths, strains) = (falls_along(1), falls_along(0));
    comparisons.push(Comparison::holds("peak falls with the initial anisotropy", source, strengths));
    comparisons.push(Comparison::holds("peak comes earlier with the initial anisotropy", source, strains));
    comparisons.push(Comparison::holds("compaction falls with the initial anisotropy", source, falls(&contractions)));
    comparisons.push(Comparison::holds(
        "most contacts at 7 % strain with the lowest initial anisotropy",
        source,
        order(&numbers).last() == Some(&0),
    ));
    comparisons.push(Comparison::holds(
        "mean anisotropies from 6 to 8 % strain are in the order of the stress ratios",
        source,
        order(&fabrics_at_failure) == order(&strengths_at_failure),
    ));
    Ok(Outcome {
        charts: vec![("", stress), ("volume", volume), ("contacts", contacts), ("induced", induced)],
        comparisons,
        notes: results.notes(),
        ..Outcome::default()
    })
}

/// Places of the values from the smallest to the largest.
fn order(values: &[f64]) -> Vec<usize> {
    let mut places: Vec<usize> = (0..values.len()).collect();
    places.sort_by(|one, other| values[*one].total_cmp(&values[*other]));
    places
}

#[cfg(test)]
mod tests {
    use super::order;

    #[test]
    fn values_are_ordered_from_the_smallest_on() {
        assert_eq!(order(&[0.3, 0.1, 0.2]), [1, 2, 0]);
        assert_eq!(order(&[]), [0; 0]);
    }
}
