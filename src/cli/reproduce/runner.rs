//! Makes the runs of a figure, each in a process of its own. A scene or specimen that was interrupted is continued; what is finished
//! stays.

use super::Arguments;
use super::error::ReproduceError;
use super::figure::{Command, Figure, Run};
use super::inputs::Inputs;
use super::results::{Finished, Results};
use crate::exit::{Exit, Failure};
use crate::stderr::tell;
use macro_solver::output::write_atomically;
use macro_solver::pool::Interrupt;
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
        return Ok(earlier);
    }
    if arguments.draw_only {
        return Err(ReproduceError::Missing(folder.to_owned()).into());
    }
    std::fs::create_dir_all(folder).map_err(|source| macro_solver::output::OutputError::write(folder, source))?;
    let begun = next_to(folder, BEGUN);
    let resume = !arguments.fresh && std::fs::read_to_string(&begun).is_ok_and(|earlier| earlier == identity);
    write_atomically(&begun, identity.as_bytes())?;
    if interrupt.is_raised() {
        return Err(Failure::new(Exit::Interrupted, format!("interrupted before the run '{}'", run.name)));
    }
    let clock = Instant::now();
    let (code, said) = execute(run, folder, resume, inputs, arguments, interrupt)?;
    let accepted: &[i32] = match run.command {
        Command::Stopping => &[0, 1],
        Command::Refused => &[0, 1, 2],
        Command::Scene | Command::Element(_) | Command::Contacts | Command::Specimen => &[0],
    };
    let Some(code) = code.filter(|code| accepted.contains(code)) else {
        let code = code.map_or("-".to_owned(), |code| code.to_string());
        tell(said.trim_end());
        return Err(ReproduceError::Run { name: run.name.clone(), code, folder: folder.to_owned() }.into());
    };
    let finished = Finished::new(&run.name, folder, identity, code, said, clock.elapsed().as_secs_f64());
    write_atomically(&next_to(folder, MARK), finished.to_json().as_bytes())?;
    Ok(finished)
}

/// A file next to the folder of a run, named after it. Names of runs contain dots (`friction-0.2`), so the ending is not an extension.
fn next_to(folder: &Path, ending: &str) -> PathBuf {
    let mut name = folder.file_name().unwrap_or_default().to_owned();
    name.push(".");
    name.push(ending);
    folder.with_file_name(name)
}

/// What runs, in full: the input with its size and settings, and the command.
fn identity(run: &Run, inputs: &Inputs) -> Result<String, Failure> {
    let document = Document::read_in_size(&inputs.file(run.input), run.size, &run.settings)?;
    let workers = run.workers.map_or_else(String::new, |count| format!(" on {count} workers"));
    Ok(format!("{:?}{workers}\n{}", run.command, document.as_run(&[])?))
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
        Command::Scene | Command::Stopping | Command::Refused => {
            command.arg("run").arg(inputs.file(run.input)).arg("--out").arg(folder);
            command.args(workers.iter().flat_map(|count| ["--workers", count]));
            command.args(resume.then_some("--resume"));
        }
        Command::Element(tangent) => {
            command.arg("element").arg(inputs.file(run.input)).arg("--out").arg(folder.join("rows.csv"));
            command.args(tangent.iter().flat_map(|kind| ["--tangent", kind]));
        }
        Command::Contacts => {
            command.arg("element").arg(inputs.file(run.input)).arg("--out").arg(folder.join("rows.csv"));
            command.arg("--contacts").arg(folder.join("contacts")).args(["--contacts-at", "0"]);
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

    #[test]
    fn runs_whose_names_have_dots_keep_their_own_marks() {
        let mark = |name: &str| next_to(&Path::new("runs").join(name), MARK);
        assert_eq!(mark("friction-0.2"), Path::new("runs/friction-0.2.finished.json"));
        assert_ne!(mark("friction-0.2"), mark("friction-0.4"));
    }
}
