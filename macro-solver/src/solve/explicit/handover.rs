//! What a stage leaves to a dynamic one behind it.

use super::integrator::Integrator;
use crate::model::constraints::Constraints;
use std::collections::BTreeMap;

/// Change of the load of a node from the end of one stage to the start of the next, over the largest load, that is rounding.
const ROUNDING: f64 = 1e-12;

/// Velocities of a dynamic stage, and what bore the body at its end. By degree of freedom.
#[derive(Clone, Debug, Default)]
pub(crate) struct Handover {
    /// m/s; `None` after a stage without motion.
    pub(super) velocity: Option<Vec<f64>>,
    supported_by: Vec<SupportedBy>,
    /// What followed others, with those that it followed.
    links: BTreeMap<usize, Vec<usize>>,
    /// Forces of supports and links at the end of a motion, N; `None` after a stage without one.
    reactions: Option<Vec<f64>>,
    /// Forces in place of supports that a stage before had, N.
    held: Vec<f64>,
    /// Forces of the loads at the end of the stage, N.
    loads: Vec<f64>,
}

/// What acted on a degree of freedom besides loads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SupportedBy {
    Nothing,
    /// A link to others that were free to move.
    Link,
    /// A support, itself or by links.
    Support,
}

impl Handover {
    /// After a stage with these constraints, these forces of the loads at its end (N), and this motion if it had one.
    pub(crate) fn after(integrator: Option<Integrator>, constraints: &Constraints, loads: Vec<f64>) -> Self {
        let (velocity, reactions, held) = match integrator {
            Some(Integrator { velocity, forces, held, .. }) => (Some(velocity), Some(forces.reactions), held),
            None => (None, None, Vec::new()),
        };
        let supported_by = |dof| {
            if constraints.is_given(dof) {
                SupportedBy::Support
            } else if constraints.is_unloaded(dof) {
                SupportedBy::Nothing
            } else {
                SupportedBy::Link
            }
        };
        Self {
            velocity,
            supported_by: (0..constraints.count()).map(supported_by).collect(),
            links: constraints.followers().map(|(dof, masters)| (dof, numbers(masters))).collect(),
            reactions,
            held,
            loads,
        }
    }

    /// Force at an absorbing side whose balance at the start of the stage asks for `missing`: a side that lets waves out in place of a
    /// support goes on bearing what the support bore, and what a link bore that is there no more. A side that was free before bears
    /// nothing, nor does one whose link goes on by itself (`is_linked_as_before`).
    pub(super) fn support(&self, dof: usize, missing: f64, is_linked_as_before: bool) -> f64 {
        let held = self.held.get(dof).copied().unwrap_or(0.0);
        match (self.supported_by.get(dof), &self.reactions) {
            (Some(SupportedBy::Support), _) => missing,
            (Some(SupportedBy::Link), None) if !is_linked_as_before => missing,
            // In a motion balance asks for more than the link: for what accelerates the node.
            (Some(SupportedBy::Link), Some(reactions)) if !is_linked_as_before => held + reactions[dof],
            _ => held,
        }
    }

    /// For each degree of freedom, whether it is linked in a stage with these constraints, and to the same ones as before.
    pub(super) fn linked_as_before(&self, constraints: &Constraints) -> Vec<bool> {
        let (mut known, mut new) = (vec![false; constraints.count()], vec![false; constraints.count()]);
        for (dof, masters) in constraints.followers() {
            let masters = numbers(masters);
            let linked = if self.links.get(&dof) == Some(&masters) { &mut known } else { &mut new };
            masters.into_iter().chain([dof]).for_each(|dof| linked[dof] = true);
        }
        known.iter().zip(new).map(|(known, new)| *known && !new).collect()
    }

    /// Forces of the loads that begin at once with a stage, N, whose loads are `now` at its start: no support has borne them.
    pub(super) fn loads_begun(&self, now: &[f64]) -> Vec<f64> {
        if self.loads.is_empty() {
            return vec![0.0; now.len()];
        }
        let largest = now.iter().chain(&self.loads).fold(0.0, |largest: f64, force| largest.max(force.abs()));
        let begun = |(now, before): (&f64, &f64)| {
            let change = now - before;
            if change.abs() > ROUNDING * largest { change } else { 0.0 }
        };
        now.iter().zip(&self.loads).map(begun).collect()
    }
}

fn numbers(masters: &[(usize, f64)]) -> Vec<usize> {
    masters.iter().map(|(master, _)| *master).collect()
}
