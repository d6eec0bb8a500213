//! `[[probe]]` tables become columns of the history.

use super::document::Document;
use super::input_error::InputError;
use super::sets::Sets;
use super::tables::{ProbeKind, ProbeTable};
use keys::Located;
use macro_solver::mesh::Dimension;
use macro_solver::output::{Probe, Quantity};
use macro_solver::problem::Axis;

/// Columns that every history has, and the one of a run with several stages.
const TAKEN: [&str; 8] = ["step", "time", "load", "iterations", "evaluations", "stage", "cut_backs", "stabilised"];

/// Checks all probes and translates them.
///
/// # Errors
/// A repeated or reserved name, a missing or superfluous key, an unknown set or component.
pub(super) fn probes(
    document: &Document,
    sets: &Sets<'_>,
    tables: &[Located<ProbeTable>],
) -> Result<Vec<Probe>, InputError> {
    let mut probes: Vec<Probe> = Vec::new();
    for table in tables {
        let name = table.get_ref().name.get_ref();
        if name.chars().any(char::is_control) {
            let problem =
                format!("a probe cannot be named {name:?}: the name holds a line feed or another control character");
            let hint = "tools that read the history line by line would fail; choose another name";
            return Err(document.error_at(table.get_ref().name.span(), problem).hint(hint));
        }
        if name.is_empty() || TAKEN.contains(&name.as_str()) || probes.iter().any(|probe| probe.name == *name) {
            let problem = format!("a probe cannot be named '{name}': the history already has that column");
            return Err(document.error_at(table.get_ref().name.span(), problem).hint("choose another name"));
        }
        probes.push(Probe { name: name.clone(), quantity: quantity(document, sets, table)? });
    }
    Ok(probes)
}

fn quantity(document: &Document, sets: &Sets<'_>, table: &Located<ProbeTable>) -> Result<Quantity, InputError> {
    let keys = Keys { document, sets, table };
    let probe = table.get_ref();
    let allowed: &[&str] = match probe.kind {
        ProbeKind::Reaction | ProbeKind::Displacement | ProbeKind::Velocity | ProbeKind::Acceleration => {
            &["set", "component"]
        }
        ProbeKind::Strain | ProbeKind::Compression => &["from", "to", "component"],
        ProbeKind::MeanStress => &["component"],
        _ => &[],
    };
    keys.refuse_others(allowed)?;
    Ok(match probe.kind {
        ProbeKind::Reaction => Quantity::Reaction { set: keys.set("set", &probe.set)?, axis: keys.axis()? },
        ProbeKind::Displacement => Quantity::Displacement { set: keys.set("set", &probe.set)?, axis: keys.axis()? },
        ProbeKind::Strain => Quantity::Strain {
            from: keys.set("from", &probe.from)?,
            to: keys.set("to", &probe.to)?,
            axis: keys.axis()?,
        },
        ProbeKind::Compression => Quantity::Compression {
            from: keys.set("from", &probe.from)?,
            to: keys.set("to", &probe.to)?,
            axis: keys.axis()?,
        },
        ProbeKind::MeanStress => {
            let (row, column) = keys.stress_component()?;
            Quantity::MeanStress { row, column }
        }
        ProbeKind::VolumeChange => Quantity::VolumeChange,
        ProbeKind::StressRatio => Quantity::StressRatio,
        ProbeKind::MeanPressure => Quantity::MeanPressure,
        ProbeKind::Deviator => Quantity::Deviator,
        ProbeKind::VoidRatio => Quantity::VoidRatio,
        ProbeKind::CoordinationNumber => Quantity::CoordinationNumber,
        ProbeKind::ElasticEnergy => Quantity::ElasticEnergy,
        ProbeKind::FrictionalDissipation => Quantity::FrictionalDissipation,
        ProbeKind::HourglassEnergy => Quantity::HourglassEnergy,
        ProbeKind::Velocity => Quantity::Velocity { set: keys.set("set", &probe.set)?, axis: keys.axis()? },
        ProbeKind::Acceleration => Quantity::Acceleration { set: keys.set("set", &probe.set)?, axis: keys.axis()? },
        ProbeKind::KineticEnergy => Quantity::KineticEnergy,
        ProbeKind::EnergyResidual => Quantity::EnergyResidual,
    })
}

/// The keys of one probe.
struct Keys<'a> {
    document: &'a Document,
    sets: &'a Sets<'a>,
    table: &'a Located<ProbeTable>,
}

impl Keys<'_> {
    fn given(&self) -> [(&'static str, Option<&Located<String>>); 4] {
        let probe = self.table.get_ref();
        [
            ("set", probe.set.as_ref()),
            ("from", probe.from.as_ref()),
            ("to", probe.to.as_ref()),
            ("component", probe.component.as_ref()),
        ]
    }

    fn refuse_others(&self, allowed: &[&str]) -> Result<(), InputError> {
        for (key, value) in self.given() {
            if let Some(value) = value
                && !allowed.contains(&key)
            {
                let kind = self.table.get_ref().kind.keyword();
                return Err(self
                    .document
                    .error_at(value.span(), format!("`{key}` has no meaning for a probe of kind \"{kind}\""))
                    .hint(format!("remove `{key}`")));
            }
        }
        Ok(())
    }

    fn missing(&self, key: &str, example: &str) -> InputError {
        let probe = self.table.get_ref();
        self.document
            .error_at(probe.name.span(), format!("the probe '{}' lacks the key `{key}`", probe.name.get_ref()))
            .hint(format!("add for example {key} = \"{example}\""))
    }

    fn set(&self, key: &str, value: &Option<Located<String>>) -> Result<String, InputError> {
        let value = value.as_ref().ok_or_else(|| self.missing(key, "top"))?;
        self.sets.node_set(self.document, value)
    }

    fn axis(&self) -> Result<Axis, InputError> {
        let component = self.component("y")?;
        match component.get_ref().as_str() {
            "x" => Ok(Axis::X),
            "y" => Ok(Axis::Y),
            "z" if self.sets.mesh.dimension == Dimension::Space => Ok(Axis::Z),
            other => Err(self.wrong_component(component, other, "\"x\" or \"y\", in space also \"z\"")),
        }
    }

    fn stress_component(&self) -> Result<(usize, usize), InputError> {
        let component = self.component("yy")?;
        let axes: Vec<usize> = component.get_ref().chars().filter_map(|letter| "xyz".find(letter)).collect();
        let known = component.get_ref().chars().count() == 2;
        match axes[..] {
            [row, column] if known && row.max(column) < self.sets.mesh.dimension.count() => Ok((row, column)),
            _ => {
                let choices = "two of the letters x and y, in space also z, for example \"xx\" or \"xy\"";
                Err(self.wrong_component(component, component.get_ref(), choices))
            }
        }
    }

    fn component(&self, example: &str) -> Result<&Located<String>, InputError> {
        self.table.get_ref().component.as_ref().ok_or_else(|| self.missing("component", example))
    }

    fn wrong_component(&self, place: &Located<String>, found: &str, choices: &str) -> InputError {
        self.document.error_at(place.span(), format!("'{found}' is not a component")).hint(format!("write {choices}"))
    }
}
