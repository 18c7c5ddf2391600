/* Random numbers of an occasion: pairs from one block of Philox4x32-10, keyed by seed, component
 * and stream, counted by the tick (or the round of a loop), the pair and the occasion. */
#ifndef SBLCOSIM_NOISE_H
#define SBLCOSIM_NOISE_H

#include "philox.h"

static inline void noise_words(const bits64 key[2], bits64 count, uint32_t pair,
                               uint32_t occasion, bits64 words[4])
{
    const bits64 zero = r_bits(r_set1(0.0));
    philox4x32(key[0], key[1], count, count >> 32, zero + pair, zero + occasion, words);
}

static inline void noise_normal2(const bits64 key[2], bits64 count, uint32_t pair,
                                 uint32_t occasion, real *first, real *second)
{
    bits64 words[4];
    noise_words(key, count, pair, occasion, words);
    philox_normal2(words, first, second);
}

static inline void noise_uniform2(const bits64 key[2], bits64 count, uint32_t pair,
                                  uint32_t occasion, real *first, real *second)
{
    bits64 words[4];
    noise_words(key, count, pair, occasion, words);
    *first = philox_uniform53(words[0], words[1]);
    *second = philox_uniform53(words[2], words[3]);
}

#endif
