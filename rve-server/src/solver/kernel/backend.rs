//! Which instructions the step runs with: chosen once at run time, the same bits with each.
//!
//! The step is written once. This file stamps it out per instruction set, inside functions that are allowed to use that
//! set; the only `unsafe` of the engine is the call of such a function, guarded by the check that the processor has it.

use super::cells_in_lanes::load_pairs;
use super::step::{Grain, GrainConstants, MoveSums, Steering, StepData, StepSums, kick_grain, sum_grain};
use crate::contact::ContactLaw;
use crate::simd::Real;
use crate::space::KernelSpace;
use std::marker::PhantomData;
use std::sync::OnceLock;

/// Whether the plain functions are compiled for lanes too: where they are the only ones, their vectors are worth it. On x86-64
/// they would be several hundred kilobytes that never run.
const PLAIN_HAS_LANES: bool = cfg!(not(target_arch = "x86_64"));

/// Numbers that the plain functions are compiled for.
struct Plain<R>(PhantomData<R>);

impl<R: Real> Plain<R> {
    const SERVES: bool = R::LANES == 1 || PLAIN_HAS_LANES;
}

/// Instruction sets, from the plainest to the widest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Backend {
    /// Instructions that every processor of the build's target has. On x86-64, without fused multiply-add in hardware, this is slow, but
    /// right: one pair of one cell at a time.
    Plain,
    /// AVX2 with fused multiply-add.
    Avx2,
    /// AVX-512.
    Avx512,
}

impl Backend {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Plain, Self::Avx2, Self::Avx512];

    /// Whether this processor can run it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Plain => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// Whether it works on lanes: on several cells, or on several pairs of one cell. Results do not depend on it.
    pub fn has_lanes(self) -> bool {
        PLAIN_HAS_LANES || self != Self::Plain && self.is_available()
    }

    /// The widest one this processor can run.
    pub fn best() -> Self {
        static BEST: OnceLock<Backend> = OnceLock::new();
        *BEST
            .get_or_init(|| Self::ALL.into_iter().rev().find(|backend| backend.is_available()).unwrap_or(Self::Plain))
    }

    /// Name for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Avx2 => "AVX2 + FMA",
            Self::Avx512 => "AVX-512",
        }
    }

    /// Kicks and moves all grains. A back end that this processor lacks is replaced by the plain one; lanes are for those that
    /// [have them](Self::has_lanes), the result is not finite otherwise.
    #[expect(unsafe_code, reason = "functions for an instruction set may only be called where the processor has it")]
    pub fn advance<K: KernelSpace, C: ContactLaw<K>, R: Real>(
        self,
        data: &mut StepData<'_, K, C, R>,
        steering: &Steering<K, R>,
    ) -> MoveSums<R> {
        match self {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `is_available` has just found every feature that the function is compiled with.
            Self::Avx512 if self.is_available() => unsafe { avx512::advance(data, steering) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Self::Avx2 if self.is_available() => unsafe { avx2::advance(data, steering) },
            _ if Plain::<R>::SERVES => plain::advance(data, steering),
            _ => MoveSums::not_finite(),
        }
    }

    /// Evaluates all contacts. A back end that this processor lacks is replaced by the plain one; lanes are for those that
    /// [have them](Self::has_lanes), the result is not finite otherwise.
    #[expect(unsafe_code, reason = "functions for an instruction set may only be called where the processor has it")]
    pub fn evaluate<K: KernelSpace, C: ContactLaw<K>, R: Real>(
        self,
        data: &mut StepData<'_, K, C, R>,
    ) -> StepSums<R> {
        match self {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `is_available` has just found every feature that the function is compiled with.
            Self::Avx512 if self.is_available() => unsafe { avx512::evaluate(data) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Self::Avx2 if self.is_available() => unsafe { avx2::evaluate(data) },
            _ if Plain::<R>::SERVES => plain::evaluate(data),
            _ => StepSums::not_finite(),
        }
    }
}

/// Moves and evaluations for one instruction set. The bodies per grain of several cells stay functions of their own: inlined into
/// the loop, the compiler turns to vectorising across grains, with gathers, and takes three times as long. For a single cell
/// the call is what costs.
macro_rules! step_functions {
    ($module:ident, $pairs_in_lanes:expr $(, $features:literal)?) => {
        mod $module {
            use super::*;

            $(#[target_feature(enable = $features)])?
            #[inline(never)]
            fn kick<K: KernelSpace, R: Real>(
                grain: &mut Grain<K, R>,
                constants: &GrainConstants,
                steering: &Steering<K, R>,
                old_power: bool,
                sums: &mut MoveSums<R>,
            ) {
                kick_grain(grain, constants, steering, old_power, sums);
            }

            $(#[target_feature(enable = $features)])?
            #[inline(never)]
            fn grain_sums<K: KernelSpace, R: Real>(
                grain: &Grain<K, R>,
                constants: &GrainConstants,
                sums: &mut StepSums<R>,
            ) {
                sum_grain(grain, constants, sums);
            }

            $(#[target_feature(enable = $features)])?
            pub(super) fn advance<K: KernelSpace, C: ContactLaw<K>, R: Real>(
                data: &mut StepData<'_, K, C, R>,
                steering: &Steering<K, R>,
            ) -> MoveSums<R> {
                let mut sums = MoveSums::default();
                for (grain, constants) in data.grains.iter_mut().zip(data.grain_constants) {
                    if R::LANES == 1 {
                        kick_grain(grain, constants, steering, data.wanted.old_power, &mut sums);
                    } else {
                        kick(grain, constants, steering, data.wanted.old_power, &mut sums);
                    }
                }
                sums
            }

            $(#[target_feature(enable = $features)])?
            pub(super) fn evaluate<K: KernelSpace, C: ContactLaw<K>, R: Real>(
                data: &mut StepData<'_, K, C, R>,
            ) -> StepSums<R> {
                let mut sums = StepSums::default();
                load_pairs::<K, C, R, { $pairs_in_lanes }>(data, &mut sums);
                for (grain, constants) in data.grains.iter().zip(data.grain_constants) {
                    if R::LANES == 1 {
                        sum_grain(grain, constants, &mut sums);
                    } else {
                        grain_sums(grain, constants, &mut sums);
                    }
                }
                sums
            }
        }
    };
}

step_functions!(plain, PLAIN_HAS_LANES);
#[cfg(target_arch = "x86_64")]
step_functions!(avx2, true, "avx2,fma");
#[cfg(target_arch = "x86_64")]
step_functions!(avx512, true, "avx2,fma,avx512f,avx512dq,avx512vl");
