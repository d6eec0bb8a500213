//! Optional results of a trial: what is requested, what an engine delivers, and the numbers themselves.

use crate::tensor::Tensor2;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Optional results, one bit each; the cheap scalars of [`Scalars`](crate::Scalars) are always part of the result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Observables(pub u32);

crate::keyword::bits! {
    Observables {
        /// First Piola stress relative to the committed state.
        FIRST_PIOLA = 1 => "first_piola",
        /// Coordination number without rattlers.
        COORDINATION_NO_RATTLERS = 2 => "coordination_no_rattlers",
        /// Contact fabric tensor and its anisotropy.
        FABRIC = 4 => "fabric",
        /// Share of contacts at the Coulomb limit.
        SLIDING_FRACTION = 8 => "sliding_fraction",
        /// Elastic energy per volume, frictional dissipation per volume and work of numerical damping per volume since the initial state.
        ENERGY = 16 => "energy",
        /// Mean grain rotation since the initial state.
        ROTATION = 32 => "rotation",
    }
}

impl Observables {
    /// Nothing beyond the cheap scalars.
    pub const NONE: Self = Self(0);
    /// Everything.
    pub const ALL: Self = Self(63);

    /// Whether all bits of `other` are set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Both sets together.
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// One optional result of an engine: a field of [`Observed`]. A bit of [`Observables`] requests one or several of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OptionalResult {
    /// [`Observed::first_piola`].
    FirstPiola,
    /// [`Observed::fabric`].
    Fabric,
    /// [`Observed::fabric_anisotropy`].
    FabricAnisotropy,
    /// [`Observed::coordination_number_no_rattlers`].
    CoordinationNumberNoRattlers,
    /// [`Observed::sliding_fraction`].
    SlidingFraction,
    /// [`Observed::elastic_energy`].
    ElasticEnergy,
    /// [`Observed::frictional_dissipation`].
    FrictionalDissipation,
    /// [`Observed::damping_work`].
    DampingWork,
    /// [`Observed::mean_rotation`].
    MeanRotation,
}

crate::keywords! {
    pub OptionalResult {
        FirstPiola => "first_piola",
        Fabric => "fabric",
        FabricAnisotropy => "fabric_anisotropy",
        CoordinationNumberNoRattlers => "coordination_number_no_rattlers",
        SlidingFraction => "sliding_fraction",
        ElasticEnergy => "elastic_energy",
        FrictionalDissipation => "frictional_dissipation",
        DampingWork => "damping_work",
        MeanRotation => "mean_rotation",
    }
}

impl OptionalResult {
    /// What requests it.
    pub fn requested_by(self) -> Observables {
        match self {
            Self::FirstPiola => Observables::FIRST_PIOLA,
            Self::Fabric | Self::FabricAnisotropy => Observables::FABRIC,
            Self::CoordinationNumberNoRattlers => Observables::COORDINATION_NO_RATTLERS,
            Self::SlidingFraction => Observables::SLIDING_FRACTION,
            Self::ElasticEnergy | Self::FrictionalDissipation | Self::DampingWork => Observables::ENERGY,
            Self::MeanRotation => Observables::ROTATION,
        }
    }
}

/// Results that are computed only on request; NaN is not allowed in messages, so a result that was not requested, or that the engine
/// does not deliver, is zero there. The macro reads only those that it requested, and makes those that are not delivered NaN.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[repr(C)]
pub struct Observed {
    /// First Piola stress relative to the committed state, Pa.
    pub first_piola: Tensor2,
    /// Contact fabric `1/C sum n x n`.
    pub fabric: Tensor2,
    /// Anisotropy of the fabric: major over minor principal value, minus 1.
    pub fabric_anisotropy: f64,
    /// 2 x contacts over non-rattlers, contacts of rattlers left out.
    pub coordination_number_no_rattlers: f64,
    /// Share of contacts at the Coulomb limit.
    pub sliding_fraction: f64,
    /// Stored contact energy per volume, J/m3.
    pub elastic_energy: f64,
    /// Energy lost to friction and contact viscosity per volume since the initial state, J/m3.
    pub frictional_dissipation: f64,
    /// Work that numerical damping has taken per volume since the initial state, J/m3.
    pub damping_work: f64,
    /// Mean over the grains of their spin added up since the initial state, a vector, rad. A plane cell has its
    /// counter-clockwise angle in the third component and zeros before it.
    pub mean_rotation: [f64; 3],
}

impl Default for Observed {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl Observed {
    /// The same with NaN in place of results that do not exist. For the macro process: NaN is not allowed in messages.
    #[must_use]
    pub fn without(mut self, lacking: &[OptionalResult]) -> Self {
        for result in lacking {
            match result {
                OptionalResult::FirstPiola => self.first_piola = Tensor2([f64::NAN; 9]),
                OptionalResult::Fabric => self.fabric = Tensor2([f64::NAN; 9]),
                OptionalResult::FabricAnisotropy => self.fabric_anisotropy = f64::NAN,
                OptionalResult::CoordinationNumberNoRattlers => self.coordination_number_no_rattlers = f64::NAN,
                OptionalResult::SlidingFraction => self.sliding_fraction = f64::NAN,
                OptionalResult::ElasticEnergy => self.elastic_energy = f64::NAN,
                OptionalResult::FrictionalDissipation => self.frictional_dissipation = f64::NAN,
                OptionalResult::DampingWork => self.damping_work = f64::NAN,
                OptionalResult::MeanRotation => self.mean_rotation = [f64::NAN; 3],
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_optional_result_is_blanked_by_its_own_word() {
        let blanked = |lacking: &[OptionalResult]| {
            let found = Observed::default().without(lacking);
            let numbers: &[f64] = bytemuck::cast_slice(std::slice::from_ref(&found));
            numbers.iter().filter(|number| number.is_nan()).count()
        };
        assert_eq!(OptionalResult::ALL.map(|one| blanked(&[one])), [9, 9, 1, 1, 1, 1, 1, 1, 3]);
        assert_eq!((blanked(&OptionalResult::ALL), blanked(&[])), (27, 0));
        for result in OptionalResult::ALL {
            assert_eq!(serde_json::to_value(result).unwrap(), result.keyword());
            assert!(Observables::ALL.contains(result.requested_by()));
        }
    }
}
