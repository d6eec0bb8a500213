//! The largest step for which central differences stay bounded.
//!
//! With the damping of the half step before, a mode with frequency `w` and damping `c` (1/s) stays bounded while
//! `w^2 dt^2 / 4 + c dt / 2 <= 1` ([Liu2015] eq. 62 in other words). The largest `w` and `c` of the elements bound those of the body,
//! so the smallest step of an element is safe for all.

use super::assembly::forces::ElementLaws;
use crate::element::frequency::{critical_step, largest_frequency_of};
use crate::element::hourglass::HourglassModes;
use crate::formulation::{Formulation, Operator};
use crate::model::body::Body;
use crate::model::constraints::Constraints;
use rayon::prelude::*;

/// What bounds the step of one element.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ElementLimits {
    /// Largest frequency, rad/s.
    pub(crate) frequency: f64,
    /// Largest damping rate, 1/s: eigenvalue of viscosity over mass.
    pub(crate) damping: f64,
}

impl ElementLimits {
    /// Critical step, s; infinite for an element that nothing moves.
    pub(crate) fn step(&self) -> f64 {
        match (self.frequency > 0.0, self.damping > 0.0) {
            (true, _) => critical_step(self.frequency, 0.5 * self.damping / self.frequency),
            (false, true) => 2.0 / self.damping,
            (false, false) => f64::INFINITY,
        }
    }

    /// The limits after all masses have been multiplied by `factor`.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        Self { frequency: self.frequency / factor.sqrt(), damping: self.damping / factor }
    }

    /// Factor on the mass that makes `step` (s) critical.
    pub(crate) fn factor_for(&self, step: f64) -> f64 {
        0.25 * (self.frequency * step).powi(2) + 0.5 * self.damping * step
    }
}

/// Limits of every element at the committed state, with the moduli of the latest tangents and the masses of the nodes of
/// every element, kg. Prescribed degrees of freedom do not count, unless there are no others.
pub(crate) fn limits(laws: &ElementLaws<'_>, constraints: &Constraints, masses: &[Vec<f64>]) -> Vec<ElementLimits> {
    let body = laws.body;
    let positions = match body.formulation() {
        Formulation::SmallStrain => body.mesh().nodes.clone(),
        Formulation::TotalLagrangian | Formulation::UpdatedLagrangian | Formulation::Corotational => {
            body.positions(&body.zero())
        }
    };
    // What follows others moves as well; ties only lower frequencies. Where nothing is free, the step resolves what the elements would do
    // by themselves: nothing else bounds it.
    let is_driven = constraints.free().is_empty();
    let is_prescribed = |dof: usize| !is_driven && constraints.is_prescribed(dof);
    let of_element = |element: usize| {
        let length = body.length_of(element, body.settled_geometry());
        let viscous = |number: usize| laws.viscosity_of(element).moduli(laws.stiffness[number], length);
        let total = |number: usize| laws.points.all()[number].total(body.formulation()).moduli;
        let is_viscous = !laws.viscosity.is_none();
        let (springs, dampers) = laws.hourglass_factors(element);
        let operators = ElementOperators {
            moduli: body.points_of(element).map(total).collect(),
            viscosity: body.points_of(element).filter(|_| is_viscous).map(viscous).collect(),
            hourglass: body.hourglass(element).map(|modes| (modes, springs, dampers)),
        };
        element_limits(body, element, &positions, &masses[element], &operators, &is_prescribed)
    };
    (0..body.mesh().elements.len()).into_par_iter().map(of_element).collect()
}

/// Stiffness and viscosity of one element.
struct ElementOperators<'a> {
    /// Moduli of the points, Pa.
    moduli: Vec<Operator>,
    /// Viscous moduli of the points, Pa s; empty if nothing is viscous.
    viscosity: Vec<Operator>,
    /// Hourglass modes with their stiffness, N/m, and viscosity, N s/m.
    hourglass: Option<(&'a HourglassModes, f64, f64)>,
}

/// Limits of one element with its nodes at `positions` (m) and the masses of its nodes (kg); prescribed degrees of freedom do not count.
fn element_limits(
    body: &Body,
    element: usize,
    positions: &[[f64; 3]],
    masses: &[f64],
    operators: &ElementOperators<'_>,
    is_prescribed: &(dyn Fn(usize) -> bool + Sync),
) -> ElementLimits {
    let mesh = body.mesh();
    let (kind, dimension) = (mesh.kinds[element], mesh.dimension.count());
    let places: Vec<[f64; 3]> = mesh.elements[element].iter().map(|&node| positions[node]).collect();
    let free: Vec<usize> = (0..dimension * places.len())
        .filter(|local| !is_prescribed(dimension * mesh.elements[element][local / dimension] + local % dimension))
        .collect();
    let springs = operators.hourglass.map(|(modes, stiffness, _)| (modes, stiffness));
    let frequency = largest_frequency_of(kind, &places, &operators.moduli, masses, springs, &free);
    let dampers = operators.hourglass.map(|(modes, _, viscosity)| (modes, viscosity));
    let is_damped = !operators.viscosity.is_empty() || dampers.is_some_and(|(_, viscosity)| viscosity > 0.0);
    let damping = if is_damped {
        // The root of an eigenvalue is meant for frequencies; here the eigenvalue itself is wanted.
        largest_frequency_of(kind, &places, &operators.viscosity, masses, dampers, &free).powi(2)
    } else {
        0.0
    };
    ElementLimits { frequency, damping }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_of_damping_and_stiffness_combine() {
        let undamped = ElementLimits { frequency: 4.0, damping: 0.0 };
        assert_eq!(undamped.step(), 0.5);
        assert!((undamped.factor_for(1.0) - 4.0).abs() < 1e-15);
        let damped = ElementLimits { frequency: 4.0, damping: 3.0 };
        let step = damped.step();
        assert!((0.25 * (4.0 * step).powi(2) + 1.5 * step - 1.0).abs() < 1e-14);
        assert!((damped.factor_for(step) - 1.0).abs() < 1e-14);
        assert!((damped.scaled(damped.factor_for(3.0)).step() - 3.0).abs() < 1e-14);
        assert_eq!(ElementLimits { frequency: 0.0, damping: 4.0 }.step(), 0.5);
        assert_eq!(ElementLimits::default().step(), f64::INFINITY);
    }
}
