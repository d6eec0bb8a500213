//! Displacements that the conditions of a stage prescribe, by degree of freedom.

use super::{Amplitude, Applied, Axis, Condition, Origin, Platen, Problem, ProblemError, Stage};

/// A prescribed displacement component of one node over a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prescribed<'a> {
    /// Displacement at factor 1, m.
    pub value: f64,
    /// Where it counts from.
    pub origin: Origin,
    /// Factor over the stage.
    pub history: &'a Amplitude,
}

impl Prescribed<'_> {
    /// Whether the node stays where it is.
    fn holds(&self) -> bool {
        self.value == 0.0 && self.origin == Origin::Stage
    }

    fn agrees(&self, other: &Self) -> bool {
        self == other || (self.holds() && other.holds())
    }
}

impl Problem {
    /// Every prescribed displacement component of a stage by degree of freedom; `None` where free.
    ///
    /// # Errors
    /// A node set that does not exist, z in the plane, or two different values for one component.
    pub fn prescribed_displacements<'a>(
        &self,
        stage: &'a Stage,
    ) -> Result<Vec<Option<Prescribed<'a>>>, ProblemError> {
        let mut prescribed = vec![None; self.mesh.degrees_of_freedom()];
        for (number, applied) in stage.conditions.iter().enumerate() {
            self.prescribe_condition(stage, &mut prescribed, applied).map_err(|error| error.of_condition(number))?;
        }
        Ok(prescribed)
    }

    fn prescribe_condition<'a>(
        &self,
        stage: &Stage,
        prescribed: &mut [Option<Prescribed<'a>>],
        applied: &'a Applied,
    ) -> Result<(), ProblemError> {
        let given = |value| Prescribed { value, origin: applied.origin, history: &applied.history };
        match &applied.condition {
            Condition::Displacement { nodes, axis, value } => {
                self.prescribe(stage, prescribed, nodes, *axis, given(*value))
            }
            Condition::Platen { nodes, contact, axis, displacement } => {
                self.prescribe(stage, prescribed, nodes, *axis, given(*displacement))?;
                if *contact == Platen::Rough {
                    let held = Prescribed { origin: Origin::Stage, ..given(0.0) };
                    for along in self.axes().filter(|along| along != axis) {
                        self.prescribe(stage, prescribed, nodes, along, held)?;
                    }
                }
                Ok(())
            }
            Condition::Pressure { .. }
            | Condition::Traction { .. }
            | Condition::BodyForce { .. }
            | Condition::Friction { .. }
            | Condition::MultiPointConstraint(_) => Ok(()),
        }
    }

    /// The directions in which the body moves.
    fn axes(&self) -> impl Iterator<Item = Axis> + use<> {
        Axis::ALL.into_iter().take(self.mesh.dimension.count())
    }

    fn prescribe<'a>(
        &self,
        stage: &Stage,
        prescribed: &mut [Option<Prescribed<'a>>],
        set: &str,
        axis: Axis,
        given: Prescribed<'a>,
    ) -> Result<(), ProblemError> {
        let nodes = self.nodes(set)?;
        let dimension = self.mesh.dimension.count();
        if axis.index() >= dimension {
            return Err(ProblemError::NoThirdAxis);
        }
        for &node in nodes {
            match prescribed[dimension * node + axis.index()].replace(given) {
                Some(first) if !first.agrees(&given) => {
                    let (first, second) = (first.value, given.value);
                    return Err(ProblemError::Contradiction {
                        node,
                        axis,
                        first,
                        second,
                        place: self.mesh.nodes[node],
                        first_set: self.first_to_prescribe(stage, node, axis).to_owned(),
                        second_set: set.to_owned(),
                    });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Node set of the first condition that prescribes a displacement of a node.
    fn first_to_prescribe<'a>(&self, stage: &'a Stage, node: usize, axis: Axis) -> &'a str {
        let holds = |set: &str| self.mesh.node_sets.get(set).is_some_and(|nodes| nodes.contains(&node));
        let prescribing = stage.conditions.iter().find_map(|applied| match &applied.condition {
            Condition::Displacement { nodes, axis: along, .. } => (*along == axis && holds(nodes)).then_some(nodes),
            Condition::Platen { nodes, contact, axis: along, .. } => {
                ((*along == axis || *contact == Platen::Rough) && holds(nodes)).then_some(nodes)
            }
            Condition::Pressure { .. }
            | Condition::Traction { .. }
            | Condition::BodyForce { .. }
            | Condition::MultiPointConstraint(_)
            | Condition::Friction { .. } => None,
        });
        prescribing.map_or("", String::as_str)
    }
}
