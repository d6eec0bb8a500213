//! Cells of discs against closed forms, invariances and the engine contract. Names such as `D-1` are check numbers of
//! the verification catalogue.

mod contract;
mod invariances;
mod lattices;
mod packings;
mod samples;
