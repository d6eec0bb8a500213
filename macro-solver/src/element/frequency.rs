//! Highest frequency of an element, which bounds that of the body and with it the step of explicit time integration.

use super::hourglass::HourglassModes;
use super::integrals::add_stiffness;
use super::{ElementKind, point_geometry};
use crate::formulation::Operator;
use nalgebra::{DMatrix, SymmetricEigen};

/// Largest natural frequency of an element, rad/s: largest `omega` of `K u = omega^2 M u` with the symmetric part of `K`,
/// of its degrees of freedom `free` (`dimension * local node + axis`). No assembly of such elements has a larger one.
/// Prescribed motion is not integrated in time, so it cannot be unstable; 0 if nothing is free.
///
/// `positions` in m, `moduli` of every Gauss point on these positions in Pa, lumped `masses` of the nodes in kg,
/// `hourglass` modes with their stiffness in N/m where the kind has some.
pub fn largest_frequency_of(
    kind: ElementKind,
    positions: &[[f64; 3]],
    moduli: &[Operator],
    masses: &[f64],
    hourglass: Option<(&HourglassModes, f64)>,
    free: &[usize],
) -> f64 {
    if free.is_empty() {
        return 0.0;
    }
    let (dimension, nodes) = (kind.dimension().count(), kind.node_count());
    let width = dimension * nodes;
    let mut stiffness = vec![0.0; width * width];
    for (local, moduli) in moduli.iter().enumerate() {
        add_stiffness(dimension, &point_geometry(kind, positions, local), nodes, moduli, &mut stiffness);
    }
    if let Some((modes, factor)) = hourglass {
        modes.add_stiffness(dimension, factor, &mut stiffness);
    }
    let scaled = DMatrix::from_fn(free.len(), free.len(), |row, column| {
        let (row, column) = (free[row], free[column]);
        let symmetric = 0.5 * (stiffness[row * width + column] + stiffness[column * width + row]);
        symmetric / (masses[row / dimension] * masses[column / dimension]).sqrt()
    });
    SymmetricEigen::new(scaled).eigenvalues.max().max(0.0).sqrt()
}

/// Largest stable step of the central difference method, s, for the largest frequency, rad/s, and the damping ratio at
/// it: `(2 / omega) (sqrt(1 + xi^2) - xi)`, [Liu2015] eq. 62.
pub fn critical_step(frequency: f64, damping_ratio: f64) -> f64 {
    2.0 / frequency * ((1.0 + damping_ratio * damping_ratio).sqrt() - damping_ratio)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::mass::{Lumping, lumped_masses};
    use crate::formulation::tensor::isotropic_moduli;
    use crate::mesh::block::Block;
    use claims::Claim;

    /// Of an element whose nodes are all free.
    fn largest_frequency(
        kind: ElementKind,
        positions: &[[f64; 3]],
        moduli: &[Operator],
        masses: &[f64],
        hourglass: Option<(&HourglassModes, f64)>,
    ) -> f64 {
        let free: Vec<usize> = (0..kind.dimension().count() * kind.node_count()).collect();
        largest_frequency_of(kind, positions, moduli, masses, hourglass, &free)
    }

    /// Upper bound of [`largest_frequency`] for elements with one point and equal node masses (Flanagan and Belytschko
    /// 1981): `omega^2 <= (M / m) V b_ai b_ai` with the P-wave modulus `M`, Pa, and the mass of a node `m`, kg.
    fn flanagan_belytschko_frequency(modes: &HourglassModes, dimension: usize, modulus: f64, mass: f64) -> f64 {
        (modulus * modes.scale * dimension as f64 / mass).sqrt()
    }

    /// Bulk and shear modulus and density of [Liu2015] table II and section 3.3.
    const BULK: f64 = 335e6;
    const SHEAR: f64 = 241e6;
    const DENSITY: f64 = 1650.0;

    fn cell(size: [f64; 3]) -> Vec<[f64; 3]> {
        Block::space(size, [1, 1, 1], ElementKind::H8Single).mesh().unwrap().element_positions(0)
    }

    fn frequency(size: [f64; 3]) -> f64 {
        let (kind, positions) = (ElementKind::H8Single, cell(size));
        let masses = lumped_masses(kind, &positions, DENSITY, Lumping::RowSum).unwrap();
        largest_frequency(kind, &positions, &[isotropic_moduli(BULK - 2.0 / 3.0 * SHEAR, SHEAR)], &masses, None)
    }

    /// H-10. The volumetric mode of a cube is its fastest: `omega^2 = 12 K / (rho h^2)`.
    #[test]
    fn the_fastest_mode_of_a_one_point_cube_is_the_volumetric_one() {
        let side = 0.01;
        let exact = 12.0 * BULK / (DENSITY * side * side);
        let square = frequency([side; 3]).powi(2);
        Claim::of("H-10", "square of the largest angular frequency of a one-point cube")
            .value(square, exact)
            .within(1e-10);
        let step = critical_step(frequency([side; 3]), 0.0);
        Claim::of("H-10", "critical step of a cube of 10 mm, s").value(step, 12.81e-6).within_absolute(0.01e-6);
    }

    #[test]
    fn steps_of_other_cells_are_the_derived_ones_and_within_the_bound() {
        for (size, published) in [([0.01012, 0.00983, 0.0127], 13.46e-6), ([0.01, 0.01, 0.005], 7.74e-6)] {
            let step = critical_step(frequency(size), 0.0);
            assert!((step / published - 1.0).abs() < 1e-3, "{size:?}: {step:e}");
        }
        let positions = cell([0.01; 3]);
        let modes = HourglassModes::new(ElementKind::H8Single, &positions).unwrap();
        let modulus = BULK + 4.0 / 3.0 * SHEAR;
        let bound = flanagan_belytschko_frequency(&modes, 3, modulus, DENSITY * 1e-6 / 8.0);
        assert!((critical_step(bound, 0.0) - 9.15e-6).abs() < 0.01e-6 && bound > frequency([0.01; 3]));
    }

    /// Hourglass springs of the usual strength do not lower the step; damping does.
    #[test]
    fn usual_hourglass_springs_leave_the_step_alone() {
        let (kind, positions) = (ElementKind::H8Single, cell([0.01; 3]));
        let masses = lumped_masses(kind, &positions, DENSITY, Lumping::RowSum).unwrap();
        let moduli = [isotropic_moduli(BULK - 2.0 / 3.0 * SHEAR, SHEAR)];
        let modes = HourglassModes::new(kind, &positions).unwrap();
        let springs = modes.stiffness(0.05, SHEAR);
        let with = largest_frequency(kind, &positions, &moduli, &masses, Some((&modes, springs)));
        assert!((with / frequency([0.01; 3]) - 1.0).abs() < 1e-12);
        assert!((critical_step(2.0, 0.75) - 0.5).abs() < 1e-15);
    }

    /// The element bound is not exceeded by two elements glued together.
    #[test]
    fn an_assembly_is_not_faster_than_its_elements() {
        let kind = ElementKind::Q4;
        let mesh = Block::plane([2.0, 1.0], [2, 1], kind).mesh().unwrap();
        let moduli = vec![isotropic_moduli(1.0, 1.0); 4];
        let positions = mesh.element_positions(0);
        let masses = lumped_masses(kind, &positions, 1.0, Lumping::Hrz).unwrap();
        let single = largest_frequency(kind, &positions, &moduli, &masses, None);
        let mut stiffness: DMatrix<f64> = DMatrix::zeros(12, 12);
        let mut mass = [0.0; 6];
        for (element, nodes) in mesh.elements.iter().enumerate() {
            let positions = mesh.element_positions(element);
            let mut own = vec![0.0; 64];
            for (local, moduli) in moduli.iter().enumerate() {
                add_stiffness(2, &point_geometry(kind, &positions, local), 4, moduli, &mut own);
            }
            for (a, &row) in nodes.iter().enumerate() {
                mass[row] += masses[a];
                for (b, &column) in nodes.iter().enumerate() {
                    for (i, k) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                        stiffness[(2 * row + i, 2 * column + k)] += own[(2 * a + i) * 8 + 2 * b + k];
                    }
                }
            }
        }
        let scaled: DMatrix<f64> =
            DMatrix::from_fn(12, 12, |r, c| stiffness[(r, c)] / f64::sqrt(mass[r / 2] * mass[c / 2]));
        let assembled = SymmetricEigen::new(scaled).eigenvalues.max().sqrt();
        assert!(assembled <= single * (1.0 + 1e-12) && assembled > 0.8 * single);
    }
}
