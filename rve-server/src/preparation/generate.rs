//! Makes a packing: random places at low density, isotropic compression until the grains carry load, then a servo on all
//! stress components until the stress is the target and the grains are at rest. Around that, where requested: a search
//! of the preparation friction, a shear that leaves an anisotropic fabric behind, and the removal of random grains.

use super::compaction::{Compaction, StepsWithoutPressure, Tolerances};
use super::friction_search::search;
use super::preshear::presheared;
use super::progress::{PackingProgress, ProgressLog};
use super::random_placement::scattered;
use super::recipe::{PackingRecipe, Removal};
use super::removal::weakened;
use super::report::{PackingReport, Searches, measured, value_of};
use super::stress_target::StressTarget;
use crate::contact::ContactTable;
use crate::definition::{Packing, PackingError, PackingFile};
use crate::solver::SolverFor;

/// Makes the packing that a recipe describes, of discs or of spheres.
///
/// # Errors
/// As [`generate`].
pub fn generate_any(
    recipe: &PackingRecipe,
    progress: &mut dyn FnMut(&PackingProgress),
) -> Result<(Packing, PackingReport), PackingError> {
    if recipe.dimension == 3 {
        let (packing, report) = generate(recipe, progress)?;
        Ok((Packing::Spheres(packing), report))
    } else {
        let (packing, report) = generate(recipe, progress)?;
        Ok((Packing::Discs(packing), report))
    }
}

/// Makes the packing that a recipe describes. Equal recipes give equal bits.
///
/// # Errors
/// [`PackingError::Content`] when the recipe is refused or something it asks for is not reached.
pub fn generate<S: SolverFor>(
    recipe: &PackingRecipe,
    progress: &mut dyn FnMut(&PackingProgress),
) -> Result<(PackingFile<S>, PackingReport), PackingError> {
    recipe.validate()?;
    if recipe.dimension as usize != S::DIMENSION {
        return Err(PackingError::Content(format!(
            "dimension = {}, but {} were requested",
            recipe.dimension,
            S::GRAINS
        )));
    }
    let target = recipe.stress_target()?;
    let log = ProgressLog::new(progress);
    let generator = PackingGenerator { recipe, target, log: &log };
    let (mut packing, contact, searches) = generator.prepare::<S>()?;
    if let Some(removal) = &recipe.removal {
        packing = generator.weakened(&packing, &contact, removal)?;
    }
    packing.provenance = provenance(recipe, &searches);
    let packing = packing.checked()?;
    let report = measured(recipe, &target, &packing, &contact, searches, log.spent())?;
    report.refuse_misses()?;
    Ok((packing, report))
}

fn provenance(recipe: &PackingRecipe, searches: &Searches) -> serde_json::Value {
    let mut provenance = serde_json::json!({
        "made_by": concat!("grainspan pack ", env!("CARGO_PKG_VERSION")),
        "recipe": recipe,
    });
    if *searches != Searches::default() {
        provenance["searches"] = serde_json::json!(searches);
    }
    provenance
}

/// Inputs that all stages of one preparation share.
struct PackingGenerator<'a> {
    recipe: &'a PackingRecipe,
    target: StressTarget,
    log: &'a ProgressLog<'a>,
}

impl<'a> PackingGenerator<'a> {
    /// A packing at its target stress with the density and anisotropy requested, and the law it is at rest under.
    fn prepare<S: SolverFor>(&self) -> Result<(PackingFile<S>, ContactTable, Searches), PackingError> {
        let mut contact = self.recipe.contact.clone();
        let mut searches = Searches::default();
        let mut packing = match &self.recipe.target {
            None => self.compacted(&contact)?,
            Some(target) => {
                let (quantity, wanted) = target.quantity()?;
                let mut make = |friction: f64| {
                    let contact = ContactTable { friction, ..contact.clone() };
                    let packing = self.compacted(&contact)?;
                    self.log.next_attempt();
                    let report = measured(self.recipe, &self.target, &packing, &contact, Searches::default(), 0)?;
                    Ok((packing, value_of(&report, quantity)))
                };
                let (packing, attempts) = search(wanted, target.tolerance, target.friction, &mut make)?;
                contact.friction = attempts.last().map_or(contact.friction, |attempt| attempt.friction);
                searches.friction = attempts;
                packing
            }
        };
        if let Some(anisotropy) = &self.recipe.anisotropy {
            contact.friction = anisotropy.friction;
            let mut prepared = || {
                self.log.next_attempt();
                self.compaction(packing.clone(), &contact)
            };
            let (compaction, attempts) = presheared(anisotropy, self.target.dimension, &mut prepared)?;
            packing = compaction.packing(serde_json::Value::Null)?;
            searches.shear = attempts;
        }
        Ok((packing, contact, searches))
    }

    /// Random places, compressed and brought to the target stress.
    fn compacted<S: SolverFor>(&self, contact: &ContactTable) -> Result<PackingFile<S>, PackingError> {
        let mut compaction = self.compaction(scattered(self.recipe)?, contact)?;
        compaction.compress()?;
        compaction.servo(if self.recipe.anisotropy.is_some() {
            StepsWithoutPressure::Many
        } else {
            StepsWithoutPressure::Few
        })?;
        compaction.packing(serde_json::Value::Null)
    }

    /// The packing without some of its grains, at rest again.
    fn weakened<S: SolverFor>(
        &self,
        packing: &PackingFile<S>,
        contact: &ContactTable,
        removal: &Removal,
    ) -> Result<PackingFile<S>, PackingError> {
        weakened(packing, contact, removal, self.target, self.tolerances(), self.log)
    }

    fn compaction<S: SolverFor>(
        &self,
        packing: PackingFile<S>,
        contact: &ContactTable,
    ) -> Result<Compaction<'a, S>, PackingError> {
        Compaction::new(packing, contact, self.target, self.tolerances(), self.log)
    }

    fn tolerances(&self) -> Tolerances {
        Tolerances { force: self.recipe.tolerance, stress: self.recipe.stress_tolerance }
    }
}
