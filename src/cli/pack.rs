//! `grainspan pack PACKING.toml`: prepares a packing and reports its quality.

use super::waiting_progress::WaitingProgress;
use crate::exit::{Exit, Failure};
use crate::stderr::tell;
use crate::stdout::{deliver, expect_place};
use rve_server::definition::Packing;
use rve_server::preparation::{
    PackingProgress, PackingRecipe, PackingReport, Requirement, SoftGrains, doubtful_lengths, generate_any,
    soft_grains, stiffness_hint,
};
use scene_reader::{Document, Kind};
use std::path::PathBuf;

/// Arguments of `grainspan pack`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan pack packings/discs-400.toml --out packings/discs-400.json
  grainspan pack packings/discs-400.toml --set seed=7 \\
      --set contact.friction=0.2 --out loose.json")]
pub(crate) struct Arguments {
    /// Recipe: grading, number, stress, preparation friction, targets, seed; see docs/guide/packings.md
    #[arg(value_name = "PACKING.toml")]
    recipe: PathBuf,
    /// Packing file to write [default: standard output]
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
    /// Override a key of the recipe
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Print nothing on standard error but warnings and errors
    #[arg(long)]
    quiet: bool,
}

/// Makes the packing, writes it and reports its state.
///
/// # Errors
/// A recipe that is not sound, a target that is not reached, a place that cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let document = Document::read(&arguments.recipe, &arguments.overrides)?;
    crate::exit::warn(&document);
    document.expect(Kind::Recipe)?;
    let recipe: PackingRecipe = document.deserialize()?;
    recipe.validate().map_err(|error| document.table_error(error))?;
    if let Some(SoftGrains { problem, remedy }) = soft_grains(&recipe) {
        return Err(document.error_at_key(&["contact"], problem).hint(remedy).into());
    }
    if let Some(remark) = doubtful_lengths(&recipe) {
        tell(format_args!("warning: {remark}"));
    }
    expect_place(arguments.out.as_deref(), &[&arguments.recipe])?;
    let progress_line = WaitingProgress::start(arguments.quiet);
    let made = generate_any(&recipe, &mut |progress| progress_line.set(stage(progress)));
    drop(progress_line);
    let (packing, report) = made.map_err(|error| {
        let text = format!("{}: {error}", arguments.recipe.display());
        let hint = stiffness_hint(&recipe)
            .unwrap_or("try another seed, more grains, a narrower grading or a looser tolerance");
        Failure::new(Exit::NotConverged, format!("{text}\nhint: {hint}"))
    })?;
    let text = match &packing {
        Packing::Discs(packing) => packing.to_json(),
        Packing::Spheres(packing) => packing.to_json(),
    };
    deliver(arguments.out.as_deref(), text.as_bytes())?;
    if let Some(remark) = packing.narrow_cell() {
        tell(format_args!("warning: {remark}"));
    }
    if !arguments.quiet {
        tell(summary(&recipe, &report).trim_end());
    }
    Ok(Exit::Done)
}

fn stage(progress: &PackingProgress) -> String {
    let attempt = if progress.attempt > 0 { format!("packing {}: ", progress.attempt + 1) } else { String::new() };
    format!(
        "{attempt}{} {}: solid fraction {:.4}, pressure {:.3e} Pa, unbalanced force {:.1e}",
        progress.stage,
        progress.increment,
        progress.solid_fraction,
        progress.pressure,
        progress.unbalanced_force_ratio
    )
}

/// The acceptance report: requested and reached values, then the state of the packing.
fn summary(recipe: &PackingRecipe, report: &PackingReport) -> String {
    let kind = if report.dimension == 2 { "discs" } else { "spheres" };
    let mut text = format!("{} {kind}, seed {}\n", report.grains, recipe.seed);
    text += &format!("  {:<34} {:>15} {:>15} {:>10}\n", "quantity", "requested", "reached", "tolerance");
    for Requirement { quantity, requested, got, tolerance } in &report.requirements {
        text += &format!("  {quantity:<34} {requested:>15.6e} {got:>15.6e} {tolerance:>10.1e}\n");
    }
    let state = [
        ("void ratio", format!("{:.5} (porosity {:.5})", report.void_ratio, report.porosity)),
        (
            "coordination number",
            format!(
                "{:.4} ({:.4} without rattlers)",
                report.coordination_number, report.coordination_number_no_rattlers
            ),
        ),
        ("fabric anisotropy", format!("{:.3e}", report.fabric_anisotropy)),
        ("largest overlap", format!("{:.1e} of a diameter", report.max_overlap_ratio)),
        ("contact friction", format!("{}", report.friction)),
        ("cost", format!("{} force evaluations", report.force_evaluations)),
    ];
    for (name, value) in state {
        text += &format!("  {name:<34} {value}\n");
    }
    for attempt in &report.searches.friction {
        text += &format!("  tried friction {:<19.6} {:.6}\n", attempt.friction, attempt.value);
    }
    for attempt in &report.searches.shear {
        text += &format!("  tried shear {:<22.3e} anisotropy {:.5}\n", attempt.shear, attempt.anisotropy);
    }
    text
}
