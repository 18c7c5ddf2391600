/* The native master's loop: runs a plan by calling the FMUs' own functions.
 *
 * native.py prepares everything, in the structures below, and owns all memory. `native_run` executes
 * one run; several threads may do so at once, each with structures of its own.
 *
 * At each instant: the outputs of all components that are due are read, recorded, and set as inputs;
 * only then does each of them step. */
#define _XOPEN_SOURCE 700
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#include <setjmp.h>
#include <signal.h>
#endif

/* Status of FMI 2 and FMI 3 alike. */
enum { WARNING = 1, DISCARD = 2 };

enum outcome { FINISHED, FAILED, CANCELLED, CRASHED };

/* What a call looks like. FMI 2 has Booleans of type int; here and in FMI 3 they are bool. */
enum form { ACCESS2, GET_BOOLEAN2, SET_BOOLEAN2, ACCESS3, STEP2, STEP3 };

/* References and values are unsigned int and pointers to some type in all of FMI. */
typedef int access2(void *instance, const uint32_t *references, size_t n, void *values);
typedef int access3(void *instance, const uint32_t *references, size_t n, void *values,
                    size_t n_values);
typedef int step2(void *instance, double time, double step, int no_set_state);
typedef int step3(void *instance, double time, double step, bool no_set_state, bool *event,
                  bool *terminate, bool *early, double *reached);

struct call {
    int64_t form;
    union {
        access2 *access2;
        access3 *access3;
        step2 *step2;
        step3 *step3;
    } function;
    void *instance;
    const uint32_t *references;
    size_t n_references;
    void *values;
    size_t n_values;
    int *booleans; /* of GET_BOOLEAN2 and SET_BOOLEAN2: the values as FMI 2 has them */
};

/* Bytes from here to there; there is the first of several rows. */
struct copy {
    const char *from;
    char *to;
    size_t size, row_size;
};

/* Its calls stand one after another: gets, sets, one step. So do its copies, which gather inputs. */
struct component {
    int64_t due; /* next communication instant in ns */
    int64_t interval;
    double step; /* s */
    size_t first_get, first_set, do_step;
    size_t first_copy, end_copy;
};

struct run {
    struct component *components;
    size_t n_components;
    const struct call *calls;
    const struct copy *copies;
    const struct copy *records;
    size_t n_records;
    const int64_t *instants;
    int64_t n_instants;
    void *stack; /* for the signal handler: the FMU may have used up the thread's own */
    size_t stack_size;
    int64_t outcome;
    int64_t status;              /* of the FMU, or number of the signal */
    int64_t ended_early;         /* the FMU has ended the simulation or the step */
    _Atomic int64_t row, at;     /* instant and call under way, for those who watch */
    _Atomic int64_t cancel;      /* set by those who watch */
};

static void copy(const struct copy *c, const struct copy *end, int64_t row)
{
    for (; c < end; c++)
        memcpy(c->to + (size_t)row * c->row_size, c->from, c->size);
}

static int access(const struct call *c)
{
    bool *values = c->values;
    switch ((enum form)c->form) {
    case ACCESS2:
        return c->function.access2(c->instance, c->references, c->n_references, c->values);
    case ACCESS3:
        return c->function.access3(c->instance, c->references, c->n_references, c->values,
                                   c->n_values);
    case SET_BOOLEAN2:
        for (size_t i = 0; i < c->n_values; i++)
            c->booleans[i] = values[i];
        return c->function.access2(c->instance, c->references, c->n_references, c->booleans);
    default: {
        int status = c->function.access2(c->instance, c->references, c->n_references, c->booleans);
        for (size_t i = 0; i < c->n_values; i++)
            values[i] = c->booleans[i] != 0;
        return status;
    }
    }
}

static int do_step(struct run *run, const struct call *c, double time, double step)
{
    if (c->form == STEP2)
        return c->function.step2(c->instance, time, step, 1);
    bool event = false, terminate = false, early = false;
    double reached = 0;
    int status = c->function.step3(c->instance, time, step, true, &event, &terminate, &early,
                                   &reached);
    if (status > WARNING || !(terminate || early))
        return status;
    run->ended_early = 1;
    return DISCARD;
}

static int access_all(struct run *run, size_t first, size_t end)
{
    int status = 0;
    for (size_t i = first; i < end && status <= WARNING; i++) {
        atomic_store_explicit(&run->at, (int64_t)i, memory_order_relaxed);
        status = access(run->calls + i);
    }
    return status;
}

/* The worst status at an instant; with the first that is worse than a warning it is over. */
static int at_instant(struct run *run, int64_t row, bool last)
{
    struct component *const end = run->components + run->n_components;
    const int64_t now = run->instants[row];
    const double time = (double)now / 1e9;
    int status = 0;
    for (struct component *c = run->components; c < end; c++)
        if (c->due == now && (status = access_all(run, c->first_get, c->first_set)) > WARNING)
            return status;
    copy(run->records, run->records + run->n_records, row);
    if (last)
        return status;
    for (struct component *c = run->components; c < end; c++) {
        if (c->due != now)
            continue;
        copy(run->copies + c->first_copy, run->copies + c->end_copy, 0);
        if ((status = access_all(run, c->first_set, c->do_step)) > WARNING)
            return status;
    }
    for (struct component *c = run->components; c < end; c++) {
        if (c->due != now)
            continue;
        c->due += c->interval;
        atomic_store_explicit(&run->at, (int64_t)c->do_step, memory_order_relaxed);
        if ((status = do_step(run, run->calls + c->do_step, time, c->step)) > WARNING)
            return status;
    }
    return status;
}

static void loop(struct run *run)
{
    run->outcome = FINISHED;
    for (int64_t row = 0; row < run->n_instants; row++) {
        atomic_store_explicit(&run->row, row, memory_order_relaxed);
        if (atomic_load_explicit(&run->cancel, memory_order_relaxed)) {
            run->outcome = CANCELLED;
            return;
        }
        run->status = at_instant(run, row, row + 1 == run->n_instants);
        if (run->status > WARNING) {
            run->outcome = FAILED;
            return;
        }
    }
}

#ifdef _WIN32

EXPORT void native_guard(int on) { (void)on; }
EXPORT void native_run(struct run *run) { loop(run); }

#else

static const int SIGNALS[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
enum { N_SIGNALS = sizeof SIGNALS / sizeof *SIGNALS };

/* Handlers belong to the process. They are set while any thread is in a run (native.py counts), and
 * know by `landing` whether the thread that has crashed is. */
static struct sigaction before[N_SIGNALS];
#ifdef __GLIBC__
__attribute__((tls_model("initial-exec"))) /* the first use of any other may call malloc */
#endif
static _Thread_local sigjmp_buf *landing;

/* Somebody else's crash: what would have happened without us. */
static void pass_on(const struct sigaction *old, int number, siginfo_t *info, void *context)
{
    if (old->sa_flags & SA_SIGINFO) {
        old->sa_sigaction(number, info, context);
    } else if (old->sa_handler == SIG_DFL) {
        sigaction(number, old, NULL);
        raise(number); /* comes when the handler returns */
    } else if (old->sa_handler != SIG_IGN) {
        old->sa_handler(number);
    }
}

static void on_signal(int number, siginfo_t *info, void *context)
{
    if (landing)
        siglongjmp(*landing, number);
    for (int i = 0; i < N_SIGNALS; i++)
        if (SIGNALS[i] == number)
            pass_on(before + i, number, info, context);
}

/* Watch out for crashes, or no longer. */
EXPORT void native_guard(int on)
{
    struct sigaction action = {.sa_flags = SA_SIGINFO | SA_ONSTACK};
    action.sa_sigaction = on_signal;
    sigemptyset(&action.sa_mask);
    for (int i = 0; i < N_SIGNALS; i++)
        sigaction(SIGNALS[i], on ? &action : before + i, on ? before + i : NULL);
}

EXPORT void native_run(struct run *run)
{
    sigjmp_buf here;
    stack_t old, stack = {.ss_sp = run->stack, .ss_size = run->stack_size};
    sigaltstack(&stack, &old);
    int number = sigsetjmp(here, 1);
    if (number == 0) {
        landing = &here;
        loop(run);
    } else {
        run->outcome = CRASHED;
        run->status = number;
    }
    landing = NULL;
    sigaltstack(&old, NULL);
}

#endif
