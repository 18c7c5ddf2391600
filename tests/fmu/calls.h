/* What every FMU must withstand, whatever the version of the standard.
 *
 * calls2.c and calls3.c include the sources of an FMU, so the tests know its tables and its
 * memory, then define the functions below, which speak to the FMU through the standard alone. */
#ifndef CALLS_H
#define CALLS_H

#include <stdbool.h>

#define NAME "probe"
#define COUNT(array) (sizeof(array) / sizeof *(array))

static void *open_instance(const char *name, const char *token);
static void close_instance(void *c);
static int enter(void *c, double start);
static int leave(void *c);
static int terminate(void *c);
static int reset(void *c);
static int get(void *c, enum type type, const unsigned vr[], size_t n, void *values, size_t room);
static int set(void *c, enum type type, const unsigned vr[], size_t n, const void *values,
               size_t room);
static int step(void *c, double time, double size, double *last);
static int state_get(void *c, void **state);
static int state_set(void *c, void *state);
static int state_free(void *c, void **state);
static int state_size(void *c, void *state, size_t *size);
static int state_serialize(void *c, void *state, unsigned char *bytes, size_t size);
static int state_deserialize(void *c, const unsigned char *bytes, size_t size, void **state);
static int derivative(void *c, const unsigned unknowns[], size_t n_unknowns,
                      const unsigned knowns[], size_t n_knowns, const double seed[], size_t n_seed,
                      double sensitivity[], size_t n_sensitivity);

/* ---- messages and checks ---- */

static char message[1024];
static int message_status = -1;

static void remember(int status, const char *text)
{
    snprintf(message, sizeof message, "%s", text);
    message_status = status;
}

static void forget(void)
{
    message[0] = 0;
    message_status = -1;
}

#define CHECK(condition)                                                                          \
    do {                                                                                          \
        if (!(condition)) {                                                                       \
            fprintf(stderr, "%s:%d: %s does not hold; last message: [%d] %s\n", __FILE__,         \
                    __LINE__, #condition, message_status, message);                               \
            exit(1);                                                                              \
        }                                                                                         \
    } while (0)

/* The call must be refused with this status and a message with all these parts. */
#define REFUSED(status, call, ...)                                                                \
    do {                                                                                          \
        forget();                                                                                 \
        CHECK((call) == (status));                                                                \
        CHECK(message_status == (status));                                                        \
        const char *const parts[] = {__VA_ARGS__};                                                \
        for (size_t part = 0; part < COUNT(parts); part++)                                        \
            if (!strstr(message, parts[part])) {                                                  \
                fprintf(stderr, "%s:%d: '%s' is missing in: %s\n", __FILE__, __LINE__,            \
                        parts[part], message);                                                    \
                exit(1);                                                                          \
            }                                                                                     \
    } while (0)

static struct data *memory(void *c) { return &((struct instance *)c)->data; }

/* The call must be refused and leave the instance as it was. */
#define REFUSED_UNCHANGED(c, status, call, ...)                                                   \
    do {                                                                                          \
        const struct data before = *memory(c);                                                    \
        REFUSED(status, call, __VA_ARGS__);                                                       \
        CHECK(memcmp(&before, memory(c), sizeof before) == 0);                                    \
    } while (0)

/* ---- random numbers ---- */

static uint64_t random_state;

static uint64_t random_bits(void) /* splitmix64 */
{
    uint64_t z = (random_state += UINT64_C(0x9e3779b97f4a7c15));
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

static unsigned below(unsigned n) { return (unsigned)(random_bits() % n); }
static double unit(void) { return (double)(random_bits() >> 11) * 0x1p-53; }

/* ---- instances and values ---- */

static void *in_mode(int32_t mode)
{
    void *c = open_instance(NAME, MODEL_TOKEN);
    CHECK(c);
    if (mode != INSTANTIATED) {
        CHECK(enter(c, 0.0) == OK);
        if (mode != INITIALIZATION)
            CHECK(leave(c) == OK);
    }
    if (mode == TERMINATED)
        CHECK(terminate(c) == OK);
    if (mode == FAILED) /* how an instance comes to fail is another matter */
        memory(c)->mode = FAILED;
    CHECK(memory(c)->mode == mode);
    forget();
    return c;
}

static const int32_t all_modes[] = {INSTANTIATED, INITIALIZATION, STEP, TERMINATED, FAILED};

/* A buffer of any of the three types. */
union cell {
    double float64[N_VALUES];
    int32_t int32[N_VALUES];
    boolean boolean_[N_VALUES];
};

static void put(union cell *cell, enum type type, size_t i, double value)
{
    switch (type) {
    case FLOAT64: cell->float64[i] = value; break;
    case INT32: cell->int32[i] = (int32_t)value; break;
    case BOOLEAN: cell->boolean_[i] = value != 0.0; break;
    }
}

static const struct variable *variable_of(unsigned element) { return &variables[owner[element]]; }
static unsigned first_element(const struct variable *v) { return v->reference - FIRST_REFERENCE; }

/* Set one element; with arrays the others get their start values. */
static int set_element(void *c, unsigned element, double value)
{
    static union cell cell;
    const struct variable *v = variable_of(element);
    const unsigned first = first_element(v);
    if (!ARRAYS) {
        put(&cell, v->type, 0, value);
        return set(c, v->type, (unsigned[]){element + FIRST_REFERENCE}, 1, &cell, 1);
    }
    for (unsigned i = 0; i < v->size; i++)
        put(&cell, v->type, i,
            first + i == element ? value
            : first + i < N_P + N_U ? start_values[first + i] : 0.0);
    return set(c, v->type, &v->reference, 1, &cell, v->size);
}

static double hash(unsigned a, unsigned b)
{
    return (double)((a * 2654435761u ^ b * 2246822519u) >> 8) * 0x1p-24;
}

/* Inputs that any component can do something with: tick k of instance number n. */
static void feed(void *c, unsigned n, unsigned k)
{
    for (unsigned e = N_P; e < N_P + N_U; e++) {
        const struct variable *v = variable_of(e);
        double value = 6.0 * hash(e, n) - 3.0 + 0.01 * k;
        if (strstr(v->name, "epoch"))
            value = 0.1 * k;
        else if (v->type == INT32)
            value = k;
        else if (strcmp(v->name, "range") == 0)
            value = 10.0 + hash(e, k);
        if (!ARRAYS || e == first_element(v)) {
            if (ARRAYS) {
                static union cell cell;
                for (unsigned i = 0; i < v->size; i++)
                    put(&cell, v->type, i, value + (v->type == FLOAT64 ? hash(e + i, n) : 0.0));
                CHECK(set(c, v->type, &v->reference, 1, &cell, v->size) == OK);
            } else
                CHECK(set_element(c, e, value) == OK);
        }
    }
}

static unsigned element_named(const char *name)
{
    for (unsigned e = 0; e < N_VALUES; e++)
        if (strcmp(variable_of(e)->name, name) == 0)
            return e;
    return N_VALUES;
}

static void begin(void *c, unsigned n)
{
    if (element_named("seed") < N_VALUES)
        CHECK(set_element(c, element_named("seed"), n) == OK);
    CHECK(enter(c, 0.0) == OK);
    CHECK(leave(c) == OK);
}

static void advance(void *c, unsigned n, unsigned k)
{
    double last;
    feed(c, n, k);
    CHECK(step(c, 0.1 * k, 0.1, &last) == OK);
}

static unsigned first_with(enum causality causality, enum type type)
{
    for (unsigned e = 0; e < N_VALUES; e++)
        if (variable_of(e)->causality == causality && variable_of(e)->type == type)
            return e;
    return N_VALUES;
}

/* A variable of type Float64 that is read and set in the tests. */
static unsigned settable(void)
{
    const unsigned e = first_with(PARAMETER, FLOAT64);
    return e < N_VALUES ? e : first_with(INPUT, FLOAT64);
}

/* ---- the tests ---- */

static void test_values(void)
{
    void *c = in_mode(INSTANTIATED);
    static union cell cell;
    char name[128], number[32];
    for (unsigned e = 0; e < N_VALUES; e++) {
        const struct variable *v = variable_of(e);
        element_name(e, name, sizeof name);
        if (v->causality == OUTPUT) {
            REFUSED_UNCHANGED(c, ERROR, set_element(c, e, v->type == BOOLEAN ? 1.0 : 7.0), NAME,
                              ARRAYS ? v->name : name, "is an output and cannot be set");
            continue;
        }
        if (v->type == FLOAT64) {
            REFUSED_UNCHANGED(c, ERROR, set_element(c, e, NAN), NAME, name, "must be finite",
                              "nan");
            REFUSED_UNCHANGED(c, ERROR, set_element(c, e, INFINITY), NAME, name, "inf");
            REFUSED_UNCHANGED(c, ERROR, set_element(c, e, -INFINITY), NAME, name, "-inf");
        }
        if (v->causality == PARAMETER && v->type != BOOLEAN) {
            const double bounds[] = {v->min, v->max}, steps[] = {-1.0, 1.0};
            for (int i = 0; i < 2; i++)
                if (fabs(bounds[i]) < (v->type == INT32 ? (double)INT32_MAX : INFINITY)) {
                    const double outside = bounds[i] + steps[i] * (1.0 + fabs(bounds[i]) / 1e3);
                    const double value = v->type == INT32 ? bounds[i] + steps[i] : outside;
                    snprintf(number, sizeof number, "%.17g", value);
                    REFUSED_UNCHANGED(c, ERROR, set_element(c, e, value), NAME, name,
                                      "out of its range", number);
                    CHECK(set_element(c, e, bounds[i]) == OK);
                }
        }
        CHECK(set_element(c, e, start_values[e]) == OK);
    }
    /* Either all values are set or none. */
    const unsigned e = settable();
    const double start = memory(c)->block.v[e];
    const struct variable *v = variable_of(e);
    const unsigned twice[] = {v->reference, v->reference};
    const unsigned size = ARRAYS ? v->size : 1;
    for (unsigned i = 0; i < 2 * size; i++)
        cell.float64[i] = i < size ? start + 0.5 : NAN;
    REFUSED_UNCHANGED(c, ERROR, set(c, FLOAT64, twice, 2, &cell, 2 * size), NAME, v->name);
    for (unsigned i = 0; i < 2 * size; i++)
        cell.float64[i] = start + (i < size ? 0.25 : 0.5);
    CHECK(set(c, FLOAT64, twice, 2, &cell, 2 * size) == OK);
    CHECK(memory(c)->block.v[e] == start + 0.5);
    close_instance(c);

    /* Fixed parameters are fixed, and inputs are not. */
    c = in_mode(STEP);
    for (int i = 0; i < N_P; i++) {
        const unsigned p = (unsigned)i;
        REFUSED_UNCHANGED(c, ERROR, set_element(c, p, start_values[p]), NAME,
                          variable_of(p)->name, "cannot be set after initialization");
    }
    for (unsigned u = N_P; u < N_P + N_U; u++)
        CHECK(set_element(c, u, start_values[u]) == OK);
    close_instance(c);
}

#if !ARRAYS
/* Why an element cannot be set in this mode as one of this type, or NULL. */
static const char *obstacle(int32_t mode, enum type type, unsigned element)
{
    const struct variable *v = variable_of(element);
    if (v->type != type)
        return "of type";
    if (v->causality == OUTPUT)
        return "is an output and cannot be set";
    return v->causality == PARAMETER && mode == STEP ? "after initialization" : NULL;
}

/* Scalars that follow each other are set at once, but not beyond the end of their kind. */
static void test_neighbours(int32_t mode)
{
    static union cell cell, read;
    static unsigned vr[N_VALUES];
    void *c = in_mode(mode);
    char name[128];
    for (unsigned first = 0; first < N_VALUES; first++) {
        const enum type type = variable_of(first)->type;
        /* A few more, up to the end of its kind and over it, or everything. */
        const unsigned rest = N_VALUES - first, over = alike[first] + 1u;
        const unsigned sizes[] = {2, over - 1, over, over + 1, rest};
        for (size_t i = 0; i < COUNT(sizes); i++) {
            const unsigned n = sizes[i];
            unsigned bad = N_VALUES, other = N_VALUES;
            if (n > rest)
                continue;
            for (unsigned j = n; j-- > 0;) {
                const unsigned e = first + j;
                vr[j] = e + FIRST_REFERENCE;
                put(&cell, type, j, e < N_P + N_U ? start_values[e] : 7.0);
                if (variable_of(e)->type != type)
                    other = e;
                if (obstacle(mode, type, e))
                    bad = e;
            }
            if (other < N_VALUES) /* types are checked before values */
                bad = other;
            if (bad == N_VALUES) {
                CHECK(set(c, type, vr, n, &cell, n) == OK);
            } else {
                element_name(bad, name, sizeof name);
                REFUSED_UNCHANGED(c, ERROR, set(c, type, vr, n, &cell, n), NAME,
                                  other < N_VALUES ? variable_of(bad)->name : name,
                                  obstacle(mode, type, bad));
            }
            if (other == N_VALUES) {
                CHECK(get(c, type, vr, n, &read, n) == OK);
                for (unsigned j = 0; j < n; j++)
                    CHECK(value_at(&read, type, j) == memory(c)->block.v[first + j]);
            } else
                REFUSED(ERROR, get(c, type, vr, n, &read, n), NAME, variable_of(other)->name);
        }
    }
    close_instance(c);
}
#endif

static void test_references(void)
{
    const unsigned unknown[] = {N_VALUES + FIRST_REFERENCE, 0x7fffffffu, 0xffffffffu};
    static union cell cell;
    char number[32];
    void *c = in_mode(INITIALIZATION);
    for (enum type type = FLOAT64; type <= BOOLEAN; type++) {
        for (size_t i = 0; i < COUNT(unknown); i++) {
            snprintf(number, sizeof number, "%u", unknown[i]);
            REFUSED_UNCHANGED(c, ERROR, get(c, type, &unknown[i], 1, &cell, 1), NAME, number);
            REFUSED_UNCHANGED(c, ERROR, set(c, type, &unknown[i], 1, &cell, 1), NAME, number);
        }
        for (unsigned i = 0; i < N_VARIABLES; i++) {
            const struct variable *v = &variables[i];
            const size_t size = ARRAYS ? v->size : 1;
            if (v->type == type) {
                CHECK(get(c, type, &v->reference, 1, &cell, size) == OK);
                continue;
            }
            REFUSED(ERROR, get(c, type, &v->reference, 1, &cell, size), NAME, v->name, "of type");
            REFUSED_UNCHANGED(c, ERROR, set(c, type, &v->reference, 1, &cell, size), NAME, v->name);
        }
        CHECK(get(c, type, NULL, 0, NULL, 0) == OK);
        CHECK(set(c, type, NULL, 0, NULL, 0) == OK);
        CHECK(get(c, type, unknown, 0, &cell, 0) == OK);
        REFUSED(ERROR, get(c, type, NULL, 1, &cell, 1), NAME, "null");
        REFUSED(ERROR, get(c, type, unknown, 1, NULL, 1), NAME, "null");
        REFUSED(ERROR, set(c, type, NULL, 1, &cell, 1), NAME, "null");
        REFUSED(ERROR, set(c, type, unknown, 1, NULL, 1), NAME, "null");
    }
    close_instance(c);
}

static void test_steps(void)
{
    const double nonsense[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300, 5e9};
    double last;
    void *c = in_mode(STEP);
    for (size_t i = 0; i < COUNT(nonsense); i++) {
        REFUSED_UNCHANGED(c, ERROR, step(c, 0.0, nonsense[i], &last), NAME);
        REFUSED_UNCHANGED(c, ERROR, step(c, nonsense[i], 0.1, &last), NAME);
    }
    REFUSED_UNCHANGED(c, ERROR, step(c, 0.0, 0.0, &last), NAME, "step", "got 0 s");
    REFUSED_UNCHANGED(c, ERROR, step(c, 0.0, -0.1, &last), NAME, "got -0.1 s");
    REFUSED_UNCHANGED(c, ERROR, step(c, 0.0, -1e-12, &last), NAME, "step", "got -1e-12 s");
    REFUSED_UNCHANGED(c, ERROR, step(c, 0.0, -5e-324, &last), NAME, "step");
    REFUSED_UNCHANGED(c, ERROR, step(c, 0.1, 0.1, &last), NAME, "0.000000000", "0.100000000");
    CHECK(last == 0.0);
    feed(c, 1, 0);
    CHECK(step(c, 0.0, 0.1, &last) == OK);
    CHECK(last == 0.1);
    REFUSED_UNCHANGED(c, ERROR, step(c, 0.0, 0.1, &last), NAME, "communication point");
    CHECK(last == 0.1);
#if P_INTERVAL >= 0 && N_U > 0
    /* A tick strictly inside the step, with the interval of 0.1 s. */
    REFUSED_UNCHANGED(c, DISCARD, step(c, 0.1, 0.25, &last), NAME, "tick inside", "0.2");
    CHECK(last == 0.1);
    CHECK(step(c, 0.1, 0.05, &last) == OK);
    REFUSED_UNCHANGED(c, DISCARD, step(c, 0.15, 0.1, &last), NAME, "0.150000000", "0.2");
    CHECK(last == 0.15);
    CHECK(step(c, 0.15, 0.05, &last) == OK);
#else
    CHECK(step(c, 0.1, 0.25, &last) == OK);
    CHECK(last == 0.35);
#endif
    close_instance(c);

    for (size_t i = 0; i < COUNT(nonsense); i++) {
        c = in_mode(INSTANTIATED);
        REFUSED_UNCHANGED(c, ERROR, enter(c, nonsense[i]), NAME, "start time");
        close_instance(c);
    }
    /* The earliest and the latest times are as far apart as any. */
    c = in_mode(INSTANTIATED);
    CHECK(enter(c, -3.9e9) == OK && leave(c) == OK);
    REFUSED(ERROR, step(c, 3.9e9, 0.1, &last), NAME);
    REFUSED(ERROR, step(c, 3.9e9, 3.9e9, &last), NAME);
#if P_INTERVAL >= 0 && N_U > 0
    REFUSED(DISCARD, step(c, -3.9e9, 3.9e9, &last), NAME, "tick inside");
    REFUSED(ERROR, step(c, -3.9e9, 7.8e9, &last), NAME);
#endif
    close_instance(c);

#if P_INTERVAL >= 0
    c = in_mode(INSTANTIATED);
    CHECK(set_element(c, P_INTERVAL, 0.1 + 2e-10) == OK);
    CHECK(enter(c, 0.0) == OK);
    REFUSED(ERROR, leave(c), NAME, variable_of(P_INTERVAL)->name, "whole number of nanoseconds",
            "0.1000000002");
    CHECK(memory(c)->mode == INITIALIZATION);
    CHECK(set_element(c, P_INTERVAL, 0.25) == OK);
    CHECK(leave(c) == OK);
    close_instance(c);
#endif
}

/* Outputs must be the same bits, and a state the same but for how the master's time was rounded. */
static void check_same(void *c, void *other)
{
    struct data a = *memory(c), b = *memory(other);
    a.moved_ns = b.moved_ns = 0;
    CHECK(memcmp(&a, &b, sizeof a) == 0);
}

/* A step size of any order of magnitude, from far below a nanosecond. */
static double any_size(void)
{
    static const double sizes[] = {1e-3, 1e-5, 1e-7, 5e-9, 1.5e-9, 1e-9, 4e-10, 1e-10, 1e-12, 1e-15};
    return (0.1 + unit()) * sizes[below(COUNT(sizes))];
}

/* A walk of steps of any size, from tick to tick, among them many too short to hold a nanosecond;
 * at every tick it must be where steps of 0.1 s lead. */
static void test_short_steps(unsigned ticks)
{
    void *c = in_mode(INSTANTIATED), *regular = in_mode(INSTANTIATED);
    double last, time = 0.0;
    begin(c, 9);
    begin(regular, 9);
    for (unsigned k = 0; k < ticks; k++) {
        const double tick = 0.1 * (k + 1);
        feed(c, 9, k);
        feed(regular, 9, k);
        for (unsigned n = below(40); n > 0; n--) {
            double size = any_size();
            if (time + size > tick - 2e-9) /* the tick is a communication point, nearly */
                break;
            CHECK(step(c, time, size, &last) == OK);
            time += size;
        }
        const double off = (unit() - 0.5) * 0.9e-9;
        CHECK(step(c, time, tick + off - time, &last) == OK);
        CHECK(fabs(last - tick) < 1e-12);
        time = tick + off;
        advance(regular, 9, k);
        check_same(c, regular);
        while (below(4)) { /* rounds to the tick: nothing happens yet */
            const double size = unit() * (tick + 0.45e-9 - time);
            if (!(size > 0.0))
                break;
            CHECK(step(c, time, size, &last) == OK);
            time += size;
            check_same(c, regular);
        }
    }
    close_instance(c);
    close_instance(regular);
}

/* Masters end a run with what is left of it; then they may go on. */
static void test_remainders(void)
{
    static const double rests[] = {1.5e-10, 1e-12, 1e-15, 1e-300, 5e-324};
    double last;
    for (size_t i = 0; i < COUNT(rests); i++) {
        void *c = in_mode(INSTANTIATED), *regular = in_mode(INSTANTIATED);
        begin(c, 2);
        begin(regular, 2);
        CHECK(step(c, 0.0, rests[i], &last) == OK && last == 0.0);
        for (unsigned k = 0; k < 8; k++) {
            advance(c, 2, k);
            advance(regular, 2, k);
            const struct data before = *memory(c);
            const double now = 0.1 * (k + 1);
            for (int n = 0; n < 3; n++)
                CHECK(step(c, now + n * rests[i], rests[i], &last) == OK);
            CHECK(memcmp(&before, memory(c), sizeof before) == 0);
            CHECK(last == (double)before.time_ns / 1e9);
            REFUSED_UNCHANGED(c, ERROR, step(c, now, -rests[i], &last), NAME, "positive");
        }
        check_same(c, regular);
        close_instance(c);
        close_instance(regular);
    }
}

/* A master's next communication point may round otherwise than its last step's end. */
static void test_rounded_times(void)
{
    double last;
    void *c = in_mode(STEP);
    CHECK(step(c, 0.0, 0.5000001e-9, &last) == OK && last == 1e-9);
    CHECK(step(c, 0.4999999e-9, 1e-12, &last) == OK && last == 1e-9);
    CHECK(step(c, 0.4999999e-9, 1e-3, &last) == OK && last == 1e-3);
    REFUSED_UNCHANGED(c, ERROR, step(c, 1e-3 - 3e-9, 1e-6, &last), NAME, "0.001000000");
    REFUSED_UNCHANGED(c, ERROR, step(c, 1e-3 + 3e-9, 1e-6, &last), NAME, "0.001000000");
    for (int i = 0; i < 100; i++) /* back by less than is noticed, again and again */
        CHECK(step(c, 1e-3 - 1e-9, 1e-12, &last) == OK && last == 1e-3);
    REFUSED_UNCHANGED(c, ERROR, step(c, 1e-3 - 3e-9, 1e-6, &last), NAME, "0.001000000");
    close_instance(c);
    c = in_mode(INSTANTIATED); /* doubles are 477 ns apart here */
    CHECK(enter(c, 3e9) == OK && leave(c) == OK);
    for (int i = 0; i < 1000; i++)
        CHECK(step(c, 3e9 + i * 1e-8, 1e-8, &last) == OK);
    CHECK(fabs(last - 3e9) < 1.1e-5);
    close_instance(c);
}

#if P_INTERVAL >= 0
/* Short steps over a tick onto which the tolerance of a long step has moved their beginning. */
static void test_one_tick(void)
{
    double last;
    for (int late = 0; late < 2; late++)
        for (unsigned n = 0; n < 200; n++) {
            void *c = in_mode(INSTANTIATED), *regular = in_mode(INSTANTIATED);
            begin(c, 4);
            begin(regular, 4);
            advance(c, 4, 0);
            advance(regular, 4, 0);
            feed(c, 4, 1);
            double time = 0.2 + (late ? 9e-7 : -9e-7) * unit();
            CHECK(step(c, 0.1, time - 0.1, &last) == OK && last == 0.2);
            advance(regular, 4, 1);
            check_same(c, regular);
            feed(c, 4, 2);
            feed(regular, 4, 2);
            while (time < 0.2 + 2e-6) { /* short steps over the tick */
                const double size = (0.01 + unit()) * (below(2) ? 1e-7 : 1e-9);
                CHECK(step(c, time, size, &last) == OK);
                time += size;
                CHECK(last == 0.2 || fabs(last - time) < 1e-9);
            }
            CHECK(step(c, time, 0.3 - time, &last) == OK && last == 0.3);
            CHECK(step(regular, 0.2, 0.1, &last) == OK);
            check_same(c, regular);
            close_instance(c);
            close_instance(regular);
        }
}
#endif

#if P_INTERVAL >= 0 && N_U > 0
/* What is not within the tolerance is no tick, and a step over one is refused. */
static void test_tick_tolerance(void)
{
    double last;
    static const struct { double size, off; int same; } cases[] = {
        {0.1, 0.9e-6, 1}, {0.1, -0.9e-6, 1}, {0.1, 1.1e-6, 0}, {0.1, -1.1e-6, 0},
        {1e-4, 0.9e-7, 1}, {1e-4, -0.9e-7, 1}, {1e-4, 1.1e-7, 0}, {1e-4, -1.1e-7, 0},
        {1e-7, 0.4e-9, 1}, {1e-7, -0.4e-9, 1}, {1e-7, 0.6e-9, 0}, {1e-7, -0.6e-9, 0},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        void *c = in_mode(STEP);
        const double end = 0.1 + cases[i].off, begun = end - cases[i].size;
        double time = 0.0;
        while (time < begun) { /* no step so long that it would end on the tick */
            const double way = 0.9 * (0.1 - time), rest = begun - time;
            const double size = way < rest ? way : rest;
            CHECK(step(c, time, size, &last) == OK && last < 0.1);
            time = size < rest ? time + size : begun;
        }
        const int status = step(c, time, end - time, &last);
        CHECK(status == (cases[i].same || cases[i].off < 0 ? OK : DISCARD));
        if (status == OK)
            CHECK((last == 0.1) == cases[i].same);
        close_instance(c);
    }
}
#endif

static void test_states(void)
{
    const struct data *mine;
    void *c = in_mode(INSTANTIATED), *other = in_mode(INSTANTIATED);
    void *state = NULL, *second = NULL, *nothing = NULL;
    size_t size = 0;
    begin(c, 5);
    for (unsigned k = 0; k < 10; k++)
        advance(c, 5, k);
    CHECK(state_get(c, &state) == OK && state);
    CHECK(state_size(c, state, &size) == OK && size > sizeof(struct data));
    for (unsigned k = 10; k < 20; k++)
        advance(c, 5, k);
    mine = memory(c);
    const struct data end = *mine;

    /* Back and again. */
    CHECK(state_set(c, state) == OK);
    CHECK(memcmp(mine, &end, sizeof end) != 0);
    for (unsigned k = 10; k < 20; k++)
        advance(c, 5, k);
    CHECK(memcmp(mine, &end, sizeof end) == 0);

    /* Through bytes into an instance that knows nothing. */
    unsigned char *bytes = malloc(size + 8), *again = malloc(size);
    CHECK(bytes && again);
    REFUSED(ERROR, state_serialize(c, state, bytes, size - 1), NAME);
    CHECK(state_serialize(c, state, bytes, size) == OK);
    CHECK(state_deserialize(other, bytes, size, &second) == OK);
    CHECK(state_set(other, second) == OK);
    for (unsigned k = 10; k < 20; k++)
        advance(other, 5, k);
    CHECK(memcmp(memory(other), &end, sizeof end) == 0);
    CHECK(state_serialize(other, second, again, size) == OK);
    CHECK(memcmp(bytes, again, size) == 0);

    /* A state that is there already is overwritten. */
    void *const same = second;
    CHECK(state_get(other, &second) == OK && second == same);
    CHECK(state_deserialize(other, bytes, size, &second) == OK && second == same);

    /* Bytes that are not a state of this FMU. */
    REFUSED(ERROR, state_deserialize(c, bytes, size - 1, &nothing), NAME, "bytes");
    REFUSED(ERROR, state_deserialize(c, bytes, size + 8, &nothing), NAME, "bytes");
    REFUSED(ERROR, state_deserialize(c, bytes, 0, &nothing), NAME, "bytes");
    for (size_t i = 0; i < size; i++) {
        bytes[i] ^= (unsigned char)(1u << (i % 8));
        REFUSED(ERROR, state_deserialize(c, bytes, size, &nothing), NAME, "state");
        CHECK(!nothing);
        bytes[i] ^= (unsigned char)(1u << (i % 8));
    }
    for (size_t i = 0; i < size; i++)
        again[i] = (unsigned char)random_bits();
    REFUSED(ERROR, state_deserialize(c, again, size, &nothing), NAME, "not one of this FMU");
    memset(again, 0, size);
    REFUSED_UNCHANGED(c, ERROR, state_set(c, again), NAME, "not one of this FMU");
    REFUSED(ERROR, state_serialize(c, again, bytes, size), NAME, "not one of this FMU");

    /* Nothing where something must be. */
    REFUSED(ERROR, state_get(c, NULL), NAME, "null");
    REFUSED(ERROR, state_set(c, NULL), NAME, "null");
    REFUSED(ERROR, state_size(c, NULL, &size), NAME, "null");
    REFUSED(ERROR, state_size(c, state, NULL), NAME, "null");
    REFUSED(ERROR, state_serialize(c, NULL, bytes, size), NAME, "null");
    REFUSED(ERROR, state_serialize(c, state, NULL, size), NAME, "null");
    REFUSED(ERROR, state_deserialize(c, NULL, size, &nothing), NAME, "null");
    REFUSED(ERROR, state_deserialize(c, bytes, size, NULL), NAME, "null");

    CHECK(state_free(c, NULL) == OK);
    CHECK(state_free(c, &nothing) == OK);
    CHECK(state_free(c, &state) == OK && !state);
    CHECK(state_free(c, &state) == OK);
    CHECK(state_free(c, &second) == OK);
    close_instance(c);
    close_instance(other);

    /* A state holds the mode too. */
    for (size_t i = 0; i < COUNT(all_modes); i++) {
        c = in_mode(all_modes[i]);
        other = in_mode(STEP);
        CHECK(state_get(c, &state) == OK);
        CHECK(state_set(other, state) == OK);
        CHECK(memory(other)->mode == all_modes[i]);
        CHECK(state_free(other, &state) == OK);
        close_instance(c);
        close_instance(other);
    }
    free(bytes);
    free(again);
}

static void test_life_cycles(void)
{
    static double y[N_Y];
    void *c = open_instance(NAME, MODEL_TOKEN);
    for (int life = 0; life < 3; life++) {
        begin(c, 3);
        for (unsigned k = 0; k < 12; k++)
            advance(c, 3, k);
        if (life == 0)
            memcpy(y, memory(c)->block.v + N_P + N_U, sizeof y);
        CHECK(memcmp(y, memory(c)->block.v + N_P + N_U, sizeof y) == 0);
        if (life != 1)
            CHECK(terminate(c) == OK);
        CHECK(reset(c) == OK);
        CHECK(memory(c)->mode == INSTANTIATED);
    }
    for (size_t i = 0; i < COUNT(all_modes); i++) { /* free and reset in every mode */
        close_instance(in_mode(all_modes[i]));
        void *d = in_mode(all_modes[i]);
        CHECK(reset(d) == OK);
        CHECK(memcmp(memory(c), memory(d), sizeof(struct data)) == 0);
        close_instance(d);
    }
    close_instance(c);
    close_instance(NULL);
}

static void test_many_instances(void)
{
    enum { MANY = 24, LENGTH = 16 };
    void *c[MANY];
    static double interleaved[MANY][N_Y];
    for (unsigned n = 0; n < MANY; n++) {
        c[n] = open_instance(NAME, MODEL_TOKEN);
        begin(c[n], n);
    }
    for (unsigned k = 0; k < LENGTH; k++)
        for (unsigned n = 0; n < MANY; n++)
            advance(c[(n * 7 + k) % MANY], (n * 7 + k) % MANY, k);
    for (unsigned n = 0; n < MANY; n++) {
        memcpy(interleaved[n], memory(c[n])->block.v + N_P + N_U, sizeof interleaved[n]);
        close_instance(c[n]);
    }
    for (unsigned n = 0; n < MANY; n++) {
        void *alone = open_instance(NAME, MODEL_TOKEN);
        begin(alone, n);
        for (unsigned k = 0; k < LENGTH; k++)
            advance(alone, n, k);
        CHECK(memcmp(interleaved[n], memory(alone)->block.v + N_P + N_U, sizeof *interleaved)
              == 0);
        close_instance(alone);
    }
}

/* Inputs so large that the results are not finite any more. */
static void test_failure(void)
{
#if N_U > 0
    double last;
    int failed = 0;
    void *c = in_mode(INSTANTIATED);
    begin(c, 1);
    for (unsigned k = 0; k < 12 && !failed; k++) {
        feed(c, 1, k);
        for (unsigned e = N_P; e < N_P + N_U; e++)
            if (variable_of(e)->type == FLOAT64 && !strstr(variable_of(e)->name, "epoch"))
                CHECK(set_element(c, e, (e % 2 ? 1e200 : -1e200)) == OK);
        forget();
        const int status = step(c, 0.1 * k, 0.1, &last);
        CHECK(status == OK || status == ERROR);
        failed = status == ERROR;
    }
    if (strcmp(MODEL_NAME, "Acoustics") == 0 || strcmp(MODEL_NAME, "RangeModel") == 0)
        CHECK(failed);
    if (failed) {
        CHECK(strstr(message, NAME) && strstr(message, "became") && strstr(message, " s"));
        CHECK(memory(c)->mode == FAILED);
        REFUSED(ERROR, step(c, last, 0.1, &last), NAME, "failed");
        CHECK(reset(c) == OK);
        begin(c, 1);
        advance(c, 1, 0);
    }
    close_instance(c);
#endif
}

static void test_derivatives(void)
{
    double seed[N_VALUES + 1] = {0}, result[N_VALUES + 1];
    void *c = in_mode(STEP);
    const unsigned y = N_P + N_U + FIRST_REFERENCE, u = N_P + FIRST_REFERENCE;
    const size_t ny = ARRAYS ? variable_of(N_P + N_U)->size : 1;
#if HAS_JACOBIAN
    const size_t nu = ARRAYS ? variable_of(N_P)->size : 1;
    const unsigned unknown = N_VALUES + FIRST_REFERENCE, zero = 0;
    seed[0] = 1.0;
    CHECK(derivative(c, &y, 1, &u, 1, seed, nu, result, ny) == OK);
    CHECK(derivative(c, &y, 0, &u, 0, seed, 0, result, 0) == OK);
    CHECK(derivative(c, &y, 1, &u, 0, seed, 0, result, ny) == OK && result[0] == 0.0);
    REFUSED(ERROR, derivative(c, &u, 1, &u, 1, seed, nu, result, nu), NAME, "not an output");
    REFUSED(ERROR, derivative(c, &y, 1, &y, 1, seed, ny, result, ny), NAME, "not an input");
    REFUSED(ERROR, derivative(c, &unknown, 1, &u, 1, seed, nu, result, 1), NAME);
    REFUSED(ERROR, derivative(c, &zero, 1, &u, 1, seed, nu, result, 1), NAME, " 0");
    REFUSED(ERROR, derivative(c, &y, 1, &zero, 1, seed, 1, result, ny), NAME, " 0");
    REFUSED(ERROR, derivative(c, NULL, 1, &u, 1, seed, nu, result, ny), NAME, "null");
    REFUSED(ERROR, derivative(c, &y, 1, NULL, 1, seed, nu, result, ny), NAME, "null");
    REFUSED(ERROR, derivative(c, &y, 1, &u, 1, NULL, nu, result, ny), NAME, "null");
    REFUSED(ERROR, derivative(c, &y, 1, &u, 1, seed, nu, NULL, ny), NAME, "null");
    /* What follows directly from an input is checked when it is read, every time. */
    static union cell cell;
    CHECK(set_element(c, N_P, 1e200) == OK);
    for (int i = 0; i < 2; i++)
        REFUSED(ERROR, get(c, FLOAT64, &y, 1, &cell, ny), NAME, "range[1] became inf");
    CHECK(set_element(c, N_P, 1.0) == OK);
    CHECK(get(c, FLOAT64, &y, 1, &cell, ny) == OK && isfinite(cell.float64[0]));
    /* At a beacon a range has no derivative. */
    for (unsigned e = N_P; e < N_P + N_U; e++)
        CHECK(set_element(c, e, 0.0) == OK);
    if (ARRAYS) {
        static union cell zeros;
        for (unsigned i = 0; i < N_VARIABLES; i++)
            if (variables[i].causality == INPUT)
                CHECK(set(c, FLOAT64, &variables[i].reference, 1, &zeros, variables[i].size)
                      == OK);
    }
    REFUSED(DISCARD, derivative(c, &y, 1, &u, 1, seed, nu, result, ny), NAME, "range[1]");
#else
    REFUSED(ERROR, derivative(c, &y, 1, &u, 1, seed, 1, result, ny), NAME, "no output depends");
#endif
    close_instance(c);
}

/* One function of the standard, called rightly; the modes in which it must succeed. */
struct call {
    const char *name;
    int (*call)(void *c);
    int modes;
};

static unsigned char *scratch_bytes;
static size_t scratch_size;
static void *scratch_state;

static void prepare_scratch(void)
{
    void *c = in_mode(INSTANTIATED);
    CHECK(state_get(c, &scratch_state) == OK);
    CHECK(state_size(c, scratch_state, &scratch_size) == OK);
    scratch_bytes = malloc(scratch_size);
    CHECK(state_serialize(c, scratch_state, scratch_bytes, scratch_size) == OK);
    close_instance(c);
}

static void drop_scratch(void)
{
    free(scratch_bytes);
    free(scratch_state);
}

static void test_every_function_in_every_mode(const struct call calls[], size_t n)
{
    for (size_t i = 0; i < n; i++) {
        CHECK(calls[i].call(NULL) == ERROR);
        for (size_t m = 0; m < COUNT(all_modes); m++) {
            void *c = in_mode(all_modes[m]);
            const int status = calls[i].call(c), expected = (calls[i].modes & all_modes[m]) != 0;
            if ((status == OK) != expected) {
                fprintf(stderr, "%s %s: status %d; last message: %s\n", calls[i].name,
                        mode_name(all_modes[m]), status, message);
                exit(1);
            }
            if (!expected) {
                CHECK(status == ERROR);
                CHECK(message_status == ERROR);
                CHECK(strstr(message, NAME));
                CHECK(strstr(message, calls[i].name));
                if (calls[i].modes) /* a matter of the mode, so the message says which it is */
                    CHECK(strstr(message, mode_name(all_modes[m]))
                          || strstr(message, "after initialization"));
                CHECK(memory(c)->mode == all_modes[m]);
            }
            close_instance(c);
        }
    }
}

/* ---- random calls ---- */

static double any_value(unsigned e)
{
    static const double special[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300, 5e-324, -0.0, -1.0};
    const struct variable *v = variable_of(e);
    const double start = e < N_P + N_U ? start_values[e] : 0.0;
    double value = start;
    if ((int)e == P_INTERVAL) /* short ones would make the steps long */
        return below(8) ? 0.05 * (1 + below(4)) : below(2) ? NAN : 0.1 + 1e-10;
    if (below(20) == 0 && v->causality != INPUT)
        value = special[below(COUNT(special))];
    else if (below(200) == 0)
        value = special[below(COUNT(special))];
    else if (v->type == INT32)
        value = below(10) ? start + below(3) : (double)(int32_t)random_bits();
    else
        value = start + (1.0 + fabs(start)) * (unit() - 0.5);
    if (v->type == INT32 && !(fabs(value) < 2e9))
        value = -1.0;
    return value;
}

/* At least `count` calls, besides those that make and end instances. */
static void random_calls(const struct call calls[], size_t n_calls, unsigned count)
{
    enum { MANY = 5, NOTHING = -1 };
    void *c[MANY] = {NULL}, *states[MANY] = {NULL};
    static union cell cell;
    unsigned char *bytes = malloc(scratch_size);
    unsigned taken[4] = {0}, steps = 0;
    CHECK(bytes);
    for (unsigned made = 0; made < count;) {
        const unsigned n = below(MANY), other = below(MANY);
        int status = NOTHING;
        if (!c[n]) {
            c[n] = open_instance(NAME, MODEL_TOKEN);
            CHECK(c[n]);
        }
        struct data *d = memory(c[n]);
        double last;
        switch (below(24)) {
        case 0: status = enter(c[n], below(4) ? 0.0 : 100.0 * unit() - 50.0); break;
        case 1: status = leave(c[n]); break;
        case 2:
            if (below(20) == 0)
                status = terminate(c[n]);
            break;
        case 3:
            if (below(10) == 0)
                status = reset(c[n]);
            break;
        case 4:
            if (below(50) == 0) {
                close_instance(c[n]);
                c[n] = NULL;
                continue;
            }
            break;
        case 5: status = state_get(c[n], &states[other]); break;
        case 6:
            if (states[other])
                status = state_set(c[n], states[other]);
            break;
        case 7: status = state_free(c[n], &states[other]); break;
        case 8:
            if (states[other]) {
                status = state_serialize(c[n], states[other], bytes, scratch_size - below(2));
                if (below(4) == 0)
                    bytes[below((unsigned)scratch_size)] ^= (unsigned char)random_bits();
                if (status == OK)
                    status = state_deserialize(c[n], bytes, scratch_size, &states[n]);
            }
            break;
        case 9: /* any function */
            if (below(8) == 0)
                status = calls[below((unsigned)n_calls)].call(c[n]);
            break;
        case 10: case 11: case 12: case 13: { /* any references */
            unsigned vr[3];
            size_t room = 0;
            const enum type type = (enum type)below(3);
            for (int j = 0; j < 3; j++) {
                vr[j] = below(30) ? variables[below(N_VARIABLES)].reference
                                  : below(2) ? below(2 * N_VALUES) : (unsigned)random_bits();
                const unsigned e = element_of(vr[j]);
                room += ARRAYS && e < N_VALUES ? variable_of(e)->size : 1;
            }
            memset(&cell, 0, sizeof cell);
            if (room > N_VALUES)
                break;
            room -= ARRAYS && below(20) == 0;
            status = below(2) ? get(c[n], type, vr, 3, &cell, room)
                              : set(c[n], type, vr, 1 + below(3), &cell, room);
            break;
        }
        case 14: case 15: case 16: case 17: {
            const unsigned e = below(N_VALUES);
            status = set_element(c[n], e, any_value(e));
            break;
        }
        default: {
            static const double sizes[] = {0.1, 0.05, 0.025, 0.2, 0.3, 1e-9, 0.0, -0.1, NAN,
                                           5e-324, 1e300, 4e9};
            const double now = (double)(d->time_ns - d->moved_ns * (int)below(2)) / 1e9;
            const double point = below(30) ? now + 1e-9 * (unit() - 0.5) * below(2)
                                           : now + unit() - 0.5;
            const int64_t before = d->time_ns;
            status = step(c[n], point, below(4) ? sizes[below(below(10) ? 3 : COUNT(sizes))]
                                                : any_size(), &last);
            CHECK(d->time_ns >= before && llabs(d->moved_ns) <= TICK_TOLERANCE_NS);
            steps += status == OK;
            break;
        }
        }
        if (status == NOTHING)
            continue;
        CHECK(status == OK || status == DISCARD || status == ERROR);
        made++;
        taken[status]++;
        if (status != OK)
            CHECK(message_status == status && strstr(message, NAME));
        CHECK(d->mode == INSTANTIATED || d->mode == INITIALIZATION || d->mode == STEP
              || d->mode == TERMINATED || d->mode == FAILED);
    }
    printf("%u ok (%u steps), %u discarded, %u refused\n", taken[OK], steps, taken[DISCARD],
           taken[ERROR]);
    CHECK(taken[OK] > count / 10 && steps > count / 50 && taken[ERROR] > count / 20);
    for (unsigned n = 0; n < MANY; n++) {
        close_instance(c[n]);
        free(states[n]);
    }
    free(bytes);
}

static int run_all(const struct call calls[], size_t n, int argc, char **argv)
{
    random_state = argc > 1 ? strtoull(argv[1], NULL, 10) : 1;
    const unsigned count = argc > 2 ? (unsigned)strtoul(argv[2], NULL, 10) : 200000;
    printf("%s, seed %s, %u random calls\n", MODEL_NAME, argc > 1 ? argv[1] : "1", count);
    prepare_scratch();
    test_every_function_in_every_mode(calls, n);
    test_values();
    test_references();
#if !ARRAYS
    test_neighbours(INITIALIZATION);
    test_neighbours(STEP);
#endif
    test_steps();
    test_short_steps(count / 1000);
    test_remainders();
    test_rounded_times();
#if P_INTERVAL >= 0
    test_one_tick();
#endif
#if P_INTERVAL >= 0 && N_U > 0
    test_tick_tolerance();
#endif
    test_states();
    test_life_cycles();
    test_many_instances();
    test_failure();
    test_derivatives();
    random_calls(calls, n, count);
    drop_scratch();
    return 0;
}

#endif
