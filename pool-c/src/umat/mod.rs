//! A user material with the conventions of Abaqus/Standard: `umat_`.
//!
//! Every [`place`] that a host names (NOEL, NPT, LAYER, KSPT) is a state of one pool. The host tries a point as often as it likes within an
//! increment; [`history`] tells iterations, restarts of an increment and the next increment apart by TIME(2) and DTIME. Stress and
//! tangent are converted in [`voigt`].
//!
//! The pool opens at the first call, with what the environment says ([`crate::material`]).

mod history;
mod place;
mod voigt;

use crate::ffi_boundary::{Failure, slice, slice_mut};
use crate::functions::scalars_of;
use crate::material::{Material, Strains};
use crate::measures::End;
use grain_pool::State;
use history::{Call, Points};
use place::Place;
use protocol::{Tensor2, Tensor4, TrialResult};
use std::ffi::{c_char, c_int};
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};
use voigt::Voigt;

/// Share of the time increment that the host is asked to try after a refusal.
const SMALLER: f64 = 0.5;

/// The points of the host.
fn known() -> &'static Mutex<Points<State>> {
    static KNOWN: Mutex<Points<State>> = Mutex::new(Points::new());
    &KNOWN
}

/// The entry that Abaqus/Standard calls for every integration point and iteration. Arguments as in its manual. Used are STRESS, STATEV,
/// DDSDDE, DSTRAN (small strains), TIME, DTIME, CMNAME, NDI, NSHR, NTENS, NSTATV, PNEWDT, DFGRD0, DFGRD1, NOEL, NPT, LAYER and KSPT.
///
/// STATEV receives void ratio, coordination number, unbalanced force ratio, largest overlap and volume ratio, as many as there are. A
/// refusal sets PNEWDT to 0.5 and leaves the rest; other failures are printed and do the same, so that the host ends in good order.
///
/// # Safety
/// The arrays have the lengths that the manual states.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn umat_(
    stress: *mut f64,
    statev: *mut f64,
    ddsdde: *mut f64,
    _sse: *mut f64,
    _spd: *mut f64,
    _scd: *mut f64,
    _rpl: *mut f64,
    _ddsddt: *mut f64,
    _drplde: *mut f64,
    _drpldt: *mut f64,
    _stran: *const f64,
    dstran: *const f64,
    time: *const f64,
    dtime: *const f64,
    _temp: *const f64,
    _dtemp: *const f64,
    _predef: *const f64,
    _dpred: *const f64,
    cmname: *const c_char,
    ndi: *const c_int,
    nshr: *const c_int,
    _ntens: *const c_int,
    nstatv: *const c_int,
    _props: *const f64,
    _nprops: *const c_int,
    _coords: *const f64,
    _drot: *const f64,
    pnewdt: *mut f64,
    _celent: *const f64,
    dfgrd0: *const f64,
    dfgrd1: *const f64,
    noel: *const c_int,
    npt: *const c_int,
    layer: *const c_int,
    kspt: *const c_int,
    _kstep: *const c_int,
    _kinc: *const c_int,
) {
    let answered = catch_unwind(AssertUnwindSafe(|| -> Result<(), Failure> {
        // SAFETY: as promised by the caller.
        let (call, shape, strain, states) = unsafe {
            let number = |pointer, name| Ok::<_, Failure>(slice::<c_int>(pointer, 1, name)?[0]);
            let value = |pointer, name| Ok::<_, Failure>(slice::<f64>(pointer, 1, name)?[0]);
            let call = Call {
                place: Place::new(
                    slice(cmname, 1, "CMNAME").ok().map(|name| name[0]),
                    [number(noel, "NOEL")?, number(npt, "NPT")?, number(layer, "LAYER")?, number(kspt, "KSPT")?],
                ),
                begin: slice(time, 2, "TIME")?[1],
                duration: value(dtime, "DTIME")?,
                before: voigt::gradient(slice(dfgrd0, 9, "DFGRD0")?),
                after: voigt::gradient(slice(dfgrd1, 9, "DFGRD1")?),
            };
            let shape = Voigt::new(number(ndi, "NDI")?, number(nshr, "NSHR")?)?;
            let strain = slice(dstran, shape.components(), "DSTRAN")?;
            (call, shape, strain, usize::try_from(number(nstatv, "NSTATV")?).unwrap_or(0))
        };
        let material = crate::material::material()?;
        let target = match material.strains {
            Strains::Finite | Strains::Lagrange => call.target(),
            Strains::Small => shape.strain(strain),
        };
        let result = evaluate(&call, target, material)?;
        let components = shape.components();
        // SAFETY: as promised by the caller.
        let (stress, statev, ddsdde) = unsafe {
            (slice_mut(stress, components), slice_mut(statev, states), slice_mut(ddsdde, components * components))
        };
        let given = || Failure::input("STRESS and DDSDDE are needed");
        let (stress, ddsdde) = (stress.ok_or_else(given)?, ddsdde.ok_or_else(given)?);
        let tangent = result.tangent.as_deref().ok_or_else(|| Failure::input("the cell gave no tangent operator"))?;
        match material.strains {
            Strains::Finite => {
                shape.put_stress(&result.stress, stress);
                shape.put_jacobian(tangent, &result.stress, ddsdde);
            }
            Strains::Lagrange => {
                let end = End { before: call.before, after: call.after, stress: &result.stress, tangent };
                shape.put_second_piola(&end, stress, ddsdde);
            }
            Strains::Small => {
                shape.put_stress(&result.stress, stress);
                shape.put_jacobian(&from_begin(tangent, &target), &Tensor2::ZERO, ddsdde);
            }
        }
        if let Some(statev) = statev {
            statev.iter_mut().zip(scalars_of(&result)).for_each(|(place, value)| *place = value);
        }
        Ok(())
    }));
    let failure = match answered {
        Ok(Ok(())) => return,
        Ok(Err(failure)) => failure.text,
        Err(_) => "a defect of this library".to_owned(),
    };
    // The host has no other place for a text.
    let _ = writeln!(std::io::stderr(), "grainspan umat: {failure}");
    // SAFETY: as promised by the caller.
    if let Some(place) = unsafe { slice_mut(pnewdt, 1) } {
        place[0] = SMALLER;
    }
}

/// The response of one point.
fn evaluate(call: &Call, target: Tensor2, material: &Material) -> Result<TrialResult, Failure> {
    let target = material.target_of_cell(&target)?;
    let state: State = known().lock().unwrap_or_else(PoisonError::into_inner).enter(call, &material.pool)?;
    material.trial(state, target, material.options(material.tangent()))
}

/// Change of the stress with the displacement gradient `H` of the step, in place of one at its end: times `(1 + H)^-1`.
fn from_begin(tangent: &Tensor4, target: &Tensor2) -> Tensor4 {
    let one = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
    let back = rve_server::space::inverse(&std::array::from_fn(|i| {
        std::array::from_fn::<f64, 3, _>(|j| one(i, j) + target.get(i, j))
    }));
    let mut found = Tensor4::ZERO;
    for place in 0..81 {
        let [i, j, k, l] = [place / 27, place / 9 % 3, place / 3 % 3, place % 3];
        found.set(i, j, k, l, (0..3).map(|n| tangent.get(i, j, k, n) * back[l][n]).sum());
    }
    found
}
