/**
 * @file fmi3.c
 * @brief FMI 3.0, co-simulation: the functions of the standard around unit.h.
 *
 * Types are those of the standard's headers. What the unit does not offer returns fmi3Error.
 */
#include "unit.h"

#include <stdbool.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif
#define OK 0
#define ERROR 3
#define UNUSED(x) (void)(x)

typedef void (*log_callback)(void *environment, int status, const char *category, const char *message);
typedef void (*callback)(void *environment);
typedef void (*preemption)(void);
typedef void (*intermediate)(void *, double, bool, bool, bool, bool, bool *, double *);

typedef struct {
    unit core;
    void *environment;
    log_callback log;
    double time;
} instance;

static int complain(const instance *self, const char *reason)
{
    if (self->log != NULL) {
        self->log(self->environment, ERROR, "logStatusError", reason);
    }
    return ERROR;
}

EXPORT const char *fmi3GetVersion(void)
{
    return "3.0";
}

EXPORT int fmi3SetDebugLogging(void *self, bool on, size_t count, const char *const categories[])
{
    UNUSED(self);
    UNUSED(on);
    UNUSED(count);
    UNUSED(categories);
    return OK;
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *path, bool visible,
    bool logging, bool events, bool early, const unsigned needed[], size_t count, void *environment,
    log_callback log, intermediate update)
{
    instance *self = NULL;

    UNUSED(name);
    UNUSED(path);
    UNUSED(visible);
    UNUSED(logging);
    UNUSED(early);
    UNUSED(needed);
    UNUSED(update);
    if (token == NULL || strcmp(token, UNIT_TOKEN) != 0 || events || count != 0u) {
        return NULL;
    }
    self = malloc(sizeof *self);
    if (self != NULL) {
        unit_blank(&self->core);
        self->environment = environment;
        self->log = log;
        self->time = 0.0;
    }
    return self;
}

EXPORT void fmi3FreeInstance(void *self)
{
    free(self);
}

EXPORT int fmi3EnterInitializationMode(void *self, bool defined, double tolerance, double start, bool stops, double stop)
{
    UNUSED(defined);
    UNUSED(tolerance);
    UNUSED(stops);
    UNUSED(stop);
    ((instance *)self)->time = start;
    return OK;
}

EXPORT int fmi3ExitInitializationMode(void *self)
{
    instance *mine = self;

    return unit_start(&mine->core, mine->time) ? OK : complain(mine, "the arithmetic of this build is not as proved");
}

EXPORT int fmi3EnterEventMode(void *self)
{
    return complain(self, "there is no event mode");
}

EXPORT int fmi3Terminate(void *self)
{
    UNUSED(self);
    return OK;
}

EXPORT int fmi3Reset(void *self)
{
    unit_blank(&((instance *)self)->core);
    return OK;
}

EXPORT int fmi3GetFloat64(void *self, const unsigned references[], size_t count, double values[], size_t size)
{
    instance *mine = self;

    return count == size && unit_get(&mine->core, references, count, values) ? OK : complain(mine, "unknown reference");
}

EXPORT int fmi3SetFloat64(void *self, const unsigned references[], size_t count, const double values[], size_t size)
{
    instance *mine = self;

    return count == size && unit_set(&mine->core, references, count, values) ? OK : complain(mine, "no such input");
}

EXPORT int fmi3DoStep(void *self, double time, double step, bool kept, bool *event, bool *terminate, bool *early,
    double *last)
{
    instance *mine = self;
    const char *reason = unit_step(&mine->core, time, step);

    UNUSED(kept);
    *event = false;
    *terminate = false;
    *early = false;
    *last = reason == NULL ? time + step : time;
    return reason == NULL ? OK : complain(mine, reason);
}

#define ABSENT(name, type) \
    EXPORT int fmi3Get##name(void *self, const unsigned r[], size_t n, type v[], size_t m) \
    { \
        UNUSED(r); \
        UNUSED(v); \
        return n == 0u && m == 0u ? OK : complain(self, "no such variable"); \
    } \
    EXPORT int fmi3Set##name(void *self, const unsigned r[], size_t n, const type v[], size_t m) \
    { \
        UNUSED(r); \
        UNUSED(v); \
        return n == 0u && m == 0u ? OK : complain(self, "no such variable"); \
    }

ABSENT(Float32, float)
ABSENT(Int8, int8_t)
ABSENT(UInt8, uint8_t)
ABSENT(Int16, int16_t)
ABSENT(UInt16, uint16_t)
ABSENT(Int32, int32_t)
ABSENT(UInt32, uint32_t)
ABSENT(Int64, int64_t)
ABSENT(UInt64, uint64_t)
ABSENT(Boolean, bool)

#define REFUSE(name, parameters, used) \
    EXPORT int fmi3##name parameters \
    { \
        used; \
        return ERROR; \
    }
#define ONE UNUSED(a)
#define TWO ONE, UNUSED(b)
#define THREE TWO, UNUSED(c)
#define FOUR THREE, UNUSED(d)
#define FIVE FOUR, UNUSED(e)
#define SIX FIVE, UNUSED(f)
#define SEVEN SIX, UNUSED(g)
#define EIGHT SEVEN, UNUSED(h)
#define NINE EIGHT, UNUSED(i)

typedef const unsigned *refs;

EXPORT void *fmi3InstantiateModelExchange(const char *a, const char *b, const char *c, bool d, bool e, void *f,
    log_callback g)
{
    SEVEN;
    return NULL;
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *a, const char *b, const char *c, bool d, bool e, void *f,
    log_callback g, callback h, preemption i, preemption j)
{
    NINE, UNUSED(j);
    return NULL;
}

REFUSE(GetString, (void *a, refs b, size_t c, const char **d, size_t e), FIVE)
REFUSE(SetString, (void *a, refs b, size_t c, const char *const *d, size_t e), FIVE)
REFUSE(GetBinary, (void *a, refs b, size_t c, size_t *d, const uint8_t **e, size_t f), SIX)
REFUSE(SetBinary, (void *a, refs b, size_t c, const size_t *d, const uint8_t *const *e, size_t f), SIX)
REFUSE(GetClock, (void *a, refs b, size_t c, bool *d), FOUR)
REFUSE(SetClock, (void *a, refs b, size_t c, const bool *d), FOUR)
REFUSE(GetNumberOfVariableDependencies, (void *a, unsigned b, size_t *c), THREE)
REFUSE(GetVariableDependencies, (void *a, unsigned b, size_t *c, unsigned *d, size_t *e, int *f, size_t g), SEVEN)
REFUSE(GetFMUState, (void *a, void **b), TWO)
REFUSE(SetFMUState, (void *a, void *b), TWO)
REFUSE(FreeFMUState, (void *a, void **b), TWO)
REFUSE(SerializedFMUStateSize, (void *a, void *b, size_t *c), THREE)
REFUSE(SerializeFMUState, (void *a, void *b, uint8_t *c, size_t d), FOUR)
REFUSE(DeserializeFMUState, (void *a, const uint8_t *b, size_t c, void **d), FOUR)
REFUSE(GetDirectionalDerivative,
    (void *a, refs b, size_t c, refs d, size_t e, const double *f, size_t g, double *h, size_t i), NINE)
REFUSE(GetAdjointDerivative,
    (void *a, refs b, size_t c, refs d, size_t e, const double *f, size_t g, double *h, size_t i), NINE)
REFUSE(EnterConfigurationMode, (void *a), ONE)
REFUSE(ExitConfigurationMode, (void *a), ONE)
REFUSE(GetIntervalDecimal, (void *a, refs b, size_t c, double *d, int *e), FIVE)
REFUSE(GetIntervalFraction, (void *a, refs b, size_t c, uint64_t *d, uint64_t *e, int *f), SIX)
REFUSE(GetShiftDecimal, (void *a, refs b, size_t c, double *d), FOUR)
REFUSE(GetShiftFraction, (void *a, refs b, size_t c, uint64_t *d, uint64_t *e), FIVE)
REFUSE(SetIntervalDecimal, (void *a, refs b, size_t c, const double *d), FOUR)
REFUSE(SetIntervalFraction, (void *a, refs b, size_t c, const uint64_t *d, const uint64_t *e), FIVE)
REFUSE(SetShiftDecimal, (void *a, refs b, size_t c, const double *d), FOUR)
REFUSE(SetShiftFraction, (void *a, refs b, size_t c, const uint64_t *d, const uint64_t *e), FIVE)
REFUSE(EvaluateDiscreteStates, (void *a), ONE)
REFUSE(UpdateDiscreteStates, (void *a, bool *b, bool *c, bool *d, bool *e, bool *f, double *g), SEVEN)
REFUSE(EnterContinuousTimeMode, (void *a), ONE)
REFUSE(CompletedIntegratorStep, (void *a, bool b, bool *c, bool *d), FOUR)
REFUSE(SetTime, (void *a, double b), TWO)
REFUSE(SetContinuousStates, (void *a, const double *b, size_t c), THREE)
REFUSE(GetContinuousStateDerivatives, (void *a, double *b, size_t c), THREE)
REFUSE(GetEventIndicators, (void *a, double *b, size_t c), THREE)
REFUSE(GetContinuousStates, (void *a, double *b, size_t c), THREE)
REFUSE(GetNominalsOfContinuousStates, (void *a, double *b, size_t c), THREE)
REFUSE(GetNumberOfEventIndicators, (void *a, size_t *b), TWO)
REFUSE(GetNumberOfContinuousStates, (void *a, size_t *b), TWO)
REFUSE(EnterStepMode, (void *a), ONE)
REFUSE(GetOutputDerivatives, (void *a, refs b, size_t c, const int32_t *d, double *e, size_t f), SIX)
REFUSE(ActivateModelPartition, (void *a, unsigned b, double c), THREE)
