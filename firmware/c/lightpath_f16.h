/*
 * The float16 array of a transfer function, read from a stream one row at a time. `lightpath kernel fetch --format f16`
 * writes it, docs/compact-kernel.md describes it. The array is many times as large as a compact kernel, but its values
 * need no computation.
 *
 *   lightpath_f16_begin(&reader, values, count);
 *   while bytes arrive:
 *       while (length > 0) {
 *           status = lightpath_f16_feed(&reader, bytes, length, &used);
 *           if (status != LIGHTPATH_OK) stop;
 *           if (reader.row_ready) use row reader.row of H, in `values`;
 *           bytes += used; length -= used;
 *       }
 *   status = lightpath_f16_end(&reader);
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef LIGHTPATH_F16_H
#define LIGHTPATH_F16_H

#include "lightpath_kernel.h"

#ifdef __cplusplus
extern "C" {
#endif

/*
 * A reader of one array. rows, columns, row and row_ready are for reading; the other members are private. rows and
 * columns count once a row is ready. Before, while the header arrives, and after a refusal they may be those of half a
 * header.
 */
typedef struct lightpath_f16 {
    uint32_t rows;    /* of the padded grid: 2 * height_px */
    uint32_t columns; /* of the padded grid: 2 * width_px */
    uint32_t row;     /* the row of H in `values`, if row_ready. Zero frequency is at row 0, column 0 */
    bool row_ready;   /* whether the last lightpath_f16_feed completed a row */
    lightpath_complex *values;
    size_t values_max;
    lightpath_status status;
    uint32_t place;       /* byte of the header, or of the stored row */
    uint32_t stored_rows; /* complete rows */
    uint32_t number;      /* the side that is being read, or the bytes of a value so far */
    uint16_t header_bytes;
    uint8_t part; /* of the header's text */
    uint8_t sides;
    bool in_array;
} lightpath_f16;

/* Prepares to read an array into `values`, which has room for `values_max` values: 2 * width_px or more. */
void lightpath_f16_begin(lightpath_f16 *reader, lightpath_complex *values, size_t values_max);

/*
 * Reads `length` bytes, or fewer if a row is complete before; `*used` becomes their number. Rows arrive in the order of
 * the file: height_px, height_px + 1, ... 2 * height_px - 1, 0, 1, ... height_px - 1. Each row begins with zero
 * frequency, as that of lightpath_transfer_row does.
 *
 * LIGHTPATH_OK, or the reason why the file is refused. After a refusal every call repeats it. The header decides the
 * sides: when the first row is ready, compare reader->rows with twice your display's rows, and reader->columns with twice
 * its columns.
 */
lightpath_status lightpath_f16_feed(lightpath_f16 *reader, const uint8_t *bytes, size_t length, size_t *used);

/* Whether the array was complete: LIGHTPATH_OK, LIGHTPATH_F16_CUT, or the refusal. */
lightpath_status lightpath_f16_end(const lightpath_f16 *reader);

#ifdef __cplusplus
}
#endif

#endif
