/* The square root where the processor has none for doubles: C's would come from libm. */
#ifndef SBLCOSIM_SOFT_SQRT_H
#define SBLCOSIM_SOFT_SQRT_H

#include <stdint.h>
#include <string.h>

#if defined(SOFT_SQRT) || (defined(__arm__) && !(defined(__ARM_FP) && (__ARM_FP & 8)))

/* Correctly rounded to nearest, as IEEE 754 asks: the root of the mantissa as an integer, one bit
 * after another, and then by what is left. */
static inline double soft_sqrt(double x)
{
    uint64_t bits, root = 0, rest;
    memcpy(&bits, &x, sizeof bits);
    if (!(x > 0.0) || bits >> 52 == 0x7ff)
        return x == 0.0 || x > 0.0 ? x : __builtin_nan("");
    int exponent = (int)(bits >> 52) - 1075;
    rest = bits & (UINT64_MAX >> 12);
    if (exponent == -1075)
        exponent = -1074; /* subnormal */
    else
        rest |= UINT64_C(1) << 52;
    while (!(rest >> 52)) {
        rest <<= 1;
        exponent--;
    }
    if (exponent & 1) {
        rest <<= 1;
        exponent--;
    }
    /* 54 bits of the root of rest * 2^54: the last one rounds. */
    uint64_t part = 0;
    for (int i = 53; i >= 0; i--) {
        const uint64_t trial = 4 * root + 1;
        part = 4 * part + (i > 26 ? rest >> (2 * (i - 27)) & 3 : 0);
        root *= 2;
        if (part >= trial) {
            part -= trial;
            root++;
        }
    }
    root = (root + 1) >> 1; /* never halfway: the square of an odd root is odd */
    const uint64_t result = ((uint64_t)(exponent / 2 + 1075 - 27 + 1) << 52) + root
                            - (UINT64_C(1) << 52);
    memcpy(&x, &result, sizeof x);
    return x;
}
#define __builtin_sqrt soft_sqrt

#endif
#endif
