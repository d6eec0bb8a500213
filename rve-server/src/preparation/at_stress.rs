//! Packings brought from their own stress to another one, so that a body can start with the stress of its depth.

use super::compaction::{Compaction, Tolerances, content, rows};
use super::progress::ProgressLog;
use super::rotation::rotated;
use super::stress_target::{Matrix, StressTarget, turned_in};
use crate::contact::ContactTable;
use crate::definition::{AnyDefinition, GrainDefinition, Packing, PackingError, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::solver::SolverFor;
use crate::space::{Components, Space};
use protocol::Observables;

/// How far from its target stress, and from rest, a packing may end.
const TOLERANCES: Tolerances = Tolerances { force: 1e-8, stress: 1e-6 };

/// The same on the way.
const TOLERANCES_ON_THE_WAY: Tolerances = Tolerances { force: 1e-4, stress: 1e-3 };

/// Largest change of the logarithm of the pressure between two stresses on the way: a quarter of the pressure.
const PRESSURE_STRIDE: f64 = 0.22;

/// Largest change of a component of the deviator over the pressure between two stresses on the way.
const DEVIATOR_STRIDE: f64 = 0.05;

/// Most servo steps of one stride: a stress that grains can carry takes some tens.
const MOST_INCREMENTS: u32 = 500;

/// Largest component of Y1 out of the plane of axes 1 and 2, over its length, that is taken for none.
const ALIGNED: f64 = 1e-9;

impl Packing {
    /// The packing brought under a contact law to `stress`, Pa, by rows, tension positive; plane packings take the upper left
    /// block. Grains follow a straight path in the logarithm of the pressure and the ratio of deviator to pressure, in steps
    /// that do not depend on the machine. Equal arguments give equal bits.
    ///
    /// # Errors
    /// [`PackingError::Content`] if the packing bears tension or no load, its vector Y1 points out of the plane of axes 1 and 2,
    /// the stress is not compressive, or the grains cannot carry it.
    pub fn at_stress(&self, contact: &ContactTable, stress: &[[f64; 3]; 3]) -> Result<Self, PackingError> {
        Ok(match self {
            Self::Discs(packing) => Self::Discs(brought(packing, contact, stress)?),
            Self::Spheres(packing) => Self::Spheres(brought(packing, contact, stress)?),
        })
    }
}

impl AnyDefinition {
    /// The definition with its packing at another stress under its own contact law, see [`Packing::at_stress`].
    ///
    /// # Errors
    /// As [`Packing::at_stress`].
    pub fn at_stress(&self, stress: &[[f64; 3]; 3]) -> Result<Self, PackingError> {
        Ok(match self {
            Self::Discs(definition) => {
                let packing = brought(&definition.packing, &definition.contact, stress)?;
                Self::Discs(GrainDefinition { packing, ..definition.clone() })
            }
            Self::Spheres(definition) => {
                let packing = brought(&definition.packing, &definition.contact, stress)?;
                Self::Spheres(GrainDefinition { packing, ..definition.clone() })
            }
        })
    }
}

/// [`Compaction`] writes packings whose vector Y1 points along axis 1, so the packing is turned there and back.
fn brought<S: SolverFor>(
    packing: &PackingFile<S>,
    contact: &ContactTable,
    stress: &Matrix,
) -> Result<PackingFile<S>, PackingError> {
    let [first, second] = [packing.periodicity[0], packing.periodicity[1]];
    let is_level = |vector: S::Vector| (2..S::DIMENSION).all(|axis| vector[axis].abs() <= ALIGNED * vector.norm());
    if !is_level(first) || !is_level(second) {
        return Err(PackingError::Content(
            "its vectors Y1 and Y2 point out of the plane of axes 1 and 2; turn the packing so that they lie in it"
                .into(),
        ));
    }
    let angle = first[1].atan2(first[0]);
    let (sine, cosine) = angle.sin_cos();
    let turned_axes = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]];
    let turned_stress = if angle == 0.0 { *stress } else { symmetric(&turned_in(stress, &turned_axes)) };
    let prepared = along_axis(&rotated(packing, -angle)?, contact, &turned_stress)?;
    rotated(&prepared, angle)
}

/// The packing, whose vector Y1 points along axis 1, at a stress.
fn along_axis<S: SolverFor>(
    packing: &PackingFile<S>,
    contact: &ContactTable,
    stress: &Matrix,
) -> Result<PackingFile<S>, PackingError> {
    let definition =
        GrainDefinition { packing: packing.clone(), contact: contact.clone(), options: RveOptions::default() };
    let answer = GrainRve::<S>::new(&definition).and_then(|mut cell| cell.observe(Observables::NONE));
    let own = symmetric(&rows(&answer.map_err(content)?.stress));
    let (begin, end) = (target::<S>(&own)?, target::<S>(stress)?);
    let strides = strides(&begin, &end);
    let mut ignore = |_: &_| {};
    let log = ProgressLog::new(&mut ignore);
    let mut compaction = Compaction::new(packing.clone(), contact, begin, TOLERANCES_ON_THE_WAY, &log)?;
    for stride in 1..=strides {
        let is_last = stride == strides;
        let aim = if is_last { end } else { between(&begin, &end, f64::from(stride) / f64::from(strides)) };
        compaction.aim_at(aim, if is_last { TOLERANCES } else { TOLERANCES_ON_THE_WAY }, MOST_INCREMENTS);
        compaction.servo()?;
    }
    compaction.packing(serde_json::Value::Null)
}

fn symmetric(stress: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (stress[i][j] + stress[j][i])))
}

fn target<S: Space>(stress: &Matrix) -> Result<StressTarget, PackingError> {
    let rows: Vec<Vec<f64>> = stress[..S::DIMENSION].iter().map(|row| row[..S::DIMENSION].to_vec()).collect();
    StressTarget::from_rows(&rows, S::DIMENSION)
}

/// Number of stresses from one to the other, the last one included.
fn strides(begin: &StressTarget, end: &StressTarget) -> u32 {
    let pressure = (end.pressure / begin.pressure).ln().abs() / PRESSURE_STRIDE;
    let components = begin.deviator.iter().flatten().zip(end.deviator.iter().flatten());
    let turn = components.map(|(from, to)| (to / end.pressure - from / begin.pressure).abs()).fold(0.0, f64::max);
    // Both are finite and positive.
    pressure.max(turn / DEVIATOR_STRIDE).ceil().max(1.0) as u32
}

/// The stress at a share of the way.
fn between(begin: &StressTarget, end: &StressTarget, share: f64) -> StressTarget {
    let pressure = begin.pressure * (end.pressure / begin.pressure).powf(share);
    let deviator = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (from, to) = (begin.deviator[i][j] / begin.pressure, end.deviator[i][j] / end.pressure);
            pressure * (from + share * (to - from))
        })
    });
    StressTarget { pressure, deviator, ..*end }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn packing(name: &str) -> Packing {
        Packing::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings").join(name)).unwrap()
    }

    fn contact() -> ContactTable {
        ContactTable { modulus: Some(6e7), normal_stiffness: None, ..ContactTable::linear(1.0, 0.5, 0.5) }
    }

    fn stress_of<S: SolverFor>(packing: &PackingFile<S>) -> Matrix {
        let definition =
            GrainDefinition { packing: packing.clone(), contact: contact(), options: RveOptions::default() };
        rows(&GrainRve::new(&definition).unwrap().observe(Observables::NONE).unwrap().stress)
    }

    /// Less and more pressure than the packing has, with a coefficient of earth pressure at rest, for cells along the axes and turned ones.
    #[test]
    fn the_file_carries_the_stress_as_it_is_read() {
        for (angle, pressure) in [(0.0f64, 2e4), (0.0, 4e5), (0.6, 5e4), (2.0, 2e5)] {
            let turned = packing("discs-100.json").rotated(angle).unwrap();
            let wanted = [[-0.5 * pressure, 0.0, 0.0], [0.0, -pressure, 0.0], [0.0, 0.0, -0.5 * pressure]];
            let Packing::Discs(made) = turned.at_stress(&contact(), &wanted).unwrap() else {
                panic!("discs stay discs")
            };
            let stress = stress_of(&made);
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let error = (stress[i][j] - wanted[i][j]).abs() / pressure;
                assert!(error < 2e-6, "{angle} {pressure}: {i}{j} is off by {error:e}");
            }
            let area = |packing: &PackingFile| crate::space::determinant(&packing.periodicity);
            let Packing::Discs(before) = &turned else { panic!("discs stay discs") };
            assert!((area(&made) / area(before) - 1.0).abs() < 0.02);
        }
    }

    #[test]
    fn spheres_too() {
        let wanted = [[-3e4, 0.0, 0.0], [0.0, -6e4, 0.0], [0.0, 0.0, -3e4]];
        let Packing::Spheres(made) = packing("spheres-100.json").at_stress(&contact(), &wanted).unwrap() else {
            panic!("spheres stay spheres")
        };
        let stress = stress_of(&made);
        for i in 0..3 {
            assert!((stress[i][i] / wanted[i][i] - 1.0).abs() < 2e-6, "{stress:?}");
        }
    }

    /// Friction 0.5 between grains: no packing of them carries a ratio of ten.
    #[test]
    fn a_stress_that_grains_cannot_carry_is_refused() {
        let wanted = [[-1e4, 0.0, 0.0], [0.0, -1e5, 0.0], [0.0; 3]];
        assert!(packing("discs-100.json").at_stress(&contact(), &wanted).is_err());
        let tension = [[1e4, 0.0, 0.0], [0.0, -1e5, 0.0], [0.0; 3]];
        assert!(
            packing("discs-100.json").at_stress(&contact(), &tension).unwrap_err().to_string().contains("tension")
        );
    }
}
