//! One run of one case: its curve and what it cost.

use super::case::Case;
use super::window::CurveRow;
use crate::workers::measured_processor_seconds;
use anyhow::Context;
use protocol::{Observables, RveEngine, TangentKind, Tensor2, TrialFlags, TrialOptions};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rve_server::definition::{AnyDefinition, Packing, RveOptions};
use rve_server::engine::GrainEngine;
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

/// The packing of a case, each grain displaced by up to `displacement` mean radii in each direction.
///
/// # Errors
/// The packing cannot be read.
pub(super) fn packing(case: &Case, displacement: f64, seed: u64) -> anyhow::Result<Packing> {
    let mut packing: serde_json::Value = serde_json::from_str(case.packing).context("an embedded packing")?;
    if displacement > 0.0 {
        let grains = packing["grains"].as_array_mut().context("an embedded packing has grains")?;
        shake(grains, displacement, &mut ChaCha8Rng::seed_from_u64(seed));
    }
    let planar = packing["dimension"] == 2;
    Ok(if planar {
        Packing::Discs(serde_json::from_value(packing).context("an embedded packing")?)
    } else {
        Packing::Spheres(serde_json::from_value(packing).context("an embedded packing")?)
    })
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

/// Strains `packing` along the path of the case.
///
/// # Errors
/// The cell cannot be built, or a trial fails.
pub(super) fn solve(case: &Case, rve: &RveOptions, packing: &Packing) -> anyhow::Result<Run> {
    let definition = AnyDefinition::new(packing.clone(), case.contact(), rve.clone());
    let mut cell = GrainEngine.create(&definition.to_protocol()).with_context(|| format!("case {}", case.name))?;
    let planar = packing.dimension() == 2;
    let options = TrialOptions {
        tangent: TangentKind::None,
        ramp_steps: 0,
        observables: Observables::NONE,
        ..TrialOptions::default()
    };
    let still = cell.trial(&Tensor2([0.0; 9]), &options).context("the packing as given")?;
    let mut run = Run {
        curve: vec![CurveRow { strain: 0.0, stress: independent(&still.stress, planar) }],
        processor: 0.0,
        evaluations: 0,
        not_equilibrated: 0,
    };
    let busy = thread_time();
    for row in 1..=case.rows() {
        let answer = cell
            .trial(&Tensor2(case.gradient), &options)
            .with_context(|| format!("case {}, row {row}", case.name))?;
        cell.commit().context("the trial just made")?;
        run.evaluations += answer.cost.force_evaluations;
        run.not_equilibrated += u64::from(answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
        let strain = f64::from(row) * case.row_strain;
        run.curve.push(CurveRow { strain, stress: independent(&answer.stress, planar) });
    }
    run.processor = thread_time() - busy;
    Ok(run)
}

/// The independent components: xx, yy, xy in the plane, xx, yy, zz, xy, yz, xz in space.
fn independent(stress: &Tensor2, planar: bool) -> Vec<f64> {
    let places: &[usize] = if planar { &[0, 4, 1] } else { &[0, 4, 8, 1, 5, 2] };
    places.iter().map(|place| stress.0[*place]).collect()
}

/// Processor time of this thread, s; wall time where the system does not report it.
fn thread_time() -> f64 {
    measured_processor_seconds("thread-self").unwrap_or_else(|| epoch().elapsed().as_secs_f64())
}

fn epoch() -> Instant {
    static EPOCH: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    *EPOCH.get_or_init(Instant::now)
}
