//! What the figures of [Liu2018] share: the curves of its biaxial test.

use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

/// Curves over the axial compression, counted like the paper's from the end of the isotropic stage.
pub(super) struct Biaxial {
    /// `|(s11 - s22) / (s11 + s22)|`.
    pub(super) ratio: Curve,
    /// Standard deviation of that of the points.
    pub(super) deviation: Curve,
    /// `(det F - det F_ic) / det F_ic`.
    pub(super) volume: Curve,
    /// Contacts per grain.
    pub(super) contacts: Curve,
    /// Major over minor principal value of the contact fabric of the body, minus 1.
    pub(super) anisotropy: Curve,
}

/// The curves of a run of `scenes/liu2018/biaxial.toml`.
///
/// # Errors
/// Its history cannot be read.
pub(super) fn biaxial(run: &Finished) -> Result<Biaxial, ReproduceError> {
    let table = run.table()?.stage("biaxial")?;
    let compression = table.column("axial_compression")?;
    let volume = table.column("volume_change")?;
    let (first, volume_first) = (compression[0], volume[0]);
    let over = |values: Vec<f64>| -> Curve {
        compression.iter().zip(values).map(|(strain, value)| [strain - first, value]).collect()
    };
    Ok(Biaxial {
        ratio: over(table.column("stress_ratio")?.into_iter().map(liu_ratio).collect()),
        deviation: over(table.column("stress_ratio_deviation")?),
        volume: over(volume.iter().map(|change| (1.0 + change) / (1.0 + volume_first) - 1.0).collect()),
        contacts: over(table.column("coordination_number")?),
        anisotropy: over(table.column("fabric_anisotropy")?),
    })
}

/// `|(s11 - s22) / (s11 + s22)|` of each of the first `count` Gauss points, which `output.points` has to name, over the same compression.
///
/// # Errors
/// The history or the table of a point cannot be read.
pub(super) fn ratios_of_points(run: &Finished, count: usize) -> Result<Vec<Curve>, ReproduceError> {
    let compression = run.table()?.stage("biaxial")?.curve("step", "axial_compression")?;
    let of_point = |point: usize| -> Result<Curve, ReproduceError> {
        let table = run.table_of(&format!("points/point-{point:04}.csv"))?;
        let stress = table.column("sigma_xx")?.into_iter().zip(table.column("sigma_yy")?);
        let ratio = stress.map(|(xx, yy)| liu_ratio(yy / xx));
        Ok(over_the_stage(&compression, table.column("step")?.into_iter().zip(ratio)))
    };
    (0..count).map(of_point).collect()
}

/// Values by step as a curve over the compression since the begin of the stage; steps outside it are left out.
fn over_the_stage(compression: &[[f64; 2]], values: impl Iterator<Item = (f64, f64)>) -> Curve {
    let first = compression.first().map_or(f64::NAN, |row| row[1]);
    let points = values.map(|(step, value)| [value_at(compression, step) - first, value]);
    points.filter(|point| point[0].is_finite()).collect()
}

/// Strains of the progressive failure, as the paper names them ([Liu2018] sections 4.2 and 4.3.3).
pub(super) const FAILURE: [f64; 2] = [0.06, 0.08];

/// Whether values grow from each to the next.
pub(super) fn rises(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[1] > pair[0])
}

/// Whether values fall from each to the next.
pub(super) fn falls(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[1] < pair[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_points_are_counted_from_the_begin_of_the_stage() {
        let compression = [[1.0, 0.25], [2.0, 0.5], [3.0, 1.0]];
        let values = [(0.0, 9.0), (1.0, 0.0), (2.0, 3.0), (3.0, 4.0), (4.0, 9.0)];
        let expected = vec![[0.0, 0.0], [0.25, 3.0], [0.75, 4.0]];
        assert_eq!(over_the_stage(&compression, values.into_iter()), expected);
    }

    #[test]
    fn trends_are_strict() {
        assert!(rises(&[1.0, 2.0, 3.0]) && falls(&[3.0, 2.0]));
        assert!(!rises(&[1.0, 1.0]) && !falls(&[1.0, 1.0]) && !rises(&[1.0, f64::NAN]));
    }
}
