//! Steps whose load factor is an unknown: cylindrical arc length and indirect control.
//!
//! Both solve with the stiffness twice, for the out-of-balance force and for the load, and let a constraint on the
//! displacements decide how much of the second there is [Crisfield 1981; de Borst 1987]. The load factor travels with the
//! displacements as one vector, so that caps and backtracks act on both.

use crate::model::failure::Failure;
use crate::observer::Outcome;
use crate::problem::{Axis, Moment, PathControl, Predictor, Problem, ProblemError, Stage};
use crate::solve::accepted::LastStep;
use crate::solve::driver::Solver;
use crate::solve::linear_solver::LinearSolverError;
use crate::solve::vectors::{dot, norm};

/// Half the change of the load factor from which its direction is taken; histories are piecewise smooth.
const LOAD_CHANGE: f64 = 1e-6;

/// The constraint of a stage.
#[derive(Clone, Debug)]
pub(in crate::solve) enum PathConstraint {
    /// `|w du| = length`.
    Length {
        /// 1 for the components that count, 0 for the others.
        weights: Vec<f64>,
        /// Of the first step.
        first_load: f64,
    },
    /// `c . du = growth`.
    Functional {
        /// Coefficients by degree of freedom.
        coefficients: Vec<f64>,
        /// Over the stage, m.
        growth: f64,
    },
}

impl PathConstraint {
    /// That of a stage; `None` where the load factor is known.
    ///
    /// # Errors
    /// A node set that the mesh lacks, or z in the plane.
    pub(in crate::solve) fn new(problem: &Problem, stage: &Stage) -> Result<Option<Self>, ProblemError> {
        if !stage.finds_load_factor() {
            return Ok(None);
        }
        let count = problem.mesh.degrees_of_freedom();
        Ok(match &stage.control.path {
            PathControl::Load => None,
            PathControl::ArcLength { first_load, set, component } => {
                let mut weights = vec![0.0; count];
                let all: Vec<usize> = (0..problem.mesh.nodes.len()).collect();
                let nodes = set.as_ref().map_or(Ok(all.as_slice()), |set| problem.nodes(set))?;
                for dof in components(problem, nodes, *component)? {
                    weights[dof] = 1.0;
                }
                Some(Self::Length { weights, first_load: *first_load })
            }
            PathControl::Indirect { nodes, relative_to, axis, growth } => {
                let mut coefficients = vec![0.0; count];
                for (set, sign) in std::iter::once((nodes, 1.0)).chain(relative_to.iter().map(|set| (set, -1.0))) {
                    let components = components(problem, problem.nodes(set)?, Some(*axis))?;
                    let share = sign / components.len() as f64;
                    components.into_iter().for_each(|dof| coefficients[dof] += share);
                }
                Some(Self::Functional { coefficients, growth: *growth })
            }
        })
    }

    /// Sign of the change of the load factor in the first step, where the constraint leaves it open.
    fn first_load(&self) -> f64 {
        match self {
            Self::Length { first_load, .. } => *first_load,
            Self::Functional { .. } => 1.0,
        }
    }

    /// Whether a motion changes nothing of what is measured.
    fn is_blind_to(&self, direction: &[f64]) -> bool {
        let counted = match self {
            Self::Length { weights, .. } => weights,
            Self::Functional { coefficients, .. } => coefficients,
        };
        counted.iter().zip(direction).all(|(counted, motion)| counted * motion == 0.0)
    }

    /// How much of `direction` brings `moved` onto the constraint; `along` is the motion that chooses between two ways.
    /// `None` if none does.
    fn share(&self, goal: f64, moved: &[f64], direction: &[f64], along: &[f64]) -> Option<f64> {
        let found = match self {
            Self::Functional { coefficients, .. } => (goal - dot(coefficients, moved)) / dot(coefficients, direction),
            Self::Length { weights, .. } => {
                let weighted = |one: &[f64], other: &[f64]| {
                    (0..weights.len()).map(|i| weights[i] * one[i] * other[i]).sum::<f64>()
                };
                let (a, b) = (weighted(direction, direction), weighted(moved, direction));
                let c = weighted(moved, moved) - goal * goal;
                let root = (b * b - a * c).sqrt();
                // The way that turns back less.
                let sign = if weighted(direction, along) >= 0.0 { 1.0 } else { -1.0 };
                (sign * root - b) / a
            }
        };
        found.is_finite().then_some(found)
    }
}

/// Degrees of freedom of a node set.
fn components(problem: &Problem, nodes: &[usize], axis: Option<Axis>) -> Result<Vec<usize>, ProblemError> {
    let dimension = problem.mesh.dimension.count();
    let axes = match axis {
        Some(axis) if axis.index() >= dimension => return Err(ProblemError::NoThirdAxis),
        Some(axis) => axis.index()..axis.index() + 1,
        None => 0..dimension,
    };
    Ok(nodes.iter().flat_map(|node| axes.clone().map(move |axis| dimension * node + axis)).collect())
}

impl Solver<'_> {
    /// Correction of the evaluated iterate and of its load factor: towards balance, and along the load as far as the
    /// constraint wants it. `first` is the first iterate of the attempt.
    pub(in crate::solve) fn correction_on_path(
        &mut self,
        constraint: &PathConstraint,
        iterate: &[f64],
        first: &[f64],
        load: f64,
        size: f64,
    ) -> Result<(Vec<f64>, f64), Failure> {
        let fail = |error: LinearSolverError| Failure::Attempt(error.to_string());
        if self.tangents.factorizes() {
            self.factorize().map_err(fail)?;
        }
        let residual = self.constraints.restrict(&self.balance.residual());
        let right: Vec<f64> = residual.iter().map(|value| -value).collect();
        let towards_balance = self.solve_linear(&right).map_err(fail)?;
        let direction = self.load_direction(iterate, load).map_err(fail)?;
        let moved: Vec<f64> = iterate.iter().zip(&towards_balance).map(|(one, other)| one + other).collect();
        let change = constraint.share(self.goal(constraint, size), &moved, &direction, first);
        let change = change.ok_or_else(|| {
            Failure::Attempt(
                "no load factor leads to a step of this length in the direction of the iterate".to_owned(),
            )
        })?;
        let both = towards_balance.iter().zip(&direction);
        Ok((both.map(|(balance, load)| balance + change * load).collect(), change))
    }

    /// The right-hand side of the constraint for a step of this size.
    fn goal(&self, constraint: &PathConstraint, size: f64) -> f64 {
        match constraint {
            PathConstraint::Functional { growth, .. } => growth * size,
            PathConstraint::Length { .. } => {
                let length = self.arc_length.expect("the first prediction has set it");
                length * size * self.stage().control.increments as f64
            }
        }
    }

    /// First iterate and its load factor: the last step again, or along the tangent.
    pub(in crate::solve) fn predict_path(
        &mut self,
        constraint: &PathConstraint,
        size: f64,
    ) -> Result<(Vec<f64>, f64), Failure> {
        let last = self.last_step.clone();
        if let Some(LastStep { increment, size: of, .. }) =
            last.as_ref().filter(|_| self.stage().strategy.predictor == Predictor::Linear)
        {
            let ratio = size / of;
            let load = self.load + ratio * self.last_load_change;
            return Ok((increment.iter().map(|value| ratio * value).collect(), load));
        }
        let fail = |error: LinearSolverError| Failure::Attempt(error.to_string());
        self.balance.clone_from(&self.committed_balance);
        let still = self.body.zero();
        if self.tangents.factorizes() {
            self.factorize().map_err(fail)?;
        }
        let direction = self.load_direction(&still, self.load).map_err(fail)?;
        if self.arc_length.is_none()
            && let PathConstraint::Length { weights, first_load } = constraint
        {
            let moved: Vec<f64> = direction.iter().zip(weights).map(|(value, weight)| value * weight).collect();
            self.arc_length = Some(norm(&moved) * first_load.abs());
        }
        let along = match &last {
            Some(last) => last.increment.clone(),
            None => direction.iter().map(|value| value * constraint.first_load()).collect(),
        };
        if constraint.is_blind_to(&direction) {
            return Err(Failure::Run(Outcome::Refused(ProblemError::NothingMeasured)));
        }
        let change = constraint.share(self.goal(constraint, size), &still, &direction, &along);
        let change = change.ok_or_else(|| Failure::Attempt("the load does not move what is measured".to_owned()))?;
        Ok((direction.iter().map(|value| change * value).collect(), self.load + change))
    }

    /// Change of the displacements per load factor in equilibrium, with the factors in place: prescribed motions, and what
    /// the rest does under them and under the change of the loads.
    fn load_direction(&mut self, iterate: &[f64], load: f64) -> Result<Vec<f64>, LinearSolverError> {
        let (ahead, behind) = (self.moment(load + LOAD_CHANGE), self.moment(load - LOAD_CHANGE));
        let per_factor = |ahead: &[f64], behind: &[f64]| -> Vec<f64> {
            ahead.iter().zip(behind).map(|(ahead, behind)| (ahead - behind) / (2.0 * LOAD_CHANGE)).collect()
        };
        let mut direction = per_factor(&self.given(ahead), &self.given(behind));
        let positions = self.body.positions(iterate);
        let pushed = per_factor(&self.loads.force(&positions, ahead), &self.loads.force(&positions, behind));
        let pulled = self.balance.stiffness_times(&direction);
        let right: Vec<f64> = pushed.iter().zip(&pulled).map(|(pushed, pulled)| pushed - pulled).collect();
        let rest = self.solve_linear(&self.constraints.restrict(&right))?;
        for (value, rest) in direction.iter_mut().zip(&rest) {
            *value += rest;
        }
        Ok(direction)
    }

    /// Increment of the prescribed components at a moment, and of those that follow them, while the free ones stay.
    pub(in crate::solve) fn given(&self, moment: Moment) -> Vec<f64> {
        let mut increment = self.body.zero();
        for (dof, value) in increment.iter_mut().enumerate() {
            if let Some(prescribed) = self.constraints.prescribed(dof, moment) {
                *value = prescribed - self.body.displacements[dof];
            }
        }
        self.constraints.complete(&mut increment, &self.body.displacements, moment);
        increment
    }
}
