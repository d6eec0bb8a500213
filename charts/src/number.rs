//! Numbers for people.

use std::ops::Range;

/// A number in four significant digits; a dash for one that was not measured (NaN).
pub fn short(value: f64) -> String {
    if value.is_nan() {
        return "-".to_owned();
    }
    if value != 0.0 && !(1e-3..1e7).contains(&value.abs()) {
        return format!("{value:.3e}");
    }
    let digits = if value == 0.0 { 0 } else { 3 - value.abs().log10().floor() as i32 };
    format!("{value:.*}", digits.clamp(0, 6) as usize)
}

/// A tick label: [`short`] without trailing zeros.
pub(crate) fn tick(value: f64) -> String {
    let text = short(value);
    match text.split_once('e') {
        Some((digits, power)) => format!("{}e{power}", trimmed(digits)),
        None => trimmed(&text).to_owned(),
    }
}

/// A tick label of a linear axis whose ends are `span` apart: without trailing zeros, and with as many digits as tell its ticks apart;
/// values that are negligible on the scale of the axis are 0.
pub(crate) fn tick_within(value: f64, span: f64) -> String {
    if value.abs() < 1e-9 * span {
        return "0".to_owned();
    }
    // Ticks are further apart than the hundredth part of an axis.
    let last_digit = span.log10().floor() as i32 - 2;
    if (1e-4..1e5).contains(&value.abs()) {
        return trimmed(&format!("{value:.*}", (-last_digit).clamp(0, 15) as usize)).to_owned();
    }
    let digits = value.abs().log10().floor() as i32 - last_digit;
    let text = format!("{value:.*e}", digits.clamp(0, 15) as usize);
    text.split_once('e').map_or(text.clone(), |(digits, power)| format!("{}e{power}", trimmed(digits)))
}

/// Marks of a logarithmic axis: powers of ten, with their multiples where there are few.
pub(crate) fn logarithmic_ticks(range: &Range<f64>) -> Vec<f64> {
    let (first, last) = (range.start.log10().floor() as i32, range.end.log10().ceil() as i32);
    let every = usize::try_from((last - first) / MOST_DECADES + 1).unwrap_or(1);
    let marks = |multiples: &[u8], every: usize| -> Vec<f64> {
        // Read as decimals, so that a mark is the number that it shows.
        let mark = |power: i32, multiple: u8| format!("{multiple}e{power}").parse().unwrap_or(f64::NAN);
        let all =
            (first..=last).step_by(every).flat_map(|power| multiples.iter().map(move |&times| mark(power, times)));
        all.filter(|mark: &f64| range.contains(mark)).collect()
    };
    for multiples in [&[1][..], &[1, 2, 5], &[1, 2, 3, 4, 5, 6, 7, 8, 9]] {
        let found = marks(multiples, every);
        if found.len() >= FEWEST_TICKS {
            return found;
        }
    }
    // Less than some tenths of a decade: equal differences.
    let step = 10f64.powf(((range.end - range.start) / FEWEST_TICKS as f64).log10().floor());
    let step = if (range.end - range.start) / step > 10.0 { 5.0 * step } else { step };
    let first = (range.start / step).ceil();
    (0..20).map(|number| (first + f64::from(number)) * step).filter(|mark| range.contains(mark)).collect()
}

/// Powers of ten of an axis that are all marked.
const MOST_DECADES: i32 = 12;

/// Marks from which on an axis can be read.
const FEWEST_TICKS: usize = 3;

/// Decimal digits without trailing zeros.
pub(crate) fn trimmed(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let shown = [0.0, 1234.56, 12.3456, 1e-5, 2.5e8, 0.01234].map(short);
        assert_eq!(shown, ["0", "1235", "12.35", "1.000e-5", "2.500e8", "0.01234"]);
    }

    #[test]
    fn ticks_have_no_trailing_zeros() {
        assert_eq!([0.5, 1000.0, 2.5e8].map(tick), ["0.5", "1000", "2.5e8"]);
        let texts = [1e-18, 0.02, 0.5].map(|value| tick_within(value, 1.0));
        assert_eq!(texts, ["0", "0.02", "0.5"]);
        assert_eq!([1e5, 2.5e5].map(|value| tick_within(value, 3e5)), ["1e5", "2.5e5"]);
        assert_eq!(tick_within(-2.5e-7, 1e-6), "-2.5e-7");
    }

    /// Stresses from 105 to 130 kPa had two digits, so that neighbouring ticks had one label.
    #[test]
    fn labels_of_ticks_tell_them_apart_and_read_back() {
        for (start, step) in
            [(1e5, 5e3), (0.338_01, 1e-5), (-2.6e-7, 2e-8), (9.99e8, 1e5), (95.0, 2.5), (1e-4, 2.5e-5)]
        {
            let ticks: Vec<f64> = (0..9).map(|number| start + f64::from(number) * step).collect();
            let labels: Vec<String> = ticks.iter().map(|tick| tick_within(*tick, 8.0 * step)).collect();
            for (tick, label) in ticks.iter().zip(&labels) {
                assert!((label.parse::<f64>().unwrap() - tick).abs() < 0.05 * step, "{label} for {tick}");
            }
            assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
        }
    }

    #[test]
    fn logarithmic_axes_have_marks_however_short_they_are() {
        assert_eq!(logarithmic_ticks(&(0.9..2000.0)), [1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(logarithmic_ticks(&(0.015..0.078)), [0.02, 0.03, 0.04, 0.05, 0.06, 0.07]);
        assert_eq!(logarithmic_ticks(&(4.0..130.0)), [5.0, 10.0, 20.0, 50.0, 100.0]);
        assert_eq!(logarithmic_ticks(&(1e-30..1e10)).len(), 10);
        for range in [150.0..520.0, 20.1..20.7, 1e-5..1.1e-5, 9.5..10.5, 1.0..1.69] {
            let marks = logarithmic_ticks(&range);
            assert!((2..=20).contains(&marks.len()), "{range:?}: {marks:?}");
            let labels: Vec<String> = marks.iter().map(|mark| tick(*mark)).collect();
            assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
        }
    }
}
