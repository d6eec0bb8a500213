/* A batch of trials from C, and the user material of Abaqus for one point.
 *
 *     cc example.c -I. -L../target/release -lgrainspan_pool -o example
 *     example PROGRAM CELL.toml
 *
 * PROGRAM is the executable `grainspan`; CELL.toml holds `packing`, [contact] and [rve]. */

#define _POSIX_C_SOURCE 200809L
#include "grainspan_pool.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { POINTS = 4, USUAL_TANGENT = 2 };

/* The entry that Abaqus calls; a host written in C declares it itself. */
void umat_(double *stress, double *statev, double *ddsdde, double *sse, double *spd, double *scd, double *rpl, double *ddsddt,
           double *drplde, double *drpldt, const double *stran, const double *dstran, const double *time, const double *dtime,
           const double *temp, const double *dtemp, const double *predef, const double *dpred, const char *cmname, const int *ndi,
           const int *nshr, const int *ntens, const int *nstatv, const double *props, const int *nprops, const double *coords,
           const double *drot, double *pnewdt, const double *celent, const double *dfgrd0, const double *dfgrd1, const int *noel,
           const int *npt, const int *layer, const int *kspt, const int *kstep, const int *kinc);

static void done(int code) {
    if (code != 0) {
        fprintf(stderr, "error %d: %s\n", code, grainspan_last_error());
        exit(1);
    }
}

static void expect(int holds, const char *what) {
    if (!holds) {
        fprintf(stderr, "this does not hold: %s\n", what);
        exit(1);
    }
}

/* Calls the user material for element 1, point 1 in plane strain; F by columns, diagonal. Returns PNEWDT. */
static double material(double begin, double duration, const double before[2], const double after[2], double stress[4]) {
    double state[5], jacobian[16], unused[16] = {0}, time[2] = {begin, begin}, pnewdt = 1.0;
    double f0[9] = {before[0], 0, 0, 0, before[1], 0, 0, 0, 1}, f1[9] = {after[0], 0, 0, 0, after[1], 0, 0, 0, 1};
    int ndi = 3, nshr = 1, ntens = 4, nstatv = 5, one = 1, none = 0;
    umat_(stress, state, jacobian, unused, unused, unused, unused, unused, unused, unused, unused, unused, time, &duration, unused,
          unused, unused, unused, "GRAINS", &ndi, &nshr, &ntens, &nstatv, unused, &none, unused, unused, &pnewdt, unused, f0, f1,
          &one, &one, &one, &one, &one, &one);
    return pnewdt;
}

int main(int count, char **words) {
    expect(count == 3, "two arguments: PROGRAM CELL.toml");
    const char *cells[] = {words[2]};
    GrainspanPool *pool = NULL;
    done(grainspan_pool_open(words[1], cells, 1, 1, &pool));
    expect(grainspan_dimension(pool) == 2, "the cell is plane");

    uint64_t states[POINTS];
    double gradients[9 * POINTS] = {0}, stresses[9 * POINTS], again[9 * POINTS], tangents[81 * POINTS], scalars[5 * POINTS];
    done(grainspan_new_states(pool, 0, POINTS, states));
    for (int point = 0; point < POINTS; ++point) {
        gradients[9 * point + 4] = -1e-4 * (point + 1);
    }
    size_t refused = 99;
    done(grainspan_trial(pool, POINTS, states, gradients, USUAL_TANGENT, 0, stresses, tangents, scalars, &refused));
    done(grainspan_trial(pool, POINTS, states, gradients, 0, 0, again, NULL, NULL, NULL));
    expect(memcmp(stresses, again, sizeof stresses) == 0, "a trial leaves the committed state alone");
    expect(stresses[4] < -1e5 && tangents[40] > 0 && scalars[0] > 0, "compression, stiffness, void ratio");
    done(grainspan_rollback(pool, 1, states));
    expect(grainspan_commit(pool, POINTS, states) == 3, "a state without a trial cannot be committed");
    done(grainspan_commit(pool, POINTS - 1, states + 1));

    /* State 1 goes to state 0 as bytes. */
    size_t size = 0;
    done(grainspan_snapshot(pool, states[1], NULL, 0, &size));
    unsigned char *bytes = malloc(size);
    done(grainspan_snapshot(pool, states[1], bytes, size, &size));
    done(grainspan_restore(pool, states[0], bytes, size));
    uint64_t both[2] = {states[0], states[1]};
    double same[18] = {[4] = -1e-4, [9 + 4] = -1e-4};
    done(grainspan_trial(pool, 2, both, same, 0, 0, again, NULL, NULL, NULL));
    expect(memcmp(again, again + 9, 9 * sizeof *again) == 0, "a restored state continues alike");
    bytes[size - 1] ^= 1;
    expect(grainspan_restore(pool, states[0], bytes, size) == 3, "damaged bytes are refused");
    free(bytes);

    gradients[9 * 2] = -3.0;
    int code = grainspan_trial(pool, POINTS, states, gradients, 0, 0, again, NULL, NULL, &refused);
    expect(code == 1 && refused == 2, "a refused trial names its point");
    printf("refused: %s\n", grainspan_last_error());

    /* The user material: an increment that the host shortens, and the next one. The same steps by the pool. */
    uint64_t state;
    const double start[2] = {1, 1}, far[2] = {1, -1}, first[2] = {1, 1 - 2e-4}, second[2] = {1, 1 - 3e-4};
    /* As the material forms it, so that the bits are equal. */
    double step[9] = {[4] = first[1] - start[1]}, wanted[9], stress[4];
    done(grainspan_new_states(pool, 0, 1, &state));
    done(grainspan_trial(pool, 1, &state, step, USUAL_TANGENT, 0, wanted, NULL, NULL, NULL));
    setenv("GRAINSPAN_PROGRAM", words[1], 1);
    setenv("GRAINSPAN_CELL", words[2], 1);
    setenv("GRAINSPAN_WORKERS", "1", 1);
    expect(material(0.0, 1.0, start, far, stress) == 0.5, "a refusal asks for half the increment");
    expect(material(0.0, 0.5, start, first, stress) == 1.0 && stress[1] == wanted[4], "the shortened increment");
    expect(material(0.0, 0.5, start, first, stress) == 1.0 && stress[1] == wanted[4], "another iteration");
    done(grainspan_commit(pool, 1, &state));
    step[4] = (second[1] - first[1]) / first[1];
    done(grainspan_trial(pool, 1, &state, step, USUAL_TANGENT, 0, wanted, NULL, NULL, NULL));
    expect(material(0.5, 0.5, first, second, stress) == 1.0, "the next increment");
    expect(stress[1] - wanted[4] < -1e-4 * wanted[4] && wanted[4] - stress[1] < -1e-4 * wanted[4], "its stress");
    expect(material(0.2, 0.5, first, second, stress) == 0.5, "another time is refused");

    grainspan_pool_close(pool);
    printf("sound\n");
    return 0;
}
