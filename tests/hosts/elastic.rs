//! Agents that come late and go early: nobody has to be there from the start or until the end.

use crate::case::{Process, agent_command, macro_command, summary_of, undisturbed};
use crate::compare;
use crate::network::Network;
use crate::short_scenes::ShortScene;
use rustix::process::Signal;
use std::path::Path;
use std::time::{Duration, Instant};

/// Long enough for all that happens to it.
const SCENE: ShortScene =
    ShortScene { name: "elastic", file: "biaxial-small", set: &["mesh.elements=[1, 2]", "loading.increments=40"] };

/// How long anything may take.
const PATIENCE: Duration = Duration::from_secs(60);

/// A run that begins without any agent. One joins; while the run is paused another joins and the first is asked to leave; the first comes
/// back later. Same bytes, and no agent counts as lost.
///
/// # Errors
/// What differs, what was counted instead, or that something hangs.
pub fn check(network: &Network) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let (out, log) = (folder.path().join("out"), |name: &str| folder.path().join(name));
    undisturbed(&SCENE, &log("reference"))?;
    let mut run = Process::start(macro_command(network, 0, &SCENE, folder.path(), false), log("macro.stderr"))?;
    let agent =
        |spoke: usize, name: &str| Process::start(agent_command(network, spoke, &SCENE, folder.path()), log(name));
    eventually("the run listens", || out.join("join").exists())?;
    let mut first = agent(1, "first.stderr")?;
    eventually("a step is done", || rows(&out) > 1)?;
    control(network, &out, "pause")?;
    let second = agent(2, "second.stderr")?;
    eventually("the second agent joins", || second.said().contains("joined"))?;
    first.signal(Signal::TERM);
    eventually("the first agent leaves", || matches!(first.child.try_wait(), Ok(Some(_))))?;
    let at = rows(&out);
    control(network, &out, "resume")?;
    eventually("the second agent works alone", || rows(&out) > at)?;
    // The run may have ended before it is there.
    let _back = agent(1, "back.stderr")?;
    eventually("the run ends", || matches!(run.child.try_wait(), Ok(Some(_))))?;
    compare::same(&out, &log("reference")).map_err(|reason| format!("{reason}: {}", run.said()))?;
    let hosts = &summary_of(&out)?["hosts"];
    let count = |name: &str| hosts[name].as_u64().unwrap_or(0);
    if count("agents_joined") < 2 || count("agents_left") != 1 || count("agents_lost") != 0 {
        return Err(format!("it counted {hosts}"));
    }
    Ok(())
}

fn control(network: &Network, out: &Path, action: &str) -> Result<(), String> {
    let words = ["ctl", &out.display().to_string(), action, "--wait"].map(str::to_owned);
    let status = network.program(0, &words).status().map_err(|error| error.to_string())?;
    if status.success() { Ok(()) } else { Err(format!("`ctl {action}` ended with {status}")) }
}

/// Lines of the history, its head included.
fn rows(out: &Path) -> usize {
    std::fs::read_to_string(out.join("history.csv")).map_or(0, |text| text.lines().count())
}

fn eventually(what: &str, mut is_so: impl FnMut() -> bool) -> Result<(), String> {
    let begun = Instant::now();
    while !is_so() {
        if begun.elapsed() > PATIENCE {
            return Err(format!("waited in vain: {what}"));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}
