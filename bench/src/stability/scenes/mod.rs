//! Small scenes: one or a few elements, badly shaped, in the plane and in space, over packings and laws drawn at random, with workers in
//! this process.

mod check;
mod draw;
mod problem;
mod single;

use super::packings::Slot;
use super::tables::accuracy;
use crate::newton::case::side_by_side;
use crate::report::Report;
use crate::table::{Cell, Table};
use check::{Finding, found};
use draw::Scene;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

pub(super) use single::run as run_one;

/// Runs `count` small scenes, several at a time, and reports how they ended; returns how many ended how.
///
/// # Errors
/// The report cannot be written.
pub(super) fn run(
    seed: u64,
    count: u64,
    slots: &[Slot],
    checked: bool,
    report: &mut Report,
) -> anyhow::Result<Table> {
    let scenes: Vec<Scene> = (0..count).map(|number| Scene::sampled(seed, number, slots)).collect();
    let findings = side_by_side(scenes.len(), |place| {
        let scene = &scenes[place];
        catch_unwind(AssertUnwindSafe(|| found(scene, &slots[scene.slot], checked, &mut |_, _| {})))
    });
    let mut table = Table::new([
        "scene",
        "range",
        "packing",
        "element",
        "elements",
        "formulation",
        "loading",
        "strain",
        "aspect",
        "slant",
        "taper",
        "accuracy",
        "class",
        "error_over_pressure",
        "bound",
        "gap",
        "steps",
        "reached_%",
        "cut_backs",
        "stabilised_steps",
        "evaluations",
        "not_at_rest",
        "wall_s",
    ]);
    let mut ends: BTreeMap<(&str, u32, String), u64> = BTreeMap::new();
    for (scene, found) in scenes.iter().zip(findings) {
        let (class, costs) = match &found {
            Err(_) => ("panicked".to_owned(), [(); 10].map(|()| Cell::from(f64::NAN))),
            Ok(Err(error)) => (format!("broke off: {error:#}"), [(); 10].map(|()| Cell::from(f64::NAN))),
            Ok(Ok(finding)) => (finding.class.clone(), costs(finding)),
        };
        let kind_of_end = class.split(':').next().unwrap_or_default().to_owned();
        *ends.entry((scene.range.name(), slots[scene.slot].dimension, kind_of_end)).or_default() += 1;
        let [error, bound, gap, steps, reached, cut_backs, stabilisation, evaluations, not_at_rest, wall] = costs;
        let [aspect, slant, taper] = scene.shape;
        let [x, y, z] = scene.elements;
        table.row([
            scene.number.into(),
            scene.range.name().into(),
            slots[scene.slot].name.as_str().into(),
            scene.kind.keyword().into(),
            (if z == 0 { format!("{x} x {y}") } else { format!("{x} x {y} x {z}") }).into(),
            format!("{:?}", scene.formulation).into(),
            format!("{:?}", scene.loading).into(),
            scene.strain.into(),
            aspect.into(),
            slant.into(),
            taper.into(),
            accuracy(&scene.options).as_str().into(),
            class.into(),
            error,
            bound,
            gap,
            steps,
            reached,
            cut_backs,
            stabilisation,
            evaluations,
            not_at_rest,
            wall,
        ]);
    }
    if count > 0 {
        report.table("scenes", "small scenes of finite elements", &table)?;
    }
    let mut summary = Table::new(["range", "dimension", "class", "scenes"]);
    for ((range, dimension, class), number) in ends {
        summary.row([range.into(), u64::from(dimension).into(), class.into(), number.into()]);
    }
    Ok(summary)
}

fn costs(finding: &Finding) -> [Cell; 10] {
    let statistics = &finding.run.run.statistics;
    [
        finding.error.into(),
        finding.bound.into(),
        finding.gap.into(),
        statistics.steps.into(),
        (100.0 * finding.run.run.load).into(),
        statistics.cut_backs.into(),
        statistics.stabilised_steps.into(),
        statistics.evaluations.into(),
        (statistics.flags.not_equilibrated + statistics.unfinished_trials).into(),
        finding.run.wall.into(),
    ]
}
