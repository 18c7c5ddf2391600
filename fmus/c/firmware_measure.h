/* Instructions and stack of an update, on the board of board.c under qemu with -icount shift=0: an
 * instruction takes 1 ns of its time, and the timer SysTick counts 25 MHz, so 40 instructions. */
#include <stdint.h>

#define SYSTICK ((volatile uint32_t *)0xE000E010) /* control, reload, current */
#define INSTRUCTIONS_PER_COUNT 40
#define PAINT 0x5AFE57ACu
#define PAINTED 16384 /* words */

static uint32_t most_counts, most_stack, updates_measured;
static uint64_t all_counts;

static void measure_begin(void)
{
    uint32_t *here;
    __asm__ volatile("mov %0, sp" : "=r"(here));
    for (uint32_t *at = here - PAINTED; at < here - 16; at++)
        *(volatile uint32_t *)at = PAINT;
    SYSTICK[1] = 0xFFFFFF;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
}

static void measure_end(void)
{
    const uint32_t counts = 0xFFFFFF - SYSTICK[2];
    uint32_t *here;
    __asm__ volatile("mov %0, sp" : "=r"(here));
    const volatile uint32_t *at = here - PAINTED;
    while (at < here && *at == PAINT)
        at++;
    const uint32_t stack = (uint32_t)((const char *)here - (const char *)at);
    most_stack = stack > most_stack ? stack : most_stack;
    most_counts = counts > most_counts ? counts : most_counts;
    all_counts += counts;
    updates_measured++;
}

#define MEASURE_UPDATE(call) (measure_begin(), call, measure_end())
#define MEASURE_REPORT() \
    printf("instructions per update: mean %lu, most %lu; stack %lu bytes\n", \
           (unsigned long)(all_counts * INSTRUCTIONS_PER_COUNT / updates_measured), \
           (unsigned long)most_counts * INSTRUCTIONS_PER_COUNT, (unsigned long)most_stack)
