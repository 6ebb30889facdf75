/**
 * @file fmi2.c
 * @brief FMI 2.0, co-simulation: the functions of the standard around unit.h.
 *
 * Types are those of the standard's headers. What the unit does not offer returns fmi2Error.
 */
#include "unit.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif
#define OK 0
#define ERROR 3
#define CO_SIMULATION 1
#define UNUSED(x) (void)(x)

typedef void (*log_callback)(void *environment, const char *name, int status, const char *category,
    const char *message, ...);

typedef struct {
    log_callback log;
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*finished)(void *environment, int status);
    void *environment;
} callbacks;

typedef struct {
    unit core;
    callbacks host;
    double time;
} instance;

static int complain(const instance *self, const char *reason)
{
    if (self->host.log != NULL) {
        self->host.log(self->host.environment, "@NAME@", ERROR, "logStatusError", "%s", reason);
    }
    return ERROR;
}

EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORT const char *fmi2GetVersion(void)
{
    return "2.0";
}

EXPORT int fmi2SetDebugLogging(void *self, int on, size_t count, const char *const categories[])
{
    UNUSED(self);
    UNUSED(on);
    UNUSED(count);
    UNUSED(categories);
    return OK;
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
    const callbacks *functions, int visible, int logging)
{
    instance *self = NULL;

    UNUSED(name);
    UNUSED(location);
    UNUSED(visible);
    UNUSED(logging);
    if (guid == NULL || strcmp(guid, UNIT_TOKEN) != 0 || type != CO_SIMULATION || functions == NULL) {
        return NULL;
    }
    self = malloc(sizeof *self);
    if (self != NULL) {
        unit_blank(&self->core);
        self->host = *functions;
        self->time = 0.0;
    }
    return self;
}

EXPORT void fmi2FreeInstance(void *self)
{
    free(self);
}

EXPORT int fmi2SetupExperiment(void *self, int defined, double tolerance, double start, int stops, double stop)
{
    UNUSED(defined);
    UNUSED(tolerance);
    UNUSED(stops);
    UNUSED(stop);
    ((instance *)self)->time = start;
    return OK;
}

EXPORT int fmi2EnterInitializationMode(void *self)
{
    UNUSED(self);
    return OK;
}

EXPORT int fmi2ExitInitializationMode(void *self)
{
    instance *mine = self;

    return unit_start(&mine->core, mine->time) ? OK : complain(mine, "the arithmetic of this build is not as proved");
}

EXPORT int fmi2Terminate(void *self)
{
    UNUSED(self);
    return OK;
}

EXPORT int fmi2Reset(void *self)
{
    unit_blank(&((instance *)self)->core);
    return OK;
}

EXPORT int fmi2GetReal(void *self, const unsigned references[], size_t count, double values[])
{
    instance *mine = self;

    return unit_get(&mine->core, references, count, values) ? OK : complain(mine, "unknown reference");
}

EXPORT int fmi2SetReal(void *self, const unsigned references[], size_t count, const double values[])
{
    instance *mine = self;

    return unit_set(&mine->core, references, count, values) ? OK : complain(mine, "no such input");
}

EXPORT int fmi2DoStep(void *self, double time, double step, int kept)
{
    instance *mine = self;
    const char *reason = unit_step(&mine->core, time, step);

    UNUSED(kept);
    return reason == NULL ? OK : complain(mine, reason);
}

#define ABSENT(name, type) \
    EXPORT int fmi2Get##name(void *self, const unsigned r[], size_t n, type v[]) \
    { \
        UNUSED(r); \
        UNUSED(v); \
        return n == 0u ? OK : complain(self, "no such variable"); \
    } \
    EXPORT int fmi2Set##name(void *self, const unsigned r[], size_t n, const type v[]) \
    { \
        UNUSED(r); \
        UNUSED(v); \
        return n == 0u ? OK : complain(self, "no such variable"); \
    }

typedef const char *text;

ABSENT(Integer, int)
ABSENT(Boolean, int)
ABSENT(String, text)

#define REFUSE(name, parameters, used) \
    EXPORT int fmi2##name parameters \
    { \
        used; \
        return ERROR; \
    }
#define ONE UNUSED(a)
#define TWO ONE, UNUSED(b)
#define THREE TWO, UNUSED(c)
#define FOUR THREE, UNUSED(d)
#define FIVE FOUR, UNUSED(e)
#define SEVEN FIVE, UNUSED(f), UNUSED(g)

typedef const unsigned *refs;

REFUSE(GetFMUstate, (void *a, void **b), TWO)
REFUSE(SetFMUstate, (void *a, void *b), TWO)
REFUSE(FreeFMUstate, (void *a, void **b), TWO)
REFUSE(SerializedFMUstateSize, (void *a, void *b, size_t *c), THREE)
REFUSE(SerializeFMUstate, (void *a, void *b, char *c, size_t d), FOUR)
REFUSE(DeSerializeFMUstate, (void *a, const char *b, size_t c, void **d), FOUR)
REFUSE(GetDirectionalDerivative, (void *a, refs b, size_t c, refs d, size_t e, const double *f, double *g), SEVEN)
REFUSE(SetRealInputDerivatives, (void *a, refs b, size_t c, const int *d, const double *e), FIVE)
REFUSE(GetRealOutputDerivatives, (void *a, refs b, size_t c, const int *d, double *e), FIVE)
REFUSE(CancelStep, (void *a), ONE)
REFUSE(GetStatus, (void *a, int b, int *c), THREE)
REFUSE(GetRealStatus, (void *a, int b, double *c), THREE)
REFUSE(GetIntegerStatus, (void *a, int b, int *c), THREE)
REFUSE(GetBooleanStatus, (void *a, int b, int *c), THREE)
REFUSE(GetStringStatus, (void *a, int b, const char **c), THREE)
