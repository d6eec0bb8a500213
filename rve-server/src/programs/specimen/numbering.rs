//! Numbers grains by position: neighbours in space become neighbours in memory, and a pair finds both of its grains in the caches. Packings
//! number their grains in no order at all.

use super::SpecimenSpace;
use super::assembly::Assembled;

/// Edge of the cubes that hold grains with numbers next to each other, in mean radii.
const EDGE: f64 = 4.0;

/// The same specimen with its grains numbered cube by cube: in rows along the shortest side, rows in layers, layers along the longest.
pub(super) fn numbered_by_position<S: SpecimenSpace>(assembled: Assembled<S>) -> Assembled<S> {
    let count = assembled.grains.len();
    let mean = assembled.grains.iter().map(|grain| grain.radius).sum::<f64>() / count.max(1) as f64;
    let mut axes: Vec<usize> = (0..S::DIMENSION).collect();
    axes.sort_by(|first, second| assembled.sides[*second].total_cmp(&assembled.sides[*first]));
    let cube = |grain: usize| -> Vec<i64> {
        let position = assembled.grains[grain].position;
        axes.iter().map(|axis| (position.as_ref()[*axis] / (EDGE * mean)).floor() as i64).collect()
    };
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_cached_key(|grain| (cube(*grain), *grain));
    let mut numbers = vec![0; count];
    for (number, grain) in order.iter().enumerate() {
        numbers[*grain] = number;
    }
    let grains = order.iter().map(|grain| assembled.grains[*grain]).collect();
    let Assembled { histories, .. } = assembled;
    let mut renumbered = Assembled { grains, histories: Vec::with_capacity(histories.len()), ..assembled };
    for history in &histories {
        let contact = &history.contact;
        let ends = [contact.origin, contact.end].map(|grain| numbers[grain as usize]);
        renumbered.keep(ends[0], ends[1], contact.shift, contact, Some(history.moment));
    }
    renumbered
}

#[cfg(test)]
mod tests {
    use super::super::assembly::{History, tiled};
    use super::*;
    use crate::definition::PackingFile;
    use crate::simd::Tuple;
    use crate::space::{Components, Spheres};
    use std::path::Path;

    /// A contact by its places: branch from origin to end grain without the whole periods, and force of the contact on the origin grain.
    fn seen(assembled: &Assembled<Spheres>, history: &History<Spheres>, from_end: bool) -> Vec<u64> {
        let contact = &history.contact;
        let [origin, end] = [contact.origin, contact.end].map(|grain| assembled.grains[grain as usize].position);
        let images = (0..3).fold([0.0; 3], |sum, axis| {
            let period = assembled.periods[axis].unwrap_or([0.0; 3]);
            Components::plus(sum, period.times(f64::from(contact.shift[axis])))
        });
        let branch = Tuple::plus(Tuple::minus(end, origin), images);
        let [force, moment] = history.axial(branch);
        let direction = branch.scaled(1.0 / Tuple::dot(branch, branch).sqrt());
        // Seen from the other grain, branch, force and moment on the grain named first turn round.
        let sign = if from_end { -1.0 } else { 1.0 };
        let force = <Spheres as crate::space::KernelSpace>::turn(force, direction).scaled(sign);
        let place = if from_end { end } else { origin };
        let near = |value: f64, unit: f64| (value / unit).round() as i64 as u64;
        let lengths = [place, branch.scaled(sign)].concat().into_iter().map(|value| near(value, 1e-12));
        lengths
            .chain(force.into_iter().map(|value| near(value, 1e-9)))
            .chain(moment.map(|m| near(sign * m, 1e-12)))
            .collect()
    }

    #[test]
    fn neighbours_get_numbers_near_each_other_and_contacts_stay_what_they_are() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/spheres-1000.json");
        let packing = PackingFile::<Spheres>::read(&file).unwrap();
        let before = tiled(&packing, &[4, 1, 1], [true; 3]).unwrap();
        let after = numbered_by_position(before.clone());
        let sorted = |assembled: &Assembled<Spheres>| {
            let mut places: Vec<_> = assembled.grains.iter().map(|grain| grain.position.map(f64::to_bits)).collect();
            places.sort_unstable();
            places
        };
        assert!(sorted(&after) == sorted(&before));
        assert!(after.histories.len() == before.histories.len() && !before.histories.is_empty());
        let contacts = |assembled: &Assembled<Spheres>| {
            let views = assembled.histories.iter().map(|history| {
                let mut both = [false, true].map(|from_end| seen(assembled, history, from_end));
                both.sort_unstable();
                both
            });
            let mut all: Vec<_> = views.collect();
            all.sort_unstable();
            all
        };
        assert!(contacts(&after) == contacts(&before));
        let mean_distance = |assembled: &Assembled<Spheres>| {
            let apart = |history: &History<Spheres>| f64::from(history.contact.origin.abs_diff(history.contact.end));
            assembled.histories.iter().map(apart).sum::<f64>() / assembled.histories.len() as f64
        };
        assert!(mean_distance(&after) < 0.4 * mean_distance(&before));
        assert!(numbered_by_position(after.clone()) == after, "numbered once, they stay");
    }
}
