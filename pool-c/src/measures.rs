//! Strains, stresses and tangent operators in the order and the measures of MFront; user materials that want another stress than Cauchy's
//! take them from here too.
//!
//! Symmetric tensors are 11, 22, 33, then 12, 13, 23 times the square root of two; others 11, 22, 33, 12, 21, 13, 31, 23, 32. Plane and
//! axially symmetric ones end after the plane components. Operators are row by row: a row for each component of the force.

use protocol::{Tensor2, Tensor4};
use rve_server::space::{determinant, inverse, product};
use std::f64::consts::SQRT_2;

/// A tensor by rows.
pub(super) type Matrix = [[f64; 3]; 3];

/// The unit tensor.
pub(super) const UNIT: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// No deformation.
pub(super) const ZERO: Matrix = [[0.0; 3]; 3];

/// Places of the components of symmetric tensors.
const SYMMETRIC: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
/// Places of the components of other tensors.
const GENERAL: [(usize, usize); 9] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)];

/// Order of components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Symmetric tensors.
    Symmetric,
    /// All tensors.
    General,
}

/// Components of a modelling hypothesis: those in space, or without the shears out of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Components {
    /// Whether all components are there.
    pub(super) in_space: bool,
}

impl Components {
    /// Number of components.
    pub(super) fn count(self, kind: Kind) -> usize {
        match (kind, self.in_space) {
            (Kind::Symmetric, true) => 6,
            (Kind::Symmetric, false) => 4,
            (Kind::General, true) => 9,
            (Kind::General, false) => 5,
        }
    }

    /// Tensors by which a tensor is the sum of its components times them.
    fn basis(self, kind: Kind) -> impl Iterator<Item = Matrix> {
        let unit = |(i, j): (usize, usize)| {
            let mut one = [[0.0; 3]; 3];
            one[i][j] = 1.0;
            one
        };
        let symmetric = move |(i, j): (usize, usize)| {
            let mut one = unit((i, j));
            if i != j {
                one[i][j] = 1.0 / SQRT_2;
                one[j][i] = 1.0 / SQRT_2;
            }
            one
        };
        (0..self.count(kind)).map(move |place| match kind {
            Kind::Symmetric => symmetric(SYMMETRIC[place]),
            Kind::General => unit(GENERAL[place]),
        })
    }

    /// The tensor with these components.
    pub(super) fn tensor(self, kind: Kind, components: &[f64]) -> Matrix {
        let mut sum = [[0.0; 3]; 3];
        for (value, one) in components.iter().zip(self.basis(kind)) {
            add(&mut sum, *value, &one);
        }
        sum
    }

    /// The components of a tensor; of its symmetric part for a symmetric order.
    pub(super) fn components(self, kind: Kind, tensor: &Matrix) -> impl Iterator<Item = f64> {
        self.basis(kind).map(|one| contract(&one, tensor))
    }
}

/// Stress measures of finite strain, in the numbers of MGIS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stress {
    /// Cauchy stress.
    Cauchy,
    /// Second Piola-Kirchhoff stress.
    SecondPiola,
    /// First Piola-Kirchhoff stress.
    FirstPiola,
}

/// Tangent operators, in the numbers of MGIS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    /// Cauchy stress by strain, for small strains.
    Strain,
    /// Cauchy stress by deformation gradient.
    CauchyByGradient,
    /// Second Piola-Kirchhoff stress by Green-Lagrange strain.
    SecondPiolaByStrain,
    /// First Piola-Kirchhoff stress by deformation gradient.
    FirstPiolaByGradient,
    /// Kirchhoff stress by the gradient of the step, `F1 F0^-1`.
    KirchhoffByStep,
}

/// End of a step: what forces and operators are made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct End<'a> {
    /// Deformation gradient at the begin of the step.
    pub(super) before: Matrix,
    /// Deformation gradient at the end of the step; for small strains with the strain of the step alone.
    pub(super) after: Matrix,
    /// Cauchy stress, Pa.
    pub(super) stress: &'a Tensor2,
    /// Change of the Cauchy stress with a further deformation gradient.
    pub(super) tangent: &'a Tensor4,
}

impl End<'_> {
    fn cauchy(&self) -> Matrix {
        let half = |i: usize, j: usize| 0.5 * (self.stress.get(i, j) + self.stress.get(j, i));
        std::array::from_fn(|i| std::array::from_fn(|j| half(i, j)))
    }

    fn kirchhoff(&self) -> Matrix {
        let ratio = determinant(&self.after);
        self.cauchy().map(|row| row.map(|value| ratio * value))
    }

    /// Components of the stress.
    pub(super) fn force(&self, measure: Stress, places: Components) -> Vec<f64> {
        let back = inverse(&self.after);
        let (kind, tensor) = match measure {
            Stress::Cauchy => (Kind::Symmetric, self.cauchy()),
            Stress::FirstPiola => (Kind::General, product(&self.kirchhoff(), &transposed(&back))),
            Stress::SecondPiola => (Kind::Symmetric, pulled_back(&self.kirchhoff(), &back)),
        };
        places.components(kind, &tensor).collect()
    }

    /// The operator, row by row.
    pub(super) fn operator(&self, operator: Operator, places: Components) -> Vec<f64> {
        let back = inverse(&self.after);
        let (rows, columns) = match operator {
            Operator::Strain | Operator::SecondPiolaByStrain => (Kind::Symmetric, Kind::Symmetric),
            Operator::CauchyByGradient | Operator::KirchhoffByStep => (Kind::Symmetric, Kind::General),
            Operator::FirstPiolaByGradient => (Kind::General, Kind::General),
        };
        let width = places.count(columns);
        let mut room = vec![0.0; places.count(rows) * width];
        let kirchhoff = self.kirchhoff();
        for (column, one) in places.basis(columns).enumerate() {
            // The further deformation that belongs to a change of the component.
            let further = match operator {
                Operator::Strain | Operator::CauchyByGradient | Operator::FirstPiolaByGradient => {
                    product(&one, &back)
                }
                Operator::SecondPiolaByStrain => product(&product(&transposed(&back), &one), &back),
                Operator::KirchhoffByStep => product(&product(&one, &self.before), &back),
            };
            let change = match operator {
                Operator::Strain | Operator::CauchyByGradient => self.change_of_cauchy(&further),
                Operator::KirchhoffByStep => self.change_of_kirchhoff(&further),
                Operator::FirstPiolaByGradient => {
                    let mut change = product(&self.change_of_kirchhoff(&further), &transposed(&back));
                    add(&mut change, -1.0, &product(&kirchhoff, &transposed(&product(&back, &further))));
                    change
                }
                Operator::SecondPiolaByStrain => {
                    let mut change = self.change_of_kirchhoff(&further);
                    add(&mut change, -1.0, &product(&further, &kirchhoff));
                    add(&mut change, -1.0, &product(&kirchhoff, &transposed(&further)));
                    pulled_back(&change, &back)
                }
            };
            for (row, value) in places.components(rows, &change).enumerate() {
                room[row * width + column] = value;
            }
        }
        room
    }

    fn change_of_cauchy(&self, further: &Matrix) -> Matrix {
        let sum = |i: usize, j: usize| -> f64 {
            (0..9).map(|place| self.tangent.get(i, j, place / 3, place % 3) * further[place / 3][place % 3]).sum()
        };
        std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (sum(i, j) + sum(j, i))))
    }

    fn change_of_kirchhoff(&self, further: &Matrix) -> Matrix {
        let mut change = self.change_of_cauchy(further);
        add(&mut change, further[0][0] + further[1][1] + further[2][2], &self.cauchy());
        let ratio = determinant(&self.after);
        change.map(|row| row.map(|value| ratio * value))
    }
}

/// Displacement gradient of a step, `F1 F0^-1 - 1`, from the small difference `(F1 - F0) F0^-1`.
pub(super) fn step(before: &Matrix, after: &Matrix) -> Matrix {
    product(&sum(after, -1.0, before), &inverse(before))
}

/// A tensor and a multiple of another.
pub(super) fn sum(first: &Matrix, factor: f64, other: &Matrix) -> Matrix {
    let mut sum = *first;
    add(&mut sum, factor, other);
    sum
}

fn pulled_back(tensor: &Matrix, back: &Matrix) -> Matrix {
    product(&product(back, tensor), &transposed(back))
}

fn add(sum: &mut Matrix, factor: f64, other: &Matrix) {
    for (row, others) in sum.iter_mut().zip(other) {
        for (value, other) in row.iter_mut().zip(others) {
            *value += factor * other;
        }
    }
}

fn contract(first: &Matrix, second: &Matrix) -> f64 {
    first.iter().flatten().zip(second.iter().flatten()).map(|(one, other)| one * other).sum()
}

fn transposed(tensor: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| tensor[j][i]))
}

/// An objective law in closed form for tests, in any units: Saint Venant-Kirchhoff's.
#[cfg(test)]
pub(super) mod closed_law {
    use super::*;

    pub(crate) const LAME: f64 = 3.0;
    pub(crate) const SHEAR: f64 = 2.0;

    /// Second Piola-Kirchhoff stress at a deformation gradient.
    pub(crate) fn second_piola(gradient: &Matrix) -> Matrix {
        let mut strain = product(&transposed(gradient), gradient);
        add(&mut strain, -1.0, &UNIT);
        let trace = 0.5 * (strain[0][0] + strain[1][1] + strain[2][2]);
        let mut piola = strain.map(|row| row.map(|value| SHEAR * value));
        add(&mut piola, LAME * trace, &UNIT);
        piola
    }

    /// Cauchy stress at a deformation gradient.
    pub(crate) fn cauchy(gradient: &Matrix) -> Matrix {
        let ratio = determinant(gradient);
        product(&product(gradient, &second_piola(gradient)), &transposed(gradient))
            .map(|row| row.map(|value| value / ratio))
    }

    pub(crate) fn flat(tensor: &Matrix) -> Tensor2 {
        Tensor2::from_rows(tensor)
    }

    /// Change of the Cauchy stress with a further deformation gradient, by central differences.
    pub(crate) fn tangent(after: &Matrix) -> Tensor4 {
        let mut found = Tensor4::ZERO;
        let size = 1e-6;
        for place in 0..9 {
            let (k, l) = (place / 3, place % 3);
            let moved = |sign: f64| {
                let mut further = UNIT;
                further[k][l] += sign * size;
                cauchy(&product(&further, after))
            };
            let (up, down) = (moved(1.0), moved(-1.0));
            for pair in 0..9 {
                let (i, j) = (pair / 3, pair % 3);
                found.set(i, j, k, l, (up[i][j] - down[i][j]) / (2.0 * size));
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::closed_law::{cauchy, flat, tangent};
    use super::*;

    const IN_SPACE: Components = Components { in_space: true };
    const BEFORE: Matrix = [[1.02, 0.03, -0.01], [0.04, 0.97, 0.02], [0.0, -0.03, 1.01]];
    const AFTER: Matrix = [[1.05, 0.06, -0.02], [0.02, 0.94, 0.05], [0.03, -0.01, 1.04]];

    fn force_at(measure: Stress, after: &Matrix) -> Vec<f64> {
        let (stress, tangent) = (flat(&cauchy(after)), Tensor4::ZERO);
        End { before: BEFORE, after: *after, stress: &stress, tangent: &tangent }.force(measure, IN_SPACE)
    }

    /// Every operator is the derivative of its force.
    #[test]
    fn operators_are_derivatives_of_their_forces() {
        let (stress, tangent) = (flat(&cauchy(&AFTER)), tangent(&AFTER));
        let end = End { before: BEFORE, after: AFTER, stress: &stress, tangent: &tangent };
        let size = 1e-6;
        let kinds =
            [(Operator::CauchyByGradient, Stress::Cauchy), (Operator::FirstPiolaByGradient, Stress::FirstPiola)];
        for (operator, measure) in kinds {
            let found = end.operator(operator, IN_SPACE);
            for (column, one) in IN_SPACE.basis(Kind::General).enumerate() {
                let moved = |sign: f64| {
                    let mut after = AFTER;
                    add(&mut after, sign * size, &one);
                    force_at(measure, &after)
                };
                for (row, (up, down)) in moved(1.0).into_iter().zip(moved(-1.0)).enumerate() {
                    let wanted = (up - down) / (2.0 * size);
                    assert!((found[9 * row + column] - wanted).abs() < 1e-6, "{operator:?} {row} {column}");
                }
            }
        }
        // By the step: F1 = (F1 F0^-1) F0.
        let found = end.operator(Operator::KirchhoffByStep, IN_SPACE);
        for (column, one) in IN_SPACE.basis(Kind::General).enumerate() {
            let moved = |sign: f64| -> Vec<f64> {
                let mut after = AFTER;
                add(&mut after, sign * size, &product(&one, &BEFORE));
                let ratio = determinant(&after);
                force_at(Stress::Cauchy, &after).into_iter().map(|value| ratio * value).collect()
            };
            for (row, (up, down)) in moved(1.0).into_iter().zip(moved(-1.0)).enumerate() {
                assert!((found[9 * row + column] - (up - down) / (2.0 * size)).abs() < 1e-6, "{row} {column}");
            }
        }
    }

    #[test]
    fn the_second_piola_operator_is_that_of_the_law() {
        let (stress, tangent) = (flat(&cauchy(&AFTER)), tangent(&AFTER));
        let end = End { before: BEFORE, after: AFTER, stress: &stress, tangent: &tangent };
        let found = end.operator(Operator::SecondPiolaByStrain, IN_SPACE);
        for (place, value) in found.iter().enumerate() {
            let (row, column) = (place / 6, place % 6);
            let wanted = if row == column { 4.0 } else { 0.0 } + if row < 3 && column < 3 { 3.0 } else { 0.0 };
            assert!((value - wanted).abs() < 1e-6, "{row} {column}: {value} {wanted}");
        }
    }

    #[test]
    fn components_and_tensors_are_inverse_to_each_other() {
        for places in [IN_SPACE, Components { in_space: false }] {
            for kind in [Kind::Symmetric, Kind::General] {
                let given: Vec<f64> = (0..places.count(kind)).map(|place| 1.5 + place as f64).collect();
                let tensor = places.tensor(kind, &given);
                let back: Vec<f64> = places.components(kind, &tensor).collect();
                assert!(
                    given.iter().zip(&back).all(|(one, other)| (one - other).abs() < 1e-14),
                    "{given:?} {back:?}"
                );
            }
        }
        let strain = IN_SPACE.tensor(Kind::Symmetric, &[0.0, 0.0, 0.0, SQRT_2, 0.0, 0.0]);
        assert!((strain[0][1] - 1.0).abs() < 1e-15 && (strain[1][0] - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_step_is_relative_to_its_begin() {
        let small = step(&BEFORE, &AFTER);
        let mut whole = small;
        add(&mut whole, 1.0, &UNIT);
        let back = product(&whole, &BEFORE);
        assert!(back.iter().flatten().zip(AFTER.iter().flatten()).all(|(one, other)| (one - other).abs() < 1e-14));
    }
}
