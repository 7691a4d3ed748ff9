/*
 * H_ideal of method 2, the band response.
 *
 * docs/compact-kernel.md defines it by an impulse response: a sum over M_x M_y frequencies for each lag, then a sum
 * over all lags for each bin of H. Together both are an interpolation of the angular spectrum A, and no impulse
 * response is needed:
 *
 *   H(u, v) = sum over p = 0 ... M_x / 2 and q = 0 ... M_y / 2 of  w_p w_q A'(p, q) I(p, u; M_x, C) I(q, v; M_y, R)
 *   I(p, u; M, C) = (-1)^u sin(C a) sin(a) / (M (cos b - cos a)),   a = 2 pi p / M,  b = pi u / C
 *                 = 2 C / M  where a = b is 0 or pi,   C / M  where a = b elsewhere
 *
 * with C = width_px, R = height_px, w = 1 at both ends of a sum and 2 between. A'(p, q) = A(p / (M_x D), q / (M_y D)),
 * minus D(fy) / (6 M_x) for p = M_x / 2, minus D(fx) / (6 M_y) for q = M_y / 2: these are the known errors of the sums.
 *
 * A group of rows takes M_x M_y / 4 values of A, and each of its rows M_x (M_y / 2 + C) / 2 additions.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_internal.h"

#include <math.h>

/* Fewest frequencies along an axis. */
#define FREQUENCIES_MIN 1024u
/* Limit on M_x M_y / 4. */
#define QUARTER_MAX (1u << 27)
/* No side of a quarter is longer, because the other side has at least FREQUENCIES_MIN / 2. */
#define HALF_MAX (QUARTER_MAX / (FREQUENCIES_MIN / 2u))

/* The smallest number of at least `least` whose prime factors are 2, 3 and 5. The search is short up to HALF_MAX. */
static uint32_t fast_length(uint32_t least)
{
    for (uint32_t length = least;; length++) {
        uint32_t rest = length;
        while (rest % 2u == 0u) {
            rest /= 2u;
        }
        while (rest % 3u == 0u) {
            rest /= 3u;
        }
        while (rest % 5u == 0u) {
            rest /= 5u;
        }
        if (rest == 1u) {
            return length;
        }
    }
}

/* Half the number of frequencies for a side of the display; 0 if it is too large. */
static uint32_t half_frequencies(uint32_t side_px, uint32_t sides, uint32_t spread_px, uint32_t spreads)
{
    const uint32_t wanted = sides * side_px + spreads * spread_px;
    const uint32_t least = ((wanted > FREQUENCIES_MIN ? wanted : FREQUENCIES_MIN) + 1u) / 2u;
    return least <= HALF_MAX ? fast_length(least) : 0u;
}

bool lightpath_frequencies(const lightpath_kernel *kernel, uint32_t *frequencies_x, uint32_t *frequencies_y)
{
    static const uint8_t paddings[3][2] = {{4, 2}, {3, 1}, {2, 1}};
    const double sine = 0.5 * kernel->wavelength_m / kernel->pixel_pitch_m;
    /* Pixels of half a wavelength send light to all sides. */
    if (!(sine < 1.0)) {
        return false;
    }
    const double spread_m = fabs(kernel->distance_m) * sine / sqrt(1.0 - sine * sine);
    const double spread_px = ceil(2.0 * spread_m / kernel->pixel_pitch_m);
    if (!(spread_px <= QUARTER_MAX)) {
        return false;
    }
    for (uint32_t i = 0; i < 3u; i++) {
        const uint32_t x = half_frequencies(kernel->width_px, paddings[i][0], (uint32_t)spread_px, paddings[i][1]);
        const uint32_t y = half_frequencies(kernel->height_px, paddings[i][0], (uint32_t)spread_px, paddings[i][1]);
        if (x > 0u && y > 0u && (uint64_t)x * y <= QUARTER_MAX) {
            *frequencies_x = 2u * x;
            *frequencies_y = 2u * y;
            return true;
        }
    }
    return false;
}

size_t lightpath_band_doubles(uint32_t frequencies_y)
{
    return (size_t)frequencies_y / 2u + 1u + 2u;
}

/* sin(pi part / whole), 0 <= part <= whole, exact near both zeros of the sine. */
static double sine_of(uint64_t part, uint64_t whole)
{
    const uint64_t nearest = part <= whole / 2u ? part : whole - part;
    return sin(0.5 * LIGHTPATH_TWO_PI * ((double)nearest / (double)whole));
}

/* sin(C a) sin(a) of the interpolation. */
static double interpolation_front(uint32_t p, uint32_t frequencies, uint32_t side_px)
{
    const uint64_t turned = (uint64_t)p * side_px % frequencies;
    const double sine = turned <= frequencies / 2u ? sine_of(2u * turned, frequencies)
                                                   : -sine_of(2u * (frequencies - turned), frequencies);
    return sine * sine_of(2u * (uint64_t)p, frequencies);
}

/* I(p, u; M, C), where `front` is interpolation_front. All angles are fractions of whole numbers: nothing cancels. */
static double interpolation(double front, uint32_t p, uint32_t frequencies, uint32_t u, uint32_t side_px)
{
    const uint64_t whole = 2u * (uint64_t)side_px * frequencies;
    const uint64_t a = 2u * (uint64_t)side_px * p;
    const uint64_t b = (uint64_t)frequencies * u;
    if (a == b) {
        return (u == 0u || u == side_px ? 2.0 : 1.0) * side_px / frequencies;
    }
    const double difference = a > b ? sine_of(a - b, whole) : -sine_of(b - a, whole);
    const double value = front / (frequencies * 2.0 * sine_of(a + b, whole) * difference);
    return u % 2u == 0u ? value : -value;
}

/* D(f), the slope of A at the end of the band, where the other frequency is `other`. */
static lightpath_wide slope_at_end(const lightpath_kernel *kernel, double other)
{
    const double end = 0.5 / kernel->pixel_pitch_m;
    const double wavelength = kernel->wavelength_m;
    const double cosine_squared = 1.0 - wavelength * wavelength * (end * end + other * other);
    lightpath_wide slope = {0.0, 0.0};
    if (cosine_squared > 0.0) {
        const double size = -LIGHTPATH_TWO_PI * kernel->distance_m * wavelength * end /
                            (sqrt(cosine_squared) * kernel->pixel_pitch_m);
        const lightpath_wide value = lightpath_angular_spectrum(kernel, end, other);
        slope.re = -size * value.im;
        slope.im = size * value.re;
    }
    return slope;
}

/* A'(p, q). */
static lightpath_wide sample(const lightpath_transfer *transfer, uint32_t p, uint32_t q)
{
    const lightpath_kernel *kernel = transfer->kernel;
    const double fx = p / (transfer->frequencies_x * kernel->pixel_pitch_m);
    const double fy = q / (transfer->frequencies_y * kernel->pixel_pitch_m);
    lightpath_wide value = lightpath_angular_spectrum(kernel, fx, fy);
    if (p == transfer->frequencies_x / 2u) {
        const lightpath_wide slope = slope_at_end(kernel, fy);
        value.re -= slope.re / (6.0 * transfer->frequencies_x);
        value.im -= slope.im / (6.0 * transfer->frequencies_x);
    }
    if (q == transfer->frequencies_y / 2u) {
        const lightpath_wide slope = slope_at_end(kernel, fx);
        value.re -= slope.re / (6.0 * transfer->frequencies_y);
        value.im -= slope.im / (6.0 * transfer->frequencies_y);
    }
    return value;
}

static double weight_of(uint32_t p, uint32_t frequencies)
{
    return p == 0u || p == frequencies / 2u ? 1.0 : 2.0;
}

/* Weighted interpolations along y: for each frequency those of all rows of the group, which are used together. */
static void fill_along_y(const lightpath_transfer *transfer, uint32_t first, uint32_t count, double *along_y)
{
    const uint32_t frequencies = transfer->frequencies_y;
    const uint32_t height_px = transfer->kernel->height_px;
    for (uint32_t q = 0; q <= frequencies / 2u; q++) {
        const double front = interpolation_front(q, frequencies, height_px);
        for (uint32_t b = 0; b < count; b++) {
            along_y[(size_t)q * count + b] =
                weight_of(q, frequencies) * interpolation(front, q, frequencies, first + b, height_px);
        }
    }
}

void lightpath_band_rows(
    const lightpath_transfer *transfer, uint32_t first, uint32_t count, double *rows, double *scratch)
{
    const uint32_t width_px = transfer->kernel->width_px;
    const size_t stride = 2u * ((size_t)width_px + 1u);
    double *sums = scratch;
    double *along_y = sums + 2u * (size_t)count;
    fill_along_y(transfer, first, count, along_y);
    for (size_t i = 0; i < count * stride; i++) {
        rows[i] = 0.0;
    }
    for (uint32_t p = 0; p <= transfer->frequencies_x / 2u; p++) {
        for (uint32_t b = 0; b < 2u * count; b++) {
            sums[b] = 0.0;
        }
        for (uint32_t q = 0; q <= transfer->frequencies_y / 2u; q++) {
            const lightpath_wide value = sample(transfer, p, q);
            for (uint32_t b = 0; b < count; b++) {
                sums[2u * b] += along_y[(size_t)q * count + b] * value.re;
                sums[2u * b + 1u] += along_y[(size_t)q * count + b] * value.im;
            }
        }
        const double weight = weight_of(p, transfer->frequencies_x);
        const double front = interpolation_front(p, transfer->frequencies_x, width_px);
        for (uint32_t u = 0; u <= width_px; u++) {
            const double along_x = weight * interpolation(front, p, transfer->frequencies_x, u, width_px);
            for (uint32_t b = 0; b < count; b++) {
                rows[b * stride + 2u * u] += along_x * sums[2u * b];
                rows[b * stride + 2u * u + 1u] += along_x * sums[2u * b + 1u];
            }
        }
    }
}
