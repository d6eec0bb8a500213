//! Averages on bars and grids with known weights, and the linear stability of the averaged bar.

use super::*;
use claims::Claim;
use nalgebra::DMatrix;
use proptest::prelude::*;

fn settings(radius: f64, kernel: Kernel) -> NonlocalSettings {
    NonlocalSettings { radius, kernel, ..NonlocalSettings::default() }
}

/// The operator of points with equal volumes.
fn of_equal_points(
    positions: &[[f64; 3]],
    periods: &[[f64; 3]],
    settings: &NonlocalSettings,
) -> Result<NonlocalOperator, NonlocalError> {
    NonlocalOperator::new(positions, &vec![1.0; positions.len()], periods, settings)
}

/// The same whether it is stable or not.
fn unchecked_of_equal_points(
    positions: &[[f64; 3]],
    periods: &[[f64; 3]],
    settings: &NonlocalSettings,
) -> Result<NonlocalOperator, NonlocalError> {
    of_equal_points(positions, periods, &NonlocalSettings { allow_unstable: true, ..settings.clone() })
}

/// The transpose leaves a uniform stress as it is, whatever the volumes of the points, near the ends of a body and in a periodic one, and a uniform
/// strain is its own average. With weights that are averages only, cells at the ends got up to three times the stress.
#[test]
fn the_adjoint_form_keeps_uniform_stresses() {
    let points: Vec<[f64; 3]> = grid([6, 4, 1], 1.0)
        .iter()
        .map(|[x, y, z]| [x + 0.2 * (3.0 * y).sin(), y + 0.2 * (2.0 * x).cos(), *z])
        .collect();
    let volumes: Vec<f64> = (0..24).map(|point| 0.5 + 0.07 * f64::from(point)).collect();
    let stress = vec![Matrix3::new(-1.0, 0.3, 0.0, 0.3, -2.0, 0.0, 0.0, 0.0, 0.4); 24];
    for (kernel, local_share) in [(Kernel::Bell, 0.0), (Kernel::Wendland, 0.0), (Kernel::Cone, 0.1)] {
        for periods in [&[][..], &[[6.0, 0.0, 0.0]], &[[6.0, 0.0, 0.0], [0.0, 4.0, 0.0]]] {
            for radius in [0.1, 1.7, 3.5] {
                let settings = NonlocalSettings { adjoint: true, local_share, ..settings(radius, kernel) };
                let operator = NonlocalOperator::new(&points, &volumes, periods, &settings).unwrap();
                let averaged = operator.averaged(&stress, &stress);
                for found in operator.integrated_stress(&stress, &volumes).iter().chain(&averaged) {
                    assert!((found - stress[0]).norm() < 1e-14, "{found}");
                }
                assert!((0..24).all(|point| operator.row(point).all(|(_, weight)| weight > 0.0)));
            }
        }
    }
}

/// Midpoints of `count` cells of side `h` along each of the axes.
fn grid(counts: [usize; 3], h: f64) -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    for z in 0..counts[2] {
        for y in 0..counts[1] {
            for x in 0..counts[0] {
                points.push([x, y, z].map(|tick| (tick as f64 + 0.5) * h));
            }
        }
    }
    points
}

/// K-6: h = 5 mm, R = 6.75 mm in the plane: four neighbours with 0.2037 before normalisation, the diagonals outside.
#[test]
fn weights_of_a_plane_grid() {
    let points = grid([5, 5, 1], 5e-3);
    let operator = of_equal_points(&points, &[], &settings(6.75e-3, Kernel::Bell)).unwrap();
    let row: Vec<(usize, f64)> = operator.row(12).collect();
    assert_eq!(row.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [11, 7, 12, 17, 13]);
    let own = row[2].1;
    Claim::of("K-6", "own share of a point of a plane grid").value(own, 0.551).within_absolute(1e-4);
    let quantity = "weight of a neighbour over that of the point itself, plane grid";
    Claim::of("K-6", quantity).value(row[0].1 / own, 0.2037).within_absolute(1e-4);
}

/// K-1, K-3: constants everywhere and linear fields inside are reproduced; a radius below the distance changes nothing.
#[test]
fn constants_and_linear_fields_pass_and_short_radii_do_nothing() {
    let points = grid([7, 7, 7], 1.0);
    let operator = of_equal_points(&points, &[], &settings(2.5, Kernel::Wendland)).unwrap();
    let slope = Matrix3::new(1.0, 2.0, -3.0, 0.5, 4.0, 0.0, 0.3, -0.2, 1.0);
    let constant = vec![slope; points.len()];
    let averages = operator.averaged(&constant, &constant);
    let change = averages.iter().map(|average| (average - slope).amax()).max_by(f64::total_cmp).unwrap();
    Claim::of("K-1", "largest change of a constant field").error(change).within(1e-13);
    let linear: Vec<Matrix3<f64>> =
        points.iter().map(|point| slope * (point[0] - 2.0 * point[1] + 0.1 * point[2])).collect();
    let averages = operator.averaged(&linear, &linear);
    for (number, point) in points.iter().enumerate() {
        if point.iter().all(|value| *value > 2.5 && *value < 4.5) {
            let change = (averages[number] - linear[number]).amax();
            // Its largest value is 50.
            Claim::of("K-1", "change of a linear field inside, over its largest value")
                .error(change / 50.0)
                .within(1e-13);
        }
    }
    let identity = of_equal_points(&points, &[], &settings(0.99, Kernel::Bell)).unwrap();
    assert!(identity.is_identity());
    let is_unchanged = identity.averaged(&linear, &linear) == linear;
    Claim::of("K-3", "a field with a radius below the distance of points keeps its bits").holds(is_unchanged);
}

/// K-2: the second moment of a quadratic field, <x^2> = x^2 + R^2/7, R^2/8, R^2/9 for the bell at R/h = 5.
#[test]
fn quadratic_fields_rise_by_the_second_moment() {
    let radius = 5.0;
    for (counts, expected, what) in
        [([21, 1, 1], 7.0, "on a bar"), ([15, 15, 1], 8.0, "in the plane"), ([13, 13, 13], 9.0, "in space")]
    {
        let points = grid(counts, 1.0);
        let operator = unchecked_of_equal_points(&points, &[], &settings(radius, Kernel::Bell)).unwrap();
        let field: Vec<Matrix3<f64>> = points.iter().map(|point| Matrix3::identity() * point[0] * point[0]).collect();
        let middle = points.len() / 2;
        let rise = operator.averaged(&field, &field)[middle][(0, 0)] - field[middle][(0, 0)];
        let quantity = format!("second moment of the bell over a grid {what}, R/h = 5");
        Claim::of("K-2", &quantity).value(rise, radius * radius / expected).within(0.02);
    }
}

/// K-5: the numbering of the points does not matter to the synchronous average, and does to the staggered one.
#[test]
fn only_the_staggered_average_knows_the_numbering() {
    let points = grid([6, 4, 1], 1.0);
    let field = |scale: f64| -> Vec<Matrix3<f64>> {
        points.iter().map(|point| Matrix3::identity() * (scale * (point[0] + 0.3 * point[1])).sin()).collect()
    };
    let (now, before) = (field(1.0), field(2.0));
    let reversed = |values: &[Matrix3<f64>]| values.iter().rev().copied().collect::<Vec<_>>();
    let backwards: Vec<[f64; 3]> = points.iter().rev().copied().collect();
    for (update, same, quantity) in [
        (Update::Synchronous, true, "synchronous averages with points numbered backwards are the same bits"),
        (Update::Staggered, false, "staggered averages with points numbered backwards differ"),
    ] {
        let settings = NonlocalSettings { update, ..settings(1.8, Kernel::Wendland) };
        let forth = of_equal_points(&points, &[], &settings).unwrap().averaged(&now, &before);
        let back = of_equal_points(&backwards, &[], &settings).unwrap().averaged(&reversed(&now), &reversed(&before));
        let back: Vec<Matrix3<f64>> = reversed(&back);
        Claim::of("K-5", quantity).holds((forth == back) == same);
    }
}

/// The same call gives the same bits whatever the search tree does.
#[test]
fn equal_points_give_equal_bits() {
    let points = grid([9, 9, 2], 0.7);
    let build = || of_equal_points(&points, &[[6.3, 0.0, 0.0]], &settings(2.0, Kernel::Wendland)).unwrap();
    assert_eq!(build(), build());
}

#[test]
fn periodic_images_make_every_point_an_interior_one() {
    let points = grid([6, 1, 1], 1.0);
    let operator = of_equal_points(&points, &[[6.0, 0.0, 0.0]], &settings(1.5, Kernel::Wendland)).unwrap();
    let first: Vec<(usize, f64)> = operator.row(0).collect();
    let inner: Vec<(usize, f64)> = operator.row(3).collect();
    assert_eq!(first.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [5, 0, 1]);
    assert!(first.iter().zip(&inner).all(|(first, inner)| (first.1 - inner.1).abs() < 1e-15));
}

/// Ties of opposite corners, or of faces that lie on each other, are no further periods: images of theirs were counted again, and the
/// own share of a point with them.
#[test]
fn periods_that_depend_on_each_other_count_once() {
    let points = grid([4, 4, 1], 0.25);
    let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let settings = NonlocalSettings { local_share: 0.1, ..settings(0.6, Kernel::Wendland) };
    let built = |periods: &[[f64; 3]]| of_equal_points(&points, periods, &settings).unwrap();
    let plain = built(&[x, y]);
    for dependent in
        [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [1.0 + 1e-9, 1.0, 0.0], [0.0, 2.0, 0.0], [0.0; 3], [1e-17, 0.0, 0.0]]
    {
        assert_eq!(built(&[x, y, dependent]), plain, "{dependent:?}");
    }
    for point in 0..plain.len() {
        assert!((plain.row(point).map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-14);
    }
}

/// The images of a body under a skewed pair of periods are those under an upright one; faces are closer than the skewed period is long.
#[test]
fn skewed_periods_reach_as_far_as_upright_ones() {
    let points = grid([2, 2, 1], 0.5);
    let settings = settings(2.2, Kernel::Wendland);
    let built = |periods: &[[f64; 3]]| of_equal_points(&points, periods, &settings).unwrap();
    let upright = built(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(built(&[[1.0, 0.0, 0.0], [5.0, 1.0, 0.0]]), upright);
    assert_eq!(built(&[[1.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), upright);
}

/// Stiffness of a bar of unit elements, both ends held, under averaged strain; its smallest real eigenvalue part.
fn smallest_eigenvalue(operator: &NonlocalOperator) -> f64 {
    let elements = operator.len();
    let mut average = DMatrix::zeros(elements, elements);
    for point in 0..elements {
        for (neighbour, weight) in operator.row(point) {
            average[(point, neighbour)] += weight;
        }
    }
    let strain = DMatrix::from_fn(elements, elements - 1, |element, node| match element as i64 - node as i64 {
        0 => 1.0,
        1 => -1.0,
        _ => 0.0,
    });
    let smoothed = &average * &strain;
    let stiffness =
        if operator.settings().adjoint { smoothed.transpose() * smoothed } else { strain.transpose() * smoothed };
    stiffness.complex_eigenvalues().iter().map(|value| value.re).fold(f64::INFINITY, f64::min)
}

/// K-4: a bar of 40 elements. The bell is stable at R/h = 1.35 and 1.8 and unstable from 2.0 on; what is unstable is refused
/// with a remedy that works.
#[test]
fn the_bell_is_unstable_on_fine_bars_and_refused() {
    let points = grid([40, 1, 1], 1.0);
    let found = |settings: &NonlocalSettings| {
        smallest_eigenvalue(&unchecked_of_equal_points(&points, &[], settings).unwrap())
    };
    for radius in [1.35, 1.8] {
        let bell = settings(radius, Kernel::Bell);
        Claim::of("K-4", "smallest eigenvalue of a bar, bell at R/h = 1.35 and 1.8")
            .number(found(&bell))
            .at_least(1e-6);
        assert!(of_equal_points(&points, &[], &bell).is_ok());
    }
    for (radius, expected) in [(2.0, -0.229), (2.5, -0.226), (2.7, -0.116), (4.0, -0.092), (6.0, -0.047)] {
        let bell = settings(radius, Kernel::Bell);
        let quantity = "smallest eigenvalue of a bar, bell at R/h = 2 to 6";
        Claim::of("K-4", quantity).value(found(&bell), expected).within_absolute(0.0006);
        let Err(NonlocalError::Unstable { symbol, remedy_share, .. }) = of_equal_points(&points, &[], &bell) else {
            panic!("R/h = {radius} must be refused");
        };
        let quantity = "an unstable bell on a bar is refused, for waves that it turns to their opposite";
        Claim::of("K-4", quantity).holds(symbol < 0.0);
        let allowed = NonlocalSettings { allow_unstable: true, ..bell.clone() };
        assert!(of_equal_points(&points, &[], &allowed).is_ok(), "R/h = {radius}");
        let blended = NonlocalSettings { local_share: remedy_share + 0.01, ..bell.clone() };
        assert!(of_equal_points(&points, &[], &blended).is_ok(), "R/h = {radius}");
        let quantity = "smallest eigenvalue of a bar, unstable bell with the proposed local share";
        Claim::of("K-4", quantity).number(found(&blended)).at_least(1e-6);
        let adjoint = NonlocalSettings { adjoint: true, ..bell };
        assert!(of_equal_points(&points, &[], &adjoint).is_ok());
        let quantity = "smallest eigenvalue of a bar, unstable bell in the adjoint form";
        Claim::of("K-4", quantity).number(found(&adjoint)).at_least(-1e-12);
    }
}

/// K-4, S-10: the positive kernels are stable at every radius up to 8 elements, the bell nowhere from 2 on.
#[test]
fn positive_kernels_are_stable_at_every_radius() {
    let points = grid([40, 1, 1], 1.0);
    for radius in [0.5, 1.35, 1.8, 2.0, 2.5, 2.7, 4.0, 6.0, 8.0] {
        for kernel in [Kernel::Wendland, Kernel::Cone] {
            let operator = of_equal_points(&points, &[], &settings(radius, kernel)).unwrap();
            let quantity = "smallest eigenvalue of a bar, Wendland's kernel and cone at R/h = 0.5 to 8";
            Claim::of("K-4", quantity).number(smallest_eigenvalue(&operator)).at_least(1e-6);
        }
    }
}

/// K-4 in the plane: the limit of the bell lies between R/h = 1.35 and 1.6.
#[test]
fn the_limit_of_the_bell_is_lower_in_the_plane() {
    let points = grid([12, 12, 1], 1.0);
    let accepted = |radius| of_equal_points(&points, &[], &settings(radius, Kernel::Bell)).is_ok();
    Claim::of("K-4", "the bell on a plane grid is accepted at R/h = 1.35").holds(accepted(1.35));
    let is_refused = [1.6, 2.0, 2.7, 4.0].into_iter().all(|radius| !accepted(radius));
    Claim::of("K-4", "the bell on a plane grid is refused at R/h = 1.6 to 4").holds(is_refused);
    for radius in [1.6, 2.7, 4.0, 6.0] {
        assert!(of_equal_points(&points, &[], &settings(radius, Kernel::Wendland)).is_ok());
    }
}

#[test]
fn numbers_that_mean_nothing_are_refused_by_name() {
    let points = grid([3, 1, 1], 1.0);
    let refused = |settings: NonlocalSettings| of_equal_points(&points, &[], &settings).unwrap_err().to_string();
    assert!(refused(settings(f64::NAN, Kernel::Bell)).contains("nonlocal.radius"));
    assert!(refused(settings(0.0, Kernel::Bell)).contains("positive length"));
    let share = NonlocalSettings { local_share: 1.0, ..settings(1.0, Kernel::Bell) };
    assert!(refused(share).contains("nonlocal.local_share"));
}

/// Work that the nodes do minus work that the materials see, `sum V sigma:(e - <e>)`, J. Erratum: [Liu2015] takes the two for
/// equal; they are with [`NonlocalSettings::adjoint`] only.
fn work_mismatch(
    operator: &NonlocalOperator,
    stress: &[Matrix3<f64>],
    increments: &[Matrix3<f64>],
    averages: &[Matrix3<f64>],
    volumes: &[f64],
) -> f64 {
    let integrated = operator.integrated_stress(stress, volumes);
    let work = |point: usize| {
        volumes[point] * (integrated[point].dot(&increments[point]) - stress[point].dot(&averages[point]))
    };
    (0..operator.len()).map(work).sum()
}

proptest! {
    /// With the adjoint form the work of the nodes is the work of the grains.
    #[test]
    fn the_adjoint_form_loses_no_work(
        strains in proptest::collection::vec(-1.0..1.0f64, 12), stresses in proptest::collection::vec(-1.0..1.0f64, 12),
    ) {
        let points = grid([4, 3, 1], 1.0);
        let volumes: Vec<f64> = (0..12).map(|point| 1.0 + 0.1 * f64::from(point)).collect();
        let fields = |values: &[f64]| values.iter().map(|value| Matrix3::identity() * *value).collect::<Vec<_>>();
        let (strains, stresses) = (fields(&strains), fields(&stresses));
        let adjoint = NonlocalSettings { adjoint: true, ..settings(2.2, Kernel::Bell) };
        let operator = of_equal_points(&points, &[], &adjoint).unwrap();
        let averages = operator.averaged(&strains, &strains);
        prop_assert!(work_mismatch(&operator, &stresses, &strains, &averages, &volumes).abs() < 1e-12);
    }
}

/// A radius in another unit would take the memory of the machine before anything is said.
#[test]
fn a_radius_that_reaches_far_beyond_the_mesh_is_refused_at_once() {
    let points: Vec<[f64; 3]> = (0..32).map(|number| [f64::from(number % 4), f64::from(number / 4), 0.0]).collect();
    let with = |radius: f64, periods: &[[f64; 3]]| {
        of_equal_points(&points, periods, &settings(radius, Kernel::Wendland)).map(|operator| operator.len())
    };
    let too_wide = |radius: f64| Err(NonlocalError::TooWide { radius, most: MOST_NEIGHBOURS });
    assert_eq!(with(20.0, &[]), Ok(32));
    assert_eq!(with(1e3, &[]), too_wide(1e3));
    assert_eq!(with(1e9, &[[4.0, 0.0, 0.0], [0.0, 8.0, 0.0]]), too_wide(1e9));
}
