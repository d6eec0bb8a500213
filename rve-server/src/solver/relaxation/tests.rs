//! What must not reach a result: pair lists, batch mates, instruction sets, work done before.

use super::*;
use crate::contact::{
    ExtendedHertzMindlin, HertzSprings, LinearSprings, NormalStiffness, PlainHertzMindlin, PlainLinear,
    RollingSpring, TangentialUnloading,
};
use crate::definition::{Criterion, Damping, GrainDefinition, PackingFile, RveOptions};
use crate::solver::kernel::backend::Backend;
use crate::space::plane::Plane;
use crate::space::{Discs, Spheres};
use claims::Claim;
use std::path::Path;

type Solver = RelaxationSolver<Discs, PlainLinear>;

const LAW: PlainLinear =
    PlainLinear::plain(LinearSprings { normal: NormalStiffness::Modulus(1e8), stiffness_ratio: 0.5 }, 0.5);

fn hundred_discs(options: RveOptions) -> (GrainModel, GrainState) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
    let contact = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let packing = PackingFile::read(&path).unwrap();
    let definition = GrainDefinition { packing, contact, options };
    let model = GrainModel::new(&definition).unwrap();
    let state = model.initial_state(&definition);
    (model, state)
}

/// The load of a packing counts from the first look at it, at rest or not: cells that fall apart as they come to rest are known by it. Without
/// it, 7 of 21 increments of a cell that had lost its pressure went on moving rounding about.
#[test]
fn the_load_of_a_packing_counts_before_it_is_at_rest() {
    for modulus in [1e8, 1e12] {
        let (model, state) = hundred_discs(RveOptions::default());
        let law = PlainLinear {
            springs: LinearSprings { normal: NormalStiffness::Modulus(modulus), stiffness_ratio: 0.5 },
            ..LAW
        };
        let end = solved(&mut Solver::new(law), &model, &state, [[0.0; 2]; 2], 0);
        assert!(end.state.largest_load > 0.0, "{modulus:e}: {}", end.solved.unbalanced);
    }
}

fn solved<S: Space, L: ContactLaw<S::Kernel>>(
    solver: &mut RelaxationSolver<S, L>,
    model: &GrainModel,
    state: &GrainState<S>,
    strain: S::Tensor,
    ramp_steps: u32,
) -> End<S> {
    solver.solve(model, &[SolveJob { state, strain, ramp_steps, counts_work: false }]).pop().unwrap().unwrap()
}

/// Whatever the skin, and so however often the pair list is renewed, the end state has the same bits.
#[test]
fn pair_list_cannot_reach_the_result() {
    let (model, state) = hundred_discs(RveOptions::default());
    let strain = [[0.01, 2e-3], [2e-3, -0.02]];
    let end_with = |skin: f64| {
        let mut solver = Solver::new(LAW);
        solver.skin_in_radii = Some(skin);
        let end = solved(&mut solver, &model, &state, strain, 2_000);
        (end, solver.single.as_ref().unwrap().listed())
    };
    let (usual, pairs) = end_with(0.05);
    for skin in [0.002, 0.02, 0.5] {
        let (other, other_pairs) = end_with(skin);
        assert_ne!(other_pairs, pairs, "skin {skin} lists other pairs");
        assert!(other == usual, "skin {skin} changed the state");
    }
}

/// A solver that has done other work before answers with the same bits as a new one.
#[test]
fn used_working_memory_leaves_no_trace() {
    let (model, state) = hundred_discs(RveOptions::default());
    let strain = [[1e-3, 0.0], [0.0, -2e-3]];
    let expected = solved(&mut Solver::new(LAW), &model, &state, strain, 200);
    let mut used = Solver::new(LAW);
    solved(&mut used, &model, &state, [[-0.02, 0.0], [0.0, 0.03]], 300);
    assert!(solved(&mut used, &model, &state, strain, 200) == expected);
}

/// Twelve different ways: directions, lengths, numbers of ramp steps.
fn ways() -> Vec<(Plane, u32)> {
    (0..12)
        .map(|way| {
            let angle = 0.7 * f64::from(way);
            let size = 5e-4 * (1.0 + 0.25 * f64::from(way));
            let (a, b) = (size * angle.cos(), size * angle.sin());
            ([[a, b], [b, -a - 0.1 * size]], 20 + 11 * way as u32)
        })
        .collect()
}

type Ends = Vec<Result<End<Discs>, RveError>>;

fn ends(
    solver: &mut Solver,
    model: &GrainModel,
    state: &GrainState,
    ways: &[(Plane, u32)],
    backend: Backend,
) -> Ends {
    let jobs: Vec<_> =
        ways.iter().map(|&(strain, ramp_steps)| SolveJob { state, strain, ramp_steps, counts_work: false }).collect();
    let setting = Setting { backend, ..Setting::of(model, &LAW) };
    solver.solve_in(&setting, &jobs)
}

fn one_by_one(model: &GrainModel, state: &GrainState, ways: &[(Plane, u32)]) -> Ends {
    let mut solver = Solver::new(LAW);
    solver.uses_lanes = false;
    ends(&mut solver, model, state, ways, Backend::best())
}

/// With every damping and criterion: twelve cells through eight lanes, recycled and handed over to the single kernel at
/// the end, have the bits that each has alone.
#[test]
fn batch_mates_cannot_reach_the_result() {
    let rules = [
        (Damping::Fire, Criterion::MaxForce),
        (Damping::Local, Criterion::RmsForce),
        (Damping::Viscous, Criterion::Energy),
        (Damping::Kinetic, Criterion::MaxForce),
        (Damping::Adaptive, Criterion::MaxForce),
    ];
    for (damping, criterion) in rules {
        let tolerance = Some(if criterion == Criterion::Energy { 1e-6 } else { 1e-3 });
        let options = RveOptions { damping, criterion, tolerance, ..RveOptions::default() };
        let (model, state) = hundred_discs(options);
        let mut ways = ways();
        let expected = one_by_one(&model, &state, &ways);
        for end in expected.iter().flatten() {
            assert!(end.solved.equilibrated, "{damping:?} needs more than {} steps", end.solved.force_evaluations);
        }
        let mut solver = Solver::new(LAW);
        assert!(ends(&mut solver, &model, &state, &ways, Backend::best()) == expected, "{damping:?}");
        // Others next to it, in another order, in lanes that have been used.
        ways.reverse();
        ways.extend_from_within(..2);
        let others = ends(&mut solver, &model, &state, &ways, Backend::best());
        assert!(others.iter().take(12).rev().eq(&expected), "{damping:?} reversed");
        assert!(others[12..] == others[..2], "{damping:?} repeated");
    }
}

/// Lanes far apart from each other need a longer common list, which is cut down again; no bit changes.
#[test]
fn lanes_that_drift_apart_keep_their_bits() {
    let (model, state) = hundred_discs(RveOptions { tolerance: Some(1e-2), ..RveOptions::default() });
    let ways: Vec<(Plane, u32)> =
        ways().into_iter().map(|(strain, _)| (strain.map(|row| row.map(|v| 60.0 * v)), 300)).collect();
    let expected = one_by_one(&model, &state, &ways);
    let mut solver = Solver::new(LAW);
    assert!(ends(&mut solver, &model, &state, &ways, Backend::best()) == expected);
    let far: Vec<_> = expected.iter().map(|end| end.as_ref().unwrap().state.clone()).collect();
    let back: Vec<_> = far
        .iter()
        .map(|state| SolveJob { state, strain: [[2e-4, 0.0], [0.0, 1e-4]], ramp_steps: 30, counts_work: false })
        .collect();
    let setting = Setting::of(&model, &LAW);
    let together = solver.solve_in(&setting, &back);
    solver.uses_lanes = false;
    let alone: Ends = back.iter().flat_map(|job| solver.solve_in(&setting, &[*job])).collect();
    assert!(together == alone);
}

/// S-15: every set of instructions that this processor has, and software arithmetic, give the same bits.
#[test]
fn instruction_sets_cannot_reach_the_result() {
    let (model, state) = hundred_discs(RveOptions::default());
    let ways = &ways()[..4];
    let expected = one_by_one(&model, &state, ways);
    for backend in Backend::ALL.into_iter().filter(|backend| backend.is_available()) {
        for uses_lanes in [false, true] {
            let mut solver = Solver::new(LAW);
            solver.uses_lanes = uses_lanes;
            let quantity = if uses_lanes {
                "end states of cells in vector lanes, every set of instructions, against single cells"
            } else {
                "end states of single cells, every set of instructions, against the best one"
            };
            Claim::of("S-15", quantity).holds(ends(&mut solver, &model, &state, ways, backend) == expected);
        }
    }
}

/// A cell that blows up is an error of its own; its batch mates do not notice.
#[test]
fn broken_cell_does_not_harm_its_mates() {
    let (model, state) = hundred_discs(RveOptions::default());
    let ways = &ways()[..4];
    let expected = one_by_one(&model, &state, ways);
    let mut broken = state.clone();
    broken.positions[17][0] = f64::NAN;
    let mut jobs: Vec<_> = ways
        .iter()
        .map(|&(strain, ramp_steps)| SolveJob { state: &state, strain, ramp_steps, counts_work: false })
        .collect();
    jobs.insert(2, SolveJob { state: &broken, ..jobs[0] });
    let mut found = Solver::new(LAW).solve_in(&Setting::of(&model, &LAW), &jobs);
    assert!(matches!(found.remove(2), Err(RveError::NotFinite { .. })));
    assert!(found == expected);
}

/// A cubic crystal of spheres, pushed out of place at random but touching: 64 grains of two sizes.
fn spheres() -> (GrainModel, GrainState<Spheres>) {
    let mut grains = Vec::new();
    for number in 0..64usize {
        let shake = |axis: usize| 0.04 * ((number * 7 + axis * 13) as f64 * 1.7).sin();
        let at = |axis: usize| ((number / 4usize.pow(axis as u32)) % 4) as f64 + shake(axis);
        grains.push([1e-3 * at(0), 1e-3 * at(1), 1e-3 * at(2), 1e-3 * (0.52 + 0.03 * ((number % 3) as f64))]);
    }
    let edge = 3.95e-3;
    let packing = PackingFile::<Spheres> {
        format: PackingFile::<Discs>::FORMAT.into(),
        version: PackingFile::<Discs>::VERSION,
        dimension: 3,
        thickness: 1.0,
        periodicity: [[edge, 0.0, 0.0], [0.0, edge, 0.0], [0.0, 0.0, edge]],
        grains,
        contacts: Vec::new(),
        rolling_moments: Vec::new(),
        provenance: serde_json::Value::Null,
    };
    let contact = ContactTable::linear(1.0, 0.5, 0.5);
    let options = RveOptions { tolerance: Some(1e-2), ..RveOptions::default() };
    let definition = GrainDefinition { packing, contact, options };
    let model = GrainModel::new(&definition).unwrap();
    let state = model.initial_state(&definition);
    (model, state)
}

/// In space too, with laws that remember overlaps and rolling moments, and with viscosity: five cells in lanes have the
/// bits of five single cells, and go on from their states with the same bits.
fn check_lanes_in_space<L: ContactLaw<<Spheres as Space>::Kernel>>(law: L, is_viscous: bool) {
    let (model, state) = spheres();
    let model = GrainModel { is_viscous, ..model };
    let strains: Vec<_> = (0..5)
        .map(|way| {
            let (a, b) = (1e-3 * f64::from(way).sin(), 1e-3 * f64::from(way).cos());
            [[a, b, 0.0], [b, -2e-3, a], [0.0, a, -b]]
        })
        .collect();
    let jobs: Vec<_> = strains
        .iter()
        .map(|&strain| SolveJob { state: &state, strain, ramp_steps: 40, counts_work: false })
        .collect();
    let mut together = RelaxationSolver::new(law);
    let found = together.solve(&model, &jobs);
    let mut alone = RelaxationSolver::new(law);
    alone.uses_lanes = false;
    assert!(alone.solve(&model, &jobs) == found);
    let states: Vec<_> = found.iter().map(|end| &end.as_ref().unwrap().state).collect();
    assert!(states[0].contacts.len() > 100);
    let jobs: Vec<_> = states
        .iter()
        .map(|state| SolveJob { state, strain: strains[3], ramp_steps: 20, counts_work: false })
        .collect();
    assert!(alone.solve(&model, &jobs) == together.solve(&model, &jobs));
}

#[test]
fn lanes_of_spheres_have_the_bits_of_single_cells() {
    let springs = HertzSprings { shear_modulus: 1e9, poisson_ratio: 0.2 };
    let rolling = RollingSpring { stiffness: 0.3, friction: 0.1 };
    let unloading = TangentialUnloading::Rescaled;
    check_lanes_in_space(
        PlainHertzMindlin { springs, friction: 0.5, cohesion: 0.0, unloading, rolling, viscosity: 0.0 },
        false,
    );
    check_lanes_in_space(
        ExtendedHertzMindlin { springs, friction: 0.5, cohesion: 1e-6, unloading, rolling, viscosity: 0.05 },
        true,
    );
}
