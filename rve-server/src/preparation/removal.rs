//! Packings weakened by taking random grains out, as in [Liu2015] section 3.4.

use super::at_stress::has_level_vectors;
use super::compaction::{
    Compaction, StepsWithoutPressure, TOLERANCES_OF_CHANGED_PACKINGS, Tolerances, packing_error, rows,
};
use super::progress::ProgressLog;
use super::random_placement::chosen;
use super::recipe::Removal;
use super::servo::pressure;
use super::stress_target::StressTarget;
use crate::contact::ContactTable;
use crate::definition::{GrainDefinition, ListedContact, Packing, PackingError, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::solver::SolverFor;
use crate::space::Space;
use protocol::{Observables, RveError, RveSolver, TrialFlags, TrialOptions};

/// Largest angle between Y1 and the first axis, rad, that is taken for none.
const ALIGNED: f64 = 1e-9;

/// Least pressure of a packing at rest over the pressure that it has as read: below it the packing has lost its load, and what is left is no
/// stress that a neighbour is in balance with.
const LEAST_SHARE_OF_PRESSURE: f64 = 1e-3;

/// A packing from which grains have been taken.
#[derive(Clone, Debug, PartialEq)]
pub struct WeakenedPacking {
    /// The packing.
    pub packing: Packing,
    /// Whether its stress is that to which it came to rest, because the packing as read was far from rest under the law.
    pub came_to_rest_first: bool,
}

impl Packing {
    /// The packing without `removal.number` random grains, brought back under this contact law to the stress that it had.
    /// Equal removals give equal bits.
    ///
    /// # Errors
    /// [`PackingError::Content`] if too many grains are to be removed, the packing bears tension, its vector Y1 does not
    /// point along the first axis, or the stress is not reached.
    pub fn weakened(&self, contact: &ContactTable, removal: &Removal) -> Result<WeakenedPacking, PackingError> {
        let (packing, came_to_rest_first) = match self {
            Self::Discs(packing) => {
                let (packing, came_to_rest_first) = at_its_stress(packing, contact, removal)?;
                (Self::Discs(packing), came_to_rest_first)
            }
            Self::Spheres(packing) => {
                let (packing, came_to_rest_first) = at_its_stress(packing, contact, removal)?;
                (Self::Spheres(packing), came_to_rest_first)
            }
        };
        Ok(WeakenedPacking { packing, came_to_rest_first })
    }
}

fn at_its_stress<S: SolverFor>(
    packing: &PackingFile<S>,
    contact: &ContactTable,
    removal: &Removal,
) -> Result<(PackingFile<S>, bool), PackingError> {
    let refuse = |reason: String| Err(PackingError::Content(reason));
    if removal.number == 0 || removal.number > packing.grains.len() / 4 {
        return refuse(format!(
            "{} grains are to be removed; that must be at least 1 and at most a quarter of the {}",
            removal.number,
            packing.grains.len()
        ));
    }
    let first = packing.periodicity[0];
    if (1..S::DIMENSION).any(|axis| first[axis].abs() > ALIGNED * first[0].abs()) || first[0] < 0.0 {
        return refuse(
            "grains can only be removed from a packing whose vector Y1 points along the first axis".into(),
        );
    }
    if !has_level_vectors(packing) || packing.periodicity[1][1] < 0.0 {
        return refuse(
            "grains can only be removed from a packing whose vector Y2 lies in the plane of axes 1 and 2, counter-clockwise of Y1; turn the \
             packing, or write -Y2 and -Y3 for Y2 and Y3, which make the same lattice"
                .into(),
        );
    }
    let definition =
        GrainDefinition { packing: packing.clone(), contact: contact.clone(), options: RveOptions::default() };
    // Under another law than that of its preparation a packing is not at rest, and its stress as read is none that its neighbours keep.
    let mut came_to_rest_first = false;
    let answer = GrainRve::<S>::new(&definition).and_then(|mut cell| {
        let as_read = cell.observe(Observables::ALL)?;
        if !cell.is_far_from_rest(&as_read) {
            return Ok(as_read);
        }
        let at_rest = cell.settle(&TrialOptions::default())?;
        if at_rest.flags.contains(TrialFlags::NOT_EQUILIBRATED) {
            return Err(RveError::Definition(
                "the packing does not come to rest under this contact law, so it has no stress to be brought back to; prepare it with this law".into(),
            ));
        }
        cell.commit()?;
        came_to_rest_first = true;
        let answer = cell.observe(Observables::NONE)?;
        let [before, after] = [&as_read, &answer].map(|answer| pressure(&answer.stress, S::DIMENSION));
        if after < LEAST_SHARE_OF_PRESSURE * before {
            return Err(RveError::Definition(format!(
                "the packing comes to rest under this contact law at a pressure of {after:.1e} Pa, where it has {before:.1e} Pa as read: it has \
                 lost its load, and no stress is left to which it could be brought back; prepare it with this law"
            )));
        }
        Ok(answer)
    });
    let stress = rows(&answer.map_err(packing_error)?.stress);
    let symmetric: Vec<Vec<f64>> =
        (0..S::DIMENSION).map(|i| (0..S::DIMENSION).map(|j| 0.5 * (stress[i][j] + stress[j][i])).collect()).collect();
    let target = StressTarget::from_rows(&symmetric, S::DIMENSION)?;
    let mut ignore = |_: &_| {};
    let packing =
        weakened(packing, contact, removal, target, TOLERANCES_OF_CHANGED_PACKINGS, &ProgressLog::new(&mut ignore))?;
    Ok((packing, came_to_rest_first))
}

/// The packing without some of its grains, brought to its target stress.
///
/// # Errors
/// [`PackingError::Content`] if the stress is not reached.
pub(crate) fn weakened<'a, S: SolverFor>(
    packing: &PackingFile<S>,
    contact: &ContactTable,
    removal: &Removal,
    target: StressTarget,
    tolerances: Tolerances,
    log: &'a ProgressLog<'a>,
) -> Result<PackingFile<S>, PackingError> {
    let removed = chosen(packing.grains.len(), removal.number, removal.seed);
    let mut compaction = Compaction::new(without(packing, &removed), contact, target, tolerances, log)?;
    compaction.servo(StepsWithoutPressure::Many)?;
    compaction.packing(serde_json::Value::Null)
}

/// The packing without the grains `removed` (ascending) and their contacts; the others are numbered again, in order.
fn without<S: Space>(packing: &PackingFile<S>, removed: &[usize]) -> PackingFile<S> {
    let mut numbers = vec![None; packing.grains.len()];
    let mut next = 0u32;
    for (grain, number) in numbers.iter_mut().enumerate() {
        if removed.binary_search(&grain).is_err() {
            *number = Some(next);
            next += 1;
        }
    }
    let kept = |grain: usize| numbers[grain].is_some();
    let grains = packing.grains.iter().enumerate().filter(|(grain, _)| kept(*grain)).map(|(_, grain)| *grain);
    let (mut contacts, mut rolling_moments) = (Vec::new(), Vec::new());
    for (place, contact) in packing.contacts.iter().enumerate() {
        if let (Some(origin), Some(end)) = (numbers[contact.origin as usize], numbers[contact.end as usize]) {
            contacts.push(ListedContact { origin, end, ..*contact });
            rolling_moments.extend(packing.rolling_moments.get(place));
        }
    }
    PackingFile { grains: grains.collect(), contacts, rolling_moments, ..packing.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// One lattice by two pairs of vectors: the axes of the packing are those of the vectors that it was given with.
    #[test]
    fn the_choice_of_vectors_turns_nothing() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let Packing::Discs(mut flat) = Packing::read(&path).unwrap() else { panic!("the file holds discs") };
        flat.contacts.clear();
        // Long cells: their second vector leans by two thirds of the first.
        let [first, second] = flat.periodicity;
        let mut lean = flat.clone();
        lean.periodicity[1] = [second[0] + 2.0 * first[0], second[1] + 2.0 * first[1]];
        let contact =
            ContactTable { modulus: Some(1e8), normal_stiffness: None, ..ContactTable::linear(1.0, 0.5, 0.5) };
        let fabric = |packing: PackingFile| {
            let made = Packing::Discs(packing).weakened(&contact, &Removal { number: 4, seed: 3 }).unwrap();
            let Packing::Discs(packing) = made.packing else { panic!("discs stay discs") };
            let options = RveOptions::default();
            let definition = GrainDefinition { packing, contact: contact.clone(), options };
            rows(&GrainRve::new(&definition).unwrap().observe(Observables::FABRIC).unwrap().observed.fabric)
        };
        let (flat, lean) = (fabric(flat), fabric(lean));
        for (i, j) in [(0, 0), (0, 1), (1, 1)] {
            assert!((flat[i][j] - lean[i][j]).abs() < 2e-3, "{flat:?} {lean:?}");
        }
    }

    /// Loose grains that were prepared with much friction, under a law with little: 5000 steps of the servo ended in another cause.
    #[test]
    fn a_packing_that_loses_its_load_is_refused_at_once() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-400-loose.json");
        let whole = Packing::read(&path).unwrap();
        let contact =
            ContactTable { modulus: Some(1e8), normal_stiffness: None, ..ContactTable::linear(1.0, 0.5, 0.05) };
        let refusal = whole.weakened(&contact, &Removal { number: 3, seed: 3 }).unwrap_err().to_string();
        assert!(refusal.contains("has lost its load"), "{refusal}");
    }

    #[test]
    fn a_weakened_packing_has_fewer_grains_and_the_stress_that_it_had() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let whole = Packing::read(&path).unwrap();
        let contact =
            ContactTable { modulus: Some(1e8), normal_stiffness: None, ..ContactTable::linear(1.0, 0.5, 0.5) };
        let removal = Removal { number: 6, seed: 3 };
        let made = whole.weakened(&contact, &removal).unwrap();
        assert!(!made.came_to_rest_first);
        let Packing::Discs(weak) = made.packing.clone() else { panic!("discs stay discs") };
        assert_eq!(weak.grains.len(), 94);
        let stress = |packing: &PackingFile| {
            let definition = GrainDefinition {
                packing: packing.clone(),
                contact: contact.clone(),
                options: RveOptions::default(),
            };
            rows(&GrainRve::new(&definition).unwrap().observe(Observables::NONE).unwrap().stress)
        };
        let Packing::Discs(whole_discs) = &whole else { panic!("the file holds discs") };
        let (before, after) = (stress(whole_discs), stress(&weak));
        for (i, j) in [(0, 0), (0, 1), (1, 1)] {
            assert!((before[i][j] - after[i][j]).abs() < 2e-6 * 1e5, "{before:?} {after:?}");
        }
        assert!(weak.periodicity[0][0] < whole_discs.periodicity[0][0], "the holes have closed a little");
        assert_eq!(whole.weakened(&contact, &removal).unwrap(), made, "the same bits again");
        // With half the modulus, listed tangential forces no longer fit: the packing comes to rest before its stress is taken.
        let softer = ContactTable { modulus: Some(5e7), ..contact.clone() };
        assert!(whole.weakened(&softer, &removal).unwrap().came_to_rest_first);
        let reason = |number| whole.weakened(&contact, &Removal { number, seed: 3 }).unwrap_err().to_string();
        assert!(reason(0).contains("at least 1") && reason(26).contains("a quarter of the 100"));
    }
}
