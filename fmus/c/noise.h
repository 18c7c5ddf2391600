/* Random numbers of an occasion: pairs from one block of Philox4x32-10, keyed by seed, component
 * and stream, counted by the tick (or the round of a loop), the block and the occasion.
 * Included by the generated model.h. */
#ifndef SBLCOSIM_NOISE_H
#define SBLCOSIM_NOISE_H

#include "philox.h"

/* A block: two numbers, their destinations, and the parameters that scale them.  If its scale is 0,
 * a number is 0, and a block that no lane needs is not drawn.  -1: one number only; no scale. */
struct draw {
    int32_t block, uniform, to[2], scale[2];
};

static inline mask noise_wanted(const struct draw *d, int i, const real *p)
{
    return d->scale[i] < 0 ? m_true(r_set1(1.0)) : m_true(p[d->scale[i]]);
}

/* Draw n blocks, at most N_BLOCKS, into w.  First all words, then all numbers, as the processor
 * works on several blocks at a time where nothing else comes between them. */
static inline void noise_draw(const struct draw *draws, int n, uint32_t occasion, const real *p,
                              const bits64 key[2], bits64 count, real *w)
{
    const bits64 zero = r_bits(r_set1(0.0));
    const struct draw *drawn[N_BLOCKS + 1];
    bits64 words[N_BLOCKS + 1][4];
    int m = 0;
    for (int i = 0; i < n; i++) {
        const struct draw *const d = &draws[i];
        if (m_any(noise_wanted(d, 0, p) | noise_wanted(d, 1, p))) {
            philox4x32(key[0], key[1], count, count >> 32, zero + (uint64_t)d->block,
                       zero + occasion, words[m]);
            drawn[m++] = d;
        } else {
            w[d->to[0]] = r_set1(0.0);
            if (d->to[1] >= 0)
                w[d->to[1]] = r_set1(0.0);
        }
    }
    for (int i = 0; i < m; i++) {
        const struct draw *const d = drawn[i];
        real number[2];
        (d->uniform ? philox_uniform2 : philox_normal2)(words[i], &number[0], &number[1]);
        w[d->to[0]] = r_keep(noise_wanted(d, 0, p), number[0]);
        if (d->to[1] >= 0)
            w[d->to[1]] = r_keep(noise_wanted(d, 1, p), number[1]);
    }
}

#endif
