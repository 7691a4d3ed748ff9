/*
 * Series of Chebyshev polynomials along a row:
 *
 *   s(x, y) = sum of c_ij T_i(x) T_j(y), 1 <= i + j <= order, ordered by i, then j
 *   T_0 = 1,  T_1 = x,  T_{i+1} = 2 x T_i - T_{i-1}
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_internal.h"

uint32_t lightpath_series_terms(uint32_t order)
{
    return (order + 1u) * (order + 2u) / 2u - 1u;
}

void lightpath_series_add(const uint8_t *coefficients, uint32_t order, double y, double factor, double *along_x)
{
    const uint8_t *next = coefficients;
    for (uint32_t i = 0; i <= order; i++) {
        double sum = 0.0;
        double before = y; /* T_{-1} = T_1, so that the recurrence also gives T_1 */
        double polynomial = 1.0;
        for (uint32_t j = 0; j <= order - i; j++) {
            /* The series has no constant term. */
            if (i + j > 0u) {
                sum += lightpath_read_f32(next) * polynomial;
                next += 4;
            }
            const double following = 2.0 * y * polynomial - before;
            before = polynomial;
            polynomial = following;
        }
        along_x[i] += factor * sum;
    }
}

/* T_i is even for an even i and odd for an odd i, so that one recurrence serves x and -x. */
void lightpath_series_values(const double *along_x, uint32_t order, double x, double *at_x, double *at_minus_x)
{
    double even = 0.0;
    double odd = 0.0;
    double before = x;
    double polynomial = 1.0;
    for (uint32_t i = 0; i <= order; i++) {
        if (i % 2u == 0u) {
            even += along_x[i] * polynomial;
        } else {
            odd += along_x[i] * polynomial;
        }
        const double following = 2.0 * x * polynomial - before;
        before = polynomial;
        polynomial = following;
    }
    *at_x = even + odd;
    *at_minus_x = even - odd;
}
