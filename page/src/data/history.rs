//! Columns of the history with their units, and which two of them the scene plots.

use crate::folder::RunFolder;
use crate::numbers::exact;
use macro_solver::output::HistoryColumn;
use serde_json::{Value, json};

/// A table: names and, column by column, cells; incomplete rows are left out.
pub(super) struct Table {
    pub(super) names: Vec<String>,
    pub(super) columns: Vec<Vec<String>>,
}

impl Table {
    pub(super) fn of(text: &str) -> Self {
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
        // A header may hold units: `top_force [N/m]`.
        let plain = |name: &str| name.split(" [").next().unwrap_or_default().to_owned();
        let names: Vec<String> = reader.headers().map(|row| row.iter().map(plain).collect()).unwrap_or_default();
        let mut columns = vec![Vec::new(); names.len()];
        for row in reader.records().flatten().filter(|row| row.len() == names.len()) {
            columns.iter_mut().zip(row.iter()).for_each(|(column, cell)| column.push(cell.to_owned()));
        }
        Self { names, columns }
    }

    pub(super) fn numbers(&self, place: usize) -> Value {
        let number = |cell: &String| cell.parse::<f64>().map_or(Value::Null, exact);
        self.columns[place].iter().map(number).collect()
    }
}

/// `columns`: name, unit, kind (`fixed`, `probe`, `solver`, `error`), values, and for probes their estimated errors; `main`: the
/// columns of the scene's plot, x and y.
pub(crate) fn history(folder: &RunFolder) -> Value {
    let table = Table::of(&folder.complete_lines("history.csv"));
    let errors = Table::of(&folder.complete_lines("probe_errors.csv"));
    let units = folder.json("units.json").unwrap_or_default();
    let column = |(place, name): (usize, &String)| {
        let unit = units.pointer(&format!("/history/{}", name.replace('~', "~0").replace('/', "~1")));
        let error = errors.names.iter().position(|of| of == name && kind(of) == "probe");
        let values =
            if name == "stage" { table.columns[place].iter().cloned().collect() } else { table.numbers(place) };
        json!({
            "name": name,
            "unit": unit.cloned().unwrap_or(Value::Null),
            "kind": kind(name),
            "values": values,
            "errors": error.map(|place| errors.numbers(place)),
        })
    };
    let probes: Vec<&String> = table.names.iter().filter(|name| kind(name) == "probe").collect();
    json!({
        "columns": table.names.iter().enumerate().map(column).collect::<Value>(),
        "main": main(folder, &probes),
    })
}

/// Keyword of the kind of a column.
fn kind(name: &str) -> &'static str {
    match HistoryColumn::kind(name) {
        HistoryColumn::Fixed => "fixed",
        HistoryColumn::Probe => "probe",
        HistoryColumn::Solver => "solver",
        HistoryColumn::Error => "error",
    }
}

/// The two columns that the scene plots.
fn main(folder: &RunFolder, probes: &[&String]) -> Option<[String; 2]> {
    let scene = folder.text("scene.toml").and_then(|text| text.parse::<toml::Table>().ok()).unwrap_or_default();
    let given = |key: &str| Some(scene.get("output")?.get(key)?.as_str()?.to_owned());
    let stages = scene.get("stage").and_then(toml::Value::as_array).map_or(0, Vec::len);
    let progress = if stages > 1 { "time" } else { "load" };
    let (x, y) = match probes {
        [] => (None, None),
        [only] => (Some(progress.to_owned()), Some((*only).clone())),
        [first, second, ..] => (Some((*first).clone()), Some((*second).clone())),
    };
    Some([given("plot_x").or(x)?, given("plot_y").or(y)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn read(files: &[(&str, &str)]) -> Value {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("scene.toml"), "").unwrap();
        files.iter().for_each(|(name, text)| fs::write(place.path().join(name), text).unwrap());
        history(&RunFolder::open(place.path()).unwrap())
    }

    #[test]
    fn columns_have_units_errors_and_kinds_and_the_cut_off_row_is_left_out() {
        let found = read(&[
            (
                "history.csv",
                "step,time [s],u [m],F [N/m],stage,cut_backs,estimated_error\n0,0,0,NaN,a,0,\n1,0.5,1e-3,2,a,0,1e-2\n2,0.75,2",
            ),
            ("probe_errors.csv", "step,F [N/m]\n0,NaN\n1,0.25\n"),
            ("units.json", r#"{"history":{"u":"m","F":"N/m","time":"s"}}"#),
        ]);
        let column = |name: &str| {
            found["columns"].as_array().unwrap().iter().find(|column| column["name"] == name).unwrap().clone()
        };
        assert_eq!(column("F")["values"].to_string(), "[null,2.0]");
        assert_eq!(column("F")["errors"].to_string(), "[null,0.25]");
        assert_eq!((&column("F")["unit"], &column("u")["errors"]), (&Value::from("N/m"), &Value::Null));
        assert_eq!(column("stage")["values"].to_string(), r#"["a","a"]"#);
        assert_eq!(
            ["u", "cut_backs", "estimated_error", "time"].map(|name| column(name)["kind"].to_string()),
            ["\"probe\"", "\"solver\"", "\"error\"", "\"fixed\""]
        );
        assert_eq!(found["main"].to_string(), r#"["u","F"]"#);
    }

    #[test]
    fn the_scene_says_what_is_plotted() {
        let plotted =
            |scene: &str, header: &str| read(&[("scene.toml", scene), ("history.csv", header)])["main"].clone();
        let chosen = "[output]\nplot_x = 'time'\n";
        assert_eq!(plotted(chosen, "step,u,F\n").to_string(), r#"["time","F"]"#);
        assert_eq!(plotted("", "step,u\n").to_string(), r#"["load","u"]"#);
        assert_eq!(plotted("[[stage]]\n[[stage]]\n", "step,u\n").to_string(), r#"["time","u"]"#);
        assert_eq!(plotted("", "step\n"), Value::Null);
        assert_eq!(plotted("", ""), Value::Null);
    }
}
