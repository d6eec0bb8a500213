//! Displacement fluctuations of a whole specimen: what the mean deformation of the body leaves.

use crate::space::{apply, inverse, product};

/// `x - F x0` of every grain about the means of both, m: `F` is the linear field that fits the displacements best in the sense of least
/// squares, since a body between walls has no cell that would give it. Positions are not wrapped into periodic sides. A rotation of the
/// body turns the result with it. Grains that lie in a plane normal to an axis, or on a line along one, have
/// `F = I` across it.
pub fn less_linear_field(start: &[[f64; 3]], now: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let (from, to) = (about_the_mean(start), about_the_mean(now));
    let mut spread = [[0.0; 3]; 3];
    let mut moved = [[0.0; 3]; 3];
    for (from, to) in from.iter().zip(&to) {
        for i in 0..3 {
            for j in 0..3 {
                spread[i][j] += from[i] * from[j];
                moved[i][j] += to[i] * from[j];
            }
        }
    }
    // Without an extent along an axis nothing is known of the deformation there.
    let largest = (0..3).map(|axis| spread[axis][axis]).fold(0.0, f64::max);
    for axis in 0..3 {
        if spread[axis][axis] <= 1e-12 * largest {
            for other in 0..3 {
                (spread[axis][other], spread[other][axis], moved[axis][other], moved[other][axis]) =
                    (0.0, 0.0, 0.0, 0.0);
            }
            (spread[axis][axis], moved[axis][axis]) = (1.0, 1.0);
        }
    }
    let gradient = product(&moved, &inverse(&spread));
    let is_sound = gradient.as_flattened().iter().all(|part| part.is_finite());
    let left = |(from, to): (&[f64; 3], &[f64; 3])| {
        let carried = if is_sound { apply(&gradient, *from) } else { *from };
        [0, 1, 2].map(|axis| to[axis] - carried[axis])
    };
    from.iter().zip(&to).map(left).collect()
}

fn about_the_mean(places: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let count = places.len().max(1) as f64;
    let mean = [0, 1, 2].map(|axis| places.iter().map(|place| place[axis]).sum::<f64>() / count);
    places.iter().map(|place| [0, 1, 2].map(|axis| place[axis] - mean[axis])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(depth: i32) -> Vec<[f64; 3]> {
        let place = |number: i32| [number % 4, number / 4 % 4, number / 16].map(f64::from);
        (0..16 * depth).map(place).collect()
    }

    /// A linear field leaves nothing, in the plane and in space; what is added to one pair of grains turns with a rotation.
    #[test]
    fn a_linear_field_leaves_nothing_and_a_rotation_turns_the_rest() {
        let (sin, cos) = 0.7_f64.sin_cos();
        let rotation = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
        for depth in [1, 4] {
            let start = grid(depth);
            let stretch = [[1.2, 0.4, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, if depth == 1 { 1.0 } else { 1.1 }]];
            let moved: Vec<[f64; 3]> = start.iter().map(|place| apply(&stretch, *place)).collect();
            let none = less_linear_field(&start, &moved);
            assert!(none.as_flattened().iter().all(|part| part.abs() < 1e-12), "{depth}");
            let mut own = moved.clone();
            own[5][0] += 0.1;
            own[6][1] -= 0.05;
            let left = less_linear_field(&start, &own);
            assert!(left[5][0] > 0.05 && left[6][1] < -0.02);
            let turned: Vec<[f64; 3]> = own.iter().map(|place| apply(&rotation, *place)).collect();
            for (one, other) in left.iter().zip(less_linear_field(&start, &turned)) {
                let expected = apply(&rotation, *one);
                assert!((0..3).all(|axis| (expected[axis] - other[axis]).abs() < 1e-12));
            }
        }
    }

    #[test]
    fn few_grains_give_finite_numbers() {
        for count in 0..3 {
            let start = &grid(1)[..count];
            let now: Vec<[f64; 3]> = start.iter().map(|[x, y, z]| [x + 1.0, y + x, *z]).collect();
            assert!(less_linear_field(start, &now).as_flattened().iter().all(|part| part.is_finite()), "{count}");
        }
    }
}
