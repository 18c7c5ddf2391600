/* The largest number of lanes that this processor supports well, and the exports of a library. */
#ifndef SBLCOSIM_WIDEST_H
#define SBLCOSIM_WIDEST_H

#include <stdint.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#if defined(__x86_64__)
static void cpuid(uint32_t leaf, uint32_t r[4])
{
    __asm__ volatile("cpuid"
                     : "=a"(r[0]), "=b"(r[1]), "=c"(r[2]), "=d"(r[3])
                     : "a"(leaf), "c"(0));
}

/* Queried directly: the answer of a compiler's own function depends on how it was linked. */
static uint32_t widest(void)
{
    uint32_t r[4], state, high;
    cpuid(0, r);
    if (r[0] < 7)
        return 2;
    cpuid(1, r);
    if (!(r[2] >> 27 & 1)) /* OSXSAVE */
        return 2;
    __asm__ volatile("xgetbv" : "=a"(state), "=d"(high) : "c"(0));
    (void)high;
    cpuid(7, r);
    const int avx2 = r[1] >> 5 & 1, avx512f = r[1] >> 16 & 1, avx512dq = r[1] >> 17 & 1;
    if (avx512f && avx512dq && (state & 0xe6) == 0xe6)
        return 8;
    return avx2 && (state & 0x06) == 0x06 ? 4 : 2;
}
#else
static uint32_t widest(void) { return 2; }
#endif

#endif
