//! The functions of the header.

use crate::ffi_boundary::{DEFECT, Failure, guarded, last_error, slice, slice_mut, text};
use crate::material::expect_ramp_steps;
use grain_pool::{PoolError, PoolOptions, RvePool, Snapshot, State, Trial};
use protocol::{TangentKind, Tensor2, TrialOptions, TrialResult};
use scene_reader::{Document, read_cell};
use std::ffi::c_char;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Worker processes and the states of points. All functions may be called from any thread; calls are served one after the other.
pub struct GrainspanPool {
    pub(crate) pool: RvePool,
    states: Mutex<Vec<State>>,
}

impl GrainspanPool {
    /// Starts `workers` workers (0: one per core) of `program` for the cells that these files describe.
    pub(crate) fn open(program: &str, cells: &[String], workers: usize) -> Result<Self, Failure> {
        let read = |path: &String| {
            let document = Document::read(Path::new(path), &[]).map_err(PoolError::from)?;
            Ok(read_cell(&document).map_err(PoolError::from)?)
        };
        let cells = cells.iter().map(read).collect::<Result<Vec<_>, Failure>>()?;
        let usual = PoolOptions::new(program);
        let workers = if workers == 0 { usual.workers } else { workers };
        let pool = RvePool::open(cells, PoolOptions { workers, ..usual })?;
        Ok(Self { pool, states: Mutex::default() })
    }

    /// New states; the number of the first.
    fn new_states(&self, cell: usize, count: usize) -> Result<u64, Failure> {
        let mut states = self.states.lock().unwrap_or_else(PoisonError::into_inner);
        let first = states.len() as u64;
        states.extend(self.pool.new_states(cell, count)?);
        Ok(first)
    }

    fn states(&self, numbers: &[u64]) -> Result<Vec<State>, Failure> {
        let states = self.states.lock().unwrap_or_else(PoisonError::into_inner);
        let known = |number: &u64| {
            let state = usize::try_from(*number).ok().and_then(|number| states.get(number)).copied();
            state.ok_or_else(|| Failure::input(format!("there is no state {number}; the pool has {}", states.len())))
        };
        numbers.iter().map(known).collect()
    }
}

/// Text of the last failure in this thread: what, where and the remedy. Valid until the next failure in this thread.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub extern "C" fn grainspan_last_error() -> *const c_char {
    last_error()
}

/// Opens a pool.
///
/// `program`: path of the executable `grainspan`. `cells`: paths of `cell_count` TOML files, each with `packing`, `[contact]` and
/// `[rve]` as in a scene. `workers`: number of worker processes, 0 for one per core. `pool`: receives the pool.
///
/// Returns 0; 2: workers cannot be started; 3: bad input; 4: a defect of this library.
///
/// # Safety
/// Pointers are valid during the call; `cells` points to `cell_count` C strings.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn grainspan_pool_open(
    program: *const c_char,
    cells: *const *const c_char,
    cell_count: usize,
    workers: usize,
    pool: *mut *mut GrainspanPool,
) -> i32 {
    guarded(|| {
        // SAFETY: as promised by the caller.
        let (program, cells, place) = unsafe {
            let listed = slice(cells, cell_count, "cells")?;
            let cells = listed.iter().map(|&cell| text(cell, "cells[...]")).collect::<Result<Vec<_>, _>>()?;
            (text(program, "program")?, cells, slice_mut(pool, 1))
        };
        let place = place.ok_or_else(|| Failure::input("`pool` is a null pointer"))?;
        place[0] = Box::into_raw(Box::new(GrainspanPool::open(&program, &cells, workers)?));
        Ok(())
    })
}

/// Ends the workers and releases the pool. A null pointer is ignored.
///
/// # Safety
/// `pool` comes from `grainspan_pool_open` and is not used afterwards.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn grainspan_pool_close(pool: *mut GrainspanPool) {
    if !pool.is_null() {
        guarded(|| {
            // SAFETY: as promised by the caller.
            drop(unsafe { Box::from_raw(pool) });
            Ok(())
        });
    }
}

/// Space dimension of the cells, 2 or 3; 0 for a null pointer.
///
/// # Safety
/// `pool` is null or an open pool.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn grainspan_dimension(pool: *const GrainspanPool) -> u32 {
    // SAFETY: as promised by the caller.
    unsafe { pool.as_ref() }.map_or(0, |pool| pool.pool.dimension())
}

/// Makes `count` states in the initial state of a cell (its place in the list of the pool, from 0). Their numbers go to `states`.
///
/// Returns 0, or 3.
///
/// # Safety
/// `pool` is an open pool, `states` has room for `count` numbers.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn grainspan_new_states(
    pool: *const GrainspanPool,
    cell: usize,
    count: usize,
    states: *mut u64,
) -> i32 {
    guarded(|| {
        // SAFETY: as promised by the caller.
        let (pool, states) = unsafe { (opened(pool)?, slice_mut(states, count)) };
        if count == 0 {
            return Ok(());
        }
        let states = states.ok_or_else(|| Failure::input("`states` is a null pointer"))?;
        let first = pool.new_states(cell, count)?;
        states.iter_mut().zip(first..).for_each(|(place, number)| *place = number);
        Ok(())
    })
}

/// Deforms `count` points from their committed states, which stay as they are.
///
/// `gradients`: for each point nine numbers, row by row: the displacement gradient `F - I` from the committed configuration. Plane
/// cells read the upper left block. `tangent`: number of the operator, 0 for none (docs/reference/protocol.md); 2 is the usual one.
/// `ramp_steps`: increments in which the deformation is applied, 0 for the choice of the cell. `stresses`: receives nine numbers for
/// each point, Cauchy, Pa, tension positive. `tangents`: receives 81 numbers for each, `d sigma_ij / d F_kl` with F relative to the end
/// of the trial, in the order ijkl; null where not wanted, and if `tangent` is 0. `scalars`: receives five numbers for each, or null: void ratio, coordination
/// number, unbalanced force ratio, largest overlap over diameter, volume over initial volume. `refused`: receives the place of the
/// refused point when 1 is returned; may be null.
///
/// Returns 0; 1: a cell refused its deformation, no trial of the call counts, a smaller step may help; 2: workers lost; 3; 4.
///
/// # Safety
/// `pool` is an open pool; the arrays have the lengths above.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn grainspan_trial(
    pool: *const GrainspanPool,
    count: usize,
    states: *const u64,
    gradients: *const f64,
    tangent: u32,
    ramp_steps: u32,
    stresses: *mut f64,
    tangents: *mut f64,
    scalars: *mut f64,
    refused: *mut usize,
) -> i32 {
    guarded(|| {
        // SAFETY: as promised by the caller.
        let (pool, states, gradients) = unsafe {
            let pool = opened(pool)?;
            let gradients = slice(gradients, numbers(count, 9)?, "gradients")?;
            (pool, pool.states(slice(states, count, "states")?)?, gradients)
        };
        if stresses.is_null() && count > 0 {
            return Err(Failure::input("`stresses` is a null pointer"));
        }
        let kind = TangentKind::from_wire(tangent).ok_or_else(|| {
            Failure::input(format!("there is no tangent number {tangent}; 0 is none, 2 the usual one"))
        })?;
        if kind == TangentKind::None && !tangents.is_null() && count > 0 {
            return Err(Failure::input("`tangents` is given and `tangent` is 0: name an operator, or pass null"));
        }
        expect_ramp_steps("ramp_steps", ramp_steps)?;
        let options = TrialOptions { tangent: kind, ramp_steps, ..TrialOptions::default() };
        let make = |(state, gradient): (State, &[f64])| Trial { state, target: target(pool, gradient), options };
        let trials: Vec<Trial> = states.into_iter().zip(gradients.chunks_exact(9)).map(make).collect();
        let results = pool.pool.trial(&trials).inspect_err(|error| {
            // SAFETY: as promised by the caller.
            if let (PoolError::Refused { point, .. }, Some(place)) = (error, unsafe { slice_mut(refused, 1) }) {
                place[0] = *point;
            }
        })?;
        let [of_stresses, of_tangents, of_scalars] = [numbers(count, 9)?, numbers(count, 81)?, numbers(count, 5)?];
        // SAFETY: as promised by the caller.
        let (stresses, tangents, scalars) = unsafe {
            (slice_mut(stresses, of_stresses), slice_mut(tangents, of_tangents), slice_mut(scalars, of_scalars))
        };
        let operator = |result: &TrialResult| -> Result<Vec<f64>, Failure> {
            let lacking = || Failure { code: DEFECT, text: "a reply has no operator".to_owned() };
            Ok(result.tangent.as_ref().ok_or_else(lacking)?.0.to_vec())
        };
        fill(stresses, 9, &results, |result| Ok(result.stress.0.to_vec()))?;
        fill(tangents, 81, &results, operator)?;
        fill(scalars, 5, &results, |result| Ok(scalars_of(result).to_vec()))
    })
}

/// Makes the last trials of these points their committed states: all, or none if one has no trial.
///
/// Returns 0, or 3.
///
/// # Safety
/// `pool` is an open pool, `states` has `count` numbers.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn grainspan_commit(pool: *const GrainspanPool, count: usize, states: *const u64) -> i32 {
    guarded(|| {
        // SAFETY: as promised by the caller.
        let (pool, states) = unsafe { (opened(pool)?, slice(states, count, "states")?) };
        Ok(pool.pool.commit(&pool.states(states)?)?)
    })
}

/// Drops the trials of these points.
///
/// Returns 0, or 3.
///
/// # Safety
/// `pool` is an open pool, `states` has `count` numbers.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn grainspan_rollback(pool: *const GrainspanPool, count: usize, states: *const u64) -> i32 {
    guarded(|| {
        // SAFETY: as promised by the caller.
        let (pool, states) = unsafe { (opened(pool)?, slice(states, count, "states")?) };
        Ok(pool.pool.rollback(&pool.states(states)?)?)
    })
}

/// Writes the committed state of a point as bytes, which are valid for the same cell in any process. `size` receives their number; with
/// less room than that nothing else is written, so a first call with `capacity` 0 finds the size.
///
/// Returns 0, or 3.
///
/// # Safety
/// `pool` is an open pool, `bytes` has room for `capacity` bytes, `size` for a number.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn grainspan_snapshot(
    pool: *const GrainspanPool,
    state: u64,
    bytes: *mut u8,
    capacity: usize,
    size: *mut usize,
) -> i32 {
    guarded(|| {
        // SAFETY: as promised by the caller.
        let (pool, bytes, size) = unsafe { (opened(pool)?, slice_mut(bytes, capacity), slice_mut(size, 1)) };
        let size = size.ok_or_else(|| Failure::input("`size` is a null pointer"))?;
        let written: Vec<u8> =
            pool.pool.snapshot(&pool.states(&[state])?)?.iter().flat_map(Snapshot::to_bytes).collect();
        size[0] = written.len();
        if let Some(room) = bytes.and_then(|bytes| bytes.get_mut(..written.len())) {
            room.copy_from_slice(&written);
        }
        Ok(())
    })
}

/// Replaces the committed state of a point by the bytes of `grainspan_snapshot`, and drops its trial.
///
/// Returns 0, or 3: the bytes are damaged or belong to another cell.
///
/// # Safety
/// `pool` is an open pool, `bytes` has `size` bytes.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub unsafe extern "C" fn grainspan_restore(
    pool: *const GrainspanPool,
    state: u64,
    bytes: *const u8,
    size: usize,
) -> i32 {
    guarded(|| {
        // SAFETY: as promised by the caller.
        let (pool, bytes) = unsafe { (opened(pool)?, slice(bytes, size, "bytes")?) };
        let snapshot = Snapshot::from_bytes(bytes).map_err(Failure::input)?;
        Ok(pool.pool.restore(&pool.states(&[state])?, &[snapshot])?)
    })
}

/// # Safety
/// `pool` is null or an open pool.
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
unsafe fn opened<'a>(pool: *const GrainspanPool) -> Result<&'a GrainspanPool, Failure> {
    // SAFETY: as promised by the caller.
    unsafe { pool.as_ref() }.ok_or_else(|| Failure::input("`pool` is a null pointer"))
}

/// The target of a trial; a plane cell takes the upper left block.
fn target(pool: &GrainspanPool, gradient: &[f64]) -> Tensor2 {
    let whole = Tensor2(std::array::from_fn(|place| gradient[place]));
    if pool.pool.dimension() == 2 { Tensor2::from_plane(whole.plane()) } else { whole }
}

/// The scalars that every trial has.
pub(crate) fn scalars_of(result: &TrialResult) -> [f64; 5] {
    let found = &result.scalars;
    [
        found.void_ratio,
        found.coordination_number,
        found.unbalanced_force_ratio,
        found.max_overlap_ratio,
        found.volume_ratio,
    ]
}

/// Writes `width` numbers of each result where C wants them.
fn fill(
    room: Option<&mut [f64]>,
    width: usize,
    results: &[TrialResult],
    of: impl Fn(&TrialResult) -> Result<Vec<f64>, Failure>,
) -> Result<(), Failure> {
    for (place, result) in room.into_iter().flat_map(|room| room.chunks_exact_mut(width)).zip(results) {
        place.copy_from_slice(&of(result)?);
    }
    Ok(())
}

/// Length of an array with `width` numbers for each of `count` points.
fn numbers(count: usize, width: usize) -> Result<usize, Failure> {
    count.checked_mul(width).ok_or_else(|| Failure::input(format!("{count} points are too many")))
}
