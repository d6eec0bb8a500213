//! Multi-point constraints as linear equations between displacements.

use super::{
    Amplitude, Applied, Axis, Condition, ConstraintTerm, Directions, MultiPointConstraint, Problem, ProblemError,
    Stage,
};
use crate::element::side::{area_vector, side_shapes};
use std::collections::BTreeMap;

/// A linear equation between changes of displacements since the beginning of a stage.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Equation<'a> {
    /// Degree of freedom and coefficient.
    pub(crate) terms: Vec<(usize, f64)>,
    /// Unknowns that belong to no node, by number, and coefficients.
    pub(crate) auxiliary: Vec<(usize, f64)>,
    /// Right-hand side at factor 1, m.
    pub(crate) value: f64,
    /// Factor over the stage.
    pub(crate) history: &'a Amplitude,
    /// Number of its condition in the stage.
    pub(crate) condition: usize,
}

/// Extent of a set along the normal of its platen, over its widest, that is rounding.
const ROUNDING: f64 = 1e-9;

impl Problem {
    /// The equations of all links of a stage, which begins with the nodes at `positions`, m.
    ///
    /// # Errors
    /// A node set that does not exist, z in the plane, or periodic sets that are not images of each other.
    pub(crate) fn equations<'a>(
        &self,
        stage: &'a Stage,
        positions: &[[f64; 3]],
    ) -> Result<Vec<Equation<'a>>, ProblemError> {
        let mut writer = Writer { problem: self, positions, auxiliaries: 0, equations: Vec::new(), condition: 0 };
        for (number, Applied { condition, history, .. }) in stage.conditions.iter().enumerate() {
            let Condition::MultiPointConstraint(link) = condition else { continue };
            writer.condition = number;
            writer.write(link, history).map_err(|error| error.of_condition(number))?;
        }
        Ok(writer.equations)
    }
}

/// Writes equations down.
struct Writer<'a, 'b> {
    problem: &'b Problem,
    positions: &'b [[f64; 3]],
    auxiliaries: usize,
    equations: Vec<Equation<'a>>,
    /// Number of the condition whose equations are written.
    condition: usize,
}

/// A prescribed number, or the unknown that stands for it.
#[derive(Clone, Copy)]
enum Part {
    Known(f64),
    Unknown(usize),
}

impl<'a> Writer<'a, '_> {
    fn dimension(&self) -> usize {
        self.problem.mesh.dimension.count()
    }

    fn part(&mut self, given: Option<f64>) -> Part {
        given.map_or_else(
            || {
                self.auxiliaries += 1;
                Part::Unknown(self.auxiliaries - 1)
            },
            Part::Known,
        )
    }

    fn write(&mut self, link: &'a MultiPointConstraint, history: &'a Amplitude) -> Result<(), ProblemError> {
        match link {
            MultiPointConstraint::RigidBody { nodes, displacement, rotation } => {
                self.rigid_body(nodes, *displacement, *rotation, history)
            }
            MultiPointConstraint::TiltingPlaten { nodes, axis, displacement, rotation } => {
                self.tilting_platen(nodes, *axis, *displacement, *rotation, history)
            }
            MultiPointConstraint::Guided { along, displacement } => self.guided(along, *displacement, history),
            MultiPointConstraint::Periodic { from, to, jump } => self.periodic(from, to, *jump, history),
            MultiPointConstraint::Sum { terms, value } => self.sum(terms, *value, history),
        }
    }

    /// `u_dof = sum of coefficient x part`.
    fn equate(&mut self, dof: usize, parts: &[(Part, f64)], history: &'a Amplitude) {
        let mut equation = Equation {
            terms: vec![(dof, 1.0)],
            auxiliary: Vec::new(),
            value: 0.0,
            history,
            condition: self.condition,
        };
        for &(part, coefficient) in parts.iter().filter(|(_, coefficient)| *coefficient != 0.0) {
            match part {
                Part::Known(value) => equation.value += coefficient * value,
                Part::Unknown(number) => equation.auxiliary.push((number, -coefficient)),
            }
        }
        self.equations.push(equation);
    }

    /// Extent of a set along the axes, m.
    fn extents(&self, nodes: &[usize]) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let along = nodes.iter().map(|&node| self.positions[node][axis]);
            along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
        })
    }

    /// Middle of the extent of a set: unlike the mean of its nodes, it does not depend on how finely a mesh is divided where.
    fn middle(&self, nodes: &[usize]) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let along = nodes.iter().map(|&node| self.positions[node][axis]);
            0.5 * (along.clone().fold(f64::INFINITY, f64::min) + along.fold(f64::NEG_INFINITY, f64::max))
        })
    }

    fn rigid_body(
        &mut self,
        set: &str,
        displacement: [Option<f64>; 3],
        rotation: [Option<f64>; 3],
        history: &'a Amplitude,
    ) -> Result<(), ProblemError> {
        let dimension = self.dimension();
        let out_of_plane =
            [displacement[2], rotation[0], rotation[1]].into_iter().flatten().any(|value| value != 0.0);
        if dimension == 2 && out_of_plane {
            return Err(ProblemError::NoThirdAxis);
        }
        let nodes = self.problem.nodes(set)?.to_vec();
        let middle = self.middle(&nodes);
        let moved = displacement.map(|given| self.part(given));
        let turned = rotation.map(|given| self.part(given));
        for node in nodes {
            let [x, y, z]: [f64; 3] = std::array::from_fn(|axis| self.positions[node][axis] - middle[axis]);
            // u = U + theta x r; in the plane only the rotation about the third axis counts.
            let solid = f64::from(u8::from(dimension == 3));
            let rows = [
                [(moved[0], 1.0), (turned[1], solid * z), (turned[2], -y)],
                [(moved[1], 1.0), (turned[2], x), (turned[0], -solid * z)],
                [(moved[2], 1.0), (turned[0], y), (turned[1], -x)],
            ];
            for (axis, row) in rows.iter().enumerate().take(dimension) {
                self.equate(dimension * node + axis, row, history);
            }
        }
        Ok(())
    }

    fn tilting_platen(
        &mut self,
        set: &str,
        normal: Axis,
        displacement: Option<f64>,
        rotation: [Option<f64>; 3],
        history: &'a Amplitude,
    ) -> Result<(), ProblemError> {
        let dimension = self.dimension();
        if normal.index() >= dimension {
            return Err(ProblemError::NoThirdAxis);
        }
        if rotation[normal.index()].is_some() {
            return Err(ProblemError::MultiPointConstraint {
                reason: "a smooth platen is turned about its normal, which moves nothing",
                remedy: "leave that component of its rotation out",
            });
        }
        if dimension == 2 && rotation[..2].iter().any(Option::is_some) {
            return Err(ProblemError::NoThirdAxis);
        }
        let nodes = self.problem.nodes(set)?.to_vec();
        let extents = self.extents(&nodes);
        let [thinnest, widest] =
            [f64::min, f64::max].map(|of| extents[1..dimension].iter().copied().fold(extents[0], of));
        if extents[normal.index()] > thinnest + ROUNDING * widest {
            return Err(ProblemError::MultiPointConstraint {
                reason: "the set of a platen is wider along its normal than across it",
                remedy: "name the axis across the face as `normal`, or another set",
            });
        }
        let middle = self.middle(&nodes);
        let moved = self.part(displacement);
        // u_n = U_n + (theta x r)_n: along each axis of the platen the rotation about the other one, right-handed.
        let about = |axis: usize| {
            let third = 3 - normal.index() - axis;
            (third, if (axis + 1) % 3 == normal.index() { 1.0 } else { -1.0 })
        };
        let along = (0..dimension).filter(|&axis| axis != normal.index());
        let tilts: Vec<(usize, Part)> = along
            .map(|axis| {
                let (third, sign) = about(axis);
                (axis, self.part(rotation[third].map(|angle| sign * angle)))
            })
            .collect();
        for node in nodes {
            let mut parts = vec![(moved, 1.0)];
            parts.extend(tilts.iter().map(|&(axis, tilt)| (tilt, self.positions[node][axis] - middle[axis])));
            self.equate(dimension * node + normal.index(), &parts, history);
        }
        Ok(())
    }

    fn guided(&mut self, along: &Directions, displacement: f64, history: &'a Amplitude) -> Result<(), ProblemError> {
        let dimension = self.dimension();
        for (node, direction) in self.directions(along)? {
            let length = direction.iter().map(|part| part * part).sum::<f64>().sqrt();
            if length == 0.0 || !length.is_finite() {
                return Err(ProblemError::NoDirection { node, place: self.positions[node] });
            }
            let terms = (0..dimension)
                .map(|axis| (dimension * node + axis, direction[axis] / length))
                .filter(|(_, share)| share.abs() > 1e-14);
            let terms = terms.collect();
            let condition = self.condition;
            self.equations.push(Equation { terms, auxiliary: Vec::new(), value: displacement, history, condition });
        }
        Ok(())
    }

    /// Nodes and their directions, of any length, ascending.
    fn directions(&self, along: &Directions) -> Result<BTreeMap<usize, [f64; 3]>, ProblemError> {
        let mut found: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
        match along {
            Directions::Normal { sides } => {
                let mesh = &self.problem.mesh;
                for &side in self.problem.sides(sides)? {
                    let nodes = mesh.side_nodes(side);
                    for shape in side_shapes(mesh.kinds[side.element].side_kind()) {
                        let area = area_vector(shape, &nodes, self.positions) * shape.weight;
                        for (&node, share) in nodes.iter().zip(&shape.values) {
                            let sum = found.entry(node).or_default();
                            // Shares of corners of quadratic sides have both signs; no side counts against its own normal.
                            (0..3).for_each(|axis| sum[axis] += share.abs() * area[axis]);
                        }
                    }
                }
            }
            Directions::Radial { nodes, centre } => {
                for &node in self.problem.nodes(nodes)? {
                    let [x, y, _] = self.positions[node];
                    found.insert(node, [x - centre[0], y - centre[1], 0.0]);
                }
            }
        }
        Ok(found)
    }

    fn periodic(
        &mut self,
        from: &str,
        to: &str,
        jump: [Option<f64>; 3],
        history: &'a Amplitude,
    ) -> Result<(), ProblemError> {
        let dimension = self.dimension();
        if dimension == 2 && jump[2].is_some_and(|value| value != 0.0) {
            return Err(ProblemError::NoThirdAxis);
        }
        let parts = jump.map(|given| self.part(given));
        for [first, second] in self.problem.pairs(from, to)? {
            for (axis, part) in parts.iter().enumerate().take(dimension) {
                self.equate(dimension * second + axis, &[(*part, 1.0)], history);
                let equation = self.equations.last_mut().expect("just written");
                equation.terms.push((dimension * first + axis, -1.0));
            }
        }
        Ok(())
    }

    fn sum(&mut self, terms: &[ConstraintTerm], value: f64, history: &'a Amplitude) -> Result<(), ProblemError> {
        let condition = self.condition;
        let mut equation = Equation { terms: Vec::new(), auxiliary: Vec::new(), value, history, condition };
        for term in terms {
            if term.axis.index() >= self.dimension() {
                return Err(ProblemError::NoThirdAxis);
            }
            let nodes = self.problem.nodes(&term.nodes)?;
            let share = term.coefficient / nodes.len() as f64;
            equation.terms.extend(nodes.iter().map(|node| (self.dimension() * node + term.axis.index(), share)));
        }
        if terms.iter().all(|term| term.coefficient == 0.0) {
            return Err(ProblemError::MultiPointConstraint {
                reason: "a sum without terms, or with coefficients of zero only, ties nothing",
                remedy: "give it terms, or remove it",
            });
        }
        self.equations.push(equation);
        Ok(())
    }
}

impl Problem {
    /// Translations under which the body repeats in a stage, m: those from one periodic face to the other, in the initial
    /// configuration, each once.
    ///
    /// # Errors
    /// A node set that does not exist.
    pub(crate) fn periods(&self, stage: &Stage) -> Result<Vec<[f64; 3]>, ProblemError> {
        let mut periods: Vec<[f64; 3]> = Vec::new();
        for Applied { condition, .. } in &stage.conditions {
            let Condition::MultiPointConstraint(MultiPointConstraint::Periodic { from, to, .. }) = condition else {
                continue;
            };
            let offset = self.offset(self.nodes(from)?, self.nodes(to)?);
            let size = offset.iter().map(|part| part * part).sum::<f64>().sqrt();
            let is_known = |known: &[f64; 3]| {
                let apart = |sign: f64| (0..3).all(|i| (known[i] - sign * offset[i]).abs() <= LARGEST_MISFIT * size);
                apart(1.0) || apart(-1.0)
            };
            if !periods.iter().any(is_known) {
                periods.push(offset);
            }
        }
        Ok(periods)
    }

    /// From the middle of one set of nodes to that of another, m.
    fn offset(&self, first: &[usize], second: &[usize]) -> [f64; 3] {
        let mean = |nodes: &[usize], axis: usize| {
            nodes.iter().map(|&node| self.mesh.nodes[node][axis]).sum::<f64>() / nodes.len() as f64
        };
        std::array::from_fn(|axis| mean(second, axis) - mean(first, axis))
    }
}

/// Largest distance between a node and the image of its partner, over the extent of the sets.
const LARGEST_MISFIT: f64 = 1e-6;

impl Problem {
    /// Nodes of one set with their images in another, by initial positions.
    fn pairs(&self, from: &str, to: &str) -> Result<Vec<[usize; 2]>, ProblemError> {
        let (first, second) = (self.nodes(from)?, self.nodes(to)?);
        let misfit = |node: usize| ProblemError::NoImage { node, from: from.to_owned(), to: to.to_owned() };
        let Some(&any) = first.first() else { return Ok(Vec::new()) };
        if first.len() != second.len() {
            return Err(misfit(any));
        }
        let offset = self.offset(first, second);
        let distance =
            |one: [f64; 3], other: [f64; 3]| (0..3).map(|i| (one[i] - other[i]).powi(2)).sum::<f64>().sqrt();
        let size = distance(offset, [0.0; 3]);
        if size == 0.0 {
            return Err(ProblemError::MultiPointConstraint {
                reason: "periodic sets lie in the same place, so that nodes are to move as themselves",
                remedy: "name two opposite sides in from and to",
            });
        }
        let mut pairs = Vec::with_capacity(first.len());
        for &node in first {
            let image: [f64; 3] = std::array::from_fn(|axis| self.mesh.nodes[node][axis] + offset[axis]);
            let nearest = second.iter().min_by(|one, other| {
                distance(self.mesh.nodes[**one], image).total_cmp(&distance(self.mesh.nodes[**other], image))
            });
            match nearest {
                Some(&found) if distance(self.mesh.nodes[found], image) <= LARGEST_MISFIT * size => {
                    pairs.push([node, found]);
                }
                _ => return Err(misfit(node)),
            }
        }
        Ok(pairs)
    }
}
