//! The stress of a body in equilibrium with its loads before any grains are in it.

use super::driver::{Session, Solver};
use crate::checkpoint::NoCheckpoints;
use crate::formulation::Formulation;
use crate::material::frictional::FrictionalMaterial;
use crate::observer::{Outcome, Silent};
use crate::problem::{
    Criteria, EquilibriumSettings, InitialState, NamedStrategy, Problem, ProblemError, Procedure, Stage, StepControl,
    Strategy, Tolerances,
};
use thiserror::Error;

/// Largest out-of-balance force over loads and reactions.
const TOLERANCE: f64 = 1e-7;

/// Most iterations.
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
    let first = problem.stages.first().cloned().unwrap_or_else(|| Stage::new("start", Vec::new()));
    let stage = Stage {
        procedure: Procedure::default(),
        nonlocal: None,
        control: StepControl { max_iterations: MOST_ITERATIONS, stabilisation: None, ..StepControl::default() },
        tolerances: Tolerances { criteria: Criteria::FORCE_OVER_REACTIONS, ..Tolerances::both(TOLERANCE, 1.0) },
        strategy: Strategy { tangent_floor: None, ..NamedStrategy::Newton.preset() },
        ..first
    };
    let start = Problem {
        stages: vec![stage],
        initial: InitialState::default(),
        formulation: Formulation::SmallStrain,
        strain_per_step: 0.0,
        error_control: None,
        pore_fluid: None,
        ..problem.clone()
    };
    let dimension = problem.mesh.dimension.count();
    let mut material = FrictionalMaterial::new(
        dimension,
        settings.rest_coefficient,
        settings.friction_angle.to_radians(),
        problem.point_count(),
    );
    let mut solver = Solver::new(&start)?;
    let session = &mut Session { material: &mut material, observer: &mut Silent, store: &mut NoCheckpoints };
    match solver.solve_start(session) {
        Ok(()) => Ok(material.stresses()),
        Err(Outcome::DidNotConverge { reason }) => Err(EquilibriumError::NotFound(reason)),
        Err(outcome) => Err(EquilibriumError::NotFound(format!("{outcome:?}"))),
    }
}
