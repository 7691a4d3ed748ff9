/*
 * H_ideal of the methods that have an impulse response: Fourier sums over the lags between pixels,
 *
 *   H(u, v) = sum of h(m, n) e^{-i pi (m u / C + n v / R)},   m = -C + 1 ... C - 1,  n = -R + 1 ... R - 1
 *
 * with C = width_px, R = height_px. h is even along both axes, and so is H. No fast Fourier transform is used: it would
 * need memory for the whole plane.
 *
 * Method 3, Rayleigh-Sommerfeld: for a group of rows the inner sums over n take R C values of h and R C additions a
 * row; the outer sums over m take C^2 additions a row. Method 5, Fresnel: h is a product of a factor along x and one
 * along y. The sum along x takes C^2 additions once, the sum along y takes R for each row. Method 2 is in
 * lightpath_band_response.c.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_internal.h"

#include <math.h>

bool lightpath_is_sum(const lightpath_kernel *kernel)
{
    return kernel->method == LIGHTPATH_BAND_RESPONSE || kernel->method == LIGHTPATH_RAYLEIGH_SOMMERFELD ||
           kernel->method == LIGHTPATH_FRESNEL_IMPULSE_RESPONSE;
}

static size_t row_doubles(const lightpath_kernel *kernel)
{
    return 2u * ((size_t)kernel->width_px + 1u);
}

/* Doubles for the values of h along one axis. */
static size_t lags_doubles(const lightpath_kernel *kernel)
{
    return 2u * (size_t)(kernel->width_px > kernel->height_px ? kernel->width_px : kernel->height_px);
}

lightpath_status lightpath_scratch_doubles(const lightpath_kernel *kernel, uint32_t rows_together, size_t *doubles)
{
    const size_t row = row_doubles(kernel);
    uint32_t frequencies_x = 0;
    uint32_t frequencies_y = 0;
    switch (kernel->method) {
    case LIGHTPATH_BAND_RESPONSE:
        if (!lightpath_frequencies(kernel, &frequencies_x, &frequencies_y)) {
            return LIGHTPATH_TOO_MANY_FREQUENCIES;
        }
        *doubles = rows_together * (row + lightpath_band_doubles(frequencies_y));
        return LIGHTPATH_OK;
    case LIGHTPATH_RAYLEIGH_SOMMERFELD:
        *doubles = row + rows_together * (row + 1u);
        return LIGHTPATH_OK;
    case LIGHTPATH_FRESNEL_IMPULSE_RESPONSE:
        *doubles = lags_doubles(kernel) + row + 2u;
        return LIGHTPATH_OK;
    default:
        *doubles = 0u;
        return LIGHTPATH_OK;
    }
}

/*
 * Sum of g(m) e^{-i pi m u / lags} over m = -lags + 1 ... lags - 1 for an even g, by Clenshaw's recurrence: it needs
 * one cosine and no table.
 */
static lightpath_wide even_sum(const double *g, uint32_t lags, uint32_t u)
{
    const double cosine = cos(0.5 * LIGHTPATH_TWO_PI * u / lags);
    lightpath_wide next = {0.0, 0.0};
    lightpath_wide after = {0.0, 0.0};
    for (uint32_t m = lags - 1u; m > 0u; m--) {
        const double re = 2.0 * (g[2u * m] + cosine * next.re) - after.re;
        const double im = 2.0 * (g[2u * m + 1u] + cosine * next.im) - after.im;
        after = next;
        next.re = re;
        next.im = im;
    }
    lightpath_wide sum;
    sum.re = g[0] + cosine * next.re - after.re;
    sum.im = g[1] + cosine * next.im - after.im;
    return sum;
}

/* D^2 h(x, y) of the first Rayleigh-Sommerfeld integral for z > 0, faded out where its samples would alias. */
static lightpath_wide rayleigh_sommerfeld(const lightpath_kernel *kernel, uint32_t m, uint32_t n)
{
    const double z = fabs(kernel->distance_m);
    const double pitch = kernel->pixel_pitch_m;
    const double x = m * pitch;
    const double y = n * pitch;
    const double rho_squared = x * x + y * y;
    const double r = sqrt(rho_squared + z * z);
    /* Phase step between neighbouring samples, in half cycles. */
    const double steepness = (x > y ? x : y) / r * 2.0 * pitch / kernel->wavelength_m;
    lightpath_wide h = {0.0, 0.0};
    if (steepness >= 1.5) {
        return h;
    }
    const double faded = steepness > 1.0 ? cos(0.5 * LIGHTPATH_TWO_PI * (steepness - 1.0)) : 1.0;
    const double front = faded * faded * pitch * pitch * z / (LIGHTPATH_TWO_PI * r * r);
    /* rho^2 / (r + z) is r - z without cancellation. */
    const lightpath_wide turn = lightpath_turn(rho_squared / ((r + z) * kernel->wavelength_m));
    const double wave = LIGHTPATH_TWO_PI / kernel->wavelength_m;
    h.re = front * (turn.re / r + turn.im * wave);
    h.im = front * (turn.im / r - turn.re * wave);
    return h;
}

static void sum_along_y(
    const lightpath_kernel *kernel, uint32_t first, uint32_t count, double *rows, double *cosines)
{
    const size_t stride = row_doubles(kernel);
    const uint32_t period = 2u * kernel->height_px;
    for (size_t i = 0; i < count * stride; i++) {
        rows[i] = 0.0;
    }
    for (uint32_t n = 0; n < kernel->height_px; n++) {
        for (uint32_t b = 0; b < count; b++) {
            const uint32_t part = (uint32_t)((uint64_t)n * (first + b) % period);
            cosines[b] = (n > 0u ? 2.0 : 1.0) * cos(LIGHTPATH_TWO_PI * part / period);
        }
        for (uint32_t m = 0; m < kernel->width_px; m++) {
            const lightpath_wide h = rayleigh_sommerfeld(kernel, m, n);
            for (uint32_t b = 0; b < count; b++) {
                rows[b * stride + 2u * m] += cosines[b] * h.re;
                rows[b * stride + 2u * m + 1u] += cosines[b] * h.im;
            }
        }
    }
}

static void sum_rayleigh_sommerfeld(const lightpath_transfer *transfer, uint32_t first, uint32_t count)
{
    const lightpath_kernel *kernel = transfer->kernel;
    const size_t stride = row_doubles(kernel);
    const double conjugated = kernel->distance_m < 0.0 ? -1.0 : 1.0;
    double *lags = transfer->scratch;
    double *rows = lags + stride;
    sum_along_y(kernel, first, count, rows, rows + transfer->rows_together * stride);
    for (uint32_t b = 0; b < count; b++) {
        double *row = rows + b * stride;
        for (size_t i = 0; i < stride; i++) {
            lags[i] = row[i];
        }
        for (uint32_t u = 0; u <= kernel->width_px; u++) {
            const lightpath_wide sum = even_sum(lags, kernel->width_px, u);
            row[2u * u] = sum.re;
            row[2u * u + 1u] = conjugated * sum.im;
        }
    }
}

/* The factor of D^2 h along one axis: D e^{i pi x^2 / (lambda z)} / sqrt(i lambda z) at each lag. */
static void fill_fresnel_lags(const lightpath_kernel *kernel, uint32_t side_px, double *lags)
{
    const double area = kernel->wavelength_m * kernel->distance_m;
    const double scale = kernel->pixel_pitch_m / sqrt(fabs(area));
    for (uint32_t m = 0; m < side_px; m++) {
        const double x = m * kernel->pixel_pitch_m;
        /* An eighth of a turn is the phase of 1 / sqrt(i). */
        const lightpath_wide h = lightpath_turn(0.5 * x * x / area - (area > 0.0 ? 0.125 : -0.125));
        lags[2u * m] = scale * h.re;
        lags[2u * m + 1u] = scale * h.im;
    }
}

static void sum_fresnel(const lightpath_transfer *transfer, uint32_t v)
{
    const lightpath_kernel *kernel = transfer->kernel;
    double *lags = transfer->scratch;
    double *along_x = lags + lags_doubles(kernel);
    double *along_y = along_x + row_doubles(kernel);
    if (transfer->rows_ready == 0u) {
        fill_fresnel_lags(kernel, kernel->width_px, lags);
        for (uint32_t u = 0; u <= kernel->width_px; u++) {
            const lightpath_wide sum = even_sum(lags, kernel->width_px, u);
            along_x[2u * u] = sum.re;
            along_x[2u * u + 1u] = sum.im;
        }
    }
    fill_fresnel_lags(kernel, kernel->height_px, lags);
    const lightpath_wide sum = even_sum(lags, kernel->height_px, v);
    along_y[0] = sum.re;
    along_y[1] = sum.im;
}

static bool is_ready(const lightpath_transfer *transfer, uint32_t v)
{
    return v >= transfer->first_row && v - transfer->first_row < transfer->rows_ready;
}

static uint32_t first_of_group(const lightpath_transfer *transfer, uint32_t v)
{
    return v - v % transfer->rows_together;
}

static uint32_t rows_of_group(const lightpath_transfer *transfer, uint32_t first)
{
    const uint32_t left = transfer->kernel->height_px + 1u - first;
    return left < transfer->rows_together ? left : transfer->rows_together;
}

void lightpath_sums_prepare(lightpath_transfer *transfer, uint32_t v)
{
    const lightpath_kernel *kernel = transfer->kernel;
    if (is_ready(transfer, v)) {
        return;
    }
    const uint32_t first = first_of_group(transfer, v);
    const uint32_t count = rows_of_group(transfer, first);
    if (kernel->method == LIGHTPATH_FRESNEL_IMPULSE_RESPONSE) {
        sum_fresnel(transfer, v);
    } else if (kernel->method == LIGHTPATH_RAYLEIGH_SOMMERFELD) {
        sum_rayleigh_sommerfeld(transfer, first, count);
    } else {
        double *rows = transfer->scratch;
        lightpath_band_rows(transfer, first, count, rows, rows + transfer->rows_together * row_doubles(kernel));
    }
    transfer->first_row = first;
    transfer->rows_ready = count;
}

uint64_t lightpath_sums_additions(const lightpath_transfer *transfer, uint32_t v)
{
    const lightpath_kernel *kernel = transfer->kernel;
    const uint64_t columns = kernel->width_px;
    const uint64_t rows = kernel->height_px;
    const uint64_t count = rows_of_group(transfer, first_of_group(transfer, v));
    if (is_ready(transfer, v)) {
        return 0u;
    }
    switch (kernel->method) {
    case LIGHTPATH_FRESNEL_IMPULSE_RESPONSE:
        return rows + (transfer->rows_ready == 0u ? columns * (columns + 1u) : 0u);
    case LIGHTPATH_RAYLEIGH_SOMMERFELD:
        return count * columns * (rows + columns + 1u);
    default:
        return count * (transfer->frequencies_x / 2u + 1u) *
               ((uint64_t)transfer->frequencies_y / 2u + 1u + columns + 1u);
    }
}

lightpath_wide lightpath_sums_at(const lightpath_transfer *transfer, uint32_t u, uint32_t v)
{
    const lightpath_kernel *kernel = transfer->kernel;
    const double *rows = transfer->scratch;
    lightpath_wide value;
    if (kernel->method == LIGHTPATH_FRESNEL_IMPULSE_RESPONSE) {
        const double *along_x = rows + lags_doubles(kernel);
        const double *along_y = along_x + row_doubles(kernel);
        const double *x = along_x + 2u * u;
        value.re = x[0] * along_y[0] - x[1] * along_y[1];
        value.im = x[0] * along_y[1] + x[1] * along_y[0];
        return value;
    }
    if (kernel->method == LIGHTPATH_RAYLEIGH_SOMMERFELD) {
        rows += row_doubles(kernel);
    }
    const double *at = rows + (v - transfer->first_row) * row_doubles(kernel) + 2u * u;
    value.re = at[0];
    value.im = at[1];
    return value;
}
