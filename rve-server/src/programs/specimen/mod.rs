//! Single-scale grain dynamics: a whole specimen of grains between walls, on the contact laws of the periodic cells.

pub mod assembly;
mod axes;
mod block;
pub mod body;
mod checkpoint;
#[cfg(test)]
mod checkpoint_tests;
#[cfg(test)]
mod collision_tests;
#[cfg(test)]
mod conservation_tests;
pub mod contact;
mod contact_forces;
pub mod csv_table;
#[cfg(test)]
mod damping_tests;
pub mod dynamics;
mod error;
mod fluctuation;
#[cfg(test)]
#[path = "../../../tests/support/gas.rs"]
mod gas;
mod glue_depth;
mod numbering;
mod profile;
mod removal;
mod results;
mod rows;
pub mod run;
#[cfg(test)]
mod servo_tests;
mod set_up;
#[cfg(test)]
mod shear_tests;
mod stage;
#[cfg(test)]
mod stage_tests;
mod state_stream;
#[cfg(test)]
mod stiffening_tests;
pub mod test_file;
#[cfg(test)]
mod tests;
mod unsupported_grains;
pub mod wall;
#[cfg(test)]
mod wave_tests;

pub use body::Body;
pub use checkpoint::Checkpoints;
pub(crate) use contact::bound;
pub use contact::{ContactSums, Grain, Load, OwnStiffness};
pub use csv_table::SpecimenCsv;
pub use dynamics::{Dynamics, GrainSums, Motion};
pub use error::SpecimenError;
pub use fluctuation::less_linear_field;
pub use profile::{Interface, Layers, ProfileTable};
pub use removal::{Region, RegionUnit};
pub use results::{Shown, SpecimenEvent, SpecimenPicture, SpecimenRow, SpecimenStart, SpecimenSummary};
pub use run::{SpecimenFor, run_specimen, run_specimen_from};
pub use stage::{AxisTable, ShearTable, Sheared, Stage};
pub use test_file::SpecimenTest;
pub use wall::{Wall, WallDrive};

use crate::space::{KernelSpace, Space};

/// Discs or spheres, seen as both a space and what the force kernel makes of it.
pub trait SpecimenSpace: KernelSpace + Space<Kernel = Self> {}

impl<S: KernelSpace + Space<Kernel = Self>> SpecimenSpace for S {}
