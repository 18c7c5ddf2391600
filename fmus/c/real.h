/* The arithmetic type of the printed equations: one double, or LANES of them.
 *
 * The same source compiles to the same bits on every lane count because every operation
 * here is either exact (bit operations, comparisons) or correctly rounded by IEEE 754
 * (+ - * / sqrt), and the order of the operations is fixed by the source.  The compiler must not
 * interfere: -ffp-contract=off, and never -ffast-math.  The only thing left open is the sign and
 * payload of a NaN, which the processor chooses.
 *
 * Names: r_ works on doubles, b_ on the 64-bit words, m_ yields masks: per lane all ones or
 * zero, or one bit where the processor has registers for that.  Masks know &, |, ^ and ~. */
#ifndef SBLCOSIM_REAL_H
#define SBLCOSIM_REAL_H

#include <stdint.h>
#include <string.h>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

#ifndef LANES
#define LANES 1
#endif

#if LANES != 1 && LANES != 2 && LANES != 4 && LANES != 8
#error "LANES must be 1, 2, 4 or 8"
#endif
#ifdef __FAST_MATH__
#error "-ffast-math would change the results"
#endif
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0
#error "doubles must be evaluated as doubles (on x86-32: -msse2 -mfpmath=sse)"
#endif

/* Ends a basic block, at no cost at run time. Some compiler passes take time that grows with the
 * square of a block: a minute instead of two seconds for 8,000 statements. */
#define END_OF_PART \
    do { \
        __label__ next; \
        __asm__ goto("" : : : : next); \
    next:; \
    } while (0)

#define R_INLINE static inline __attribute__((always_inline))

/* Everything is static, so how a vector would cross a call between objects does not matter.
 * (Where the target has no registers for a real, GCC still prints a note about that, never an
 * error; -Wno-psabi on the command line silences it.) */
#if LANES > 1 && defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#if LANES == 1
typedef double real;
typedef uint64_t bits64;
typedef int64_t mask;
#define R_ALL(v) (v)
#else
typedef double real __attribute__((vector_size(8 * LANES)));
typedef uint64_t bits64 __attribute__((vector_size(8 * LANES)));
#if LANES == 8 && defined(__AVX512DQ__)
#define R_MASK_REGISTERS
typedef __mmask8 mask;
#else
typedef int64_t mask __attribute__((vector_size(8 * LANES)));
#endif
#if LANES == 2
#define R_ALL(v) {(v), (v)}
#elif LANES == 4
#define R_ALL(v) {(v), (v), (v), (v)}
#else
#define R_ALL(v) {(v), (v), (v), (v), (v), (v), (v), (v)}
#endif
#endif

#define R_SIGN_BIT UINT64_C(0x8000000000000000)

/* ---- making, taking apart ---- */

R_INLINE real r_set1(double v)
{
    real r = R_ALL(v);
    return r;
}

R_INLINE bits64 b_set1(uint64_t v)
{
    bits64 r = R_ALL(v);
    return r;
}

R_INLINE double r_get(real v, int lane)
{
#if LANES == 1
    (void)lane;
    return v;
#else
    return v[lane];
#endif
}

R_INLINE void r_put(real *v, int lane, double value)
{
#if LANES == 1
    (void)lane;
    *v = value;
#else
    (*v)[lane] = value;
#endif
}

R_INLINE uint64_t b_get(bits64 v, int lane)
{
#if LANES == 1
    (void)lane;
    return v;
#else
    return v[lane];
#endif
}

R_INLINE void b_put(bits64 *v, int lane, uint64_t value)
{
#if LANES == 1
    (void)lane;
    *v = value;
#else
    (*v)[lane] = value;
#endif
}

/* LANES consecutive doubles, at any alignment. */
R_INLINE real r_load(const double *from)
{
    real r;
    memcpy(&r, from, sizeof r);
    return r;
}

R_INLINE void r_store(double *to, real v)
{
    memcpy(to, &v, sizeof v);
}

R_INLINE bits64 r_bits(real v)
{
    bits64 r;
    memcpy(&r, &v, sizeof r);
    return r;
}

R_INLINE real r_from_bits(bits64 v)
{
    real r;
    memcpy(&r, &v, sizeof r);
    return r;
}

/* ---- masks ---- */

#if defined(R_MASK_REGISTERS)
#define R_COMPARE(name, operator, predicate) \
    R_INLINE mask name(real a, real b) \
    { \
        return _mm512_cmp_pd_mask(a, b, predicate); \
    }
#elif LANES == 1
#define R_COMPARE(name, operator, predicate) \
    R_INLINE mask name(real a, real b) { return -(mask)(a operator b); }
#else
#define R_COMPARE(name, operator, predicate) \
    R_INLINE mask name(real a, real b) { return (mask)(a operator b); }
#endif
R_COMPARE(m_lt, <, _CMP_LT_OQ)
R_COMPARE(m_le, <=, _CMP_LE_OQ)
R_COMPARE(m_eq, ==, _CMP_EQ_OQ)
R_COMPARE(m_ne, !=, _CMP_NEQ_UQ)

/* A condition is true when it is not zero, so NaN is true, as in C. */
R_INLINE mask m_true(real c) { return m_ne(c, r_set1(0.0)); }

/* Whether the highest bit is set. */
R_INLINE mask m_high(bits64 v)
{
#if defined(R_MASK_REGISTERS)
    return _mm512_movepi64_mask((__m512i)v);
#else
    return -(mask)(v >> 63);
#endif
}

/* A double is chosen by a condition, but by its bits in WebAssembly: there, engines choose between
 * doubles with a branch, and large functions with many of them are several times slower. */

/* a where the mask is set, else +0. */
R_INLINE real r_keep(mask m, real a)
{
#if defined(R_MASK_REGISTERS)
    return _mm512_maskz_mov_pd(m, a);
#elif LANES == 1 && !defined(__wasm__)
    return m ? a : 0.0;
#else
    return r_from_bits(r_bits(a) & (bits64)m);
#endif
}

/* a where the mask is set, else b; the bits of either are kept as they are. */
R_INLINE real r_blend(mask m, real a, real b)
{
#if defined(R_MASK_REGISTERS)
    return _mm512_mask_blend_pd(m, b, a);
#elif LANES == 4 && defined(__AVX__)
    return _mm256_blendv_pd(b, a, (real)m);
#elif LANES == 1 && !defined(__wasm__)
    return m ? a : b;
#else
    return r_from_bits((r_bits(a) & (bits64)m) | (r_bits(b) & ~(bits64)m));
#endif
}

/* 1.0 where the mask is set, else +0. */
R_INLINE real r_truth(mask m) { return r_keep(m, r_set1(1.0)); }

/* Is the mask set in any lane? Asked before every loop and draw, so worth the processor's own
 * instruction. */
R_INLINE int m_any(mask m)
{
#if LANES == 1 || defined(R_MASK_REGISTERS)
    return m != 0;
#elif LANES == 4 && defined(__AVX__)
    return _mm256_movemask_pd((__m256d)m) != 0;
#elif LANES == 2 && defined(__SSE2__)
    return _mm_movemask_pd((__m128d)m) != 0;
#else
    int64_t any = 0;
    for (int i = 0; i < LANES; i++)
        any |= m[i];
    return any != 0;
#endif
}

/* Is c nonzero in any lane? */
R_INLINE int r_any(real c) { return m_any(m_true(c)); }

/* ---- sign, extrema, rounding ---- */

R_INLINE real r_fabs(real x) { return r_from_bits(r_bits(x) & ~R_SIGN_BIT); }

R_INLINE real r_copysign(real x, real y)
{
    return r_from_bits((r_bits(x) & ~R_SIGN_BIT) | (r_bits(y) & R_SIGN_BIT));
}

/* -1, 1, or x itself when it is a zero or NaN. */
R_INLINE real r_sign(real x)
{
    return r_blend(m_lt(x, r_set1(0.0)), r_set1(-1.0),
                   r_blend(m_lt(r_set1(0.0), x), r_set1(1.0), x));
}

/* The smaller or larger; b where they are equal or one of them is NaN, as the processor's own
 * instruction has it. */
#if LANES == 1
#define R_EXTREMUM(name, compare, instruction) \
    R_INLINE real name(real a, real b) { return compare(a, b) ? a : b; }
#elif LANES == 8 && defined(__AVX512F__)
#define R_EXTREMUM(name, compare, instruction) \
    R_INLINE real name(real a, real b) { return _mm512_##instruction(a, b); }
#elif LANES == 4 && defined(__AVX__)
#define R_EXTREMUM(name, compare, instruction) \
    R_INLINE real name(real a, real b) { return _mm256_##instruction(a, b); }
#elif LANES == 2 && defined(__SSE2__)
#define R_EXTREMUM(name, compare, instruction) \
    R_INLINE real name(real a, real b) { return _mm_##instruction(a, b); }
#else
#define R_EXTREMUM(name, compare, instruction) \
    R_INLINE real name(real a, real b) { return r_blend(compare(a, b), a, b); }
#endif
#define R_GREATER(a, b) m_lt(b, a)
R_EXTREMUM(r_min, m_lt, min_pd)
R_EXTREMUM(r_max, R_GREATER, max_pd)

/* C's fmin and fmax: a NaN gives way to the other argument.  Where C leaves a choice,
 * between a zero and a zero of the other sign, it is the second argument. */
R_INLINE real r_fmin(real a, real b) { return r_blend(m_ne(b, b), a, r_min(a, b)); }
R_INLINE real r_fmax(real a, real b) { return r_blend(m_ne(b, b), a, r_max(a, b)); }

/* Floor of any double; -0, inf and NaN are returned as they are.  Below 2^52 in magnitude,
 * adding and subtracting 2^52 rounds to an integer, at most one too high; the sign is put
 * back so that -0 survives.  Larger ones are integers already. */
R_INLINE real r_floor(real x)
{
    const real two52 = r_set1(0x1p52);
    real a = r_fabs(x);
    real t = r_copysign((a + two52) - two52, x);
    t = t - r_keep(m_lt(x, t), r_set1(1.0));
    return r_blend(m_lt(a, two52), t, x);
}

R_INLINE real r_negate(real x) { return r_from_bits(r_bits(x) ^ R_SIGN_BIT); }

/* As in C, values in (-1, 0) give -0. */
R_INLINE real r_ceil(real x) { return r_negate(r_floor(r_negate(x))); }

/* Correctly rounded.  GCC does not merge lane-wise square roots into one vector
 * instruction, so on x86 it is told the instruction. */
R_INLINE real r_sqrt(real x)
{
#if LANES == 1
    return __builtin_sqrt(x);
#elif defined(__clang__) && __has_builtin(__builtin_elementwise_sqrt)
    return __builtin_elementwise_sqrt(x);
#elif defined(__SSE2__) && !defined(__clang__)
#if LANES == 4 && defined(__AVX__)
    return __builtin_ia32_sqrtpd256(x);
#elif LANES == 8 && defined(__AVX512F__)
    return __builtin_ia32_sqrtpd512_mask(x, x, -1, 4);
#else
    typedef double pair __attribute__((vector_size(16)));
    pair part[LANES / 2];
    memcpy(part, &x, sizeof x);
    for (int i = 0; i < LANES / 2; i++)
        part[i] = __builtin_ia32_sqrtpd(part[i]);
    memcpy(&x, part, sizeof x);
    return x;
#endif
#else
    for (int i = 0; i < LANES; i++)
        x[i] = __builtin_sqrt(x[i]);
    return x;
#endif
}

/* C's fmod, exact, for |x| < |y| and for |x| < 2^990 with |x / y| < 2^53; outside this range
 * NaN (so also for y = 0, infinite x, NaN).  The rounded quotient's integer part is at most
 * one too high; its product with y is formed as an exact sum of two doubles (Veltkamp,
 * Dekker), so the remainder comes out exact and at most once needs y added. */
R_INLINE real r_fmod(real x, real y)
{
    const real split = r_set1(134217729.0); /* 2^27 + 1 */
    real a = r_fabs(x), b = r_fabs(y);
    mask below = m_lt(a, b);
    mask valid = m_lt(a, r_set1(0x1p990)) & m_lt(a, b * r_set1(0x1p53));
    real q = r_floor(a / b);
    real qh = q * split, bh = b * split;
    qh = qh - (qh - q);
    bh = bh - (bh - b);
    real ql = q - qh, bl = b - bh;
    real p = q * b;
    real e = ((qh * bh - p) + qh * bl + ql * bh) + ql * bl;
    real r = (a - p) - e;
    r = r + r_keep(m_lt(r, r_set1(0.0)), b);
    r = r_blend(valid, r, r_set1(__builtin_nan("")));
    return r_copysign(r_blend(below, a, r), x);
}

#endif
