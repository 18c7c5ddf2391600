/* The calls of FMI 2.0, right and wrong, on the sources of one FMU. */
#include "fmi2.c"
#include "calls.h"

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String text, ...)
{
    (void)environment;
    CHECK(name == NULL || strcmp(name, NAME) == 0);
    CHECK(strncmp(category, "logStatus", 9) == 0);
    CHECK(!strchr(text, '%')); /* it is a format */
    remember((int)status, text);
}

static const fmi2CallbackFunctions callbacks = {.logger = logger};

static void *open_instance(const char *name, const char *token)
{
    return fmi2Instantiate(name, fmi2CoSimulation, token, "file:///nowhere", &callbacks, fmi2False,
                           fmi2True);
}

static void close_instance(void *c) { fmi2FreeInstance(c); }

static int enter(void *c, double start)
{
    const int status = (int)fmi2SetupExperiment(c, fmi2False, 0.0, start, fmi2False, 0.0);
    return status == OK ? (int)fmi2EnterInitializationMode(c) : status;
}

static int leave(void *c) { return (int)fmi2ExitInitializationMode(c); }
static int terminate(void *c) { return (int)fmi2Terminate(c); }
static int reset(void *c) { return (int)fmi2Reset(c); }

static int get(void *c, enum type type, const unsigned vr[], size_t n, void *values, size_t room)
{
    (void)room;
    switch (type) {
    case FLOAT64: return (int)fmi2GetReal(c, vr, n, values);
    case INT32: return (int)fmi2GetInteger(c, vr, n, values);
    default: return (int)fmi2GetBoolean(c, vr, n, values);
    }
}

static int set(void *c, enum type type, const unsigned vr[], size_t n, const void *values,
               size_t room)
{
    (void)room;
    switch (type) {
    case FLOAT64: return (int)fmi2SetReal(c, vr, n, values);
    case INT32: return (int)fmi2SetInteger(c, vr, n, values);
    default: return (int)fmi2SetBoolean(c, vr, n, values);
    }
}

static int step(void *c, double time, double size, double *last)
{
    const int status = (int)fmi2DoStep(c, time, size, fmi2False);
    if (memory(c)->mode & (STEP | TERMINATED | FAILED))
        CHECK(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, last) == fmi2OK);
    return status;
}

static int state_get(void *c, void **state) { return (int)fmi2GetFMUstate(c, state); }
static int state_set(void *c, void *state) { return (int)fmi2SetFMUstate(c, state); }
static int state_free(void *c, void **state) { return (int)fmi2FreeFMUstate(c, state); }

static int state_size(void *c, void *state, size_t *size)
{
    return (int)fmi2SerializedFMUstateSize(c, state, size);
}

static int state_serialize(void *c, void *state, unsigned char *bytes, size_t size)
{
    return (int)fmi2SerializeFMUstate(c, state, (fmi2Byte *)bytes, size);
}

static int state_deserialize(void *c, const unsigned char *bytes, size_t size, void **state)
{
    return (int)fmi2DeSerializeFMUstate(c, (const fmi2Byte *)bytes, size, state);
}

static int derivative(void *c, const unsigned unknowns[], size_t n_unknowns,
                      const unsigned knowns[], size_t n_knowns, const double seed[], size_t n_seed,
                      double sensitivity[], size_t n_sensitivity)
{
    (void)n_seed, (void)n_sensitivity;
    return (int)fmi2GetDirectionalDerivative(c, unknowns, n_unknowns, knowns, n_knowns, seed,
                                             sensitivity);
}

/* ---- every function ---- */

static unsigned vr_of(unsigned element) { return element + FIRST_REFERENCE; }

static fmi2Real scalar;
static fmi2Integer integer;
static fmi2Boolean truth;
static fmi2String string = "text";
static fmi2Status kind;
static void *state;
static size_t length;

#define CALL(function, ...)                                                                       \
    static int call_##function(void *c) { return (int)function(c, ##__VA_ARGS__); }
#define ONE(causality, type) (unsigned[]){vr_of(first_with(causality, type))}, 1

CALL(fmi2SetDebugLogging, fmi2True, 1, (fmi2String[]){"logStatusError"})
CALL(fmi2SetupExperiment, fmi2False, 0.0, 0.0, fmi2False, 0.0)
CALL(fmi2EnterInitializationMode)
CALL(fmi2ExitInitializationMode)
CALL(fmi2Terminate)
CALL(fmi2Reset)
CALL(fmi2GetReal, ONE(OUTPUT, FLOAT64), &scalar)
CALL(fmi2GetInteger, (unsigned[]){1}, 0, &integer)
CALL(fmi2GetBoolean, (unsigned[]){1}, 0, &truth)
CALL(fmi2GetString, (unsigned[]){1}, 1, &string)
CALL(fmi2SetInteger, (unsigned[]){1}, 0, &integer)
CALL(fmi2SetBoolean, (unsigned[]){1}, 0, &truth)
CALL(fmi2SetString, (unsigned[]){1}, 1, &string)
CALL(fmi2SetFMUstate, scratch_state)
CALL(fmi2FreeFMUstate, &state)
CALL(fmi2SerializedFMUstateSize, scratch_state, &length)
CALL(fmi2SerializeFMUstate, scratch_state, (fmi2Byte *)scratch_bytes, scratch_size)
CALL(fmi2GetDirectionalDerivative, ONE(OUTPUT, FLOAT64), ONE(INPUT, FLOAT64), (double[]){1.0},
     &scalar)
CALL(fmi2SetRealInputDerivatives, (unsigned[]){1}, 1, &integer, &scalar)
CALL(fmi2GetRealOutputDerivatives, (unsigned[]){1}, 1, &integer, &scalar)
CALL(fmi2DoStep, 0.0, 0.1, fmi2False)
CALL(fmi2CancelStep)
CALL(fmi2GetStatus, fmi2DoStepStatus, &kind)
CALL(fmi2GetRealStatus, fmi2LastSuccessfulTime, &scalar)
CALL(fmi2GetIntegerStatus, fmi2LastSuccessfulTime, &integer)
CALL(fmi2GetBooleanStatus, fmi2Terminated, &truth)
CALL(fmi2GetStringStatus, fmi2PendingStatus, &string)

static int call_fmi2SetReal(void *c)
{
    scalar = start_values[settable()];
    return (int)fmi2SetReal(c, (unsigned[]){vr_of(settable())}, 1, &scalar);
}

static int call_fmi2GetFMUstate(void *c)
{
    void *mine = NULL;
    const int status = (int)fmi2GetFMUstate(c, &mine);
    free(mine);
    return status;
}

static int call_fmi2DeSerializeFMUstate(void *c)
{
    void *mine = NULL;
    const int status = (int)fmi2DeSerializeFMUstate(c, (const fmi2Byte *)scratch_bytes,
                                                    scratch_size, &mine);
    free(mine);
    return status;
}

#define BEFORE_STEPS (INSTANTIATED | INITIALIZATION)
#define AFTER_STEPS (STEP | TERMINATED | FAILED)
#define ROW(function, modes) {#function, call_##function, modes}

static const struct call calls[] = {
    ROW(fmi2SetDebugLogging, ANY_MODE),
    ROW(fmi2SetupExperiment, INSTANTIATED),
    ROW(fmi2EnterInitializationMode, INSTANTIATED),
    ROW(fmi2ExitInitializationMode, INITIALIZATION),
    ROW(fmi2Terminate, STEP),
    ROW(fmi2Reset, ANY_MODE),
    ROW(fmi2GetReal, READABLE),
    ROW(fmi2GetInteger, READABLE),
    ROW(fmi2GetBoolean, READABLE),
    ROW(fmi2GetString, 0),
    ROW(fmi2SetReal, N_P > 0 ? BEFORE_STEPS : BEFORE_STEPS | STEP),
    ROW(fmi2SetInteger, BEFORE_STEPS | STEP),
    ROW(fmi2SetBoolean, BEFORE_STEPS | STEP),
    ROW(fmi2SetString, 0),
    ROW(fmi2GetFMUstate, ANY_MODE),
    ROW(fmi2SetFMUstate, ANY_MODE),
    ROW(fmi2FreeFMUstate, ANY_MODE),
    ROW(fmi2SerializedFMUstateSize, ANY_MODE),
    ROW(fmi2SerializeFMUstate, ANY_MODE),
    ROW(fmi2DeSerializeFMUstate, ANY_MODE),
    ROW(fmi2GetDirectionalDerivative, HAS_JACOBIAN ? INITIALIZATION | STEP | TERMINATED : 0),
    ROW(fmi2SetRealInputDerivatives, 0),
    ROW(fmi2GetRealOutputDerivatives, 0),
    ROW(fmi2DoStep, STEP),
    ROW(fmi2CancelStep, 0),
    ROW(fmi2GetStatus, 0),
    ROW(fmi2GetRealStatus, AFTER_STEPS),
    ROW(fmi2GetIntegerStatus, 0),
    ROW(fmi2GetBooleanStatus, AFTER_STEPS),
    ROW(fmi2GetStringStatus, 0),
};

static void *instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                         const fmi2CallbackFunctions *functions)
{
    forget();
    return fmi2Instantiate(name, type, guid, NULL, functions, fmi2False, fmi2False);
}

static void test_instantiation(void)
{
    const fmi2CallbackFunctions mute = {.logger = NULL};
    CHECK(!instantiate(NAME, fmi2CoSimulation, "{wrong}", &callbacks));
    CHECK(message_status == ERROR && strstr(message, MODEL_TOKEN) && strstr(message, "{wrong}"));
    CHECK(!instantiate(NAME, fmi2CoSimulation, NULL, &callbacks) && strstr(message, "GUID"));
    CHECK(!instantiate(NULL, fmi2CoSimulation, MODEL_TOKEN, &callbacks) && strstr(message, "name"));
    CHECK(!instantiate("", fmi2CoSimulation, MODEL_TOKEN, &callbacks) && strstr(message, "name"));
    CHECK(!instantiate(NAME, fmi2ModelExchange, MODEL_TOKEN, &callbacks)
          && strstr(message, "Co-Simulation"));
    CHECK(!instantiate(NAME, fmi2CoSimulation, "{wrong}", NULL));
    CHECK(!instantiate(NAME, fmi2CoSimulation, "{wrong}", &mute));
    for (int i = 0; i < 2; i++) { /* without a logger */
        void *c = instantiate("100%s #r1#", fmi2CoSimulation, MODEL_TOKEN, i ? &mute : NULL);
        CHECK(c);
        CHECK(fmi2DoStep(c, 0.0, 0.1, fmi2False) == fmi2Error);
        fmi2FreeInstance(c);
    }
    CHECK(strcmp(fmi2GetVersion(), "2.0") == 0);
    CHECK(strcmp(fmi2GetTypesPlatform(), "default") == 0);
}

static void test_logging_and_status(void)
{
    void *c = in_mode(STEP);
    fmi2String names[] = {"logStatusError", "logEvents"};
    CHECK(fmi2SetDebugLogging(c, fmi2False, 0, NULL) == fmi2OK);
    REFUSED(ERROR, (int)fmi2SetDebugLogging(c, fmi2True, 1, NULL), NAME, "null");
    REFUSED(ERROR, (int)fmi2SetDebugLogging(c, fmi2True, 2, names), NAME, "logEvents");
    names[1] = NULL;
    REFUSED(ERROR, (int)fmi2SetDebugLogging(c, fmi2True, 2, names), NAME, "null");
    REFUSED(ERROR, (int)fmi2GetRealStatus(c, fmi2LastSuccessfulTime, NULL), NAME, "null");
    REFUSED(ERROR, (int)fmi2GetBooleanStatus(c, fmi2Terminated, NULL), NAME, "null");
    REFUSED(ERROR, (int)fmi2GetRealStatus(c, fmi2Terminated, &scalar), NAME);
    REFUSED(ERROR, (int)fmi2GetBooleanStatus(c, fmi2DoStepStatus, &truth), NAME);
    CHECK(fmi2GetBooleanStatus(c, fmi2Terminated, &truth) == fmi2OK && truth == fmi2False);
    CHECK(fmi2GetString(c, NULL, 0, NULL) == fmi2OK);
    CHECK(fmi2SetString(c, NULL, 0, NULL) == fmi2OK);
    fmi2FreeInstance(c);
}

int main(int argc, char **argv)
{
    test_instantiation();
    test_logging_and_status();
    return run_all(calls, COUNT(calls), argc, argv);
}
