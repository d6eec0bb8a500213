//! One case: a packing, a contact law, options and a path, drawn from the seed of the campaign and the number of the case.

use super::packings::Slot;
use super::path::{Course, Kind, segments};
use super::random_stream::{Purpose, RandomStream};
use rve_server::contact::{ContactTable, LawName, NormalStiffness, Rotations, TangentialUnloading};
use rve_server::definition::{Accuracy, RveOptions};
use rve_server::programs::rve_test::ElementTest;
use std::path::PathBuf;

/// Every fifth case is one of spheres.
const SPHERES_AMONG: u64 = 5;

/// Share of the cases whose accuracy is an error that is asked for, `rve.error`.
const ERROR_SHARE: f64 = 0.35;

/// What is expected of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Range {
    /// Parameters that people use every day: the solver has to bring all increments to rest.
    Everyday,
    /// Away from everything that the solver was tuned on.
    Hard,
}

impl Range {
    /// Both.
    pub(super) const ALL: [Self; 2] = [Self::Everyday, Self::Hard];

    /// Name on the command line and in tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Everyday => "everyday",
            Self::Hard => "hard",
        }
    }
}

/// One case of a campaign.
#[derive(Clone, Debug)]
pub(super) struct Case {
    /// Its number; with the seed of the campaign it is all that is needed to make it again.
    pub(super) number: u64,
    /// What is expected of it.
    pub(super) range: Range,
    /// Its path.
    pub(super) kind: Kind,
    /// Its packing among the slots of the campaign.
    pub(super) slot: usize,
    /// The test, with a packing by name.
    pub(super) test: ElementTest,
}

/// Draws a case; `has_long_cycles` gives cases of many cycles 10 000 of them instead of some tens.
pub(super) fn sampled(seed: u64, number: u64, slots: &[Slot], has_long_cycles: bool) -> Case {
    let stream = &mut RandomStream::new(seed, Purpose::Case(number));
    let range = if stream.chance(0.5) { Range::Everyday } else { Range::Hard };
    let dimension = if number % SPHERES_AMONG == SPHERES_AMONG - 1 { 3 } else { 2 };
    let kind = match range {
        Range::Everyday => stream.pick(&Kind::EVERYDAY),
        Range::Hard => stream.pick(&Kind::ALL),
    };
    let slot = sampled_slot(range, dimension, kind, slots, stream);
    let packing = &slots[slot];
    let contact = sampled_contact(range, packing, stream);
    let accuracy = sampled_accuracy(range, packing, stream);
    let course = sampled_course(range, kind, &accuracy, packing, has_long_cycles, stream);
    let test = ElementTest {
        packing: PathBuf::from(format!("{}.json", packing.name)),
        stress_tolerance: 1e-3,
        contact,
        rve: accuracy,
        frame: None,
        path: segments(kind, &course, stream),
    };
    Case { number, range, kind, slot, test }
}

/// A packing that the range may use; large ones are rare because they are dear.
fn sampled_slot(range: Range, dimension: u32, kind: Kind, slots: &[Slot], stream: &mut RandomStream) -> usize {
    let may = |slot: &Slot| {
        let is_small_enough = kind != Kind::Skewed && kind != Kind::LongCycles || slot.number <= 100;
        slot.dimension == dimension && is_small_enough && (slot.is_everyday || range == Range::Hard)
    };
    let weight = |slot: &Slot| match slot.number {
        0..=100 => 1.0,
        101..=400 => 0.5,
        _ => 0.3,
    };
    let weighed: Vec<(f64, usize)> =
        slots.iter().enumerate().filter(|(_, slot)| may(slot)).map(|(place, slot)| (weight(slot), place)).collect();
    stream.weighed(&weighed)
}

/// The law that the packing was made with, so that its forces are those of the file, with other tangential springs, friction
/// and extensions.
pub(crate) fn sampled_contact(range: Range, slot: &Slot, stream: &mut RandomStream) -> ContactTable {
    let mut contact = slot.contact.clone();
    let is_everyday = range == Range::Everyday;
    contact.friction = match range {
        Range::Everyday => stream.between(0.1, 1.0),
        Range::Hard => stream.weighed(&[(0.1, 0.0), (0.1, 2.0), (0.8, f64::NAN)]),
    };
    if contact.friction.is_nan() {
        contact.friction = stream.between(0.0, 2.0);
    }
    match contact.law {
        LawName::Linear => {
            let ratio = if is_everyday { stream.between(0.2, 1.0) } else { stream.between(0.0, 1.3) };
            contact.stiffness_ratio = Some(if !is_everyday && stream.chance(0.05) { 0.0 } else { ratio });
        }
        LawName::HertzMindlin => {
            let poisson = if is_everyday { stream.between(0.05, 0.4) } else { stream.between(-0.3, 0.5) };
            // The normal springs stay as they are: G / (1 - nu).
            let before = contact.poisson_ratio.unwrap_or(0.0);
            contact.shear_modulus = contact.shear_modulus.map(|modulus| modulus * (1.0 - poisson) / (1.0 - before));
            contact.poisson_ratio = Some(poisson);
            if !is_everyday && stream.chance(0.2) {
                contact.unloading = Some(TangentialUnloading::Incremental);
            }
        }
    }
    match stream.unit() {
        share if share < 0.15 => contact.rotations = Rotations::Blocked,
        share if share < 0.35 => {
            contact.rolling_stiffness =
                if is_everyday { stream.between(0.2, 1.0) } else { stream.decades(0.05, 5.0) };
            contact.rolling_friction = stream.between(0.05, 0.5);
        }
        _ => {}
    }
    if !is_everyday {
        if stream.chance(0.15) {
            // Up to the overlap of a contact under the pressure of the packing.
            contact.cohesion = stream.decades(0.01, 1.0) * slack(slot) * 5e-4;
        }
        if stream.chance(0.1) {
            contact.damping = stream.between(0.05, 1.0);
        }
    }
    contact
}

/// A named accuracy, or an error as scenes ask for one. A cell without a run around it takes the error as fixed: no estimate tells it more.
fn sampled_accuracy(range: Range, slot: &Slot, stream: &mut RandomStream) -> RveOptions {
    if stream.chance(ERROR_SHARE) {
        return RveOptions { error: Some(sampled_error(stream)), ..RveOptions::default() };
    }
    let is_large = slot.number > 400;
    let draft = if is_large { 0.95 } else { 0.6 };
    let accuracy = match stream.unit() {
        share if share < draft => Accuracy::Draft,
        share if range == Range::Everyday || is_large || share < 0.97 => Accuracy::Default,
        _ => Accuracy::Tight,
    };
    RveOptions { accuracy, ..RveOptions::default() }
}

/// An error of the stress over the pressure, around the 5e-3 that scenes keep to by default.
pub(crate) fn sampled_error(stream: &mut RandomStream) -> f64 {
    stream.decades(1e-3, 1e-2)
}

fn sampled_course(
    range: Range,
    kind: Kind,
    accuracy: &RveOptions,
    slot: &Slot,
    has_long_cycles: bool,
    stream: &mut RandomStream,
) -> Course {
    let is_everyday = range == Range::Everyday;
    let increment = match kind {
        Kind::Skewed => 1e-2,
        Kind::LongCycles => stream.decades(1e-5, 3e-4),
        Kind::Cyclic if !is_everyday => stream.decades(1e-5, 2e-3),
        _ if is_everyday => stream.pick(&[5e-4, 1e-3]),
        _ => stream.decades(1e-6, 5e-3),
    };
    let count = match kind {
        Kind::Skewed => 20 + stream.below(40) as u32,
        Kind::Decades => 12,
        _ if is_everyday => 20 + stream.below(6) as u32,
        _ => 5 + stream.below(21) as u32,
    };
    // Strain steps are the price of accuracy, and grains that of a step.
    let dearness = match accuracy.strain_per_step() {
        step if step > 3e-6 => 1.0,
        step if step > 5e-7 => 0.5,
        _ => 0.01,
    } * if slot.number > 400 { 0.2 } else { 1.0 };
    let increment = if is_everyday { increment } else { increment * dearness };
    let count = if is_everyday && slot.number > 400 { 8 } else { count };
    Course {
        dimension: slot.dimension as usize,
        increment,
        count,
        pressure: slot.pressure,
        slack: slack(slot),
        cycles: if has_long_cycles { 10_000 } else { 10 + stream.below(21) as u32 },
    }
}

/// Linear strain that takes the pressure off a packing, roughly: pressure over stiffness of an assembly of its contacts.
fn slack(slot: &Slot) -> f64 {
    let pressure = slot.pressure;
    match slot.contact.normal() {
        // Discs of about 0.25 mm and as thick as they are wide, spheres of any size.
        Ok(NormalStiffness::Modulus(modulus)) => 2.0 * pressure / modulus,
        Ok(NormalStiffness::Constant(stiffness)) => 1.8 * pressure / stiffness,
        Err(_) => (pressure / slot.contact.shear_modulus.unwrap_or(pressure)).powf(2.0 / 3.0),
    }
}

#[cfg(test)]
mod tests {
    use super::super::packings::slots;
    use super::*;

    #[test]
    fn cases_are_sound_repeatable_and_of_all_sorts() {
        let slots = slots(7).unwrap();
        let cases: Vec<Case> = (0..600).map(|number| sampled(7, number, &slots, false)).collect();
        for case in &cases {
            let text = toml::to_string(&case.test).unwrap();
            assert_eq!(ElementTest::from_toml(&text).unwrap(), case.test, "case {}: {text}", case.number);
            assert_eq!(sampled(7, case.number, &slots, false).test, case.test);
            let is_everyday = case.range == Range::Everyday;
            assert!(!is_everyday || slots[case.slot].is_everyday && Kind::EVERYDAY.contains(&case.kind));
        }
        for kind in Kind::ALL {
            assert!(cases.iter().any(|case| case.kind == kind), "{}", kind.name());
        }
        let spheres = cases.iter().filter(|case| slots[case.slot].dimension == 3).count();
        assert_eq!(spheres, 120);
        assert_ne!(sampled(8, 0, &slots, false).test, cases[0].test);
    }
}
