//! The tangent operators that a trial may be asked for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which tangent operator a trial returns with its stress. Always `C_ijkl = d sigma_ij / d F_kl` with `F` relative to
/// the trial's own end state. Numbers are part of the wire: new kinds are appended.
///
/// Kinds ending in `_printed` are the formulas as printed in [Argilaga2018], kept for comparison; the objective forms
/// beside them are the ones to use. "At rest" means that the sliding contacts are those at the Coulomb limit in the
/// relaxed end state instead of those that slid in the ramp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum TangentKind {
    /// Nothing: the stress alone.
    #[default]
    None = 0,
    /// PSTLO, the prestressed truss-like operator of [Argilaga2018] appendix B: all contacts stick.
    TrussLike = 1,
    /// As `truss_like`, but a contact that was at the Coulomb limit during this trial's own ramp slips
    /// non-associatively and has no tangential stiffness. Not symmetric.
    TrussLikeSlip = 2,
    /// UKO made symmetric: uniform strain in all grains, [Argilaga2018] eq. 13. Erratum: the
    /// printed tangential part uses the full displacement gradient and is not objective. Far too stiff;
    /// the fallback when a network operator is singular.
    Kruyt = 3,
    /// UKO as printed, [Argilaga2018] eq. 13.
    KruytPrinted = 4,
    /// UCKO: `kruyt` times one factor calibrated by a CTO in the first step, [Argilaga2018] eq. 16.
    KruytCalibrated = 5,
    /// UCKO on the printed UKO.
    KruytCalibratedPrinted = 6,
    /// UCKO-2DOF: `kruyt` with one factor for `k_n` and one for `k_t`, [Argilaga2018] eq. 17.
    KruytTwiceCalibrated = 7,
    /// UCKO-2DOF on the printed UKO.
    KruytTwiceCalibratedPrinted = 8,
    /// KAO made symmetric: uniform strain and rotation with prestress, [Argilaga2018] eq. 18.
    KruytAugmented = 9,
    /// KAO as printed.
    KruytAugmentedPrinted = 10,
    /// DEMQO: small perturbations from the end state without sliding, [Argilaga2018] eq. 20.
    QuasiStatic = 11,
    /// CTO by one-sided perturbations of the whole step, [Argilaga2018] eq. 6.
    Consistent = 12,
    /// CTO by central perturbations.
    ConsistentCentral = 13,
    /// AEO: running average of the CTOs of the first committed steps, then frozen.
    ElasticAverage = 14,
    /// As `truss_like`, but contacts that slid in the ramp keep no tangential stiffness along their slip. Symmetric.
    TrussLikeReleased = 15,
    /// As `truss_like_released` with the sliding contacts of the relaxed state.
    TrussLikeReleasedAtRest = 16,
    /// As `truss_like_slip` with the sliding contacts of the relaxed state.
    TrussLikeSlipAtRest = 17,
}

crate::keywords! {
    pub TangentKind {
        None => "none",
        TrussLike => "truss_like",
        TrussLikeSlip => "truss_like_slip",
        Kruyt => "kruyt",
        KruytPrinted => "kruyt_printed",
        KruytCalibrated => "kruyt_calibrated",
        KruytCalibratedPrinted => "kruyt_calibrated_printed",
        KruytTwiceCalibrated => "kruyt_twice_calibrated",
        KruytTwiceCalibratedPrinted => "kruyt_twice_calibrated_printed",
        KruytAugmented => "kruyt_augmented",
        KruytAugmentedPrinted => "kruyt_augmented_printed",
        QuasiStatic => "quasi_static",
        Consistent => "consistent",
        ConsistentCentral => "consistent_central",
        ElasticAverage => "elastic_average",
        TrussLikeReleased => "truss_like_released",
        TrussLikeReleasedAtRest => "truss_like_released_at_rest",
        TrussLikeSlipAtRest => "truss_like_slip_at_rest",
    }
}

impl TangentKind {
    /// The kind with this wire number.
    pub fn from_wire(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u32 == number)
    }
}
