//! H-3 and H-4: bending against published and exact solutions of linear elasticity.

use super::*;
use crate::observer::Outcome;
use claims::Claim;

/// Small enough that geometric effects stay below every tolerance here.
const SMALL: f64 = 1e-6;

/// H-3. Cook's membrane: deflection of the middle of the right side, E = 1, nu = 1/3, load 1.
#[test]
fn cook_membrane_deflects_as_published_for_equal_meshes() {
    for (count, published) in [(8, 22.079), (16, 23.430)] {
        let mut mesh = block(ElementKind::Q4, count, count);
        for node in &mut mesh.nodes {
            let [along, up, _] = node.map(|x| x / count as f64);
            *node = [48.0 * along, 44.0 * along + up * (44.0 - 28.0 * along), 0.0];
        }
        let middle = mesh.node_sets["right"][count / 2];
        let mut problem = Problem::new(
            mesh,
            vec![
                Condition::fixed("left", Axis::X),
                Condition::fixed("left", Axis::Y),
                Condition::Traction { sides: "right".into(), value: [0.0, SMALL / 16.0, 0.0] },
            ],
        );
        problem.stages[0].control.increments = 1;
        problem.stages[0].tolerances = Tolerances::both(1e-6, 1e-6);
        let (bulk, shear) = plane_stress_moduli(1.0, 1.0 / 3.0);
        let mut material = ElasticMaterial::new(ElasticLaw::SmallStrain, bulk, shear, problem.point_count());
        let (run, record) = run(&problem, &mut material);
        assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
        let deflection = record.displacements[middle][1] / SMALL;
        let quantity = "deflection of Cook's membrane, Q4, 8 and 16 a side, finite strains at a small load";
        Claim::of("H-3", quantity).value(deflection, published).within(1e-4);
    }
}

/// Exact field of a cantilever of length 4 and depth 2 under a parabolic end load (Timoshenko and Goodier).
fn cantilever([x, y, _]: [f64; 3]) -> [f64; 3] {
    let (length, depth, poisson) = (4.0, 2.0, 0.25);
    let axial = (6.0 * length - 3.0 * x) * x + (2.0 + poisson) * (y * y - depth * depth / 4.0);
    let vertical = 3.0 * poisson * y * y * (length - x)
        + (4.0 + 5.0 * poisson) * depth * depth * x / 4.0
        + (3.0 * length - x) * x * x;
    [-SMALL * y * axial / 100.0, SMALL * vertical / 100.0, 0.0]
}

/// Largest nodal error, over the largest deflection's scale; `skew` distorts the mesh smoothly inside the beam.
fn cantilever_error(kind: ElementKind, rows: usize, skew: f64) -> f64 {
    let mut mesh = block(kind, 2 * rows, rows);
    for node in &mut mesh.nodes {
        let [x, y] = [2.0 * node[0] / rows as f64, 2.0 * node[1] / rows as f64 - 1.0];
        let bow = (std::f64::consts::FRAC_PI_4 * x).sin();
        *node = [x + skew * bow * y, y + skew * bow * (1.0 - y * y), 0.0];
    }
    let ends = [mesh.node_sets["left"].clone(), mesh.node_sets["right"].clone()].concat();
    let mut problem = Problem::new(mesh, Vec::new());
    prescribe_field(&mut problem, &ends, cantilever);
    problem.stages[0].control.increments = 1;
    problem.stages[0].tolerances = Tolerances::both(1e-6, 1e-6);
    let (bulk, shear) = plane_stress_moduli(1.0, 0.25);
    let mut material = ElasticMaterial::new(ElasticLaw::SmallStrain, bulk, shear, problem.point_count());
    let (run, record) = run(&problem, &mut material);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    let errors = record.displacements.iter().zip(&problem.mesh.nodes).map(|(moved, place)| {
        let exact = cantilever(*place);
        (moved[0] - exact[0]).hypot(moved[1] - exact[1]) / cantilever([4.0, 0.0, 0.0])[1]
    });
    errors.fold(0.0, f64::max)
}

/// H-4. Order 2 for Q4, at least 3 for Q8 on a smoothly distorted mesh.
#[test]
fn cantilever_error_falls_at_the_order_of_the_element() {
    for (kind, meshes, lowest) in [(ElementKind::Q4, [4, 8], 1.8), (ElementKind::Q8, [4, 8], 2.8)] {
        let errors = meshes.map(|rows| cantilever_error(kind, rows, 0.2));
        let order = (errors[0] / errors[1]).log2();
        let quantity = format!("order of the error of a cantilever, {kind:?}, 4 and 8 elements through the depth");
        Claim::of("H-4", &quantity).number(order).between(lowest, 4.5);
    }
}

/// On rectangles the reduced Q8 meets this cubic field exactly at its nodes; Newton's tolerance leaves room for the
/// geometric effect of the small deflection.
#[test]
fn rectangular_quadratic_elements_are_exact_at_nodes() {
    let error = cantilever_error(ElementKind::Q8, 2, 0.0);
    assert!(error < 10.0 * SMALL, "{error:e}");
}

/// Where forces balance loosely, the largest force that reactions lack of the loads is stated.
#[test]
fn what_reactions_lack_of_the_loads_is_stated() {
    let pulled = |tolerances| {
        let traction = Condition::Traction { sides: "top".into(), value: [0.0, -4e6, 0.0] };
        let held = [Condition::fixed("bottom", Axis::Y), Condition::fixed("bottom_left", Axis::X)];
        let mut problem = Problem::new(block(ElementKind::Q4, 1, 2), held.into_iter().chain([traction]).collect());
        (problem.stages[0].control.increments, problem.stages[0].tolerances) = (1, tolerances);
        let (run, record) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
        assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
        let bottom: f64 = problem.mesh.node_sets["bottom"].iter().map(|&node| record.reactions[node][1]).sum();
        (run.statistics.largest_force_sum, (bottom / 4e6 - 1.0).abs())
    };
    let (loose, lacking) = pulled(Tolerances::both(0.2, 1e9));
    assert!(lacking > 1e-3 && (loose / lacking - 1.0).abs() < 0.1, "{loose} stated, {lacking} lacking");
    assert!(pulled(TIGHT).0 < 1e-6);
}
