//! The equations of a stage: supports, loads and what solves for the unknowns.

use super::linear_solver::LinearSolver;
use crate::model::assembly::block::BlockDofs;
use crate::model::body::Body;
use crate::model::constraints::Constraints;
use crate::model::friction::Frictions;
use crate::model::loads::Loads;
use crate::model::points::Coupling;
use crate::problem::elimination::dependents;
use crate::problem::{Problem, ProblemError, Stage};

/// What a stage prescribes, ready for the solver.
pub(super) struct Equations {
    pub(super) constraints: Constraints,
    pub(super) loads: Loads,
    pub(super) frictions: Frictions,
    pub(super) linear: LinearSolver,
}

impl Equations {
    /// The equations of a stage that begins with the displacements `start`, m, and whose points are coupled by averages over
    /// neighbours or not.
    ///
    /// # Errors
    /// A condition that does not fit the mesh.
    pub(super) fn new(
        problem: &Problem,
        stage: &Stage,
        body: &Body,
        start: &[f64],
        coupling: Option<&Coupling>,
    ) -> Result<Self, ProblemError> {
        let prescribed = problem.prescribed_displacements(stage)?;
        // About where the stage begins, also when a run goes on within it.
        let equations = problem.equations(stage, &body.positions_at(start))?;
        let constraints = Constraints::new(&prescribed, &dependents(&equations, &prescribed)?, start);
        let loads = Loads::new(problem, stage)?;
        // Meshes of motions may be too large for a stiffness.
        let block_dofs: Vec<BlockDofs> = match stage.procedure.solves_equations() {
            true => body.block_dofs(&loads, coupling).iter().map(|dofs| constraints.condensed_dofs(dofs)).collect(),
            false => Vec::new(),
        };
        let linear = LinearSolver::new(block_dofs.iter(), &constraints, problem.equations);
        let frictions = Frictions::new(problem, stage, body)?;
        Ok(Self { constraints, loads, frictions, linear })
    }
}
