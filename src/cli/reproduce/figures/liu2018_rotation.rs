//! [Liu2018] Figs. 10 and 11: free and blocked rotations. Part of J-1.

use super::liu2018::biaxial;
use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-rotation",
    source: "[Liu2018] Figs. 10, 11",
    shows: "stress ratio and anisotropy of the contacts with free and blocked rotations",
    run_time: ("10 s", "1 min"),
    entries: &[("J-1", "blocked over free")],
    runs,
    evaluate,
};

const KINDS: [&str; 2] = ["free", "blocked"];

fn runs(size: Size) -> Vec<Run> {
    let both = |kind: &str| {
        let setting = format!("contact.rotations={kind}");
        let scene = Run::new(format!("body-{kind}"), "scenes/liu2018/biaxial.toml", Command::Scene, size);
        let cell = Run::new(format!("cell-{kind}"), "scenes/liu2018/cell-biaxial.toml", Command::Element(None), size);
        [scene.set(setting.clone()), cell.set(setting)]
    };
    KINDS.iter().flat_map(|kind| both(kind)).collect()
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let x = ("axial compression", Scale::Linear);
    let mut stress = Chart::new("[Liu2018] Fig. 10a: rotations", x, ("|(s11 - s22) / (s11 + s22)|", Scale::Linear));
    let mut anisotropy =
        Chart::new("[Liu2018] Fig. 11b: rotations", x, ("anisotropy of the contacts", Scale::Linear));
    let mut at_their_strain = Vec::new();
    let mut comparisons = Vec::new();
    for (kind, (ratio_theirs, anisotropy_theirs)) in KINDS.into_iter().zip([(0.39, 0.27), (0.48, 0.33)]) {
        let ratio = biaxial(results.run(&format!("body-{kind}"))?)?.ratio;
        let cell = results.run(&format!("cell-{kind}"))?.table()?;
        let along: Vec<f64> = cell.column("F_yy")?.iter().map(|stretch| 1.0 - stretch).collect();
        let fabric: Vec<[f64; 2]> =
            along.iter().zip(cell.column("fabric_anisotropy")?).map(|(x, y)| [*x, y]).collect();
        comparisons.push(Comparison::new(
            format!("stress ratio at 7.3 % strain, rotations {kind}"),
            "-",
            Theirs::Value(ratio_theirs),
            "[Liu2018] section 4.4",
            value_at(&ratio, 0.073),
            Tolerance::Absolute(0.03),
        ));
        comparisons.push(Comparison::new(
            format!("anisotropy at 7.3 % strain, rotations {kind}"),
            "-",
            Theirs::Value(anisotropy_theirs),
            "[Liu2018] section 4.4",
            value_at(&fabric, 0.073),
            Tolerance::Absolute(0.05),
        ));
        let top = peak(&ratio)?;
        comparisons.push(Comparison::reported(format!("largest stress ratio, rotations {kind}"), "-", top[1]));
        at_their_strain.push(top[1]);
        stress.curve(&format!("rotations {kind}"), ratio);
        anisotropy.curve(&format!("rotations {kind}, one cell"), fabric);
    }
    comparisons.push(Comparison::new(
        "largest stress ratio, blocked over free",
        "-",
        Theirs::Between(1.23, 1.5),
        "[Liu2018] section 4.4, band of J-1",
        at_their_strain[1] / at_their_strain[0],
        Tolerance::Absolute(0.0),
    ));
    stress.published("[Liu2018]: 0.39 free, 0.48 inner grains blocked", [[0.073, 0.39], [0.073, 0.48]]);
    anisotropy.published("[Liu2018]: 0.27 free, 0.33 inner grains blocked", [[0.073, 0.27], [0.073, 0.33]]);
    let notes =
        [vec!["rotations of all grains are blocked, those of the paper's inner grains".to_owned()], results.notes()];
    Ok(Outcome {
        charts: vec![("", stress), ("anisotropy", anisotropy)],
        comparisons,
        notes: notes.concat(),
        ..Outcome::default()
    })
}
