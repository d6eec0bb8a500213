//! Numbers for people.

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
    }
}
