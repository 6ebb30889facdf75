/**
 * @file unit.h
 * @brief One agent as a co-simulation unit: its values by reference, and the sample that is due in a step.
 *
 * Sample k is taken at start + k*PERIOD from the inputs as they are when the step begins that contains this instant;
 * what is written comes out at the end of that step. Steps may be shorter than a period, not longer.
 */
#ifndef UNIT_H
#define UNIT_H

#include "@NAME@_unit.h"

#include <stdlib.h>
#include <string.h>

#define TOLERANCE 1e-3 /* of a period: communication points are rounded multiples */

enum { TIME = 0, Y = 1, U = 2, REFERENCE = 3, STAMP = 4, SENT_Y = 5, OMEGA = 6, LISTS = 7 };

typedef struct {
    double values[UNIT_VALUES];
    @NAME@_state agent;
    double start;
    double sample;
    int running;
} unit;

static void publish(unit *self)
{
    consensus_message message;
    uint32_t l;

    @NAME@_message(&self->agent, &message);
    self->values[U] = (double)self->agent.written;
    self->values[REFERENCE] = self->agent.y_now;
    self->values[STAMP] = (double)message.stamp;
    self->values[SENT_Y] = message.y;
    self->values[OMEGA] = message.omega;
    for (l = 0u; l < CONSENSUS_AGENTS; ++l) {
        self->values[LISTS + l] = message.mixing[l];
        self->values[LISTS + CONSENSUS_AGENTS + l] = message.running[l] ? 1.0 : 0.0;
    }
}

static void exchange(unit *self)
{
    static const uint32_t heard[UNIT_HEARD] = UNIT_SENDERS;
    uint32_t j;
    uint32_t l;

    for (j = 0u; j < UNIT_HEARD; ++j) {
        const double *from = &self->values[UNIT_OUTPUTS + j * UNIT_MESSAGE];
        consensus_message message;

        if (!(from[0] >= 0.0 && from[0] < 9007199254740992.0)) {
            continue; /* nothing is connected */
        }
        message.sender = heard[j];
        message.stamp = (uint64_t)from[0];
        message.y = from[1];
        message.omega = from[2];
        for (l = 0u; l < CONSENSUS_AGENTS; ++l) {
            message.mixing[l] = from[3u + l];
            message.running[l] = from[3u + CONSENSUS_AGENTS + l] > 0.5 ? 1u : 0u;
        }
        (void)@NAME@_receive(&self->agent, &message);
    }
    (void)@NAME@_coordinate(&self->agent);
}

/* -1 in the stamp of an input says that there is no message. */
static void unit_blank(unit *self)
{
    uint32_t j;

    (void)memset(self, 0, sizeof *self);
    for (j = 0u; j < UNIT_HEARD; ++j) {
        self->values[UNIT_OUTPUTS + j * UNIT_MESSAGE] = -1.0;
    }
    self->values[REFERENCE] = UNIT_REFERENCE;
    self->values[SENT_Y] = UNIT_REFERENCE;
}

static int unit_start(unit *self, double time)
{
    self->start = time;
    self->sample = 0.0;
    self->values[TIME] = time;
    if (@NAME@_start(&self->agent, (UNIT_REAL)self->values[Y]) != 0) {
        return 0;
    }
    self->running = 1;
    publish(self);
    return 1;
}

/* NULL, or why the step cannot be made. */
static const char *unit_step(unit *self, double time, double step)
{
    const double due = self->start + self->sample * UNIT_PERIOD;

    if (!self->running) {
        return "the unit was not initialised";
    }
    if (!(step > 0.0) || step > (1.0 + TOLERANCE) * UNIT_PERIOD) {
        return "a communication step must be positive and not longer than the period of the controller";
    }
    if (time > due + TOLERANCE * UNIT_PERIOD) {
        return "a sample was left out";
    }
    if (due < time + step - TOLERANCE * UNIT_PERIOD) {
        if (self->agent.substep == UNIT_SUBSTEPS) {
            exchange(self);
        }
        (void)@NAME@_step(&self->agent, (UNIT_REAL)self->values[Y]);
        self->sample += 1.0;
        publish(self);
    }
    self->values[TIME] = time + step;
    return NULL;
}

static int unit_get(const unit *self, const unsigned *references, size_t count, double *values)
{
    size_t k;

    for (k = 0u; k < count; ++k) {
        if (references[k] >= UNIT_VALUES) {
            return 0;
        }
        values[k] = self->values[references[k]];
    }
    return 1;
}

static int unit_set(unit *self, const unsigned *references, size_t count, const double *values)
{
    size_t k;

    for (k = 0u; k < count; ++k) {
        if (references[k] != Y && (references[k] < UNIT_OUTPUTS || references[k] >= UNIT_VALUES)) {
            return 0;
        }
        self->values[references[k]] = values[k];
    }
    return 1;
}

#endif
