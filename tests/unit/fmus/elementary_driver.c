/* Applies the functions of fmus/c to arrays, LANES elements at a time, for the tests.
 * Array lengths are multiples of 8. */
#include <stddef.h>

#include "elementary.h"
#include "philox.h"
#include "real.h"

#define EXPORT __attribute__((visibility("default")))

/* Masks as numbers, 1 or 0. */
#define r_lt(a, b) r_truth(m_lt(a, b))
#define r_le(a, b) r_truth(m_le(a, b))
#define r_eq(a, b) r_truth(m_eq(a, b))
#define r_ne(a, b) r_truth(m_ne(a, b))
#define r_and(a, b) r_truth(m_true(a) & m_true(b))
#define r_or(a, b) r_truth(m_true(a) | m_true(b))
#define r_not(a) r_truth(~m_true(a))
#define r_keep_true(c, x) r_keep(m_true(c), x)

#define UNARY(name)                                                  \
    EXPORT void map_##name(const double *x, double *y, size_t n);    \
    EXPORT void map_##name(const double *x, double *y, size_t n)     \
    {                                                                \
        for (size_t i = 0; i < n; i += LANES)                        \
            r_store(y + i, r_##name(r_load(x + i)));                 \
    }

#define BINARY(name)                                                                 \
    EXPORT void map_##name(const double *a, const double *b, double *y, size_t n);   \
    EXPORT void map_##name(const double *a, const double *b, double *y, size_t n)    \
    {                                                                                \
        for (size_t i = 0; i < n; i += LANES)                                        \
            r_store(y + i, r_##name(r_load(a + i), r_load(b + i)));                  \
    }

UNARY(sin)
UNARY(cos)
UNARY(tan)
UNARY(exp)
UNARY(log)
UNARY(atan)
UNARY(asin)
UNARY(acos)
UNARY(sqrt)
UNARY(fabs)
UNARY(sign)
UNARY(floor)
UNARY(ceil)
UNARY(not)
UNARY(negate)
BINARY(atan2)
BINARY(fmod)
BINARY(fmin)
BINARY(fmax)
BINARY(min)
BINARY(max)
BINARY(copysign)
BINARY(lt)
BINARY(le)
BINARY(eq)
BINARY(ne)
BINARY(and)
BINARY(or)
BINARY(keep_true)

EXPORT int lanes(void);
EXPORT int lanes(void)
{
    return LANES;
}

EXPORT void map_blend(const double *c, const double *a, const double *b, double *y, size_t n);
EXPORT void map_blend(const double *c, const double *a, const double *b, double *y, size_t n)
{
    for (size_t i = 0; i < n; i += LANES)
        r_store(y + i, r_blend(m_true(r_load(c + i)), r_load(a + i), r_load(b + i)));
}

/* One answer for the whole array, which tests r_any in every lane. */
EXPORT int any_nonzero(const double *x, size_t n);
EXPORT int any_nonzero(const double *x, size_t n)
{
    int any = 0;
    for (size_t i = 0; i < n; i += LANES)
        any |= r_any(r_load(x + i));
    return any;
}

/* x through every accessor, unchanged. */
EXPORT void map_access(const double *x, double *y, size_t n);
EXPORT void map_access(const double *x, double *y, size_t n)
{
    for (size_t i = 0; i < n; i += LANES) {
        real v = r_set1(x[i]);
        bits64 b = b_set1(0);
        for (int lane = 0; lane < LANES; lane++)
            r_put(&v, lane, x[i + (size_t)lane]);
        for (int lane = 0; lane < LANES; lane++)
            b_put(&b, lane, b_get(r_bits(v), lane));
        v = r_from_bits(b);
        for (int lane = 0; lane < LANES; lane++)
            y[i + (size_t)lane] = r_get(v, lane);
    }
}

EXPORT void map_sincos(const double *x, double *s, double *c, size_t n);
EXPORT void map_sincos(const double *x, double *s, double *c, size_t n)
{
    for (size_t i = 0; i < n; i += LANES) {
        real sine, cosine;
        r_sincos(r_load(x + i), &sine, &cosine);
        r_store(s + i, sine);
        r_store(c + i, cosine);
    }
}

EXPORT void map_sincos_turn(const double *u, double *s, double *c, size_t n);
EXPORT void map_sincos_turn(const double *u, double *s, double *c, size_t n)
{
    for (size_t i = 0; i < n; i += LANES) {
        real sine, cosine;
        r_sincos_turn(r_load(u + i), &sine, &cosine);
        r_store(s + i, sine);
        r_store(c + i, cosine);
    }
}

static bits64 b_load(const uint32_t *from, size_t stride)
{
    bits64 r = b_set1(0);
    for (int lane = 0; lane < LANES; lane++)
        b_put(&r, lane, from[(size_t)lane * stride]);
    return r;
}

/* Rows of key (2 words) and counter (4 words) to rows of 4 words. */
EXPORT void philox_rows(const uint32_t *key, const uint32_t *counter, uint32_t *out, size_t n);
EXPORT void philox_rows(const uint32_t *key, const uint32_t *counter, uint32_t *out, size_t n)
{
    for (size_t i = 0; i < n; i += LANES) {
        const uint32_t *k = key + 2 * i, *c = counter + 4 * i;
        bits64 w[4];
        philox4x32(b_load(k, 2), b_load(k + 1, 2), b_load(c, 4), b_load(c + 1, 4),
                   b_load(c + 2, 4), b_load(c + 3, 4), w);
        for (int lane = 0; lane < LANES; lane++)
            for (int j = 0; j < 4; j++)
                out[4 * (i + (size_t)lane) + (size_t)j] = (uint32_t)b_get(w[j], lane);
    }
}

/* Rows of 4 words to their two 53-bit numbers and their two normals. */
EXPORT void words_rows(const uint32_t *words, double *uniforms, double *normals, size_t n);
EXPORT void words_rows(const uint32_t *words, double *uniforms, double *normals, size_t n)
{
    for (size_t i = 0; i < n; i += LANES) {
        bits64 w[4];
        real n0, n1;
        for (size_t j = 0; j < 4; j++)
            w[j] = b_load(words + 4 * i + j, 4);
        real u0 = philox_uniform53(w[0], w[1]), u1 = philox_uniform53(w[2], w[3]);
        philox_normal2(w, &n0, &n1);
        for (int lane = 0; lane < LANES; lane++) {
            double *u = uniforms + 2 * (i + (size_t)lane);
            double *z = normals + 2 * (i + (size_t)lane);
            u[0] = r_get(u0, lane);
            u[1] = r_get(u1, lane);
            z[0] = r_get(n0, lane);
            z[1] = r_get(n1, lane);
        }
    }
}

/* 2n normals: element i and n + i from key and counter (i, 0, 0, 0), i < 2^32. */
EXPORT void normals(const uint32_t *key, double *out, size_t n);
EXPORT void normals(const uint32_t *key, double *out, size_t n)
{
    const bits64 zero = b_set1(0);
    bits64 index = b_set1(0);
    for (int lane = 0; lane < LANES; lane++)
        b_put(&index, lane, (uint64_t)lane);
    for (size_t i = 0; i < n; i += LANES) {
        bits64 w[4];
        real n0, n1;
        philox4x32(b_set1(key[0]), b_set1(key[1]), index, zero, zero, zero, w);
        philox_normal2(w, &n0, &n1);
        r_store(out + i, n0);
        r_store(out + n + i, n1);
        index += LANES;
    }
}
