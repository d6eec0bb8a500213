//! A user material with the conventions of Abaqus/Standard: `umat_`.
//!
//! Every pair of element and integration point (NOEL, NPT) is a state of one pool. The host tries a point as often as it likes within an
//! increment; [`history`] tells iterations, restarts of an increment and the next increment apart by TIME(2) and DTIME. Stress and
//! tangent are converted in [`voigt`].
//!
//! The pool opens at the first call. Environment: `GRAINSPAN_PROGRAM` (the executable), `GRAINSPAN_CELL` (a TOML file with `packing`,
//! `[contact]`, `[rve]`), `GRAINSPAN_WORKERS`.

mod history;
mod voigt;

use crate::border::{Failure, slice, slice_mut};
use crate::functions::{GrainspanPool, scalars_of};
use grain_pool::{PoolError, State, Trial};
use history::{Call, Points};
use protocol::{TangentKind, TrialOptions, TrialResult};
use std::ffi::{c_char, c_int};
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, OnceLock, PoisonError};
use voigt::Voigt;

/// Share of the time increment that the host is asked to try after a refusal.
const SMALLER: f64 = 0.5;

struct Material {
    pool: GrainspanPool,
    points: Mutex<Points>,
}

/// The pool of this process, or why there is none.
fn material() -> Result<&'static Material, &'static Failure> {
    static OPENED: OnceLock<Result<Material, Failure>> = OnceLock::new();
    let open = || {
        let named = |name: &str| {
            std::env::var(name).map_err(|_| Failure::input(format!("the environment variable {name} is not set")))
        };
        let workers = std::env::var("GRAINSPAN_WORKERS").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
        let pool = GrainspanPool::open(&named("GRAINSPAN_PROGRAM")?, &[named("GRAINSPAN_CELL")?], workers)?;
        Ok(Material { pool, points: Mutex::default() })
    };
    OPENED.get_or_init(open).as_ref()
}

/// The entry that Abaqus/Standard calls for every integration point and iteration. Arguments as in its manual. Used are STRESS, STATEV,
/// DDSDDE, TIME, DTIME, NDI, NSHR, NTENS, NSTATV, PNEWDT, DFGRD0, DFGRD1, NOEL and NPT.
///
/// STATEV receives void ratio, coordination number, unbalanced force ratio, largest overlap and volume ratio, as many as there are. A
/// refusal sets PNEWDT to 0.5 and leaves the rest; other failures are printed and do the same, so that the host ends in good order.
///
/// # Safety
/// The arrays have the lengths that the manual states.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the border to C: see the crate's documentation")]
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
    _dstran: *const f64,
    time: *const f64,
    dtime: *const f64,
    _temp: *const f64,
    _dtemp: *const f64,
    _predef: *const f64,
    _dpred: *const f64,
    _cmname: *const c_char,
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
    _layer: *const c_int,
    _kspt: *const c_int,
    _kstep: *const c_int,
    _kinc: *const c_int,
) {
    let answered = catch_unwind(AssertUnwindSafe(|| -> Result<(), Failure> {
        // SAFETY: as promised by the caller.
        let (call, shape, states) = unsafe {
            let number = |pointer, name| Ok::<_, Failure>(slice::<c_int>(pointer, 1, name)?[0]);
            let value = |pointer, name| Ok::<_, Failure>(slice::<f64>(pointer, 1, name)?[0]);
            let call = Call {
                point: (number(noel, "NOEL")?, number(npt, "NPT")?),
                begin: slice(time, 2, "TIME")?[1],
                duration: value(dtime, "DTIME")?,
                before: voigt::gradient(slice(dfgrd0, 9, "DFGRD0")?),
                after: voigt::gradient(slice(dfgrd1, 9, "DFGRD1")?),
            };
            let shape = Voigt::new(number(ndi, "NDI")?, number(nshr, "NSHR")?)?;
            (call, shape, usize::try_from(number(nstatv, "NSTATV")?).unwrap_or(0))
        };
        let result = evaluate(&call)?;
        let components = shape.components();
        // SAFETY: as promised by the caller.
        let (stress, statev, ddsdde) = unsafe {
            (slice_mut(stress, components), slice_mut(statev, states), slice_mut(ddsdde, components * components))
        };
        let given = || Failure::input("STRESS and DDSDDE are needed");
        shape.put_stress(&result.stress, stress.ok_or_else(given)?);
        let tangent = result.tangent.as_deref().ok_or_else(given)?;
        shape.put_jacobian(tangent, &result.stress, ddsdde.ok_or_else(given)?);
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
fn evaluate(call: &Call) -> Result<TrialResult, Failure> {
    let material = material().map_err(|failure| Failure { code: failure.code, text: failure.text.clone() })?;
    let pool = &material.pool.pool;
    let state: State = {
        let mut points = material.points.lock().unwrap_or_else(PoisonError::into_inner);
        points.enter(call, pool)?
    };
    let options = TrialOptions { tangent: TangentKind::TrussLikeSlip, ..TrialOptions::default() };
    let trial = Trial { state, target: call.target(pool.dimension()), options };
    let mut results = pool.trial(&[trial])?;
    results.pop().ok_or_else(|| PoolError::Closed.into())
}
