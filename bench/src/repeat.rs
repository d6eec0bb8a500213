//! Repeated measurements on a machine that does other things as well.

/// The middle of the samples (the mean of the two middle ones of an even number); NaN without samples.
pub(crate) fn median(samples: &[f64]) -> f64 {
    quantile(samples, 0.5)
}

/// The value below which the given share of the samples lies, between neighbours linearly; NaN without samples.
pub(crate) fn quantile(samples: &[f64], share: f64) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share.clamp(0.0, 1.0) * last as f64;
    let low = place.floor() as usize;
    let high = (low + 1).min(last);
    sorted[low] + (place - low as f64) * (sorted[high] - sorted[low])
}

/// Samples of several variants, taken in rounds: each round runs every variant once, every other round backwards, so
/// that whatever else the machine does hits all variants alike. Result `[variant][round]`.
///
/// # Errors
/// The first error of a variant.
pub(crate) fn interleaved<E>(
    rounds: usize,
    variants: usize,
    mut measure: impl FnMut(usize) -> Result<f64, E>,
) -> Result<Vec<Vec<f64>>, E> {
    let mut samples = vec![Vec::with_capacity(rounds); variants];
    for round in 0..rounds {
        for place in 0..variants {
            let variant = if round % 2 == 0 { place } else { variants - 1 - place };
            samples[variant].push(measure(variant)?);
        }
    }
    Ok(samples)
}

/// Median of the ratios within each round: `over` to `under`.
pub(crate) fn ratio(over: &[f64], under: &[f64]) -> f64 {
    let ratios: Vec<f64> = over.iter().zip(under).map(|(top, bottom)| top / bottom).collect();
    median(&ratios)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn medians_and_quantiles_of_small_samples() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(quantile(&[1.0, 2.0, 3.0, 4.0, 5.0], 0.9), 4.6);
        assert!(median(&[]).is_nan());
    }

    #[test]
    fn every_round_runs_all_variants_and_ratios_are_taken_within_rounds() {
        let mut order = Vec::new();
        // A machine that becomes ten times slower after the first round.
        let samples = interleaved::<Infallible>(2, 2, |variant| {
            order.push(variant);
            Ok((variant + 1) as f64 * if order.len() > 2 { 10.0 } else { 1.0 })
        });
        let samples = samples.unwrap();
        assert_eq!(order, [0, 1, 1, 0]);
        assert_eq!(samples, [[1.0, 10.0], [2.0, 20.0]]);
        assert_eq!(ratio(&samples[1], &samples[0]), 2.0);
    }
}
