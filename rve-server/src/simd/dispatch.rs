//! Run-time choice of the instruction set.
//!
//! Work is written once in portable code over small arrays; inside a function with the features enabled the compiler
//! turns these into vectors. Every fused multiply-add is written as such, so that all ways give the same bits.

/// Work that gains from wide vectors. `run` and all it calls should be `#[inline(always)]`.
pub(crate) trait Vectorised {
    /// Its result.
    type Output;

    /// Does the work.
    fn run(self) -> Self::Output;
}

/// Does `work` with the widest instructions that this processor has and the program knows of. What several algorithms need is
/// dispatched by itself: written into each of them, it would be compiled again for every place of use.
pub(crate) fn dispatch<T: Vectorised>(work: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        #[expect(unsafe_code, reason = "the features that the function needs have just been detected")]
        return unsafe { with_avx2(work) };
    }
    plain(work)
}

#[inline(never)]
fn plain<T: Vectorised>(work: T) -> T::Output {
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
#[inline(never)]
fn with_avx2<T: Vectorised>(work: T) -> T::Output {
    work.run()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone)]
    struct Chain(Vec<[f64; 4]>);

    impl Vectorised for Chain {
        type Output = [f64; 4];

        #[inline(always)]
        fn run(self) -> [f64; 4] {
            let mut sum = [0.1_f64; 4];
            for values in &self.0 {
                for lane in 0..4 {
                    sum[lane] = sum[lane].mul_add(values[lane], 1.0 / values[lane]);
                }
            }
            sum
        }
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let chain =
            Chain((1..100).map(|place| [0.3, 0.7, -0.2, 0.9].map(|value| value / f64::from(place))).collect());
        assert_eq!(dispatch(chain.clone()).map(f64::to_bits), chain.run().map(f64::to_bits));
    }
}
