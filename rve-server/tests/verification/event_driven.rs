//! The event-driven solver against tight relaxation.

use crate::samples::{packing, sand};
use protocol::{Observables, Observed, RveSolver, Tensor2, TrialFlags, TrialOptions, TrialRequest, TrialResult};
use rve_server::cell::GrainState;
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, GrainModel, RveOptions, SolverName};
use rve_server::engine::GrainRve;
use rve_server::solver::{AnsweredBy, SolveJob, SolverFor};
use rve_server::space::Discs;
use rve_server::space::plane::{self, Plane};
use rve_server::tangent::network::NetworkResponses;

fn definition(name: &str, options: RveOptions) -> GrainDefinition {
    GrainDefinition { packing: packing(name), contact: sand(), options }
}

fn event_driven() -> RveOptions {
    RveOptions { solver: SolverName::EventDriven, ..RveOptions::default() }
}

fn tight() -> RveOptions {
    RveOptions { strain_per_step: Some(1e-7), tolerance: Some(1e-8), ..RveOptions::default() }
}

/// Increments of a pure shear `amplitude sin(2 pi t)`, 40 a cycle.
fn cyclic(amplitude: f64, cycles: usize) -> Vec<Plane> {
    let at = |step: usize| 0.5 * amplitude * (std::f64::consts::TAU * step as f64 / 40.0).sin();
    let increment = |step: usize| at(step + 1) - at(step);
    (0..40 * cycles).map(|step| [[0.0, increment(step)], [increment(step), 0.0]]).collect()
}

#[derive(Debug, Default)]
struct Counts {
    evaluations: u64,
    elastic: u64,
    events: u64,
    handed_over: u64,
}

/// Stresses, Pa, after each increment, each committed; the last state.
fn run(name: &str, options: RveOptions, start: &GrainState, path: &[Plane]) -> (Vec<Plane>, Counts, GrainState) {
    let definition = definition(name, options);
    let model = GrainModel::new(&definition).unwrap();
    let mut solver = Discs::solver(definition.options.solver, &definition.contact).unwrap();
    solver.use_responses(Box::new(NetworkResponses::default()));
    let mut state = start.clone();
    let (mut counts, mut stresses) = (Counts::default(), Vec::new());
    for strain in path {
        let largest = strain.iter().flatten().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let ramp_steps = ((largest / definition.options.strain_per_step()).ceil() as u32).max(5);
        let end = solver
            .solve_one(&model, SolveJob { state: &state, strain: *strain, ramp_steps, counts_work: false })
            .unwrap();
        counts.evaluations += end.solved.force_evaluations;
        counts.elastic += u64::from(end.solved.answered_by == AnsweredBy::Elastic);
        counts.events += u64::from(end.solved.answered_by == AnsweredBy::Events);
        counts.handed_over += u64::from(end.solved.answered_by == AnsweredBy::HandedOver);
        stresses.push(solver.network(&model, &end).stress());
        state = end.state;
    }
    (stresses, counts, state)
}

/// Largest difference of stresses over the pressure of the packings.
fn distance(a: &[Plane], b: &[Plane]) -> f64 {
    let of = |a: &Plane, b: &Plane| {
        let sum: f64 = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b) * (a - b)).sum();
        sum.sqrt() / 1e5
    };
    a.iter().zip(b).map(|(a, b)| of(a, b)).fold(0.0, f64::max)
}

/// The packing after a biaxial compression to this axial strain.
fn loaded(name: &str, strain: f64) -> GrainState {
    let cell = GrainRve::new(&definition(name, tight())).unwrap();
    let path: Vec<Plane> = (0..20).map(|_| [[0.25 * strain / 20.0, 0.0], [0.0, -strain / 20.0]]).collect();
    if strain > 0.0 { run(name, tight(), cell.committed(), &path).2 } else { cell.committed().clone() }
}

/// Increments of up to `largest` in no regular order.
fn irregular(largest: f64, count: usize) -> Vec<Plane> {
    let value = |place: f64| largest * (place * place * std::f64::consts::GOLDEN_RATIO).sin();
    let increment = |step: usize| {
        let [a, b, c] = [0.0, 1.0, 2.0].map(|offset| value(3.0 * step as f64 + offset + 1.0));
        [[a, c], [c, b]]
    };
    (0..count).map(increment).collect()
}

/// The same increments in a turned frame.
fn seen_from(path: &[Plane], turn: &Plane) -> Vec<Plane> {
    path.iter().map(|h| rve_server::space::rotated(h, turn)).collect()
}

fn advance(cell: &mut GrainRve, h: Plane) -> TrialResult {
    let answer = cell.trial(&Tensor2::from_plane(h), &TrialOptions::default()).unwrap();
    cell.commit().unwrap();
    answer
}

#[test]
fn small_increments_agree_with_tight_relaxation() {
    for name in ["discs-100.json", "discs-400.json", "discs-400-dense.json"] {
        let fresh = loaded(name, 0.0);
        let compressed = loaded(name, 2e-4);
        let back: Vec<Plane> = (0..20).map(|_| [[-1e-6, 0.0], [0.0, 4e-6]]).collect();
        let reversed = run(name, tight(), &compressed, &back).2;
        let shaken = run(name, tight(), &compressed, &cyclic(1e-5, 2)).2;
        for (history, start) in
            [("fresh", fresh), ("compressed", compressed), ("reversed", reversed), ("shaken", shaken)]
        {
            let path = irregular(1e-6, 20);
            let (reference, ..) = run(name, tight(), &start, &path);
            let (stresses, counts, end) = run(name, event_driven(), &start, &path);
            let error = distance(&stresses, &reference);
            assert!(error < 3e-5, "{name}, {history}: {error:e}, {counts:?}");
            assert!(end.unbalanced <= 1e-4, "{name}, {history}: {}", end.unbalanced);
            assert!(counts.elastic + counts.events >= 10, "{name}, {history}: {counts:?}");
            assert_eq!(counts.elastic + counts.events + counts.handed_over, 20);
        }
    }
}

#[test]
fn cycles_after_shakedown_cost_a_tenth_of_the_evaluations() {
    let name = "discs-100.json";
    let start = run(name, tight(), &loaded(name, 0.0), &cyclic(1e-5, 2)).2;
    let path = cyclic(1e-5, 2);
    let (_, relaxation, _) = run(name, RveOptions::default(), &start, &path);
    let (_, counts, _) = run(name, event_driven(), &start, &path);
    assert!(10 * counts.evaluations < relaxation.evaluations, "{counts:?} {relaxation:?}");
    assert!(counts.elastic >= 70, "{counts:?}");
}

#[test]
fn stresses_do_not_drift_over_hundreds_of_cycles() {
    let name = "discs-100.json";
    let start = run(name, tight(), &loaded(name, 0.0), &cyclic(1e-5, 2)).2;
    let path = cyclic(1e-5, 300);
    let (stresses, counts, end) = run(name, event_driven(), &start, &path);
    let (first, last) = (stresses[39], stresses[path.len() - 1]);
    assert!(distance(&[first], &[last]) < 1e-5, "{first:?} {last:?}");
    assert!(end.unbalanced <= 1e-4 && counts.handed_over == 0, "{counts:?}");
    // A tight relaxation finds the same stress at the end.
    let still = [[[1e-12, 0.0], [0.0, 0.0]]];
    let (relaxed, ..) = run(name, tight(), &end, &still);
    assert!(distance(&relaxed, &[last]) < 1e-5, "{relaxed:?} {last:?}");
}

#[test]
fn answers_are_a_function_of_the_committed_state() {
    let definition = definition("discs-100.json", event_driven());
    let path: Vec<Plane> = [cyclic(1e-4, 1), irregular(1e-6, 20)].concat();
    let mut cell = GrainRve::new(&definition).unwrap();
    let mut states = Vec::new();
    for h in &path {
        let mut before = Vec::new();
        cell.snapshot(&mut before);
        // A rejected trial leaves nothing behind.
        cell.trial(&Tensor2::from_plane([[3e-6, 1e-6], [1e-6, 0.0]]), &TrialOptions::default()).unwrap();
        let answer = advance(&mut cell, *h);
        states.push((before, answer));
    }
    let mut last = Vec::new();
    cell.snapshot(&mut last);
    // Another worker, which has not seen the way: from the middle, and asked for many states at once.
    let mut other = GrainRve::new(&definition).unwrap();
    other.restore(&states[30].0).unwrap();
    for h in &path[30..] {
        advance(&mut other, *h);
    }
    let mut again = Vec::new();
    other.snapshot(&mut again);
    assert_eq!(last, again);
    let question = |((state, _), h): (&(Vec<u8>, TrialResult), &Plane)| {
        let target = Tensor2::from_plane(*h);
        (state.clone(), target)
    };
    let questions: Vec<_> = states.iter().zip(&path).map(question).collect();
    let options = TrialOptions::default();
    let requests: Vec<TrialRequest<'_>> = questions
        .iter()
        .map(|(state, target)| TrialRequest { definition: other.definition_id(), state, target: *target, options })
        .collect();
    for (answer, (_, expected)) in other.solve_batch(&requests).into_iter().zip(&states) {
        let (answer, _) = answer.unwrap();
        assert_eq!((answer.stress, answer.flags), (expected.stress, expected.flags));
    }
}

#[test]
fn answers_are_objective() {
    let definition = definition("discs-100.json", event_driven());
    let path = [irregular(1e-6, 10), cyclic(1e-5, 1)].concat();
    let (mut fixed, mut turning) = (GrainRve::new(&definition).unwrap(), GrainRve::new(&definition).unwrap());
    let turn = plane::rotation(0.7);
    let mut worst = 0.0_f64;
    for (step, (h, turned)) in path.iter().zip(seen_from(&path, &turn)).enumerate() {
        let answer = advance(&mut fixed, *h).stress.plane();
        // From the fifth increment on in a frame that has turned with it.
        let other = match step {
            0..4 => *h,
            4 => {
                let stretched = [[1.0 + h[0][0], h[0][1]], [h[1][0], 1.0 + h[1][1]]];
                let f = rve_server::space::product(&turn, &stretched);
                [[f[0][0] - 1.0, f[0][1]], [f[1][0], f[1][1] - 1.0]]
            }
            _ => turned,
        };
        let seen = advance(&mut turning, other).stress.plane();
        let expected = if step < 4 { answer } else { rve_server::space::rotated(&answer, &turn) };
        worst = worst.max(distance(&[seen], &[expected]));
    }
    assert!(worst < 2e-6, "{worst:e}");
}

#[test]
fn what_it_cannot_do_is_done_by_relaxation_and_said() {
    let handed_over = |contact: ContactTable, h: Plane| {
        let definition = |solver| GrainDefinition {
            packing: packing("discs-100.json"),
            contact: contact.clone(),
            options: RveOptions { solver, ..RveOptions::default() },
        };
        let mut cell = GrainRve::new(&definition(SolverName::EventDriven)).unwrap();
        let mut relaxed = GrainRve::new(&definition(SolverName::Relaxation)).unwrap();
        let answer = advance(&mut cell, h);
        assert_eq!(answer.stress, advance(&mut relaxed, h).stress);
        assert!(answer.flags.contains(TrialFlags::HANDED_OVER), "{contact:?}");
    };
    let small = [[1e-7, 0.0], [0.0, 0.0]];
    handed_over(sand(), [[1e-4, 0.0], [0.0, 0.0]]);
    handed_over(ContactTable { rolling_stiffness: 0.1, rolling_friction: 0.1, ..sand() }, small);
    handed_over(ContactTable { damping: 0.1, ..sand() }, small);
    let mut cell = GrainRve::new(&definition("discs-100.json", event_driven())).unwrap();
    let answer = advance(&mut cell, small);
    assert!(!answer.flags.contains(TrialFlags::HANDED_OVER), "{:?}", answer.flags);
    let still = cell.trial(&Tensor2::ZERO, &TrialOptions::default()).unwrap();
    assert_eq!(still.flags, TrialFlags::SKIPPED_NULL_TARGET);
}

#[test]
fn spheres_are_handed_over() {
    let definition = GrainDefinition {
        packing: crate::samples::packing_of::<rve_server::space::Spheres>("spheres-100.json"),
        contact: sand(),
        options: event_driven(),
    };
    let mut cell = GrainRve::new(&definition).unwrap();
    let mut target = Tensor2::ZERO;
    target.0[0] = 1e-7;
    let answer = cell.trial(&target, &TrialOptions::default()).unwrap();
    assert!(answer.flags.contains(TrialFlags::HANDED_OVER));
}

/// `rve.largest_event_increment`: larger strain components go to relaxation.
#[test]
fn increments_above_the_largest_one_are_handed_over() {
    let start = loaded("discs-100.json", 0.0);
    let path: Vec<Plane> = [1e-6, 8e-6, 2e-5].map(|strain| [[0.0, 0.0], [0.0, -strain]]).to_vec();
    for (largest, handed_over) in [(None, 1), (Some(2e-6), 2), (Some(1e-4), 0)] {
        let options = RveOptions { largest_event_increment: largest, ..event_driven() };
        assert_eq!(run("discs-100.json", options, &start, &path).1.handed_over, handed_over, "{largest:?}");
    }
}

/// A packing of another law: what its grains lose on their way to equilibrium was in no account, 12 of 16 J/m3 of a whole test.
#[test]
fn a_packing_out_of_balance_comes_to_rest_by_relaxation_and_its_energy_balance_closes() {
    let mut definition = definition("discs-100.json", event_driven());
    definition.contact.cohesion = 2e-6;
    let mut cell = GrainRve::<Discs>::new(&definition).unwrap();
    let options = TrialOptions { observables: Observables::ALL, ..TrialOptions::default() };
    let energies =
        |observed: &Observed| [observed.elastic_energy, observed.frictional_dissipation, observed.damping_work];
    let before = energies(&cell.observe(Observables::ALL).unwrap().observed);
    let answer = cell.trial(&Tensor2::from_plane([[0.0, 0.0], [0.0, -8e-6]]), &options).unwrap();
    assert!(answer.flags.contains(TrialFlags::HANDED_OVER), "{:?}", answer.flags);
    let [elastic, friction, damping] = energies(&answer.observed);
    let released = before[0] - elastic;
    assert!(released > 1.0 && damping + friction > 0.8 * released, "{released} {damping} {friction}");
    cell.commit().unwrap();
    let next = cell.trial(&Tensor2::from_plane([[0.0, 0.0], [0.0, -8e-6]]), &options).unwrap();
    assert!(!next.flags.contains(TrialFlags::HANDED_OVER), "at rest it answers itself: {:?}", next.flags);
}
