//! Tangential forces and rolling moments of a packing that a cell does not take over.

use crate::cell::{ContactRecord, GrainState};
use crate::space::{Components, Space};

/// Counts of forces and moments of a packing that were dropped or cut. Both counts are zero for a packing that was written in
/// equilibrium and is read with the contact law it was made with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ListedForces {
    /// Forces on pairs that do not touch: dropped.
    pub dropped: usize,
    /// Forces above the Coulomb limit: cut to it.
    pub cut: usize,
    /// Forces of a packing whose contact law has no tangential springs: dropped.
    pub springless: usize,
    /// Rolling moments that the contact law cannot bear, or not in full: dropped or cut to its limit.
    pub moments_cut: usize,
    /// Rolling moments of a packing whose contact law has no tangential springs, and so none against rolling: dropped.
    pub moments_springless: usize,
}

impl ListedForces {
    /// Compares a packing's listed forces with what one evaluation has left of them.
    pub(super) fn compare<S: Space>(given: &GrainState<S>, found: &GrainState<S>) -> Self {
        let mut counts = Self::default();
        let forces = CutCheck::of(given.contacts.iter().map(|contact| contact.tangential_force.norm()));
        for listed in given.contacts.iter().filter(|contact| contact.tangential_force.norm() > 0.0) {
            match found.contacts.binary_search_by_key(&listed.key(), ContactRecord::key) {
                Err(_) => counts.dropped += 1,
                Ok(place) => {
                    let (before, after) =
                        (listed.tangential_force.norm(), found.contacts[place].tangential_force.norm());
                    counts.cut += usize::from(forces.is_cut(before, after));
                }
            }
        }
        let moments = CutCheck::of(given.rolling_moments.iter().map(|moment| moment.norm()));
        for (listed, moment) in given.contacts.iter().zip(&given.rolling_moments).filter(|(_, m)| m.norm() > 0.0) {
            let place = found.contacts.binary_search_by_key(&listed.key(), ContactRecord::key).ok();
            let after = place.and_then(|place| found.rolling_moments.get(place)).map_or(0.0, |moment| moment.norm());
            counts.moments_cut += usize::from(moments.is_cut(moment.norm(), after));
        }
        counts
    }

    /// All forces and moments that were dropped or cut.
    pub fn changed(&self) -> usize {
        self.dropped + self.cut + self.springless + self.moments_cut + self.moments_springless
    }

    /// A warning for the user, or nothing if all forces were taken over.
    pub fn warning(&self) -> Option<String> {
        let mut parts = Vec::new();
        if self.dropped > 0 {
            parts.push(format!("{} listed on pairs that do not touch were dropped", self.dropped));
        }
        if self.cut > 0 {
            parts.push(format!("{} above the Coulomb limit of this contact law were cut to it", self.cut));
        }
        if self.springless > 0 {
            parts.push(format!(
                "{} were dropped because stiffness_ratio = 0 leaves no tangential springs",
                self.springless
            ));
        }
        let forces =
            (!parts.is_empty()).then(|| format!("of the packing's tangential forces, {}", parts.join(" and ")));
        let moments = (self.moments_cut > 0)
            .then(|| format!("of its rolling moments, {} are more than this contact law bears", self.moments_cut));
        let springless = (self.moments_springless > 0).then(|| {
            let count = self.moments_springless;
            format!(
                "{count} rolling moments were dropped because stiffness_ratio = 0 leaves no springs against rolling"
            )
        });
        let sentences: Vec<String> = forces.into_iter().chain(moments).chain(springless).collect();
        (!sentences.is_empty()).then(|| sentences.join("; "))
    }
}

/// Share by which a listed force may shrink before it counts as cut, of itself or of the mean one: forces exactly at the limit are rounded,
/// and the limit of a contact that hardly touches is known no better than the places of its grains.
const CUT_MARGIN: f64 = 1e-9;

/// What counts as cut among listed forces, or moments.
struct CutCheck {
    mean: f64,
}

impl CutCheck {
    /// By the mean of those that are listed.
    fn of(listed: impl Iterator<Item = f64>) -> Self {
        let (count, sum) =
            listed.filter(|size| *size > 0.0).fold((0_u32, 0.0), |(count, sum), size| (count + 1, sum + size));
        Self { mean: if count > 0 { sum / f64::from(count) } else { 0.0 } }
    }

    /// Whether what is left of one is less than it was.
    fn is_cut(&self, before: f64, after: f64) -> bool {
        after.is_nan() || after < before - CUT_MARGIN * before.max(self.mean)
    }
}

#[cfg(test)]
mod tests {
    use super::CutCheck;

    /// Contacts that hardly touch have forces at a limit whose rounding is no share of 1e-9, and every fourth packing was said to have lost
    /// one of its forces under the law it was made with.
    #[test]
    fn rounding_of_contacts_that_hardly_touch_is_no_cut() {
        let forces = CutCheck::of([0.0, 2.0, 1e-7, 1.0].into_iter());
        assert!(!forces.is_cut(1e-7, 1e-7 * (1.0 - 4e-7)) && !forces.is_cut(2.0, 2.0 * (1.0 - 1e-10)));
        assert!(forces.is_cut(1.0, 1.0 - 1e-8) && forces.is_cut(1e-7, 0.0) && forces.is_cut(1.0, f64::NAN));
        assert!(!CutCheck::of([].into_iter()).is_cut(0.0, 0.0));
    }
}
