/* The start of a program on the board that qemu emulates (mps2-an500, mps2-an386), and what
 * measure.h asks for. Semihosting prints and exits. */
#include <stdint.h>
#include <stdlib.h>

extern uint32_t stack_top[], data_begin[], data_end[], data_load[], bss_begin[], bss_end[];
extern void initialise_monitor_handles(void);
extern int main(void);
void reset(void);
void _fini(void);
void _fini(void) {} /* newlib calls it at exit */

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[16] = {
    (uintptr_t)stack_top, (uintptr_t)reset,
};

void reset(void)
{
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* CPACR: the floating-point unit */
    __asm__ volatile("dsb\n isb");
    const uint32_t *load = data_load;
    for (uint32_t *to = data_begin; to < data_end;)
        *to++ = *load++;
    for (uint32_t *to = bss_begin; to < bss_end;)
        *to++ = 0;
    initialise_monitor_handles();
    exit(main());
}
