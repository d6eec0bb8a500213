//! Documents, help, messages and names in the sources use the words of the field.

use super::text::{documents, files, lines, no_faults, prose, read};

/// Words that have a meaning of their own in the field, or none, and phrases that a plain sentence replaces. Code spans are exempt:
/// keys and old names may have to be written.
const BANNED: [&str; 44] = [
    "a lot of its own",
    "abreast",
    "anew",
    "asked elsewhere",
    "beacon",
    "beacons",
    "beside",
    "border guard",
    "border to c",
    "condemn",
    "condemned",
    "creep",
    "creeping",
    "creeps",
    "crept",
    "crew",
    "culprit",
    "deadly",
    "dealt out",
    "desk",
    "equal questions",
    "fell short",
    "foresees",
    "foretells",
    "in words",
    "is told",
    "keeper",
    "last words",
    "nobody",
    "null targets",
    "process border",
    "pulls nothing",
    "question",
    "questions",
    "remember their way",
    "roster",
    "rota",
    "shelf",
    "so many",
    "somebody",
    "turned down",
    "vitals",
    "with words",
    "yardstick",
];

/// Words of a text without punctuation, in lower case, with single spaces.
fn words(text: &str) -> String {
    let plain: String = text
        .to_lowercase()
        .chars()
        .map(|letter| if letter.is_alphanumeric() || ['-', '_'].contains(&letter) { letter } else { ' ' })
        .collect();
    format!(" {} ", plain.split_whitespace().collect::<Vec<_>>().join(" "))
}

fn banned_in(text: &str) -> Vec<&'static str> {
    let text = words(text);
    BANNED.into_iter().filter(|word| text.contains(&format!(" {word} "))).collect()
}

#[test]
fn documents_use_the_words_of_the_field() {
    let mut faults = Vec::new();
    for document in documents(&files()) {
        for (number, line, code) in lines(&read(&document)) {
            let found = if code { Vec::new() } else { banned_in(&prose(line)) };
            faults.extend(found.iter().map(|word| format!("{document}:{number}: \"{word}\"")));
        }
    }
    no_faults(&faults);
}

#[test]
fn help_uses_the_words_of_the_field() {
    let Some(program) = option_env!("CARGO_BIN_EXE_grainspan") else { return };
    let help = |arguments: &[&str]| {
        let output = std::process::Command::new(program).args(arguments).arg("--help").output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let main = help(&[]);
    let commands = main.split("Commands:").nth(1).expect("the help lists commands");
    let named = commands.lines().skip(1).take_while(|line| line.starts_with("  "));
    let named: Vec<&str> =
        named.filter(|line| !line.starts_with("   ")).filter_map(|line| line.split_whitespace().next()).collect();
    assert!(named.len() > 5, "{named:?}");
    let mut faults = Vec::new();
    for command in named.into_iter().filter(|command| *command != "help") {
        faults.extend(
            banned_in(&help(&[command])).iter().map(|word| format!("grainspan {command} --help: \"{word}\"")),
        );
    }
    faults.extend(banned_in(&main).iter().map(|word| format!("grainspan --help: \"{word}\"")));
    no_faults(&faults);
}

/// String literals of a Rust source with the lines on which they begin; comments, character literals and inline tests left out.
fn literals(text: &str) -> Vec<(usize, String)> {
    let sources = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let letters: Vec<char> = sources.chars().collect();
    let (mut at, mut line, mut found) = (0, 1, Vec::new());
    while at < letters.len() {
        match letters[at] {
            '/' if letters.get(at + 1) == Some(&'/') => {
                while at < letters.len() && letters[at] != '\n' {
                    at += 1;
                }
                continue;
            }
            // `'"'` and `'\"'`.
            '\'' if letters.get(at + 1) == Some(&'"') || letters.get(at + 1) == Some(&'\\') => at += 3,
            '"' => {
                let (begin, mut literal) = (line, String::new());
                at += 1;
                while at < letters.len() && letters[at] != '"' {
                    if letters[at] == '\\' {
                        at += 1;
                        literal.push(' ');
                    } else {
                        literal.push(letters[at]);
                    }
                    line += usize::from(letters.get(at) == Some(&'\n'));
                    at += 1;
                }
                found.push((begin, literal));
            }
            '\n' => line += 1,
            _ => {}
        }
        at += 1;
    }
    found
}

/// Error messages, help and names of columns. Names with underscores are one word: old names of keys and counters may be read.
#[test]
fn messages_use_the_words_of_the_field() {
    let product = |path: &&String| {
        path.ends_with(".rs")
            && !path.starts_with("tests/")
            && !["/tests/", "/examples/", "tests.rs", "_tests.rs"].iter().any(|part| path.contains(part))
    };
    let mut faults = Vec::new();
    let mut checked = 0;
    for file in files().iter().filter(product) {
        for (line, literal) in literals(&read(file)) {
            checked += 1;
            // A single word is a name: a former key or keyword that is still read.
            let is_text = literal.contains(' ');
            let found = if is_text { banned_in(&prose(&literal)) } else { Vec::new() };
            faults.extend(found.iter().map(|word| format!("{file}:{line}: \"{word}\"")));
        }
    }
    assert!(checked > 1000, "literals were found: {checked}");
    no_faults(&faults);
}

/// Parts of a name of code: `asked_for` and `AskedFor` as `asked`, `for`.
fn parts_of_name(name: &str) -> Vec<String> {
    let mut parts: Vec<String> = Vec::new();
    for word in name.split('_') {
        let mut begins = true;
        for letter in word.chars() {
            if begins || letter.is_uppercase() {
                parts.push(String::new());
            }
            begins = false;
            parts.last_mut().expect("a part has begun").extend(letter.to_lowercase());
        }
    }
    parts
}

/// Words that are metaphors as names of modules, types, functions, traits and constants.
const BANNED_NAMES: [&str; 14] = [
    "abreast",
    "beacon",
    "creep",
    "crew",
    "culprit",
    "deadly",
    "desk",
    "keeper",
    "patience",
    "rota",
    "roster",
    "shelf",
    "vitals",
    "yardstick",
];

/// Names that a line defines.
fn defined(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let line = line.strip_prefix("pub(crate) ").or_else(|| line.strip_prefix("pub(super) ")).unwrap_or(line);
    let line = line.strip_prefix("pub ").unwrap_or(line);
    let kinds = ["fn ", "struct ", "enum ", "trait ", "mod ", "const ", "type "];
    let rest = kinds.iter().find_map(|kind| line.strip_prefix(kind))?;
    rest.split(|letter: char| !letter.is_alphanumeric() && letter != '_').next()
}

#[test]
fn names_in_sources_use_the_words_of_the_field() {
    let mut faults = Vec::new();
    let mut checked = 0;
    let product = |path: &&String| path.ends_with(".rs") && !path.contains("tests");
    for file in files().iter().filter(product) {
        let text = read(file);
        let sources = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(&text);
        for (index, line) in sources.lines().enumerate() {
            let Some(name) = defined(line) else { continue };
            checked += 1;
            let capitals = name.chars().all(|letter| !letter.is_lowercase());
            let name = if capitals { name.to_lowercase() } else { name.to_owned() };
            let found = parts_of_name(&name).into_iter().filter(|part| BANNED_NAMES.contains(&part.as_str()));
            faults.extend(found.map(|part| format!("{file}:{}: \"{part}\" in `{name}`", index + 1)));
        }
    }
    assert!(checked > 1000, "names were found: {checked}");
    no_faults(&faults);
}

/// Most words of a sentence outside the lab book, the changelog and generated tables.
const LONGEST_SENTENCE: usize = 46;

/// Paragraphs and list entries of a document with their first lines; headings, tables and blocks of code left out.
fn paragraphs(text: &str) -> Vec<(usize, String)> {
    let mut found: Vec<(usize, String)> = Vec::new();
    let mut goes_on = false;
    for (number, line, code) in lines(text) {
        let line = line.trim();
        if code || line.is_empty() || line.starts_with(['|', '#']) {
            goes_on = false;
            continue;
        }
        let numbered = line.split_once(". ").filter(|(head, _)| head.parse::<u32>().is_ok()).map(|(_, rest)| rest);
        let entry = line.strip_prefix("* ").or_else(|| line.strip_prefix("- ")).or(numbered);
        match found.last_mut() {
            Some((_, paragraph)) if goes_on && entry.is_none() => *paragraph += &format!(" {line}"),
            _ => found.push((number, entry.unwrap_or(line).to_owned())),
        }
        goes_on = true;
    }
    found
}

/// Numbers of words of the sentences of a paragraph; a code span is one word. Colons and semicolons end a sentence too.
fn sentence_lengths(paragraph: &str) -> Vec<usize> {
    let spans_as_words: Vec<&str> =
        paragraph.split('`').enumerate().map(|(index, part)| if index % 2 == 0 { part } else { "X" }).collect();
    let plain = prose(&spans_as_words.concat());
    let mut lengths = vec![0];
    for word in plain.split_whitespace() {
        *lengths.last_mut().expect("there is a sentence") += usize::from(word.contains(char::is_alphanumeric));
        if word.trim_end_matches(['*', ')', ']', '"']).ends_with(['.', '!', '?', ':', ';']) {
            lengths.push(0);
        }
    }
    lengths
}

#[test]
fn sentences_are_short() {
    let mut faults = Vec::new();
    let held = |document: &&String| {
        !["docs/lab-book/", "docs/reference/keys-"].iter().any(|part| document.starts_with(part))
            && *document != "CHANGELOG.md"
    };
    for document in documents(&files()).iter().filter(held) {
        for (number, paragraph) in paragraphs(&read(document)) {
            let long = sentence_lengths(&paragraph).into_iter().filter(|length| *length > LONGEST_SENTENCE);
            faults.extend(long.map(|length| format!("{document}:{number}: a sentence of {length} words")));
        }
    }
    no_faults(&faults);
}

#[test]
fn parts_of_this_test_work() {
    assert_eq!(banned_in("A body CREEPS, so many."), ["creeps", "so many"]);
    assert_eq!(literals("f('\"', \"a b\"); // \"c\"\ng(\"d\");"), [(1, "a b".to_owned()), (2, "d".to_owned())]);
    assert_eq!(defined("    pub(super) fn of_crew(a: f64) {"), Some("of_crew"));
    assert_eq!(sentence_lengths("One `a b c` two. Three: four."), [3, 1, 1, 0]);
    assert_eq!(
        paragraphs("a\nb\n* c\n  d\n\n| e |\n2. f"),
        [(1, "a b"), (3, "c d"), (7, "f")].map(|(n, p)| (n, p.to_owned()))
    );
    assert_eq!(parts_of_name("StateKeeper"), ["state", "keeper"]);
    assert_eq!(prose("a `creep` [x](creep.md) b"), "a   [x  b");
}
