//! `points/*.csv`: what is known of chosen Gauss points, a row for each accepted step.

use super::RecordPlan;
use crate::formulation::strain::green_lagrange;
use crate::observer::PointFields;
use protocol::{Observables, Tensor2};

/// A column behind `step` and `time`.
pub(super) struct PointColumn {
    /// Its name in the header.
    pub(super) name: String,
    value: Box<dyn Fn(&PointFields) -> f64>,
}

impl PointColumn {
    /// Value of a point.
    pub(super) fn of(&self, point: &PointFields) -> f64 {
        (self.value)(point)
    }
}

/// All columns of a plan in order.
pub(super) fn point_columns(plan: &RecordPlan) -> Vec<PointColumn> {
    let mut columns = vec![scalar("volume", |point| point.volume)];
    let all: Vec<(usize, usize)> = (0..9).map(|place| (place / 3, place % 3)).collect();
    let upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
    columns.extend(tensor("F", &all, |point| point.deformation));
    columns.extend(tensor("strain", &upper, |point| green_lagrange(&point.deformation)));
    columns.extend(tensor("sigma", &all, |point| point.stress));
    columns.extend([
        scalar("void_ratio", |point| point.scalars.void_ratio),
        scalar("porosity", |point| point.scalars.void_ratio / (1.0 + point.scalars.void_ratio)),
        scalar("coordination_number", |point| point.scalars.coordination_number),
        scalar("unbalanced_force_ratio", |point| point.scalars.unbalanced_force_ratio),
        scalar("max_overlap_ratio", |point| point.scalars.max_overlap_ratio),
    ]);
    if plan.pore_fluid {
        columns.push(scalar("pore_pressure", |point| point.pore_pressure.unwrap_or(0.0)));
    }
    let mut optional = |observable, more: Vec<PointColumn>| {
        if plan.observables.contains(observable) {
            columns.extend(more);
        }
    };
    let no_rattlers =
        scalar("coordination_number_no_rattlers", |point| point.observed.coordination_number_no_rattlers);
    optional(Observables::COORDINATION_NO_RATTLERS, vec![no_rattlers]);
    let sliding = scalar("sliding_fraction", |point| point.observed.sliding_fraction);
    optional(Observables::SLIDING_FRACTION, vec![sliding]);
    let energies = vec![
        scalar("elastic_energy", |point| point.observed.elastic_energy),
        scalar("frictional_dissipation", |point| point.observed.frictional_dissipation),
        scalar("damping_work", |point| point.observed.damping_work),
    ];
    optional(Observables::ENERGY, energies);
    let rotations = vec![
        scalar("grain_rotation_x", |point| point.observed.mean_rotation[0]),
        scalar("grain_rotation_y", |point| point.observed.mean_rotation[1]),
        scalar("grain_rotation_z", |point| point.observed.mean_rotation[2]),
    ];
    optional(Observables::ROTATION, rotations);
    let mut fabric = tensor("fabric", &upper, |point| point.observed.fabric);
    fabric.push(scalar("fabric_anisotropy", |point| point.observed.fabric_anisotropy));
    optional(Observables::FABRIC, fabric);
    columns.push(scalar("evaluations", |point| point.evaluations as f64));
    columns
}

fn scalar(name: &str, value: fn(&PointFields) -> f64) -> PointColumn {
    PointColumn { name: name.to_owned(), value: Box::new(value) }
}

fn tensor(name: &str, components: &[(usize, usize)], of: fn(&PointFields) -> Tensor2) -> Vec<PointColumn> {
    let axis = |number: usize| ["x", "y", "z"][number];
    let column = |&(row, column): &(usize, usize)| PointColumn {
        name: format!("{name}_{}{}", axis(row), axis(column)),
        value: Box::new(move |point| of(point).get(row, column)),
    };
    components.iter().map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::probe::tests::point;
    use crate::output::recorder::tests::plan;

    #[test]
    fn columns_follow_what_was_asked_for() {
        let point = point(2.0, [[-3.0, 0.5], [0.5, -7.0]], 1.1);
        let columns = |observables| point_columns(&RecordPlan { observables, ..plan() });
        let value = |observables, name: &str| {
            columns(observables).iter().find(|column| column.name == name).map(|column| column.of(&point))
        };
        assert_eq!(value(Observables::NONE, "sigma_yy"), Some(-7.0));
        assert_eq!(value(Observables::NONE, "F_xx"), Some(1.1));
        assert_eq!(value(Observables::NONE, "porosity"), Some(2.0 / 3.0));
        assert!((value(Observables::NONE, "strain_xx").unwrap() - 0.105).abs() < 1e-15);
        assert_eq!(value(Observables::NONE, "elastic_energy"), None);
        assert_eq!(value(Observables::ENERGY, "elastic_energy"), Some(3.0));
        assert_eq!(columns(Observables::ALL).last().unwrap().name, "evaluations");
    }

    /// 0 before the stage of the fluid.
    #[test]
    fn points_with_fluid_have_its_pressure() {
        let drained = point(2.0, [[-3.0, 0.5], [0.5, -7.0]], 1.1);
        let filled = PointFields { pore_pressure: Some(4e3), ..drained.clone() };
        let values = |pore_fluid| {
            let columns = point_columns(&RecordPlan { pore_fluid, ..plan() });
            let column = columns.into_iter().find(|column| column.name == "pore_pressure")?;
            Some([&drained, &filled].map(|point| column.of(point)))
        };
        assert_eq!(values(true), Some([0.0, 4e3]));
        assert_eq!(values(false), None);
    }
}
