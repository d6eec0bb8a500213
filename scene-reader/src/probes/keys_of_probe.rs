//! The keys of one `[[probe]]`.

use super::ProbeContext;
use crate::input_error::InputError;
use crate::tables::ProbeTable;
use keys::Located;
use macro_solver::mesh::Dimension;
use macro_solver::problem::Axis;
use std::ops::Range;

/// A probe with what it refers to.
pub(super) struct Keys<'a> {
    pub(super) context: &'a ProbeContext<'a>,
    pub(super) table: &'a Located<ProbeTable>,
}

impl Keys<'_> {
    /// The keys that are written, and where.
    fn given(&self) -> Vec<(&'static str, Range<usize>)> {
        let probe = self.table.get_ref();
        let texts = [
            ("set", &probe.set),
            ("from", &probe.from),
            ("to", &probe.to),
            ("component", &probe.component),
            ("reference", &probe.reference),
        ];
        let texts = texts.into_iter().map(|(key, value)| (key, value.as_ref().map(Located::span)));
        let others = [
            ("part", probe.part.as_ref().map(Located::span)),
            ("statistic", probe.statistic.as_ref().map(Located::span)),
            ("field", probe.field.as_ref().map(Located::span)),
        ];
        texts.chain(others).filter_map(|(key, span)| span.map(|span| (key, span))).collect()
    }

    /// Refuses keys that the kind does not have.
    ///
    /// # Errors
    /// The first such key.
    pub(super) fn refuse_others(&self, allowed: &[&str]) -> Result<(), InputError> {
        match self.given().into_iter().find(|(key, _)| !allowed.contains(key)) {
            None => Ok(()),
            Some((key, span)) => {
                let kind = self.table.get_ref().kind.keyword();
                Err(self
                    .context
                    .document
                    .error_at(span, format!("`{key}` has no meaning for a probe of kind \"{kind}\""))
                    .hint(format!("remove `{key}`")))
            }
        }
    }

    fn missing(&self, key: &str, example: &str) -> InputError {
        let probe = self.table.get_ref();
        self.context
            .document
            .error_at(probe.name.span(), format!("the probe '{}' lacks the key `{key}`", probe.name.get_ref()))
            .hint(format!("add for example {key} = \"{example}\""))
    }

    /// A node set.
    ///
    /// # Errors
    /// It is not given, or the mesh does not have it.
    pub(super) fn set(&self, key: &str, value: &Option<Located<String>>) -> Result<String, InputError> {
        let value = value.as_ref().ok_or_else(|| self.missing(key, "top"))?;
        self.context.sets.node_set(self.context.document, value)
    }

    /// The axis that `component` names.
    ///
    /// # Errors
    /// It is not given, or no axis of the mesh.
    pub(super) fn axis(&self) -> Result<Axis, InputError> {
        let component = self.table.get_ref().component.as_ref().ok_or_else(|| self.missing("component", "y"))?;
        match component.get_ref().as_str() {
            "x" => Ok(Axis::X),
            "y" => Ok(Axis::Y),
            "z" if self.context.sets.mesh.dimension == Dimension::Space => Ok(Axis::Z),
            other => Err(self
                .context
                .document
                .error_at(component.span(), format!("'{other}' is not a component"))
                .hint("write \"x\" or \"y\", in space also \"z\"")),
        }
    }

    /// The two axes of the plane of a band.
    ///
    /// # Errors
    /// `component` does not name two axes of the mesh.
    pub(super) fn plane(&self) -> Result<[usize; 2], InputError> {
        let Some(component) = &self.table.get_ref().component else { return Ok([0, 1]) };
        match (component.get_ref().as_str(), self.context.sets.mesh.dimension) {
            ("xy", _) => Ok([0, 1]),
            ("xz", Dimension::Space) => Ok([0, 2]),
            ("yz", Dimension::Space) => Ok([1, 2]),
            (other, _) => Err(self
                .context
                .document
                .error_at(component.span(), format!("'{other}' is not a plane of this mesh"))
                .hint("write \"xy\", in space also \"xz\" or \"yz\"")),
        }
    }

    /// The stage from whose start is counted.
    ///
    /// # Errors
    /// There is none of the name.
    pub(super) fn reference(&self) -> Result<Option<usize>, InputError> {
        self.table.get_ref().reference.as_ref().map(|name| self.context.stage(name)).transpose()
    }
}
