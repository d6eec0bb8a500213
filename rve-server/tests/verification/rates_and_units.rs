//! What the answer may depend on and how: on the units not at all, on the way not while nothing yields, on the rate of
//! loading in proportion.

use crate::samples::{hundred_discs, tight, trial};
use crate::spheres::{self, Matrix, thousand};
use claims::Claim;
use protocol::{RveSolver, Tensor2, TrialOptions};
use rve_server::definition::{Damping, GrainDefinition, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::space::plane::{self, Plane};
use rve_server::space::{Space, Tensor, add_scaled, inverse, largest_component, product, scaled};

const PRESSURE: f64 = 1e5;

/// The cell with all lengths times `length` and all stresses times `stress`.
fn rescaled<S: Space>(definition: &GrainDefinition<S>, length: f64, stress: f64) -> GrainDefinition<S>
where
    S::Grain: AsMut<[f64]>,
{
    let mut other = definition.clone();
    let packing = &mut other.packing;
    packing.periodicity = scaled(&packing.periodicity, length);
    packing.thickness *= if S::DIMENSION == 2 { length } else { 1.0 };
    for grain in &mut packing.grains {
        for value in grain.as_mut() {
            *value *= length;
        }
    }
    // Forces grow with the stress and the square of the length.
    assert!(packing.contacts.is_empty(), "listed forces would have to be scaled too");
    for modulus in [&mut other.contact.modulus, &mut other.contact.shear_modulus].into_iter().flatten() {
        *modulus *= stress;
    }
    other
}

/// E-6 in the plane: powers of two leave every bit alone, other factors round differently: measured 2.4e-12 of the pressure.
#[test]
fn units_do_not_matter_to_discs() {
    let mut plain = hundred_discs(RveOptions { tolerance: Some(1e-10), ..tight() });
    plain.packing.contacts.clear();
    let h = [[3e-5, 1e-5], [1e-5, -6e-5]];
    let stress = |definition: &GrainDefinition| trial(&mut GrainRve::new(definition).unwrap(), &h).stress.plane();
    let expected = stress(&plain);
    for (length, scale, units, tolerance) in [
        (1024.0, 0.25, "units in powers of two", 0.0),
        (0.125, 4096.0, "units in powers of two", 0.0),
        (1e3, 1e-6, "other units", 1e-11),
        (1e-5, 1e3, "other units", 1e-11),
    ] {
        let found = plane::add_scaled(&[[0.0; 2]; 2], 1.0 / scale, &stress(&rescaled(&plain, length, scale)));
        let error = plane::largest_component(&plane::add_scaled(&found, -1.0, &expected)) / PRESSURE;
        Claim::of("E-6", &format!("stress of 100 discs in {units}, over the pressure"))
            .error(error)
            .within(tolerance);
    }
}

/// E-6 in space: measured 1.1e-13.
#[test]
fn units_do_not_matter_to_spheres() {
    let mut plain = thousand(spheres::coarse());
    plain.packing.contacts.clear();
    let stress = |definition: &GrainDefinition<_>| spheres::stress_after(definition, &scaled(&spheres::STRAIN, 0.3));
    let expected = stress(&plain);
    for (length, scale, units, tolerance) in
        [(1024.0, 0.25, "units in powers of two", 0.0), (1e-4, 1e5, "other units", 1e-12)]
    {
        let found = scaled(&stress(&rescaled(&plain, length, scale)), 1.0 / scale);
        let error = largest_component(&add_scaled(&found, -1.0, &expected));
        Claim::of("E-6", &format!("stress of 1000 spheres in {units}, over the pressure"))
            .error(error)
            .within(tolerance);
    }
}

/// Displacement gradients from state to state along a closed way through these strains.
fn closed_way<T: Tensor>(stations: &[T]) -> Vec<T> {
    let mut before = T::IDENTITY;
    let mut way = Vec::new();
    for station in stations.iter().chain([&T::ZERO]) {
        let f = add_scaled(&T::IDENTITY, 1.0, station);
        way.push(add_scaled(&product(&f, &inverse(&before)), -1.0, &T::IDENTITY));
        before = f;
    }
    way
}

/// E-7: without sliding and with the same contacts a closed way of strains leads back to the stress of its start.
#[test]
fn closed_ways_lead_back_to_the_stress() {
    let small = 2e-6;
    let options = RveOptions { tolerance: Some(1e-10), ..tight() };
    let mut discs = hundred_discs(options.clone());
    discs.contact.friction = 1e9;
    let mut cell = GrainRve::new(&discs).unwrap();
    // The first trial lets the packing settle under its new friction.
    let mut go = |h: &Plane| {
        let stress = trial(&mut cell, h).stress.plane();
        cell.commit().unwrap();
        (stress, cell.committed().contacts.len())
    };
    let start = go(&[[1e-9, 0.0], [0.0, 0.0]]);
    let stations: [Plane; 3] =
        [[[small, 0.0], [0.0, 0.0]], [[small, small], [0.0, -small]], [[0.0, small], [0.0, 0.0]]];
    let way = closed_way(&stations);
    let ends: Vec<_> = way.iter().map(&mut go).collect();
    let end = ends[3];
    assert!(ends.iter().all(|other| other.1 == start.1), "a contact was gained or lost on the way");
    let error = plane::largest_component(&plane::add_scaled(&end.0, -1.0, &start.0)) / PRESSURE;
    Claim::of("E-7", "stress of 100 discs at the end of a closed path, over the pressure").error(error).within(1e-6);

    let mut spheres = thousand(RveOptions { strain_per_step: Some(1e-6), tolerance: Some(1e-9), ..options });
    spheres.contact.friction = 1e9;
    let mut cell = GrainRve::new(&spheres).unwrap();
    let mut go = |h: &Matrix| {
        let answer = cell.trial(&Tensor2::from_rows(h), &TrialOptions::default()).unwrap();
        cell.commit().unwrap();
        (Matrix::from_fn(|i, j| answer.stress.get(i, j)), cell.committed().contacts.len())
    };
    let unit = |i: usize, j: usize| Matrix::from_fn(|k, l| if (k, l) == (i, j) { small } else { 0.0 });
    let start = go(&scaled(&unit(0, 0), 1e-3));
    let way = closed_way(&[unit(0, 0), add_scaled(&unit(0, 0), 1.0, &unit(1, 2)), unit(1, 2)]);
    let ends: Vec<_> = way.iter().map(&mut go).collect();
    assert!(ends.iter().all(|other| other.1 == start.1), "a contact was gained or lost on the way");
    let error = largest_component(&add_scaled(&ends[3].0, -1.0, &start.0));
    Claim::of("E-7", "stress of 1000 spheres at the end of a closed path, over the pressure")
        .error(error)
        .within(1e-6);
}

/// E-10: strained continuously, without a hold to speak of, the stress errs in proportion to the strain of a step.
#[test]
fn error_is_proportional_to_the_rate() {
    let h = [[0.0, 0.0], [0.0, -5e-4]];
    let stress = |ramp_steps: u32| {
        let options = RveOptions { damping: Damping::Viscous, tolerance: Some(1e9), ..RveOptions::default() };
        let mut cell = GrainRve::new(&hundred_discs(options)).unwrap();
        let options = TrialOptions { ramp_steps, ..TrialOptions::default() };
        cell.trial(&Tensor2::from_plane(h), &options).unwrap().stress.plane()
    };
    let reference = stress(64_000);
    let errors = [500, 1000, 2000, 4000]
        .map(|steps| plane::largest_component(&plane::add_scaled(&stress(steps), -1.0, &reference)) / PRESSURE);
    let slope = (errors[0] / errors[3]).ln() / 8f64.ln();
    Claim::of("E-10", "order of the stress error over the strain per step, 100 discs")
        .value(slope, 1.0)
        .within_absolute(0.2);
}
