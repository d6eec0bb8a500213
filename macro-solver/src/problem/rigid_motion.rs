//! Whether the supports hold every part of the mesh.

use super::elimination::Dependent;
use super::{Prescribed, ProblemError};
use crate::mesh::{Dimension, Mesh};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Every connected part must have its translations and rotations suppressed by prescribed and linked displacements;
/// otherwise the equations are singular for any material. Parts are looked at one by one, or, where displacements are
/// linked, all together.
pub(super) fn check_rigid_motion(
    mesh: &Mesh,
    prescribed: &[Option<Prescribed<'_>>],
    dependents: &[Dependent<'_>],
) -> Result<(), ProblemError> {
    let parts: Vec<Part> = parts(mesh).into_iter().map(|(element, nodes)| Part::new(mesh, element, nodes)).collect();
    if dependents.is_empty() {
        return parts.chunks(1).try_for_each(|alone| check_together(mesh, alone, prescribed, &[]));
    }
    check_together(mesh, &parts, prescribed, dependents)
}

/// A connected part of the mesh.
struct Part {
    element: usize,
    nodes: Vec<usize>,
    centre: [f64; 3],
    extent: f64,
}

impl Part {
    fn new(mesh: &Mesh, element: usize, nodes: Vec<usize>) -> Self {
        let count = nodes.len() as f64;
        let centre = std::array::from_fn(|i| nodes.iter().map(|&node| mesh.nodes[node][i]).sum::<f64>() / count);
        let square = |node: &usize| (0..3).map(|i| (mesh.nodes[*node][i] - centre[i]).powi(2)).sum::<f64>();
        let extent = nodes.iter().map(square).fold(0.0, f64::max).sqrt();
        Self { element, nodes, centre, extent }
    }

    /// Displacement of a node along each axis, as a row over the rigid motions.
    fn motions(&self, mesh: &Mesh, node: usize) -> Vec<DVector<f64>> {
        let arm = std::array::from_fn(|i| (mesh.nodes[node][i] - self.centre[i]) / self.extent);
        rigid_motions(mesh.dimension, arm)
    }
}

fn check_together(
    mesh: &Mesh,
    parts: &[Part],
    prescribed: &[Option<Prescribed<'_>>],
    dependents: &[Dependent<'_>],
) -> Result<(), ProblemError> {
    let (words, dimension) = (motion_words(mesh.dimension), mesh.dimension.count());
    let size = words.len() * parts.len();
    let mut gram = DMatrix::zeros(size, size);
    let mut part_of = vec![None; if dependents.is_empty() { 0 } else { mesh.nodes.len() }];
    for (number, part) in parts.iter().enumerate() {
        let first = number * words.len();
        for &node in &part.nodes {
            part_of.get_mut(node).into_iter().for_each(|place| *place = Some(number));
            for (axis, motion) in part.motions(mesh, node).iter().enumerate() {
                if prescribed[dimension * node + axis].is_some() {
                    let mut block = gram.view_mut((first, first), (words.len(), words.len()));
                    block += motion * motion.transpose();
                }
            }
        }
    }
    for Dependent { dof, masters, .. } in dependents {
        let mut row = DVector::zeros(size);
        for (dof, coefficient) in
            std::iter::once((*dof, 1.0)).chain(masters.iter().map(|&(dof, share)| (dof, -share)))
        {
            let node = dof / dimension;
            if let Some(number) = part_of[node] {
                let motion = &parts[number].motions(mesh, node)[dof % dimension];
                let mut share = row.rows_mut(number * words.len(), words.len());
                share += coefficient * motion;
            }
        }
        gram += &row * row.transpose();
    }
    let eigen = SymmetricEigen::new(gram);
    let weakest = eigen.eigenvalues.imin();
    if eigen.eigenvalues[weakest] >= 1e-10 {
        return Ok(());
    }
    let free = eigen.eigenvectors.column(weakest);
    let part = free.iamax() / words.len();
    let shares = free.rows(part * words.len(), words.len());
    let involved: Vec<&str> =
        words.iter().zip(shares.iter()).filter(|(_, share)| share.abs() > 1e-6).map(|(word, _)| *word).collect();
    Err(ProblemError::RigidMotion { element: parts[part].element, motion: involved.join(" and ") })
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
