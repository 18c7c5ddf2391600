/* A receiver as plain C for a microcontroller: the engine for one simulation, without the FMI. The
 * build writes this file with everything that it includes as NAME.c, for one scenario's parameters;
 * NAME.h says how to call it. */
#include "firmware.h" /* generated: the types and names of NAME.h */
#include "soft_sqrt.h"
#include "real.h"
#include "elementary.h"
#include "model.h"
#include "engine.h"
#include "firmware_ports.h" /* generated: from the inputs, to the outputs */

_Static_assert(sizeof(FIRMWARE(state)) == FIRMWARE_STATE_BYTES, "state size");
_Static_assert(sizeof(struct block) == sizeof(((FIRMWARE(state) *)0)->block), "size of a block");

void FIRMWARE(init)(FIRMWARE(state) *state)
{
    state->time_ns = FIRMWARE_INTERVAL_NS; /* of the first update: ticks are counted from 1 */
    memset(state->block, 0, sizeof state->block);
    engine_initial((struct block *)state->block, 0, 0);
}

void FIRMWARE(update)(FIRMWARE(state) *state, const FIRMWARE(inputs) *in, FIRMWARE(outputs) *out)
{
    struct block *const b = (struct block *)state->block;
    const int64_t end_ns = state->time_ns + FIRMWARE_INTERVAL_NS;
    firmware_take(in, b->v + N_P);
    engine_step(b, 0, 0, FIRMWARE_INTERVAL_NS, state->time_ns, end_ns);
    state->time_ns = end_ns;
    firmware_give(engine_x(b), out);
}
