/*
 * The modulator: the light on it, its phase response, its cross-talk, and the field behind it.
 *
 *   c(x, y) = a(x, y) (e^{i r(psi; x, y)} + z0),   r = (1 + v(x, y)) psi + sum of a_k sin(k psi) + b_k cos(k psi)
 *   psi = sum over k, l of K_k(q_y) K_l(q_x) wrap(phase)(row + k, column + l),   K_k(q) = q^{k^2} / sum of q^{j^2}
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_internal.h"

#include <math.h>

#define REACH (LIGHTPATH_CROSSTALK_TAPS / 2u)

double lightpath_place(uint32_t index, uint32_t count)
{
    return (2.0 * index + 1.0) / count - 1.0;
}

/* The series of the modulator along a row. */
typedef struct row_series {
    double amplitude[LIGHTPATH_ORDER_MAX + 1u]; /* of the source */
    double phase[LIGHTPATH_ORDER_MAX + 1u];     /* of the source */
    double response[LIGHTPATH_ORDER_MAX + 1u];  /* v */
} row_series;

static void add_response(const lightpath_kernel *kernel, double y, double *along_x)
{
    if (kernel->response_series > 0u) {
        /* This series has a constant, which comes first. */
        const uint8_t *numbers = kernel->bytes + kernel->response_variation_at;
        along_x[0] = lightpath_read_f32(numbers);
        lightpath_series_add(numbers + 4, kernel->response_series - 1u, y, 1.0, along_x);
    }
}

static void collect_row(const lightpath_kernel *kernel, uint32_t row, row_series *series)
{
    const double y = lightpath_place(row, kernel->height_px);
    const uint8_t *source = kernel->bytes + kernel->source_at;
    for (uint32_t i = 0; i <= LIGHTPATH_ORDER_MAX; i++) {
        series->amplitude[i] = 0.0;
        series->phase[i] = 0.0;
        series->response[i] = 0.0;
    }
    lightpath_series_add(source, kernel->source_order, y, 1.0, series->amplitude);
    source += 4u * lightpath_series_terms(kernel->source_order);
    lightpath_series_add(source, kernel->source_order, y, 1.0, series->phase);
    add_response(kernel, y, series->response);
}

static double value_at(const double *along_x, uint32_t order, double x)
{
    double value = 0.0;
    double mirrored = 0.0;
    lightpath_series_values(along_x, order, x, &value, &mirrored);
    return value;
}

static lightpath_wide source_at(const lightpath_kernel *kernel, const row_series *series, double x)
{
    const double amplitude = exp(value_at(series->amplitude, kernel->source_order, x));
    lightpath_wide value = lightpath_turn(value_at(series->phase, kernel->source_order, x) / LIGHTPATH_TWO_PI);
    value.re *= amplitude;
    value.im *= amplitude;
    return value;
}

lightpath_status lightpath_source_row(const lightpath_kernel *kernel, uint32_t row, lightpath_complex *values)
{
    row_series series;
    if (row >= kernel->height_px) {
        return LIGHTPATH_NO_SUCH_ROW;
    }
    collect_row(kernel, row, &series);
    for (uint32_t column = 0; column < kernel->width_px; column++) {
        const lightpath_wide value = source_at(kernel, &series, lightpath_place(column, kernel->width_px));
        if (!lightpath_put(value.re, value.im, &values[column])) {
            return LIGHTPATH_VALUE_NOT_FINITE;
        }
    }
    return LIGHTPATH_OK;
}

static double response_variation_at(const lightpath_kernel *kernel, const double *along_x, double x)
{
    return kernel->response_series > 0u ? value_at(along_x, kernel->response_series - 1u, x) : 0.0;
}

double lightpath_response_variation(const lightpath_kernel *kernel, double x, double y)
{
    double along_x[LIGHTPATH_ORDER_MAX + 1u];
    for (uint32_t i = 0; i <= LIGHTPATH_ORDER_MAX; i++) {
        along_x[i] = 0.0;
    }
    add_response(kernel, y, along_x);
    return response_variation_at(kernel, along_x, x);
}

double lightpath_response(const lightpath_kernel *kernel, double psi, double v)
{
    const lightpath_wide turn = lightpath_turn(psi / LIGHTPATH_TWO_PI);
    const uint8_t *harmonic = kernel->bytes + kernel->response_at;
    lightpath_wide power = turn;
    double response = (1.0 + v) * psi;
    for (uint32_t k = 0; k < kernel->harmonics; k++) {
        response += lightpath_read_f32(harmonic) * power.im + lightpath_read_f32(harmonic + 4) * power.re;
        const double re = power.re * turn.re - power.im * turn.im;
        power.im = power.re * turn.im + power.im * turn.re;
        power.re = re;
        harmonic += 8;
    }
    return response;
}

void lightpath_crosstalk_weights(double q, double weights[LIGHTPATH_CROSSTALK_TAPS])
{
    const double to_the_4 = q * q * q * q;
    const double powers[REACH + 1u] = {1.0, q, to_the_4, to_the_4 * to_the_4 * q};
    const double sum = 1.0 + 2.0 * (powers[1] + powers[2] + powers[3]);
    for (uint32_t k = 0; k < LIGHTPATH_CROSSTALK_TAPS; k++) {
        weights[k] = powers[k < REACH ? REACH - k : k - REACH] / sum;
    }
}

static double wrapped(double phase)
{
    return phase - LIGHTPATH_TWO_PI * floor(phase / LIGHTPATH_TWO_PI);
}

/* The phases near a pixel, blurred along y. */
static double blurred_along_y(const float *const *near, const double *weights, uint32_t column)
{
    double sum = 0.0;
    for (uint32_t k = 0; k < LIGHTPATH_CROSSTALK_TAPS; k++) {
        /* Rows without weight may be missing. */
        if (weights[k] > 0.0) {
            sum += weights[k] * wrapped((double)near[k][column]);
        }
    }
    return sum;
}

/* The column that is `tap` - 3 from another one, or that of the edge. */
static uint32_t near_column(uint32_t column, uint32_t tap, uint32_t width_px)
{
    const uint32_t place = column + tap < REACH ? 0u : column + tap - REACH;
    return place < width_px ? place : width_px - 1u;
}

lightpath_status lightpath_field_row(const lightpath_kernel *kernel, uint32_t row,
    const float *const near[LIGHTPATH_CROSSTALK_TAPS], lightpath_complex *values)
{
    row_series series;
    double weights_x[LIGHTPATH_CROSSTALK_TAPS];
    double weights_y[LIGHTPATH_CROSSTALK_TAPS];
    /* The phases of seven neighbouring columns, blurred along y. */
    double window[LIGHTPATH_CROSSTALK_TAPS];
    if (row >= kernel->height_px) {
        return LIGHTPATH_NO_SUCH_ROW;
    }
    collect_row(kernel, row, &series);
    lightpath_crosstalk_weights(kernel->crosstalk_x, weights_x);
    lightpath_crosstalk_weights(kernel->crosstalk_y, weights_y);
    for (uint32_t k = 1; k < LIGHTPATH_CROSSTALK_TAPS; k++) {
        window[k] = blurred_along_y(near, weights_y, near_column(0u, k - 1u, kernel->width_px));
    }
    for (uint32_t column = 0; column < kernel->width_px; column++) {
        double psi = 0.0;
        for (uint32_t k = 0; k < LIGHTPATH_CROSSTALK_TAPS; k++) {
            window[k] = k + 1u < LIGHTPATH_CROSSTALK_TAPS
                            ? window[k + 1u]
                            : blurred_along_y(near, weights_y, near_column(column, k, kernel->width_px));
            psi += weights_x[k] * window[k];
        }
        const double x = lightpath_place(column, kernel->width_px);
        const double v = response_variation_at(kernel, series.response, x);
        const lightpath_wide light = source_at(kernel, &series, x);
        lightpath_wide turned = lightpath_turn(lightpath_response(kernel, psi, v) / LIGHTPATH_TWO_PI);
        turned.re += (double)kernel->zero_order.re;
        turned.im += (double)kernel->zero_order.im;
        if (!lightpath_put(light.re * turned.re - light.im * turned.im, light.re * turned.im + light.im * turned.re,
                &values[column])) {
            return LIGHTPATH_VALUE_NOT_FINITE;
        }
    }
    return LIGHTPATH_OK;
}
