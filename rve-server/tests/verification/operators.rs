//! Tangent operators of random packings against probes of the grains and against closed forms of isotropic contacts.

use claims::Claim;
use protocol::{Observables, RveSolver, TangentKind, Tensor2, Tensor4, TrialFlags, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, OperatorOptions, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use rve_server::space::{Components, Discs, Spheres};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn cell<S: SolverFor>(file: &str, contact: ContactTable, options: RveOptions) -> GrainRve<S> {
    let packing = PackingFile::<S>::read(&root().join(file)).unwrap();
    GrainRve::new(&GrainDefinition { packing, contact, options }).unwrap()
}

fn operator<S: SolverFor>(cell: &mut GrainRve<S>, target: &Tensor2, kind: TangentKind) -> Tensor4 {
    let answer = cell.trial(target, &TrialOptions { tangent: kind, ..TrialOptions::default() }).unwrap();
    assert!(!answer.flags.contains(TrialFlags::TANGENT_FALLBACK), "{kind:?}");
    *answer.tangent.unwrap()
}

fn distance(found: &Tensor4, expected: &Tensor4) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    let miss = norm(&mut found.0.iter().zip(expected.0).map(|(a, b)| a - b));
    miss / norm(&mut expected.0.iter().copied())
}

/// Bulk and shear modulus of the isotropic part of an operator on symmetric strains.
fn moduli(operator: &Tensor4, dimension: usize) -> [f64; 2] {
    let (mut trace, mut whole) = (0.0, 0.0);
    for i in 0..dimension {
        for j in 0..dimension {
            trace += operator.get(i, i, j, j);
            whole += 0.5 * (operator.get(i, j, i, j) + operator.get(i, j, j, i));
        }
    }
    let d = dimension as f64;
    let bulk = trace / (d * d);
    // The isotropic part has d K along the mean and 2 G in each of the other independent strains.
    [bulk, (whole - d * bulk) / ((d + 2.0) * (d - 1.0))]
}

fn glass(unloading: &str) -> ContactTable {
    let text = format!(
        "law = \"hertz_mindlin\"\nshear_modulus = 29e9\npoisson_ratio = 0.15\nfriction = 0.5\nunloading = \"{unloading}\"\n"
    );
    toml::from_str(&text).unwrap()
}

/// T-1 for spheres with both laws. `truss_like` is the derivative of the law by increments. It leaves out what the default
/// law does to tangential forces of contacts that unload: `d f_t = f_t d(delta) / 2 delta`, beside `k_t` times the slip.
#[test]
fn truss_like_is_the_derivative_of_the_incremental_law_of_spheres() {
    for (unloading, least, most) in [("incremental", 0.0, 1e-4), ("rescaled", 2e-2, 8e-2)] {
        let probes = OperatorOptions {
            quasi_static_perturbation: Some(1e-8),
            quasi_static_tolerance: Some(1e-9),
            ..OperatorOptions::default()
        };
        let options = RveOptions { tolerance: Some(1e-9), operator: probes, ..RveOptions::default() };
        let mut cell = cell::<Spheres>("packings/spheres-100.json", glass(unloading), options);
        let increment = Tensor2([2.5e-4, 7.5e-5, 0.0, 7.5e-5, 2.5e-4, 0.0, 0.0, 0.0, -5e-4]);
        for _ in 0..2 {
            cell.trial(&increment, &TrialOptions::default()).unwrap();
            cell.commit().unwrap();
        }
        let network = operator(&mut cell, &increment, TangentKind::TrussLike);
        let perturbed = operator(&mut cell, &increment, TangentKind::QuasiStatic);
        let found = distance(&network, &perturbed);
        eprintln!("{unloading}: truss_like is {found:.2e} off the perturbed operator");
        assert!(found >= least, "{unloading}: {found:e}");
        Claim::of("T-1", &format!("operator of 100 Hertzian spheres, tangential forces on unloading {unloading}"))
            .error(found)
            .missed_up_to(most)
            .within(1e-4);
    }
}

/// UCKO needs its own factor only: a state that gives UCKO-2DOF no positive pair calibrates it all the same.
#[test]
fn one_factor_is_calibrated_where_two_are_not_positive() {
    let mut cell = cell::<Spheres>("packings/spheres-100.json", glass("rescaled"), RveOptions::default());
    let increment = Tensor2([2.5e-4, 7.5e-5, 0.0, 7.5e-5, 2.5e-4, 0.0, 0.0, 0.0, -5e-4]);
    let consistent = operator(&mut cell, &increment, TangentKind::Consistent);
    let options = TrialOptions { tangent: TangentKind::KruytTwiceCalibrated, ..TrialOptions::default() };
    let twice = cell.trial(&increment, &options).unwrap();
    assert!(twice.flags.contains(TrialFlags::TANGENT_FALLBACK), "no positive pair here");
    let calibrated = operator(&mut cell, &increment, TangentKind::KruytCalibrated);
    let wanted = consistent.get(0, 0, 0, 0);
    assert!(wanted > 0.0 && (calibrated.get(0, 0, 0, 0) / wanted - 1.0).abs() < 1e-12);
    // Calibrated once: the next step needs no probes.
    cell.commit().unwrap();
    let increment = Tensor2([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1e-5]);
    let cost = |cell: &mut GrainRve<Spheres>, tangent| {
        cell.trial(&increment, &TrialOptions { tangent, ..TrialOptions::default() }).unwrap().cost.force_evaluations
    };
    assert_eq!(cost(&mut cell, TangentKind::KruytCalibrated), cost(&mut cell, TangentKind::None));
}

/// T-6: the uniform-strain moduli of springs in space, `K = k_n S / 9` and `G = (2 k_n + 3 k_t) S / 30` with `S = sum l^2 / V`,
/// for any packing; for equal spheres `S = 3 z phi / (pi d)`.
#[test]
fn uniform_strain_moduli_of_spheres_follow_the_closed_form() {
    let (normal, ratio) = (1e-3, 0.5);
    let contact = ContactTable::linear(normal, ratio, 0.5);
    let mut cell = cell::<Spheres>("tests/data/case-b/packing.json", contact, RveOptions::default());
    let found = moduli(&operator(&mut cell, &Tensor2::ZERO, TangentKind::Kruyt), 3);
    let network = cell.committed_network().unwrap();
    let sum: f64 = network.contacts.iter().map(|contact| network.branch(contact).dot(network.branch(contact))).sum();
    let density = sum / network.volume().abs();
    let expected = [normal * density / 9.0, normal * (2.0 + 3.0 * ratio) * density / 30.0];
    for ((name, found), expected) in ["bulk", "shear"].iter().zip(found).zip(expected) {
        Claim::of("T-6", &format!("uniform-strain {name} modulus of 1000 spheres with linear springs, Pa"))
            .value(found, expected)
            .within(1e-12);
    }
    let scalars = cell.observe(Observables::NONE).unwrap().scalars;
    let solid = 1.0 / (1.0 + scalars.void_ratio);
    let mean = 2.0 * network.radii.iter().sum::<f64>() / network.radii.len() as f64;
    let statistical = 3.0 * scalars.coordination_number * solid / (std::f64::consts::PI * mean);
    eprintln!("T-6: sum l^2 / V is {:.4} of 3 z phi / (pi d)", density / statistical);
    Claim::of("T-6", "sum of squared branches over the volume against 3 z phi / (pi d), 1000 spheres")
        .value(density, statistical)
        .within(3e-2);
}

/// T-6: effective medium of Hertzian spheres and [Liu2015] Table II, 4096 spheres at 416 kPa.
#[test]
fn spheres_have_the_bulk_modulus_of_the_effective_medium() {
    let mut cell = cell::<Spheres>("packings/spheres-4096.json", glass("rescaled"), RveOptions::default());
    let look = cell.observe(Observables::NONE).unwrap();
    let pressure = -(0..3).map(|axis| look.stress.get(axis, axis)).sum::<f64>() / 3.0;
    let solid = 1.0 / (1.0 + look.scalars.void_ratio);
    let coordination = look.scalars.coordination_number;
    let (shear, nu) = (29e9, 0.15);
    let product = coordination * solid * shear / (1.0 - nu);
    let medium = (product * product * pressure / (18.0 * std::f64::consts::PI.powi(2))).cbrt();
    let medium_shear = medium * 3.0 * (5.0 - 4.0 * nu) / (5.0 * (2.0 - nu));
    let uniform = moduli(&operator(&mut cell, &Tensor2::ZERO, TangentKind::Kruyt), 3);
    let relaxed = moduli(&operator(&mut cell, &Tensor2::ZERO, TangentKind::TrussLike), 3);
    eprintln!(
        "T-6: z {coordination:.3}, solid fraction {solid:.4}, pressure {pressure:.4e}; effective medium K {medium:.4e}, G \
         {medium_shear:.4e}; uniform strain {uniform:.4?}; relaxed {relaxed:.4?}; [Liu2015] K 3.35e8, G 2.41e8"
    );
    for ((name, found), expected) in ["bulk", "shear"].iter().zip(uniform).zip([medium, medium_shear]) {
        Claim::of("T-6", &format!("uniform-strain {name} modulus of 4096 spheres against the effective medium, Pa"))
            .value(found, expected)
            .within(3e-2);
    }
    assert!(relaxed[0] < uniform[0] && relaxed[1] < uniform[1], "uniform strain is an upper bound");
    // Table II has the effective medium's K and half of its G; relaxation takes 4 % of K and 29 % of G.
    Claim::of("T-6", "uniform-strain bulk modulus of 4096 spheres against [Liu2015] Table II, Pa")
        .value(uniform[0], 3.35e8)
        .within(3e-2);
    assert!((0.94..0.98).contains(&(relaxed[0] / uniform[0])), "{relaxed:?}");
    assert!((0.68..0.74).contains(&(relaxed[1] / uniform[1])), "{relaxed:?}");
}

/// T-7: 400 discs with `k_t = k_n`: what relaxation leaves of the uniform-strain moduli.
#[test]
fn relaxation_leaves_discs_their_share_of_the_uniform_strain_moduli() {
    let options = RveOptions { tolerance: Some(1e-6), ..RveOptions::default() };
    let contact = ContactTable::linear(1000.0, 1.0, 0.5);
    let mut cell = cell::<Discs>("tests/data/case-a/packing.json", contact, options);
    let small = Tensor2::from_plane([[-1e-8, 0.0], [0.0, -1e-8]]);
    let [relaxed, uniform] =
        [TangentKind::TrussLike, TangentKind::Kruyt].map(|kind| moduli(&operator(&mut cell, &small, kind), 2));
    let [bulk, shear] = [0, 1].map(|place: usize| relaxed[place] / uniform[place]);
    Claim::of("T-7", "relaxed over uniform-strain bulk modulus").number(bulk).between(0.88, 0.92);
    Claim::of("T-7", "relaxed over uniform-strain shear modulus").number(shear).between(0.69, 0.73);
}
