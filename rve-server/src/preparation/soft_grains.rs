//! Grains that are too soft for the pressure of their recipe, told before the first step.

use super::recipe::PackingRecipe;
use crate::contact::{ContactTable, HertzSprings, LawName, Springs};
use crate::definition::PackingFile;
use crate::space::Space;

/// Expected overlap over diameter above which no packing can meet the limit of 0.1: the estimate is good to a factor of two and a half.
const LARGEST_OVERLAP: f64 = 0.25;

/// Expected overlaps over diameter beyond which the stiffness is a likely reason of a packing that cannot be made.
const SOFT: f64 = 0.04;
const STIFF: f64 = 2e-5;

/// Why the grains of a recipe are too soft for its pressure.
pub struct SoftGrains {
    /// What is wrong, for people.
    pub problem: String,
    /// What helps.
    pub remedy: String,
}

/// Grains so soft that the pressure would press them into one another, which is known before the first step.
pub fn soft_grains(recipe: &PackingRecipe) -> Option<SoftGrains> {
    let overlap = expected_overlap(recipe).filter(|overlap| *overlap > LARGEST_OVERLAP)?;
    let remedy = if !recipe.contact.law.is_linear() {
        "with shear modulus G and Poisson ratio nu the overlap is about (1.5 p (1 - nu) / G)^(2/3) of a diameter: give a larger \
         contact.shear_modulus"
            .to_owned()
    } else if recipe.dimension == 2 {
        let diameter = mean_diameter(recipe);
        format!(
            "thickness is {:.3e} m for grains of {diameter:.3e} m; one mean diameter is usual. With modulus E the overlap is about \
             2 p t / (E d): a smaller thickness, or a larger modulus or normal_stiffness, helps",
            recipe.thickness
        )
    } else {
        "with modulus E the overlap is about 2 p / E: give a larger modulus or normal_stiffness".to_owned()
    };
    let problem = format!(
        "grains would overlap by about {} of a diameter under this pressure (a packing may have 0.1)",
        shown(overlap)
    );
    Some(SoftGrains { problem, remedy })
}

/// Mean diameter, m, above which radii were probably given in other units.
const LARGEST_DIAMETER: f64 = 0.5;

/// Thickness of a plane packing over the mean diameter below which they were too: the stress of a disc is a force over its thickness.
const THINNEST: f64 = 0.05;

/// A remark on a recipe whose lengths are probably not all in metres.
pub fn doubtful_lengths(recipe: &PackingRecipe) -> Option<String> {
    let diameter = mean_diameter(recipe);
    if diameter > LARGEST_DIAMETER {
        return Some(format!("the mean diameter of the grains is {diameter:.3e} m: are the radii in m?"));
    }
    let is_thin = recipe.dimension == 2 && recipe.thickness < THINNEST * diameter;
    is_thin.then(|| {
        format!(
            "thickness is {:.3e} m for discs of {diameter:.3e} m; one mean diameter is usual: are radii and thickness both in m?",
            recipe.thickness
        )
    })
}

/// What the stiffness of a recipe has to do with a packing that could not be made; nothing in the range that is usual.
pub fn stiffness_hint(recipe: &PackingRecipe) -> Option<&'static str> {
    match expected_overlap(recipe)? {
        overlap if overlap > SOFT => Some("its grains are soft for this pressure: give contact a larger stiffness"),
        overlap if overlap < STIFF => Some(
            "its grains are so stiff for this pressure that they may not get there at all: give contact a smaller stiffness",
        ),
        _ => None,
    }
}

/// Why the grains of a packing are too soft to be brought to a pressure (Pa), in one sentence with its remedy.
pub(super) fn too_soft_for<S: Space>(
    packing: &PackingFile<S>,
    contact: &ContactTable,
    pressure: f64,
) -> Option<String> {
    let radii = packing.grains.iter().map(S::radius);
    let diameter = 2.0 * radii.sum::<f64>() / packing.grains.len() as f64;
    let depth = if S::DIMENSION == 2 { packing.thickness } else { diameter };
    let overlap = overlap_under(contact, pressure, diameter, depth).filter(|overlap| *overlap > LARGEST_OVERLAP)?;
    Some(format!(
        "its grains would overlap by about {} of a diameter under this pressure (a packing may have 0.1); give contact a larger stiffness, or a \
         plane packing the thickness of a mean diameter",
        shown(overlap)
    ))
}

/// An overlap over a diameter: a pressure in a wrong unit makes it any number.
fn shown(overlap: f64) -> String {
    if overlap < 10.0 { format!("{overlap:.2}") } else { format!("{overlap:.0e}") }
}

/// Overlap over diameter of the grains of a recipe; `None` where it says no pressure.
fn expected_overlap(recipe: &PackingRecipe) -> Option<f64> {
    let target = recipe.stress_target().ok()?;
    let diameter = mean_diameter(recipe);
    let depth = if recipe.dimension == 2 { recipe.thickness } else { diameter };
    overlap_under(&recipe.contact, target.pressure, diameter, depth)
}

/// Overlap over diameter at a contact that carries its share of a pressure (Pa) over a diameter and a depth, m.
fn overlap_under(contact: &ContactTable, pressure: f64, diameter: f64, depth: f64) -> Option<f64> {
    let force = pressure * depth * diameter;
    let radii = [0.5 * diameter; 2];
    let overlap = match contact.law {
        LawName::Linear => force / contact.normal().ok()?.of(radii[0], radii[1]),
        LawName::HertzMindlin => {
            let (shear_modulus, poisson_ratio) = (contact.shear_modulus?, contact.poisson_ratio?);
            let [coefficient, _] = HertzSprings { shear_modulus, poisson_ratio }.coefficients(radii);
            (force / coefficient).powf(2.0 / 3.0)
        }
    };
    Some(overlap / diameter)
}

fn mean_diameter(recipe: &PackingRecipe) -> f64 {
    let radii = recipe.radii();
    2.0 * radii.iter().sum::<f64>() / radii.len() as f64
}
