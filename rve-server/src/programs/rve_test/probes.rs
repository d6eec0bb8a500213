//! How the stresses of a cell follow its strains: by the operators of its contacts, or by perturbations where these do not tell it.

use super::error::ElementError;
use super::path::{COMPONENTS, Operator, by_gradient, flat, tensor_of};
use super::run::Run;
use super::servo::Servo;
use super::step::Step;
use super::stress_relaxation::Relaxation;
use super::tested_cell::TestedCell;
use crate::tangent::FrozenMethod;

/// Strain of a perturbation. Its trial takes the least number of steps.
const PERTURBATION: f64 = 1e-6;

/// What perturbations have told in a segment, or since its stresses were last relaxed, `d sigma / dG`, Pa.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probed {
    /// Of the controlled components then.
    elastic: Operator,
    /// The same as the last search that ended at a strain has left it, at its stresses or as near as a snap allows.
    followed: Option<Operator>,
}

impl<C: TestedCell> Run<C> {
    /// `d sigma / dG` of the committed state while contacts stick.
    pub(super) fn elastic(&mut self, step: &Step) -> Result<Operator, ElementError> {
        match self.by_contacts(FrozenMethod::TRUSS_LIKE, step) {
            Some(operator) => Ok(operator),
            None => Ok(self.probed(step)?.elastic),
        }
    }

    /// The same while contacts go on sliding.
    pub(super) fn sliding(&mut self, step: &Step) -> Result<Operator, ElementError> {
        match self.by_contacts(FrozenMethod::TRUSS_LIKE_SLIP, step) {
            Some(operator) => Ok(operator),
            None => self.probed(step).map(|probed| probed.followed.unwrap_or(probed.elastic)),
        }
    }

    /// Takes over what a search that has ended at a strain has learnt.
    pub(super) fn follow_up(&mut self, search: &Servo) {
        if let Some(probed) = &mut self.probed {
            probed.followed = Some(search.derivative());
        }
    }

    /// Searches begin with what the start of the segment has told.
    pub(super) fn forget_followed(&mut self) {
        if let Some(probed) = &mut self.probed {
            probed.followed = None;
        }
    }

    fn by_contacts(&self, method: FrozenMethod, step: &Step) -> Option<Operator> {
        let network = self.network.as_ref().expect("row 0 sets the network");
        C::operator_of(network, method).map(|operator| by_gradient(&operator, &step.committed_gradient))
    }

    fn probed(&mut self, step: &Step) -> Result<Probed, ElementError> {
        if let Some(probed) = self.probed {
            return Ok(probed);
        }
        let elastic = self.perturbed(step)?;
        // Where perturbations tell nothing, as in a frame that is far from rest and collapses in each of them, uniform strain of all grains takes
        // their place: too stiff, so that steps are short.
        let is_sound = Relaxation::new(&step.targets).is_sound(&elastic);
        let uniform = || self.by_contacts(FrozenMethod::KRUYT, step);
        let elastic = if is_sound { elastic } else { uniform().unwrap_or(elastic) };
        Ok(*self.probed.insert(Probed { elastic, followed: None }))
    }

    /// Central differences about the committed state by the strains of the controlled components.
    fn perturbed(&mut self, step: &Step) -> Result<Operator, ElementError> {
        let mut operator = [[0.0; COMPONENTS]; COMPONENTS];
        let trials = self.spent.trials;
        for column in (0..COMPONENTS).filter(|place| step.targets[*place].is_some()) {
            let mut stresses = [[0.0; COMPONENTS]; 2];
            for (stress, sign) in stresses.iter_mut().zip([1.0, -1.0]) {
                let mut gradient = flat(&step.committed_gradient);
                gradient[column] += sign * PERTURBATION;
                *stress = self.attempt(step, &tensor_of(&gradient), 0)?.stress.0;
            }
            for (row, values) in operator.iter_mut().enumerate() {
                values[column] = (stresses[0][row] - stresses[1][row]) / (2.0 * PERTURBATION);
            }
        }
        // Their force evaluations count with the row, they themselves are no trials of a search.
        self.spent.trials = trials;
        Ok(operator)
    }
}
