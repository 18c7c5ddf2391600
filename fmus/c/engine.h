/* The engine: how a component's equations are stepped, over one simulation or several side by
 * side. Include the generated model.h before this file. */
#ifndef SBLCOSIM_ENGINE_H
#define SBLCOSIM_ENGINE_H

#include <stdint.h>

#define N_VALUES (N_P + N_U + N_Y)
#define N_LOOPS (N_ADVANCE + N_ITERATE)

/* More rounds than any sensible use needs; an endless loop would hang its host. */
#define MAX_ROUNDS 1000000

enum occasion { OCCASION_INITIAL = 0, OCCASION_TICK = 1, OCCASION_LOOPS = 2 };

/* All numbers of the simulations. No pointers: a copy is a snapshot. */
struct block {
    /* Parameters, inputs, outputs, in the order of the declaration, then the states that are not
     * outputs. */
    real v[N_P + N_U + N_X];
    bits64 rounds[N_LOOPS + 1]; /* how often each loop has run: the counter of its noise; C has
                                 * no empty arrays */
    bits64 key[2];
};

/* A whole number below 2^52 as an integer. */
static inline bits64 r_integer(real v)
{
    return r_bits(v + r_set1(0x1p52)) & (UINT64_MAX >> 12);
}

static inline const real *engine_p(const struct block *b) { return b->v; }
static inline const real *engine_u(const struct block *b) { return b->v + N_P; }
static inline real *engine_x(struct block *b) { return b->v + N_P + N_U; } /* outputs, states */

static inline void engine_noise(const struct block *b, int occasion, bits64 count, real *w)
{
    if (N_W > 0)
        noise_draw(model_draws[occasion], model_blocks[occasion], (uint32_t)occasion, engine_p(b),
                   b->key, count, w);
}

#if HAS_INNER
#define INNER_LOOPS(loop) model_inner[loop]
#else
#define INNER_LOOPS(loop) 0
#endif

static inline int engine_loops(struct block *b, int variant, int first, int end, real t);

/* Lanes in which a loop has something to do: not those that hold a NaN. */
static inline mask engine_going(struct block *b, int variant, int loop, real t)
{
    real going = r_set1(0.0);
    model_guard(loop, variant, engine_x(b), engine_u(b), engine_p(b), t, &going);
    return m_true(going) & m_eq(going, going);
}

/* A loop that has something to do. 0 if it does not end. Side by side, the lane concerned becomes
 * NaN and the others continue. */
static inline int engine_loop(struct block *b, int variant, int loop, real t, mask going)
{
    real *const x = engine_x(b);
    for (int round = 0; round < MAX_ROUNDS; round++) {
        real w[N_W + 1];
        engine_noise(b, OCCASION_LOOPS + loop, b->rounds[loop], w);
        /* Lanes with nothing to do stay unchanged. */
        model_body(loop, variant, going, x, engine_u(b), engine_p(b), w, t);
        b->rounds[loop] += r_integer(r_truth(going));
        if (INNER_LOOPS(loop) > 0
            && !engine_loops(b, variant, loop + 1, loop + 1 + INNER_LOOPS(loop), t))
            return 0;
        going = engine_going(b, variant, loop, t);
        if (!m_any(going))
            return 1;
    }
#if LANES == 1
    return 0;
#else
    for (int i = 0; i < N_X; i++)
        x[i] = r_blend(going, r_set1(__builtin_nan("")), x[i]);
    return 1;
#endif
}

#ifdef HAS_EACH
/* A loop over each row of some states: the body runs where the guard holds. */
static inline void engine_rows(struct block *b, int variant, int loop, real t)
{
    real *const x = engine_x(b);
    for (int row = 0; row < model_rows[loop]; row++) {
        real c = r_set1(0.0);
        model_row_guard(loop, variant, row, x, engine_u(b), engine_p(b), t, &c);
        const mask going = m_true(c) & m_eq(c, c);
        if (m_any(going))
            model_row_body(loop, variant, row, going, x, engine_u(b), engine_p(b), t);
    }
}
#endif

/* The loops from first to before end, each with its inner loops. */
static inline int engine_loops(struct block *b, int variant, int first, int end, real t)
{
    for (int loop = first; loop < end; loop += 1 + INNER_LOOPS(loop)) {
#ifdef HAS_EACH
        if (model_rows[loop] > 0) {
            engine_rows(b, variant, loop, t);
            continue;
        }
#endif
        const mask going = engine_going(b, variant, loop, t);
        if (m_any(going) && !engine_loop(b, variant, loop, t, going))
            return 0;
    }
    return 1;
}

#define MAX_SECONDS 4e9 /* differences of two such times fit into 64 bits of nanoseconds */

/* Seconds to whole nanoseconds; 0 if they are not a sensible time. */
static inline int to_ns(double seconds, int64_t *ns)
{
    if (!(seconds > -MAX_SECONDS && seconds < MAX_SECONDS))
        return 0;
    *ns = (int64_t)(seconds * 1e9 + (seconds < 0 ? -0.5 : 0.5));
    return 1;
}

/* The time between ticks, which must be whole nanoseconds; otherwise 0. */
static inline int engine_interval(double seconds, int64_t *ns)
{
    if (!to_ns(seconds, ns) || *ns <= 0)
        return 0;
    const double rest = seconds * 1e9 - (double)*ns;
    return rest >= -1e-3 && rest <= 1e-3;
}

static inline real engine_seconds(int64_t ns) { return r_set1((double)ns / 1e9); }

static inline void engine_output(struct block *b, int variant, int64_t time_ns)
{
    model_output(variant, engine_x(b), engine_u(b), engine_p(b), engine_seconds(time_ns));
}

/* State and outputs at the start time. */
static inline int engine_initial(struct block *b, int variant, int64_t start_ns)
{
    const real t = engine_seconds(start_ns);
    real w[N_W + 1];
    bits64 zero = r_bits(r_set1(0.0));
    b->key[0] = b->key[1] = zero;
#if P_SEED >= 0
    b->key[0] = r_integer(b->v[P_SEED]);
    b->key[1] = r_integer(r_set1(COMPONENT_NUMBER * 65536.0) + b->v[P_STREAM]);
#endif
    for (int i = 0; i < N_LOOPS; i++)
        b->rounds[i] = zero;
    engine_noise(b, OCCASION_INITIAL, zero, w);
    model_initial(variant, engine_p(b), w, t, engine_x(b));
    if (!engine_loops(b, variant, 0, N_ADVANCE, t))
        return 0;
    engine_output(b, variant, start_ns);
    return 1;
}

/* Everything that happens in [time_ns, end_ns), and the outputs at end_ns. Ticks are at start_ns +
 * k interval_ns, k = 1, 2, ...; an interval of 0 means none. 0 if a loop has no end. */
static inline int engine_step(struct block *b, int variant, int64_t start_ns, int64_t interval_ns,
                       int64_t time_ns, int64_t end_ns)
{
    if (interval_ns > 0) {
        int64_t k = (time_ns - start_ns + interval_ns - 1) / interval_ns;
        if (k < 1)
            k = 1;
        for (; start_ns + k * interval_ns < end_ns; k++) {
            const real t = engine_seconds(start_ns + k * interval_ns);
            real w[N_W + 1];
            if (!engine_loops(b, variant, 0, N_ADVANCE, t))
                return 0;
            engine_noise(b, OCCASION_TICK, r_integer(r_set1((double)k)), w);
            model_tick(variant, engine_x(b), engine_u(b), engine_p(b), w, t, r_set1((double)k));
            if (!engine_loops(b, variant, N_ADVANCE, N_LOOPS, t))
                return 0;
        }
    }
    if (!engine_loops(b, variant, 0, N_ADVANCE, engine_seconds(end_ns)))
        return 0;
    engine_output(b, variant, end_ns);
    return 1;
}

#endif
