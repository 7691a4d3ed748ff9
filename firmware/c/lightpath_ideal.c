/*
 * H_ideal of the methods that have a formula, at bin (u, v) of the padded grid:
 *
 *   1 angular spectrum            A(fx, fy) = exp(-i 2 pi z lambda f^2 / (1 + sqrt(1 - lambda^2 f^2)))
 *   0 band-limited                A where its samples do not alias, otherwise 0
 *   4 Fresnel transfer function   exp(-i pi lambda z f^2)
 *
 * f^2 = fx^2 + fy^2. docs/compact-kernel.md has the whole definitions.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_internal.h"

#include <math.h>

/* The amplitude of A(fx, fy), and its phase in cycles. */
static double angular_spectrum(const lightpath_kernel *kernel, double fx, double fy, double *cycles)
{
    const double z = kernel->distance_m;
    const double wavelength = kernel->wavelength_m;
    const double f_squared = fx * fx + fy * fy;
    const double sine_squared = wavelength * wavelength * f_squared;
    if (sine_squared <= 1.0) {
        *cycles = -z * wavelength * f_squared / (1.0 + sqrt(1.0 - sine_squared));
        return 1.0;
    }
    *cycles = -z / wavelength;
    /* Evanescent waves would grow without bound towards a negative distance. */
    return z > 0.0 ? exp(-LIGHTPATH_TWO_PI * z / wavelength * sqrt(sine_squared - 1.0)) : 0.0;
}

lightpath_wide lightpath_angular_spectrum(const lightpath_kernel *kernel, double fx, double fy)
{
    double cycles = 0.0;
    const double amplitude = angular_spectrum(kernel, fx, fy, &cycles);
    lightpath_wide value = lightpath_turn(cycles);
    value.re *= amplitude;
    value.im *= amplitude;
    return value;
}

/* Whether the padded grid samples H at this frequency without aliasing. */
static bool is_in_band_limit(const lightpath_kernel *kernel, double fx, double fy)
{
    const double sine_x = kernel->wavelength_m * fx;
    const double sine_y = kernel->wavelength_m * fy;
    const double extent_x = 2.0 * kernel->width_px * kernel->pixel_pitch_m;
    const double extent_y = 2.0 * kernel->height_px * kernel->pixel_pitch_m;
    const double slope_x = 2.0 * kernel->distance_m / extent_x;
    const double slope_y = 2.0 * kernel->distance_m / extent_y;
    return sine_x * sine_x * (slope_x * slope_x + 1.0) + sine_y * sine_y <= 1.0 &&
           sine_y * sine_y * (slope_y * slope_y + 1.0) + sine_x * sine_x <= 1.0;
}

double lightpath_ideal_formula(const lightpath_kernel *kernel, uint32_t u, uint32_t v, double *cycles)
{
    const double fx = (double)u / (2.0 * kernel->width_px * kernel->pixel_pitch_m);
    const double fy = (double)v / (2.0 * kernel->height_px * kernel->pixel_pitch_m);
    if (kernel->method == LIGHTPATH_FRESNEL_TRANSFER_FUNCTION) {
        *cycles = -0.5 * kernel->wavelength_m * kernel->distance_m * (fx * fx + fy * fy);
        return 1.0;
    }
    if (kernel->method == LIGHTPATH_BAND_LIMITED && !is_in_band_limit(kernel, fx, fy)) {
        *cycles = 0.0;
        return 0.0;
    }
    return angular_spectrum(kernel, fx, fy, cycles);
}
