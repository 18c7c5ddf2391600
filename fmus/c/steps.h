/* Steps, in whole nanoseconds. */
#ifndef SBLCOSIM_STEPS_H
#define SBLCOSIM_STEPS_H

#include "instance.h"
#include "life_cycle.h"

#define TICK_TOLERANCE_NS 1000

/* Time relative to the start. A time close enough to a tick counts as that tick. */
static int64_t snap(int64_t relative_ns, int64_t interval_ns, int64_t tolerance_ns)
{
    if (interval_ns <= 0 || relative_ns < 0)
        return relative_ns;
    const int64_t tick = (relative_ns + interval_ns / 2) / interval_ns * interval_ns;
    const int64_t distance = relative_ns > tick ? relative_ns - tick : tick - relative_ns;
    return distance <= tolerance_ns ? tick : relative_ns;
}

/* End of a step that the master ends at `end_ns`: never before it begins, so that every tick
 * lies in exactly one step, and a step shorter than a nanosecond contains none. */
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
     * rounded. */
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
    /* If a step did not advance, its end may lie before that of the previous step. */
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

#endif
