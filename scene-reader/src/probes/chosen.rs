//! `output.fields`: quantities of Gauss points that become fields.

use super::ProbeContext;
use super::measure::{Word, measure};
use crate::input_error::InputError;
use macro_solver::output::{ChosenField, is_field};

/// Checks the fields and translates them.
///
/// # Errors
/// A kind that is not measured at Gauss points or needs a component, one that is written anyway, one that is named twice.
pub(crate) fn chosen_fields(context: &ProbeContext<'_>) -> Result<Vec<ChosenField>, InputError> {
    let mut fields: Vec<ChosenField> = Vec::new();
    for kind in &context.file.output.fields {
        let (place, name) = (kind.span(), kind.get_ref().keyword());
        let refuse = |problem: String, hint: &str| Err(context.document.error_at(place.clone(), problem).hint(hint));
        if is_field(name) {
            return refuse(
                format!("the field '{name}' is written anyway, if its observable is"),
                "leave it out of output.fields",
            );
        }
        if fields.iter().any(|field| field.name == name) {
            return refuse(format!("output.fields names '{name}' twice"), "remove one of them");
        }
        let word = Word { context, place: place.clone(), name, kind: *kind.get_ref() };
        let measure = match measure(&word, None) {
            Ok(Some((measure, _))) => measure,
            Ok(None) => return Err(word.not_at_points()),
            Err(_) => {
                return refuse(
                    format!("the field '{name}' has components, or the cells do not have it"),
                    "take a kind without components, for example \"equivalent_strain_increment\"; tensors are fields of their own",
                );
            }
        };
        fields.push(ChosenField { name: name.to_owned(), measure });
    }
    Ok(fields)
}

#[cfg(test)]
mod tests {
    use crate::weak_element;

    #[test]
    fn fields_are_kinds_of_gauss_points_that_are_not_written_anyway() {
        let chosen =
            |fields: &str| weak_element(&[&format!("output.fields={fields}")]).map(|scene| scene.record.fields);
        let names =
            |fields: &str| -> Vec<String> { chosen(fields).unwrap().into_iter().map(|field| field.name).collect() };
        assert_eq!(names("[]"), Vec::<String>::new());
        assert_eq!(names("['equivalent_strain_increment', 'porosity']"), ["equivalent_strain_increment", "porosity"]);
        for (fields, reason) in [
            ("['shear_strain']", "written anyway"),
            ("['porosity', 'porosity']", "twice"),
            ("['kinetic_energy']", "not measured at Gauss points"),
            ("['reaction']", "written anyway"),
            ("['mean_stress']", "components"),
            ("['von_mises_stress']", "the cells do not have it"),
            ("['volume']", "volume"),
        ] {
            let error = chosen(fields).unwrap_err();
            assert!(error.contains(reason) && error.contains("hint:"), "{fields}: {error}");
        }
        let error =
            weak_element(&["output.fields=['sliding_fraction']", "output.observables=['energy']"]).unwrap_err();
        assert!(error.contains("written anyway"), "{error}");
    }
}
