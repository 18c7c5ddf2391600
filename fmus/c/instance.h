/* An instance of a component, the same for FMI 2 and FMI 3: its memory, its values, its call
 * sequence, its snapshots. fmi2.c and fmi3.c dress it in the functions of the standard; they
 * define `boolean`, `logger_callback` and ARRAYS (whether one value reference stands for a whole array) before. */
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

/* Where an instance is in the standard's call sequence; a function names the modes it is for. */
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

#define SNAPSHOT_MAGIC 0x53424c46u /* "SBLF" */
#define SNAPSHOT_VERSION 1u
#define TICK_TOLERANCE_NS 1000

/* Everything that changes, and nothing but numbers: a snapshot is a copy. */
struct data {
    struct block block;
    int64_t start_ns, time_ns, interval_ns;
    int32_t mode, variant;
    int32_t stale; /* outputs are older than what they depend on */
    int32_t moved_ns; /* time_ns minus the end of the last step as the master has it */
};

struct snapshot {
    uint32_t magic, version;
    uint64_t size;
    uint64_t checksum; /* 0 except in the serialized form */
    char token[sizeof MODEL_TOKEN];
    struct data data;
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

/* ---- life cycle ---- */

static void instance_start_values(struct instance *in)
{
    struct data *d = &in->data;
    memset(d, 0, sizeof *d);
    for (int i = 0; i < N_P + N_U; i++)
        d->block.v[i] = start_values[i];
    d->mode = INSTANTIATED;
    d->stale = 1;
}

static struct instance *instance_create(const char *name, void *environment,
                                        logger_callback logger)
{
    struct instance *in = calloc(1, sizeof *in);
    if (!in)
        return NULL;
    const size_t length = strlen(name) + 1;
    in->name = malloc(length);
    if (!in->name) {
        free(in);
        return NULL;
    }
    memcpy(in->name, name, length);
    in->environment = environment;
    in->logger = logger;
    instance_start_values(in);
    return in;
}

static void instance_free(struct instance *in)
{
    if (in) {
        free(in->name);
        free(in);
    }
}

static enum status instance_set_start(struct instance *in, double start)
{
    if (!to_ns(start, &in->data.start_ns))
        return report(in, ERROR, "the start time must be finite and below %g s, got %g",
                      MAX_SECONDS, start);
    in->data.time_ns = in->data.start_ns;
    in->data.stale = 1;
    return OK;
}

/* Evaluate the state and the outputs at the start time. */
static enum status instance_initialise(struct instance *in)
{
    struct data *d = &in->data;
    d->interval_ns = 0;
#if P_INTERVAL >= 0
    if (!engine_interval(d->block.v[P_INTERVAL], &d->interval_ns))
        return report(in, ERROR, "%s must be a whole number of nanoseconds, got %.17g s",
                      variables[owner[P_INTERVAL]].name, d->block.v[P_INTERVAL]);
#endif
    d->variant = 0;
#if P_VARIANT >= 0
    d->variant = (int32_t)d->block.v[P_VARIANT];
#endif
    if (!engine_initial(&d->block, d->variant, d->start_ns))
        return report(in, ERROR, "the initial state was not found in %d rounds", MAX_ROUNDS);
    d->stale = 0;
    return OK;
}

static int all_finite(const double *values, size_t n)
{
    uint64_t bad = 0;
    for (size_t i = 0; i < n; i++) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        bad |= (bits & 0x7ff0000000000000u) == 0x7ff0000000000000u;
    }
    return !bad;
}

static enum status instance_check_finite(const struct instance *in)
{
    if (all_finite(in->data.block.v + N_P + N_U, N_Y))
        return OK;
    for (unsigned i = N_P + N_U; i < N_VALUES; i++)
        if (!__builtin_isfinite(in->data.block.v[i])) {
            char name[128];
            element_name(i, name, sizeof name);
            return report(in, ERROR, "%s became %g at %.9g s", name, in->data.block.v[i],
                          (double)in->data.time_ns / 1e9);
        }
    return OK;
}

static enum status instance_exit_initialization(struct instance *in)
{
    enum status status = instance_initialise(in);
    if (status == OK)
        status = instance_check_finite(in);
    if (status == OK)
        in->data.mode = STEP;
    return status;
}

/* ---- values ---- */

/* The element of a value reference, or N_VALUES. */
static unsigned element_of(unsigned reference)
{
    const unsigned element = reference - FIRST_REFERENCE;
    return element < N_VALUES ? element : N_VALUES;
}

static enum status check_type(const struct instance *in, const char *function, unsigned element,
                              enum type type)
{
    static const char *const names[] = {"Float64 (Real)", "Int32 (Integer)", "Boolean"};
    const struct variable *v = &variables[owner[element]];
    if (v->type == type)
        return OK;
    return report(in, ERROR, "%s: %s is of type %s, not %s", function, v->name, names[v->type],
                  names[type]);
}

/* Bring the outputs up to date before they are read. */
static enum status instance_refresh(struct instance *in)
{
    if (!in->data.stale)
        return OK;
    if (in->data.mode == INITIALIZATION) {
        const enum status status = instance_initialise(in);
        if (status != OK)
            return status;
    } else
        engine_output(&in->data.block, in->data.variant, in->data.time_ns);
    const enum status status = instance_check_finite(in);
    in->data.stale = status != OK;
    return status;
}

/* Why a value cannot be set, or NULL. */
static const char *refusal(const struct instance *in, const struct variable *v, double value)
{
    if (v->causality == OUTPUT)
        return "is an output and cannot be set; got";
    if (v->causality == PARAMETER && !(in->data.mode & (INSTANTIATED | INITIALIZATION)))
        return "is a fixed parameter and cannot be set after initialization; got";
    if (!__builtin_isfinite(value))
        return "must be finite, got";
    if (v->causality == PARAMETER && !(value >= v->min && value <= v->max))
        return "is out of its range, got";
    return NULL;
}

static enum status check_value(const struct instance *in, const char *function, unsigned element,
                               double value)
{
    const struct variable *v = &variables[owner[element]];
    const char *reason = refusal(in, v, value);
    if (!reason)
        return OK;
    char name[128];
    element_name(element, name, sizeof name);
    if (v->causality == PARAMETER && (v->min > -INFINITY || v->max < INFINITY))
        return report(in, ERROR, "%s: %s (%.9g to %.9g) %s %.17g", function, name, v->min, v->max,
                      reason, value);
    return report(in, ERROR, "%s: %s %s %.17g", function, name, reason, value);
}

/* How many elements a reference stands for: its variable, or only itself without arrays. */
static unsigned extent(unsigned element)
{
    return ARRAYS ? variables[owner[element]].size : 1;
}

/* Elements that follow each other and can be read or written at once: an array, or scalars with
 * consecutive references whose type and causality are the same. */
struct piece {
    unsigned first, size;
    size_t references;
};

static struct piece next_piece(const unsigned references[], size_t n)
{
    struct piece piece = {element_of(references[0]), 0, 1};
    if (piece.first == N_VALUES)
        return piece;
    piece.size = extent(piece.first);
    if (!ARRAYS) {
        while (piece.references < n && piece.references < alike[piece.first]
               && references[piece.references] == references[0] + piece.references)
            piece.references++;
        piece.size = (unsigned)piece.references;
    }
    return piece;
}

static int is_time(unsigned reference, enum type type)
{
    return ARRAYS && reference == 0 && type == FLOAT64;
}

/* Check references and the number of values before anything is read or written. */
static enum status check_access(const struct instance *in, const char *function, enum type type,
                                const unsigned references[], size_t n, const void *values,
                                size_t n_values)
{
    size_t count = 0;
    if (n > 0 && (!references || !values))
        return report(in, ERROR, "%s: the arrays must not be null", function);
    for (size_t i = 0; i < n;) {
        if (is_time(references[i], type)) {
            count++, i++;
            continue;
        }
        const struct piece piece = next_piece(references + i, n - i);
        if (!piece.size || (ARRAYS && variables[owner[piece.first]].reference != references[i]))
            return report(in, ERROR, "%s: there is no variable with value reference %u", function,
                          references[i]);
        const enum status status = check_type(in, function, piece.first, type);
        if (status != OK)
            return status;
        count += piece.size;
        i += piece.references;
    }
    if (count != n_values)
        return report(in, ERROR, "%s: the variables have %zu values, got room for %zu", function,
                      count, n_values);
    return OK;
}

static double value_at(const void *values, enum type type, size_t i)
{
    switch (type) {
    case FLOAT64: return ((const double *)values)[i];
    case INT32: return ((const int32_t *)values)[i];
    default: return ((const boolean *)values)[i] ? 1.0 : 0.0;
    }
}

static enum status instance_get(struct instance *in, const char *function, enum type type,
                                const unsigned references[], size_t n, void *values,
                                size_t n_values)
{
    enum status status = require(in, READABLE, function);
    if (status == OK)
        status = check_access(in, function, type, references, n, values, n_values);
    if (status == OK)
        status = instance_refresh(in);
    if (status != OK)
        return status;
    size_t place = 0;
    for (size_t i = 0; i < n;) {
        if (is_time(references[i], type)) {
            ((double *)values)[place++] = (double)in->data.time_ns / 1e9;
            i++;
            continue;
        }
        const struct piece piece = next_piece(references + i, n - i);
        const double *from = in->data.block.v + piece.first;
        switch (type) {
        case FLOAT64:
            memcpy((double *)values + place, from, piece.size * sizeof *from);
            break;
        case INT32:
            for (unsigned j = 0; j < piece.size; j++)
                ((int32_t *)values)[place + j] = (int32_t)from[j];
            break;
        case BOOLEAN:
            for (unsigned j = 0; j < piece.size; j++)
                ((boolean *)values)[place + j] = from[j] != 0.0;
            break;
        }
        place += piece.size;
        i += piece.references;
    }
    return OK;
}

/* Check the values of a piece, or set them. */
static enum status piece_set(struct instance *in, const char *function, enum type type,
                             const struct piece *piece, const void *values, size_t place, int write)
{
    double *to = in->data.block.v + piece->first;
    const int input = variables[owner[piece->first]].causality == INPUT;
    if (input && type == FLOAT64) { /* the many values of every step */
        const double *from = (const double *)values + place;
        if (write)
            memcpy(to, from, piece->size * sizeof *to);
        if (write || all_finite(from, piece->size))
            return OK;
    }
    for (unsigned j = 0; j < piece->size; j++) {
        const double value = value_at(values, type, place + j);
        const enum status status =
            write ? OK : check_value(in, function, piece->first + j, value);
        if (status != OK)
            return status;
        if (write)
            to[j] = value;
    }
    return OK;
}

static enum status instance_set(struct instance *in, const char *function, enum type type,
                                const unsigned references[], size_t n, const void *values,
                                size_t n_values)
{
    enum status status = require(in, INSTANTIATED | INITIALIZATION | STEP, function);
    if (status == OK)
        status = check_access(in, function, type, references, n, values, n_values);
    if (status != OK)
        return status;
    for (int write = 0; write < 2; write++) { /* all values are checked before one is set */
        size_t place = 0;
        for (size_t i = 0; i < n;) {
            if (is_time(references[i], type))
                return report(in, ERROR, "%s: time cannot be set", function);
            const struct piece piece = next_piece(references + i, n - i);
            if ((status = piece_set(in, function, type, &piece, values, place, write)) != OK)
                return status;
            place += piece.size;
            i += piece.references;
        }
    }
    /* Outputs at the start follow from parameters; later only direct feedthrough matters. */
    if (n > 0 && (in->data.mode != STEP || HAS_JACOBIAN))
        in->data.stale = 1;
    return OK;
}

/* ---- steps ---- */

/* Time relative to the start; a time close enough to a tick is that tick. */
static int64_t snap(int64_t relative_ns, int64_t interval_ns, int64_t tolerance_ns)
{
    if (interval_ns <= 0 || relative_ns < 0)
        return relative_ns;
    const int64_t tick = (relative_ns + interval_ns / 2) / interval_ns * interval_ns;
    const int64_t distance = relative_ns > tick ? relative_ns - tick : tick - relative_ns;
    return distance <= tolerance_ns ? tick : relative_ns;
}

/* Where a step ends that the master ends at `end_ns`: never before it begins, so that every tick lies
 * in exactly one step, and a step too short to hold a nanosecond has none. */
static int64_t step_end(const struct data *d, int64_t end_ns, int64_t tolerance_ns)
{
    const int64_t snapped = d->start_ns + snap(end_ns - d->start_ns, d->interval_ns, tolerance_ns);
    if (snapped >= d->time_ns)
        return snapped;
    return end_ns > d->time_ns ? end_ns : d->time_ns;
}

static enum status instance_step(struct instance *in, double point, double size)
{
    struct data *d = &in->data;
    int64_t point_ns, size_ns, said_ns;
    if (!to_ns(point, &point_ns) || !to_ns(size, &size_ns) || !to_ns(point + size, &said_ns))
        return report(in, ERROR, "doStep: the communication point and its step must be finite "
                      "and below %g s, got %g s and %g s", MAX_SECONDS, point, size);
    if (!(size > 0.0))
        return report(in, ERROR, "doStep: the step must be positive, got %g s", size);
    int64_t tolerance = size_ns / 1000;
    if (tolerance > TICK_TOLERANCE_NS)
        tolerance = TICK_TOLERANCE_NS;
    /* The previous step has ended at time_ns for us and at last_ns for the master, whose times are
     * no better than rounded. */
    const int64_t last_ns = d->time_ns - d->moved_ns;
    const int64_t first = d->moved_ns > 0 ? last_ns : d->time_ns;
    const int64_t latest = d->moved_ns > 0 ? d->time_ns : last_ns;
    const int64_t slack = tolerance + 1 + (int64_t)((point < 0 ? -point : point) * 1e9 * 0x1p-51);
    if (point_ns < first - slack || point_ns > latest + slack)
        return report(in, ERROR, "doStep: the communication point must be %.9f s, where the "
                      "previous step ended, got %.9f s", (double)last_ns / 1e9, point);
    const int64_t end_ns = step_end(d, said_ns, tolerance);
#if N_U > 0 && P_INTERVAL >= 0
    /* A tick strictly inside would use inputs that are out of date by then. */
    const int64_t next = ((d->time_ns - d->start_ns) / d->interval_ns + 1) * d->interval_ns
        + d->start_ns;
    if (next < end_ns)
        return report(in, DISCARD, "doStep: the step from %.9f s to %.9f s has a tick inside, at "
                      "%.9f s; it must end there", (double)d->time_ns / 1e9,
                      (double)end_ns / 1e9, (double)next / 1e9);
#endif
    if (!engine_step(&d->block, d->variant, d->start_ns, d->interval_ns, d->time_ns, end_ns)) {
        d->mode = FAILED;
        return report(in, ERROR, "doStep: no end was found in %d rounds", MAX_ROUNDS);
    }
    /* Of a step that has led nowhere the end may lie before that of the one before it. */
    if (said_ns < last_ns && end_ns == d->time_ns)
        said_ns = last_ns;
    d->moved_ns = (int32_t)(end_ns - said_ns);
    d->time_ns = end_ns;
    d->stale = 0;
    const enum status status = instance_check_finite(in);
    if (status != OK)
        d->mode = FAILED;
    return status;
}

/* ---- derivatives ---- */

/* sensitivity = (d unknowns / d knowns) seed, for outputs and inputs with direct feedthrough. */
static enum status instance_derivative(struct instance *in, const char *function,
                                       const unsigned unknowns[], size_t n_unknowns,
                                       const unsigned knowns[], size_t n_knowns,
                                       const double seed[], size_t n_seed, double sensitivity[],
                                       size_t n_sensitivity)
{
#if HAS_JACOBIAN
    enum status status = require(in, INITIALIZATION | STEP | TERMINATED, function);
    if (status == OK)
        status = check_access(in, function, FLOAT64, unknowns, n_unknowns, sensitivity,
                              n_sensitivity);
    if (status == OK)
        status = check_access(in, function, FLOAT64, knowns, n_knowns, seed, n_seed);
    if (status == OK)
        status = instance_refresh(in);
    if (status != OK)
        return status;
    for (size_t i = 0; i < n_unknowns + n_knowns; i++) {
        const unsigned reference = i < n_unknowns ? unknowns[i] : knowns[i - n_unknowns];
        const enum causality wanted = i < n_unknowns ? OUTPUT : INPUT;
        const unsigned element = element_of(reference);
        if (element == N_VALUES || variables[owner[element]].causality != wanted)
            return report(in, ERROR, "%s: the variable with value reference %u is not an %s",
                          function, reference, wanted == INPUT ? "input" : "output");
    }
    struct data *d = &in->data;
    real jacobian[N_Y * N_U];
    model_jacobian(d->variant, engine_x(&d->block), engine_u(&d->block), engine_p(&d->block),
                   engine_seconds(d->time_ns), jacobian);
    size_t row = 0;
    for (size_t i = 0; i < n_unknowns; i++) {
        const unsigned output = element_of(unknowns[i]);
        for (unsigned y = output; y < output + extent(output); y++, row++) {
            size_t column = 0;
            double sum = 0.0;
            for (size_t j = 0; j < n_knowns; j++) {
                const unsigned input = element_of(knowns[j]);
                for (unsigned u = input; u < input + extent(input); u++, column++)
                    sum += jacobian[(y - N_P - N_U) * N_U + (u - N_P)] * seed[column];
            }
            if (!__builtin_isfinite(sum)) {
                char name[128];
                element_name(y, name, sizeof name);
                return report(in, DISCARD, "%s: %s has no derivative here, got %g", function, name,
                              sum);
            }
            sensitivity[row] = sum;
        }
    }
    return OK;
#else
    (void)unknowns, (void)n_unknowns, (void)knowns, (void)n_knowns;
    (void)seed, (void)n_seed, (void)sensitivity, (void)n_sensitivity;
    return report(in, ERROR, "%s: no output depends directly on an input", function);
#endif
}

/* ---- snapshots ---- */

static void snapshot_take(const struct instance *in, struct snapshot *s)
{
    memset(s, 0, sizeof *s);
    s->magic = SNAPSHOT_MAGIC;
    s->version = SNAPSHOT_VERSION;
    s->size = sizeof *s;
    memcpy(s->token, MODEL_TOKEN, sizeof s->token);
    s->data = in->data;
}

static enum status snapshot_check(const struct instance *in, const struct snapshot *s)
{
    if (s->magic != SNAPSHOT_MAGIC || s->version != SNAPSHOT_VERSION || s->size != sizeof *s
        || memcmp(s->token, MODEL_TOKEN, sizeof s->token) != 0)
        return report(in, ERROR, "the state is not one of this FMU");
    return OK;
}

/* A new snapshot, or an old one overwritten. */
static enum status snapshot_get(const struct instance *in, void **state)
{
    struct snapshot *s = *state ? *state : malloc(sizeof *s);
    if (!s)
        return report(in, ERROR, "no memory for the state");
    snapshot_take(in, s);
    *state = s;
    return OK;
}

static enum status snapshot_set(struct instance *in, const void *state)
{
    const enum status status = snapshot_check(in, state);
    if (status == OK)
        in->data = ((const struct snapshot *)state)->data;
    return status;
}

/* FNV-1a over all other bytes. */
static uint64_t snapshot_checksum(const struct snapshot *s)
{
    struct snapshot copy;
    unsigned char bytes[sizeof copy];
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    memcpy(&copy, s, sizeof copy);
    copy.checksum = 0;
    memcpy(bytes, &copy, sizeof copy);
    for (size_t i = 0; i < sizeof copy; i++)
        hash = (hash ^ bytes[i]) * UINT64_C(0x100000001b3);
    return hash;
}

static enum status snapshot_serialize(const struct instance *in, const void *state,
                                      unsigned char *bytes, size_t size)
{
    struct snapshot outgoing;
    const enum status status = snapshot_check(in, state);
    if (status != OK)
        return status;
    if (size < sizeof(struct snapshot))
        return report(in, ERROR, "the serialized state takes %zu bytes, got room for %zu",
                      sizeof(struct snapshot), size);
    memcpy(&outgoing, state, sizeof outgoing);
    outgoing.checksum = snapshot_checksum(&outgoing);
    memcpy(bytes, &outgoing, sizeof outgoing);
    return OK;
}

static enum status snapshot_deserialize(const struct instance *in, const unsigned char *bytes,
                                        size_t size, void **state)
{
    struct snapshot incoming;
    if (size != sizeof incoming)
        return report(in, ERROR, "the serialized state must have %zu bytes, got %zu",
                      sizeof incoming, size);
    memcpy(&incoming, bytes, sizeof incoming);
    const enum status status = snapshot_check(in, &incoming);
    if (status != OK)
        return status;
    if (incoming.checksum != snapshot_checksum(&incoming))
        return report(in, ERROR, "the serialized state is damaged");
    incoming.checksum = 0;
    struct snapshot *s = *state ? *state : malloc(sizeof *s);
    if (!s)
        return report(in, ERROR, "no memory for the state");
    memcpy(s, &incoming, sizeof *s);
    *state = s;
    return OK;
}

#endif
