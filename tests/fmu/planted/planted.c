/* An FMU with a defect, or without, for FMI 2.0 (-DFMI=2) and FMI 3.0 (-DFMI=3) Co-Simulation.
 *
 * A receiver of sorts. In a step from t to t + h, exactly:
 *     x -> depth + (x - depth) exp(-h / tau),  epoch = t + h,  update_count = the seconds begun.
 * position = (x, t, depth^2); the last depends directly on the input, with a derivative.
 *
 * -DDEFECT=… plants one of the defects below; without it nothing is known to be wrong. */
#include "../hang.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum defect {
    NONE,
    STATE_NOT_RESTORED,    /* x stays what it is */
    SHARED_GLOBAL,         /* all instances have one x */
    WRONG_DERIVATIVE,      /* depth in place of 2 depth */
    CRASH_ON_NULL,         /* NULL for references or values */
    LEAK,                  /* the name of each instance */
    RESET_FORGETS,         /* x is not set back */
    STEP_SIZE_MATTERS,     /* Euler's method */
    POINTER_IN_STATE,      /* serialised states point into the process */
    CRASH_OUT_OF_ORDER,    /* a step before initialisation */
    CRASH_ON_REFERENCE,    /* references are not checked */
    HANG_ON_NAN,           /* in the step after it */
    FUNCTION_MISSING,      /* of the state, though it claims them */
    STEP_DISCARDED,        /* no defect: steps other than of 0.1 s are refused */
    NEVER_THE_SAME,        /* no defect to be told: noise from the clock */
    EXITS,                 /* ends the process when it is terminated */
    THREADS_CLASH,         /* a step works in one place for all instances */
    STATE_NOT_OVERWRITTEN, /* x of a copy that is to be written over stays what it is */
    DERIVATIVE_A_BIT_OFF,  /* 2.1 depth in place of 2 depth */
    ONLY_ONCE,             /* no defect if it says so: a second instance crashes, also afterwards */
    CRASH_ON_RESET,        /* before and during initialisation */
    NO_FATAL_END,          /* no defect: a step of NaN s is Fatal, and no call is answered after it */
    ANY_REFERENCE,         /* references of no variable are ignored */
    ANY_OF_STRINGS,        /* the same of texts only */
    HIDDEN_REFERENCE,      /* no defect: 8 is a variable that the description does not name */
    WARNS_OF_REFERENCES,   /* answers Warning */
    ANY_TOKEN,             /* tokens are not compared */
    ANY_EMPTY_TOKEN,       /* an empty one will do */
    OUTPUT_IS_SET,         /* position can be set at any time */
    CONSTANT_IS_SET,       /* no defect without one, which has the reference 9 */
    NO_LICENCE,            /* no instance, and says why */
    NO_SEAT,               /* one instance at a time, and says why */
    NO_MODULE,             /* initialisation fails, and says why */
    ABORTS_SAYING,         /* ends the process when it is instantiated, and says why */
    SILENT,                /* no instance; says why if its logging is on */
    SAYS_MORE,             /* initialisation fails; the message has the values of many types */
    SAYS_WRONG,            /* the same; the message is no format for its values */
};

#ifndef DEFECT
#define DEFECT NONE
#endif

#if FMI == 2
#define EXPORT(name) fmi2##name
#define STATE(name) fmi2##name##FMUstate
#define REAL(verb) fmi2##verb##Real
#define INTEGER(verb) fmi2##verb##Integer
#define VALUES
#define SEEDS
#define SENSITIVITIES
typedef int boolean;
#else
#define EXPORT(name) fmi3##name
#define STATE(name) fmi3##name##FMUState
#define REAL(verb) fmi3##verb##Float64
#define INTEGER(verb) fmi3##verb##Int32
#define VALUES , size_t n_values
#define SEEDS , size_t n_seed
#define SENSITIVITIES , size_t n_sensitivity
typedef bool boolean;
#endif

enum mode { NEW, INITIALISATION, STEPPING, TERMINATED };
enum { OK = 0, DISCARD = 2, ERROR = 3, FATAL = 4 };
/* What comes of a reference of no variable. */
#define UNKNOWN                                                                                    \
    (DEFECT == ANY_REFERENCE ? OK : DEFECT == WARNS_OF_REFERENCES ? 1 : ERROR)
enum { TAU = 1, DEPTH = 2, POSITION = 3, EPOCH = 6, COUNT = 7 };

typedef struct {
    int mode;
    double tau, depth, x, time;
    const double *decay; /* where the step finds tau, for POINTER_IN_STATE */
} state;

typedef struct {
    state now;
    char *name;
    const void *callbacks;
} instance;

/* What is said, in FMI 2 with values that follow. */
#if FMI == 2
struct callbacks {
    void (*log)(void *, const char *, int, const char *, const char *, ...);
    void *others[3], *environment;
};
#define SAY(to, ...)                                                                               \
    ((const struct callbacks *)(to))                                                               \
        ->log(((const struct callbacks *)(to))->environment, "", ERROR, "", __VA_ARGS__)
#define WRONG "\xfc 100% sure\x1b #r2# ##1 %s %s %s %s %s %s %n %s"
#else
#define WRONG "\xfc 100% sure\x1b #r2# ##1 %s"
static void *their_environment; /* of the newest instance */
static void say(const void *log, const char *format, ...)
{
    char text[20000];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    void (*tell)(void *, int, const char *, const char *);
    memcpy(&tell, &log, sizeof tell);
    if (tell)
        tell(their_environment, ERROR, "", text);
}
#define SAY(to, ...) say(to, __VA_ARGS__)
#endif

static double shared;
static int *seats; /* NO_SEAT */
static bool dead; /* NO_FATAL_END */

static double *x_of(instance *in) { return DEFECT == SHARED_GLOBAL ? &shared : &in->now.x; }

static void start(instance *in, bool again)
{
    const double x = in->now.x;
    in->now = (state){.mode = NEW, .tau = 1};
    if (again && DEFECT == RESET_FORGETS)
        in->now.x = x;
    if (DEFECT == POINTER_IN_STATE) {
        double *place = malloc(sizeof *place);
        *place = 1;
        in->now.decay = place;
    }
}

static instance *create(const char *name, const char *token, const void *callbacks, bool logging)
{
    const bool any = DEFECT == ANY_TOKEN || (DEFECT == ANY_EMPTY_TOKEN && token && !*token);
    if (!name || !token || (strcmp(token, "planted") && !any))
        return NULL;
    if (DEFECT == NO_LICENCE || DEFECT == ABORTS_SAYING || (DEFECT == SILENT && logging))
        SAY(callbacks, "no licence for '%s': server %d@%s, error %g, 100%%", "planted", 27000,
            "keys.example", -15.5);
    if (DEFECT == ABORTS_SAYING)
        abort();
    if (DEFECT == NO_LICENCE || DEFECT == SILENT)
        return NULL;
    static int instances, living;
    if (DEFECT == NO_SEAT && living) {
        SAY(callbacks, "all %d licences are in use", living);
        return NULL;
    }
    seats = &living, living++;
    if ((DEFECT == ONLY_ONCE && instances++) || dead)
        abort();
    instance *in = calloc(1, sizeof *in);
    in->callbacks = callbacks;
    in->name = malloc(strlen(name) + 1);
    strcpy(in->name, name);
    start(in, false);
    return in;
}

void EXPORT(FreeInstance)(instance *in)
{
    if (!in)
        return;
    --*seats;
    if (DEFECT != LEAK)
        free(in->name);
    if (DEFECT == POINTER_IN_STATE)
        free((void *)in->now.decay);
    free(in);
}

int EXPORT(Reset)(instance *in)
{
    if (DEFECT == CRASH_ON_RESET && in && in->now.mode < STEPPING)
        abort();
    return in ? start(in, true), OK : ERROR;
}

static int enter(instance *in, double time)
{
    if (!in || in->now.mode != NEW)
        return ERROR;
    if (DEFECT == NO_MODULE)
        return SAY(in->callbacks, "ModuleNotFoundError: No module named '%s'", "scipy"), ERROR;
    if (DEFECT == SAYS_MORE)
        return SAY(in->callbacks,
                   "%s: %d of %i, %5.2f|%-4d|%04u, %x %c %e %g %lld %zu %.3s %% %*d %.*f %p", "many",
                   -1, 2, 3.14159, 42, 7u, 255u, 'z', 12345.678, 0.5, -9000000000ll, (size_t)11,
                   "abcdef", 4, 5, 1, 2.25, (void *)16), ERROR;
    if (DEFECT == SAYS_WRONG)
#if FMI == 2
        return SAY(in->callbacks, WRONG, 1, 2, 3, 4, 5, 6, 7, 8), ERROR;
#else
        return SAY(in->callbacks, "%s", WRONG), ERROR;
#endif
    in->now.mode = INITIALISATION, in->now.time = time;
    return OK;
}

int EXPORT(ExitInitializationMode)(instance *in)
{
    if (!in || in->now.mode != INITIALISATION)
        return ERROR;
    in->now.mode = STEPPING;
    return OK;
}

int EXPORT(Terminate)(instance *in)
{
    if (DEFECT == EXITS)
        exit(3);
    if (!in || in->now.mode != STEPPING)
        return ERROR;
    in->now.mode = TERMINATED;
    return OK;
}

int EXPORT(SetDebugLogging)(instance *in, boolean on, size_t n, const char *const names[])
{
    return (void)on, (void)n, (void)names, in ? OK : ERROR;
}

static bool refused(const instance *in, const void *references, size_t n, const void *values)
{
    return DEFECT != CRASH_ON_NULL && (!in || (n && (!references || !values)));
}

int REAL(Get)(instance *in, const unsigned vr[], size_t n, double values[] VALUES)
{
    static double table[8];
    if (refused(in, vr, n, values))
        return ERROR;
    for (size_t i = 0; i < n; i++)
        switch (vr[i]) {
        case TAU: values[i] = in->now.tau; break;
        case DEPTH: values[i] = in->now.depth; break;
        case POSITION: values[i] = *x_of(in); break;
        case POSITION + 1: values[i] = in->now.time; break;
        case POSITION + 2: values[i] = in->now.depth * in->now.depth; break;
        case EPOCH: values[i] = in->now.time; break;
#if FMI == 3
        case 0: values[i] = in->now.time; break;
#endif
        case 9: values[i] = 1; break;
        default:
            if (DEFECT == HIDDEN_REFERENCE && vr[i] == 8)
                break;
            if (DEFECT != CRASH_ON_REFERENCE)
                return UNKNOWN;
            values[i] = ((volatile double *)table)[vr[i]];
        }
    return OK;
}

int REAL(Set)(instance *in, const unsigned vr[], size_t n, const double values[] VALUES)
{
    if (refused(in, vr, n, values))
        return ERROR;
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(values[i]) && DEFECT != HANG_ON_NAN)
            return ERROR;
        if (vr[i] == TAU && values[i] >= 0.1 && in->now.mode == NEW)
            in->now.tau = values[i];
        else if (vr[i] == DEPTH)
            in->now.depth = values[i];
        else if (DEFECT == OUTPUT_IS_SET && vr[i] == POSITION)
            *x_of(in) = values[i];
        else if (vr[i] < 8 || (vr[i] == 9 && DEFECT != CONSTANT_IS_SET))
            return ERROR;
        else if (vr[i] != 9 && (DEFECT != HIDDEN_REFERENCE || vr[i] != 8))
            return UNKNOWN;
    }
    return OK;
}

int INTEGER(Get)(instance *in, const unsigned vr[], size_t n, int32_t values[] VALUES)
{
    if (refused(in, vr, n, values))
        return ERROR;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != COUNT)
            return UNKNOWN;
        values[i] = (int32_t)ceil(in->now.time - 1e-6);
    }
    return OK;
}

int INTEGER(Set)(instance *in, const unsigned vr[], size_t n, const int32_t values[] VALUES)
{
    return (void)in, (void)values, n ? (vr[0] == COUNT ? ERROR : UNKNOWN) : OK;
}

static int step(instance *in, double time, double h)
{
    static double depth; /* THREADS_CLASH */
    if (DEFECT == NO_FATAL_END && isnan(h))
        return dead = true, FATAL;
    if (DEFECT == CRASH_OUT_OF_ORDER && in && in->now.mode == NEW)
        abort();
    if (!in || in->now.mode != STEPPING || !(h > 0) || !(fabs(time - in->now.time) < 1e-6))
        return ERROR;
    if (DEFECT == STEP_DISCARDED && fabs(h - 0.1) > 1e-6)
        return DISCARD;
    if (DEFECT == HANG_ON_NAN && isnan(in->now.depth))
        hang();
    double tau = in->now.tau, target = in->now.depth, *x = x_of(in);
    if (DEFECT == POINTER_IN_STATE)
        tau *= *in->now.decay;
    if (DEFECT == THREADS_CLASH) {
        depth = target;
        usleep(50);
        target = depth;
    }
    if (DEFECT == STEP_SIZE_MATTERS)
        *x += h * (target - *x) / tau;
    else
        *x = target + (*x - target) * exp(-h / tau);
    if (DEFECT == NEVER_THE_SAME)
        *x += 1e-9 * getpid();
    in->now.time = time + h;
    return OK;
}

int EXPORT(GetDirectionalDerivative)(instance *in, const unsigned unknowns[], size_t n,
                                     const unsigned knowns[], size_t m, const double seed[] SEEDS,
                                     double sensitivity[] SENSITIVITIES)
{
    const double factor = DEFECT == WRONG_DERIVATIVE       ? 1
                          : DEFECT == DERIVATIVE_A_BIT_OFF ? 2.1
                                                           : 2;
    if (refused(in, unknowns, n, sensitivity) || refused(in, knowns, m, seed))
        return ERROR;
    for (size_t i = 0; i < n; i++) {
        sensitivity[i] = 0;
        for (size_t j = 0; j < m; j++)
            if (unknowns[i] != POSITION + 2 || knowns[j] != DEPTH)
                return ERROR;
            else
                sensitivity[i] += factor * in->now.depth * seed[j];
    }
    return OK;
}

/* ---- states ---- */

#if DEFECT != 12
int STATE(Get)(instance *in, state **copy)
{
    if (!in || !copy)
        return ERROR;
    const double before = *copy ? (*copy)->x : in->now.x;
    if (!*copy)
        *copy = malloc(sizeof **copy);
    **copy = in->now;
    if (DEFECT == STATE_NOT_OVERWRITTEN)
        (*copy)->x = before;
    return OK;
}
#endif

int STATE(Set)(instance *in, const state *copy)
{
    if (!in || !copy)
        return ERROR;
    const double x = in->now.x;
    in->now = *copy;
    if (DEFECT == STATE_NOT_RESTORED)
        in->now.x = x;
    return OK;
}

int STATE(Free)(instance *in, state **copy)
{
    if (in && copy) {
        free(*copy);
        *copy = NULL;
    }
    return in ? OK : ERROR;
}

#if FMI == 2
#define STATE_SIZE fmi2SerializedFMUstateSize
#define DESERIALIZE fmi2DeSerializeFMUstate
#else
#define STATE_SIZE fmi3SerializedFMUStateSize
#define DESERIALIZE fmi3DeserializeFMUState
#endif

int STATE_SIZE(instance *in, const state *copy, size_t *size)
{
    return in && copy && size ? *size = sizeof *copy, OK : ERROR;
}

int STATE(Serialize)(instance *in, const state *copy, char bytes[], size_t size)
{
    return in && copy && bytes && size >= sizeof *copy ? memcpy(bytes, copy, sizeof *copy), OK
                                                       : ERROR;
}

int DESERIALIZE(instance *in, const char bytes[], size_t size, state **copy)
{
    if (!in || !bytes || !copy || size != sizeof **copy)
        return ERROR;
    *copy = malloc(size);
    memcpy(*copy, bytes, size);
    return OK;
}

/* ---- the rest of the standards ---- */

#define NO(name)                                                                                   \
    int EXPORT(name)(void) { return ERROR; }
#define NO_VALUES(name)                                                                            \
    int EXPORT(name)(instance *in, const unsigned vr[], size_t n)                                  \
    {                                                                                              \
        return (void)vr, in && !n ? OK : UNKNOWN;                                                  \
    }
#define TEXTS(name)                                                                                \
    int EXPORT(name)(instance *in, const unsigned vr[], size_t n)                                  \
    {                                                                                              \
        return (void)vr, in && (!n || DEFECT == ANY_OF_STRINGS) ? OK : UNKNOWN;                    \
    }

#if FMI == 2
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
instance *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                          const void *callbacks, int visible, int logging)
{
    (void)resources, (void)visible;
    return type == 1 ? create(name, token, callbacks, logging) : NULL;
}
static double start_time; /* between two calls of one host; threads all start at 0 */
int fmi2SetupExperiment(instance *in, int a, double b, double time, int c, double d)
{
    (void)a, (void)b, (void)c, (void)d;
    start_time = time;
    return in && in->now.mode == NEW ? OK : ERROR;
}
int fmi2EnterInitializationMode(instance *in) { return enter(in, start_time); }
int fmi2DoStep(instance *in, double time, double h, int no_set)
{
    return (void)no_set, step(in, time, h);
}
NO(CancelStep) NO(GetBooleanStatus) NO(GetIntegerStatus) NO(GetRealOutputDerivatives)
NO(GetRealStatus) NO(GetStatus) NO(GetStringStatus) NO(SetRealInputDerivatives)
NO_VALUES(GetBoolean) TEXTS(GetString) NO_VALUES(SetBoolean) TEXTS(SetString)
#else
const char *fmi3GetVersion(void) { return "3.0"; }
instance *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                      bool visible, bool logging, bool events, bool early,
                                      const unsigned required[], size_t n_required,
                                      void *environment, void *logger, void *update)
{
    (void)resources, (void)visible, (void)events, (void)early, (void)required;
    (void)n_required, (void)update;
    their_environment = environment;
    return create(name, token, logger, logging);
}
int fmi3EnterInitializationMode(instance *in, bool a, double b, double time, bool c, double d)
{
    return (void)a, (void)b, (void)c, (void)d, enter(in, time);
}
int fmi3DoStep(instance *in, double time, double h, bool no_set, bool *event, bool *terminate,
               bool *early, double *last)
{
    (void)no_set;
    if (!event || !terminate || !early || !last)
        return ERROR;
    *event = *terminate = *early = false, *last = time + h;
    return step(in, time, h);
}
NO(EnterConfigurationMode) NO(EnterEventMode) NO(EnterStepMode) NO(EvaluateDiscreteStates)
NO(ExitConfigurationMode) NO(GetAdjointDerivative) NO_VALUES(GetBinary) NO_VALUES(GetClock)
NO(GetIntervalDecimal) NO(GetIntervalFraction) NO(GetNumberOfVariableDependencies)
NO(GetOutputDerivatives) NO(GetShiftDecimal) NO(GetShiftFraction) NO(GetVariableDependencies)
NO_VALUES(SetBinary) NO_VALUES(SetClock) NO(SetIntervalDecimal) NO(SetIntervalFraction) NO(SetShiftDecimal)
NO(SetShiftFraction) NO(UpdateDiscreteStates)
NO_VALUES(GetBoolean) NO_VALUES(GetFloat32) NO_VALUES(GetInt16) NO_VALUES(GetInt64)
NO_VALUES(GetInt8) TEXTS(GetString) NO_VALUES(GetUInt16) NO_VALUES(GetUInt32)
NO_VALUES(GetUInt64) NO_VALUES(GetUInt8) NO_VALUES(SetBoolean) NO_VALUES(SetFloat32)
NO_VALUES(SetInt16) NO_VALUES(SetInt64) NO_VALUES(SetInt8) TEXTS(SetString)
NO_VALUES(SetUInt16) NO_VALUES(SetUInt32) NO_VALUES(SetUInt64) NO_VALUES(SetUInt8)
#endif
