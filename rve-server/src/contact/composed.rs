//! The composition: springs, friction, adhesion, and on request rolling resistance and viscosity.

use super::adhesion::attraction;
use super::hertz_mindlin::HertzSprings;
use super::law::{AT_LIMIT, ContactLaw, ContactMotion, ContactResponse, Viscous};
use super::linear::LinearSprings;
use super::rolling::{RollingSpring, rolled};
use super::springs::Springs;
use super::unloading::{TangentialUnloading, unloading_factor};
use crate::simd::{Real, Tuple};
use crate::space::{KernelSpace, Shortened};

/// Linear springs and Coulomb friction.
pub type PlainLinear = ComposedLaw<LinearSprings, 0>;
/// Linear springs, Coulomb friction, rolling resistance, viscosity.
pub type ExtendedLinear = ComposedLaw<LinearSprings, 4>;
/// Hertz-Mindlin springs and Coulomb friction.
pub type PlainHertzMindlin = ComposedLaw<HertzSprings, 1>;
/// Hertz-Mindlin springs, Coulomb friction, rolling resistance, viscosity.
pub type ExtendedHertzMindlin = ComposedLaw<HertzSprings, 4>;

/// A contact law that remembers `MEMORY` numbers per contact: none, the [size](Springs::contact_size) at the last evaluation, or
/// the overlap then and a rolling moment of up to three components. Rolling resistance and viscosity need all four; with fewer,
/// neither is compiled in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComposedLaw<N: Springs, const MEMORY: usize> {
    /// Normal and tangential springs.
    pub springs: N,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Cohesive overlap C, m.
    pub cohesion: f64,
    /// Effect of unloading on tangential forces.
    pub unloading: TangentialUnloading,
    /// Rolling resistance.
    pub rolling: RollingSpring,
    /// Contact viscosity over stiffness in pseudo-time steps: a motion of one step is answered by this many times the
    /// elastic force it causes, across the contact within the friction limit of spring and dashpot together. Nothing moves at
    /// equilibrium, so no quasi-static result depends on it.
    pub viscosity: f64,
}

/// A plane is a grain of this many radii to the springs: rigid in shape, of the grains' material.
const WALL_RADIUS: f64 = 1e9;

/// Places in the constants of a pair.
const NORMAL: usize = 0;
const TANGENTIAL: usize = 1;
const ATTRACTION: usize = 2;
const LIMIT: usize = 3;
const ROLLING_ARM_SQUARE: usize = 4;
const ROLLING_LIMIT_ARM: usize = 5;
/// 1 / k_t of springs whose tangential stiffness is constant; 0 without tangential stiffness.
const COMPLIANCE: usize = 6;

impl<N: Springs, const MEMORY: usize> ComposedLaw<N, MEMORY> {
    const IS_EXTENDED: bool = MEMORY == 4;

    /// Springs and Coulomb friction: no cohesion, no rolling resistance, no viscosity, and no motion that gains energy.
    pub const fn plain(springs: N, friction: f64) -> Self {
        Self {
            springs,
            friction,
            cohesion: 0.0,
            unloading: TangentialUnloading::Rescaled,
            rolling: RollingSpring { stiffness: 0.0, friction: 0.0 },
            viscosity: 0.0,
        }
    }

    /// First number of a memory.
    #[inline(always)]
    fn remembered<R: Real>(overlap: R) -> R {
        if Self::IS_EXTENDED { overlap } else { N::contact_size(overlap) }
    }

    /// Tangential stiffness at the last evaluation, N/m.
    #[inline(always)]
    fn old_stiffness<R: Real>(constants: &[R; 7], memory: &[R; MEMORY]) -> R {
        if !N::TANGENT_VARIES {
            return constants[TANGENTIAL];
        }
        let size = if Self::IS_EXTENDED { N::contact_size(memory[0]) } else { memory[0] };
        N::stiffness_of_size(constants[TANGENTIAL], size)
    }

    /// The rolling moment in a memory.
    #[inline(always)]
    fn moment<K: KernelSpace, R: Real>(memory: &[R; MEMORY]) -> K::Axial<R> {
        K::Axial::build(|i| if Self::IS_EXTENDED { memory[1 + i] } else { R::default() })
    }

    #[inline(always)]
    fn keep_moment<K: KernelSpace, R: Real>(memory: &mut [R; MEMORY], moment: K::Axial<R>) {
        if Self::IS_EXTENDED {
            for (kept, value) in memory[1..].iter_mut().zip(moment.as_ref()) {
                *kept = *value;
            }
        }
    }

    /// Tangential energy, J, of a force of this square; zero without tangential stiffness.
    #[inline(always)]
    fn spring_energy<R: Real>(square: R, stiffness: R) -> R {
        R::select(R::default().less(stiffness), R::splat(0.5) * square / stiffness, R::default())
    }
}

impl<K: KernelSpace, N: Springs, const MEMORY: usize> ContactLaw<K> for ComposedLaw<N, MEMORY> {
    type Constants<R: Real> = [R; 7];
    type Memory<R: Real> = [R; MEMORY];
    const ROLLS: bool = Self::IS_EXTENDED;

    fn with_friction(self, friction: f64) -> Self {
        Self { friction, ..self }
    }

    fn constants(&self, radii: [f64; 2]) -> [f64; 7] {
        let [normal, tangential] = self.springs.coefficients(radii);
        let mut constants = [0.0; 7];
        constants[NORMAL] = normal;
        constants[TANGENTIAL] = tangential;
        constants[ATTRACTION] = attraction::<N>(normal, self.cohesion);
        constants[LIMIT] = self.friction * normal;
        constants[ROLLING_ARM_SQUARE] = self.rolling.arm_square(radii);
        constants[ROLLING_LIMIT_ARM] = self.rolling.limit_arm(radii);
        if !N::TANGENT_VARIES && tangential > 0.0 {
            constants[COMPLIANCE] = 1.0 / tangential;
        }
        constants
    }

    fn wall_constants(&self, radius: f64) -> [f64; 7] {
        let mut constants = <Self as ContactLaw<K>>::constants(self, [radius, WALL_RADIUS * radius]);
        let rolling = if self.friction > 0.0 { self.rolling } else { RollingSpring::default() };
        constants[ROLLING_ARM_SQUARE] = rolling.arm_square([radius; 2]);
        constants[ROLLING_LIMIT_ARM] = rolling.limit_arm([radius; 2]);
        constants
    }

    #[inline(always)]
    fn limits_scaled<R: Real>(&self, constants: &[R; 7], factor: R) -> [R; 7] {
        let mut scaled = *constants;
        scaled[LIMIT] = scaled[LIMIT] * factor;
        scaled[ROLLING_LIMIT_ARM] = scaled[ROLLING_LIMIT_ARM] * factor;
        scaled
    }

    fn resumed(&self, overlap: f64, rolling_moment: K::Axial<f64>) -> [f64; MEMORY] {
        let mut memory = [0.0; MEMORY];
        if MEMORY > 0 {
            memory[0] = Self::remembered(overlap);
        }
        Self::keep_moment::<K, f64>(&mut memory, rolling_moment);
        memory
    }

    fn rolling_moment(&self, memory: &[f64; MEMORY]) -> K::Axial<f64> {
        Self::moment::<K, f64>(memory)
    }

    #[inline(always)]
    fn carry<R: Real>(&self, memory: &mut [R; MEMORY], carry: impl Fn(K::Axial<R>) -> K::Axial<R>) {
        if Self::IS_EXTENDED {
            let moment = carry(Self::moment::<K, R>(memory));
            Self::keep_moment::<K, R>(memory, moment);
        }
    }

    #[inline(always)]
    fn respond<R: Real>(
        &self,
        constants: &[R; 7],
        motion: &ContactMotion<K, R>,
        memory: &mut [R; MEMORY],
    ) -> ContactResponse<K, R> {
        let zero = R::default();
        let overlap = motion.overlap;
        let elastic = N::force(constants[NORMAL], overlap);
        let limit = N::force(constants[LIMIT], overlap);
        let tangential = N::tangential_stiffness(constants[TANGENTIAL], overlap);
        let compliance = if N::TANGENT_VARIES {
            R::select(zero.less(tangential), R::splat(1.0) / tangential, zero)
        } else {
            constants[COMPLIANCE]
        };
        let (mut carried, mut dissipation) = (motion.carried, zero);
        let mut rolled_before = Self::moment::<K, R>(memory);
        if N::TANGENT_VARIES {
            let ratio = tangential / Self::old_stiffness(constants, memory);
            let factor = unloading_factor(self.unloading, ratio);
            // f^2 / 2 k of the old stiffness less that of the new one, with k_old = k / ratio and f times the factor.
            let mut lost = R::splat(0.5) * compliance * carried.dot(carried) * (ratio - factor * factor);
            carried = carried.scaled(factor);
            if Self::IS_EXTENDED {
                // The rolling stiffness is a multiple of the tangential one, and its spring answers alike.
                let stiffness = constants[ROLLING_ARM_SQUARE] * tangential;
                lost += Self::spring_energy(rolled_before.dot(rolled_before), stiffness) * (ratio - factor * factor);
                rolled_before = rolled_before.scaled(factor);
            }
            dissipation = R::select(motion.touched, lost, zero);
        }
        let attempt = carried.plus(motion.slip.scaled(tangential)).where_or(motion.touched, K::Axial::zero());
        let Shortened { kept, lost, at_limit } = K::shortened(attempt, limit, AT_LIMIT);
        dissipation += lost * compliance;
        let mut response = ContactResponse {
            normal_force: constants[ATTRACTION] - elastic,
            tangential_force: kept,
            viscous: None,
            couple: None,
            at_limit,
            dissipation,
        };
        if Self::IS_EXTENDED {
            let before = memory[0];
            let viscosity = R::select(motion.touched, R::splat(self.viscosity), zero);
            let normal_stiffness = N::normal_stiffness(constants[NORMAL], overlap);
            let mut across = motion.slip.scaled(viscosity * tangential);
            if self.viscosity > 0.0 {
                // Spring and dashpot together stay in the cone. Where a contact slides its spring resists no further motion; a
                // dashpot that did would hold the cell back with forces far from balance.
                let both = K::shortened(kept.plus(across), limit, AT_LIMIT).kept;
                across = both.minus(kept);
            }
            let approach = overlap - before;
            let viscous =
                Viscous { normal_force: -(viscosity * normal_stiffness * approach), tangential_force: across };
            // What the dashpots take of the work of this step.
            response.dissipation += across.dot(motion.slip) - viscous.normal_force * approach;
            response.viscous = Some(viscous);
            let rolling = motion.rolling.where_or(motion.touched, K::Axial::zero());
            let (moment, lost) = rolled::<K, R>(
                rolled_before,
                constants[ROLLING_ARM_SQUARE] * tangential,
                rolling,
                constants[ROLLING_LIMIT_ARM] * elastic,
            );
            response.couple = Some(moment);
            response.dissipation += lost;
            Self::keep_moment::<K, R>(memory, moment);
        }
        if MEMORY > 0 {
            memory[0] = Self::remembered(overlap);
        }
        response
    }

    #[inline(always)]
    fn normal_force<R: Real>(&self, constants: &[R; 7], overlap: R) -> R {
        constants[ATTRACTION] - N::force(constants[NORMAL], overlap)
    }

    #[inline(always)]
    fn stiffness<R: Real>(&self, constants: &[R; 7], overlap: R) -> [R; 3] {
        let tangential = N::tangential_stiffness(constants[TANGENTIAL], overlap);
        let rolling = if Self::IS_EXTENDED { constants[ROLLING_ARM_SQUARE] * tangential } else { R::default() };
        [N::normal_stiffness(constants[NORMAL], overlap), tangential, rolling]
    }

    #[inline(always)]
    fn friction_limit<R: Real>(&self, constants: &[R; 7], overlap: R) -> R {
        N::force(constants[LIMIT], overlap)
    }

    #[inline(always)]
    fn rolling_limit<R: Real>(&self, constants: &[R; 7], overlap: R) -> R {
        constants[ROLLING_LIMIT_ARM] * N::force(constants[NORMAL], overlap)
    }

    #[inline(always)]
    fn energy<R: Real>(&self, constants: &[R; 7], overlap: R, tangential_force: R, memory: &[R; MEMORY]) -> R {
        let tangential = N::tangential_stiffness(constants[TANGENTIAL], overlap);
        let normal = N::normal_energy(constants[NORMAL], overlap) - constants[ATTRACTION] * overlap;
        let stored = normal + Self::spring_energy(tangential_force * tangential_force, tangential);
        if !Self::IS_EXTENDED {
            return stored;
        }
        let moment = Self::moment::<K, R>(memory);
        stored + Self::spring_energy(moment.dot(moment), constants[ROLLING_ARM_SQUARE] * tangential)
    }

    #[inline(always)]
    fn opening_loss<R: Real>(&self, constants: &[R; 7], tangential_force: K::Axial<R>, memory: &[R; MEMORY]) -> R {
        let tangential = Self::old_stiffness(constants, memory);
        let lost = Self::spring_energy(tangential_force.dot(tangential_force), tangential);
        if !Self::IS_EXTENDED {
            return lost;
        }
        let moment = Self::moment::<K, R>(memory);
        lost + Self::spring_energy(moment.dot(moment), constants[ROLLING_ARM_SQUARE] * tangential)
    }

    fn mass_factor(&self) -> f64 {
        // Explicit motion with forces -k (x + b dx): stable while omega^2 (1 + 2 b) < 4.
        if Self::IS_EXTENDED { 1.0 + 2.0 * self.viscosity } else { 1.0 }
    }
}
