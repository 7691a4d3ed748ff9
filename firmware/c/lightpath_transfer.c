/*
 * Rows of the transfer function:
 *
 *   H(fx, fy; x, y) = H_ideal(fx, fy) exp(alpha + i psi)
 *   alpha + i psi = s(2 D fx, 2 D fy) + sum of P_m(x, y) s_m(2 D fx, 2 D fy),   P = x, y, x^2, xy, y^2
 *
 * D is the pixel pitch, s and s_m are the kernel's complex series.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_internal.h"

#include <math.h>

/* The series of the kernel along a row, at one place of the modulator. */
typedef struct row_errors {
    double amplitude[LIGHTPATH_ORDER_MAX + 1u];
    double phase[LIGHTPATH_ORDER_MAX + 1u];
    uint32_t order;
} row_errors;

static void add_field(row_errors *errors, const uint8_t *numbers, uint32_t order, double fy, double factor)
{
    lightpath_series_add(numbers, order, fy, factor, errors->amplitude);
    lightpath_series_add(numbers + 4u * lightpath_series_terms(order), order, fy, factor, errors->phase);
}

static void collect_errors(const lightpath_kernel *kernel, double fy, double x, double y, row_errors *errors)
{
    const double powers[LIGHTPATH_POWERS] = {x, y, x * x, x * y, y * y};
    const uint32_t variation_order = kernel->variation_order;
    for (uint32_t i = 0; i <= LIGHTPATH_ORDER_MAX; i++) {
        errors->amplitude[i] = 0.0;
        errors->phase[i] = 0.0;
    }
    errors->order = kernel->order > variation_order ? kernel->order : variation_order;
    add_field(errors, kernel->bytes + kernel->kernel_at, kernel->order, fy, 1.0);
    if (variation_order > 0u) {
        const uint8_t *field = kernel->bytes + kernel->variation_at;
        for (uint32_t m = 0; m < LIGHTPATH_POWERS; m++) {
            add_field(errors, field, variation_order, fy, powers[m]);
            field += 8u * lightpath_series_terms(variation_order);
        }
    }
}

/* A value of H_ideal: `factor` times e^{i 2 pi cycles}. A formula gives cycles, so that each value takes one phasor. */
typedef struct ideal_value {
    lightpath_wide factor;
    double cycles;
} ideal_value;

static ideal_value ideal_at(const lightpath_transfer *transfer, uint32_t u, uint32_t v)
{
    ideal_value ideal = {{0.0, 0.0}, 0.0};
    if (lightpath_is_sum(transfer->kernel)) {
        ideal.factor = lightpath_sums_at(transfer, u, v);
    } else {
        ideal.factor.re = lightpath_ideal_formula(transfer->kernel, u, v, &ideal.cycles);
    }
    return ideal;
}

static bool put_product(const ideal_value *ideal, double amplitude, double phase, lightpath_complex *value)
{
    const lightpath_wide factor = ideal->factor;
    /* Where no light arrives, errors of any size change nothing. */
    if (factor.re == 0.0 && factor.im == 0.0) {
        return lightpath_put(0.0, 0.0, value);
    }
    const double scale = exp(amplitude);
    const lightpath_wide turn = lightpath_turn(ideal->cycles + phase / LIGHTPATH_TWO_PI);
    return lightpath_put(scale * (factor.re * turn.re - factor.im * turn.im),
        scale * (factor.re * turn.im + factor.im * turn.re), value);
}

/* Writes the values at fx = u and at -u steps from zero frequency: H_ideal is the same at both. */
static bool put_pair(
    const row_errors *errors, const ideal_value *ideal, uint32_t u, uint32_t width_px, lightpath_complex *values)
{
    double amplitude = 0.0;
    double amplitude_minus = 0.0;
    double phase = 0.0;
    double phase_minus = 0.0;
    const double fx = (double)u / width_px;
    lightpath_series_values(errors->amplitude, errors->order, fx, &amplitude, &amplitude_minus);
    lightpath_series_values(errors->phase, errors->order, fx, &phase, &phase_minus);
    bool fits = true;
    if (u < width_px) {
        fits = put_product(ideal, amplitude, phase, &values[u]);
    }
    if (u > 0u) {
        fits = put_product(ideal, amplitude_minus, phase_minus, &values[2u * width_px - u]) && fits;
    }
    return fits;
}

static uint32_t folded(const lightpath_kernel *kernel, uint32_t row)
{
    return row <= kernel->height_px ? row : 2u * kernel->height_px - row;
}

lightpath_status lightpath_transfer_row(
    lightpath_transfer *transfer, uint32_t row, double x, double y, lightpath_complex *values)
{
    const lightpath_kernel *kernel = transfer->kernel;
    row_errors errors;
    if (row >= 2u * kernel->height_px) {
        return LIGHTPATH_NO_SUCH_ROW;
    }
    if (!(fabs(x) <= 1.0 && fabs(y) <= 1.0)) {
        return LIGHTPATH_NO_SUCH_PLACE;
    }
    const uint32_t v = folded(kernel, row);
    const double fy = (row < kernel->height_px ? (double)row : -(double)v) / kernel->height_px;
    collect_errors(kernel, fy, x, y, &errors);
    if (lightpath_is_sum(kernel)) {
        lightpath_sums_prepare(transfer, v);
    }
    for (uint32_t u = 0; u <= kernel->width_px; u++) {
        const ideal_value ideal = ideal_at(transfer, u, v);
        if (!put_pair(&errors, &ideal, u, kernel->width_px, values)) {
            return LIGHTPATH_VALUE_NOT_FINITE;
        }
    }
    return LIGHTPATH_OK;
}

lightpath_status lightpath_transfer_begin(
    lightpath_transfer *transfer, const lightpath_kernel *kernel, double *scratch, size_t scratch_doubles)
{
    size_t one = 0;
    size_t two = 0;
    const lightpath_status status = lightpath_scratch_doubles(kernel, 1u, &one);
    if (status != LIGHTPATH_OK) {
        return status;
    }
    if (scratch_doubles < one) {
        return LIGHTPATH_SCRATCH_TOO_SMALL;
    }
    (void)lightpath_scratch_doubles(kernel, 2u, &two);
    transfer->kernel = kernel;
    transfer->scratch = scratch;
    transfer->rows_together = 1u;
    transfer->first_row = 0u;
    transfer->rows_ready = 0u;
    transfer->frequencies_x = 0u;
    transfer->frequencies_y = 0u;
    if (kernel->method == LIGHTPATH_BAND_RESPONSE) {
        (void)lightpath_frequencies(kernel, &transfer->frequencies_x, &transfer->frequencies_y);
    }
    if (two > one) {
        const size_t more = (scratch_doubles - one) / (two - one);
        transfer->rows_together += more < kernel->height_px ? (uint32_t)more : kernel->height_px;
    }
    return LIGHTPATH_OK;
}

uint64_t lightpath_transfer_additions(const lightpath_transfer *transfer, uint32_t row)
{
    const lightpath_kernel *kernel = transfer->kernel;
    const bool is_row = lightpath_is_sum(kernel) && row < 2u * kernel->height_px;
    return is_row ? lightpath_sums_additions(transfer, folded(kernel, row)) : 0u;
}
