//! [Liu2018] Figs. 3c, 3d and 12: the cells as given, with their contact forces and the rose of their contact normals.

use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-cells",
    source: "[Liu2018] Figs. 3c, 3d, 12",
    shows: "the cell with its contact forces, and roses of the contact normals for initial anisotropies of 0.02, 0.05 and 0.08",
    run_time: ("10 s", "10 s"),
    entries: &[],
    runs,
    evaluate,
};

/// Initial anisotropy in the paper, and its packing.
const CELLS: [(&str, f64, &str); 3] =
    [("002", 0.02, "discs-liu2018"), ("005", 0.05, "discs-liu2018-a05"), ("008", 0.08, "discs-liu2018-a08")];

/// How pictures of the packing as given are called.
const GIVEN: &str = "increment-0000";

fn runs(size: Size) -> Vec<Run> {
    let cell = |(name, _, packing): (&str, f64, &str)| {
        Run::new(format!("anisotropy-{name}"), "scenes/liu2018/cell-biaxial.toml", Command::Contacts(At::Start), size)
            .set(format!("packing=\"../../packings/{packing}.json\""))
            .set("path.0.increments=1")
            .set("path.0.strain.yy=-1e-6")
    };
    let frame = Run::new("frame", "scenes/liu2018/cell-frame.toml", Command::Element(None), size)
        .set("path.0.increments=1")
        .set("path.0.strain.yy=-1e-6");
    CELLS.into_iter().map(cell).chain([frame]).collect()
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let mut drawn = Vec::new();
    let mut comparisons = Vec::new();
    for (name, anisotropy, _) in CELLS {
        let run = results.run(&format!("anisotropy-{name}"))?;
        let table = run.table()?;
        let first = |column: &str| -> Result<f64, ReproduceError> { Ok(table.column(column)?[0]) };
        comparisons.push(Comparison::new(
            format!("anisotropy of the contacts of the packing, {anisotropy}"),
            "-",
            Theirs::Value(anisotropy),
            "[Liu2018] section 4.3.3, Fig. 3",
            first("fabric_anisotropy")?,
            Tolerance::Absolute(0.01),
        ));
        if name == "002" {
            comparisons.push(Comparison::new(
                "coordination number of the frame",
                "-",
                Theirs::Value(3.42),
                "[Liu2018] section 4.1",
                results.run("frame")?.table()?.column("coordination_number")?[0],
                Tolerance::Absolute(0.1),
            ));
            comparisons.push(Comparison::reported(
                "coordination number of the periodic cell that it is cut from",
                "-",
                first("coordination_number")?,
            ));
            comparisons.push(Comparison::new(
                "solid fraction",
                "-",
                Theirs::Value(0.846),
                "[Liu2018] section 4.1",
                1.0 / (1.0 + first("void_ratio")?),
                Tolerance::Absolute(0.01),
            ));
            let picture = run.picture("contacts/increment-0000-force-chains.svg")?;
            drawn.push((String::new(), picture.replace(GIVEN, "[Liu2018] Fig. 3c")));
        }
        let title = format!("[Liu2018] Fig. 3d, anisotropy {anisotropy}");
        drawn.push((
            format!("rose-{name}"),
            run.picture("contacts/increment-0000-normals.svg")?.replace(GIVEN, &title),
        ));
    }
    Ok(Outcome { drawn, comparisons, ..Outcome::default() })
}
