//! What the page shows, as JSON made from the files of an output folder.
//!
//! | part | from |
//! | --- | --- |
//! | `state` | `summary.json`, the live run, names of files |
//! | `history` | `history.csv`, `probe_errors.csv`, `units.json`, `scene.toml` |
//! | `log` | `run.jsonl` |
//! | `mesh` | `scene.toml` and the files that it names |
//! | `frame` | one of `fields/*.vtu` |
//! | `cell` | `cells/`, `grains/` |

mod frame;
mod history;
mod log;
mod mesh;
mod state;

pub(crate) use frame::{frame, frames};
pub(crate) use history::history;
pub(crate) use log::log;
pub(crate) use mesh::mesh;
pub(crate) use state::state;
