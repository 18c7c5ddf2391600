/* An interface of our FMUs besides FMI: the same equations for many simulations at once.
 *
 * Its exported symbol `sblcosim_lanes` returns an engine for a number of lanes. A block of memory
 * holds one simulation per lane; it begins with the values of all elements of all variables, in
 * the order of the value references, each as `lanes` doubles: parameters, inputs, outputs. */
#ifndef SBLCOSIM_LANES_H
#define SBLCOSIM_LANES_H

#include <stdint.h>

#define LANES_VERSION 1

struct lanes {
    uint32_t version;
    uint32_t lanes;
    uint32_t parameters, inputs, outputs; /* numbers of elements */
    uint32_t block_size;                  /* bytes, to be aligned to 64 */
    /* State and outputs at the start. Returns 0, or the 1-based element of a parameter that must
     * be equal in all lanes but differs, or that is not a valid interval. */
    uint32_t (*initial)(void *block, int64_t start_ns);
    /* From time_ns, where the last step ended, to end_ns. */
    void (*step)(void *block, int64_t start_ns, int64_t time_ns, int64_t end_ns);
};

/* lanes = 0: as many as this processor supports well; NULL if it does not support that many. */
typedef const struct lanes *lanes_entry(uint32_t lanes);

#endif
