//! One block of pairs, with the widest instructions that help a single number at a time.

use super::SpecimenSpace;
use super::contact::{ContactSums, Grain, PairLoad, Slot};
use crate::contact::ContactLaw;
use crate::simd::Tuple;
use crate::solver::kernel::backend::Backend;

/// A listed pair as the search for contacts sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Listed {
    pub(crate) origin: u32,
    pub(crate) end: u32,
    /// Row of the table of image translations.
    pub(crate) image: u32,
    /// Square of the distance below which the pair touches, m2.
    pub(crate) near_square: f64,
}

/// One block: sources of its forces, and their destination.
pub(super) struct Block<'a, S: SpecimenSpace, C: ContactLaw<S>> {
    /// The law of every contact.
    pub law: &'a C,
    /// All grains.
    pub grains: &'a [Grain<S>],
    /// Shifts of the periodic images.
    pub images: &'a [S::Coordinates<f64>],
    /// Velocities of the images, m/s; empty while the periodic sides stand still.
    pub image_velocities: &'a [S::Coordinates<f64>],
    /// The pairs of this block.
    pub pairs: &'a [Listed],
    /// Histories of the contacts of these pairs.
    pub slots: &'a mut [Slot<S, C>],
    /// Loads of these pairs on their grains.
    pub loads: &'a mut [PairLoad<S>],
    /// Length of the motion, s.
    pub step: f64,
}

impl<S: SpecimenSpace, C: ContactLaw<S>> Block<'_, S, C> {
    /// Forces of the touching pairs; pairs that have come apart are let go.
    #[expect(unsafe_code, reason = "a function for an instruction set may only be called where the processor has it")]
    pub(super) fn evaluate(self) -> ContactSums {
        #[cfg(target_arch = "x86_64")]
        if Backend::Avx2.is_available() {
            // SAFETY: `is_available` has just found every feature that the function is compiled with.
            return unsafe { self.with_fused_products() };
        }
        self.pair_by_pair()
    }

    /// The same arithmetic; without the instruction every fused product is a call into a library.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn with_fused_products(self) -> ContactSums {
        self.pair_by_pair()
    }

    #[inline(always)]
    fn pair_by_pair(self) -> ContactSums {
        let mut sums = ContactSums::default();
        for ((pair, slot), load) in self.pairs.iter().zip(self.slots).zip(self.loads) {
            let ends = [&self.grains[pair.origin as usize], &self.grains[pair.end as usize]];
            let branch = ends[1].position.minus(ends[0].position).plus(self.images[pair.image as usize]);
            if branch.dot(branch) < pair.near_square {
                let image;
                let ends = match self.image_velocities.get(pair.image as usize) {
                    Some(velocity) => {
                        image = Grain { velocity: ends[1].velocity.plus(*velocity), ..*ends[1] };
                        [ends[0], &image]
                    }
                    None => ends,
                };
                *load = slot.press(self.law, branch, ends, self.step, &mut sums);
            } else if slot.touches {
                slot.open(self.law, &mut sums);
            }
        }
        sums
    }
}
