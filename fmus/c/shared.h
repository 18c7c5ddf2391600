/* The engine for one simulation, compiled once in an FMU: by lanes.c, for the functions of FMI, too.
 * Include engine.h before this file; what follows uses the compiled engine. */
#ifndef SBLCOSIM_SHARED_H
#define SBLCOSIM_SHARED_H

int shared_initial(struct block *b, int variant, int64_t start_ns);
int shared_step(struct block *b, int variant, int64_t start_ns, int64_t interval_ns,
                int64_t time_ns, int64_t end_ns);
void shared_output(struct block *b, int variant, int64_t time_ns);

#ifdef HAS_SHARED
int shared_initial(struct block *b, int variant, int64_t start_ns)
{
    return engine_initial(b, variant, start_ns);
}

int shared_step(struct block *b, int variant, int64_t start_ns, int64_t interval_ns,
                int64_t time_ns, int64_t end_ns)
{
    return engine_step(b, variant, start_ns, interval_ns, time_ns, end_ns);
}

void shared_output(struct block *b, int variant, int64_t time_ns)
{
    engine_output(b, variant, time_ns);
}
#endif

#define engine_initial shared_initial
#define engine_step shared_step
#define engine_output shared_output

#endif
