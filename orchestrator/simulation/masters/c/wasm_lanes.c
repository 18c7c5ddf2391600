/* Whole simulations and replays as WebAssembly, without imports: the lanes master, the replay of
 * recorded inputs, and the engines of our components in one module, for one number of lanes. The README of orchestrator/wasm says how to
 * call it. */
#include "lanes_master.c"
#include "replay.c"

#include "engines.h" /* ENGINES, generated */

#define EXPORTED(name) __attribute__((export_name(#name)))

#define DECLARED(name) extern const struct lanes name;
ENGINES(DECLARED)
#define LISTED(name) &name,
static const struct lanes *const engines[] = {ENGINES(LISTED)};

/* The engine of a component, in the order of the module's description. */
EXPORTED(sblcosim_engine) const struct lanes *sblcosim_engine(uint32_t component);
const struct lanes *sblcosim_engine(uint32_t component) { return engines[component]; }

EXPORTED(sblcosim_drive)
int64_t sblcosim_drive(const struct plan *p, void *const *blocks, double *const *held,
                       void *moments, int64_t groups, const double *const *values, double *sums,
                       double *record, const struct errors *errors, double *order,
                       const volatile int32_t *cancel, volatile int64_t *done);
int64_t sblcosim_drive(const struct plan *p, void *const *blocks, double *const *held,
                       void *moments, int64_t groups, const double *const *values, double *sums,
                       double *record, const struct errors *errors, double *order,
                       const volatile int32_t *cancel, volatile int64_t *done)
{
    return PASTE(sblcosim_drive_, LANES)(p, blocks, held, moments, groups, values, sums, record,
                                         errors, order, cancel, done);
}

EXPORTED(sblcosim_replay_start)
int64_t sblcosim_replay_start(const struct replay *r, void *block, const double *values);
int64_t sblcosim_replay_start(const struct replay *r, void *block, const double *values)
{
    return PASTE(sblcosim_replay_start_, LANES)(r, block, values);
}

EXPORTED(sblcosim_replay_ticks)
int64_t sblcosim_replay_ticks(const struct replay *r, void *block, int64_t first, int64_t end,
                              int64_t done, double *record);
int64_t sblcosim_replay_ticks(const struct replay *r, void *block, int64_t first, int64_t end,
                              int64_t done, double *record)
{
    return PASTE(sblcosim_replay_ticks_, LANES)(r, block, first, end, done, record);
}
