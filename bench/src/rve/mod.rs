//! What a stress curve of one cell costs at which error: every setting of the grain solver on the same strain paths,
//! against a reference at least ten times tighter, beside the band within which a perturbed start scatters, and beside
//! Yade and LAMMPS where they are installed.

mod case;
mod measure;
mod peers;
mod record;
mod setting;
mod window;

use super::repeat::median;
use super::report::Report;
use super::table::Table;
use crate::effort::Effort;
use anyhow::Context;
use case::{CASES, Case};
use macro_solver::output::write_atomically;
use measure::Run;
use peers::Peer;
use record::{Measured, charts, read, table};
use rve_server::definition::{Packing, RveOptions};
use setting::{Setting, is_beyond, settings};
use std::path::Path;
use window::{CurveRow, band, error};

/// Displacement of the grains of the perturbed engines, mean radii.
const PERTURBATION: f64 = 1e-10;

/// Strain rates of the other programs, from the fastest; the slowest is their own reference.
const PEER_RATES: [f64; 4] = [5e-3, 5e-4, 5e-5, 5e-6];

/// Cases that are measured with this effort.
fn measured_cases(effort: &Effort) -> &'static [Case] {
    effort.choose(CASES, &CASES[..1])
}

/// What `--only` may name.
pub(super) fn parts(effort: &Effort) -> Vec<String> {
    measured_cases(effort).iter().map(|case| case.name.to_owned()).collect()
}

/// Draws error over cost for all cases, or for those that `--only` names.
///
/// # Errors
/// A solve fails, a peer fails, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let scratch = tempfile::tempdir().context("making a scratch folder")?;
    let names: Vec<&str> = CASES.iter().map(|case| case.name).collect();
    for case in measured_cases(effort) {
        if effort.includes(case.name, &names) {
            study(case, effort, scratch.path(), report)?;
        }
    }
    Ok(())
}

/// Draws the pictures of the tables in a folder again, and counts them.
///
/// # Errors
/// There is no table of this study, one has other columns, or a picture cannot be written.
pub(super) fn redraw(folder: &Path) -> anyhow::Result<usize> {
    let mut drawn = 0;
    for case in CASES {
        let file = folder.join(format!("{}.csv", case.name));
        if !file.exists() {
            continue;
        }
        let measured = read(&file).with_context(|| file.display().to_string())?;
        for (name, chart) in charts(case, &measured) {
            write_atomically(&folder.join(format!("{name}.svg")), chart.to_svg()?.as_bytes())?;
            drawn += 1;
        }
    }
    anyhow::ensure!(
        drawn > 0,
        "there is no table to draw from in {}\nhint: name the folder of an earlier measurement with --out, or measure first, \
         without --redraw",
        folder.display()
    );
    Ok(drawn)
}

fn study(case: &Case, effort: &Effort, scratch: &Path, report: &mut Report) -> anyhow::Result<()> {
    let packing = measure::packing(case, 0.0, 0)?;
    report.note(&format!("\n{}: {}", case.name, case.about))?;
    let tight = if effort.quick { "strain_per_step = 5e-7\ntolerance = 1e-4" } else { case.reference };
    let options: RveOptions = toml::from_str(tight).context("reference of a case")?;
    let reference = measure::solve(case, &options, &packing)?;
    let pressure = measure::pressure(&reference.curve);
    report.note(&format!(
        "reference: {}, {} force evaluations, {:.1} s",
        tight.replace('\n', ", "),
        reference.evaluations,
        reference.processor
    ))?;
    let chosen: Vec<Setting> =
        settings(effort.quick)?.into_iter().filter(|setting| is_beyond(&options, &setting.rve)).collect();
    let mut measured = ours(case, &chosen, effort, &packing, &reference.curve, pressure)?;
    scatter(case, effort, pressure, report)?;
    if let (Some(law), false) = (case.peer, effort.quick) {
        for peer in Peer::ALL {
            if peer.is_installed() {
                let runs = theirs(peer, case, law, scratch)?;
                measured.extend(compared(peer, case, &runs, &reference.curve, pressure));
            } else {
                report.note(&format!("{} is not installed and left out ({})", peer.name(), peer.remedy()))?;
            }
        }
    }
    let heading = format!("{}: error of the stress (RMS, in units of the pressure) and its price", case.name);
    report.table(case.name, &heading, &table(&measured))?;
    for (name, chart) in charts(case, &measured) {
        report.chart(&name, &chart)?;
    }
    Ok(())
}

/// All settings, in alternating rounds.
fn ours(
    case: &Case,
    chosen: &[Setting],
    effort: &Effort,
    packing: &Packing,
    reference: &[CurveRow],
    pressure: f64,
) -> anyhow::Result<Vec<Measured>> {
    let mut runs: Vec<Vec<Run>> = vec![Vec::new(); chosen.len()];
    for round in 0..effort.choose(3, 1) {
        for place in 0..chosen.len() {
            let index = if round % 2 == 0 { place } else { chosen.len() - 1 - place };
            runs[index].push(measure::solve(case, &chosen[index].rve, packing)?);
        }
    }
    Ok(chosen
        .iter()
        .zip(&runs)
        .map(|(setting, runs)| Measured {
            curve: setting.curve.clone(),
            name: setting.name.clone(),
            processor: median(&runs.iter().map(|run| run.processor).collect::<Vec<_>>()),
            evaluations: runs[0].evaluations,
            not_equilibrated: runs[0].not_equilibrated,
            errors: errors(case, &runs[0].curve, reference, pressure),
        })
        .collect())
}

fn errors(case: &Case, curve: &[CurveRow], reference: &[CurveRow], pressure: f64) -> Vec<f64> {
    case.windows.iter().map(|window| error(curve, reference, window, pressure)).collect()
}

/// The band of the default setting from perturbed starts: below it, an error says nothing.
fn scatter(case: &Case, effort: &Effort, pressure: f64, report: &mut Report) -> anyhow::Result<()> {
    let mut ensemble = Vec::new();
    for seed in 0..effort.choose(6, 2) {
        let packing = measure::packing(case, PERTURBATION, seed)?;
        ensemble.push(measure::solve(case, &RveOptions::default(), &packing)?.curve);
    }
    let mut table = Table::new(["window", "after", "until", "band"]);
    for window in case.windows {
        table.row([
            window.name.into(),
            window.after.into(),
            window.until.into(),
            band(&ensemble, window, pressure).into(),
        ]);
    }
    let heading = format!(
        "{}: scatter of {} runs at default accuracy with grains displaced by {PERTURBATION:e} mean radii (RMS, in units of the pressure)",
        case.name,
        ensemble.len()
    );
    Ok(report.table(&format!("{}-band", case.name), &heading, &table)?)
}

fn theirs(peer: Peer, case: &Case, law: case::PeerLaw, folder: &Path) -> anyhow::Result<Vec<(f64, peers::PeerRun)>> {
    std::fs::write(folder.join("packing.json"), case.packing).context("the packing for the other programs")?;
    PEER_RATES
        .iter()
        .map(|rate| Ok((*rate, peer.run(case, law, *rate, folder).with_context(|| peer.name().to_owned())?)))
        .collect()
}

/// The runs of a peer but its slowest, compared with its slowest: differences of the law are no errors of the rate. Then
/// the slowest, compared with our reference: how far the programs differ once both have converged.
fn compared(
    peer: Peer,
    case: &Case,
    runs: &[(f64, peers::PeerRun)],
    reference: &[CurveRow],
    pressure: f64,
) -> Vec<Measured> {
    let Some(((slowest, own), faster)) = runs.split_last() else { return Vec::new() };
    let row = |curve: String, rate: f64, run: &peers::PeerRun, errors: Vec<f64>| Measured {
        curve,
        name: format!("{} rate {rate:e}", peer.name()),
        processor: run.processor,
        evaluations: run.steps,
        not_equilibrated: 0,
        errors,
    };
    let mut rows: Vec<Measured> = faster
        .iter()
        .map(|(rate, run)| row(peer.name().to_owned(), *rate, run, errors(case, &run.curve, &own.curve, pressure)))
        .collect();
    // At our rows, which are far apart: between them our curve is not straight.
    let apart = errors(case, reference, &own.curve, pressure);
    rows.push(row(format!("{}, slowest, against our reference", peer.name()), *slowest, own, apart));
    rows
}
