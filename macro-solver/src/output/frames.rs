//! One frame of the field film: what of an accepted step goes into `.vtu`, and how points become elements.
//!
//! Nodes carry displacement, reaction and applied load on the initial mesh (warp by displacement in ParaView).
//! Elements carry means over their Gauss points, weighted with the current volume; costs are sums.

use super::fields::{Field, FieldGrid, write_grid};
use super::probe::{Axes, Rank, StressMeasure};
use super::{OutputError, write_particles};
use crate::formulation::strain::{green_lagrange, plane_shear_strain, spatial_shear_strain};
use crate::mesh::Dimension;
use crate::observer::{FieldsView, PointFields};
use protocol::{Observables, Tensor2, TrialFlags};
use std::path::Path;

/// File of the fields of a step, relative to the output folder.
pub fn frame_file(step: u64) -> String {
    format!("fields/step-{step:04}.vtu")
}

/// The step whose fields a file holds, by the name that [`frame_file`] gives it; `None` for other files.
pub fn step_of_frame(file: &str) -> Option<u64> {
    file.strip_prefix("fields/step-")?.strip_suffix(".vtu")?.parse().ok()
}

/// Writes the fields of an accepted step. `observables` says which optional results are meaningful, `more` are further fields of the
/// elements.
///
/// # Errors
/// [`OutputError::Write`].
pub fn write_frame(
    path: &Path,
    view: &FieldsView<'_>,
    observables: Observables,
    more: Vec<Field>,
) -> Result<(), OutputError> {
    let on_nodes = [
        Field::vector("displacement", view.displacements),
        Field::vector("reaction", view.reactions),
        Field::vector("load", view.loads),
    ];
    let mesh = view.mesh;
    let grid = FieldGrid { nodes: &mesh.nodes, elements: &mesh.elements, kinds: &mesh.kinds };
    let mut on_elements = element_fields(mesh.dimension, view.points, observables);
    on_elements.extend(more);
    write_grid(path, grid, &on_nodes, &on_elements)
}

/// Writes the Gauss points of an accepted step as a cloud at their current positions; `more` are further fields of the points.
///
/// # Errors
/// [`OutputError::Write`].
pub fn write_point_frame(
    path: &Path,
    view: &FieldsView<'_>,
    observables: Observables,
    more: Vec<Field>,
) -> Result<(), OutputError> {
    let positions: Vec<[f64; 3]> = view.points.iter().map(|point| point.position).collect();
    let mut fields = quantities(view.mesh.dimension, observables, has_fluid(view.points))
        .iter()
        .map(|quantity| quantity.of_points(view.points))
        .collect::<Vec<_>>();
    add_invariants(view.mesh.dimension, &mut fields);
    fields.push(Field::scalar("element", view.points.iter().map(|point| point.element as f64).collect()));
    fields.push(Field::scalar("volume", view.points.iter().map(|point| point.volume).collect()));
    fields.extend(more);
    write_particles(path, &positions, &fields)
}

fn has_fluid(points: &[PointFields]) -> bool {
    points.iter().any(|point| point.pore_pressure.is_some())
}

fn element_fields(dimension: Dimension, points: &[PointFields], observables: Observables) -> Vec<Field> {
    let mut fields: Vec<Field> = quantities(dimension, observables, has_fluid(points))
        .iter()
        .map(|quantity| quantity.of_elements(points))
        .collect();
    add_invariants(dimension, &mut fields);
    let sums = |value: fn(&PointFields) -> u64| {
        by_element(points).map(|element| element.iter().map(value).sum::<u64>() as f64).collect()
    };
    fields.push(Field::scalar("step_evaluations", sums(|point| point.step_evaluations)));
    fields.push(Field::scalar("evaluations", sums(|point| point.evaluations)));
    fields.push(Field::scalar("step_force_evaluations", sums(|point| point.step_cost.force_evaluations)));
    fields.push(Field::scalar("force_evaluations", sums(|point| point.cost.force_evaluations)));
    fields.push(Field::scalar(
        "flagged_points",
        sums(|point| u64::from(point.flags.without(TrialFlags::COURSE) != TrialFlags::default())),
    ));
    fields
}

/// Adds principal stresses, `p` and `q` of the stress that is among the fields: of elements those of the mean stress. `q` is the
/// difference of the principal stresses in the plane, and `sqrt(3/2 s:s)` of the deviator `s` in space; the two agree in a
/// triaxial test. `p` and `q` are compression positive, principal stresses tension positive.
fn add_invariants(dimension: Dimension, fields: &mut Vec<Field>) {
    let Some(stress) = fields.iter().find(|field| field.name == "stress") else { return };
    let of = |name: &str, measures: &[(f64, StressMeasure)]| {
        let value = |stress: &[f64]| {
            let stress = Tensor2(std::array::from_fn(|place| stress[place]));
            measures.iter().map(|(factor, measure)| factor * measure.of(&stress)).sum()
        };
        Field::scalar(name, stress.values.chunks_exact(9).map(value).collect())
    };
    let axes = if dimension == Dimension::Plane { Axes::Plane } else { Axes::Space };
    let principal = |rank| StressMeasure::Principal(rank, axes);
    let mut more = vec![of("principal_stress_major", &[(1.0, principal(Rank::Major))])];
    if dimension == Dimension::Space {
        more.push(of("principal_stress_intermediate", &[(1.0, principal(Rank::Intermediate))]));
    }
    more.push(of("principal_stress_minor", &[(1.0, principal(Rank::Minor))]));
    more.push(of("p", &[(1.0, StressMeasure::Pressure(dimension.count()))]));
    more.push(match dimension {
        Dimension::Plane => of("q", &[(1.0, principal(Rank::Minor)), (-1.0, principal(Rank::Major))]),
        Dimension::Space => of("q", &[(1.0, StressMeasure::VonMises)]),
    });
    fields.extend(more);
}

/// The points of each element.
fn by_element(points: &[PointFields]) -> impl Iterator<Item = &[PointFields]> {
    points.chunk_by(|one, next| one.element == next.element)
}

/// A quantity of a Gauss point that is averaged over elements.
struct Quantity {
    name: &'static str,
    components: usize,
    value: fn(&PointFields) -> Vec<f64>,
}

impl Quantity {
    fn of_points(&self, points: &[PointFields]) -> Field {
        let values = points.iter().flat_map(|point| (self.value)(point)).collect();
        Field { name: self.name.to_owned(), components: self.components, values }
    }

    fn of_elements(&self, points: &[PointFields]) -> Field {
        let values = by_element(points).flat_map(|element| self.mean(element)).collect();
        Field { name: self.name.to_owned(), components: self.components, values }
    }

    fn mean(&self, element: &[PointFields]) -> Vec<f64> {
        let volume: f64 = element.iter().map(|point| point.volume).sum();
        let mut mean = vec![0.0; self.components];
        for point in element {
            for (sum, value) in mean.iter_mut().zip((self.value)(point)) {
                *sum += value * point.volume / volume;
            }
        }
        mean
    }
}

fn scalar(name: &'static str, value: fn(&PointFields) -> Vec<f64>) -> Quantity {
    Quantity { name, components: 1, value }
}

/// `has_fluid`: whether there is pore fluid that cannot drain.
fn quantities(dimension: Dimension, observables: Observables, has_fluid: bool) -> Vec<Quantity> {
    let mut quantities = vec![
        Quantity { name: "stress", components: 9, value: |point| point.stress.0.to_vec() },
        Quantity { name: "strain", components: 9, value: |point| green_lagrange(&point.deformation).0.to_vec() },
        match dimension {
            Dimension::Plane => scalar("shear_strain", |point| vec![plane_shear_strain(&point.deformation)]),
            Dimension::Space => scalar("shear_strain", |point| vec![spatial_shear_strain(&point.deformation)]),
        },
        scalar("void_ratio", |point| vec![point.scalars.void_ratio]),
        scalar("coordination_number", |point| vec![point.scalars.coordination_number]),
        scalar("unbalanced_force_ratio", |point| vec![point.scalars.unbalanced_force_ratio]),
        scalar("max_overlap_ratio", |point| vec![point.scalars.max_overlap_ratio]),
    ];
    let optional = [
        (
            Observables::ROTATION,
            Quantity { name: "grain_rotation", components: 3, value: |point| point.observed.mean_rotation.to_vec() },
        ),
        (
            Observables::COORDINATION_NO_RATTLERS,
            scalar("coordination_number_no_rattlers", |point| vec![point.observed.coordination_number_no_rattlers]),
        ),
        (Observables::FABRIC, scalar("fabric_anisotropy", |point| vec![point.observed.fabric_anisotropy])),
        (Observables::SLIDING_FRACTION, scalar("sliding_fraction", |point| vec![point.observed.sliding_fraction])),
        (Observables::ENERGY, scalar("elastic_energy", |point| vec![point.observed.elastic_energy])),
        (Observables::ENERGY, scalar("frictional_dissipation", |point| vec![point.observed.frictional_dissipation])),
        (Observables::ENERGY, scalar("damping_work", |point| vec![point.observed.damping_work])),
    ];
    if has_fluid {
        quantities.push(scalar("pore_pressure", |point| vec![point.pore_pressure.unwrap_or(0.0)]));
    }
    quantities
        .extend(optional.into_iter().filter(|(bit, _)| observables.contains(*bit)).map(|(_, quantity)| quantity));
    quantities
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::probe::tests::point;
    use crate::output::units::is_field;

    #[test]
    fn files_of_frames_tell_their_step() {
        assert_eq!(frame_file(4), "fields/step-0004.vtu");
        for step in [0, 4, 9_999, 12_345] {
            assert_eq!(step_of_frame(&frame_file(step)), Some(step));
        }
        for other in
            ["step-0004.vtu", "fields/step-0004.vtu.part", "fields/gauss-points-0004.vtp", "fields/step-.vtu"]
        {
            assert_eq!(step_of_frame(other), None, "{other}");
        }
    }

    /// 300 and 700 kPa of compression, turned by the shear stress: the invariants of a plane stress are known, and so are those of
    /// the triaxial stress in space.
    #[test]
    fn invariants_of_the_stress_are_among_the_fields_and_have_units() {
        let points = [point(2.0, [[-5.0, 2.0], [2.0, -5.0]], 1.1)];
        let fields = element_fields(Dimension::Plane, &points, Observables::ALL);
        assert!(fields.iter().all(|field| is_field(&field.name)));
        let value = |name: &str| fields.iter().find(|field| field.name == name).map(|field| field.values[0]);
        let near = |name: &str, expected: f64| (value(name).unwrap() - expected).abs() < 1e-12;
        assert!(near("principal_stress_major", -7.0) && near("principal_stress_minor", -3.0));
        assert!(near("p", 5.0) && near("q", 4.0) && value("principal_stress_intermediate").is_none());
        let mut solid = vec![Field::tensor("stress", &[Tensor2([-1.0, 0.0, 0.0, 0.0, -4.0, 0.0, 0.0, 0.0, -1.0])])];
        add_invariants(Dimension::Space, &mut solid);
        let value = |name: &str| solid.iter().find(|field| field.name == name).unwrap().values[0];
        assert!((value("q") - 3.0).abs() < 1e-12 && (value("p") - 2.0).abs() < 1e-12);
        assert_eq!([value("principal_stress_major"), value("principal_stress_intermediate")], [-4.0, -1.0]);
    }
}
