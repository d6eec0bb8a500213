//! What can be wrong with a packing: format, lattice, grains, listed contacts. What passes has its centres wrapped into the cell.

use super::packing_file::{PackingError, PackingFile, wrong_dimension};
use crate::cell::{Cell, PairKey, shortened};
use crate::space::{Components, Space, Tensor};
use std::cmp::Ordering;

/// Largest distance of a centre from the cell, and largest cell shift of a listed contact, in cells: beyond it, numbers tell images no more
/// apart as grains need it.
const FARTHEST: f64 = 1e6;

/// Largest product of the lengths of the periodicity vectors over the area or volume that they span. Beyond it rounding shows in what they
/// span; shifts of contacts by [`FARTHEST`] cells stay whole numbers of 32 bits when the lattice is described by short vectors.
const LARGEST_LEAN: f64 = 1e3;

impl<S: Space> PackingFile<S> {
    /// Checks everything that can be wrong and wraps the centres, adjusting the shifts of listed contacts.
    ///
    /// # Errors
    /// [`PackingError::Content`] naming the grain or contact and the remedy.
    pub fn checked(mut self) -> Result<Self, PackingError> {
        let refuse = |reason: String| Err(PackingError::Content(reason));
        if self.format != PackingFile::FORMAT {
            return refuse(format!("format is `{}`, but `{}` was expected", self.format, PackingFile::FORMAT));
        }
        if ![PackingFile::VERSION, PackingFile::VERSION_WITH_MOMENTS].contains(&self.version) {
            return refuse(format!(
                "version {} is not known; this program reads versions {} and {}",
                self.version,
                PackingFile::VERSION,
                PackingFile::VERSION_WITH_MOMENTS
            ));
        }
        if !self.rolling_moments.is_empty() && self.version != PackingFile::VERSION_WITH_MOMENTS {
            return refuse(format!(
                "rolling_moments belong to version {}; this file says version {}",
                PackingFile::VERSION_WITH_MOMENTS,
                self.version
            ));
        }
        if self.dimension as usize != S::DIMENSION {
            return refuse(wrong_dimension::<S>(self.dimension));
        }
        if !(self.thickness.is_finite() && self.thickness > 0.0) {
            return refuse(format!("thickness = {} must be a positive length in m", self.thickness));
        }
        if S::DIMENSION == 3 && self.thickness != 1.0 {
            return refuse("thickness belongs to plane packings; remove it".into());
        }
        let cell = Cell::<S> { rows: self.periodicity };
        if !self.periodicity.components().all(f64::is_finite) {
            return refuse("periodicity holds a number that is not finite".into());
        }
        let measure = cell.measure();
        if measure <= 0.0 {
            return refuse(match S::DIMENSION {
                2 => format!(
                    "periodicity spans an area of {measure:e} m2; Y2 must lie counter-clockwise of Y1 (swap the two rows)"
                ),
                _ => format!(
                    "periodicity spans a volume of {measure:e} m3; Y1, Y2, Y3 must be right-handed (swap two rows)"
                ),
            });
        }
        let lengths: f64 = (0..S::DIMENSION).map(|row| self.periodicity[row].norm()).product();
        if lengths > LARGEST_LEAN * measure {
            return refuse(format!(
                "the vectors of periodicity are nearly parallel: the product of their lengths is {:.1e} times what they span; describe the same \
                 lattice by shorter vectors, for example Y2 - n Y1 for Y2",
                lengths / measure
            ));
        }
        if self.grains.is_empty() {
            return refuse("a packing needs at least one grain".into());
        }
        self.check_grains(&cell)?;
        let wraps = self.wrap_centres(&cell);
        self.refuse_equal_centres()?;
        self.check_contacts(&wraps)?;
        Ok(self)
    }

    /// Two grains at one place have no direction to push each other in. Centres are in the cell.
    fn refuse_equal_centres(&self) -> Result<(), PackingError> {
        let centre = |number: &usize| S::centre(&self.grains[*number]);
        let order = |one: S::Vector, other: S::Vector| {
            let axes = (0..S::DIMENSION).map(|axis| one[axis].total_cmp(&other[axis]));
            axes.fold(Ordering::Equal, Ordering::then)
        };
        let mut numbers: Vec<usize> = (0..self.grains.len()).collect();
        numbers.sort_by(|one, other| order(centre(one), centre(other)));
        match numbers.windows(2).find(|pair| order(centre(&pair[0]), centre(&pair[1])) == Ordering::Equal) {
            Some(pair) => Err(PackingError::Content(format!(
                "grains {} and {} have their centres at the same place, or at images of it; take one of them out",
                pair[0], pair[1]
            ))),
            None => Ok(()),
        }
    }

    fn check_grains(&self, cell: &Cell<S>) -> Result<(), PackingError> {
        let refuse = |reason: String| Err(PackingError::Content(reason));
        let shortest = shortest_translation(cell);
        for (index, grain) in self.grains.iter().enumerate() {
            let radius = S::radius(grain);
            if !grain.as_ref().iter().all(|value| value.is_finite()) {
                return refuse(format!("grain {index}: {:?} holds a number that is not finite", grain.as_ref()));
            }
            let fraction = cell.fractional(S::centre(grain));
            if (0..S::DIMENSION).any(|axis| fraction[axis].is_nan() || fraction[axis].abs() > FARTHEST) {
                return refuse(format!(
                    "grain {index}: {:?} lies more than {FARTHEST:e} cells away; give its image inside the cell",
                    grain.as_ref()
                ));
            }
            if radius <= 0.0 {
                return refuse(format!("grain {index}: radius {radius} must be positive"));
            }
            // A lattice of one grain per cell overlaps its own images a little; beyond that it is a mistake in units.
            if 2.0 * radius > 1.15 * shortest {
                return refuse(format!(
                    "grain {index}: diameter {} exceeds the distance {shortest} to its own image; \
                     the grain is larger than the cell",
                    2.0 * radius
                ));
            }
        }
        Ok(())
    }

    fn wrap_centres(&mut self, cell: &Cell<S>) -> Vec<S::Shift> {
        self.grains
            .iter_mut()
            .map(|grain| {
                let (inside, shift) = cell.wrapped(S::centre(grain));
                if shift != S::Shift::default() {
                    *grain = S::grain(inside, S::radius(grain));
                }
                shift
            })
            .collect()
    }

    fn check_contacts(&mut self, wraps: &[S::Shift]) -> Result<(), PackingError> {
        let refuse = |reason: String| Err(PackingError::Content(reason));
        let count = self.grains.len();
        if ![0, self.contacts.len()].contains(&self.rolling_moments.len()) {
            return refuse(format!(
                "{} rolling_moments for {} contacts: one for each row of contacts is needed, or none at all",
                self.rolling_moments.len(),
                self.contacts.len()
            ));
        }
        if let Some(index) = self.rolling_moments.iter().position(|moment| !moment.is_finite()) {
            return refuse(format!("rolling moment {index}: {:?} is not finite", self.rolling_moments[index]));
        }
        let mut keys = Vec::with_capacity(self.contacts.len());
        for (index, contact) in self.contacts.iter_mut().enumerate() {
            let (i, j) = (contact.origin as usize, contact.end as usize);
            if i >= count || j >= count {
                return refuse(format!("contact {index}: grain {} does not exist; there are {count}", i.max(j)));
            }
            if !contact.tangential_force.is_finite() {
                let force = contact.tangential_force;
                return refuse(format!("contact {index}: tangential force {force:?} is not finite"));
            }
            let (from, to, shift) = (wraps[i], wraps[j], contact.shift);
            if (0..S::DIMENSION).any(|axis| f64::from(shift[axis]).abs() > FARTHEST) {
                return refuse(format!("contact {index}: its cell shift is more than {FARTHEST:e} cells"));
            }
            contact.shift = S::shift(|axis| shift[axis] + (to[axis] - from[axis]));
            if i == j && contact.shift == S::Shift::default() {
                return refuse(format!("contact {index}: grain {i} cannot touch itself without a cell shift"));
            }
            keys.push((PairKey::<S>::canonical(contact.origin, contact.end, contact.shift), index));
        }
        keys.sort_unstable();
        if let Some(twice) = keys.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return refuse(format!("contacts {} and {} name the same pair", twice[0].1, twice[1].1));
        }
        Ok(())
    }
}

/// Length of the shortest sum of periodicity vectors, m. Once these are short, none needs to be taken more than once.
fn shortest_translation<S: Space>(cell: &Cell<S>) -> f64 {
    let cell = shortened(*cell);
    (0..27)
        .map(|number| [number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1])
        .filter(|shift| shift[..S::DIMENSION].iter().any(|step| *step != 0))
        .map(|shift| cell.translation(S::shift(|axis| shift[axis])).norm())
        .fold(f64::INFINITY, f64::min)
}
