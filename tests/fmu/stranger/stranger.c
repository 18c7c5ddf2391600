/* An FMU that is not ours, for FMI 2.0 (-DFMI=2) and FMI 3.0 (-DFMI=3) Co-Simulation.
 *
 * In a step from t to t + h:
 *     y[i,1] = gain u[i] + offset[i],  y[i,2] += h u[i],  steps += n,  was_on = on,  now = t + h.
 * A negative gain is refused with a message; so is the step that contains fail_at, with the status
 * fail_as. From 5 on, fail_as is how to misbehave instead; see misbehave().
 *
 * There are variables of which no description speaks unless a test puts them there: the outputs z,
 * the first row of y (700), and odd, whether steps is (2300); as scalars u (800, 801), offset (802,
 * 803), y row by row (804 to 807) and y[1,1] + y[2,1] (808); and in FMI 3 arrays of two of every
 * other type of numbers, 3100 (input) and 3150 (output) for Float32, 3200 and 3250 for Int8, and so
 * on: in a step output = input + 1.
 *
 * Value references: variable number times 100, plus (FMI 2) the number of the element. */
#include "../hang.h"

#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define OTHER_TYPES(X)                                                                             \
    X(Float32, float, 31) X(Int8, int8_t, 32) X(UInt8, uint8_t, 33) X(Int16, int16_t, 34)          \
    X(UInt16, uint16_t, 35) X(UInt32, uint32_t, 36) X(Int64, int64_t, 37) X(UInt64, uint64_t, 38)

#if FMI == 2
#include "fmi2FunctionTypes.h"
typedef fmi2Boolean boolean;
#define EXPORT(name) fmi2##name
#else
#include "fmi3FunctionTypes.h"
typedef fmi3Boolean boolean;
#define EXPORT(name) fmi3##name
#endif

typedef struct {
    double gain, offset[2], fail_at, u[2], y[4], total, now;
    int32_t fail_as, n, steps;
    boolean on, was_on, odd;
    bool initialised, broken, slow;
#define MEMBER(Type, type, number) struct { type in[2], out[2]; } pair_##Type;
    OTHER_TYPES(MEMBER)
    char name[64];
    void *environment;
#if FMI == 2
    fmi2CallbackLogger logger;
#else
    fmi3LogMessageCallback logger;
#endif
} instance;

static void start(instance *in)
{
    in->gain = 1, in->fail_at = -1, in->now = 0, in->fail_as = 2, in->n = 1, in->steps = 0;
    memset(in->offset, 0, sizeof in->offset), memset(in->u, 0, sizeof in->u);
    memset(in->y, 0, sizeof in->y), in->total = 0;
    in->on = in->was_on = in->odd = 0, in->initialised = in->broken = in->slow = false;
#define CLEAR(Type, type, number) memset(&in->pair_##Type, 0, sizeof in->pair_##Type);
    OTHER_TYPES(CLEAR)
}

/* FMI 2 formats messages in the logger, FMI 3 before it. */
static void complain(instance *in, int status, const char *format, double value)
{
#if FMI == 2
    in->logger(in->environment, in->name, status, "logStatusError", format, value);
#else
    char message[200];
    snprintf(message, sizeof message, format, value);
    in->logger(in->environment, status, "logStatusError", message);
#endif
}

static void *locate(instance *in, unsigned vr, size_t *n)
{
    *n = 1;
    if (in->broken && vr / 100 == 5)
        *(volatile int *)n = 1 / *(volatile int *)NULL;
    switch (vr / 100) {
    case 1: return &in->gain;
    case 2: *n = 2; return in->offset + vr % 100;
    case 3: return &in->fail_at;
    case 4: *n = 2; return in->u + vr % 100;
    case 5: *n = 4; return in->y + vr % 100;
    case 6: return &in->now;
    case 7: *n = 2; return in->y + vr % 100;
    case 8:
        if (vr % 100 < 9)
            return (double *[]){in->u, in->u + 1, in->offset, in->offset + 1, in->y, in->y + 1,
                                in->y + 2, in->y + 3, &in->total}[vr % 100];
        return complain(in, 3, "unknown value reference %g", vr), NULL;
    case 11: return &in->fail_as;
    case 12: return &in->n;
    case 13: return &in->steps;
    case 21: return &in->on;
    case 22: return &in->was_on;
    case 23: return &in->odd;
#define CASE(Type, type, number)                                                                   \
    case number: *n = 2; return vr % 100 ? in->pair_##Type.out : in->pair_##Type.in;
    OTHER_TYPES(CASE)
    default: complain(in, 3, "unknown value reference %g", vr); return NULL;
    }
}

#if FMI == 2
#define VALUES
#define COUNT(n) 1
#else
#define VALUES , size_t n_values
#define COUNT(n) (n)
#endif

#define ACCESS(Type, type)                                                                         \
    int EXPORT(Get##Type)(void *c, const unsigned vr[], size_t nvr, type value[] VALUES)           \
    {                                                                                              \
        for (size_t i = 0, n; i < nvr; i++, value += COUNT(n)) {                                   \
            const type *from = locate(c, vr[i], &n);                                               \
            if (!from)                                                                             \
                return 3;                                                                          \
            memcpy(value, from, COUNT(n) * sizeof *value);                                         \
        }                                                                                          \
        return 0;                                                                                  \
    }                                                                                              \
    int EXPORT(Set##Type)(void *c, const unsigned vr[], size_t nvr, const type value[] VALUES)     \
    {                                                                                              \
        for (size_t i = 0, n; i < nvr; i++, value += COUNT(n)) {                                   \
            type *to = locate(c, vr[i], &n);                                                       \
            if (!to)                                                                               \
                return 3;                                                                          \
            memcpy(to, value, COUNT(n) * sizeof *value);                                           \
        }                                                                                          \
        return 0;                                                                                  \
    }

#if FMI == 2
ACCESS(Real, double)
ACCESS(Integer, int32_t)
#else
ACCESS(Float64, double)
ACCESS(Int32, int32_t)
#define OTHER(Type, type, number) ACCESS(Type, type)
OTHER_TYPES(OTHER)
#endif
ACCESS(Boolean, boolean)

/* With -DTEXT, 2400 is a text, whose length is added to offset[1]. */
int EXPORT(SetString)(instance *in, const unsigned vr[], size_t nvr,
                      const char *const value[] VALUES)
{
#ifdef TEXT
    const bool known = nvr == 1 && vr[0] == 2400;
    in->offset[0] += known ? (double)strlen(value[0]) : 0;
    return known ? 0 : 3;
#else
    return (void)in, (void)vr, (void)nvr, (void)value, 3;
#endif
}

static int use_up_the_stack(volatile char *above)
{
    volatile char more[10000];
    more[0] = above ? *above : 0;
    return use_up_the_stack(more) + more[0];
}

static void misbehave(instance *in)
{
    switch (in->fail_as) {
    case 5: *(volatile int *)NULL = 0; break;
    case 6: abort();
    case 7: raise(SIGFPE); break;
    case 8: raise(SIGILL); break;
    case 9: raise(SIGBUS); break;
    case 10: use_up_the_stack(NULL); break;
    case 11: hang();
    case 12: in->broken = true; break; /* crashes when y is read */
    case 13: in->slow = true; break;   /* 1 ms per step from now on */
    }
}

static int step(instance *in, double t, double h)
{
    if (!in->initialised)
        return 3;
    if (in->slow)
        usleep(1000);
    const bool fail = in->fail_at >= t && in->fail_at < t + h;
    if (fail && in->fail_as > 4) {
        misbehave(in);
    } else if (fail) {
        complain(in, in->fail_as, "cannot step over %g", in->fail_at);
        return in->fail_as;
    }
    for (int i = 0; i < 2; i++) {
        in->y[2 * i] = in->gain * in->u[i] + in->offset[i];
        in->y[2 * i + 1] += h * in->u[i];
    }
    in->total = in->y[0] + in->y[2];
#define ADVANCE(Type, type, number)                                                                \
    for (int i = 0; i < 2; i++)                                                                    \
        in->pair_##Type.out[i] = (type)(in->pair_##Type.in[i] + 1);
    OTHER_TYPES(ADVANCE)
    in->steps += in->n, in->was_on = in->on, in->odd = in->steps & 1, in->now = t + h;
    return 0;
}

static int enter(instance *in)
{
    if (in->gain < 0)
        complain(in, 3, "gain must not be negative, got %g", in->gain);
    return in->gain < 0 ? 3 : 0;
}

int EXPORT(ExitInitializationMode)(instance *in) { return in->initialised = true, 0; }
int EXPORT(Reset)(instance *in) { return start(in), 0; }
void EXPORT(FreeInstance)(instance *in) { free(in); }
int EXPORT(Terminate)(instance *in) { return (void)in, 0; }
int EXPORT(SetDebugLogging)(instance *in, int on, size_t n, const char *const names[])
{
    return (void)in, (void)on, (void)n, (void)names, 0;
}

static instance *create(const char *name, const char *token, void *environment, void *logger)
{
    instance *in = calloc(1, sizeof *in);
    start(in);
    in->environment = environment;
    memcpy(&in->logger, &logger, sizeof logger);
    snprintf(in->name, sizeof in->name, "%s", name);
#ifdef ONLY_ONCE
    static int instances;
    if (++instances > 1) {
        complain(in, 3, "this is instance number %g", instances);
        free(in);
        return NULL;
    }
#endif
    if (strcmp(token, "stranger-1")) {
        complain(in, 3, "token must be stranger-%g", 1);
        free(in);
        return NULL;
    }
    return in;
}

/* What this FMU does not do; FMPy wants every function to be there. */
#define NO(name)                                                                                   \
    int EXPORT(name)(void) { return 3; }

#if FMI == 2
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
instance *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                          const fmi2CallbackFunctions *callbacks, int visible, int logging)
{
    (void)type, (void)resources, (void)visible, (void)logging;
    return create(name, token, callbacks->componentEnvironment, (void *)callbacks->logger);
}
int fmi2SetupExperiment(instance *in, int a, double b, double t, int d, double e)
{
    return (void)a, (void)b, (void)d, (void)e, in->now = t, 0;
}
int fmi2EnterInitializationMode(instance *in) { return enter(in); }
int fmi2DoStep(instance *in, double t, double h, int no_set) { return (void)no_set, step(in, t, h); }
NO(CancelStep) NO(DeSerializeFMUstate) NO(FreeFMUstate) NO(GetBooleanStatus)
NO(GetDirectionalDerivative) NO(GetFMUstate) NO(GetIntegerStatus) NO(GetRealOutputDerivatives)
NO(GetRealStatus) NO(GetStatus) NO(GetString) NO(GetStringStatus) NO(SerializeFMUstate)
NO(SerializedFMUstateSize) NO(SetFMUstate) NO(SetRealInputDerivatives)
#else
const char *fmi3GetVersion(void) { return "3.0"; }
instance *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                      bool visible, bool logging, bool events, bool early,
                                      const unsigned required[], size_t n_required,
                                      void *environment, void *logger, void *update)
{
    (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)required;
    (void)n_required, (void)update;
    return create(name, token, environment, logger);
}
int fmi3EnterInitializationMode(instance *in, bool a, double b, double t, bool d, double e)
{
    return (void)a, (void)b, (void)d, (void)e, in->now = t, enter(in);
}
/* Status 0 as fail_as: end the simulation politely; 14: end the step early. */
int fmi3DoStep(instance *in, double t, double h, bool no_set, bool *event, bool *terminate,
               bool *early, double *last)
{
    (void)no_set;
    const bool now = in->fail_at >= t && in->fail_at < t + h;
    *terminate = now && in->fail_as == 0, *early = now && in->fail_as == 14;
    *event = false, *last = *early ? in->fail_at : t + h;
    return step(in, t, *last - t);
}
NO(ActivateModelPartition) NO(CompletedIntegratorStep) NO(DeserializeFMUState)
NO(EnterConfigurationMode) NO(EnterContinuousTimeMode) NO(EnterEventMode) NO(EnterStepMode)
NO(EvaluateDiscreteStates) NO(ExitConfigurationMode) NO(FreeFMUState) NO(GetAdjointDerivative)
NO(GetBinary) NO(GetClock) NO(GetContinuousStateDerivatives) NO(GetContinuousStates)
NO(GetDirectionalDerivative) NO(GetEventIndicators) NO(GetFMUState)
NO(GetIntervalDecimal) NO(GetIntervalFraction)
NO(GetNominalsOfContinuousStates) NO(GetNumberOfContinuousStates) NO(GetNumberOfEventIndicators)
NO(GetNumberOfVariableDependencies) NO(GetOutputDerivatives) NO(GetShiftDecimal)
NO(GetShiftFraction) NO(GetString)
NO(GetVariableDependencies) NO(InstantiateModelExchange) NO(InstantiateScheduledExecution)
NO(SerializeFMUState) NO(SerializedFMUStateSize) NO(SetBinary) NO(SetClock)
NO(SetContinuousStates) NO(SetFMUState)
NO(SetIntervalDecimal) NO(SetIntervalFraction) NO(SetShiftDecimal) NO(SetShiftFraction)
NO(SetTime)
NO(UpdateDiscreteStates)
#endif
