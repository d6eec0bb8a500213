//! Everything that can be wrong with a problem, found before the first evaluation.

use super::{Axis, Condition, Platen, Problem, ProblemError, Tolerances};
use crate::element::hourglass::HourglassControl;
use crate::mesh::{Dimension, Mesh, Side};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

impl Problem {
    /// Checks the mesh, every number, every set that a condition names, and that no part can move as a rigid body.
    ///
    /// # Errors
    /// The first defect found.
    pub fn validate(&self) -> Result<(), ProblemError> {
        self.mesh.validate()?;
        self.check_numbers()?;
        let single = self.mesh.kinds.iter().any(|kind| kind.needs_hourglass_control());
        if single && matches!(self.hourglass, HourglassControl::Viscous { .. }) {
            return Err(ProblemError::ViscousHourglass);
        }
        for condition in &self.conditions {
            match condition {
                Condition::Pressure { sides, .. } | Condition::Traction { sides, .. } => {
                    self.sides(sides)?;
                }
                Condition::BodyForce { elements, .. } => {
                    self.elements(elements)?;
                }
                Condition::Displacement { .. } | Condition::Platen { .. } => {}
            }
        }
        let prescribed = self.prescribed_displacements()?;
        check_rigid_motion(&self.mesh, &prescribed)
    }

    /// Value at load 1 of every prescribed displacement component, m, by degree of freedom; `None` where free.
    ///
    /// # Errors
    /// A node set that does not exist, z in the plane, or two different values for one component.
    pub fn prescribed_displacements(&self) -> Result<Vec<Option<f64>>, ProblemError> {
        let mut prescribed = vec![None; self.mesh.degrees_of_freedom()];
        for condition in &self.conditions {
            match condition {
                Condition::Displacement { nodes, axis, value } => {
                    self.prescribe(&mut prescribed, nodes, *axis, *value)?;
                }
                Condition::Platen { nodes, contact, axis, displacement } => {
                    self.prescribe(&mut prescribed, nodes, *axis, *displacement)?;
                    if *contact == Platen::Rough {
                        for along in self.axes().filter(|along| along != axis) {
                            self.prescribe(&mut prescribed, nodes, along, 0.0)?;
                        }
                    }
                }
                Condition::Pressure { .. } | Condition::Traction { .. } | Condition::BodyForce { .. } => {}
            }
        }
        Ok(prescribed)
    }

    /// The directions in which the body moves.
    fn axes(&self) -> impl Iterator<Item = Axis> + use<> {
        Axis::ALL.into_iter().take(self.mesh.dimension.count())
    }

    /// The named side set.
    ///
    /// # Errors
    /// [`ProblemError::UnknownSideSet`], naming what there is.
    pub fn sides(&self, name: &str) -> Result<&[Side], ProblemError> {
        self.mesh.side_sets.get(name).map(Vec::as_slice).ok_or_else(|| ProblemError::UnknownSideSet {
            name: name.to_owned(),
            available: names(self.mesh.side_sets.keys()),
        })
    }

    /// The named element set.
    ///
    /// # Errors
    /// [`ProblemError::UnknownElementSet`], naming what there is.
    pub fn elements(&self, name: &str) -> Result<&[usize], ProblemError> {
        self.mesh.element_sets.get(name).map(Vec::as_slice).ok_or_else(|| ProblemError::UnknownElementSet {
            name: name.to_owned(),
            available: names(self.mesh.element_sets.keys()),
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
        let dimension = self.mesh.dimension.count();
        if axis.index() >= dimension {
            return Err(ProblemError::NoThirdAxis);
        }
        for &node in nodes {
            match prescribed[dimension * node + axis.index()].replace(value) {
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
        let coefficient = self.hourglass.coefficient();
        checks.push(("hourglass_coefficient", coefficient, "above 0", coefficient > 0.0));
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
                Condition::BodyForce { value, .. } => {
                    checks.extend(value.map(|value| ("body_force", value, "a finite number", true)));
                }
            }
        }
        self.check_third_axis()?;
        match checks.into_iter().find(|(_, value, _, sound)| !(*sound && value.is_finite())) {
            Some((what, value, requirement, _)) => Err(ProblemError::Number { what, requirement, value }),
            None => Ok(()),
        }
    }

    fn check_third_axis(&self) -> Result<(), ProblemError> {
        let acts_along_z = |condition: &Condition| match condition {
            Condition::Traction { value, .. } | Condition::BodyForce { value, .. } => value[2] != 0.0,
            _ => false,
        };
        if self.mesh.dimension == Dimension::Plane && self.conditions.iter().any(acts_along_z) {
            return Err(ProblemError::NoThirdAxis);
        }
        Ok(())
    }
}

fn names<'a>(keys: impl Iterator<Item = &'a String>) -> String {
    keys.map(String::as_str).collect::<Vec<_>>().join(", ")
}

/// Every connected part must have its translations and rotations suppressed by prescribed displacements; otherwise
/// the equations are singular for any material.
fn check_rigid_motion(mesh: &Mesh, prescribed: &[Option<f64>]) -> Result<(), ProblemError> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementKind;
    use crate::mesh::block::Block;

    fn problem(conditions: Vec<Condition>) -> Problem {
        let mesh = Block::plane([1.0, 2.0], [2, 2], ElementKind::Q4).mesh().unwrap();
        Problem::new(mesh, conditions)
    }

    fn supported() -> Vec<Condition> {
        vec![
            Condition::fixed("bottom_left", Axis::X),
            Condition::Platen { nodes: "bottom".into(), contact: Platen::Smooth, axis: Axis::Y, displacement: 0.0 },
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
        let corners = [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 1.0, 0.0], [5.0, 1.0, 0.0]];
        problem.mesh.nodes.extend(corners);
        problem.mesh.kinds.push(ElementKind::Q4);
        problem.mesh.elements.push((first..first + 4).collect());
        assert!(matches!(problem.validate(), Err(ProblemError::RigidMotion { element: 4, .. })));
    }

    #[test]
    fn missing_sets_contradictions_and_bad_numbers_are_refused() {
        let pressure = Condition::Pressure { sides: "lid".into(), value: 1.0, kind: Default::default() };
        let error = problem([supported(), vec![pressure]].concat()).validate().unwrap_err();
        assert_eq!(error.to_string(), "no side set 'lid'; the mesh has: bottom, left, right, top");
        let moved = Condition::Displacement { nodes: "bottom".into(), axis: Axis::Y, value: 0.1 };
        let error = problem([supported(), vec![moved]].concat()).validate().unwrap_err();
        assert!(matches!(error, ProblemError::Contradiction { node: 0, axis: Axis::Y, .. }));
        let mut bad = problem(supported());
        bad.control.cut = f64::NAN;
        assert!(matches!(bad.validate(), Err(ProblemError::Number { what: "cut", .. })));
        let bad = problem(
            [supported(), vec![Condition::Traction { sides: "top".into(), value: [0.0, f64::NAN, 0.0] }]].concat(),
        );
        assert!(matches!(bad.validate(), Err(ProblemError::Number { what: "traction", .. })));
    }

    #[test]
    fn a_solid_needs_six_supports_and_the_plane_has_no_third_axis() {
        let mesh = Block::space([1.0, 2.0, 1.0], [1, 2, 1], ElementKind::H8).mesh().unwrap();
        let bottom = Condition::fixed("bottom", Axis::Y);
        let held = |more: &[(&str, Axis)]| {
            let more = more.iter().map(|(set, axis)| Condition::fixed(*set, *axis));
            Problem::new(mesh.clone(), std::iter::once(bottom.clone()).chain(more).collect()).validate()
        };
        held(&[("left", Axis::X), ("back", Axis::Z)]).unwrap();
        match held(&[("bottom_left_back", Axis::X), ("bottom_left_back", Axis::Z)]) {
            Err(ProblemError::RigidMotion { motion, .. }) => assert!(motion.contains("rotate about y"), "{motion}"),
            other => panic!("{other:?}"),
        }
        let lifted = problem([supported(), vec![Condition::fixed("left", Axis::Z)]].concat());
        assert_eq!(lifted.validate(), Err(ProblemError::NoThirdAxis));
        let pulled = Condition::Traction { sides: "top".into(), value: [0.0, 0.0, 1.0] };
        assert_eq!(problem([supported(), vec![pulled]].concat()).validate(), Err(ProblemError::NoThirdAxis));
    }
}
