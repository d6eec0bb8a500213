//! Cohesion: a constant attraction while grains touch.

use super::springs::Springs;

/// Attraction of a pair, N: the elastic force at the cohesive overlap C, so that the contact is free of force at the
/// overlap C and pulls with this force just before it opens. For linear springs this is [Argilaga2018]
/// `f_n = -k_n (delta - C)`. Erratum: the paper gives no tension bound and no friction limit for cohesive contacts; used here
/// are loss of contact where the overlap ends, and a limit that adds the attraction to the pressing force:
/// `|f_t| <= mu (-f_n + attraction)`, which is mu times the elastic force.
pub(super) fn attraction<N: Springs>(normal_coefficient: f64, cohesive_overlap: f64) -> f64 {
    if cohesive_overlap > 0.0 { N::force(normal_coefficient, cohesive_overlap) } else { 0.0 }
}
