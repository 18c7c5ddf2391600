/* Feeds a receiver with the receptions of a recorded dive, and compares all outputs with recorded
 * ones, bit by bit. Prints what differs; the exit code is 0 if nothing does. */
#include <stddef.h>
#include <stdio.h>
#include <string.h>

struct place {
    unsigned short offset, size;
};

#include "recording.h" /* generated */

#ifdef MEASURE
#include "measure.h"
#else
#define MEASURE_UPDATE(call) call
#define MEASURE_REPORT()
#endif

static SELFTEST(state) state;
static SELFTEST(inputs) in;
static SELFTEST(outputs) out;

static uint64_t bits_at(const void *structure, struct place place)
{
    uint64_t bits = 0;
    const char *from = (const char *)structure + place.offset;
    if (place.size == sizeof(double))
        memcpy(&bits, from, sizeof bits);
    else if (place.size == sizeof(int32_t)) {
        int32_t number;
        memcpy(&number, from, sizeof number);
        bits = (uint64_t)(int64_t)number;
    } else
        bits = *(const bool *)from;
    return bits;
}

static void put_at(void *structure, struct place place, uint64_t bits)
{
    char *to = (char *)structure + place.offset;
    const int32_t number = (int32_t)bits;
    if (place.size == sizeof(double))
        memcpy(to, &bits, sizeof bits);
    else if (place.size == sizeof number)
        memcpy(to, &number, sizeof number);
    else
        *(bool *)to = bits != 0;
}

int main(void)
{
    static uint64_t expected[sizeof outputs / sizeof *outputs];
    const struct change *change = changes;
    const uint64_t *bits = values;
    unsigned long different = 0, compared = 0;
    SELFTEST(init)(&state);
    for (int update = 0; update < UPDATES; update++) {
        for (int i = 0; i < counts[update].inputs; i++, change++)
            put_at(&in, inputs[change->element], *bits++);
        for (int i = 0; i < counts[update].outputs; i++, change++)
            expected[change->element] = *bits++;
        MEASURE_UPDATE(SELFTEST(update)(&state, &in, &out));
        for (unsigned i = 0; i < sizeof outputs / sizeof *outputs; i++, compared++) {
            uint64_t difference = bits_at(&out, outputs[i]) ^ expected[i];
            for (; difference; difference &= difference - 1)
                different++;
        }
    }
    printf("%d updates, %lu outputs, %lu bits differ\n", UPDATES, compared, different);
    MEASURE_REPORT();
    return different != 0;
}
