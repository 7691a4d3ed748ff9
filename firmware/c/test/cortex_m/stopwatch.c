/*
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "stopwatch.h"

#include <stddef.h>
#include <stdio.h>

/* The board's timer 0 counts down at 25 MHz. */
#define TIMER ((volatile uint32_t *)0x40000000u)
#define INSTRUCTIONS_PER_TICK 40u
/* Stack that is watched [bytes]. */
#define STACK_MAX 8192u
#define PATTERN 0xa5u

void begin_measuring(void)
{
    TIMER[2] = 0xffffffffu;
    TIMER[0] = 1u;
    printf("%-42s %9s  %-9s %5s\n", "", "instr.", "for each", "stack");
}

/* The memory below the stack pointer is painted before the work: what lost its paint was used. */
void measure(const char *name, void (*work)(void), uint64_t parts, const char *part)
{
    volatile uint8_t *top;
    size_t stack = STACK_MAX;
    __asm volatile("mov %0, sp" : "=r"(top));
    for (size_t i = 1; i <= STACK_MAX; i++) {
        *(top - i) = PATTERN;
    }
    const uint32_t begin = TIMER[1];
    work();
    const uint64_t instructions = (uint64_t)(begin - TIMER[1]) * INSTRUCTIONS_PER_TICK;
    while (stack > 0u && *(top - stack) == PATTERN) {
        stack--;
    }
    printf("%-42s %9lu  %-9s %5lu\n", name, (unsigned long)((instructions + parts / 2u) / parts), part,
        (unsigned long)stack);
}
