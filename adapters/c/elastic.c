/* An engine in C: an elastic law in place of grains, to show every function that an engine has.
 *
 * cc -std=c11 -I adapters/c adapters/c/elastic.c target/release/libgrainspan_worker_c.a -lm -lpthread -ldl -o elastic
 * elastic --run RUN */
#include "grainspan_worker.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A trial beyond this strain is left to smaller steps, as an engine with a limit of its own would do. */
#ifndef LARGEST_STRAIN
#define LARGEST_STRAIN 0.1
#endif

typedef struct {
    double stiffness;
    double committed[9];
    double trial[9];
} elastic;

static void *create(const grainspan_cell *cell, char *reason, size_t length) {
    elastic *rve = calloc(1, sizeof *rve);
    if (rve == NULL) {
        snprintf(reason, length, "out of memory");
        return NULL;
    }
    rve->stiffness = cell->modulus > 0.0 ? cell->modulus : cell->normal_stiffness;
    rve->committed[0] = rve->committed[4] = -1e5;
    return rve;
}

static int trial(void *self, const double gradient[9], const grainspan_trial_options *ask, grainspan_answer *answer, char *reason,
                 size_t length) {
    elastic *rve = self;
    if (ask->tangent != 0) {
        snprintf(reason, length, "a tangent");
        return GRAINSPAN_REFUSED;
    }
    int moved = 0;
    double trace = gradient[0] + gradient[4];
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            if (fabs(gradient[3 * i + j] + gradient[3 * j + i]) > 2.0 * LARGEST_STRAIN) {
                snprintf(reason, length, "strain beyond %g", LARGEST_STRAIN);
                return GRAINSPAN_TOO_LARGE;
            }
        }
    }
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            double strain = 0.5 * (gradient[3 * i + j] + gradient[3 * j + i]);
            moved |= gradient[3 * i + j] != 0.0;
            rve->trial[3 * i + j] =
                rve->committed[3 * i + j] + rve->stiffness * (strain + (i == j ? 0.5 * trace : 0.0));
        }
    }
    memcpy(answer->stress, rve->trial, sizeof rve->trial);
    answer->volume_ratio = 1.0;
    answer->force_evaluations = 1;
    answer->flags = moved ? 0 : 32; /* the target was zero */
    return GRAINSPAN_OK;
}

static void commit(void *self) {
    elastic *rve = self;
    memcpy(rve->committed, rve->trial, sizeof rve->committed);
}

static void rollback(void *self) {
    elastic *rve = self;
    memset(rve->trial, 0, sizeof rve->trial);
}

static size_t snapshot(const void *self, int of_trial, uint8_t *out, size_t capacity) {
    const elastic *rve = self;
    if (capacity >= sizeof rve->committed) {
        memcpy(out, of_trial ? rve->trial : rve->committed, sizeof rve->committed);
    }
    return sizeof rve->committed;
}

static int restore(void *self, const uint8_t *bytes, size_t length, char *reason, size_t reason_length) {
    elastic *rve = self;
    if (length != sizeof rve->committed) {
        snprintf(reason, reason_length, "a state of %zu bytes", length);
        return GRAINSPAN_REFUSED;
    }
    memcpy(rve->committed, bytes, length);
    return GRAINSPAN_OK;
}

static void release(void *self) {
    free(self);
}

int main(int count, char **words) {
    const grainspan_engine engine = {
        .name = "elastic-c", .version = "1", .plane = 1, .linear = 1, .largest_target = 0.2,
        .create = create, .trial = trial, .commit = commit, .rollback = rollback,
        .snapshot = snapshot, .restore = restore, .release = release,
    };
    for (int place = 1; place < count; place++) {
        if (strcmp(words[place], "--capabilities") == 0) {
            return grainspan_print_capabilities(&engine);
        }
        if (strcmp(words[place], "--run") == 0 && place + 1 < count) {
            return grainspan_serve(words[place + 1], &engine);
        }
    }
    fprintf(stderr, "usage: %s --run RUN | --capabilities\n", words[0]);
    return 2;
}
