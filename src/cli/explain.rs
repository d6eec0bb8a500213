//! `grainspan explain [KEY]`: what the keys of input files mean, from the definitions that also check them, and the terms of the glossary.

use super::glossary;
use crate::exit::{Exit, Failure};
use crate::stdout::print;
use scene_reader::{Kind, completions, explained, mentioned, nearest_key, overview};

/// Arguments of `grainspan explain`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan explain                       all tables of a scene
  grainspan explain loading.growth        one key: meaning, unit, default, range
  grainspan explain solver                a table with its keys
  grainspan explain time step             keys whose description has these words
  grainspan explain rattler               a term of the glossary
  grainspan explain --markdown packing    the reference of packing recipes
  grainspan explain --schema scene        JSON schema for editors")]
pub(crate) struct Arguments {
    /// Key such as loading.growth, its last name, a table, or a term of the glossary; otherwise words that an explanation holds
    #[arg(value_name = "KEY")]
    key: Vec<String>,
    /// Kind of input file [default: all]
    #[arg(long, value_name = "KIND", value_parser = ["scene", "rve-test", "specimen", "packing", "study"])]
    file: Option<String>,
    /// Print the reference of a kind of input file as Markdown
    #[arg(long, value_name = "KIND", value_parser = ["scene", "rve-test", "specimen", "packing", "study"], conflicts_with = "key")]
    markdown: Option<String>,
    /// Print the JSON schema of a kind of input file
    #[arg(long, value_name = "KIND", value_parser = ["scene", "rve-test", "specimen", "packing", "study"], conflicts_with = "key")]
    schema: Option<String>,
}

/// Most keys that are listed for words which are not the name of one.
const MOST_LINES: usize = 30;

/// Prints what is asked for.
///
/// # Errors
/// There is no such key (exit code 2). Several words are a search, which fails when no key mentions them.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let kind = |word: &Option<String>| word.as_deref().and_then(|word| word.parse::<Kind>().ok());
    let text = if let Some(kind) = kind(&arguments.markdown) {
        kind.reference()
    } else if let Some(kind) = kind(&arguments.schema) {
        let schema = serde_json::to_string_pretty(&kind.schema());
        schema.map_err(|error| Failure::new(Exit::BadInput, error))? + "\n"
    } else {
        let kinds = kind(&arguments.file).map_or(Kind::ALL.to_vec(), |kind| vec![kind]);
        match arguments.key.join(" ").as_str() {
            "" => overview(kinds[0]) + "\n`grainspan explain TABLE` lists the keys of a table.\n",
            key => explanation(&kinds, key)?,
        }
    };
    print(text.as_bytes())?;
    Ok(Exit::Done)
}

fn explanation(kinds: &[Kind], key: &str) -> Result<String, Failure> {
    let mut texts = explained(kinds, key);
    texts.extend(glossary::entries(key));
    if !texts.is_empty() {
        return Ok(texts.join("\n"));
    }
    // What is written like a key is a mistake in one, not words.
    let lines = if key.contains(['_', '.']) { Vec::new() } else { mentioned(kinds, key) };
    let left = lines.len().saturating_sub(MOST_LINES);
    let more = if left > 0 { format!("and {left} more\n") } else { String::new() };
    let listed = format!("these mention it:\n{}\n{more}", lines[..lines.len() - left].join("\n"));
    if !lines.is_empty() && key.contains(char::is_whitespace) {
        return Ok(format!("no key is called '{key}'; {listed}"));
    }
    let meant = nearest_key(key).map_or_else(String::new, |meant| format!("did you mean {meant}? "));
    let hint = match lines.is_empty() {
        true => format!("{meant}`grainspan explain` lists all tables"),
        // One word may be a mistake in the name of a key as well as a search.
        false => format!("{meant}{}", listed.trim_end()),
    };
    Err(Failure::new(Exit::BadInput, format!("there is no key '{key}'\nhint: {hint}")))
}

/// Arguments of the hidden command that completion scripts call.
#[derive(clap::Args, Debug)]
pub(crate) struct CompleteArguments {
    /// Command whose `--set` is completed
    command: String,
    /// What has been typed of KEY.PATH=VALUE
    #[arg(default_value = "")]
    start: String,
}

/// Prints what `--set` may go on with, a line each.
///
/// # Errors
/// Standard output cannot be written.
pub(crate) fn complete(arguments: &CompleteArguments) -> Result<Exit, Failure> {
    let named = |kind: &Kind| kind.command() == arguments.command;
    let kind = Kind::ALL.into_iter().find(named).unwrap_or(Kind::Scene);
    let lines: String =
        completions(kind, &arguments.start).into_iter().map(|(candidate, _)| format!("{candidate}\n")).collect();
    print(lines.as_bytes())?;
    Ok(Exit::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_that_is_no_key_fails_with_the_keys_that_mention_it() {
        let failure = explanation(&Kind::ALL, "against").unwrap_err();
        assert_eq!(failure.exit, Exit::BadInput);
        assert!(failure.message.starts_with("there is no key 'against'\nhint: "), "{failure}");
        assert!(failure.message.contains("these mention it:\n"), "{failure}");
        assert!(explanation(&Kind::ALL, "friction").unwrap().contains("friction"));
    }

    #[test]
    fn several_words_are_a_search_and_what_looks_like_a_key_is_none() {
        assert!(explanation(&Kind::ALL, "time step").unwrap().contains("these mention it"));
        let failure = explanation(&Kind::ALL, "loading.grwoth").unwrap_err();
        assert!(failure.message.contains("did you mean loading.growth?"), "{failure}");
    }
}
