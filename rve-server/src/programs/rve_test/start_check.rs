//! The packing as given against the path: units, modulus or thickness that are not those of the packing show in its first row, long before
//! anything fails.

use super::path::Matrix;
use super::row::ElementRow;
use super::test_file::{COMPONENT_KEYS, ElementTest};

/// Largest factor between the stress of the packing and the first targets that is taken to be meant.
const FARTHEST: f64 = 10.0;

/// Difference over the largest direct stress of the packing from which on a stress counts as changed by the path.
const CHANGED: f64 = 0.01;

/// Places of the direct components in a row-major tensor.
const DIRECT: [usize; 3] = [0, 4, 8];

/// Remedy of a packing that is not what its path expects.
const REMEDY: &str = "check units and thickness of the packing (m), contact.modulus or normal_stiffness, and the stresses of the path (Pa)";

/// Whether `stress`, Pa, of the packing and the direct stresses that the first segment prescribes differ by a large factor. Targets of zero
/// unload on purpose, and a packing without any stress is told of otherwise.
pub(super) fn is_far_from_targets(test: &ElementTest, stress: &Matrix) -> bool {
    scales(test, stress).is_some_and(|scales| scales.are_far_apart())
}

/// Warnings about the packing as given, row 0 of `test`, one line each.
pub fn start_warnings(test: &ElementTest, row: &ElementRow) -> Vec<String> {
    let targets = scales(test, &row.stress).filter(Scales::are_far_apart).map(|scales| {
        format!(
            "the packing has {0} = {1:.3e} Pa and the path begins with {0} = {2:.3e} Pa, {3}; if this is not meant, {REMEDY}",
            scales.name(),
            scales.found,
            scales.wanted,
            scales.factor_text()
        )
    });
    let dense = (row.void_ratio < 0.0).then(|| {
        format!(
            "the void ratio of the packing is {:.3}: the grains have more volume than their cell; radii and cell are in different units, or \
             they overlap far too much",
            row.void_ratio
        )
    });
    targets.into_iter().chain(dense).collect()
}

/// A remark on row 0 of `test` if its first segment strains the packing and changes a direct stress meanwhile: most paths mean to keep it.
pub fn start_note(test: &ElementTest, row: &ElementRow) -> Option<String> {
    let segment = test.path.first()?;
    let is_strained = segment.strain.values().into_iter().flatten().any(|component| component != 0.0);
    let found = |place: usize| row.stress[place / 3][place % 3];
    let largest = DIRECT.into_iter().map(|place| found(place).abs()).fold(0.0, f64::max);
    let targets = segment.stress.values();
    let wanted = DIRECT.into_iter().filter_map(|place| Some((place, targets[place]?)));
    let (place, wanted) = wanted.max_by(|one, other| {
        let miss = |(place, wanted): &(usize, f64)| (wanted - found(*place)).abs();
        miss(one).total_cmp(&miss(other))
    })?;
    let is_told = is_strained && (wanted - found(place)).abs() > CHANGED * largest;
    (is_told && !is_far_from_targets(test, &row.stress)).then(|| {
        format!(
            "the packing has sigma_{0} = {1:.3e} Pa and the first segment ends at {2:.3e} Pa: this stress changes linearly over the whole segment; to \
             keep it constant, prescribe that of the packing, prepare the packing at this stress, or bring it there in a segment of stresses alone",
            COMPONENT_KEYS[place],
            found(place),
            wanted
        )
    })
}

/// The direct stress with the largest target of the first segment, Pa, tension positive.
struct Scales {
    place: usize,
    found: f64,
    wanted: f64,
}

impl Scales {
    fn are_far_apart(&self) -> bool {
        let (found, wanted) = (self.found.abs(), self.wanted.abs());
        found > FARTHEST * wanted || wanted > FARTHEST * found
    }

    fn name(&self) -> String {
        format!("sigma_{}", COMPONENT_KEYS[self.place])
    }

    fn factor_text(&self) -> String {
        let (found, wanted) = (self.found.abs(), self.wanted.abs());
        if wanted > found {
            format!("{:.1e} times as much", wanted / found)
        } else {
            format!("{:.1e} times less", found / wanted)
        }
    }
}

fn scales(test: &ElementTest, stress: &Matrix) -> Option<Scales> {
    let targets = test.path.first()?.stress.values();
    let wanted = DIRECT.into_iter().filter_map(|place| Some((place, targets[place]?)));
    let (place, wanted) = wanted.max_by(|one, other| one.1.abs().total_cmp(&other.1.abs()))?;
    let found = stress[place / 3][place % 3];
    (wanted != 0.0 && found != 0.0).then_some(Scales { place, found, wanted })
}

#[cfg(test)]
mod tests {
    use super::super::run_element_on;
    use super::*;
    use crate::definition::Packing;
    use protocol::TangentKind;
    use std::ops::ControlFlow;
    use std::path::Path;

    /// A modulus of other units, or radii that are too large for their cell, are told of in row 0; a packing that is compressed to five times its
    /// pressure, or unloaded, is not.
    #[test]
    fn a_packing_that_is_not_what_the_path_expects_is_told_of_at_once() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let begun = |modulus: f64, swelling: f64, path: &str| {
            let text = format!(
                "packing = \"packings/discs-100.json\"\n[contact]\nlaw = \"linear\"\nmodulus = {modulus:e}\nstiffness_ratio = 0.5\n\
                 friction = 0.5\n[rve]\naccuracy = \"draft\"\n[[path]]\nincrements = 20\n{path}"
            );
            let test = ElementTest::from_toml(&text).unwrap();
            let mut packing = Packing::read(&root.join(&test.packing)).unwrap();
            if let Packing::Discs(discs) = &mut packing {
                discs.grains.iter_mut().for_each(|grain| grain[2] *= swelling);
            }
            let (mut told, mut note) = (Vec::new(), None);
            let end = run_element_on(&test, packing, TangentKind::None, &mut |row| {
                (told, note) = (start_warnings(&test, row), start_note(&test, row));
                ControlFlow::Break(())
            });
            (told, note, end.summary)
        };
        let biaxial = "strain = { yy = -0.01 }\nstress = { xx = -1e5 }";
        let (told, note, summary) = begun(1e11, 1.0, biaxial);
        assert!(note.is_none(), "the warning says it: {note:?}");
        let expected = [
            "sigma_xx = -1.00",
            "Pa and the path begins with sigma_xx = -1.000e5 Pa",
            "times less",
            "contact.modulus",
        ];
        assert!(told.len() == 1 && expected.iter().all(|part| told[0].contains(part)), "{told:?}");
        assert_eq!(summary.far_from_targets, 1);
        assert!(summary.warnings().iter().any(|(what, rows)| what.contains("more than tenfold") && *rows == 1));
        let (told, _, summary) = begun(1e8, 1.3, "strain = { yy = -0.01 }");
        assert!(told.len() == 1 && told[0].contains("void ratio of the packing is -0."), "{told:?}");
        assert_eq!((summary.far_from_targets, summary.negative_void_ratio), (0, 1));
        for path in [biaxial, "stress = { xx = -5e5, yy = -5e5 }", "stress = { xx = 0.0, yy = 0.0 }"] {
            let (told, note, summary) = begun(1e8, 1.0, path);
            assert!(told.is_empty() && note.is_none() && summary.far_from_targets == 0, "{path}: {told:?} {note:?}");
        }
        // The packing has 100 kPa.
        let (told, note, _) = begun(1e8, 1.0, "strain = { yy = -0.01 }\nstress = { xx = -2e5 }");
        assert!(told.is_empty(), "{told:?}");
        assert!(note.as_ref().is_some_and(|note| note.contains("ends at -2.000e5 Pa")), "{note:?}");
    }
}
