//! The page: the end of the run first, then the curves, then everything else.

use super::columns::Columns;
use super::contents::Contents;
use crate::cli::run::counters::{Concern, in_words};
use charts::{ChartError, short};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::Value;

/// Columns of the work of the solver.
const SOLVER: [&str; 2] = ["iterations", "evaluations"];

const STYLE: &str = "body{font:15px/1.45 sans-serif;margin:2em auto;max-width:72em;padding:0 1em;color:#222}\
h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em;border-bottom:1px solid #ccc}\
table{border-collapse:collapse}td,th{padding:.15em .8em .15em 0;text-align:left;vertical-align:top}\
td.number{text-align:right;font-variant-numeric:tabular-nums}\
.curves{display:grid;grid-template-columns:repeat(auto-fill,minmax(32em,1fr));gap:1em}.curves svg,.main svg{width:100%;height:auto}.main{max-width:56em}.mesh svg{max-width:40em;max-height:40em}summary{cursor:pointer;margin-top:1.5em}\
.facts{display:grid;grid-template-columns:repeat(auto-fill,minmax(20em,1fr));gap:0 2em}\
pre{background:#f5f5f5;padding:.8em;overflow-x:auto;font-size:.88em}.bad{color:#a02000}";

/// The whole page as text.
///
/// # Errors
/// The drawing library refuses.
pub(super) fn page(contents: &Contents) -> Result<String, ChartError> {
    let columns = Columns::of(contents);
    let main = columns
        .main
        .as_ref()
        .filter(|_| contents.rows.len() > 1)
        .map(|(x, y)| columns.curve(contents, x, y))
        .transpose()?;
    let over_time = |names: &[String]| -> Result<Vec<String>, ChartError> {
        names.iter().map(|name| columns.curve(contents, "time", name)).collect()
    };
    let (probes, solver) = match contents.rows.len() {
        0 | 1 => (Vec::new(), Vec::new()),
        _ => (over_time(&columns.probes)?, over_time(&SOLVER.map(str::to_owned))?),
    };
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head { meta charset="utf-8"; title { "Grainspan: " (contents.name) } style { (PreEscaped(STYLE)) } }
            body {
                h1 { (contents.name) ": " (status(contents)) }
                (reason(contents.summary.as_ref()))
                (concerns(contents.summary.as_ref()))
                @if let Some(curve) = &main { div.main { (PreEscaped(curve)) } }
                @if contents.rows.len() < 2 { p { "No step was accepted: there is no curve to draw." } }
                @else {
                    h2 { "Probes over time" }
                    div.curves { @for curve in &probes { div { (PreEscaped(curve)) } } }
                }
                @if let Some(mesh) = &contents.mesh { h2 { "Mesh" } div.mesh { (PreEscaped(mesh)) } }
                h2 { "Warnings of the log" }
                (warnings(contents))
                (facts(contents.summary.as_ref()))
                @if contents.rows.len() > 1 {
                    details { summary { "Work of the solver over time" } div.curves { @for curve in &solver { div { (PreEscaped(curve)) } } } }
                }
                @if let Some(scene) = &contents.scene { h2 { "The scene as run" } pre { (scene) } }
            }
        }
    };
    Ok(markup.into_string())
}

fn status(contents: &Contents) -> Markup {
    let status = contents.summary.as_ref().and_then(|summary| summary.get("status")).and_then(Value::as_str);
    match status {
        Some("done") => html! { "done" },
        Some(other) => html! { span.bad { (other.replace('_', " ")) } },
        None => html! { span.bad { "not ended (no summary.json)" } },
    }
}

/// Why the run did not reach its end.
fn reason(summary: Option<&Value>) -> Markup {
    let reason = summary.and_then(|summary| summary.get("reason")).and_then(Value::as_str);
    html! { @if let Some(reason) = reason { pre.bad { (reason) } } }
}

/// Counters that concern the accuracy, in one line.
fn concerns(summary: Option<&Value>) -> Markup {
    let groups = summary.and_then(|summary| summary.get("fallback_groups"));
    let found = groups.and_then(|groups| groups.get(Concern::LookAtThis.keyword())).and_then(Value::as_object);
    let Some(found) = found else { return html! {} };
    let warnings: Vec<String> =
        found.iter().map(|(name, count)| in_words(name, count.as_u64().unwrap_or(0))).collect();
    html! {
        @if warnings.is_empty() { p { "Accuracy: no warnings." } }
        @else { p.bad { "Accuracy: " (warnings.join(", ")) " (docs/reference/counters.md explains the counters)." } }
    }
}

/// The summary: plain values in one table, each group of values in a table of its own. Counters that are 0 and former names of
/// counters are left out.
fn facts(summary: Option<&Value>) -> Markup {
    let entries: Vec<(&String, &Value)> = summary.and_then(Value::as_object).into_iter().flatten().collect();
    let is_plain = |key: &str, value: &Value| !value.is_object() && !matches!(key, "status" | "reason");
    let plain: Vec<_> = entries.iter().copied().filter(|(key, value)| is_plain(key, value)).collect();
    let former: Vec<&str> = (summary.and_then(|summary| summary.get("deprecated_names")).and_then(Value::as_object))
        .into_iter()
        .flat_map(|names| names.keys().map(String::as_str))
        .collect();
    let is_former = |group: &str, name: &str| former.contains(&format!("{group}.{name}").as_str());
    let groups = entries.iter().filter(|(key, _)| !matches!(key.as_str(), "fallback_groups" | "deprecated_names"));
    let groups = groups.filter_map(|(key, value)| Some((key, value.as_object()?)));
    html! {
        div.facts {
            div { h2 { "Run" } (table(plain)) }
            @for (key, group) in groups {
                @let shown: Vec<_> = (group.iter())
                    .filter(|(name, value)| value.as_u64() != Some(0) && !is_former(key, name))
                    .collect();
                div { h2 { (key.replace('_', " ")) } @if shown.is_empty() { p { "none" } } @else { (table(shown)) } }
            }
        }
    }
}

fn table<'a>(entries: impl IntoIterator<Item = (&'a String, &'a Value)>) -> Markup {
    html! {
        table {
            @for (key, value) in entries {
                tr { td { (key.replace('_', " ")) } td.number { (shown(value)) } }
            }
        }
    }
}

fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => number.as_f64().map_or_else(|| number.to_string(), short),
        other => other.to_string(),
    }
}

fn warnings(contents: &Contents) -> Markup {
    html! {
        @if contents.warnings.is_empty() { p { "none" } } @else {
            pre { @for line in &contents.warnings { (line) "\n" } }
            @if contents.more_warnings > 0 { p { "and " (contents.more_warnings) " more in run.jsonl" } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_holds_everything_and_escapes_what_people_wrote() {
        let contents = Contents {
            name: "biaxial <1>".into(),
            summary: serde_json::from_str(
                r#"{"status":"not_converged","reason":"no progress & no hope","steps":3,"fallbacks":{"tangent":2,"other":0,"former":2},"deprecated_names":{"fallbacks.former":"fallbacks.tangent"},
                    "fallback_groups":{"look_at_this":{"large_overlap":2},"harmless":{}},"skipped":{}}"#,
            )
            .ok(),
            columns: ["step", "time", "load", "iterations", "evaluations", "ratio"].map(str::to_owned).to_vec(),
            rows: vec![vec![0.0, 0.0, 0.0, 1.0, 8.0, 1.0], vec![1.0, 0.5, 0.5, 2.0, 9.0, 1.4]],
            scene: Some("name = \"a & b\"".into()),
            is_solid: false,
            mesh: None,
            warnings: vec!["WARN: cut_back, step = 1".into()],
            more_warnings: 4,
        };
        let text = page(&contents).unwrap();
        for part in [
            "<!DOCTYPE html>",
            "biaxial &lt;1&gt;",
            "not converged",
            "<svg",
            "ratio",
            "fallbacks",
            "a &amp; b",
            "cut_back",
            "and 4 more",
            "no progress &amp; no hope",
            "Accuracy: 2 trials with overlap above 10 % of a diameter",
        ] {
            assert!(text.contains(part), "{part} is missing");
        }
        let place = |part: &str| text.find(part).unwrap_or_else(|| panic!("{part} is missing"));
        assert!(place("no hope") < place("<svg") && place("<svg") < place("fallbacks"), "curves come first");
        assert!(!text.contains("<td>other</td>"), "counters that are 0 are left out");
        assert!(!text.contains("former"), "former names are left out");
        assert!(!text.contains("src=") && !text.contains("href="), "the page needs no other file");
    }
    #[test]
    fn a_run_without_a_step_has_no_empty_charts() {
        let contents = Contents {
            name: "a".into(),
            summary: serde_json::from_str(r#"{"status":"not_converged","reason":"initial equilibrium"}"#).ok(),
            columns: ["step", "time", "load", "iterations", "evaluations", "ratio"].map(str::to_owned).to_vec(),
            rows: Vec::new(),
            scene: None,
            is_solid: false,
            mesh: None,
            warnings: Vec::new(),
            more_warnings: 0,
        };
        let text = page(&contents).unwrap();
        assert!(
            !text.contains("<svg") && text.contains("No step was accepted") && text.contains("initial equilibrium")
        );
    }
}
