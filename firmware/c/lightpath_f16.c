/*
 * Float16 arrays in NumPy's .npy form, version 1.0:
 *
 *   bytes 0 to 7    \x93NUMPY, 1, 0
 *   bytes 8, 9      length of the header, little-endian
 *   header          {'descr': '<f2', 'fortran_order': False, 'shape': (rows, columns, 2), }, spaces, a line feed
 *   then            rows x columns pairs of little-endian float16, real part first, zero frequency in the middle
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_f16.h"

#define PREFIX_BYTES 10u
/* Lightpath and NumPy write 118 bytes. */
#define HEADER_BYTES_MAX 512u
#define SIDE_MAX (2u * LIGHTPATH_SIDE_PX_MAX)
#define VALUE_BYTES 4u

/* Stands for a side in the header's text. */
#define SIDE '#'

static const char *header_text(void)
{
    return "{'descr': '<f2', 'fortran_order': False, 'shape': (#, #, 2), }";
}

void lightpath_f16_begin(lightpath_f16 *reader, lightpath_complex *values, size_t values_max)
{
    reader->rows = 0;
    reader->columns = 0;
    reader->row = 0;
    reader->row_ready = false;
    reader->values = values;
    reader->values_max = values_max;
    reader->status = LIGHTPATH_OK;
    reader->place = 0;
    reader->stored_rows = 0;
    reader->number = 0;
    reader->header_bytes = 0;
    reader->part = 0;
    reader->sides = 0;
    reader->in_array = false;
}

static lightpath_status read_prefix(lightpath_f16 *reader, uint8_t byte)
{
    static const uint8_t start[8] = {0x93, 'N', 'U', 'M', 'P', 'Y', 1, 0};
    if (reader->place < sizeof start) {
        return byte == start[reader->place] ? LIGHTPATH_OK : LIGHTPATH_F16_NOT_AN_ARRAY;
    }
    reader->header_bytes = (uint16_t)(reader->header_bytes | (uint16_t)byte << (reader->place == sizeof start ? 0 : 8));
    const bool is_too_long = reader->place + 1u == PREFIX_BYTES && reader->header_bytes > HEADER_BYTES_MAX;
    return is_too_long ? LIGHTPATH_F16_WRONG_HEADER : LIGHTPATH_OK;
}

/* Ends a side of the shape: rows, then columns. */
static lightpath_status end_side(lightpath_f16 *reader)
{
    if (reader->number < 2u || reader->number % 2u == 1u) {
        return LIGHTPATH_F16_WRONG_SHAPE;
    }
    if (reader->sides == 0u) {
        reader->rows = reader->number;
    } else {
        reader->columns = reader->number;
    }
    reader->sides++;
    reader->part++;
    reader->number = 0;
    return LIGHTPATH_OK;
}

/* Compares the header with its text, byte by byte. The spaces after the text end with a line feed. */
static lightpath_status read_header(lightpath_f16 *reader, uint8_t byte)
{
    const bool is_last = reader->place + 1u >= PREFIX_BYTES + reader->header_bytes;
    const char *text = header_text();
    if (is_last) {
        const bool is_complete = text[reader->part] == '\0' && byte == '\n';
        reader->in_array = is_complete;
        if (is_complete && reader->columns > reader->values_max) {
            return LIGHTPATH_F16_ROW_TOO_LONG;
        }
        return is_complete ? LIGHTPATH_OK : LIGHTPATH_F16_WRONG_HEADER;
    }
    if (text[reader->part] == SIDE) {
        if (byte >= '0' && byte <= '9') {
            /* Zeros before a number have no place in the text. */
            if (byte == '0' && reader->number == 0u) {
                return LIGHTPATH_F16_WRONG_SHAPE;
            }
            reader->number = 10u * reader->number + (uint32_t)(byte - '0');
            return reader->number <= SIDE_MAX ? LIGHTPATH_OK : LIGHTPATH_F16_WRONG_SHAPE;
        }
        const lightpath_status side = end_side(reader);
        if (side != LIGHTPATH_OK) {
            return side;
        }
    }
    if (text[reader->part] == '\0') {
        return byte == ' ' ? LIGHTPATH_OK : LIGHTPATH_F16_WRONG_HEADER;
    }
    const bool is_same = byte == (uint8_t)text[reader->part];
    reader->part++;
    return is_same ? LIGHTPATH_OK : LIGHTPATH_F16_WRONG_HEADER;
}

/* Converts a float16 exactly. False for infinity and for what is no number. */
static bool read_half(uint32_t bits, float *number)
{
    const uint32_t exponent = bits >> 10 & 31u;
    const uint32_t fraction = bits & 1023u;
    union {
        uint32_t bits;
        float number;
    } word;
    word.bits = (exponent + 112u) << 23 | fraction << 13;
    if (exponent == 0u) {
        word.number = (float)fraction * 5.9604644775390625e-8f; /* 2^-24 */
    }
    *number = (bits & 0x8000u) != 0u ? -word.number : word.number;
    return exponent != 31u;
}

/* Index of a stored row or column when zero frequency, which is stored in the middle, has index 0. */
static uint32_t from_zero_frequency(uint32_t stored, uint32_t count)
{
    return stored < count / 2u ? stored + count / 2u : stored - count / 2u;
}

static lightpath_status read_value(lightpath_f16 *reader, uint8_t byte)
{
    if (reader->stored_rows == reader->rows) {
        return LIGHTPATH_F16_TOO_LONG;
    }
    const uint32_t column = reader->place / VALUE_BYTES;
    reader->number |= (uint32_t)byte << 8u * (reader->place % VALUE_BYTES);
    reader->place++;
    if (reader->place % VALUE_BYTES != 0u) {
        return LIGHTPATH_OK;
    }
    lightpath_complex *value = &reader->values[from_zero_frequency(column, reader->columns)];
    const bool re_is_finite = read_half(reader->number & 0xffffu, &value->re);
    const bool im_is_finite = read_half(reader->number >> 16, &value->im);
    reader->number = 0;
    if (column + 1u == reader->columns) {
        reader->place = 0;
        reader->row = from_zero_frequency(reader->stored_rows, reader->rows);
        reader->stored_rows++;
        reader->row_ready = true;
    }
    return re_is_finite && im_is_finite ? LIGHTPATH_OK : LIGHTPATH_VALUE_NOT_FINITE;
}

static lightpath_status read_byte(lightpath_f16 *reader, uint8_t byte)
{
    if (reader->in_array) {
        return read_value(reader, byte);
    }
    const lightpath_status status =
        reader->place < PREFIX_BYTES ? read_prefix(reader, byte) : read_header(reader, byte);
    reader->place = reader->in_array ? 0u : reader->place + 1u;
    return status;
}

lightpath_status lightpath_f16_feed(lightpath_f16 *reader, const uint8_t *bytes, size_t length, size_t *used)
{
    reader->row_ready = false;
    *used = 0;
    while (*used < length && reader->status == LIGHTPATH_OK && !reader->row_ready) {
        reader->status = read_byte(reader, bytes[*used]);
        *used += 1u;
    }
    if (reader->status != LIGHTPATH_OK) {
        reader->row_ready = false;
    }
    return reader->status;
}

lightpath_status lightpath_f16_end(const lightpath_f16 *reader)
{
    if (reader->status != LIGHTPATH_OK) {
        return reader->status;
    }
    return reader->in_array && reader->stored_rows == reader->rows ? LIGHTPATH_OK : LIGHTPATH_F16_CUT;
}
