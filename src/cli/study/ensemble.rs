//! Makes the packings of a study and takes each along every path, side by side on the cores. Results come in the order of the study
//! whatever ends first, so they have the same bits for any number of jobs.

use super::curve::{Collector, Path, value};
use super::statistics::{PowerFit, Statistics};
use crate::exit::Failure;
use crate::side_by_side::side_by_side;
use protocol::TangentKind;
use rve_server::definition::Packing;
use rve_server::preparation::{PackingRecipe, SoftGrains, generate_any, soft_grains};
use rve_server::programs::rve_test::{run_element_on, start_note, start_warnings};
use scene_reader::{Ensemble, RowMeasure, Study};
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One packing of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Place of its recipe.
    pub(super) recipe: usize,
    /// Place of its size.
    pub(super) size: usize,
    /// Its seed.
    pub(super) seed: u64,
    /// Its number of grains.
    pub(super) grains: usize,
}

/// A packing and its paths, in the order of the tests.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sample {
    /// Which packing.
    pub(super) place: Place,
    /// Its paths; why there are none.
    pub(super) paths: Result<Vec<Path>, String>,
    /// What is to be said about its packing and where its paths start.
    pub(super) remarks: Vec<Remark>,
}

/// What a remark about a sample is about: one of each kind is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Subject {
    /// The cell is narrow for its grains.
    Cell,
    /// The packing does not suit the start of the path.
    Start,
    /// Tangential forces or moments of the packing were not taken over.
    ListedForces,
    /// The first segment changes a stress while it strains: a note, no warning.
    FirstSegment,
}

impl Subject {
    /// All subjects, in the order in which they are told.
    pub(super) const ALL: [Self; 4] = [Self::Cell, Self::Start, Self::ListedForces, Self::FirstSegment];
}

/// Something to be said about a sample.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Remark {
    /// What it is about.
    pub(super) subject: Subject,
    /// What is said, behind the name of the sample.
    pub(super) text: String,
}

/// All samples of a study.
#[derive(Debug)]
pub(super) struct Results<'a> {
    /// The study.
    pub(super) study: &'a Study,
    /// The distinct measures of its quantities.
    pub(super) measures: Vec<RowMeasure>,
    /// Recipe by recipe, size by size, seed by seed.
    pub(super) samples: Vec<Sample>,
}

/// The packings of a study, in its order.
pub(super) fn places(study: &Study) -> Vec<Place> {
    let mut found = Vec::new();
    for (recipe, entry) in study.recipes.iter().enumerate() {
        for (size, number) in study.sizes().into_iter().enumerate() {
            let grains = if number == 0 { entry.recipe.number } else { number };
            let seeds = (0..u64::from(study.seeds)).map(|offset| study.first_seed.wrapping_add(offset));
            found.extend(seeds.map(|seed| Place { recipe, size, seed, grains }));
        }
    }
    found
}

/// Why a sample has no paths when a stop was requested before it had ended.
const INTERRUPTED: &str = "a stop was requested before it had ended";

/// Makes all samples with this many at a time; `on_sample` hears of each as soon as it has ended, with the number that have. Once
/// `keep_going` says no, what has not ended counts as failed.
///
/// # Errors
/// None of a sample: those are part of the results.
pub(super) fn run<'a>(
    study: &'a Study,
    jobs: NonZeroUsize,
    keep_going: &(dyn Fn() -> bool + Sync),
    on_sample: &(dyn Fn(usize, &Sample) + Sync),
) -> Results<'a> {
    let measures = measures(study);
    let places = places(study);
    // Large packings first: none of them is left alone at the end.
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|place| std::cmp::Reverse(places[*place].grains));
    let done = AtomicUsize::new(0);
    // What is not begun after a stop counts as interrupted.
    let made = side_by_side(&order, jobs, &|| true, &|number| {
        let sample = sample(study, places[number], &measures, keep_going);
        if keep_going() {
            on_sample(done.fetch_add(1, Ordering::Relaxed) + 1, &sample);
        }
        sample
    });
    Results { study, measures, samples: made.into_iter().flatten().collect() }
}

/// The distinct measures of the quantities, in the order of the declaration.
fn measures(study: &Study) -> Vec<RowMeasure> {
    let mut found: Vec<RowMeasure> = study.quantities.iter().map(|quantity| quantity.measure).collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// One packing with all its paths.
fn sample(study: &Study, place: Place, measures: &[RowMeasure], keep_going: &(dyn Fn() -> bool + Sync)) -> Sample {
    let interrupted = || Sample { place, paths: Err(INTERRUPTED.to_owned()), remarks: Vec::new() };
    if !keep_going() {
        return interrupted();
    }
    let recipe =
        PackingRecipe { seed: place.seed, number: place.grains, ..study.recipes[place.recipe].recipe.clone() };
    let packing = generate_any(&recipe, &mut |_| ()).map(|(packing, _)| packing);
    let narrow = packing.as_ref().ok().and_then(Packing::narrow_cell);
    let mut remarks: Vec<Remark> =
        narrow.into_iter().map(|text| Remark { subject: Subject::Cell, text: format!(": {text}") }).collect();
    let paths = match packing {
        Err(error) => Err(format!("no packing: {error}")),
        Ok(packing) => Ok(study
            .tests
            .iter()
            .map(|entry| {
                let mut rows = Collector::new(measures, entry.strain);
                let mut say = |subject, text: String| {
                    remarks.push(Remark { subject, text: format!(", {}: {text}", entry.name) });
                };
                let end = run_element_on(&entry.test, packing.clone(), TangentKind::None, &mut |row| {
                    if row.increment == 0 {
                        start_warnings(&entry.test, row).into_iter().for_each(|text| say(Subject::Start, text));
                        start_note(&entry.test, row).into_iter().for_each(|text| say(Subject::FirstSegment, text));
                    }
                    rows.add(row);
                    if keep_going() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
                });
                end.summary.listed_forces.warning().into_iter().for_each(|text| say(Subject::ListedForces, text));
                let path = rows.finish(study.smoothing, end.result.err().map(|error| error.to_string()));
                Path { fallbacks: [end.summary.warnings(), end.summary.fallbacks()].concat(), ..path }
            })
            .collect()),
    };
    if keep_going() { Sample { place, paths, remarks } } else { interrupted() }
}

impl Results<'_> {
    /// Remarks on packings and starts of paths, each with the name of its sample.
    pub(super) fn remarks(&self) -> Vec<Remark> {
        let named = |sample: &Sample, remark: &Remark| {
            let text = format!("{}{}", self.name(sample.place), remark.text);
            Remark { subject: remark.subject, text }
        };
        let of = |sample: &Sample| sample.remarks.iter().map(|remark| named(sample, remark)).collect::<Vec<_>>();
        self.samples.iter().flat_map(of).collect()
    }

    /// What a sample is called.
    pub(super) fn name(&self, place: Place) -> String {
        format!("{}, {} grains, seed {}", self.study.recipes[place.recipe].name, place.grains, place.seed)
    }

    /// The value of a quantity in a sample.
    ///
    /// # Errors
    /// Why there is none.
    pub(super) fn value(&self, sample: &Sample, test: usize, quantity: usize) -> Result<f64, String> {
        let paths = sample.paths.as_ref().map_err(Clone::clone)?;
        let quantity = &self.study.quantities[quantity];
        let measure = self.measures.iter().position(|measure| *measure == quantity.measure);
        let of_slopes =
            if quantity.measure.needs_compression() { "; dilatancy needs three rows within `smoothing`" } else { "" };
        value(&paths[test], measure.ok_or("it is not measured")?, quantity.rows).map_err(|reason| reason + of_slopes)
    }

    /// Samples of a recipe and size.
    pub(super) fn of(&self, recipe: usize, size: usize) -> impl Iterator<Item = &Sample> {
        self.samples.iter().filter(move |sample| sample.place.recipe == recipe && sample.place.size == size)
    }

    /// Number of grains of the packings of a recipe and size.
    pub(super) fn grains(&self, recipe: usize, size: usize) -> usize {
        self.of(recipe, size).next().map_or(0, |sample| sample.place.grains)
    }

    /// Statistics of a quantity over an ensemble, `None` if no sample has a value; and how many samples have none.
    pub(super) fn statistics(&self, ensemble: Ensemble) -> (Option<Statistics>, usize) {
        let values: Vec<Result<f64, String>> = self
            .of(ensemble.recipe, ensemble.size)
            .map(|sample| self.value(sample, ensemble.test, ensemble.quantity))
            .collect();
        let missing = values.iter().filter(|value| value.is_err()).count();
        let found: Vec<f64> = values.into_iter().flatten().collect();
        (Statistics::of(&found), missing)
    }

    /// How the scatter of a quantity falls with the number of grains.
    pub(super) fn power(&self, ensemble: Ensemble) -> Option<PowerFit> {
        let sizes: Vec<(usize, Statistics)> = (0..self.study.sizes().len())
            .filter_map(|size| {
                let (found, _) = self.statistics(Ensemble { size, ..ensemble });
                Some((self.grains(ensemble.recipe, size), found?))
            })
            .collect();
        PowerFit::of(&sizes)
    }

    /// Every ensemble, in the order of the study: recipe, test, quantity, size.
    pub(super) fn ensembles(&self) -> Vec<Ensemble> {
        let mut found = Vec::new();
        for recipe in 0..self.study.recipes.len() {
            for test in 0..self.study.tests.len() {
                for quantity in 0..self.study.quantities.len() {
                    found.extend((0..self.study.sizes().len()).map(|size| Ensemble { recipe, size, test, quantity }));
                }
            }
        }
        found
    }

    /// Every sample that has no packing, whose path stopped early, or that has no value of a quantity: its name and the reason.
    pub(super) fn failures(&self) -> Vec<String> {
        let mut found = Vec::new();
        for sample in &self.samples {
            let name = self.name(sample.place);
            match &sample.paths {
                Err(reason) => found.push(format!("{name}: {reason}")),
                Ok(paths) => {
                    for (test, path) in paths.iter().enumerate() {
                        let missing: Vec<(&str, String)> = self
                            .study
                            .quantities
                            .iter()
                            .enumerate()
                            .filter_map(|(place, quantity)| {
                                Some((quantity.name.as_str(), self.value(sample, test, place).err()?))
                            })
                            .collect();
                        let reason = match (&path.stopped, missing.first()) {
                            (Some(reason), _) => format!("stopped early: {reason}"),
                            (None, Some((_, reason))) => reason.clone(),
                            (None, None) => continue,
                        };
                        let without: Vec<&str> = missing.iter().map(|(name, _)| *name).collect();
                        let without = if without.is_empty() {
                            "all values".to_owned()
                        } else {
                            format!("no value of {}", without.join(", "))
                        };
                        found.push(format!("{name}, {}: {reason}; {without}", self.study.tests[test].name));
                    }
                }
            }
        }
        found
    }

    /// Rows with shortcuts or degradations over all samples, with the number of paths that have any.
    pub(super) fn fallbacks(&self) -> Vec<(&'static str, u64, usize)> {
        let mut found: Vec<(&'static str, u64, usize)> = Vec::new();
        let paths = self.samples.iter().filter_map(|sample| sample.paths.as_ref().ok()).flatten();
        for (what, rows) in paths.flat_map(|path| path.fallbacks.iter().copied()) {
            match found.iter_mut().find(|(other, ..)| *other == what) {
                Some((_, sum, paths)) => (*sum, *paths) = (*sum + rows, *paths + 1),
                None => found.push((what, rows, 1)),
            }
        }
        found.sort_unstable();
        found
    }
}

/// Refuses tests that no packing of the study can follow, before any is made.
///
/// # Errors
/// A path has components out of the plane of discs, or spheres would have to bound a frame.
pub(super) fn check(study: &Study) -> Result<(), Failure> {
    let refuse = |problem: String| Err(Failure::new(crate::exit::Exit::BadInput, problem));
    for test in &study.tests {
        for recipe in &study.recipes {
            if let Some(SoftGrains { problem, remedy }) = soft_grains(&recipe.recipe) {
                return refuse(format!("recipe '{}': {problem}; {remedy}", recipe.name));
            }
            if test.test.frame.is_some() && recipe.recipe.dimension != 2 {
                return refuse(format!(
                    "test '{}': boundary-particle frames are for plane packings; remove the table [frame], or choose discs in recipe '{}'",
                    test.name, recipe.name
                ));
            }
            if let Err(error) = test.test.check_dimension(recipe.recipe.dimension as usize) {
                return refuse(format!("test '{}' of '{}': {error}", test.name, recipe.name));
            }
            if recipe.recipe.dimension == 2 && test.strain == scene_reader::PathStrain::CompressionZ {
                return refuse(format!(
                    "test '{}': discs ('{}') are not compressed along z; choose another `strain`",
                    test.name, recipe.name
                ));
            }
        }
    }
    Ok(())
}
