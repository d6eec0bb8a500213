//! `part` of a probe or profile: which Gauss points take part.

use super::ProbeContext;
use crate::input_error::InputError;
use crate::tables::PartTable;
use keys::Located;
use macro_solver::mesh::point_places;
use macro_solver::output::Part;

/// The Gauss points of a part; without one the whole body.
///
/// # Errors
/// Something that the mesh does not have, a part without points, or several ways to choose it.
pub(super) fn part(context: &ProbeContext<'_>, table: Option<&Located<PartTable>>) -> Result<Part, InputError> {
    let Some(located) = table else { return Ok(Part::Body) };
    let table = located.get_ref();
    let mesh = context.sets.mesh;
    let starts = mesh.first_points();
    let of_element = |element: usize| starts[element]..starts[element + 1];
    let error = |problem: String| context.document.error_at(located.span(), format!("part: {problem}"));
    let is_box = table.from.is_some() || table.to.is_some();
    let is_element = table.element.is_some() || table.point.is_some();
    let ways = [table.elements.is_some(), table.region.is_some(), is_element, is_box];
    if ways.iter().filter(|way| **way).count() != 1 {
        return Err(error("it is chosen in exactly one way".to_owned()).hint(
            "give `elements`, `region`, `element` and `point` or one of them, or the corners `from` and `to` of a box",
        ));
    }
    if let Some(set) = &table.elements {
        let set = context.sets.element_set(context.document, set)?;
        return Ok(Part::Points(mesh.element_sets[&set].iter().flat_map(|&element| of_element(element)).collect()));
    }
    if let Some(name) = &table.region {
        return region(context, name);
    }
    if is_box {
        return in_box(context, table).map_err(|(problem, hint)| error(problem).hint(hint));
    }
    if let Some(element) = &table.element {
        let count = mesh.elements.len();
        if *element.get_ref() >= count {
            return Err(context
                .document
                .error_at(element.span(), format!("there is no element {}", element.get_ref()))
                .hint(format!("the mesh has the elements 0 to {}", count - 1)));
        }
    }
    let points = table.element.as_ref().map_or(0..mesh.point_count(), |element| of_element(*element.get_ref()));
    let Some(point) = &table.point else { return Ok(Part::Points(points.collect())) };
    if *point.get_ref() >= points.len() {
        let problem = match &table.element {
            None => format!("there is no Gauss point {}", point.get_ref()),
            Some(element) => format!("element {} has no Gauss point {}", element.get_ref(), point.get_ref()),
        };
        let hint = format!("there are the points 0 to {}", points.len() - 1);
        return Err(context.document.error_at(point.span(), problem).hint(hint));
    }
    Ok(Part::Points(vec![points.start + *point.get_ref()]))
}

/// The points that have cells of the region of this name.
fn region(context: &ProbeContext<'_>, name: &Located<String>) -> Result<Part, InputError> {
    let names: Vec<&str> = context.file.region.iter().map(|region| region.get_ref().name.as_str()).collect();
    if !names.contains(&name.get_ref().as_str()) {
        let hint = match names[..] {
            [] => "the scene has no [[region]]; take `elements` or a box".to_owned(),
            _ => format!("use one of: {}", names.join(", ")),
        };
        return Err(context
            .document
            .error_at(name.span(), format!("there is no region '{}'", name.get_ref()))
            .hint(hint));
    }
    let regions = &context.materials.region_of;
    let is_in = |point: &usize| regions[*point].is_some_and(|number| names[number] == name.get_ref());
    let points: Vec<usize> = (0..regions.len()).filter(is_in).collect();
    if points.is_empty() {
        return Err(context
            .document
            .error_at(name.span(), format!("no Gauss point is left in the region '{}'", name.get_ref()))
            .hint("regions further down take its elements; name one of them"));
    }
    Ok(Part::Points(points))
}

fn in_box(context: &ProbeContext<'_>, table: &PartTable) -> Result<Part, (String, &'static str)> {
    let mesh = context.sets.mesh;
    let axes = mesh.dimension.count();
    let (Some(from), Some(to)) = (&table.from, &table.to) else {
        return Err(("a box needs two corners".to_owned(), "give both `from` and `to`"));
    };
    if from.len() != axes || to.len() != axes {
        let problem = format!("a box needs {axes} coordinates in `from` and in `to`");
        return Err((problem, "give one for each axis of the mesh"));
    }
    let is_in = |place: &[f64; 3]| (0..axes).all(|axis| (from[axis]..=to[axis]).contains(&place[axis]));
    let places = point_places(mesh);
    let points: Vec<usize> = (0..places.len()).filter(|&point| is_in(&places[point])).collect();
    match points.is_empty() {
        true => Err((
            "no Gauss point lies in it".to_owned(),
            "a point belongs to the box that holds its initial position; make the box larger",
        )),
        false => Ok(Part::Points(points)),
    }
}
