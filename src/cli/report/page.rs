//! The page: what happened first, then the curves, then everything else.

use super::contents::Contents;
use crate::cli::bench::chart::{Chart, Scale};
use crate::cli::bench::table::short;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use plotters::drawing::DrawingAreaErrorKind;
use serde_json::Value;

const STYLE: &str = "body{font:15px/1.45 sans-serif;margin:2em auto;max-width:72em;padding:0 1em;color:#222}\
h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em;border-bottom:1px solid #ccc}\
table{border-collapse:collapse}td,th{padding:.15em .8em .15em 0;text-align:left;vertical-align:top}\
td.number{text-align:right;font-variant-numeric:tabular-nums}\
.curves{display:grid;grid-template-columns:repeat(auto-fill,minmax(22em,1fr));gap:1em}.curves svg{width:100%;height:auto}\
.facts{display:grid;grid-template-columns:repeat(auto-fill,minmax(20em,1fr));gap:0 2em}\
pre{background:#f5f5f5;padding:.8em;overflow-x:auto;font-size:.88em}.bad{color:#a02000}";

/// Columns that are not drawn over time.
const NOT_DRAWN: [&str; 4] = ["step", "time", "load", "stage"];

/// The whole page as text.
///
/// # Errors
/// The drawing library refuses.
pub(super) fn page(contents: &Contents) -> Result<String, DrawingAreaErrorKind<std::io::Error>> {
    let curves = curves(contents)?;
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head { meta charset="utf-8"; title { "Grainspan: " (contents.name) } style { (PreEscaped(STYLE)) } }
            body {
                h1 { (contents.name) ": " (status(contents)) }
                (facts(contents.summary.as_ref()))
                h2 { "Curves over time" }
                div.curves { @for curve in &curves { div { (PreEscaped(curve)) } } }
                h2 { "Warnings of the log" }
                (warnings(contents))
                @if let Some(scene) = &contents.scene { h2 { "The scene as run" } pre { (scene) } }
            }
        }
    };
    Ok(markup.into_string())
}

fn status(contents: &Contents) -> Markup {
    let said = contents.summary.as_ref().and_then(|summary| summary.get("status")).and_then(Value::as_str);
    match said {
        Some("done") => html! { "done" },
        Some(other) => html! { span.bad { (other.replace('_', " ")) } },
        None => html! { span.bad { "not ended (no summary.json)" } },
    }
}

/// The summary: plain values in one table, each group of values in one of its own.
fn facts(summary: Option<&Value>) -> Markup {
    let entries: Vec<(&String, &Value)> = summary.and_then(Value::as_object).into_iter().flatten().collect();
    let plain: Vec<_> =
        entries.iter().copied().filter(|(key, value)| !value.is_object() && *key != "status").collect();
    let groups = entries.iter().filter_map(|(key, value)| Some((key, value.as_object()?)));
    html! {
        div.facts {
            div { h2 { "Run" } (table(plain)) }
            @for (key, group) in groups {
                div { h2 { (key.replace('_', " ")) } @if group.is_empty() { p { "none" } } @else { (table(group)) } }
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

/// One picture for each column of numbers.
fn curves(contents: &Contents) -> Result<Vec<String>, DrawingAreaErrorKind<std::io::Error>> {
    let time = contents.column("time");
    let drawn = contents.columns.iter().filter(|column| !NOT_DRAWN.contains(&column.as_str()));
    drawn
        .map(|column| {
            let mut chart = Chart::new(column, ("time, s", Scale::Linear), ("", Scale::Linear));
            chart.curve(column, time.iter().zip(contents.column(column)).map(|(time, value)| [*time, value]));
            chart.to_svg()
        })
        .collect()
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
                r#"{"status":"not_converged","steps":3,"fallbacks":{"tangent":2},"skipped":{}}"#,
            )
            .ok(),
            columns: ["step", "time", "load", "ratio"].map(str::to_owned).to_vec(),
            rows: vec![vec![0.0, 0.0, 0.0, 1.0], vec![1.0, 0.5, 0.5, 1.4]],
            scene: Some("name = \"a & b\"".into()),
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
        ] {
            assert!(text.contains(part), "{part} is missing");
        }
        assert!(!text.contains("src=") && !text.contains("href="), "the page needs nothing beside it");
    }
}
