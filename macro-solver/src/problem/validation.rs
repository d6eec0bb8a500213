//! Everything that can be wrong with a problem, found before the first evaluation.

use super::elimination::dependents;
use super::rigid_motion::check_rigid_motion;
use super::{
    Applied, Axis, Condition, EquationSettings, InitialStress, LoadingSettings, Problem, ProblemError, Procedure,
    Stage,
};
use crate::element::hourglass::HourglassControl;
use crate::mesh::{Dimension, Side};
use crate::mesh::{point_places, point_volumes};
use crate::nonlocal::NonlocalOperator;
use keys::{Fault, check_settings};

/// A number with its name, what it has to be, and whether it is.
type Check = (&'static str, f64, &'static str, bool);

impl Problem {
    /// Checks the mesh, every number, every set that a condition names, and that no part can move as a rigid body in any
    /// stage.
    ///
    /// # Errors
    /// The first defect found; with several stages, [`ProblemError::Stage`] says in which.
    pub fn validate(&self) -> Result<(), ProblemError> {
        self.mesh.validate()?;
        check_settings(&EquationSettings::of(self), &["solver"])?;
        let strain = self.strain_per_step;
        refuse_unsound(vec![("strain of a ramp step", strain, "at least 0", strain >= 0.0)])?;
        let expected = self.initial.expected.iter().flat_map(InitialStress::numbers);
        refuse_unsound(expected.map(|value| ("initial_stress", value, "a finite number", true)).collect())?;
        check_settings(&self.initial.limits, &["initial_stress"])?;
        check_settings(&self.initial.preparation, &["initial_stress"])?;
        if let Some(fluid) = &self.pore_fluid {
            check_settings(fluid, &["pore_fluid"])?;
        }
        let single = self.mesh.kinds.iter().any(|kind| kind.needs_hourglass_control());
        let is_dynamic = |stage: &Stage| matches!(stage.procedure, Procedure::Dynamic(_));
        let is_viscous = matches!(self.hourglass, HourglassControl::Viscous { .. });
        if single && is_viscous && !self.stages.iter().all(is_dynamic) {
            return Err(ProblemError::ViscousHourglass);
        }
        if self.stages.is_empty() {
            return Err(ProblemError::NoStage);
        }
        for (number, stage) in self.stages.iter().enumerate() {
            self.validate_stage(stage).map_err(|error| match self.stages.len() {
                1 => error,
                _ => ProblemError::Stage { number, stage: stage.name.clone(), error: Box::new(error) },
            })?;
        }
        Ok(())
    }

    fn validate_stage(&self, stage: &Stage) -> Result<(), ProblemError> {
        check_stage_settings(stage)?;
        self.validate_nonlocal(stage)?;
        for (number, applied) in stage.conditions.iter().enumerate() {
            self.validate_condition(stage, applied).map_err(|error| error.of_condition(number))?;
        }
        self.validate_path(stage)?;
        self.check_frictions(stage)?;
        let prescribed = self.prescribed_displacements(stage)?;
        let dependents = dependents(&self.equations(stage, &self.mesh.nodes)?, &prescribed)?;
        match &stage.procedure {
            Procedure::Implicit | Procedure::Relaxation(_) => {
                check_rigid_motion(&self.mesh, &prescribed, &dependents)
            }
            // Inertia holds what no support does.
            Procedure::Dynamic(settings) => settings.validate(self),
        }
    }

    /// What the control of the load factor measures.
    fn validate_path(&self, stage: &Stage) -> Result<(), ProblemError> {
        let at_its_key = |error: ProblemError| {
            let path = ["loading", "control"].map(str::to_owned).to_vec();
            ProblemError::Setting(Fault { path, span: 0..0, problem: error.to_string(), hint: None })
        };
        for (nodes, axis) in stage.control.path.measured() {
            if let Some(nodes) = nodes {
                self.nodes(nodes).map_err(at_its_key)?;
            }
            if axis == Some(Axis::Z) && self.mesh.dimension == Dimension::Plane {
                return Err(at_its_key(ProblemError::NoThirdAxis));
            }
        }
        Ok(())
    }

    /// What can be told of one condition alone; where and what it holds is told by its equations.
    fn validate_condition(&self, stage: &Stage, applied: &Applied) -> Result<(), ProblemError> {
        refuse_unsound(condition_numbers(&applied.condition))?;
        if let Some(reason) = applied.history.defect() {
            return Err(ProblemError::History { reason });
        }
        if stage.finds_load_factor() && applied.history.may_begin_at_rest() {
            return Err(ProblemError::HistoryAtRest);
        }
        // Steps move supports by what their histories change with the load factor, which tells no jump and rounds off a kink.
        if stage.finds_load_factor() && applied.moves_support() && !applied.history.is_proportional() {
            return Err(ProblemError::MotionOffRamp);
        }
        match &applied.condition {
            Condition::Pressure { sides, .. } => {
                self.sides(sides)?;
            }
            Condition::Traction { sides, value } => {
                self.sides(sides)?;
                self.refuse_third_axis(value[2])?;
            }
            Condition::BodyForce { elements, value } => {
                self.elements(elements)?;
                self.refuse_third_axis(value[2])?;
            }
            Condition::Friction { from, to, .. } => {
                if !applied.history.stays_between_0_and_1() {
                    return Err(ProblemError::FrictionHistory);
                }
                if from != to && stage.finds_load_factor() {
                    return Err(ProblemError::FrictionUnknownLoad);
                }
            }
            Condition::Displacement { .. } | Condition::Platen { .. } | Condition::MultiPointConstraint(_) => {}
        }
        Ok(())
    }

    /// Refuses a component along z that acts in the plane.
    fn refuse_third_axis(&self, component: f64) -> Result<(), ProblemError> {
        if self.mesh.dimension == Dimension::Plane && component != 0.0 {
            return Err(ProblemError::NoThirdAxis);
        }
        Ok(())
    }

    fn validate_nonlocal(&self, stage: &Stage) -> Result<(), ProblemError> {
        let Some(settings) = &stage.nonlocal else { return Ok(()) };
        if !self.formulation.has_strain_increments() {
            return Err(ProblemError::NonlocalFormulation { formulation: self.formulation.keyword() });
        }
        // Periodic faces change where a body ends, and with it what is stable.
        let (places, volumes) = (point_places(&self.mesh), point_volumes(&self.mesh));
        NonlocalOperator::new(&places, &volumes, &self.periods(stage)?, settings)?;
        Ok(())
    }

    /// Whether the averages of a stage reach no neighbour, so that every point sees its own strain.
    pub fn averages_nothing(&self, stage: &Stage) -> bool {
        let Some(settings) = &stage.nonlocal else { return true };
        let periods = self.periods(stage).unwrap_or_default();
        let (places, volumes) = (point_places(&self.mesh), point_volumes(&self.mesh));
        NonlocalOperator::unchecked(&places, &volumes, &periods, settings).is_ok_and(|found| found.is_identity())
    }

    /// What the averages of a stage leave of the shortest waves of the mesh, at the place where it is least; `None` without averages, and with those
    /// that the stresses are averaged with as well.
    pub fn shortest_waves_left(&self, stage: &Stage) -> Option<f64> {
        let settings = stage.nonlocal.as_ref().filter(|settings| !settings.adjoint)?;
        let periods = self.periods(stage).unwrap_or_default();
        let (places, volumes) = (point_places(&self.mesh), point_volumes(&self.mesh));
        let averages = NonlocalOperator::unchecked(&places, &volumes, &periods, settings).ok()?;
        Some(averages.smallest_symbol().1)
    }

    /// The named node set.
    ///
    /// # Errors
    /// [`ProblemError::UnknownNodeSet`], naming what there is.
    pub fn nodes(&self, name: &str) -> Result<&[usize], ProblemError> {
        self.mesh.node_sets.get(name).map(Vec::as_slice).ok_or_else(|| ProblemError::UnknownNodeSet {
            name: name.to_owned(),
            available: names(self.mesh.node_sets.keys()),
        })
    }

    /// The named side set.
    ///
    /// # Errors
    /// [`ProblemError::UnknownSideSet`], naming what there is.
    pub fn sides(&self, name: &str) -> Result<&[Side], ProblemError> {
        self.mesh.side_sets.get(name).map(Vec::as_slice).ok_or_else(|| ProblemError::UnknownSideSet {
            name: name.to_owned(),
            available: names(self.mesh.side_sets.keys()),
        })
    }

    /// The named element set.
    ///
    /// # Errors
    /// [`ProblemError::UnknownElementSet`], naming what there is.
    pub fn elements(&self, name: &str) -> Result<&[usize], ProblemError> {
        self.mesh.element_sets.get(name).map(Vec::as_slice).ok_or_else(|| ProblemError::UnknownElementSet {
            name: name.to_owned(),
            available: names(self.mesh.element_sets.keys()),
        })
    }

    /// Whether every element has one friction.
    fn check_frictions(&self, stage: &Stage) -> Result<(), ProblemError> {
        let mut set_of: Vec<Option<&str>> = vec![None; self.mesh.elements.len()];
        for (number, applied) in stage.conditions.iter().enumerate() {
            let Condition::Friction { elements: set, .. } = &applied.condition else { continue };
            for &element in self.elements(set).map_err(|error| error.of_condition(number))? {
                if let Some(first) = set_of[element].replace(set) {
                    let (first, second) = (first.to_owned(), set.clone());
                    return Err(ProblemError::TwoFrictions { element, first, second }.of_condition(number));
                }
            }
        }
        Ok(())
    }
}

fn refuse_unsound(checks: Vec<Check>) -> Result<(), ProblemError> {
    match checks.into_iter().find(|(_, value, _, sound)| !(*sound && value.is_finite())) {
        Some((what, value, requirement, _)) => Err(ProblemError::Number { what, requirement, value }),
        None => Ok(()),
    }
}

/// What the keys declare: ranges, and what one key demands of another.
fn check_stage_settings(stage: &Stage) -> Result<(), ProblemError> {
    check_settings(&LoadingSettings::of(stage), &["loading"])?;
    check_settings(&stage.tolerances, &["solver"])?;
    check_settings(&stage.strategy, &["solver"])?;
    match &stage.procedure {
        Procedure::Implicit => {}
        Procedure::Relaxation(settings) => check_settings(settings, &["relaxation"])?,
        Procedure::Dynamic(settings) => check_settings(&**settings, &["dynamics"])?,
    }
    Ok(())
}

fn condition_numbers(condition: &Condition) -> Vec<Check> {
    let (name, values) = match condition {
        Condition::Displacement { value, .. } => ("displacement", vec![*value]),
        Condition::Platen { displacement, .. } => ("platen displacement", vec![*displacement]),
        Condition::Pressure { value, .. } => ("pressure", vec![*value]),
        Condition::Traction { value, .. } => ("traction", value.to_vec()),
        Condition::BodyForce { value, .. } => ("body_force", value.to_vec()),
        Condition::MultiPointConstraint(link) => ("linked displacement", link.numbers()),
        Condition::Friction { from, to, .. } => {
            let check = |value: f64| ("friction factor", value, "between 0 and 1", (0.0..=1.0).contains(&value));
            return vec![check(*from), check(*to)];
        }
    };
    values.into_iter().map(|value| (name, value, "a finite number", true)).collect()
}

fn names<'a>(keys: impl Iterator<Item = &'a String>) -> String {
    keys.map(String::as_str).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementKind;
    use crate::mesh::block::Block;
    use crate::problem::dynamics::{DynamicSettings, InitialVelocity};
    use crate::problem::{Amplitude, MultiPointConstraint, PathControl, Platen};

    fn problem(conditions: Vec<Condition>) -> Problem {
        let mesh = Block::plane([1.0, 2.0], [2, 2], ElementKind::Q4).mesh().unwrap();
        Problem::new(mesh, conditions)
    }

    /// What is wrong with a problem of one stage, and which of its conditions has it.
    fn refusal(problem: &Problem) -> (Option<usize>, ProblemError) {
        match problem.validate().unwrap_err() {
            ProblemError::Condition { number, error } => (Some(number), *error),
            other => (None, other),
        }
    }

    fn supported() -> Vec<Condition> {
        vec![
            Condition::fixed("bottom_left", Axis::X),
            Condition::Platen { nodes: "bottom".into(), contact: Platen::Smooth, axis: Axis::Y, displacement: 0.0 },
        ]
    }

    /// The limit of the smallest step is declared with its key, and so is its name.
    #[test]
    fn a_smallest_step_above_the_steps_themselves_is_refused_at_its_key() {
        let mut steps = problem(supported());
        (steps.stages[0].control.increments, steps.stages[0].control.min) = (4, 0.25);
        steps.validate().unwrap();
        steps.stages[0].control.min = 0.5;
        let Err(ProblemError::Setting(fault)) = steps.validate() else { panic!("not refused") };
        assert_eq!(fault.path, ["loading", "smallest_increment"]);
        assert_eq!(fault.problem, "loading.smallest_increment must be at most 1 / increments, not 0.5");
    }

    #[test]
    fn an_unknown_load_factor_needs_histories_that_change_at_once() {
        let mut problem = problem(supported());
        problem.validate().unwrap();
        problem.stages[0].control.path = PathControl::ArcLength { first_load: 0.1, set: None, component: None };
        problem.validate().unwrap();
        problem.stages[0].conditions[1].history = Amplitude::SMOOTH;
        assert_eq!(refusal(&problem), (Some(1), ProblemError::HistoryAtRest));
        // A path that the scene controls is none of a motion's.
        problem.stages[0].procedure = Procedure::Dynamic(Box::new(DynamicSettings::new(1e3)));
        assert_eq!(problem.validate(), Ok(()));
    }

    /// A constant displacement was never imposed, and a kink left an error behind.
    #[test]
    fn motion_under_an_unknown_load_factor_has_to_be_a_ramp() {
        let moved = Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value: -0.1 };
        let sunk = Condition::MultiPointConstraint(MultiPointConstraint::RigidBody {
            nodes: "top".into(),
            displacement: [None, Some(-0.1), None],
            rotation: [None; 3],
        });
        let kinked = Amplitude::Table(vec![[0.0, 0.0], [0.5, 1.0]]);
        for motion in [moved, sunk] {
            let mut problem = problem([supported(), vec![motion]].concat());
            let checked = |problem: &mut Problem, history: &Amplitude| {
                problem.stages[0].conditions[2].history = history.clone();
                problem.validate()
            };
            for history in [Amplitude::Constant, kinked.clone(), Amplitude::Ramp { from: 0.5, to: 1.0 }] {
                problem.stages[0].control.path = PathControl::Load;
                assert_eq!(checked(&mut problem, &history), Ok(()));
                problem.stages[0].control.path =
                    PathControl::ArcLength { first_load: 0.1, set: None, component: None };
                assert_eq!(
                    checked(&mut problem, &history),
                    Err(ProblemError::MotionOffRamp.of_condition(2)),
                    "{history:?}"
                );
            }
            assert_eq!(checked(&mut problem, &Amplitude::RAMP), Ok(()));
            // Supports at rest and loads keep any history.
            problem.stages[0].conditions[0].history = Amplitude::Constant;
            problem.stages[0].conditions.push(Applied::new(
                Condition::Pressure { sides: "left".into(), value: 1.0, kind: Default::default() },
                kinked.clone(),
            ));
            assert_eq!(problem.validate(), Ok(()));
        }
    }

    #[test]
    fn free_rigid_motions_are_named() {
        problem(supported()).validate().unwrap();
        let motion = |conditions| match problem(conditions).validate() {
            Err(ProblemError::RigidMotion { element: 0, motion }) => motion,
            other => panic!("{other:?}"),
        };
        assert_eq!(motion(vec![supported().remove(1)]), "move along x");
        let pinned = vec![Condition::fixed("bottom_left", Axis::X), Condition::fixed("bottom_left", Axis::Y)];
        assert!(motion(pinned).contains("rotate"));
        assert_eq!(motion(vec![Condition::fixed("left", Axis::X)]), "move along y");
    }

    #[test]
    fn a_loose_second_part_is_found() {
        let mut problem = problem(supported());
        let first = problem.mesh.nodes.len();
        let corners = [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 1.0, 0.0], [5.0, 1.0, 0.0]];
        problem.mesh.nodes.extend(corners);
        problem.mesh.kinds.push(ElementKind::Q4);
        problem.mesh.elements.push((first..first + 4).collect());
        assert!(matches!(problem.validate(), Err(ProblemError::RigidMotion { element: 4, .. })));
    }

    #[test]
    fn missing_sets_contradictions_and_bad_numbers_are_refused() {
        let pressure = Condition::Pressure { sides: "lid".into(), value: 1.0, kind: Default::default() };
        let error = problem([supported(), vec![pressure]].concat()).validate().unwrap_err();
        assert_eq!(error.to_string(), "no side set 'lid'; the mesh has: bottom, left, right, top");
        let moved = Condition::Displacement { nodes: "bottom".into(), axis: Axis::Y, value: 0.1 };
        let error = refusal(&problem([supported(), vec![moved]].concat()));
        assert!(matches!(error, (Some(2), ProblemError::Contradiction { node: 0, axis: Axis::Y, .. })));
        let moved = Condition::Displacement { nodes: "left".into(), axis: Axis::Y, value: 0.1 };
        let text = problem([supported(), vec![moved]].concat()).validate().unwrap_err().to_string();
        let said = "at (0.0000, 0.0000, 0.0000) m is given two different displacements or histories along Y: 0.000000e0 m by \
                    'bottom' and 1.000000e-1 m by 'left'";
        assert!(text.contains(said), "{text}");
        let mut bad = problem(supported());
        bad.stages[0].control.cut = f64::NAN;
        let refused = bad.validate().unwrap_err().to_string();
        assert_eq!(refused, "loading.cut must be a finite number, not NaN");
        bad.stages[0].control.cut = 1.0;
        assert_eq!(bad.validate().unwrap_err().to_string(), "loading.cut must be above 0 and below 1, not 1");
        let bad = problem(
            [supported(), vec![Condition::Traction { sides: "top".into(), value: [0.0, f64::NAN, 0.0] }]].concat(),
        );
        assert!(matches!(refusal(&bad), (Some(2), ProblemError::Number { what: "traction", .. })));
    }

    #[test]
    fn a_solid_needs_six_supports_and_the_plane_has_no_third_axis() {
        let mesh = Block::space([1.0, 2.0, 1.0], [1, 2, 1], ElementKind::H8).mesh().unwrap();
        let bottom = Condition::fixed("bottom", Axis::Y);
        let held = |more: &[(&str, Axis)]| {
            let more = more.iter().map(|(set, axis)| Condition::fixed(*set, *axis));
            Problem::new(mesh.clone(), std::iter::once(bottom.clone()).chain(more).collect()).validate()
        };
        held(&[("left", Axis::X), ("back", Axis::Z)]).unwrap();
        match held(&[("bottom_left_back", Axis::X), ("bottom_left_back", Axis::Z)]) {
            Err(ProblemError::RigidMotion { motion, .. }) => assert!(motion.contains("rotate about y"), "{motion}"),
            other => panic!("{other:?}"),
        }
        let lifted = problem([supported(), vec![Condition::fixed("left", Axis::Z)]].concat());
        assert_eq!(refusal(&lifted), (Some(2), ProblemError::NoThirdAxis));
        let pulled = Condition::Traction { sides: "top".into(), value: [0.0, 0.0, 1.0] };
        assert_eq!(refusal(&problem([supported(), vec![pulled]].concat())), (Some(2), ProblemError::NoThirdAxis));
        let mut thrown = problem(supported());
        let velocity = InitialVelocity { nodes: "top".into(), value: [0.0, 0.0, 1.0] };
        let settings = DynamicSettings { initial_velocities: vec![velocity], ..DynamicSettings::new(1e3) };
        thrown.stages[0].procedure = Procedure::Dynamic(Box::new(settings));
        assert_eq!(thrown.validate(), Err(ProblemError::NoThirdAxis));
        // A displacement of 0 along z, which is no fault, hid the rotation behind it.
        let turned = |rotation: [Option<f64>; 3]| {
            let link = MultiPointConstraint::RigidBody {
                nodes: "top".into(),
                displacement: [None, None, Some(0.0)],
                rotation,
            };
            problem([supported(), vec![Condition::MultiPointConstraint(link)]].concat()).validate()
        };
        assert_eq!(turned([Some(0.0), None, Some(0.0)]), Ok(()));
        assert_eq!(turned([Some(0.5), None, None]), Err(ProblemError::NoThirdAxis.of_condition(2)));
        assert_eq!(turned([Some(0.0), Some(0.5), None]), Err(ProblemError::NoThirdAxis.of_condition(2)));
    }
}
