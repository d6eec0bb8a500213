//! One case again: its increments, or the files that others can run.

use super::campaign::Campaign;
use super::check::Subject;
use super::outcome::{self, Class};
use crate::report::Report;
use crate::stability_options::Options;
use crate::table::Table;
use anyhow::{Context, anyhow};
use charts::short;
use macro_solver::output::write_atomically;
use protocol::TrialFlags;
use rve_server::definition::Packing;
use std::path::Path;

/// Runs the one case of a campaign and shows its increments, or writes it as an element test.
///
/// # Errors
/// The packing cannot be made, or a file cannot be written.
pub(super) fn run(campaign: &Campaign, options: &Options, report: &mut Report) -> anyhow::Result<()> {
    let case = &campaign.cases[0];
    let slot = &campaign.slots[case.slot];
    let (test, text) = campaign.test(case, &[])?;
    let packing = campaign.packing(case).map_err(|reason| anyhow!("no packing: {reason}"))?;
    report.note(&format!(
        "case {} of seed {}: {}, {}, {}",
        case.number,
        campaign.seed,
        case.range.name(),
        case.kind.name(),
        slot.name
    ))?;
    if let Some(file) = &options.write {
        return written(file, &text, packing, &slot.recipe(), campaign.seed, case.number, report);
    }
    report.note(&format!("\n{text}"))?;
    let outcome = outcome::run(&test, slot, packing, 1.0);
    let mut table = Table::new([
        "increment",
        "pressure_Pa",
        "sigma_xx_Pa",
        "sigma_yy_Pa",
        "sigma_xy_Pa",
        "stored_J/m3",
        "friction_J/m3",
        "damping_J/m3",
        "work_J/m3",
        "force_evaluations",
        "at_rest",
    ]);
    for (number, one) in outcome.increments.iter().enumerate() {
        let at_rest = if one.flags.contains(TrialFlags::NOT_EQUILIBRATED) { "no" } else { "yes" };
        table.row([
            number.into(),
            one.pressure(slot.dimension).into(),
            one.stress[0][0].into(),
            one.stress[1][1].into(),
            one.stress[0][1].into(),
            one.stored.into(),
            one.lost.into(),
            one.damped.into(),
            one.work.into(),
            one.evaluations.into(),
            at_rest.into(),
        ]);
    }
    report.table("increments", "increments", &table)?;
    let subject = Subject { test: &test, slot, packing, outcome: &outcome };
    let is_plain = matches!(outcome.class, Class::Unchecked | Class::NoLoadBearingContacts);
    let checked = subject.checked(is_plain && !options.unchecked);
    report.note(&format!("\n{} {}", checked.class.name(), checked.reason))?;
    report.note(&format!(
        "error {} of the mean pressure, bound {}, gap {}; energy ledger open by {}",
        short(checked.error),
        checked.bound,
        short(checked.gap),
        short(checked.open)
    ))?;
    Ok(())
}

fn written(
    file: &Path,
    text: &str,
    packing: &Packing,
    recipe: &str,
    seed: u64,
    number: u64,
    report: &mut Report,
) -> anyhow::Result<()> {
    let stem = file.file_stem().context("--write needs the name of a file")?.to_string_lossy().into_owned();
    let packing_file = file.with_file_name(format!("{stem}-packing.json"));
    let mut table: toml::Table = text.parse().context("a case as TOML")?;
    table.insert("packing".into(), format!("{stem}-packing.json").into());
    let json = match packing {
        Packing::Discs(packing) => packing.to_json(),
        Packing::Spheres(packing) => packing.to_json(),
    };
    let mut head = format!("# Case {number} of the stability campaign of seed {seed}.\n");
    if !recipe.is_empty() {
        head += "# Its packing was made from this recipe (or the next seed that gives one, see its file):\n";
        head.extend(recipe.lines().map(|line| format!("# {line}").trim_end().to_owned() + "\n"));
    }
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    write_atomically(&packing_file, json.as_bytes())?;
    write_atomically(file, format!("{head}{}", toml::to_string(&table)?).as_bytes())?;
    report.note(&format!("grainspan element {}", file.display()))?;
    Ok(())
}
