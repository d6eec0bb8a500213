//! The state of a packing as given, under the contact law of the scene.

use crate::exit::{Exit, Failure};
use protocol::{Observables, Scalars, Tensor2};
use rve_server::definition::{AnyDefinition, GrainDefinition};
use rve_server::engine::{GrainRve, ListedForces};
use rve_server::homogenization::fabric::LARGE_OVERLAP_RATIO;
use rve_server::solver::SolverFor;
use scene_reader::Scene;

/// Largest over smallest radius above which a packing is likely to mix units.
const WIDEST_GRADING: f64 = 1e3;

/// A packing as given, before any grain has moved.
#[derive(Clone, Debug)]
pub(crate) struct PackingState {
    /// Stress, Pa, tension positive.
    pub(crate) stress: Tensor2,
    /// Space dimension of the packing.
    pub(crate) dimension: usize,
    /// Density, contacts and overlaps.
    pub(crate) scalars: Scalars,
    /// Coordination number without rattlers.
    pub(crate) coordination_no_rattlers: f64,
    /// How many of the tangential forces in its file could be used.
    pub(crate) listed_forces: ListedForces,
    /// Largest over smallest radius.
    pub(crate) radius_ratio: f64,
    /// Whether it holds together and is far from equilibrium under the contact law.
    pub(crate) is_far_from_rest: bool,
}

impl PackingState {
    /// The states of all packings of a scene, in the order of its definitions: the first is that of the scene, others are those of regions.
    ///
    /// # Errors
    /// A packing that cannot be a cell.
    pub(crate) fn of_all(scene: &Scene) -> Result<Vec<Self>, Failure> {
        scene.materials.definitions.iter().map(Self::of).collect()
    }

    /// The state of the packing of a definition.
    ///
    /// # Errors
    /// Forces that are not finite.
    pub(crate) fn of(definition: &AnyDefinition) -> Result<Self, Failure> {
        match definition {
            AnyDefinition::Discs(discs) => Self::of_cell(discs, discs.packing.grains.iter().map(|grain| grain[2])),
            AnyDefinition::Spheres(spheres) => {
                Self::of_cell(spheres, spheres.packing.grains.iter().map(|grain| grain[3]))
            }
        }
    }

    fn of_cell<S: SolverFor>(
        definition: &GrainDefinition<S>,
        radii: impl Iterator<Item = f64>,
    ) -> Result<Self, Failure> {
        let refused = |error| Failure::new(Exit::BadInput, error);
        let mut cell = GrainRve::new(definition).map_err(refused)?;
        let answer = cell.observe(Observables::ALL).map_err(refused)?;
        let (smallest, largest) =
            radii.fold((f64::INFINITY, 0.0f64), |(low, high), radius| (low.min(radius), high.max(radius)));
        Ok(Self {
            stress: answer.stress,
            dimension: S::DIMENSION,
            scalars: answer.scalars,
            coordination_no_rattlers: answer.observed.coordination_number_no_rattlers,
            listed_forces: cell.listed_forces(),
            radius_ratio: largest / smallest,
            is_far_from_rest: cell.is_far_from_rest(&answer),
        })
    }

    /// Whether no chain of contacts spans the cell.
    pub(crate) fn carries_no_load(&self) -> bool {
        self.coordination_no_rattlers == 0.0 || self.stress.0.iter().all(|component| *component == 0.0)
    }

    /// Mean pressure, Pa, compression positive: over the axes of the packing.
    pub(super) fn pressure(&self) -> f64 {
        pressure_of(&self.stress, self.dimension)
    }

    /// The stress tensor and its mean for people.
    pub(crate) fn stress_text(&self) -> String {
        let names = ["xx", "yy", "zz"];
        let direct = names.iter().enumerate().take(self.dimension).map(|(axis, name)| (*name, 4 * axis));
        let shear = [("xy", 1), ("xz", 2), ("yz", 5)].into_iter().take(if self.dimension == 2 { 1 } else { 3 });
        let parts: Vec<String> =
            direct.chain(shear).map(|(name, place)| format!("{name} {:.3e}", self.stress.0[place])).collect();
        format!("{} Pa (tension positive), mean pressure {:.3e} Pa", parts.join(", "), self.pressure())
    }

    /// Density and contacts for people.
    pub(crate) fn state_text(&self) -> String {
        format!(
            "void ratio {:.4}, coordination number {:.3} ({:.3} without rattlers), largest overlap {:.1e} of a diameter",
            self.scalars.void_ratio,
            self.scalars.coordination_number,
            self.coordination_no_rattlers,
            self.scalars.max_overlap_ratio
        )
    }

    /// What the contact law does not take over of the equilibrium in which the packing was written, one line each.
    pub(crate) fn remarks_on_the_law(&self) -> Vec<String> {
        let unrest = self.is_far_from_rest.then(|| {
            format!(
                "the grains are far from rest under this contact law, unbalanced forces reach {:.2} of the mean contact force: the first \
                 increment begins with their motion. Prepare the packing under the law of the scene (`grainspan pack`)",
                self.scalars.unbalanced_force_ratio
            )
        });
        self.listed_forces.warning().into_iter().chain(unrest).collect()
    }

    /// Warnings, one line each.
    pub(crate) fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.carries_no_load() {
            remarks.push(
                "the packing carries no load: no chain of contacts spans the cell; the stiffness of a run would be singular. Prepare one with `grainspan pack`"
                    .to_owned(),
            );
        }
        if self.scalars.max_overlap_ratio > LARGE_OVERLAP_RATIO {
            remarks.push(format!(
                "grains overlap by {:.2} of a diameter: wrong units, a modulus that is too small, or another contact law than the \
                 packing was made with",
                self.scalars.max_overlap_ratio
            ));
        }
        if self.radius_ratio > WIDEST_GRADING {
            let ratio = self.radius_ratio;
            remarks.push(format!(
                "the largest grain is {ratio:.1e} times the smallest: is one of them given in other units?"
            ));
        }
        remarks
    }
}

/// Mean pressure of a stress over the axes of a packing, Pa, compression positive.
pub(super) fn pressure_of(stress: &Tensor2, dimension: usize) -> f64 {
    -(0..dimension).map(|axis| stress.0[4 * axis]).sum::<f64>() / dimension as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::start_state::tests::scene;

    #[test]
    fn the_mean_pressure_of_a_packing_of_spheres_is_over_three_axes() {
        let packing = PackingState::of(scene("single-hexahedron-biaxial.toml", &[]).definition()).unwrap();
        let trace: f64 = [0, 4, 8].map(|place| packing.stress.0[place]).iter().sum();
        assert!((packing.pressure() + trace / 3.0).abs() < 1e-9 * packing.pressure());
        assert!(packing.stress_text().contains("zz ") && !packing.carries_no_load());
    }
}
