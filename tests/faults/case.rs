//! One disturbed run, and what was done to it.

use super::children::children_of;
use super::compare::same;
use super::draw::Draw;
use super::fault::{Fault, State};
use super::macros::{Macro, strike};
use super::short_scenes::{SHORT_SCENES, ShortScene};
use rustix::process::Signal;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Faulty workers of one case; those that come later are sound, so that the run reaches its end.
const FAULTY: usize = 10;

/// What was done, over all cases.
#[derive(Default)]
pub struct Tally {
    /// Faults that a worker has reported, by state and action.
    faulty: BTreeMap<String, u64>,
    /// Signals to workers and macros.
    signals: BTreeMap<String, u64>,
    resumes: u64,
    /// Seconds spent, by manner.
    seconds: BTreeMap<&'static str, f64>,
}

impl Tally {
    /// How many faults there were.
    pub fn faults(&self) -> u64 {
        self.faulty.values().chain(self.signals.values()).sum()
    }

    /// Adds what was done elsewhere.
    pub fn merge(&mut self, other: Self) {
        for (mine, theirs) in [(&mut self.faulty, other.faulty), (&mut self.signals, other.signals)] {
            theirs.into_iter().for_each(|(what, count)| *mine.entry(what).or_default() += count);
        }
        self.resumes += other.resumes;
        other.seconds.into_iter().for_each(|(manner, time)| *self.seconds.entry(manner).or_default() += time);
    }

    /// States in which no worker has failed.
    pub fn missed(&self) -> Vec<State> {
        let hit = |state: &State| self.faulty.keys().any(|what| what.starts_with(&format!("{state:?}:")));
        State::ALL.into_iter().filter(|state| !hit(state)).collect()
    }

    fn add(map: &mut BTreeMap<String, u64>, what: String) {
        *map.entry(what).or_default() += 1;
    }

    /// A table for people.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let mut by_state: BTreeMap<&str, (u64, Vec<String>)> = BTreeMap::new();
        for (what, count) in &self.faulty {
            let (state, action) = what.split_once(':').unwrap_or((what, ""));
            let entry = by_state.entry(state).or_default();
            entry.0 += count;
            entry.1.push(format!("{action} {count}"));
        }
        for (state, (count, actions)) in by_state {
            writeln!(text, "{state:<14} {count:>5}  {}", actions.join(", "))
                .expect("writing to a String cannot fail");
        }
        for (what, count) in &self.signals {
            writeln!(text, "{what:<14} {count:>5}").expect("writing to a String cannot fail");
        }
        for (manner, seconds) in &self.seconds {
            writeln!(text, "{manner:<14} {seconds:>5.0} s").expect("writing to a String cannot fail");
        }
        write!(text, "{:<14} {:>5}", "resumed", self.resumes).expect("writing to a String cannot fail");
        text
    }
}

/// A place for the output of all cases.
pub struct Site {
    folder: tempfile::TempDir,
}

impl Site {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("there is a place for temporary files") }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn arguments(&self, out: &str, scene: ShortScene, more: &[&str]) -> Vec<String> {
        let mut words = vec!["run".to_owned(), format!("scenes/{}.toml", scene.file), "--out".to_owned()];
        words.push(self.path(out).display().to_string());
        // A hang has to be noticed soon, and a storm of faults must not look like one deadly job.
        for &set in scene.set.iter().chain(&[
            "pool.hang_floor=1.5",
            "pool.hang_unknown=1.5",
            "pool.hang_factor=4.0",
            "pool.stopped_limit=0.3",
            "pool.quarantine_after=1000",
            "pool.restarts=1000",
        ]) {
            words.extend(["--set".to_owned(), set.to_owned()]);
        }
        words.extend(more.iter().map(|&word| word.to_owned()));
        words
    }

    /// Makes the undisturbed runs, so that nobody waits for them and they tell how long a run takes.
    pub fn prepare(&self) -> Result<(), String> {
        SHORT_SCENES.iter().try_for_each(|&scene| self.reference(scene).map(drop))
    }

    /// The undisturbed run of this scene, made once; returns its folder and how long it took.
    fn reference(&self, scene: ShortScene) -> Result<(PathBuf, Duration), String> {
        let name = format!("reference-{}", scene.name);
        let (folder, clock) = (self.path(&name), self.path(&format!("{name}.clock")));
        if let Ok(text) = fs::read_to_string(&clock) {
            return Ok((folder, Duration::from_secs_f64(text.parse().unwrap_or(1.0))));
        }
        let begun = Instant::now();
        let mut run =
            Macro::start(&self.arguments(&name, scene, &["--workers", "2"]), &self.path(&format!("{name}.stderr")));
        wait(&mut run, |_| {})?;
        let took = begun.elapsed();
        fs::write(&clock, took.as_secs_f64().to_string()).map_err(|error| error.to_string())?;
        Ok((folder, took))
    }

    /// Runs one case.
    pub fn run(&self, number: u64, draw: &mut Draw, tally: &mut Tally) -> Result<(), String> {
        let scene = draw.pick(&SHORT_SCENES);
        let (reference, took) = self.reference(scene)?;
        let name = format!("case-{number}");
        let begun = Instant::now();
        let (manner, ended) = match number % 3 {
            0 => ("faulty", self.faulty(&name, scene, draw, tally)),
            1 => ("struck", self.struck(&name, scene, took, draw, tally)),
            _ => ("continued", self.resumed(&name, scene, took, draw, tally)),
        };
        *tally.seconds.entry(manner).or_default() += begun.elapsed().as_secs_f64();
        let of_scene = |reason: String| format!("{}: {reason}", scene.name);
        ended.map_err(of_scene)?;
        same(&self.path(&name), &reference).map_err(of_scene)?;
        let left = fs::read_dir(format!("/dev/shm/grainspan-{}", rustix::process::getuid().as_raw()));
        let left: Vec<_> = left.into_iter().flatten().flatten().map(|entry| entry.file_name()).collect();
        let ours = format!("c{}-{number}", std::process::id());
        if left.iter().any(|name| name.to_string_lossy() == ours) {
            return Err("the run has left something in memory".to_owned());
        }
        let _ = fs::remove_dir_all(self.path(&name));
        Ok(())
    }

    /// Workers that fail in given ways at given states.
    fn faulty(&self, name: &str, scene: ShortScene, draw: &mut Draw, tally: &mut Tally) -> Result<(), String> {
        let run = format!("c{}-{}", std::process::id(), name.trim_start_matches("case-"));
        let workers = 1 + draw.below(3) as usize;
        let count = workers.to_string();
        let arguments = self.arguments(name, scene, &["--attach", &run, "--workers", &count]);
        let log = self.path(&format!("{name}.faults"));
        let engine = scene.set.iter().find_map(|set| set.strip_prefix("pool.engine="));
        let mut workers_of_run = RunWorkers { run, log: log.clone(), engine, workers: Vec::new(), hired: 0 };
        let mut r#macro = Macro::start(&arguments, &self.path(&format!("{name}.stderr")));
        let ended = wait(&mut r#macro, |_| workers_of_run.keep(workers, draw));
        drop(workers_of_run);
        for line in fs::read_to_string(&log).unwrap_or_default().lines() {
            let (what, _) = line.rsplit_once(':').unwrap_or((line, ""));
            Tally::add(&mut tally.faulty, what.to_owned());
        }
        ended
    }

    /// Signals to the run's own workers.
    fn struck(
        &self,
        name: &str,
        scene: ShortScene,
        took: Duration,
        draw: &mut Draw,
        tally: &mut Tally,
    ) -> Result<(), String> {
        let count = (1 + draw.below(3)).to_string();
        let arguments = self.arguments(name, scene, &["--workers", &count]);
        let mut left = 2 + draw.below(6);
        let pause = |draw: &mut Draw| took.mul_f64(draw.below(1000) as f64 / 2500.0);
        let mut next = Instant::now() + pause(draw);
        let mut run = Macro::start(&arguments, &self.path(&format!("{name}.stderr")));
        wait(&mut run, |pid| {
            let victims = if left > 0 && Instant::now() >= next { children_of(pid) } else { Vec::new() };
            if !victims.is_empty() {
                left -= 1;
                next = Instant::now() + pause(draw);
                let signal = draw.pick(&[Signal::KILL, Signal::KILL, Signal::SEGV, Signal::STOP, Signal::TERM]);
                strike(draw.pick(&victims), signal);
                Tally::add(&mut tally.signals, format!("worker {signal:?}"));
            }
        })
    }

    /// The macro is killed and continued.
    fn resumed(
        &self,
        name: &str,
        scene: ShortScene,
        took: Duration,
        draw: &mut Draw,
        tally: &mut Tally,
    ) -> Result<(), String> {
        let pause = ["checkpoint.seconds=0", "checkpoint.steps=1", "checkpoint.steps=2"][draw.below(3) as usize];
        let arguments = self.arguments(name, scene, &["--workers", "2", "--resume", "--set", pause]);
        let stderr = self.path(&format!("{name}.stderr"));
        for _ in 0..2 + draw.below(4) {
            let mut run = Macro::start(&arguments, &stderr);
            tally.resumes += 1;
            let deadline = Instant::now() + took.mul_f64(0.1 + draw.below(1000) as f64 / 1200.0);
            while Instant::now() < deadline && run.ended().is_none() {
                std::thread::sleep(Duration::from_millis(1));
            }
            if run.ended().is_some() {
                break;
            }
            let signal = draw.pick(&[Signal::KILL, Signal::KILL, Signal::KILL, Signal::TERM, Signal::INT]);
            strike(run.pid(), signal);
            Tally::add(&mut tally.signals, format!("macro {signal:?}"));
            let end = Instant::now() + Duration::from_secs(20);
            let status = loop {
                if let Some(status) = run.ended() {
                    break status;
                }
                if Instant::now() > end {
                    return Err(format!("a macro does not follow {signal:?}"));
                }
                std::thread::sleep(Duration::from_millis(2));
            };
            // A process that has not yet asked for its signals is ended by them at once.
            let at_once = status.signal() == Some(signal.as_raw());
            let stopped = at_once || status.success() || status.code() == Some(130);
            if !stopped {
                return Err(format!("{status} after {signal:?}: {}", run.said()));
            }
        }
        tally.resumes += 1;
        wait(&mut Macro::start(&arguments, &stderr), |_| {})
    }
}

/// Waits for the good end of a run, doing something meanwhile.
pub fn wait(run: &mut Macro, mut meanwhile: impl FnMut(u32)) -> Result<(), String> {
    loop {
        if let Some(status) = run.ended() {
            return if status.success() { Ok(()) } else { Err(format!("{status}: {}", run.said())) };
        }
        if run.is_stuck() {
            return Err(format!("the run does not end: {}", run.said()));
        }
        meanwhile(run.pid());
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Workers of an attached run, hired again when they end.
struct RunWorkers {
    run: String,
    log: PathBuf,
    /// Engine of the scene, if it names one.
    engine: Option<&'static str>,
    workers: Vec<Child>,
    hired: usize,
}

impl RunWorkers {
    fn keep(&mut self, count: usize, draw: &mut Draw) {
        self.workers.retain_mut(|worker| matches!(worker.try_wait(), Ok(None)));
        while self.workers.len() < count + usize::from(self.hired < FAULTY) {
            let mut words = vec![format!("run={}", self.run), format!("log={}", self.log.display())];
            words.extend(self.engine.map(|engine| format!("engine={engine}")));
            if self.hired < FAULTY {
                words.push(format!("fault={}", Fault::draw(draw)));
            }
            self.hired += 1;
            let program = std::env::current_exe().expect("this program lies somewhere");
            let mut command = Command::new(program);
            command.arg("worker").args(words).current_dir(env!("CARGO_MANIFEST_DIR"));
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
            self.workers.push(command.spawn().expect("a worker starts"));
        }
    }
}

impl Drop for RunWorkers {
    fn drop(&mut self) {
        // Those that were stopped or put to sleep before the run knew them do not end by themselves.
        for worker in &mut self.workers {
            let end = Instant::now() + Duration::from_millis(500);
            while matches!(worker.try_wait(), Ok(None)) && Instant::now() < end {
                std::thread::sleep(Duration::from_millis(2));
            }
            let _ = worker.kill();
            let _ = worker.wait();
        }
    }
}
