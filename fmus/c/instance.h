/* An instance of a component, the same for FMI 2 and FMI 3: its memory, its modes, its messages.
 *
 * life_cycle.h, values.h, steps.h and snapshots.h implement what it can do; fmi2.c and fmi3.c wrap
 * this in the functions of the standard. They first define `boolean`, `logger_callback` and ARRAYS:
 * whether one value reference stands for a whole array. */
#ifndef SBLCOSIM_INSTANCE_H
#define SBLCOSIM_INSTANCE_H

#include <math.h> /* INFINITY; no function of libm is called */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "real.h"
#include "elementary.h"
#include "model.h"
#include "engine.h"
#ifdef SHARED_ENGINE
#include "shared.h"
#endif

enum type { FLOAT64, INT32, BOOLEAN };
enum causality { PARAMETER, INPUT, OUTPUT };

struct variable {
    const char *name;
    enum type type;
    enum causality causality;
    unsigned reference; /* of the first element */
    unsigned size, dimensions, columns;
    double min, max;
};

#include "tables.h"

/* State of an instance in the standard's call sequence; each function names the modes it allows. */
enum mode {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEP = 4,
    TERMINATED = 8,
    FAILED = 16, /* a step went wrong: read, restore, reset or free */
};
#define ANY_MODE (INSTANTIATED | INITIALIZATION | STEP | TERMINATED | FAILED)
#define READABLE (INITIALIZATION | STEP | TERMINATED | FAILED)

/* Whole numbers of the standards: the same in FMI 2 and FMI 3. */
enum status { OK = 0, WARNING = 1, DISCARD = 2, ERROR = 3 };

/* Everything that changes, and nothing but numbers: a snapshot is a copy. */
struct data {
    struct block block;
    int64_t start_ns, time_ns, interval_ns;
    int32_t mode, variant;
    int32_t stale; /* outputs are older than the values they depend on */
    int32_t moved_ns; /* time_ns minus the end of the last step as the master has it */
};

struct instance {
    struct data data;
    char *name;
    void *environment;
    logger_callback logger;
};

/* Hand a message to the environment; in fmi2.c and fmi3.c. */
static void emit(const struct instance *in, enum status status, const char *message);

#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
static enum status report(const struct instance *in, enum status status, const char *format, ...)
{
    char text[512], message[768];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    snprintf(message, sizeof message, "%s: %s", in->name ? in->name : MODEL_NAME, text);
    for (char *c = message; *c; c++)
        if (*c == '%' || *c == '#') /* both mean something to an FMI 2 logger */
            *c = '_';
    emit(in, status, message);
    return status;
}

static const char *mode_name(int32_t mode)
{
    switch (mode) {
    case INSTANTIATED: return "instantiated";
    case INITIALIZATION: return "in Initialization Mode";
    case STEP: return "in Step Mode";
    case TERMINATED: return "terminated";
    default: return "failed";
    }
}

static enum status require(const struct instance *in, int modes, const char *function)
{
    if (in->data.mode & modes)
        return OK;
    return report(in, ERROR, "%s is not allowed while the instance is %s", function,
                  mode_name(in->data.mode));
}

static void element_name(unsigned element, char *name, size_t size)
{
    const struct variable *v = &variables[owner[element]];
    const unsigned index = element + FIRST_REFERENCE - v->reference;
    if (v->dimensions == 0)
        snprintf(name, size, "%s", v->name);
    else if (v->dimensions == 1)
        snprintf(name, size, "%s[%u]", v->name, index + 1);
    else
        snprintf(name, size, "%s[%u,%u]", v->name, index / v->columns + 1,
                 index % v->columns + 1);
}

#endif
