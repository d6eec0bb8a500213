//! `cells/*.json`: the grains of Gauss points for the page, those of any point on request and those of all points at the end.

use super::grains::{CommittedCell, Renderer, Snapshots, renderer};
use macro_solver::material::PointId;
use macro_solver::observer::StopRequest;
use macro_solver::output::{OutputError, write_without_flush};
use page::cell::{Cell, Contact, FOLDER, Grain};
use protocol::RveError;
use rve_server::definition::AnyDefinition;
use rve_server::homogenization::picture::CellPicture;
use scene_reader::Materials;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};
use thiserror::Error;

/// Most grains whose last states are written unasked: some 15 MB.
const MOST_GRAINS: usize = 100_000;

/// Why the cell of a Gauss point was not written.
#[derive(Debug, Error)]
enum CellError {
    #[error("no step was accepted")]
    NoStep,
    #[error("there is no such point, or another engine solves it")]
    NoState,
    #[error(transparent)]
    Definition(#[from] RveError),
    #[error(transparent)]
    Picture(#[from] StopRequest),
    #[error(transparent)]
    Folder(#[from] io::Error),
    #[error(transparent)]
    Write(#[from] OutputError),
}

/// Writes cells of accepted steps.
pub(super) struct CellWriter<'a> {
    folder: PathBuf,
    materials: &'a Materials,
    snapshots: Snapshots,
    /// Snapshots of all points after the last accepted step, and the step.
    accepted: Option<(u64, BTreeMap<PointId, CommittedCell>)>,
    /// Step and snapshots that a continued run starts from: its last accepted step until it accepts one itself. A run that
    /// was killed after its last step accepts none.
    continued: Option<(u64, Snapshots)>,
    /// By definition.
    renderers: BTreeMap<usize, Box<dyn Renderer>>,
}

impl<'a> CellWriter<'a> {
    /// A writer into the folder of a run.
    pub(super) fn new(
        folder: &Path,
        materials: &'a Materials,
        snapshots: Snapshots,
        continued: Option<(u64, Snapshots)>,
    ) -> Self {
        let folder = folder.to_owned();
        Self { folder, materials, snapshots, accepted: None, continued, renderers: BTreeMap::new() }
    }

    /// Without an accepted step takes the one that the run continues from.
    fn take_continued(&mut self) {
        if self.accepted.is_none() {
            let read = self.continued.as_ref().filter(|(_, snapshots)| !snapshots.borrow().is_empty());
            self.accepted = read.map(|(step, snapshots)| (*step, snapshots.borrow().clone()));
        }
    }

    /// Takes note of an accepted step: a later attempt may commit states that are not accepted.
    pub(super) fn accept(&mut self, step: u64) {
        self.accepted = Some((step, self.snapshots.borrow().clone()));
    }

    /// Writes the cell of a point after the last accepted step. Failure is logged: it concerns the page only.
    pub(super) fn write(&mut self, point: PointId) {
        self.take_continued();
        if let Err(reason) = self.try_write(point) {
            tracing::warn!(point, %reason, "the cell of a Gauss point could not be written");
        }
    }

    /// Writes the cells of all points, unless they have too many grains.
    pub(super) fn write_all(&mut self) {
        self.take_continued();
        let points: Vec<PointId> = self.accepted.iter().flat_map(|(_, states)| states.keys().copied()).collect();
        let mut grains = 0;
        for &point in &points {
            grains += match &self.materials.definitions[self.materials.made_of[point]] {
                AnyDefinition::Discs(definition) => definition.packing.grains.len(),
                AnyDefinition::Spheres(definition) => definition.packing.grains.len(),
            };
        }
        if grains <= MOST_GRAINS {
            points.into_iter().for_each(|point| self.write(point));
        } else {
            tracing::info!(grains, most = MOST_GRAINS, "the last cells are not written: too many grains");
        }
    }

    fn try_write(&mut self, point: PointId) -> Result<(), CellError> {
        let Some((step, states)) = &self.accepted else { return Err(CellError::NoStep) };
        let Some(committed) = states.get(&point) else {
            return Err(CellError::NoState);
        };
        let definition = self.materials.made_of[point];
        if !self.renderers.contains_key(&definition) {
            let made = renderer(&self.materials.definitions[definition])?;
            self.renderers.insert(definition, made);
        }
        let picture = self.renderers[&definition].picture(committed)?;
        let folder = self.folder.join(FOLDER);
        fs::create_dir_all(&folder)?;
        let text = cell(point, *step, &picture).to_json().to_string();
        Ok(write_without_flush(&self.folder.join(Cell::file(point)), text.as_bytes())?)
    }
}

fn cell(point: PointId, step: u64, picture: &CellPicture) -> Cell {
    let places = picture.centres.iter().zip(&picture.radii).zip(&picture.rattlers);
    Cell {
        point,
        step,
        dimension: picture.dimension,
        vectors: picture.cell.clone(),
        grains: places.map(|((&centre, &radius), &is_rattler)| Grain { centre, radius, is_rattler }).collect(),
        contacts: picture
            .contacts
            .iter()
            .map(|contact| Contact {
                from: contact.from,
                to: contact.to,
                compression: -contact.normal_force,
                tangential: contact.tangential_force,
                is_sliding: contact.is_sliding,
            })
            .collect(),
    }
}
