/* The worker side of a Grainspan run for engines in C, and in whatever calls C.
 *
 * Fill a grainspan_engine with functions and call grainspan_serve: it joins the run, takes jobs, keeps states, answers, and
 * returns when the run dismisses it. All calls come from the thread that called grainspan_serve, one after the other.
 * Link with libgrainspan_worker_c.a -lm -lpthread -ldl (cargo build --release -p grainspan-worker-c).
 *
 * SI units, stress tension positive, tensors 3x3 row-major; a plane problem uses the upper left 2x2 block.
 * docs/guide/external-engines.md tells what an engine must keep to. */
#ifndef GRAINSPAN_WORKER_H
#define GRAINSPAN_WORKER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What an RVE is made of. Valid during create only: copy what is needed. */
typedef struct grainspan_cell {
    uint32_t dimension;            /* 2 or 3 */
    uint32_t grains;               /* number of grains */
    double thickness;              /* out of plane, m; 1 in space */
    double periodicity[9];         /* cell vectors, each a row, m */
    const double *centres;         /* three per grain, m */
    const double *radii;           /* one per grain, m */
    double normal_stiffness;       /* N/m; 0 when modulus is given, and with "hertz_mindlin" */
    double modulus;                /* E of k_n = 2 E R1 R2 / (R1 + R2), Pa; 0 when normal_stiffness is given, and with
                                    * "hertz_mindlin" */
    double stiffness_ratio;        /* k_t / k_n; 0 with "hertz_mindlin" */
    double friction;               /* Coulomb coefficient */
    double cohesion;               /* cohesive overlap, m */
    double strain_per_step;        /* largest strain of one ramp step */
    double tolerance;              /* of the equilibrium criterion */
    const char *definition;        /* everything, as JSON: packing, contact, options */
} grainspan_cell;

/* How a trial is solved, and what it should deliver in addition to the stress. */
typedef struct grainspan_trial_options {
    uint32_t tangent;              /* reserved; 0: runs find tangents by differences of stresses */
    uint32_t ramp_steps;           /* increments of the deformation; 0: the engine chooses */
    uint32_t observables;          /* bits of optional results, see docs/reference/protocol.md */
    uint32_t reserved;
} grainspan_trial_options;

/* Former name, kept for one version. */
typedef grainspan_trial_options grainspan_ask;

/* Optional results. Those whose names are among the `observables` of the engine are read, where they were asked for. */
typedef struct grainspan_observed {
    double first_piola[9];         /* with respect to the committed configuration, Pa */
    double fabric[9];              /* 1/C sum n x n over the contacts */
    double fabric_anisotropy;      /* major over minor principal value, minus 1 */
    double coordination_number_no_rattlers;
    double sliding_fraction;       /* share of contacts at the Coulomb limit */
    double elastic_energy;         /* per volume, J/m3 */
    double frictional_dissipation; /* per volume since the initial state, J/m3 */
    double damping_work;           /* of numerical damping, per volume since the initial state, J/m3 */
    double mean_rotation[3];       /* of the grains since the initial state, rad; the third component in the plane */
} grainspan_observed;

/* The answer to a trial; all zero when trial is called. */
typedef struct grainspan_answer {
    double stress[9];              /* Cauchy stress at the end, Pa */
    double tangent[81];            /* reserved; 0: not read */
    double void_ratio;
    double coordination_number;
    double unbalanced_force_ratio;
    double max_overlap_ratio;
    double volume_ratio;           /* cell volume over initial cell volume */
    uint64_t force_evaluations;    /* cost, a count that is the same in every run; at least 1 */
    uint64_t ramp_steps;
    uint32_t flags;                /* shortcuts taken, see docs/reference/protocol.md */
    uint32_t reserved;
    grainspan_observed observed;
} grainspan_answer;

/* GRAINSPAN_REFUSED ends the run. GRAINSPAN_TOO_LARGE, of trial only, is one that smaller steps cure: the run cuts its load step. */
enum { GRAINSPAN_OK = 0, GRAINSPAN_REFUSED = 1, GRAINSPAN_TOO_LARGE = 2 };

/* An engine. Functions that can refuse write a text of at most `length` bytes, its end included, to `reason`. */
typedef struct grainspan_engine {
    const char *name;              /* in snapshots and messages */
    const char *version;
    uint32_t plane;                /* 1: serves two dimensions */
    uint32_t space;                /* 1: serves three */
    uint32_t linear;               /* 1: serves the contact law "linear" */
    uint32_t hertz_mindlin;        /* 1: serves "hertz_mindlin" */
    double largest_target;         /* largest |H| of a trial, above 0, INFINITY for none; beyond it targets are refused */

    /* A new RVE in its initial committed state, or NULL with a reason. */
    void *(*create)(const grainspan_cell *cell, char *reason, size_t length);
    /* Deforms from the committed state by H = F - I, total. Replaces an earlier trial. Returns a code above. */
    int (*trial)(void *rve, const double gradient[9], const grainspan_trial_options *options, grainspan_answer *answer, char *reason,
                 size_t length);
    /* Makes the trial state the committed state. */
    void (*commit)(void *rve);
    /* Drops the trial state. */
    void (*rollback)(void *rve);
    /* Writes the trial state (trial = 1) or the committed state (trial = 0) if it fits `capacity`; returns its size.
     * Equal states give equal bytes. */
    size_t (*snapshot)(const void *rve, int trial, uint8_t *out, size_t capacity);
    /* Makes bytes of snapshot the committed state and drops the trial. */
    int (*restore)(void *rve, const uint8_t *bytes, size_t length, char *reason, size_t reason_length);
    /* Frees the RVE. */
    void (*release)(void *rve);

    /* The two texts may be NULL, as they are where an initialiser leaves them out: then the engine delivers and follows none.
     * Compile an engine again with the library that it is linked with: earlier versions had no such texts. */
    /* Names of the fields of grainspan_observed that the engine delivers, separated by spaces; runs show the others as NaN. */
    const char *observables;
    /* Parts of definitions that not every engine follows and this one does, separated by spaces: see `features` in
     * docs/reference/protocol.md. A scene that uses another one is refused. */
    const char *features;
} grainspan_engine;

/* Serves the run of this name until dismissed. Returns an exit code: 0 done, 2 refused (the reason is on standard error),
 * 3 the run has ended. */
int grainspan_serve(const char *run, const grainspan_engine *engine);

/* Prints what the engine can do, as `--capabilities` has to. Returns 0, or 2 when the engine is not complete. */
int grainspan_print_capabilities(const grainspan_engine *engine);

#ifdef __cplusplus
}
#endif

#endif
