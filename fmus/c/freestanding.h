/* What we use of string.h, for a target without a C library. It is compiled under that name. */
#ifndef SBLCOSIM_FREESTANDING_H
#define SBLCOSIM_FREESTANDING_H

#include <stddef.h>

#define memcpy __builtin_memcpy
#define memset __builtin_memset

#endif
