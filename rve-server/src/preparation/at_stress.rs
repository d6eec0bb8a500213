//! Packings brought from their own stress to another one, so that a body can start with the stress of its depth.

use super::compaction::{
    Compaction, StepsWithoutPressure, TOLERANCES_OF_CHANGED_PACKINGS, Tolerances, packing_error, rows,
};
use super::progress::ProgressLog;
use super::rotation::rotated;
use super::soft_grains::too_soft_for;
use super::stress_target::{Matrix, StressTarget, symmetric, turned_in};
use crate::contact::ContactTable;
use crate::definition::{AnyDefinition, GrainDefinition, PackingError, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::solver::SolverFor;
use crate::space::{Components, Space};
use protocol::Observables;

/// The same on the way.
const TOLERANCES_ON_THE_WAY: Tolerances = Tolerances { force: 1e-4, stress: 1e-3 };

/// Those of a cell that comes no nearer to its stress at the end of the last attempt; it counts as [`PreparedCell::next_to_stress`].
const TOLERANCES_NEXT_TO_STRESS: Tolerances = Tolerances { stress: 1e-4, ..TOLERANCES_OF_CHANGED_PACKINGS };

/// Largest change of the logarithm of the pressure between two stresses on the way: a quarter of the pressure.
const PRESSURE_STRIDE: f64 = 0.22;

/// Largest change of a component of the deviator over the pressure between two stresses on the way.
const DEVIATOR_STRIDE: f64 = 0.05;

/// Most servo steps of one stride: a stress that grains can carry takes some tens.
const MOST_INCREMENTS: u32 = 500;

/// Largest strain of one stride. Grains that can carry a stress take some per mille to it, at their strength some per cent.
const MOST_STRAIN: f64 = 0.1;

/// How many times as many strides the attempts have. A cell that snaps across its target on one way may reach it on another.
const ATTEMPTS: [u32; 3] = [1, 3, 7];

/// Largest component of Y1 out of the plane of axes 1 and 2, over its length, that is taken for none.
const ALIGNED: f64 = 1e-9;

/// A definition whose packing has been brought to a stress.
#[derive(Clone, Debug)]
pub struct PreparedCell {
    /// The definition.
    pub definition: AnyDefinition,
    /// Whether the stress was reached in smaller steps only.
    pub in_smaller_steps: bool,
    /// Whether it was missed, by at most 1e-4 of the pressure.
    pub next_to_stress: bool,
}

impl AnyDefinition {
    /// The definition with its packing brought under its own contact law to `stress`, Pa, by rows, tension positive; plane packings take
    /// the upper left block. Grains follow a straight path in the logarithm of the pressure and the ratio of deviator to pressure; if that
    /// does not end at the stress, up to twice more in smaller steps. Equal arguments give equal bits.
    ///
    /// # Errors
    /// [`PackingError::Content`] if the packing bears tension or no load, its vectors Y1 and Y2 point out of the plane of axes 1 and 2,
    /// the stress is not compressive, or the grains cannot carry it.
    pub fn at_stress(&self, stress: &[[f64; 3]; 3]) -> Result<PreparedCell, PackingError> {
        Ok(match self {
            Self::Discs(definition) => brought(definition, stress)?
                .prepared(|packing| Self::Discs(GrainDefinition { packing, ..definition.clone() })),
            Self::Spheres(definition) => brought(definition, stress)?
                .prepared(|packing| Self::Spheres(GrainDefinition { packing, ..definition.clone() })),
        })
    }
}

/// A packing at a stress, and how it came there.
struct Brought<S: Space> {
    packing: PackingFile<S>,
    in_smaller_steps: bool,
    next_to_stress: bool,
}

impl<S: Space> Brought<S> {
    fn prepared(self, definition: impl FnOnce(PackingFile<S>) -> AnyDefinition) -> PreparedCell {
        let Self { packing, in_smaller_steps, next_to_stress } = self;
        PreparedCell { definition: definition(packing), in_smaller_steps, next_to_stress }
    }
}

/// The packing at the stress. [`Compaction`] writes packings whose vector Y1 points along axis 1, so
/// the packing is turned there and back.
fn brought<S: SolverFor>(definition: &GrainDefinition<S>, stress: &Matrix) -> Result<Brought<S>, PackingError> {
    let GrainDefinition { packing, contact, .. } = definition;
    if !has_level_vectors(packing) {
        return Err(PackingError::Content(
            "its vectors Y1 and Y2 point out of the plane of axes 1 and 2; turn the packing so that they lie in it"
                .into(),
        ));
    }
    let first = packing.periodicity[0];
    let angle = first[1].atan2(first[0]);
    let (sine, cosine) = angle.sin_cos();
    let turned_axes = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]];
    let turned_stress = if angle == 0.0 { *stress } else { symmetric(&turned_in(stress, &turned_axes)) };
    let along_first_axis = rotated(packing, -angle)?;
    if along_first_axis.periodicity[1][1] < 0.0 {
        return Err(PackingError::Content(
            "its vector Y2 lies clockwise of Y1 in the plane of axes 1 and 2; write -Y2 and -Y3 for Y2 and Y3, which make the same lattice"
                .into(),
        ));
    }
    let brought = along_axis(&along_first_axis, contact, &turned_stress)?;
    Ok(Brought { packing: rotated(&brought.packing, angle)?, ..brought })
}

/// Whether Y1 and Y2 lie in the plane of axes 1 and 2, as those of the packings that [`Compaction`] writes.
pub(super) fn has_level_vectors<S: Space>(packing: &PackingFile<S>) -> bool {
    let is_level = |vector: &S::Vector| (2..S::DIMENSION).all(|axis| vector[axis].abs() <= ALIGNED * vector.norm());
    is_level(&packing.periodicity[0]) && is_level(&packing.periodicity[1])
}

/// As [`brought`], of a packing whose vector Y1 points along axis 1.
fn along_axis<S: SolverFor>(
    packing: &PackingFile<S>,
    contact: &ContactTable,
    stress: &Matrix,
) -> Result<Brought<S>, PackingError> {
    let definition =
        GrainDefinition { packing: packing.clone(), contact: contact.clone(), options: RveOptions::default() };
    let answer = GrainRve::<S>::new(&definition).and_then(|mut cell| cell.observe(Observables::NONE));
    let own = symmetric(&rows(&answer.map_err(packing_error)?.stress));
    let end = target::<S>(stress)?;
    if let Some(reason) = too_soft_for(packing, contact, end.pressure) {
        return Err(PackingError::Content(reason));
    }
    let begin = target::<S>(&own).map_err(|error| {
        PackingError::Content(format!(
            "the stress of the packing itself under this contact law cannot be used as the starting stress: {error}; a packing that was \
             prepared with this law, its cohesion included, bears pressure"
        ))
    })?;
    let strides = strides(&begin, &end);
    let mut reason = None;
    for (number, finer) in ATTEMPTS.into_iter().enumerate() {
        let is_last = number + 1 == ATTEMPTS.len();
        match along(packing, contact, [&begin, &end], finer * strides, is_last) {
            Ok((packing, next_to_stress)) => {
                return Ok(Brought { packing, in_smaller_steps: number > 0, next_to_stress });
            }
            Err(error) => reason = Some(error),
        }
    }
    Err(reason.expect("there is an attempt"))
}

/// The packing brought from one stress to the other in `strides` equal changes of the target, and whether it ends next to its stress only, which
/// it may if `may_miss`.
fn along<S: SolverFor>(
    packing: &PackingFile<S>,
    contact: &ContactTable,
    [begin, end]: [&StressTarget; 2],
    strides: u32,
    may_miss: bool,
) -> Result<(PackingFile<S>, bool), PackingError> {
    let mut ignore = |_: &_| {};
    let log = ProgressLog::new(&mut ignore);
    let mut compaction = Compaction::new(packing.clone(), contact, *begin, TOLERANCES_ON_THE_WAY, &log)?;
    let mut carried = *begin;
    let mut reach = |aim: StressTarget, tolerances: Tolerances| {
        compaction.aim_at(aim, tolerances, MOST_INCREMENTS, MOST_STRAIN);
        compaction.servo(StepsWithoutPressure::Many).map_err(|error| with_what_was_carried(error, &carried))?;
        carried = aim;
        Ok(())
    };
    for stride in 1..strides {
        reach(between(begin, end, f64::from(stride) / f64::from(strides)), TOLERANCES_ON_THE_WAY)?;
    }
    let at_end = reach(*end, TOLERANCES_OF_CHANGED_PACKINGS);
    let misses = at_end.is_err();
    at_end.or_else(|error| if may_miss { reach(*end, TOLERANCES_NEXT_TO_STRESS) } else { Err(error) })?;
    Ok((compaction.packing(serde_json::Value::Null)?, misses))
}

/// The error with the stress that was reached before it.
fn with_what_was_carried(error: PackingError, carried: &StressTarget) -> PackingError {
    let PackingError::Content(reason) = error else { return error };
    let [smallest, largest] = carried.principal_pressures();
    PackingError::Content(format!(
        "{reason}; on the way it carried a pressure of {:.3e} Pa with smallest over largest principal stress {:.2}",
        carried.pressure,
        smallest / largest
    ))
}

fn target<S: Space>(stress: &Matrix) -> Result<StressTarget, PackingError> {
    StressTarget::of_tensor(stress, S::DIMENSION)
}

/// Number of stresses from one to the other, the last one included.
fn strides(begin: &StressTarget, end: &StressTarget) -> u32 {
    let pressure = (end.pressure / begin.pressure).ln().abs() / PRESSURE_STRIDE;
    let components = begin.deviator.iter().flatten().zip(end.deviator.iter().flatten());
    let turn = components.map(|(from, to)| (to / end.pressure - from / begin.pressure).abs()).fold(0.0, f64::max);
    // Both are finite and positive.
    pressure.max(turn / DEVIATOR_STRIDE).ceil().max(1.0) as u32
}

/// The stress at a share of the way.
fn between(begin: &StressTarget, end: &StressTarget, share: f64) -> StressTarget {
    let pressure = begin.pressure * (end.pressure / begin.pressure).powf(share);
    let deviator = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (from, to) = (begin.deviator[i][j] / begin.pressure, end.deviator[i][j] / end.pressure);
            pressure * (from + share * (to - from))
        })
    });
    StressTarget { pressure, deviator, ..*end }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::definition::Packing;
    use crate::space::determinant;
    use std::path::Path;

    fn cell(name: &str, modulus: f64, angle: f64) -> AnyDefinition {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings").join(name);
        let packing = Packing::read(&path).unwrap().rotated(angle).unwrap();
        let contact =
            ContactTable { modulus: Some(modulus), normal_stiffness: None, ..ContactTable::linear(1.0, 0.5, 0.5) };
        AnyDefinition::new(packing, contact, RveOptions::default())
    }

    /// Stress and volume of the packing as it is read.
    fn state_of(cell: &AnyDefinition) -> (Matrix, f64) {
        fn of<S: SolverFor>(definition: &GrainDefinition<S>) -> (Matrix, f64) {
            let answer = GrainRve::new(definition).unwrap().observe(Observables::NONE).unwrap();
            (rows(&answer.stress), determinant(&definition.packing.periodicity))
        }
        match cell {
            AnyDefinition::Discs(definition) => of(definition),
            AnyDefinition::Spheres(definition) => of(definition),
        }
    }

    fn at_rest(coefficient: f64, pressure: f64) -> Matrix {
        [[-coefficient * pressure, 0.0, 0.0], [0.0, -pressure, 0.0], [0.0, 0.0, -coefficient * pressure]]
    }

    /// Less and more pressure than the packing has, with a coefficient of earth pressure at rest, for cells along the axes and turned ones.
    #[test]
    fn the_file_carries_the_stress_as_it_is_read() {
        for (angle, pressure) in [(0.0f64, 2e4), (0.0, 4e5), (0.6, 5e4), (2.0, 2e5)] {
            let (given, wanted) = (cell("discs-100.json", 6e7, angle), at_rest(0.5, pressure));
            let (stress, volume) = state_of(&given.at_stress(&wanted).unwrap().definition);
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let error = (stress[i][j] - wanted[i][j]).abs() / pressure;
                assert!(error < 2e-6, "{angle} {pressure}: {i}{j} is off by {error:e}");
            }
            assert!((volume / state_of(&given).1 - 1.0).abs() < 0.02);
        }
    }

    /// Close to the strength of its grains it snaps across its target by some 1e-5 of the pressure in every attempt.
    #[test]
    fn a_cell_that_snaps_next_to_its_stress_is_taken_and_counted() {
        let AnyDefinition::Discs(mut given) = cell("discs-100.json", 2e7, 0.0) else { panic!("discs") };
        given.contact.stiffness_ratio = Some(0.8);
        given.contact.friction = 0.35;
        // 1.61 m below a ground that carries 10 kPa, at a Gauss point of eight elements over 4 m.
        let wanted = at_rest(0.5, 42_113.248_654_051_87);
        let made = AnyDefinition::Discs(given).at_stress(&wanted).unwrap();
        assert!(made.in_smaller_steps && made.next_to_stress);
        let (stress, _) = state_of(&made.definition);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let error = (stress[i][j] - wanted[i][j]).abs() / wanted[1][1].abs();
            assert!(error < 1e-4, "{i}{j} is off by {error:e}");
        }
    }

    /// They were pressed into one another by more than a diameter, which the engine refused then.
    #[test]
    fn grains_too_soft_for_the_stress_are_refused() {
        let Err(refused) = cell("discs-100.json", 1e5, 0.0).at_stress(&at_rest(0.5, 1e5)) else {
            panic!("no packing bears that")
        };
        assert!(refused.to_string().contains("would overlap by about"), "{refused}");
    }

    /// The same lattice by vectors that lean far, which the first trial describes by shorter ones.
    #[test]
    fn cells_that_lean_by_whole_vectors_are_brought_to_it() {
        let AnyDefinition::Discs(mut given) = cell("discs-100.json", 6e7, 0.0) else { panic!("discs") };
        let [first, second] = &mut given.packing.periodicity;
        (0..2).for_each(|axis| second[axis] += 2.0 * first[axis]);
        given.packing.contacts.clear();
        let wanted = at_rest(0.5, 1.5e5);
        let (stress, _) = state_of(&AnyDefinition::Discs(given).at_stress(&wanted).unwrap().definition);
        assert!((stress[1][1] / wanted[1][1] - 1.0).abs() < 2e-6, "{stress:?}");
    }

    /// One lattice by two pairs of vectors, none of which points along axis 1: the fabric of one was turned by 116 degrees against that of the
    /// other, at the right stress.
    #[test]
    fn the_choice_of_vectors_turns_nothing() {
        let fabric = |mix: [[f64; 2]; 2]| {
            let AnyDefinition::Discs(mut given) = cell("discs-liu2018-a08.json", 1e9, 0.0) else { panic!("discs") };
            given.contact = ContactTable::linear(1e7, 0.2, 0.4);
            let [first, second] = given.packing.periodicity;
            given.packing.periodicity =
                mix.map(|[one, other]| std::array::from_fn(|axis| one * first[axis] + other * second[axis]));
            given.packing.contacts.clear();
            let isotropic = at_rest(1.0, 1.5e5);
            let AnyDefinition::Discs(made) = AnyDefinition::Discs(given).at_stress(&isotropic).unwrap().definition
            else {
                panic!("discs")
            };
            rows(&GrainRve::new(&made).unwrap().observe(Observables::FABRIC).unwrap().observed.fabric)
        };
        let (plain, mixed) = (fabric([[1.0, 0.0], [0.0, 1.0]]), fabric([[2.0, 1.0], [1.0, 1.0]]));
        for (i, j) in [(0, 0), (0, 1), (1, 1)] {
            assert!((plain[i][j] - mixed[i][j]).abs() < 2e-3, "{plain:?} {mixed:?}");
        }
        assert!((plain[0][0] - plain[1][1]).abs() > 8e-3, "without anisotropy a turn is not seen: {plain:?}");
    }

    #[test]
    fn spheres_too() {
        let wanted = at_rest(0.5, 6e4);
        let (stress, _) = state_of(&cell("spheres-100.json", 6e7, 0.0).at_stress(&wanted).unwrap().definition);
        for i in 0..3 {
            assert!((stress[i][i] / wanted[i][i] - 1.0).abs() < 2e-6, "{stress:?}");
        }
    }

    /// Found in a mesh of 9 x 3 elements: on the first way this cell snaps to and fro across the stress, which it can carry.
    #[test]
    fn a_stress_that_is_missed_on_one_way_is_reached_on_another() {
        let wanted = at_rest(0.5, 1e4 + 2e4 * (4.0 / 3.0) * 0.5 * (1.0 - 1.0 / 3f64.sqrt()));
        let (stress, _) = state_of(&cell("discs-100.json", 1e8, 0.0).at_stress(&wanted).unwrap().definition);
        assert!((stress[1][1] / wanted[1][1] - 1.0).abs() < 2e-6, "{stress:?}");
    }

    /// Friction 0.5 between grains: no packing of them carries a ratio of ten.
    #[test]
    fn a_stress_that_grains_cannot_carry_is_refused() {
        let cell = cell("discs-100.json", 6e7, 0.0);
        let refusal = cell.at_stress(&at_rest(0.1, 1e5)).unwrap_err().to_string();
        let ratio: f64 = refusal.rsplit(' ').next().unwrap().parse().unwrap();
        // The strength of this cell in dense element tests: a friction angle of some 25 degrees.
        assert!((0.3..0.5).contains(&ratio), "{refusal}");
        assert!(cell.at_stress(&at_rest(-0.1, 1e5)).unwrap_err().to_string().contains("tension"));
    }
}
