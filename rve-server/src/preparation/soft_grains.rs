//! Grains that are too soft for the pressure of their recipe, told before the first step.

use super::recipe::PackingRecipe;
use crate::contact::{HertzSprings, LawName, Springs};

/// Expected overlap over diameter above which no packing can meet the limit of 0.1: the estimate is good to a factor of two and a half.
const LARGEST_OVERLAP: f64 = 0.25;

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
        "grains would overlap by about {overlap:.2} of a diameter under this pressure (a packing may have 0.1)"
    );
    Some(SoftGrains { problem, remedy })
}

/// Overlap over diameter at a contact that carries its share of the pressure; `None` where the recipe says no pressure.
fn expected_overlap(recipe: &PackingRecipe) -> Option<f64> {
    let target = recipe.stress_target().ok()?;
    let diameter = mean_diameter(recipe);
    let depth = if recipe.dimension == 2 { recipe.thickness } else { diameter };
    let force = target.pressure * depth * diameter;
    let radii = [0.5 * diameter; 2];
    let overlap = match recipe.contact.law {
        LawName::Linear => force / recipe.contact.normal().ok()?.of(radii[0], radii[1]),
        LawName::HertzMindlin => {
            let (shear_modulus, poisson_ratio) = (recipe.contact.shear_modulus?, recipe.contact.poisson_ratio?);
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
