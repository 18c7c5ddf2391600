/* A receiver in plain C for FMI 2.0 Co-Simulation that needs only the FMI headers.
 *
 * The circles around four beacons, at the sensor's depth, differ by straight lines. Their
 * least-squares intersection is the position. build.py makes the FMU.
 *
 * Value references are indices into `real` and `integer` below. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FMI2_FUNCTION_PREFIX
#include "fmi2Functions.h"

enum { RANGE = 0, RANGE_EPOCH = 4, BEACON = 8, DEPTH = 20, EPOCH = 21, POSITION = 22, N_REAL = 25 };
enum { RECEPTION_COUNT = 0, UPDATE_COUNT = 4, N_INTEGER = 5 };

typedef struct {
    double real[N_REAL];
    int integer[N_INTEGER];
    int seen; /* receptions used in the newest estimate */
} receiver;

static void update(receiver *r)
{
    const double *range = r->real + RANGE, *epoch = r->real + RANGE_EPOCH, *b = r->real + BEACON;
    const double depth = r->real[DEPTH];
    double mean[3] = {0}, right[4], a = 0, c = 0, d = 0, e = 0, f = 0, newest = epoch[0];
    int receptions = 0;

    for (int i = 0; i < 4; i++) {
        if (r->integer[RECEPTION_COUNT + i] == 0)
            return; /* not all beacons have been heard */
        receptions += r->integer[RECEPTION_COUNT + i];
    }
    if (receptions == r->seen)
        return; /* nothing new */
    r->seen = receptions;
    for (int i = 0; i < 4; i++, b += 3) {
        const double down = depth - b[2];
        right[i] = b[0] * b[0] + b[1] * b[1] - (range[i] * range[i] - down * down);
        mean[0] += b[0] / 4, mean[1] += b[1] / 4, mean[2] += right[i] / 4;
        newest = fmax(newest, epoch[i]);
    }
    b = r->real + BEACON;
    for (int i = 0; i < 4; i++, b += 3) { /* normal equations [a c; c d] [north east] = [e f] */
        const double x = 2 * (b[0] - mean[0]), y = 2 * (b[1] - mean[1]), z = right[i] - mean[2];
        a += x * x, c += x * y, d += y * y, e += x * z, f += y * z;
    }
    r->real[POSITION] = (d * e - c * f) / (a * d - c * c);
    r->real[POSITION + 1] = (a * f - c * e) / (a * d - c * c);
    r->real[POSITION + 2] = depth;
    r->real[EPOCH] = newest;
    r->integer[UPDATE_COUNT]++;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set)
{
    (void)time, (void)step, (void)no_set;
    update(c);
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging)
{
    (void)name, (void)resources, (void)callbacks, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || strcmp(guid, "receiver-in-c-1")) /* as modelDescription.xml */
        return NULL;
    return calloc(1, sizeof(receiver));
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2Reset(fmi2Component c)
{
    memset(c, 0, sizeof(receiver));
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop)
{
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    ((receiver *)c)->real[EPOCH] = start;
    return fmi2OK;
}

#define ACCESS(Type, type, member, size)                                                           \
    fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n, type v[])   \
    {                                                                                              \
        for (size_t i = 0; i < n; i++) {                                                           \
            if (vr[i] >= size)                                                                     \
                return fmi2Error;                                                                  \
            v[i] = ((receiver *)c)->member[vr[i]];                                                 \
        }                                                                                          \
        return fmi2OK;                                                                             \
    }                                                                                              \
    fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n,             \
                             const type v[])                                                       \
    {                                                                                              \
        for (size_t i = 0; i < n; i++) {                                                           \
            if (vr[i] >= size)                                                                     \
                return fmi2Error;                                                                  \
            ((receiver *)c)->member[vr[i]] = v[i];                                                 \
        }                                                                                          \
        return fmi2OK;                                                                             \
    }
ACCESS(Real, fmi2Real, real, N_REAL)
ACCESS(Integer, fmi2Integer, integer, N_INTEGER)

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

/* Calls without effect, and functions that this FMU does not support but tools expect to exist. */
#define TRIVIAL(name, result, ...)                                                                 \
    fmi2Status name(__VA_ARGS__) { return result; }
#pragma GCC diagnostic ignored "-Wunused-parameter"
#define C fmi2Component c
#define REFERENCES const fmi2ValueReference vr[], size_t n
TRIVIAL(fmi2EnterInitializationMode, fmi2OK, C)
TRIVIAL(fmi2ExitInitializationMode, fmi2OK, C)
TRIVIAL(fmi2Terminate, fmi2OK, C)
TRIVIAL(fmi2SetDebugLogging, fmi2OK, C, fmi2Boolean on, size_t n, const fmi2String categories[])
TRIVIAL(fmi2GetBoolean, n ? fmi2Error : fmi2OK, C, REFERENCES, fmi2Boolean v[])
TRIVIAL(fmi2SetBoolean, n ? fmi2Error : fmi2OK, C, REFERENCES, const fmi2Boolean v[])
TRIVIAL(fmi2GetString, n ? fmi2Error : fmi2OK, C, REFERENCES, fmi2String v[])
TRIVIAL(fmi2SetString, n ? fmi2Error : fmi2OK, C, REFERENCES, const fmi2String v[])
TRIVIAL(fmi2CancelStep, fmi2Error, C)
TRIVIAL(fmi2GetFMUstate, fmi2Error, C, fmi2FMUstate *state)
TRIVIAL(fmi2SetFMUstate, fmi2Error, C, fmi2FMUstate state)
TRIVIAL(fmi2FreeFMUstate, fmi2Error, C, fmi2FMUstate *state)
TRIVIAL(fmi2SerializedFMUstateSize, fmi2Error, C, fmi2FMUstate state, size_t *size)
TRIVIAL(fmi2SerializeFMUstate, fmi2Error, C, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
TRIVIAL(fmi2DeSerializeFMUstate, fmi2Error, C, const fmi2Byte bytes[], size_t size, fmi2FMUstate *s)
TRIVIAL(fmi2GetDirectionalDerivative, fmi2Error, C, REFERENCES, const fmi2ValueReference known[],
        size_t n_known, const fmi2Real seed[], fmi2Real sensitivity[])
TRIVIAL(fmi2SetRealInputDerivatives, fmi2Error, C, REFERENCES, const fmi2Integer order[],
        const fmi2Real v[])
TRIVIAL(fmi2GetRealOutputDerivatives, fmi2Error, C, REFERENCES, const fmi2Integer order[],
        fmi2Real v[])
TRIVIAL(fmi2GetStatus, fmi2Error, C, const fmi2StatusKind kind, fmi2Status *v)
TRIVIAL(fmi2GetRealStatus, fmi2Error, C, const fmi2StatusKind kind, fmi2Real *v)
TRIVIAL(fmi2GetIntegerStatus, fmi2Error, C, const fmi2StatusKind kind, fmi2Integer *v)
TRIVIAL(fmi2GetBooleanStatus, fmi2Error, C, const fmi2StatusKind kind, fmi2Boolean *v)
TRIVIAL(fmi2GetStringStatus, fmi2Error, C, const fmi2StatusKind kind, fmi2String *v)
