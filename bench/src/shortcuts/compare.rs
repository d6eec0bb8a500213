//! Two runs of one scene: whether their histories are the same, and how far their stresses are apart.

use crate::program::EndedRun;

/// Beginnings of columns that count work, or that the estimate of the error adds.
const NO_RESULTS: [&str; 4] = ["evaluations", "estimated_error", "balance_error", "strain_per_step"];

/// Whether all results of two histories are equal in every digit.
pub(super) fn is_same(one: &EndedRun, other: &EndedRun) -> bool {
    let results = |run: &EndedRun| -> Vec<(String, Vec<String>)> {
        let is_result = |name: &str| !NO_RESULTS.iter().any(|begin| name.starts_with(begin));
        run.columns.iter().filter(|(name, _)| is_result(name)).cloned().collect()
    };
    results(one) == results(other)
}

/// How far the mean stresses of two runs are apart behind step 0, in which packings that are not at rest under the law of the scene differ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Difference {
    /// Largest difference at any time over the mean pressure of the first run.
    pub(super) largest: f64,
    /// Largest difference over what is allowed at its time: a bound, or the errors that both runs estimate if they are larger.
    pub(super) over_allowed: f64,
}

/// Compares two runs at the times that both have, since steps that are cut back add some; `None` where there are none. `components` name the
/// columns of the mean stresses, `bound` is over the mean pressure.
pub(super) fn difference(one: &EndedRun, other: &EndedRun, components: &[&str], bound: f64) -> Option<Difference> {
    let normal = components.iter().filter(|name| name.as_bytes()[0] == name.as_bytes()[1]);
    let means: Vec<f64> = normal.map(|name| values(one, name).iter().sum::<f64>() / one.steps() as f64).collect();
    let pressure = -means.iter().sum::<f64>() / means.len() as f64;
    let stresses: Vec<[Vec<f64>; 2]> =
        components.iter().map(|name| [values(one, name), values(other, name)]).collect();
    let errors = [one, other].map(|run| values(run, "estimated_error"));
    let times = [one, other].map(|run| values(run, "time"));
    let mut found: Option<Difference> = None;
    for (step, time) in times[0].iter().enumerate().skip(1) {
        let Some(partner) = times[1].iter().position(|other| other == time) else { continue };
        let places = [step, partner];
        let apart = stresses.iter().map(|[a, b]| distance(a[step], b[partner]) / pressure).fold(0.0, f64::max);
        // Runs without the estimate have no such column; NaN counts as nothing known.
        let estimates = errors.iter().zip(places).filter_map(|(error, place)| error.get(place));
        let estimated: f64 = estimates.filter(|error| error.is_finite()).sum();
        let before = found.unwrap_or(Difference { largest: 0.0, over_allowed: 0.0 });
        found = Some(Difference {
            largest: before.largest.max(apart),
            over_allowed: before.over_allowed.max(apart / bound.max(estimated)),
        });
    }
    found
}

/// How far two numbers are apart: infinitely far if one of them is none.
fn distance(one: f64, other: f64) -> f64 {
    let apart = (one - other).abs();
    if apart.is_nan() { f64::INFINITY } else { apart }
}

/// A column of numbers; NaN where an entry is none, empty where there is no such column.
fn values(run: &EndedRun, name: &str) -> Vec<f64> {
    let rows = run.columns.iter().find(|(column, _)| column == name).map_or(&[][..], |(_, rows)| rows);
    rows.iter().map(|row| row.parse().unwrap_or(f64::NAN)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMPONENTS: [&str; 3] = ["xx", "yy", "xy"];

    /// Entries: time, evaluations, shear stress and estimated error of each step; the pressure is 2.
    fn ended(steps: &[[&str; 4]]) -> EndedRun {
        let column = |name: &str, place: usize| {
            (name.to_owned(), steps.iter().map(|step| step[place].to_owned()).collect::<Vec<String>>())
        };
        let constant = |name: &str, entry: &str| (name.to_owned(), vec![entry.to_owned(); steps.len()]);
        let columns = vec![
            column("time", 0),
            column("evaluations", 1),
            constant("xx", "-1"),
            constant("yy", "-3"),
            column("xy", 2),
            column("estimated_error", 3),
        ];
        EndedRun { code: 0, summary: serde_json::Value::Null, columns }
    }

    #[test]
    fn histories_are_compared_by_their_results_and_stresses_over_the_pressure() {
        let one = ended(&[["0", "4", "0", "0"], ["1", "8", "1", "1e-3"]]);
        assert!(is_same(&one, &ended(&[["0", "5", "0", "0"], ["1", "9", "1", "2e-3"]])));
        let other = ended(&[["0", "4", "0", "0"], ["1", "8", "1.1", "1e-3"]]);
        assert!(!is_same(&one, &other));
        let found = difference(&one, &other, &COMPONENTS, 0.025).unwrap();
        assert!((found.largest - 0.05).abs() < 1e-12 && (found.over_allowed - 2.0).abs() < 1e-9, "{found:?}");
        // Where the runs themselves do not know better, and in step 0.
        let snapped = ended(&[["0", "4", "0.5", "0"], ["1", "8", "1.1", "0.099"]]);
        assert!(difference(&one, &snapped, &COMPONENTS, 0.025).unwrap().over_allowed < 0.51);
    }

    #[test]
    fn a_stress_that_is_no_number_is_not_passed_over() {
        let one = ended(&[["0", "4", "0", "0"], ["1", "8", "1", "0"]]);
        let lost = ended(&[["0", "4", "0", "0"], ["1", "8", "NaN", "0"]]);
        assert_eq!(difference(&one, &lost, &COMPONENTS, 0.025).unwrap().over_allowed, f64::INFINITY);
    }

    /// They were passed over as if they had been compared.
    #[test]
    fn runs_with_other_steps_are_compared_where_they_meet_and_those_that_do_not_meet_are_told() {
        let one = ended(&[["0", "4", "0", "0"], ["1", "8", "1", "0"], ["2", "8", "2", "0"]]);
        let cut_back = ended(&[["0", "4", "0", "0"], ["0.5", "8", "9", "0"], ["2", "8", "2.1", "0"]]);
        assert!((difference(&one, &cut_back, &COMPONENTS, 0.025).unwrap().largest - 0.05).abs() < 1e-12);
        assert!(difference(&one, &ended(&[["0", "4", "0", "0"]]), &COMPONENTS, 0.025).is_none());
    }
}
