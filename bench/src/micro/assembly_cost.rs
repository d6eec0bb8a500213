//! Cost of the macro solver without grains: time of assembly and of the global equations for one iteration with an elastic
//! law at every Gauss point.
//!
//! `grainspan bench micro assembly_cost [NAME]...`; without names all cases but the
//! largest direct ones. Times are wall times of a run of one load step divided by its evaluations; a loaded machine
//! shows in them.
#![expect(clippy::print_stdout, reason = "a program for people")]

use macro_solver::material::elastic::{ElasticLaw, ElasticMaterial};
use macro_solver::mesh::block::Block;
use macro_solver::mesh::{ElementKind, Mesh};
use macro_solver::observer::Silent;
use macro_solver::problem::{Axis, Condition, EquationSolver, Platen, Problem};
use macro_solver::solve::solve;

struct Case {
    name: &'static str,
    kind: ElementKind,
    elements: [usize; 3],
    equations: EquationSolver,
}

const CASES: [Case; 7] = [
    Case { name: "plane-2048", kind: ElementKind::Q8, elements: [16, 32, 0], equations: EquationSolver::Direct },
    Case { name: "plane-100000", kind: ElementKind::Q8, elements: [125, 200, 0], equations: EquationSolver::Direct },
    Case { name: "solid-13824", kind: ElementKind::H8, elements: [12; 3], equations: EquationSolver::Direct },
    Case {
        name: "solid-13824-iterative",
        kind: ElementKind::H8,
        elements: [12; 3],
        equations: EquationSolver::Iterative,
    },
    Case {
        name: "solid-97336-iterative",
        kind: ElementKind::H8,
        elements: [23; 3],
        equations: EquationSolver::Iterative,
    },
    Case {
        name: "single-97336-iterative",
        kind: ElementKind::H8Single,
        elements: [46; 3],
        equations: EquationSolver::Iterative,
    },
    Case { name: "solid-97336", kind: ElementKind::H8, elements: [23; 3], equations: EquationSolver::Direct },
];

/// See the head of this file.
///
/// # Errors
/// None; the signature is that of all microbenchmarks.
pub(super) fn run(wanted: &[String]) -> anyhow::Result<()> {
    println!(
        "case,points,unknowns,evaluations,material_us_per_point,assembly_us_per_point,equations_s,linear_iterations"
    );
    for (number, case) in CASES.iter().enumerate() {
        let chosen = if wanted.is_empty() { number + 1 < CASES.len() } else { wanted.iter().any(|w| w == case.name) };
        if chosen {
            measure(case);
        }
    }
    Ok(())
}

fn measure(case: &Case) {
    let mesh = mesh(case);
    let points = mesh.point_count();
    let mut problem = Problem::new(mesh, conditions(case.kind));
    problem.equations = case.equations;
    problem.stages[0].control.increments = 1;
    let mut material = ElasticMaterial::new(ElasticLaw::SaintVenant, 2e7, 1e7, points);
    let run = solve(&problem, &mut material, &mut Silent);
    let statistics = &run.statistics;
    let sweeps = statistics.evaluations as f64 / points as f64;
    let per_point = |nanoseconds: u64| nanoseconds as f64 * 1e-3 / (sweeps * points as f64);
    println!(
        "{},{points},{},{sweeps},{:.2},{:.2},{:.3},{}",
        case.name,
        statistics.unknowns,
        per_point(statistics.material_nanoseconds),
        per_point(statistics.assembly_nanoseconds),
        statistics.linear_solver_nanoseconds as f64 * 1e-9 / sweeps,
        statistics.linear_iterations,
    );
}

fn mesh(case: &Case) -> Mesh {
    let [columns, rows, layers] = case.elements;
    let block = match layers {
        0 => Block::plane([1.0, 2.0], [columns, rows], case.kind),
        _ => Block::space([1.0, 2.0, 1.0], case.elements, case.kind),
    };
    block.mesh().expect("the sizes of the cases are sound")
}

/// Compression by 1 % between rough platens.
fn conditions(kind: ElementKind) -> Vec<Condition> {
    let platen = |nodes: &str, displacement: f64| Condition::Platen {
        nodes: nodes.into(),
        contact: Platen::Rough,
        axis: Axis::Y,
        displacement,
    };
    let mut conditions = vec![platen("bottom", 0.0), platen("top", -0.02)];
    if kind.dimension().count() == 3 {
        conditions.push(Condition::fixed("back", Axis::Z));
    }
    conditions
}
