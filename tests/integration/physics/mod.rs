//! Scenes against closed forms and independent engines.

mod coupled;
mod frames;
mod free_vibration;
mod ground_at_rest;
mod lattice_elements;
mod reference_case_a;
mod reference_case_b;
mod single_elements;
mod slope_by_friction;
mod triaxial_element;
mod undrained;
