//! `grainspan specimen TEST.toml`: single-scale grain dynamics of a whole specimen, in this process, on several threads.

mod checkpoint;
mod pictures;
mod profile;

use self::checkpoint::SpecimenCheckpoint;
use self::pictures::Pictures;
use self::profile::Profiles;
use super::rve_test::{rows_in_words, shortfalls};
use crate::exit::{Exit, Failure};
use crate::folder_lock::refuse_folder_of_a_run;
use crate::stderr::tell;
use crate::stdout::{deliver, expect_place};
use crate::workers::SignalWatch;
use grain_pool::processes::most_workers;
use indicatif::{ProgressBar, ProgressStyle};
use macro_solver::output::remove_drafts;
use rve_server::definition::Packing;
use rve_server::programs::specimen::{
    Checkpoints, SpecimenCsv, SpecimenError, SpecimenEvent, SpecimenStart, SpecimenSummary, SpecimenTest,
    run_specimen_from,
};
use scene_reader::{Document, InputError, Kind};
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Arguments of `grainspan specimen`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan specimen scenes/specimen-biaxial.toml --out curve.csv
  grainspan specimen scenes/specimen-biaxial.toml --threads 8 \\
      --pictures out/grains --set tiles=[4,8]
  grainspan specimen scenes/liu2015/grains-shear-layer.toml --size small \\
      --out curve.csv --profiles out/layers
  grainspan specimen scenes/specimen-biaxial.toml --out curve.csv \\
      --checkpoint out/specimen --resume")]
pub(crate) struct Arguments {
    /// Specimen test: packing, tiles, contact law, walls and stages; see docs/guide/specimens.md
    #[arg(value_name = "TEST.toml")]
    test: PathBuf,
    /// File to write [default: standard output, at the end]
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Folder for ParaView files of the grains, one per row
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Add displacement fluctuations of the grains to the files of --pictures, counted from the start of this stage: the displacement
    /// less the linear field that fits the body best
    #[arg(long, value_name = "STAGE", requires = "pictures")]
    fluctuations_from: Option<String>,
    /// Add the contacts and their forces to --pictures, and of discs pictures of force chains and rotations
    #[arg(long, requires = "pictures")]
    contacts: bool,
    /// Folder for the shear of the layers that `[profile]` of the test names, and the shear band that it shows
    #[arg(long, value_name = "DIR")]
    profiles: Option<PathBuf>,
    /// Folder for checkpoints of the run, which are removed when it has ended
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
    /// Steps between two checkpoints
    #[arg(long, value_name = "N", default_value_t = 10_000, requires = "checkpoint", value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint_every: u64,
    /// Go on from the checkpoint, to the same table; from the beginning if there is none
    #[arg(long, requires = "checkpoint")]
    resume: bool,
    /// Threads [default: one per core]; the results do not depend on it
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// One of the sizes that the file names in `[sizes]` [default: the file as it stands]
    #[arg(long, value_name = "NAME")]
    size: Option<String>,
    /// Override a key of the test
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Put units into the header: `sigma_xx [Pa]`
    #[arg(long)]
    units: bool,
    /// Print nothing on standard error but warnings and errors
    #[arg(long)]
    quiet: bool,
}

/// Runs the test.
///
/// # Errors
/// A test that is not sound (exit code 2); a motion out of control (exit code 1, the rows before are written); a stop that was
/// requested (exit code 130, likewise).
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let document = Document::read_in_size(&arguments.test, arguments.size.as_deref(), &arguments.overrides)?;
    crate::exit::warn(&document);
    document.expect(Kind::Specimen)?;
    let test: SpecimenTest = document.deserialize()?;
    let packing = Packing::read(&document.resolve(Path::new(&test.packing)))
        .map_err(|error| document.error_at_key(&["packing"], error))?;
    test.validate(packing.dimension() as usize).map_err(|error| document.table_error(error))?;
    expect_place(arguments.out.as_deref(), &[&arguments.test, &document.resolve(Path::new(&test.packing))])?;
    if let Some(threads) = arguments.threads.map(NonZeroUsize::get) {
        let most = most_workers();
        if threads > most {
            let text =
                format!("--threads {threads}: at most {most} on this machine, and more than one per core is slower");
            return Err(Failure::new(Exit::BadInput, text));
        }
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()
            .map_err(|error| Failure::new(Exit::BadInput, format!("--threads {threads}: {error}")))?;
    }
    for (option, folder) in [("--pictures", &arguments.pictures), ("--profiles", &arguments.profiles)] {
        folder.as_deref().map_or(Ok(()), |folder| refuse_folder_of_a_run(option, folder))?;
    }
    let checkpoint = match &arguments.checkpoint {
        Some(folder) => {
            let packing = document.resolve(Path::new(&test.packing));
            let asked = checkpoint::Asked {
                units: arguments.units,
                pictures: arguments.pictures.is_some(),
                profiles: arguments.profiles.is_some(),
                fluctuations_from: arguments.fluctuations_from.clone(),
                contacts: arguments.contacts,
            };
            Some(SpecimenCheckpoint::new(folder, document.as_run(&[])?, &packing, asked)?)
        }
        None => None,
    };
    let earlier = match &checkpoint {
        Some(checkpoint) if arguments.resume => checkpoint.earlier()?,
        _ => None,
    };
    let mut output = Output::new(arguments, &test, packing.dimension() as usize)?;
    if let Some(earlier) = &earlier {
        output.go_on(arguments, &test, earlier)?;
    }
    let every = checkpoint.is_some().then_some(arguments.checkpoint_every);
    output.checkpoint = checkpoint;
    let checkpoints = Checkpoints { every, from: earlier.as_ref().map(|earlier| &earlier.state[..]) };
    let interrupt = SignalWatch::flag("the specimen ends within a hundred steps")?;
    let mut listener = |event: &SpecimenEvent<'_>| {
        output.take(event);
        let is_over = interrupt.is_raised() || output.failure.is_some();
        if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let ended = match &packing {
        Packing::Discs(packing) => run_specimen_from(&test, packing, &checkpoints, &mut listener),
        Packing::Spheres(packing) => run_specimen_from(&test, packing, &checkpoints, &mut listener),
    };
    let checkpoint = output.checkpoint.take();
    // A test that could not begin has no table.
    if !matches!(ended, Err(SpecimenError::Test(_) | SpecimenError::Packing(_))) {
        output.finish(arguments.out.as_deref())?;
    }
    match ended {
        Ok(summary) if summary.is_stopped => {
            let text = format!("{}: interrupted after step {}", arguments.test.display(), summary.steps);
            let remedy = match &arguments.checkpoint {
                Some(_) => "\nhint: the same command with --resume goes on from here",
                None => "\nhint: with --checkpoint DIR a run can be continued",
            };
            let text = format!("{text}; the rows up to there are written{remedy}");
            Err(Failure::new(Exit::Interrupted, text))
        }
        Ok(summary) => {
            if let Some(checkpoint) = &checkpoint {
                checkpoint.remove()?;
            }
            if !arguments.quiet {
                tell(closing(&summary));
            }
            if summary.unbalanced_stages > 0 {
                let (path, count) = (arguments.test.display(), summary.unbalanced_stages);
                let stages = if count == 1 { "1 stage".to_owned() } else { format!("{count} stages") };
                let text = format!("{path}: {stages} ended at `steps` before `until_balance` was met");
                let hint = "\nhint: give more `steps`, or a larger `until_balance`";
                return Err(Failure::new(Exit::NotConverged, format!("{text}{hint}")));
            }
            Ok(Exit::Done)
        }
        Err(SpecimenError::Test(reason)) => Err(document.table_error(reason).into()),
        Err(SpecimenError::Packing(reason)) => Err(document.error_at_key(&["packing"], reason).into()),
        Err(reason) => Err(Failure::new(Exit::NotConverged, format!("{}: {reason}", arguments.test.display()))),
    }
}

/// Table, pictures and progress bar of one run.
struct Output {
    csv: SpecimenCsv<Vec<u8>>,
    pictures: Option<Pictures>,
    profiles: Option<Profiles>,
    bar: ProgressBar,
    /// Steps before each stage.
    before: Vec<u64>,
    checkpoint: Option<SpecimenCheckpoint>,
    failure: Option<Failure>,
}

impl Output {
    fn new(arguments: &Arguments, test: &SpecimenTest, dimension: usize) -> Result<Self, Failure> {
        let mut whole = 0;
        let mut before = Vec::new();
        for stage in &test.stage {
            before.push(whole);
            whole += stage.steps;
        }
        let bar = if arguments.quiet { ProgressBar::hidden() } else { ProgressBar::new(whole) };
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} steps  {elapsed} of {duration}  {msg}")
            .expect("the template is a constant");
        bar.set_style(style);
        Ok(Self {
            csv: SpecimenCsv::new(Vec::new(), arguments.units, test)
                .map_err(|error| Failure::new(Exit::BadInput, error))?,
            pictures: pictures(arguments, test, dimension)?,
            profiles: profiles(arguments, test, dimension)?,
            bar,
            before,
            checkpoint: None,
            failure: None,
        })
    }

    /// Goes on behind the rows and pictures of an earlier process.
    fn go_on(
        &mut self,
        arguments: &Arguments,
        test: &SpecimenTest,
        earlier: &checkpoint::Kept,
    ) -> Result<(), Failure> {
        self.csv = SpecimenCsv::resumed(earlier.table.clone(), arguments.units, test)
            .map_err(|error| Failure::new(Exit::BadInput, error))?;
        if let (Some(pictures), Some(folder)) = (&mut self.pictures, &arguments.pictures) {
            remove_drafts(folder)?;
            let files = earlier.frames.iter().flat_map(|(_, grains)| pictures.files(grains));
            if let Some(missing) = files.into_iter().find(|file| !folder.join(file).exists()) {
                let problem =
                    format!("--pictures: {} does not hold {missing}, which was drawn before", folder.display());
                return Err(Failure::new(
                    Exit::BadInput,
                    format!("{problem}\nhint: name the folder of the run that is continued"),
                ));
            }
            pictures.go_on(&earlier.frames, &earlier.start)?;
        }
        if let (Some(profiles), Some(kept)) = (&mut self.profiles, &earlier.profiles) {
            profiles.go_on(kept.clone());
        }
        Ok(())
    }

    fn take(&mut self, event: &SpecimenEvent<'_>) {
        match event {
            SpecimenEvent::Progress { stage, step } => self.bar.set_position(self.before[*stage] + step),
            SpecimenEvent::Begun { stage, picture } => {
                if let Some(pictures) = &mut self.pictures {
                    pictures.begun(*stage, picture);
                }
                if let Some(profiles) = &mut self.profiles {
                    profiles.begun(*stage, picture);
                }
            }
            SpecimenEvent::State(state) => {
                // Behind a picture that could not be written the table has a row more than there are pictures: the run can only go on
                // from the checkpoint before.
                if let Some(checkpoint) = &mut self.checkpoint
                    && self.failure.is_none()
                {
                    let pictures = self.pictures.as_ref();
                    checkpoint.write(checkpoint::Now {
                        table: self.csv.so_far(),
                        frames: pictures.map_or(&[][..], |pictures| pictures.series.frames()),
                        start: pictures.map_or(&[][..], |pictures| &pictures.start),
                        profiles: self.profiles.as_ref().map(Profiles::kept),
                        state,
                    });
                }
            }
            SpecimenEvent::Row(row, shown) => {
                self.bar.set_message(format!("{}: unbalanced {:.1e}", row.stage, row.unbalanced_force_ratio));
                if let Some(profiles) = &mut self.profiles {
                    profiles.add(row, *shown);
                }
                let written = self.csv.write(row).map_err(|error| Failure::new(Exit::BadInput, error));
                let drawn = written.and_then(|()| match &mut self.pictures {
                    Some(pictures) => Ok(pictures.draw(row, *shown)?),
                    None => Ok(()),
                });
                if let Err(failure) = drawn {
                    self.failure.get_or_insert(failure);
                }
            }
        }
    }

    /// Writes the rows; also those before something else could not be written, which is then the failure.
    fn finish(self, out: Option<&Path>) -> Result<(), Failure> {
        self.bar.finish_and_clear();
        let bytes = self.csv.into_inner().map_err(|error| Failure::new(Exit::BadInput, error));
        let delivered = bytes.and_then(|bytes| deliver(out, &bytes));
        let profiles = self.profiles.map_or(Ok(()), |profiles| profiles.write());
        self.failure.map_or(delivered, Err)?;
        Ok(profiles?)
    }
}

/// The pictures that were asked for.
///
/// # Errors
/// Fluctuations from a stage that the test does not have; the folder cannot be made.
fn pictures(arguments: &Arguments, test: &SpecimenTest, dimension: usize) -> Result<Option<Pictures>, Failure> {
    let stage = arguments.fluctuations_from.as_ref().map(|name| {
        let names: Vec<&str> = test.stage.iter().map(|stage| stage.name.as_str()).collect();
        names.iter().position(|stage| stage == name).ok_or_else(|| {
            InputError::at("--fluctuations-from", format!("there is no stage '{name}'"))
                .hint(format!("use one of: {}", names.join(", ")))
        })
    });
    let from = stage.transpose()?;
    let create = |folder: &Path| Pictures::create(folder, from, arguments.contacts, dimension);
    arguments.pictures.as_deref().map(create).transpose()
}

/// The profiles that were asked for.
///
/// # Errors
/// The test does not say which; the folder cannot be made.
fn profiles(arguments: &Arguments, test: &SpecimenTest, dimension: usize) -> Result<Option<Profiles>, Failure> {
    let Some(folder) = &arguments.profiles else { return Ok(None) };
    let Some(table) = &test.profile else {
        let problem = InputError::at("--profiles", "the test has no table [profile]".to_owned());
        return Err(problem.hint("add one, for example: [profile] with axis = \"y\" and along = \"x\"").into());
    };
    let stages = test.stage.iter().map(|stage| stage.name.clone()).collect();
    Ok(Some(Profiles::create(folder, table, dimension, stages)?))
}

fn closing(summary: &SpecimenSummary) -> String {
    let SpecimenSummary { grains, steps, renewals, shortenings, unbalanced_stages, .. } = summary;
    let mut warnings = Vec::new();
    if *unbalanced_stages > 0 {
        warnings.push(format!("stages without equilibrium at the end: {unbalanced_stages}"));
    }
    if summary.servo_misses > 0 {
        warnings.push(format!(
            "wall stress off its target in {}, by {:.1} % at most",
            rows_in_words(summary.servo_misses),
            100.0 * summary.largest_servo_error
        ));
    }
    if summary.unbalanced_rows > 0 {
        warnings.push(format!(
            "not quasi-static in {}: an unbalanced force is above a tenth of the mean contact force, up to {:.2} of it; more `steps` make \
             a stage slower",
            rows_in_words(summary.unbalanced_rows),
            summary.largest_unbalanced
        ));
    }
    if summary.shear_misses > 0 {
        warnings.push(format!(
            "opposite walls bear different shear forces in {}, by {:.1} % of the normal force at most: inertia or local damping bears a \
             part of the shear; more `steps`, or a smaller `motion.local_damping`",
            rows_in_words(summary.shear_misses),
            100.0 * summary.largest_shear_difference
        ));
    }
    if summary.energy_misses > 0 {
        warnings.push(format!(
            "energy not accounted for in {}, {:.1} % at most",
            rows_in_words(summary.energy_misses),
            100.0 * summary.largest_energy_error
        ));
    }
    if summary.overlap_misses > 0 {
        warnings.push(format!(
            "grains overlap by more than a tenth of a diameter in {} rows, by {:.2} at most: the contact law holds for far less",
            summary.overlap_misses, summary.largest_overlap
        ));
    }
    let fallbacks = if *shortenings > 0 { vec![format!("shortened steps: {shortenings}")] } else { Vec::new() };
    format!(
        "{}\n{grains} grains, {steps} steps, {renewals} neighbour lists; {}",
        start_text(&summary.start),
        shortfalls(warnings, fallbacks)
    )
}

/// State of the specimen before the first step.
fn start_text(start: &SpecimenStart) -> String {
    let [xx, yy, zz, xy, ..] = start.stress;
    let mut parts = vec![format!(
        "stress at the start, from the contacts between grains: xx {xx:.4e}, yy {yy:.4e}, zz {zz:.4e}, xy {xy:.4e} Pa, out of \
         balance by {:.1e} mean contact forces; {} contacts kept their history",
        start.unbalanced_force_ratio, start.histories
    )];
    if start.cut_through > 0 {
        parts.push(format!("{} were cut by the walls", start.cut_through));
    }
    if start.dropped > 0 {
        parts.push(format!("{} of pairs that do not touch were dropped", start.dropped));
    }
    if start.springless > 0 {
        parts.push(format!(
            "{} were dropped because stiffness_ratio = 0 leaves no tangential springs",
            start.springless
        ));
    }
    if start.removed > 0 {
        parts.push(format!("{} grains were removed from regions", start.removed));
    }
    if start.slant > 1e-3 {
        parts.push(format!(
            "the copies lean by {:.1} % of their height against upright walls, which close the gaps first",
            100.0 * start.slant
        ));
    }
    parts.join(", ")
}
