//! [Liu2018] Figs. 12 to 14: influence of the initial anisotropy of the contacts.

use super::liu2018::{Biaxial, biaxial};
use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-anisotropy",
    source: "[Liu2018] Figs. 12 to 14",
    shows: "stress ratio and volume over strain for initial anisotropies of the contacts of 0.02, 0.05, 0.08",
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
    let mut comparisons = Vec::new();
    let mut tops = Vec::new();
    let mut contractions = Vec::new();
    for (anisotropy, _) in PACKINGS {
        let Biaxial { ratio, volume: change, .. } = biaxial(results.run(&name(anisotropy))?)?;
        let top = peak(&ratio)?;
        let label = format!("initial anisotropy {anisotropy}");
        comparisons.push(Comparison::reported(format!("peak stress ratio, {label}"), "-", top[1]));
        comparisons.push(Comparison::reported(format!("strain at the peak, {label}"), "-", top[0]));
        tops.push(top);
        contractions.push(-trough(&change)?[1]);
        stress.curve(&label, ratio);
        volume.curve(&label, change);
    }
    stress.published("[Liu2018]: largest value 0.39 at 7.3 %, anisotropy 0.02", [[0.073, 0.39]]);
    let source = "[Liu2018] section 4.3.3";
    let falls = |values: Vec<f64>| values.windows(2).all(|pair| pair[1] < pair[0]);
    let strengths = falls(tops.iter().map(|top| top[1]).collect());
    let strains = falls(tops.iter().map(|top| top[0]).collect());
    comparisons.push(Comparison::holds("peak falls with the initial anisotropy", source, strengths));
    comparisons.push(Comparison::holds("peak comes earlier with the initial anisotropy", source, strains));
    comparisons.push(Comparison::holds("compaction falls with the initial anisotropy", source, falls(contractions)));
    Ok(Outcome {
        charts: vec![("", stress), ("volume", volume)],
        comparisons,
        notes: results.notes(),
        ..Outcome::default()
    })
}
