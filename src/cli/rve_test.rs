//! `grainspan element TEST.toml`, alias `rve-test`: one cell along a strain/stress path, in this process, without finite elements.

use super::cell_files::{ENDINGS, write_all};
use super::earlier_files::remove_numbered;
use super::failure_case;
use super::sweep::{self, Common, Sweep};
use super::waiting_progress::WaitingProgress;
use crate::exit::{Exit, Failure};
use crate::folder_lock::refuse_folder_of_a_run;
use crate::stderr::tell;
use crate::stdout::{deliver, expect_place, print};
use crate::workers::SignalWatch;
use macro_solver::output::OutputError;
use protocol::TangentKind;
use rve_server::programs::rve_test::{
    ElementCsv, ElementError, ElementRow, ElementSummary, RowRequests, Segment, StopRequests, run_element_on,
    start_note, start_warnings,
};
use scene_reader::{Document, InputError, Kind, read_element_test};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::io::Write;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Arguments of `grainspan element`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan element scenes/rve-biaxial.toml > curve.csv
  grainspan element --replay out/biaxial/quarantine.replay
  grainspan element scenes/rve-biaxial.toml --tangent truss_like \\
      --set rve.accuracy=tight --out curve.csv
  grainspan element scenes/rve-biaxial.toml --contacts out/contacts \\
      --contacts-at 0,10,20 --out curve.csv
  grainspan element scenes/rve-biaxial.toml --contacts out/contacts \\
      --fluctuations-from 0 --out curve.csv
  grainspan element scenes/rve-biaxial.toml \\
      --sweep contact.friction=0.1:0.7:7 --out friction.csv")]
pub(crate) struct Arguments {
    /// Element test: packing, contact law and path
    #[arg(value_name = "TEST.toml", required_unless_present = "replay")]
    test: Option<PathBuf>,
    /// Repeat the trial that a run has quarantined because it ended its workers
    #[arg(long, value_name = "FILE", conflicts_with_all = ["test", "overrides", "tangent", "out", "contacts", "size", "quiet"])]
    replay: Option<PathBuf>,
    /// File to write [default: standard output, row by row]
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// One of the sizes that the file names in `[sizes]` [default: the file as it stands]
    #[arg(long, value_name = "NAME")]
    size: Option<String>,
    /// Override a key of the test
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Add the columns of a tangent operator: truss_like, truss_like_slip, quasi_static, consistent, kruyt ... (a wrong
    /// keyword lists all)
    #[arg(long, value_name = "KIND", default_value = "none")]
    tangent: TangentKind,
    /// Folder for grains, contacts, force chains and rose diagrams of chosen increments; those of an
    /// earlier test are replaced
    #[arg(long, value_name = "DIR")]
    contacts: Option<PathBuf>,
    /// Increments of --contacts, 0 is the packing as given [default: 0 and the last one]
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', requires = "contacts")]
    contacts_at: Vec<u64>,
    /// Add displacement fluctuations of the grains to the files of --contacts, counted from this increment: the displacement less
    /// that of the mean deformation of the cell
    #[arg(long, value_name = "N", requires = "contacts")]
    fluctuations_from: Option<u64>,
    /// Repeat the test with many values of a key, FIRST:LAST:COUNT or VALUE,VALUE,..., into one table; given for several keys, with
    /// all combinations
    #[arg(long = "sweep", value_name = "KEY.PATH=VALUES", conflicts_with_all = ["replay", "contacts"])]
    sweeps: Vec<Sweep>,
    /// Tests of a sweep that run at the same time [default: one per core]
    #[arg(long, value_name = "N", requires = "sweeps")]
    jobs: Option<NonZeroUsize>,
    /// Put units into the header: `sigma_xx [Pa]`
    #[arg(long, conflicts_with = "replay")]
    units: bool,
    /// Print nothing on standard error but warnings and errors
    #[arg(long)]
    quiet: bool,
}

/// Runs the test.
///
/// # Errors
/// A test that is not sound (exit code 2); a path that the cell or the stress control could not follow (exit code 1,
/// the rows before are written); a stop that was requested (exit code 130, likewise).
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    if let Some(file) = &arguments.replay {
        return failure_case::run(file);
    }
    let path = arguments.test.as_ref().expect("the command line asks for a test or a replay");
    if !arguments.sweeps.is_empty() {
        let common = Common {
            path,
            size: arguments.size.as_deref(),
            overrides: &arguments.overrides,
            tangent: arguments.tangent,
            out: arguments.out.as_deref(),
            units: arguments.units,
            jobs: arguments.jobs,
            quiet: arguments.quiet,
        };
        return sweep::run(&common, &arguments.sweeps);
    }
    let document = Document::read_in_size(path, arguments.size.as_deref(), &arguments.overrides)?;
    crate::exit::warn(&document);
    document.expect(Kind::ElementTest)?;
    let (test, packing) = read_element_test(&document)?;
    if let Some(remark) = packing.narrow_cell() {
        tell(format_args!("warning: {remark}"));
    }
    expect_place(arguments.out.as_deref(), &[path, &document.resolve(Path::new(&test.packing))])?;
    let buffer = Rc::new(RefCell::new(Vec::new()));
    let mut rows = Rows::new(arguments, &buffer)?;
    let progress_line = WaitingProgress::start(arguments.quiet);
    let rows_of = |segment: &Segment| (segment.increments as usize).saturating_mul(segment.repeat as usize);
    let expected = test.path.iter().map(rows_of).fold(0, usize::saturating_add);
    let interrupt = SignalWatch::flag("the present trial is the last")?;
    let raised = interrupt.clone();
    let requests = RowRequests {
        tangent: arguments.tangent,
        pictures: pictures(arguments, expected as u64)?,
        fluctuations_from: arguments.fluctuations_from,
        stop: StopRequests::new(move || raised.is_raised()),
    };
    let mut done = 0;
    progress_line.set(format!("row 0 of {expected}"));
    let end = run_element_on(&test, packing, requests, &mut |row| {
        if row.increment == 0 {
            start_warnings(&test, row).iter().for_each(|text| progress_line.say(format_args!("warning: {text}")));
            start_note(&test, row).iter().for_each(|text| progress_line.say(format_args!("note: {text}")));
        }
        rows.add(row);
        rows.draw(row, arguments.contacts.as_deref());
        done += 1;
        progress_line.set(format!("row {done} of {expected}"));
        let is_over = interrupt.is_raised() || rows.failure.is_some();
        if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    drop(progress_line);
    // A test that could not begin has no table, and leaves an earlier one alone.
    if end.summary.rows > 0 {
        rows.finish(arguments.out.as_deref())?;
        if !arguments.quiet {
            tell(closing(&end.summary));
        }
    }
    let interrupted = || {
        // Row 0 is the packing as given.
        let text = format!("{}: interrupted after row {} of {expected}", path.display(), done.max(1) - 1);
        Err(Failure::new(Exit::Interrupted, format!("{text}; the rows up to there are written")))
    };
    match end.result {
        Ok(()) if done <= expected && interrupt.is_raised() => interrupted(),
        Ok(()) => Ok(Exit::Done),
        Err(ElementError::Interrupted { .. }) => interrupted(),
        Err(error) if error.is_bad_input() => Err(document.table_error(error).into()),
        Err(error) => Err(Failure::new(Exit::NotConverged, format!("{}: {error}", path.display()))),
    }
}

/// The increments whose contacts are written, with their folder made.
///
/// # Errors
/// There is no such increment; the folder is that of a run, or cannot be made.
fn pictures(arguments: &Arguments, last: u64) -> Result<BTreeSet<u64>, Failure> {
    let Some(folder) = &arguments.contacts else { return Ok(BTreeSet::new()) };
    let refuse = |problem: String, hint: &str| Err(InputError::at("--contacts", problem).hint(hint).into());
    if let Some(beyond) = arguments.contacts_at.iter().find(|increment| **increment > last) {
        return refuse(
            format!("there is no increment {beyond}"),
            &format!("the test has the increments 0 to {last}"),
        );
    }
    let chosen = &arguments.contacts_at;
    let chosen = if chosen.is_empty() { BTreeSet::from([0, last]) } else { chosen.iter().copied().collect() };
    if let Some(from) = arguments.fluctuations_from
        && chosen.iter().all(|increment| *increment <= from)
    {
        let problem = InputError::at("--fluctuations-from", format!("no picture comes after increment {from}"));
        return Err(problem.hint("name a later increment in --contacts-at, or an earlier one here").into());
    }
    refuse_folder_of_a_run("--contacts", folder)?;
    std::fs::create_dir_all(folder).map_err(|source| OutputError::write(folder, source))?;
    Ok(chosen)
}

/// Encodes rows; without an output file each goes to standard output at once.
struct Rows {
    buffer: Rc<RefCell<Vec<u8>>>,
    csv: ElementCsv<SharedBuffer>,
    streams: bool,
    /// Whether grains and contacts have been written.
    has_drawn: bool,
    failure: Option<Failure>,
}

impl Rows {
    fn new(arguments: &Arguments, buffer: &Rc<RefCell<Vec<u8>>>) -> Result<Self, Failure> {
        let csv = ElementCsv::new(SharedBuffer(Rc::clone(buffer)), arguments.tangent)
            .map_err(|error| Failure::new(Exit::BadInput, error))?
            .with_units(arguments.units);
        Ok(Self { buffer: Rc::clone(buffer), csv, streams: arguments.out.is_none(), has_drawn: false, failure: None })
    }

    fn add(&mut self, row: &ElementRow) {
        let written = self.csv.write(row).map_err(|error| Failure::new(Exit::BadInput, error));
        let printed = written.and_then(|()| if self.streams { print(&self.buffer.take()) } else { Ok(()) });
        if let Err(failure) = printed {
            self.failure.get_or_insert(failure);
        }
    }

    /// Writes the grains and contacts of a row that has them.
    fn draw(&mut self, row: &ElementRow, folder: Option<&Path>) {
        let (Some(picture), Some(folder)) = (&row.picture, folder) else { return };
        let has_drawn = std::mem::replace(&mut self.has_drawn, true);
        let earlier = if has_drawn { Ok(()) } else { remove_numbered(folder, "increment", &ENDINGS) };
        let stem = format!("increment-{:04}", row.increment);
        let written = earlier.and_then(|()| write_all(folder, &stem, picture, row.fluctuations.as_deref()));
        if let Err(error) = written {
            self.failure.get_or_insert(error.into());
        }
    }

    /// Writes the rows; also those before something else could not be written, which is then the failure.
    fn finish(self, out: Option<&Path>) -> Result<(), Failure> {
        let delivered = deliver(out, &self.buffer.take());
        self.failure.map_or(delivered, Err)
    }
}

/// The encoder's end of the buffer.
struct SharedBuffer(Rc<RefCell<Vec<u8>>>);

impl Write for SharedBuffer {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn closing(summary: &ElementSummary) -> String {
    let in_words = |(what, rows)| format!("{what}: {}", rows_in_words(rows));
    let warnings = summary.warnings().into_iter().map(in_words).chain(summary.listed_forces.warning()).collect();
    let fallbacks = summary.fallbacks().into_iter().map(in_words).collect();
    format!(
        "{}, {}, {}; {}",
        rows_in_words(summary.rows),
        counted(summary.trials, "trial"),
        counted(summary.dem_steps, "force evaluation"),
        shortfalls(warnings, fallbacks)
    )
}

/// What a test fell short of, and by which detours it met its tolerances; the latter are left out where there are none.
pub(super) fn shortfalls(warnings: Vec<String>, fallbacks: Vec<String>) -> String {
    let warnings = if warnings.is_empty() { "none".to_owned() } else { warnings.join(", ") };
    let fallbacks =
        if fallbacks.is_empty() { String::new() } else { format!("; fallbacks: {}", fallbacks.join(", ")) };
    format!("warnings: {warnings}{fallbacks}")
}

/// So many things, whose plural ends in s.
fn counted(count: u64, thing: &str) -> String {
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}

/// A number of rows in words.
pub(super) fn rows_in_words(count: u64) -> String {
    counted(count, "row")
}
