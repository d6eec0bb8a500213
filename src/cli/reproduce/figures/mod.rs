//! All figures, one file each. A new figure is a file here and a line in [`ALL`].

mod argilaga2018_displacements;
mod argilaga2018_iterations;
mod argilaga2018_operators;
mod argilaga2018_residuals;
mod argilaga2018_shares;
mod argilaga2018_speedup;
mod geotechnics;
mod geotechnics_cavity;
mod geotechnics_cells;
mod geotechnics_footing;
mod geotechnics_slope;
mod geotechnics_wall;
mod liu2015_biaxial;
mod liu2015_column;
mod liu2015_element;
mod liu2015_kernel;
mod liu2015_moduli;
mod liu2015_shear_layer;
mod liu2018;
mod liu2018_anisotropy;
mod liu2018_cells;
mod liu2018_errata;
mod liu2018_friction;
mod liu2018_meshes;
mod liu2018_rotation;

use super::figure::Figure;

/// Every figure, in the order of the list.
pub(super) const ALL: &[&Figure] = &[
    &liu2015_moduli::FIGURE,
    &liu2015_element::FIGURE,
    &liu2015_column::FIGURE,
    &liu2015_shear_layer::FIGURE,
    &liu2015_biaxial::FIGURE,
    &liu2015_kernel::FIGURE,
    &argilaga2018_operators::FIGURE,
    &argilaga2018_displacements::FIGURE,
    &argilaga2018_residuals::FIGURE,
    &argilaga2018_iterations::FIGURE,
    &argilaga2018_shares::FIGURE,
    &argilaga2018_speedup::FIGURE,
    &liu2018_cells::FIGURE,
    &liu2018_meshes::FIGURE,
    &liu2018_friction::FIGURE,
    &liu2018_rotation::FIGURE,
    &liu2018_anisotropy::FIGURE,
    &liu2018_errata::FIGURE,
    &geotechnics_cells::FIGURE,
    &geotechnics_wall::FIGURE,
    &geotechnics_footing::FIGURE,
    &geotechnics_cavity::FIGURE,
    &geotechnics_slope::FIGURE,
];
