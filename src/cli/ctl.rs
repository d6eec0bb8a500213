//! `grainspan ctl`: pauses, resumes, saves or stops the run that writes to a folder, between two of its steps.

use crate::exit::{Exit, Failure};
use crate::stdout::print;
use crate::workers::run_that_writes_to;
use page::{Action, Controls, NO_CHECKPOINTS, NOT_SAVED, PAUSED, RunFolder};
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

/// What a request to save and end or wait comes to in a run without checkpoints.
const NOTHING_SAVED: &str = ", and saves nothing: its scene says checkpoint.enabled = false";

/// Between two looks at the run.
const PAUSE: Duration = Duration::from_millis(50);

/// Arguments of `grainspan ctl`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan ctl out/biaxial pause
  grainspan ctl out/biaxial checkpoint --wait
  grainspan ctl out/biaxial stop --wait && \\
      grainspan run scenes/biaxial.toml --resume

Requests act after the step that is being solved. None of them changes a result.")]
pub(crate) struct Arguments {
    /// Output folder of a live run
    folder: PathBuf,
    /// What the run shall do
    #[arg(value_enum)]
    action: Request,
    /// Return when it has been done, not when it has been requested
    #[arg(long)]
    wait: bool,
}

/// What a run can be asked for.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Request {
    /// Save the state and wait after the current step
    Pause,
    /// Go on
    Resume,
    /// Save the state after the current step
    Checkpoint,
    /// Save the state and end after the current step; `run --resume` continues
    Stop,
}

impl Request {
    fn action(self) -> Action {
        match self {
            Self::Pause => Action::Pause,
            Self::Resume => Action::Resume,
            Self::Checkpoint => Action::Checkpoint,
            Self::Stop => Action::Stop,
        }
    }
}

/// Leaves the request in the folder.
///
/// # Errors
/// No run writes to the folder, the request cannot be written, or the run ended before it was carried out.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let bad = |error| Failure::new(Exit::BadInput, error);
    let folder = RunFolder::open(&arguments.folder).map_err(bad)?;
    let place = arguments.folder.display();
    if !is_alive(folder.path()) {
        return Err(bad(page::PageError(format!(
            "no run writes to {place} now\nhint: `grainspan status` lists the live runs with their folders"
        ))));
    }
    let (action, controls) = (arguments.action.action(), Controls::of(folder.path()));
    if action == Action::Checkpoint && controls.has(NO_CHECKPOINTS) {
        let reason = format!("the run in {place} keeps no checkpoints: its scene says checkpoint.enabled = false");
        return Err(bad(page::PageError(reason)));
    }
    // The folder of the requests goes with the run.
    let saves_nothing = action != Action::Resume && controls.has(NO_CHECKPOINTS);
    let unsaved = if saves_nothing { NOTHING_SAVED } else { "" };
    controls.request(action).map_err(bad)?;
    if !arguments.wait {
        let when = if action == Action::Resume { "goes on" } else { "acts after its current step" };
        print(format!("{}: the run in {place} {when}{unsaved}\n", action.keyword()).as_bytes())?;
        return Ok(Exit::Done);
    }
    while !is_done(action, &controls, folder.path()) {
        if !is_alive(folder.path()) {
            let reason = format!("the run in {place} ended before it could {}", action.keyword());
            return Err(bad(page::PageError(reason)));
        }
        sleep(PAUSE);
    }
    if action != Action::Resume
        && let Some(reason) = controls.text(NOT_SAVED)
    {
        let (goes_on, hint) = match action {
            Action::Pause => ("it is paused", "make room on the disk and ask for a checkpoint"),
            Action::Stop => ("it has ended", "make room on the disk; `--resume` begins with the checkpoint before"),
            Action::Checkpoint | Action::Resume => ("it goes on", "make room on the disk and ask again"),
        };
        let text = format!("the run in {place} could not save its state; {goes_on}: {}", reason.trim());
        return Err(bad(page::PageError(format!("{text}\nhint: {hint}"))));
    }
    let unsaved = if saves_nothing { "; nothing was saved: its scene says checkpoint.enabled = false" } else { "" };
    print(format!("{}: done{unsaved}\n", action.keyword()).as_bytes())?;
    Ok(Exit::Done)
}

fn is_done(action: Action, controls: &Controls, folder: &Path) -> bool {
    match action {
        Action::Pause => controls.has(PAUSED),
        Action::Resume => !controls.has(PAUSED),
        Action::Checkpoint => !controls.asks(action),
        Action::Stop => !controls.asks(action) && !is_alive(folder),
    }
}

/// Whether a run writes to the folder: one of this machine by its record, one of another machine by its lock.
fn is_alive(folder: &Path) -> bool {
    let is_locked = || {
        let lock = File::open(folder).map(|folder| folder.try_lock_shared());
        matches!(lock, Ok(Err(TryLockError::WouldBlock)))
    };
    run_that_writes_to(folder).is_some() || is_locked()
}
