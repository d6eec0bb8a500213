//! Times as options of commands take them.

/// A time on the command line, s.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(time) if (0.0..=2_678_400.0).contains(&time) => Ok(time),
        _ => Err("not a time in seconds".to_owned()),
    }
}
