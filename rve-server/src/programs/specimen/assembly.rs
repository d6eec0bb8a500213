//! From a periodic packing to the grains of a specimen.
//!
//! Nothing is moved against its neighbours: grains keep the places, contacts inside the specimen keep the tangential
//! forces and rolling moments that they have in the packing. What walls cut through is left out and counted.

use super::SpecimenSpace;
use super::contact::Grain;
use super::test_file::Cut;
use crate::cell::{Cell, ContactRecord, PairKey};
use crate::definition::{MOST_GRAINS, PackingError, PackingFile};
use crate::programs::frame::geometry::FrameGeometry;
use crate::simd::Tuple;
use crate::space::{Axial, Components, Discs, Space, Tensor};
use std::collections::BTreeMap;

/// Slant of a cell, or part of a cell vector along an axis where it has none, that is taken for rounding.
const UPRIGHT: f64 = 1e-9;

/// History of a contact of the packing, between two grains of the specimen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct History<S: Space> {
    /// The pair in the specimen with the tangential force on its origin grain, N.
    pub contact: ContactRecord<S>,
    /// Rolling moment on the origin grain, N m.
    pub moment: S::Spin,
}

/// Grains at rest and the box that they fill.
#[derive(Clone, Debug, PartialEq)]
pub struct Assembled<S: SpecimenSpace> {
    /// Grains.
    pub grains: Vec<Grain<S>>,
    /// Lower corner of the box, m: the origin for tiles, the centre of the first corner grain for frames.
    pub corner: [f64; 3],
    /// Side lengths of the box, m.
    pub sides: [f64; 3],
    /// Translations to the next image along the periodic axes, m.
    pub periods: [Option<S::Vector>; 3],
    /// Contacts of the packing that lie inside.
    pub histories: Vec<History<S>>,
    /// Listed contacts, of all copies, that the walls cut through.
    pub cut_through: usize,
    /// Largest slant of the copies against the walls, displacement over height; 0 where grains fill the box upright.
    pub slant: f64,
}

impl<S: SpecimenSpace> History<S> {
    /// Tangential force and rolling moment as axial vectors for a contact along `branch`.
    pub(super) fn axial(&self, branch: S::Coordinates<f64>) -> [S::Axial<f64>; 2] {
        let direction = branch.scaled(1.0 / branch.dot(branch).sqrt());
        let direction = S::Vector::from_fn(|axis| direction.as_ref()[axis]);
        let force: Axial<S> = S::to_axial(self.contact.tangential_force, direction);
        [force, S::axial(self.moment)]
    }
}

/// The packing after a homogeneous shear that makes periodic axes upright where they lean along walled ones. Contacts keep their
/// tangential forces.
pub fn straightened<S: SpecimenSpace>(packing: &PackingFile<S>, periodic: [bool; 3]) -> PackingFile<S> {
    let mut upright = packing.clone();
    for i in (0..S::DIMENSION).filter(|axis| periodic[*axis]) {
        for j in (0..i).filter(|axis| !periodic[*axis]) {
            let lean = upright.periodicity[i][j] / upright.periodicity[i][i];
            for row in 0..S::DIMENSION {
                upright.periodicity[row][j] -= lean * upright.periodicity[row][i];
            }
            upright.periodicity[i][j] = 0.0;
            for grain in &mut upright.grains {
                grain[j] -= lean * grain[i];
            }
        }
    }
    upright
}

/// Repeats a packing as whole tiles from the origin on. A skewed cell stays as it is: the copies tile the plane, or space,
/// and the specimen is the upright box `tiles` cells wide, which holds every grain of every copy once because Y1 points
/// along x and Y2 lies in the plane of x and y.
///
/// # Errors
/// A cell whose vectors do not lie so, or a periodic axis that leans against a wall.
pub fn tiled<S: SpecimenSpace>(
    packing: &PackingFile<S>,
    tiles: &[usize],
    periodic: [bool; 3],
) -> Result<Assembled<S>, PackingError> {
    let rows = &packing.periodicity;
    let axes = || (0..S::DIMENSION).flat_map(|i| (0..S::DIMENSION).map(move |j| (i, j)));
    let part = |(i, j): (usize, usize)| (rows[i][j] / rows[i][i]).abs();
    if let Some((i, j)) = axes().find(|(i, j)| j > i && part((*i, *j)) > UPRIGHT) {
        return Err(PackingError::Content(format!(
            "the packing's vector Y{} has a part of {:.2e} of itself along {}; a specimen needs Y1 along x and Y2 in the plane of \
             x and y, as `grainspan pack` writes them",
            i + 1,
            part((i, j)),
            ["x", "y", "z"][j]
        )));
    }
    if let Some((i, j)) = axes().find(|(i, j)| j < i && periodic[*i] && !periodic[*j] && part((*i, *j)) > UPRIGHT) {
        return Err(PackingError::Content(format!(
            "the packing's vector Y{} leans by {:.4} along {}, where this specimen has walls: make {} periodic as well, or \
             neither, set straighten = true, or use a packing whose cell is upright",
            i + 1,
            part((i, j)),
            ["x", "y", "z"][j],
            ["x", "y", "z"][j]
        )));
    }
    let counts: [usize; 3] = std::array::from_fn(|axis| tiles.get(axis).copied().unwrap_or(1));
    let sides: [f64; 3] =
        std::array::from_fn(|axis| if axis < S::DIMENSION { rows[axis][axis] * counts[axis] as f64 } else { 1.0 });
    let cell = Cell::<S> { rows: packing.periodicity };
    let whole = Cell::<S> { rows: S::Tensor::from_fn(|i, j| rows[i][j] * counts[i] as f64) };
    let tile_of =
        |number: usize| [number % counts[0], number / counts[0] % counts[1], number / (counts[0] * counts[1])];
    let number = expect_count(tiles, packing.grains.len())?;
    let mut grains = Vec::with_capacity(number);
    // By how many whole boxes each grain was moved to lie in the upright one.
    let mut moved: Vec<[i32; 3]> = Vec::with_capacity(grains.capacity());
    for number in 0..counts.iter().product() {
        let tile = tile_of(number);
        let offset = cell.translation(S::shift(|axis| tile[axis] as i32));
        for grain in &packing.grains {
            let mut place = Components::plus(S::centre(grain), offset);
            let mut boxes = [0; 3];
            for axis in (0..S::DIMENSION).rev() {
                boxes[axis] = -(place[axis] / sides[axis]).floor() as i32;
                let by = S::shift(|other| if other == axis { boxes[axis] } else { 0 });
                place = Components::plus(place, whole.translation(by));
            }
            grains.push(still(<S::Coordinates<f64>>::build(|axis| place[axis]), S::radius(grain)));
            moved.push(boxes);
        }
    }
    let periods = std::array::from_fn(|axis| periodic[axis].then(|| S::Vector::from_fn(|j| whole.rows[axis][j])));
    let mut assembled =
        Assembled { grains, corner: [0.0; 3], sides, periods, histories: Vec::new(), cut_through: 0, slant: 0.0 };
    let per_tile = packing.grains.len();
    for number in 0..counts.iter().product() {
        let tile = tile_of(number);
        for (contact, moment) in packing.histories() {
            let mut far = [0usize; 3];
            let mut boxes = [0i32; 3];
            for axis in 0..S::DIMENSION {
                let place = tile[axis] as i32 + contact.shift[axis];
                far[axis] = place.rem_euclid(counts[axis] as i32) as usize;
                boxes[axis] = place.div_euclid(counts[axis] as i32);
            }
            let origin = number * per_tile + contact.origin as usize;
            let end = (far[0] + counts[0] * (far[1] + counts[1] * far[2])) * per_tile + contact.end as usize;
            let across = |axis: usize| boxes[axis] + moved[origin][axis] - moved[end][axis];
            if (0..S::DIMENSION).any(|axis| !periodic[axis] && across(axis) != 0) {
                assembled.cut_through += 1;
                continue;
            }
            assembled.keep(origin, end, S::shift(across), &contact, moment);
        }
    }
    Ok(assembled)
}

/// Number of grains in all tiles with `per_copy` grains in each; too large a number is refused before a grain takes memory.
///
/// # Errors
/// They are more than a specimen may have.
fn expect_count(tiles: &[usize], per_copy: usize) -> Result<usize, PackingError> {
    let number = tiles.iter().try_fold(per_copy, |product, count| product.checked_mul(*count));
    number.filter(|number| *number <= MOST_GRAINS).ok_or_else(|| {
        PackingError::Content(format!(
            "tiles = {tiles:?} of a packing of {per_copy} grains are more than {MOST_GRAINS} grains; use fewer tiles"
        ))
    })
}

impl<S: SpecimenSpace> Assembled<S> {
    /// A contact of the packing between these two grains of the specimen.
    pub(super) fn keep(
        &mut self,
        origin: usize,
        end: usize,
        shift: S::Shift,
        listed: &ContactRecord<S>,
        moment: Option<S::Spin>,
    ) {
        let key = PairKey::<S>::canonical(origin as u32, end as u32, shift);
        let is_swapped = (key.origin as usize, key.shift) != (origin, shift);
        let tangential_force = S::seen_from(listed.tangential_force, is_swapped);
        let moment = moment.unwrap_or(S::Spin::ZERO).times(if is_swapped { -1.0 } else { 1.0 });
        let contact = ContactRecord { origin: key.origin, end: key.end, shift: key.shift, tangential_force };
        self.histories.push(History { contact, moment });
    }
}

/// Repeats the frame of a plane packing; grains that tiles have in common come once. Copies of a skewed cell lean against
/// the walls.
///
/// # Errors
/// A packing without a frame, or more grains than a specimen may have.
pub fn joined_frames(packing: &PackingFile<Discs>, tiles: &[usize]) -> Result<Assembled<Discs>, PackingError> {
    let frame = FrameGeometry::of(packing)?;
    // Each copy adds as many grains as a cell has, or more where it lies at the border.
    expect_count(tiles, packing.grains.len().max(frame.places.len()))?;
    let cell = Cell::<Discs> { rows: packing.periodicity };
    let mut places: BTreeMap<(i32, i32, u32), [f64; 2]> = BTreeMap::new();
    for tile in 0..tiles[0] * tiles[1] {
        let by = [(tile % tiles[0]) as i32, (tile / tiles[0]) as i32];
        let moved = cell.translation(by);
        for ((grain, shift), position) in frame.places.iter().zip(&frame.positions) {
            let key = (shift[1] + by[1], shift[0] + by[0], *grain);
            places.entry(key).or_insert([position[0] + moved[0], position[1] + moved[1]]);
        }
    }
    let grains = places
        .iter()
        .map(|((_, _, grain), position)| still::<Discs>(*position, Discs::radius(&packing.grains[*grain as usize])));
    let sides = [packing.periodicity[0][0] * tiles[0] as f64, packing.periodicity[1][1] * tiles[1] as f64, 1.0];
    let [first, second] = packing.periodicity;
    let [x, y] = frame.positions[frame.corners[0]];
    let mut assembled = Assembled {
        grains: grains.collect(),
        corner: [x, y, 0.0],
        sides,
        periods: [None; 3],
        histories: Vec::new(),
        cut_through: 0,
        slant: (first[1] / first[0]).abs().max((second[0] / second[1]).abs()),
    };
    let numbers: BTreeMap<(i32, i32, u32), usize> =
        places.keys().enumerate().map(|(number, place)| (*place, number)).collect();
    // Copies of each grain of the packing: shifts along Y2 and Y1, and number in the specimen.
    let mut copies = vec![Vec::new(); packing.grains.len()];
    for (&(up, right, grain), &number) in &numbers {
        copies[grain as usize].push((up, right, number));
    }
    for (contact, moment) in packing.histories() {
        for &(up, right, origin) in &copies[contact.origin as usize] {
            let far = (up + contact.shift[1], right + contact.shift[0], contact.end);
            match numbers.get(&far) {
                Some(&end) => assembled.keep(origin, end, [0, 0], &contact, moment),
                None => assembled.cut_through += 1,
            }
        }
    }
    Ok(assembled)
}

/// The specimen that a test asks for.
///
/// # Errors
/// A packing that does not suit.
pub fn assembled<S: SpecimenSpace + Joinable>(
    packing: &PackingFile<S>,
    tiles: &[usize],
    cut: Cut,
    periodic: [bool; 3],
) -> Result<Assembled<S>, PackingError> {
    match cut {
        Cut::Tiles => tiled(packing, tiles, periodic),
        Cut::Frames => S::joined(packing, tiles),
    }
}

/// Spaces whose packings may have frames.
pub trait Joinable: SpecimenSpace {
    /// See [`joined_frames`].
    ///
    /// # Errors
    /// A packing without a frame, or a space that has none.
    fn joined(packing: &PackingFile<Self>, tiles: &[usize]) -> Result<Assembled<Self>, PackingError>;
}

impl Joinable for Discs {
    fn joined(packing: &PackingFile<Self>, tiles: &[usize]) -> Result<Assembled<Self>, PackingError> {
        joined_frames(packing, tiles)
    }
}

impl Joinable for crate::space::Spheres {
    fn joined(_: &PackingFile<Self>, _: &[usize]) -> Result<Assembled<Self>, PackingError> {
        Err(PackingError::Content("cut = \"frames\" is for plane packings".into()))
    }
}

fn still<S: SpecimenSpace>(position: S::Coordinates<f64>, radius: f64) -> Grain<S> {
    Grain { position, velocity: Tuple::zero(), spin: Tuple::zero(), radius }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn more_tiles_than_memory_could_hold_are_refused_at_once() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let packing = PackingFile::<Discs>::read(&file).unwrap();
        for cut in [Cut::Tiles, Cut::Frames] {
            let refused = assembled(&packing, &[2000, 1000], cut, [false; 3]).unwrap_err().to_string();
            assert!(refused.contains("more than 100000000 grains; use fewer tiles"), "{refused}");
        }
    }
}
