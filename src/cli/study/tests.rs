//! An ensemble of tiny packings: order, counting and naming of failures, comparisons.

use super::ensemble::{self, Results, Subject};
use super::{expected, tables};
use scene_reader::{ChosenRows, Document, Study, read_study};
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

const TEXT: &str = "seeds = 2\ngrains = [12, 16]\n[[recipe]]\nname = \"dense\"\nfile = \"packings/discs-100.toml\"\n\
    set = [\"tolerance=1e-3\", \"stress_tolerance=1e-2\"]\n[[test]]\nname = \"squeeze\"\nfile = \"scenes/rve-biaxial.toml\"\n\
    set = [\"rve.accuracy=draft\", \"path=[{ increments = 4, strain = { xx = -1e-3, yy = -2e-3 } }]\"]\n\
    [[quantity]]\nname = \"pressure\"\nmeasure = \"mean_pressure\"\ntake = \"at\"\nat = 0.001\n\
    [[quantity]]\nname = \"voids\"\nmeasure = \"void_ratio\"\ntake = \"mean\"\n\
    [[expected]]\nentry = \"X-1\"\nquantity = \"voids\"\nstatistic = \"power\"\nvalue = -0.5\n\
    [[expected]]\nentry = \"X-1\"\nquantity = \"voids\"\ngrains = 12\nbetween = [0.0, 1.0]\ntolerance = 0.0\n\
    [[expected]]\nquantity = \"pressure\"\nlike = { quantity = \"voids\" }\ntolerance = 1.0\nrelative = true\n";

fn study(text: &str) -> Study {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tiny.toml");
    read_study(&Document::from_text(&path, text.to_owned(), &[]).unwrap()).unwrap()
}

fn made(study: &Study, jobs: usize) -> Results<'_> {
    ensemble::run(study, NonZeroUsize::new(jobs).unwrap(), &|| true, &|_, _| ())
}

#[test]
fn results_come_in_the_order_of_the_study_for_any_number_of_jobs() {
    let study = study(TEXT);
    let one = made(&study, 1);
    let places: Vec<(usize, u64)> =
        one.samples.iter().map(|sample| (sample.place.grains, sample.place.seed)).collect();
    assert_eq!(places, [(12, 1), (12, 2), (16, 1), (16, 2)]);
    let three = made(&study, 3);
    assert_eq!(one.samples, three.samples);
    assert_eq!(tables::statistics_csv(&one).unwrap(), tables::statistics_csv(&three).unwrap());
    assert_eq!(one.failures(), Vec::<String>::new());

    let (rows, entries) = expected::compared(&one);
    assert_eq!((rows.len(), entries["X-1"].len()), (3, 2));
    assert_eq!(rows[1].quantity(), "voids, 12 grains: mean");
    let statistics = String::from_utf8(tables::statistics_csv(&one).unwrap()).unwrap();
    assert_eq!(statistics.lines().count(), 1 + 2 * 2);
    assert!(
        statistics.lines().nth(1).unwrap().starts_with("dense,squeeze,12,pressure,mean_pressure,Pa,2,0,"),
        "{statistics}"
    );
    // Rows of the mean curves: two sizes, two measures, the start and four increments; the mean is that of the samples.
    assert_eq!(tables::curves_csv(&one).unwrap(), tables::curves_csv(&three).unwrap());
    let curves = String::from_utf8(tables::curves_csv(&one).unwrap()).unwrap();
    assert_eq!(curves.lines().count(), 1 + 2 * 2 * 5);
    let last = curves.lines().rfind(|line| line.starts_with("dense,squeeze,12,mean_pressure,Pa,")).unwrap();
    let mean: f64 = last.split(',').nth(7).unwrap().parse().unwrap();
    let of_sample = |sample: usize| *one.samples[sample].paths.as_ref().unwrap()[0].measures[0].last().unwrap();
    assert!((mean - 0.5 * (of_sample(0) + of_sample(1))).abs() < 1e-9 * mean.abs(), "{last}");
    let powers = String::from_utf8(tables::powers_csv(&one).unwrap()).unwrap();
    assert!(powers.lines().any(|line| line.starts_with("dense,squeeze,voids,2,")), "{powers}");
}

/// What had ended when a stop was requested is kept; the rest counts as failed, by name.
#[test]
fn samples_of_a_stopped_study_that_have_ended_are_kept() {
    let study = study(TEXT);
    let ended = AtomicUsize::new(0);
    let keep_going = || ended.load(Ordering::Relaxed) < 2;
    let one = NonZeroUsize::MIN;
    let results = ensemble::run(&study, one, &keep_going, &|number, _| ended.store(number, Ordering::Relaxed));
    // Large packings come first.
    let have_paths: Vec<bool> = results.samples.iter().map(|sample| sample.paths.is_ok()).collect();
    assert_eq!(have_paths, [false, false, true, true]);
    assert_eq!(results.samples[2..], made(&study, 1).samples[2..]);
    assert_eq!(results.failures()[0], "dense, 12 grains, seed 1: a stop was requested before it had ended");
}

/// A value beyond the end of the path, as where a controlled stress decides how far that strains: every sample fails, is counted and named,
/// and no number is made up.
#[test]
fn failed_samples_are_counted_and_named() {
    let mut study = study(TEXT);
    study.quantities[0].rows = ChosenRows::At(0.01);
    let results = made(&study, 2);
    let failures = results.failures();
    assert_eq!(failures.len(), 4);
    assert!(
        failures[0].starts_with("dense, 12 grains, seed 1, squeeze: the largest strain of the path is 0.0020"),
        "{failures:?}"
    );
    assert!(failures[0].ends_with("no value of pressure"), "{failures:?}");
    let csv = String::from_utf8(tables::statistics_csv(&results).unwrap()).unwrap();
    assert!(csv.lines().nth(1).unwrap().ends_with("pressure,mean_pressure,Pa,0,2,,,,,,"), "{csv}");
    let samples = String::from_utf8(tables::samples_csv(&results).unwrap()).unwrap();
    assert!(samples.lines().nth(1).unwrap().starts_with("dense,12,1,squeeze,,"), "{samples}");
    assert!(samples.contains("below 0.01"), "{samples}");

    // A packing that cannot be made has the reason of its preparation.
    let study = self::study(
        &TEXT
            .replace(
                "stress_tolerance=1e-2\"]",
                "stress_tolerance=1e-2\", \"target={ void_ratio = 3.0, tolerance = 1e-3 }\"]",
            )
            .replace("[12, 16]", "[12]")
            .replace("statistic = \"power\"\n", ""),
    );
    let results = made(&study, 2);
    assert_eq!(results.failures().len(), 2);
    assert!(results.failures()[1].starts_with("dense, 12 grains, seed 2: no packing: "), "{:?}", results.failures());
}

#[test]
fn narrow_cells_are_told_with_the_name_of_their_sample() {
    let text = TEXT.replace("seeds = 2\ngrains = [12, 16]", "seeds = 1\ngrains = [10, 40]");
    let steep = "\"tolerance=1e-3\", \"grading.smallest_radius=1e-4\", \"grading.largest_radius=1e-3\"";
    let study = study(&text.replace("grains = 12", "grains = 40").replace("\"tolerance=1e-3\"", steep));
    let remarks = made(&study, 1).remarks();
    assert_eq!(remarks.len(), 1, "{remarks:?}");
    assert!(remarks[0].text.starts_with("dense, 10 grains, seed 1: the cell is 1."), "{remarks:?}");
}

/// What `element` says of a start, a study says with the name of the sample and the test.
#[test]
fn a_stress_that_the_first_segment_changes_is_told() {
    let text = TEXT
        .replace("seeds = 2\ngrains = [12, 16]", "seeds = 1\ngrains = [12]")
        .replace("statistic = \"power\"\n", "")
        .replace("xx = -1e-3, yy = -2e-3 }", "yy = -2e-3 }, stress = { xx = -1.5e5 }");
    let study = study(&text);
    let results = made(&study, 1);
    let remarks = results.remarks();
    let [remark] = &remarks[..] else { panic!("{remarks:?}") };
    assert_eq!(remark.subject, Subject::FirstSegment);
    assert!(
        remark.text.starts_with("dense, 12 grains, seed 1, squeeze: the packing has sigma_xx = "),
        "{}",
        remark.text
    );
}
