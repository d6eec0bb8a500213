//! Probes over synthetic fields with known answers.

use super::*;
use crate::mesh::ElementKind;
use crate::mesh::block::Block;
use crate::observer::{PointFields, Statistics, StepReport};
use protocol::{Cost, Observed, OptionalResult, Scalars, Tensor2, TrialFlags};

pub(crate) fn report(step: usize, stage: usize, load: f64) -> StepReport {
    StepReport {
        step,
        stage,
        load,
        time: step as f64,
        share: 0.0,
        size: 1.0,
        iterations: 1,
        evaluations: 1,
        skipped: 0,
        cut_backs: 0,
        stabilisation_increments: 0,
        committed_iterates: 0,
        force_ratio: 0.0,
        displacement_ratio: 0.0,
        ends_stage: load >= 1.0,
        convergence: crate::observer::Convergence::Full,
        flags: crate::observer::FlagCounts::default(),
        accuracy: crate::observer::StepAccuracy::default(),
    }
}

/// Two points of unequal volume would hide a missing weight, so the two get different ones.
pub(crate) fn point(volume: f64, stress: [[f64; 2]; 2], jacobian: f64) -> PointFields {
    PointFields {
        element: 0,
        local: 0,
        initial_position: [0.0; 3],
        position: [0.0; 3],
        volume,
        deformation: Tensor2([jacobian, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        step_gradient: Tensor2::ZERO,
        stress: Tensor2::from_plane(stress),
        pore_pressure: None,
        scalars: Scalars { void_ratio: volume, ..Scalars::default() },
        observed: Observed { elastic_energy: 3.0, ..Observed::default() },
        flags: TrialFlags::default(),
        step_evaluations: 0,
        evaluations: 0,
        cost: Cost::default(),
        step_cost: Cost::default(),
    }
}

/// A view of these points in a block of 1 m x 2 m whose nodes have moved by `(0.1 x, factor y)`.
pub(crate) fn seen<T>(points: &[PointFields], factor: f64, look: impl FnOnce(&FieldsView<'_>) -> T) -> T {
    let mesh = Block::plane([1.0, 2.0], [1, 1], ElementKind::Q4).mesh().unwrap();
    let displacements: Vec<[f64; 3]> = mesh.nodes.iter().map(|&[x, y, _]| [0.1 * x, factor * y, 0.0]).collect();
    look(&FieldsView {
        mesh: &mesh,
        displacements: &displacements,
        reactions: &vec![[0.0, 7.0, 0.0]; mesh.nodes.len()],
        loads: &vec![[0.0; 3]; mesh.nodes.len()],
        hourglass_energy: 0.25,
        fluid_energy: 0.0,
        dynamics: None,
        points,
        statistics: &Statistics::default(),
    })
}

fn mean(measure: Measure) -> Quantity {
    Quantity::Field(FieldProbe::mean(measure))
}

fn stress(measure: StressMeasure) -> Quantity {
    mean(Measure::Stress(measure))
}

#[test]
fn averages_are_weighted_with_the_volume_and_signs_are_as_promised() {
    let points = [point(3.0, [[-1.0, 0.0], [0.0, -4.0]], 1.5), point(1.0, [[-5.0, 0.0], [0.0, -8.0]], 0.5)];
    seen(&points, -0.25, |view| {
        let value = |quantity: Quantity| quantity.value(view, &References::default());
        let top = || "top".to_owned();
        let bottom = || "bottom".to_owned();
        assert_eq!(value(stress(StressMeasure::Component(1, 1))), -5.0);
        assert_eq!(value(stress(StressMeasure::Ratio)), 2.5);
        assert_eq!(value(stress(StressMeasure::Pressure(2))), 3.5);
        assert_eq!(value(stress(StressMeasure::Deviator)), 3.0);
        assert_eq!(value(stress(StressMeasure::SigmaBar)), 3.0 / 7.0);
        assert_eq!(value(stress(StressMeasure::Principal(Rank::Major, Axes::Plane))), -5.0);
        assert_eq!(value(mean(Measure::VoidRatio)), 2.5);
        assert_eq!(value(mean(Measure::VolumeChange)), 0.0);
        assert_eq!(value(mean(Measure::ElasticEnergy)), 12.0);
        assert_eq!(value(Quantity::HourglassEnergy), 0.25);
        assert_eq!(value(Quantity::Reaction { set: top(), axis: Axis::Y }), 14.0);
        assert_eq!(value(Quantity::Displacement { set: top(), axis: Axis::Y, reference: None }), -0.5);
        let (from, to, axis) = (bottom(), top(), Axis::Y);
        assert_eq!(value(Quantity::Strain { from, to, axis, reference: None }), -0.25);
        let (from, to, axis) = (bottom(), top(), Axis::Y);
        assert_eq!(value(Quantity::Compression { from, to, axis, reference: None }), 0.25);
        // 3 m3 with void ratio 3 and 1 m3 with void ratio 1 hold 5/4 m3 of grains; the mean of the void ratios says 2.5.
        assert_eq!(value(mean(Measure::Porosity)), 1.0 - 1.25 / 4.0);
    });
}

/// A stress that grows linearly over the height 0 to 1, seen at 1000 places of equal volume: mean, extremes and standard deviation of
/// a uniform distribution, over the body and over its upper half.
#[test]
fn statistics_of_a_linear_field_are_those_of_a_uniform_distribution() {
    let points: Vec<PointFields> = (0..1000)
        .map(|number| point(1e-3, [[0.0, 0.0], [0.0, 2.0 * (f64::from(number) + 0.5) / 1000.0]], 1.0))
        .collect();
    let upper = Part::Points((500..1000).collect());
    seen(&points, 0.0, |view| {
        let value = |part: &Part, statistic| {
            let measure = Measure::Stress(StressMeasure::Component(1, 1));
            FieldProbe { part: part.clone(), statistic, ..FieldProbe::mean(measure) }
                .value(view, &References::default())
        };
        assert!((value(&Part::Body, Statistic::Mean) - 1.0).abs() < 1e-13);
        assert_eq!(value(&Part::Body, Statistic::Minimum), 0.001);
        assert_eq!(value(&Part::Body, Statistic::Maximum), 1.999);
        // The variance of n equally spaced values is (1 - 1/n^2) L^2 / 12.
        let deviation = (4.0 * (1.0 - 1e-6) / 12.0_f64).sqrt();
        assert!((value(&Part::Body, Statistic::StandardDeviation) - deviation).abs() < 1e-13);
        assert!((value(&upper, Statistic::Mean) - 1.5).abs() < 1e-13);
        assert_eq!(value(&upper, Statistic::Minimum), 1.001);
        let deviation = ((1.0 - 4e-6) / 12.0_f64).sqrt();
        assert!((value(&upper, Statistic::StandardDeviation) - deviation).abs() < 1e-13);
        assert!(value(&Part::Points(Vec::new()), Statistic::Mean).is_nan());
    });
}

#[test]
fn the_standard_deviation_weighs_with_the_volume() {
    let points = [point(3.0, [[0.0; 2]; 2], 1.0), point(1.0, [[0.0; 2]; 2], 1.0)];
    seen(&points, 0.0, |view| {
        let probe = FieldProbe { statistic: Statistic::StandardDeviation, ..FieldProbe::mean(Measure::VoidRatio) };
        // Values 3 and 1 with weights 3/4 and 1/4: mean 2.5, variance 0.75.
        assert!((probe.value(view, &References::default()) - 0.75_f64.sqrt()).abs() < 1e-15);
    });
}

/// Stage 0 compresses by 20 % along y and stretches the points to 0.8, stage 1 goes on to -0.25 and 0.6.
#[test]
fn strain_and_volume_change_count_from_the_start_of_a_stage() {
    let at = |jacobian: f64| vec![point(2.0 * jacobian, [[0.0; 2]; 2], jacobian); 2];
    let quantities = || {
        let set = |name: &str| name.to_owned();
        [
            Quantity::Compression { from: set("bottom"), to: set("top"), axis: Axis::Y, reference: Some(1) },
            Quantity::Displacement { set: set("top"), axis: Axis::Y, reference: Some(1) },
            Quantity::Field(FieldProbe { reference: Some(1), ..FieldProbe::mean(Measure::VolumeChange) }),
            Quantity::Field(FieldProbe { reference: Some(1), ..FieldProbe::mean(Measure::LogVolumeStrain) }),
            Quantity::Field(FieldProbe {
                reference: Some(1),
                ..FieldProbe::mean(Measure::DisplacementGradient(0, 0))
            }),
        ]
    };
    let mut references = References::of_stages(quantities().iter().filter_map(Quantity::reference));
    let mut step = |number, stage, load, jacobian, factor| {
        let report = report(number, stage, load);
        seen(&at(jacobian), factor, |view| {
            references.enter(&report);
            let values = quantities().map(|quantity| quantity.value(view, &references));
            references.keep(&report, view);
            values
        })
    };
    step(0, 0, 0.0, 1.0, 0.0);
    assert_eq!(step(1, 0, 1.0, 0.8, -0.2), [0.0; 5], "the stage has not begun");
    let values = step(2, 1, 0.5, 0.6, -0.25);
    let expected = [0.05 / 0.8, -0.1, -0.25, 0.75_f64.ln(), -0.25];
    for (value, expected) in values.iter().zip(expected) {
        assert!((value - expected).abs() < 1e-14, "{value} {expected}");
    }
    // What was kept stays, also through a checkpoint.
    let text = serde_json::to_string(&references).unwrap();
    assert_eq!(serde_json::from_str::<References>(&text).unwrap(), references);
}

/// Engines that do not deliver a quantity left zeros in means, and the extremes were those of the other points.
#[test]
fn a_quantity_that_one_point_lacks_is_not_a_number_over_both() {
    let whole = point(1.0, [[0.0; 2]; 2], 1.0);
    let lacking = [OptionalResult::ElasticEnergy];
    let points = [whole.clone(), PointFields { observed: whole.observed.without(&lacking), ..whole }];
    let statistics = [Statistic::Mean, Statistic::Minimum, Statistic::Maximum, Statistic::StandardDeviation];
    for order in [[0, 1], [1, 0]] {
        let ordered = order.map(|place: usize| points[place].clone());
        seen(&ordered, 0.0, |view| {
            let over = |part: Part| {
                statistics.map(|statistic| {
                    let of_energy = FieldProbe::mean(Measure::ElasticEnergy);
                    FieldProbe { statistic, part: part.clone(), ..of_energy }.value(view, &References::default())
                })
            };
            assert!(over(Part::Body).iter().all(|value| value.is_nan()));
            let known = order.iter().position(|place| *place == 0).unwrap();
            assert_eq!(over(Part::Points(vec![known])), [3.0, 3.0, 3.0, 0.0]);
        });
    }
}

/// Two steps of shear, 0.1 and 0.25, the second one in a stage of its own: the increment is counted from step to step, and over the
/// lengths at the start of the stage that the probe names.
#[test]
fn the_equivalent_strain_increment_is_the_norm_of_the_change_of_the_deformation() {
    let sheared = |stretch: f64, shear: f64| PointFields {
        deformation: Tensor2([stretch, shear, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        ..point(1.0, [[0.0; 2]; 2], 1.0)
    };
    let probe =
        |reference| Quantity::Field(FieldProbe { reference, ..FieldProbe::mean(Measure::EquivalentStrainIncrement) });
    assert!(probe(None).compares_steps() && !mean(Measure::VolumeChange).compares_steps());
    let mut references = References::of_stages([1].into_iter()).comparing_steps(true);
    let mut step = |number, stage, stretch, shear| {
        let report = report(number, stage, 1.0);
        seen(&[sheared(stretch, shear)], 0.0, |view| {
            references.enter(&report);
            let values = [None, Some(1)].map(|reference| probe(reference).value(view, &references));
            references.keep(&report, view);
            values
        })
    };
    let near = |found: [f64; 2], expected: [f64; 2]| {
        assert!((0..2).all(|place| (found[place] - expected[place]).abs() < 1e-15), "{found:?} {expected:?}");
    };
    near(step(0, 0, 2.0, 0.0), [1.0, 0.0]);
    near(step(1, 0, 2.0, 0.1), [0.1, 0.0]);
    // Since the start of the stage: F F1^-1 = [[3/2, (0.25 - 0.15)], [0, 1]] and the unit tensor before.
    near(step(2, 1, 3.0, 0.25), [1.0_f64.hypot(0.15), 0.5_f64.hypot(0.1)]);
    near(step(3, 1, 3.0, 0.25), [0.0, 0.0]);
    let text = serde_json::to_string(&references).unwrap();
    assert_eq!(serde_json::from_str::<References>(&text).unwrap(), references);
}

/// A band at 35 degrees through a field of shear, as a probe sees it.
#[test]
fn a_band_has_the_width_and_the_angle_that_it_was_given() {
    let (sin, cos) = 35_f64.to_radians().sin_cos();
    let mut points = Vec::new();
    for row in 0..80 {
        for column in 0..40 {
            let position = [1e-3 * f64::from(column), 1e-3 * f64::from(row), 0.0];
            let across = -sin * (position[0] - 0.02) + cos * (position[1] - 0.04);
            let shear = 0.01 + 0.1 * (-0.5 * (across / 0.004).powi(2)).exp();
            let deformation = Tensor2([1.0, shear, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
            points.push(PointFields { position, deformation, ..point(1e-6, [[0.0; 2]; 2], 1.0) });
        }
    }
    seen(&points, 0.0, |view| {
        let value = |property, measure| {
            BandProbe { measure, part: Part::Body, reference: None, plane: [0, 1], property }
                .value(view, &References::default())
        };
        let shear = Measure::DisplacementGradient(0, 1);
        assert!((value(BandProperty::Inclination, shear) - 35.0).abs() < 1e-6);
        assert!((value(BandProperty::Width, shear) - 0.004 * (8.0 * 2_f64.ln()).sqrt()).abs() < 1e-9);
        assert!(value(BandProperty::Quality, shear) > 1.0 - 1e-9);
        // The Green-Lagrange shear strain is slightly nonlinear in the shear: its band is a little narrower.
        let strain = Measure::ShearStrain(Axes::Plane);
        assert!((value(BandProperty::Inclination, strain) - 35.0).abs() < 1e-3);
        assert!((value(BandProperty::Width, strain) / 0.004 / (8.0 * 2_f64.ln()).sqrt() - 1.0).abs() < 0.01);
        assert!(value(BandProperty::Width, Measure::VolumeChange).is_nan(), "a uniform field has no band");
    });
}
