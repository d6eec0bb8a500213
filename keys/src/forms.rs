//! Forms in which documents write values that Rust holds in another type, for `#[serde(with = "..")]`.

/// An optional number that documents write as 0 where there is none.
pub mod zero_is_none {
    use serde::{Deserialize, Deserializer, Serializer};

    /// Writes 0 for nothing.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(value.unwrap_or(0.0))
    }

    /// Reads 0 as nothing.
    ///
    /// # Errors
    /// It is no number.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
        let value = f64::deserialize(deserializer)?;
        Ok((value != 0.0).then_some(value))
    }
}

/// A time that documents write in seconds.
pub mod seconds {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};
    use std::time::Duration;

    /// Writes seconds.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(time: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(time.as_secs_f64())
    }

    /// Reads seconds.
    ///
    /// # Errors
    /// It is no number, or none that a time can have.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Duration, D::Error> {
        Duration::try_from_secs_f64(f64::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}
