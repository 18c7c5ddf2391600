/* FMI 3.0 for Co-Simulation over an instance of a component. */
#include "fmi3Functions.h"

typedef fmi3Boolean boolean;
typedef fmi3LogMessageCallback logger_callback;
#define ARRAYS 1
#include "instance.h"
#include "life_cycle.h"
#include "values.h"
#include "steps.h"
#include "snapshots.h"

#define NOT_NULL(pointer)                                                                         \
    if (!(pointer))                                                                               \
        return (fmi3Status)report(c, ERROR, "%s: " #pointer " must not be null", __func__)
#define INSTANCE_AND_MODE(modes)                                                                  \
    if (!c || require(c, (modes), __func__) != OK)                                                \
        return fmi3Error
#define NOT_SUPPORTED(what)                                                                       \
    return c ? (fmi3Status)report(c, ERROR, "%s: %s", __func__, what) : fmi3Error

static const char *const categories[] = {"logStatusWarning", "logStatusDiscard", "logStatusError"};

static void emit(const struct instance *in, enum status status, const char *message)
{
    if (in->logger)
        in->logger(in->environment, (fmi3Status)status,
                   categories[status == WARNING ? 0 : status == DISCARD ? 1 : 2], message);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

/* Messages come with a status other than OK; these are always passed on. */
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String names[])
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
            return (fmi3Status)report(c, ERROR, "%s: there is no log category '%s'", __func__,
                                      names[i]);
    }
    return fmi3OK;
}

/* ---- life cycle ---- */

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate)
{
    (void)resourcePath, (void)visible, (void)loggingOn, (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables;
    (void)intermediateUpdate;
    struct instance nobody = {.logger = logMessage, .environment = instanceEnvironment};
    if (!instanceName || !*instanceName) {
        report(&nobody, ERROR, "%s: the instance must have a name", __func__);
        return NULL;
    }
    if (!instantiationToken || strcmp(instantiationToken, MODEL_TOKEN) != 0) {
        report(&nobody, ERROR, "%s: the instantiation token must be %s, got %s", __func__,
               MODEL_TOKEN, instantiationToken ? instantiationToken : "null");
        return NULL;
    }
    if (eventModeUsed) {
        report(&nobody, ERROR, "%s: there is no Event Mode", __func__);
        return NULL;
    }
    return instance_create(instanceName, instanceEnvironment, logMessage);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage)
{
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible;
    (void)loggingOn;
    struct instance nobody = {.logger = logMessage, .environment = instanceEnvironment};
    report(&nobody, ERROR, "%s: the FMU is for Co-Simulation only", __func__);
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption)
{
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible;
    (void)loggingOn, (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    struct instance nobody = {.logger = logMessage, .environment = instanceEnvironment};
    report(&nobody, ERROR, "%s: the FMU is for Co-Simulation only", __func__);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance c) { instance_free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    INSTANCE_AND_MODE(INSTANTIATED);
    const enum status status = instance_set_start(c, startTime);
    if (status == OK)
        ((struct instance *)c)->data.mode = INITIALIZATION;
    return (fmi3Status)status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    INSTANCE_AND_MODE(INITIALIZATION);
    return (fmi3Status)instance_exit_initialization(c);
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    INSTANCE_AND_MODE(STEP);
    ((struct instance *)c)->data.mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    INSTANCE_AND_MODE(ANY_MODE);
    instance_start_values(c);
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    INSTANCE_AND_MODE(STEP);
    NOT_NULL(eventHandlingNeeded);
    NOT_NULL(terminateSimulation);
    NOT_NULL(earlyReturn);
    NOT_NULL(lastSuccessfulTime);
    const enum status status =
        instance_step(c, currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = (double)((struct instance *)c)->data.time_ns / 1e9;
    return (fmi3Status)status;
}

/* ---- values ---- */

#define GET(Type, type)                                                                           \
    fmi3Status fmi3Get##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,           \
                             fmi3##Type values[], size_t nValues)                                 \
    {                                                                                             \
        return c ? (fmi3Status)instance_get(c, __func__, type, vr, nvr, values, nValues)          \
                 : fmi3Error;                                                                     \
    }
#define SET(Type, type)                                                                           \
    fmi3Status fmi3Set##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,           \
                             const fmi3##Type values[], size_t nValues)                           \
    {                                                                                             \
        return c ? (fmi3Status)instance_set(c, __func__, type, vr, nvr, values, nValues)          \
                 : fmi3Error;                                                                     \
    }
GET(Float64, FLOAT64)
GET(Int32, INT32)
GET(Boolean, BOOLEAN)
SET(Float64, FLOAT64)
SET(Int32, INT32)
SET(Boolean, BOOLEAN)

/* Types without variables: a call for none of them succeeds. */
#define NO_VARIABLES(Type)                                                                        \
    fmi3Status fmi3Get##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,           \
                             fmi3##Type values[], size_t nValues)                                 \
    {                                                                                             \
        (void)vr, (void)values, (void)nValues;                                                    \
        if (c && nvr == 0)                                                                        \
            return fmi3OK;                                                                        \
        NOT_SUPPORTED("there are no variables of type " #Type);                                   \
    }                                                                                             \
    fmi3Status fmi3Set##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,           \
                             const fmi3##Type values[], size_t nValues)                           \
    {                                                                                             \
        (void)vr, (void)values, (void)nValues;                                                    \
        if (c && nvr == 0)                                                                        \
            return fmi3OK;                                                                        \
        NOT_SUPPORTED("there are no variables of type " #Type);                                   \
    }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    (void)vr, (void)valueSizes, (void)values, (void)nValues;
    if (c && nvr == 0)
        return fmi3OK;
    NOT_SUPPORTED("there are no variables of type Binary");
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    (void)vr, (void)valueSizes, (void)values, (void)nValues;
    if (c && nvr == 0)
        return fmi3OK;
    NOT_SUPPORTED("there are no variables of type Binary");
}

/* ---- structure ---- */

static enum status output_reference(struct instance *in, const char *function,
                                    fmi3ValueReference reference)
{
    const unsigned element = element_of(reference);
    if (element < N_VALUES && variables[owner[element]].reference == reference
        && variables[owner[element]].causality == OUTPUT)
        return OK;
    return report(in, ERROR, "%s: there is no output with value reference %u", function,
                  reference);
}

/* Dependencies do not change, so those of modelDescription.xml hold. Without direct feedthrough
 * there are none. */
fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference valueReference,
                                               size_t *nDependencies)
{
    INSTANCE_AND_MODE(READABLE);
    NOT_NULL(nDependencies);
    if (HAS_JACOBIAN)
        NOT_SUPPORTED("dependencies are those of modelDescription.xml");
    const enum status status = output_reference(c, __func__, valueReference);
    if (status == OK)
        *nDependencies = 0;
    return (fmi3Status)status;
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[],
                                       fmi3DependencyKind dependencyKinds[], size_t nDependencies)
{
    (void)elementIndicesOfDependent, (void)independents, (void)elementIndicesOfIndependents;
    (void)dependencyKinds;
    INSTANCE_AND_MODE(READABLE);
    if (HAS_JACOBIAN)
        NOT_SUPPORTED("dependencies are those of modelDescription.xml");
    if (nDependencies != 0)
        NOT_SUPPORTED("the number of dependencies must be 0");
    return (fmi3Status)output_reference(c, __func__, dependent);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity)
{
    if (!c)
        return fmi3Error;
    return (fmi3Status)instance_derivative(c, __func__, unknowns, nUnknowns, knowns, nKnowns, seed,
                                           nSeed, sensitivity, nSensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity)
{
    (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns;
    (void)seed, (void)nSeed, (void)sensitivity, (void)nSensitivity;
    NOT_SUPPORTED("there are no adjoint derivatives");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)
{
    (void)vr, (void)nvr, (void)orders, (void)values, (void)nValues;
    NOT_SUPPORTED("there are no output derivatives");
}

/* ---- state ---- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *FMUState)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(FMUState);
    return (fmi3Status)snapshot_get(c, FMUState);
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState FMUState)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(FMUState);
    return (fmi3Status)snapshot_set(c, FMUState);
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *FMUState)
{
    INSTANCE_AND_MODE(ANY_MODE);
    if (FMUState) {
        free(*FMUState);
        *FMUState = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState FMUState, size_t *size)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(FMUState);
    NOT_NULL(size);
    *size = sizeof(struct snapshot);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState FMUState, fmi3Byte serializedState[],
                                 size_t size)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(FMUState);
    NOT_NULL(serializedState);
    return (fmi3Status)snapshot_serialize(c, FMUState, serializedState, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte serializedState[], size_t size,
                                   fmi3FMUState *FMUState)
{
    INSTANCE_AND_MODE(ANY_MODE);
    NOT_NULL(serializedState);
    NOT_NULL(FMUState);
    return (fmi3Status)snapshot_deserialize(c, serializedState, size, FMUState);
}

/* ---- what Co-Simulation without events, clocks and structural parameters does not have ---- */

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c)
{
    NOT_SUPPORTED("there are no structural parameters");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c)
{
    NOT_SUPPORTED("there are no structural parameters");
}

fmi3Status fmi3EnterEventMode(fmi3Instance c) { NOT_SUPPORTED("there is no Event Mode"); }
fmi3Status fmi3EnterStepMode(fmi3Instance c) { NOT_SUPPORTED("there is no Event Mode"); }
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) { NOT_SUPPORTED("there is no Event Mode"); }

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)
{
    (void)discreteStatesNeedUpdate, (void)terminateSimulation, (void)nextEventTimeDefined;
    (void)nominalsOfContinuousStatesChanged, (void)valuesOfContinuousStatesChanged;
    (void)nextEventTime;
    NOT_SUPPORTED("there is no Event Mode");
}

#define NO_CLOCKS(name, ...)                                                                      \
    fmi3Status name(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, __VA_ARGS__)       \
    {                                                                                             \
        (void)vr, (void)a, (void)b, (void)d;                                                      \
        if (c && nvr == 0)                                                                        \
            return fmi3OK;                                                                        \
        NOT_SUPPORTED("there are no clocks");                                                     \
    }
static const int b, d; /* stand for the arguments that some of these functions do not have */
NO_CLOCKS(fmi3GetClock, fmi3Clock a[])
NO_CLOCKS(fmi3SetClock, const fmi3Clock a[])
NO_CLOCKS(fmi3GetIntervalDecimal, fmi3Float64 a[], fmi3IntervalQualifier b[])
NO_CLOCKS(fmi3GetIntervalFraction, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier d[])
NO_CLOCKS(fmi3GetShiftDecimal, fmi3Float64 a[])
NO_CLOCKS(fmi3GetShiftFraction, fmi3UInt64 a[], fmi3UInt64 b[])
NO_CLOCKS(fmi3SetIntervalDecimal, const fmi3Float64 a[])
NO_CLOCKS(fmi3SetIntervalFraction, const fmi3UInt64 a[], const fmi3UInt64 b[])
NO_CLOCKS(fmi3SetShiftDecimal, const fmi3Float64 a[])
NO_CLOCKS(fmi3SetShiftFraction, const fmi3UInt64 a[], const fmi3UInt64 b[])

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime)
{
    (void)clockReference, (void)activationTime;
    NOT_SUPPORTED("there is no Scheduled Execution");
}

/* ---- Model Exchange, present so that every importer can resolve every name ---- */

#define NO_MODEL_EXCHANGE(signature, ...)                                                         \
    fmi3Status signature                                                                          \
    {                                                                                             \
        __VA_ARGS__;                                                                              \
        NOT_SUPPORTED("the FMU is for Co-Simulation only");                                       \
    }
NO_MODEL_EXCHANGE(fmi3EnterContinuousTimeMode(fmi3Instance c), (void)0)
NO_MODEL_EXCHANGE(fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean p, fmi3Boolean *q,
                                              fmi3Boolean *r),
                  (void)p, (void)q, (void)r)
NO_MODEL_EXCHANGE(fmi3SetTime(fmi3Instance c, fmi3Float64 p), (void)p)
NO_MODEL_EXCHANGE(fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 p[], size_t n),
                  (void)p, (void)n)
NO_MODEL_EXCHANGE(fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 p[], size_t n),
                  (void)p, (void)n)
NO_MODEL_EXCHANGE(fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 p[], size_t n), (void)p,
                  (void)n)
NO_MODEL_EXCHANGE(fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 p[], size_t n), (void)p,
                  (void)n)
NO_MODEL_EXCHANGE(fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 p[], size_t n),
                  (void)p, (void)n)
NO_MODEL_EXCHANGE(fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n), (void)n)
NO_MODEL_EXCHANGE(fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n), (void)n)
