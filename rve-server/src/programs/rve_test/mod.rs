//! The element test: one cell along a path of prescribed strains and servo-controlled stresses, without finite elements.
//!
//! An increment is one trial of the cell where strains alone are prescribed. Stress components are met by a Newton search over the strain
//! components that work on them (`servo`); each iteration is a trial from the committed state, so that the search leaves no trace in the
//! grains. Where a search fails, the increment is taken in shorter strides (`strides`), and where these fail, the stresses are relaxed in committed
//! steps (`stress_relaxation`). Frames of boundary grains go the same way; what differs is in `tested_cell`.

mod csv_table;
mod error;
mod increment;
mod path;
mod probes;
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
mod tested_cell;
mod work;

#[cfg(test)]
mod frame_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod unrest_tests;

pub use csv_table::{ElementCsv, ElementTable, element_table};
pub use error::ElementError;
pub use requests::{RowRequests, StopRequests};
pub use row::ElementRow;
pub use run::{run_element, run_element_on};
pub use start_check::{start_note, start_warnings};
pub use stress_control::StressControl;
pub use summary::{ElementEnd, ElementSummary};
pub use test_file::{Components, ElementTest, Segment};
