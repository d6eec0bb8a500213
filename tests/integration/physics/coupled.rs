//! Elements and grains together, against the grains alone.
//!
//! One Q4 element under biaxial compression with a cell pressure must repeat what a single RVE answers when it is driven
//! by the same deformation (check I-1), a patch of equal elements under homogeneous conditions must stay homogeneous
//! (I-2), and the work of the boundary forces must equal the stress work of the Gauss points and what their grains store
//! and lose (I-10).

use claims::Claim;
use macro_solver::formulation::Formulation;
use macro_solver::formulation::tensor::matrix;
use macro_solver::mesh::ElementKind;
use macro_solver::mesh::block::Block;
use macro_solver::observer::{FieldsView, Observer, Outcome, StepReport, StopRequest};
use macro_solver::problem::dynamics::{DynamicSettings, RayleighDamping, Reporting};
use macro_solver::problem::relaxation::RelaxationSettings;
use macro_solver::problem::{Axis, Condition, NamedStrategy, Platen, PressureKind, Problem, Procedure};
use protocol::{Definition, Observables, RveEngine, TangentKind, Tensor2, TrialOptions};
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainEngine;
use std::path::Path;

use crate::in_process::solved_in_process;

const PRESSURE: f64 = 1e5;

fn definition() -> Definition {
    let packing: PackingFile = PackingFile::read(Path::new("packings/discs-100.json")).unwrap();
    let contact = toml::from_str("law = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5").unwrap();
    let options: RveOptions = toml::from_str("accuracy = \"draft\"").unwrap();
    GrainDefinition { packing, contact, options }.validate().unwrap().to_protocol()
}

/// One Gauss point after one accepted step.
#[derive(Clone, Copy)]
struct Sample {
    step_gradient: Tensor2,
    deformation: Tensor2,
    stress: Tensor2,
    volume: f64,
    /// Elastic energy and work lost in friction, J/m3; 0 if not asked for.
    elastic: f64,
    lost: f64,
}

/// Keeps what the checks need.
#[derive(Default)]
struct Recorder {
    samples: Vec<Vec<Sample>>,
    displacements: Vec<Vec<[f64; 3]>>,
    forces: Vec<Vec<[f64; 3]>>,
    top_reaction: Vec<f64>,
    width: Vec<f64>,
    evaluations: u64,
}

impl Observer for Recorder {
    fn accepted(&mut self, _: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        let sample = |point: &macro_solver::observer::PointFields| Sample {
            step_gradient: point.step_gradient,
            deformation: point.deformation,
            stress: point.stress,
            volume: point.volume,
            elastic: point.observed.elastic_energy,
            lost: point.observed.frictional_dissipation,
        };
        self.samples.push(fields.points.iter().map(sample).collect());
        self.displacements.push(fields.displacements.to_vec());
        let total =
            |(reaction, load): (&[f64; 3], &[f64; 3])| std::array::from_fn(|axis| reaction[axis] + load[axis]);
        self.forces.push(fields.reactions.iter().zip(fields.loads).map(total).collect());
        let top = &fields.mesh.node_sets["top"];
        self.top_reaction.push(top.iter().map(|node| fields.reactions[*node][1]).sum());
        let x = |name: &str| {
            let node = fields.mesh.node_sets[name][0];
            fields.mesh.nodes[node][0] + fields.displacements[node][0]
        };
        self.evaluations = fields.statistics.evaluations;
        self.width.push(x("top_right") - x("top_left"));
        Ok(())
    }
}

/// Biaxial compression of a block of Q4 elements, 1 m by 1 m, to the axial strain given. `strain_per_step` 0 lets each cell
/// choose its ramp from its own target, so that a cell driven alone chooses the same.
fn biaxial(columns: usize, rows: usize, strain: f64, increments: usize, strain_per_step: f64) -> (Outcome, Recorder) {
    solved(biaxial_problem(ElementKind::Q4, [columns, rows], strain, increments, strain_per_step))
}

fn biaxial_problem(
    kind: ElementKind,
    elements: [usize; 2],
    strain: f64,
    increments: usize,
    strain_per_step: f64,
) -> Problem {
    let mesh = Block::plane([1.0, 1.0], elements, kind).mesh().unwrap();
    let platen = |nodes: &str, displacement: f64| Condition::Platen {
        nodes: nodes.into(),
        contact: Platen::Smooth,
        axis: Axis::Y,
        displacement,
    };
    let pressure =
        |sides: &str| Condition::Pressure { sides: sides.into(), value: PRESSURE, kind: PressureKind::Follower };
    let conditions = vec![
        platen("bottom", 0.0),
        platen("top", -strain),
        Condition::fixed("bottom_left", Axis::X),
        pressure("left"),
        pressure("right"),
    ];
    let mut problem = Problem::new(mesh, conditions);
    problem.stages[0].control.increments = increments;
    problem.stages[0].tolerances.force = 1e-4;
    problem.strain_per_step = strain_per_step;
    problem
}

/// Solves with one worker in this process.
fn solved(problem: Problem) -> (Outcome, Recorder) {
    let mut recorder = Recorder::default();
    let run = solved_in_process(&problem, definition(), &mut recorder);
    (run.outcome, recorder)
}

/// Check I-7. Newton's method, dynamic relaxation and a slow damped motion agree before the peak, within 1 % of the stress ratio; what
/// each costs is asserted as an order.
#[test]
fn three_procedures_agree_on_a_biaxial_test() {
    let run = |procedure: Procedure, formulation: Formulation| {
        let mut problem = biaxial_problem(ElementKind::Q4Single, [1, 1], 1e-3, 2, 5e-6);
        problem.formulation = formulation;
        problem.stages[0].tolerances.force = 1e-3;
        problem.stages[0].procedure = procedure;
        let (outcome, record) = solved(problem);
        assert!(matches!(outcome, Outcome::Completed), "{outcome:?}");
        (record.top_reaction.last().unwrap() / record.width.last().unwrap() / -PRESSURE, record.evaluations)
    };
    let (newton, few) = run(Procedure::Implicit, Formulation::UpdatedLagrangian);
    let (relaxed, many) = run(Procedure::Relaxation(RelaxationSettings::default()), Formulation::UpdatedLagrangian);
    // In the one second of the stage a wave of this density crosses the body some hundred times.
    let slow = DynamicSettings {
        damping: RayleighDamping { mass: 200.0, stiffness: 0.0 },
        reporting: Reporting::Interval(0.5),
        ..DynamicSettings::new(2000.0)
    };
    let (moved, most) = run(Procedure::Dynamic(Box::new(slow)), Formulation::Corotational);
    Claim::of("I-7", "stress ratio at 0.1 % by dynamic relaxation against Newton's method")
        .value(relaxed, newton)
        .within(0.01);
    Claim::of("I-7", "stress ratio at 0.1 % by slow damped motion against Newton's method")
        .value(moved, newton)
        .within(0.01);
    assert!(newton > 1.2 && few < many && many < most, "{newton}: {few}, {many}, {most} evaluations");
}

/// Check I-7, the implicit ways: every strategy and every formulation on a body between rough platens, which does not strain
/// uniformly, to 0.1 % before the peak.
#[test]
fn strategies_and_formulations_agree_between_rough_platens() {
    let ratio = |strategy: NamedStrategy, formulation: Formulation| {
        let mut problem = biaxial_problem(ElementKind::Q4, [2, 2], 1e-3, 2, 5e-6);
        for applied in &mut problem.stages[0].conditions {
            if let Condition::Platen { contact, .. } = &mut applied.condition {
                *contact = Platen::Rough;
            }
        }
        problem.stages[0].conditions.retain(|applied| !matches!(applied.condition, Condition::Displacement { .. }));
        problem.formulation = formulation;
        problem.stages[0].strategy = strategy.preset();
        problem.stages[0].control.max_iterations = 40;
        let (outcome, record) = solved(problem);
        assert!(matches!(outcome, Outcome::Completed), "{} {formulation:?}: {outcome:?}", strategy.keyword());
        record.top_reaction.last().unwrap() / -PRESSURE
    };
    let newton = ratio(NamedStrategy::Newton, Formulation::UpdatedLagrangian);
    assert!(newton > 1.2, "{newton}");
    for strategy in NamedStrategy::ALL {
        let found = ratio(strategy, Formulation::UpdatedLagrangian);
        Claim::of("I-7", "force between rough platens at 0.1 %, strategies against full Newton")
            .value(found, newton)
            .within(1e-3);
    }
    for formulation in [Formulation::SmallStrain, Formulation::TotalLagrangian, Formulation::Corotational] {
        let found = ratio(NamedStrategy::Newton, formulation);
        // A strain of 0.1 % is what they differ by.
        Claim::of("I-7", "force between rough platens at 0.1 %, formulations against updated Lagrangian")
            .value(found, newton)
            .within(5e-3);
    }
}

/// Check I-1. The points' own deformation drives a single RVE to the same bits; the boundary forces follow from its
/// stress.
#[test]
fn one_element_repeats_one_cell() {
    let (outcome, record) = biaxial(1, 1, 3e-3, 3, 0.0);
    assert!(matches!(outcome, Outcome::Completed), "{outcome:?}");
    assert_eq!(record.samples.len(), 4);

    let mut cell = GrainEngine.create(&definition()).unwrap();
    let options = TrialOptions {
        tangent: TangentKind::None,
        ramp_steps: 0,
        observables: Observables::NONE,
        ..TrialOptions::default()
    };
    for (step, points) in record.samples.iter().enumerate() {
        let alone = cell.trial(&points[0].step_gradient, &options).unwrap();
        cell.commit().unwrap();
        for point in points {
            for (ours, theirs) in point.stress.0.iter().zip(&alone.stress.0) {
                Claim::of("I-1", "largest difference of the stress over the pressure, element and single cell")
                    .error((ours - theirs) / PRESSURE)
                    .within(1e-6);
            }
        }
        // The stress carries the cell pressure sideways and the platen's force upwards, within the force tolerance.
        let stress = alone.stress.plane();
        Claim::of("I-1", "lateral stress of the single cell against the pressure on the element")
            .value(-stress[0][0], PRESSURE)
            .within(1e-3);
        let platen = record.top_reaction[step] / record.width[step];
        Claim::of("I-1", "largest error of the stress below the platen over the pressure, against the cell")
            .error((platen - stress[1][1]) / PRESSURE)
            .within(1e-3);
    }
    let ratio = record.top_reaction[3] / record.width[3] / -PRESSURE;
    assert!(ratio > 1.5, "compression has mobilised friction: sigma_yy/sigma_xx = {ratio}");
}

/// Check I-2, before many contacts slide: at 0.1 % strain sliding contacts have amplified the rounding of equal targets to
/// 1e-6 of the pressure. One step: the next begins with what this one leaves to correct, and with that comes the shear stress of the
/// cell, which smooth supports do not carry, so that the elements differ by some 1e-5 of the pressure.
#[test]
fn equal_elements_under_homogeneous_conditions_stay_equal() {
    let (outcome, record) = biaxial(2, 2, 1e-4, 1, 5e-6);
    assert!(matches!(outcome, Outcome::Completed), "{outcome:?}");
    for points in &record.samples {
        for point in points {
            for (ours, theirs) in point.stress.0.iter().zip(&points[0].stress.0) {
                Claim::of("I-2", "largest difference of the stress over the pressure, four equal elements")
                    .error((ours - theirs) / PRESSURE)
                    .within(1e-8);
            }
        }
    }
}

/// Check I-10, per step by the trapezium rule in forces and in the first Piola-Kirchhoff stress, which are equal but for what the force
/// tolerance leaves: `sum f . du = sum V0 P : dF`. And over all steps the work of the stresses is what the grains store and
/// lose, but for the rule's own error and what brings them to rest.
#[test]
fn boundary_work_is_stress_work_is_work_of_the_grains() {
    for (formulation, kind) in [
        (Formulation::SmallStrain, ElementKind::Q4),
        (Formulation::TotalLagrangian, ElementKind::Q8),
        (Formulation::UpdatedLagrangian, ElementKind::Q4),
        (Formulation::UpdatedLagrangian, ElementKind::Q8),
        (Formulation::Corotational, ElementKind::Q4),
    ] {
        let mut problem = biaxial_problem(kind, [2, 1], 2e-3, 8, 5e-6);
        (problem.formulation, problem.observables) = (formulation, Observables::ENERGY);
        let (outcome, record) = solved(problem);
        assert!(matches!(outcome, Outcome::Completed), "{formulation:?}: {outcome:?}");
        let nominal = |point: &Sample| match formulation {
            Formulation::SmallStrain => matrix(&point.stress),
            _ => {
                let deformation = matrix(&point.deformation);
                let back = deformation.try_inverse().expect("no point is inside out");
                matrix(&point.stress) * back.transpose() * deformation.determinant()
            }
        };
        let mut whole = 0.0;
        for step in 1..record.samples.len() {
            let mut boundary = 0.0;
            for node in 0..record.forces[step].len() {
                for axis in 0..2 {
                    let force = 0.5 * (record.forces[step][node][axis] + record.forces[step - 1][node][axis]);
                    boundary +=
                        force * (record.displacements[step][node][axis] - record.displacements[step - 1][node][axis]);
                }
            }
            let of_points = record.samples[step].iter().zip(&record.samples[step - 1]).zip(&record.samples[0]);
            let stress_work: f64 = of_points
                .map(|((after, before), initial)| {
                    let path = matrix(&after.deformation) - matrix(&before.deformation);
                    0.5 * initial.volume * (nominal(after) + nominal(before)).dot(&path)
                })
                .sum();
            Claim::of("I-10", "work at the boundary against that of the stresses, each step, J")
                .value(boundary, stress_work)
                .within(1e-3);
            whole += stress_work;
        }
        let energy = |step: usize, of: fn(&Sample) -> f64| -> f64 {
            record.samples[step].iter().map(|point| point.volume * of(point)).sum()
        };
        let last = record.samples.len() - 1;
        let stored = energy(last, |point| point.elastic) - energy(0, |point| point.elastic);
        Claim::of("I-10", "energy that grains store and lose to friction against the work of the stresses, J")
            .value(stored + energy(last, |point| point.lost), whole)
            .within(1e-3);
    }
}
