//! Which grains bound a frame, and their area vectors.
//!
//! [Liu2018] works on a square whose border is a chain of grains, opposite grains alike. Any periodic packing holds such
//! frames: a chain of neighbouring grains from a grain to its image along Y1, another one along Y2, and the images of both
//! chains enclose one period. The enclosed area is that of the periodic cell, opposite grains are images of each other
//! and therefore alike, which is what makes `(1/V) sum X_q x A_q` the unit tensor to rounding.
//!
//! Copies of such a frame side by side have their boundary grains in common. The outer ones bound all copies together and are a frame
//! again: the simulations of all grains of [Liu2018] section 4.2.

use crate::cell::Cell;
use crate::definition::{PackingError, PackingFile};
use crate::space::Discs;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

/// Grains count as neighbours in a chain up to this gap between their surfaces, in mean radii.
const CHAIN_GAP: f64 = 0.8;

/// How dear it is for a chain to leave the straight line, per squared distance in mean radii.
const DETOUR: f64 = 0.5;

/// Corner grains tried.
const MOST_CORNERS: usize = 40;

/// A place in the periodic packing: grain and cell shift.
type Place = (u32, [i32; 2]);

/// Bits of the sides of a frame.
pub const BOTTOM: u8 = 1;
/// See [`BOTTOM`].
pub const RIGHT: u8 = 2;
/// See [`BOTTOM`].
pub const TOP: u8 = 4;
/// See [`BOTTOM`].
pub const LEFT: u8 = 8;

/// A frame cut out of a periodic packing. Boundary grains come first, counter-clockwise from the first corner; the four
/// corners are images of one grain.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameGeometry {
    /// Grain of the packing and its cell shift for every grain of the frame.
    pub places: Vec<(u32, [i32; 2])>,
    /// Centres, m.
    pub positions: Vec<[f64; 2]>,
    /// Radii, m.
    pub radii: Vec<f64>,
    /// Number of boundary grains Q.
    pub boundary: usize,
    /// Area vectors of the boundary grains per unit of thickness, m, outward.
    pub areas: Vec<[f64; 2]>,
    /// Area enclosed by the centres of the boundary grains, m2.
    pub area: f64,
    /// Numbers of the corner grains: at the origin and, for n by m copies, at n Y1, n Y1 + m Y2, m Y2.
    pub corners: [usize; 4],
    /// Opposite edge grains, `[minus, plus]`; plus is the image of minus by n Y1 or m Y2.
    pub pairs: Vec<[usize; 2]>,
    /// Bits of the sides that a grain lies on: [`BOTTOM`], [`RIGHT`], [`TOP`], [`LEFT`]; 0 inside.
    pub sides: Vec<u8>,
    /// For every grain the number, below `distinct`, of the one that it is an image of.
    pub images_of: Vec<usize>,
    /// Number of grains in all copies that are no images of each other.
    pub distinct: usize,
}

impl FrameGeometry {
    /// Numbers of the grains that are no images of each other: of images the first.
    pub(super) fn distinct_places(&self) -> impl Iterator<Item = usize> + '_ {
        let mut seen = vec![false; self.distinct];
        let mut is_first = move |original: usize| !std::mem::replace(&mut seen[original], true);
        (0..self.images_of.len()).filter(move |place| is_first(self.images_of[*place]))
    }

    /// Cuts a frame out of a packing.
    ///
    /// # Errors
    /// [`PackingError::Content`] if the grains form no closed chains, as in very small packings.
    pub fn of(packing: &PackingFile<Discs>) -> Result<Self, PackingError> {
        Self::tiled(packing, [1, 1])
    }

    /// The frame around `tiles` copies along Y1 and Y2, each of them the frame that [`FrameGeometry::of`] cuts out.
    ///
    /// # Errors
    /// As [`FrameGeometry::of`].
    pub fn tiled(packing: &PackingFile<Discs>, tiles: [u32; 2]) -> Result<Self, PackingError> {
        let cell = Cell::<Discs> { rows: packing.periodicity };
        let neighbours = Neighbours::of(packing, &cell);
        let mut order: Vec<usize> = (0..packing.grains.len()).collect();
        let distance = |grain: &usize| {
            let [x, y, _] = packing.grains[*grain];
            x * x + y * y
        };
        order.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        order
            .into_iter()
            .take(MOST_CORNERS)
            .find_map(|corner| Self::around(packing, &cell, &neighbours, corner as u32, tiles))
            .ok_or_else(|| {
                PackingError::Content(
                    "no closed chains of grains bound one period of this packing; use more grains or a denser packing"
                        .into(),
                )
            })
    }

    fn around(
        packing: &PackingFile<Discs>,
        cell: &Cell<Discs>,
        neighbours: &Neighbours,
        corner: u32,
        tiles: [u32; 2],
    ) -> Option<Self> {
        let [across, up] = tiles.map(|count| count as i32);
        let bottom = neighbours.chain(corner, [1, 0], &BTreeSet::new())?;
        let taken: BTreeSet<u32> = bottom.iter().map(|place| place.0).collect();
        let left = neighbours.chain(corner, [0, 1], &taken)?;
        let moved = |place: &Place, by: [i32; 2]| (place.0, [place.1[0] + by[0], place.1[1] + by[1]]);
        let bottom = repeated(&bottom, across, |copy| [copy, 0]);
        let left = repeated(&left, up, |copy| [0, copy]);
        // Counter-clockwise: bottom to the right, right up, top to the left, left down. Each without its last corner.
        let mut places: Vec<Place> = Vec::new();
        let mut sides = Vec::new();
        let legs: [(Vec<Place>, u8); 4] = [
            (bottom.clone(), BOTTOM),
            (left.iter().map(|place| moved(place, [across, 0])).collect(), RIGHT),
            (bottom.iter().rev().map(|place| moved(place, [0, up])).collect(), TOP),
            (left.iter().rev().copied().collect(), LEFT),
        ];
        let mut corners = [0; 4];
        for (number, (leg, side)) in legs.iter().enumerate() {
            corners[number] = places.len();
            for (step, place) in leg[..leg.len() - 1].iter().enumerate() {
                let before = if number == 0 { LEFT } else { legs[number - 1].1 };
                sides.push(if step == 0 { side | before } else { *side });
                places.push(*place);
            }
        }
        let boundary = places.len();
        let position = |place: &Place| {
            let [x, y, _] = packing.grains[place.0 as usize];
            let shift = cell.translation(place.1);
            [x + shift[0], y + shift[1]]
        };
        let outline: Vec<[f64; 2]> = places.iter().map(position).collect();
        let area = enclosed_area(&outline);
        if (area / (cell.measure() * f64::from(across * up)) - 1.0).abs() > 1e-9 || crosses_itself(&outline) {
            return None;
        }
        let grains = packing.grains.len();
        let on_boundary: BTreeSet<usize> = places.iter().map(|place| image_of(place, grains, tiles)).collect();
        let distinct = grains * (across * up) as usize;
        for number in (0..distinct).filter(|number| !on_boundary.contains(number)) {
            let (copy, grain) = ((number / grains) as i32, (number % grains) as u32);
            places.push(image_inside(&outline, &position, (grain, [copy % across, copy / across]), [across, up])?);
            sides.push(0);
        }
        let positions: Vec<[f64; 2]> = places.iter().map(position).collect();
        let radii: Vec<f64> = places.iter().map(|place| packing.grains[place.0 as usize][2]).collect();
        let areas = area_vectors(&positions[..boundary], &radii[..boundary]);
        let images_of: Vec<usize> = places.iter().map(|place| image_of(place, grains, tiles)).collect();
        let pairs = opposite(&places[..boundary], &images_of, &corners);
        Some(Self { places, positions, radii, boundary, areas, area, corners, pairs, sides, images_of, distinct })
    }
}

/// Area vectors, [Liu2018] eq. 3: each stretch of the outline is shared by its two grains in proportion to their radii.
fn area_vectors(outline: &[[f64; 2]], radii: &[f64]) -> Vec<[f64; 2]> {
    let count = outline.len();
    (0..count)
        .map(|q| {
            let (before, after) = ((q + count - 1) % count, (q + 1) % count);
            let first = radii[q] / (radii[q] + radii[before]);
            let second = radii[q] / (radii[q] + radii[after]);
            let from = [outline[q][0] - outline[before][0], outline[q][1] - outline[before][1]];
            let to = [outline[after][0] - outline[q][0], outline[after][1] - outline[q][1]];
            // The vector product with the unit vector out of the plane turns a tangent of the outline outward.
            [first * from[1] + second * to[1], -(first * from[0] + second * to[0])]
        })
        .collect()
}

/// A chain from a grain to its image, and its copies after it. Each begins where the one before ends.
fn repeated(chain: &[Place], copies: i32, shift: impl Fn(i32) -> [i32; 2]) -> Vec<Place> {
    let moved = |(grain, own): &Place, by: [i32; 2]| (*grain, [own[0] + by[0], own[1] + by[1]]);
    let begin = chain[..1].iter().copied();
    begin
        .chain(
            (0..copies)
                .flat_map(|copy| chain[1..].iter().map(move |place| (place, copy)))
                .map(|(place, copy)| moved(place, shift(copy))),
        )
        .collect()
}

/// Number of the grain that a place is an image of, over all copies: grains of the first copy first.
fn image_of((grain, shift): &Place, grains: usize, [across, up]: [u32; 2]) -> usize {
    let copy = |shift: i32, count: u32| shift.rem_euclid(count as i32) as usize;
    *grain as usize + grains * (copy(shift[0], across) + across as usize * copy(shift[1], up))
}

/// Opposite edge grains: images of one grain by the period of all copies.
fn opposite(places: &[Place], images_of: &[usize], corners: &[usize; 4]) -> Vec<[usize; 2]> {
    let mut first: BTreeMap<usize, usize> = BTreeMap::new();
    let mut pairs = Vec::new();
    for (index, place) in places.iter().enumerate().filter(|(index, _)| !corners.contains(index)) {
        match first.get(&images_of[index]) {
            None => {
                first.insert(images_of[index], index);
            }
            Some(&other) => {
                let is_plus = place.1 > places[other].1;
                pairs.push(if is_plus { [other, index] } else { [index, other] });
            }
        }
    }
    pairs
}

fn enclosed_area(outline: &[[f64; 2]]) -> f64 {
    let next = outline.iter().cycle().skip(1);
    0.5 * outline.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>()
}

fn crosses_itself(outline: &[[f64; 2]]) -> bool {
    let count = outline.len();
    let turn =
        |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0;
    (0..count).any(|i| {
        let (a, b) = (outline[i], outline[(i + 1) % count]);
        (i + 2..count).filter(|j| (j + 1) % count != i).any(|j| {
            let (c, d) = (outline[j], outline[(j + 1) % count]);
            turn(a, b, c) != turn(a, b, d) && turn(c, d, a) != turn(c, d, b)
        })
    })
}

fn is_inside(outline: &[[f64; 2]], point: [f64; 2]) -> bool {
    let next = outline.iter().cycle().skip(1);
    let crossings = outline.iter().zip(next).filter(|(a, b)| {
        (a[1] > point[1]) != (b[1] > point[1]) && point[0] < a[0] + (b[0] - a[0]) * (point[1] - a[1]) / (b[1] - a[1])
    });
    crossings.count() % 2 == 1
}

/// The one image of a grain, by the period of all copies, that lies inside.
fn image_inside(
    outline: &[[f64; 2]],
    position: &dyn Fn(&Place) -> [f64; 2],
    (grain, shift): Place,
    [across, up]: [i32; 2],
) -> Option<Place> {
    let image = |first: i32, second: i32| (grain, [shift[0] + first * across, shift[1] + second * up]);
    let mut images = (-2..=2).flat_map(|first| (-2..=2).map(move |second| image(first, second)));
    images.find(|place| is_inside(outline, position(place)))
}

/// Which grains are near which, in the periodic packing.
struct Neighbours {
    positions: Vec<[f64; 2]>,
    rows: [[f64; 2]; 2],
    mean_radius: f64,
    lists: Vec<Vec<Place>>,
}

impl Neighbours {
    fn of(packing: &PackingFile<Discs>, cell: &Cell<Discs>) -> Self {
        let positions: Vec<[f64; 2]> = packing.grains.iter().map(|grain| [grain[0], grain[1]]).collect();
        let radii: Vec<f64> = packing.grains.iter().map(|grain| grain[2]).collect();
        let mean_radius = radii.iter().sum::<f64>() / radii.len() as f64;
        let mut keys = Vec::new();
        let mut finder = crate::cell::PairFinder::<Discs>::default();
        finder.find(cell, positions.iter().copied(), &radii, CHAIN_GAP * mean_radius, &mut keys);
        let mut lists: Vec<Vec<Place>> = vec![Vec::new(); radii.len()];
        for key in keys {
            lists[key.origin as usize].push((key.end, key.shift));
            lists[key.end as usize].push((key.origin, key.shift.map(|step| -step)));
        }
        Self { positions, rows: cell.rows, mean_radius, lists }
    }

    fn position(&self, place: &Place) -> [f64; 2] {
        let [first, second] = place.1.map(f64::from);
        let [x, y] = self.positions[place.0 as usize];
        let [a, b] = self.rows;
        [x + first * a[0] + second * b[0], y + first * a[1] + second * b[1]]
    }

    /// The chain from a grain to its image by `shift` that stays closest to the straight line, both ends included. No
    /// grain comes twice, and none of `avoided` but the ends.
    fn chain(&self, corner: u32, shift: [i32; 2], avoided: &BTreeSet<u32>) -> Option<Vec<Place>> {
        let (from, to) = ((corner, [0, 0]), (corner, shift));
        let start = self.position(&from);
        let along = {
            let end = self.position(&to);
            [end[0] - start[0], end[1] - start[1]]
        };
        let length = along[0].hypot(along[1]);
        let off_line = |place: &Place| {
            let x = self.position(place);
            ((x[0] - start[0]) * along[1] - (x[1] - start[1]) * along[0]) / (length * self.mean_radius)
        };
        // Dijkstra's search; costs of positive numbers keep their order as bit patterns.
        let mut best: BTreeMap<Place, (f64, Option<Place>)> = BTreeMap::from([(from, (0.0, None))]);
        let mut queue = BinaryHeap::from([Reverse((0u64, from))]);
        while let Some(Reverse((bits, place))) = queue.pop() {
            let cost = f64::from_bits(bits);
            if place == to {
                break;
            }
            if best[&place].0 < cost {
                continue;
            }
            for &(grain, step) in &self.lists[place.0 as usize] {
                let next = (grain, [place.1[0] + step[0], place.1[1] + step[1]]);
                let is_corner = grain == corner;
                if (is_corner && next != to) || (!is_corner && avoided.contains(&grain)) {
                    continue;
                }
                let (a, b) = (self.position(&place), self.position(&next));
                let off = off_line(&next);
                let way = (b[0] - a[0]).hypot(b[1] - a[1]) * (1.0 + DETOUR * off * off);
                let total = cost + way;
                if best.get(&next).is_none_or(|(known, _)| total < *known) {
                    best.insert(next, (total, Some(place)));
                    queue.push(Reverse((total.to_bits(), next)));
                }
            }
        }
        let mut chain = vec![to];
        while let Some(before) = best.get(chain.last()?)?.1 {
            chain.push(before);
        }
        chain.reverse();
        let distinct: BTreeSet<u32> = chain.iter().map(|place| place.0).collect();
        (distinct.len() + 1 == chain.len() && chain.len() > 2).then_some(chain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use claims::Claim;
    use std::path::Path;

    fn packing(name: &str) -> PackingFile<Discs> {
        PackingFile::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings").join(name)).unwrap()
    }

    /// `(1/V) sum x_q x A_q` for boundary centres `x_q`: the deformation gradient of the frame, [Liu2018] eq. 5.
    fn deformation_gradient(frame: &FrameGeometry, boundary: &[[f64; 2]]) -> [[f64; 2]; 2] {
        let mut sum = [[0.0; 2]; 2];
        for (position, area) in boundary.iter().zip(&frame.areas) {
            for (row, x) in sum.iter_mut().zip(position) {
                for (value, a) in row.iter_mut().zip(area) {
                    *value += x * a / frame.area;
                }
            }
        }
        sum
    }

    /// E-8: the area vectors close and give the unit tensor, at any deformation of the outline that is affine.
    #[test]
    fn area_vectors_close_and_measure_the_deformation() {
        for name in ["discs-100.json", "discs-400.json", "discs-400-dense.json"] {
            let packing = packing(name);
            let frame = FrameGeometry::of(&packing).unwrap();
            let side = frame.area.sqrt();
            let sum = frame.areas.iter().fold([0.0; 2], |sum, area| [sum[0] + area[0], sum[1] + area[1]]);
            for component in sum {
                let quantity = "sum of the area vectors of a frame over its side";
                Claim::of("E-8", quantity).error(component / side).within(1e-12);
            }
            let f = deformation_gradient(&frame, &frame.positions[..frame.boundary]);
            for (i, row) in f.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    let unit = if i == j { 1.0 } else { 0.0 };
                    let quantity = "unit tensor from the area vectors of a frame and its grains";
                    Claim::of("E-8", quantity).error(value - unit).within(1e-12);
                }
            }
        }
    }

    /// Copies share the grains between them: [Liu2018] has 441 and 1681 grains for 228. Contacts and area vectors are those of one frame.
    #[test]
    fn copies_side_by_side_have_their_boundaries_in_common() {
        let packing = packing("discs-liu2018.json");
        let one = FrameGeometry::of(&packing).unwrap();
        let corner_to_corner = |index: usize| one.corners[index + 1] - one.corners[index];
        let (along, up) = (corner_to_corner(0) + 1, corner_to_corner(1) + 1);
        for tiles in [[1, 2], [2, 4], [3, 1]] {
            let frame = FrameGeometry::tiled(&packing, tiles).unwrap();
            let [n, m] = tiles.map(|count| count as usize);
            let seams = (n - 1) * m * up + (m - 1) * n * along;
            assert_eq!(frame.places.len(), n * m * one.places.len() + (n - 1) * (m - 1) - seams, "{tiles:?}");
            assert_eq!(frame.boundary, 4 + 2 * frame.pairs.len());
            assert_eq!(frame.boundary, 2 * n * (along - 1) + 2 * m * (up - 1));
            assert!((frame.area / one.area / (n * m) as f64 - 1.0).abs() < 1e-12);
            let distinct: BTreeSet<usize> = frame.images_of.iter().copied().collect();
            assert_eq!((distinct.len(), distinct.last().copied()), (frame.distinct, Some(frame.distinct - 1)));
            let f = deformation_gradient(&frame, &frame.positions[..frame.boundary]);
            assert!((f[0][0] - 1.0).abs() < 1e-12 && (f[1][1] - 1.0).abs() < 1e-12 && f[0][1].abs() < 1e-12);
            for [minus, plus] in &frame.pairs {
                let away = [0, 1].map(|axis| frame.positions[*plus][axis] - frame.positions[*minus][axis]);
                let [y1, y2] = packing.periodicity;
                let is = |row: [f64; 2], count: usize| {
                    (0..2).all(|axis| (away[axis] - count as f64 * row[axis]).abs() < 1e-12 * frame.area.sqrt())
                };
                assert!(is(y1, n) || is(y2, m), "{away:?}");
            }
        }
    }

    #[test]
    fn a_frame_holds_one_period_and_the_copies_of_its_boundary() {
        let packing = packing("discs-400.json");
        let frame = FrameGeometry::of(&packing).unwrap();
        let (corners, edges) = (4, 2 * frame.pairs.len());
        assert_eq!(frame.boundary, corners + edges);
        assert_eq!(frame.places.len(), 400 + 3 + frame.pairs.len(), "corners come four times, edge grains twice");
        assert!((frame.area / Cell::<Discs> { rows: packing.periodicity }.measure() - 1.0).abs() < 1e-12);
        for [minus, plus] in &frame.pairs {
            assert_eq!(frame.radii[*minus], frame.radii[*plus]);
            assert!(frame.sides[*minus] & frame.sides[*plus] == 0);
        }
    }
}
