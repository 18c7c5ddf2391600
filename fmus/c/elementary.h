/* Elementary functions on real, branch-free: the same few IEEE operations in every lane.
 *
 * Nothing here calls libm, whose results differ between systems.  The polynomials are
 * minimax (Remez) fits for the relative error of the finished function, with the leading
 * Taylor terms split off; they are evaluated as two interleaved Horner chains, which halves
 * the latency for one more multiplication.  Where a sum of parts would cost accuracy, the
 * low part is carried separately and added to the small terms.
 *
 * Accuracy is given in units in the last place (ulp) of the result. */
#ifndef SBLCOSIM_ELEMENTARY_H
#define SBLCOSIM_ELEMENTARY_H

#include "real.h"

/* The coefficient lists below are written c0, c1, ... of c0 + c1 z + c2 z^2 + ... */
#define R_POLY6(z, zz, c0, c1, c2, c3, c4, c5) \
    (((c0) + (zz) * ((c2) + (zz) * (c4))) + (z) * ((c1) + (zz) * ((c3) + (zz) * (c5))))
#define R_POLY7(z, zz, c0, c1, c2, c3, c4, c5, c6) \
    (((c0) + (zz) * ((c2) + (zz) * ((c4) + (zz) * (c6)))) \
     + (z) * ((c1) + (zz) * ((c3) + (zz) * (c5))))
#define R_POLY10(z, zz, c0, c1, c2, c3, c4, c5, c6, c7, c8, c9) \
    (((c0) + (zz) * ((c2) + (zz) * ((c4) + (zz) * ((c6) + (zz) * (c8))))) \
     + (z) * ((c1) + (zz) * ((c3) + (zz) * ((c5) + (zz) * ((c7) + (zz) * (c9))))))
#define R_POLY11(z, zz, c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10) \
    (((c0) + (zz) * ((c2) + (zz) * ((c4) + (zz) * ((c6) + (zz) * ((c8) + (zz) * (c10)))))) \
     + (z) * ((c1) + (zz) * ((c3) + (zz) * ((c5) + (zz) * ((c7) + (zz) * (c9))))))
#define R_POLY13(z, zz, c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10, c11, c12) \
    (((c0) + (zz) * ((c2) + (zz) * ((c4) + (zz) * ((c6) + (zz) * ((c8) + (zz) * ((c10) \
     + (zz) * (c12))))))) \
     + (z) * ((c1) + (zz) * ((c3) + (zz) * ((c5) + (zz) * ((c7) + (zz) * ((c9) \
     + (zz) * (c11)))))))

/* ---- sine, cosine, tangent ---- */

/* Largest |x| whose count of quarter turns stays below 2^25. */
#define R_TRIG_LIMIT 5e7

/* The common part of sine, cosine and tangent.  |x| = quarters * pi/2 + r with |r| <= pi/4, and
 * sin r = s + ds, cos r = c + dc with the d's small. */
typedef struct {
    bits64 quarters; /* only its low bits count */
    real s, ds, c, dc;
} r_trig;

/* s, ds, c and dc for r + lo; without lo where it is known to be zero. */
R_INLINE r_trig r_trig_of(bits64 quarters, real r, const real *lo)
{
    r_trig t;
    real z = r * r, zz = z * z;
    real h = z * 0.5;
    t.quarters = quarters;
    t.s = r;
    t.ds = (r * z) * R_POLY6(z, zz, -0x1.5555555555549p-3, 0x1.111111110f860p-7,
                             -0x1.a01a019c0e174p-13, 0x1.71de3574894dcp-19,
                             -0x1.ae5e63a4c7e80p-26, 0x1.5d923a612fd4dp-33);
    t.c = 1.0 - h;
    real low = (1.0 - t.c) - h;
    if (lo) {
        t.ds = t.ds + *lo * t.c;
        low = low - r * *lo;
    }
    t.dc = zz * R_POLY6(z, zz, 0x1.555555555554cp-5, -0x1.6c16c16c15161p-10,
                        0x1.a01a019caecc6p-16, -0x1.27e4f807b76cep-22,
                        0x1.1ee9ea565e00bp-29, -0x1.8fadc423f80f3p-37)
           + low;
    return t;
}

/* The reduction subtracts quarters * pi/2 with pi/2 in four parts.  The first three have so
 * few bits that their products are exact, and so are the first two differences.  The third
 * is either exact or large enough that its rounding error is found by one more subtraction.
 * So r + lo is good to 2^-114, while no double up to the limit comes closer to a multiple of
 * pi/2 than 2^-61.  |x| beyond the limit is replaced by 0, inf and NaN by NaN. */
R_INLINE r_trig r_trig_parts(real x)
{
    const real round = r_set1(0x1.8p52);
    real a = r_fabs(x);
    a = r_blend(m_le(a, r_set1(R_TRIG_LIMIT)), a, a * 0.0);
    real n = a * 0x1.45f306dc9c883p-1 + round;
    bits64 quarters = r_bits(n);
    n = n - round;
    real r2 = (a - n * 0x1.921fb54p+0) - n * 0x1.10b462p-30;
    real w3 = n * -0x1.cb3b39ap-55;
    real r = r2 - w3;
    real lo = ((r2 - r) - w3) - n * 0x1.45c06e0e68948p-86;
    return r_trig_of(quarters, r, &lo);
}

/* Mask of the lanes where the lowest bit is set. */
R_INLINE mask r_odd(bits64 n) { return m_high(n << 63); }

/* sin x and cos x.  < 1 ulp for |x| <= 5e7; beyond that (+-0, 1); NaN for inf and NaN. */
static inline void r_sincos(real x, real *sine, real *cosine)
{
    real a = r_fabs(x);
    if (!m_any(~m_le(a, r_set1(0.785)))) { /* nothing to reduce in any lane: the same, shorter */
        r_trig t = r_trig_of(r_bits(r_set1(0.0)), a, NULL);
        *sine = r_copysign(t.s + t.ds, x);
        *cosine = t.c + t.dc;
        return;
    }
    r_trig t = r_trig_parts(x);
    real s = t.s + t.ds, c = t.c + t.dc;
    mask odd = r_odd(t.quarters);
    bits64 s_sign = ((t.quarters << 62) ^ r_bits(x)) & R_SIGN_BIT;
    bits64 c_sign = ((t.quarters + 1) << 62) & R_SIGN_BIT;
    *sine = r_from_bits(r_bits(r_blend(odd, c, s)) ^ s_sign);
    *cosine = r_from_bits(r_bits(r_blend(odd, s, c)) ^ c_sign);
}

/* sin x, as above; sin(-0) = -0. */
static inline real r_sin(real x)
{
    real s, c;
    r_sincos(x, &s, &c);
    return s;
}

/* cos x, as above. */
static inline real r_cos(real x)
{
    real s, c;
    r_sincos(x, &s, &c);
    return c;
}

/* tan x.  < 1.5 ulp for |x| <= 5e7; beyond that +-0; NaN for inf and NaN.  sin r / cos r or
 * its negative reciprocal, with the rounding errors of both carried into the quotient. */
static inline real r_tan(real x)
{
    r_trig t = r_trig_parts(x);
    real s = t.s + t.ds, c = t.c + t.dc;
    real es = (t.s - s) + t.ds, ec = (t.c - c) + t.dc;
    mask odd = r_odd(t.quarters);
    real num = r_blend(odd, c, s), den = r_blend(odd, s, c);
    real enu = r_blend(odd, ec, es), ede = r_blend(odd, es, ec);
    real q = num / den;
    q = q + (enu - q * ede) / den;
    bits64 sign = ((t.quarters << 63) ^ r_bits(x)) & R_SIGN_BIT;
    return r_from_bits(r_bits(q) ^ sign);
}

/* sin(2 pi u) and cos(2 pi u) for u in [0, 1).  < 1.5 ulp.  The quarter turns are taken off
 * exactly; the fits are in quarter turns too, so pi enters only as a coefficient. */
static inline void r_sincos_turn(real u, real *sine, real *cosine)
{
    const real round = r_set1(0x1.8p52);
    real v = u * 4.0;
    real n = v + round;
    bits64 quarters = r_bits(n);
    real f = v - (n - round);
    real z = f * f, zz = z * z;
    real s = f * 0x1.921fb54442d18p+0
             + (f * 0x1.1a62633145c07p-54
                + (f * z) * R_POLY6(z, zz, -0x1.4abbce625be47p-1, 0x1.466bc67758d85p-4,
                                    -0x1.32d2cce333306p-8, 0x1.5078301b63f8fp-13,
                                    -0x1.e300a65accdc6p-19, 0x1.e403d073e6664p-25));
    real c = 1.0
             + z * R_POLY7(z, zz, -0x1.3bd3cc9be45dep+0, 0x1.03c1f081b5ab0p-2,
                           -0x1.55d3c7e3c95bcp-6, 0x1.e1f50683b42a3p-11,
                           -0x1.a6d1ecb73dfb4p-16, 0x1.f9cc6acdfca50p-22,
                           -0x1.b26fe7c4cab45p-28);
    mask odd = r_odd(quarters);
    bits64 s_sign = (quarters << 62) & R_SIGN_BIT;
    bits64 c_sign = ((quarters + 1) << 62) & R_SIGN_BIT;
    *sine = r_from_bits(r_bits(r_blend(odd, c, s)) ^ s_sign);
    *cosine = r_from_bits(r_bits(r_blend(odd, s, c)) ^ c_sign);
}

/* ---- exponential, logarithm ---- */

/* exp x for every x.  < 1 ulp where the result is normal, 1 unit of 2^-1074 where it is
 * subnormal; inf above 709.78, 0 below -745.13.  x = k ln 2 + r; exp r by a polynomial; and
 * 2^k as two factors, as one may not be representable.  k comes from the rounding constant
 * biased to 2046 + k, of which the factors' exponents are the two halves. */
static inline real r_exp(real x)
{
    const real round = r_set1(0x1.8p52 + 2046.0);
    x = r_blend(m_lt(x, r_set1(-1400.0)), r_set1(-1400.0), x);
    x = r_blend(m_lt(r_set1(1400.0), x), r_set1(1400.0), x);
    real n = x * 0x1.71547652b82fep+0 + round;
    bits64 k = r_bits(n);
    n = n - round;
    real hi = x - n * 0x1.62e42fefa3800p-1; /* exact */
    real lo = n * 0x1.ef35793c76730p-45;
    real r = hi - lo, rr = r * r;
    real p = R_POLY10(r, rr, 0x1.000000000000ap-1, 0x1.55555555554fap-3, 0x1.5555555550878p-5,
                      0x1.1111111127c00p-7, 0x1.6c16c1842b2d2p-10, 0x1.a01a012a50653p-13,
                      0x1.a0199a092c0d2p-16, 0x1.71df255db858cp-19, 0x1.28ad75f9b7949p-22,
                      0x1.ad7f656d5a428p-26);
    real y = 1.0 + (hi + (rr * p - lo));
    bits64 half = (k << 51) & UINT64_C(0x7ff0000000000000);
    return (y * r_from_bits(half)) * r_from_bits((k << 52) - half);
}

/* log of a positive normal x, given 2^52 + 1023 as the bias, or more to take from the
 * exponent.  < 1 ulp.  x = 2^k m with m in [sqrt(1/2), sqrt(2)); for f = m - 1 and
 * s = f / (2 + f), log m = 2 artanh s = f - f^2/2 + s (f^2/2 + R(s^2)), where only small
 * terms are rounded.  k is made a double by placing it in the low bits of 2^52. */
R_INLINE real r_log_normal(real x, real bias)
{
    bits64 b = r_bits(x) + (UINT64_C(0x3ff0000000000000) - UINT64_C(0x3fe6a09e667f3bcd));
    real k = r_from_bits((b >> 52) | UINT64_C(0x4330000000000000)) - bias;
    real m = r_from_bits((b & UINT64_C(0x000fffffffffffff)) + UINT64_C(0x3fe6a09e667f3bcd));
    real f = m - 1.0;
    real s = f / (f + 2.0);
    real h = f * f * 0.5;
    real z = s * s, zz = z * z;
    real p = z * R_POLY7(z, zz, 0x1.5555555555593p-1, 0x1.999999997fc9ep-2,
                         0x1.2492494201d34p-2, 0x1.c71c51faeac21p-3, 0x1.7466420c3795ap-3,
                         0x1.39a16553b1f50p-3, 0x1.2f08ea7fd890ep-3);
    return k * 0x1.62e42fefa3800p-1
           - ((h - (s * (h + p) + k * 0x1.ef35793c76730p-45)) - f);
}

#define R_LOG_BIAS (0x1p52 + 1023.0)

/* log x for every x.  < 1 ulp, subnormal x too; log(+-0) = -inf, NaN below 0. */
static inline real r_log(real x)
{
    mask tiny = m_lt(x, r_set1(0x1p-1022));
    real y = r_log_normal(x * r_blend(tiny, r_set1(0x1p54), r_set1(1.0)),
                          r_blend(tiny, r_set1(R_LOG_BIAS + 54.0), r_set1(R_LOG_BIAS)));
    /* If x is not positive and finite: inf and NaN are their own logarithm. */
    real other = r_blend(m_lt(x, r_set1(0.0)), r_set1(__builtin_nan("")), x);
    other = r_blend(m_eq(x, r_set1(0.0)), r_set1(-__builtin_inf()), other);
    mask usual = m_lt(r_set1(0.0), x) & m_lt(x, r_set1(__builtin_inf()));
    return r_blend(usual, y, other);
}

/* ---- inverse trigonometric functions ---- */

/* Angle of the point (hi, lo), 0 <= lo <= hi, 0 < hi, lo + hi finite, moved to where it
 * belongs: turned by quarters * pi/2 after being mirrored at the axis where mirror is set.
 * Above pi/8 the point is turned back by pi/4, so the quotient stays within tan(pi/8), and
 * the rounding errors of its sum and difference are made good to first order.  The constant
 * is added last, from two parts. */
R_INLINE real r_angle(real lo, real hi, mask mirror, real eighths)
{
    mask above = m_lt(hi * 0x1.a827999fcef32p-2, lo);
    real less = r_keep(above, hi), more = r_keep(above, lo);
    real num = lo - less, den = hi + more;
    real t = num / den;
    real error = ((lo - (num + less)) - t * (more - (den - hi))) / den;
    real z = t * t, zz = z * z;
    real p = t * (z * R_POLY11(z, zz, -0x1.555555555553dp-2, 0x1.99999999958f4p-3,
                          -0x1.24924922b15b5p-3, 0x1.c71c70e7ba6e0p-4,
                          -0x1.745cf90ded19ep-4, 0x1.3b111c986b0b5p-4,
                          -0x1.10ebdffcecc33p-4, 0x1.df118ad6e899ep-5,
                          -0x1.9cdcc9a7a026cp-5, 0x1.37eee631f6177p-5,
                          -0x1.25a0f658c7859p-6)) + error;
    bits64 flip = r_bits(r_keep(mirror, r_set1(-0.0)));
    real eighth = r_from_bits(r_bits(r_keep(above, r_set1(1.0))) ^ flip);
    real turn = eighths + eighth;
    t = r_from_bits(r_bits(t) ^ flip);
    p = r_from_bits(r_bits(p) ^ flip);
    /* The high part has 50 bits, so its multiples up to 4 are exact. */
    return turn * 0x1.921fb54442d18p-1 + (t + (p + turn * 0x1.1a62633145c07p-55));
}

/* atan x for every x.  < 1.5 ulp; odd, atan(+-inf) = +-pi/2. */
static inline real r_atan(real x)
{
    const real one = r_set1(1.0);
    real a = r_fabs(x);
    a = r_blend(m_lt(r_set1(0x1p1000), a), r_set1(0x1p1000), a); /* its atan is pi/2 too */
    mask steep = m_lt(one, a);
    real y = r_angle(r_blend(steep, one, a), r_blend(steep, a, one), steep,
                     r_keep(steep, r_set1(2.0)));
    return r_copysign(y, x);
}

/* atan2(y, x) for all arguments as C99 defines it, zeros and infinities included.
 * < 1.5 ulp. */
static inline real r_atan2(real y, real x)
{
    const real zero = r_set1(0.0), one = r_set1(1.0), inf = r_set1(__builtin_inf());
    real a = r_fabs(y), b = r_fabs(x);
    mask steep = m_lt(b, a);
    real lo = r_blend(steep, b, a), hi = r_blend(steep, a, b);
    /* Keep lo + hi finite.  An infinity stands for 1 and makes any finite partner 0. */
    mask endless = m_eq(hi, inf);
    lo = r_blend(endless, r_blend(m_eq(lo, inf), one, lo * 0.0), lo);
    hi = r_blend(endless, one, hi);
    real scale = r_blend(m_lt(r_set1(0x1p1000), hi), r_set1(0x1p-60), one);
    lo = lo * scale;
    hi = hi * scale;
    hi = r_blend(m_eq(hi, zero), one, hi);
    /* steep mirrors at the diagonal, x < 0 (or -0) at the vertical axis. */
    mask left = m_high(r_bits(x));
    real eighths = r_keep(steep, r_set1(2.0));
    eighths = r_blend(left, 4.0 - eighths, eighths);
    return r_copysign(r_angle(lo, hi, steep ^ left, eighths), y);
}

/* The common part of asin and acos, for a = |x|.  Below 1/2: root = a and asin a = a + a rest.
 * Above: root + low = sqrt((1 - a) / 2), whose square is exact before the division, root
 * has at most 21 bits, and acos a = 2 (root + low + (root + low) rest). */
typedef struct {
    mask upper;
    real root, low, tail;
} r_arc;

R_INLINE r_arc r_arc_parts(real a)
{
    r_arc p;
    p.upper = m_lt(r_set1(0.5), a);
    real z = r_blend(p.upper, (1.0 - a) * 0.5, a * a), zz = z * z;
    real s = r_blend(p.upper, r_sqrt(z), a);
    real high = r_from_bits(r_bits(s) & UINT64_C(0xffffffff00000000));
    real low = (z - high * high) / (s + high + 0x1p-1000); /* at z = 0, 0 / 0 otherwise */
    p.root = r_blend(p.upper, high, a);
    p.low = r_keep(p.upper, low);
    p.tail = s * (z * R_POLY13(z, zz, 0x1.5555555555578p-3, 0x1.333333332df7fp-4,
                          0x1.6db6db7226033p-5, 0x1.f1c71a8dc62ebp-6,
                          0x1.6e8bdfa6272fcp-6, 0x1.1c49e2bf9f5a7p-6,
                          0x1.ca20cdbd8cab0p-7, 0x1.757b7c2169b76p-7,
                          0x1.6173ea87ce0f3p-7, 0x1.e2bef9c48a392p-9,
                          0x1.6492966b96418p-6, -0x1.59546a33c1f8cp-6,
                          0x1.0bb05e818122fp-5));
    return p;
}

/* asin x, |x| <= 1, else NaN.  < 1 ulp; odd. */
static inline real r_asin(real x)
{
    r_arc p = r_arc_parts(r_fabs(x));
    real lower = p.root + p.tail;
    real upper = 0x1.921fb54442d18p-1
                 + ((0x1.921fb54442d18p-1 - 2.0 * p.root)
                    + (0x1.1a62633145c07p-54 - 2.0 * (p.low + p.tail)));
    return r_copysign(r_blend(p.upper, upper, lower), x);
}

/* acos x, |x| <= 1, else NaN.  < 1 ulp. */
static inline real r_acos(real x)
{
    r_arc p = r_arc_parts(r_fabs(x));
    bits64 sign = r_bits(x) & R_SIGN_BIT;
    real tail = r_from_bits(r_bits(p.tail) ^ sign);
    real middle = 0x1.921fb54442d18p+0 - (x + (tail - 0x1.1a62633145c07p-54));
    real right = 2.0 * (p.root + (p.low + p.tail));
    real left = 0x1.921fb54442d18p+1
                - 2.0 * (p.root + ((p.low + p.tail) - 0x1.1a62633145c07p-54));
    return r_blend(p.upper, r_blend(m_lt(x, r_set1(0.0)), left, right), middle);
}

#endif
