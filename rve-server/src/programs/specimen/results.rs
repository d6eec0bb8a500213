//! Results of a specimen test: rows, start, summary, pictures, events.

use crate::homogenization::picture::ContactLine;

/// One row of results. Stresses in Pa, tension positive; axes that are periodic or do not exist have zero wall stress.
#[derive(Clone, Debug, PartialEq)]
pub struct SpecimenRow {
    /// Name of the stage.
    pub stage: String,
    /// Steps since the start.
    pub step: u64,
    /// Time since the start, s; steps where masses are scaled.
    pub time: f64,
    /// Distance of opposite walls over that at the start, minus 1.
    pub strain: [f64; 3],
    /// Mean of both walls' forces over their area, per axis.
    pub wall_stress: [f64; 3],
    /// Love-Weber stress of all contacts between grains over the box, components xx, yy, zz, xy, xz, yz.
    pub contact_stress: [f64; 6],
    /// Void volume over grain volume.
    pub void_ratio: f64,
    /// 2 x contacts over grains, contacts with walls left out.
    pub coordination_number: f64,
    /// Major over minor principal value of the contact fabric, minus 1.
    pub fabric_anisotropy: f64,
    /// Share of contacts at the friction limit.
    pub sliding_fraction: f64,
    /// Largest unbalanced force over mean contact force.
    pub unbalanced_force_ratio: f64,
    /// Kinetic energy, J.
    pub kinetic_energy: f64,
    /// Stored contact energy, J.
    pub elastic_energy: f64,
    /// Work lost to friction since the start, J.
    pub friction_work: f64,
    /// Work lost to contact viscosity since the start, J.
    pub viscous_work: f64,
    /// Work lost to local damping since the start, J.
    pub damping_work: f64,
    /// Largest overlap over the smaller diameter.
    pub max_overlap_ratio: f64,
    /// Work of the walls and periodic sides on the grains since the start, J.
    pub wall_work: f64,
    /// Shear strain and wall shear stress, Pa, per component that some stage of the test asks for: see
    /// [`SpecimenTest::sheared`](super::SpecimenTest::sheared).
    pub shear: Vec<[f64; 2]>,
    /// Part of the work that came from walls moving along their planes and from periodic sides, J.
    pub shear_work: f64,
    /// Work of gravity on the grains, J.
    pub gravity_work: f64,
    /// Energy put in since the start that is neither stored nor booked as lost, J; negative if there is more than was put in.
    pub missing_energy: f64,
}

/// The specimen before anything has moved: how far it is from what the packing was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpecimenStart {
    /// Love-Weber stress of the contacts between grains, Pa, tension positive: xx, yy, zz, xy, xz, yz.
    pub stress: [f64; 6],
    /// Largest unbalanced force over mean contact force.
    pub unbalanced_force_ratio: f64,
    /// Contacts of all copies whose tangential force or rolling moment was taken over.
    pub histories: usize,
    /// Those that the walls cut through.
    pub cut_through: usize,
    /// Those of pairs that do not touch.
    pub dropped: usize,
    /// Those of a contact law without tangential springs, which could not change them.
    pub springless: usize,
    /// Displacement over height by which the copies lean against the walls.
    pub slant: f64,
    /// Grains that regions have lost.
    pub removed: usize,
}

/// Cost of a test, and counts of missed tolerances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpecimenSummary {
    /// The specimen before anything has moved.
    pub start: SpecimenStart,
    /// Number of grains.
    pub grains: usize,
    /// Steps.
    pub steps: u64,
    /// Renewals of the pair list.
    pub renewals: u64,
    /// How often the step had to be shortened.
    pub shortenings: u64,
    /// Stages that ended at their step cap before they came to balance.
    pub unbalanced_stages: u64,
    /// Rows of stages without `until_balance` whose controlled wall stresses are more than 1 % of the mean target off.
    pub servo_misses: u64,
    /// The largest such distance, over the mean target.
    pub largest_servo_error: f64,
    /// Rows of stages without `until_balance`, with scaled masses, whose largest unbalanced force is above a tenth of the mean contact force.
    pub unbalanced_rows: u64,
    /// The largest such share in any of these stages' rows.
    pub largest_unbalanced: f64,
    /// Rows of the same stages in which walls shear the specimen, all other sides are periodic, and the shear forces of opposite walls differ by
    /// more than 2 % of the normal ones.
    pub shear_misses: u64,
    /// The largest such difference, over the normal force.
    pub largest_shear_difference: f64,
    /// Rows that miss more than 1 % of the energy turned over.
    pub energy_misses: u64,
    /// Largest share of the energy turned over that was missing, or too much, at any check.
    pub largest_energy_error: f64,
    /// Largest energy turned over at any check, J: the scale of what is missing.
    pub largest_turnover: f64,
    /// Rows in which two grains overlap by more than a tenth of a diameter.
    pub overlap_misses: u64,
    /// Largest overlap over the diameter in any row.
    pub largest_overlap: f64,
    /// The listener ended the run before its last stage was done.
    pub is_stopped: bool,
}

/// Grains as pictures need them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpecimenPicture {
    /// Centres, m.
    pub centres: Vec<[f64; 3]>,
    /// Radii, m.
    pub radii: Vec<f64>,
    /// Rotations since the start, rad; about z in the plane.
    pub rotations: Vec<[f64; 3]>,
    /// Velocities, m/s.
    pub velocities: Vec<[f64; 3]>,
}

/// What a run shows at the moment of a row, on request.
pub trait Shown {
    /// The grains.
    fn grains(&self) -> SpecimenPicture;

    /// Contacts between the grains, in sorted pair order; forces with their viscous part. Those with walls are not among them.
    fn contacts(&self) -> Vec<ContactLine>;
}

/// Events of a run in progress.
pub enum SpecimenEvent<'a> {
    /// A step of `steps` in stage `stage` of the test is done; called every hundred steps.
    Progress {
        /// Number of the stage, from 0.
        stage: usize,
        /// Steps done in it.
        step: u64,
    },
    /// A stage is about to begin, with a picture of the grains on request; not called again when a run goes on within it.
    Begun {
        /// Number of the stage, from 0.
        stage: usize,
        /// The grains before its first step.
        picture: &'a dyn Fn() -> SpecimenPicture,
    },
    /// The state of the run, from which [`run_specimen_from`](super::run_specimen_from) goes on with the same bits; called as often as
    /// [`Checkpoints`](super::Checkpoints) ask for it, after the row of the same step.
    State(Vec<u8>),
    /// A row.
    Row(&'a SpecimenRow, &'a dyn Shown),
}
