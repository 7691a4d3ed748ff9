/*
 * What the parts of the decoder share. No program needs to include it.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef LIGHTPATH_INTERNAL_H
#define LIGHTPATH_INTERNAL_H

#include "lightpath_kernel.h"

#define LIGHTPATH_TWO_PI 6.283185307179586
/* Highest total degree of a series. */
#define LIGHTPATH_ORDER_MAX 12u
/* Powers x, y, x^2, xy, y^2 of the place by which a kernel varies over the modulator. */
#define LIGHTPATH_POWERS 5u

/*
 * The files hold IEEE 754 numbers, and phases of a million radians need 53 bits: a compiler whose double has 32 bits
 * must stop here.
 */
typedef char lightpath_double_must_have_64_bits[sizeof(double) == 8 && sizeof(float) == 4 ? 1 : -1];

/* A complex number while it is computed. */
typedef struct lightpath_wide {
    double re;
    double im;
} lightpath_wide;

/* Little-endian numbers at any address (lightpath_numbers.c). */
uint32_t lightpath_read_u32(const uint8_t *at);
double lightpath_read_f32(const uint8_t *at);

/* Rounds a number to float. False, and 0, for a number that is not finite or beyond the range of float. */
bool lightpath_put(double re, double im, lightpath_complex *value);

/* e^{i 2 pi cycles}. */
lightpath_wide lightpath_turn(double cycles);

/* Number of polynomials of total degree 1 to `order` (lightpath_series.c). */
uint32_t lightpath_series_terms(uint32_t order);

/*
 * The series s(x, y) = sum of c_ij T_i(x) T_j(y), 1 <= i + j <= order, along a row, where y is fixed: adds `factor`
 * times the coefficient of T_i(x) to along_x[i], i = 0 ... order.
 */
void lightpath_series_add(const uint8_t *coefficients, uint32_t order, double y, double factor, double *along_x);

/* Sum of along_x[i] T_i(x), i = 0 ... order, at x and at -x. */
void lightpath_series_values(const double *along_x, uint32_t order, double x, double *at_x, double *at_minus_x);

/* The angular spectrum A(fx, fy) (lightpath_ideal.c). */
lightpath_wide lightpath_angular_spectrum(const lightpath_kernel *kernel, double fx, double fy);

/*
 * The amplitude of H_ideal, and its phase in cycles, of the methods 0, 1 and 4 at bin (u, v) of the padded grid,
 * u = 0 ... width_px, v = 0 ... height_px.
 */
double lightpath_ideal_formula(const lightpath_kernel *kernel, uint32_t u, uint32_t v, double *cycles);

/*
 * The Fourier sums of methods 2, 3 and 5 (lightpath_sums.c). They keep rows of H_ideal in the scratch memory: for each
 * row the bins u = 0 ... width_px, and only the rows v = 0 ... height_px, because H_ideal is even along both axes.
 */
bool lightpath_is_sum(const lightpath_kernel *kernel);

/* Sums the group of rows that row v belongs to, unless it is ready. */
void lightpath_sums_prepare(lightpath_transfer *transfer, uint32_t v);

/* Additions that lightpath_sums_prepare would make. */
uint64_t lightpath_sums_additions(const lightpath_transfer *transfer, uint32_t v);

/* H_ideal at bin (u, v), whose group is ready. */
lightpath_wide lightpath_sums_at(const lightpath_transfer *transfer, uint32_t u, uint32_t v);

/* Numbers of frequencies M_x and M_y of method 2; false if it is not defined (lightpath_band_response.c). */
bool lightpath_frequencies(const lightpath_kernel *kernel, uint32_t *frequencies_x, uint32_t *frequencies_y);

/* Doubles of scratch memory that method 2 needs for each row beside the row itself. */
size_t lightpath_band_doubles(uint32_t frequencies_y);

/*
 * Sums `count` rows of method 2 from row `first` on. `rows` receives 2 * (width_px + 1) doubles for each; `scratch` has
 * count * lightpath_band_doubles(frequencies_y).
 */
void lightpath_band_rows(
    const lightpath_transfer *transfer, uint32_t first, uint32_t count, double *rows, double *scratch);

#endif
