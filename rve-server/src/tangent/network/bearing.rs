//! Which grains carry load, and which of their displacements must be held for a unique answer.
//!
//! Rattlers, and in space chains of grains that buckle freely, are removed first: [`rattlers`](crate::homogenization::rattlers). Chains do
//! not buckle under tension, where rolling springs hold them, or where grains do not turn and their contacts resist slip.
//! In space a single grain with two contacts is a strut that can only spin about the line through its contact points, and
//! that spin is held unless a rolling spring does so. The remaining grains fall into clusters linked by contacts. The periodic fluctuation of each cluster is free up to a
//! translation, which is pinned at its first grain. A cluster that meets none of its own images can also turn as a
//! whole; then the spins of that grain are pinned too. All pins choose one of many equal answers and change no contact
//! force.

use crate::homogenization::rattlers::{LoadBearing, Pruned};
use crate::tangent::link::LinkedGrains;
use crate::tangent::sliding::ContactStiffness;

/// The load-carrying part of a network, its grains renumbered in the network's order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BearingNetwork<const D: usize, const B: usize> {
    /// Contacts kept: index in the network, new numbers of origin and end grain.
    pub contacts: Vec<BearingContact>,
    /// Number in the network of each kept grain.
    pub grains: Vec<usize>,
    /// Radius of each kept grain, m: the length that turns its spin into a displacement.
    pub radii: Vec<f64>,
    /// Whether displacements and spins of each kept grain are held at zero.
    pub pinned: Vec<[bool; B]>,
    /// Struts and the direction of the spin that holds nothing.
    pub struts: Vec<(usize, [f64; D])>,
    /// Whether a spin is held although forces act on it: all contacts of the grain slide.
    pub spin_held_against_load: bool,
}

/// One load-bearing contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BearingContact {
    /// Position in [`LinkedGrains::links`].
    pub index: usize,
    /// New number of the origin grain.
    pub origin: usize,
    /// New number of the end grain.
    pub end: usize,
}

/// Square of the sine between the line of a strut and the normal of a rolling spring up to which that does not hold the strut.
const HARDLY_ACROSS: f64 = 1e-6;

impl<const D: usize, const B: usize> BearingNetwork<D, B> {
    /// Prunes `network` and finds the pins; `stiffness` belongs to the network's contacts.
    pub(super) fn of(network: &LinkedGrains<D>, stiffness: &[ContactStiffness<D>]) -> Self {
        let kept = load_bearing_contacts(network, stiffness);
        let mut number = vec![usize::MAX; network.radii.len()];
        for &index in &kept {
            number[network.links[index].origin] = 0;
            number[network.links[index].end] = 0;
        }
        let mut grains = Vec::new();
        for (grain, place) in number.iter_mut().enumerate() {
            if *place == 0 {
                *place = grains.len();
                grains.push(grain);
            }
        }
        let contacts: Vec<BearingContact> = kept
            .iter()
            .map(|&index| {
                let link = &network.links[index];
                BearingContact { index, origin: number[link.origin], end: number[link.end] }
            })
            .collect();
        let mut bearing = Self {
            pinned: vec![[false; B]; grains.len()],
            radii: grains.iter().map(|&grain| network.radii[grain]).collect(),
            contacts,
            grains,
            struts: Vec::new(),
            spin_held_against_load: false,
        };
        bearing.pin_clusters(network);
        bearing.pin_spins(network, stiffness);
        if D == 3 && network.rotations_free {
            bearing.find_struts(network);
        }
        bearing
    }

    fn pin_clusters(&mut self, network: &LinkedGrains<D>) {
        let neighbours = Neighbours::of(self, network);
        // The image of each grain in which it was reached first; reaching another image closes a loop round the cell.
        let mut image: Vec<Option<[i32; D]>> = vec![None; self.radii.len()];
        let mut pending = Vec::new();
        for first in 0..self.radii.len() {
            if image[first].is_some() {
                continue;
            }
            image[first] = Some([0; D]);
            let mut meets_itself = false;
            pending.push((first, [0; D]));
            while let Some((grain, here)) = pending.pop() {
                for &(neighbour, shift) in neighbours.of_grain(grain) {
                    let there = std::array::from_fn(|axis| here[axis] + shift[axis]);
                    match image[neighbour] {
                        None => {
                            image[neighbour] = Some(there);
                            pending.push((neighbour, there));
                        }
                        Some(known) => meets_itself |= known != there,
                    }
                }
            }
            self.pinned[first] = std::array::from_fn(|unknown| unknown < D || !meets_itself);
        }
    }

    fn pin_spins(&mut self, network: &LinkedGrains<D>, stiffness: &[ContactStiffness<D>]) {
        let mut is_resisted = vec![false; self.radii.len()];
        let mut is_loaded = vec![false; self.radii.len()];
        for contact in &self.contacts {
            let law = &stiffness[contact.index];
            let resists = law.resists_slip() || network.links[contact.index].rolling_stiffness > 0.0;
            let loads = law.coupling != [0.0; D] || network.links[contact.index].tangential_force != [0.0; D];
            for grain in [contact.origin, contact.end] {
                is_resisted[grain] |= resists;
                is_loaded[grain] |= loads;
            }
        }
        for grain in 0..self.radii.len() {
            if !network.rotations_free || !is_resisted[grain] {
                self.pinned[grain][D..].fill(true);
                self.spin_held_against_load |= network.rotations_free && is_loaded[grain];
            }
        }
    }

    fn find_struts(&mut self, network: &LinkedGrains<D>) {
        let mut points: Vec<Vec<[f64; D]>> = vec![Vec::new(); self.radii.len()];
        // Normals of contacts whose rolling springs hold a spin, but for its part along the normal.
        let mut held: Vec<Vec<[f64; D]>> = vec![Vec::new(); self.radii.len()];
        for contact in &self.contacts {
            let link = &network.links[contact.index];
            for (grain, reach) in [(contact.origin, link.arms[0]), (contact.end, -link.arms[1])] {
                if points[grain].len() < 3 {
                    points[grain].push(link.normal.map(|component| reach * component));
                    if link.rolling_stiffness > 0.0 {
                        held[grain].push(link.normal);
                    }
                }
            }
        }
        for (grain, points) in points.iter().enumerate() {
            if let [first, second] = points[..] {
                let line: [f64; D] = std::array::from_fn(|axis| second[axis] - first[axis]);
                let length = line.iter().map(|component| component * component).sum::<f64>().sqrt();
                let line = line.map(|component| component / length);
                let across =
                    |normal: &[f64; D]| 1.0 - (0..D).map(|axis| normal[axis] * line[axis]).sum::<f64>().powi(2);
                if held[grain].iter().all(|normal| across(normal) < HARDLY_ACROSS) {
                    self.struts.push((grain, line));
                }
            }
        }
    }
}

/// Neighbours of each grain with the cell shift that leads to them.
struct Neighbours<const D: usize> {
    starts: Vec<usize>,
    entries: Vec<(usize, [i32; D])>,
}

impl<const D: usize> Neighbours<D> {
    fn of<const B: usize>(bearing: &BearingNetwork<D, B>, network: &LinkedGrains<D>) -> Self {
        let mut starts = vec![0; bearing.radii.len() + 1];
        for contact in &bearing.contacts {
            starts[contact.origin + 1] += 1;
            starts[contact.end + 1] += 1;
        }
        for grain in 0..bearing.radii.len() {
            starts[grain + 1] += starts[grain];
        }
        let mut next = starts.clone();
        let mut entries = vec![(0, [0; D]); 2 * bearing.contacts.len()];
        for contact in &bearing.contacts {
            let shift = network.links[contact.index].shift;
            let ends =
                [(contact.origin, contact.end, shift), (contact.end, contact.origin, shift.map(|count: i32| -count))];
            for (grain, neighbour, shift) in ends {
                entries[next[grain]] = (neighbour, shift);
                next[grain] += 1;
            }
        }
        Self { starts, entries }
    }

    fn of_grain(&self, grain: usize) -> &[(usize, [i32; D])] {
        &self.entries[self.starts[grain]..self.starts[grain + 1]]
    }
}

/// Tension of a contact over the mean force from which on it holds a chain straight.
const HOLDING_TENSION: f64 = 1e-3;

/// Numbers of the contacts that bear load.
fn load_bearing_contacts<const D: usize>(network: &LinkedGrains<D>, stiffness: &[ContactStiffness<D>]) -> Vec<usize> {
    let forces = network.links.iter().map(|link| link.normal_force.abs()).sum::<f64>();
    let tension = HOLDING_TENSION * forces / network.links.len().max(1) as f64;
    let bearing = |index: usize| {
        let link = &network.links[index];
        if link.rolling_stiffness > 0.0 {
            return LoadBearing::AndHolds;
        }
        let is_pulled = tension > 0.0 && link.normal_force > tension;
        let is_blocked = !network.rotations_free && stiffness[index].resists_slip();
        // A grain that meets its own image is no chain: its place is given by the cell.
        let is_straight = D == 2 || is_pulled || is_blocked || link.origin == link.end;
        if is_straight { LoadBearing::WithoutRattlers } else { LoadBearing::WithoutRattlersAndChains }
    };
    let ends = network.links.iter().map(|link| [link.origin, link.end]);
    let Pruned { kept, .. } = Pruned::of(network.radii.len(), ends, bearing);
    (0..kept.len()).filter(|&index| kept[index]).collect()
}
