//! The packings of a campaign: the shipped ones, and others made on the fly from random recipes.

use super::random_stream::{Purpose, RandomStream};
use anyhow::{Context, bail};
use rve_server::contact::ContactTable;
use rve_server::definition::{Packing, PackingFile};
use rve_server::preparation::{Grading, PackingRecipe, generate_any};
use rve_server::space::{Discs, Spheres};

/// A shipped packing, the law it was made with and the pressure it is at rest under.
struct Shipped {
    name: &'static str,
    packing: &'static str,
    recipe: &'static str,
}

macro_rules! shipped {
    ($name:literal) => {
        Shipped {
            name: $name,
            packing: include_str!(concat!("../../../packings/", $name, ".json")),
            recipe: include_str!(concat!("../../../packings/", $name, ".toml")),
        }
    };
}

const SHIPPED: [Shipped; 5] = [
    shipped!("discs-100"),
    shipped!("discs-400"),
    shipped!("discs-400-dense"),
    shipped!("discs-liu2018"),
    shipped!("spheres-100"),
];

/// Number of packings made of each sort.
const MADE: [(Sort, usize); 8] = [
    (Sort { dimension: 2, number: 100, is_everyday: true }, 10),
    (Sort { dimension: 2, number: 400, is_everyday: true }, 4),
    (Sort { dimension: 2, number: 100, is_everyday: false }, 14),
    (Sort { dimension: 2, number: 400, is_everyday: false }, 4),
    (Sort { dimension: 2, number: 1000, is_everyday: false }, 2),
    (Sort { dimension: 3, number: 100, is_everyday: true }, 5),
    (Sort { dimension: 3, number: 100, is_everyday: false }, 7),
    (Sort { dimension: 3, number: 1000, is_everyday: false }, 2),
];

/// k_t / k_n while a packing is made, that of the shipped recipes: the campaign tests the cases, not the preparation.
const PREPARED_RATIO: f64 = 0.5;

/// Seeds in a row that are tried for a packing.
const ATTEMPTS: u64 = 4;

/// What packings made on the fly have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sort {
    dimension: u32,
    number: usize,
    is_everyday: bool,
}

/// One packing of the campaign, by what makes it.
#[derive(Clone, Debug)]
pub(crate) struct Slot {
    /// Name in tables.
    pub(crate) name: String,
    /// 2 or 3.
    pub(crate) dimension: u32,
    /// Grains.
    pub(crate) number: usize,
    /// Whether everyday cases may use it.
    pub(crate) is_everyday: bool,
    /// The law it is made with.
    pub(crate) contact: ContactTable,
    /// The pressure it is at rest under, Pa.
    pub(crate) pressure: f64,
    source: Source,
}

#[derive(Clone, Debug)]
enum Source {
    Shipped(&'static str),
    Recipe(Box<PackingRecipe>),
}

/// All packings of a campaign, none of them made yet.
///
/// # Errors
/// None in a sound build: a shipped recipe cannot be read.
pub(crate) fn slots(seed: u64) -> anyhow::Result<Vec<Slot>> {
    let mut slots = Vec::new();
    for Shipped { name, packing, recipe } in &SHIPPED {
        let recipe = PackingRecipe::from_toml(recipe).with_context(|| format!("the recipe of {name}"))?;
        slots.push(Slot {
            name: (*name).to_owned(),
            dimension: recipe.dimension,
            number: recipe.number,
            is_everyday: true,
            pressure: recipe.pressure.with_context(|| format!("{name} is at rest under a pressure"))?,
            contact: recipe.contact,
            source: Source::Shipped(packing),
        });
    }
    let mut number = 0;
    for (sort, count) in MADE {
        for _ in 0..count {
            let recipe = sampled_recipe(sort, &mut RandomStream::new(seed, Purpose::Packing(number)));
            slots.push(Slot {
                name: format!("made-{number}-{}", described(&recipe)),
                dimension: sort.dimension,
                number: sort.number,
                is_everyday: sort.is_everyday,
                contact: recipe.contact.clone(),
                pressure: recipe.pressure.context("recipes of a campaign have a pressure")?,
                source: Source::Recipe(Box::new(recipe)),
            });
            number += 1;
        }
    }
    Ok(slots)
}

fn described(recipe: &PackingRecipe) -> String {
    let kind = if recipe.dimension == 2 { "discs" } else { "spheres" };
    format!("{kind}-{}", recipe.number)
}

/// A recipe of a sort: everyday ones are like the shipped ones but for seed, stiffness level and preparation friction.
fn sampled_recipe(sort: Sort, stream: &mut RandomStream) -> PackingRecipe {
    let is_plane = sort.dimension == 2;
    let pressure = 1e5;
    // The stiffness level decides about overlaps: stiffer packings take longer to make, large ones and spheres above all.
    let stiffest = match (sort.is_everyday, is_plane, sort.number) {
        (false, true, ..=100) => 1e5,
        (_, _, ..=400) => 1e4,
        _ => 1e3,
    };
    let level = stream.decades(1e2, stiffest);
    let friction = match sort.is_everyday {
        true => stream.pick(&[0.0, 0.02, 0.05, 0.1, 0.3]),
        false => stream.pick(&[0.0, 0.0, 0.05, 0.5, 1.0]),
    };
    let is_linear = is_plane || stream.chance(0.4);
    let contact = if is_linear {
        ContactTable {
            normal_stiffness: None,
            modulus: Some(level * pressure),
            ..ContactTable::linear(1.0, PREPARED_RATIO, friction)
        }
    } else {
        // Overlaps of Hertz contacts go with (pressure / modulus)^(2/3).
        ContactTable::hertz_mindlin(pressure * level.powf(1.5), stream.between(0.05, 0.35), friction)
    };
    let grading = match sort.is_everyday {
        true => Grading::Uniform { smallest_radius: 1.625e-4, largest_radius: 3.375e-4 },
        false => sampled_grading(sort, stream),
    };
    PackingRecipe {
        dimension: sort.dimension,
        number: sort.number,
        seed: stream.seed(),
        pressure: Some(pressure),
        stress: None,
        aspect: None,
        thickness: if is_plane { 5e-4 } else { 1.0 },
        tolerance: 1e-5,
        stress_tolerance: 1e-4,
        grading,
        contact,
        target: None,
        anisotropy: None,
        removal: None,
    }
}

/// A grading with a ratio of sizes up to 10 where there are grains enough to fill it.
fn sampled_grading(sort: Sort, stream: &mut RandomStream) -> Grading {
    let smallest_radius = 1e-4;
    let widest = if sort.dimension == 2 { 10.0 } else { 4.0 };
    let largest_radius = smallest_radius * stream.decades(1.2, widest);
    match stream.below(3) {
        0 => Grading::Uniform { smallest_radius, largest_radius },
        1 => Grading::Bidisperse {
            small_radius: smallest_radius,
            large_radius: largest_radius,
            large_share: stream.between(0.05, 0.5),
        },
        _ => Grading::PowerLaw { smallest_radius, largest_radius, exponent: stream.between(-3.0, 0.0) },
    }
}

impl Slot {
    /// The packing itself.
    ///
    /// # Errors
    /// The recipe finds no packing.
    pub(crate) fn packing(&self) -> anyhow::Result<Packing> {
        match &self.source {
            Source::Shipped(text) => {
                let made = if self.dimension == 2 {
                    Packing::Discs(serde_json::from_str::<PackingFile<Discs>>(text)?.checked()?)
                } else {
                    Packing::Spheres(serde_json::from_str::<PackingFile<Spheres>>(text)?.checked()?)
                };
                Ok(made)
            }
            Source::Recipe(recipe) => {
                // A preparation may miss its tolerances slightly; the campaign tests the cases, so the next seed will do.
                let mut attempts = (0..ATTEMPTS).map(|attempt| {
                    let recipe = PackingRecipe { seed: recipe.seed + attempt, ..(**recipe).clone() };
                    generate_any(&recipe, &mut |_| {})
                });
                let first = attempts.next().expect("there is at least one attempt");
                let made = first.or_else(|error| attempts.find_map(Result::ok).ok_or(error));
                let (packing, _) = made.with_context(|| self.name.clone())?;
                if packing.dimension() != self.dimension {
                    bail!("{} has the wrong dimension", self.name);
                }
                Ok(packing)
            }
        }
    }

    /// The recipe of a packing made on the fly, as TOML, before any change of its seed; empty for shipped ones.
    pub(super) fn recipe(&self) -> String {
        match &self.source {
            Source::Shipped(_) => String::new(),
            Source::Recipe(recipe) => toml::to_string(recipe).unwrap_or_default(),
        }
    }
}
