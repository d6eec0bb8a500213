//! What cells in lanes and pairs in lanes have in common, with every set of instructions.

use super::backend::Backend;
use super::*;
use crate::contact::{LinearSprings, NormalStiffness, PlainLinear};
use crate::simd::{Lanes, Real, Tuple};
use crate::space::Discs;

const LAW: PlainLinear =
    PlainLinear::plain(LinearSprings { normal: NormalStiffness::Constant(1.0), stiffness_ratio: 0.25 }, 0.5);

/// What three couples of unit discs lose that carried these tangential forces and have moved apart; in a second lane the
/// first couple still touches.
fn opening_loss<R: Real>(forces: [f64; 3], backend: Backend) -> f64 {
    let still = Grain::<Discs, R>::empty();
    let mut grains = vec![still; 6];
    let mut contacts = vec![Contact::<Discs, PlainLinear, R>::none(); 3];
    for (couple, force) in forces.into_iter().enumerate() {
        let mut distance = R::splat(2.5);
        if couple == 0 && R::LANES > 1 {
            distance.set_lane(1, 1.9);
        }
        grains[2 * couple].position = [R::default(), R::splat(10.0 * couple as f64)];
        grains[2 * couple + 1].position = [distance, R::splat(10.0 * couple as f64)];
        contacts[couple].direction = [R::splat(1.0), R::default()];
        contacts[couple].tangential_force = [R::splat(force)];
    }
    let data = StepData {
        law: &LAW,
        grain_constants: &[GrainConstants::default(); 6],
        grains: &mut grains,
        pairs: &[0, 2, 4].map(|origin| ListedPair { origin, end: origin + 1, image: 0 }),
        pair_constants: &[PairConstants::new(&LAW, [1.0, 1.0]); 3],
        contacts: &mut contacts,
        groups: &mut [],
        live: &mut [true; 3],
        limit_counts: &mut [R::default(); 3],
        sampling: R::default(),
        images: &[Tuple::zero()],
        wanted: Wanted::default(),
    };
    let mut groups = Vec::new();
    if R::LANES == 1 && backend.has_lanes() {
        pack(&data, &mut groups);
    }
    let sums = backend.evaluate(&mut StepData { groups: &mut groups, ..data });
    sums.opening_loss.lane(0)
}

/// Losses of contacts that open in one step are added in key order, whatever else is near: 2 + e + e is 2, e + e + 2 is not.
#[test]
fn losses_of_openings_have_one_order() {
    let small = 1.25 / f64::from(1 << 27);
    for backend in Backend::ALL {
        assert_eq!(opening_loss::<f64>([1.0, small, small], backend).to_bits(), 2.0f64.to_bits());
        if backend.has_lanes() {
            assert_eq!(opening_loss::<Lanes<8>>([1.0, small, small], backend).to_bits(), 2.0f64.to_bits());
        }
    }
}

/// Sums and forces of two touching discs that may not rotate, with moments left out or not.
fn blocked_couple<R: Real>(blocked: bool, backend: Backend) -> ([u64; 10], bool) {
    let still = Grain::<Discs, R>::empty();
    let mut grains = vec![still; 2];
    grains[1].position = [R::splat(1.9), R::splat(0.1)];
    grains[0].velocity = [R::splat(0.01), R::splat(-0.02)];
    let mut contacts = vec![Contact::<Discs, PlainLinear, R>::none(); 1];
    contacts[0].direction = [R::splat(1.0), R::default()];
    contacts[0].tangential_force = [R::splat(0.03)];
    let data = StepData {
        law: &LAW,
        grain_constants: &[GrainConstants { mass: 1.0, inverse_mass: 1.0, ..GrainConstants::default() }; 2],
        grains: &mut grains,
        pairs: &[ListedPair { origin: 0, end: 1, image: 0 }],
        pair_constants: &[PairConstants::new(&LAW, [1.0, 1.0])],
        contacts: &mut contacts,
        groups: &mut [],
        live: &mut [true],
        limit_counts: &mut [R::default()],
        sampling: R::default(),
        images: &[Tuple::zero()],
        wanted: Wanted { blocked, virial: true, ..Wanted::default() },
    };
    let mut groups = Vec::new();
    if R::LANES == 1 && backend.has_lanes() {
        pack(&data, &mut groups);
    }
    let sums = backend.evaluate(&mut StepData { groups: &mut groups, ..data }).lane(0);
    let [force, opposite] = [grains[0].force, grains[1].force].map(|force| force.map(|part| part.lane(0)));
    let branch = [1.9, 0.1];
    let virial: [f64; 4] = std::array::from_fn(|place| force[place / 2] * branch[place % 2]);
    assert_eq!(sums.virial[..4], virial, "force times branch vector, by rows");
    let numbers = [
        sums.normal_force,
        sums.dissipation,
        sums.largest_force_square,
        sums.force_square,
        sums.power,
        sums.scaled_force_square,
        force[0],
        force[1],
        opposite[0],
        opposite[1],
    ];
    (numbers.map(f64::to_bits), grains[0].moment[0].lane(0) != 0.0)
}

/// No bit depends on moments that count for nothing.
#[test]
fn grains_that_may_not_rotate_need_no_moments() {
    let answers = |backend: Backend, blocked: bool| {
        let lanes = backend.has_lanes().then(|| blocked_couple::<Lanes<8>>(blocked, backend));
        [Some(blocked_couple::<f64>(blocked, backend)), lanes]
    };
    let mut moments_left_out = false;
    for backend in Backend::ALL {
        for (with, without) in answers(backend, false).into_iter().zip(answers(backend, true)) {
            let (Some((with, turned)), Some((without, idle))) = (with, without) else { continue };
            assert_eq!(with, without);
            assert!(turned, "moments are summed for grains that rotate");
            moments_left_out |= !idle;
        }
    }
    assert_eq!(
        moments_left_out,
        Backend::ALL.into_iter().any(Backend::has_lanes),
        "and not for single cells of others"
    );
}
