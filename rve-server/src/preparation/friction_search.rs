//! The preparation friction that gives a packing the density or coordination requested.
//!
//! More friction leaves a packing looser and with fewer contacts; between two frictions the state is searched by regula
//! falsi with the Illinois rule, because a finite packing's response is only nearly continuous.

use crate::definition::PackingError;
use serde::{Deserialize, Serialize};

/// Most packings that a search makes.
const MOST_TRIES: usize = 16;

/// One packing of a search.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrictionAttempt {
    /// Preparation friction.
    pub friction: f64,
    /// Value of the requested quantity reached with it.
    pub value: f64,
}

/// Makes packings until one has the value requested.
///
/// # Errors
/// [`PackingError::Content`] with the values in reach.
pub(crate) fn search<T>(
    wanted: f64,
    tolerance: f64,
    range: [f64; 2],
    make: &mut dyn FnMut(f64) -> Result<(T, f64), PackingError>,
) -> Result<(T, Vec<FrictionAttempt>), PackingError> {
    let mut attempts: Vec<FrictionAttempt> = Vec::new();
    let mut ends: [(f64, f64); 2] = [(0.0, 0.0); 2];
    for (end, friction) in ends.iter_mut().zip(range) {
        let (made, value) = make(friction)?;
        attempts.push(FrictionAttempt { friction, value });
        if (value - wanted).abs() <= tolerance {
            return Ok((made, attempts));
        }
        *end = (friction, value - wanted);
    }
    if (ends[0].1 > 0.0) == (ends[1].1 > 0.0) {
        return Err(PackingError::Content(format!(
            "target {wanted} +- {tolerance} is out of reach: friction {} gives {:.5}, friction {} gives {:.5}; widen \
             target.friction or change the grading",
            range[0], attempts[0].value, range[1], attempts[1].value
        )));
    }
    let mut kept: Option<usize> = None;
    while attempts.len() < MOST_TRIES {
        let [(low, below), (high, above)] = ends;
        // The response is steep near zero friction and flat beyond: every third try halves the interval instead.
        let halve = attempts.len() % 3 == 1;
        let friction = if halve { 0.5 * (low + high) } else { (low * above - high * below) / (above - below) };
        let (made, value) = make(friction)?;
        attempts.push(FrictionAttempt { friction, value });
        let miss = value - wanted;
        if miss.abs() <= tolerance {
            return Ok((made, attempts));
        }
        let replaced = usize::from((miss > 0.0) == (ends[1].1 > 0.0));
        ends[replaced] = (friction, miss);
        // Illinois: an end that stays counts half, or the other would converge ever more slowly.
        if kept == Some(1 - replaced) {
            ends[1 - replaced].1 *= 0.5;
        }
        kept = Some(1 - replaced);
    }
    let nearest = attempts
        .iter()
        .min_by(|a, b| (a.value - wanted).abs().total_cmp(&(b.value - wanted).abs()))
        .expect("the search has made packings");
    Err(PackingError::Content(format!(
        "target {wanted} +- {tolerance} was not met in {MOST_TRIES} packings; nearest: {:.5} at friction {:.5}; widen \
         target.tolerance or use more grains",
        nearest.value, nearest.friction
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_monotone_response_is_met_and_its_tries_are_told() {
        let mut response = |friction: f64| Ok((friction, 0.2 + 0.1 * (friction / (0.1 + friction))));
        let (friction, attempts) = search(0.26, 1e-5, [0.0, 1.0], &mut response).unwrap();
        assert!((friction - 0.15).abs() < 1e-3);
        assert!(attempts.len() < 12, "{} packings", attempts.len());
        assert_eq!(attempts.last().unwrap().friction, friction);
    }

    #[test]
    fn what_is_out_of_reach_is_refused_with_what_is_in_reach() {
        let mut response = |friction: f64| Ok(((), 0.2 + 0.1 * friction));
        let reason = search(0.4, 1e-3, [0.0, 1.0], &mut response).unwrap_err().to_string();
        assert!(reason.contains("0.20000") && reason.contains("0.30000") && reason.contains("target.friction"));
    }

    /// A response with a jump across the target ends with the nearest value instead of running on.
    #[test]
    fn a_jump_ends_with_the_nearest() {
        let mut response = |friction: f64| Ok(((), if friction < 0.3 { 0.2 } else { 0.3 }));
        let reason = search(0.26, 1e-3, [0.0, 1.0], &mut response).unwrap_err().to_string();
        assert!(reason.contains("nearest: 0.30000"), "{reason}");
    }
}
