//! The error of a stress curve against a reference, in windows of strain.

/// Rows between two strains, with a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    /// Name in tables.
    pub(super) name: &'static str,
    /// Strain after which it begins.
    pub(super) after: f64,
    /// Strain with which it ends.
    pub(super) until: f64,
}

impl Window {
    /// Whether a row belongs to it. Strains of rows carry the rounding of their sum.
    pub(super) fn holds(&self, strain: f64) -> bool {
        let rounding = 1e-9;
        strain > self.after + rounding && strain <= self.until + rounding
    }
}

/// One row of a curve: strain and stress components, Pa.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CurveRow {
    /// Strain of the path.
    pub(super) strain: f64,
    /// Independent stress components, Pa.
    pub(super) stress: Vec<f64>,
}

/// Root mean square difference of all stress components over the rows of a window, in units of `pressure`. NaN if no
/// row of the window is in both curves.
pub(super) fn error(curve: &[CurveRow], reference: &[CurveRow], window: &Window, pressure: f64) -> f64 {
    let mut sum = 0.0;
    let mut count = 0;
    for row in curve.iter().filter(|row| window.holds(row.strain)) {
        let Some(wanted) = interpolated(reference, row.strain) else { continue };
        for (value, expected) in row.stress.iter().zip(&wanted) {
            sum += ((value - expected) / pressure).powi(2);
            count += 1;
        }
    }
    (sum / f64::from(count)).sqrt()
}

/// Root mean square deviation of the engines of an ensemble from their mean, in units of `pressure`: what a single curve
/// cannot know better.
pub(super) fn band(ensemble: &[Vec<CurveRow>], window: &Window, pressure: f64) -> f64 {
    let Some(first) = ensemble.first() else { return f64::NAN };
    let mean: Vec<CurveRow> = (0..first.len())
        .map(|row| CurveRow {
            strain: first[row].strain,
            stress: (0..first[row].stress.len())
                .map(|component| {
                    let engines = ensemble.iter().map(|member| member[row].stress[component]);
                    engines.sum::<f64>() / ensemble.len() as f64
                })
                .collect(),
        })
        .collect();
    let squares = ensemble.iter().map(|member| error(member, &mean, window, pressure).powi(2));
    (squares.sum::<f64>() / ensemble.len() as f64).sqrt()
}

/// The stress of a curve at a strain, linear between rows; `None` outside it.
fn interpolated(curve: &[CurveRow], strain: f64) -> Option<Vec<f64>> {
    let rounding = 1e-9;
    let after = curve.iter().position(|row| row.strain >= strain - rounding)?;
    let upper = &curve[after];
    if upper.strain <= strain + rounding || after == 0 {
        return (upper.strain <= strain + rounding).then(|| upper.stress.clone());
    }
    let lower = &curve[after - 1];
    let share = (strain - lower.strain) / (upper.strain - lower.strain);
    Some(lower.stress.iter().zip(&upper.stress).map(|(from, to)| from + share * (to - from)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Window = Window { name: "all", after: 0.0, until: 1.0 };

    fn curve(stress: impl Fn(f64) -> f64) -> Vec<CurveRow> {
        (0..=10)
            .map(|row| f64::from(row) / 10.0)
            .map(|strain| CurveRow { strain, stress: vec![stress(strain), 5.0] })
            .collect()
    }

    #[test]
    fn error_is_root_mean_square_over_rows_and_components_in_units_of_the_pressure() {
        let off_by_two = curve(|strain| strain + 2.0);
        // One of two components is off by 2: sqrt(4 / 2) / 10.
        let found = error(&off_by_two, &curve(|strain| strain), &ALL, 10.0);
        assert!((found - 2f64.sqrt() / 10.0).abs() < 1e-15);
        let late = Window { name: "late", after: 1.0, until: 2.0 };
        assert!(error(&off_by_two, &off_by_two, &late, 1.0).is_nan());
    }

    #[test]
    fn a_reference_with_other_rows_is_interpolated() {
        let coarse: Vec<CurveRow> = curve(|strain| 3.0 * strain).into_iter().step_by(5).collect();
        assert!(error(&curve(|strain| 3.0 * strain), &coarse, &ALL, 1.0) < 1e-15);
        assert_eq!(interpolated(&coarse, 1.5), None);
    }

    /// Curves are compared at the rows of the first: a coarse curve against a fine one, not the other way round.
    #[test]
    fn a_coarse_curve_of_the_same_bent_function_has_no_error_against_a_fine_one() {
        let fine = curve(|strain| strain.sqrt());
        let coarse: Vec<CurveRow> = fine.iter().step_by(5).cloned().collect();
        assert_eq!(error(&coarse, &fine, &ALL, 1.0), 0.0);
        assert!(error(&fine, &coarse, &ALL, 1.0) > 0.05);
    }

    #[test]
    fn the_band_of_an_ensemble_is_its_spread_about_the_mean() {
        let ensemble = [curve(|_| 1.0), curve(|_| 3.0)];
        assert!((band(&ensemble, &ALL, 1.0) - 0.5f64.sqrt()).abs() < 1e-15);
        assert_eq!(band(&ensemble[..1], &ALL, 1.0), 0.0);
    }
}
