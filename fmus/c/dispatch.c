/* The numbers of lanes that this processor supports well. */
#include <stddef.h>

#include "lanes.h"
#include "widest.h"

extern const struct lanes lanes_1, lanes_2;
#if defined(__x86_64__)
extern const struct lanes lanes_4, lanes_8;
#endif

extern EXPORT lanes_entry sblcosim_lanes;
const struct lanes *sblcosim_lanes(uint32_t lanes)
{
    const uint32_t most = widest();
    if (lanes > most)
        return NULL;
    switch (lanes ? lanes : most) {
    case 1: return &lanes_1;
    case 2: return &lanes_2;
#if defined(__x86_64__)
    case 4: return &lanes_4;
    case 8: return &lanes_8;
#endif
    default: return NULL;
    }
}
