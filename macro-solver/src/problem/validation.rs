//! Everything that can be wrong with a problem, found before the first evaluation.

use super::{Axis, Condition, Platen, Problem, ProblemError, Tolerances};
use crate::mesh::{Edge, Mesh};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

impl Problem {
    /// Checks the mesh, every number, every set that a condition names, and that no part can move as a rigid body.
    ///
    /// # Errors
    /// The first defect found.
    pub fn validate(&self) -> Result<(), ProblemError> {
        self.mesh.validate()?;
        self.check_numbers()?;
        for condition in &self.conditions {
            if let Condition::Pressure { edges, .. } | Condition::Traction { edges, .. } = condition {
                self.edges(edges)?;
            }
        }
        let prescribed = self.prescribed_displacements()?;
        check_rigid_motion(&self.mesh, &prescribed)
    }

    /// Value at load 1 of every prescribed displacement component, m, by `2 * node + axis`; `None` where free.
    ///
    /// # Errors
    /// A node set that does not exist, or two different values for one component.
    pub fn prescribed_displacements(&self) -> Result<Vec<Option<f64>>, ProblemError> {
        let mut prescribed = vec![None; 2 * self.mesh.nodes.len()];
        for condition in &self.conditions {
            match condition {
                Condition::Displacement { nodes, axis, value } => {
                    self.prescribe(&mut prescribed, nodes, *axis, *value)?;
                }
                Condition::Platen { nodes, contact, displacement } => {
                    self.prescribe(&mut prescribed, nodes, Axis::Y, *displacement)?;
                    if *contact == Platen::Rough {
                        self.prescribe(&mut prescribed, nodes, Axis::X, 0.0)?;
                    }
                }
                Condition::Pressure { .. } | Condition::Traction { .. } => {}
            }
        }
        Ok(prescribed)
    }

    /// The named edge set.
    ///
    /// # Errors
    /// [`ProblemError::UnknownEdgeSet`], naming what there is.
    pub fn edges(&self, name: &str) -> Result<&[Edge], ProblemError> {
        self.mesh.edge_sets.get(name).map(Vec::as_slice).ok_or_else(|| ProblemError::UnknownEdgeSet {
            name: name.to_owned(),
            available: names(self.mesh.edge_sets.keys()),
        })
    }

    fn prescribe(
        &self,
        prescribed: &mut [Option<f64>],
        set: &str,
        axis: Axis,
        value: f64,
    ) -> Result<(), ProblemError> {
        let nodes = self.mesh.node_sets.get(set).ok_or_else(|| ProblemError::UnknownNodeSet {
            name: set.to_owned(),
            available: names(self.mesh.node_sets.keys()),
        })?;
        for &node in nodes {
            match prescribed[2 * node + axis.index()].replace(value) {
                Some(first) if first != value => {
                    return Err(ProblemError::Contradiction { node, axis, first, second: value });
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<(), ProblemError> {
        let Tolerances { force, displacement } = self.tolerances;
        let (control, strategy) = (&self.control, &self.strategy);
        let base = 1.0 / control.increments as f64;
        let mut checks = vec![
            ("increments", control.increments as f64, "at least 1", control.increments >= 1),
            ("min", control.min, "above 0 and at most 1 / increments", control.min > 0.0 && control.min <= base),
            ("growth", control.growth, "at least 1", control.growth >= 1.0),
            ("cut", control.cut, "between 0 and 1", control.cut > 0.0 && control.cut < 1.0),
            ("max_iterations", control.max_iterations as f64, "at least 1", control.max_iterations >= 1),
            ("force tolerance", force, "above 0", force > 0.0),
            ("displacement tolerance", displacement, "above 0", displacement > 0.0),
            ("capped_change", strategy.capped_change, "above 0", strategy.capped_change > 0.0),
            ("strain_per_step", self.strain_per_step, "at least 0", self.strain_per_step >= 0.0),
        ];
        if let Some(floor) = strategy.tangent_floor {
            checks.push(("tangent_floor", floor, "between 0 and 1", (0.0..1.0).contains(&floor)));
        }
        if let Some(gates) = strategy.secant {
            checks.push(("secant min_change", gates.min_change, "at least 0", gates.min_change >= 0.0));
            checks.push(("secant max_ratio", gates.max_ratio, "above 0", gates.max_ratio > 0.0));
            checks.push(("secant floor", gates.floor, "at least 0", gates.floor >= 0.0));
        }
        for condition in &self.conditions {
            match condition {
                Condition::Displacement { value, .. } => {
                    checks.push(("displacement", *value, "a finite number", true))
                }
                Condition::Platen { displacement, .. } => {
                    checks.push(("platen displacement", *displacement, "a finite number", true));
                }
                Condition::Pressure { value, .. } => checks.push(("pressure", *value, "a finite number", true)),
                Condition::Traction { value, .. } => {
                    checks.extend(value.map(|value| ("traction", value, "a finite number", true)));
                }
            }
        }
        match checks.into_iter().find(|(_, value, _, sound)| !(*sound && value.is_finite())) {
            Some((what, value, requirement, _)) => Err(ProblemError::Number { what, requirement, value }),
            None => Ok(()),
        }
    }
}

fn names<'a>(keys: impl Iterator<Item = &'a String>) -> String {
    keys.map(String::as_str).collect::<Vec<_>>().join(", ")
}

/// Every connected part must have its two translations and its rotation suppressed by prescribed displacements;
/// otherwise the equations are singular for any material.
fn check_rigid_motion(mesh: &Mesh, prescribed: &[Option<f64>]) -> Result<(), ProblemError> {
    for (element, nodes) in parts(mesh) {
        let count = nodes.len() as f64;
        let centre = [0, 1].map(|i| nodes.iter().map(|&node| mesh.nodes[node][i]).sum::<f64>() / count);
        let extent = nodes
            .iter()
            .map(|&node| (mesh.nodes[node][0] - centre[0]).hypot(mesh.nodes[node][1] - centre[1]))
            .fold(0.0, f64::max);
        let mut gram = Matrix3::zeros();
        for &node in &nodes {
            let arm = [0, 1].map(|i| (mesh.nodes[node][i] - centre[i]) / extent);
            let motions = [Vector3::new(1.0, 0.0, -arm[1]), Vector3::new(0.0, 1.0, arm[0])];
            for (axis, motion) in motions.iter().enumerate() {
                if prescribed[2 * node + axis].is_some() {
                    gram += motion * motion.transpose();
                }
            }
        }
        let eigen = SymmetricEigen::new(gram);
        let weakest = eigen.eigenvalues.imin();
        if eigen.eigenvalues[weakest] < 1e-10 {
            return Err(ProblemError::RigidMotion {
                element,
                motion: describe(&eigen.eigenvectors.column(weakest).into()),
            });
        }
    }
    Ok(())
}

fn describe(motion: &Vector3<f64>) -> String {
    let words = ["move along x", "move along y", "rotate"];
    let involved: Vec<&str> =
        words.iter().zip(motion.iter()).filter(|(_, share)| share.abs() > 1e-6).map(|(word, _)| *word).collect();
    involved.join(" and ")
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementKind;
    use crate::mesh::block::Block;

    fn problem(conditions: Vec<Condition>) -> Problem {
        let mesh = Block { width: 1.0, height: 2.0, columns: 2, rows: 2, kind: ElementKind::Q4 }.mesh().unwrap();
        Problem::new(mesh, conditions)
    }

    fn supported() -> Vec<Condition> {
        vec![
            Condition::fixed("bottom_left", Axis::X),
            Condition::Platen { nodes: "bottom".into(), contact: Platen::Smooth, displacement: 0.0 },
        ]
    }

    #[test]
    fn free_rigid_motions_are_named() {
        problem(supported()).validate().unwrap();
        let motion = |conditions| match problem(conditions).validate() {
            Err(ProblemError::RigidMotion { element: 0, motion }) => motion,
            other => panic!("{other:?}"),
        };
        assert_eq!(motion(vec![supported().remove(1)]), "move along x");
        let pinned = vec![Condition::fixed("bottom_left", Axis::X), Condition::fixed("bottom_left", Axis::Y)];
        assert!(motion(pinned).contains("rotate"));
        assert_eq!(motion(vec![Condition::fixed("left", Axis::X)]), "move along y");
    }

    #[test]
    fn a_loose_second_part_is_found() {
        let mut problem = problem(supported());
        let first = problem.mesh.nodes.len();
        problem.mesh.nodes.extend([[5.0, 0.0], [6.0, 0.0], [6.0, 1.0], [5.0, 1.0]]);
        problem.mesh.elements.push((first..first + 4).collect());
        assert!(matches!(problem.validate(), Err(ProblemError::RigidMotion { element: 4, .. })));
    }

    #[test]
    fn missing_sets_contradictions_and_bad_numbers_are_refused() {
        let pressure = Condition::Pressure { edges: "lid".into(), value: 1.0, kind: Default::default() };
        let error = problem([supported(), vec![pressure]].concat()).validate().unwrap_err();
        assert_eq!(error.to_string(), "no edge set 'lid'; the mesh has: bottom, left, right, top");
        let moved = Condition::Displacement { nodes: "bottom".into(), axis: Axis::Y, value: 0.1 };
        let error = problem([supported(), vec![moved]].concat()).validate().unwrap_err();
        assert!(matches!(error, ProblemError::Contradiction { node: 0, axis: Axis::Y, .. }));
        let mut bad = problem(supported());
        bad.control.cut = f64::NAN;
        assert!(matches!(bad.validate(), Err(ProblemError::Number { what: "cut", .. })));
        let bad = problem(
            [supported(), vec![Condition::Traction { edges: "top".into(), value: [0.0, f64::NAN] }]].concat(),
        );
        assert!(matches!(bad.validate(), Err(ProblemError::Number { what: "traction", .. })));
    }
}
