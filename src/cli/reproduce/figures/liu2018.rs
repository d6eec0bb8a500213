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
