/* The native master's loop: runs a plan by calling the FMUs' own functions.
 *
 * native.py fills the structures below and owns all memory. `native_run` executes one run; several
 * threads may call it at once, each with its own structures.
 *
 * At each instant it reads and records the outputs of all components that are due, and sets their
 * inputs; only then does each of them step. */
#define _XOPEN_SOURCE 700
#include <fenv.h>
#include <locale.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#if defined __x86_64__
#include <xmmintrin.h>
#endif
#ifdef __APPLE__
#include <xlocale.h>
#endif

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* Status of FMI 2 and FMI 3 alike. */
enum { WARNING = 1, DISCARD = 2 };

enum outcome { FINISHED, FAILED, CANCELLED };

/* Process state that an FMU may have changed for all others, as bits. */
enum habit { FLOATING = 1, LOCALE = 2 };

/* Signature of a call. Booleans are int in FMI 2, and bool here and in FMI 3. */
enum form { ACCESS2, GET_BOOLEAN2, SET_BOOLEAN2, ACCESS3, STEP2, STEP3 };

/* In all FMI access functions, references are unsigned int and values are a pointer. */
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
    int *booleans; /* GET_BOOLEAN2 and SET_BOOLEAN2 only: the values as int */
};

/* A copy of bytes; `to` is in the first of several rows. */
struct copy {
    const char *from;
    char *to;
    size_t size, row_size;
};

/* For an input that is gathered: factor * value + offset. */
struct conversion {
    double *value;
    double factor, offset;
};

/* Its calls are contiguous: gets, sets, one step. So are its copies, which gather inputs. */
struct component {
    int64_t due; /* next communication instant [ns] */
    int64_t interval;
    double step; /* [s] */
    size_t first_get, first_set, do_step;
    size_t first_copy, end_copy;
    size_t first_conversion, end_conversion;
    int64_t watched;   /* whether to check the process state after its calls */
    int64_t habits;    /* changes seen so far */
    int64_t habits_at; /* the first call with a change */
};

/* Shared by the loop and its watchers, perhaps in another process. The loop writes row and at; a
 * watcher writes cancel. */
struct progress {
    _Atomic int64_t row, at; /* current instant and call */
    _Atomic int64_t cancel;
};

struct run {
    struct component *components;
    size_t n_components;
    const struct call *calls;
    const struct copy *copies;
    const struct conversion *conversions;
    const struct copy *records;
    size_t n_records;
    const int64_t *instants;
    int64_t n_instants;
    struct progress *progress;
    int64_t outcome;
    int64_t status;      /* returned by the FMU */
    int64_t ended_early; /* the FMU has ended the simulation or the step */
};

/* ---- habits ---- */

/* The floating-point settings: rounding, subnormal numbers, trapped exceptions; without the sticky
 * exception flags. */
static uint64_t floating(void)
{
#if defined __x86_64__
    uint16_t x87;
    __asm__ volatile("fnstcw %0" : "=m"(x87));
    return (_mm_getcsr() & ~0x3Fu) | (uint64_t)x87 << 32;
#elif defined __aarch64__
    uint64_t state;
    __asm__ volatile("mrs %0, fpcr" : "=r"(state));
    return state;
#else
    return (uint64_t)fegetround();
#endif
}

static void set_floating(uint64_t state)
{
#if defined __x86_64__
    const uint16_t x87 = (uint16_t)(state >> 32);
    __asm__ volatile("fnclex\n\tfldcw %0" : : "m"(x87)); /* pending exceptions must not trap now */
    _mm_setcsr((uint32_t)state);
#elif defined __aarch64__
    __asm__ volatile("msr fpcr, %0" : : "r"(state));
#else
    fesetround((int)state);
#endif
}

static uint64_t usual_floating;
static char usual_locale[1024];

/* The whole locale: if an FMU changes the format of dates, say, the call that does it is reported.
 * */
static bool locale_is_usual(void)
{
    const char *const name = setlocale(LC_ALL, NULL);
#ifndef _WIN32
    if (uselocale((locale_t)0) != LC_GLOBAL_LOCALE)
        return false;
#endif
    return name && !strcmp(name, usual_locale);
}

/* Take the current state as the normal one, with numbers formatted as in C. */
EXPORT void native_remember(void)
{
    setlocale(LC_NUMERIC, "C");
    const char *const name = setlocale(LC_ALL, NULL);
    snprintf(usual_locale, sizeof usual_locale, "%s", name ? name : "C");
    usual_floating = floating();
}

static void settle_locale(void)
{
#ifndef _WIN32
    uselocale(LC_GLOBAL_LOCALE);
#endif
    setlocale(LC_ALL, usual_locale);
}

/* Restore the normal state; return what had changed, as bits of enum habit. */
static int settle(void)
{
    int habits = 0;
    if (floating() != usual_floating) {
        set_floating(usual_floating);
        habits |= FLOATING;
    }
    if (!locale_is_usual()) {
        settle_locale();
        habits |= LOCALE;
    }
    return habits;
}

/* For calls outside the loop. */
EXPORT int native_settle(void) { return settle(); }

/* After each call of a component. */
static void watch(struct component *c, size_t call)
{
    if (!c->watched)
        return;
    const int habits = settle();
    if (habits && !c->habits)
        c->habits_at = (int64_t)call;
    c->habits |= habits;
}

/* ---- the loop ---- */

static void copy(const struct copy *c, const struct copy *end, int64_t row)
{
    for (; c < end; c++)
        memcpy(c->to + (size_t)row * c->row_size, c->from, c->size);
}

static void convert(const struct conversion *c, const struct conversion *end)
{
    for (; c < end; c++)
        *c->value = *c->value * c->factor + c->offset;
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

static int access_all(struct run *run, struct component *c, size_t first, size_t end)
{
    int status = 0;
    for (size_t i = first; i < end && status <= WARNING; i++) {
        atomic_store_explicit(&run->progress->at, (int64_t)i, memory_order_relaxed);
        status = access(run->calls + i);
        watch(c, i);
    }
    return status;
}

/* Do an instant; return the last status, which is the first one worse than a warning, if any. */
static int at_instant(struct run *run, int64_t row, bool last)
{
    struct component *const end = run->components + run->n_components;
    const int64_t now = run->instants[row];
    const double time = (double)now / 1e9;
    int status = 0;
    for (struct component *c = run->components; c < end; c++)
        if (c->due == now && (status = access_all(run, c, c->first_get, c->first_set)) > WARNING)
            return status;
    copy(run->records, run->records + run->n_records, row);
    if (last)
        return status;
    for (struct component *c = run->components; c < end; c++) {
        if (c->due != now)
            continue;
        copy(run->copies + c->first_copy, run->copies + c->end_copy, 0);
        convert(run->conversions + c->first_conversion, run->conversions + c->end_conversion);
        if ((status = access_all(run, c, c->first_set, c->do_step)) > WARNING)
            return status;
    }
    for (struct component *c = run->components; c < end; c++) {
        if (c->due != now)
            continue;
        c->due += c->interval;
        atomic_store_explicit(&run->progress->at, (int64_t)c->do_step, memory_order_relaxed);
        status = do_step(run, run->calls + c->do_step, time, c->step);
        watch(c, c->do_step);
        if (status > WARNING)
            return status;
    }
    return status;
}

EXPORT void native_run(struct run *run)
{
    run->outcome = FINISHED;
    for (int64_t row = 0; row < run->n_instants; row++) {
        atomic_store_explicit(&run->progress->row, row, memory_order_relaxed);
        if (atomic_load_explicit(&run->progress->cancel, memory_order_relaxed)) {
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
