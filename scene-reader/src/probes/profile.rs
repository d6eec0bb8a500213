//! `[[profile]]`.

use super::ProbeContext;
use super::measure::{Word, measure};
use super::part::part;
use crate::input_error::InputError;
use crate::tables::ProfileTable;
use keys::Located;
use macro_solver::mesh::point_places;
use macro_solver::output::{FieldProbe, Profile, Statistic};

/// Checks all profiles and translates them.
///
/// # Errors
/// A repeated name or one that cannot name a file, a kind that is not measured at Gauss points, a range that is empty.
pub(crate) fn profiles(context: &ProbeContext<'_>) -> Result<Vec<Profile>, InputError> {
    let mut profiles: Vec<Profile> = Vec::new();
    for table in &context.file.profile {
        let name = &table.get_ref().name;
        let is_sound = |letter: char| letter.is_ascii_alphanumeric() || letter == '-' || letter == '_';
        if name.get_ref().is_empty() || !name.get_ref().chars().all(is_sound) {
            return Err(context
                .document
                .error_at(name.span(), format!("'{}' cannot name a file", name.get_ref()))
                .hint("use letters, digits, '-' and '_' only"));
        }
        if profiles.iter().any(|profile| profile.name == *name.get_ref()) {
            return Err(context
                .document
                .error_at(name.span(), format!("there are two profiles '{}'", name.get_ref()))
                .hint("give every profile a name of its own"));
        }
        profiles.push(profile(context, table.get_ref())?);
    }
    Ok(profiles)
}

fn profile(context: &ProbeContext<'_>, table: &ProfileTable) -> Result<Profile, InputError> {
    let document = context.document;
    let kind = *table.kind.get_ref();
    let word = Word { context, place: table.kind.span(), name: table.name.get_ref(), kind };
    let Some((measure, has_component)) = measure(&word, table.component.as_ref())? else {
        return Err(word.not_at_points());
    };
    let superfluous = |key: &str, place| {
        document
            .error_at(place, format!("`{key}` has no meaning for a profile of kind \"{}\"", kind.keyword()))
            .hint(format!("remove `{key}`"))
    };
    if let Some(component) = table.component.as_ref().filter(|_| !has_component) {
        return Err(superfluous("component", component.span()));
    }
    if let Some(reference) = table.reference.as_ref().filter(|_| !measure.has_reference()) {
        return Err(superfluous("reference", reference.span()));
    }
    if let Some(keyword) = table.statistic.as_ref().filter(|_| measure.is_energy_density()) {
        return Err(superfluous("statistic", keyword.span()));
    }
    let axis = axis(context, &table.axis)?;
    let coordinates = || context.sets.mesh.nodes.iter().map(|node| node[axis]);
    let from = table.from.unwrap_or_else(|| coordinates().fold(f64::INFINITY, f64::min));
    let to = table.to.unwrap_or_else(|| coordinates().fold(f64::NEG_INFINITY, f64::max));
    if !(from < to && from.is_finite() && to.is_finite()) {
        return Err(document
            .error_at(
                table.name.span(),
                format!("the profile '{}' from {from} to {to} is empty", table.name.get_ref()),
            )
            .hint("`to` lies beyond `from`"));
    }
    let part = part(context, table.part.as_ref())?;
    let places = point_places(context.sets.mesh);
    let lies_in = |point: &usize| part.holds(*point) && (from..=to).contains(&places[*point][axis]);
    if !(0..places.len()).any(|point| lies_in(&point)) {
        let problem = format!("no Gauss point lies in the profile '{}' from {from} to {to}", table.name.get_ref());
        return Err(document
            .error_at(table.name.span(), problem)
            .hint("a point belongs to the bin that holds its initial position; leave out `from` and `to` for the whole mesh"));
    }
    let reference: Option<usize> = table.reference.as_ref().map(|name| context.stage(name)).transpose()?;
    let statistic = table.statistic.as_ref().map_or(Statistic::default(), |one| *one.get_ref());
    Ok(Profile {
        name: table.name.get_ref().clone(),
        probe: FieldProbe { measure, part, statistic, reference },
        axis,
        from,
        to,
        bins: table.bins,
        every: table.every,
    })
}

fn axis(context: &ProbeContext<'_>, axis: &Located<String>) -> Result<usize, InputError> {
    let axes = &["x", "y", "z"][..context.sets.mesh.dimension.count()];
    axes.iter().position(|one| one == axis.get_ref()).ok_or_else(|| {
        context
            .document
            .error_at(axis.span(), format!("'{}' is not an axis of this mesh", axis.get_ref()))
            .hint("write \"x\" or \"y\", in space also \"z\"")
    })
}
