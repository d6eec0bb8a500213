//! Cells so narrow that a grain bears on its own image, or nearly so.

use super::packing_file::{Packing, PackingFile};
use super::{AnyDefinition, GrainDefinition};
use crate::cell::{Cell, shortened};
use crate::space::Space;

/// Width in largest diameters below which a cell is narrow: no other grain has room between the largest one and its image.
const NARROW: f64 = 2.0;

/// Largest over smallest radius up to which grains are alike: crystals are exact in cells of one grain.
const ALIKE: f64 = 1.001;

impl<S: Space> PackingFile<S> {
    /// A warning about a cell that is narrower than two of its largest grains.
    pub fn narrow_cell(&self) -> Option<String> {
        let radii = self.grains.iter().map(S::radius);
        let [smallest, largest] =
            radii.fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], radius| [low.min(radius), high.max(radius)]);
        let widths = shortened(Cell::<S> { rows: self.periodicity }).widths();
        let width = (0..S::DIMENSION).map(|axis| widths[axis]).fold(f64::INFINITY, f64::min) / (2.0 * largest);
        (width < NARROW && largest > ALIKE * smallest).then(|| {
            format!(
                "the cell is {width:.2} of its largest diameters wide: a grain that bears on its own image is a column, and the response is not \
                 that of the material; take more grains, a narrower grading, or a shape that is less slender"
            )
        })
    }
}

impl Packing {
    /// See [`PackingFile::narrow_cell`].
    pub fn narrow_cell(&self) -> Option<String> {
        match self {
            Self::Discs(packing) => packing.narrow_cell(),
            Self::Spheres(packing) => packing.narrow_cell(),
        }
    }
}

impl AnyDefinition {
    /// See [`PackingFile::narrow_cell`].
    pub fn narrow_cell(&self) -> Option<String> {
        match self {
            Self::Discs(GrainDefinition { packing, .. }) => packing.narrow_cell(),
            Self::Spheres(GrainDefinition { packing, .. }) => packing.narrow_cell(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Discs;

    #[test]
    fn cells_in_which_a_grain_nearly_meets_itself_are_told() {
        let packing = |height: f64, small: f64| {
            PackingFile::<Discs>::new([[10.0, 0.0], [0.0, height]], vec![[2.0, 1.0, 1.0], [5.0, 1.0, small]])
        };
        assert!(
            packing(2.1, 0.2).narrow_cell().unwrap().starts_with("the cell is 1.05 of its largest diameters wide")
        );
        assert_eq!(packing(4.1, 0.2).narrow_cell(), None);
        assert_eq!(packing(2.1, 1.0).narrow_cell(), None, "a crystal");
        // Vectors that lean far describe the same cell.
        let leaning = PackingFile::<Discs>::new([[10.0, 0.0], [40.0, 4.1]], vec![[2.0, 1.0, 1.0], [5.0, 1.0, 0.2]]);
        assert_eq!(leaning.narrow_cell(), None);
    }
}
