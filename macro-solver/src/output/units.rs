//! `units.json`: the units of everything that a run writes, for people and pictures. Column names stay free of units, unless
//! `output.units` asks for headers such as `top_force [N/m]`.

use super::points::point_columns;
use super::{OutputError, RecordPlan, write_atomically};
use crate::mesh::Dimension;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Units of the columns of one kind of file by their names; `-` marks numbers without a unit.
pub(super) type Units = BTreeMap<String, &'static str>;

/// What `units.json` holds, by kind of file.
#[derive(Debug, Serialize)]
struct UnitsFile {
    /// Columns of `history.csv` and `probe_errors.csv`.
    history: Units,
    /// Fields on nodes and elements, and at Gauss points.
    fields: Units,
    /// Columns of `points/*.csv`.
    points: Units,
    /// Column `value` of each file of `profiles/`, by its name.
    profiles: Units,
    /// Fields of `grains/*.vtp`.
    grains: Units,
}

/// Writes the units of the outputs of a plan.
///
/// # Errors
/// [`OutputError`].
pub(super) fn write_units(path: &Path, plan: &RecordPlan, dimension: Dimension) -> Result<(), OutputError> {
    let history = history_units(plan, dimension);
    let names = point_columns(plan).into_iter().map(|column| column.name);
    let mut points: Units = names
        .map(|name| {
            let unit = point_unit(&name, dimension);
            (name, unit)
        })
        .collect();
    let profiles = plan.profiles.iter().map(|profile| (profile.name.clone(), profile.probe.unit(dimension)));
    let force = force(dimension);
    let mut fields: Units = FIELDS.into_iter().map(own).collect();
    fields.extend([("reaction", force), ("load", force), (VOLUME, volume(dimension))].map(own));
    let chosen = || plan.fields.iter().map(|field| (field.name.clone(), field.unit(dimension)));
    fields.extend(chosen());
    points.extend(if plan.points.is_empty() { None } else { Some(chosen()) }.into_iter().flatten());
    let file = UnitsFile {
        history,
        fields,
        points,
        profiles: profiles.collect(),
        grains: GRAINS.into_iter().map(own).collect(),
    };
    let text = serde_json::to_vec_pretty(&file).map_err(|reason| OutputError::encode(path, reason))?;
    write_atomically(path, &text)
}

/// Units of the columns of `history.csv` and `probe_errors.csv`.
pub(super) fn history_units(plan: &RecordPlan, dimension: Dimension) -> Units {
    let mut history: Units = HISTORY_COLUMNS.into_iter().map(own).collect();
    history.extend(plan.probes.iter().map(|probe| (probe.name.clone(), probe.quantity.unit(dimension))));
    history
}

/// A column's name with its unit, `top_force [N/m]`; the name alone where there is none.
pub(super) fn headed(name: &str, units: &Units) -> String {
    match units.get(name) {
        None | Some(&"-") => name.to_owned(),
        Some(unit) => format!("{name} [{unit}]"),
    }
}

/// An entry of [`Units`].
pub(super) fn own((name, unit): (&str, &'static str)) -> (String, &'static str) {
    (name.to_owned(), unit)
}

/// Unit of a force: in the plane per metre of thickness.
pub(super) fn force(dimension: Dimension) -> &'static str {
    match dimension {
        Dimension::Plane => "N/m",
        Dimension::Space => "N",
    }
}

/// Unit of an energy: in the plane per metre of thickness.
pub(super) fn energy(dimension: Dimension) -> &'static str {
    match dimension {
        Dimension::Plane => "J/m",
        Dimension::Space => "J",
    }
}

/// Unit of a volume: in the plane per metre of thickness.
fn volume(dimension: Dimension) -> &'static str {
    match dimension {
        Dimension::Plane => "m2",
        Dimension::Space => "m3",
    }
}

/// Columns of a history that are no probes, with their units.
pub const HISTORY_COLUMNS: [(&str, &str); 14] = [
    ("step", "-"),
    ("time", "s"),
    ("load", "-"),
    ("iterations", "-"),
    ("evaluations", "-"),
    ("stage", "-"),
    ("cut_backs", "-"),
    ("stabilised", "-"),
    ("committed_iterates", "-"),
    ("strain_per_step", "-"),
    ("estimated_error", "-"),
    ("estimated_error_of_mean", "-"),
    ("balance_error", "-"),
    ("balance_error_of_mean", "-"),
];

/// Field with the volumes of Gauss points.
const VOLUME: &str = "volume";

/// Fields whose unit is the same in the plane and in space.
const FIELDS: [(&str, &str); 27] = [
    ("displacement", "m"),
    ("stress", "Pa"),
    ("principal_stress_major", "Pa"),
    ("principal_stress_intermediate", "Pa"),
    ("principal_stress_minor", "Pa"),
    ("p", "Pa"),
    ("q", "Pa"),
    ("strain", "-"),
    ("shear_strain", "-"),
    ("pore_pressure", "Pa"),
    ("void_ratio", "-"),
    ("coordination_number", "-"),
    ("coordination_number_no_rattlers", "-"),
    ("unbalanced_force_ratio", "-"),
    ("max_overlap_ratio", "-"),
    ("grain_rotation", "rad"),
    ("fabric_anisotropy", "-"),
    ("sliding_fraction", "-"),
    ("elastic_energy", "J/m3"),
    ("frictional_dissipation", "J/m3"),
    ("damping_work", "J/m3"),
    ("step_evaluations", "-"),
    ("evaluations", "-"),
    ("step_force_evaluations", "-"),
    ("force_evaluations", "-"),
    ("flagged_points", "-"),
    ("element", "-"),
];

const GRAINS: [(&str, &str); 11] = [
    ("radius", "m"),
    ("rotation", "rad"),
    ("contacts", "-"),
    ("rattler", "-"),
    ("displacement_fluctuation", "m"),
    ("normal_force", "N"),
    ("tangential_force", "N"),
    ("force", "N"),
    ("sliding", "-"),
    ("overlap", "m"),
    ("force_on_first", "N"),
];

/// Unit of a column of `points/*.csv`: that of the field of this name, if there is one.
pub(super) fn point_unit(name: &str, dimension: Dimension) -> &'static str {
    if name == VOLUME {
        return volume(dimension);
    }
    if let Some((_, unit)) = FIELDS.iter().find(|(field, _)| *field == name) {
        return unit;
    }
    match name.split('_').next() {
        _ if name == "time" => "s",
        Some("sigma") => "Pa",
        Some("grain") => "rad",
        _ => "-",
    }
}

/// Whether runs write a field of this name without being asked for it.
pub fn is_field(name: &str) -> bool {
    FIELDS.iter().map(|(name, _)| *name).chain(["reaction", "load", VOLUME]).any(|one| one == name)
}

#[cfg(test)]
mod tests {
    use super::super::recorder::tests::plan;
    use super::*;
    use protocol::Observables;

    /// Every column that is also a field has the unit of the field: the damping work of points had none.
    #[test]
    fn columns_of_points_have_the_units_of_the_fields() {
        let columns = point_columns(&RecordPlan { observables: Observables::ALL, pore_fluid: true, ..plan() });
        let unit = |name: &str| {
            assert!(columns.iter().any(|column| column.name == name), "{name}");
            point_unit(name, Dimension::Plane)
        };
        for (name, unit) in FIELDS {
            if columns.iter().any(|column| column.name == name) {
                assert_eq!(point_unit(name, Dimension::Plane), unit, "{name}");
            }
        }
        assert_eq!([unit("damping_work"), unit("elastic_energy"), unit("pore_pressure")], ["J/m3", "J/m3", "Pa"]);
        assert_eq!(
            [unit("sigma_xy"), unit("grain_rotation_z"), unit("F_xx"), unit("volume")],
            ["Pa", "rad", "-", "m2"]
        );
        assert_eq!(point_unit("volume", Dimension::Space), "m3");
    }
}
