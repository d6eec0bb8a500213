//! Numbers as JSON: as short as pictures allow.

use serde_json::Value;

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
    let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
    if rounded.fract() == 0.0 && rounded.abs() < 1e15 { Value::from(rounded as i64) } else { exact(rounded) }
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
}
