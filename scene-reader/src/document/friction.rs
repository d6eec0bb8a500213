//! Coefficients of friction that are probably angles.

use keys::{Node, Value};
use std::ops::Range;

/// Coefficient of friction, of 72 degrees, above which an angle was probably given.
const LARGEST: f64 = 3.0;

/// Remarks on the tables `contact` of a document, wherever they stand, each with the place of its coefficient.
pub(super) fn remarks(node: &Node) -> Vec<(Range<usize>, String)> {
    match &node.value {
        Value::Table(members) => members
            .iter()
            .flat_map(|(key, member)| {
                let friction = member.node.get("friction").filter(|_| key == "contact");
                let angle = friction.filter(|friction| friction.number().is_some_and(|value| value > LARGEST));
                let own = angle.map(|angle| {
                    let value = angle.number().unwrap_or_default();
                    let text = format!(
                        "contact.friction = {value} is the coefficient of friction, the tangent of the angle, not the angle"
                    );
                    (angle.span.clone(), text)
                });
                own.into_iter().chain(remarks(&member.node))
            })
            .collect(),
        Value::List(entries) => entries.iter().flat_map(remarks).collect(),
        Value::Nothing
        | Value::Boolean(_)
        | Value::Integer(_)
        | Value::Number(_)
        | Value::Text(_)
        | Value::Date(_) => Vec::new(),
    }
}
