//! Documents against the repository: paths, links, headings, folders, seams, ids and words that a document uses exist or are allowed.
//!
//! The last column of the verification catalogue is written by
//! `GRAINSPAN_UPDATE_DOCUMENTS=1 cargo test --release --test integration documents`.

mod catalogue;
mod circles;
mod map;
mod paths;
mod text;
mod words;
