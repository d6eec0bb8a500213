//! [Argilaga2018] Table 2: shares of the time of the parts of the program, 128 and 512 elements. Part of J-2.

use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "argilaga2018-shares",
    source: "[Argilaga2018] Table 2",
    shows: "shares of the cells, the linear solver and the rest in the time of 128 and 512 elements, by size of the mesh",
    run_time: ("1 min", "hours"),
    entries: &[("J-2", "cells and their transport")],
    runs,
    evaluate,
};

/// Elements across and up, and the shares of elements, solver and others in the paper, %.
const MESHES: [((u32, u32), [f64; 3]); 2] = [((8, 16), [99.93, 0.02, 0.05]), ((16, 32), [99.67, 0.31, 0.02])];

fn name((across, up): (u32, u32)) -> String {
    format!("mesh-{across}x{up}")
}

fn runs(size: Size) -> Vec<Run> {
    let run = |((across, up), _): ((u32, u32), [f64; 3])| {
        let run = Run::new(name((across, up)), "scenes/argilaga2018/biaxial.toml", Command::Stopping, size)
            .set(format!("mesh.elements=[{across}, {up}]"))
            .set("output.fields_every=0");
        match size {
            // The first two of forty steps; past the peak cells take longer, and the share of the rest is smaller still.
            Size::Small => run.set("boundary.2.displacement.y=-1e-4").set("loading.increments=2"),
            Size::Paper => run,
        }
    };
    MESHES.map(run).into()
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let (x, y) = (("Gauss points", Scale::Logarithmic), ("share of the time, %", Scale::Logarithmic));
    let mut chart = Chart::new("[Argilaga2018] Table 2: linear solver and assembly", x, y);
    let (mut solver, mut rest, mut published) = (Curve::new(), Curve::new(), Curve::new());
    let mut comparisons = Vec::new();
    for (mesh, theirs) in MESHES {
        let run = results.run(&name(mesh))?;
        let elements = mesh.0 * mesh.1;
        let points = f64::from(4 * elements);
        let wall = run.summary(&["time", "wall_s"])?;
        let share = |part: &str| Ok::<f64, ReproduceError>(100.0 * run.summary(&["time", part])? / wall);
        let [linear, assembly] = [share("linear_solver_s")?, share("assembly_s")?];
        solver.push([points, linear]);
        rest.push([points, assembly]);
        published.push([points, theirs[1]]);
        comparisons.push(Comparison::new(
            format!("{elements} elements: cells and their transport"),
            "%",
            Theirs::Value(theirs[0]),
            "[Argilaga2018] Table 2; band of J-2: above 99 %",
            100.0 - linear - assembly,
            Tolerance::Absolute(1.0),
        ));
        for (label, ours, theirs) in [("linear solver", linear, theirs[1]), ("assembly", assembly, theirs[2])] {
            let label = format!("{elements} elements: {label}");
            let source = "[Argilaga2018] Table 2";
            comparisons.push(Comparison::new(label, "%", Theirs::Value(theirs), source, ours, Tolerance::Nothing));
        }
    }
    chart.curve("linear solver", solver);
    chart.curve("assembly", rest);
    chart.published("[Argilaga2018]: solver", published);
    Ok(Outcome { charts: vec![("", chart)], comparisons, notes: results.notes(), ..Outcome::default() })
}
