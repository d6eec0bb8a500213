//! A dynamic run that was interrupted goes on to the same bits.

use super::*;
use crate::checkpoint::{Archive, CheckpointStore, Progress};
use crate::nonlocal::{Kernel, NonlocalSettings, Update};
use crate::problem::MultiPointConstraint;
use crate::problem::dynamics::RayleighDamping;
use crate::solve::solve_with_checkpoints;

/// Keeps every archive, and hands one back.
#[derive(Default)]
struct Shelf {
    kept: Vec<Archive>,
    earlier: Option<Archive>,
}

impl CheckpointStore for Shelf {
    fn earlier(&mut self) -> Option<Archive> {
        self.earlier.take()
    }

    fn save_step(&mut self, _mark: Progress, fill: &mut dyn FnMut(&mut Archive)) {
        let mut archive = Archive::new();
        fill(&mut archive);
        self.kept.push(archive);
    }
}

/// Two dynamic stages with dampers, absorbing sides, ties, softening and a staggered average: all that is remembered.
fn two_stages() -> Problem {
    let mut settings = settings(2.0);
    settings.damping = RayleighDamping { mass: 0.01, stiffness: 0.02 };
    settings.absorbing = vec!["right".into()];
    settings.reporting = Reporting::Interval(1.7);
    settings.tangent_every = 7;
    let push = moved("left", Axis::X, -0.01, Amplitude::RAMP);
    let level = MultiPointConstraint::Periodic { from: "bottom".into(), to: "top".into(), jump: [None, None, None] };
    let conditions = vec![push, held("bottom", Axis::Y), Condition::MultiPointConstraint(level).into()];
    let mut problem = problem(strip(ElementKind::Q4Single, 6, 1.0), conditions, 12.0, settings);
    problem.formulation = Formulation::Corotational;
    problem.stages[0].nonlocal = Some(NonlocalSettings {
        radius: 2.2,
        kernel: Kernel::Wendland,
        update: Update::Staggered,
        ..NonlocalSettings::default()
    });
    let mut second = problem.stages[0].clone();
    second.name = "again".into();
    problem.stages.push(second);
    problem
}

#[test]
fn an_interrupted_dynamic_run_ends_in_the_same_bits() {
    let problem = two_stages();
    let law = DamageLaw { lambda: 1.0, shear: 1.0, threshold: 1e-3, softening: 1e-2 };
    let material = || DamageMaterial::new(vec![law; problem.point_count()]);
    let mut whole = (Film::default(), Shelf::default());
    let run = solve_with_checkpoints(&problem, &mut material(), &mut whole.0, &mut whole.1);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    assert_eq!(whole.1.kept.len(), whole.0.instants.len());
    // The starts of both stages are counted, each in the first report behind it or about it.
    assert_eq!(whole.0.instants.iter().map(|instant| instant.evaluations).sum::<u64>(), run.statistics.evaluations);
    let ends = whole.0.last();
    assert!(ends.points.iter().any(|point| point.stress.get(0, 0) != 0.0));
    for (number, archive) in whole.1.kept.iter().enumerate() {
        let mut film = Film::default();
        let mut shelf = Shelf { earlier: Some(archive.clone()), ..Shelf::default() };
        let again = solve_with_checkpoints(&problem, &mut material(), &mut film, &mut shelf);
        assert!(matches!(again.outcome, Outcome::Completed), "{:?}", again.outcome);
        assert_eq!(film.instants.len(), whole.0.instants.len() - number - 1);
        for (one, other) in film.instants.iter().zip(&whole.0.instants[number + 1..]) {
            assert!(one.points == other.points, "points at {} s, from report {number}", one.time);
        }
        if let Some(last) = film.instants.last() {
            assert_eq!(last.displacements, ends.displacements, "from report {number}");
            assert_eq!(last.velocities, ends.velocities);
            assert_eq!(last.reactions, ends.reactions);
            assert_eq!(last.energy, ends.energy);
        }
        assert_eq!(again.statistics.evaluations, run.statistics.evaluations);
    }
}
