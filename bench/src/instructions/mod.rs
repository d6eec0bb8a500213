//! Nothing asked, nothing paid: instructions of whole processes that are equal but for one thing.
//!
//! Counts repeat to some millionths, unlike times. Everything runs in one process without workers, so that no waiting is counted.

mod cases;
mod cell;
mod counter;
mod finding;

pub(crate) use cell::follow;

use crate::Effort;
use crate::program::program;
use crate::report::Report;
use crate::table::Table;
use anyhow::Context;
use cases::{Case, Course, DISCS, ELEMENT_TEST, GROUPS, group};
use counter::{Counter, Invocation};
use finding::{BOUND, Finding, Measured, findings};
use std::ffi::OsString;
use std::fs;
use std::path::Path;

/// Role of the process that solves cells.
pub(crate) const ROLE: &str = "trials";

/// What `--only` may name.
pub(super) fn parts(_: &Effort) -> Vec<String> {
    GROUPS.map(str::to_owned).to_vec()
}

/// Counts all groups, or those that are named.
///
/// # Errors
/// Nothing counts here, a run fails, something is paid for that was not asked for, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let folder = tempfile::tempdir().context("a folder for the runs")?;
    let counter = Counter::find(folder.path())?;
    report.note(&format!("counted by: {}", counter.name()))?;
    fs::write(folder.path().join("packing.json"), DISCS)?;
    let test = if effort.quick { format!("{ELEMENT_TEST}{QUICK_TEST}") } else { ELEMENT_TEST.to_owned() };
    fs::write(folder.path().join("test.toml"), test)?;
    let mut table = Table::new([
        "group",
        "run",
        "claim",
        "instructions",
        "difference",
        "share",
        "force_evaluations",
        "instructions_per_force_evaluation",
        "verdict",
    ]);
    let mut paid = Vec::new();
    let default = if effort.quick { &QUICK_GROUPS[..] } else { &GROUPS[..] };
    let wanted = |name: &&str| effort.names(name) || default.contains(name) && effort.includes(name, &GROUPS);
    for name in GROUPS.into_iter().filter(wanted) {
        let mut cases = group(name, effort.quick);
        if effort.quick {
            cases.truncate(QUICK);
        }
        for found in count(&cases, counter, folder.path()).with_context(|| format!("group {name}"))? {
            if !found.verdict.is_good() {
                paid.push(format!("{name}, {}", found.name));
            }
            table.row(row(name, &found));
        }
        report.raw("instructions", &table)?;
        report.note(&format!("{name}: done"))?;
    }
    report.table("instructions", HEADING, &table)?;
    report.note(&format!("bound: {BOUND:.0e} of the plain run"))?;
    anyhow::ensure!(paid.is_empty(), "paid for without being asked for: {}", paid.join("; "));
    Ok(())
}

/// Groups of a quick look.
const QUICK_GROUPS: [&str; 2] = ["cell", "element"];

/// End of the element test in a quick look. Long enough that to read one key more, 36 000 instructions, is well within the bound.
const QUICK_TEST: &str = "[rve]\naccuracy = 'draft'\nstrain_per_step = 1.5e-6\n";

/// Runs of a group in a quick look: up to the first request with its complement and all.
const QUICK: usize = 5;

const HEADING: &str = "instructions in user space; differences are from the plain run of the group, which asks for nothing; per force evaluation \
                       without the start of the process";

fn row(group: &str, found: &Finding) -> [crate::table::Cell; 9] {
    [
        group.into(),
        found.name.as_str().into(),
        found.claim.keyword().into(),
        found.measured.instructions.into(),
        found.difference.into(),
        found.share.into(),
        found.measured.force_evaluations.into(),
        found.per_evaluation.into(),
        found.verdict.keyword().into(),
    ]
}

/// Counts the runs of a group and compares them.
fn count(cases: &[Case], counter: Counter, folder: &Path) -> anyhow::Result<Vec<Finding>> {
    let mut measured = Vec::new();
    for case in cases {
        let one = measure(&case.course, counter, folder).with_context(|| case.name.clone())?;
        measured.push((case.name.clone(), case.claim, one));
    }
    let start = match &cases.first().context("a group has runs")?.course {
        Course::Cells(plan) => {
            let still = cell::CellPlan { increments: 0, ..(**plan).clone() };
            Some(measure(&Course::Cells(Box::new(still)), counter, folder)?.instructions)
        }
        // A test has at least one increment.
        Course::Element { .. } => None,
    };
    Ok(findings(&measured, start))
}

/// Counts one run.
fn measure(course: &Course, counter: Counter, folder: &Path) -> anyhow::Result<Measured> {
    match course {
        Course::Cells(plan) => {
            let file = folder.join("plan.json");
            fs::write(&file, serde_json::to_vec(plan)?)?;
            let program = std::env::current_exe().context("the path of this program is unknown")?;
            let arguments = vec!["--helper".into(), ROLE.into(), file.into_os_string()];
            let counted = counter.count(&Invocation { program, arguments }, folder)?;
            let said = counted.output.trim();
            let force_evaluations = said.parse().with_context(|| format!("force evaluations, not `{said}`"))?;
            Ok(Measured { instructions: counted.instructions, force_evaluations })
        }
        Course::Element { settings, arguments } => {
            let out = folder.join("curve.csv");
            let mut all: Vec<OsString> = vec!["element".into(), folder.join("test.toml").into_os_string()];
            all.extend(["--quiet".into(), "--out".into(), out.clone().into_os_string()]);
            all.extend(settings.iter().flat_map(|setting| [OsString::from("--set"), (*setting).into()]));
            let pictures = folder.join("contacts");
            all.extend(arguments.iter().map(|argument| match *argument {
                "DIR" => pictures.clone().into_os_string(),
                other => other.into(),
            }));
            let counted = counter.count(&Invocation { program: program()?, arguments: all }, folder)?;
            if pictures.exists() {
                fs::remove_dir_all(&pictures)?;
            }
            Ok(Measured { instructions: counted.instructions, force_evaluations: dem_steps(&out)? })
        }
    }
}

/// Sum of the column of an element test.
fn dem_steps(curve: &Path) -> anyhow::Result<u64> {
    let mut reader = csv::Reader::from_path(curve).context("the curve of the test")?;
    let column =
        reader.headers()?.iter().position(|head| head == "dem_steps").context("the curve has no dem_steps")?;
    let mut sum = 0;
    for record in reader.records() {
        sum += record?[column].parse::<u64>().context("dem_steps is a count")?;
    }
    Ok(sum)
}
