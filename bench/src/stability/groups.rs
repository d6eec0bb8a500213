//! Comparison of ends that differ by chance: coarse runs and fine ones, few at first and more where they lie apart.

/// Runs of each group before it is decided, and after a first look that found them apart.
const ROUNDS: [usize; 2] = [3, 6];

/// Finer runs have half the strain per step and a tenth of the tolerance; both groups vary the step by these factors.
const VARIED: [f64; 6] = [1.0, 0.87, 0.93, 0.81, 0.97, 0.9];

/// Strain per step and tolerance of a finer run over those of its case, before the step is varied.
pub(super) const FINER: [f64; 2] = [0.5, 0.1];

/// What a comparison has shown.
#[derive(Clone, Copy, Debug)]
pub(super) struct Comparison {
    /// Largest difference of a component from the first finer run.
    pub(super) error: f64,
    /// Distance of the ranges of coarse and fine runs; NaN where the first finer run agreed.
    pub(super) gap: f64,
}

impl Comparison {
    /// Whether no coarse end comes within the bound of a fine one.
    pub(super) fn is_apart(&self, bound: f64) -> bool {
        self.error > bound && self.gap > bound
    }
}

/// How a comparison ended.
#[derive(Clone, Copy, Debug)]
pub(super) enum Compared {
    /// With all runs that it takes.
    Decided(Comparison),
    /// A finer run after the first one had no answer.
    Undecided(Comparison),
    /// The first finer run had no answer.
    Nothing,
}

/// Compares the `first` end with finer ones. `run` makes one more: its strain per step and its tolerance over those of the case.
pub(super) fn compared(first: Vec<f64>, bound: f64, mut run: impl FnMut([f64; 2]) -> Option<Vec<f64>>) -> Compared {
    let mut coarse = vec![first];
    let mut fine: Vec<Vec<f64>> = Vec::new();
    let [step, tolerance] = FINER;
    let Some(end) = run([step * VARIED[0], tolerance]) else { return Compared::Nothing };
    fine.push(end);
    let mut found = Comparison { error: gap(&coarse, &fine), gap: f64::NAN };
    if found.error <= bound {
        return Compared::Decided(found);
    }
    for count in ROUNDS {
        for varied in &VARIED[fine.len()..count] {
            let Some(end) = run([step * varied, tolerance]) else { return Compared::Undecided(found) };
            fine.push(end);
        }
        for varied in &VARIED[coarse.len()..count] {
            coarse.extend(run([*varied, 1.0]));
        }
        found.gap = gap(&coarse, &fine);
        if found.gap <= bound {
            break;
        }
    }
    Compared::Decided(found)
}

/// Largest distance, over the components, between the ranges of two groups; 0 where they overlap.
pub(super) fn gap(one: &[Vec<f64>], other: &[Vec<f64>]) -> f64 {
    let range = |group: &[Vec<f64>], component: usize| {
        group
            .iter()
            .map(|end| end[component])
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    (0..one[0].len())
        .map(|component| {
            let ((low, high), (other_low, other_high)) = (range(one, component), range(other, component));
            (other_low - high).max(low - other_high).max(0.0)
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_overlap_have_no_gap_and_others_the_distance_between_them() {
        let group = |values: &[f64]| -> Vec<Vec<f64>> { values.iter().map(|value| vec![0.0, *value]).collect() };
        assert_eq!(gap(&group(&[1.0, 3.0]), &group(&[2.0, 5.0])), 0.0);
        assert_eq!(gap(&group(&[1.0, 2.0]), &group(&[2.5])), 0.5);
        assert_eq!(gap(&group(&[2.5]), &group(&[1.0, 2.0])), 0.5);
    }

    #[test]
    fn ends_that_scatter_about_each_other_agree_and_ends_that_are_apart_do_not() {
        let is_fine = |setting: [f64; 2]| setting[1] < 1.0;
        let mut runs = 0;
        let scattered = compared(vec![1.0], 0.05, |setting| {
            runs += 1;
            Some(vec![if is_fine(setting) { 1.5 - 0.3 * f64::from(runs % 3) } else { 1.2 }])
        });
        assert!(matches!(scattered, Compared::Decided(found) if !found.is_apart(0.05)), "{scattered:?}");
        let apart = compared(vec![1.0], 0.05, |setting| Some(vec![if is_fine(setting) { 1.5 } else { 1.0 }]));
        assert!(matches!(apart, Compared::Decided(found) if found.is_apart(0.05) && found.gap == 0.5), "{apart:?}");
        assert!(matches!(compared(vec![1.0], 0.05, |_| None), Compared::Nothing));
    }
}
