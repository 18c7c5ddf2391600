/* Replay: gives recorded inputs to one component, for groups of simulations with different
 * parameters, one per lane. Compiled once per number of lanes. */
#include <string.h>

#include "lanes.h"
#include "real.h"

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#define API __attribute__((visibility("default")))

/* The same for all groups. Elements of an input or output are counted as in struct lanes. */
struct replay {
    const struct lanes *engine;
    int64_t start_ns, interval_ns;
    const int64_t *ticks_ns; /* start_ns plus multiples of interval_ns */
    const double *inputs;    /* (ticks, width) */
    const int32_t *places;   /* (width): the element that each column of inputs sets */
    const int32_t *spans;    /* (n_spans, 2): first element of a recorded output, and its length */
    const int64_t *wanted;   /* ticks after which to record, in ascending order */
    int64_t n_wanted;
    int32_t width, n_spans;
};

#if LANES == 1
API extern const uint32_t sblcosim_replay_version;
const uint32_t sblcosim_replay_version = LANES_VERSION;
#endif

/* State at the start. block: aligned to 64. values: parameters and inputs, (elements, LANES).
 * Returns 0, or the 1-based element of a parameter whose values cannot share a group of lanes. */
API int64_t PASTE(sblcosim_replay_start_, LANES)(const struct replay *r, void *block,
                                                 const double *values)
{
    const struct lanes *const k = r->engine;
    memset(block, 0, k->block_size);
    memcpy(block, values, (size_t)(k->parameters + k->inputs) * sizeof(real));
    return k->initial(block, r->start_ns);
}

/* Ticks from first to before end. done: number of instants that are recorded already. record:
 * (wanted, elements of all spans, LANES). Returns the new value of done. */
API int64_t PASTE(sblcosim_replay_ticks_, LANES)(const struct replay *r, void *block,
                                                 int64_t first, int64_t end, int64_t done,
                                                 double *record)
{
    const struct lanes *const k = r->engine;
    real *const v = block, *const u = v + k->parameters;
    size_t each = 0;
    for (int i = 0; i < r->n_spans; i++)
        each += (size_t)r->spans[2 * i + 1] * LANES;
    record += (size_t)done * each;
    for (int64_t tick = first; tick < end; tick++) {
        const double *const given = r->inputs + tick * r->width;
        for (int i = 0; i < r->width; i++)
            u[r->places[i]] = r_set1(given[i]);
        k->step(block, r->start_ns, r->ticks_ns[tick], r->ticks_ns[tick] + r->interval_ns);
        if (done == r->n_wanted || r->wanted[done] != tick)
            continue;
        for (int i = 0; i < r->n_spans; i++) {
            const size_t n = (size_t)r->spans[2 * i + 1] * LANES;
            memcpy(record, v + k->parameters + k->inputs + r->spans[2 * i], n * sizeof(double));
            record += n;
        }
        done++;
    }
    return done;
}
