//! Whether the supports hold every part of the mesh.

use super::{Prescribed, ProblemError};
use crate::mesh::{Dimension, Mesh};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Every connected part must have its translations and rotations suppressed by prescribed displacements; otherwise
/// the equations are singular for any material.
pub(super) fn check_rigid_motion(mesh: &Mesh, prescribed: &[Option<Prescribed<'_>>]) -> Result<(), ProblemError> {
    for (element, nodes) in parts(mesh) {
        let count = nodes.len() as f64;
        let centre: [f64; 3] =
            std::array::from_fn(|i| nodes.iter().map(|&node| mesh.nodes[node][i]).sum::<f64>() / count);
        let arm = |node: usize| -> [f64; 3] { std::array::from_fn(|i| mesh.nodes[node][i] - centre[i]) };
        let extent =
            nodes.iter().map(|&node| arm(node).iter().map(|x| x * x).sum::<f64>()).fold(0.0, f64::max).sqrt();
        let words = motion_words(mesh.dimension);
        let mut gram = DMatrix::zeros(words.len(), words.len());
        for &node in &nodes {
            let motions = rigid_motions(mesh.dimension, arm(node).map(|x| x / extent));
            for (axis, motion) in motions.iter().enumerate() {
                if prescribed[mesh.dimension.count() * node + axis].is_some() {
                    gram += motion * motion.transpose();
                }
            }
        }
        let eigen = SymmetricEigen::new(gram);
        let weakest = eigen.eigenvalues.imin();
        if eigen.eigenvalues[weakest] < 1e-10 {
            let free = eigen.eigenvectors.column(weakest);
            let involved: Vec<&str> = words
                .iter()
                .zip(free.iter())
                .filter(|(_, share)| share.abs() > 1e-6)
                .map(|(word, _)| *word)
                .collect();
            return Err(ProblemError::RigidMotion { element, motion: involved.join(" and ") });
        }
    }
    Ok(())
}

/// Displacement along each axis, as a row over the rigid motions, of a node at `arm` from the centre.
fn rigid_motions(dimension: Dimension, [x, y, z]: [f64; 3]) -> Vec<DVector<f64>> {
    let rows: &[&[f64]] = match dimension {
        Dimension::Plane => &[&[1.0, 0.0, -y], &[0.0, 1.0, x]],
        Dimension::Space => {
            &[&[1.0, 0.0, 0.0, 0.0, z, -y], &[0.0, 1.0, 0.0, -z, 0.0, x], &[0.0, 0.0, 1.0, y, -x, 0.0]]
        }
    };
    rows.iter().map(|row| DVector::from_row_slice(row)).collect()
}

fn motion_words(dimension: Dimension) -> &'static [&'static str] {
    match dimension {
        Dimension::Plane => &["move along x", "move along y", "rotate"],
        Dimension::Space => {
            &["move along x", "move along y", "move along z", "rotate about x", "rotate about y", "rotate about z"]
        }
    }
}

/// First element and sorted nodes of every connected part of the mesh.
fn parts(mesh: &Mesh) -> Vec<(usize, Vec<usize>)> {
    let mut leader: Vec<usize> = (0..mesh.nodes.len()).collect();
    fn find(leader: &mut [usize], mut node: usize) -> usize {
        while leader[node] != node {
            leader[node] = leader[leader[node]];
            node = leader[node];
        }
        node
    }
    for nodes in &mesh.elements {
        for pair in nodes.windows(2) {
            let (first, second) = (find(&mut leader, pair[0]), find(&mut leader, pair[1]));
            leader[first.max(second)] = first.min(second);
        }
    }
    let mut found: Vec<(usize, usize, Vec<usize>)> = Vec::new();
    for (element, nodes) in mesh.elements.iter().enumerate() {
        let root = find(&mut leader, nodes[0]);
        if !found.iter().any(|(other, _, _)| *other == root) {
            let members = (0..mesh.nodes.len()).filter(|&node| find(&mut leader, node) == root).collect();
            found.push((root, element, members));
        }
    }
    found.into_iter().map(|(_, element, members)| (element, members)).collect()
}
