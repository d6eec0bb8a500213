//! Work done on a cell along its path, and what numerical damping took of it.

use super::path::{Matrix, flat};
use crate::solver::PathEnergies;
use crate::space::{determinant, inverse, product, scaled, transpose};

/// Work and damping over the volume of the packing as given. Both are sums over the steps of the grains where the solver counts them. Elsewhere the
/// work is one of trapezoids over committed states: mean second Piola stress on the change of the Green strain, so that rotations do not
/// enter, however large.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathWork {
    deformation: Matrix,
    /// Cauchy stress, Pa, tension positive.
    stress: Matrix,
    /// Volume of the packing as given, m3.
    initial_volume: f64,
    /// J/m3 of the packing as given.
    total: f64,
    /// The same.
    damping: f64,
}

impl PathWork {
    /// Before anything has moved, with the volume of the packing as given, m3.
    pub(super) fn new(deformation: Matrix, stress: Matrix, initial_volume: f64) -> Self {
        Self { deformation, stress, initial_volume, total: 0.0, damping: 0.0 }
    }

    /// Goes on to another committed state: deformation gradient relative to the packing as given, Cauchy stress, Pa, and what was counted
    /// on the way.
    pub(super) fn advance(&mut self, deformation: Matrix, stress: Matrix, counted: Option<PathEnergies>) {
        match counted {
            Some(counted) => {
                self.total += counted.work / self.initial_volume;
                self.damping += counted.damping / self.initial_volume;
            }
            None => self.total += self.trapezoid(&deformation, &stress),
        }
        (self.deformation, self.stress) = (deformation, stress);
    }

    /// Work from the last state to this one, J/m3 of the packing as given.
    fn trapezoid(&self, deformation: &Matrix, stress: &Matrix) -> f64 {
        let pioles = [second_piola(&self.deformation, &self.stress), second_piola(deformation, stress)];
        let strains = [right_cauchy_green(&self.deformation), right_cauchy_green(deformation)];
        let [[before, after], [from, to]] = [pioles.map(|stress| flat(&stress)), strains.map(|strain| flat(&strain))];
        (0..9).map(|k| 0.25 * (before[k] + after[k]) * (to[k] - from[k])).sum()
    }

    /// Work and damping so far over the present volume, J/m3.
    pub(super) fn over_present_volume(&self) -> [f64; 2] {
        let stretch = determinant(&self.deformation);
        [self.total / stretch, self.damping / stretch]
    }
}

/// `F^T F`.
fn right_cauchy_green(f: &Matrix) -> Matrix {
    product(&transpose(f), f)
}

/// Second Piola stress relative to the packing as given, Pa: `J F^-1 sigma F^-T`.
fn second_piola(f: &Matrix, stress: &Matrix) -> Matrix {
    let back = inverse(f);
    scaled(&product(&product(&back, stress), &transpose(&back)), determinant(f))
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// A pressure of 10 against which a cell is compressed to half of its height in a hundred steps, turned by 0.3 in each: the work is 5 per
    /// volume at the start, 10 per volume at the end.
    #[test]
    fn work_of_a_constant_pressure_is_pressure_times_volume_whatever_the_rotation() {
        let pressed = [[-10.0, 0.0, 0.0], [0.0, -10.0, 0.0], [0.0, 0.0, -10.0]];
        let mut work = PathWork::new(UNIT, pressed, 1.0);
        for number in 1..=100 {
            let (sine, cosine) = (0.3 * f64::from(number)).sin_cos();
            let height = 1.0 - 0.005 * f64::from(number);
            work.advance(
                [[cosine, -sine * height, 0.0], [sine, cosine * height, 0.0], [0.0, 0.0, 1.0]],
                pressed,
                None,
            );
        }
        // Measured 1e-4.
        let [total, _] = work.over_present_volume();
        assert!((total - 10.0).abs() < 1e-3, "{total}");
    }

    /// A uniaxial stress that turns with the cell does no work.
    #[test]
    fn a_stressed_cell_that_only_turns_takes_no_work() {
        let (sine, cosine) = 0.3f64.sin_cos();
        let turned = [[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]];
        let mut work = PathWork::new(UNIT, [[7.0, 0.0, 0.0], [0.0; 3], [0.0; 3]], 1.0);
        let along_turned = [
            [7.0 * cosine * cosine, 7.0 * cosine * sine, 0.0],
            [7.0 * cosine * sine, 7.0 * sine * sine, 0.0],
            [0.0; 3],
        ];
        work.advance(turned, along_turned, None);
        assert!(work.over_present_volume()[0].abs() < 1e-14);
    }
}
