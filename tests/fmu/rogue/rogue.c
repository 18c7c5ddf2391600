/* A receiver for FMI 2.0 that misbehaves as the file `how` beside its library says: "WHAT PHASE".
 *
 * It takes the newest depth, tells its true position to be (t, 0, depth), and does what it does when
 * it is called for the given phase; in the loop, in the second step. */
#include "../hang.h"

#include <fenv.h>
#include <locale.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#if defined __x86_64__
#include <xmmintrin.h>
#endif

#include "fmi2FunctionTypes.h"

typedef struct {
    double depth, epoch, position[3];
    int count, steps;
    fmi2CallbackLogger logger;
    void *environment;
    char name[64];
} instance;

static char what[32], phase[32];
static instance *newest;
static pthread_t later;
static int is_later;

static void read_how(void)
{
    Dl_info info;
    char path[4096];
    if (!dladdr((void *)read_how, &info))
        return;
    snprintf(path, sizeof path, "%s", info.dli_fname);
    char *const slash = strrchr(path, '/');
    snprintf(slash ? slash : path, sizeof path - (size_t)(slash - path), "/how");
    FILE *const file = fopen(path, "r");
    if (!file)
        return;
    if (fscanf(file, "%31s %31s", what, phase) < 2)
        what[0] = phase[0] = 0;
    fclose(file);
}

static void *crash(void *delay_us)
{
    usleep((unsigned)(size_t)delay_us);
    *(volatile int *)NULL = 0;
    return NULL;
}

static void flood(void)
{
    static char text[10000];
    memset(text, 'x', sizeof text - 2), text[sizeof text - 2] = '\n';
    for (int i = 0; i < 1000; i++)
        fputs(text, i % 2 ? stdout : stderr);
    fflush(stdout);
    for (int i = 0; newest && i < 2000; i++)
        newest->logger(newest->environment, newest->name, 1, "logStatusWarning", "%d %s", i, text);
}

static void misbehave(void)
{
    pthread_t thread;
    if (!strcmp(what, "exit"))
        exit(0);
    else if (!strcmp(what, "_exit"))
        _exit(3);
    else if (!strcmp(what, "segv"))
        *(volatile int *)NULL = 0;
    else if (!strcmp(what, "abort"))
        abort();
    else if (!strcmp(what, "fpe"))
        raise(SIGFPE);
    else if (!strcmp(what, "bus"))
        raise(SIGBUS);
    else if (!strcmp(what, "hang"))
        hang();
    else if (!strcmp(what, "sleep"))
        usleep(300000);
    else if (!strcmp(what, "thread")) {
        pthread_create(&thread, NULL, crash, NULL);
        pthread_join(thread, NULL);
    } else if (!strcmp(what, "later")) {
        is_later = !pthread_create(&later, NULL, crash, (void *)30000);
    } else if (!strcmp(what, "rounding"))
        fesetround(FE_UPWARD);
    else if (!strcmp(what, "subnormal")) {
#if defined __x86_64__
        _mm_setcsr(_mm_getcsr() | 0x8040);
#else
        fesetround(FE_TOWARDZERO);
#endif
    } else if (!strcmp(what, "locale"))
        setlocale(LC_ALL, "C.UTF-8");
    else if (!strcmp(what, "dates"))
        setlocale(LC_TIME, "C.UTF-8");
    else if (!strcmp(what, "flood"))
        flood();
    else if (!strcmp(what, "complain") && newest) {
        newest->logger(newest->environment, newest->name, 3, "logStatusError", "no licence");
        exit(1);
    }
}

static int at(const char *now)
{
    if (!strcmp(phase, now))
        misbehave();
    return !strcmp(phase, now) && !strcmp(what, "error") ? 3 : 0;
}

__attribute__((constructor)) static void loaded(void)
{
    read_how();
    at("load");
}
__attribute__((destructor)) static void unloaded(void) { at("unload"); }

const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }

void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                      const fmi2CallbackFunctions *callbacks, int visible, int logging)
{
    (void)type, (void)token, (void)resources, (void)visible, (void)logging;
    instance *const in = newest = calloc(1, sizeof *in);
    in->logger = callbacks->logger, in->environment = callbacks->componentEnvironment;
    snprintf(in->name, sizeof in->name, "%s", name);
    if (at("instantiate"))
        return NULL;
    return in;
}
void fmi2FreeInstance(instance *in)
{
    at("free");
    newest = NULL;
    free(in);
}
int fmi2SetDebugLogging(void *in, int on, size_t n, const char *const names[])
{
    return (void)in, (void)on, (void)n, (void)names, 0;
}
int fmi2SetupExperiment(void *in, int a, double b, double c, int d, double e)
{
    return (void)in, (void)a, (void)b, (void)c, (void)d, (void)e, at("setup");
}
int fmi2EnterInitializationMode(void *in) { return (void)in, at("initialise"); }
int fmi2ExitInitializationMode(void *in) { return (void)in, 0; }
int fmi2Terminate(void *in)
{
    if (is_later) /* no run is over before the crash, however busy the machine is */
        pthread_join(later, NULL);
    return (void)in, at("terminate");
}
int fmi2Reset(instance *in)
{
    in->depth = in->epoch = 0, in->count = in->steps = 0;
    memset(in->position, 0, sizeof in->position);
    return at("reset");
}

int fmi2SetReal(instance *in, const unsigned vr[], size_t n, const double value[])
{
    for (size_t i = 0; i < n; i++)
        if (vr[i] == 1)
            in->depth = value[i];
    return in->steps == 1 ? at("set") : 0;
}
int fmi2GetReal(instance *in, const unsigned vr[], size_t n, double value[])
{
    for (size_t i = 0; i < n; i++)
        value[i] = vr[i] == 1 ? in->depth : vr[i] == 2 ? in->epoch : in->position[vr[i] - 3];
    return in->steps == 1 ? at("get") : 0;
}
int fmi2GetInteger(instance *in, const unsigned vr[], size_t n, int value[])
{
    (void)vr;
    for (size_t i = 0; i < n; i++)
        value[i] = in->count;
    return 0;
}
int fmi2DoStep(instance *in, double t, double h, int no_set)
{
    (void)h, (void)no_set;
    in->count++, in->epoch = t, in->position[0] = t, in->position[2] = in->depth;
    return in->steps++ == 1 ? at("step") : 0;
}

/* What this FMU does not do; FMPy wants every function to be there. */
#define NO(name)                                                                                   \
    int name(void) { return 3; }
NO(fmi2SetInteger) NO(fmi2GetBoolean) NO(fmi2SetBoolean) NO(fmi2GetString) NO(fmi2SetString)
NO(fmi2GetFMUstate) NO(fmi2SetFMUstate) NO(fmi2FreeFMUstate) NO(fmi2SerializedFMUstateSize)
NO(fmi2SerializeFMUstate) NO(fmi2DeSerializeFMUstate) NO(fmi2GetDirectionalDerivative)
NO(fmi2SetRealInputDerivatives) NO(fmi2GetRealOutputDerivatives) NO(fmi2CancelStep)
NO(fmi2GetStatus) NO(fmi2GetRealStatus) NO(fmi2GetIntegerStatus) NO(fmi2GetBooleanStatus)
NO(fmi2GetStringStatus)
