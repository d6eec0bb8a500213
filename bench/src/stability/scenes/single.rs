//! One small scene again: its steps, and those of the finer runs that it is compared with.

use super::super::packings::Slot;
use super::super::tables::accuracy;
use super::check::found;
use super::draw::Scene;
use crate::newton::case::StrategyRun;
use crate::report::Report;
use crate::table::Table;

/// Runs the scene of a number, and finer ones if it is to be `checked`, and shows the mean stress and the cost of every step of every run.
///
/// # Errors
/// A packing or a mesh that cannot be made, a worker that ends early, or a report that cannot be written.
pub(in super::super) fn run(
    seed: u64,
    number: u64,
    slots: &[Slot],
    checked: bool,
    report: &mut Report,
) -> anyhow::Result<()> {
    let scene = Scene::sampled(seed, number, slots);
    let slot = &slots[scene.slot];
    report.note(&format!(
        "scene {number} of seed {seed}, {}, packing {}\n{scene:#?}",
        scene.range.name(),
        slot.name
    ))?;
    let mut table = Table::new([
        "strain_per_step_over",
        "tolerance_over",
        "step",
        "load_%",
        "sigma_xx_Pa",
        "sigma_yy_Pa",
        "sigma_zz_Pa",
        "sigma_xy_Pa",
        "strain_per_step",
        "error_by_strain_per_step",
        "error_by_balance",
        "iterations",
        "evaluations",
    ]);
    let mut record = |[strain, tolerance]: [f64; 2], run: &StrategyRun| {
        for step in &run.steps {
            let [xx, xy, _, _, yy, _, _, _, zz] = step.stress;
            table.row([
                strain.into(),
                tolerance.into(),
                step.report.step.into(),
                (100.0 * step.report.load).into(),
                xx.into(),
                yy.into(),
                zz.into(),
                xy.into(),
                step.report.accuracy.strain_per_step.into(),
                step.report.accuracy.estimate.map_or(f64::NAN, |error| error.of_mean).into(),
                step.report.accuracy.balance.map_or(f64::NAN, |error| error.of_mean).into(),
                step.report.iterations.into(),
                step.report.evaluations.into(),
            ]);
        }
    };
    let finding = found(&scene, slot, checked, &mut record)?;
    report.table("steps", "mean stress at the end of each step", &table)?;
    report.note(&format!(
        "\n{}: {}; error {:.4} of the mean pressure, bound {}, gap {:.4}; {} evaluations, {} cut-backs, {} stabilised steps",
        accuracy(&scene.options),
        finding.class,
        finding.error,
        finding.bound,
        finding.gap,
        finding.run.run.statistics.evaluations,
        finding.run.run.statistics.cut_backs,
        finding.run.run.statistics.stabilised_steps
    ))?;
    Ok(())
}
