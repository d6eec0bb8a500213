//! Inputs that all cells of a batch share.

use super::stiffness::INERTIA_FACTOR;
use crate::contact::{ContactLaw, Rotations};
use crate::definition::{GrainModel, RveOptions};
use crate::solver::kernel::GrainConstants;
use crate::solver::kernel::backend::Backend;
use crate::space::Space;

/// Skin of the pair list in mean radii: at a strain of 1e-6 per step a list lives for thousands of steps, and a thicker
/// skin would only make the kernel test more empty pairs.
const SKIN: f64 = 0.05;

/// Packing, law and options of the cells of a batch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting<'a, C> {
    pub(crate) radii: &'a [f64],
    pub(crate) law: &'a C,
    pub(crate) rotations_free: bool,
    /// Whether contacts have viscosity.
    pub(crate) is_viscous: bool,
    /// Whether work and damping are summed up.
    pub(crate) counts_energies: bool,
    pub(crate) options: &'a RveOptions,
    pub(crate) mean_radius: f64,
    pub(crate) largest_radius: f64,
    /// Skin of the pair list, m; no result depends on it.
    pub(crate) skin: f64,
    /// No result depends on it either.
    pub(crate) backend: Backend,
}

impl<'a, C> Setting<'a, C> {
    /// Of a model, with the usual skin and the best back end.
    pub(crate) fn of(model: &'a GrainModel, law: &'a C) -> Self {
        let (mean_radius, largest_radius) = (model.mean_radius(), model.largest_radius());
        Self {
            radii: &model.radii,
            law,
            rotations_free: model.rotations == Rotations::Free,
            is_viscous: model.is_viscous,
            counts_energies: false,
            options: &model.options,
            mean_radius,
            largest_radius,
            skin: SKIN * mean_radius,
            backend: Backend::best(),
        }
    }

    /// Inertia of rotation over mass times radius squared; 0 for blocked grains.
    pub(crate) fn inertia_factor(&self) -> f64 {
        if self.rotations_free { INERTIA_FACTOR } else { 0.0 }
    }

    /// Stiffness, N/m, of a contact that is pressed as far as one step of this strain brings two grains together; 0 for
    /// laws that are as stiff as that at any overlap.
    ///
    /// Contacts of a gas of Hertzian grains begin without stiffness: masses taken from them alone would be next to nothing, and
    /// the first deeper touch would throw the grains through many cells in one step.
    pub(crate) fn first_touch_stiffness<S: Space>(&self, strain: f64) -> f64
    where
        C: ContactLaw<S::Kernel>,
    {
        let constants = self.law.constants([self.mean_radius; 2]);
        let at = |overlap: f64| self.law.stiffness(&constants, overlap)[0];
        let overlap = 2.0 * self.mean_radius * strain;
        if at(4.0 * overlap) > at(overlap) { at(overlap) } else { 0.0 }
    }

    /// Inertias of the grains per unit of a cell's mass: grains of stiffer contacts get more of it, so that all are
    /// equally sluggish.
    pub(crate) fn grain_constants<S: Space>(&self) -> Vec<GrainConstants>
    where
        C: ContactLaw<S::Kernel>,
    {
        let overlap = 1e-3 * self.mean_radius;
        let stiffness = |radius| self.law.stiffness(&self.law.constants([radius, radius]), overlap)[0];
        let mean = stiffness(self.mean_radius);
        let factor = self.inertia_factor();
        self.radii
            .iter()
            .map(|&radius| {
                let mass = stiffness(radius) / mean;
                let rotation = factor * mass * radius * radius;
                GrainConstants {
                    mass,
                    inverse_mass: 1.0 / mass,
                    rotation,
                    inverse_rotation: if rotation > 0.0 { 1.0 / rotation } else { 0.0 },
                    inverse_radius: if self.rotations_free { 1.0 / radius } else { 0.0 },
                }
            })
            .collect()
    }
}
