/*
 * Numbers of files, numbers of rows, and phasors.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_internal.h"

#include <math.h>

#define F32_MAX 3.4028234663852886e38

uint32_t lightpath_read_u32(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

/* The bits go through a union: the address may be odd, and a pointer to float must not be on some processors. */
double lightpath_read_f32(const uint8_t *at)
{
    union {
        uint32_t bits;
        float number;
    } word;
    word.bits = lightpath_read_u32(at);
    return (double)word.number;
}

bool lightpath_put(double re, double im, lightpath_complex *value)
{
    /* Written so that it is false for what is no number. */
    const bool fits = fabs(re) <= F32_MAX && fabs(im) <= F32_MAX;
    value->re = fits ? (float)re : 0.0f;
    value->im = fits ? (float)im : 0.0f;
    return fits;
}

/* Whole cycles are subtracted first: sine and cosine of a small angle are faster, and exact on every library. */
lightpath_wide lightpath_turn(double cycles)
{
    const double angle = LIGHTPATH_TWO_PI * (cycles - floor(cycles + 0.5));
    lightpath_wide turn;
    turn.re = cos(angle);
    turn.im = sin(angle);
    return turn;
}
