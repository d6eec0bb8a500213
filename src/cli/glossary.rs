//! The glossary of the documents, for `grainspan explain`.

/// The page; its tables have a row for each term: names, separated by commas, then the meaning.
const PAGE: &str = include_str!("../../docs/reference/glossary.md");

/// The entries whose names include `word`, without regard to case; of several words in a name each counts as well, where no whole name does.
pub(super) fn entries(word: &str) -> Vec<String> {
    let wanted = word.trim().to_lowercase();
    let rows: Vec<(Vec<String>, String)> = PAGE.lines().filter_map(row).collect();
    let chosen = |is_meant: &dyn Fn(&str) -> bool| -> Vec<String> {
        let met = rows.iter().filter(|(names, _)| names.iter().any(|name| is_meant(name)));
        met.map(|(names, meaning)| format!("{}: {meaning}\n", names.join(", "))).collect()
    };
    let whole = chosen(&|name| name.to_lowercase() == wanted);
    if !whole.is_empty() || wanted.is_empty() {
        return whole;
    }
    chosen(&|name| name.to_lowercase().split_whitespace().any(|part| part == wanted))
}

/// Names and meaning of a row of a table, in plain text.
fn row(line: &str) -> Option<(Vec<String>, String)> {
    let mut cells = line.strip_prefix('|')?.split(" | ").map(|cell| plain(cell.trim().trim_end_matches('|')));
    let (names, meaning) = (cells.next()?, cells.next()?);
    let is_entry = names != "term" && !names.starts_with("---");
    is_entry.then(|| (names.split(',').map(|name| name.trim().to_owned()).collect(), meaning))
}

/// Without the marks of code and without the targets of links.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, link)) = rest.split_once('[') {
        plain += before;
        let parts = link.split_once(']').and_then(|(shown, behind)| {
            let target = behind.strip_prefix('(')?;
            Some((shown, target.split_once(')')?.1))
        });
        match parts {
            Some((shown, behind)) => {
                plain += shown;
                rest = behind;
            }
            None => {
                plain.push('[');
                rest = link;
            }
        }
    }
    (plain + rest).replace('`', "").trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_are_found_by_any_of_their_names() {
        for word in ["rattler", "RVE", "cell", "K0", "snap", "k_n", "replica", "coordination number", "fabric"] {
            let found = entries(word);
            assert!(!found.is_empty() && found.iter().all(|entry| entry.contains(": ")), "{word}: {found:?}");
            assert!(found.iter().all(|entry| !entry.contains('`') && !entry.contains("](")), "{found:?}");
        }
        assert!(entries("operator").iter().any(|entry| entry.starts_with("tangent operator: ")));
        assert!(entries("no such term").is_empty() && entries("term").is_empty() && entries("").is_empty());
    }

    #[test]
    fn every_row_has_a_meaning() {
        let rows: Vec<_> = PAGE.lines().filter_map(row).collect();
        assert!(rows.len() > 50, "{}", rows.len());
        assert!(rows.iter().all(|(names, meaning)| names.iter().all(|name| !name.is_empty()) && meaning.len() > 10));
    }

    #[test]
    fn links_and_code_become_plain_text() {
        assert_eq!(plain("a `b` of [c](d.md#e), [Liu2018] and [f](g)"), "a b of c, [Liu2018] and f");
    }
}
