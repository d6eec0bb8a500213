//! A pool in this process, workers as processes of the real program: what needs settings that the command line does
//! not offer.

use crate::harness::{Site, Watched, eventually, lives, signal};
use macro_solver::material::{MaterialError, PointMaterial, PointTrial};
use macro_solver::pool::{HangPolicy, Interrupt, JoiningWorkers, Pool, PoolSettings, SupplyStatus, WorkerSupply};
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort, SharedMemoryWorkerPort};
use protocol::transport::{WorkerEvent, WorkerPort};
use protocol::{Capabilities, Definition, TangentKind, Tensor2, TrialOptions};
use rustix::process::Signal;
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use std::path::Path;
use std::time::{Duration, Instant};

const POINTS: usize = 8;

type SharedPool = Pool<SharedMemoryMacroPort>;

fn definition(options: &str) -> Definition {
    let packing: PackingFile = PackingFile::read(Path::new("packings/discs-100.json")).unwrap();
    let contact = toml::from_str("law = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5").unwrap();
    let options: RveOptions = toml::from_str(options).unwrap();
    GrainDefinition { packing, contact, options }.validate().unwrap().to_protocol()
}

fn questions(strain: f64) -> Vec<PointTrial> {
    let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
    let target = |point: usize| Tensor2::from_plane([[0.0, 0.0], [0.0, -strain * (1.0 + 0.1 * point as f64)]]);
    (0..POINTS).map(|point| PointTrial { point, target: target(point), options }).collect()
}

/// A pool and this many worker processes that have joined it.
fn open(
    site: &Site,
    label: &str,
    workers: usize,
    options: &str,
    supply: Box<dyn WorkerSupply>,
    hang: HangPolicy,
) -> (SharedPool, Vec<Watched>) {
    let run = format!("t{}-{label}", std::process::id());
    let port = SharedMemoryMacroPort::create(&run, ChannelLimits::default()).unwrap();
    let settings = PoolSettings { hang, ..PoolSettings::new(run.as_str()) };
    let mut pool = Pool::new(port, supply, Interrupt::new(), settings, vec![definition(options)], &[0; POINTS]);
    let processes: Vec<_> =
        (0..workers).map(|worker| site.start(&format!("{label}-{worker}"), &["rve-server", "--run", &run])).collect();
    pool.gather(workers).unwrap();
    (pool, processes)
}

fn stresses(pool: &mut SharedPool) -> Vec<[u64; 9]> {
    let answers = pool.evaluate(&questions(1e-3)).unwrap();
    answers.iter().map(|answer| answer.stress.0.map(f64::to_bits)).collect()
}

#[test]
fn a_stopped_worker_is_ended_and_its_jobs_are_done_by_others() {
    let site = Site::new();
    let second = Duration::from_secs(1);
    let hang = HangPolicy { floor: second, factor: 1.0, unknown: second, stopped: second };
    let (mut pool, workers) = open(&site, "stop", 2, "accuracy = \"draft\"", Box::new(JoiningWorkers), hang);
    signal(workers[0].pid(), Signal::STOP);
    let disturbed = stresses(&mut pool);
    let statistics = pool.statistics();
    assert_eq!((statistics.workers_hung, statistics.workers_lost), (1, 1));
    assert!(statistics.reissued >= 1);
    pool.rollback();
    assert_eq!(stresses(&mut pool), disturbed);
    pool.close();
    for worker in workers {
        worker.end();
    }
}

/// Replaces nobody.
#[derive(Default)]
struct NoReplacement {
    lost: bool,
}

impl WorkerSupply for NoReplacement {
    fn joined(&mut self, _pid: u32) {}

    fn refused(&mut self, _pid: u32, _reason: &str) {}

    fn lost(&mut self, _pid: u32, _had_answered: bool) {
        self.lost = true;
    }

    fn tend(&mut self) -> SupplyStatus {
        if self.lost {
            return SupplyStatus::Exhausted("nobody is replaced".into());
        }
        SupplyStatus::Expected { check_again: Duration::from_secs(10) }
    }

    fn restarts(&self) -> u64 {
        0
    }

    fn finish(&mut self) {}
}

/// The whole way from the kernel's notice to the caller: below a tenth of a second. What a busy machine adds is no property of
/// the program, so the quickest of three counts.
#[test]
fn a_killed_worker_is_noticed_at_once() {
    let delays: Vec<Duration> = (0..3).map(|attempt| delay_of_a_death(&format!("kill{attempt}"))).collect();
    assert!(delays.iter().min() < Some(&Duration::from_millis(100)), "{delays:?}");
}

fn delay_of_a_death(label: &str) -> Duration {
    let site = Site::new();
    // Minutes of work: the worker dies in the middle of it.
    let slow = "strain_per_step = 1e-10";
    let (mut pool, workers) = open(&site, label, 1, slow, Box::new(NoReplacement::default()), HangPolicy::default());
    let victim = workers[0].pid();
    let killer = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(200));
        signal(victim, Signal::KILL);
        Instant::now()
    });
    let error = pool.evaluate(&questions(1e-2)).unwrap_err();
    let noticed = Instant::now();
    let delay = noticed.duration_since(killer.join().unwrap());
    assert!(matches!(error, MaterialError::WorkersLost(_)), "{error}");
    delay
}

/// A worker of another build is told why it may not take part; the others go on.
#[test]
fn another_protocol_version_is_refused_with_words() {
    let site = Site::new();
    let (mut pool, workers) =
        open(&site, "version", 1, "accuracy = \"draft\"", Box::new(JoiningWorkers), HangPolicy::default());
    let run = format!("t{}-version", std::process::id());
    let stranger = std::thread::spawn(move || {
        let mut port = SharedMemoryWorkerPort::join(&run, Duration::from_secs(5)).unwrap();
        let capabilities = Capabilities {
            engine: "grains".into(),
            version: "0".into(),
            dimensions: vec![2],
            tangents: TangentKind::ALL.to_vec(),
            ..Capabilities::default()
        };
        let pid = std::process::id();
        port.send_control(&FromWorker::Hello { protocol: 999, run, pid, capabilities, state_cache: 1 }).unwrap();
        let mut refusal = None;
        let end = Instant::now() + Duration::from_secs(20);
        while refusal.is_none() && Instant::now() < end {
            port.poll(Duration::from_secs(1), &mut |event| {
                if let WorkerEvent::Control(ToWorker::Refused { reason }) = event {
                    refusal = Some(reason);
                }
            })
            .unwrap();
        }
        refusal.expect("a refusal within 20 s")
    });
    eventually("refusal", || {
        assert_eq!(stresses(&mut pool).len(), POINTS);
        (pool.statistics().workers_refused == 1).then_some(())
    });
    let reason = stranger.join().unwrap();
    assert!(reason.contains("version 999") && reason.contains("same build"), "{reason}");
    assert_eq!(pool.workers(), 1);
    pool.close();
    for worker in workers {
        let pid = worker.pid();
        assert!(worker.end().status.success());
        assert!(!lives(pid));
    }
}
