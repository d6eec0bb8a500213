//! Statistics of a measure over a part of the body.

use super::measure::Measure;
use super::reference::{Origin, References, reference_volume};
use super::stress_measure::StressMeasure;
use crate::mesh::Dimension;
use crate::observer::{FieldsView, PointFields};
use crate::output::units::energy;
use protocol::Tensor2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A measure over Gauss points, reduced to one number.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldProbe {
    /// What is measured at each point.
    pub measure: Measure,
    /// Where.
    pub part: Part,
    /// How the values become one number.
    pub statistic: Statistic,
    /// Stage, from 0, from whose start deformation is counted; without one from the start of the run.
    pub reference: Option<usize>,
}

/// Gauss points of a probe.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Part {
    /// The whole body.
    #[default]
    Body,
    /// These Gauss points, numbered through the mesh, ascending; at least one.
    Points(Vec<usize>),
}

impl Part {
    /// Whether this Gauss point belongs to it.
    pub fn holds(&self, point: usize) -> bool {
        match self {
            Self::Body => true,
            Self::Points(numbers) => numbers.binary_search(&point).is_ok(),
        }
    }

    /// The points with their numbers.
    pub(super) fn of<'a>(
        &'a self,
        points: &'a [PointFields],
    ) -> impl Iterator<Item = (usize, &'a PointFields)> + Clone {
        let (all, some) = match self {
            Self::Body => (points, &[][..]),
            Self::Points(numbers) => (&[][..], &numbers[..]),
        };
        let some = some.iter().filter_map(|&number| points.get(number).map(|point| (number, point)));
        all.iter().enumerate().chain(some)
    }
}

/// How values at Gauss points become one number. Energies, which have no other statistic than the mean, are sums over the part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Statistic {
    /// Mean, weighted with the current volume. Functions of the stress are those of the mean stress, changes of volume those of the
    /// part as a whole.
    #[default]
    Mean,
    /// Smallest value.
    Minimum,
    /// Largest value.
    Maximum,
    /// Standard deviation, weighted with the current volume.
    StandardDeviation,
}

impl FieldProbe {
    /// Unit of the value; `-` if it has none. Energies are sums over the part, in the plane per metre of thickness.
    pub fn unit(&self, dimension: Dimension) -> &'static str {
        if self.measure.is_energy_density() && self.statistic == Statistic::Mean {
            energy(dimension)
        } else {
            self.measure.unit()
        }
    }

    /// A mean over the whole body, counted from the start of the run.
    pub fn mean(measure: Measure) -> Self {
        Self { measure, part: Part::Body, statistic: Statistic::Mean, reference: None }
    }

    /// Value after an accepted step; NaN over no points, and over points of which one has no such value.
    pub fn value(&self, view: &FieldsView<'_>, references: &References) -> f64 {
        self.over(self.part.of(view.points), references.origin(self.reference))
    }

    /// The same over points that follow each other from number `first` on, in place of those of the part.
    pub(in crate::output) fn of_points(&self, first: usize, points: &[PointFields], references: &References) -> f64 {
        let numbered = points.iter().enumerate().map(|(place, point)| (first + place, point));
        self.over(numbered, references.origin(self.reference))
    }

    /// The same over other points than those of the part.
    pub(super) fn over<'a>(
        &self,
        points: impl Iterator<Item = (usize, &'a PointFields)> + Clone,
        origin: Origin<'_>,
    ) -> f64 {
        let values = points.clone().map(|(number, point)| self.measure.at(number, point, origin));
        match self.statistic {
            Statistic::Mean => mean_of_part(&self.measure, points, origin),
            Statistic::Minimum => extreme(values, f64::min),
            Statistic::Maximum => extreme(values, f64::max),
            Statistic::StandardDeviation => {
                let mean = mean(points.clone(), |number, point| self.measure.at(number, point, origin));
                let square = |number, point: &PointFields| (self.measure.at(number, point, origin) - mean).powi(2);
                self::mean(points, square).sqrt()
            }
        }
    }
}

/// Smallest or largest value; NaN over no points, and where a point has no such value: the extreme of the others would be another's.
fn extreme(values: impl Iterator<Item = f64>, of_two: fn(f64, f64) -> f64) -> f64 {
    let known = |one: f64, other: f64| if one.is_nan() || other.is_nan() { f64::NAN } else { of_two(one, other) };
    values.reduce(known).unwrap_or(f64::NAN)
}

/// The mean of a measure as the field means it, see [`Statistic::Mean`].
fn mean_of_part<'a>(
    measure: &Measure,
    points: impl Iterator<Item = (usize, &'a PointFields)> + Clone,
    origin: Origin<'_>,
) -> f64 {
    match *measure {
        Measure::Stress(stress) => stress_of_part(stress, points),
        Measure::VolumeChange | Measure::LogVolumeStrain => {
            let initial: f64 = points.clone().map(|(number, point)| reference_volume(origin, number, point)).sum();
            let ratio = points.map(|(_, point)| point.volume).sum::<f64>() / initial;
            if *measure == Measure::VolumeChange { ratio - 1.0 } else { ratio.ln() }
        }
        Measure::ElasticEnergy | Measure::FrictionalDissipation | Measure::DampingWork => {
            points.map(|(number, point)| point.volume * measure.at(number, point, origin)).sum()
        }
        Measure::PorePressure
        | Measure::VoidRatio
        | Measure::Porosity
        | Measure::Coordination
        | Measure::CoordinationNoRattlers
        | Measure::FabricAnisotropy
        | Measure::Fabric(..)
        | Measure::SlidingFraction
        | Measure::GrainRotation(_)
        | Measure::DisplacementGradient(..)
        | Measure::Strain(..)
        | Measure::ShearStrain(_)
        | Measure::ShearStrainIncrement(_)
        | Measure::DeviatoricStrain
        | Measure::DeviatoricStrainIncrement
        | Measure::EquivalentStrainIncrement => mean(points, |number, point| measure.at(number, point, origin)),
    }
}

/// The function of the mean stress.
fn stress_of_part<'a>(measure: StressMeasure, points: impl Iterator<Item = (usize, &'a PointFields)> + Clone) -> f64 {
    let stress = |row: usize, column: usize| mean(points.clone(), |_, point| point.stress.get(row, column));
    match measure {
        // Linear in the stress: one sum instead of nine.
        StressMeasure::Component(row, column) => stress(row, column),
        StressMeasure::Pressure(axes) => {
            let trace = |_, point: &PointFields| (0..axes).map(|axis| point.stress.get(axis, axis)).sum::<f64>();
            -mean(points, trace) / axes as f64
        }
        StressMeasure::Deviator => mean(points, |_, point| point.stress.get(0, 0) - point.stress.get(1, 1)),
        StressMeasure::Ratio
        | StressMeasure::Principal(..)
        | StressMeasure::PrincipalRatio(..)
        | StressMeasure::SigmaBar
        | StressMeasure::FrictionAngle(_)
        | StressMeasure::VonMises => measure.of(&Tensor2(std::array::from_fn(|pair| stress(pair / 3, pair % 3)))),
    }
}

/// Mean weighted with the current volume.
fn mean<'a>(
    points: impl Iterator<Item = (usize, &'a PointFields)> + Clone,
    value: impl Fn(usize, &PointFields) -> f64,
) -> f64 {
    let sum: f64 = points.clone().map(|(number, point)| point.volume * value(number, point)).sum();
    sum / points.map(|(_, point)| point.volume).sum::<f64>()
}
