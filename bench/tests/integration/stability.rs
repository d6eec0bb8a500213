//! Random cases with a seed of their own every time: what has to hold for any of them.
//!
//! `GRAINSPAN_STABILITY_SEED=N cargo test --release -p grainspan-bench stability` runs the cases of a seed again that a failed
//! test has printed.

use crate::program::{Site, bench, seed, stderr};

/// Cases, all of them of at most 100 grains.
const CASES: &str = "120";

/// Share of the increments of everyday cases that have to be at rest.
const AT_REST: f64 = 0.999;

/// One row of `cases.csv`.
struct Row {
    case: String,
    range: String,
    class: String,
    reason: String,
    increments: usize,
    not_at_rest: usize,
}

#[test]
#[expect(clippy::print_stdout, reason = "the seed belongs to the output of a failed test")]
fn random_cases_end_in_an_answer_or_a_refusal_and_everyday_ones_at_rest() {
    let site = Site::new();
    let (seed, folder) = (seed("GRAINSPAN_STABILITY_SEED").to_string(), site.path("stability"));
    println!("GRAINSPAN_STABILITY_SEED={seed}");
    let mut campaign = vec!["stability", "--cases", CASES, "--largest", "100", "--small", "0", "--unchecked"];
    campaign.extend(["--seed", &seed, "--out", folder.to_str().unwrap()]);
    let ended = bench(&campaign);
    assert!(ended.status.success(), "seed {seed}: {}", stderr(&ended));
    let rows = rows(&folder.join("cases.csv"));
    assert_eq!(rows.len().to_string(), CASES);
    let again = |rows: &[&Row]| -> String {
        let line = |row: &&Row| {
            format!("\n  {} {}: grainspan bench stability --seed {seed} --case {}", row.class, row.reason, row.case)
        };
        rows.iter().map(line).collect()
    };
    // A typed refusal is an answer, and a strain that grains cannot follow may be refused. Nothing else is.
    let broken: Vec<&Row> =
        rows.iter().filter(|row| ["panicked", "not finite"].contains(&row.class.as_str())).collect();
    assert!(broken.is_empty(), "seed {seed}:{}", again(&broken));
    // Stored energy, friction and damping are the work within 5 % (all of 1240 everyday cases of seed 2026 and 500 of seed 5).
    let open: Vec<&Row> = rows.iter().filter(|row| row.class == "wrong" && row.range == "everyday").collect();
    assert!(open.len() <= 1, "seed {seed}:{}", again(&open));
    let unexplained: Vec<&Row> = rows.iter().filter(|row| row.class == "refused" && row.reason.is_empty()).collect();
    assert!(unexplained.is_empty(), "seed {seed}:{}", again(&unexplained));
    let everyday: Vec<&Row> = rows.iter().filter(|row| row.range == "everyday").collect();
    let increments: usize = everyday.iter().map(|row| row.increments).sum();
    let restless: Vec<&Row> = everyday.iter().copied().filter(|row| row.not_at_rest > 0).collect();
    let not_at_rest: usize = restless.iter().map(|row| row.not_at_rest).sum();
    assert!(increments > 800, "seed {seed}: only {increments} everyday increments");
    assert!(
        (increments - not_at_rest) as f64 >= AT_REST * increments as f64,
        "seed {seed}: {not_at_rest} of {increments} everyday increments are not at rest:{}",
        again(&restless)
    );
}

/// A case written as an element test gives the stresses that it had in the campaign, to the last bit.
#[test]
fn a_case_is_written_as_an_element_test_that_ends_alike() {
    let site = Site::new();
    let (folder, file) = (site.path("stability"), site.path("case.toml"));
    let case = ["stability", "--seed", "5", "--case", "7", "--unchecked", "--out", folder.to_str().unwrap()];
    let written = [case.as_slice(), &["--write", file.to_str().unwrap()]].concat();
    assert!(bench(&case).status.success());
    let ours = column(&std::fs::read(folder.join("increments.csv")).unwrap(), "sigma_yy_Pa");
    assert!(bench(&written).status.success());
    let curve = site.path("curve.csv");
    let element =
        ["grainspan", "element", file.to_str().unwrap(), "--quiet", "--out", curve.to_str().unwrap()].map(Into::into);
    assert_eq!(grainspan::run_command_line(element), std::process::ExitCode::SUCCESS);
    let theirs = column(&std::fs::read(curve).unwrap(), "sigma_yy");
    assert!(ours.len() > 2, "{ours:?}");
    assert_eq!(ours, theirs);
}

fn column(table: &[u8], name: &str) -> Vec<f64> {
    let mut reader = csv::Reader::from_reader(table);
    let place = reader.headers().unwrap().iter().position(|head| head == name).unwrap();
    reader.records().map(|record| record.unwrap()[place].parse().unwrap()).collect()
}

fn rows(path: &std::path::Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let heads = reader.headers().unwrap().clone();
    let place = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let places = ["case", "range", "class", "reason", "increments", "not_at_rest"].map(place);
    reader
        .records()
        .map(|record| {
            let record = record.unwrap();
            let [case, range, class, reason, increments, not_at_rest] = places.map(|place| record[place].to_owned());
            Row {
                case,
                range,
                class,
                reason,
                increments: increments.parse().unwrap(),
                not_at_rest: not_at_rest.parse().unwrap(),
            }
        })
        .collect()
}
