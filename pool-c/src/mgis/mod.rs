//! Behaviours for hosts of MGIS, the support library of MFront's generic interface.
//!
//! A host finds the behaviours `GrainCell` (small strains) and `GrainCellFiniteStrain` in this library by the [`symbols`] that MGIS looks
//! up, and calls one function per point and iteration with the state at the begin of the step. States are values ([`states`]): a host may
//! repeat a step, with any length. Components and measures are those of MFront ([`crate::measures`]). The layout of [`View`] is that of MGIS
//! from 2.0 on.

mod states;
mod symbols;

use crate::ffi_boundary::{Failure, REFUSED, slice, slice_mut};
use crate::functions::scalars_of;
use crate::measures::{self, Components, End, Kind, Operator, Stress, UNIT};
use grain_pool::State;
use protocol::{TangentKind, Tensor2, Tensor4};
use states::States;
use std::ffi::{c_char, c_int};
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

/// Answers of a behaviour.
const DONE: c_int = 1;
const FAILED: c_int = -1;
/// Length of the room for an error message.
const MESSAGE: usize = 512;
/// Share of the step that the host is asked to try after a refusal.
const SMALLER: f64 = 0.5;
/// Kinds of operator above this one ask for the speed of sound too: MGIS adds 100 to the kind.
const WITH_SPEED: f64 = 50.0;

/// State at the begin or at the end of a step, as MGIS lays it out.
#[repr(C)]
#[derive(Clone, Copy)]
struct StateView {
    gradients: *const f64,
    forces: *mut f64,
    mass_density: *const f64,
    material_properties: *const f64,
    internal_variables: *mut f64,
    stored_energy: *mut f64,
    dissipated_energy: *mut f64,
    external_variables: *const f64,
}

/// A point as MGIS lays it out.
#[repr(C)]
pub struct View {
    message: *mut c_char,
    duration: f64,
    operator: *mut f64,
    time_factor: *mut f64,
    speed_of_sound: *mut f64,
    before: StateView,
    after: StateView,
}

/// Which behaviour and modelling hypothesis a host calls.
#[derive(Clone, Copy, Debug)]
struct Behaviour {
    is_finite: bool,
    is_plane_strain: bool,
    places: Components,
}

impl Behaviour {
    const fn new(is_finite: bool, is_plane_strain: bool, in_space: bool) -> Self {
        Self { is_finite, is_plane_strain, places: Components { in_space } }
    }

    fn gradient(self) -> Kind {
        if self.is_finite { Kind::General } else { Kind::Symmetric }
    }

    /// Measures that the host wants: `K[1]` and `K[2]` of MGIS.
    fn measures(self, wanted: &[f64]) -> Result<(Stress, Operator), Failure> {
        if !self.is_finite {
            return Ok((Stress::Cauchy, Operator::Strain));
        }
        let unknown = |what: &str, value: f64| Failure::input(format!("there is no {what} number {value}"));
        let stress = match wanted[1].round() {
            0.0 => Stress::Cauchy,
            1.0 => Stress::SecondPiola,
            2.0 => Stress::FirstPiola,
            other => return Err(unknown("stress measure", other)),
        };
        let operator = match wanted[2].round() {
            0.0 => Operator::CauchyByGradient,
            1.0 => Operator::SecondPiolaByStrain,
            2.0 => Operator::FirstPiolaByGradient,
            3.0 => Operator::KirchhoffByStep,
            other => return Err(unknown("tangent operator", other)),
        };
        Ok((stress, operator))
    }
}

/// What the host wants besides the stress: the tangent operator, and whether the step is integrated.
///
/// # Errors
/// The speed of sound is wanted. A packing has another one in every direction, and its tangent is not symmetric; a host that chose its
/// time step by one number would take what nobody has measured.
fn wanted(kind: f64, usual: TangentKind) -> Result<(TangentKind, bool), Failure> {
    if kind.is_nan() {
        return Err(Failure::input("K[0], which says what is asked for, is not a number"));
    }
    if kind > WITH_SPEED {
        return Err(Failure::input(format!(
            "K[0] = {kind} asks for the speed of sound, which cells do not give; call without it, and take it from the tangent operator and \
             the density"
        )));
    }
    let tangent = match kind.abs() {
        size if size < 0.5 => TangentKind::None,
        size if size < 2.5 => TangentKind::TrussLike,
        _ => usual,
    };
    Ok((tangent, kind > -0.5))
}

fn known() -> &'static Mutex<States<State>> {
    static KNOWN: Mutex<States<State>> = Mutex::new(States::new());
    &KNOWN
}

/// # Safety
/// The view is as MGIS lays it out for this behaviour and hypothesis.
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
unsafe fn integrate(view: &View, behaviour: Behaviour) -> Result<(), Failure> {
    let count = behaviour.places.count(behaviour.gradient());
    let options_of_operator = if behaviour.is_finite { 3 } else { 1 };
    // SAFETY: as promised by the caller.
    let (gradients, variables, operator) = unsafe {
        (
            [
                slice(view.before.gradients, count, "s0.gradients")?,
                slice(view.after.gradients, count, "s1.gradients")?,
            ],
            slice(view.before.internal_variables, 1 + scalars_count(), "s0.internal_state_variables")?,
            slice(view.operator, options_of_operator, "K")?,
        )
    };
    let material = crate::material::material()?;
    let (tangent, is_integrated) = wanted(operator[0], material.tangent())?;
    let (measure, kind) = behaviour.measures(operator)?;
    let [before, after] = gradients.map(|one| behaviour.places.tensor(behaviour.gradient(), one));
    let (before, after, step) = match (behaviour.is_finite, is_integrated) {
        (true, true) => (before, after, measures::step(&before, &after)),
        (true, false) => (before, before, measures::ZERO),
        // Small strains: the step alone, from the unit tensor.
        (false, true) => {
            let step = measures::sum(&after, -1.0, &before);
            (UNIT, measures::sum(&UNIT, 1.0, &step), step)
        }
        (false, false) => (UNIT, UNIT, measures::ZERO),
    };
    let target = Tensor2::from_rows(&step);

    let target = match (material.pool.dimension(), behaviour.is_plane_strain) {
        (2, true) => material.target_of_cell(&target)?,
        (2, false) => {
            let text = "cells of discs serve plane strain only; use a packing of spheres";
            return Err(Failure::input(text));
        }
        _ => target,
    };
    let number = number_of(variables[0])?;
    let options = material.options(tangent);
    let state = known().lock().unwrap_or_else(PoisonError::into_inner).enter(number, material)?;
    let result = material.trial(state, target, options)?;
    let end =
        End { before, after, stress: &result.stress, tangent: result.tangent.as_deref().unwrap_or(&Tensor4::ZERO) };
    if tangent != TangentKind::None {
        let values = end.operator(kind, behaviour.places);
        // SAFETY: as promised by the caller.
        fill(unsafe { slice_mut(view.operator, values.len()) }, values, "K")?;
    }
    if is_integrated {
        let made = known().lock().unwrap_or_else(PoisonError::into_inner).made(number, target, options);
        let values = end.force(measure, behaviour.places);
        // SAFETY: as promised by the caller.
        fill(unsafe { slice_mut(view.after.forces, values.len()) }, values, "s1.thermodynamic_forces")?;
        let variables: Vec<f64> = std::iter::once(made as f64).chain(scalars_of(&result)).collect();
        // SAFETY: as promised by the caller.
        let room = unsafe { slice_mut(view.after.internal_variables, variables.len()) };
        fill(room, variables, "s1.internal_state_variables")?;
    }
    Ok(())
}

/// Number of scalars after the number of the state.
const fn scalars_count() -> usize {
    5
}

fn fill(room: Option<&mut [f64]>, values: Vec<f64>, name: &str) -> Result<(), Failure> {
    let room = room.ok_or_else(|| Failure::input(format!("`{name}` is a null pointer")))?;
    room.copy_from_slice(&values);
    Ok(())
}

/// The number of a state from the variable of the host.
fn number_of(value: f64) -> Result<u64, Failure> {
    if value >= 0.0 && value.fract() == 0.0 && value < 9e15 {
        Ok(value as u64)
    } else {
        Err(Failure::input(format!("GrainState = {value} is no number of a state; begin with 0")))
    }
}

/// # Safety
/// As [`integrate`].
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
unsafe fn answer(view: *mut View, behaviour: Behaviour) -> c_int {
    // SAFETY: as promised by the caller.
    let Some(view) = (unsafe { view.as_ref() }) else { return FAILED };
    // SAFETY: as promised by the caller.
    let answered = catch_unwind(AssertUnwindSafe(|| unsafe { integrate(view, behaviour) }));
    let (text, is_refusal) = match answered {
        Ok(Ok(())) => return DONE,
        Ok(Err(failure)) => (failure.text, failure.code == REFUSED),
        Err(_) => ("a defect of this library".to_owned(), false),
    };
    let has_room = !view.message.is_null();
    // Hosts such as OpenGeoSys keep the text to themselves. What a smaller step does not cure is for people.
    if !(has_room && is_refusal) {
        let _ = writeln!(std::io::stderr(), "grainspan behaviour: {text}");
    }
    // SAFETY: as promised by the caller.
    unsafe {
        if let Some(factor) = slice_mut(view.time_factor, 1) {
            factor[0] = factor[0].min(SMALLER);
        }
        if let Some(room) = slice_mut(view.message, MESSAGE) {
            let bytes = text.bytes().filter(|&byte| byte != 0).take(MESSAGE - 1).chain(std::iter::once(0));
            room.iter_mut().zip(bytes).for_each(|(place, byte)| *place = byte as c_char);
        }
    }
    FAILED
}

macro_rules! entries {
    ($($name:ident: $symbol:literal, $finite:literal, $plane:literal, $space:literal;)*) => {$(
        /// The entry of a behaviour and hypothesis that hosts of MGIS call for every point and iteration: 1 is success, -1 a failure.
        ///
        /// # Safety
        /// The view is as MGIS lays it out for this behaviour and hypothesis.
        #[unsafe(export_name = $symbol)]
        #[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
        pub unsafe extern "C" fn $name(view: *mut View) -> c_int {
            // SAFETY: as promised by the caller.
            unsafe { answer(view, Behaviour::new($finite, $plane, $space)) }
        }
    )*};
}

entries! {
    small_plane_strain: "GrainCell_PlaneStrain", false, true, false;
    small_axisymmetrical: "GrainCell_Axisymmetrical", false, false, false;
    small_tridimensional: "GrainCell_Tridimensional", false, false, true;
    finite_plane_strain: "GrainCellFiniteStrain_PlaneStrain", true, true, false;
    finite_axisymmetrical: "GrainCellFiniteStrain_Axisymmetrical", true, false, false;
    finite_tridimensional: "GrainCellFiniteStrain_Tridimensional", true, false, true;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_of_operator_are_those_of_mgis() {
        let usual = TangentKind::TrussLikeSlip;
        let cases = [
            (0.0, TangentKind::None, true),
            (1.0, TangentKind::TrussLike, true),
            (4.0, usual, true),
            (-1.0, TangentKind::TrussLike, false),
            (-3.0, usual, false),
        ];
        for (kind, tangent, is_integrated) in cases {
            assert_eq!(wanted(kind, usual).unwrap(), (tangent, is_integrated), "{kind}");
        }
    }

    /// It was left as it stood, and the step counted as done.
    #[test]
    fn the_speed_of_sound_is_refused() {
        for kind in [97.0, 100.0, 104.0] {
            let error = wanted(kind, TangentKind::TrussLikeSlip).unwrap_err().text;
            assert!(error.contains("speed of sound"), "{error}");
        }
        let error = wanted(f64::NAN, TangentKind::TrussLikeSlip).unwrap_err().text;
        assert!(error.contains("not a number"), "it counted as done: {error}");
    }
}
