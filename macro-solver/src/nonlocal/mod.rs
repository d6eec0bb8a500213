//! Averages over a neighbourhood of Gauss points: a softening material gets the length that it lacks.
//!
//! [Liu2015] section 2.3.3 and appendix A: a point does not see its own strain increment but
//! `<e>_I = sum_J a_IJ e_J` with `a_IJ = w(|x_I - x_J| / R) / sum_K w(|x_I - x_K| / R)` over all Gauss points within the
//! radius `R`, the intrinsic length of the material. The table of weights is built once from the initial positions; the
//! order of neighbours is that of their places, so sums have one order.
//!
//! The adjoint form has weights of its own, `a_IJ = w_IJ V_J / V` with the volumes `V_J` of the points and the largest sum
//! `V = max_I sum_J w_IJ V_J`; what a point near the end of the body lacks to 1 goes to itself, as in Borino, Failla and Parrinello (2003). Only
//! then `sum_I V_I a_IJ = V_J`, so that the transpose leaves a uniform stress as it is.

mod bins;
mod images;
mod kernel;
mod layer;
mod stability;
#[cfg(test)]
mod tests;

pub use kernel::Kernel;
pub use layer::NonlocalLayer;

use bins::Bins;
use images::images;
use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Which values of the neighbours are averaged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Update {
    /// The increments of the same step at all points. They are all known before any grain moves, so nothing is lost by it,
    /// and the result does not depend on the order of points.
    #[default]
    Synchronous,
    /// As printed in [Liu2015]: points with a lower number contribute their increment of this step, the others that of the
    /// step before. Depends on the numbering; for comparison with the paper.
    Staggered,
}

/// What a nonlocal operator is made of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct NonlocalSettings {
    /// Radius of influence R. Below the distance of neighbouring Gauss points nothing is averaged.
    #[schemars(extend("x-unit" = "m", "x-default" = "none, has to be given"))]
    pub radius: f64,
    /// Weights over distance.
    pub kernel: Kernel,
    /// Share of the point's own increment that is kept in addition to the average; 0.1 makes the bell stable in many cases.
    /// In equilibrium beyond the peak it also keeps strains from alternating between elements that the average cannot tell apart.
    #[schemars(extend("x-unit" = "-"))]
    pub local_share: f64,
    /// Which values are averaged.
    pub update: Update,
    /// Whether the stress is averaged by the transpose as well. The work of the averaged stress on the strain of the elements
    /// then equals the work of the stress on the averaged strain, and the stiffness stays symmetric and not negative with
    /// every kernel; some waves of the mesh may be left without stiffness. Weights count the volumes of the points then, and near the ends
    /// of the body a point keeps more of its own increment, so that a uniform stress stays uniform.
    pub adjoint: bool,
    /// Whether combinations of kernel, radius and mesh that are known to be unstable run all the same, for the comparison that shows
    /// why they are refused.
    pub allow_unstable: bool,
}

/// Why an operator was refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NonlocalError {
    /// A number that means nothing.
    #[error("nonlocal.{key} = {value} must {must}")]
    Value {
        /// Key of the table.
        key: &'static str,
        /// What was given.
        value: f64,
        /// What it must be.
        must: &'static str,
    },
    /// The radius reaches so many Gauss points that their table takes the memory and time of the machine: most likely a wrong unit.
    #[error(
        "nonlocal.radius = {radius:e} m reaches more than {most} neighbours of a Gauss point, images of a periodic body, or points of the unbounded grid \
         whose stability is checked; lengths are in m, and a radius of some elements is usual"
    )]
    TooWide {
        /// Radius, m.
        radius: f64,
        /// Most neighbours and images.
        most: usize,
    },
    /// A wave of the mesh would be averaged to its opposite and grow.
    #[error(
        "the {kernel} kernel with radius {radius} m is unstable on this mesh: around Gauss point {point} a wave of the mesh is \
         averaged to {symbol:.3} of itself, and the elements then push the wrong way; use kernel = \"wendland\" or \"cone\", \
         adjoint = true, a local_share of at least {remedy_share:.2}, or a radius below the distance of neighbouring points"
    )]
    Unstable {
        /// Keyword of the kernel.
        kernel: &'static str,
        /// Radius, m.
        radius: f64,
        /// Point whose neighbourhood shows it most.
        point: usize,
        /// Smallest factor by which a wave is multiplied; negative.
        symbol: f64,
        /// Local share that lifts it to zero.
        remedy_share: f64,
    },
}

/// Most neighbours of a Gauss point, on the regular grid of its neighbourhood too, and most images of a periodic body. A radius of 158
/// distances of points in the plane and of 23 in space has as many.
const MOST_NEIGHBOURS: usize = 100_000;

/// A table of weights over Gauss points.
#[derive(Clone, Debug, PartialEq)]
pub struct NonlocalOperator {
    settings: NonlocalSettings,
    /// First entry of each point in `neighbours` and `weights`; one more at the end.
    starts: Vec<usize>,
    neighbours: Vec<usize>,
    weights: Vec<f64>,
    /// Branch from the point to the neighbour (or its periodic image), m; for the weights and the stability check, empty later.
    offsets: Vec<[f64; 3]>,
}

impl NonlocalOperator {
    /// Builds the table for points at `positions` (m) with `volumes` (m3, in the plane m2), which the adjoint form needs. `periods` are translations (m) under which the body repeats, each
    /// used forwards and backwards, as often as the radius reaches, and in all combinations, of which equal ones count once; empty for
    /// an ordinary body.
    ///
    /// # Errors
    /// [`NonlocalError`]; in particular every combination of kernel, radius and points that would be unstable, unless the settings
    /// allow it.
    pub fn new(
        positions: &[[f64; 3]],
        volumes: &[f64],
        periods: &[[f64; 3]],
        settings: &NonlocalSettings,
    ) -> Result<Self, NonlocalError> {
        let operator = Self::unchecked(positions, volumes, periods, settings)?;
        if !settings.allow_unstable {
            operator.check_stability()?;
        }
        Ok(operator)
    }

    /// As [`NonlocalOperator::new`], without the check of stability: to ask which points have neighbours
    /// ([`Problem::averages_nothing`](crate::problem::Problem::averages_nothing)), and for studies of what goes wrong.
    ///
    /// # Errors
    /// A number that means nothing.
    pub fn unchecked(
        positions: &[[f64; 3]],
        volumes: &[f64],
        periods: &[[f64; 3]],
        settings: &NonlocalSettings,
    ) -> Result<Self, NonlocalError> {
        settings.validate()?;
        let too_wide = || NonlocalError::TooWide { radius: settings.radius, most: MOST_NEIGHBOURS };
        let places: Vec<[f64; 3]> = images(periods, positions, settings.radius, MOST_NEIGHBOURS)
            .ok_or_else(too_wide)?
            .iter()
            .flat_map(|shift| positions.iter().map(move |position| moved(position, 1.0, shift)))
            .collect();
        let bins = Bins::new(places, settings.radius);
        let mut operator = Self {
            settings: settings.clone(),
            starts: vec![0],
            neighbours: Vec::new(),
            weights: Vec::new(),
            offsets: Vec::new(),
        };
        for (number, position) in positions.iter().enumerate() {
            operator.add_point(number, position, positions.len(), &bins);
            // At the first points: a whole table of such rows is what must not be made.
            let in_reach = operator.neighbours.len() - operator.starts[number];
            if in_reach > MOST_NEIGHBOURS || operator.points_of_grid(number) > MOST_NEIGHBOURS as f64 {
                return Err(too_wide());
            }
        }
        if settings.adjoint {
            operator.keep_uniform_stresses(volumes);
        }
        Ok(operator)
    }

    /// Replaces the weights by those of the adjoint form.
    fn keep_uniform_stresses(&mut self, volumes: &[f64]) {
        let NonlocalSettings { radius, kernel, local_share, .. } = self.settings;
        let volume_in_reach = |entry: usize| {
            let distance = self.offsets[entry].iter().map(|part| part * part).sum::<f64>().sqrt();
            kernel.weight(distance / radius) * volumes[self.neighbours[entry]]
        };
        let entries = |point: usize| self.starts[point]..self.starts[point + 1];
        let largest = (0..self.len()).map(|point| entries(point).map(volume_in_reach).sum()).fold(0.0, f64::max);
        let mut weights: Vec<f64> =
            (0..self.weights.len()).map(|entry| (1.0 - local_share) * volume_in_reach(entry) / largest).collect();
        for point in 0..self.len() {
            let own =
                entries(point).find(|&entry| self.neighbours[entry] == point && self.offsets[entry] == [0.0; 3]);
            if let Some(own) = own {
                let others: f64 = entries(point).filter(|&entry| entry != own).map(|entry| weights[entry]).sum();
                weights[own] = 1.0 - others;
            }
        }
        self.weights = weights;
    }

    fn add_point(&mut self, number: usize, position: &[f64; 3], count: usize, bins: &Bins) {
        let radius = self.settings.radius;
        let mut found: Vec<(usize, [f64; 3], f64)> = bins
            .around(position)
            .filter_map(|place| {
                let offset = moved(bins.position(place), -1.0, position);
                let distance = offset.iter().map(|part| part * part).sum::<f64>().sqrt();
                let weight = self.settings.kernel.weight(distance / radius);
                (weight > 0.0).then_some((place % count, offset, weight))
            })
            .collect();
        // Cubes hand them out in an order of their own; sums shall have one that the places of the points alone decide,
        // whatever their numbers are.
        found.sort_by(|first, second| {
            let by_place = first.1.iter().zip(&second.1).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne());
            by_place.unwrap_or_else(|| first.0.cmp(&second.0))
        });
        let total: f64 = found.iter().map(|(_, _, weight)| weight).sum();
        let share = self.settings.local_share;
        for (neighbour, offset, weight) in found {
            let own = neighbour == number && offset == [0.0; 3];
            self.neighbours.push(neighbour);
            self.weights.push((1.0 - share) * weight / total + if own { share } else { 0.0 });
            self.offsets.push(offset);
        }
        self.starts.push(self.neighbours.len());
    }

    /// Gives back the memory of what only the check of stability and the weights need, more than half of the table.
    pub(super) fn forget_branches(&mut self) {
        self.offsets = Vec::new();
        self.neighbours.shrink_to_fit();
        self.weights.shrink_to_fit();
    }

    /// What it was made of.
    pub fn settings(&self) -> &NonlocalSettings {
        &self.settings
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether no point has a neighbour: the operator is the identity.
    pub fn is_identity(&self) -> bool {
        self.neighbours.len() == self.len()
    }

    /// Neighbours of a point (itself included) with their weights, in the order of their places along x, then y, then z.
    pub fn row(&self, point: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.starts[point]..self.starts[point + 1];
        self.neighbours[range.clone()].iter().copied().zip(self.weights[range].iter().copied())
    }

    /// Those of them whose increment of this step a point sees, with their weights: all but what [`Update::Staggered`] takes from the step
    /// before.
    pub fn row_of_this_step(&self, point: usize) -> impl Iterator<Item = (usize, f64)> {
        let is_staggered = self.settings.update == Update::Staggered;
        self.row(point).filter(move |(neighbour, _)| !(is_staggered && *neighbour > point))
    }

    /// What every point sees: averages of `current`, the increments of this step; `previous` holds those of the step before
    /// and is used by [`Update::Staggered`] only.
    pub fn averaged(&self, current: &[Matrix3<f64>], previous: &[Matrix3<f64>]) -> Vec<Matrix3<f64>> {
        (0..self.len())
            .map(|point| {
                let known = |neighbour: usize| match self.settings.update {
                    Update::Staggered if neighbour > point => &previous[neighbour],
                    Update::Synchronous | Update::Staggered => &current[neighbour],
                };
                self.row(point).fold(Matrix3::zeros(), |sum, (neighbour, weight)| sum + weight * known(neighbour))
            })
            .collect()
    }

    /// The stress that the elements integrate: `stress` itself, or its average by the transpose,
    /// `s_J = (1 / V_J) sum_I V_I a_IJ sigma_I`, if the settings say so. `volumes` are those of the points, m3.
    pub fn integrated_stress(&self, stress: &[Matrix3<f64>], volumes: &[f64]) -> Vec<Matrix3<f64>> {
        if !self.settings.adjoint {
            return stress.to_vec();
        }
        let mut collected = vec![Matrix3::zeros(); self.len()];
        for point in 0..self.len() {
            for (neighbour, weight) in self.row(point) {
                collected[neighbour] += volumes[point] * weight * stress[point];
            }
        }
        collected.iter().zip(volumes).map(|(sum, volume)| sum / *volume).collect()
    }
}

impl NonlocalSettings {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NonlocalError::Value`] for the first that means nothing.
    pub fn validate(&self) -> Result<(), NonlocalError> {
        if !(self.radius.is_finite() && self.radius > 0.0) {
            return Err(NonlocalError::Value {
                key: "radius",
                value: self.radius,
                must: "be a positive length in m",
            });
        }
        if !(0.0..1.0).contains(&self.local_share) {
            return Err(NonlocalError::Value { key: "local_share", value: self.local_share, must: "lie in [0, 1)" });
        }
        Ok(())
    }
}

/// `position + scale shift`.
fn moved(position: &[f64; 3], scale: f64, shift: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| position[axis] + scale * shift[axis])
}
