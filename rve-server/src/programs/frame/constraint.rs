//! Constraints between the boundary grains of a frame and the deformation, and the loads that are left to move them.

use super::geometry::{BOTTOM, FrameGeometry, TOP};
use crate::definition::FrameConstraint;
use crate::programs::specimen::Load;
use crate::simd::Tuple;
use crate::space::Discs;
use std::ops::Range;

/// Turns contact loads into the loads that may move the grains: whatever the constraint takes up is removed, tied
/// grains share theirs. All grains have the same inertia of translation; `inertias` are those of rotation.
pub(crate) fn project(
    constraint: FrameConstraint,
    geometry: &FrameGeometry,
    inertias: &[f64],
    loads: &mut [Load<Discs>],
) {
    match constraint {
        FrameConstraint::Linear => {
            for load in &mut loads[..geometry.boundary] {
                *load = Load::none();
            }
        }
        FrameConstraint::Periodic => tie(geometry, inertias, loads),
        FrameConstraint::Traction => spread(geometry, loads, 0..2),
        FrameConstraint::Platens => {
            spread(geometry, loads, 0..1);
            let on_platens = |side: u8| side & (BOTTOM | TOP) != 0;
            for (load, _) in loads.iter_mut().zip(&geometry.sides).filter(|(_, side)| on_platens(**side)) {
                load.force[1] = 0.0;
            }
        }
    }
}

/// Opposite grains move and turn as one; corners turn as one and move with the deformation alone.
fn tie(geometry: &FrameGeometry, inertias: &[f64], loads: &mut [Load<Discs>]) {
    for &[minus, plus] in &geometry.pairs {
        let force = loads[minus].force.plus(loads[plus].force).scaled(0.5);
        let moment = loads[minus].moment.plus(loads[plus].moment);
        let inertia = inertias[minus] + inertias[plus];
        for grain in [minus, plus] {
            let share = inertias[grain] / inertia;
            loads[grain] = Load { force, moment: moment.scaled(share) };
        }
    }
    let moment = geometry.corners.iter().fold([0.0], |sum: [f64; 1], corner| sum.plus(loads[*corner].moment));
    for corner in geometry.corners {
        // Corners are images of one grain: equal inertias, equal shares.
        loads[corner] = Load { force: Tuple::zero(), moment: moment.scaled(0.25) };
    }
}

/// Adds the boundary forces `P A_q` for which the mean deformation does not accelerate, of these components.
fn spread(geometry: &FrameGeometry, loads: &mut [Load<Discs>], components: Range<usize>) {
    let (mut pull, mut areas) = ([[0.0; 2]; 2], [[0.0; 2]; 2]);
    for (load, area) in loads.iter().zip(&geometry.areas) {
        for i in 0..2 {
            for j in 0..2 {
                pull[i][j] += load.force[i] * area[j];
                areas[i][j] += area[i] * area[j];
            }
        }
    }
    let stress = crate::space::product(&pull, &crate::space::inverse(&areas));
    for (load, area) in loads.iter_mut().zip(&geometry.areas) {
        let traction = crate::space::apply(&stress, *area);
        for component in components.clone() {
            load.force[component] -= traction[component];
        }
    }
}
