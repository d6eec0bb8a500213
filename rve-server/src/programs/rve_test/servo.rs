//! Search for the strain components that bring the controlled stress components to their targets.
//!
//! A Newton search with the operator of the frozen network as first guess of the derivative and rank-one secant updates
//! afterwards: once contacts slide, two trials know the cell better than any operator. Updates and steps are taken from
//! the best trial so far. A derivative that is not positive would walk down a softening branch without end, so it is
//! replaced by the elastic one. With a single unknown the trials also bracket the target, which keeps the search
//! inside and shows when the cell snaps across the target: then no strain meets it, and the nearer side is the answer.

use super::path::{COMPONENTS, Matrix, Operator, flat, tensor_of};
use nalgebra::{DMatrix, DVector};

/// Largest change of a strain component in one iteration, dimensionless.
const LARGEST_STEP: f64 = 0.01;

/// Smallest lengthened stride, dimensionless.
const SMALLEST_STRIDE: f64 = 1e-7;

/// Number of trials on one side of the target after which strides are lengthened unless the search converges.
const MIN_TRIALS: u32 = 4;

/// Unknown strain components, numbered 11, 12, 13, 21, ..., and the stress targets of the same numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Servo {
    unknowns: Vec<usize>,
    targets: Vec<f64>,
    derivative: DMatrix<f64>,
    elastic: DMatrix<f64>,
    best: Option<Sample>,
    /// With one unknown: the trials nearest the target from below and from above, as (strain, stress difference).
    bracket: [Option<(f64, f64)>; 2],
    trials: u32,
    /// With one unknown: distance of the last trial from the target, Pa.
    last_difference: f64,
    /// With one unknown: the strain of the first trial.
    first: Option<f64>,
}

#[derive(Clone, Debug, PartialEq)]
struct Sample {
    gradient: DVector<f64>,
    residual: DVector<f64>,
}

/// How far the worst controlled component is from its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Miss {
    /// Number of the component, 11, 12, 13, 21, ...
    pub component: usize,
    /// Value reached, Pa.
    pub reached: f64,
    /// Value wanted, Pa.
    pub target: f64,
}

impl Servo {
    /// Prepares a search. `derivative` and `elastic` are `d sigma / dG` of the slip and of the elastic operator.
    pub(super) fn new(targets: &[Option<f64>; COMPONENTS], derivative: &Operator, elastic: &Operator) -> Self {
        let unknowns: Vec<usize> = (0..COMPONENTS).filter(|place| targets[*place].is_some()).collect();
        let elastic = reduced(elastic, &unknowns);
        Self {
            targets: targets.iter().flatten().copied().collect(),
            derivative: usable(reduced(derivative, &unknowns), &elastic),
            elastic,
            unknowns,
            best: None,
            bracket: [None; 2],
            trials: 0,
            last_difference: f64::INFINITY,
            first: None,
        }
    }

    /// The unknown components that cancel `expected_stress - target` to first order, added to `gradient`.
    pub(super) fn predict(&self, gradient: &Matrix, expected_stress: &Matrix) -> Matrix {
        let residual = self.residual(expected_stress);
        self.stepped(&self.pick(gradient), &residual, gradient)
    }

    /// Takes in a trial and returns the next strain to try; its prescribed components are those of `gradient`.
    pub(super) fn improve(&mut self, gradient: &Matrix, stress: &Matrix) -> Matrix {
        let sample = Sample { gradient: self.pick(gradient), residual: self.residual(stress) };
        let best = match self.best.take() {
            None => sample,
            Some(best) => {
                let moved = &sample.gradient - &best.gradient;
                let surprise = &sample.residual - &best.residual - &self.derivative * &moved;
                let square = moved.norm_squared();
                if square > 0.0 {
                    let updated = &self.derivative + surprise * moved.transpose() / square;
                    self.derivative = usable(updated, &self.elastic);
                }
                if sample.residual.norm() < best.residual.norm() { sample } else { best }
            }
        };
        let next = self.stepped(&best.gradient, &best.residual, gradient);
        self.best = Some(best);
        self.kept_inside(gradient, stress, next)
    }

    /// Whether strains so close that a sound network would differ by less than `tolerance` lie on both sides of the
    /// target, Pa.
    pub(super) fn has_pinned_a_jump(&self, tolerance: f64) -> bool {
        self.interval().is_some_and(|[below, above]| self.elastic[(0, 0)] * (above - below).abs() < 0.1 * tolerance)
    }

    /// The strain of the best trial so far, its prescribed components those of `gradient`.
    pub(super) fn best(&self, gradient: &Matrix) -> Matrix {
        let mut values = flat(gradient);
        if let Some(best) = &self.best {
            for (place, &component) in self.unknowns.iter().enumerate() {
                values[component] = best.gradient[place];
            }
        }
        tensor_of(&values)
    }

    /// The derivative as the trials have left it, `d sigma / dG` of the controlled components; zero elsewhere.
    pub(super) fn derivative(&self) -> Operator {
        let mut operator = [[0.0; COMPONENTS]; COMPONENTS];
        for (row, &stress) in self.unknowns.iter().enumerate() {
            for (column, &strain) in self.unknowns.iter().enumerate() {
                operator[stress][strain] = self.derivative[(row, column)];
            }
        }
        operator
    }

    fn interval(&self) -> Option<[f64; 2]> {
        Some([self.bracket[0]?.0, self.bracket[1]?.0])
    }

    /// Takes the trial into the bracket and returns `next`, or the middle of the bracket if `next` is not well inside.
    fn kept_inside(&mut self, gradient: &Matrix, stress: &Matrix, next: Matrix) -> Matrix {
        let [component] = self.unknowns[..] else { return next };
        let (here, difference) = (flat(gradient)[component], self.residual(stress)[0]);
        let side = usize::from(difference > 0.0);
        let width_before = self.interval().map(|[below, above]| (above - below).abs());
        // Only a bracket that shrinks can pin a jump: of two trials on one side the nearer in strain to the other side
        // counts, whatever its stress.
        self.trials += 1;
        let is_converging = difference.abs() < 0.5 * self.last_difference;
        self.last_difference = difference.abs();
        let first = *self.first.get_or_insert(here);
        // Stretching raises a stress: below the target the search goes to larger strain, above it to smaller.
        let outward = if difference > 0.0 { -1.0 } else { 1.0 };
        let replaces = match (self.bracket[side], self.bracket[1 - side]) {
            (Some((old, _)), Some((other, _))) => (here - other).abs() < (old - other).abs(),
            (Some((old, _)), None) => (here - old) * outward > 0.0,
            (None, _) => true,
        };
        if replaces {
            self.bracket[side] = Some((here, difference));
        }
        let mut values = flat(&next);
        let Some([below, above]) = self.interval() else {
            if self.trials < MIN_TRIALS || is_converging {
                return next;
            }
            // Still on one side of the target: go beyond all trials by as much as they span.
            let outermost = self.bracket[side].map_or(here, |(strain, _)| strain);
            let newton = (values[component] - here).abs();
            let stride = newton.max((outermost - first).abs()).clamp(SMALLEST_STRIDE, LARGEST_STEP);
            values[component] = outermost + outward * stride;
            return tensor_of(&values);
        };
        let shrinks = width_before.is_none_or(|width| (above - below).abs() < 0.6 * width);
        let share = (flat(&next)[component] - below) / (above - below);
        if shrinks && share > 0.02 && share < 0.98 {
            return next;
        }
        values[component] = 0.5 * (below + above);
        tensor_of(&values)
    }

    /// The controlled component farthest from its target.
    pub(super) fn miss(&self, stress: &Matrix) -> Miss {
        let mut targets = [None; COMPONENTS];
        for (&component, &target) in self.unknowns.iter().zip(&self.targets) {
            targets[component] = Some(target);
        }
        Miss::farthest(stress, &targets)
    }

    fn residual(&self, stress: &Matrix) -> DVector<f64> {
        let stress = flat(stress);
        DVector::from_iterator(
            self.unknowns.len(),
            self.unknowns.iter().zip(&self.targets).map(|(&component, target)| stress[component] - target),
        )
    }

    fn pick(&self, gradient: &Matrix) -> DVector<f64> {
        let values = flat(gradient);
        DVector::from_iterator(self.unknowns.len(), self.unknowns.iter().map(|&component| values[component]))
    }

    fn stepped(&self, from: &DVector<f64>, residual: &DVector<f64>, gradient: &Matrix) -> Matrix {
        let step = [&self.derivative, &self.elastic]
            .into_iter()
            .find_map(|matrix| matrix.clone().lu().solve(residual).filter(|step| step.iter().all(|v| v.is_finite())))
            .unwrap_or_else(|| DVector::zeros(self.unknowns.len()));
        let mut next = flat(gradient);
        for (place, &component) in self.unknowns.iter().enumerate() {
            next[component] = from[place] - step[place].clamp(-LARGEST_STEP, LARGEST_STEP);
        }
        tensor_of(&next)
    }
}

impl Miss {
    /// The component farthest from its target; at least one has a target.
    pub(super) fn farthest(stress: &Matrix, targets: &[Option<f64>; COMPONENTS]) -> Self {
        let stress = flat(stress);
        let mut worst: Option<Self> = None;
        for (component, target) in targets.iter().enumerate() {
            let Some(target) = *target else { continue };
            let miss = Self { component, reached: stress[component], target };
            if worst.is_none_or(|worst| miss.distance() > worst.distance()) {
                worst = Some(miss);
            }
        }
        worst.expect("a stress is controlled")
    }

    /// Distance from the target, Pa.
    pub(super) fn distance(&self) -> f64 {
        (self.reached - self.target).abs()
    }
}

fn reduced(operator: &Operator, unknowns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(unknowns.len(), unknowns.len(), |row, column| operator[unknowns[row]][unknowns[column]])
}

/// `candidate` if its symmetric part is positive definite, else `elastic`.
fn usable(candidate: DMatrix<f64>, elastic: &DMatrix<f64>) -> DMatrix<f64> {
    let symmetric = (&candidate + candidate.transpose()) * 0.5;
    // A floor of 1 % of the elastic stiffness bounds the step.
    let floor = 0.01 * elastic.diagonal().amax();
    let softest = symmetric.symmetric_eigenvalues().iter().copied().fold(f64::INFINITY, f64::min);
    if softest > floor { candidate } else { elastic.clone() }
}
