//! What an engine can do is what it says itself: it is started once with `--capabilities` and prints one line of JSON.
//! That also shows, before a run begins, that it can be started here at all.

use super::Engine;
use anyhow::{Context, bail};
use protocol::Capabilities;
use rve_server::server::built_in_engine;
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How long an engine may take to say what it can do: some load half a gigabyte first.
const PATIENCE: Duration = Duration::from_secs(60);

/// Asks an engine what it can do.
///
/// # Errors
/// It cannot be started, does not answer in time, or answers with something else; with its own last words.
pub(crate) fn capabilities_of(engine: &Engine) -> anyhow::Result<Capabilities> {
    if let Some(built_in) = built_in_engine(&engine.name) {
        return Ok((built_in.create)().capabilities());
    }
    let name = &engine.name;
    let mut child = Command::new(&engine.program)
        .args(&engine.arguments)
        .arg("--capabilities")
        .envs(&engine.environment)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("engine '{name}' cannot be started: {}", engine.program.display()))?;
    // Both pipes are read while the process runs: a full pipe would keep it from ending.
    let said = drained(child.stdout.take());
    let words = drained(child.stderr.take());
    let ended = wait(&mut child).with_context(|| format!("engine '{name}'"))?;
    let (said, words) = (said.join().unwrap_or_default(), words.join().unwrap_or_default());
    let last = words.trim().lines().last().unwrap_or("it said nothing").to_owned();
    if !ended.success() {
        bail!("engine '{name}' cannot say what it can do: {ended}: {last}");
    }
    // Some engines print a banner first.
    let line = said.lines().rfind(|line| line.starts_with('{'));
    let Some(line) = line else { bail!("engine '{name}' printed no capabilities: {last}") };
    serde_json::from_str(line).with_context(|| format!("engine '{name}' printed capabilities that cannot be read"))
}

fn drained(pipe: Option<impl Read + Send + 'static>) -> std::thread::JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            // What can be read is used; the exit status tells whether something went wrong.
            let _ = pipe.read_to_end(&mut bytes);
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

fn wait(child: &mut Child) -> anyhow::Result<std::process::ExitStatus> {
    let end = Instant::now() + PATIENCE;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if Instant::now() >= end {
            let _ = child.kill();
            let _ = child.wait();
            bail!("it did not say what it can do within {} s", PATIENCE.as_secs());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn shell(script: &str) -> Engine {
        Engine {
            name: "mine".into(),
            program: "/bin/sh".into(),
            arguments: vec!["-c".into(), script.into()],
            environment: BTreeMap::new(),
        }
    }

    #[test]
    fn capabilities_are_the_last_line_of_json() {
        let script = "echo banner; echo '{\"engine\":\"mine\",\"version\":\"1\",\"dimensions\":[2],\"tangents\":[]}'";
        let capabilities = capabilities_of(&shell(script)).unwrap();
        assert_eq!((capabilities.engine.as_str(), capabilities.deterministic), ("mine", false));
    }

    #[test]
    fn an_engine_that_cannot_start_says_why() {
        let text = |engine: &Engine| format!("{:#}", capabilities_of(engine).unwrap_err());
        assert!(text(&shell("echo 'no module named x' >&2; exit 1")).contains("no module named x"));
        assert!(text(&shell("echo hello")).contains("printed no capabilities"));
        let missing = Engine { program: "/nonexistent/engine".into(), ..shell("") };
        assert!(text(&missing).contains("cannot be started"));
    }
}
