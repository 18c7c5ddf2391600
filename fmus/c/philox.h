/* Philox4x32-10 (Salmon, Moraes, Dror, Shaw: "Parallel random numbers: as easy as 1, 2, 3",
 * 2011) with its own key and counter in every lane, and normal deviates from it.
 *
 * The generator has no state: the same key and counter give the same four words wherever
 * and whenever they are asked for.  Each 32-bit word lies in the lower half of a 64-bit lane, so
 * that a product of two words is one plain multiplication. */
#ifndef SBLCOSIM_PHILOX_H
#define SBLCOSIM_PHILOX_H

#include "elementary.h"
#include "real.h"

#define B_WORD UINT64_C(0xffffffff)

/* The lower half of a, times b.  Clang knows the instruction for it from the mask; GCC would form
 * all of a 64x64 product, so on x86 it is told. */
R_INLINE bits64 b_mul32(bits64 a, uint64_t b)
{
#if LANES > 1 && defined(__SSE2__) && !defined(__clang__)
#if LANES == 4 && defined(__AVX2__)
    typedef int half __attribute__((vector_size(32)));
    return (bits64)__builtin_ia32_pmuludq256((half)a, (half)b_set1(b));
#elif LANES == 8 && defined(__AVX512F__)
    typedef int half __attribute__((vector_size(64)));
    typedef long long whole __attribute__((vector_size(64)));
    return (bits64)__builtin_ia32_pmuludq512_mask((half)a, (half)b_set1(b), (whole)a, -1);
#else
    typedef int half __attribute__((vector_size(16)));
    const half factor = {(int)b, 0, (int)b, 0};
    half part[LANES / 2];
    memcpy(part, &a, sizeof a);
    for (int i = 0; i < LANES / 2; i++)
        part[i] = (half)__builtin_ia32_pmuludq128(part[i], factor);
    memcpy(&a, part, sizeof a);
    return a;
#endif
#else
    return (a & B_WORD) * b;
#endif
}

/* The four words for a key and a counter.  Only the lower half of each lane counts, so what the
 * rounds leave in the upper halves is cleared at the end. */
static inline void philox4x32(bits64 key0, bits64 key1, bits64 c0, bits64 c1, bits64 c2,
                              bits64 c3, bits64 out[4])
{
    for (int round = 0; round < 10; round++) {
        bits64 p0 = b_mul32(c0, UINT64_C(0xd2511f53));
        bits64 p1 = b_mul32(c2, UINT64_C(0xcd9e8d57));
        c0 = (p1 >> 32) ^ c1 ^ key0;
        c1 = p1;
        c2 = (p0 >> 32) ^ c3 ^ key1;
        c3 = p0;
        key0 = key0 + UINT64_C(0x9e3779b9);
        key1 = key1 + UINT64_C(0xbb67ae85);
    }
    out[0] = c0 & B_WORD;
    out[1] = c1 & B_WORD;
    out[2] = c2 & B_WORD;
    out[3] = c3 & B_WORD;
}

/* The integer hi * 2^21 + (lo >> 11), below 2^53, as a double.  Either word becomes the low
 * bits of a power of two whose last place has the word's weight; all sums are exact. */
static inline real philox_uniform53(bits64 hi, bits64 lo)
{
    real h = r_from_bits(hi | UINT64_C(0x4480000000000000));         /* 2^73 + hi 2^21 */
    real l = r_from_bits((lo >> 11) | UINT64_C(0x4330000000000000)); /* 2^52 + lo >> 11 */
    return (h - (0x1p73 + 0x1p52)) + l;
}

/* Two independent standard normal deviates from four words (Box, Muller).  The radius comes
 * from a uniform number in (0, 1], whose smallest value 2^-53 bounds it to 8.58; the angle
 * from one in [0, 1). */
static inline void philox_normal2(const bits64 w[4], real *n0, real *n1)
{
    real u = (philox_uniform53(w[0], w[1]) + 1.0) * 0x1p-53;
    real turn = philox_uniform53(w[2], w[3]) * 0x1p-53;
    real radius = r_sqrt(-2.0 * r_log_normal(u, r_set1(R_LOG_BIAS)));
    real s, c;
    r_sincos_turn(turn, &s, &c);
    *n0 = radius * c;
    *n1 = radius * s;
}

/* Two independent integers in [0, 2^53). */
static inline void philox_uniform2(const bits64 w[4], real *u0, real *u1)
{
    *u0 = philox_uniform53(w[0], w[1]);
    *u1 = philox_uniform53(w[2], w[3]);
}

#endif
