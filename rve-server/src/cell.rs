//! The periodic cell: two periodicity vectors that may be skewed, and the geometry that follows from them.

use crate::plane::{self, Plane};

/// A parallelogram that tiles the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Periodicity vectors Y1, Y2, each a row, m. Y2 lies counter-clockwise of Y1.
    pub rows: Plane,
}

impl Cell {
    /// Area, m2.
    pub fn area(&self) -> f64 {
        plane::determinant(&self.rows)
    }

    /// The vector `shift_1 Y1 + shift_2 Y2`, m.
    pub fn translation(&self, shift: [i32; 2]) -> [f64; 2] {
        let (first, second) = (f64::from(shift[0]), f64::from(shift[1]));
        [first * self.rows[0][0] + second * self.rows[1][0], first * self.rows[0][1] + second * self.rows[1][1]]
    }

    /// Distances between the opposite sides that Y1 and Y2 bridge, m.
    pub fn widths(&self) -> [f64; 2] {
        let area = self.area();
        let length = |row: [f64; 2]| (row[0] * row[0] + row[1] * row[1]).sqrt();
        [area / length(self.rows[1]), area / length(self.rows[0])]
    }

    /// The cell after every vector `Y` has become `F Y`.
    pub fn deformed(&self, f: &Plane) -> Self {
        Self { rows: [plane::apply(f, self.rows[0]), plane::apply(f, self.rows[1])] }
    }

    /// Coordinates of a point in units of Y1 and Y2.
    pub fn fractional(&self, point: [f64; 2]) -> [f64; 2] {
        let scale = 1.0 / self.area();
        let [[a, b], [c, d]] = self.rows;
        [(point[0] * d - point[1] * c) * scale, (point[1] * a - point[0] * b) * scale]
    }

    /// The image of `point` whose fractional coordinates lie in [0, 1), and the shift that was subtracted.
    pub fn wrapped(&self, point: [f64; 2]) -> ([f64; 2], [i32; 2]) {
        let fraction = self.fractional(point);
        let shift = [fraction[0].floor() as i32, fraction[1].floor() as i32];
        let translation = self.translation(shift);
        ([point[0] - translation[0], point[1] - translation[1]], shift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractional_coordinates_of_a_skewed_cell_rebuild_the_point() {
        let cell = Cell { rows: [[3.0, 0.4], [1.7, 2.5]] };
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
        let cell = Cell { rows: [[2.0, 0.0], [5.0, 1.0]] };
        let widths = cell.widths();
        assert!((widths[1] - 1.0).abs() < 1e-15);
        assert!((widths[0] - 2.0 / 26f64.sqrt()).abs() < 1e-15);
    }
}
