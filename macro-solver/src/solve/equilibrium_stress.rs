//! The stress of a body in equilibrium with its loads before any grains are in it.

use super::driver::{Session, Solver};
use crate::checkpoint::NoCheckpoints;
use crate::element::hourglass::HourglassControl;
use crate::formulation::Formulation;
use crate::material::frictional::FrictionalMaterial;
use crate::observer::{Outcome, Silent};
use crate::problem::relaxation::RelaxationSettings;
use crate::problem::{
    Criteria, EquilibriumSettings, InitialState, NamedStrategy, Problem, ProblemError, Procedure, Stage, StepControl,
    Strategy, Tolerances,
};
use thiserror::Error;

/// Largest out-of-balance force over loads and reactions.
const TOLERANCE: f64 = 1e-7;

/// Most iterations of dynamic relaxation.
const MOST_RELAXING: usize = 20_000;

/// Most iterations of Newton's method.
const MOST_ITERATIONS: usize = 100;

/// Why there is no stress in equilibrium.
#[derive(Debug, Error)]
pub enum EquilibriumError {
    /// The problem itself is at fault.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// Loads that friction does not bear, or supports that leave the body free.
    #[error("{0}")]
    NotFound(String),
}

/// Cauchy stress of every Gauss point, Pa, by rows, tension positive, of an elastic and frictional body in equilibrium with the loads at the
/// start of a problem, on its mesh and supports.
///
/// # Errors
/// See [`EquilibriumError`].
pub fn equilibrium_stress(
    problem: &Problem,
    settings: &EquilibriumSettings,
) -> Result<Vec<[[f64; 3]; 3]>, EquilibriumError> {
    let newton = Procedure::default();
    let relaxation =
        Procedure::Relaxation(RelaxationSettings { max_iterations: MOST_RELAXING, ..Default::default() });
    let mut reasons = Vec::new();
    // Newton's method takes some ten iterations, but can go to and fro between points that yield in turns; a damped motion cannot.
    for (name, procedure) in [("Newton's method", newton), ("dynamic relaxation", relaxation)] {
        let start = start_of(problem, procedure);
        let mut solver = Solver::new(&start)?;
        let mut material = FrictionalMaterial::new(
            problem.mesh.dimension.count(),
            settings.rest_coefficient,
            settings.friction_angle.to_radians(),
            solver.load_per_area(),
            problem.point_count(),
        );
        let session = &mut Session { material: &mut material, observer: &mut Silent, store: &mut NoCheckpoints };
        let reason = match solver.solve_start(session) {
            Ok(()) => return Ok(material.stresses()),
            Err(Outcome::Refused(error)) => return Err(error.into()),
            Err(
                Outcome::DidNotConverge { reason }
                | Outcome::Unstable { reason, .. }
                | Outcome::WorkersLost { reason },
            ) => reason,
            // Nothing observes this solution or continues it.
            Err(outcome) => format!("ended early ({outcome:?})"),
        };
        reasons.push(format!("{name}: {reason}"));
    }
    Err(EquilibriumError::NotFound(reasons.join("; ")))
}

impl Solver<'_> {
    /// Loads at the start over the area of a side as long as the body, Pa.
    fn load_per_area(&self) -> f64 {
        let forces = self.loads.force(&self.body.positions(&self.body.zero()), self.moment(0.0));
        let sides = i32::try_from(self.body.mesh().dimension.count() - 1).expect("two or three axes");
        forces.iter().map(|force| force.abs()).sum::<f64>() / self.body.extent().powi(sides)
    }
}

/// The problem up to its first step, with small strains and nothing that belongs to grains.
fn start_of(problem: &Problem, procedure: Procedure) -> Problem {
    let first = problem.stages.first().cloned().unwrap_or_else(|| Stage::new("start", Vec::new()));
    let stage = Stage {
        procedure,
        nonlocal: None,
        control: StepControl { max_iterations: MOST_ITERATIONS, stabilisation: None, ..StepControl::default() },
        tolerances: Tolerances { criteria: Criteria::FORCE_OVER_REACTIONS, ..Tolerances::both(TOLERANCE, 1.0) },
        strategy: Strategy { tangent_floor: None, ..NamedStrategy::Newton.preset() },
        ..first
    };
    // Dashpots hold nothing at rest.
    let hourglass = match problem.hourglass {
        HourglassControl::Viscous { .. } => HourglassControl::default(),
        springs @ HourglassControl::Stiffness { .. } => springs,
    };
    Problem {
        stages: vec![stage],
        hourglass,
        initial: InitialState::default(),
        formulation: Formulation::SmallStrain,
        strain_per_step: 0.0,
        error_control: None,
        pore_fluid: None,
        ..problem.clone()
    }
}
