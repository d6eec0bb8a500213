/* A batch of trials from C, and for one point the user material of Abaqus and the behaviour of MGIS.
 *
 *     cc example.c -I. -L../target/release -lgrainspan_pool -o example
 *     example PROGRAM CELL.toml
 *
 * PROGRAM is the executable `grainspan`; CELL.toml holds `packing`, [contact] and [rve]. */

#define _POSIX_C_SOURCE 200809L
#include "grainspan_pool.h"
#include <stdint.h>
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

/* A state, a point, an entry and a symbol as hosts of MGIS have them. */
typedef struct {
    const double *gradients;
    double *forces;
    const double *mass_density, *material_properties;
    double *internal_variables, *stored_energy, *dissipated_energy;
    const double *external_variables;
} StateView;

typedef struct {
    char *message;
    double duration, *operator, *time_factor, *speed_of_sound;
    StateView before, after;
} PointView;

int GrainCell_PlaneStrain(PointView *view);
int GrainCell_Tridimensional(PointView *view);
int GrainCellFiniteStrain_PlaneStrain(PointView *view);
extern const unsigned short GrainCell_nInternalStateVariables, GrainCellFiniteStrain_BehaviourType;
extern const char *const GrainCell_InternalStateVariables[6], *const GrainCellFiniteStrain_Gradients[1];

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
static double material_of_layer(const char *name, int layer, double begin, double duration, const double before[2],
                                const double after[2], double stress[4]) {
    double state[5], jacobian[16], unused[16] = {0}, time[2] = {begin, begin}, pnewdt = 1.0;
    double f0[9] = {before[0], 0, 0, 0, before[1], 0, 0, 0, 1}, f1[9] = {after[0], 0, 0, 0, after[1], 0, 0, 0, 1};
    int ndi = 3, nshr = 1, ntens = 4, nstatv = 5, one = 1, none = 0;
    umat_(stress, state, jacobian, unused, unused, unused, unused, unused, unused, unused, unused, unused, time, &duration, unused,
          unused, unused, unused, name, &ndi, &nshr, &ntens, &nstatv, unused, &none, unused, unused, &pnewdt, unused, f0, f1,
          &one, &one, &layer, &one, &one, &one);
    return pnewdt;
}

static double material(double begin, double duration, const double before[2], const double after[2], double stress[4]) {
    return material_of_layer("GRAINS", 1, begin, duration, before, after, stress);
}

/* Discs have no stiffness out of their plane: a strain along the third axis is refused, of solids too. */
static void beyond_the_plane(void) {
    double stress[6], state[5], jacobian[36], unused[36] = {0}, time[2] = {0.0, 0.0}, duration = 1.0;
    double f0[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, thicker[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1.01};
    for (int solid = 0; solid < 2; solid++) {
        int ndi = 3, nshr = solid ? 3 : 1, ntens = ndi + nshr, nstatv = 5, one = 1, none = 0, other = 7;
        double pnewdt = 1.0;
        umat_(stress, state, jacobian, unused, unused, unused, unused, unused, unused, unused, unused, unused, time, &duration, unused,
              unused, unused, unused, "GRAINS", &ndi, &nshr, &ntens, &nstatv, unused, &none, unused, unused, &pnewdt, unused, f0,
              thicker, &other, &one, &one, &one, &one, &one);
        expect(pnewdt < 1.0, "cells of discs are refused out of their plane");
    }
}

/* Integrates a vertical strain, or for finite strains a vertical stretch; `variables` are those at the begin and at the end. */
static int behaviour(int is_finite, double from, double to, double variables[2][6], double stress[4], double operator[20]) {
    double one = is_finite ? 1.0 : 0.0, factor = 1.0, forces[4] = {0};
    double gradients[2][6] = {{one, from, one}, {one, to, one}};
    char message[512];
    PointView view = {message, 1.0, operator, &factor, NULL, {gradients[0], forces, NULL, NULL, variables[0], NULL, NULL, NULL},
                      {gradients[1], stress, NULL, NULL, variables[1], NULL, NULL, NULL}};
    int code = is_finite ? GrainCellFiniteStrain_PlaneStrain(&view) : GrainCell_PlaneStrain(&view);
    if (code != 1) {
        expect(code == -1 && factor == 0.5 && strlen(message) > 10, "a failure has a message and asks for a smaller step");
        printf("behaviour: %s\n", message);
        PointView space = view;
        expect(GrainCell_Tridimensional(&space) == -1, "discs are refused in space");
    }
    return code;
}

/* The behaviour against the same steps by the pool: iterations, a repeated step, and an earlier iteration that is accepted. */
static void behaviours(const GrainspanPool *pool) {
    expect(GrainCell_nInternalStateVariables == 6 && GrainCellFiniteStrain_BehaviourType == 2, "numbers of a behaviour");
    expect(strcmp(GrainCell_InternalStateVariables[0], "GrainState") == 0, "names of a behaviour");
    expect(strcmp(GrainCellFiniteStrain_Gradients[0], "DeformationGradient") == 0, "names of the other behaviour");
    uint64_t state;
    double step[9] = {[4] = -2e-4}, wanted[9], stress[4], operator[20] = {4.0}, variables[2][6] = {{0}}, first, second[6];
    done(grainspan_new_states(pool, 0, 1, &state));
    done(grainspan_trial(pool, 1, &state, step, USUAL_TANGENT, 0, wanted, NULL, NULL, NULL));
    expect(behaviour(0, 0.0, -2e-4, variables, stress, operator) == 1 && stress[1] == wanted[4], "the first step");
    expect(operator[5] > 1e7 && variables[1][0] > 0 && variables[1][1] > 0, "stiffness, a new state, its void ratio");
    first = variables[1][0];
    operator[0] = 0.0;
    expect(behaviour(0, 0.0, -3.0, variables, stress, operator) == -1, "a refusal");
    operator[0] = 104.0;
    expect(behaviour(0, 0.0, -1e-4, variables, stress, operator) == -1, "the speed of sound is refused");
    operator[0] = 0.0;
    expect(behaviour(0, 0.0, -1e-4, variables, stress, operator) == 1 && stress[1] != wanted[4], "another iteration");
    expect(variables[1][0] != first, "another state");
    /* The host goes on from the iteration before the last. */
    done(grainspan_commit(pool, 1, &state));
    step[4] = -5e-4 - -2e-4;
    done(grainspan_trial(pool, 1, &state, step, 0, 0, wanted, NULL, NULL, NULL));
    memcpy(variables[0], variables[1], sizeof variables[0]);
    variables[0][0] = first;
    expect(behaviour(0, -2e-4, -5e-4, variables, stress, operator) == 1 && stress[1] == wanted[4], "the next step");
    expect(behaviour(0, -2e-4, -5e-4, variables, stress, operator) == 1 && stress[1] == wanted[4], "the next step again");
    memcpy(second, variables[1], sizeof second);
    operator[0] = -4.0;
    expect(behaviour(0, -2e-4, -9e-4, variables, stress, operator) == 1 && operator[5] > 1e7, "an operator without a step");
    expect(memcmp(second, variables[1], sizeof second) == 0, "which changes nothing else");
    /* From the iteration before the operator, which the pool has no trial of any more. */
    done(grainspan_commit(pool, 1, &state));
    step[4] = -6e-4 - -5e-4;
    done(grainspan_trial(pool, 1, &state, step, 0, 0, wanted, NULL, NULL, NULL));
    variables[0][0] = second[0];
    operator[0] = 0.0;
    expect(behaviour(0, -5e-4, -6e-4, variables, stress, operator) == 1 && stress[1] == wanted[4], "the third step");
    /* A refusal, after which the host goes on from the iteration before it. */
    expect(behaviour(0, -5e-4, -3.0, variables, stress, operator) == -1, "a refusal of a later step");
    done(grainspan_commit(pool, 1, &state));
    step[4] = -7e-4 - -6e-4;
    done(grainspan_trial(pool, 1, &state, step, 0, 0, wanted, NULL, NULL, NULL));
    variables[0][0] = variables[1][0];
    expect(behaviour(0, -6e-4, -7e-4, variables, stress, operator) == 1 && stress[1] == wanted[4], "the fourth step");
    variables[0][0] = second[0];
    expect(behaviour(0, -5e-4, -6e-4, variables, stress, operator) == -1, "older states are gone");
    variables[0][0] = 0.0;
    operator[0] = 4.0, operator[1] = 0.0, operator[2] = 0.0;
    expect(behaviour(1, 1.0, 1.0 - 2e-4, variables, stress, operator) == 1 && operator[6] > 1e7, "finite strain");
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
    expect(grainspan_trial(pool, POINTS, states, gradients, 0, 0, again, tangents, NULL, NULL) == 3,
           "room for operators and no operator asked for");
    expect(grainspan_trial(pool, SIZE_MAX / 8, states, gradients, 0, 0, again, NULL, NULL, NULL) == 3, "too many points");
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
    expect(material_of_layer("GRAINS", 2, 0.0, 0.5, start, second, stress) == 1.0 && stress[1] < wanted[4], "another layer");
    done(grainspan_commit(pool, 1, &state));
    step[4] = (second[1] - first[1]) / first[1];
    done(grainspan_trial(pool, 1, &state, step, USUAL_TANGENT, 0, wanted, NULL, NULL, NULL));
    expect(material(0.5, 0.5, first, second, stress) == 1.0, "the next increment");
    expect(stress[1] - wanted[4] < -1e-4 * wanted[4] && wanted[4] - stress[1] < -1e-4 * wanted[4], "its stress");
    expect(material(0.2, 0.5, first, second, stress) == 0.5, "another time is refused");
    expect(material_of_layer("GRAINS", 3, 0.5, 0.5, first, second, stress) == 0.5, "a layer that comes late is refused");
    expect(material_of_layer("@ABAQUS_GRAINS", 3, 0.0, 0.5, start, first, stress) == 1.0, "CalculiX has no layers");
    expect(material_of_layer("@ABAQUS_GRAINS", 9, 0.5, 0.5, first, second, stress) == 1.0, "whatever it says of them");

    beyond_the_plane();
    behaviours(pool);
    grainspan_pool_close(pool);
    printf("sound\n");
    return 0;
}
