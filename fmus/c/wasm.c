/* The entry of a component as WebAssembly, without imports: the engine for one simulation. The
 * README of this folder says how to call it. */
#include "lanes.h"

#define EXPORTED(name) __attribute__((export_name(#name)))

extern const struct lanes lanes_1;

EXPORTED(sblcosim_lanes) const struct lanes *sblcosim_lanes(void);
const struct lanes *sblcosim_lanes(void) { return &lanes_1; }

EXPORTED(sblcosim_initial) uint32_t sblcosim_initial(void *block, int64_t start_ns);
uint32_t sblcosim_initial(void *block, int64_t start_ns)
{
    return lanes_1.initial(block, start_ns);
}

EXPORTED(sblcosim_step)
void sblcosim_step(void *block, int64_t start_ns, int64_t time_ns, int64_t end_ns);
void sblcosim_step(void *block, int64_t start_ns, int64_t time_ns, int64_t end_ns)
{
    lanes_1.step(block, start_ns, time_ns, end_ns);
}
