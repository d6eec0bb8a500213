//! The element test: one cell along a path of prescribed strains and servo-controlled stresses, without finite elements.
//!
//! Every increment is one accepted trial of the cell. Stress components are met by a Newton search over the strain
//! components that work on them (`servo`); each iteration is a trial from the committed state, so that the search
//! leaves no trace in the grains.

mod csv_table;
mod error;
mod increment;
mod on_frame;
mod path;
mod requests;
mod row;
mod run;
mod search_limit;
mod servo;
mod start_check;
mod step;
mod stress_control;
mod stress_relaxation;
mod strides;
mod summary;
mod test_file;
mod work;

#[cfg(test)]
mod tests;

pub use csv_table::{ElementCsv, ElementTable, element_table};
pub use error::ElementError;
pub use requests::{RowRequests, StopRequests};
pub use row::ElementRow;
pub use run::{run_element, run_element_on};
pub use start_check::{start_note, start_warnings};
pub use stress_control::StressControl;
pub use summary::{ElementEnd, ElementSummary};
pub use test_file::{Components, ElementTest, Segment};
