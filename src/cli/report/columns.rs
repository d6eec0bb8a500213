//! The columns of a history as its scene means them: which are probes, in which units, and which two the scene plots.

use super::contents::Contents;
use charts::{Chart, ChartError, Scale};
use std::collections::BTreeMap;

/// Columns that every history has.
const FIXED: [&str; 6] = ["step", "time", "load", "iterations", "evaluations", "stage"];

/// What the columns mean.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Columns {
    /// Names of the probes, in the order of the scene.
    pub(super) probes: Vec<String>,
    /// The two columns that the scene plots, x and y.
    pub(super) main: Option<(String, String)>,
    units: BTreeMap<String, &'static str>,
}

impl Columns {
    /// Reads them from the scene as run; without one they are numbers over time.
    pub(super) fn of(contents: &Contents) -> Self {
        let probes: Vec<String> =
            contents.columns.iter().filter(|column| !FIXED.contains(&column.as_str())).cloned().collect();
        let scene = contents.scene.as_ref().and_then(|text| text.parse::<toml::Table>().ok()).unwrap_or_default();
        let tables = scene.get("probe").and_then(toml::Value::as_array).into_iter().flatten();
        let units = tables.filter_map(|probe| {
            let text = |key: &str| probe.get(key).and_then(toml::Value::as_str);
            Some((text("name")?.to_owned(), unit(text("kind")?, contents.is_solid)))
        });
        let units = units.chain([("time".to_owned(), "s"), ("load".to_owned(), "-")]).collect();
        let output = scene.get("output");
        let given =
            |key: &str| output.and_then(|table| table.get(key)).and_then(toml::Value::as_str).map(str::to_owned);
        let stages = scene.get("stage").and_then(toml::Value::as_array).map_or(0, Vec::len);
        let progress = if stages > 1 { "time" } else { "load" }.to_owned();
        let (x, y) = match &probes[..] {
            [] => (None, None),
            [only] => (Some(progress), Some(only.clone())),
            [first, second, ..] => (Some(first.clone()), Some(second.clone())),
        };
        let main = given("plot_x").or(x).zip(given("plot_y").or(y));
        Self { probes, main, units }
    }

    fn label(&self, column: &str) -> String {
        match self.units.get(column) {
            Some(unit) => format!("{column}, {unit}"),
            None => column.to_owned(),
        }
    }

    /// One column over another.
    ///
    /// # Errors
    /// The drawing library refuses.
    pub(super) fn curve(&self, contents: &Contents, x: &str, y: &str) -> Result<String, ChartError> {
        let (across, up) = (self.label(x), self.label(y));
        let mut chart = Chart::new(&format!("{y} over {x}"), (&across, Scale::Linear), (&up, Scale::Linear));
        chart.curve(y, contents.column(x).into_iter().zip(contents.column(y)).map(|(x, y)| [x, y]));
        chart.to_svg()
    }
}

/// Unit of a kind of probe; in the plane forces and energies are per metre of thickness.
fn unit(kind: &str, is_solid: bool) -> &'static str {
    match kind {
        "reaction" => {
            if is_solid {
                "N"
            } else {
                "N/m"
            }
        }
        "displacement" | "band_width" => "m",
        "grain_rotation" => "rad",
        "friction_angle" | "band_inclination" => "degrees",
        "mean_stress" | "mean_pressure" | "deviator" | "principal_stress" | "von_mises_stress" => "Pa",
        "elastic_energy" | "frictional_dissipation" | "hourglass_energy" | "kinetic_energy" => {
            if is_solid {
                "J"
            } else {
                "J/m"
            }
        }
        "velocity" => "m/s",
        "acceleration" => "m/s2",
        _ => "-",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(scene: &str, names: &[&str], is_solid: bool) -> Columns {
        let fixed = ["step", "time", "load", "iterations", "evaluations"];
        let columns = fixed.iter().chain(names).map(|name| (*name).to_owned()).collect();
        Columns::of(&Contents { columns, scene: Some(scene.to_owned()), is_solid, ..Contents::default() })
    }

    #[test]
    fn the_scene_says_what_is_plotted_and_in_which_units() {
        let probes = "[[probe]]\nname = 'u'\nkind = 'displacement'\n[[probe]]\nname = 'F'\nkind = 'reaction'\n";
        let found = columns(probes, &["u", "F"], false);
        assert_eq!(found.main, Some(("u".to_owned(), "F".to_owned())));
        assert_eq!([found.label("u"), found.label("F"), found.label("time")], ["u, m", "F, N/m", "time, s"]);
        let solid = columns(&format!("{probes}[output]\nplot_x = 'time'"), &["u", "F"], true);
        assert_eq!((solid.label("F"), solid.main.unwrap().0), ("F, N".to_owned(), "time".to_owned()));
        let staged = "[[probe]]\nname = 'u'\nkind = 'displacement'\n[[stage]]\nname = 'a'\n[[stage]]\nname = 'b'\n";
        assert_eq!(columns(staged, &["u"], false).main, Some(("time".to_owned(), "u".to_owned())));
    }
}
