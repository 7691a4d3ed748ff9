/*
 * Opening a compact kernel: every check that Lightpath's own decoder makes, in the same order.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_internal.h"

#define HEADER_BYTES 60u
#define CHECKSUM_BYTES 4u
#define NUMBER_BYTES 4u
/* Version of the layout for kernels that vary over the modulator. */
#define VERSION_VARYING 2u
/* Version of the layout for cross-talk and responses that vary. */
#define VERSION_UNEVEN 3u
#define VARIATION_ORDER_MAX 8u
#define HARMONICS_MAX 8u
#define METHOD_MAX 5u
/* Largest cross-talk. In the file's 32 bits it is a little larger. */
#define CROSSTALK_MAX 0.6
#define CROSSTALK_MAX_IN_FILE 0.60000002384185791015625

static double read_f64(const uint8_t *at)
{
    union {
        uint64_t bits;
        double number;
    } word;
    word.bits = (uint64_t)lightpath_read_u32(at) | (uint64_t)lightpath_read_u32(at + 4) << 32;
    return word.number;
}

/* An exponent of ones means infinity or no number. */
static bool is_finite_f32(const uint8_t *at)
{
    return (lightpath_read_u32(at) & 0x7f800000u) != 0x7f800000u;
}

/* CRC-32 of IEEE 802.3. The table has an entry for each half byte: 64 bytes of it suffice where memory is small. */
static uint32_t checksum_of(const uint8_t *bytes, size_t length)
{
    static const uint32_t table[16] = {
        0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u, 0x4db26158u, 0x5005713cu,
        0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu, 0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu,
    };
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < length; i++) {
        crc ^= bytes[i];
        crc = crc >> 4 ^ table[crc & 15u];
        crc = crc >> 4 ^ table[crc & 15u];
    }
    return ~crc;
}

/* Reads the header's small numbers, and finds the places of all others. `*length` becomes the length of the file. */
static lightpath_status read_shape(lightpath_kernel *kernel, const uint8_t *bytes, size_t *length)
{
    const bool is_uneven = bytes[4] == VERSION_UNEVEN;
    if (bytes[4] < 1u || bytes[4] > VERSION_UNEVEN) {
        return LIGHTPATH_UNKNOWN_VERSION;
    }
    if (bytes[11] > (is_uneven ? LIGHTPATH_ORDER_MAX + 1u : 0u)) {
        return LIGHTPATH_WRONG_RESPONSE_ORDER;
    }
    if (bytes[6] > LIGHTPATH_ORDER_MAX || bytes[7] > LIGHTPATH_ORDER_MAX) {
        return LIGHTPATH_WRONG_ORDER;
    }
    if (bytes[10] > VARIATION_ORDER_MAX || (!is_uneven && (bytes[10] > 0u) != (bytes[4] == VERSION_VARYING))) {
        return LIGHTPATH_WRONG_VARIATION_ORDER;
    }
    kernel->version = bytes[4];
    kernel->model = bytes[5];
    kernel->order = bytes[6];
    kernel->source_order = bytes[7];
    kernel->harmonics = bytes[8];
    kernel->method = bytes[9];
    kernel->variation_order = bytes[10];
    kernel->response_series = bytes[11];
    uint32_t numbers = HEADER_BYTES / NUMBER_BYTES;
    kernel->kernel_at = (uint16_t)(NUMBER_BYTES * numbers);
    numbers += 2u * lightpath_series_terms(kernel->order);
    kernel->source_at = (uint16_t)(NUMBER_BYTES * numbers);
    numbers += 2u * lightpath_series_terms(kernel->source_order);
    kernel->response_at = (uint16_t)(NUMBER_BYTES * numbers);
    numbers += 2u * kernel->harmonics + (is_uneven ? 2u : 0u);
    kernel->response_variation_at = (uint16_t)(NUMBER_BYTES * numbers);
    if (kernel->response_series > 0u) {
        numbers += 1u + lightpath_series_terms(kernel->response_series - 1u);
    }
    kernel->variation_at = (uint16_t)(NUMBER_BYTES * numbers);
    numbers += LIGHTPATH_POWERS * 2u * lightpath_series_terms(kernel->variation_order);
    *length = NUMBER_BYTES * numbers + CHECKSUM_BYTES;
    return LIGHTPATH_OK;
}

static bool is_between(double least, double number, double most)
{
    return number >= least && number <= most; /* false for what is no number */
}

static bool is_side(uint32_t side_px)
{
    return side_px > 0u && side_px <= LIGHTPATH_SIDE_PX_MAX;
}

static lightpath_status read_optics(lightpath_kernel *kernel, const uint8_t *bytes)
{
    kernel->height_px = lightpath_read_u32(bytes + 12);
    kernel->width_px = lightpath_read_u32(bytes + 16);
    kernel->pixel_pitch_m = read_f64(bytes + 20);
    kernel->wavelength_m = read_f64(bytes + 28);
    kernel->distance_m = read_f64(bytes + 36);
    if (!is_side(kernel->height_px) || !is_side(kernel->width_px)) {
        return LIGHTPATH_WRONG_SIDE;
    }
    if (!is_between(1e-8, kernel->pixel_pitch_m, 1e-2)) {
        return LIGHTPATH_WRONG_PITCH;
    }
    if (!is_between(100e-9, kernel->wavelength_m, 10e-6)) {
        return LIGHTPATH_WRONG_WAVELENGTH;
    }
    if (!is_between(-10.0, kernel->distance_m, 10.0) || kernel->distance_m == 0.0) {
        return LIGHTPATH_WRONG_DISTANCE;
    }
    return LIGHTPATH_OK;
}

static double read_crosstalk(const uint8_t *at)
{
    const double q = lightpath_read_f32(at);
    return q == CROSSTALK_MAX_IN_FILE ? CROSSTALK_MAX : q;
}

static lightpath_status read_numbers(lightpath_kernel *kernel, const uint8_t *bytes, size_t length)
{
    for (size_t at = 44; at < length - CHECKSUM_BYTES; at += NUMBER_BYTES) {
        if (!is_finite_f32(bytes + at)) {
            return LIGHTPATH_NUMBER_NOT_FINITE;
        }
    }
    kernel->gain = (float)lightpath_read_f32(bytes + 44);
    kernel->offset = (float)lightpath_read_f32(bytes + 48);
    kernel->zero_order.re = (float)lightpath_read_f32(bytes + 52);
    kernel->zero_order.im = (float)lightpath_read_f32(bytes + 56);
    kernel->crosstalk_x = 0.0;
    kernel->crosstalk_y = 0.0;
    if (kernel->version == VERSION_UNEVEN) {
        const uint8_t *crosstalk = bytes + kernel->response_at + 2u * NUMBER_BYTES * kernel->harmonics;
        kernel->crosstalk_x = read_crosstalk(crosstalk);
        kernel->crosstalk_y = read_crosstalk(crosstalk + NUMBER_BYTES);
    }
    if (!is_between(0.0, kernel->crosstalk_x, CROSSTALK_MAX) || !is_between(0.0, kernel->crosstalk_y, CROSSTALK_MAX)) {
        return LIGHTPATH_WRONG_CROSSTALK;
    }
    return LIGHTPATH_OK;
}

lightpath_status lightpath_kernel_open(lightpath_kernel *kernel, const uint8_t *bytes, size_t length)
{
    size_t expected = 0;
    if (length < HEADER_BYTES + CHECKSUM_BYTES || bytes[0] != 'L' || bytes[1] != 'P' || bytes[2] != 'K' ||
        bytes[3] != 'C') {
        return LIGHTPATH_NOT_A_KERNEL;
    }
    const lightpath_status shape = read_shape(kernel, bytes, &expected);
    if (shape != LIGHTPATH_OK) {
        return shape;
    }
    if (length != expected) {
        return LIGHTPATH_WRONG_LENGTH;
    }
    const size_t content = length - CHECKSUM_BYTES;
    if (checksum_of(bytes, content) != lightpath_read_u32(bytes + content)) {
        return LIGHTPATH_WRONG_CHECKSUM;
    }
    if (kernel->model < 3u || kernel->model > 5u) {
        return LIGHTPATH_UNKNOWN_MODEL;
    }
    if (kernel->method > METHOD_MAX) {
        return LIGHTPATH_UNKNOWN_METHOD;
    }
    if (kernel->harmonics > HARMONICS_MAX) {
        return LIGHTPATH_TOO_MANY_HARMONICS;
    }
    const lightpath_status optics = read_optics(kernel, bytes);
    if (optics != LIGHTPATH_OK) {
        return optics;
    }
    kernel->bytes = bytes;
    return read_numbers(kernel, bytes, length);
}
