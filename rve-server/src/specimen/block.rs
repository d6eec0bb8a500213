//! One block of pairs, with the widest instructions that help a single number at a time.

use super::SpecimenSpace;
use super::body::Listed;
use super::contact::{ContactSums, Grain, PairLoad, Slot};
use crate::lanes::Tuple;
use crate::lanes::backend::Backend;
use crate::law::ContactLaw;

/// Forces of the touching pairs of one block; pairs that have come apart are let go.
#[expect(unsafe_code, reason = "a function for an instruction set may only be called where the processor has it")]
pub(super) fn evaluate_block<S: SpecimenSpace, C: ContactLaw<S>>(
    law: &C,
    grains: &[Grain<S>],
    images: &[S::Coordinates<f64>],
    pairs: &[Listed],
    slots: &mut [Slot<S, C>],
    loads: &mut [PairLoad<S>],
    step: f64,
) -> ContactSums {
    #[cfg(target_arch = "x86_64")]
    if Backend::Avx2.is_available() {
        // SAFETY: `is_available` has just found every feature that the function is compiled with.
        return unsafe { with_fused_products(law, grains, images, pairs, slots, loads, step) };
    }
    evaluate_pairs(law, grains, images, pairs, slots, loads, step)
}

/// The same arithmetic; without the instruction every fused product is a call into a library.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn with_fused_products<S: SpecimenSpace, C: ContactLaw<S>>(
    law: &C,
    grains: &[Grain<S>],
    images: &[S::Coordinates<f64>],
    pairs: &[Listed],
    slots: &mut [Slot<S, C>],
    loads: &mut [PairLoad<S>],
    step: f64,
) -> ContactSums {
    evaluate_pairs(law, grains, images, pairs, slots, loads, step)
}

#[inline(always)]
fn evaluate_pairs<S: SpecimenSpace, C: ContactLaw<S>>(
    law: &C,
    grains: &[Grain<S>],
    images: &[S::Coordinates<f64>],
    pairs: &[Listed],
    slots: &mut [Slot<S, C>],
    loads: &mut [PairLoad<S>],
    step: f64,
) -> ContactSums {
    let mut sums = ContactSums::default();
    for ((pair, slot), load) in pairs.iter().zip(slots).zip(loads) {
        let ends = [&grains[pair.origin as usize], &grains[pair.end as usize]];
        let branch = ends[1].position.minus(ends[0].position).plus(images[pair.image as usize]);
        if branch.dot(branch) < pair.near_square {
            *load = slot.press(law, branch, ends, step, &mut sums);
        } else if slot.touches {
            slot.open(law, &mut sums);
        }
    }
    sums
}
