/*
 * Lightpath's compact kernel for firmware: a decoder in C99 of the form that docs/compact-kernel.md describes.
 *
 * A kernel is what Lightpath learned about one display at one wavelength and distance. The decoder gives
 *
 *   H(fx, fy; x, y)  the transfer function, one row at a time    lightpath_transfer_row
 *   a(x, y)          the light that falls on the modulator       lightpath_source_row
 *   r(psi; x, y)     the phase response of the modulator         lightpath_response
 *   K_k              the cross-talk between its pixels           lightpath_crosstalk_weights
 *   a (e^ir + z0)    the field behind the modulator              lightpath_field_row
 *
 * It allocates nothing, has no global variables, and calls no library but <math.h>: floor, ceil, fabs, sqrt, exp, sin
 * and cos of double. A target's own math library is faster and more exact than any that could be part of this code.
 * Compilers may also emit calls of memcpy and memset.
 *
 * Planes are in row-major order. Lengths are in metres, phases in radians. The padded grid has twice the display's
 * sides, 2 * height_px rows and 2 * width_px columns. Its zero frequency is at [0][0], as a Fourier transform has it:
 * row v stands for fy = n / (2 * height_px * pixel_pitch_m) with n = v for v < height_px, and n = v - 2 * height_px
 * otherwise. Columns and fx likewise.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef LIGHTPATH_KERNEL_H
#define LIGHTPATH_KERNEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What a function found. Only LIGHTPATH_OK means success. */
typedef enum lightpath_status {
    LIGHTPATH_OK = 0,
    /* Refusals of a file by lightpath_kernel_open. */
    LIGHTPATH_NOT_A_KERNEL,
    LIGHTPATH_UNKNOWN_VERSION,
    LIGHTPATH_WRONG_RESPONSE_ORDER,
    LIGHTPATH_WRONG_ORDER,
    LIGHTPATH_WRONG_VARIATION_ORDER,
    LIGHTPATH_WRONG_LENGTH,
    LIGHTPATH_WRONG_CHECKSUM,
    LIGHTPATH_UNKNOWN_MODEL,
    LIGHTPATH_UNKNOWN_METHOD,
    LIGHTPATH_TOO_MANY_HARMONICS,
    LIGHTPATH_WRONG_SIDE,
    LIGHTPATH_WRONG_PITCH,
    LIGHTPATH_WRONG_WAVELENGTH,
    LIGHTPATH_WRONG_DISTANCE,
    LIGHTPATH_NUMBER_NOT_FINITE,
    LIGHTPATH_WRONG_CROSSTALK,
    /* Refusals of a request for values. */
    LIGHTPATH_TOO_MANY_FREQUENCIES,
    LIGHTPATH_SCRATCH_TOO_SMALL,
    LIGHTPATH_NO_SUCH_ROW,
    LIGHTPATH_NO_SUCH_PLACE,
    LIGHTPATH_VALUE_NOT_FINITE,
    /* Refusals of a float16 array, see lightpath_f16.h. */
    LIGHTPATH_F16_NOT_AN_ARRAY,
    LIGHTPATH_F16_WRONG_HEADER,
    LIGHTPATH_F16_WRONG_SHAPE,
    LIGHTPATH_F16_ROW_TOO_LONG,
    LIGHTPATH_F16_CUT,
    LIGHTPATH_F16_TOO_LONG,
    LIGHTPATH_STATUS_COUNT
} lightpath_status;

/* A sentence about a status, in English, for people. Never NULL. */
const char *lightpath_status_text(lightpath_status status);

/* A complex number, as NumPy's complex64 stores it. */
typedef struct lightpath_complex {
    float re;
    float im;
} lightpath_complex;

/* Largest side of a display [px]. */
#define LIGHTPATH_SIDE_PX_MAX 16384u
/* Number of pixels whose phases blur into one, along an axis: three on either side. */
#define LIGHTPATH_CROSSTALK_TAPS 7u

/* Numbers of the methods of H_ideal, the transfer function of free space. */
enum {
    LIGHTPATH_BAND_LIMITED = 0,
    LIGHTPATH_ANGULAR_SPECTRUM = 1,
    LIGHTPATH_BAND_RESPONSE = 2,
    LIGHTPATH_RAYLEIGH_SOMMERFELD = 3,
    LIGHTPATH_FRESNEL_TRANSFER_FUNCTION = 4,
    LIGHTPATH_FRESNEL_IMPULSE_RESPONSE = 5
};

/* An opened kernel. Its members are for reading. Those named `_at` are places in the file [bytes]. */
typedef struct lightpath_kernel {
    const uint8_t *bytes; /* the caller's file */
    double pixel_pitch_m;
    double wavelength_m;
    double distance_m; /* negative for an image behind the display */
    double crosstalk_x; /* weight q of a neighbour's phase relative to the pixel's own, 0 to 0.6 */
    double crosstalk_y;
    lightpath_complex zero_order; /* undiffracted light z0, relative to the modulated light */
    float gain;   /* photograph = gain * light + offset */
    float offset;
    uint32_t height_px; /* rows of the display, 1 to LIGHTPATH_SIDE_PX_MAX */
    uint32_t width_px;  /* columns */
    uint16_t kernel_at;
    uint16_t source_at;
    uint16_t response_at;
    uint16_t response_variation_at;
    uint16_t variation_at;
    uint8_t version;         /* of the layout, 1 to 3 */
    uint8_t model;           /* 3 smooth, 4 display, 5 varying */
    uint8_t method;          /* of H_ideal, 0 to 5 */
    uint8_t order;           /* of the kernel's series, 0 to 12 */
    uint8_t source_order;    /* of the source's series, 0 to 12 */
    uint8_t harmonics;       /* of the phase response, 0 to 8 */
    uint8_t variation_order; /* of the kernel's variation over the modulator, 0 to 8; 0: none */
    uint8_t response_series; /* 1 + the order of the response's variation, 0 to 13; 0: none */
} lightpath_kernel;

/*
 * Opens a compact kernel. It reads `length` bytes, checks all of them, and keeps the pointer: the bytes must stay in
 * their place, such as flash memory, as long as `kernel` is in use. They need no alignment.
 *
 * LIGHTPATH_OK, or the reason why the file is refused. Then `kernel` must not be used.
 */
lightpath_status lightpath_kernel_open(lightpath_kernel *kernel, const uint8_t *bytes, size_t length);

/*
 * Rows of the transfer function. H_ideal of the methods 2, 3 and 5 is a Fourier sum. Its rows are computed in groups,
 * because the rows of a group share most of the work; the scratch memory decides how many they are. The members are
 * private.
 */
typedef struct lightpath_transfer {
    const lightpath_kernel *kernel;
    double *scratch;
    uint32_t rows_together; /* rows of H_ideal that the scratch memory holds at once */
    uint32_t first_row;     /* of the rows that it holds now */
    uint32_t rows_ready;    /* number of the rows that it holds now */
    uint32_t frequencies_x; /* M_x and M_y of method 2 */
    uint32_t frequencies_y;
} lightpath_transfer;

/*
 * Number of doubles that the scratch memory needs for `rows_together` rows of H_ideal at once, 1 to height_px + 1.
 * Methods 0, 1 and 4 need none. With C = width_px, R = height_px and B = rows_together:
 *
 *   method 2  B * (M_y / 2 + 2 * C + 5)                M_y as in docs/compact-kernel.md, at least 4 * R
 *   method 3  2 * (C + 1) + B * (2 * C + 3)
 *   method 5  2 * max(C, R) + 2 * (C + 1) + 2          for any B
 *
 * LIGHTPATH_TOO_MANY_FREQUENCIES for a display whose method 2 is not defined, as the server refuses it.
 */
lightpath_status lightpath_scratch_doubles(const lightpath_kernel *kernel, uint32_t rows_together, size_t *doubles);

/*
 * Prepares to compute rows of H. `scratch` may be NULL for methods 0, 1 and 4. More than the memory for one row makes
 * groups of rows. `kernel` and `scratch` must stay in their places while `transfer` is in use.
 *
 * LIGHTPATH_SCRATCH_TOO_SMALL for less than the memory for one row, LIGHTPATH_TOO_MANY_FREQUENCIES as above.
 */
lightpath_status lightpath_transfer_begin(
    lightpath_transfer *transfer, const lightpath_kernel *kernel, double *scratch, size_t scratch_doubles);

/*
 * Computes row `row` of the padded grid, 0 to 2 * height_px - 1: the 2 * width_px values
 *
 *   H(fx, fy; x, y) = H_ideal(fx, fy) exp(alpha + i psi)
 *
 * for the light from the place (x, y) of the modulator, both in [-1, 1]; use lightpath_place for a pixel's place.
 * A kernel whose variation_order is 0 has the same H everywhere.
 *
 * The rows v and 2 * height_px - v have the same H_ideal: ask for one after the other, and for each place in turn.
 *
 * LIGHTPATH_NO_SUCH_ROW, LIGHTPATH_NO_SUCH_PLACE. LIGHTPATH_VALUE_NOT_FINITE for values beyond the range of float,
 * which only a kernel with absurd coefficients has; then `values` holds a part of the row.
 */
lightpath_status lightpath_transfer_row(
    lightpath_transfer *transfer, uint32_t row, double x, double y, lightpath_complex *values);

/*
 * Number of additions in the sums of the next lightpath_transfer_row(transfer, row, ...). It is the work beside some
 * thousand cycles for each value; 0 if H_ideal is a formula or the row's group is ready. Ask before a watchdog does.
 */
uint64_t lightpath_transfer_additions(const lightpath_transfer *transfer, uint32_t row);

/* Place of pixel `index` of `count` along a side of the modulator, in [-1, 1]. */
double lightpath_place(uint32_t index, uint32_t count);

/*
 * Computes row `row` of a(x, y), the complex amplitude of the light on the modulator: width_px values.
 *
 * LIGHTPATH_NO_SUCH_ROW, LIGHTPATH_VALUE_NOT_FINITE.
 */
lightpath_status lightpath_source_row(const lightpath_kernel *kernel, uint32_t row, lightpath_complex *values);

/* v(x, y), the relative change of the phase response at a place of the modulator; x and y in [-1, 1]. */
double lightpath_response_variation(const lightpath_kernel *kernel, double x, double y);

/* r(psi; x, y) [rad] for a shown phase psi in [0, 2 pi) and v = v(x, y). */
double lightpath_response(const lightpath_kernel *kernel, double psi, double v);

/* The weights K_k(q), k = -3 ... 3, with which phases blur into a pixel. q is crosstalk_x or crosstalk_y. */
void lightpath_crosstalk_weights(double q, double weights[LIGHTPATH_CROSSTALK_TAPS]);

/*
 * Computes row `row` of the field behind the modulator, a (e^{i r(psi)} + z0): width_px values.
 *
 * `near[3]` holds the phases [rad] of this row that the modulator is given, carrier included, wrapped or not; near[0]
 * to near[6] those of the rows row - 3 to row + 3. Beyond the edge, give the row of the edge. Only kernels whose
 * crosstalk_y is not 0 read other rows than near[3].
 *
 * LIGHTPATH_NO_SUCH_ROW, LIGHTPATH_VALUE_NOT_FINITE.
 */
lightpath_status lightpath_field_row(const lightpath_kernel *kernel, uint32_t row,
    const float *const near[LIGHTPATH_CROSSTALK_TAPS], lightpath_complex *values);

#ifdef __cplusplus
}
#endif

#endif
