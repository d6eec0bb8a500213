//! Grains and contacts of one cell in and out of the lanes that several share.

use crate::contact::ContactLaw;
use crate::simd::{Real, Tuple, take_lane};
use crate::solver::kernel::{Contact, Grain};
use crate::space::KernelSpace;

/// Sets one lane of a tuple.
pub(super) fn set_lane<R: Real, T: Tuple<R>>(tuple: &mut T, lane: usize, components: &[f64]) {
    for (value, component) in tuple.as_mut().iter_mut().zip(components) {
        value.set_lane(lane, *component);
    }
}

/// One lane of a vector.
pub(super) fn vector_of<K: KernelSpace, R: Real>(vector: &K::Coordinates<R>, lane: usize) -> K::Coordinates<f64> {
    take_lane(vector, lane)
}

/// Branch vector of a pair and its length, m, with the operations of the kernel.
pub(crate) fn branch_of<K: KernelSpace>(
    origin: K::Coordinates<f64>,
    end: K::Coordinates<f64>,
    image: K::Coordinates<f64>,
) -> (K::Coordinates<f64>, f64) {
    let branch = end.minus(origin).plus(image);
    (branch, branch.dot(branch).sqrt())
}

impl<K: KernelSpace, R: Real> Grain<K, R> {
    /// A grain at the origin without motion or load.
    pub(crate) fn empty() -> Self {
        Self::at_rest(Tuple::zero())
    }

    /// A grain without motion or load.
    pub(crate) fn at_rest(position: K::Coordinates<R>) -> Self {
        Self {
            position,
            velocity: Tuple::zero(),
            spin: Tuple::zero(),
            turned: Tuple::zero(),
            force: Tuple::zero(),
            moment: Tuple::zero(),
        }
    }

    /// One lane.
    pub(super) fn lane(&self, lane: usize) -> Grain<K, f64> {
        Grain {
            position: take_lane(&self.position, lane),
            velocity: take_lane(&self.velocity, lane),
            spin: take_lane(&self.spin, lane),
            turned: take_lane(&self.turned, lane),
            force: take_lane(&self.force, lane),
            moment: take_lane(&self.moment, lane),
        }
    }

    /// Replaces one lane.
    pub(super) fn set_lane(&mut self, lane: usize, given: &Grain<K, f64>) {
        set_lane(&mut self.position, lane, given.position.as_ref());
        set_lane(&mut self.velocity, lane, given.velocity.as_ref());
        set_lane(&mut self.spin, lane, given.spin.as_ref());
        set_lane(&mut self.turned, lane, given.turned.as_ref());
        set_lane(&mut self.force, lane, given.force.as_ref());
        set_lane(&mut self.moment, lane, given.moment.as_ref());
    }
}

impl<K: KernelSpace, C: ContactLaw<K>, R: Real> Contact<K, C, R> {
    /// One lane.
    pub(super) fn lane(&self, lane: usize) -> Contact<K, C, f64> {
        Contact {
            direction: take_lane(&self.direction, lane),
            tangential_force: take_lane(&self.tangential_force, lane),
            memory: take_lane(&self.memory, lane),
        }
    }

    /// Replaces one lane.
    pub(super) fn set_lane(&mut self, lane: usize, given: &Contact<K, C, f64>) {
        set_lane(&mut self.direction, lane, given.direction.as_ref());
        set_lane(&mut self.tangential_force, lane, given.tangential_force.as_ref());
        set_lane(&mut self.memory, lane, given.memory.as_ref());
    }
}

impl<K: KernelSpace, C: ContactLaw<K>> Contact<K, C, f64> {
    /// Whether the pair touched at the last evaluation.
    pub(crate) fn touches(&self) -> bool {
        self.direction != Tuple::zero()
    }
}
