//! Nodal forces and stiffness of the elements: [`balance`] with their tangent for implicit steps, [`forces`] with viscous parts for
//! procedures that move masses. Both go through all elements and add hourglass forces in the same way, which is here.

pub(crate) mod balance;
pub(crate) mod block;
mod coupling;
pub(crate) mod forces;
pub(crate) mod isotropic;
pub(crate) mod viscosity;

use super::body::Body;
use super::points::Point;
use crate::element::hourglass::HourglassModes;
use rayon::prelude::*;

impl Body {
    /// Contributions of all elements in their order. They are computed in parallel; whoever adds them up in this order gets the
    /// same bits for any number of threads.
    fn for_all_elements<T: Send>(&self, of_element: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        (0..self.mesh().elements.len()).into_par_iter().map(of_element).collect()
    }

    /// Adds the forces that resist the hourglass modes of an element to its nodal forces, N: `factor` (N/m or N s/m) times the
    /// amplitudes of a nodal field (displacements, m, or velocities, m/s). Returns the amplitudes.
    fn add_hourglass_force(
        &self,
        element: usize,
        modes: &HourglassModes,
        factor: f64,
        field: impl Fn(usize) -> [f64; 3],
        force: &mut [f64],
    ) -> Vec<[f64; 3]> {
        let values: Vec<[f64; 3]> = self.mesh().elements[element].iter().map(|&node| field(node)).collect();
        let amplitudes = modes.amplitudes(&values);
        modes.add_force(self.mesh().dimension.count(), factor, &amplitudes, force);
        amplitudes
    }

    /// Shear modulus of an element with one point at its first tangent, Pa: the measure of hourglass control.
    fn first_shear_modulus(&self, element: usize, points: &[Point]) -> f64 {
        points[self.points_of(element).start].first_shear_modulus()
    }
}
