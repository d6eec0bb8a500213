//! Cells of spheres: crystals with one grain per cell, and a random packing of a thousand.

use crate::samples::{border_stress, tight};
use claims::Claim;
use protocol::{Observables, RveSolver, Tensor2, TrialFlags, TrialOptions, TrialResult};
use rve_server::cell::{ContactNetwork, NetworkContact};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::homogenization::stress::first_piola;
use rve_server::space::{
    Components, Space, Spheres, Tensor, add_scaled, largest_component, product, rotated, scaled, transpose,
};
use std::path::Path;

pub(crate) type Matrix = [[f64; 3]; 3];

const NORMAL: f64 = 1.0;
const TANGENTIAL: f64 = 0.5;

const SIMPLE: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn face_centred() -> Matrix {
    let h = std::f64::consts::FRAC_1_SQRT_2;
    [[0.0, h, h], [h, 0.0, h], [h, h, 0.0]]
}

fn body_centred() -> Matrix {
    let a = 1.0 / 3f64.sqrt();
    [[-a, a, a], [a, -a, a], [a, a, -a]]
}

/// One sphere of unit diameter per primitive cell, pressed together by `overlap`.
fn crystal(rows: Matrix, overlap: f64, contact: ContactTable) -> GrainDefinition<Spheres> {
    let packing = PackingFile::new(scaled(&rows, 1.0 - overlap), vec![[0.2, 0.1, 0.3, 0.5]]);
    GrainDefinition { packing, contact, options: tight() }
}

fn sticking() -> ContactTable {
    ContactTable::linear(NORMAL, TANGENTIAL / NORMAL, 1e9)
}

pub(crate) fn tensor(answer: &TrialResult) -> Matrix {
    Matrix::from_fn(|i, j| answer.stress.get(i, j))
}

pub(crate) fn trial(cell: &mut GrainRve<Spheres>, h: &Matrix) -> TrialResult {
    cell.trial(&Tensor2::from_rows(h), &TrialOptions::default()).unwrap()
}

/// `C11`, `C12`, `C44` of a cubic crystal by central differences.
fn cubic_moduli(cell: &mut GrainRve<Spheres>, size: f64) -> [f64; 3] {
    let slope = |cell: &mut GrainRve<Spheres>, direction: Matrix| {
        let [plus, minus] = [size, -size].map(|step| tensor(&trial(cell, &scaled(&direction, step))));
        scaled(&add_scaled(&plus, -1.0, &minus), 0.5 / size)
    };
    let axial = slope(cell, [[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]]);
    let shear = slope(cell, [[0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0; 3]]);
    [axial[0][0], axial[1][1], shear[0][1]]
}

/// D-3, D-4, D-5: moduli of the three cubic crystals at a trace of pressure.
#[test]
fn cubic_crystals_have_their_moduli() {
    let (n, t) = (NORMAL, TANGENTIAL);
    let cases = [
        ("D-3", SIMPLE, 6.0, [n, 0.0, t / 2.0]),
        ("D-4", face_centred(), 12.0, [2f64.sqrt() * (n + t), (n - t) / 2f64.sqrt(), (n + t) / 2f64.sqrt()]),
        ("D-5", body_centred(), 8.0, [n + 2.0 * t, n - t, n + 0.5 * t].map(|sum| sum * 3f64.sqrt() / 3.0)),
    ];
    for (entry, rows, coordination, expected) in cases {
        let mut cell = GrainRve::new(&crystal(rows, 1e-6, sticking())).unwrap();
        assert_eq!(cell.observe(Observables::NONE).unwrap().scalars.coordination_number, coordination, "{entry}");
        for ((name, found), wanted) in ["C11", "C12", "C44"].iter().zip(cubic_moduli(&mut cell, 1e-8)).zip(expected) {
            Claim::of(entry, &format!("{name} by differences of stresses, over k_n / d"))
                .value(found, wanted)
                .within_absolute(1e-4);
        }
    }
}

/// D-7: finite isotropic compression, linear and Hertzian, `p = factor f / b^2`.
#[test]
fn finite_compression_of_crystals_follows_the_closed_forms() {
    let (shear, nu) = (1.0, 0.2);
    let linear = |overlap: f64| NORMAL * overlap;
    // Unit diameter: R* = 1/4.
    let hertz = |overlap: f64| 4.0 / 3.0 * shear / (1.0 - nu) * 0.25f64.sqrt() * overlap.powf(1.5);
    for (rows, factor) in [(SIMPLE, 1.0), (body_centred(), 3f64.sqrt()), (face_centred(), 2.0 * 2f64.sqrt())] {
        let laws: [(&str, ContactTable, &dyn Fn(f64) -> f64); 2] =
            [("linear", sticking(), &linear), ("Hertzian", ContactTable::hertz_mindlin(shear, nu, 1e9), &hertz)];
        for (law, contact, force) in laws {
            let options = RveOptions { strain_per_step: Some(1e-5), ..tight() };
            let mut cell = GrainRve::new(&GrainDefinition { options, ..crystal(rows, 0.0, contact) }).unwrap();
            let mut spacing = 1.0;
            for _ in 0..3 {
                let answer = trial(&mut cell, &scaled(&Matrix::IDENTITY, -0.01));
                cell.commit().unwrap();
                spacing *= 0.99;
                let pressure = factor * force(1.0 - spacing) / (spacing * spacing);
                let miss = add_scaled(&tensor(&answer), pressure, &Matrix::IDENTITY);
                Claim::of("D-7", &format!("stress of three cubic crystals, {law} contacts, compressed by up to 3 %"))
                    .error(largest_component(&miss))
                    .within(1e-12);
            }
        }
    }
}

/// D-8: at fixed contacts the bulk modulus of Hertzian spheres grows as the cube root of the pressure.
#[test]
fn hertzian_stiffness_grows_with_the_cube_root_of_the_pressure() {
    let found = [1e-6, 1e-5].map(|overlap: f64| {
        let contact = ContactTable::hertz_mindlin(1.0, 0.2, 1e9);
        let mut cell = GrainRve::new(&crystal(face_centred(), overlap, contact)).unwrap();
        let pressure = -cell.observe(Observables::NONE).unwrap().stress.get(0, 0);
        let [c11, c12, c44] = cubic_moduli(&mut cell, 1e-3 * overlap);
        [pressure, c11 + 2.0 * c12, c44]
    });
    let exponent = |k: usize| (found[1][k] / found[0][k]).ln() / (found[1][0] / found[0][0]).ln();
    for (place, name) in [(1, "bulk modulus"), (2, "shear modulus")] {
        Claim::of("D-8", &format!("exponent of the {name} over the pressure, face-centred crystal"))
            .value(exponent(place), 1.0 / 3.0)
            .within_absolute(3e-3);
    }
}

/// D-10: rigid frictional spheres, face-centred, compressed along a cube axis: `2 (1 + f) / (1 - f)` at the peak, and
/// `2 tan(theta) tan(theta + phi_mu)` on the way down.
#[test]
fn face_centred_crystal_yields_at_its_frictional_strength() {
    for friction in [0.1f64, 0.3] {
        let contact = ContactTable::linear(NORMAL, TANGENTIAL, friction);
        let options = RveOptions { strain_per_step: Some(1e-6), ..tight() };
        let definition = GrainDefinition { options, ..crystal(face_centred(), 1e-5, contact) };
        let mut cell = GrainRve::new(&definition).unwrap();
        let mut before = 45f64.to_radians();
        for (degrees, is_peak) in [(44.9f64, true), (43.0, false)] {
            // The inclined contacts keep their length: the cell widens by the cosine and sinks by the sine.
            let angle = degrees.to_radians();
            let (wider, lower) = (angle.cos() / before.cos() - 1.0, angle.sin() / before.sin() - 1.0);
            let answer = trial(&mut cell, &[[wider, 0.0, 0.0], [0.0, wider, 0.0], [0.0, 0.0, lower]]);
            cell.commit().unwrap();
            before = angle;
            assert_eq!(answer.scalars.coordination_number, 8.0);
            let ratio = answer.stress.get(2, 2) / answer.stress.get(0, 0);
            let expected = 2.0 * angle.tan() * (angle + friction.atan()).tan();
            Claim::of("D-10", "stress ratio along a cube axis against 2 tan(angle) tan(angle + friction angle)")
                .value(ratio, expected)
                .within(1e-3);
            if is_peak {
                Claim::of("D-10", "largest stress ratio along a cube axis")
                    .value(ratio, 2.0 * (1.0 + friction) / (1.0 - friction))
                    .within(2e-2);
            }
        }
    }
}

/// D-10 in plane strain: the same crystal turned by 45 degrees about the cube axis, so that square layers lie one above the
/// other. No strain along one row of contacts, which opens by its own overlap, the other rows part: eight contacts slide.
#[test]
fn face_centred_crystal_yields_in_plane_strain() {
    let layers = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2]];
    for friction in [0.1f64, 0.3] {
        let overlap = 1e-5;
        let contact = ContactTable::linear(NORMAL, TANGENTIAL, friction);
        let mut cell = GrainRve::new(&crystal(layers, overlap, contact)).unwrap();
        // The inclined contacts keep their length: x^2 / 4 + y^2 / 4 + z^2 in units of the rows stays 1.
        let (aside, lower) = (2.0 * overlap, 2e-3);
        let height = std::f64::consts::FRAC_1_SQRT_2 * (1.0 - lower);
        let width = 2.0 * (1.0 - 0.25 * (1.0 + aside) * (1.0 + aside) - height * height).sqrt();
        let answer = trial(&mut cell, &[[width - 1.0, 0.0, 0.0], [0.0, aside, 0.0], [0.0, 0.0, -lower]]);
        assert_eq!(answer.scalars.coordination_number, 8.0);
        let [x, y, z] = [0, 1, 2].map(|axis| answer.stress.get(axis, axis));
        let (three, two) = (3f64.sqrt(), 2f64.sqrt());
        let weak = three - 2.0 * two * friction;
        Claim::of("D-10", "major over minor stress in plane strain")
            .value(z / x, 2.0 * (three + two * friction) / weak)
            .within(2e-2);
        Claim::of("D-10", "intermediate over minor stress in plane strain").value(y / x, three / weak).within(2e-2);
    }
}

/// S-7: one sphere that touches its own images answers as eight of them do; S-4: deep overlaps are flagged.
#[test]
fn cells_smaller_than_the_contact_range_are_exact() {
    let strain = [[2e-4, 1e-4, 0.0], [0.0, -3e-4, 5e-5], [1e-4, 0.0, -2e-4]];
    // Of the three crystals only the face-centred one is stable in cells of more than one grain: the others are gear
    // trains, in which neighbours roll on each other.
    for (law, contact) in [("linear", sticking()), ("Hertzian", ContactTable::hertz_mindlin(1.0, 0.2, 1e9))] {
        let one = crystal(face_centred(), 1e-3, contact);
        let mut eight = one.clone();
        let cell = one.packing.periodicity;
        eight.packing.grains = (0..8)
            .map(|k| {
                let corner = [k & 1, k >> 1 & 1, k >> 2].map(f64::from);
                let centre = (0..3).fold([0.2, 0.1, 0.3], |sum, row| sum.plus(cell[row].times(corner[row])));
                [centre[0], centre[1], centre[2], 0.5]
            })
            .collect();
        eight.packing.periodicity = scaled(&cell, 2.0);
        let [first, second] =
            [one, eight].map(|definition| tensor(&trial(&mut GrainRve::new(&definition).unwrap(), &strain)));
        let miss = largest_component(&add_scaled(&first, -1.0, &second)) / largest_component(&first);
        Claim::of("S-7", &format!("stress of a cell of one sphere against eight, face-centred, {law} contacts"))
            .error(miss)
            .within(1e-9);
    }
    let mut deep = GrainRve::new(&crystal(SIMPLE, 0.12, sticking())).unwrap();
    let flags = deep.observe(Observables::NONE).unwrap().flags;
    Claim::of("S-4", "overlaps of 12 % of a diameter are flagged").holds(flags.contains(TrialFlags::LARGE_OVERLAP));
}

/// A thousand spheres at unit pressure, `(E* / p)^(2/3) = 300`.
pub(crate) fn thousand(options: RveOptions) -> GrainDefinition<Spheres> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/case-b/packing.json");
    let contact = ContactTable::hertz_mindlin(1e4 / 2.4, 0.2, 0.5);
    GrainDefinition { packing: PackingFile::read(&path).unwrap(), contact, options }
}

pub(crate) fn coarse() -> RveOptions {
    RveOptions { strain_per_step: Some(3e-5), tolerance: Some(1e-9), ..RveOptions::default() }
}

pub(crate) const STRAIN: Matrix = [[1e-4, 5e-5, 0.0], [5e-5, -2e-4, 3e-5], [0.0, 3e-5, 5e-5]];

pub(crate) fn stress_after(definition: &GrainDefinition<Spheres>, h: &Matrix) -> Matrix {
    tensor(&trial(&mut GrainRve::new(definition).unwrap(), h))
}

/// E-1: a rotation on top of a stretch turns the stress and does nothing else.
#[test]
fn superposed_rotation_turns_the_stress_of_spheres() {
    let definition = thousand(coarse());
    let plain = stress_after(&definition, &STRAIN);
    let stretch = add_scaled(&Matrix::IDENTITY, 1.0, &STRAIN);
    let turn = Spheres::polar(&[[-0.5, -0.7, 0.2], [0.9, -0.4, -0.1], [0.1, 0.3, -0.2]]).turn;
    let rotation = Spheres::rotation_matrix(turn);
    let h = add_scaled(&product(&rotation, &stretch), -1.0, &Matrix::IDENTITY);
    let error = add_scaled(&stress_after(&definition, &h), -1.0, &rotated(&plain, &rotation));
    // Measured 6e-14: rounding, which sliding contacts amplify.
    Claim::of("E-1", "stress of 1000 spheres, rotated at once, over the pressure")
        .error(largest_component(&error))
        .within(1e-11);
}

/// E-3, E-4: the stress from the contacts that cross the border is that of all contacts, and it is symmetric, both up to
/// the forces out of balance. A-4 in space: a state that went through bytes continues to the same bits.
#[test]
fn stress_of_spheres_is_consistent_and_states_are_complete() {
    let definition = thousand(coarse());
    let mut cell = GrainRve::new(&definition).unwrap();
    let first = trial(&mut cell, &STRAIN);
    let network = cell.network().unwrap().clone();
    let (whole, border) = (network.stress(), border_stress(&network));
    let unbalanced = first.scalars.unbalanced_force_ratio;
    assert!(unbalanced <= 1e-9);
    // Measured 0.36 and 1e-3 of the ratio.
    let [gap, skew] = [&border, &transpose(&whole)].map(|other| largest_component(&add_scaled(&whole, -1.0, other)));
    Claim::of("E-3", "stress across the border, 1000 spheres: difference over the unbalanced ratio")
        .error(gap / unbalanced)
        .within(1.0);
    Claim::of("E-4", "skew part of the stress of 1000 spheres over the unbalanced ratio")
        .error(skew / unbalanced)
        .within(0.01);
    cell.commit().unwrap();

    let mut bytes = Vec::new();
    cell.snapshot(&mut bytes);
    let mut restored = GrainRve::new(&definition).unwrap();
    restored.restore(&bytes).unwrap();
    let back = scaled(&STRAIN, -0.5);
    let [uninterrupted, continued] = [&mut cell, &mut restored].map(|cell| trial(cell, &back).stress);
    Claim::of("A-4", "stress of 1000 spheres after a saved state is restored, bits")
        .holds(uninterrupted == continued);
}

/// E-5: basis of the cell, origin, numbering.
#[test]
fn basis_origin_and_numbering_do_not_matter_to_spheres() {
    let plain = thousand(coarse());
    let expected = stress_after(&plain, &STRAIN);
    let rows = plain.packing.periodicity;
    let mut basis = plain.clone();
    basis.packing.periodicity[2] = rows[2].plus(rows[0]).minus(rows[1]);
    let mut moved = plain.clone();
    for grain in &mut moved.packing.grains {
        grain[0] += 0.37 * rows[0][0];
        grain[2] -= 1.41 * rows[2][2];
    }
    moved.packing.grains.reverse();
    for (name, changed) in [("basis", basis), ("origin and numbering", moved)] {
        let error = largest_component(&add_scaled(&stress_after(&changed, &STRAIN), -1.0, &expected));
        // Measured 3e-14.
        Claim::of("E-5", &format!("stress of 1000 spheres with another {name}, over the pressure"))
            .error(error)
            .within(1e-11);
    }
}

/// E-2: the work of the contact forces is the work of the stress.
#[test]
fn contact_work_of_spheres_is_stress_work() {
    let mut cell = GrainRve::new(&thousand(RveOptions { strain_per_step: Some(1e-6), ..coarse() })).unwrap();
    let small = scaled(&STRAIN, 0.1);
    let before = cell.committed_network().unwrap();
    trial(&mut cell, &small);
    let after = cell.network().unwrap();
    let key = |contact: &NetworkContact<Spheres>| (contact.origin, contact.end, contact.shift);
    let mut all: Vec<_> = before.contacts.iter().chain(&after.contacts).copied().collect();
    all.sort_by_key(key);
    all.dedup_by_key(|contact| key(contact));
    let force_in = |network: &ContactNetwork<Spheres>, contact| {
        let place = network.contacts.binary_search_by_key(&key(contact), key);
        place.map_or([0.0; 3], |place| network.force(&network.contacts[place]))
    };
    let contact_work = all.iter().map(|contact| {
        let way = after.branch(contact).minus(before.branch(contact));
        0.5 * force_in(&before, contact).plus(force_in(after, contact)).dot(way)
    });
    let contact_work = contact_work.sum::<f64>() / before.volume();
    let f = add_scaled(&Matrix::IDENTITY, 1.0, &small);
    let mean = add_scaled(&before.stress(), 1.0, &first_piola(&after.stress(), &f));
    let stress_work: f64 = (0..9).map(|k| 0.5 * mean[k / 3][k % 3] * small[k / 3][k % 3]).sum();
    Claim::of("E-2", "work of the contacts against work of the stress, 1000 spheres, J / m3")
        .value(contact_work, stress_work)
        .within(1e-3);
}
