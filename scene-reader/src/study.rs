//! Reads an ensemble study with its recipes and element tests.

use crate::cell::checked_test;
use crate::document::{Document, Kind};
use crate::input_error::InputError;
use crate::path_reach::strain_range;
pub use crate::tables::{EnsembleStatistic, PathStrain, RowMeasure};
use crate::tables::{ExpectedEntry, QuantityEntry, StudyFile, Take};
use keys::Located;
use rve_server::preparation::PackingRecipe;
use rve_server::programs::rve_test::ElementTest;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Strains that differ by less are the same: increments are shares of a segment.
const SAME_STRAIN: f64 = 1e-9;

/// A checked study.
#[derive(Clone, Debug)]
pub struct Study {
    /// Its name, good for a folder.
    pub name: String,
    /// Seed of the first packing of every ensemble.
    pub first_seed: u64,
    /// Packings of an ensemble.
    pub seeds: u32,
    /// Numbers of grains, ascending; empty: as the recipes say.
    pub grains: Vec<usize>,
    /// Half the range of axial strain over which dilatancy is averaged.
    pub smoothing: f64,
    /// Recipes; number and seed are those of the files.
    pub recipes: Vec<StudyRecipe>,
    /// Element tests.
    pub tests: Vec<StudyTest>,
    /// What is measured.
    pub quantities: Vec<StudyQuantity>,
    /// What it is compared with.
    pub expectations: Vec<Expectation>,
}

/// A recipe of a study.
#[derive(Clone, Debug)]
pub struct StudyRecipe {
    /// Its name in the study.
    pub name: String,
    /// The recipe.
    pub recipe: PackingRecipe,
}

/// An element test of a study.
#[derive(Clone, Debug)]
pub struct StudyTest {
    /// Its name in the study.
    pub name: String,
    /// The test; its packing is not read.
    pub test: ElementTest,
    /// What is called its strain.
    pub strain: PathStrain,
}

/// A quantity of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyQuantity {
    /// Its name in the study.
    pub name: String,
    /// What is measured in every row.
    pub measure: RowMeasure,
    /// Which rows become its value.
    pub rows: ChosenRows,
}

impl StudyQuantity {
    /// Unit of its value; `-` without one.
    pub fn unit(&self) -> &'static str {
        if matches!(self.rows, ChosenRows::StrainOfLargest(..)) { "-" } else { self.measure.unit() }
    }
}

/// Which rows of a path become one number, and how. Strains are those of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChosenRows {
    /// The largest value between two strains; `None` is the end of the path.
    Largest(f64, Option<f64>),
    /// The smallest value between two strains.
    Smallest(f64, Option<f64>),
    /// The strain of the row with the largest value between two strains.
    StrainOfLargest(f64, Option<f64>),
    /// The mean between two strains.
    Mean(f64, Option<f64>),
    /// The value where the path first has this strain.
    At(f64),
}

/// A number of the study and what it is compared with. Numbers of lists stand for recipes, tests and quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// Entry of the verification catalogue.
    pub entry: Option<String>,
    /// Our number.
    pub ours: Ensemble,
    /// Which statistic of it.
    pub statistic: EnsembleStatistic,
    /// What is expected.
    pub expected: Expected,
    /// Largest difference that counts as agreement.
    pub tolerance: Option<f64>,
    /// Whether the tolerance is a share of the expected number.
    pub is_relative: bool,
    /// Where the expected number comes from.
    pub source: String,
}

/// A quantity of the packings of one recipe and size along one path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ensemble {
    /// Place in [`Study::recipes`].
    pub recipe: usize,
    /// Place in the sizes of the study.
    pub size: usize,
    /// Place in [`Study::tests`].
    pub test: usize,
    /// Place in [`Study::quantities`].
    pub quantity: usize,
}

/// What a number is compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expected {
    /// A number.
    Value(f64),
    /// Anything between two numbers.
    Between(f64, f64),
    /// The mean of another ensemble.
    Like(Ensemble),
    /// Nothing: our number is reported.
    Nothing,
}

impl Study {
    /// Sizes of a study, at least one; 0 stands for the number that each recipe names.
    pub fn sizes(&self) -> Vec<usize> {
        if self.grains.is_empty() { vec![0] } else { self.grains.clone() }
    }
}

/// Reads a study, its recipes and its element tests, with every key checked.
///
/// # Errors
/// The first defect with its place and remedy.
pub fn read_study(document: &Document) -> Result<Study, InputError> {
    let file: StudyFile = document.deserialize()?;
    let name = name_of(document, &file)?;
    let grains = file.grains.as_ref().map_or(Vec::new(), |grains| grains.get_ref().clone());
    let place_of_grains = || file.grains.as_ref().map_or(0..0, Located::span);
    if grains.windows(2).any(|pair| pair[0] >= pair[1]) {
        return Err(document
            .error_at(place_of_grains(), format!("grains = {grains:?} do not ascend"))
            .hint("list every size once, the smallest first"));
    }
    for (key, list, is_empty) in [
        ("recipe", file.recipe.span(), file.recipe.get_ref().is_empty()),
        ("test", file.test.span(), file.test.get_ref().is_empty()),
        ("quantity", file.quantity.span(), file.quantity.get_ref().is_empty()),
    ] {
        if is_empty {
            return Err(document
                .error_at(list, format!("`{key}` has no entries"))
                .hint(format!("add [[{key}]]; `grainspan explain --file study {key}` lists its keys")));
        }
    }
    let names = Names {
        recipes: unique(document, file.recipe.get_ref().iter().map(|entry| &entry.name))?,
        tests: unique(document, file.test.get_ref().iter().map(|entry| &entry.name))?,
        quantities: unique(document, file.quantity.get_ref().iter().map(|entry| &entry.name))?,
        grains: grains.clone(),
    };
    let mut recipes = Vec::new();
    for entry in file.recipe.get_ref() {
        let recipe = recipe_of(document, &entry.file, &entry.set)?;
        for &number in grains.iter().chain(grains.is_empty().then_some(&recipe.number)) {
            let sized = PackingRecipe { number, ..recipe.clone() };
            sized.validate().map_err(|error| document.error_at(place_of_grains(), error))?;
        }
        recipes.push(StudyRecipe { name: entry.name.get_ref().clone(), recipe });
    }
    let mut tests = Vec::new();
    for entry in file.test.get_ref() {
        let test = test_of(document, &entry.file, &entry.set)?;
        tests.push(StudyTest { name: entry.name.get_ref().clone(), test, strain: entry.strain });
    }
    let mut quantities = Vec::new();
    for entry in file.quantity.get_ref() {
        quantities.push(quantity_of(document, entry, &tests)?);
    }
    let expectations =
        file.expected.iter().map(|entry| names.expectation(document, entry)).collect::<Result<_, InputError>>()?;
    Ok(Study {
        name,
        first_seed: file.first_seed,
        seeds: file.seeds,
        grains,
        smoothing: file.smoothing,
        recipes,
        tests,
        quantities,
        expectations,
    })
}

fn name_of(document: &Document, file: &StudyFile) -> Result<String, InputError> {
    match &file.name {
        Some(name) => checked_name(document, name).map(str::to_owned),
        None => {
            let stem =
                document.path().file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
            if is_name(&stem) {
                Ok(stem)
            } else {
                Err(document.error("the file's name is no name for a folder").hint("give `name`"))
            }
        }
    }
}

fn is_name(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|letter| letter.is_ascii_alphanumeric() || "-_".contains(letter))
}

fn checked_name<'a>(document: &Document, name: &'a Located<String>) -> Result<&'a str, InputError> {
    if is_name(name.get_ref()) {
        return Ok(name.get_ref());
    }
    let problem = format!("'{}' is not a name of letters, digits, - and _", name.get_ref());
    Err(document.error_at(name.span(), problem).hint("names become columns and names of files"))
}

/// The names in their order.
fn unique<'a>(
    document: &Document,
    names: impl Iterator<Item = &'a Located<String>>,
) -> Result<Vec<String>, InputError> {
    let mut found: Vec<String> = Vec::new();
    for name in names {
        let text = checked_name(document, name)?;
        if found.iter().any(|other| other == text) {
            let problem = format!("the name '{text}' is given twice");
            return Err(document.error_at(name.span(), problem).hint("give every entry a name of its own"));
        }
        found.push(text.to_owned());
    }
    Ok(found)
}

/// Where a file lies that a study names.
fn existing(document: &Document, file: &Located<PathBuf>) -> Result<PathBuf, InputError> {
    let path = document.resolve(file.get_ref());
    if path.is_file() {
        return Ok(path);
    }
    let problem = format!("there is no file {}", path.display());
    Err(document.error_at(file.span(), problem).hint("correct the path; it is relative to the folder of the study"))
}

fn recipe_of(document: &Document, file: &Located<PathBuf>, set: &[String]) -> Result<PackingRecipe, InputError> {
    let read = |path: &Path| {
        let recipe = Document::read(path, set)?;
        recipe.expect(Kind::Recipe)?;
        let read: PackingRecipe = recipe.deserialize()?;
        read.validate().map_err(|error| recipe.table_error(error))?;
        Ok(read)
    };
    read(&existing(document, file)?).map_err(|error: InputError| error.named_at(&document.error_at(file.span(), "")))
}

fn test_of(document: &Document, file: &Located<PathBuf>, set: &[String]) -> Result<ElementTest, InputError> {
    let read = |path: &Path| {
        let test = Document::read(path, set)?;
        test.expect(Kind::ElementTest)?;
        checked_test(&test)
    };
    read(&existing(document, file)?).map_err(|error| error.named_at(&document.error_at(file.span(), "")))
}

fn quantity_of(document: &Document, entry: &QuantityEntry, tests: &[StudyTest]) -> Result<StudyQuantity, InputError> {
    let name = entry.name.get_ref();
    let refuse = |span: Range<usize>, problem: &str, hint: &str| {
        Err(document.error_at(span, format!("quantity '{name}': {problem}")).hint(hint))
    };
    if SAMPLE_COLUMNS.contains(&name.as_str()) {
        return refuse(entry.name.span(), "this is a column of NAME-samples.csv already", "choose another name");
    }
    if entry.measure.needs_compression()
        && let Some(shear) = tests.iter().find(|test| test.strain == PathStrain::ShearXy)
    {
        let problem = format!("the strain of test '{}' is no axial compression", shear.name);
        return refuse(entry.name.span(), &problem, "measure dilatancy in a study of compression tests only");
    }
    let number = |given: &Option<Located<f64>>| given.as_ref().map(|given| *given.get_ref());
    let span = |given: &Option<Located<f64>>| given.as_ref().map_or(entry.name.span(), Located::span);
    let (from, to) = (number(&entry.from).unwrap_or(f64::NEG_INFINITY), number(&entry.to));
    if to.is_some_and(|to| to < from) {
        return refuse(span(&entry.to), "`to` is below `from`", "strains ascend");
    }
    for (key, given) in [("from", &entry.from), ("to", &entry.to), ("at", &entry.at)] {
        let Some(wanted) = given else { continue };
        for test in tests {
            let Some([lowest, highest]) = strain_range(&test.test, test.strain) else { continue };
            // A window may begin before the path does.
            let is_below = key != "from" && *wanted.get_ref() < lowest - SAME_STRAIN;
            if is_below || *wanted.get_ref() > highest + SAME_STRAIN {
                let problem = format!(
                    "`{key}` = {} lies beyond the path of test '{}', whose strains are {lowest:.4} to {highest:.4}",
                    wanted.get_ref(),
                    test.name
                );
                return refuse(
                    wanted.span(),
                    &problem,
                    "extension counts negative; choose a strain of the path, or a longer path",
                );
            }
        }
    }
    let rows = match (entry.take, number(&entry.at)) {
        (Take::At, Some(at)) => {
            if let Some(window) = entry.from.as_ref().or(entry.to.as_ref()) {
                return refuse(window.span(), "`from` and `to` do not go with `at`", "leave them out");
            }
            ChosenRows::At(at)
        }
        (Take::At, None) => {
            return refuse(entry.name.span(), "`at` is missing", "give the strain, such as at = 0.05");
        }
        (_, Some(_)) => {
            return refuse(span(&entry.at), "`at` goes with take = \"at\" only", "leave it out, or give from and to");
        }
        (Take::Largest, None) => ChosenRows::Largest(from, to),
        (Take::Smallest, None) => ChosenRows::Smallest(from, to),
        (Take::StrainOfLargest, None) => ChosenRows::StrainOfLargest(from, to),
        (Take::Mean, None) => ChosenRows::Mean(from, to),
    };
    Ok(StudyQuantity { name: name.clone(), measure: entry.measure, rows })
}

/// Columns of the table of samples, between which those of the quantities stand.
pub const SAMPLE_COLUMNS: [&str; 5] = ["recipe", "grains", "seed", "test", "problem"];

/// The names that comparisons may use.
struct Names {
    recipes: Vec<String>,
    tests: Vec<String>,
    quantities: Vec<String>,
    grains: Vec<usize>,
}

impl Names {
    fn expectation(&self, document: &Document, entry: &Located<ExpectedEntry>) -> Result<Expectation, InputError> {
        let (span, entry) = (entry.span(), entry.get_ref());
        let refuse = |problem: &str, hint: &str| Err(document.error_at(span.clone(), problem.to_owned()).hint(hint));
        let is_power = entry.statistic == EnsembleStatistic::Power;
        let size = match &entry.grains {
            Some(grains) if is_power => {
                return Err(document
                    .error_at(grains.span(), "a power belongs to all sizes")
                    .hint("leave `grains` out"));
            }
            Some(grains) => self.grains.iter().position(|number| number == grains.get_ref()).ok_or_else(|| {
                let problem = format!("no packings of {} grains are made", grains.get_ref());
                document.error_at(grains.span(), problem).hint(format!("the study has the sizes {:?}", self.grains))
            })?,
            None => self.grains.len().saturating_sub(1),
        };
        if is_power && self.grains.len() < 2 {
            return refuse("a power needs at least two sizes", "give `grains`");
        }
        let ours = Ensemble {
            recipe: chosen(document, "recipe", &entry.recipe, &self.recipes, &span)?,
            size,
            test: chosen(document, "test", &entry.test, &self.tests, &span)?,
            quantity: chosen(document, "quantity", &Some(entry.quantity.clone()), &self.quantities, &span)?,
        };
        let expected = match (entry.value, entry.between, &entry.like) {
            (None, None, None) => Expected::Nothing,
            (Some(value), None, None) => Expected::Value(value),
            (None, Some([low, high]), None) if low <= high => Expected::Between(low, high),
            (None, Some(_), None) => return refuse("`between` does not ascend", "give the smaller number first"),
            (None, None, Some(_)) if is_power => {
                return refuse("a power cannot be compared with a mean", "give `value`");
            }
            (None, None, Some(like)) => {
                let other = like.get_ref();
                let or_ours = |given: &Option<Located<String>>, kind: &str, known: &[String], ours: usize| match given
                {
                    Some(_) => chosen(document, kind, given, known, &span),
                    None => Ok(ours),
                };
                Expected::Like(Ensemble {
                    recipe: or_ours(&other.recipe, "recipe", &self.recipes, ours.recipe)?,
                    size,
                    test: or_ours(&other.test, "test", &self.tests, ours.test)?,
                    quantity: or_ours(&other.quantity, "quantity", &self.quantities, ours.quantity)?,
                })
            }
            _ => return refuse("give one of `value`, `between` and `like`", "remove the others"),
        };
        if entry.tolerance.is_some() && expected == Expected::Nothing {
            return refuse("`tolerance` without a number that is expected", "give `value`, `between` or `like`");
        }
        if entry.tolerance.is_none() && entry.relative {
            return refuse("`relative` without `tolerance`", "give the tolerance as a share of the expected number");
        }
        Ok(Expectation {
            entry: entry.entry.clone(),
            ours,
            statistic: entry.statistic,
            expected,
            tolerance: entry.tolerance,
            is_relative: entry.relative,
            source: entry.source.clone(),
        })
    }
}

/// Place of a name in its list; without a name that of the only entry.
fn chosen(
    document: &Document,
    kind: &str,
    given: &Option<Located<String>>,
    known: &[String],
    span: &Range<usize>,
) -> Result<usize, InputError> {
    match given {
        Some(name) => known.iter().position(|known| known == name.get_ref()).ok_or_else(|| {
            let problem = format!("there is no {kind} '{}'", name.get_ref());
            document.error_at(name.span(), problem).hint(format!("the study has: {}", known.join(", ")))
        }),
        None if known.len() == 1 => Ok(0),
        None => Err(document
            .error_at(span.clone(), format!("`{kind}` is missing"))
            .hint(format!("the study has several: {}", known.join(", ")))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const TEXT: &str = "seeds = 3\ngrains = [50, 100]\n[[recipe]]\nname = \"dense\"\nfile = \"packings/discs-100.toml\"\n\
        set = [\"contact.friction=0.0\"]\n[[test]]\nname = \"biaxial\"\nfile = \"scenes/rve-biaxial.toml\"\n[[quantity]]\n\
        name = \"peak\"\nmeasure = \"stress_ratio\"\ntake = \"largest\"\n[[expected]]\nentry = \"X-1\"\nquantity = \"peak\"\n\
        statistic = \"power\"\nvalue = -0.5\n";

    fn read(text: &str) -> Result<Study, String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../size.toml");
        let document = Document::from_text(&path, text.to_owned(), &[]).map_err(|error| error.to_string())?;
        read_study(&document).map_err(|error| error.to_string())
    }

    #[test]
    fn a_study_is_read_with_its_recipes_and_tests() {
        let study = read(TEXT).unwrap();
        assert_eq!((study.name.as_str(), study.first_seed, study.sizes()), ("size", 1, vec![50, 100]));
        assert_eq!(study.recipes[0].recipe.contact.friction, 0.0);
        assert_eq!(study.quantities[0].rows, ChosenRows::Largest(f64::NEG_INFINITY, None));
        assert_eq!(study.expectations[0].expected, Expected::Value(-0.5));
        assert_eq!(read(&TEXT.replace("grains = [50, 100]\n", "").replace("power", "mean")).unwrap().sizes(), [0]);
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_place() {
        let cases = [
            (TEXT.replace("[50, 100]", "[100, 50]"), "size.toml:2: grains = [100, 50] do not ascend"),
            (TEXT.replace("[50, 100]", "[5, 100]"), "at least 10 grains"),
            (TEXT.replace("[50, 100]", "[100]"), "a power needs at least two sizes"),
            (TEXT.replace("quantity = \"peak\"", "quantity = \"peek\""), "there is no quantity 'peek'"),
            (TEXT.replace("\"largest\"", "\"at\""), "`at` is missing"),
            (TEXT.replace("\"largest\"", "\"mean\"\nfrom = 0.2\nto = 0.1"), "`to` is below `from`"),
            (
                TEXT.replace("\"largest\"", "\"mean\"\nfrom = 0.9"),
                "`from` = 0.9 lies beyond the path of test 'biaxial'",
            ),
            (TEXT.replace("\"largest\"", "\"at\"\nat = 0.9"), "`at` = 0.9 lies beyond the path"),
            (TEXT.replace("name = \"dense\"", "name = \"de nse\""), "not a name"),
            (TEXT.replace("discs-100.toml", "discs-100.json"), "discs-100.json"),
            (TEXT.replace("contact.friction=0.0", "contact.frction=0.0"), "frction"),
            (
                TEXT.replace("stress_ratio\"", "dilatancy\"")
                    .replace("biaxial.toml\"", "biaxial.toml\"\nstrain = \"shear_xy\""),
                "no axial compression",
            ),
            (TEXT.replace("value = -0.5", "value = -0.5\nbetween = [0.0, 1.0]"), "give one of"),
        ];
        for (text, expected) in cases {
            let refused = read(&text).unwrap_err();
            assert!(refused.contains(expected), "{expected}: {refused}");
        }
    }
}
