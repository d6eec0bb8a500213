//! A nonlocal operator at work in a run, between elements and points.

use super::{NonlocalError, NonlocalOperator, NonlocalSettings};
use nalgebra::Matrix3;
use std::sync::Arc;

/// The operator and the increments of the step before, which [`super::Update::Staggered`] looks at.
#[derive(Clone, Debug, PartialEq)]
pub struct NonlocalLayer {
    operator: Arc<NonlocalOperator>,
    previous: Vec<Matrix3<f64>>,
}

impl NonlocalLayer {
    /// A layer over points at `positions`, m, with `volumes`, m3, of a body that repeats with `periods`, m.
    ///
    /// # Errors
    /// See [`NonlocalOperator::new`].
    pub fn new(
        positions: &[[f64; 3]],
        volumes: &[f64],
        periods: &[[f64; 3]],
        settings: &NonlocalSettings,
    ) -> Result<Self, NonlocalError> {
        let mut operator = NonlocalOperator::new(positions, volumes, periods, settings)?;
        operator.forget_branches();
        Ok(Self { previous: vec![Matrix3::zeros(); operator.len()], operator: Arc::new(operator) })
    }

    /// Strain increments of the points (dimensionless, in the fixed axes) from those of the elements, by point: averages over the
    /// neighbourhood. `strains` has one entry for each point.
    pub fn seen(&self, strains: &[Matrix3<f64>]) -> Vec<Matrix3<f64>> {
        self.operator.averaged(strains, &self.previous)
    }

    /// Stresses that the elements integrate, Pa, from those of the points and the volumes of the points, m3; one entry for each
    /// point. See [`NonlocalOperator::integrated_stress`].
    pub fn integrated(&self, stress: &[Matrix3<f64>], volumes: &[f64]) -> Vec<Matrix3<f64>> {
        self.operator.integrated_stress(stress, volumes)
    }

    /// Whether elements integrate averaged stresses.
    pub fn is_adjoint(&self) -> bool {
        self.operator.settings().adjoint
    }

    /// The table of weights.
    pub fn operator(&self) -> &Arc<NonlocalOperator> {
        &self.operator
    }

    /// The increments of a step have been committed.
    pub fn commit(&mut self, strains: Vec<Matrix3<f64>>) {
        self.previous = strains;
    }

    /// Increments of the last committed step.
    pub fn previous(&self) -> &[Matrix3<f64>] {
        &self.previous
    }
}
