//! Lumped masses of elements.

use super::{GaussPoint, gauss_points, geometry_of_shape, shape};
use crate::mesh::{Dimension, ElementKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How the mass of an element is given to its nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Lumping {
    /// `m_a = integral rho N_a`: rows of the consistent matrix. Not positive at corners of quadratic elements.
    RowSum,
    /// `m_a` in proportion to `integral N_a^2`, with the element's mass as their sum (Hinton, Rock and Zienkiewicz 1976;
    /// [Liu2018] section 2.3). Positive for every kind.
    #[default]
    Hrz,
}

impl Lumping {
    /// The keyword of scene files.
    pub fn keyword(self) -> &'static str {
        match self {
            Self::RowSum => "row_sum",
            Self::Hrz => "hrz",
        }
    }
}

/// A lumping that does not work for an element kind.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error(
    "row-sum lumping gives node {node} of a {kind:?} the mass {mass:.3e} kg, which is not positive; use \"hrz\" lumping"
)]
pub struct MassError {
    /// Kind of the element.
    pub kind: ElementKind,
    /// Local node.
    pub node: usize,
    /// Its mass, kg.
    pub mass: f64,
}

/// Masses of the nodes of an element at its initial `positions` with a mass density in kg/m3: kg, in the plane per metre
/// of thickness. Integrated exactly on elements with straight edges and constant Jacobian.
///
/// # Errors
/// [`MassError`] when a mass is not positive.
pub fn lumped_masses(
    kind: ElementKind,
    positions: &[[f64; 3]],
    density: f64,
    lumping: Lumping,
) -> Result<Vec<f64>, MassError> {
    let mut total = 0.0;
    let (mut rows, mut squares) = (vec![0.0; kind.node_count()], vec![0.0; kind.node_count()]);
    for point in mass_points(kind) {
        let shape = shape(kind, point.place);
        let mass = density * point.weight * geometry_of_shape(kind, &shape, positions).volume;
        total += mass;
        for (node, value) in shape.values.iter().enumerate().take(kind.node_count()) {
            rows[node] += mass * value;
            squares[node] += mass * value * value;
        }
    }
    if lumping == Lumping::Hrz {
        let sum: f64 = squares.iter().sum();
        return Ok(squares.iter().map(|square| square / sum * total).collect());
    }
    match rows.iter().position(|mass| *mass <= 1e-12 * total) {
        Some(node) => Err(MassError { kind, node, mass: rows[node] }),
        None => Ok(rows),
    }
}

/// Points that integrate `N_a^2` exactly over a natural element.
fn mass_points(kind: ElementKind) -> Vec<GaussPoint> {
    match kind {
        ElementKind::Q4Single => gauss_points(ElementKind::Q4).to_vec(),
        ElementKind::Q8 => gauss_points(ElementKind::Q8Full).to_vec(),
        ElementKind::H8Single => gauss_points(ElementKind::H8).to_vec(),
        ElementKind::H20 => gauss_points(ElementKind::H20Full).to_vec(),
        ElementKind::T3 | ElementKind::T6 | ElementKind::T4 | ElementKind::T10 => simplex_points(kind.dimension()),
        ElementKind::Q4 | ElementKind::Q8Full | ElementKind::H8 | ElementKind::H20Full => gauss_points(kind).to_vec(),
    }
}

/// Four-point Gauss rule on 0 to 1.
const FOUR: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// A product rule collapsed onto the triangle or tetrahedron, exact for polynomials of degree 4.
fn simplex_points(dimension: Dimension) -> Vec<GaussPoint> {
    let mut points = Vec::new();
    for (u, wu) in FOUR {
        for (v, wv) in FOUR {
            let (x, y) = (u, v * (1.0 - u));
            match dimension {
                Dimension::Plane => {
                    points.push(GaussPoint { place: [x, y, 0.0], weight: wu * wv * (1.0 - u) });
                }
                Dimension::Space => points.extend(FOUR.iter().map(|(w, ww)| GaussPoint {
                    place: [x, y, w * (1.0 - x - y)],
                    weight: wu * wv * ww * (1.0 - u) * (1.0 - x - y),
                })),
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::node_places;

    fn shares(kind: ElementKind, lumping: Lumping) -> Result<Vec<f64>, MassError> {
        let masses = lumped_masses(kind, node_places(kind), 3.0, lumping)?;
        let total: f64 = masses.iter().sum();
        Ok(masses.iter().map(|mass| mass / total).collect())
    }

    #[test]
    fn every_kind_keeps_its_mass_and_has_positive_hrz_masses() {
        for kind in ElementKind::ALL {
            let masses = lumped_masses(kind, node_places(kind), 3.0, Lumping::Hrz).unwrap();
            let volume: f64 = gauss_points(kind).iter().map(|point| point.weight).sum();
            assert!((masses.iter().sum::<f64>() - 3.0 * volume).abs() < 1e-13, "{kind:?}");
            assert!(masses.iter().all(|mass| *mass > 0.0), "{kind:?}");
        }
    }

    /// Published shares: T6 3/57 and 16/57, Q8 3/76 and 16/76, T10 1/36 and 4/27.
    #[test]
    fn hrz_shares_are_the_published_ones() {
        for (kind, corner, middle) in [
            (ElementKind::T6, 3.0 / 57.0, 16.0 / 57.0),
            (ElementKind::Q8, 3.0 / 76.0, 16.0 / 76.0),
            (ElementKind::T10, 1.0 / 36.0, 4.0 / 27.0),
            (ElementKind::H8Single, 0.125, 0.125),
        ] {
            let shares = shares(kind, Lumping::Hrz).unwrap();
            assert!((shares[0] - corner).abs() < 1e-14, "{kind:?}: {}", shares[0]);
            assert!((shares[kind.node_count() - 1] - middle).abs() < 1e-14, "{kind:?}: {shares:?}");
        }
    }

    #[test]
    fn row_sums_are_equal_for_linear_elements_and_refused_for_quadratic_ones() {
        for kind in ElementKind::ALL {
            match shares(kind, Lumping::RowSum) {
                Ok(shares) => {
                    assert!(!kind.is_quadratic());
                    assert!(shares.iter().all(|share| (share * kind.node_count() as f64 - 1.0).abs() < 1e-14));
                }
                Err(error) => assert!(kind.is_quadratic() && error.to_string().contains("hrz")),
            }
        }
    }
}
