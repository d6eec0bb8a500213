//! `grainspan reproduce`: the list, and one figure from its runs to its tables.

use crate::harness::commands::{grainspan, succeeded};
use crate::harness::table::Table;
use claims::Claim;
use std::fs;
use std::os::unix::fs::PermissionsExt;

#[test]
fn the_list_names_figures_with_their_papers_and_run_times() {
    for words in [vec!["reproduce"], vec!["reproduce", "--list"]] {
        let listed = String::from_utf8(succeeded(&words).stdout).unwrap();
        for part in ["liu2018-friction", "Table II", "[Argilaga2018]", "geotechnics-wall", "small", "paper"] {
            assert!(listed.contains(part), "{part} is missing in\n{listed}");
        }
    }
}

/// A figure of element tests. The second call uses the runs of the first and writes the same bytes.
#[test]
fn a_figure_is_made_end_to_end_and_again_from_its_runs() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().to_str().unwrap();
    let words = ["reproduce", "geotechnics-cells", "--size", "small", "--out", out];
    let made = succeeded(&words);
    assert!(String::from_utf8_lossy(&made.stdout).contains("earth pressure at rest"));
    let read = |name: &str| fs::read_to_string(place.path().join(name)).unwrap();
    let csv = read("geotechnics-cells.csv");
    assert!(csv.starts_with("quantity,unit,theirs,source,ours,difference,tolerance,met\n"), "{csv}");
    assert!(
        csv.lines().any(|line| line.starts_with("earth pressure at rest,-,") && line.contains(",Jaky,")),
        "{csv}"
    );
    assert!(read("geotechnics-cells.svg").contains("<polyline"));
    let provenance = read("geotechnics-cells.json");
    assert!(
        provenance.contains("\"size\": \"small\"") && provenance.contains("\"program\": \"grainspan "),
        "{provenance}"
    );
    succeeded(&[&words[..], &["--draw-only"]].concat());
    assert_eq!(read("geotechnics-cells.csv"), csv);

    // A run that is begun again and stopped is not finished, whatever the folder held before.
    let stops = place.path().join("stops");
    fs::write(&stops, "#!/bin/sh\nexit 130\n").unwrap();
    fs::set_permissions(&stops, fs::Permissions::from_mode(0o755)).unwrap();
    let stopped = grainspan(&[&words[..], &["--fresh", "--program", stops.to_str().unwrap()]].concat());
    assert_eq!(stopped.status.code(), Some(130), "{stopped:?}");
    let drawn = grainspan(&[&words[..], &["--draw-only"]].concat());
    assert_eq!(drawn.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&drawn.stderr).contains("leave --draw-only out"), "{drawn:?}");
}

#[test]
fn an_unknown_figure_and_missing_runs_are_refused_with_the_remedy() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().to_str().unwrap();
    for (words, remedy) in [
        (vec!["reproduce", "nothing"], "`grainspan reproduce` lists them"),
        (vec!["reproduce", "geotechnics-cells", "--draw-only", "--out", out], "leave --draw-only out"),
        (vec!["reproduce", "all", "--out", out], "leave it out with `all`"),
        (vec!["reproduce", "geotechnics-cells", "--inputs", out], "name it with --inputs DIR"),
    ] {
        let output = grainspan(&words);
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(remedy), "{words:?}: {said}");
    }
}

/// The column `ours` of the row of a quantity in the table of a figure that is made in its small size.
fn numbers(figure: &str, quantities: &[&str]) -> Vec<f64> {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().to_str().unwrap();
    succeeded(&["reproduce", figure, "--size", "small", "--out", out]);
    let table = Table::read(&place.path().join(format!("{figure}.csv")));
    let (names, values) = (table.texts("quantity"), table.texts("ours"));
    let ours = |quantity: &&str| {
        let row = names.iter().position(|name| name == quantity).unwrap_or_else(|| panic!("{quantity} is missing"));
        values[row].parse().unwrap()
    };
    quantities.iter().map(ours).collect()
}

/// [Liu2018] Figs. 8, 9: friction. The strengths of the catalogue, J-1 and G-10.
#[test]
fn strength_of_the_published_biaxial_test_grows_with_friction() {
    let quantities = ["0.2", "0.4", "0.6"].map(|friction| format!("peak stress ratio, friction {friction}"));
    let peaks = numbers("liu2018-friction", &quantities.each_ref().map(String::as_str));
    assert!(peaks[0] < peaks[1] && peaks[1] < peaks[2], "{peaks:?}");
    Claim::of("G-10", "peak stress ratio of the published biaxial test, friction 0.2, small size")
        .value(peaks[0], 0.298)
        .within_absolute(0.052);
    Claim::of("J-1", "peak stress ratio of the published biaxial test, friction 0.4, small size")
        .value(peaks[1], 0.39)
        .within_absolute(0.03);
}

/// [Liu2018] Figs. 10, 11: blocked rotations make the grains stronger and the contacts more anisotropic.
#[test]
fn blocked_rotations_strengthen_the_published_biaxial_test() {
    let found = numbers(
        "liu2018-rotation",
        &[
            "largest stress ratio, blocked over free",
            "anisotropy at 7.3 % strain, rotations free",
            "anisotropy at 7.3 % strain, rotations blocked",
        ],
    );
    // The paper has 1.23 to 1.5, which 1.54 misses; that all rotations are blocked here is on its page.
    assert!(found[0] > 1.23, "{found:?}");
    Claim::of("J-1", "largest stress ratio, blocked over free rotations, small size")
        .number(found[0])
        .missed_up_to(0.2)
        .between(1.23, 1.5);
    assert!(found[2] > 1.5 * found[1], "{found:?}");
    Claim::of("J-1", "anisotropy of the contacts at 7.3 %, blocked rotations, small size")
        .value(found[2], 0.33)
        .within_absolute(0.05);
}
