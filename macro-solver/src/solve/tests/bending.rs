//! H-11 and H-14: what one Gauss point costs and gains in bending and near incompressibility.

use super::*;
use crate::element::hourglass::HourglassControl;
use crate::formulation::Formulation;
use crate::observer::Outcome;
use claims::Claim;

const LENGTH: f64 = 8.0;
const DEPTH: f64 = 1.0;
/// End shear, Pa: linear elasticity has no scale, but strains far above round-off keep the law's digits.
const LOAD: f64 = 1.0;

/// Tip deflection of a cantilever of solid elements under an end shear, and hourglass over external work.
fn cantilever(kind: ElementKind, poisson: f64, along: usize, through: usize) -> (f64, f64) {
    let mesh = Block::space([LENGTH, DEPTH, 0.25], [along, through, 1], kind).mesh().unwrap();
    let mut problem = Problem::new(
        mesh,
        vec![
            Condition::fixed("left", Axis::X),
            Condition::fixed("bottom_left", Axis::Y),
            Condition::fixed("back", Axis::Z),
            Condition::fixed("front", Axis::Z),
            Condition::Traction { sides: "right".into(), value: [0.0, LOAD, 0.0] },
        ],
    );
    problem.formulation = Formulation::SmallStrain;
    problem.hourglass = HourglassControl::Stiffness { coefficient: 0.05 };
    problem.stages[0].control.increments = 1;
    problem.stages[0].strategy.tangent_floor = None;
    problem.stages[0].strategy.capped_change = 1.0;
    problem.stages[0].tolerances = Tolerances::both(1e-8, 1e-8);
    let young = 1e3;
    let (bulk, shear) = (young / (3.0 * (1.0 - 2.0 * poisson)), young / (2.0 * (1.0 + poisson)));
    let mut material = ElasticMaterial::spatial(ElasticLaw::SmallStrain, bulk, shear, problem.point_count());
    let (run, record) = run(&problem, &mut material);
    assert!(matches!(run.outcome, Outcome::Completed), "{kind:?} {poisson} {:?} {:?}", run.outcome, record.cut_backs);
    let tip = problem.mesh.node_sets["right"].iter().map(|&node| record.displacements[node][1]).sum::<f64>()
        / problem.mesh.node_sets["right"].len() as f64;
    let work = 0.5 * LOAD * DEPTH * 0.25 * tip;
    (tip, record.hourglass_energy / work)
}

/// Plane-strain beam theory with shear.
fn theory(poisson: f64) -> f64 {
    let (young, force, inertia) = (1e3 / (1.0 - poisson * poisson), LOAD * DEPTH, DEPTH.powi(3) / 12.0);
    let shear = 1e3 / (2.0 * (1.0 + poisson));
    force * LENGTH.powi(3) / (3.0 * young * inertia) + 1.2 * force * LENGTH / (shear * DEPTH)
}

/// H-11. With four elements through the depth the hourglass control takes less than 5 % of the work.
#[test]
fn hourglass_energy_stays_small_in_bending() {
    let (tip, share) = cantilever(ElementKind::H8Single, 0.25, 32, 4);
    assert!(share > 0.0, "{share}");
    let quantity = "hourglass energy of a cantilever over the work of its load, four through the depth";
    Claim::of("H-11", quantity).number(share).at_most(0.05);
    assert!((tip / theory(0.25) - 1.0).abs() < 0.08, "{tip} {}", theory(0.25));
    // The control takes over where the points see nothing: one element through the depth.
    assert!(cantilever(ElementKind::H8Single, 0.25, 8, 1).1 > 0.3);
}

/// H-14. Near incompressibility full integration locks and one point does not.
#[test]
fn one_point_does_not_lock_near_incompressibility() {
    let poisson = 0.499_9;
    let (full, _) = cantilever(ElementKind::H8, poisson, 16, 4);
    let (single, _) = cantilever(ElementKind::H8Single, poisson, 16, 4);
    let reference = cantilever(ElementKind::H20, poisson, 16, 4).0;
    Claim::of("H-14", "deflection of H20 against beam theory, m").value(reference, theory(poisson)).within(0.02);
    Claim::of("H-14", "deflection of H8 with eight points over that of H20").number(full / reference).at_most(0.5);
    Claim::of("H-14", "deflection of one-point H8 over that of H20").number(single / reference).at_least(0.9);
}
