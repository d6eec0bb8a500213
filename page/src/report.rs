//! The page as one file, and its parts.

use crate::cell;
use crate::data;
use crate::folder::RunFolder;
use crate::program::Program;
use serde_json::{Map, Value, json};

const PAGE: &str = include_str!("../assets/page.html");

/// Styles in the order of use: name and text.
const STYLES: [(&str, &str); 2] = [
    ("uPlot.min.css", include_str!("../assets/vendor/uPlot.min.css")),
    ("page.css", include_str!("../assets/page.css")),
];

/// Scripts in the order of use: name and text.
const SCRIPTS: [(&str, &str); 7] = [
    (
        "uPlot.min.js",
        concat!(
            "/*\n",
            include_str!("../assets/vendor/uPlot.LICENSE"),
            "*/\n",
            include_str!("../assets/vendor/uPlot.min.js")
        ),
    ),
    ("common.js", include_str!("../assets/common.js")),
    ("curves.js", include_str!("../assets/curves.js")),
    ("mesh.js", include_str!("../assets/mesh.js")),
    ("cell.js", include_str!("../assets/cell.js")),
    ("summary.js", include_str!("../assets/summary.js")),
    ("page.js", include_str!("../assets/page.js")),
];

/// Numbers of fields that a report holds: more would make a file that no browser likes.
const MOST_FIELD_NUMBERS: usize = 400_000;

/// Grains whose cells a report holds.
const MOST_GRAINS: usize = 20_000;

/// A part of the page by its name: kind and text.
pub(crate) fn asset(name: &str) -> Option<(&'static str, &'static str)> {
    let style = STYLES.iter().find(|(known, _)| *known == name).map(|(_, text)| ("text/css; charset=utf-8", *text));
    let script = SCRIPTS.iter().find(|(known, _)| *known == name);
    style.or_else(|| script.map(|(_, text)| ("text/javascript; charset=utf-8", *text)))
}

/// The page that loads its parts and data from the server.
pub(crate) fn live_page(name: &str) -> String {
    let styles: String =
        STYLES.iter().map(|(name, _)| format!("<link rel=\"stylesheet\" href=\"assets/{name}\">\n")).collect();
    let scripts: String =
        SCRIPTS.iter().map(|(name, _)| format!("<script src=\"assets/{name}\"></script>\n")).collect();
    filled(name, &styles, "<script id=\"data\" type=\"application/json\">null</script>\n", &scripts)
}

/// The page with everything inside: it needs neither a server nor a network.
pub fn report(folder: &RunFolder, program: &Program) -> String {
    let styles: String = STYLES.iter().map(|(_, text)| format!("<style>\n{text}</style>\n")).collect();
    let scripts: String = SCRIPTS.iter().map(|(_, text)| format!("<script>\n{text}</script>\n")).collect();
    // Inside a script element only this sequence has a meaning; in JSON the escape is the same text.
    let data = everything(folder, program).to_string().replace("</", "<\\/").replace("<!--", "<\\u0021--");
    filled(
        &folder.name(),
        &styles,
        &format!("<script id=\"data\" type=\"application/json\">{data}</script>\n"),
        &scripts,
    )
}

fn filled(name: &str, styles: &str, data: &str, scripts: &str) -> String {
    let title = name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let mut text = String::new();
    // In one pass: what is put in may hold the marks.
    for line in PAGE.lines() {
        match line.trim() {
            "<!-- styles -->" => text.push_str(styles),
            "<!-- data -->" => text.push_str(data),
            "<!-- scripts -->" => text.push_str(scripts),
            _ => {
                text.push_str(&line.replace("<!-- title -->", &title));
                text.push('\n');
            }
        }
    }
    text
}

/// All data: `frames` by step, `cells` by Gauss point and step.
fn everything(folder: &RunFolder, program: &Program) -> Value {
    let mut state = data::state(folder, program);
    let frames = chosen_frames(folder);
    let cells = chosen_cells(folder);
    if let Some(state) = state.as_object_mut() {
        // What is said to be there is in the file.
        let known = |frame: &Value| {
            frame.get("step").and_then(Value::as_u64).is_some_and(|step| frames.contains_key(&step.to_string()))
        };
        let all = state.get("frames").and_then(Value::as_array).cloned().unwrap_or_default();
        let left_out = all.iter().filter(|frame| !known(frame)).count();
        state.insert("frames".into(), all.into_iter().filter(known).collect());
        state.insert("frames_left_out".into(), left_out.into());
        let known = |(point, steps): (&String, &Value)| {
            json!({"point": point.parse::<usize>().ok(), "steps": steps.as_object().into_iter().flatten()
                .filter_map(|(step, _)| step.parse::<u64>().ok()).collect::<Vec<_>>()})
        };
        state.insert("cells_left_out".into(), (cell::available(folder).len() - cells.len()).into());
        state.insert("cells".into(), cells.iter().map(known).collect());
        state.insert("live".into(), Value::Null);
        // A file does not change, and is the same whenever it is written.
        state.insert("run".into(), Value::Null);
        state.insert("version".into(), Value::Null);
    }
    json!({
        "state": state,
        "history": data::history(folder),
        "log": data::log(folder),
        "mesh": data::mesh(folder),
        "frames": frames,
        "cells": cells,
    })
}

/// Frames with all their fields, evenly chosen up to the bound, the last one always.
fn chosen_frames(folder: &RunFolder) -> Map<String, Value> {
    let steps: Vec<u64> = data::frames(folder).iter().map(|frame| frame.step).collect();
    let Some(&last) = steps.last() else { return Map::new() };
    let mut found = Map::new();
    let Some(frame) = data::frame(folder, last, None) else { return found };
    let numbers = |frame: &Value| {
        let values = frame.get("values").and_then(Value::as_object).into_iter().flatten();
        values.filter_map(|(_, values)| values.as_array()).map(Vec::len).sum::<usize>()
            + frame.get("displacement").and_then(Value::as_array).map_or(0, Vec::len)
    };
    let fitting = (MOST_FIELD_NUMBERS / numbers(&frame).max(1)).max(1);
    let stride = steps.len().div_ceil(fitting).max(1);
    found.insert(last.to_string(), frame);
    for &step in steps.iter().rev().step_by(stride).skip(1) {
        if let Some(frame) = data::frame(folder, step, None) {
            found.insert(step.to_string(), frame);
        }
    }
    found
}

/// The last cell of each Gauss point that has one, of evenly chosen points if they have too many grains; then earlier ones, up to the
/// bound.
fn chosen_cells(folder: &RunFolder) -> Map<String, Value> {
    let mut found: Map<String, Value> = Map::new();
    let mut steps = cell::available(folder);
    let first = steps.iter().next().and_then(|(&point, steps)| cell::read(folder, point, *steps.last()?));
    let fitting = MOST_GRAINS / first.as_ref().map_or(1, grain_count).max(1);
    let stride = steps.len().div_ceil(fitting.max(1));
    let mut place = 0;
    steps.retain(|_, steps| {
        place += 1;
        // Points with several steps were chosen by the scene.
        (place - 1) % stride == 0 || steps.len() > 1
    });
    let mut grains = 0;
    while grains < MOST_GRAINS && !steps.is_empty() {
        steps.retain(|point, steps| {
            let Some(step) = steps.pop() else { return false };
            if grains < MOST_GRAINS
                && let Some(cell) = cell::read(folder, *point, step)
            {
                grains += grain_count(&cell);
                let of_point = found.entry(point.to_string()).or_insert_with(|| Value::Object(Map::new()));
                of_point[step.to_string()] = cell;
            }
            true
        });
    }
    found
}

fn grain_count(cell: &Value) -> usize {
    cell.get("grains").and_then(Value::as_array).map_or(0, Vec::len)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const PROGRAM: Program = Program { live: |_| None, counter: |name, count| (format!("{count} {name}"), false) };

    fn data_of(page: &str) -> Value {
        let begin = page.find("type=\"application/json\">").unwrap() + "type=\"application/json\">".len();
        serde_json::from_str(page[begin..].split("</script>").next().unwrap()).unwrap()
    }

    #[test]
    fn the_report_holds_everything_and_nothing_that_people_wrote_ends_its_script() {
        let place = tempfile::tempdir().unwrap();
        let run = place.path().join("biaxial <1>");
        fs::create_dir_all(run.join("cells")).unwrap();
        fs::write(run.join("scene.toml"), "name = \"</script><script>alert(1)</script><!-- styles -->\"").unwrap();
        fs::write(run.join("history.csv"), "step,time,u\n0,0,0\n1,1,2\n").unwrap();
        fs::write(run.join("summary.json"), r#"{"status":"not_converged","reason":"no </script> hope"}"#).unwrap();
        for point in 0..3 {
            fs::write(run.join(cell::Cell::file(point)), r#"{"step":1,"grains":[[0,0,1,0]],"contacts":[]}"#).unwrap();
        }
        let page = report(&RunFolder::open(&run).unwrap(), &PROGRAM);
        assert!(page.starts_with("<!DOCTYPE html>") && page.contains("biaxial &lt;1&gt;"));
        assert!(page.contains("Leon Sorokin"), "the licence of the plotting library");
        assert!(!page.contains("src=\"") && !page.contains("href=\"assets"), "the page needs no other file");
        let data = data_of(&page);
        assert_eq!(data["state"]["status"], "not_converged");
        assert_eq!(data["state"]["reason"], "no </script> hope");
        assert_eq!(data["history"]["columns"].as_array().unwrap().len(), 3);
        assert_eq!(data["cells"].as_object().unwrap().len(), 3);
        assert_eq!(data["state"]["cells"][2]["steps"].to_string(), "[1]");
        assert!(data["mesh"]["problem"].is_string(), "a scene that cannot be read is said to be so");
        assert_eq!(page.matches("alert(1)<\\/script>").count(), 1);
    }

    #[test]
    fn the_live_page_names_parts_that_exist() {
        let page = live_page("a & b");
        assert_eq!(data_of(&page), Value::Null);
        let names: Vec<&str> = page.split("assets/").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
        assert_eq!(names.len(), STYLES.len() + SCRIPTS.len());
        names.iter().for_each(|name| assert!(asset(name).is_some(), "{name}"));
        assert!(page.contains("a &amp; b") && asset("page.html").is_none());
    }
}
