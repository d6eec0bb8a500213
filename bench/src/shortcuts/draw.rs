//! What a scene of the study is: a body, its cells and what is done to it, drawn from the seed and the number of the scene, and
//! written as users write scenes.

use crate::stability::case::{Range, sampled_contact, sampled_error};
use crate::stability::packings::Slot;
use crate::stability::random_stream::{Purpose, RandomStream};
use anyhow::Context;
use rve_server::contact::LawName;
use rve_server::definition::{Accuracy, RveOptions};
use std::fmt::Write;

/// Grains of the largest packing behind a Gauss point.
const LARGEST: usize = 200;

/// Share of the scenes that stand in space.
const IN_SPACE: f64 = 0.2;

/// Share of the others whose cells are of several kinds.
const SEVERAL_KINDS: f64 = 0.4;

/// What is done to a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Loading {
    /// Compressed between smooth platens.
    Compression,
    /// Compressed, held, unloaded by half and compressed again.
    Turns,
    /// Periodic along x, sheared to and fro by 1e-6 to 1e-3.
    Cycles,
    /// Periodic along x, sheared at its base by a wave; dynamic.
    Wave,
    /// Under a head that sinks and tilts.
    Head,
}

impl Loading {
    const PLANE: [Self; 5] = [Self::Compression, Self::Turns, Self::Cycles, Self::Wave, Self::Head];
    const SPACE: [Self; 2] = [Self::Compression, Self::Turns];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Compression => "compression",
            Self::Turns => "turns",
            Self::Cycles => "cycles",
            Self::Wave => "wave",
            Self::Head => "head",
        }
    }
}

/// One scene.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    pub(super) loading: Loading,
    /// Its packing among the slots of the campaign.
    pub(super) slot: usize,
    pub(super) element: &'static str,
    pub(super) elements: String,
    pub(super) strategy: &'static str,
    /// How accurately the cells are solved.
    pub(super) options: RveOptions,
    /// Whether the event-driven solver serves its cells: discs with linear springs.
    pub(super) is_linear: bool,
    /// The scene file; its packing is `packing.json` next to it.
    pub(super) text: String,
}

impl Scene {
    /// Draws the scene of a number.
    ///
    /// # Errors
    /// None in a sound build: a contact law that cannot be written.
    pub(super) fn sampled(seed: u64, number: u64, slots: &[Slot]) -> anyhow::Result<Self> {
        let stream = &mut RandomStream::new(seed, Purpose::Shortcuts(number));
        let is_plane = !stream.chance(IN_SPACE);
        let dimension = if is_plane { 2 } else { 3 };
        let places: Vec<usize> = (0..slots.len())
            .filter(|&place| {
                let slot = &slots[place];
                slot.dimension == dimension && slot.number <= LARGEST && slot.is_everyday
            })
            .collect();
        let slot = stream.pick(&places);
        let loading = stream.pick(if is_plane { &Loading::PLANE[..] } else { &Loading::SPACE });
        let element = match (loading, is_plane) {
            (Loading::Wave, _) => stream.pick(&["q4", "q4_single"]),
            (_, true) => stream.pick(&["q4", "q8", "t3", "t6", "q4_single"]),
            // Not `h20`: in a column one element wide it has motions that need no energy.
            (_, false) => stream.pick(&["h8", "h8_single", "h20_full"]),
        };
        let elements = match (loading, is_plane) {
            (Loading::Wave, _) => format!("[1, {}]", 4 + stream.below(9)),
            (_, true) => stream.pick(&["[1, 1]", "[2, 1]", "[1, 3]", "[2, 2]", "[2, 4]"]).to_owned(),
            (_, false) => stream.pick(&["[1, 1, 1]", "[1, 2, 1]"]).to_owned(),
        };
        let contact = sampled_contact(Range::Everyday, &slots[slot], stream);
        let options = sampled_options(loading, stream);
        let strategy = stream.pick(&["", "", "newton", "modified_newton", "slip_secant", "quasi_newton"]);
        let pressure = slots[slot].pressure;
        let size = if is_plane { "[1.0, 2.0]" } else { "[1.0, 2.0, 1.0]" };
        let mut text = format!(
            "name = \"scene-{number}\"\npacking = \"packing.json\"\n{}\
             [mesh]\ngenerator = \"block\"\nsize = {size}\nelements = {elements}\nelement = \"{element}\"\n\n",
            if loading == Loading::Wave { "procedure = \"dynamic\"\n" } else { "" }
        );
        let law = toml::to_string(&contact).context("a contact law as TOML")?;
        write!(text, "[contact]\n{law}\n[rve]\n{}\n\n", accuracy(&options)).expect("memory");
        if !strategy.is_empty() && loading != Loading::Wave {
            write!(text, "[solver]\nstrategy = \"{strategy}\"\n\n").expect("memory");
        }
        if is_plane && stream.chance(SEVERAL_KINDS) {
            text += &several_kinds(stream);
        }
        text += &conditions(loading, is_plane, pressure, stream);
        text += "\n[output]\nfields_every = 0\n";
        for component in if is_plane { &["xx", "yy", "xy"][..] } else { &["xx", "yy", "zz", "xy"] } {
            write!(
                text,
                "\n[[probe]]\nname = \"{component}\"\nkind = \"mean_stress\"\ncomponent = \"{component}\"\n"
            )
            .expect("memory");
        }
        let is_linear = is_plane && contact.law == LawName::Linear;
        Ok(Self { loading, slot, element, elements, strategy, options, is_linear, text })
    }

    /// How accurately its cells are solved, as the scene says it.
    pub(super) fn accuracy(&self) -> String {
        accuracy(&self.options)
    }

    /// The probes of stress.
    pub(super) fn components(&self) -> &'static [&'static str] {
        if self.text.contains("name = \"zz\"") { &["xx", "yy", "zz", "xy"] } else { &["xx", "yy", "xy"] }
    }
}

/// An error where steps can keep to one, a named accuracy elsewhere and in some others.
fn sampled_options(loading: Loading, stream: &mut RandomStream) -> RveOptions {
    if loading != Loading::Wave && stream.chance(0.5) {
        // As the scene writes it.
        let error = format!("{:.1e}", sampled_error(stream)).parse().ok();
        return RveOptions { error, ..RveOptions::default() };
    }
    let accuracy = if loading == Loading::Wave || stream.chance(0.3) { Accuracy::Default } else { Accuracy::Draft };
    RveOptions { accuracy, ..RveOptions::default() }
}

fn accuracy(options: &RveOptions) -> String {
    match (options.error, options.accuracy) {
        (Some(error), _) => format!("error = {error:e}"),
        (None, Accuracy::Draft) => "accuracy = \"draft\"".to_owned(),
        _ => "accuracy = \"default\"".to_owned(),
    }
}

/// The packing at angles that are drawn per Gauss point, and a corner that has lost some grains.
fn several_kinds(stream: &mut RandomStream) -> String {
    let [angles, grains] = [stream.seed(), stream.seed()];
    format!(
        "[[region]]\nname = \"turned\"\nelements = \"all\"\nrotations = [0.0, 45.0, 90.0]\nseed = {angles}\n\n\
         [[region]]\nname = \"weak\"\nfrom = [0.0, 0.0]\nto = [0.7, 1.1]\nremoval = {{ number = 3, seed = {grains} }}\n\n"
    )
}

fn boundary(set: &str, more: &str) -> String {
    format!("[[boundary]]\nset = \"{set}\"\n{more}\n\n")
}

fn conditions(loading: Loading, is_plane: bool, pressure: f64, stream: &mut RandomStream) -> String {
    match loading {
        Loading::Compression | Loading::Turns | Loading::Head => specimen(loading, is_plane, pressure, stream),
        Loading::Cycles | Loading::Wave => layer(loading, stream),
    }
}

/// A specimen under pressure from its sides.
fn specimen(loading: Loading, is_plane: bool, pressure: f64, stream: &mut RandomStream) -> String {
    let sides = if is_plane { &["left", "right"][..] } else { &["left", "right", "back", "front"] };
    let sides = sides.iter().map(|set| format!("[[pressure]]\nset = \"{set}\"\nvalue = {pressure:e}\n\n"));
    let mut text: String = sides.collect();
    text += &boundary("bottom", "platen = \"smooth\"\ndisplacement = { y = 0.0 }");
    if is_plane {
        text += &boundary("bottom_left", "displacement = { x = 0.0 }");
    } else {
        text += &boundary("bottom_left_back", "displacement = { x = 0.0, z = 0.0 }");
        text += &boundary("bottom_right_back", "displacement = { z = 0.0 }");
    }
    let way = -2.0 * stream.decades(1e-4, 5e-3);
    let steps = 4 + stream.below(7);
    match loading {
        Loading::Head => {
            let turn = stream.sign() * stream.decades(1e-4, 2e-3);
            write!(
                text,
                "[[rigid_body]]\nset = \"top\"\ndisplacement = {{ y = {way:e} }}\nrotation = {{ z = {turn:e} }}\n\n"
            )
            .expect("memory");
            write!(text, "[loading]\nincrements = {steps}\n").expect("memory");
        }
        Loading::Turns => {
            // Times of the turns lie on ends of steps.
            let history = "history = { table = [[0.0, 0.0], [4.0, 1.0], [6.0, 1.0], [8.0, 0.5], [12.0, 1.5]] }";
            let motion = format!("platen = \"smooth\"\ndisplacement = {{ y = {way:e} }}\n{history}");
            text += &boundary("top", &motion);
            text += "[loading]\nduration = 12.0\nincrements = 12\n";
        }
        _ => {
            text += &boundary("top", &format!("platen = \"smooth\"\ndisplacement = {{ y = {way:e} }}"));
            write!(text, "[loading]\nincrements = {steps}\n").expect("memory");
        }
    }
    text
}

/// A layer without ends between two platens that keep their distance.
fn layer(loading: Loading, stream: &mut RandomStream) -> String {
    let mut text = "[[periodic]]\nfrom = \"left\"\nto = \"right\"\njump = { x = 0.0, y = 0.0 }\n\n".to_owned();
    if loading == Loading::Wave {
        let way = stream.decades(1e-7, 1e-4);
        let frequency = stream.between(20.0, 200.0);
        let sine = format!("displacement = {{ x = {way:e} }}\nhistory = {{ sine = {{ frequency = {frequency} }} }}");
        text += &boundary("bottom", &sine);
        text += &boundary("bottom", "displacement = { y = 0.0 }");
        text += &boundary("top", "displacement = { x = 0.0, y = 0.0 }");
        text += "[loading]\nduration = 6.0e-3\n\n[dynamics]\noutput_interval = 1.0e-3\n";
        return text;
    }
    let way = 2.0 * stream.decades(1e-6, 1e-3);
    text += &boundary("bottom", "displacement = { x = 0.0, y = 0.0 }");
    text += &boundary("top", "displacement = { y = 0.0 }");
    let sine = format!("displacement = {{ x = {way:e} }}\nhistory = {{ sine = {{ frequency = 1.0 }} }}");
    text += &boundary("top", &sine);
    text + "[loading]\nduration = 1.25\nincrements = 20\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::packings::slots;

    #[test]
    fn scenes_are_repeatable_can_be_read_and_are_of_all_sorts() {
        let slots = slots(7).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let scenes: Vec<Scene> = (0..80).map(|number| Scene::sampled(7, number, &slots).unwrap()).collect();
        let file = folder.path().join("scene.toml");
        for (number, scene) in scenes.iter().enumerate() {
            assert_eq!(Scene::sampled(7, number as u64, &slots).unwrap().text, scene.text);
            let packing = match slots[scene.slot].dimension {
                2 => include_str!("../../../packings/discs-100.json"),
                _ => include_str!("../../../packings/spheres-100.json"),
            };
            std::fs::write(folder.path().join("packing.json"), packing).unwrap();
            std::fs::write(&file, &scene.text).unwrap();
            let read = scene_reader::Scene::load(&file, &[]);
            assert!(read.is_ok(), "scene {number}: {:#}\n{}", read.err().unwrap(), scene.text);
        }
        for loading in Loading::PLANE {
            assert!(scenes.iter().any(|scene| scene.loading == loading), "{}", loading.name());
        }
        assert!(scenes.iter().any(|scene| slots[scene.slot].dimension == 3));
        assert_ne!(Scene::sampled(8, 0, &slots).unwrap().text, scenes[0].text);
    }
}
