//! The whole of `scenes/biaxial-small.toml` on every engine outside this program, and on all of them together with the
//! built-in one: minutes, so it is run by name.
//!
//! `cargo test --release --test engines_whole -- --nocapture --test-threads 1`
//!
//! Prints the curves and times; engines that cannot be started are printed as SKIPPED, and are an error where
//! `GRAINSPAN_REQUIRE_ENGINES` names them.

#[path = "integration/engines_outside/foreign.rs"]
mod foreign;
mod harness;

use harness::Site;
use harness::table::Table;
use std::time::Instant;

/// How far independent engines differ before the peak, relative to the stress ratio.
const SCATTER: f64 = 0.01;

/// A finished run.
struct Ran {
    strain: Vec<f64>,
    ratio: Vec<f64>,
    volume: Vec<f64>,
    seconds: f64,
    summary: serde_json::Value,
}

fn run(site: &Site, name: &str, extra: &[&str]) -> Ran {
    let catalogue = site.path("engines.toml");
    std::fs::write(&catalogue, foreign::catalogue()).unwrap();
    let out = site.path(name);
    let words = ["run", "scenes/biaxial-small.toml", "--quiet", "--workers", "1", "--out", out.to_str().unwrap()];
    let begun = Instant::now();
    let ended = site.program(&[&words, extra].concat()).env("GRAINSPAN_ENGINES", catalogue).output().unwrap();
    assert!(ended.status.success(), "{name}: {}", String::from_utf8_lossy(&ended.stderr));
    let seconds = begun.elapsed().as_secs_f64();
    let history = Table::of(&site.history(name));
    let column = |name| history.column(name);
    let summary = serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
    let (strain, ratio, volume) = (column("axial_compression"), column("stress_ratio"), column("volume_change"));
    Ran { strain, ratio, volume, seconds, summary }
}

/// Prints the curves and holds them to the scatter.
fn agree(name: &str, found: &Ran, own: &Ran) {
    eprintln!("{name}: {:.0} s, built-in {:.1} s", found.seconds, own.seconds);
    eprintln!("  evaluations {}, {}", found.summary["rve_evaluations"], found.summary["fallbacks"]);
    assert_eq!(found.strain.len(), own.strain.len(), "{name}: cut-backs");
    for step in 0..own.strain.len() {
        let error = found.ratio[step] / own.ratio[step] - 1.0;
        eprintln!(
            "  {:.3} %: stress ratio {:.4} ({:+.2} %), volume change {:+.3e} ({:+.3e})",
            100.0 * own.strain[step],
            found.ratio[step],
            100.0 * error,
            found.volume[step],
            own.volume[step]
        );
        assert!(error.abs() < SCATTER, "{name}: {} {}", found.ratio[step], own.ratio[step]);
    }
}

#[test]
fn every_engine_alone_runs_the_whole_small_scene() {
    let site = Site::new();
    let own = run(&site, "own", &[]);
    for engine in foreign::ENGINES {
        if foreign::is_there(engine) {
            agree(engine, &run(&site, engine, &["--engine", engine]), &own);
        }
    }
}

/// Every engine has two of the eight elements; the rest is the built-in one's.
#[test]
fn all_engines_together_run_the_whole_small_scene() {
    let there: Vec<_> = foreign::ENGINES.into_iter().filter(|engine| foreign::is_there(engine)).collect();
    if there.is_empty() {
        return;
    }
    let site = Site::new();
    let own = run(&site, "own", &[]);
    let share = |(place, engine): (usize, &&str)| {
        let points: Vec<_> = (8 * place..8 * place + 8).map(|point| point.to_string()).collect();
        ["--set".to_owned(), format!("pool.points.{engine}=[{}]", points.join(","))]
    };
    let shares: Vec<_> = there.iter().enumerate().flat_map(share).collect();
    let shares: Vec<&str> = shares.iter().map(String::as_str).collect();
    let mixed = run(&site, "mixed", &shares);
    let engines = mixed.summary["versions"]["engines"].as_str().unwrap();
    assert!(there.iter().all(|engine| engines.contains(engine)) && engines.contains("grains"), "{engines}");
    agree(engines, &mixed, &own);
}
