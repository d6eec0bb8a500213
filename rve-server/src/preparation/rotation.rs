//! Packings turned as a whole: cell vectors, grains and tangential forces.

use crate::cell::Cell;
use crate::definition::{ListedContact, Packing, PackingError, PackingFile};
use crate::space::{Space, Tensor, apply};

impl Packing {
    /// The packing turned by `angle`, rad, counter-clockwise in the plane; in space about the third axis.
    ///
    /// # Errors
    /// [`PackingError::Content`] if the angle is not finite.
    pub fn rotated(&self, angle: f64) -> Result<Self, PackingError> {
        Ok(match self {
            Self::Discs(packing) => Self::Discs(rotated(packing, angle)?),
            Self::Spheres(packing) => Self::Spheres(rotated(packing, angle)?),
        })
    }
}

/// As [`Packing::rotated`], typed by the dimension.
pub(super) fn rotated<S: Space>(packing: &PackingFile<S>, angle: f64) -> Result<PackingFile<S>, PackingError> {
    if !angle.is_finite() {
        return Err(PackingError::Content(format!("a packing cannot be turned by {angle}")));
    }
    if angle == 0.0 {
        return Ok(packing.clone());
    }
    let (sine, cosine) = angle.sin_cos();
    let turn = S::Tensor::from_fn(|i, j| match (i, j) {
        (0, 0) | (1, 1) => cosine,
        (0, 1) => -sine,
        (1, 0) => sine,
        _ => f64::from(u8::from(i == j)),
    });
    let cell = Cell::<S> { rows: packing.periodicity };
    let grains = packing.grains.iter().map(|grain| S::grain(apply(&turn, S::centre(grain)), S::radius(grain)));
    let contacts = packing.contacts.iter().map(|contact| ListedContact {
        tangential_force: S::turned_tangential(contact.tangential_force, &turn),
        ..*contact
    });
    PackingFile {
        periodicity: cell.deformed(&turn).rows,
        grains: grains.collect(),
        contacts: contacts.collect(),
        rolling_moments: packing.rolling_moments.iter().map(|moment| S::turned_spin(*moment, &turn)).collect(),
        ..packing.clone()
    }
    .checked()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::ContactTable;
    use crate::definition::{GrainDefinition, RveOptions};
    use crate::engine::GrainRve;
    use crate::space::Discs;
    use nalgebra::Matrix3;
    use protocol::{Observables, RveSolver, Tensor2, TrialOptions};
    use std::path::Path;

    fn cell(packing: &Packing) -> GrainRve<Discs> {
        let Packing::Discs(packing) = packing else { panic!("discs stay discs") };
        let contact =
            ContactTable { modulus: Some(1e8), normal_stiffness: None, ..ContactTable::linear(1.0, 0.5, 0.5) };
        let options = RveOptions { tolerance: Some(1e-7), strain_per_step: Some(1e-6), ..RveOptions::default() };
        GrainRve::new(&GrainDefinition { packing: packing.clone(), contact, options }).unwrap()
    }

    fn stress(cell: &mut GrainRve<Discs>, target: &Matrix3<f64>) -> Matrix3<f64> {
        let target = Tensor2(std::array::from_fn(|place| target[(place / 3, place % 3)]));
        let answer = cell.trial(&target, &TrialOptions::default()).unwrap();
        Matrix3::from_row_slice(&answer.stress.0)
    }

    /// A turned cell answers a turned strain with the turned stress, and an isotropic one with the turned stress as well.
    #[test]
    fn a_turned_packing_answers_as_the_packing_turned_would() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let upright = Packing::read(&path).unwrap();
        let angle = 0.7;
        let turned = upright.rotated(angle).unwrap();
        let turn = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), angle).into_inner();
        let initial =
            |packing: &Packing| Matrix3::from_row_slice(&cell(packing).observe(Observables::NONE).unwrap().stress.0);
        let start = turn * initial(&upright) * turn.transpose();
        assert!((initial(&turned) - start).amax() < 1e-9 * 1e5, "the start");
        let isotropic = Matrix3::from_diagonal(&[-1e-4, -1e-4, 0.0].into());
        let shear = Matrix3::new(2e-4, 5e-5, 0.0, 1e-4, -3e-4, 0.0, 0.0, 0.0, 0.0);
        for (target, tolerance) in [(isotropic, 1e-6), (shear, 1e-5)] {
            let expected = turn * stress(&mut cell(&upright), &target) * turn.transpose();
            let found = stress(&mut cell(&turned), &(turn * target * turn.transpose()));
            let error = (found - expected).amax() / 1e5;
            assert!(error < tolerance, "{error:e}");
        }
        assert_eq!(upright.rotated(0.0).unwrap(), upright);
        assert!(upright.rotated(f64::NAN).is_err());
    }
}
