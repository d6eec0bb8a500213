//! "did you mean": the name nearest to a wrong one.

/// The name that is most like `wrong`, if any is like it enough to be meant. A name that begins with it comes first.
pub fn nearest<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = wrong.to_lowercase();
    let distance =
        |name: &str| if name.starts_with(&lower) { 0 } else { edit_distance(&lower, &name.to_lowercase()) };
    let (distance, name) = names.into_iter().map(|name| (distance(name), name)).min()?;
    (distance <= wrong.len().div_ceil(2).min(4)).then_some(name)
}

/// Number of single-character insertions, deletions and replacements between two short names.
fn edit_distance(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (line, character) in from.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = line + 1;
        for column in 0..to.len() {
            let replaced = diagonal + usize::from(to[column] != character);
            diagonal = row[column + 1];
            row[column + 1] = replaced.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[to.len()]
}
