//! `grainspan pack PACKING.toml`: prepares a packing and says how good it is.

use super::exit::{Exit, Failure};
use super::stdout::deliver;
use crate::scene::Document;
use indicatif::{ProgressBar, ProgressStyle};
use rve_server::packing::{PackingProgress, PackingRecipe, PackingReport, generate};
use std::path::PathBuf;
use std::time::Duration;

/// Arguments of `grainspan pack`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan pack packings/discs-400.toml --out packings/discs-400.json
  grainspan pack packings/discs-400.toml --set seed=7 --set contact.friction=0.2 --out loose.json")]
pub(crate) struct Arguments {
    /// Recipe: grading, number, pressure, preparation friction, seed
    #[arg(value_name = "PACKING.toml")]
    recipe: PathBuf,
    /// Packing file to write [default: standard output]
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
    /// Override a key of the recipe
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Say nothing on standard error
    #[arg(long)]
    quiet: bool,
}

/// Makes the packing, writes it and reports its state.
///
/// # Errors
/// A recipe that is not sound, a target that is not reached, a place that cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let document = Document::read(&arguments.recipe, &arguments.overrides)?;
    let recipe: PackingRecipe = document.deserialize()?;
    recipe.validate().map_err(|error| document.table_error(error))?;
    let bar = if arguments.quiet { ProgressBar::hidden() } else { spinner() };
    let made = generate(&recipe, &mut |progress| bar.set_message(stage(progress)));
    bar.finish_and_clear();
    let (packing, report) = made.map_err(|error| {
        let text = format!("{}: {error}", arguments.recipe.display());
        Failure::new(Exit::NotConverged, format!("{text}\nhint: try another seed, more grains or a looser tolerance"))
    })?;
    deliver(arguments.out.as_deref(), packing.to_json().as_bytes())?;
    if !arguments.quiet {
        eprint!("{}", summary(&recipe, &report));
    }
    Ok(Exit::Done)
}

fn spinner() -> ProgressBar {
    let style = ProgressStyle::with_template("{spinner} {elapsed}  {msg}").expect("the template is a constant");
    let bar = ProgressBar::new_spinner().with_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

fn stage(progress: &PackingProgress) -> String {
    format!(
        "{} {}: solid fraction {:.4}, pressure {:.3e} Pa, out of balance {:.1e}",
        progress.stage,
        progress.increment,
        progress.solid_fraction,
        progress.pressure,
        progress.unbalanced_force_ratio
    )
}

fn summary(recipe: &PackingRecipe, report: &PackingReport) -> String {
    format!(
        "{} discs at {:e} Pa, seed {}\n  \
         void ratio             {:.5}\n  \
         coordination number    {:.4} ({:.4} without rattlers)\n  \
         fabric anisotropy      {:.2e}\n  \
         deviation from target  {:.1e} of the pressure, in the worst stress component\n  \
         out of balance         {:.1e} of the mean contact force\n  \
         largest overlap        {:.1e} of a diameter\n  \
         cost                   {} force evaluations\n",
        recipe.number,
        recipe.pressure,
        recipe.seed,
        report.void_ratio,
        report.coordination_number,
        report.coordination_number_no_rattlers,
        report.fabric_anisotropy,
        report.stress_error,
        report.unbalanced_force_ratio,
        report.max_overlap_ratio,
        report.force_evaluations
    )
}
