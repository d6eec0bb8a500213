//! Keys of input files, each declared once: as a documented field of a struct.
//!
//! A table of an input file is a struct with `serde` and [`schemars::JsonSchema`] derives. The doc comment of a field is
//! the documentation of its key, `#[schemars(range(..))]` and `extend("exclusiveMinimum" = 0)` its range, the default of
//! the struct its default. Further properties are extensions:
//!
//! | `#[schemars(extend(..))]` | meaning |
//! | --- | --- |
//! | `"x-unit" = "Pa"` | unit; dimensionless numbers have `"-"` |
//! | `"x-default" = "by ..."` | default in words, where it is not a constant |
//! | `"x-instead-of" = "other"` | this key and `other` exclude each other |
//! | `"x-most-inverse-of" = "other"` | a number that is at most 1 / `other`, a number of the same table |
//! | `"x-procedures" = "implicit"` | procedures that use the key, separated by blanks; all if left out |
//! | `"x-nonzero" = true` | any number but 0 |
//! | `"x-without" = "word"` | a word of the type that this key does not take |
//! | `"x-when-written" = true` | value if the table is written without this key, whatever held before |
//! | `"x-folded" = true` | of a table: its keys are listed with the key that holds it |
//! | `"x-scope" = "run"` | holds for the whole run and cannot be given in a stage |
//!
//! [`Table::of`] collects all of it. From there come the checks of a document ([`check`]) and of settings that a program
//! fills in ([`check_settings`]), explanations ([`explain`]), the tables of the reference ([`markdown`]) and the paths that
//! a shell completes ([`paths`]). [`Given`] lays the keys that are written over settings that hold otherwise.

mod check;
mod deserialize;
mod explain;
pub mod forms;
mod given;
mod located;
mod markdown;
mod nearest;
mod node;
mod serialize;
mod shape;
#[cfg(test)]
mod tests;

pub use check::{Fault, check, check_settings};
pub use deserialize::deserialize;
pub use explain::{Entry, explain, find, mentions, paths, summary};
pub use given::{Given, merged};
pub use located::Located;
pub use markdown::{markdown, undocumented};
pub use nearest::nearest;
pub use node::{Member, Node, Value, type_name};
pub use serialize::to_node;
pub use shape::{Bounds, Key, Shape, Table, Word};
