//! The tables of the papers' pages: the pages are written by hand, the numbers in their tables come from the committed comparisons.

use super::pages::cell;
use super::rows::{Row, Source};
use std::fmt::Write;

/// The pages, from the root of the repository.
pub(super) const PAGES: [&str; 4] =
    ["docs/papers/liu2015.md", "docs/papers/argilaga2018.md", "docs/papers/liu2018.md", "docs/papers/geotechnics.md"];

const COMMAND: &str = "`grainspan reproduce ";

/// What tables of comparisons begin with.
const TITLE: &str = "| quantity | theirs | ours | difference | tolerance | met |";

/// What the line before such a table begins with.
const ORIGIN: &str = "Table of `";

/// The page with the numbers of its tables as `sources` have them: a table belongs to the figure whose command was named last.
///
/// # Errors
/// What is wrong with the page: a table of no figure, or of one that there is not.
pub(super) fn filled(page: &str, sources: &[Source]) -> Result<String, String> {
    let mut text = String::with_capacity(page.len());
    let mut figure: Option<&str> = None;
    let mut lines = page.lines().peekable();
    while let Some(line) = lines.next() {
        if line.starts_with(ORIGIN) {
            lines.next_if(|line| line.is_empty());
            continue;
        }
        if line != TITLE {
            figure = line.rsplit_once(COMMAND).map(|(_, rest)| name(rest)).or(figure);
            text.extend([line, "\n"]);
            continue;
        }
        while lines.next_if(|line| line.starts_with('|')).is_some() {}
        let figure = figure.ok_or_else(|| format!("no line with {COMMAND}NAME` is before a table"))?;
        let start = format!("grainspan reproduce {figure} ");
        let source = sources.iter().find(|source| source.command.starts_with(&start));
        let source = source.ok_or_else(|| format!("'{figure}', which a table belongs to, is no figure"))?;
        text += &table(source);
    }
    Ok(text)
}

/// The name of the figure that a text begins with.
fn name(text: &str) -> &str {
    text.split(['`', ' ']).next().unwrap_or(text)
}

fn table(source: &Source) -> String {
    let mut text = format!(
        "{ORIGIN}{}`, {}, {}, inputs of commit {}:\n\n{TITLE}\n| --- | --- | --- | --- | --- | --- |\n",
        source.command, source.date, source.processor, source.commit
    );
    for row in &source.rows {
        writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} |",
            cell(&title(row)),
            row.theirs,
            row.ours,
            row.difference,
            row.tolerance,
            row.met
        )
        .expect("writing to a String cannot fail");
    }
    text
}

fn title(row: &Row) -> String {
    if row.source.is_empty() { row.quantity.clone() } else { format!("{} ({})", row.quantity, row.source) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(rows: Vec<Row>) -> Source {
        Source {
            origin: "[Liu2015] Fig. 1".to_owned(),
            command: "grainspan reproduce liu2015-a --size paper".to_owned(),
            date: "2026-01-02".to_owned(),
            processor: "a processor".to_owned(),
            commit: "abc".to_owned(),
            rows,
        }
    }

    fn row(theirs: &str, source: &str) -> Row {
        Row {
            entries: Vec::new(),
            quantity: "peak | q".to_owned(),
            theirs: theirs.to_owned(),
            source: source.to_owned(),
            ours: "2.000 kPa".to_owned(),
            difference: "-1.000".to_owned(),
            tolerance: "5.000 %".to_owned(),
            met: "no".to_owned(),
        }
    }

    #[test]
    fn tables_get_the_numbers_of_their_figures_and_everything_else_stays() {
        let page = "# Page\n\n`grainspan reproduce liu2015-other` and `grainspan reproduce liu2015-a --size paper` (1 min).\n\n\
                    | quantity | paper | here |\n| --- | --- | --- |\n| a | b | c |\n\n\
                    | quantity | theirs | ours | difference | tolerance | met |\n| --- |\n| old | 1 |\n| old | 2 |\n\nText.\n";
        let with = |numbers: &str| {
            let (before, rest) = page.split_once("| quantity | theirs").unwrap();
            format!(
                "{before}Table of `grainspan reproduce liu2015-a --size paper`, 2026-01-02, a processor, inputs of commit abc:\n\n\
                 {TITLE}\n| --- | --- | --- | --- | --- | --- |\n{numbers}{}",
                &rest[rest.find("\n\nText").unwrap() + 1..]
            )
        };
        let first = filled(page, &[source(vec![row("3.000 kPa", "Table I"), row("", "")])]).unwrap();
        assert_eq!(
            first,
            with(
                "| peak \\| q (Table I) | 3.000 kPa | 2.000 kPa | -1.000 | 5.000 % | no |\n\
                 | peak \\| q |  | 2.000 kPa | -1.000 | 5.000 % | no |\n"
            )
        );
        // Again, with other numbers.
        let second = filled(&first, &[source(vec![row("", "")])]).unwrap();
        assert_eq!(second, with("| peak \\| q |  | 2.000 kPa | -1.000 | 5.000 % | no |\n"));
        assert_eq!(filled(&second, &[source(vec![row("", "")])]), Ok(second.clone()));
    }

    #[test]
    fn tables_of_no_figure_are_told() {
        let table = format!("{TITLE}\n| --- |\n");
        assert!(filled(&table, &[]).unwrap_err().contains("is before a table"));
        let unknown = format!("`grainspan reproduce liu2015-b`\n{table}");
        assert_eq!(
            filled(&unknown, &[source(Vec::new())]).unwrap_err(),
            "'liu2015-b', which a table belongs to, is no figure"
        );
    }
}
