/* The life of an instance from its creation to the end of its initialization. */
#ifndef SBLCOSIM_LIFE_CYCLE_H
#define SBLCOSIM_LIFE_CYCLE_H

#include "instance.h"

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

#endif
