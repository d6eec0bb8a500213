//! Capabilities of an engine: its program is started once with `--capabilities` and prints one line of JSON. This also shows,
//! before a run begins, that the program can be started on this machine.

use super::Engine;
use anyhow::{Context, anyhow, bail};
use protocol::Capabilities;
use rve_server::server::built_in_engine;
use std::io::{ErrorKind, Read};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// How long an engine may take to report its capabilities; some load half a gigabyte of libraries first.
const REPORT_TIMEOUT: Duration = Duration::from_secs(60);

/// Bytes of an engine's report that are kept.
const LONGEST_REPORT: usize = 1 << 20;

/// Requests the capabilities of an engine.
///
/// # Errors
/// It cannot be started, does not reply in time, or replies with something else; with the last line of its standard error.
pub(crate) fn capabilities_of(engine: &Engine) -> anyhow::Result<Capabilities> {
    capabilities_within(engine, REPORT_TIMEOUT)
}

fn capabilities_within(engine: &Engine, timeout: Duration) -> anyhow::Result<Capabilities> {
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
    let end = Instant::now() + timeout;
    let ended = wait(&mut child, end).with_context(|| format!("engine '{name}'"))?;
    // A process that a wrapper has left behind may keep a pipe open: what it has to say comes within the same time, or is missing.
    let text = |pipe: Receiver<String>| pipe.recv_timeout(end.saturating_duration_since(Instant::now()));
    let open = |_| anyhow!("engine '{name}' has ended, but a process that it started keeps its output open");
    let (stdout, stderr) = (text(stdout).map_err(open)?, text(stderr).map_err(open)?);
    let last = stderr.trim().lines().last().unwrap_or("nothing on standard error").to_owned();
    if !ended.success() {
        bail!("engine '{name}' does not report its capabilities: {ended}: {last}");
    }
    // Some engines print a banner first.
    let line = stdout.lines().rfind(|line| line.starts_with('{'));
    let Some(line) = line else {
        let printed = match stdout.trim().lines().last() {
            Some(line) => format!("its last line is \"{:.80}\"", line.trim()),
            None => "it printed nothing".to_owned(),
        };
        bail!("engine '{name}' printed no capabilities, which are a line of JSON: {printed}; {last}")
    };
    serde_json::from_str(line).with_context(|| format!("engine '{name}' printed capabilities that cannot be read"))
}

/// Reads a pipe to its end and sends the text, of which the last [`LONGEST_REPORT`] bytes are kept.
fn drained(pipe: Option<impl Read + Send + 'static>) -> Receiver<String> {
    let (send, receive) = channel();
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            let mut part = vec![0; LONGEST_REPORT];
            // A partial text is used too; the exit status shows whether the engine failed.
            loop {
                match pipe.read(&mut part) {
                    Ok(length @ 1..) => bytes.extend_from_slice(&part[..length]),
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    Ok(0) | Err(_) => break,
                }
                bytes.drain(..bytes.len().saturating_sub(LONGEST_REPORT));
            }
        }
        // Nobody waits for the text of an engine that was given up.
        let _ = send.send(String::from_utf8_lossy(&bytes).into_owned());
    });
    receive
}

fn wait(child: &mut Child, end: Instant) -> anyhow::Result<std::process::ExitStatus> {
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if Instant::now() >= end {
            let _ = child.kill();
            let _ = child.wait();
            bail!("it did not report its capabilities in time");
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

    /// A wrapper that ends while a process of its own keeps its output open would be waited for without end.
    #[test]
    fn what_an_engine_leaves_behind_is_not_waited_for() {
        let within = |script: &str| capabilities_within(&shell(script), Duration::from_millis(400));
        let text = |script: &str| format!("{:#}", within(script).unwrap_err());
        assert!(text("sleep 30 & exit 0").contains("keeps its output open"));
        assert!(text("exec sleep 30").contains("in time"));
        // Of a long report the end is kept.
        let line = "'{\"engine\":\"mine\",\"version\":\"1\",\"dimensions\":[2],\"tangents\":[]}'";
        let script = format!("head -c 5000000 /dev/zero | tr '\\0' 'x'; echo; echo {line}");
        assert_eq!(capabilities_of(&shell(&script)).unwrap().engine, "mine");
    }

    #[test]
    fn an_engine_that_cannot_start_says_why() {
        let text = |engine: &Engine| format!("{:#}", capabilities_of(engine).unwrap_err());
        assert!(text(&shell("echo 'no module named x' >&2; exit 1")).contains("no module named x"));
        let greeting = text(&shell("echo hello"));
        assert!(greeting.contains("printed no capabilities") && greeting.contains("\"hello\""), "{greeting}");
        assert!(text(&shell("true")).contains("printed nothing"));
        let missing = Engine { program: "/nonexistent/engine".into(), ..shell("") };
        assert!(text(&missing).contains("cannot be started"));
    }
}
