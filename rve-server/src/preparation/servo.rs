//! The strain that should bring a cell to its target stress.

use super::stress_target::{Matrix, StressTarget, symmetric_pairs};
use crate::homogenization::fluctuation::cell_deformation;
use crate::space::{Space, Tensor};
use nalgebra::{DMatrix, DVector};
use protocol::{Tensor2, Tensor4};

/// Largest strain component of one servo step, unless the caller wants smaller ones.
pub(crate) const LARGEST_STRAIN: f64 = 1e-3;

/// Shear over bulk modulus that is assumed while nothing is known yet.
const FIRST_SHEAR_TO_BULK: f64 = 0.5;

/// Isotropic compression where the response is singular: a network of too few contacts says nothing about the stress.
const SINGULAR_COMPRESSION: f64 = 1e-5;

/// Stress that a step aims at, in laboratory axes: the target, or a step of a factor of two towards it while the
/// pressure is still far off, because the network stiffens as it is compressed.
pub(crate) fn aim(target: &StressTarget, deviator: &Matrix, stress: &Tensor2) -> Matrix {
    let pressure = target.pressure.min(2.0 * pressure(stress, target.dimension).max(0.01 * target.pressure));
    let share = pressure / target.pressure;
    let mut aim = deviator.map(|row| row.map(|value| share * value));
    for (i, row) in aim.iter_mut().enumerate().take(target.dimension) {
        row[i] += -pressure;
    }
    aim
}

/// Mean pressure of a stress, Pa, compression positive.
pub(crate) fn pressure(stress: &Tensor2, dimension: usize) -> f64 {
    if dimension == 2 {
        -0.5 * (stress.get(0, 0) + stress.get(1, 1))
    } else {
        -(stress.get(0, 0) + stress.get(1, 1) + stress.get(2, 2)) / 3.0
    }
}

/// What ends a servo that does not reach its target.
pub(crate) struct ServoLimits<S: Space> {
    /// Most servo steps.
    pub(crate) increments: u32,
    /// The vectors of the cell at the start, m, by rows.
    start: S::Tensor,
    /// How far a component of the deformation since then may be from the identity.
    most_strain: f64,
}

impl<S: Space> ServoLimits<S> {
    /// `increments` steps, and a strain of `most` of a cell that has these vectors. The strain is below a half: a larger deformation of a lattice cannot
    /// be told from another choice of its vectors.
    pub(crate) fn increments_and_strain(increments: u32, rows: S::Tensor, most: f64) -> Self {
        Self { increments, start: rows, most_strain: most }
    }

    /// Whether a cell with these vectors has been strained by more than the limit.
    pub(crate) fn are_passed_by(&self, rows: &S::Tensor) -> bool {
        // A cell whose vectors lean far is described by shorter ones from its first trial on: that is no strain.
        let deformation = cell_deformation::<S>(&self.start, rows, &S::Tensor::IDENTITY);
        let identity = S::Tensor::IDENTITY;
        let mut components = deformation.components().zip(identity.components());
        !components.all(|(now, then)| (now - then).abs() <= self.most_strain)
    }
}

/// Steps in which the stress error must fall by a tenth; a servo that takes longer goes round in circles.
const LONGEST_CIRCLE: u32 = 100;

/// Notices that a servo goes round in circles: a contact that opens under the steps of one operator and closes under those
/// of the other leads from one state to the other and back for ever, or converges ever more slowly.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StagnationMonitor {
    milestone: f64,
    steps: u32,
}

impl StagnationMonitor {
    /// Before the first step.
    pub(crate) fn new() -> Self {
        Self { milestone: f64::INFINITY, steps: 0 }
    }

    /// Takes the next stress error; whether the servo has come no further for too long.
    pub(crate) fn is_circling(&mut self, error: f64) -> bool {
        if error < 0.9 * self.milestone {
            *self = Self { milestone: error, steps: 0 };
        } else {
            self.steps += 1;
        }
        self.steps >= LONGEST_CIRCLE
    }
}

/// Model of `d stress / d strain`: the network's own operator, or one updated from the steps.
#[derive(Clone, Debug)]
pub(crate) struct Response {
    dimension: usize,
    matrix: DMatrix<f64>,
}

impl Response {
    /// An isotropic guess from a bulk modulus, Pa.
    pub(crate) fn isotropic(bulk: f64, dimension: usize) -> Self {
        let pairs = symmetric_pairs(dimension);
        let shear = FIRST_SHEAR_TO_BULK * bulk;
        let lame = bulk - 2.0 * shear / dimension as f64;
        let matrix = DMatrix::from_fn(pairs.len(), pairs.len(), |row, column| {
            let (normal_row, normal_column) = (row < dimension, column < dimension);
            let twice_shear = if row == column { 2.0 * shear } else { 0.0 };
            twice_shear + if normal_row && normal_column { lame } else { 0.0 }
        });
        Self { dimension, matrix }
    }

    /// The operator of the network itself.
    pub(crate) fn adopt(&mut self, operator: &Tensor4) {
        let pairs = symmetric_pairs(self.dimension);
        self.matrix = DMatrix::from_fn(pairs.len(), pairs.len(), |row, column| {
            let ((i, j), (k, l)) = (pairs[row], pairs[column]);
            let of = |i: usize, j: usize| {
                if k == l { operator.get(i, j, k, l) } else { operator.get(i, j, k, l) + operator.get(i, j, l, k) }
            };
            if i == j { of(i, j) } else { 0.5 * (of(i, j) + of(j, i)) }
        });
    }

    /// Learns from one step (Broyden's update): the model then repeats what the step did.
    pub(crate) fn learn(&mut self, strain: &Matrix, change: &Matrix) {
        let (step, effect) = (components(strain, self.dimension), components(change, self.dimension));
        let square = step.norm_squared();
        if square > 0.0 {
            let surprise = effect - &self.matrix * &step;
            self.matrix += surprise * step.transpose() / square;
        }
    }

    /// Symmetric strain that is to change `stress` into `aim`; a little compression if the model says nothing, cut to
    /// `most`, a size that the model can be trusted for.
    pub(crate) fn strain(&self, aim: &Matrix, stress: &Tensor2, most: f64) -> Matrix {
        let pairs = symmetric_pairs(self.dimension);
        let wanted = DVector::from_iterator(
            pairs.len(),
            pairs.iter().map(|&(i, j)| {
                if i == j {
                    aim[i][j] - stress.get(i, j)
                } else {
                    aim[i][j] - 0.5 * (stress.get(i, j) + stress.get(j, i))
                }
            }),
        );
        let step = self.matrix.clone().lu().solve(&wanted).filter(|step| step.iter().all(|value| value.is_finite()));
        let step = step.unwrap_or_else(|| {
            DVector::from_fn(pairs.len(), |row, _| if row < self.dimension { -SINGULAR_COMPRESSION } else { 0.0 })
        });
        let largest = step.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        let shrink = (most / largest).min(1.0);
        let mut strain = [[0.0; 3]; 3];
        for (&(i, j), value) in pairs.iter().zip(step.iter()) {
            strain[i][j] = value * shrink;
            strain[j][i] = strain[i][j];
        }
        strain
    }
}

fn components(tensor: &Matrix, dimension: usize) -> DVector<f64> {
    let pairs = symmetric_pairs(dimension);
    DVector::from_iterator(pairs.len(), pairs.iter().map(|&(i, j)| 0.5 * (tensor[i][j] + tensor[j][i])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Discs;

    /// Grains that flow flatten their cell, which is caught on the way; other vectors of the same lattice are no strain.
    #[test]
    fn a_cell_that_flattens_passes_the_limit() {
        let start = [[1.0, 0.1], [-0.2, 1.1]];
        let limits = ServoLimits::<Discs>::increments_and_strain(10, start, 0.4);
        let stretched = |stretch: f64| start.map(|row| [row[0] * stretch, row[1] / stretch]);
        for step in 0..=44 {
            let stretch = 1.0 + 0.01 * f64::from(step);
            assert_eq!(limits.are_passed_by(&stretched(stretch)), step > 40, "{stretch}");
        }
        assert!(limits.are_passed_by(&stretched(1.0 / 1.45)));
        let [first, second] = start;
        assert!(!limits.are_passed_by(&[first, [second[0] - first[0], second[1] - first[1]]]));
    }

    /// On a linear material that it does not know, the learning servo finds the target stress.
    #[test]
    fn learnt_response_reaches_a_full_stress_tensor() {
        for dimension in [2, 3] {
            let rows: Vec<Vec<f64>> = (0..dimension)
                .map(|i| (0..dimension).map(|j| if i == j { -1.0 - 0.2 * i as f64 } else { 0.1 }).collect())
                .collect();
            let target = StressTarget::from_rows(&rows, dimension).unwrap();
            let count = symmetric_pairs(dimension).len();
            let material = DMatrix::from_fn(count, count, |i, j| {
                if i == j { 300.0 + 20.0 * i as f64 } else { 40.0 / (1.0 + i as f64 + 2.0 * j as f64) }
            });
            let mut response = Response::isotropic(500.0, dimension);
            let mut stress = Tensor2::ZERO;
            let mut steps = 0;
            loop {
                let aimed = aim(&target, &target.deviator, &stress);
                let strain = response.strain(&aimed, &stress, LARGEST_STRAIN);
                let effect = &material * components(&strain, dimension);
                let mut change = [[0.0; 3]; 3];
                for (&(i, j), value) in symmetric_pairs(dimension).iter().zip(effect.iter()) {
                    (change[i][j], change[j][i]) = (*value, *value);
                }
                for i in 0..3 {
                    for j in 0..3 {
                        stress.0[3 * i + j] += change[i][j];
                    }
                }
                response.learn(&strain, &change);
                steps += 1;
                let error = (0..dimension)
                    .flat_map(|i| (0..dimension).map(move |j| (i, j)))
                    .map(|(i, j)| (stress.get(i, j) - target.component(i, j)).abs())
                    .fold(0.0, f64::max);
                if error < 1e-9 {
                    break;
                }
                assert!(steps < 60, "{dimension}D: still off by {error}");
            }
        }
    }
}
