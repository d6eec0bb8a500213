//! Errata of [Liu2018], each shown by a run: a contact stiffness that is a thousand times too small, and one frequency for the damping and the step of
//! dynamic relaxation.

use crate::cli::reproduce::prelude::*;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-errata",
    source: "errata to [Liu2018]",
    shows: "the printed stiffness under the printed pressure, and iterations of dynamic relaxation as printed and corrected, by mesh",
    run_time: ("15 s", "1 min"),
    entries: &[],
    runs,
    evaluate,
};

const SCENE: &str = "scenes/liu2018/biaxial.toml";

/// Elements across and up, and whether the paper size alone has them.
const MESHES: [([u32; 2], bool); 4] = [([1, 1], false), ([1, 2], false), ([2, 4], false), ([4, 8], true)];

const FORMS: [(&str, &str); 2] = [("as_printed", "as printed"), ("corrected", "corrected")];

fn meshes(size: Size) -> impl Iterator<Item = [u32; 2]> {
    MESHES.into_iter().filter(move |(_, is_large)| !is_large || size == Size::Paper).map(|(mesh, _)| mesh)
}

fn name(form: &str, [across, up]: [u32; 2]) -> String {
    format!("{form}-{across}x{up}")
}

fn runs(size: Size) -> Vec<Run> {
    // One element and cheap grains in either size: what is shown are a refusal and counts of iterations.
    let run = |name: String| Run::new(name, SCENE, Command::Refused(&["no equilibrium", "as_printed"]), Size::Small);
    let mut runs = vec![run("stiffness-as-printed".to_owned()).set("contact.normal_stiffness=1e4")];
    for mesh in meshes(size) {
        for (form, _) in FORMS {
            runs.push(
                run(name(form, mesh))
                    .set("procedure=relaxation")
                    .set(format!("relaxation.form={form}"))
                    .set("solver={ formulation = \"total_lagrangian\", force_tolerance = 1e-3 }")
                    .set(format!("mesh.elements=[{}, {}]", mesh[0], mesh[1]))
                    .set("stage.1.loading.increments=2")
                    .set("stage.1.boundary.0.displacement.y=-4e-5"),
            );
        }
    }
    runs
}

fn evaluate(results: &Results, size: Size) -> Result<Outcome, ReproduceError> {
    let stopped = results.run("stiffness-as-printed")?.stopped();
    let carries_nothing = stopped.is_some_and(|said| said.contains("no equilibrium"));
    let mut comparisons = vec![Comparison::holds(
        "k_n = 1e4 N/m: the cell carries no 0.15 MN/m",
        "erratum: an overlap of fifteen diameters",
        carries_nothing,
    )];
    let mut chart = Chart::new(
        "[Liu2018] dynamic relaxation to 0.2 % of compression",
        ("elements", Scale::Logarithmic),
        ("iterations", Scale::Logarithmic),
    );
    for (form, label) in FORMS {
        let mut curve = Curve::new();
        for mesh in meshes(size) {
            let run = results.run(&name(form, mesh))?;
            let quantity = format!("iterations, {} x {} elements, {label}", mesh[0], mesh[1]);
            if run.stopped().is_some() {
                comparisons.push(Comparison::holds(format!("{quantity}: reaches its end"), "", false));
                continue;
            }
            let iterations = run.summary(&["newton_iterations"])?;
            comparisons.push(Comparison::reported(quantity, "-", iterations));
            curve.push([f64::from(mesh[0] * mesh[1]), iterations]);
        }
        chart.curve(label, curve);
    }
    Ok(Outcome { charts: vec![("", chart)], comparisons, notes: results.notes(), ..Outcome::default() })
}
