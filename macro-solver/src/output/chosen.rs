//! Fields that a scene asks for in addition to those that every run writes.

use super::fields::Field;
use super::probe::{FieldProbe, Measure, References};
use crate::mesh::Dimension;
use crate::observer::{FieldsView, PointFields};

/// A measure as a field on elements and Gauss points.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenField {
    /// Its name in the files.
    pub name: String,
    /// What is measured, counted from the start of the run.
    pub measure: Measure,
}

impl ChosenField {
    /// Unit of the values; `-` if they have none.
    pub(super) fn unit(&self, dimension: Dimension) -> &'static str {
        self.probe().unit(dimension)
    }

    /// One value for each element, the mean over its points as a probe takes it.
    pub(super) fn of_elements(&self, view: &FieldsView<'_>, references: &References) -> Field {
        let probe = self.probe();
        let mut first = 0;
        let elements = view.points.chunk_by(|one, next| one.element == next.element);
        let values = elements.map(|element| {
            let value = probe.of_points(first, element, references);
            first += element.len();
            value
        });
        Field::scalar(&self.name, values.collect())
    }

    /// One value for each Gauss point.
    pub(super) fn of_points(&self, view: &FieldsView<'_>, references: &References) -> Field {
        let values = view.points.iter().enumerate().map(|(number, point)| self.at(number, point, references));
        Field::scalar(&self.name, values.collect())
    }

    /// Value of the Gauss point `number`.
    pub(super) fn at(&self, number: usize, point: &PointFields, references: &References) -> f64 {
        self.measure.at(number, point, references.origin(None))
    }

    fn probe(&self) -> FieldProbe {
        FieldProbe::mean(self.measure)
    }
}

#[cfg(test)]
mod tests {
    use super::super::probe::tests::{point, report, seen};
    use super::*;
    use protocol::Tensor2;

    /// Two elements of two points; the points of the second one have volumes 3 and 1 and shear by 0.3 and 0.1 in the second step.
    #[test]
    fn elements_have_the_mean_of_their_points_weighted_with_the_volume() {
        let sheared = |element: usize, volume: f64, shear: f64| PointFields {
            element,
            deformation: Tensor2([1.0, shear, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
            ..point(volume, [[0.0; 2]; 2], 1.0)
        };
        let still = [sheared(0, 1.0, 0.0), sheared(0, 1.0, 0.0), sheared(1, 3.0, 0.2), sheared(1, 1.0, 0.2)];
        let moved = [sheared(0, 1.0, 0.0), sheared(0, 1.0, 0.0), sheared(1, 3.0, 0.5), sheared(1, 1.0, 0.3)];
        let chosen = ChosenField { name: "increment".into(), measure: Measure::EquivalentStrainIncrement };
        let mut references = References::default().comparing_steps(true);
        seen(&still, 0.0, |view| references.keep(&report(0, 0, 0.0), view));
        seen(&moved, 0.0, |view| {
            let near = |found: Field, expected: &[f64]| {
                assert_eq!(found.values.len(), expected.len());
                found.values.iter().zip(expected).for_each(|(one, other)| assert!((one - other).abs() < 1e-15));
            };
            near(chosen.of_elements(view, &references), &[0.0, 0.25]);
            near(chosen.of_points(view, &references), &[0.0, 0.0, 0.3, 0.1]);
        });
    }
}
