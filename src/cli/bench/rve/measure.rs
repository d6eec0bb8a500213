//! One run of one case: its curve and what it cost.

use super::case::Case;
use super::window::CurveRow;
use anyhow::Context;
use protocol::TangentKind;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rve_server::definition::RveOptions;
use rve_server::element::run_element;
use std::fs;
use std::path::Path;
use std::time::Instant;

/// A curve and its price.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// Rows, the unstrained one first.
    pub(super) curve: Vec<CurveRow>,
    /// Processor time, s.
    pub(super) processor: f64,
    /// Force evaluations.
    pub(super) evaluations: u64,
    /// Rows whose relaxation ended at the step cap.
    pub(super) not_equilibrated: u64,
}

/// Mean pressure of the unstrained state, Pa: the unit of all errors.
pub(super) fn pressure(curve: &[CurveRow]) -> f64 {
    let normal = if curve[0].stress.len() == 3 { 2 } else { 3 };
    -curve[0].stress[..normal].iter().sum::<f64>() / normal as f64
}

/// Solves the case with `rve`; its packing lies in `folder`.
///
/// # Errors
/// The element test fails.
pub(super) fn solve(case: &Case, rve: &RveOptions, folder: &Path) -> anyhow::Result<Run> {
    let test = case.test_with(rve);
    let mut curve = Vec::new();
    let mut strain = 0.0;
    let busy = thread_time();
    let summary = run_element(&test, folder, TangentKind::None, &mut |row| {
        curve.push(CurveRow { strain, stress: independent(&row.stress) });
        strain += case.row_strain;
    })
    .with_context(|| format!("case {}", case.name))?;
    Ok(Run {
        curve,
        processor: thread_time() - busy,
        evaluations: summary.dem_steps,
        not_equilibrated: summary.not_equilibrated,
    })
}

/// The independent components of a plane stress: normal components first.
fn independent(stress: &[[f64; 2]; 2]) -> Vec<f64> {
    vec![stress[0][0], stress[1][1], stress[0][1]]
}

/// Writes the packing of a case to `folder`, each grain displaced by up to `displacement` mean radii in each direction.
///
/// # Errors
/// The file cannot be written.
pub(super) fn lay_out(case: &Case, folder: &Path, displacement: f64, seed: u64) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    let mut packing: serde_json::Value = serde_json::from_str(case.packing).context("an embedded packing")?;
    if displacement > 0.0 {
        let grains = packing["grains"].as_array_mut().context("an embedded packing has grains")?;
        shake(grains, displacement, &mut ChaCha8Rng::seed_from_u64(seed));
    }
    let path = folder.join("packing.json");
    fs::write(&path, packing.to_string()).with_context(|| format!("writing {}", path.display()))
}

fn shake(grains: &mut [serde_json::Value], displacement: f64, random: &mut impl Rng) {
    let radius =
        |grain: &serde_json::Value| grain.as_array().and_then(|values| values.last()?.as_f64()).unwrap_or(0.0);
    let mean = grains.iter().map(radius).sum::<f64>() / grains.len() as f64;
    for grain in grains {
        let Some(values) = grain.as_array_mut() else { continue };
        let coordinates = values.len() - 1;
        for value in &mut values[..coordinates] {
            let shift = displacement * mean * random.random_range(-1.0..1.0);
            *value = (value.as_f64().unwrap_or(0.0) + shift).into();
        }
    }
}

/// Processor time of this thread, s; wall time where the system does not tell.
fn thread_time() -> f64 {
    let told = fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| epoch().elapsed().as_secs_f64(), |value| value * 1e-9)
}

fn epoch() -> Instant {
    static EPOCH: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    *EPOCH.get_or_init(Instant::now)
}
