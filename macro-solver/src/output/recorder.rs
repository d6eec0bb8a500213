//! The observer that fills a run's output folder while the solver goes.

use super::appended::EarlierFiles;
use super::frames::{frame_file, write_frame, write_point_frame};
use super::points::point_columns;
use super::probe::LargestLevels;
use super::table::{TableFile, TableRow};
use super::units::{Units, headed, history_units, own, point_unit, write_units};
use super::{
    ChosenField, FieldSeries, HistoryLayout, HistoryRow, HistoryWriter, OutputError, Probe, Profile, References,
};
use crate::checkpoint::{Archive, CheckpointError};
use crate::mesh::Dimension;
use crate::observer::{FieldsView, Observer, StepReport, StopRequest};
use crate::problem::Problem;
use protocol::Observables;
use std::fs;
use std::path::{Path, PathBuf};

/// What is written, and when.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordPlan {
    /// Columns of the history.
    pub probes: Vec<Probe>,
    /// Profiles, a file in `profiles/` each.
    pub profiles: Vec<Profile>,
    /// Gauss points, numbered through the mesh, with a file in `points/` each.
    pub points: Vec<usize>,
    /// Fields in addition to those that are always written; columns of the files in `points/` as well.
    pub fields: Vec<ChosenField>,
    /// The stages of the run, in order.
    pub stages: Vec<StageOutput>,
    /// Whether the Gauss points are written in addition to the elements.
    pub gauss_points: bool,
    /// Optional results that the points are asked for.
    pub observables: Observables,
    /// Whether pores hold fluid that cannot drain in some stage.
    pub pore_fluid: bool,
    /// Whether the error of the stresses is estimated, and so has its columns.
    pub accuracy: bool,
    /// Headers of tables hold units, `top_force [N/m]`, in this dimension; `None` leaves names alone.
    pub units_in_headers: Option<Dimension>,
}

/// What is written of one stage.
#[derive(Clone, Debug, PartialEq)]
pub struct StageOutput {
    /// Its name.
    pub name: String,
    /// Fields every n steps of the run, in addition to the first and those that end a stage; 0 = never.
    pub fields_every: u64,
}

impl RecordPlan {
    /// Whether the fields of this step are wanted.
    pub fn wants_fields(&self, report: &StepReport) -> bool {
        let every = self.stages.get(report.stage).map_or(0, |stage| stage.fields_every);
        every > 0 && (report.ends_stage || (report.step as u64).is_multiple_of(every))
    }

    /// Whether any fields are wanted.
    pub fn has_fields(&self) -> bool {
        self.stages.iter().any(|stage| stage.fields_every > 0)
    }

    /// Whether a profile is written at this step.
    fn wants_profile(&self, profile: &Profile, report: &StepReport) -> bool {
        report.ends_stage || (report.step as u64).is_multiple_of(profile.every)
    }

    /// The states from whose start anything is counted.
    fn references(&self) -> References {
        let of_probes = self.probes.iter().filter_map(|probe| probe.quantity.reference());
        let of_profiles = self.profiles.iter().filter_map(|profile| profile.probe.reference);
        let compares_steps = self.probes.iter().any(|probe| probe.quantity.compares_steps())
            || self.profiles.iter().any(|profile| profile.probe.measure.compares_steps())
            || self.fields.iter().any(|field| field.measure.compares_steps());
        References::of_stages(of_probes.chain(of_profiles)).comparing_steps(compares_steps)
    }

    /// Units of the history's columns, as its header shows them.
    fn headings(&self) -> Units {
        self.units_in_headers.map(|dimension| history_units(self, dimension)).unwrap_or_default()
    }

    /// Columns behind the fixed ones, and the names behind the numbers of stages.
    fn layout(&self) -> HistoryLayout {
        HistoryLayout {
            headings: self.headings(),
            probes: self.probes.iter().map(|probe| probe.name.clone()).collect(),
            stages: self.stages.iter().map(|stage| stage.name.clone()).collect(),
            accuracy: self.accuracy,
        }
    }
}

/// Writes `history.csv`, `profiles/`, `points/`, `fields.pvd` and `fields/`.
#[derive(Debug)]
pub struct Recorder {
    folder: PathBuf,
    plan: RecordPlan,
    history: HistoryWriter,
    elements: FieldSeries,
    points: FieldSeries,
    curve: Vec<HistoryRow>,
    references: References,
    levels: LargestLevels,
    /// One for each profile, then one for each chosen Gauss point.
    tables: Vec<TableFile>,
    /// Estimated errors of the probes that are means of stresses; absent without an estimate or such probes.
    errors: Option<TableFile>,
}

impl Recorder {
    /// Creates the history, the tables and the folder of fields.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub fn create(folder: &Path, plan: RecordPlan, earlier: EarlierFiles) -> Result<Self, OutputError> {
        let history = HistoryWriter::create(&folder.join("history.csv"), plan.layout(), earlier)?;
        if plan.has_fields() {
            let fields = folder.join("fields");
            fs::create_dir_all(&fields).map_err(|source| OutputError::write(&fields, source))?;
        }
        let tables = tables(folder, &plan, earlier)?;
        let errors = error_table(folder, &plan, earlier)?;
        Ok(Self {
            errors,
            folder: folder.to_owned(),
            references: plan.references(),
            levels: LargestLevels::default(),
            tables,
            plan,
            history,
            elements: FieldSeries::new(&folder.join("fields.pvd")),
            points: FieldSeries::new(&folder.join("gauss_points.pvd")),
            curve: Vec::new(),
        })
    }

    /// All rows written so far.
    pub fn rows(&self) -> &[HistoryRow] {
        &self.curve
    }

    fn record(&mut self, report: &StepReport, view: &FieldsView<'_>) -> Result<(), OutputError> {
        self.references.enter(report);
        let row = HistoryRow {
            step: report.step as u64,
            time: report.time,
            load: report.load,
            iterations: report.iterations as u64,
            evaluations: report.evaluations,
            stage: report.stage,
            probes: self.plan.probes.iter().map(|probe| probe.quantity.value(view, &self.references)).collect(),
            cut_backs: report.cut_backs as u64,
            stabilised: report.stabilisation_increments as u64,
            committed_iterates: report.committed_iterates as u64,
            accuracy: report.accuracy,
            probe_errors: self.probe_errors(report, view),
        };
        if self.plan.wants_fields(report) {
            let frame = frame_file(report.step as u64);
            let more = self.plan.fields.iter().map(|field| field.of_elements(view, &self.references));
            write_frame(&self.folder.join(&frame), view, self.plan.observables, more.collect())?;
            self.elements.add(row.time, frame)?;
            if self.plan.gauss_points {
                let frame = format!("fields/gauss-points-{:04}.vtp", report.step);
                let more = self.plan.fields.iter().map(|field| field.of_points(view, &self.references));
                write_point_frame(&self.folder.join(&frame), view, self.plan.observables, more.collect())?;
                self.points.add(row.time, frame)?;
            }
        }
        self.record_tables(report, view)?;
        self.references.keep(report, view);
        self.history.append(&row)?;
        if let Some(table) = &mut self.errors {
            table.append([error_row(&self.plan, &row)])?;
        }
        self.curve.push(row);
        Ok(())
    }

    fn probe_errors(&mut self, report: &StepReport, view: &FieldsView<'_>) -> Vec<Option<f64>> {
        if self.plan.accuracy { self.levels.errors(&self.plan.probes, report, view) } else { Vec::new() }
    }

    fn record_tables(&mut self, report: &StepReport, view: &FieldsView<'_>) -> Result<(), OutputError> {
        let (of_profiles, of_points) = self.tables.split_at_mut(self.plan.profiles.len());
        let step = report.step as u64;
        for (profile, table) in self.plan.profiles.iter().zip(of_profiles) {
            if self.plan.wants_profile(profile, report) {
                let values = profile.values(view, &self.references);
                let row =
                    |[coordinate, value]: [f64; 2]| TableRow { step, values: vec![report.time, coordinate, value] };
                table.append(values.into_iter().map(row))?;
            }
        }
        let columns = if self.plan.points.is_empty() { Vec::new() } else { point_columns(&self.plan) };
        for (&number, table) in self.plan.points.iter().zip(of_points) {
            if let Some(point) = view.points.get(number) {
                let values = columns.iter().map(|column| column.of(point));
                let more = own_columns(&self.plan).map(|field| field.at(number, point, &self.references));
                let values = values.chain(more);
                table.append([TableRow { step, values: std::iter::once(report.time).chain(values).collect() }])?;
            }
        }
        Ok(())
    }
}

/// Creates the files of profiles and Gauss points.
fn tables(folder: &Path, plan: &RecordPlan, earlier: EarlierFiles) -> Result<Vec<TableFile>, OutputError> {
    let mut tables = Vec::new();
    for profile in &plan.profiles {
        let path = folder.join(format!("profiles/{}.csv", profile.name));
        let unit = plan.units_in_headers.map(|dimension| profile.probe.unit(dimension));
        let units = unit.map(|unit| Units::from([("time", "s"), ("coordinate", "m"), ("value", unit)].map(own)));
        let headings = units.unwrap_or_default();
        let columns = ["time", "coordinate", "value"].map(|name| headed(name, &headings));
        tables.push(TableFile::create(&path, &columns, earlier)?);
    }
    let columns: Vec<String> = point_columns(plan).into_iter().map(|column| column.name).collect();
    let chosen = own_columns(plan).map(|field| field.name.clone()).collect();
    let columns = [vec!["time".to_owned()], columns, chosen].concat();
    let columns: Vec<String> = match plan.units_in_headers {
        Some(dimension) => {
            let chosen = |name: &String| plan.fields.iter().find(|field| field.name == *name);
            let unit = |name: &String| {
                chosen(name).map_or_else(|| point_unit(name, dimension), |field| field.unit(dimension))
            };
            columns.iter().map(|name| headed(name, &Units::from([(name.clone(), unit(name))]))).collect()
        }
        None => columns,
    };
    for number in &plan.points {
        tables.push(TableFile::create(&folder.join(format!("points/point-{number:04}.csv")), &columns, earlier)?);
    }
    Ok(tables)
}

/// The chosen fields that files of Gauss points do not hold anyway.
fn own_columns(plan: &RecordPlan) -> impl Iterator<Item = &ChosenField> {
    let fixed = point_columns(plan);
    plan.fields.iter().filter(move |field| !fixed.iter().any(|column| column.name == field.name))
}

/// Creates the table of the estimated errors of the probes, if there are any.
fn error_table(folder: &Path, plan: &RecordPlan, earlier: EarlierFiles) -> Result<Option<TableFile>, OutputError> {
    let of_stresses = plan.probes.iter().filter(|probe| probe.quantity.has_error());
    let headings = plan.headings();
    let columns: Vec<String> = of_stresses.map(|probe| headed(&probe.name, &headings)).collect();
    let wanted = plan.accuracy && !columns.is_empty();
    wanted.then(|| TableFile::create(&folder.join("probe_errors.csv"), &columns, earlier)).transpose()
}

/// Estimated errors of the probes after a step, NaN where there is no estimate.
fn error_row(plan: &RecordPlan, row: &HistoryRow) -> TableRow {
    let places = plan.probes.iter().enumerate().filter(|(_, probe)| probe.quantity.has_error());
    let error = |(place, _)| row.probe_errors.get(place).copied().flatten().unwrap_or(f64::NAN);
    TableRow { step: row.step, values: places.map(error).collect() }
}

const SECTION: &str = "recorder";

/// Counts changes of what [`Recorder`] saves.
const VERSION: u32 = 9;

/// Frames of a series: time and file.
type Frames = Vec<(f64, String)>;

/// What [`Recorder`] saves: rows of the history, frames of elements and points, reference states, largest levels, rows of the tables.
type Saved = (Vec<HistoryRow>, (Frames, Frames), References, LargestLevels, Vec<Vec<TableRow>>);

impl Observer for Recorder {
    fn started(&mut self, problem: &Problem) -> Result<(), StopRequest> {
        write_units(&self.folder.join("units.json"), &self.plan, problem.mesh.dimension)
            .map_err(|error| StopRequest { reason: error.to_string() })
    }

    fn save(&self, archive: &mut Archive) {
        let tables: Vec<&[TableRow]> = self.tables.iter().map(TableFile::rows).collect();
        let frames = (self.elements.frames(), self.points.frames());
        archive.put(SECTION, VERSION, &(&self.curve, frames, &self.references, &self.levels, tables));
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        let (curve, (elements, points), references, levels, tables): Saved = archive.get(SECTION, VERSION)?;
        let unfit = |error| CheckpointError::unfit(SECTION, error);
        let path = self.folder.join("history.csv");
        self.history = HistoryWriter::reopen(&path, self.plan.layout(), &curve).map_err(unfit)?;
        if let Some(table) = &mut self.errors {
            table.restore(curve.iter().map(|row| error_row(&self.plan, row)).collect()).map_err(unfit)?;
        }
        self.curve = curve;
        self.references = references;
        self.levels = levels;
        for (table, rows) in self.tables.iter_mut().zip(tables) {
            table.restore(rows).map_err(unfit)?;
        }
        self.elements.restore(elements).map_err(unfit)?;
        self.points.restore(points).map_err(unfit)
    }

    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        self.record(report, fields).map_err(|error| StopRequest { reason: error.to_string() })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A plan that records nothing.
    pub(crate) fn plan() -> RecordPlan {
        RecordPlan {
            probes: Vec::new(),
            profiles: Vec::new(),
            points: Vec::new(),
            fields: Vec::new(),
            stages: Vec::new(),
            gauss_points: false,
            observables: Observables::NONE,
            pore_fluid: false,
            accuracy: false,
            units_in_headers: None,
        }
    }
}
