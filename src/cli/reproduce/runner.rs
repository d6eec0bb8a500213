//! Makes the runs of a figure, each in a process of its own. A scene or specimen that was interrupted is continued; what is finished
//! stays.

use super::Arguments;
use super::error::ReproduceError;
use super::figure::{At, Command, Figure, Run};
use super::inputs::Inputs;
use super::results::{Finished, Origin, Results};
use crate::exit::{Exit, Failure};
use crate::stderr::tell;
use macro_solver::output::write_atomically;
use macro_solver::pool::Interrupt;
use protocol::ContentId;
use rustix::process::{Pid, Signal, kill_process};
use rve_server::programs::specimen::SpecimenTest;
use scene_reader::Document;
use std::io::{self, Read};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process;
use std::time::{Duration, Instant};

/// Says what has run in the folder of a run, next to it; written when it is finished.
const MARK: &str = "finished.json";

/// Says what has been begun in the folder of a run, next to it: only the same is continued.
const BEGUN: &str = "begun.txt";

/// Makes all runs of a figure below `out/runs`.
///
/// # Errors
/// The first run that does not end as it should.
pub(super) fn run_all(
    figure: &Figure,
    inputs: &Inputs,
    out: &Path,
    arguments: &Arguments,
    interrupt: &Interrupt,
) -> Result<Results, Failure> {
    let runs = (figure.runs)(arguments.size);
    let count = runs.len();
    let mut finished = Vec::new();
    for (index, run) in runs.iter().enumerate() {
        let folder = out.join("runs").join(&run.name);
        tell(format_args!("run {} of {count}: {}", index + 1, run.name));
        finished.push(made(run, &folder, inputs, arguments, interrupt)?);
    }
    Ok(Results::new(finished))
}

/// The run, made now or earlier.
fn made(
    run: &Run,
    folder: &Path,
    inputs: &Inputs,
    arguments: &Arguments,
    interrupt: &Interrupt,
) -> Result<Finished, Failure> {
    let identity = identity(run, inputs)?;
    if let Some(earlier) = Finished::read(&run.name, folder, &next_to(folder, MARK))
        && earlier.identity() == identity
        && !arguments.fresh
    {
        let origin = Origin::of_now(inputs);
        if !earlier.is_of(&origin) {
            let text =
                "an earlier call finished it with another build or another state of the inputs; --fresh repeats it";
            tell(format_args!("  {text}"));
        }
        return Ok(earlier);
    }
    if arguments.draw_only {
        return Err(ReproduceError::Missing(folder.to_owned()).into());
    }
    std::fs::create_dir_all(folder).map_err(|source| macro_solver::output::OutputError::write(folder, source))?;
    let begun = next_to(folder, BEGUN);
    let resume = !arguments.fresh && std::fs::read_to_string(&begun).is_ok_and(|earlier| earlier == identity);
    write_atomically(&begun, identity.as_bytes())?;
    // From here on the folder holds a run under way, whatever an earlier one has left.
    let mark = next_to(folder, MARK);
    if let Err(source) = std::fs::remove_file(&mark)
        && source.kind() != io::ErrorKind::NotFound
    {
        return Err(macro_solver::output::OutputError::write(&mark, source).into());
    }
    if interrupt.is_raised() {
        return Err(Failure::new(Exit::Interrupted, format!("interrupted before the run '{}'", run.name)));
    }
    let clock = Instant::now();
    let (code, said) = execute(run, folder, resume, inputs, arguments, interrupt)?;
    let Some(code) = code.filter(|code| is_accepted(run.command, *code, &said)) else {
        let code = code.map_or("-".to_owned(), |code| code.to_string());
        tell(said.trim_end());
        return Err(ReproduceError::Run { name: run.name.clone(), code, folder: folder.to_owned() }.into());
    };
    let (origin, wall_s) = (Origin::of_now(inputs), clock.elapsed().as_secs_f64());
    let finished = Finished::new(&run.name, folder, identity, code, said, wall_s, origin);
    write_atomically(&mark, finished.to_json().as_bytes())?;
    Ok(finished)
}

/// Whether a run of this kind has ended as the figure allows. A refusal for any other reason, such as a disk that is full, is none that
/// the figure shows.
fn is_accepted(command: Command, code: i32, said: &str) -> bool {
    match command {
        Command::Stopping => matches!(code, 0 | 1),
        Command::Refused(words) => matches!(code, 0 | 1) || code == 2 && words.iter().any(|word| said.contains(word)),
        Command::Scene | Command::Element(_) | Command::Contacts(_) | Command::Specimen => code == 0,
    }
}

/// A file next to the folder of a run, named after it. Names of runs contain dots (`friction-0.2`), so the ending is not an extension.
fn next_to(folder: &Path, ending: &str) -> PathBuf {
    let mut name = folder.file_name().unwrap_or_default().to_owned();
    name.push(".");
    name.push(ending);
    folder.with_file_name(name)
}

/// What runs, in full: the input with its size and settings, the content of the files that it names, and the command.
fn identity(run: &Run, inputs: &Inputs) -> Result<String, Failure> {
    let document = Document::read_in_size(&inputs.file(run.input), run.size, &run.settings)?;
    let workers = run.workers.map_or_else(String::new, |count| format!(" on {count} workers"));
    let text = document.as_run(&[])?;
    let files: String =
        named_files(&document, &text).into_iter().map(|(name, content)| format!("# {name}: {content}\n")).collect();
    Ok(format!("{:?}{workers}\n{files}{text}", run.command))
}

/// The files that an input names, such as packings and meshes, with their content.
fn named_files(document: &Document, text: &str) -> Vec<(String, ContentId)> {
    fn texts(value: &toml::Value, found: &mut std::collections::BTreeSet<String>) {
        match value {
            toml::Value::String(text) => {
                found.insert(text.clone());
            }
            toml::Value::Array(values) => values.iter().for_each(|value| texts(value, found)),
            toml::Value::Table(table) => table.values().for_each(|value| texts(value, found)),
            _ => {}
        }
    }
    let mut found = std::collections::BTreeSet::new();
    texts(&toml::Value::Table(text.parse().unwrap_or_default()), &mut found);
    let content = |name: String| {
        let path = document.resolve(Path::new(&name));
        let file = path.is_file().then(|| std::fs::File::open(&path)).and_then(Result::ok)?;
        Some((name, ContentId::of_reader(file).ok()?))
    };
    found.into_iter().filter_map(content).collect()
}

/// Whether a specimen test names layers whose shear is written.
fn has_profile(run: &Run, inputs: &Inputs) -> bool {
    Document::read_in_size(&inputs.file(run.input), run.size, &run.settings)
        .and_then(|document| document.deserialize::<SpecimenTest>())
        .is_ok_and(|test| test.profile.is_some())
}

/// Starts the program for one run and waits. Returns its exit code and what it said on standard error.
fn execute(
    run: &Run,
    folder: &Path,
    resume: bool,
    inputs: &Inputs,
    arguments: &Arguments,
    interrupt: &Interrupt,
) -> Result<(Option<i32>, String), ReproduceError> {
    let own = || std::env::current_exe().unwrap_or_else(|_| PathBuf::from("grainspan"));
    let program = arguments.program.clone().unwrap_or_else(own);
    let mut command = process::Command::new(&program);
    let workers = run.workers.or(arguments.workers.map(usize::from)).map(|count| count.to_string());
    match run.command {
        Command::Scene | Command::Stopping | Command::Refused(_) => {
            command.arg("run").arg(inputs.file(run.input)).arg("--out").arg(folder);
            command.args(workers.iter().flat_map(|count| ["--workers", count]));
            command.args(resume.then_some("--resume"));
        }
        Command::Element(tangent) => {
            command.arg("element").arg(inputs.file(run.input)).arg("--out").arg(folder.join("rows.csv"));
            command.args(tangent.iter().flat_map(|kind| ["--tangent", kind]));
        }
        Command::Contacts(at) => {
            command.arg("element").arg(inputs.file(run.input)).arg("--out").arg(folder.join("rows.csv"));
            command.arg("--contacts").arg(folder.join("contacts"));
            command.args((at == At::Start).then_some(["--contacts-at", "0"]).into_iter().flatten());
        }
        Command::Specimen => {
            command.arg("specimen").arg(inputs.file(run.input)).arg("--out").arg(folder.join("rows.csv"));
            command.args(workers.iter().flat_map(|count| ["--threads", count]));
            command.arg("--checkpoint").arg(folder).args(resume.then_some("--resume"));
            if has_profile(run, inputs) {
                command.arg("--profiles").arg(folder.join("layers"));
            }
        }
    }
    command.args(run.size.iter().flat_map(|size| ["--size", size]));
    command.args(run.settings.iter().flat_map(|setting| ["--set", setting.as_str()]));
    let started =
        command.stdin(process::Stdio::null()).stdout(process::Stdio::null()).stderr(process::Stdio::piped());
    // In a group of its own: Ctrl-C in a terminal goes to every process of a group, and the run would get it twice.
    let child = started.process_group(0).spawn();
    let failed = |source| ReproduceError::Start { program, source };
    child.and_then(|child| watched(child, interrupt)).map_err(failed)
}

/// Exit code of a run that was interrupted.
const INTERRUPTED: i32 = 130;

/// Time between two looks at a run.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

/// Waits for a run, to which a stop that is requested is handed on. Returns its exit code and what it said on standard error.
fn watched(mut child: process::Child, interrupt: &Interrupt) -> io::Result<(Option<i32>, String)> {
    let run = Pid::from_child(&child);
    let mut said = child.stderr.take().expect("it is piped");
    let listener = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        said.read_to_end(&mut bytes).map(|_| bytes)
    });
    let mut is_told = false;
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if interrupt.is_raised() && !std::mem::replace(&mut is_told, true) {
            kill_process(run, Signal::INT)?;
        }
        std::thread::sleep(BETWEEN_LOOKS);
    };
    let bytes = listener.join().map_err(|_| io::Error::other("its messages were lost"))??;
    // A run that was told before it could listen has ended by the signal itself.
    let code = status.code().or_else(|| is_told.then_some(INTERRUPTED));
    Ok((code, String::from_utf8_lossy(&bytes).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full disk was taken for the refusal that a figure shows, and kept for good.
    #[test]
    fn a_refusal_counts_if_it_is_the_one_that_is_shown() {
        let shown = Command::Refused(&["unstable"]);
        assert!(is_accepted(shown, 2, "error: the kernel is unstable on this mesh"));
        assert!(!is_accepted(shown, 2, "error: could not write out/x: no space left on device"));
        assert!(is_accepted(shown, 1, "") && is_accepted(shown, 0, "") && !is_accepted(shown, 130, "unstable"));
        assert!(!is_accepted(Command::Scene, 1, "") && is_accepted(Command::Stopping, 1, ""));
    }

    #[test]
    fn the_content_of_named_files_belongs_to_the_identity() {
        let place = tempfile::tempdir().unwrap();
        let (input, packing) = (place.path().join("test.toml"), place.path().join("cell.json"));
        let text = "packing = \"cell.json\"\nother = [\"not a file\", { deeper = \"cell.json\" }]\n";
        std::fs::write(&input, text).unwrap();
        std::fs::write(&packing, "{}").unwrap();
        let files = || named_files(&Document::read(&input, &[]).unwrap(), text);
        let first = files();
        assert_eq!(first.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["cell.json"]);
        std::fs::write(&packing, "{ }").unwrap();
        assert_ne!(files(), first);
    }

    #[test]
    fn runs_whose_names_have_dots_keep_their_own_marks() {
        let mark = |name: &str| next_to(&Path::new("runs").join(name), MARK);
        assert_eq!(mark("friction-0.2"), Path::new("runs/friction-0.2.finished.json"));
        assert_ne!(mark("friction-0.2"), mark("friction-0.4"));
    }
}
