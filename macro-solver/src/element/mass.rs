//! Lumped masses of elements.

use super::{ElementKind, geometry_of_shape, shape};
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
    for point in (kind.definition().mass_points)() {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{gauss_points, node_places};

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
