/*
 * Start of a program on an emulated Cortex-M: vectors, and the floating-point unit.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include <stdint.h>

extern char __stack[];
/* newlib's start for semihosting: it clears memory, reads the command line, and calls main and exit. */
extern void _start(void);
extern void _exit(int status);

void reset(void);

static void fault(void)
{
    _exit(70);
}

void reset(void)
{
#ifdef __ARM_FP
    /* Full access to the coprocessors 10 and 11, which are the floating-point unit. */
    *(volatile uint32_t *)0xe000ed88u |= 0xfu << 20;
    __asm volatile("dsb\n isb");
#endif
    _start();
}

typedef struct vector_table {
    char *stack;
    void (*handlers[15])(void);
} vector_table;

__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    __stack,
    {reset, fault, fault, fault, fault, fault},
};
