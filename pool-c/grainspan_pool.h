// Pools of cells of grains for programs in C: see docs/guide/c.md. Generated from pool-c/src by its test; do not edit.

#ifndef GRAINSPAN_POOL_H
#define GRAINSPAN_POOL_H

#include <stddef.h>
#include <stdint.h>

// Worker processes and the states of points. All functions may be called from any thread; calls are served one after the other.
typedef struct GrainspanPool GrainspanPool;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Text of the last failure in this thread: what, where and the remedy. Valid until the next failure in this thread.
const char *grainspan_last_error(void);

// Opens a pool.
//
// `program`: path of the executable `grainspan`. `cells`: paths of `cell_count` TOML files, each with `packing`, `[contact]` and
// `[rve]` as in a scene. `workers`: number of worker processes, 0 for one per core. `pool`: receives the pool.
//
// Returns 0; 2: workers cannot be started; 3: bad input; 4: a defect of this library.
//
// # Safety
// Pointers are valid during the call; `cells` points to `cell_count` C strings.
int32_t grainspan_pool_open(const char *program,
                            const char *const *cells,
                            size_t cell_count,
                            size_t workers,
                            GrainspanPool **pool);

// Ends the workers and releases the pool. A null pointer is ignored.
//
// # Safety
// `pool` comes from `grainspan_pool_open` and is not used afterwards.
void grainspan_pool_close(GrainspanPool *pool);

// Space dimension of the cells, 2 or 3; 0 for a null pointer.
//
// # Safety
// `pool` is null or an open pool.
uint32_t grainspan_dimension(const GrainspanPool *pool);

// Makes `count` states in the initial state of a cell (its place in the list of the pool, from 0). Their numbers go to `states`.
//
// Returns 0, or 3.
//
// # Safety
// `pool` is an open pool, `states` has room for `count` numbers.
int32_t grainspan_new_states(const GrainspanPool *pool,
                             size_t cell,
                             size_t count,
                             uint64_t *states);

// Deforms `count` points from their committed states, which stay as they are.
//
// `gradients`: for each point nine numbers, row by row: the displacement gradient `F - I` from the committed configuration. Plane
// cells read the upper left block. `tangent`: number of the operator, 0 for none (docs/reference/protocol.md); 2 is the usual one.
// `ramp_steps`: increments in which the deformation is applied, 0 for the choice of the cell. `stresses`: receives nine numbers for
// each point, Cauchy, Pa, tension positive. `tangents`: receives 81 numbers for each, `d sigma_ij / d F_kl` with F relative to the end
// of the trial, in the order ijkl; null where not wanted, and if `tangent` is 0. `scalars`: receives five numbers for each, or null: void ratio, coordination
// number, unbalanced force ratio, largest overlap over diameter, volume over initial volume. `refused`: receives the place of the
// refused point when 1 is returned; may be null.
//
// Returns 0; 1: a cell refused its deformation, no trial of the call counts, a smaller step may help; 2: workers lost; 3; 4.
//
// # Safety
// `pool` is an open pool; the arrays have the lengths above.
int32_t grainspan_trial(const GrainspanPool *pool,
                        size_t count,
                        const uint64_t *states,
                        const double *gradients,
                        uint32_t tangent,
                        uint32_t ramp_steps,
                        double *stresses,
                        double *tangents,
                        double *scalars,
                        size_t *refused);

// Makes the last trials of these points their committed states: all, or none if one has no trial.
//
// Returns 0, or 3.
//
// # Safety
// `pool` is an open pool, `states` has `count` numbers.
int32_t grainspan_commit(const GrainspanPool *pool, size_t count, const uint64_t *states);

// Drops the trials of these points.
//
// Returns 0, or 3.
//
// # Safety
// `pool` is an open pool, `states` has `count` numbers.
int32_t grainspan_rollback(const GrainspanPool *pool, size_t count, const uint64_t *states);

// Writes the committed state of a point as bytes, which are valid for the same cell in any process. `size` receives their number; with
// less room than that nothing else is written, so a first call with `capacity` 0 finds the size.
//
// Returns 0, or 3.
//
// # Safety
// `pool` is an open pool, `bytes` has room for `capacity` bytes, `size` for a number.
int32_t grainspan_snapshot(const GrainspanPool *pool,
                           uint64_t state,
                           uint8_t *bytes,
                           size_t capacity,
                           size_t *size);

// Replaces the committed state of a point by the bytes of `grainspan_snapshot`, and drops its trial.
//
// Returns 0, or 3: the bytes are damaged or belong to another cell.
//
// # Safety
// `pool` is an open pool, `bytes` has `size` bytes.
int32_t grainspan_restore(const GrainspanPool *pool,
                          uint64_t state,
                          const uint8_t *bytes,
                          size_t size);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* GRAINSPAN_POOL_H */
