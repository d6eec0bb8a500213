//! The periodic cell: periodicity vectors that may be skewed, and the geometry that follows from them.

use crate::space::{Components, Discs, Space, Tensor, apply};

/// A parallelogram or parallelepiped that tiles the space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell<S: Space = Discs> {
    /// Periodicity vectors Y1, Y2 (, Y3), each a row, m. They are right-handed: their determinant is positive.
    pub rows: S::Tensor,
}

impl<S: Space> Cell<S> {
    /// Area (m2) of a plane cell, volume (m3) of a cell in space.
    pub fn measure(&self) -> f64 {
        self.rows.determinant()
    }

    /// The vector `shift_1 Y1 + shift_2 Y2 (+ shift_3 Y3)`, m.
    pub fn translation(&self, shift: S::Shift) -> S::Vector {
        translation::<S>(&self.rows, shift)
    }

    /// Distances between the opposite sides that each periodicity vector bridges, m.
    pub fn widths(&self) -> S::Vector {
        let (measure, cofactors) = (self.measure(), S::cofactors(&self.rows));
        S::Vector::from_fn(|axis| measure / cofactors[axis].norm())
    }

    /// The cell after every vector `Y` has become `F Y`.
    pub fn deformed(&self, f: &S::Tensor) -> Self {
        let rows = [0, 1, 2].map(|row| if row < S::DIMENSION { apply(f, self.rows[row]) } else { S::Vector::ZERO });
        Self { rows: S::Tensor::from_fn(|row, axis| rows[row][axis]) }
    }

    /// Coordinates of a point in units of the periodicity vectors.
    pub fn fractional(&self, point: S::Vector) -> S::Vector {
        let scale = 1.0 / self.measure();
        let cofactors = S::cofactors(&self.rows);
        S::Vector::from_fn(|axis| point.dot(cofactors[axis]) * scale)
    }

    /// The image of `point` whose fractional coordinates lie in [0, 1), and the shift that was subtracted.
    pub fn wrapped(&self, point: S::Vector) -> (S::Vector, S::Shift) {
        let fraction = self.fractional(point);
        let shift = S::shift(|axis| fraction[axis].floor() as i32);
        (point.minus(self.translation(shift)), shift)
    }
}

/// The sum of the rows, each times its number in `shift`, m.
pub(crate) fn translation<S: Space>(rows: &S::Tensor, shift: S::Shift) -> S::Vector {
    S::Vector::from_fn(|axis| {
        let mut sum = f64::from(shift[0]) * rows[0][axis];
        for row in 1..S::DIMENSION {
            sum += f64::from(shift[row]) * rows[row][axis];
        }
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Spheres;

    #[test]
    fn fractional_coordinates_of_a_skewed_cell_rebuild_the_point() {
        let cell = Cell::<Discs> { rows: [[3.0, 0.4], [1.7, 2.5]] };
        let point = [-4.0, 7.3];
        let fraction = cell.fractional(point);
        for (axis, coordinate) in point.iter().enumerate() {
            let rebuilt = fraction[0] * cell.rows[0][axis] + fraction[1] * cell.rows[1][axis];
            assert!((rebuilt - coordinate).abs() < 1e-14);
        }
        let (wrapped, shift) = cell.wrapped(point);
        let inside = cell.fractional(wrapped);
        assert!(inside.iter().all(|f| (-1e-15..1.0 + 1e-15).contains(f)));
        let back = cell.translation(shift);
        assert!((wrapped[0] + back[0] - point[0]).abs() < 1e-14 && (wrapped[1] + back[1] - point[1]).abs() < 1e-14);
    }

    #[test]
    fn widths_are_perpendicular_distances() {
        let cell = Cell::<Discs> { rows: [[2.0, 0.0], [5.0, 1.0]] };
        let widths = cell.widths();
        assert!((widths[1] - 1.0).abs() < 1e-15);
        assert!((widths[0] - 2.0 / 26f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn skewed_cell_in_space_rebuilds_points_and_measures_widths() {
        let cell = Cell::<Spheres> { rows: [[3.0, 0.4, -0.2], [1.7, 2.5, 0.3], [-0.6, 0.9, 4.0]] };
        let point = [-4.0, 7.3, 11.0];
        let (wrapped, shift) = cell.wrapped(point);
        assert!(cell.fractional(wrapped).iter().all(|f| (-1e-15..1.0 + 1e-15).contains(f)));
        assert!(wrapped.plus(cell.translation(shift)).minus(point).norm() < 1e-14);
        for axis in 0..3 {
            let mut one = [0.0; 3];
            one[axis] = 1.0;
            assert!(cell.fractional(cell.rows[axis]).minus(one).norm() < 1e-15);
        }
        let straight = Cell::<Spheres> { rows: [[2.0, 0.0, 0.0], [5.0, 3.0, 0.0], [1.0, 1.0, 4.0]] };
        assert!((straight.widths()[2] - 4.0).abs() < 1e-15 && (straight.measure() - 24.0).abs() < 1e-13);
    }
}
