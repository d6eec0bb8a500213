//! `[[probe]]` and `[[profile]]` tables become columns of the history and files of their own.

mod chosen;
mod keys_of_probe;
mod measure;
mod part;
mod profile;

pub(super) use chosen::chosen_fields;
pub(super) use profile::profiles;

use super::document::Document;
use super::input_error::InputError;
use super::materials::Materials;
use super::sets::Sets;
use super::tables::{PoreFluidTable, ProbeKind, ProbeTable, SceneFile};
use keys::Located;
use keys_of_probe::Keys;
use macro_solver::output::{BandProbe, BandProperty, FieldProbe, HISTORY_COLUMNS, Probe, Quantity, Statistic};
use macro_solver::problem::{Axis, PoreFluid};
use measure::{Word, bare_measure, measure};

/// What probes refer to.
pub(super) struct ProbeContext<'a> {
    pub(super) document: &'a Document,
    pub(super) sets: &'a Sets<'a>,
    pub(super) file: &'a SceneFile,
    pub(super) materials: &'a Materials,
}

impl ProbeContext<'_> {
    /// Pore fluid with the number of its stage.
    ///
    /// # Errors
    /// There is no such stage.
    pub(super) fn pore_fluid(&self, table: &PoreFluidTable) -> Result<PoreFluid, InputError> {
        let from_stage = table.stage.as_ref().map_or(Ok(0), |name| self.stage(name))?;
        Ok(PoreFluid { from_stage, ..table.fluid })
    }

    /// Number of the stage of this name.
    ///
    /// # Errors
    /// There is none.
    pub(super) fn stage(&self, name: &Located<String>) -> Result<usize, InputError> {
        let names: Vec<&str> = self.file.stage.iter().map(|stage| stage.get_ref().name.get_ref().as_str()).collect();
        names.iter().position(|one| one == name.get_ref()).ok_or_else(|| {
            let hint = if names.is_empty() {
                "the scene has no [[stage]]; leave it out to count from the start of the run".to_owned()
            } else {
                format!("use one of: {}", names.join(", "))
            };
            self.document.error_at(name.span(), format!("there is no stage '{}'", name.get_ref())).hint(hint)
        })
    }
}

/// Checks all probes and translates them.
///
/// # Errors
/// A repeated or reserved name, a missing or superfluous key, an unknown set, stage, part or component.
pub(super) fn probes(context: &ProbeContext<'_>) -> Result<Vec<Probe>, InputError> {
    let document = context.document;
    let mut probes: Vec<Probe> = Vec::new();
    for table in &context.file.probe {
        let name = table.get_ref().name.get_ref();
        if name.chars().any(char::is_control) {
            let problem =
                format!("a probe cannot be named {name:?}: the name holds a line feed or another control character");
            let hint = "tools that read the history line by line would fail; choose another name";
            return Err(document.error_at(table.get_ref().name.span(), problem).hint(hint));
        }
        if name.is_empty() {
            let problem = "a probe cannot be named '': its column in the history would have no name";
            return Err(document.error_at(table.get_ref().name.span(), problem).hint("choose a name"));
        }
        if name.contains(" [") {
            let problem =
                format!("a probe cannot be named '{name}': in headers ` [` begins a unit, as in `top_force [N/m]`");
            let hint = "leave out the bracket, or the space before it";
            return Err(document.error_at(table.get_ref().name.span(), problem).hint(hint));
        }
        if HISTORY_COLUMNS.iter().any(|(taken, _)| taken == name) || probes.iter().any(|probe| probe.name == *name) {
            let problem = format!("a probe cannot be named '{name}': the history already has that column");
            return Err(document.error_at(table.get_ref().name.span(), problem).hint("choose another name"));
        }
        probes.push(Probe { name: name.clone(), quantity: quantity(context, table)? });
    }
    Ok(probes)
}

fn quantity(context: &ProbeContext<'_>, table: &Located<ProbeTable>) -> Result<Quantity, InputError> {
    let document = context.document;
    let keys = Keys { context, table };
    let probe = table.get_ref();
    let of_band = |property| band(&keys, property);
    let axis_of_set = || -> Result<(String, Axis), InputError> {
        keys.refuse_others(&["set", "component"])?;
        Ok((keys.set("set", &probe.set)?, keys.axis()?))
    };
    let between = || -> Result<(String, String, Axis, Option<usize>), InputError> {
        keys.refuse_others(&["from", "to", "component", "reference"])?;
        let (from, to) = (keys.set("from", &probe.from)?, keys.set("to", &probe.to)?);
        if from == to {
            let problem =
                format!("the probe '{}' measures the distance of '{from}' from itself", probe.name.get_ref());
            return Err(document.error_at(probe.name.span(), problem).hint("name two sets in `from` and `to`"));
        }
        Ok((from, to, keys.axis()?, keys.reference()?))
    };
    let of_body = |quantity| keys.refuse_others(&[]).map(|()| quantity);
    Ok(match probe.kind {
        ProbeKind::Reaction => axis_of_set().map(|(set, axis)| Quantity::Reaction { set, axis })?,
        ProbeKind::Displacement => {
            keys.refuse_others(&["set", "component", "reference"])?;
            let set = keys.set("set", &probe.set)?;
            Quantity::Displacement { set, axis: keys.axis()?, reference: keys.reference()? }
        }
        ProbeKind::Strain => {
            between().map(|(from, to, axis, reference)| Quantity::Strain { from, to, axis, reference })?
        }
        ProbeKind::Compression => {
            between().map(|(from, to, axis, reference)| Quantity::Compression { from, to, axis, reference })?
        }
        ProbeKind::Velocity => axis_of_set().map(|(set, axis)| Quantity::Velocity { set, axis })?,
        ProbeKind::Acceleration => axis_of_set().map(|(set, axis)| Quantity::Acceleration { set, axis })?,
        ProbeKind::HourglassEnergy => of_body(Quantity::HourglassEnergy)?,
        ProbeKind::KineticEnergy => of_body(Quantity::KineticEnergy)?,
        ProbeKind::EnergyResidual => of_body(Quantity::EnergyResidual)?,
        ProbeKind::BandWidth => of_band(BandProperty::Width)?,
        ProbeKind::BandInclination => of_band(BandProperty::Inclination)?,
        ProbeKind::BandQuality => of_band(BandProperty::Quality)?,
        // All others are measured at Gauss points; `measure` names them.
        kind => Quantity::Field(field(&keys, kind)?),
    })
}

/// A probe of a kind that is measured at Gauss points.
fn field(keys: &Keys<'_>, kind: ProbeKind) -> Result<FieldProbe, InputError> {
    let probe = keys.table.get_ref();
    let word = Word { context: keys.context, place: probe.name.span(), name: probe.name.get_ref(), kind };
    let Some((measure, has_component)) = measure(&word, probe.component.as_ref())? else {
        return Err(word.not_at_points());
    };
    let allowed = [
        ("component", has_component),
        ("part", true),
        ("statistic", !measure.is_energy_density()),
        ("reference", measure.has_reference()),
    ];
    let allowed: Vec<&str> = allowed.iter().filter(|(_, is_used)| *is_used).map(|(key, _)| *key).collect();
    keys.refuse_others(&allowed)?;
    Ok(FieldProbe {
        measure,
        part: part::part(keys.context, probe.part.as_ref())?,
        statistic: probe.statistic.as_ref().map_or(Statistic::default(), |one| *one.get_ref()),
        reference: keys.reference()?,
    })
}

fn band(keys: &Keys<'_>, property: BandProperty) -> Result<Quantity, InputError> {
    let probe = keys.table.get_ref();
    let shown_by = probe.field.as_ref().map_or(ProbeKind::ShearStrain, |field| *field.get_ref());
    let place = probe.field.as_ref().map_or(probe.name.span(), Located::span);
    let measure = bare_measure(&Word { context: keys.context, place, name: probe.name.get_ref(), kind: shown_by })?;
    match measure.has_reference() {
        true => keys.refuse_others(&["field", "component", "part", "reference"])?,
        false => keys.refuse_others(&["field", "component", "part"])?,
    }
    Ok(Quantity::Band(BandProbe {
        measure,
        part: part::part(keys.context, probe.part.as_ref())?,
        reference: keys.reference()?,
        plane: keys.plane()?,
        property,
    }))
}

#[cfg(test)]
mod tests {
    use crate::weak_element;
    use macro_solver::output::{Measure, Part, Quantity, Statistic};

    const STAGES: &str = "stage=[{ name = 'squeeze' }, { name = 'shear' }]";

    fn probe(table: &str, more: &[&str]) -> Result<Quantity, String> {
        let probe = format!("probe=[{{ name = 'one', {table} }}]");
        let overrides: Vec<&str> = std::iter::once(probe.as_str()).chain(more.iter().copied()).collect();
        weak_element(&overrides).map(|scene| scene.record.probes[0].quantity.clone())
    }

    fn part(table: &str) -> Part {
        match probe(&format!("kind = 'porosity', part = {table}"), &[]).unwrap() {
            Quantity::Field(field) => field.part,
            other => panic!("{other:?}"),
        }
    }

    /// The scene has 2 x 4 elements on 50 mm x 100 mm; its second region is the third element.
    #[test]
    fn parts_name_points_elements_regions_and_boxes() {
        assert_eq!(part("{ point = 9 }"), Part::Points(vec![9]));
        assert_eq!(part("{ element = 2, point = 1 }"), Part::Points(vec![9]));
        assert_eq!(part("{ element = 2 }"), Part::Points(vec![8, 9, 10, 11]));
        assert_eq!(part("{ region = 'weak' }"), Part::Points(vec![8, 9, 10, 11]));
        assert_eq!(part("{ from = [0.0, 0.025], to = [0.025, 0.05] }"), Part::Points(vec![8, 9, 10, 11]));
        assert_eq!(part("{ elements = 'all' }"), Part::Points((0..32).collect()));
    }

    #[test]
    fn statistics_and_references_reach_the_probe() {
        let table = "kind = 'shear_strain', statistic = 'maximum', reference = 'shear'";
        let Quantity::Field(field) = probe(table, &[STAGES]).unwrap() else { panic!("it is a field") };
        assert_eq!((field.statistic, field.reference), (Statistic::Maximum, Some(1)));
        let Quantity::Field(field) = probe("kind = 'log_volume_strain'", &[]).unwrap() else {
            panic!("it is a field")
        };
        assert_eq!((field.measure, field.statistic), (Measure::LogVolumeStrain, Statistic::Mean));
    }

    #[test]
    fn defects_of_probes_have_their_reason_and_remedy() {
        for (table, reason) in [
            ("kind = 'porosity', part = { point = 32 }", "there is no Gauss point 32"),
            ("kind = 'porosity', part = { element = 8 }", "there is no element 8"),
            ("kind = 'porosity', part = { element = 2, point = 4 }", "element 2 has no Gauss point 4"),
            ("kind = 'porosity', part = { region = 'core' }", "there is no region 'core'"),
            ("kind = 'porosity', part = { from = [9.0, 9.0], to = [9.5, 9.5] }", "no Gauss point lies in it"),
            ("kind = 'porosity', part = { from = [0.0], to = [1.0, 1.0] }", "2 coordinates"),
            ("kind = 'porosity', part = { element = 2, region = 'weak' }", "exactly one"),
            ("kind = 'porosity', reference = 'shear'", "no meaning"),
            ("kind = 'shear_strain', reference = 'shear'", "there is no stage 'shear'"),
            ("kind = 'elastic_energy', statistic = 'mean'", "no meaning"),
            ("kind = 'mean_stress', component = 'zz'", "not a component"),
            ("kind = 'principal_stress', component = 'intermediate'", "two of the plane"),
            ("kind = 'principal_ratio', component = 'major'", "major/minor"),
            ("kind = 'von_mises_stress'", "spheres"),
            ("kind = 'grain_rotation', component = 'x'", "not a component"),
            ("kind = 'band_width', field = 'mean_stress'", "component"),
            ("kind = 'band_width', field = 'reaction'", "not measured at Gauss points"),
            ("kind = 'reaction', set = 'top', component = 'y', part = { point = 1 }", "no meaning"),
            ("kind = 'compression', from = 'top', to = 'top', component = 'y'", "distance of 'top' from itself"),
        ] {
            let error = probe(table, &[]).unwrap_err();
            assert!(error.contains(reason) && error.contains("hint:"), "{table}: {error}");
        }
        let error = probe("kind = 'fabric_anisotropy'", &["output.observables=['energy']"]).unwrap_err();
        assert!(error.contains("needs \"fabric\", which output.observables leaves out"), "{error}");
    }

    #[test]
    fn profiles_cover_the_mesh_unless_they_say_otherwise() {
        let profile = |table: &str| {
            let table = format!("profile=[{{ name = 'rows', kind = 'porosity', {table} }}]");
            weak_element(&[&table]).map(|scene| scene.record.profiles[0].clone())
        };
        let whole = profile("axis = 'y', bins = 4").unwrap();
        assert_eq!((whole.axis, whole.from, whole.to, whole.bins, whole.every), (1, 0.0, 0.1, 4, 1));
        let piece = profile("axis = 'x', bins = 2, from = 0.01, to = 0.02, every = 3").unwrap();
        assert_eq!((piece.axis, piece.from, piece.to, piece.every), (0, 0.01, 0.02, 3));
        for (table, reason) in [
            ("axis = 'z', bins = 4", "not an axis"),
            ("axis = 'y', bins = 4, from = 0.1, to = 0.1", "beyond"),
            ("axis = 'y', bins = 0", "bins"),
            ("axis = 'y', bins = 4, from = 5.0, to = 6.0", "no Gauss point lies in the profile"),
            ("axis = 'y', bins = 4, component = 'xx'", "no meaning"),
        ] {
            let error = profile(table).unwrap_err();
            assert!(error.contains(reason), "{table}: {error}");
        }
        let named = |name: &str| {
            weak_element(&[&format!("profile=[{{ name = '{name}', kind = 'porosity', axis = 'y', bins = 1 }}]")])
        };
        assert!(named("a/b").unwrap_err().contains("cannot name a file"));
        let reaction = weak_element(&["profile=[{ name = 'a', kind = 'reaction', axis = 'y', bins = 1 }]"]);
        assert!(reaction.unwrap_err().contains("not measured at Gauss points"));
    }
}
