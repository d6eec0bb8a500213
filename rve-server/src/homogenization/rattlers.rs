//! Grains that carry no load, and the contacts that are left without them.
//!
//! A grain with fewer than two contacts is a rattler: it can bear no force in equilibrium. Without its contacts another grain
//! may become one, so pruning goes on until nothing changes. The contacts that are left do not depend on the order of
//! removal: a contact that may go stays free to go when others have gone.

use crate::cell::ContactNetwork;
use crate::space::Space;

/// Which contacts bear load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LoadBearing {
    /// Those whose grains both have two contacts or more.
    WithoutRattlers,
    /// The same of a contact that also holds its grains from buckling, by a rolling spring.
    AndHolds,
    /// Of these, those that are no link of a chain: in space, grains in a row with two contacts each buckle freely unless contacts
    /// hold them. A single such grain between others is a strut and stays.
    WithoutRattlersAndChains,
}

impl LoadBearing {
    /// By the contacts that its grains have left; `is_held`: one of them holds one of the grains.
    fn holds(self, [first, second]: [u32; 2], is_held: bool) -> bool {
        let fewest = first.min(second) >= 2;
        match self {
            Self::WithoutRattlers | Self::AndHolds => fewest,
            Self::WithoutRattlersAndChains => fewest && (is_held || [first, second] != [2, 2]),
        }
    }
}

/// Result of pruning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Pruned {
    /// Load-bearing contacts of each grain.
    pub(crate) degree: Vec<u32>,
    /// Whether each contact bears load.
    pub(crate) kept: Vec<bool>,
}

impl Pruned {
    /// Prunes contacts between `grains` grains; `ends` are the two grains of each contact, `bearing` the rule for a contact by its number.
    pub(crate) fn of(
        grains: usize,
        ends: impl Iterator<Item = [usize; 2]> + Clone,
        bearing: impl Fn(usize) -> LoadBearing,
    ) -> Self {
        let (mut degree, mut holding) = (vec![0; grains], vec![0; grains]);
        for (number, ends) in ends.clone().enumerate() {
            for grain in ends {
                degree[grain] += 1;
                holding[grain] += u32::from(bearing(number) == LoadBearing::AndHolds);
            }
        }
        let mut kept = vec![true; ends.clone().count()];
        loop {
            let mut changed = false;
            for (number, ([first, second], kept)) in ends.clone().zip(&mut kept).enumerate() {
                let rule = bearing(number);
                let is_held = holding[first] + holding[second] > 0;
                if *kept && !rule.holds([degree[first], degree[second]], is_held) {
                    *kept = false;
                    for grain in [first, second] {
                        degree[grain] -= 1;
                        holding[grain] -= u32::from(rule == LoadBearing::AndHolds);
                    }
                    changed = true;
                }
            }
            if !changed {
                return Self { degree, kept };
            }
        }
    }
}

impl<S: Space> ContactNetwork<S> {
    /// Whether each grain is a rattler: removed with its contacts because fewer than two were left.
    pub fn rattlers(&self) -> Vec<bool> {
        self.without_rattlers().degree.into_iter().map(|degree| degree < 2).collect()
    }

    /// 2 x contacts over non-rattlers, contacts of rattlers left out; 0 if all are rattlers.
    pub fn coordination_number_no_rattlers(&self) -> f64 {
        let Pruned { degree, kept } = self.without_rattlers();
        let grains = degree.iter().filter(|degree| **degree >= 2).count();
        let contacts = kept.iter().filter(|kept| **kept).count();
        if grains == 0 { 0.0 } else { 2.0 * contacts as f64 / grains as f64 }
    }

    fn without_rattlers(&self) -> Pruned {
        let ends = self.contacts.iter().map(|contact| [contact.origin as usize, contact.end as usize]);
        Pruned::of(self.positions.len(), ends, |_| LoadBearing::WithoutRattlers)
    }
}
