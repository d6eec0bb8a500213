//! A run that is continued after any of its steps ends in the same bits, whatever solves it and whatever is linked.

use super::stages::Shelf;
use super::*;
use crate::formulation::Formulation;
use crate::material::damage::{DamageLaw, DamageMaterial};
use crate::nonlocal::{NonlocalSettings, Update};
use crate::observer::Outcome;
use crate::problem::dynamics::{DynamicSettings, Reporting};
use crate::problem::relaxation::RelaxationSettings;
use crate::problem::{EquationSolver, MultiPointConstraint, Platen, PressureKind, Procedure};
use crate::solve::solve_with_checkpoints;

/// Continues a run after each of its steps.
fn assert_continues(problem: &Problem, what: &str) {
    let law = DamageLaw { lambda: 2.0e7, shear: 1.0e7, threshold: 1e-2, softening: 5e-2 };
    let material = || DamageMaterial::new(vec![law; problem.point_count()]);
    let (mut whole, mut shelf) = (Recorder::default(), Shelf::default());
    let undisturbed = solve_with_checkpoints(problem, &mut material(), &mut whole, &mut shelf);
    assert!(matches!(undisturbed.outcome, Outcome::Completed), "{what}: {:?}", undisturbed.outcome);
    assert!(shelf.kept.len() > 4 && whole.reactions.iter().flatten().any(|value| *value != 0.0), "{what}");
    let last = shelf.kept.len() - 1;
    for (mark, archive) in shelf.kept.into_iter().take(last) {
        let mut rest = Recorder::default();
        let mut shelf = Shelf { earlier: Some(archive), ..Shelf::default() };
        let resumed = solve_with_checkpoints(problem, &mut material(), &mut rest, &mut shelf);
        let what = format!("{what}, continued after step {} of stage {}", mark.step, mark.stage);
        assert!(matches!(resumed.outcome, Outcome::Completed), "{what}: {:?}", resumed.outcome);
        assert!(rest.steps[..] == whole.steps[mark.step as usize + 1..], "{what}: the steps differ");
        assert!(rest.displacements == whole.displacements, "{what}: displacements differ");
        assert!(rest.reactions == whole.reactions, "{what}: reactions differ");
        assert!(rest.points == whole.points, "{what}: points differ");
        assert_eq!(resumed.statistics.evaluations, undisturbed.statistics.evaluations, "{what}");
        let iterative = |run: &Run| (run.statistics.linear_iterations, run.statistics.direct_fallbacks);
        assert_eq!(iterative(&resumed), iterative(&undisturbed), "{what}");
    }
}

/// What holds and moves the head of the block.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Head {
    Platen,
    Tilting,
    Turned,
    Periodic,
}

impl Head {
    fn conditions(self, down: f64) -> Vec<Condition> {
        match self {
            Self::Platen => {
                let contact = Platen::Smooth;
                vec![Condition::Platen { nodes: "top".into(), contact, axis: Axis::Y, displacement: -down }]
            }
            Self::Tilting => {
                let link = MultiPointConstraint::TiltingPlaten {
                    nodes: "top".into(),
                    axis: Axis::Y,
                    displacement: Some(-down),
                    rotation: [None; 3],
                };
                vec![Condition::MultiPointConstraint(link)]
            }
            Self::Turned => vec![Condition::MultiPointConstraint(MultiPointConstraint::RigidBody {
                nodes: "top".into(),
                displacement: [None, Some(-down), None],
                rotation: [None, None, Some(20.0 * down)],
            })],
            Self::Periodic => {
                let link = MultiPointConstraint::Periodic {
                    from: "left".into(),
                    to: "right".into(),
                    jump: [None, Some(0.0), None],
                };
                let platen = Self::Platen.conditions(down);
                platen.into_iter().chain([Condition::MultiPointConstraint(link)]).collect()
            }
        }
    }
}

/// A block whose sides are not binary fractions, between its foot and a head that goes down, turns or tilts in each of the
/// stages, while it is pushed sideways.
fn squeezed(kind: ElementKind, formulation: Formulation, head: Head, procedures: &[Procedure]) -> Problem {
    let mesh = Block::plane([0.05, 0.07], [2, 3], kind).mesh().unwrap();
    let mut problem = Problem::new(mesh, Vec::new());
    problem.formulation = formulation;
    let dead = |sides: &str, value| Condition::Pressure { sides: sides.into(), value, kind: PressureKind::Dead };
    problem.stages = procedures
        .iter()
        .enumerate()
        .map(|(number, procedure)| {
            let mut conditions = vec![
                Condition::fixed("bottom", Axis::X),
                Condition::fixed("bottom", Axis::Y),
                Condition::BodyForce { elements: "all".into(), value: [1e5, 0.0, 0.0] },
            ];
            if head != Head::Periodic {
                conditions.push(dead("right", 2e4));
            }
            conditions.extend(head.conditions(1e-4));
            let mut stage = Stage::new(format!("{number}"), conditions.into_iter().map(Into::into).collect());
            (stage.control.increments, stage.duration) = (3, 2e-3);
            stage.tolerances = Tolerances::both(1e-6, 1e-6);
            stage.procedure = procedure.clone();
            stage
        })
        .collect();
    problem
}

fn motion() -> Procedure {
    let mut settings = DynamicSettings::new(2e3);
    settings.reporting = Reporting::Interval(7e-4);
    settings.damping.mass = 500.0;
    Procedure::Dynamic(Box::new(settings))
}

#[test]
fn implicit_stages_with_links_go_on_to_the_same_bits() {
    let twice = [Procedure::Implicit, Procedure::Implicit];
    for head in [Head::Tilting, Head::Turned, Head::Periodic] {
        for (kind, formulation) in [
            (ElementKind::Q4, Formulation::UpdatedLagrangian),
            (ElementKind::Q8, Formulation::TotalLagrangian),
            (ElementKind::Q4Single, Formulation::Corotational),
            (ElementKind::Q4, Formulation::SmallStrain),
        ] {
            assert_continues(&squeezed(kind, formulation, head, &twice), &format!("{head:?} {kind:?}"));
        }
    }
}

/// The counts of the iterative way began again at 0.
#[test]
fn iterative_equations_go_on_to_the_same_bits_and_counts() {
    let twice = [Procedure::Implicit, Procedure::Implicit];
    let mut problem = squeezed(ElementKind::Q4, Formulation::UpdatedLagrangian, Head::Platen, &twice);
    problem.equations = EquationSolver::Iterative;
    assert_continues(&problem, "iterative equations");
}

#[test]
fn dynamic_stages_go_on_to_the_same_bits_from_their_first_instant_on() {
    let twice = [motion(), motion()];
    for head in [Head::Platen, Head::Tilting, Head::Turned, Head::Periodic] {
        for formulation in [Formulation::UpdatedLagrangian, Formulation::Corotational, Formulation::SmallStrain] {
            let problem = squeezed(ElementKind::Q4Single, formulation, head, &twice);
            assert_continues(&problem, &format!("{head:?} {formulation:?}"));
        }
    }
}

#[test]
fn stages_of_all_procedures_go_on_to_the_same_bits() {
    let relaxation = || Procedure::Relaxation(RelaxationSettings::default());
    for kind in [ElementKind::Q4Single, ElementKind::Q8] {
        let procedures = [relaxation(), Procedure::Implicit, motion(), relaxation()];
        let problem = squeezed(kind, Formulation::Corotational, Head::Platen, &procedures);
        assert_continues(&problem, &format!("{kind:?}"));
    }
    let linked = [Procedure::Implicit, motion(), Procedure::Implicit];
    assert_continues(
        &squeezed(ElementKind::Q4, Formulation::UpdatedLagrangian, Head::Turned, &linked),
        "motion between",
    );
}

/// Averages that begin, change their radius and end with a stage.
#[test]
fn stages_with_other_averages_go_on_to_the_same_bits() {
    let relaxation = || Procedure::Relaxation(RelaxationSettings::default());
    let orders = [
        vec![Procedure::Implicit, Procedure::Implicit, Procedure::Implicit, Procedure::Implicit],
        vec![relaxation(), Procedure::Implicit, motion(), Procedure::Implicit],
    ];
    for procedures in &orders {
        for (kind, formulation, adjoint) in [
            (ElementKind::Q4Single, Formulation::Corotational, false),
            (ElementKind::Q4, Formulation::Corotational, true),
            (ElementKind::Q4, Formulation::SmallStrain, false),
        ] {
            let mut problem = squeezed(kind, formulation, Head::Platen, procedures);
            let radii = [None, Some(0.04), Some(0.06), None];
            for (stage, radius) in problem.stages.iter_mut().zip(radii) {
                let update = Update::Staggered;
                stage.nonlocal =
                    radius.map(|radius| NonlocalSettings { radius, adjoint, update, ..NonlocalSettings::default() });
            }
            assert_continues(&problem, &format!("{kind:?} {formulation:?} adjoint {adjoint}"));
        }
    }
}
