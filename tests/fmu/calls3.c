/* The calls of FMI 3.0, right and wrong, on the sources of one FMU. */
#include "fmi3.c"
#include "calls.h"

static void logger(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                   fmi3String text)
{
    (void)environment;
    CHECK(strncmp(category, "logStatus", 9) == 0);
    remember((int)status, text);
}

static void *instantiate(fmi3String name, fmi3String token, fmi3Boolean events,
                         fmi3LogMessageCallback log)
{
    forget();
    return fmi3InstantiateCoSimulation(name, token, NULL, fmi3False, fmi3False, events, fmi3False,
                                       NULL, 0, NULL, log, NULL);
}

static void *open_instance(const char *name, const char *token)
{
    return instantiate(name, token, fmi3False, logger);
}

static void close_instance(void *c) { fmi3FreeInstance(c); }

static int enter(void *c, double start)
{
    return (int)fmi3EnterInitializationMode(c, fmi3False, 0.0, start, fmi3False, 0.0);
}

static int leave(void *c) { return (int)fmi3ExitInitializationMode(c); }
static int terminate(void *c) { return (int)fmi3Terminate(c); }
static int reset(void *c) { return (int)fmi3Reset(c); }

static int get(void *c, enum type type, const unsigned vr[], size_t n, void *values, size_t room)
{
    switch (type) {
    case FLOAT64: return (int)fmi3GetFloat64(c, vr, n, values, room);
    case INT32: return (int)fmi3GetInt32(c, vr, n, values, room);
    default: return (int)fmi3GetBoolean(c, vr, n, values, room);
    }
}

static int set(void *c, enum type type, const unsigned vr[], size_t n, const void *values,
               size_t room)
{
    switch (type) {
    case FLOAT64: return (int)fmi3SetFloat64(c, vr, n, values, room);
    case INT32: return (int)fmi3SetInt32(c, vr, n, values, room);
    default: return (int)fmi3SetBoolean(c, vr, n, values, room);
    }
}

static int step(void *c, double time, double size, double *last)
{
    fmi3Boolean events = fmi3True, end = fmi3True, early = fmi3True;
    const int status = (int)fmi3DoStep(c, time, size, fmi3False, &events, &end, &early, last);
    if (status == OK)
        CHECK(!events && !end && !early);
    return status;
}

static int state_get(void *c, void **state) { return (int)fmi3GetFMUState(c, state); }
static int state_set(void *c, void *state) { return (int)fmi3SetFMUState(c, state); }
static int state_free(void *c, void **state) { return (int)fmi3FreeFMUState(c, state); }

static int state_size(void *c, void *state, size_t *size)
{
    return (int)fmi3SerializedFMUStateSize(c, state, size);
}

static int state_serialize(void *c, void *state, unsigned char *bytes, size_t size)
{
    return (int)fmi3SerializeFMUState(c, state, bytes, size);
}

static int state_deserialize(void *c, const unsigned char *bytes, size_t size, void **state)
{
    return (int)fmi3DeserializeFMUState(c, bytes, size, state);
}

static int derivative(void *c, const unsigned unknowns[], size_t n_unknowns,
                      const unsigned knowns[], size_t n_knowns, const double seed[], size_t n_seed,
                      double sensitivity[], size_t n_sensitivity)
{
    return (int)fmi3GetDirectionalDerivative(c, unknowns, n_unknowns, knowns, n_knowns, seed,
                                             n_seed, sensitivity, n_sensitivity);
}

/* ---- every function ---- */

static fmi3Boolean truth[3];
static fmi3String string = "text";
static fmi3Binary binary;
static fmi3Clock clocks[1];
static fmi3IntervalQualifier qualifier;
static fmi3UInt64 counter, resolution;
static fmi3Float64 scalars[N_VALUES];
static fmi3Int32 order = 1;
static void *state;
static size_t length;

#define CALL(function, ...)                                                                       \
    static int call_##function(void *c) { return (int)function(c, ##__VA_ARGS__); }
#define FIRST (unsigned[]){1}, 1
#define NONE (unsigned[]){1}, 0

CALL(fmi3SetDebugLogging, fmi3True, 1, (fmi3String[]){"logStatusError"})
CALL(fmi3EnterInitializationMode, fmi3False, 0.0, 0.0, fmi3False, 0.0)
CALL(fmi3ExitInitializationMode)
CALL(fmi3EnterEventMode)
CALL(fmi3Terminate)
CALL(fmi3Reset)
CALL(fmi3GetFloat64, (unsigned[]){0}, 1, scalars, 1)
CALL(fmi3GetInt32, NONE, &order, 0)
CALL(fmi3GetBoolean, NONE, truth, 0)
CALL(fmi3SetInt32, NONE, &order, 0)
CALL(fmi3SetBoolean, NONE, truth, 0)
#define OTHER_TYPE(Type)                                                                          \
    static fmi3##Type value_##Type;                                                               \
    CALL(fmi3Get##Type, FIRST, &value_##Type, 1)                                                  \
    CALL(fmi3Set##Type, FIRST, &value_##Type, 1)
OTHER_TYPE(Float32)
OTHER_TYPE(Int8)
OTHER_TYPE(UInt8)
OTHER_TYPE(Int16)
OTHER_TYPE(UInt16)
OTHER_TYPE(UInt32)
OTHER_TYPE(Int64)
OTHER_TYPE(UInt64)
CALL(fmi3GetString, FIRST, &string, 1)
CALL(fmi3SetString, FIRST, &string, 1)
CALL(fmi3GetBinary, FIRST, &length, &binary, 1)
CALL(fmi3SetBinary, FIRST, &length, &binary, 1)
CALL(fmi3GetClock, FIRST, clocks)
CALL(fmi3SetClock, FIRST, clocks)
CALL(fmi3GetIntervalDecimal, FIRST, scalars, &qualifier)
CALL(fmi3GetIntervalFraction, FIRST, &counter, &resolution, &qualifier)
CALL(fmi3GetShiftDecimal, FIRST, scalars)
CALL(fmi3GetShiftFraction, FIRST, &counter, &resolution)
CALL(fmi3SetIntervalDecimal, FIRST, scalars)
CALL(fmi3SetIntervalFraction, FIRST, &counter, &resolution)
CALL(fmi3SetShiftDecimal, FIRST, scalars)
CALL(fmi3SetShiftFraction, FIRST, &counter, &resolution)
CALL(fmi3ActivateModelPartition, 1, 0.0)
CALL(fmi3GetNumberOfVariableDependencies, N_P + N_U + FIRST_REFERENCE, &length)
CALL(fmi3GetVariableDependencies, N_P + N_U + FIRST_REFERENCE, NULL, NULL, NULL, NULL, 0)
CALL(fmi3SetFMUState, scratch_state)
CALL(fmi3FreeFMUState, &state)
CALL(fmi3SerializedFMUStateSize, scratch_state, &length)
CALL(fmi3SerializeFMUState, scratch_state, scratch_bytes, scratch_size)
CALL(fmi3GetAdjointDerivative, FIRST, FIRST, scalars, 1, scalars, 1)
CALL(fmi3GetOutputDerivatives, FIRST, &order, scalars, 1)
CALL(fmi3EnterConfigurationMode)
CALL(fmi3ExitConfigurationMode)
CALL(fmi3EnterStepMode)
CALL(fmi3EvaluateDiscreteStates)
CALL(fmi3UpdateDiscreteStates, truth, truth, truth, truth, truth, scalars)
CALL(fmi3EnterContinuousTimeMode)
CALL(fmi3CompletedIntegratorStep, fmi3False, truth, truth)
CALL(fmi3SetTime, 0.0)
CALL(fmi3SetContinuousStates, scalars, 1)
CALL(fmi3GetContinuousStateDerivatives, scalars, 1)
CALL(fmi3GetEventIndicators, scalars, 1)
CALL(fmi3GetContinuousStates, scalars, 1)
CALL(fmi3GetNominalsOfContinuousStates, scalars, 1)
CALL(fmi3GetNumberOfEventIndicators, &length)
CALL(fmi3GetNumberOfContinuousStates, &length)
CALL(fmi3DoStep, 0.0, 0.1, fmi3False, truth, truth, truth, scalars)

static int call_fmi3SetFloat64(void *c)
{
    const struct variable *v = variable_of(settable());
    return (int)fmi3SetFloat64(c, &v->reference, 1, start_values + first_element(v), v->size);
}

static int call_fmi3GetDirectionalDerivative(void *c)
{
    const struct variable *y = variable_of(N_P + N_U);
    const unsigned u = first_with(INPUT, FLOAT64);
    const struct variable *known = variable_of(u < N_VALUES ? u : 0);
    return (int)fmi3GetDirectionalDerivative(c, &y->reference, 1, &known->reference, 1, scalars,
                                             known->size, scalars, y->size);
}

static int call_fmi3GetFMUState(void *c)
{
    void *mine = NULL;
    const int status = (int)fmi3GetFMUState(c, &mine);
    free(mine);
    return status;
}

static int call_fmi3DeserializeFMUState(void *c)
{
    void *mine = NULL;
    const int status = (int)fmi3DeserializeFMUState(c, scratch_bytes, scratch_size, &mine);
    free(mine);
    return status;
}

#define BEFORE_STEPS (INSTANTIATED | INITIALIZATION)
#define ROW(function, modes) {#function, call_##function, modes}
#define GET_AND_SET(Type) ROW(fmi3Get##Type, 0), ROW(fmi3Set##Type, 0)

static const struct call calls[] = {
    ROW(fmi3SetDebugLogging, ANY_MODE),
    ROW(fmi3EnterInitializationMode, INSTANTIATED),
    ROW(fmi3ExitInitializationMode, INITIALIZATION),
    ROW(fmi3EnterEventMode, 0),
    ROW(fmi3Terminate, STEP),
    ROW(fmi3Reset, ANY_MODE),
    ROW(fmi3GetFloat64, READABLE),
    ROW(fmi3GetInt32, READABLE),
    ROW(fmi3GetBoolean, READABLE),
    ROW(fmi3SetFloat64, N_P > 0 ? BEFORE_STEPS : BEFORE_STEPS | STEP),
    ROW(fmi3SetInt32, BEFORE_STEPS | STEP),
    ROW(fmi3SetBoolean, BEFORE_STEPS | STEP),
    GET_AND_SET(Float32),
    GET_AND_SET(Int8),
    GET_AND_SET(UInt8),
    GET_AND_SET(Int16),
    GET_AND_SET(UInt16),
    GET_AND_SET(UInt32),
    GET_AND_SET(Int64),
    GET_AND_SET(UInt64),
    GET_AND_SET(String),
    GET_AND_SET(Binary),
    GET_AND_SET(Clock),
    GET_AND_SET(IntervalDecimal),
    GET_AND_SET(IntervalFraction),
    GET_AND_SET(ShiftDecimal),
    GET_AND_SET(ShiftFraction),
    ROW(fmi3ActivateModelPartition, 0),
    ROW(fmi3GetNumberOfVariableDependencies, HAS_JACOBIAN ? 0 : READABLE),
    ROW(fmi3GetVariableDependencies, HAS_JACOBIAN ? 0 : READABLE),
    ROW(fmi3GetFMUState, ANY_MODE),
    ROW(fmi3SetFMUState, ANY_MODE),
    ROW(fmi3FreeFMUState, ANY_MODE),
    ROW(fmi3SerializedFMUStateSize, ANY_MODE),
    ROW(fmi3SerializeFMUState, ANY_MODE),
    ROW(fmi3DeserializeFMUState, ANY_MODE),
    ROW(fmi3GetDirectionalDerivative, HAS_JACOBIAN ? INITIALIZATION | STEP | TERMINATED : 0),
    ROW(fmi3GetAdjointDerivative, 0),
    ROW(fmi3GetOutputDerivatives, 0),
    ROW(fmi3EnterConfigurationMode, 0),
    ROW(fmi3ExitConfigurationMode, 0),
    ROW(fmi3EnterStepMode, 0),
    ROW(fmi3EvaluateDiscreteStates, 0),
    ROW(fmi3UpdateDiscreteStates, 0),
    ROW(fmi3EnterContinuousTimeMode, 0),
    ROW(fmi3CompletedIntegratorStep, 0),
    ROW(fmi3SetTime, 0),
    ROW(fmi3SetContinuousStates, 0),
    ROW(fmi3GetContinuousStateDerivatives, 0),
    ROW(fmi3GetEventIndicators, 0),
    ROW(fmi3GetContinuousStates, 0),
    ROW(fmi3GetNominalsOfContinuousStates, 0),
    ROW(fmi3GetNumberOfEventIndicators, 0),
    ROW(fmi3GetNumberOfContinuousStates, 0),
    ROW(fmi3DoStep, STEP),
};

static void test_instantiation(void)
{
    CHECK(!instantiate(NAME, "wrong-token", fmi3False, logger));
    CHECK(message_status == ERROR && strstr(message, MODEL_TOKEN)
          && strstr(message, "wrong-token"));
    CHECK(!instantiate(NAME, NULL, fmi3False, logger) && strstr(message, "token"));
    CHECK(!instantiate(NULL, MODEL_TOKEN, fmi3False, logger) && strstr(message, "name"));
    CHECK(!instantiate("", MODEL_TOKEN, fmi3False, logger) && strstr(message, "name"));
    CHECK(!instantiate(NAME, MODEL_TOKEN, fmi3True, logger) && strstr(message, "Event Mode"));
    CHECK(!instantiate(NAME, "wrong-token", fmi3False, NULL));
    forget();
    CHECK(!fmi3InstantiateModelExchange(NAME, MODEL_TOKEN, NULL, fmi3False, fmi3False, NULL, logger)
          && strstr(message, "Co-Simulation only"));
    forget();
    CHECK(!fmi3InstantiateScheduledExecution(NAME, MODEL_TOKEN, NULL, fmi3False, fmi3False, NULL,
                                             logger, NULL, NULL, NULL)
          && strstr(message, "Co-Simulation only"));
    void *c = instantiate(NAME, MODEL_TOKEN, fmi3False, NULL); /* without a logger */
    CHECK(c && call_fmi3DoStep(c) == ERROR);
    fmi3FreeInstance(c);
    CHECK(strncmp(fmi3GetVersion(), "3.0", 3) == 0);
}

static void test_logging(void)
{
    void *c = in_mode(STEP);
    fmi3String names[] = {"logStatusError", "logEvents"};
    CHECK(fmi3SetDebugLogging(c, fmi3False, 0, NULL) == fmi3OK);
    REFUSED(ERROR, (int)fmi3SetDebugLogging(c, fmi3True, 1, NULL), NAME, "null");
    REFUSED(ERROR, (int)fmi3SetDebugLogging(c, fmi3True, 2, names), NAME, "logEvents");
    names[1] = NULL;
    REFUSED(ERROR, (int)fmi3SetDebugLogging(c, fmi3True, 2, names), NAME, "null");
    fmi3FreeInstance(c);
}

static void test_arrays(void)
{
    static double values[2 * N_VALUES + 2];
    void *c = in_mode(INITIALIZATION);
    char size[48];
    for (unsigned i = 0; i < N_VARIABLES; i++) {
        const struct variable *v = &variables[i];
        if (v->type != FLOAT64)
            continue;
        snprintf(size, sizeof size, "have %u values, got room for %u", v->size, v->size + 1);
        REFUSED(ERROR, get(c, FLOAT64, &v->reference, 1, values, v->size + 1), NAME, size);
        REFUSED(ERROR, get(c, FLOAT64, &v->reference, 1, values, v->size - 1), NAME, "values");
        REFUSED_UNCHANGED(c, ERROR, set(c, FLOAT64, &v->reference, 1, values, v->size + 1), NAME,
                          size);
        for (unsigned j = 1; j < v->size; j++) { /* an element has no reference of its own */
            const unsigned inner = v->reference + j;
            REFUSED(ERROR, get(c, FLOAT64, &inner, 1, values, 1), NAME);
        }
    }
    const unsigned time = 0;
    REFUSED_UNCHANGED(c, ERROR, set(c, FLOAT64, &time, 1, values, 1), NAME, "time cannot be set");
    fmi3FreeInstance(c);
    c = in_mode(INSTANTIATED);
    CHECK(enter(c, 1.5) == OK);
    CHECK(get(c, FLOAT64, &time, 1, values, 1) == OK && values[0] == 1.5);
    CHECK(leave(c) == OK && step(c, 1.5, 0.1, values) == OK);
    CHECK(get(c, FLOAT64, &time, 1, values + 1, 1) == OK && values[0] == 1.6 && values[1] == 1.6);
    fmi3FreeInstance(c);
}

static void test_null_pointers_of_steps(void)
{
    void *c = in_mode(STEP);
    fmi3Boolean b[3];
    double last;
    REFUSED_UNCHANGED(c, ERROR, (int)fmi3DoStep(c, 0, 0.1, fmi3False, NULL, b, b, &last), NAME);
    REFUSED_UNCHANGED(c, ERROR, (int)fmi3DoStep(c, 0, 0.1, fmi3False, b, NULL, b, &last), NAME);
    REFUSED_UNCHANGED(c, ERROR, (int)fmi3DoStep(c, 0, 0.1, fmi3False, b, b, NULL, &last), NAME);
    REFUSED_UNCHANGED(c, ERROR, (int)fmi3DoStep(c, 0, 0.1, fmi3False, b, b, b, NULL), NAME);
    fmi3FreeInstance(c);
}

static void test_dependencies(void)
{
    void *c = in_mode(STEP);
    const unsigned parameter = FIRST_REFERENCE, unknown = N_VALUES + FIRST_REFERENCE;
    size_t n = 7;
    if (!HAS_JACOBIAN) {
        CHECK(fmi3GetNumberOfVariableDependencies(c, variable_of(N_P + N_U)->reference, &n)
              == fmi3OK);
        CHECK(n == 0);
        REFUSED(ERROR, (int)fmi3GetNumberOfVariableDependencies(c, parameter, &n), NAME, "output");
        REFUSED(ERROR, (int)fmi3GetNumberOfVariableDependencies(c, unknown, &n), NAME, "output");
    }
    REFUSED(ERROR, (int)fmi3GetNumberOfVariableDependencies(c, unknown, NULL), NAME, "null");
    REFUSED(ERROR, (int)fmi3GetVariableDependencies(c, 1, NULL, NULL, NULL, NULL, 3), NAME);
    fmi3FreeInstance(c);
}

static void test_no_values_of_types_without_variables(void)
{
    void *c = in_mode(STEP);
    CHECK(fmi3GetString(c, NULL, 0, NULL, 0) == fmi3OK);
    CHECK(fmi3SetUInt64(c, NULL, 0, NULL, 0) == fmi3OK);
    CHECK(fmi3GetBinary(c, NULL, 0, NULL, NULL, 0) == fmi3OK);
    CHECK(fmi3SetBinary(c, NULL, 0, NULL, NULL, 0) == fmi3OK);
    CHECK(fmi3GetClock(c, NULL, 0, NULL) == fmi3OK);
    CHECK(fmi3GetIntervalDecimal(c, NULL, 0, NULL, NULL) == fmi3OK);
    fmi3FreeInstance(c);
}

int main(int argc, char **argv)
{
    test_instantiation();
    test_logging();
    test_arrays();
    test_null_pointers_of_steps();
    test_dependencies();
    test_no_values_of_types_without_variables();
    return run_all(calls, COUNT(calls), argc, argv);
}
