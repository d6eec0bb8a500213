//! Whether averaging can turn a wave of the mesh into its opposite.
//!
//! The internal force of an averaged strain is `B^T sigma(A B u)`. On a regular body a wave `exp(i k.x)` is an eigenvector of
//! `A` with the factor `sum_J a_J cos(k.x_J)`; where that is negative, the stiffness of the wave is negative, and it grows
//! without bound in an explicit scheme and makes an implicit one indefinite. On a real mesh the factor is taken, point by
//! point, on the regular grid that has the distances of the point to its nearest neighbours along each axis.

use super::{NonlocalError, NonlocalOperator};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Wave numbers along each axis between zero and the shortest wave that the points resolve.
const WAVES: u32 = 12;

/// Distances that differ by less than this share are one.
const RESOLUTION: f64 = 0.01;

/// Factors above this are rounding.
const ROUNDING: f64 = -1e-9;

impl NonlocalOperator {
    /// Refuses an operator that is unstable.
    pub(super) fn check_stability(&self) -> Result<(), NonlocalError> {
        if self.settings.adjoint || self.is_identity() || self.is_empty() {
            return Ok(());
        }
        let (point, symbol) = self.smallest_symbol();
        if symbol >= ROUNDING {
            return Ok(());
        }
        let share = self.settings.local_share;
        let bare = (symbol - share) / (1.0 - share);
        Err(NonlocalError::Unstable {
            kernel: self.settings.kernel.keyword(),
            radius: self.settings.radius,
            point,
            symbol,
            // A share b maps a factor s to (1 - b) s + b.
            remedy_share: -bare / (1.0 - bare),
        })
    }

    /// The smallest factor by which a wave of the mesh is multiplied, and the point around which that happens.
    pub fn smallest_symbol(&self) -> (usize, f64) {
        let mut grids: BTreeMap<[i64; 3], usize> = BTreeMap::new();
        for point in 0..self.len() {
            let key = self.spacing(point).map(|distance| (distance.ln() / RESOLUTION).round() as i64);
            grids.entry(key).or_insert(point);
        }
        grids
            .into_values()
            .map(|point| (point, self.grid_symbol(&self.spacing(point))))
            .fold((0, f64::INFINITY), |least, next| if next.1 < least.1 { next } else { least })
    }

    /// Distance to the nearest neighbour along each axis, in units of the radius; infinite where there is none.
    fn spacing(&self, point: usize) -> [f64; 3] {
        let mut spacing = [f64::INFINITY; 3];
        for offset in &self.offsets[self.starts[point]..self.starts[point + 1]] {
            let size = offset.map(f64::abs);
            let axis = if size[0] >= size[1] && size[0] >= size[2] {
                0
            } else if size[1] >= size[2] {
                1
            } else {
                2
            };
            if size[axis] > 0.0 {
                spacing[axis] = spacing[axis].min(size[axis] / self.settings.radius);
            }
        }
        spacing
    }

    /// Points of the regular grid that has the distances of a point to its nearest neighbours, in the box around the radius.
    pub(super) fn points_of_grid(&self, point: usize) -> f64 {
        reach(&self.spacing(point)).into_iter().map(|points| 2.0 * points + 1.0).product()
    }

    /// The smallest factor on a regular grid of the given distances, in units of the radius.
    fn grid_symbol(&self, spacing: &[f64; 3]) -> f64 {
        let reach = reach(spacing).map(|points| points as i32);
        let place = |axis: usize, tick: i32| if tick == 0 { 0.0 } else { f64::from(tick) * spacing[axis] };
        let mut stencil = Vec::new();
        for x in -reach[0]..=reach[0] {
            for y in -reach[1]..=reach[1] {
                for z in -reach[2]..=reach[2] {
                    let offset = [place(0, x), place(1, y), place(2, z)];
                    let distance = offset.iter().map(|part| part * part).sum::<f64>().sqrt();
                    let weight = self.settings.kernel.weight(distance);
                    if weight > 0.0 {
                        stencil.push(([x, y, z], weight));
                    }
                }
            }
        }
        let total: f64 = stencil.iter().map(|(_, weight)| weight).sum();
        let waves = reach.map(|reach| if reach > 0 { WAVES } else { 0 });
        let mut least = f64::INFINITY;
        for x in 0..=waves[0] {
            for y in 0..=waves[1] {
                for z in 0..=waves[2] {
                    // Phase from one grid point to the next; pi is the shortest wave.
                    let phase = [x, y, z].map(|tick| PI * f64::from(tick) / f64::from(WAVES));
                    let turned = |ticks: &[i32; 3]| {
                        ticks.iter().zip(&phase).map(|(tick, phase)| f64::from(*tick) * phase).sum::<f64>().cos()
                    };
                    let sum: f64 = stencil.iter().map(|(ticks, weight)| weight * turned(ticks)).sum();
                    least = least.min(sum / total);
                }
            }
        }
        let share = self.settings.local_share;
        (1.0 - share) * least + share
    }
}

/// Points of a regular grid with these distances, in units of the radius, within a radius along each axis.
fn reach(spacing: &[f64; 3]) -> [f64; 3] {
    spacing.map(|distance| if distance.is_finite() { (1.0 / distance).floor() } else { 0.0 })
}
