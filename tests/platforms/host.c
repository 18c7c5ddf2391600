/* A master in plain C for any platform: loads the binaries of FMUs by path, runs a system of them
 * as test_c_host.py has written it down, and prints all outputs at all instants, as the bits of doubles.
 *
 * In FMI 2, an FMU of ours is also stepped through its engines for 1, 2, 4 and 8 simulations, as far as the
 * processor can do them; all must give the bits of the FMI functions. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"
#include "fmi3FunctionTypes.h"
#include "lanes.h"

#ifdef _WIN32
#include <windows.h>
static void *load(const char *path) { return (void *)LoadLibraryA(path); }
static void *look_up(void *library, const char *name)
{
    return (void *)GetProcAddress((HMODULE)library, name);
}
#else
#include <dlfcn.h>
static void *load(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *look_up(void *library, const char *name) { return dlsym(library, name); }
#endif

enum { REAL, INTEGER, LOGICAL, TYPES };
static const char *const NAMES[2][TYPES] = {{"Real", "Integer", "Boolean"},
                                            {"Float64", "Int32", "Boolean"}};

struct access {
    size_t type, n_references, n_values;
    unsigned *references;
    size_t start;    /* of reads: where the values go */
    size_t *sources; /* of writes: where they come from */
};

struct engine {
    const struct lanes *lanes;
    double *block;
};

struct component {
    int fmi;
    void *library, *instance;
    int64_t interval;
    size_t n_reads, n_writes;
    struct access *reads, *writes;
    char types[8192]; /* of all elements, in the order of the value references; "-": no lanes */
    struct engine engines[4];
};

static double *vectors[TYPES];

static void die(const char *what, const char *which)
{
    fprintf(stderr, "%s: %s\n", what, which);
    exit(1);
}

static int64_t integer(void)
{
    int64_t value;
    if (scanf("%" SCNd64, &value) != 1)
        die("job", "a whole number must be next");
    return value;
}

static void *many(size_t n, size_t size)
{
    void *memory = calloc(n ? n : 1, size);
    if (!memory)
        die("memory", "there must be enough");
    return memory;
}

static void word(char *text)
{
    if (scanf("%8191s", text) != 1)
        die("job", "a word must be next");
}

static double real(void)
{
    uint64_t bits;
    double value;
    if (scanf("%" SCNx64, &bits) != 1)
        die("job", "the bits of a number must be next");
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void *function(const struct component *c, const char *verb, const char *what)
{
    char name[64];
    snprintf(name, sizeof name, "fmi%d%s%s", c->fmi, verb, what);
    void *found = look_up(c->library, name);
    if (!found)
        die("missing function", name);
    return found;
}

static void check(int status, const char *what)
{
    if (status > 1)
        die("refused", what);
}

/* Get or set values, which are doubles here whatever their type. */
static void call(const struct component *c, const char *verb, const struct access *a, double *values)
{
    const int get = verb[0] == 'G';
    void *f = function(c, verb, NAMES[c->fmi - 2][a->type]);
    const size_t n = a->n_values, r = a->n_references;
    void *memory = many(n, sizeof(double));
    double *floats = memory;
    int32_t *integers = memory;
    int *booleans2 = memory;
    bool *booleans3 = memory;
    for (size_t i = 0; i < n && !get; i++) {
        if (a->type == REAL)
            floats[i] = values[i];
        else if (a->type == INTEGER)
            integers[i] = (int32_t)values[i];
        else if (c->fmi == 2)
            booleans2[i] = values[i] != 0;
        else
            booleans3[i] = values[i] != 0;
    }
    if (c->fmi == 2) /* the three types of value have pointers alike */
        check(((fmi2GetRealTYPE *)f)(c->instance, a->references, r, memory), verb);
    else
        check(((fmi3GetFloat64TYPE *)f)(c->instance, a->references, r, memory, n), verb);
    for (size_t i = 0; i < n && get; i++)
        values[i] = a->type == REAL  ? floats[i]
                    : a->type == INTEGER  ? integers[i]
                    : c->fmi == 2       ? booleans2[i]
                                        : booleans3[i];
    free(memory);
}

static void logger2(void *e, fmi2String i, fmi2Status s, fmi2String c, fmi2String m, ...)
{
    (void)e, (void)c;
    fprintf(stderr, "%s: %d: %s\n", i, (int)s, m);
}

static void logger3(void *e, fmi3Status s, fmi3String c, fmi3String m)
{
    (void)e, (void)c;
    fprintf(stderr, "%d: %s\n", (int)s, m);
}

static const fmi2CallbackFunctions callbacks = {logger2, calloc, free, NULL, NULL};

static struct access accessed(void)
{
    struct access a = {.type = (size_t)integer(), .n_references = (size_t)integer()};
    a.references = many(a.n_references, sizeof *a.references);
    for (size_t i = 0; i < a.n_references; i++)
        a.references[i] = (unsigned)integer();
    a.n_values = (size_t)integer();
    return a;
}

static double element(const struct component *c, unsigned i)
{
    const char type = c->types[i];
    unsigned reference = i + 1; /* 0 is the time */
    const struct access a = {.type = type == 'F' ? REAL : type == 'I' ? INTEGER : LOGICAL,
                             .n_references = 1, .n_values = 1, .references = &reference};
    double value;
    call(c, "Get", &a, &value);
    return value;
}

/* Copy elements from the instance to all lanes of a block. */
static void to_lanes(const struct component *c, struct engine *e, unsigned first, unsigned end)
{
    for (unsigned i = first; i < end; i++) {
        const double value = element(c, i);
        for (unsigned lane = 0; lane < e->lanes->lanes; lane++)
            e->block[i * e->lanes->lanes + lane] = value;
    }
}

static void compare(const struct component *c, const struct engine *e)
{
    const unsigned first = e->lanes->parameters + e->lanes->inputs;
    for (unsigned i = first; i < first + e->lanes->outputs; i++) {
        const double value = element(c, i);
        for (unsigned lane = 0; lane < e->lanes->lanes; lane++)
            if (memcmp(&value, &e->block[i * e->lanes->lanes + lane], sizeof value) != 0)
                die("lanes", "must give the bits of the FMU");
    }
}

static void begin_lanes(struct component *c, int64_t start)
{
    lanes_entry *entry = (lanes_entry *)look_up(c->library, "sblcosim_lanes");
    if (!entry)
        die("missing function", "sblcosim_lanes");
    for (int k = 0; k < 4; k++) {
        struct engine *e = &c->engines[k];
        e->lanes = entry(1u << k);
        if (!e->lanes)
            continue;
        char *memory = many(e->lanes->block_size + 64, 1);
        e->block = (double *)(memory + 64 - (uintptr_t)memory % 64);
        to_lanes(c, e, 0, e->lanes->parameters + e->lanes->inputs);
        if (e->lanes->initial(e->block, start))
            die("lanes", "must start");
        compare(c, e);
    }
}

static void begin(struct component *c, int64_t start)
{
    static char name[8192], token[8192], path[8192];
    c->fmi = (int)integer();
    word(name), word(token), word(path);
    c->library = load(path);
    if (!c->library)
        die("cannot be loaded", path);
    if (c->fmi == 2) {
        fmi2InstantiateTYPE *make = (fmi2InstantiateTYPE *)function(c, "Instantiate", "");
        c->instance = make(name, fmi2CoSimulation, token, "", &callbacks, fmi2False, fmi2False);
    } else {
        fmi3InstantiateCoSimulationTYPE *make =
            (fmi3InstantiateCoSimulationTYPE *)function(c, "InstantiateCoSimulation", "");
        c->instance = make(name, token, "", false, false, false, false, NULL, 0, NULL, logger3,
                           NULL);
    }
    if (!c->instance)
        die("cannot be instantiated", name);
    c->interval = integer();
    const double seconds = (double)start / 1e9;
    for (int64_t n = integer(); n > 0; n--) {
        const struct access a = accessed();
        double *values = many(a.n_values, sizeof *values);
        for (size_t i = 0; i < a.n_values; i++)
            values[i] = real();
        call(c, "Set", &a, values);
        free(values);
    }
    if (c->fmi == 2) {
        check(((fmi2SetupExperimentTYPE *)function(c, "SetupExperiment", ""))(
                  c->instance, fmi2False, 0, seconds, fmi2False, 0), "setup");
        check(((fmi2EnterInitializationModeTYPE *)function(c, "EnterInitializationMode", ""))(
                  c->instance), "initialisation");
    } else
        check(((fmi3EnterInitializationModeTYPE *)function(c, "EnterInitializationMode", ""))(
                  c->instance, false, 0, seconds, false, 0), "initialisation");
    check(((fmi2ExitInitializationModeTYPE *)function(c, "ExitInitializationMode", ""))(
              c->instance), "initialisation");
    c->n_reads = (size_t)integer();
    c->reads = many(c->n_reads, sizeof *c->reads);
    for (size_t i = 0; i < c->n_reads; i++) {
        c->reads[i] = accessed();
        c->reads[i].start = (size_t)integer();
    }
    c->n_writes = (size_t)integer();
    c->writes = many(c->n_writes, sizeof *c->writes);
    for (size_t i = 0; i < c->n_writes; i++) {
        struct access *a = &c->writes[i];
        *a = accessed();
        a->sources = many(a->n_values, sizeof *a->sources);
        for (size_t k = 0; k < a->n_values; k++)
            a->sources[k] = (size_t)integer();
    }
    word(c->types);
    if (c->types[0] != '-')
        begin_lanes(c, start);
}

static void set_inputs(const struct component *c)
{
    for (const struct access *a = c->writes; a < c->writes + c->n_writes; a++) {
        double *values = many(a->n_values, sizeof *values);
        for (size_t k = 0; k < a->n_values; k++)
            values[k] = vectors[a->type][a->sources[k]];
        call(c, "Set", a, values);
        free(values);
    }
}

static void step(struct component *c, int64_t start, int64_t now)
{
    const double t = (double)now / 1e9, h = (double)c->interval / 1e9;
    for (struct engine *e = c->engines; e < c->engines + 4; e++)
        if (e->lanes) {
            to_lanes(c, e, e->lanes->parameters, e->lanes->parameters + e->lanes->inputs);
            e->lanes->step(e->block, start, now, now + c->interval);
        }
    if (c->fmi == 2)
        check(((fmi2DoStepTYPE *)function(c, "DoStep", ""))(c->instance, t, h, fmi2True), "step");
    else {
        bool event, terminate, early;
        double reached;
        check(((fmi3DoStepTYPE *)function(c, "DoStep", ""))(c->instance, t, h, true, &event,
                                                            &terminate, &early, &reached), "step");
    }
    for (struct engine *e = c->engines; e < c->engines + 4; e++)
        if (e->lanes)
            compare(c, e);
}

int main(int argc, char **argv)
{
    if (argc != 2 || !freopen(argv[1], "r", stdin))
        die("job", "must be a file");
    const int64_t start = integer(), rows = integer();
    int64_t *instants = many((size_t)rows, sizeof *instants);
    for (int64_t row = 0; row < rows; row++)
        instants[row] = integer();
    size_t sizes[TYPES];
    for (int type = 0; type < TYPES; type++)
        vectors[type] = many(sizes[type] = (size_t)integer(), sizeof(double));
    const size_t n = (size_t)integer();
    struct component *components = many(n, sizeof *components);
    for (size_t i = 0; i < n; i++)
        begin(&components[i], start);
    for (int64_t row = 0; row < rows; row++) {
        const int64_t now = instants[row];
        for (struct component *c = components; c < components + n; c++)
            if ((now - start) % c->interval == 0)
                for (const struct access *a = c->reads; a < c->reads + c->n_reads; a++)
                    call(c, "Get", a, vectors[a->type] + a->start);
        for (int type = 0; type < TYPES; type++)
            for (size_t i = 0; i < sizes[type]; i++) {
                uint64_t bits;
                memcpy(&bits, &vectors[type][i], sizeof bits);
                printf("%016" PRIx64 "\n", bits);
            }
        if (row == rows - 1)
            break;
        for (struct component *c = components; c < components + n; c++)
            if ((now - start) % c->interval == 0)
                set_inputs(c);
        for (struct component *c = components; c < components + n; c++)
            if ((now - start) % c->interval == 0)
                step(c, start, now);
    }
    for (size_t i = 0; i < n; i++) {
        check(((fmi2TerminateTYPE *)function(&components[i], "Terminate", ""))(
                  components[i].instance), "terminate");
        ((fmi2FreeInstanceTYPE *)function(&components[i], "FreeInstance", ""))(
            components[i].instance);
    }
    unsigned widest = 0;
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < 4; k++)
            if (components[i].engines[k].lanes && widest < 1u << k)
                widest = 1u << k;
    fprintf(stderr, "widest: %u\n", widest);
    return 0;
}
