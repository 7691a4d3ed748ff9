/*
 * Counts instructions and measures stack on an emulated Cortex-M. QEMU must run with -icount shift=0, where each
 * instruction takes a nanosecond of the board's time.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef LIGHTPATH_STOPWATCH_H
#define LIGHTPATH_STOPWATCH_H

#include <stdint.h>

/* Starts the board's timer, and prints the head of the table. */
void begin_measuring(void);

/* Runs `work` and prints its instructions for each of its `parts`, and its stack [bytes]. */
void measure(const char *name, void (*work)(void), uint64_t parts, const char *part);

#endif
