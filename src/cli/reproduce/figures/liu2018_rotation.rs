//! [Liu2018] Figs. 10 and 11: free and blocked rotations. Part of J-1.

use super::liu2018::{biaxial, falls, rises};
use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-rotation",
    source: "[Liu2018] Figs. 10, 11",
    shows: "stress ratio, volume, contacts and their anisotropy with free and blocked rotations, of periodic cells and of frames",
    run_time: ("10 s", "4 min"),
    entries: &[("J-1", "blocked over free")],
    runs,
    evaluate,
};

/// Cells with which the test is made.
#[derive(Clone, Copy)]
struct Cells {
    /// In the names of runs.
    name: &'static str,
    /// In the names of quantities and curves; empty for periodic cells.
    label: &'static str,
    scene: &'static str,
    /// How rotations are blocked.
    blocked: &'static str,
    settings: &'static [&'static str],
    /// Whether the small size of the figure has them.
    is_small: bool,
}

const CELLS: [Cells; 3] = [
    Cells {
        name: "body",
        label: "",
        scene: "scenes/liu2018/biaxial.toml",
        blocked: "blocked",
        settings: &[],
        is_small: true,
    },
    Cells {
        name: "frame",
        label: "frames, ",
        scene: "scenes/liu2018/frame-biaxial.toml",
        blocked: "inner_blocked",
        settings: &[],
        is_small: true,
    },
    Cells {
        name: "servo",
        label: "frames by servo, 1 x 1 elements, ",
        scene: "scenes/liu2018/frame-biaxial.toml",
        blocked: "inner_blocked",
        settings: &["rve.frame.control={ servo = { gain = 1.0 } }", "mesh.elements=[1, 1]"],
        is_small: false,
    },
];

/// What the paper reads at 7.3 % strain: stress ratio and anisotropy of the contacts.
const THEIRS: [(&str, f64, f64); 2] = [("free", 0.39, 0.27), ("blocked", 0.48, 0.33)];

impl Cells {
    fn of(size: Size) -> impl Iterator<Item = Self> {
        CELLS.into_iter().filter(move |cells| cells.is_small || size == Size::Paper)
    }

    fn run(self, kind: &str) -> String {
        format!("{}-{kind}", self.name)
    }

    /// Rotations of one of the two kinds, in words.
    fn rotations(self, kind: &str) -> String {
        let inner = if kind == "blocked" && self.blocked == "inner_blocked" { "of inner grains " } else { "" };
        format!("{}rotations {inner}{kind}", self.label)
    }
}

fn runs(size: Size) -> Vec<Run> {
    let mut runs = Vec::new();
    for cells in Cells::of(size) {
        for (kind, ..) in THEIRS {
            let rotations = if kind == "free" { "free" } else { cells.blocked };
            let run = Run::new(cells.run(kind), cells.scene, Command::Scene, size);
            let run = run.set(format!("contact.rotations={rotations}"));
            runs.push(cells.settings.iter().fold(run, |run, setting| run.set(*setting)));
        }
    }
    for (kind, ..) in THEIRS {
        let cell = Run::new(format!("cell-{kind}"), "scenes/liu2018/cell-biaxial.toml", Command::Element(None), size);
        runs.push(cell.set(format!("contact.rotations={kind}")));
    }
    runs
}

fn evaluate(results: &Results, size: Size) -> Result<Outcome, ReproduceError> {
    let x = ("axial compression", Scale::Linear);
    let mut stress = Chart::new("[Liu2018] Fig. 10a: rotations", x, ("|(s11 - s22) / (s11 + s22)|", Scale::Linear));
    let mut anisotropy =
        Chart::new("[Liu2018] Fig. 11b: rotations", x, ("anisotropy of the contacts", Scale::Linear));
    let mut volume = Chart::new("[Liu2018] Fig. 10b: rotations", x, ("relative change of volume", Scale::Linear));
    let mut contacts = Chart::new("[Liu2018] Fig. 11a: rotations", x, ("coordination number", Scale::Linear));
    let mut comparisons = Vec::new();
    for cells in Cells::of(size) {
        let mut largest = Vec::new();
        let (mut changes, mut numbers) = (Vec::new(), Vec::new());
        for (kind, ratio_theirs, anisotropy_theirs) in THEIRS {
            let body = biaxial(results.run(&cells.run(kind))?)?;
            let rotations = cells.rotations(kind);
            // Of periodic cells the anisotropy is that of one alone.
            let fabric = if cells.name == "body" { one_cell(results, kind)? } else { body.anisotropy };
            let mut at_their_strain = |quantity: &str, theirs: f64, curve: &[[f64; 2]], tolerance: f64| {
                comparisons.push(Comparison::new(
                    format!("{quantity} at 7.3 % strain, {rotations}"),
                    "-",
                    Theirs::Value(theirs),
                    "[Liu2018] section 4.3.2",
                    value_at(curve, 0.073),
                    Tolerance::Absolute(tolerance),
                ));
            };
            at_their_strain("stress ratio", ratio_theirs, &body.ratio, 0.03);
            at_their_strain("anisotropy", anisotropy_theirs, &fabric, 0.05);
            let top = peak(&body.ratio)?;
            comparisons.push(Comparison::reported(format!("largest stress ratio, {rotations}"), "-", top[1]));
            comparisons.push(Comparison::reported(
                format!("largest anisotropy, {rotations}"),
                "-",
                peak(&fabric)?[1],
            ));
            comparisons.push(Comparison::reported(
                format!("largest compaction, {rotations}"),
                "-",
                -trough(&body.volume)?[1],
            ));
            largest.push(top[1]);
            let source = if cells.name == "body" { ", one cell" } else { "" };
            stress.curve(&rotations, body.ratio);
            volume.curve(&rotations, body.volume.clone());
            contacts.curve(&rotations, body.contacts.clone());
            changes.push(body.volume);
            numbers.push(body.contacts);
            anisotropy.curve(&format!("{rotations}{source}"), fabric);
        }
        comparisons.push(Comparison::new(
            format!("largest stress ratio, {}blocked over free", cells.label),
            "-",
            Theirs::Between(1.23, 1.5),
            "[Liu2018] section 4.3.2, band of J-1",
            largest[1] / largest[0],
            Tolerance::Absolute(0.0),
        ));
        comparisons.extend(trends(cells.label, &changes, &numbers)?);
    }
    stress.published("[Liu2018]: 0.39 free, 0.48 inner grains blocked", [[0.073, 0.39], [0.073, 0.48]]);
    anisotropy.published("[Liu2018]: 0.27 free, 0.33 inner grains blocked", [[0.073, 0.27], [0.073, 0.33]]);
    let notes = [
        vec!["of periodic cells the rotations of all grains are blocked, of frames those of the inner grains, as in the paper".to_owned()],
        results.notes(),
    ];
    Ok(Outcome {
        charts: vec![("", stress), ("volume", volume), ("contacts", contacts), ("anisotropy", anisotropy)],
        comparisons,
        notes: notes.concat(),
        ..Outcome::default()
    })
}

/// What the paper says of volume and contacts, of curves with free and then with blocked rotations.
fn trends(label: &str, changes: &[Curve], numbers: &[Curve]) -> Result<Vec<Comparison>, ReproduceError> {
    let source = "[Liu2018] section 4.3.2";
    let mut compactions = Vec::new();
    for change in changes {
        compactions.push(-trough(change)?[1]);
    }
    let means: Vec<f64> = numbers.iter().map(|number| mean_between(number, 0.0, 0.1)).collect();
    let quantity = |what: &str| format!("{label}{what}");
    Ok(vec![
        Comparison::holds(quantity("compaction is larger with blocked rotations"), source, rises(&compactions)),
        Comparison::holds(
            quantity("contacts fall over the test, free and blocked"),
            source,
            numbers.iter().all(|number| is_lower_at_the_end(number)),
        ),
        Comparison::holds(
            quantity("mean contacts of the test are fewer with blocked rotations"),
            source,
            falls(&means),
        ),
    ])
}

/// Whether a curve ends below its first value.
fn is_lower_at_the_end(curve: &[[f64; 2]]) -> bool {
    matches!(curve, [first, .., last] if last[1] < first[1])
}

/// Anisotropy of the contacts of one periodic cell on the path of the test.
fn one_cell(results: &Results, kind: &str) -> Result<Curve, ReproduceError> {
    let cell = results.run(&format!("cell-{kind}"))?.table()?;
    let along = cell.column("F_yy")?;
    Ok(along.iter().zip(cell.column("fabric_anisotropy")?).map(|(stretch, value)| [1.0 - stretch, value]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_falls_if_its_end_is_below_its_begin() {
        assert!(is_lower_at_the_end(&[[0.0, 4.2], [0.05, 4.3], [0.1, 4.1]]));
        assert!(!is_lower_at_the_end(&[[0.0, 4.2], [0.05, 4.1], [0.1, 4.2]]));
        assert!(!is_lower_at_the_end(&[[0.0, 4.2]]));
    }
}
