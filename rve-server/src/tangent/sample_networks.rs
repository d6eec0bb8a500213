//! Networks for tests: perfect lattices with closed-form moduli and random ones in exact balance.

use crate::cell::{ContactNetwork, NetworkContact};
use crate::space::{Space, Spheres};
use crate::tangent::{Closeness, FrozenMethod, Method, Orderings, TangentOutcome, evaluate_with};
use nalgebra::{DMatrix, DVector};
use protocol::TangentKind;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha12Rng;

/// A plane operator as `[ij][kl]`, pairs ordered 11, 12, 21, 22, Pa.
pub(super) type PlaneOperator = [[f64; 4]; 4];

/// The method of a kind that needs the network alone.
pub(super) fn frozen(kind: TangentKind) -> FrozenMethod {
    match Method::of(kind) {
        Method::Frozen(method) => method,
        other => panic!("{} is found by {other:?}", kind.keyword()),
    }
}

/// Operator of such a kind, solved as closely as results are.
pub(super) fn evaluate<S: Space>(network: &ContactNetwork<S>, kind: TangentKind) -> TangentOutcome {
    evaluate_with(&mut Orderings::default(), network, frozen(kind), Closeness::RESULT)
}

/// Springs and normal force of all contacts of a lattice.
#[derive(Clone, Copy)]
pub(super) struct Springs {
    pub normal: f64,
    pub tangential: f64,
    pub normal_force: f64,
}

/// `counts` primitive cells with vectors `primitive`, one grain in each, linked to the neighbours `links`.
fn lattice(primitive: [[f64; 2]; 2], links: &[[i32; 2]], counts: [i32; 2], springs: Springs) -> ContactNetwork {
    let at =
        |i: i32, j: i32| [0, 1].map(|axis| f64::from(i) * primitive[0][axis] + f64::from(j) * primitive[1][axis]);
    let mut positions = Vec::new();
    let mut contacts = Vec::new();
    for j in 0..counts[1] {
        for i in 0..counts[0] {
            positions.push(at(i, j));
            for link in links {
                let (column, row) = (i + link[0], j + link[1]);
                let end = row.rem_euclid(counts[1]) * counts[0] + column.rem_euclid(counts[0]);
                contacts.push(NetworkContact {
                    origin: (j * counts[0] + i) as u32,
                    end: end as u32,
                    shift: [column.div_euclid(counts[0]), row.div_euclid(counts[1])],
                    normal_stiffness: springs.normal,
                    tangential_stiffness: springs.tangential,
                    rolling_stiffness: 0.0,
                    normal_force: springs.normal_force,
                    tangential_force: 0.0,
                    slid: false,
                    at_limit: false,
                });
            }
        }
    }
    let spacing = primitive[0][0].hypot(primitive[0][1]);
    ContactNetwork {
        cell: [at(counts[0], 0), at(0, counts[1])],
        thickness: 1.0,
        radii: vec![0.5 * spacing; positions.len()],
        positions,
        rotations_free: true,
        friction: 0.5,
        contacts,
    }
}

/// Triangular lattice of spacing `spacing`, turned by `angle` radians.
pub(super) fn triangular(spacing: f64, angle: f64, counts: [i32; 2], springs: Springs) -> ContactNetwork {
    let along = |turn: f64| [spacing * (angle + turn).cos(), spacing * (angle + turn).sin()];
    let primitive = [along(0.0), along(std::f64::consts::FRAC_PI_3)];
    lattice(primitive, &[[1, 0], [0, 1], [-1, 1]], counts, springs)
}

/// Square lattice of spacing `spacing` along the axes.
pub(super) fn square(spacing: f64, counts: [i32; 2], springs: Springs) -> ContactNetwork {
    lattice([[spacing, 0.0], [0.0, spacing]], &[[1, 0], [0, 1]], counts, springs)
}

/// A skewed cell of jittered grains of unequal size and stiffness with some contacts missing, its forces in balance on
/// every grain. `pressure_ratio` is the mean overlap over the grain diameter.
pub(super) fn random(seed: u64, pressure_ratio: f64) -> ContactNetwork {
    let mut generator = ChaCha12Rng::seed_from_u64(seed);
    let mut uniform =
        move |low: f64, high: f64| low + (high - low) * ((generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64);
    let springs = Springs { normal: 1.0, tangential: 0.5, normal_force: 0.0 };
    let mut network = triangular(1.0, 0.1, [5, 4], springs);
    for position in &mut network.positions {
        *position = position.map(|coordinate| coordinate + uniform(-0.12, 0.12));
    }
    network.radii = network.radii.iter().map(|_| uniform(0.4, 0.6)).collect();
    network.contacts.retain(|_| uniform(0.0, 1.0) < 0.85);
    for contact in &mut network.contacts {
        contact.normal_stiffness = uniform(0.5, 1.5);
        contact.tangential_stiffness = uniform(0.2, 1.0);
        contact.normal_force = -pressure_ratio * uniform(0.2, 1.8);
        contact.tangential_force = pressure_ratio * uniform(-0.4, 0.4);
    }
    balance(&mut network);
    network
}

/// Replaces the contact forces by the nearest ones that leave no force and no moment on any grain.
fn balance(network: &mut ContactNetwork) {
    let mut equations = DMatrix::<f64>::zeros(3 * network.positions.len(), 2 * network.contacts.len());
    for (index, contact) in network.contacts.iter().enumerate() {
        let geometry = geometry(network, contact);
        let ends = [(contact.origin as usize, 1.0, geometry.arms[0]), (contact.end as usize, -1.0, geometry.arms[1])];
        for (grain, sign, arm) in ends {
            for axis in 0..2 {
                equations[(3 * grain + axis, 2 * index)] += sign * geometry.normal[axis];
                equations[(3 * grain + axis, 2 * index + 1)] += sign * geometry.tangent[axis];
            }
            equations[(3 * grain + 2, 2 * index + 1)] += arm;
        }
    }
    let forces = DVector::from_iterator(
        2 * network.contacts.len(),
        network.contacts.iter().flat_map(|contact| [contact.normal_force, contact.tangential_force]),
    );
    let decomposition = equations.clone().svd(true, true);
    let mut balanced = forces;
    for _ in 0..2 {
        let imbalance = &equations * &balanced;
        balanced -= decomposition.solve(&imbalance, 1e-10).expect("both singular bases were requested");
    }
    for (contact, pair) in network.contacts.iter_mut().zip(balanced.as_slice().chunks(2)) {
        contact.normal_force = pair[0];
        contact.tangential_force = pair[1];
    }
}

/// Branch, normal, tangent and arms of a contact.
struct Geometry {
    normal: [f64; 2],
    tangent: [f64; 2],
    arms: [f64; 2],
}

fn geometry(network: &ContactNetwork, contact: &NetworkContact) -> Geometry {
    let branch = network.branch(contact);
    let length = branch[0].hypot(branch[1]);
    let normal = branch.map(|component| component / length);
    let difference = 0.5 * (network.radii[contact.origin as usize] - network.radii[contact.end as usize]);
    let arms = [0.5 * length + difference, 0.5 * length - difference];
    Geometry { normal, tangent: [-normal[1], normal[0]], arms }
}

/// Love-Weber stress, Pa.
pub(super) fn stress(network: &ContactNetwork) -> [[f64; 2]; 2] {
    network.stress()
}

/// `counts` primitive cells of a crystal of spheres, one grain in each, linked to the neighbours `links`.
pub(super) fn crystal(
    primitive: [[f64; 3]; 3],
    links: &[[i32; 3]],
    counts: [i32; 3],
    springs: Springs,
) -> ContactNetwork<Spheres> {
    let at = |cell: [i32; 3]| -> [f64; 3] {
        std::array::from_fn(|axis| (0..3).map(|vector| f64::from(cell[vector]) * primitive[vector][axis]).sum())
    };
    let number = |cell: [i32; 3]| ((cell[2] * counts[1] + cell[1]) * counts[0] + cell[0]) as u32;
    let cells = (0..counts[0] * counts[1] * counts[2])
        .map(|place| [place % counts[0], place / counts[0] % counts[1], place / (counts[0] * counts[1])]);
    let mut network = ContactNetwork {
        cell: [at([counts[0], 0, 0]), at([0, counts[1], 0]), at([0, 0, counts[2]])],
        thickness: 1.0,
        positions: Vec::new(),
        radii: Vec::new(),
        rotations_free: true,
        friction: 0.5,
        contacts: Vec::new(),
    };
    let spacing = at(links[0]).iter().map(|component| component * component).sum::<f64>().sqrt();
    for cell in cells {
        network.positions.push(at(cell));
        network.radii.push(0.5 * spacing);
        for link in links {
            let reached: [i32; 3] = std::array::from_fn(|axis| cell[axis] + link[axis]);
            network.contacts.push(NetworkContact {
                origin: number(cell),
                end: number(std::array::from_fn(|axis| reached[axis].rem_euclid(counts[axis]))),
                shift: std::array::from_fn(|axis| reached[axis].div_euclid(counts[axis])),
                normal_stiffness: springs.normal,
                tangential_stiffness: springs.tangential,
                rolling_stiffness: 0.0,
                normal_force: springs.normal_force,
                tangential_force: [0.0; 3],
                slid: false,
                at_limit: false,
            });
        }
    }
    network
}

/// A face-centred crystal of `side`^3 primitive cells with jittered grains, unequal stiffnesses, missing contacts and
/// arbitrary forces of `pressure_ratio` of stiffness times diameter, some of them sliding. Its forces are not in balance.
pub(super) fn disordered(side: i32, seed: u64, pressure_ratio: f64) -> ContactNetwork<Spheres> {
    let mut generator = ChaCha12Rng::seed_from_u64(seed);
    let mut uniform =
        move |low: f64, high: f64| low + (high - low) * ((generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64);
    let h = std::f64::consts::FRAC_1_SQRT_2;
    let links = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, -1, 0], [1, 0, -1], [0, 1, -1]];
    let springs = Springs { normal: 1.0, tangential: 0.5, normal_force: 0.0 };
    let mut network = crystal([[0.0, h, h], [h, 0.0, h], [h, h, 0.0]], &links, [side; 3], springs);
    for position in &mut network.positions {
        *position = position.map(|coordinate| coordinate + uniform(-0.02, 0.02));
    }
    network.contacts.retain(|_| uniform(0.0, 1.0) < 0.8);
    let normals: Vec<[f64; 3]> = network.contacts.iter().map(|contact| network.branch(contact)).collect();
    for (contact, normal) in network.contacts.iter_mut().zip(normals) {
        contact.normal_stiffness = uniform(0.5, 1.5);
        contact.tangential_stiffness = uniform(0.2, 1.0);
        contact.normal_force = -pressure_ratio * uniform(0.5, 1.5);
        let force: [f64; 3] = std::array::from_fn(|_| pressure_ratio * uniform(-0.3, 0.3));
        let square: f64 = normal.iter().map(|component| component * component).sum();
        let along: f64 = normal.iter().zip(force).map(|(a, b)| a * b).sum::<f64>() / square;
        contact.tangential_force = std::array::from_fn(|axis| force[axis] - along * normal[axis]);
        contact.slid = uniform(0.0, 1.0) < 0.1;
    }
    network
}
