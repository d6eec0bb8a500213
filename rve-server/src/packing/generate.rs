//! Makes a packing: random places at low density, isotropic compression until the grains carry load, then a servo on
//! all three stress components until the stress is isotropic and the grains are at rest.

use crate::cell::Cell;
use crate::definition::{ContactTable, GrainDefinition, RveOptions};
use crate::engine::GrainRve;
use crate::homogenization::fabric::anisotropy;
use crate::packing::recipe::PackingRecipe;
use crate::packing::{ListedContact, PackingError, PackingFile};
use crate::plane::{self, Plane};
use crate::space::Discs;
use crate::state::ContactRecord;
use protocol::{Ask, Observables, RveError, RveSolver, TangentKind, Tensor2, TrialAnswer};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Solid fraction of the random places: sparse enough that sequential insertion never jams.
const START_SOLID_FRACTION: f64 = 0.45;

/// Places tried for one grain before giving up.
const PLACES_PER_GRAIN: u32 = 100_000;

/// First isotropic compression per increment; grains move by a hundredth of a radius or so.
const FIRST_COMPRESSION: f64 = 5e-3;

/// Share of the target pressure at which the compression hands over to the servo.
const HANDOVER: [f64; 2] = [0.02, 0.2];

/// Most increments of either stage.
const MOST_INCREMENTS: u32 = 5_000;

/// How far a preparation has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackingProgress {
    /// What is being done.
    pub stage: &'static str,
    /// Increments done in this stage.
    pub increment: u32,
    /// Solid area over cell area.
    pub solid_fraction: f64,
    /// Mean pressure, Pa, compression positive.
    pub pressure: f64,
    /// Largest deviation of a stress component from the target over the target pressure.
    pub stress_error: f64,
    /// Unbalanced force over mean normal force.
    pub unbalanced_force_ratio: f64,
}

/// What a preparation has achieved, measured on the packing as written.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PackingReport {
    /// Void area over grain area.
    pub void_ratio: f64,
    /// 2 x contacts over grains.
    pub coordination_number: f64,
    /// The same without rattlers.
    pub coordination_number_no_rattlers: f64,
    /// Major over minor principal fabric, minus 1.
    pub fabric_anisotropy: f64,
    /// Largest deviation of a stress component from the target over the target pressure.
    pub stress_error: f64,
    /// Unbalanced force over mean normal force.
    pub unbalanced_force_ratio: f64,
    /// Largest overlap over grain diameter.
    pub max_overlap_ratio: f64,
    /// DEM steps spent.
    pub force_evaluations: u64,
}

/// Makes the packing that a recipe describes. Equal recipes give equal bits.
///
/// # Errors
/// [`PackingError::Content`] when the recipe is refused or the target is not reached.
pub fn generate(
    recipe: &PackingRecipe,
    progress: &mut dyn FnMut(&PackingProgress),
) -> Result<(PackingFile, PackingReport), PackingError> {
    recipe.validate()?;
    let mut preparation = Preparation::new(recipe, progress)?;
    preparation.compress()?;
    preparation.servo()?;
    let packing = preparation.packing()?;
    let report = measured(recipe, &packing, preparation.force_evaluations)?;
    Ok((packing, report))
}

struct Preparation<'a> {
    recipe: &'a PackingRecipe,
    progress: &'a mut dyn FnMut(&PackingProgress),
    cell: GrainRve,
    force_evaluations: u64,
}

impl<'a> Preparation<'a> {
    fn new(recipe: &'a PackingRecipe, progress: &'a mut dyn FnMut(&PackingProgress)) -> Result<Self, PackingError> {
        let definition = GrainDefinition {
            packing: scattered(recipe)?,
            contact: recipe.contact.clone(),
            options: RveOptions {
                strain_per_step: Some(2e-4),
                tolerance: Some(1e-2),
                max_steps: Some(2_000),
                ..RveOptions::default()
            },
        };
        let cell = GrainRve::new(&definition).map_err(content)?;
        Ok(Self { recipe, progress, cell, force_evaluations: 0 })
    }

    /// Isotropic compression; increments that overshoot are taken back and halved.
    fn compress(&mut self) -> Result<(), PackingError> {
        let mut compression = FIRST_COMPRESSION;
        for increment in 0..MOST_INCREMENTS {
            let strain = [[-compression, 0.0], [0.0, -compression]];
            let answer = self.trial(&strain, TangentKind::None)?;
            let share = pressure(&answer.stress.plane()) / self.recipe.pressure;
            if share > HANDOVER[1] {
                self.cell.rollback();
                compression *= 0.5;
                continue;
            }
            self.cell.commit().map_err(content)?;
            self.report("compression", increment, &answer);
            if share > HANDOVER[0] {
                return Ok(());
            }
        }
        Err(PackingError::Content(format!("compression did not reach a pressure in {MOST_INCREMENTS} increments")))
    }

    /// Newton steps on all three stress components with the network's own tangent.
    fn servo(&mut self) -> Result<(), PackingError> {
        let target = self.recipe.pressure;
        self.cell.set_options(RveOptions {
            strain_per_step: Some(2e-6),
            tolerance: Some(1e-4),
            max_steps: Some(20_000),
            ..RveOptions::default()
        });
        let mut answer = self.trial(&[[-1e-9, 0.0], [0.0, -1e-9]], TangentKind::TrussLike)?;
        let mut refined = false;
        for increment in 0..MOST_INCREMENTS {
            self.cell.commit().map_err(content)?;
            self.report("servo", increment, &answer);
            let error = stress_error(&answer.stress.plane(), target);
            if refined
                && error <= self.recipe.stress_tolerance
                && answer.scalars.unbalanced_force_ratio <= self.recipe.tolerance
            {
                return Ok(());
            }
            if error < 1e-2 && !refined {
                refined = true;
                self.cell.set_options(RveOptions {
                    strain_per_step: Some(1e-6),
                    tolerance: Some(self.recipe.tolerance),
                    max_steps: Some(100_000),
                    ..RveOptions::default()
                });
            }
            let strain = servo_strain(&answer, target);
            answer = self.trial(&strain, TangentKind::TrussLike)?;
        }
        Err(PackingError::Content(format!(
            "the stress did not reach the target in {MOST_INCREMENTS} servo steps; loosen tolerance or stress_tolerance"
        )))
    }

    fn trial(&mut self, strain: &Plane, tangent: TangentKind) -> Result<TrialAnswer, PackingError> {
        let ask = Ask { tangent, ..Ask::default() };
        let answer = self.cell.trial(&Tensor2::from_plane(*strain), &ask).map_err(content)?;
        self.force_evaluations += answer.cost.force_evaluations;
        Ok(answer)
    }

    fn report(&mut self, stage: &'static str, increment: u32, answer: &TrialAnswer) {
        let stress = answer.stress.plane();
        (self.progress)(&PackingProgress {
            stage,
            increment,
            solid_fraction: 1.0 / (1.0 + answer.scalars.void_ratio),
            pressure: pressure(&stress),
            stress_error: stress_error(&stress, self.recipe.pressure),
            unbalanced_force_ratio: answer.scalars.unbalanced_force_ratio,
        });
    }

    /// The committed state as a file, turned so that Y1 points along x: an isotropic stress does not mind.
    fn packing(&self) -> Result<PackingFile, PackingError> {
        let state = self.cell.committed();
        let first = state.cell.rows[0];
        let length = (first[0] * first[0] + first[1] * first[1]).sqrt();
        let (cosine, sine) = (first[0] / length, first[1] / length);
        let back = [[cosine, sine], [-sine, cosine]];
        let mut rows = state.cell.deformed(&back).rows;
        rows[0][1] = 0.0;
        let radii = &self.cell.model().radii;
        let grains = state.positions.iter().zip(radii).map(|(position, radius)| {
            let [x, y] = plane::apply(&back, *position);
            [x, y, *radius]
        });
        let contacts = state.contacts.iter().filter(|contact| contact.tangential_force != 0.0).map(|contact| {
            let ContactRecord { origin, end, shift, tangential_force } = *contact;
            ListedContact { origin, end, shift, tangential_force }
        });
        PackingFile::<Discs> {
            format: PackingFile::FORMAT.into(),
            version: PackingFile::VERSION,
            dimension: 2,
            thickness: self.recipe.thickness,
            periodicity: rows,
            grains: grains.collect(),
            contacts: contacts.collect(),
            provenance: serde_json::json!({
                "made_by": concat!("grainspan pack ", env!("CARGO_PKG_VERSION")),
                "recipe": self.recipe,
            }),
        }
        .checked()
    }
}

/// Strain that the tangent promises to bring the stress to the target, or half way there in the logarithm while the
/// pressure is still far off: the network stiffens as it is compressed.
fn servo_strain(answer: &TrialAnswer, target: f64) -> Plane {
    let stress = answer.stress.plane();
    let aim = target.min(2.0 * pressure(&stress).max(0.01 * target));
    let wanted = [-aim - stress[0][0], -aim - stress[1][1], -0.5 * (stress[0][1] + stress[1][0])];
    let c = answer.tangent.as_ref().map(|tangent| tangent.plane()).unwrap_or_default();
    // Symmetric strain (e11, e22, e12 = e21): columns 0, 3 and 1 + 2; stress rows 0, 3 and the mean of 1 and 2.
    let row = |i: usize| [c[i][0], c[i][3], c[i][1] + c[i][2]];
    let (shear_1, shear_2) = (row(1), row(2));
    let matrix = nalgebra::Matrix3::from_rows(&[
        nalgebra::RowVector3::from(row(0)),
        nalgebra::RowVector3::from(row(3)),
        nalgebra::RowVector3::from(std::array::from_fn::<f64, 3, _>(|k| 0.5 * (shear_1[k] + shear_2[k]))),
    ]);
    let step = matrix.lu().solve(&nalgebra::Vector3::from(wanted)).filter(|step| step.iter().all(|e| e.is_finite()));
    // A singular network (too few contacts) is simply compressed a little further.
    let [e11, e22, e12] = step.map_or([-1e-5, -1e-5, 0.0], |step| [step[0], step[1], step[2]]);
    let largest = e11.abs().max(e22.abs()).max(e12.abs());
    let shrink = (1e-3 / largest).min(1.0);
    [[e11 * shrink, e12 * shrink], [e12 * shrink, e22 * shrink]]
}

/// Random places without overlap in a square cell, largest grains first.
fn scattered(recipe: &PackingRecipe) -> Result<PackingFile, PackingError> {
    let radii = recipe.radii();
    let solid: f64 = radii.iter().map(|radius| std::f64::consts::PI * radius * radius).sum();
    let side = (solid / START_SOLID_FRACTION).sqrt();
    let cell = Cell { rows: [[side, 0.0], [0.0, side]] };
    let mut order: Vec<usize> = (0..radii.len()).collect();
    order.sort_by(|a, b| radii[*b].total_cmp(&radii[*a]));
    let mut random = ChaCha8Rng::seed_from_u64(recipe.seed);
    let mut placed: Vec<[f64; 3]> = Vec::with_capacity(radii.len());
    for grain in order {
        let radius = radii[grain];
        let place = (0..PLACES_PER_GRAIN)
            .map(|_| [side * unit_interval(&mut random), side * unit_interval(&mut random)])
            .find(|place| placed.iter().all(|other| !overlap(&cell, *place, radius, other)))
            .ok_or_else(|| {
                PackingError::Content("the grains do not fit at random; the grading is too wide".into())
            })?;
        placed.push([place[0], place[1], radius]);
    }
    Ok(PackingFile::<Discs> {
        format: PackingFile::FORMAT.into(),
        version: PackingFile::VERSION,
        dimension: 2,
        thickness: recipe.thickness,
        periodicity: cell.rows,
        grains: placed,
        contacts: Vec::new(),
        provenance: serde_json::Value::Null,
    })
}

fn overlap(cell: &Cell, place: [f64; 2], radius: f64, other: &[f64; 3]) -> bool {
    let side = cell.rows[0][0];
    let nearest = |difference: f64| difference - side * (difference / side).round();
    let (dx, dy) = (nearest(place[0] - other[0]), nearest(place[1] - other[1]));
    dx * dx + dy * dy < (radius + other[2]).powi(2)
}

/// 53 random bits as a number in [0, 1).
fn unit_interval(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Pressure of a stress, Pa, compression positive.
fn pressure(stress: &Plane) -> f64 {
    -0.5 * (stress[0][0] + stress[1][1])
}

fn stress_error(stress: &Plane, target: f64) -> f64 {
    let deviation = plane::add_scaled(stress, target, &plane::IDENTITY);
    plane::largest_component(&deviation) / target
}

/// Measures a packing as a user of the file would find it.
fn measured(
    recipe: &PackingRecipe,
    packing: &PackingFile,
    force_evaluations: u64,
) -> Result<PackingReport, PackingError> {
    let contact: ContactTable = recipe.contact.clone();
    let definition = GrainDefinition { packing: packing.clone(), contact, options: RveOptions::default() };
    let mut cell = GrainRve::new(&definition).map_err(content)?;
    let answer = cell.look(Observables::ALL);
    let fabric = answer.observed.fabric.plane();
    Ok(PackingReport {
        void_ratio: answer.scalars.void_ratio,
        coordination_number: answer.scalars.coordination_number,
        coordination_number_no_rattlers: answer.observed.coordination_number_no_rattlers,
        fabric_anisotropy: anisotropy(&fabric),
        stress_error: stress_error(&answer.stress.plane(), recipe.pressure),
        unbalanced_force_ratio: answer.scalars.unbalanced_force_ratio,
        max_overlap_ratio: answer.scalars.max_overlap_ratio,
        force_evaluations,
    })
}

fn content(error: RveError) -> PackingError {
    PackingError::Content(error.to_string())
}
