//! Cells of discs and spheres against closed forms, invariances and the engine contract. Names such as `D-1` are check numbers of
//! the verification catalogue.

mod contract;
mod corners;
mod equilibrium;
mod event_driven;
mod friction;
mod impacts;
mod invariances;
mod large_shear;
mod lattices;
mod operators;
mod packings;
mod pair;
mod rates_and_units;
mod rest;
mod rows_of_spheres;
mod samples;
mod spheres;
mod stability;
mod stress_control;
mod two_body;
