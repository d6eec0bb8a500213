//! `grainspan completions SHELL`: a completion script on stdout.

use super::CommandLine;
use crate::exit::{Exit, Failure};
use crate::stdout::print;
use clap::CommandFactory;
use clap_complete::Shell;

/// Arguments of `grainspan completions`.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Shell that the script is for
    shell: Shell,
}

/// Prints the script. Keys after `--set` are completed by asking this program, which knows them.
///
/// # Errors
/// Standard output cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut CommandLine::command(), "grainspan", &mut script);
    let script = with_keys(arguments.shell, &String::from_utf8_lossy(&script));
    print(script.as_bytes())?;
    Ok(Exit::Done)
}

/// Candidates of bash: whole keys end with `=`, after which no blank follows. `=` splits words in bash, so a value is completed on
/// its own.
const BASH_SET: &str = r#"--set)
                    compopt -o nospace
                    COMPREPLY=($(compgen -W "$(grainspan complete-key "${COMP_WORDS[1]:-run}" "${cur}" 2>/dev/null)" -- "${cur}"))
                    return 0"#;

const ZSH_KEYS: &str = r#"
(( $+functions[_grainspan_keys] )) ||
_grainspan_keys() {
    local -a keys
    keys=(${(f)"$(grainspan complete-key "${${(M)words:#(run|check|element|rve-test|pack|specimen|study)}[1]:-run}" "${PREFIX}" 2>/dev/null)"})
    compadd -S '' -a keys
}
"#;

const FISH_KEYS: &str = r#"complete -c grainspan -n "__fish_seen_subcommand_from run check element rve-test pack specimen study" -l set -x -a "(grainspan complete-key (commandline -opc)[2] (commandline -ct) 2>/dev/null)"
"#;

fn with_keys(shell: Shell, script: &str) -> String {
    match shell {
        Shell::Bash => {
            let mut text = String::new();
            let mut rest = script;
            while let Some((before, after)) = rest.split_once("--set)") {
                let end = after.find("return 0").map_or(0, |end| end + "return 0".len());
                text += before;
                text += BASH_SET;
                rest = &after[end..];
            }
            text += rest;
            // `=` ends a word in bash: behind it comes a value, of which nothing is known.
            let behind = "    opts=\"\"\n";
            // Right behind it bash hands over an empty word and the one before `=`; options such as `--wait=` have words of their own.
            let value = "    if [[ \"${prev}\" == \"=\" || \"${COMP_WORDS[COMP_CWORD]}\" == \"=\" && \"${prev}\" != -* ]]; then\n        return 0\n    fi\n";
            text.replacen(behind, &format!("{behind}{value}"), 1)
        }
        Shell::Zsh => {
            let script = script.replace(":KEY.PATH=VALUE:_default", ":KEY.PATH=VALUE:_grainspan_keys");
            match script.split_once("\n\n") {
                Some((head, body)) => format!("{head}\n{ZSH_KEYS}\n{body}"),
                None => script,
            }
        }
        Shell::Fish => format!("{script}{FISH_KEYS}"),
        _ => script.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn script(shell: Shell) -> String {
        let mut script = Vec::new();
        clap_complete::generate(shell, &mut CommandLine::command(), "grainspan", &mut script);
        with_keys(shell, &String::from_utf8_lossy(&script))
    }

    #[test]
    fn shells_ask_the_program_for_keys() {
        let bash = script(Shell::Bash);
        assert!(bash.matches("grainspan complete-key \"${COMP_WORDS[1]").count() >= 4);
        assert_eq!(bash.matches("\"${prev}\" == \"=\"").count(), 1);
        let zsh = script(Shell::Zsh);
        assert!(zsh.starts_with("#compdef grainspan") && zsh.matches(":_grainspan_keys").count() >= 4, "{zsh}");
        assert!(script(Shell::Fish).contains("-l set -x -a"));
    }
}
