//! `[initial_stress] prepare`: cells brought to the stress of their Gauss points before a run starts.

use super::build::Scene;
use super::input_error::InputError;
use super::place::place_text;
use macro_solver::mesh::point_places;
use macro_solver::problem::{InitialPreparation, InitialStress};
use nalgebra::Matrix3;
use rayon::prelude::*;
use rve_server::definition::PackingError;
use rve_server::preparation::{PreparedCell, StressTarget};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Stresses that differ by less than this share of the pressure differ by rounding only.
const ROUNDING: f64 = 1e-9;

/// What is prepared, or has been.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellPreparation {
    /// Number of cells.
    pub cells: usize,
    /// Lowest and highest vertical pressure, Pa, compression positive; along axis y.
    pub vertical_pressure: [f64; 2],
    /// How many of them took smaller steps; 0 before they are prepared.
    pub in_smaller_steps: usize,
    /// How many of them miss their stress, by at most 1e-4 of the pressure; 0 before.
    pub next_to_stress: usize,
    /// Wall time that it took, s; 0 before.
    pub seconds: f64,
}

/// One cell to prepare.
struct PlannedCell {
    /// Place of its definition.
    definition: usize,
    /// Stress, Pa, by rows, tension positive.
    stress: [[f64; 3]; 3],
    /// The Gauss points that have it.
    points: Vec<usize>,
}

impl Scene {
    /// What `[initial_stress] prepare` asks for; `None` if the cells stay as they are.
    pub fn preparation(&self) -> Option<CellPreparation> {
        let planned = self.planned_cells();
        let vertical = || planned.iter().map(|cell| -cell.stress[1][1]);
        (!planned.is_empty()).then(|| CellPreparation {
            cells: planned.len(),
            vertical_pressure: [
                vertical().fold(f64::INFINITY, f64::min),
                vertical().fold(f64::NEG_INFINITY, f64::max),
            ],
            in_smaller_steps: 0,
            next_to_stress: 0,
            seconds: 0.0,
        })
    }

    /// Refuses stresses that no grains bear before any are moved.
    ///
    /// # Errors
    /// The first of them, with its place and remedy.
    pub(crate) fn check_preparation(&self) -> Result<(), InputError> {
        let dimension = |cell: &PlannedCell| self.materials.definitions[cell.definition].dimension() as usize;
        for cell in &self.planned_cells() {
            StressTarget::of_tensor(&cell.stress, dimension(cell)).map_err(|error| self.refusal(cell, &error))?;
        }
        Ok(())
    }

    /// A remark on frames that are cut from prepared cells.
    pub(crate) fn frames_out_of_balance(&self) -> Option<String> {
        let frame = self.definition().options().frame.as_ref()?;
        (self.preparation().is_some() && !frame.shared_sides).then(|| {
            "initial_stress: cells are brought to their stress as periodic cells; in the frames cut from them stresses are off by some per \
             cent, so that the first step begins out of balance; rve.frame.shared_sides = true keeps them"
                .to_owned()
        })
    }

    /// Brings the cells to the stress of their points if the scene asks for it, on all cores; the result does not depend on their number.
    /// `progress` is called from any thread with the number of cells done and says whether to go on. Returns `false`, with nothing changed,
    /// if it said no.
    ///
    /// # Errors
    /// A stress that the grains of a point cannot carry, with its place and remedy.
    pub fn prepare_cells(&mut self, progress: &(dyn Fn(usize) -> bool + Sync)) -> Result<bool, InputError> {
        let Some(preparation) = self.preparation() else { return Ok(true) };
        let planned = self.planned_cells();
        let done = AtomicUsize::new(0);
        let (first_to_fail, is_stopped) = (AtomicUsize::new(usize::MAX), AtomicBool::new(false));
        let prepare = |(place, cell): (usize, &PlannedCell)| {
            // The error of the first cell in order is reported, so cells behind one that failed no longer matter.
            if place > first_to_fail.load(Ordering::Relaxed) || is_stopped.load(Ordering::Relaxed) {
                return None;
            }
            let made = self.materials.definitions[cell.definition].at_stress(&cell.stress);
            if !progress(done.fetch_add(1, Ordering::Relaxed) + 1) {
                is_stopped.store(true, Ordering::Relaxed);
            }
            if made.is_err() {
                first_to_fail.fetch_min(place, Ordering::Relaxed);
            }
            Some(made.map_err(|error| self.refusal(cell, &error)))
        };
        let made: Vec<Option<Result<PreparedCell, InputError>>> =
            planned.par_iter().enumerate().map(prepare).collect();
        if is_stopped.into_inner() {
            return Ok(false);
        }
        // Cells that were left out stand behind the error that ends this.
        let made = made.into_iter().flatten().collect::<Result<Vec<_>, _>>()?;
        // The first definition stays: it is the packing of the scene itself.
        let first = self.materials.definitions.len();
        for (place, cell) in planned.iter().enumerate() {
            for &point in &cell.points {
                self.materials.made_of[point] = first + place;
            }
        }
        let in_smaller_steps = made.iter().filter(|cell| cell.in_smaller_steps).count();
        let next_to_stress = made.iter().filter(|cell| cell.next_to_stress).count();
        self.materials.definitions.extend(made.into_iter().map(|cell| cell.definition));
        self.prepared = Some(CellPreparation { in_smaller_steps, next_to_stress, ..preparation });
        Ok(true)
    }

    /// The cells to prepare, in the order of their first points.
    fn planned_cells(&self) -> Vec<PlannedCell> {
        let InitialPreparation { prepare, prepare_spacing: spacing } = self.problem.initial.preparation;
        let Some(expected) = self.problem.initial.expected.as_ref().filter(|_| prepare) else { return Vec::new() };
        let places = point_places(&self.problem.mesh);
        let stresses: Vec<Matrix3<f64>> =
            places.iter().enumerate().map(|(point, place)| expected.at(point, *place)).collect();
        let pressures = stresses.iter().map(|stress| -stress[(1, 1)]);
        let lowest = pressures.clone().filter(|pressure| *pressure > 0.0).fold(f64::INFINITY, f64::min);
        let mut places_of: BTreeMap<(usize, i64), usize> = BTreeMap::new();
        let mut planned: Vec<PlannedCell> = Vec::new();
        for (point, pressure) in pressures.enumerate() {
            let level = (pressure / lowest).ln() / spacing.max(ROUNDING).ln_1p();
            // Pressures that are not positive are refused with their cell.
            let level = match expected {
                InitialStress::AtPoints(_) => i64::try_from(point).expect("points are far fewer"),
                InitialStress::Uniform(_) | InitialStress::Geostatic { .. } if level.is_finite() => {
                    level.round() as i64
                }
                InitialStress::Uniform(_) | InitialStress::Geostatic { .. } => i64::MIN,
            };
            let definition = self.materials.made_of[point];
            let place = *places_of.entry((definition, level)).or_insert_with(|| {
                planned.push(PlannedCell { definition, stress: [[0.0; 3]; 3], points: Vec::new() });
                planned.len() - 1
            });
            planned[place].points.push(point);
        }
        for cell in &mut planned {
            let sum: Matrix3<f64> = cell.points.iter().map(|&point| stresses[point]).sum();
            let mean = if spacing == 0.0 { stresses[cell.points[0]] } else { sum / cell.points.len() as f64 };
            cell.stress = std::array::from_fn(|i| std::array::from_fn(|j| mean[(i, j)]));
        }
        planned
    }

    fn refusal(&self, cell: &PlannedCell, error: &PackingError) -> InputError {
        let point = cell.points[0];
        let at = place_text(&self.problem.mesh, point);
        let [[xx, xy, xz], [_, yy, yz], [.., zz]] = cell.stress;
        let shear = if self.problem.mesh.dimension.count() == 2 {
            format!("xy {xy:.3e}")
        } else {
            format!("xy {xy:.3e}, xz {xz:.3e}, yz {yz:.3e}")
        };
        self.document
            .error_at_key(
                &["initial_stress", "prepare"],
                format!(
                    "the cell of Gauss point {point} at {at} cannot be brought to the stress xx {xx:.3e}, yy {yy:.3e}, zz {zz:.3e}, {shear} Pa \
                     (tension positive): {error}"
                ),
            )
            .hint(
                "grains bear no tension and only so much shear: give a surcharge, a rest_coefficient that their friction allows (with \
                 `equilibrium`, a smaller friction_angle), or a denser packing",
            )
    }
}
