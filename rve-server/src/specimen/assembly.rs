//! From a periodic packing to the grains of a specimen.

use super::SpecimenSpace;
use super::contact::Grain;
use super::test_file::Cut;
use crate::frame::FrameGeometry;
use crate::lanes::Tuple;
use crate::packing::PackingFile;
use crate::space::{Discs, Space};
use std::collections::BTreeMap;

/// Grains at rest and the box that they fill.
#[derive(Clone, Debug, PartialEq)]
pub struct Assembled<S: SpecimenSpace> {
    /// Grains.
    pub grains: Vec<Grain<S>>,
    /// Side lengths of the box, m.
    pub sides: [f64; 3],
}

/// Repeats a packing, whose cell must be rectangular, as whole tiles from the origin on.
///
/// # Errors
/// A skewed cell.
pub fn tiled<S: SpecimenSpace>(packing: &PackingFile<S>, tiles: &[usize]) -> Result<Assembled<S>, String> {
    let rows = &packing.periodicity;
    let skew = (0..S::DIMENSION)
        .flat_map(|i| (0..S::DIMENSION).map(move |j| (i, j)))
        .filter(|(i, j)| i != j)
        .fold(0.0, |largest: f64, (i, j)| largest.max((rows[i][j] / rows[i][i]).abs()));
    // A packing brought to an isotropic stress is skewed a little; its tiles are set side by side unskewed.
    if skew > 0.05 {
        return Err(format!("the packing's cell is skewed by {skew:.3}; a specimen needs a rectangular one"));
    }
    let sides: [f64; 3] = std::array::from_fn(|axis| if axis < S::DIMENSION { rows[axis][axis] } else { 1.0 });
    let cell = crate::cell::Cell::<S> { rows: packing.periodicity };
    let counts: [usize; 3] = std::array::from_fn(|axis| tiles.get(axis).copied().unwrap_or(1));
    let mut grains = Vec::with_capacity(packing.grains.len() * counts.iter().product::<usize>());
    for number in 0..counts.iter().product() {
        let tile = [number % counts[0], number / counts[0] % counts[1], number / (counts[0] * counts[1])];
        for grain in &packing.grains {
            let place = cell.fractional(S::centre(grain));
            let position = <S::Coordinates<f64>>::build(|axis| (place[axis] + tile[axis] as f64) * sides[axis]);
            grains.push(still(position, S::radius(grain)));
        }
    }
    Ok(Assembled { grains, sides: std::array::from_fn(|axis| sides[axis] * counts[axis] as f64) })
}

/// Repeats the frame of a plane packing; grains that tiles have in common come once.
///
/// # Errors
/// A packing without a frame.
pub fn joined_frames(packing: &PackingFile<Discs>, tiles: &[usize]) -> Result<Assembled<Discs>, String> {
    let frame = FrameGeometry::of(packing).map_err(|error| error.to_string())?;
    let cell = crate::cell::Cell::<Discs> { rows: packing.periodicity };
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
    Ok(Assembled { grains: grains.collect(), sides })
}

/// The specimen that a test asks for.
///
/// # Errors
/// A packing that does not suit.
pub fn assembled<S: SpecimenSpace + Joinable>(
    packing: &PackingFile<S>,
    tiles: &[usize],
    cut: Cut,
) -> Result<Assembled<S>, String> {
    match cut {
        Cut::Tiles => tiled(packing, tiles),
        Cut::Frames => S::joined(packing, tiles),
    }
}

/// Spaces whose packings may have frames.
pub trait Joinable: SpecimenSpace {
    /// See [`joined_frames`].
    ///
    /// # Errors
    /// A packing without a frame, or a space that has none.
    fn joined(packing: &PackingFile<Self>, tiles: &[usize]) -> Result<Assembled<Self>, String>;
}

impl Joinable for Discs {
    fn joined(packing: &PackingFile<Self>, tiles: &[usize]) -> Result<Assembled<Self>, String> {
        joined_frames(packing, tiles)
    }
}

impl Joinable for crate::space::Spheres {
    fn joined(_: &PackingFile<Self>, _: &[usize]) -> Result<Assembled<Self>, String> {
        Err("cut = \"frames\" is for plane packings".into())
    }
}

fn still<S: SpecimenSpace>(position: S::Coordinates<f64>, radius: f64) -> Grain<S> {
    Grain { position, velocity: Tuple::zero(), spin: Tuple::zero(), radius }
}
