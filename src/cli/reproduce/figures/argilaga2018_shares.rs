//! [Argilaga2018] Table 2 and Fig. 8: 128 and 512 elements to 2 %, shares of the time of the parts of the program, shear band. Part of J-2.

use crate::cli::reproduce::field::Fields;
use crate::cli::reproduce::journal::{attempt, iterates};
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "argilaga2018-shares",
    source: "[Argilaga2018] Table 2, Fig. 8",
    shows: "128 and 512 elements to 2 %: stress ratio, shear band, residuals past the peak, shares of cells and linear solver in the time",
    run_time: ("5 min", "hours"),
    runs,
    evaluate,
};

/// Elements across and up, and the shares of elements, solver and others in the paper, %.
const MESHES: [((u32, u32), [f64; 3]); 2] = [((8, 16), [99.93, 0.02, 0.05]), ((16, 32), [99.67, 0.31, 0.02])];

fn name((across, up): (u32, u32)) -> String {
    format!("mesh-{across}x{up}")
}

fn runs(size: Size) -> Vec<Run> {
    let run = |(mesh, _): ((u32, u32), [f64; 3])| {
        Run::new(name(mesh), "scenes/argilaga2018/biaxial.toml", Command::Stopping, size)
            .set(format!("mesh.elements=[{}, {}]", mesh.0, mesh.1))
    };
    MESHES.map(run).into()
}

/// The largest FNORM/RNORM with which a step past a compression was accepted.
fn largest_ratio(run: &Finished, after: f64) -> Result<f64, ReproduceError> {
    let all = iterates(run)?;
    let steps = run.table()?.curve("step", "axial_compression")?;
    let accepted = steps.iter().filter(|[_, strain]| *strain > after);
    let ratio = |step: f64| attempt(&all, step as u64).last().map(|iterate| iterate.force_ratio);
    Ok(accepted.filter_map(|[step, _]| ratio(*step)).fold(0.0, f64::max))
}

/// The shear strain of the elements at the end.
fn strain(run: &Finished, label: &str) -> Result<Panel, ReproduceError> {
    let last = Fields::steps(run).last().copied().unwrap_or(0);
    let compression = value_at(&run.table()?.curve("step", "axial_compression")?, last as f64);
    let fields = Fields::read(run, last)?;
    let patches = fields.outlines()?.into_iter().zip(fields.element_values("shear_strain")?).collect();
    Ok(Panel { name: format!("{label}, {:.1} %", 100.0 * compression), patches })
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let (x, y) = (("Gauss points", Scale::Logarithmic), ("share of the time, %", Scale::Logarithmic));
    let mut shares = Chart::new("[Argilaga2018] Table 2: linear solver and assembly", x, y);
    let x = ("axial compression", Scale::Linear);
    let mut stress = Chart::new("[Argilaga2018] section 7: two meshes", x, ("stress ratio", Scale::Linear));
    let (mut solver, mut rest, mut published) = (Curve::new(), Curve::new(), Curve::new());
    let mut panels = Vec::new();
    let mut comparisons = Vec::new();
    for (mesh, theirs) in MESHES {
        let run = results.run(&name(mesh))?;
        let elements = mesh.0 * mesh.1;
        let label = format!("{elements} elements");
        let points = f64::from(4 * elements);
        let wall = run.summary(&["time", "wall_s"])?;
        let share = |part: &str| Ok::<f64, ReproduceError>(100.0 * run.summary(&["time", part])? / wall);
        let [linear, assembly] = [share("linear_solver_s")?, share("assembly_s")?];
        solver.push([points, linear]);
        rest.push([points, assembly]);
        published.push([points, theirs[1]]);
        comparisons.push(Comparison::new(
            format!("{label}: cells, their tangents and transport"),
            "%",
            Theirs::Value(theirs[0]),
            "[Argilaga2018] Table 2; band of J-2: above 99 %",
            100.0 - linear - assembly,
            Tolerance::Absolute(1.0),
        ));
        for (part, ours, theirs) in [("linear solver", linear, theirs[1]), ("assembly", assembly, theirs[2])] {
            let quantity = format!("{label}: {part}");
            let source = "[Argilaga2018] Table 2";
            comparisons.push(Comparison::new(quantity, "%", Theirs::Value(theirs), source, ours, Tolerance::Nothing));
        }
        let ratio = run.table()?.curve("axial_compression", "stress_ratio")?;
        let top = peak(&ratio)?;
        comparisons.push(Comparison::reported(format!("{label}: largest stress ratio"), "-", top[1]));
        comparisons.push(Comparison::reported(
            format!("{label}: compression at the largest stress ratio"),
            "-",
            top[0],
        ));
        comparisons.push(Comparison::new(
            format!("{label}: largest FNORM/RNORM of a step past the peak"),
            "-",
            Theirs::Between(0.0, 1e-2),
            "[Argilaga2018] section 4, J-2",
            largest_ratio(run, top[0])?,
            Tolerance::Absolute(0.0),
        ));
        for (part, path) in
            [("evaluations per point", &["evaluations_per_gauss_point"][..]), ("cut-backs", &["cutbacks"])]
        {
            comparisons.push(Comparison::reported(format!("{label}: {part}"), "-", run.summary(path)?));
        }
        stress.curve(&label, ratio);
        panels.push(strain(run, &label)?);
    }
    shares.curve("linear solver", solver);
    shares.curve("assembly", rest);
    shares.published("[Argilaga2018]: solver", published);
    let map = Map {
        title: "[Argilaga2018] Fig. 8: meshes and compression".to_owned(),
        quantity: "shear strain since the start".to_owned(),
        panels,
    };
    Ok(Outcome {
        charts: vec![("", shares), ("stress", stress)],
        maps: vec![("map", map)],
        comparisons,
        notes: results.notes(),
    })
}
