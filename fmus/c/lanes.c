/* The engine for LANES simulations; compiled once per number of lanes. */
#include "real.h"
#include "elementary.h"
#include "model.h"
#include "engine.h"
#include "lanes.h"
#ifdef SHARED_ENGINE
#define HAS_SHARED
#include "shared.h"
#endif

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)

struct group {
    struct block block;
    int64_t interval_ns;
    int32_t variant;
};

#if P_INTERVAL >= 0 || P_VARIANT >= 0
static int lanes_agree(real v)
{
    for (int lane = 1; lane < LANES; lane++)
        if (!(r_get(v, lane) == r_get(v, 0)))
            return 0;
    return 1;
}
#endif

static uint32_t group_initial(void *memory, int64_t start_ns)
{
    struct group *g = memory;
    g->interval_ns = 0;
    g->variant = 0;
#if P_INTERVAL >= 0
    if (!lanes_agree(g->block.v[P_INTERVAL])
        || !engine_interval(r_get(g->block.v[P_INTERVAL], 0), &g->interval_ns))
        return P_INTERVAL + 1;
#endif
#if P_VARIANT >= 0
    if (!lanes_agree(g->block.v[P_VARIANT]))
        return P_VARIANT + 1;
    g->variant = (int32_t)r_get(g->block.v[P_VARIANT], 0);
#endif
    engine_initial(&g->block, g->variant, start_ns);
    return 0;
}

static void group_step(void *memory, int64_t start_ns, int64_t time_ns, int64_t end_ns)
{
    struct group *g = memory;
    engine_step(&g->block, g->variant, start_ns, g->interval_ns, time_ns, end_ns);
}

extern const struct lanes PASTE(lanes_, LANES);
const struct lanes PASTE(lanes_, LANES) = {
    .version = LANES_VERSION,
    .lanes = LANES,
    .parameters = N_P,
    .inputs = N_U,
    .outputs = N_Y,
    .block_size = (sizeof(struct group) + 63) / 64 * 64,
    .initial = group_initial,
    .step = group_step,
};
