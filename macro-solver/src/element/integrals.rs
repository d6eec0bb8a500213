//! Contributions of one Gauss point to the forces and the stiffness of its element.
//!
//! Element vectors run over `dimension * local node + axis`; element matrices are square and row-major over the same.

use super::PointGeometry;
use crate::formulation::Operator;
use nalgebra::Matrix3;

/// Adds `f_ai = s_ij dN_a/dx_j dv`, N.
pub fn add_force(dimension: usize, geometry: &PointGeometry, nodes: usize, stress: &Matrix3<f64>, force: &mut [f64]) {
    for (a, slope) in geometry.gradients.iter().enumerate().take(nodes) {
        for i in 0..dimension {
            let traction: f64 = (0..dimension).map(|j| stress[(i, j)] * slope[j]).sum();
            force[dimension * a + i] += geometry.volume * traction;
        }
    }
}

/// Adds `K_aibk = dN_a/dx_j A_ijkl dN_b/dx_l dv`, N/m.
pub fn add_stiffness(
    dimension: usize,
    geometry: &PointGeometry,
    nodes: usize,
    moduli: &Operator,
    matrix: &mut [f64],
) {
    // The number of dimensions is known to each copy, so that its loops unroll.
    match dimension {
        2 => add_stiffness_in::<2>(geometry, nodes, moduli, matrix),
        _ => add_stiffness_in::<3>(geometry, nodes, moduli, matrix),
    }
}

fn add_stiffness_in<const D: usize>(geometry: &PointGeometry, nodes: usize, moduli: &Operator, matrix: &mut [f64]) {
    let width = D * nodes;
    for b in 0..nodes {
        let slope = &geometry.gradients[b];
        for k in 0..D {
            // change_ij = A_ijkl dN_b/dx_l dv.
            let mut change = [[0.0; D]; D];
            for (i, row) in change.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    let sum: f64 = (0..D).map(|l| moduli[(3 * i + j, 3 * k + l)] * slope[l]).sum();
                    *entry = geometry.volume * sum;
                }
            }
            for a in 0..nodes {
                let test = &geometry.gradients[a];
                for (i, row) in change.iter().enumerate() {
                    let entry: f64 = (0..D).map(|j| test[j] * row[j]).sum();
                    matrix[(D * a + i) * width + D * b + k] += entry;
                }
            }
        }
    }
}
