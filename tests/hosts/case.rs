//! One case: a run over three hosts, the faults that it meets, and the comparison with an undisturbed one.

use crate::children::children_of;
use crate::compare;
use crate::draw::Draw;
use crate::network::{HUB, Network, SPOKES};
use crate::short_scenes::{SHORT_SCENES, ShortScene};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// No case may take longer. What passes while this program is held up, with all that it has started, does not count.
const WATCHDOG: Duration = Duration::from_secs(120);

/// Longest time between two looks at a case that counts, on a machine that is busy and not asleep.
const LONGEST_TURN: Duration = Duration::from_secs(1);

/// Silence after which a host counts as lost, s; short, so that cases are.
const SILENCE: &str = "2";

/// What can happen. Every case meets one of these, in turn, and some more that are drawn.
pub const KINDS: [Kind; 11] = [
    Kind::AgentKilled,
    Kind::AgentStopped,
    Kind::AgentFrozen,
    Kind::WorkerKilled,
    Kind::CutShort,
    Kind::CutLong,
    Kind::CutForGood,
    Kind::Loss,
    Kind::Delay,
    Kind::MacroKilled,
    Kind::Strangers,
];

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// SIGKILL to an agent; another is started a while later.
    AgentKilled,
    /// SIGTERM to an agent; another is started.
    AgentStopped,
    /// SIGSTOP to an agent, for a while.
    AgentFrozen,
    /// SIGKILL to a worker process of an agent.
    WorkerKilled,
    /// No packet passes for less than the silence that is allowed.
    CutShort,
    /// The same for longer: the host is given up, and comes back.
    CutLong,
    /// A host is never heard of again.
    CutForGood,
    /// Packets are lost.
    Loss,
    /// Packets are late, and overtake each other.
    Delay,
    /// SIGKILL to the macro, which is resumed on another host.
    MacroKilled,
    /// Noise at the connector, and agents with another secret.
    Strangers,
}

/// What was done.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    faults: BTreeMap<Kind, u64>,
    counted: BTreeMap<String, u64>,
}

impl Tally {
    pub fn merge(&mut self, other: &Self) {
        for (kind, count) in &other.faults {
            *self.faults.entry(*kind).or_default() += count;
        }
        for (name, count) in &other.counted {
            *self.counted.entry(name.clone()).or_default() += count;
        }
    }

    pub fn faults(&self) -> u64 {
        self.faults.values().sum()
    }

    pub fn text(&self) -> String {
        let faults: Vec<String> = self.faults.iter().map(|(kind, count)| format!("{kind:?} {count}")).collect();
        let counted: Vec<String> = self.counted.iter().map(|(name, count)| format!("{name} {count}")).collect();
        format!("faults: {}\ncounted by the runs: {}", faults.join(", "), counted.join(", "))
    }
}

/// The undisturbed runs, on one host.
pub struct References {
    folder: tempfile::TempDir,
    /// How long each took, by name of the scene.
    durations: BTreeMap<&'static str, Duration>,
}

impl References {
    pub fn prepare() -> Result<Self, String> {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let mut durations = BTreeMap::new();
        for scene in SHORT_SCENES {
            let begun = Instant::now();
            undisturbed(&scene, &folder.path().join(scene.name))?;
            durations.insert(scene.name, begun.elapsed());
        }
        Ok(Self { folder, durations })
    }

    /// Draws when a fault strikes: at any time of any step, so that a faster program meets as many faults as a slower one.
    fn moment(&self, scene: &ShortScene, draw: &mut Draw) -> Moment {
        let rows = rows_of_history(&self.of(scene)).max(1);
        let step = self.durations[scene.name].as_millis() as u64 / rows;
        Moment { rows: draw.below(rows), delay: draw.below(step + 1) }
    }

    fn of(&self, scene: &ShortScene) -> PathBuf {
        self.folder.path().join(scene.name)
    }
}

/// When a fault strikes: so many milliseconds after the history has so many rows.
#[derive(Clone, Copy, Debug)]
struct Moment {
    rows: u64,
    delay: u64,
}

/// Complete rows of a run's history without its header; zero while there is none.
fn rows_of_history(out: &Path) -> u64 {
    let text = fs::read(out.join("history.csv")).unwrap_or_default();
    (text.iter().filter(|byte| **byte == b'\n').count() as u64).saturating_sub(1)
}

/// Runs a scene on one host.
///
/// # Errors
/// The run fails.
pub fn undisturbed(scene: &ShortScene, out: &Path) -> Result<(), String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_grainspan"));
    command.args(arguments(scene, out)).args(["--workers", "2"]);
    command.current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null()).stdout(Stdio::null());
    let output = command.output().map_err(|error| error.to_string())?;
    if output.status.success() {
        Ok(())
    } else {
        Err(format!("{}: {}", scene.name, String::from_utf8_lossy(&output.stderr)))
    }
}

fn arguments(scene: &ShortScene, out: &Path) -> Vec<String> {
    let mut words = vec!["run".to_owned(), format!("scenes/{}.toml", scene.file), "--quiet".to_owned()];
    words.extend(["--out".to_owned(), out.display().to_string()]);
    for key in scene.set {
        words.extend(["--set".to_owned(), (*key).to_owned()]);
    }
    words
}

/// A process of the case, ended with it.
pub struct Process {
    pub child: Child,
    log: PathBuf,
}

impl Process {
    /// What it says on standard error goes to `log`.
    pub fn start(mut command: Command, log: PathBuf) -> Result<Self, String> {
        let file = fs::OpenOptions::new().create(true).append(true).open(&log).map_err(|error| error.to_string())?;
        let child = command.stderr(file).spawn().map_err(|error| error.to_string())?;
        Ok(Self { child, log })
    }

    pub fn signal(&self, signal: Signal) {
        // `ip netns exec` becomes the program, so this is its process.
        if let Some(pid) = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw) {
            let _ = kill_process(pid, signal);
        }
    }

    /// Its last lines.
    pub fn said(&self) -> String {
        let text = fs::read_to_string(&self.log).unwrap_or_default();
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(12)..].join("\n")
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A case at work.
struct Case<'a> {
    network: &'a Network,
    scene: ShortScene,
    folder: tempfile::TempDir,
    run: Process,
    /// Host of the macro.
    macro_host: usize,
    agents: [Option<Process>; 2],
    /// Faults whose step has not come yet.
    waiting: Vec<(Moment, Kind)>,
    /// What is done later: when, and what.
    later: Vec<(Instant, Later)>,
}

#[derive(Clone, Copy, Debug)]
enum Later {
    Fault(Kind),
    StartAgent(usize),
    Continue(usize),
    Mend(usize),
    Resume,
}

/// Runs one case.
///
/// # Errors
/// What differs, or that something hangs.
pub fn run(
    number: u64,
    draw: &mut Draw,
    network: &Network,
    references: &References,
    tally: &mut Tally,
) -> Result<(), String> {
    let scene = draw.pick(&SHORT_SCENES);
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let macro_log = folder.path().join("macro.stderr");
    let run = Process::start(macro_command(network, 0, &scene, folder.path(), false), macro_log)?;
    let first = KINDS[(number % KINDS.len() as u64) as usize];
    let more = draw.below(3);
    let kinds: Vec<Kind> = std::iter::once(first).chain((0..more).map(|_| draw.pick(&KINDS))).collect();
    let waiting = kinds.into_iter().map(|kind| (references.moment(&scene, draw), kind)).collect();
    let (agents, later) = ([None, None], Vec::new());
    let mut case = Case { network, scene, folder, run, macro_host: 0, agents, waiting, later };
    for spoke in 1..=2 {
        case.start_agent(spoke)?;
    }
    let (mut spent, mut turn) = (Duration::ZERO, Instant::now());
    loop {
        case.faults_of_this_step();
        if let Some(status) = case.run.child.try_wait().map_err(|error| error.to_string())? {
            let resuming = case.later.iter().any(|(_, what)| matches!(what, Later::Resume));
            if !resuming {
                if !status.success() {
                    return Err(format!("{}: the run ended with {status}: {}", case.scene.name, case.run.said()));
                }
                break;
            }
        }
        spent += turn.elapsed().min(LONGEST_TURN);
        turn = Instant::now();
        if spent > WATCHDOG {
            let said: Vec<String> = case.agents.iter().flatten().map(Process::said).collect();
            return Err(format!(
                "{}: it hangs: {}\nagents: {}",
                case.scene.name,
                case.run.said(),
                said.join("\n--\n")
            ));
        }
        let now = Instant::now();
        let (due, rest): (Vec<_>, Vec<_>) = case.later.drain(..).partition(|(at, _)| *at <= now);
        case.later = rest;
        for (_, what) in due {
            case.act(what, draw, tally)?;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let out = case.folder.path().join("out");
    count(&out, tally);
    compare::same(&out, &references.of(&case.scene)).map_err(|reason| format!("{}: {reason}", case.scene.name))?;
    case.agents_leave()
}

/// Adds the counters of the run's summary.
fn count(out: &Path, tally: &mut Tally) {
    let Ok(summary) = summary_of(out) else { return };
    for name in ["agents_joined", "agents_left", "agents_lost", "strangers_refused", "states_kept"] {
        *tally.counted.entry(name.to_owned()).or_default() += summary["hosts"][name].as_u64().unwrap_or(0);
    }
    for name in ["workers_cut_off", "workers_lost", "workers_hung", "workers_faulty", "messages_refused"] {
        *tally.counted.entry(name.to_owned()).or_default() += summary["fallbacks"][name].as_u64().unwrap_or(0);
    }
    *tally.counted.entry("reissued_jobs".to_owned()).or_default() += summary["reissued_jobs"].as_u64().unwrap_or(0);
}

/// The summary of a run.
///
/// # Errors
/// It is missing or cannot be read.
pub fn summary_of(out: &Path) -> Result<serde_json::Value, String> {
    let text = fs::read(out.join("summary.json")).map_err(|error| format!("no summary: {error}"))?;
    serde_json::from_slice(&text).map_err(|error| format!("the summary cannot be read: {error}"))
}

/// An agent with one worker on a spoke, for the run of a scene in `folder`.
pub fn agent_command(network: &Network, spoke: usize, scene: &ShortScene, folder: &Path) -> Command {
    let join = folder.join("out/join").display().to_string();
    let engine = scene.set.iter().find_map(|key| key.strip_prefix("pool.engine=")).unwrap_or("grains");
    let words =
        ["agent", "--join", &join, "--engine", engine, "--workers", "1", "--timeout", "100", "--silence", SILENCE];
    network.program(spoke, &words.map(str::to_owned))
}

/// The run of a case on a host, which waits for agents.
pub fn macro_command(network: &Network, host: usize, scene: &ShortScene, folder: &Path, resume: bool) -> Command {
    let mut words = arguments(scene, &folder.join("out"));
    let own = ["--workers", "0", "--listen", "0.0.0.0:0", "--silence", SILENCE, "--set", "checkpoint.steps=1"];
    words.extend(own.map(str::to_owned));
    let addresses: Vec<&str> = if host == 0 { HUB.to_vec() } else { vec![SPOKES[host - 1]] };
    for address in addresses {
        words.extend(["--advertise".to_owned(), address.to_owned()]);
    }
    if resume {
        words.push("--resume".to_owned());
    }
    network.program(host, &words)
}

impl Case<'_> {
    fn start_agent(&mut self, spoke: usize) -> Result<(), String> {
        let command = agent_command(self.network, spoke, &self.scene, self.folder.path());
        let log = self.folder.path().join(format!("agent{spoke}.stderr"));
        self.agents[spoke - 1] = Some(Process::start(command, log)?);
        Ok(())
    }

    /// Faults whose step has begun strike a while later. Steps begin when the first worker has joined.
    fn faults_of_this_step(&mut self) {
        let out = self.folder.path().join("out");
        if self.waiting.is_empty() || !out.join("history.csv").exists() {
            return;
        }
        let rows = rows_of_history(&out);
        let (begun, waiting): (Vec<_>, Vec<_>) = self.waiting.drain(..).partition(|(moment, _)| moment.rows <= rows);
        self.waiting = waiting;
        for (moment, kind) in begun {
            self.after(moment.delay, Later::Fault(kind));
        }
    }

    fn after(&mut self, milliseconds: u64, what: Later) {
        self.later.push((Instant::now() + Duration::from_millis(milliseconds), what));
    }

    fn act(&mut self, what: Later, draw: &mut Draw, tally: &mut Tally) -> Result<(), String> {
        match what {
            Later::Fault(kind) => {
                *tally.faults.entry(kind).or_default() += 1;
                self.strike(kind, draw)
            }
            Later::StartAgent(spoke) => self.start_agent(spoke),
            Later::Continue(spoke) => {
                if let Some(agent) = &self.agents[spoke - 1] {
                    agent.signal(Signal::CONT);
                }
                Ok(())
            }
            Later::Mend(spoke) => {
                self.network.disturb(spoke, 0.0, 0.0);
                Ok(())
            }
            Later::Resume => {
                let command = macro_command(self.network, self.macro_host, &self.scene, self.folder.path(), true);
                self.run = Process::start(command, self.folder.path().join("macro.stderr"))?;
                Ok(())
            }
        }
    }

    fn strike(&mut self, kind: Kind, draw: &mut Draw) -> Result<(), String> {
        let spoke = 1 + draw.below(2) as usize;
        match kind {
            Kind::AgentKilled | Kind::AgentStopped => {
                if let Some(agent) = &self.agents[spoke - 1] {
                    agent.signal(if kind == Kind::AgentKilled { Signal::KILL } else { Signal::TERM });
                }
                self.after(100 + draw.below(1500), Later::StartAgent(spoke));
            }
            Kind::AgentFrozen => {
                if let Some(agent) = &self.agents[spoke - 1] {
                    agent.signal(Signal::STOP);
                }
                self.after(100 + draw.below(3000), Later::Continue(spoke));
            }
            Kind::WorkerKilled => {
                let workers = self.agents[spoke - 1].as_ref().map(|agent| children_of(agent.child.id()));
                for pid in workers.into_iter().flatten() {
                    if let Some(pid) = i32::try_from(pid).ok().and_then(Pid::from_raw) {
                        let _ = kill_process(pid, Signal::KILL);
                    }
                }
            }
            Kind::CutShort | Kind::CutLong => {
                self.network.disturb(spoke, 1.0, 0.0);
                let length = if kind == Kind::CutShort { 50 + draw.below(1200) } else { 2500 + draw.below(2500) };
                self.after(length, Later::Mend(spoke));
            }
            Kind::CutForGood => {
                // Not the host of a macro that has moved there.
                let spoke = if self.macro_host == spoke { 3 - spoke } else { spoke };
                self.network.disturb(spoke, 1.0, 0.0);
                self.later.retain(|(_, what)| !matches!(what, Later::Mend(mended) if *mended == spoke));
                // The other must stay: a run without any worker waits.
                let others = [Kind::CutForGood, Kind::AgentFrozen];
                self.later.retain(|(_, what)| !matches!(what, Later::Fault(kind) if others.contains(kind)));
                self.waiting.retain(|(_, kind)| !others.contains(kind));
            }
            Kind::Loss => self.network.disturb(spoke, 0.01 + draw.below(15) as f64 * 0.01, 0.0),
            Kind::Delay => {
                self.network.disturb(spoke, draw.below(3) as f64 * 0.01, 0.001 + draw.below(40) as f64 * 0.001)
            }
            Kind::MacroKilled => {
                if self.later.iter().any(|(_, what)| matches!(what, Later::Resume)) {
                    return Ok(());
                }
                self.run.signal(Signal::KILL);
                let _ = self.run.child.wait();
                if self.folder.path().join("out/summary.json").exists() {
                    // It had just ended.
                    self.after(0, Later::Resume);
                    return Ok(());
                }
                self.macro_host = draw.below(3) as usize;
                for spoke in 1..=2 {
                    self.network.disturb(spoke, 0.0, 0.0);
                }
                self.after(100 + draw.below(1000), Later::Resume);
            }
            Kind::Strangers => self.strangers()?,
        }
        Ok(())
    }

    /// Noise at the connector from a host, and an agent with another secret, which is told so.
    fn strangers(&self) -> Result<(), String> {
        let join = fs::read_to_string(self.folder.path().join("out/join")).unwrap_or_default();
        let Some(port) = join.split('"').find_map(|part| part.rsplit_once(':')?.1.parse::<u16>().ok()) else {
            return Ok(());
        };
        if self.macro_host != 0 {
            return Ok(());
        }
        let endpoint = format!("{}:{port}", HUB[0]);
        let secret = self.folder.path().join("wrong");
        fs::write(&secret, "a secret that is not the one").map_err(|error| error.to_string())?;
        fs::set_permissions(&secret, std::os::unix::fs::PermissionsExt::from_mode(0o600))
            .map_err(|error| error.to_string())?;
        let secret = secret.display().to_string();
        let words = ["agent", "--join", &endpoint, "--secret", &secret, "--workers", "1", "--timeout", "0"];
        let mut command = self.network.program(1, &words.map(str::to_owned));
        let mut stranger = command.stderr(Stdio::null()).spawn().map_err(|error| error.to_string())?;
        std::thread::spawn(move || {
            let _ = stranger.wait();
        });
        let noise = format!(
            "import socket,os\nfor n in range(20):\n s=socket.create_connection(('{}',{port}),1)\n s.send(os.urandom(n*50))",
            HUB[0]
        );
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.network.name(1), "python3", "-c", &noise]);
        let noise = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        let mut noise = noise.map_err(|error| error.to_string())?;
        std::thread::spawn(move || {
            let _ = noise.wait();
        });
        Ok(())
    }

    /// Agents that can hear that the run has ended leave by themselves.
    fn agents_leave(mut self) -> Result<(), String> {
        if self.later.iter().any(|(_, what)| !matches!(what, Later::Fault(_))) {
            return Ok(());
        }
        let end = Instant::now() + Duration::from_secs(1);
        while Instant::now() < end {
            if self.agents.iter_mut().flatten().all(|agent| matches!(agent.child.try_wait(), Ok(Some(_)))) {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    }
}
