//! Nodal forces of the elements, without stiffness: for procedures that move masses.

use super::isotropic::Isotropic;
use super::viscosity::Viscosity;
use crate::element::PointGeometry;
use crate::element::hourglass::HourglassControl;
use crate::element::integrals::add_force;
use crate::formulation::Formulation;
use crate::model::body::{Body, degrees_of_freedom};
use crate::model::points::Points;
use nalgebra::Matrix3;

/// Laws by which elements turn stresses and velocities into nodal forces.
pub(crate) struct ElementLaws<'a> {
    pub(crate) body: &'a Body,
    pub(crate) points: &'a Points,
    /// Stiffness of every point, for viscous stresses.
    pub(crate) stiffness: &'a [Isotropic],
    pub(crate) viscosity: Viscosity,
    /// Mass density of every element, kg/m3; empty: that of `viscosity`.
    pub(crate) densities: &'a [f64],
    pub(crate) hourglass: HourglassControl,
}

/// Geometry, displacements and velocities at which forces are evaluated.
#[derive(Clone, Copy)]
pub(crate) struct Motion<'a> {
    /// Geometry of the points on which stresses are integrated.
    pub(crate) geometry: &'a [PointGeometry],
    /// Displacements since the start, m, by degree of freedom.
    pub(crate) displacements: &'a [f64],
    /// Velocities for everything viscous, m/s, by degree of freedom.
    pub(crate) velocity: &'a [f64],
}

/// Forces over all degrees of freedom, N, in the plane per metre of thickness.
#[derive(Clone, Debug)]
pub(crate) struct ElementForces {
    pub(crate) internal: Vec<f64>,
    pub(crate) viscous: Vec<f64>,
    pub(crate) hourglass: Vec<f64>,
    /// Energy of hourglass springs, J.
    pub(crate) hourglass_energy: f64,
}

/// Forces of one element over its own degrees of freedom; viscous and hourglass forces are empty if there are none.
struct OneElement {
    internal: Vec<f64>,
    viscous: Vec<f64>,
    hourglass: Vec<f64>,
    hourglass_energy: f64,
}

impl ElementLaws<'_> {
    /// All forces, from the latest stresses of the points.
    pub(crate) fn forces(&self, motion: Motion<'_>) -> ElementForces {
        let averaged = self.points.integrated_stresses(motion.geometry.iter().map(|geometry| geometry.volume));
        let dimension = self.body.mesh().dimension.count();
        let parts = self.body.for_all_elements(|element| self.of_element(element, motion, averaged.as_deref()));
        let zero = self.body.zero();
        let mut forces =
            ElementForces { internal: zero.clone(), viscous: zero.clone(), hourglass: zero, hourglass_energy: 0.0 };
        for (nodes, part) in self.body.mesh().elements.iter().zip(&parts) {
            for (local, dof) in degrees_of_freedom(dimension, nodes).into_iter().enumerate() {
                forces.internal[dof] += part.internal[local];
                if let Some(value) = part.viscous.get(local) {
                    forces.viscous[dof] += value;
                }
                if let Some(value) = part.hourglass.get(local) {
                    forces.hourglass[dof] += value;
                }
            }
            forces.hourglass_energy += part.hourglass_energy;
        }
        forces
    }

    fn of_element(&self, element: usize, motion: Motion<'_>, averaged: Option<&[Matrix3<f64>]>) -> OneElement {
        let (mesh, formulation) = (self.body.mesh(), self.body.formulation());
        let (dimension, nodes) = (mesh.dimension.count(), &mesh.elements[element]);
        let width = dimension * nodes.len();
        let is_viscous = !self.viscosity.is_none();
        let mut part = OneElement {
            internal: vec![0.0; width],
            viscous: vec![0.0; if is_viscous { width } else { 0 }],
            hourglass: Vec::new(),
            hourglass_energy: 0.0,
        };
        let length = if is_viscous { self.body.length_of(element, motion.geometry) } else { 0.0 };
        for number in self.body.points_of(element) {
            let (point, geometry) = (&self.points.all()[number], &motion.geometry[number]);
            let stress = averaged.map_or(point.response.stress, |stresses| stresses[number]);
            let stress = point.nominal(formulation, &point.with_pore_pressure(formulation, &stress));
            add_force(dimension, geometry, nodes.len(), &stress, &mut part.internal);
            if is_viscous {
                let rate = self.rate(nodes, geometry, motion.velocity, &point.deformation);
                let stress = self.viscosity_of(element).stress(self.stiffness[number], length, &rate);
                add_force(dimension, geometry, nodes.len(), &point.nominal(formulation, &stress), &mut part.viscous);
            }
        }
        self.add_hourglass(element, motion, &mut part);
        part
    }

    fn add_hourglass(&self, element: usize, motion: Motion<'_>, part: &mut OneElement) {
        let Some(modes) = self.body.hourglass(element) else { return };
        let dimension = self.body.mesh().dimension.count();
        let (stiffness, viscosity) = self.hourglass_factors(element);
        let (factor, values) = match self.hourglass {
            HourglassControl::Stiffness { .. } => (stiffness, motion.displacements),
            HourglassControl::Viscous { .. } => (viscosity, motion.velocity),
        };
        let of_node = |node: usize| -> [f64; 3] {
            std::array::from_fn(|axis| if axis < dimension { values[dimension * node + axis] } else { 0.0 })
        };
        part.hourglass = vec![0.0; part.internal.len()];
        let amplitudes = self.body.add_hourglass_force(element, modes, factor, of_node, &mut part.hourglass);
        part.hourglass_energy = modes.energy(stiffness, &amplitudes);
    }

    /// The viscous law in an element.
    pub(crate) fn viscosity_of(&self, element: usize) -> Viscosity {
        let density = self.densities.get(element).copied().unwrap_or(self.viscosity.density);
        Viscosity { density, ..self.viscosity }
    }

    /// Stiffness, N/m, and viscosity, N s/m, of the hourglass modes of an element: one of them is zero.
    pub(crate) fn hourglass_factors(&self, element: usize) -> (f64, f64) {
        let Some(modes) = self.body.hourglass(element) else { return (0.0, 0.0) };
        let shear = self.body.first_shear_modulus(element, self.points.all());
        match self.hourglass {
            HourglassControl::Stiffness { coefficient } => (modes.stiffness(coefficient, shear), 0.0),
            HourglassControl::Viscous { coefficient } => {
                (0.0, modes.viscosity(coefficient, shear, self.viscosity_of(element).density))
            }
        }
    }

    /// Rate of deformation of a point, 1/s.
    fn rate(
        &self,
        nodes: &[usize],
        geometry: &PointGeometry,
        velocity: &[f64],
        deformation: &Matrix3<f64>,
    ) -> Matrix3<f64> {
        let gradient = self.body.gradient_of(nodes, geometry, velocity);
        let spatial = match self.body.formulation() {
            // Gradients are on the initial geometry: the rate of F becomes that on the current one by F^-1.
            Formulation::TotalLagrangian => {
                gradient * deformation.try_inverse().expect("a point that is turned inside out is never evaluated")
            }
            Formulation::SmallStrain | Formulation::UpdatedLagrangian | Formulation::Corotational => gradient,
        };
        0.5 * (spatial + spatial.transpose())
    }
}
