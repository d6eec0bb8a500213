use super::*;

#[test]
fn shape_functions_are_one_at_their_node_and_zero_at_the_others() {
    for kind in ElementKind::ALL {
        for (place, &corner) in node_places(kind).iter().enumerate() {
            let values = shape(kind, corner).values;
            for (node, value) in values.iter().enumerate() {
                assert_eq!(*value, f64::from(node == place), "{kind:?} function {node} at node {place}");
            }
        }
    }
}

#[test]
fn shape_functions_sum_to_one_and_their_gradients_match_differences() {
    let step = 1e-6;
    for kind in ElementKind::ALL {
        for place in [[0.3, 0.2, 0.15], [-0.2, 0.9, -0.4]] {
            let here = shape(kind, place);
            assert!((here.values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            for axis in 0..3 {
                let shifted = |sign: f64| {
                    let mut moved = place;
                    moved[axis] += sign * step;
                    shape(kind, moved).values
                };
                let (ahead, behind) = (shifted(1.0), shifted(-1.0));
                for node in 0..MAX_NODES {
                    let difference = (ahead[node] - behind[node]) / (2.0 * step);
                    assert!((difference - here.gradients[node][axis]).abs() < 1e-9, "{kind:?} {node} {axis}");
                }
            }
        }
    }
}

/// The natural element, mapped by an affine map of determinant 1.7 and then bent a little.
fn distorted(kind: ElementKind, bend: f64) -> Vec<[f64; 3]> {
    let plane = kind.dimension() == Dimension::Plane;
    let map = if plane {
        Matrix3::new(1.3, 0.2, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 1.0)
    } else {
        Matrix3::new(1.3, 0.2, 0.1, 0.1, 1.1, -0.2, -0.3, 0.1, 1.2)
    };
    let moved = |place: &[f64; 3]| {
        let x = map * nalgebra::Vector3::from(*place);
        let height = if plane { 0.0 } else { x[2] + bend * x[0] * x[1] };
        [x[0] + bend * x[0] * x[1], x[1] - bend * x[0] * x[1], height]
    };
    node_places(kind).iter().map(moved).collect()
}

#[test]
fn gradients_of_a_linear_field_on_a_distorted_element_are_exact() {
    for kind in ElementKind::ALL {
        let positions = distorted(kind, 0.05);
        for local in 0..kind.point_count() {
            let geometry = point_geometry(kind, &positions, local);
            let mut gradient = [0.0; 3];
            for (position, slope) in positions.iter().zip(&geometry.gradients) {
                let field = 3.0 * position[0] - 2.0 * position[1] + 0.5 * position[2];
                (0..3).for_each(|i| gradient[i] += field * slope[i]);
            }
            let third = if kind.dimension() == Dimension::Plane { 0.0 } else { 0.5 };
            let error = (gradient[0] - 3.0).abs() + (gradient[1] + 2.0).abs() + (gradient[2] - third).abs();
            assert!(error < 1e-12, "{kind:?}: {gradient:?}");
        }
    }
}

#[test]
fn volumes_of_parallel_epipeds_are_exact_and_tables_hold_every_point() {
    for kind in ElementKind::ALL {
        assert_eq!(gauss_points(kind).len(), kind.point_count());
        assert_eq!(shapes_at_points(kind).len(), kind.point_count());
        assert_eq!(shapes_at_points(kind)[0], shape(kind, gauss_points(kind)[0].place));
        let positions = distorted(kind, 0.0);
        let volume: f64 = (0..kind.point_count()).map(|local| point_geometry(kind, &positions, local).volume).sum();
        let natural: f64 = gauss_points(kind).iter().map(|point| point.weight).sum();
        let determinant = if kind.dimension() == Dimension::Plane { 1.28 } else { 1.764 };
        assert!((volume / natural - determinant).abs() < 1e-13, "{kind:?}: {}", volume / natural);
    }
}

/// Every rule integrates the highest degree that it claims over its natural element.
#[test]
fn quadrature_rules_have_their_degree() {
    let degree = |kind| match kind {
        ElementKind::Q4Single | ElementKind::H8Single | ElementKind::T3 | ElementKind::T4 => 1,
        ElementKind::T6 | ElementKind::T10 => 2,
        ElementKind::Q8Full | ElementKind::H20Full => 5,
        _ => 3,
    };
    for kind in ElementKind::ALL {
        for power in 0..=degree(kind) {
            let found: f64 = gauss_points(kind).iter().map(|point| point.weight * point.place[0].powi(power)).sum();
            let n = f64::from(power);
            let exact = match kind {
                ElementKind::T3 | ElementKind::T6 => 1.0 / ((n + 1.0) * (n + 2.0)),
                ElementKind::T4 | ElementKind::T10 => 1.0 / ((n + 1.0) * (n + 2.0) * (n + 3.0)),
                _ if power % 2 == 1 => 0.0,
                _ => 2f64.powi(kind.dimension().count() as i32) / (n + 1.0),
            };
            assert!((found - exact).abs() < 1e-14, "{kind:?} degree {power}: {found} {exact}");
        }
    }
}
