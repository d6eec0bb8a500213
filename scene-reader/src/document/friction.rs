//! Coefficients of friction that are probably angles.

use keys::{Node, Value};
use std::ops::Range;

/// Coefficient of friction, of 72 degrees, above which an angle was probably given.
const LARGEST: f64 = 3.0;

/// Remarks on the numbers called `friction` in a document, wherever they stand (contact law, walls, stages), each with the place of its coefficient.
pub(super) fn remarks(node: &Node) -> Vec<(Range<usize>, String)> {
    below(node, "")
}

fn below(node: &Node, table: &str) -> Vec<(Range<usize>, String)> {
    match &node.value {
        Value::Table(members) => members
            .iter()
            .flat_map(|(key, member)| {
                let entries = match &member.node.value {
                    Value::List(entries) => &entries[..],
                    _ => std::slice::from_ref(&member.node),
                };
                let is_angle = |node: &&Node| key == "friction" && node.number().is_some_and(|value| value > LARGEST);
                let angles = entries.iter().filter(is_angle);
                let own = angles.map(|node| (node.span.clone(), remark(table, node.number().unwrap_or_default())));
                own.chain(below(&member.node, key)).collect::<Vec<_>>()
            })
            .collect(),
        Value::List(entries) => entries.iter().flat_map(|entry| below(entry, table)).collect(),
        Value::Nothing
        | Value::Boolean(_)
        | Value::Integer(_)
        | Value::Number(_)
        | Value::Text(_)
        | Value::Date(_) => Vec::new(),
    }
}

fn remark(table: &str, value: f64) -> String {
    let key = if table.is_empty() { "friction".to_owned() } else { format!("{table}.friction") };
    format!("{key} = {value} is the coefficient of friction, the tangent of the angle, not the angle")
}

#[cfg(test)]
mod tests {
    use super::*;
    use toml::de::DeTable;

    #[test]
    fn angles_are_noted_in_every_table() {
        let text = "[contact]\nfriction = 30\n[walls]\nfriction = 25.0\n[[stage]]\nfriction = 2.5\n[[stage]]\nfriction = 3.5\n\
                    [recipe]\ntarget = { friction = [0.0, 45.0] }\n";
        let found = remarks(&Node::from(&DeTable::parse(text).unwrap()));
        let texts: Vec<&str> =
            found.iter().map(|(_, remark)| remark.split(" is the").next().unwrap_or_default()).collect();
        assert_eq!(
            texts,
            ["contact.friction = 30", "target.friction = 45", "stage.friction = 3.5", "walls.friction = 25"]
        );
        assert!(found.iter().all(|(span, _)| text[span.clone()].parse::<f64>().is_ok()));
    }
}
