//! Capabilities of an engine: its program is started once with `--capabilities` and prints one line of JSON. This also shows,
//! before a run begins, that the program can be started on this machine.

use super::Engine;
use anyhow::{Context, bail};
use protocol::Capabilities;
use rve_server::server::built_in_engine;
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How long an engine may take to report its capabilities; some load half a gigabyte of libraries first.
const REPORT_TIMEOUT: Duration = Duration::from_secs(60);

/// Requests the capabilities of an engine.
///
/// # Errors
/// It cannot be started, does not reply in time, or replies with something else; with the last line of its standard error.
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
    let stdout = drained(child.stdout.take());
    let stderr = drained(child.stderr.take());
    let ended = wait(&mut child).with_context(|| format!("engine '{name}'"))?;
    let (stdout, stderr) = (stdout.join().unwrap_or_default(), stderr.join().unwrap_or_default());
    let last = stderr.trim().lines().last().unwrap_or("nothing on standard error").to_owned();
    if !ended.success() {
        bail!("engine '{name}' does not report its capabilities: {ended}: {last}");
    }
    // Some engines print a banner first.
    let line = stdout.lines().rfind(|line| line.starts_with('{'));
    let Some(line) = line else { bail!("engine '{name}' printed no capabilities: {last}") };
    serde_json::from_str(line).with_context(|| format!("engine '{name}' printed capabilities that cannot be read"))
}

fn drained(pipe: Option<impl Read + Send + 'static>) -> std::thread::JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            // A partial text is used too; the exit status shows whether the engine failed.
            let _ = pipe.read_to_end(&mut bytes);
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

fn wait(child: &mut Child) -> anyhow::Result<std::process::ExitStatus> {
    let end = Instant::now() + REPORT_TIMEOUT;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if Instant::now() >= end {
            let _ = child.kill();
            let _ = child.wait();
            bail!("it did not report its capabilities within {} s", REPORT_TIMEOUT.as_secs());
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
