//! `engines.toml`: the commands behind engine names.

use crate::build_info::running_program;
use anyhow::{Context, bail};
use grain_pool::processes::Engine;
use rve_server::server::{BUILT_IN_ENGINES, built_in_engine};
use scene_reader::BUILT_IN_ENGINE;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Names the catalogue file, whatever the working directory.
const VARIABLE: &str = "GRAINSPAN_ENGINES";

/// Entry of one engine in a catalogue file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    command: Vec<String>,
    #[serde(default)]
    environment: BTreeMap<String, String>,
}

/// The engines that can be named.
#[derive(Debug, Default)]
pub(crate) struct Catalogue {
    path: Option<PathBuf>,
    engines: BTreeMap<String, Engine>,
}

impl Catalogue {
    /// Reads the catalogue: the file that `GRAINSPAN_ENGINES` names, else `engines.toml` in the working directory, else
    /// `grainspan/engines.toml` in the user's configuration folder, else nothing.
    ///
    /// # Errors
    /// The file cannot be read or is not a catalogue.
    pub(crate) fn read() -> anyhow::Result<Self> {
        if let Some(path) = std::env::var_os(VARIABLE) {
            return Self::from_file(Path::new(&path)).with_context(|| format!("named by {VARIABLE}"));
        }
        let configuration = std::env::var_os("XDG_CONFIG_HOME")
            .map(PathBuf::from)
            .or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".config")));
        let places = [Some(PathBuf::from("engines.toml")), configuration.map(|at| at.join("grainspan/engines.toml"))];
        match places.into_iter().flatten().find(|place| place.exists()) {
            Some(place) => Self::from_file(&place),
            None => Ok(Self::default()),
        }
    }

    /// Reads one file.
    fn from_file(path: &Path) -> anyhow::Result<Self> {
        let place = || format!("cannot use the engine catalogue {}", path.display());
        let text = std::fs::read_to_string(path).with_context(place)?;
        let whole = std::path::absolute(path).with_context(place)?;
        let folder = whole.parent().unwrap_or(Path::new("/")).display().to_string();
        let engines = parse(&text, &folder).with_context(place)?;
        Ok(Self { path: Some(path.to_owned()), engines })
    }

    /// The engine called `name`.
    ///
    /// # Errors
    /// There is none; the text lists the known names and the file they come from.
    pub(crate) fn find(&self, name: &str) -> anyhow::Result<Engine> {
        if built_in_engine(name).is_some() {
            return Ok(Engine::built_in(name, running_program()));
        }
        if let Some(engine) = self.engines.get(name) {
            return Ok(engine.clone());
        }
        let known: Vec<&str> = std::iter::once(BUILT_IN_ENGINE)
            .chain(BUILT_IN_ENGINES.iter().map(|engine| engine.keyword))
            .chain(self.engines.keys().map(String::as_str))
            .collect();
        let place = match &self.path {
            Some(path) => format!("{} lists", path.display()),
            None => format!("no engines.toml was found (set {VARIABLE}); there is"),
        };
        bail!("there is no engine '{name}'; {place}: {}", known.join(", "))
    }
}

fn parse(text: &str, folder: &str) -> anyhow::Result<BTreeMap<String, Engine>> {
    let entries: BTreeMap<String, Entry> = toml::from_str(text)?;
    let mut engines = BTreeMap::new();
    for (name, entry) in entries {
        if built_in_engine(&name).is_some() {
            bail!("'{name}' is an engine inside this program; choose another name");
        }
        let mut words = entry.command.iter().map(|word| word.replace("{here}", folder));
        let Some(program) = words.next() else { bail!("engine '{name}' has an empty command") };
        let engine = Engine {
            name: name.clone(),
            program: program.into(),
            arguments: words.map(OsString::from).collect(),
            environment: entry
                .environment
                .iter()
                .map(|(variable, value)| (variable.clone(), value.replace("{here}", folder)))
                .collect(),
        };
        engines.insert(name, engine);
    }
    Ok(engines)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_find_their_files_beside_the_catalogue() {
        let text =
            "[mine]\ncommand = [\"python3\", \"{here}/mine.py\"]\nenvironment = { PYTHONPATH = \"{here}/lib\" }";
        let engines = parse(text, "/opt/engines").unwrap();
        let mine = &engines["mine"];
        assert_eq!(mine.program, Path::new("python3"));
        assert_eq!(mine.arguments, ["/opt/engines/mine.py"]);
        assert_eq!(mine.environment["PYTHONPATH"], "/opt/engines/lib");
    }

    #[test]
    fn defects_of_a_catalogue_are_named() {
        assert!(parse("[mine]\ncommand = []", "/").unwrap_err().to_string().contains("empty command"));
        assert!(parse("[grains]\ncommand = [\"x\"]", "/").unwrap_err().to_string().contains("another name"));
        assert!(parse("[mine]\ncomand = [\"x\"]", "/").unwrap_err().to_string().contains("comand"));
        let missing = Catalogue::default().find("yade").unwrap_err().to_string();
        assert!(missing.contains("no engine 'yade'") && missing.contains("GRAINSPAN_ENGINES"), "{missing}");
    }
}
