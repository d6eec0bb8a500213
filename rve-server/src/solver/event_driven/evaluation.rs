//! One exact evaluation of all contacts after a given motion of the grains: geometry, springs, friction, and what is left
//! out of balance. Nothing is linearised here, so that the residual is the whole error of a predicted motion.

use crate::cell::{Cell, GrainState, PairKey};
use crate::contact::{ContactLaw, ContactMotion, PlainLinear};
use crate::definition::GrainModel;
use crate::solver::kernel::StepSums;
use crate::solver::linear::DiscPair;
use crate::space::{Components, Discs, Space, add_scaled, apply};

/// Gap that a loose grain is left with when it is pushed away, over the distance of the centres.
const FREE_GAP: f64 = 3e-5;

/// Motion of a grain besides the affine one: two displacements and its spin times its radius, m.
pub(super) type Motion = [f64; 3];

/// A near pair at the committed state.
#[derive(Clone, Copy, Debug)]
struct StartPair {
    key: PairKey<Discs>,
    constants: [f64; 7],
    /// Sum of the radii and half their difference, m.
    range: f64,
    half_difference: f64,
    /// Normal; zero where the pair does not touch.
    direction: [f64; 2],
    touched: bool,
    tangential_force: f64,
}

/// A near pair after the motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairNow {
    pub(super) branch: [f64; 2],
    pub(super) length: f64,
    pub(super) touches: bool,
    /// N; negative in compression.
    pub(super) normal_force: f64,
    /// N, along the tangent.
    pub(super) tangential_force: f64,
    /// Whether friction has cut the tangential force.
    pub(super) slides: bool,
}

/// The committed state as the evaluations of one trial need it.
#[derive(Debug)]
pub(super) struct Start<'a> {
    pub(super) state: &'a GrainState<Discs>,
    law: &'a PlainLinear,
    radii: &'a [f64],
    rotations_free: bool,
    pairs: Vec<StartPair>,
}

/// All contacts after a motion.
#[derive(Debug)]
pub(super) struct Evaluation {
    pub(super) cell: Cell<Discs>,
    pub(super) positions: Vec<[f64; 2]>,
    /// In the order of the listed pairs.
    pub(super) pairs: Vec<PairNow>,
    /// Force out of balance and moment over radius of each grain, N.
    pub(super) loads: Vec<[f64; 3]>,
    pub(super) sums: StepSums<f64>,
}

impl<'a> Start<'a> {
    /// With these near pairs, sorted; they must hold every contact of the state.
    pub(super) fn of(
        model: &'a GrainModel,
        law: &'a PlainLinear,
        state: &'a GrainState<Discs>,
        pairs: &[PairKey<Discs>],
        rotations_free: bool,
    ) -> Self {
        let mut records = state.contacts.iter().peekable();
        let pairs = pairs
            .iter()
            .map(|key| {
                let radii = [model.radii[key.origin as usize], model.radii[key.end as usize]];
                while records.peek().is_some_and(|record| record.key() < *key) {
                    records.next();
                }
                let record = records.next_if(|record| record.key() == *key);
                let mut pair = StartPair {
                    key: *key,
                    constants: ContactLaw::<Discs>::constants(law, radii),
                    range: radii[0] + radii[1],
                    half_difference: 0.5 * (radii[0] - radii[1]),
                    direction: [0.0; 2],
                    touched: false,
                    tangential_force: 0.0,
                };
                if let Some(record) = record {
                    let (origin, end) = (state.positions[key.origin as usize], state.positions[key.end as usize]);
                    let branch = end.minus(origin).plus(state.cell.translation(key.shift));
                    let length = branch.norm();
                    if length < pair.range {
                        pair.direction = branch.times(1.0 / length);
                        pair.touched = true;
                        pair.tangential_force = record.tangential_force;
                    }
                }
                pair
            })
            .collect();
        Self { state, law, radii: &model.radii, rotations_free, pairs }
    }

    /// Keys of the near pairs.
    pub(super) fn keys(&self) -> impl Iterator<Item = PairKey<Discs>> {
        self.pairs.iter().map(|pair| pair.key)
    }

    /// The contacts after the stretch `I + strain` and `motion`.
    pub(super) fn evaluate(&self, strain: &[[f64; 2]; 2], motion: &[Motion]) -> Evaluation {
        let stretch = add_scaled(&[[1.0, 0.0], [0.0, 1.0]], 1.0, strain);
        let cell = self.state.cell.deformed(&stretch);
        let moved = |(position, motion): (&[f64; 2], &Motion)| {
            position.plus(apply(strain, *position).plus([motion[0], motion[1]]))
        };
        let positions: Vec<[f64; 2]> = self.state.positions.iter().zip(motion).map(moved).collect();
        let mut loads = vec![[0.0; 3]; positions.len()];
        let mut sums = StepSums::<f64>::default();
        let pairs = self.pairs.iter().map(|pair| {
            let (origin, end) = (pair.key.origin as usize, pair.key.end as usize);
            let branch = positions[end].minus(positions[origin]).plus(cell.translation(pair.key.shift));
            let length = branch.norm();
            let overlap = pair.range - length;
            let mut now = PairNow {
                branch,
                length,
                touches: overlap > 0.0,
                normal_force: 0.0,
                tangential_force: 0.0,
                slides: false,
            };
            if !now.touches {
                if pair.touched {
                    sums.opening_loss +=
                        ContactLaw::<Discs>::opening_loss(self.law, &pair.constants, [pair.tangential_force], &[]);
                }
                return now;
            }
            let direction = branch.times(1.0 / length);
            let arms = [0.5 * length + pair.half_difference, 0.5 * length - pair.half_difference];
            let spins = [motion[origin][2] / self.radii[origin], motion[end][2] / self.radii[end]];
            let mut slip = [0.0];
            if pair.touched {
                (slip, ()) = Discs::slip(pair.direction, direction, length, arms, spins);
            }
            let contact_motion = ContactMotion::<Discs, f64> {
                overlap,
                touched: pair.touched,
                carried: [pair.tangential_force],
                slip,
                rolling: [0.0],
            };
            let response = self.law.respond(&pair.constants, &contact_motion, &mut []);
            let [tangential] = response.tangential_force;
            now.normal_force = response.normal_force;
            now.tangential_force = tangential;
            let [_, stiffness, _] = ContactLaw::<Discs>::stiffness(self.law, &pair.constants, overlap);
            now.slides = pair.touched && tangential.abs() < (pair.tangential_force + slip[0] * stiffness).abs();
            let force = Discs::contact_force(direction, now.normal_force, tangential);
            for (grain, sign, arm) in [(origin, 1.0, arms[0]), (end, -1.0, arms[1])] {
                let load = &mut loads[grain];
                load[0] += sign * force[0];
                load[1] += sign * force[1];
                load[2] += tangential * arm / self.radii[grain];
            }
            sums.contacts += 1.0;
            sums.normal_force += now.normal_force.abs();
            sums.contact_force_square += now.normal_force * now.normal_force + tangential * tangential;
            sums.dissipation += response.dissipation;
            now
        });
        let pairs = pairs.collect();
        for load in &mut loads {
            if !self.rotations_free {
                load[2] = 0.0;
            }
            let force = load[0] * load[0] + load[1] * load[1];
            sums.largest_force_square = sums.largest_force_square.max(force).max(load[2] * load[2]);
            sums.force_square += force + load[2] * load[2];
        }
        Evaluation { cell, positions, pairs, loads, sums }
    }

    /// Pushes every loose grain that is out of balance by more than `threshold`, N, away from what it touches, and a little
    /// farther. A grain is loose if none of its contacts presses with more than `weak`, N. Returns whether any was moved.
    ///
    /// Statics does not say where such a grain is. That it carried nothing shows afterwards: the forces on the grains round it
    /// must be in balance without it.
    pub(super) fn free_loose_grains(
        &self,
        evaluation: &Evaluation,
        motion: &mut [Motion],
        weak: f64,
        threshold: f64,
    ) -> bool {
        let mut strongest = vec![0.0_f64; motion.len()];
        let touching = || self.pairs.iter().zip(&evaluation.pairs).filter(|(_, now)| now.touches);
        for (pair, now) in touching() {
            for grain in [pair.key.origin as usize, pair.key.end as usize] {
                strongest[grain] = strongest[grain].max(now.normal_force.abs());
            }
        }
        let is_moved: Vec<bool> = strongest
            .iter()
            .zip(&evaluation.loads)
            .map(|(strongest, [x, y, turn])| *strongest <= weak && x.hypot(*y).max(turn.abs()) > threshold)
            .collect();
        for (pair, now) in touching() {
            let grains = [pair.key.origin as usize, pair.key.end as usize];
            let shared = if is_moved[grains[0]] && is_moved[grains[1]] { 0.5 } else { 1.0 };
            let way = shared * (pair.range * (1.0 + FREE_GAP) - now.length) / now.length;
            for (grain, sign) in grains.into_iter().zip([-1.0, 1.0]) {
                if is_moved[grain] {
                    motion[grain][0] += sign * way * now.branch[0];
                    motion[grain][1] += sign * way * now.branch[1];
                }
            }
        }
        is_moved.contains(&true)
    }

    /// The near pairs of an evaluation, for the linear equations. Open pairs are among them, so that the order of
    /// elimination holds for as long as the list does.
    pub(super) fn linear_pairs(&self, evaluation: &Evaluation) -> Vec<DiscPair> {
        let linear = |(pair, now): (&StartPair, &PairNow)| {
            let [normal, tangential, _] =
                ContactLaw::<Discs>::stiffness(self.law, &pair.constants, pair.range - now.length);
            DiscPair {
                origin: pair.key.origin as usize,
                end: pair.key.end as usize,
                touches: now.touches,
                branch: now.branch,
                length: now.length,
                stiffness: [normal, tangential],
                normal_force: now.normal_force,
                tangential_force: now.tangential_force,
                slides: now.slides,
            }
        };
        self.pairs.iter().zip(&evaluation.pairs).map(linear).collect()
    }
}
