/* FMI 2.0 for Co-Simulation over an instance of a component. */
#include "fmi2Functions.h"

typedef fmi2Boolean boolean;
typedef fmi2CallbackLogger logger_callback;
#define ARRAYS 0
#include "instance.h"
#include "life_cycle.h"
#include "values.h"
#include "steps.h"
#include "snapshots.h"

#define NOT_NULL(pointer)                                                                         \
    if (!(pointer))                                                                               \
        return (fmi2Status)report(c, ERROR, "%s: " #pointer " must not be null", __func__)
#define INSTANCE_AND_MODE(modes)                                                                  \
    if (!c || require(c, (modes), __func__) != OK)                                                \
        return fmi2Error
#define NOT_SUPPORTED(what)                                                                       \
    return c ? (fmi2Status)report(c, ERROR, "%s: %s", __func__, what) : fmi2Error

static const char *const categories[] = {"logStatusWarning", "logStatusDiscard", "logStatusError"};

static void emit(const struct instance *in, enum status status, const char *message)
{
    if (in->logger)
        in->logger(in->environment, in->name, (fmi2Status)status,
                   categories[status == WARNING ? 0 : status == DISCARD ? 1 : 2], message);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

/* Messages come with a status other than OK; these are always passed on. */
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String names[])
{
    (void)loggingOn;
    INSTANCE_AND_MODE(ANY_MODE);
    if (nCategories > 0)
        NOT_NULL(names);
    for (size_t i = 0; i < nCategories; i++) {
        NOT_NULL(names[i]);
        int known = 0;
        for (size_t j = 0; j < sizeof categories / sizeof *categories; j++)
            known |= strcmp(names[i], categories[j]) == 0;
        if (!known)
            return (fmi2Status)report(c, ERROR, "%s: there is no log category '%s'", __func__,
                                      names[i]);
    }
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn)
{
    (void)fmuResourceLocation, (void)visible, (void)loggingOn;
    struct instance nobody = {.logger = functions ? functions->logger : NULL,
                              .environment = functions ? functions->componentEnvironment : NULL};
    if (!instanceName || !*instanceName) {
        report(&nobody, ERROR, "%s: the instance must have a name", __func__);
        return NULL;
    }
    if (!fmuGUID || strcmp(fmuGUID, MODEL_TOKEN) != 0) {
        report(&nobody, ERROR, "%s: the GUID must be %s, got %s", __func__, MODEL_TOKEN,
               fmuGUID ? fmuGUID : "null");
        return NULL;
    }
    if (fmuType != fmi2CoSimulation) {
        report(&nobody, ERROR, "%s: the FMU is for Co-Simulation only", __func__);
        return NULL;
    }
    return instance_create(instanceName, nobody.environment, nobody.logger);
}

void fmi2FreeInstance(fmi2Component c) { instance_free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    INSTANCE_AND_MODE(INSTANTIATED);
    return (fmi2Status)instance_set_start(c, startTime);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    INSTANCE_AND_MODE(INSTANTIATED);
    ((struct instance *)c)->data.mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    INSTANCE_AND_MODE(INITIALIZATION);
    return (fmi2Status)instance_exit_initialization(c);
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    INSTANCE_AND_MODE(STEP);
    ((struct instance *)c)->data.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    INSTANCE_AND_MODE(ANY_MODE);
    instance_start_values(c);
    return fmi2OK;
}

#define GET(Type, type)                                                                           \
    fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,          \
                             fmi2##Type value[])                                                  \
    {                                                                                             \
        return c ? (fmi2Status)instance_get(c, __func__, type, vr, nvr, value, nvr) : fmi2Error;  \
    }
#define SET(Type, type)                                                                           \
    fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,          \
                             const fmi2##Type value[])                                            \
    {                                                                                             \
        return c ? (fmi2Status)instance_set(c, __func__, type, vr, nvr, value, nvr) : fmi2Error;  \
    }
GET(Real, FLOAT64)
GET(Integer, INT32)
GET(Boolean, BOOLEAN)
SET(Real, FLOAT64)
SET(Integer, INT32)
SET(Boolean, BOOLEAN)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[])
{
    (void)vr, (void)value;
    if (c && nvr == 0)
        return fmi2OK;
    NOT_SUPPORTED("there are no variables of type String");
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[])
{
    (void)vr, (void)value;
    if (c && nvr == 0)
        return fmi2OK;
    NOT_SUPPORTED("there are no variables of type String");
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(FMUstate);
    return (fmi2Status)snapshot_get(c, FMUstate);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(FMUstate);
    return (fmi2Status)snapshot_set(c, FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    INSTANCE_AND_MODE(ANY_MODE);
    if (FMUstate) {
        free(*FMUstate);
        *FMUstate = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(FMUstate);
    NOT_NULL(size);
    *size = sizeof(struct snapshot);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate,
                                 fmi2Byte serializedState[], size_t size)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(FMUstate);
    NOT_NULL(serializedState);
    return (fmi2Status)snapshot_serialize(c, FMUstate, (unsigned char *)serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(serializedState);
    NOT_NULL(FMUstate);
    return (fmi2Status)snapshot_deserialize(c, (const unsigned char *)serializedState, size,
                                            FMUstate);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[],
                                        size_t nUnknown, const fmi2ValueReference knowns[],
                                        size_t nKnown, const fmi2Real seed[],
                                        fmi2Real sensitivity[])
{
    if (!c)
        return fmi2Error;
    return (fmi2Status)instance_derivative(c, __func__, unknowns, nUnknown, knowns, nKnown, seed,
                                           nKnown, sensitivity, nUnknown);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    NOT_SUPPORTED("inputs are held, not interpolated");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    NOT_SUPPORTED("there are no output derivatives");
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    INSTANCE_AND_MODE(STEP);
    return (fmi2Status)instance_step(c, currentCommunicationPoint, communicationStepSize);
}

fmi2Status fmi2CancelStep(fmi2Component c) { NOT_SUPPORTED("no step is ever pending"); }

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    (void)s, (void)value;
    NOT_SUPPORTED("no step is ever pending");
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    INSTANCE_AND_MODE(STEP | TERMINATED | FAILED);
    NOT_NULL(value);
    if (s != fmi2LastSuccessfulTime)
        NOT_SUPPORTED("the only status of type Real is fmi2LastSuccessfulTime");
    *value = (double)((struct instance *)c)->data.time_ns / 1e9;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    (void)s, (void)value;
    NOT_SUPPORTED("there is no status of type Integer");
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    INSTANCE_AND_MODE(STEP | TERMINATED | FAILED);
    NOT_NULL(value);
    if (s != fmi2Terminated)
        NOT_SUPPORTED("the only status of type Boolean is fmi2Terminated");
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    (void)s, (void)value;
    NOT_SUPPORTED("no step is ever pending");
}
