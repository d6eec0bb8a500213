//! How stiff the stiffest grain is: the bound from which the relaxation takes its masses.
//!
//! With a unit pseudo-time step the explicit motion is stable while `omega_max < 2`. The bound used is
//! `omega_max^2 <= 2 max_i lambda_max(M_i^-1 K_ii)` with `K_ii` the grain's own 3x3 or 6x6 block (translations and
//! rotations), because `(a - b)^2 <= 2 a^2 + 2 b^2` in every contact. Erratum: the single-contact frequencies of
//! [Liu2015] eq. 64 are not bounds; on crystals they allow steps up to four times too long.

use crate::contact::ContactLaw;
use crate::simd::{Mask, Real, Tuple, Vectorised, dispatch};
use crate::solver::kernel::{GrainConstants, ListedPair, PairConstants, spread};
use crate::space::{KernelSpace, Space};

/// Inertia of a grain in the relaxation is this times mass times radius squared; measured best, a solid disc has 0.5.
pub(crate) const INERTIA_FACTOR: f64 = 0.8;

/// Newton steps for an eigenvalue; five leave less than a percent even between close eigenvalues.
const NEWTON_STEPS: u32 = 5;

/// Squarings of a block in space: the bound is then off by at most `6^(1/64)`, 3 %.
const SQUARINGS: u32 = 5;

/// Numbers of a symmetric matrix. In the plane 3x3 as `[xx, yy, zz, xy, xz, yz]`; in space 6x6 as its upper triangle, row by row.
const fn block_length<S: Space>() -> usize {
    if S::DIMENSION == 2 { 6 } else { 21 }
}

/// The contacts of one cell, or of several side by side, as the stiffness bound sees them.
pub(crate) trait StiffContacts<S: Space> {
    /// One number, or one of each cell.
    type Number: Real;

    /// Unit vector from origin to end; zero where they do not touch.
    fn direction(&self, pair: usize) -> <S::Kernel as KernelSpace>::Coordinates<Self::Number>;

    /// m; any number where they do not touch.
    fn overlap(&self, pair: usize) -> Self::Number;
}

/// Which pairs each grain belongs to, in the order of the list.
#[derive(Clone, Debug, Default)]
pub(crate) struct PairsOfGrains {
    /// First entry of each grain, and the end.
    starts: Vec<usize>,
    entries: Vec<PairOfGrain>,
}

/// A pair of a grain.
#[derive(Clone, Copy, Debug, Default)]
struct PairOfGrain {
    /// Place in the list.
    pair: u32,
    /// Whether the grain is its end and not its origin.
    is_end: bool,
}

impl PairsOfGrains {
    /// Forgets a list of pairs that has changed.
    pub(crate) fn clear(&mut self) {
        self.starts.clear();
    }

    /// Takes up a list of pairs, unless that is known.
    pub(crate) fn follow(&mut self, grains: usize, pairs: &[ListedPair]) {
        if !self.starts.is_empty() {
            return;
        }
        self.starts.resize(grains + 1, 0);
        for pair in pairs {
            self.starts[pair.origin as usize + 1] += 1;
            self.starts[pair.end as usize + 1] += 1;
        }
        for grain in 0..grains {
            self.starts[grain + 1] += self.starts[grain];
        }
        self.entries.clear();
        self.entries.resize(2 * pairs.len(), PairOfGrain::default());
        let mut next = self.starts.clone();
        for (place, pair) in pairs.iter().enumerate() {
            for (grain, is_end) in [(pair.origin, false), (pair.end, true)] {
                let next = &mut next[grain as usize];
                self.entries[*next] = PairOfGrain { pair: place as u32, is_end };
                *next += 1;
            }
        }
    }
}

/// Law and grains that the bound is taken for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StiffGrains<'a, S: Space, L: ContactLaw<S::Kernel>> {
    pub(crate) law: &'a L,
    /// Inertia of rotation over mass times radius squared; 0 means that grains do not rotate.
    pub(crate) inertia: f64,
    pub(crate) radii: &'a [f64],
    pub(crate) constants: &'a [GrainConstants],
    pub(crate) pairs: &'a PairsOfGrains,
    /// Constants of the listed pairs.
    pub(crate) pair_constants: &'a [PairConstants<S::Kernel, L>],
}

/// Largest eigenvalue over all grains of the own stiffness block divided by its unit masses and inertias, N/m, of every cell.
pub(crate) fn largest_own_stiffness<S: Space, L: ContactLaw<S::Kernel>, C: StiffContacts<S>>(
    grains: StiffGrains<'_, S, L>,
    contacts: &C,
) -> C::Number {
    dispatch(Search { grains, contacts })
}

/// The search for the stiffest grain.
struct Search<'a, S: Space, L: ContactLaw<S::Kernel>, C> {
    grains: StiffGrains<'a, S, L>,
    contacts: &'a C,
}

impl<S: Space, L: ContactLaw<S::Kernel>, C: StiffContacts<S>> Vectorised for Search<'_, S, L, C> {
    type Output = C::Number;

    #[inline(always)]
    fn run(self) -> C::Number {
        let Self { grains, contacts } = self;
        let zero = C::Number::default();
        let arm = C::Number::splat(arm(grains.inertia));
        let mut largest = zero;
        let bounds = grains.pairs.starts.windows(2);
        for ((bounds, constants), radius) in bounds.zip(grains.constants).zip(grains.radii) {
            let mut numbers = [zero; 21];
            let block = &mut numbers[..block_length::<S>()];
            for &PairOfGrain { pair, is_end } in &grains.pairs.entries[bounds[0]..bounds[1]] {
                let direction = contacts.direction(pair as usize);
                let touches = C::Number::splat(0.5).less(direction.dot(direction));
                if !touches.any() {
                    continue;
                }
                let law = spread::<S::Kernel, L, C::Number>(&grains.pair_constants[pair as usize]);
                let stiffness = grains.law.stiffness(&law, contacts.overlap(pair as usize));
                let [normal, tangential, rolling] = stiffness.map(|value| C::Number::select(touches, value, zero));
                // A quotient for each end of each contact costs as much as the rest; few laws have rolling stiffness.
                let rolls = zero.less(rolling).any();
                let rolling = if rolls { rolling / C::Number::splat(radius * radius) } else { rolling };
                let away = direction.scaled(C::Number::splat(if is_end { -1.0 } else { 1.0 }));
                add_contact::<S, C::Number>(block, away.as_ref(), [normal, tangential, rolling], arm);
            }
            // The close bound is dear in space: only for blocks that a cheap one does not rule out.
            let bound = cheap_bound::<S, C::Number>(block) * C::Number::splat(constants.inverse_mass);
            let may_be_larger = largest.less(bound);
            if may_be_larger.any() {
                raise::<S, C::Number>(&mut largest, may_be_larger, block, constants.inverse_mass);
            }
        }
        largest
    }
}

/// Raises the largest eigenvalue of the cells of a mask to that of a block.
#[inline(never)]
fn raise<S: Space, R: Real>(largest: &mut R, cells: R::Mask, block: &[R], inverse_mass: f64) {
    for lane in (0..R::LANES).filter(|lane| cells.lane(*lane)) {
        let mut own = [0.0; 21];
        for (own, value) in own.iter_mut().zip(block) {
            *own = value.lane(lane);
        }
        let eigenvalue = largest_eigenvalue::<S>(&own[..block.len()]);
        largest.set_lane(lane, f64::max(largest.lane(lane), eigenvalue * inverse_mass));
    }
}

/// Upper bound of the largest eigenvalue: in the plane from mean and deviator, in space by Gershgorin's circles.
#[inline(always)]
fn cheap_bound<S: Space, R: Real>(block: &[R]) -> R {
    if S::DIMENSION == 2 {
        let Deviator { mean, half, .. } = Deviator::of(block);
        // Rounding must not rule out the largest one.
        return (mean + R::splat(2.0) * (half / R::splat(3.0)).sqrt()) * R::splat(1.0 + 1e-14);
    }
    let mut sums = [R::default(); 6];
    let mut place = 0;
    for i in 0..6 {
        for j in i..6 {
            sums[i] += block[place].abs();
            if i != j {
                sums[j] += block[place].abs();
            }
            place += 1;
        }
    }
    sums.into_iter().fold(R::default(), R::larger)
}

/// Scale of the lever arms for an inertia. Zero inertia means that grains do not rotate.
fn arm(inertia: f64) -> f64 {
    if inertia > 0.0 { 1.0 / inertia.sqrt() } else { 0.0 }
}

/// Adds `k_n e e^T + k_t (t, l) (t, l)^T` with the rotation scaled by its inertia, `stiffness` being k_n, k_t and the rolling
/// stiffness over radius squared, N/m, and `direction` the unit vector away from the grain. The lever arm is taken as the radius,
/// which bounds it; `arm` is that of [`arm`].
#[inline(always)]
fn add_contact<S: Space, R: Real>(block: &mut [R], direction: &[R], stiffness: [R; 3], arm: R) {
    if S::DIMENSION == 2 {
        add_in_plane(block, direction, stiffness, arm);
    } else {
        add_in_space(block, direction, stiffness, arm);
    }
}

#[inline(always)]
fn add_in_plane<R: Real>(block: &mut [R], direction: &[R], [normal, tangential, rolling]: [R; 3], arm: R) {
    let (x, y) = (direction[0], direction[1]);
    block[0] += normal * x * x + tangential * y * y;
    block[1] += normal * y * y + tangential * x * x;
    block[2] += (tangential + rolling) * arm * arm;
    block[3] += (normal - tangential) * x * y;
    block[4] -= tangential * arm * y;
    block[5] += tangential * arm * x;
}

/// The slip at the contact is `P (u + a w x e)` with the projection `P = I - e e^T`.
#[inline(always)]
fn add_in_space<R: Real>(block: &mut [R], direction: &[R], [normal, tangential, rolling]: [R; 3], arm: R) {
    let e = [direction[0], direction[1], direction[2]];
    let turning = (tangential + rolling) * arm * arm;
    let couple = tangential * arm;
    let mut place = 0;
    for i in 0..6 {
        for j in i..6 {
            let unit = R::splat(if i == j { 1.0 } else { 0.0 });
            let square = e[i % 3] * e[j % 3];
            block[place] += match (i < 3, j < 3) {
                (true, true) => normal * square + tangential * (unit - square),
                (true, false) => couple * across(e, i, j - 3),
                _ => turning * (unit - square),
            };
            place += 1;
        }
    }
}

/// Component `ij` of the matrix that takes `w` to `w x e`.
#[inline(always)]
fn across<R: Real>(e: [R; 3], i: usize, j: usize) -> R {
    match (3 + j - i) % 3 {
        0 => R::default(),
        1 => e[(i + 2) % 3],
        _ => -e[(i + 1) % 3],
    }
}

/// Upper bound of the largest eigenvalue of a block.
fn largest_eigenvalue<S: Space>(block: &[f64]) -> f64 {
    if S::DIMENSION == 2 { largest_of_three(block) } else { largest_of_six(block) }
}

/// A symmetric 3x3 matrix as its mean and invariants of its deviator.
struct Deviator<R> {
    mean: R,
    /// Half the squared norm.
    half: R,
    determinant: R,
}

impl<R: Real> Deviator<R> {
    #[inline(always)]
    fn of(block: &[R]) -> Self {
        let &[xx, yy, zz, xy, xz, yz] = block else { unreachable!("a block in the plane has six numbers") };
        let mean = (xx + yy + zz) / R::splat(3.0);
        let (x, y, z) = (xx - mean, yy - mean, zz - mean);
        let half = R::splat(0.5) * (x * x + y * y + z * z) + (xy * xy + xz * xz + yz * yz);
        let determinant = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz);
        Self { mean, half, determinant }
    }
}

/// Upper bound of the largest eigenvalue of a symmetric 3x3 matrix, tight to rounding unless two eigenvalues nearly
/// coincide.
///
/// Newton's method on the characteristic cubic, started above its largest root, approaches that root from above: every
/// iterate is a bound. Arithmetic alone, so that the masses and with them all results do not depend on a system's
/// mathematical library.
fn largest_of_three(block: &[f64]) -> f64 {
    // Characteristic cubic of the deviator: r^3 - half r - determinant.
    let Deviator { mean, half, determinant } = Deviator::of(block);
    let mut root = 2.0 * (half / 3.0).sqrt();
    for _ in 0..NEWTON_STEPS {
        let slope = 3.0 * root * root - half;
        if slope <= 0.0 {
            break;
        }
        root -= (root * (root * root - half) - determinant) / slope;
    }
    mean + root
}

/// Upper bound of the largest eigenvalue of a symmetric, positive semi-definite 6x6 matrix: the root of the trace of a
/// high power of it.
fn largest_of_six(block: &[f64]) -> f64 {
    let mut matrix = [[0.0; 6]; 6];
    let mut place = 0;
    for i in 0..6 {
        for j in i..6 {
            (matrix[i][j], matrix[j][i]) = (block[place], block[place]);
            place += 1;
        }
    }
    let trace: f64 = (0..6).map(|i| matrix[i][i]).sum();
    if trace <= 0.0 {
        return 0.0;
    }
    let mut power = matrix.map(|row| row.map(|value| value / trace));
    let mut root = 1.0;
    // lambda^(2^k) <= trace of the 2^k-th power; each power is scaled to trace 1 and the scale's root collected.
    for level in 1..=SQUARINGS {
        power = squared(&power);
        let trace: f64 = (0..6).map(|i| power[i][i]).sum();
        root *= repeated_root(trace, level);
        power = power.map(|row| row.map(|value| value / trace));
    }
    // One more doubling comes free: the trace of the square is the squared norm.
    let square: f64 = power.iter().flatten().map(|value| value * value).sum();
    trace * root * repeated_root(square, SQUARINGS + 1)
}

fn squared(a: &[[f64; 6]; 6]) -> [[f64; 6]; 6] {
    let mut square = [[0.0; 6]; 6];
    for i in 0..6 {
        for j in i..6 {
            let mut sum = 0.0;
            for k in 0..6 {
                sum += a[i][k] * a[k][j];
            }
            (square[i][j], square[j][i]) = (sum, sum);
        }
    }
    square
}

/// The `2^times`-th root.
fn repeated_root(value: f64, times: u32) -> f64 {
    (0..times).fold(value, |root, _| root.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{Components, Discs, Spheres};
    use nalgebra::{Matrix3, Matrix6};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigenvalue_is_bounded_from_above_and_tightly(v in proptest::array::uniform6(-5.0..5.0f64)) {
            let [a, b, c, d, e, f] = v;
            let matrix = Matrix3::new(a, d, e, d, b, f, e, f, c);
            let reference = matrix.symmetric_eigenvalues().max();
            let spread = matrix.norm();
            let bound = largest_eigenvalue::<Discs>(&v);
            prop_assert!(bound >= reference - 1e-13 * spread);
            prop_assert!(bound <= reference + 0.02 * spread);
        }

        #[test]
        fn eigenvalue_of_a_sphere_is_bounded_from_above_and_tightly(
            contacts in proptest::collection::vec((proptest::array::uniform3(-1.0..1.0f64), 0.1..2.0f64, 0.0..2.0f64), 1..9),
        ) {
            let mut block = [0.0; 21];
            let mut matrix = Matrix6::zeros();
            for (direction, normal, tangential) in contacts {
                prop_assume!(direction.norm() > 0.1);
                let direction = direction.times(1.0 / direction.norm());
                add_contact::<Spheres, f64>(&mut block, &direction, [normal, tangential, 0.0], arm(0.8));
                // The same from the definition: stiffness of the slip of a motion (u, w) with w = turn / sqrt(0.8).
                let e = nalgebra::Vector3::from(direction);
                let project = Matrix3::identity() - e * e.transpose();
                let mut gradient = nalgebra::Matrix3x6::zeros();
                gradient.fixed_view_mut::<3, 3>(0, 0).copy_from(&project);
                let turn = -project * e.cross_matrix() / 0.8f64.sqrt();
                gradient.fixed_view_mut::<3, 3>(0, 3).copy_from(&turn);
                matrix += tangential * gradient.transpose() * gradient;
                let mut along = nalgebra::RowVector6::zeros();
                along.fixed_view_mut::<1, 3>(0, 0).copy_from(&e.transpose());
                matrix += normal * along.transpose() * along;
            }
            let reference = matrix.symmetric_eigenvalues().max();
            let bound = largest_eigenvalue::<Spheres>(&block);
            prop_assert!(bound >= reference * (1.0 - 1e-12), "{bound} {reference}");
            prop_assert!(bound <= reference * 1.03, "{bound} {reference}");
        }
    }
}
