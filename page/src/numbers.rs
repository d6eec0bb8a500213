//! Numbers as JSON: as short as pictures allow.

use serde_json::Value;

/// Largest power of ten that a double holds exactly.
const EXACT_POWER: i32 = 22;

/// A number as JSON, `null` if it is not finite.
pub(crate) fn exact(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or(Value::Null, Value::Number)
}

/// A number with five significant digits, for pictures; `null` if it is not finite.
pub(crate) fn short(value: f64) -> Value {
    if !value.is_finite() {
        return Value::Null;
    }
    if value == 0.0 {
        return Value::from(0);
    }
    let rounded = rounded(value);
    if rounded.fract() == 0.0 && rounded.abs() < 1e15 { Value::from(rounded as i64) } else { exact(rounded) }
}

/// The nearest number with five significant digits. A picture holds some hundred thousand numbers, so that rounding through text would
/// be felt.
fn rounded(value: f64) -> f64 {
    let exponent = value.abs().log10().floor() as i32 - 4;
    // Powers of ten and integers of five digits are exact, so that quotient or product is the number nearest to the decimal.
    if (-EXACT_POWER..=EXACT_POWER).contains(&exponent) {
        let unit = 10f64.powi(exponent.abs());
        if exponent < 0 { (value * unit).round() / unit } else { (value / unit).round() * unit }
    } else {
        format!("{value:.4e}").parse().unwrap_or(value)
    }
}

/// Numbers for pictures.
pub(crate) fn shorts(values: impl IntoIterator<Item = f64>) -> Value {
    values.into_iter().map(short).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_never_infinite() {
        let text = shorts([1.0 / 3.0, -100_000.4, 0.0, f64::NAN, f64::INFINITY, 1.5e-7]).to_string();
        assert_eq!(text, "[0.33333,-100000,0,null,null,1.5e-7]");
    }

    #[test]
    fn rounding_by_arithmetic_is_rounding_through_text() {
        let mut value = 1.234_567_891e-40;
        while value < 1e40 {
            for sign in [1.0, -1.0] {
                let text: f64 = format!("{:.4e}", sign * value).parse().unwrap();
                assert_eq!(rounded(sign * value), text, "{value:e}");
            }
            value *= 1.003_7;
        }
        assert_eq!(rounded(9.999_96e-5), 1e-4);
        assert_eq!(rounded(1e5), 1e5);
    }
}
