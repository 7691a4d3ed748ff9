/*
 * Measures the decoder on an emulated Cortex-M: instructions and stack.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "../../lightpath_f16.h"
#include "../../lightpath_kernel.h"
#include "../vector_files.h"
#include "stopwatch.h"

#include <string.h>

#define ROWS 90u
#define COLUMNS 160u
#define ORDER 5u
/* Scratch memory for eight rows of any method. */
#define SCRATCH_MAX 8192u

/* One piece of work, with what it works on. */
typedef struct bench {
    uint8_t file[4096];
    size_t length;
    lightpath_kernel kernel;
    lightpath_transfer transfer;
    double scratch[SCRATCH_MAX];
    lightpath_complex values[2u * COLUMNS];
    float phases[COLUMNS];
    lightpath_f16 reader;
} bench;

static bench all;

static void put_f64(uint8_t *at, double number)
{
    memcpy(at, &number, sizeof number);
}

static size_t terms(size_t order)
{
    return (order + 1u) * (order + 2u) / 2u - 1u;
}

/* A kernel of order 5 with a source of order 5, three harmonics, cross-talk, a varying response and variation. */
static void make_kernel(uint8_t method, uint8_t variation_order)
{
    const size_t numbers = 2u * (2u * terms(ORDER) + 3u + 5u * terms(variation_order)) + 2u + 1u + terms(2u);
    const uint8_t small[8] = {3, 4, ORDER, ORDER, 3, method, variation_order, 3};
    memset(all.file, 0, sizeof all.file);
    memcpy(all.file, "LPKC", 4);
    memcpy(all.file + 4, small, sizeof small);
    all.file[12] = ROWS;
    all.file[16] = COLUMNS;
    put_f64(all.file + 20, 8e-6);
    put_f64(all.file + 28, 515e-9);
    put_f64(all.file + 36, 0.02);
    for (size_t i = 0; i < numbers; i++) {
        const float number = 0.01f * (float)(i % 7u);
        memcpy(all.file + 60u + 4u * i, &number, sizeof number);
    }
    all.length = 64u + 4u * numbers;
    renew_checksum(all.file, all.length);
}

static void open_kernel(void)
{
    const lightpath_status status = lightpath_kernel_open(&all.kernel, all.file, all.length);
    if (status != LIGHTPATH_OK) {
        fail("the kernel is refused", lightpath_status_text(status));
    }
}

static void compute_row(void)
{
    if (lightpath_transfer_row(&all.transfer, 3u, 0.5, -0.5, all.values) != LIGHTPATH_OK) {
        fail("the row is refused", "measure");
    }
}

static void compute_source(void)
{
    if (lightpath_source_row(&all.kernel, 3u, all.values) != LIGHTPATH_OK) {
        fail("the row is refused", "source");
    }
}

static void compute_field(void)
{
    const float *const near[7] = {
        all.phases, all.phases, all.phases, all.phases, all.phases, all.phases, all.phases};
    if (lightpath_field_row(&all.kernel, 3u, near, all.values) != LIGHTPATH_OK) {
        fail("the row is refused", "field");
    }
}

/* A header and one row of zeros. */
static void read_array(void)
{
    static const char start[] =
        "\x93NUMPY\x01\x00v\x00{'descr': '<f2', 'fortran_order': False, 'shape': (180, 320, 2), }";
    static uint8_t bytes[128u + 8u * COLUMNS];
    size_t used = 0;
    memset(bytes, ' ', 127u);
    memcpy(bytes, start, sizeof start - 1u);
    bytes[127] = '\n';
    memset(bytes + 128, 0, 8u * COLUMNS);
    lightpath_f16_begin(&all.reader, all.values, 2u * COLUMNS);
    if (lightpath_f16_feed(&all.reader, bytes, sizeof bytes, &used) != LIGHTPATH_OK || !all.reader.row_ready) {
        fail("the array is refused", "measure");
    }
}

/* The sums of the first row, alone or with its group, then the row itself. */
static void measure_method(uint8_t method, const char *name, uint32_t rows_together, const char *together)
{
    char title[64];
    size_t doubles = 0;
    make_kernel(method, 0u);
    open_kernel();
    if (lightpath_scratch_doubles(&all.kernel, rows_together, &doubles) != LIGHTPATH_OK || doubles > SCRATCH_MAX ||
        lightpath_transfer_begin(&all.transfer, &all.kernel, all.scratch, doubles) != LIGHTPATH_OK) {
        fail("there is too little memory", name);
    }
    const uint64_t additions = lightpath_transfer_additions(&all.transfer, 3u);
    if (additions > 0u) {
        snprintf(title, sizeof title, "%s, sums%s", name, together);
        measure(title, compute_row, additions, "addition");
    }
    if (rows_together == 1u) {
        snprintf(title, sizeof title, "%s, row", name);
        measure(title, compute_row, 2u * COLUMNS, "value");
    }
}

int main(void)
{
    begin_measuring();
    make_kernel(0u, 0u);
    measure("open", open_kernel, all.length, "byte");
    measure_method(0u, "method 0", 1u, "");
    measure_method(1u, "method 1", 1u, "");
    measure_method(2u, "method 2", 1u, ", one row");
    measure_method(2u, "method 2", 8u, ", eight rows");
    measure_method(3u, "method 3", 1u, ", one row");
    measure_method(3u, "method 3", 8u, ", eight rows");
    measure_method(4u, "method 4", 1u, "");
    measure_method(5u, "method 5", 1u, "");
    make_kernel(0u, 5u);
    open_kernel();
    (void)lightpath_transfer_begin(&all.transfer, &all.kernel, NULL, 0u);
    measure("method 0, varying, row", compute_row, 2u * COLUMNS, "value");
    measure("source, row", compute_source, COLUMNS, "value");
    measure("field with cross-talk, row", compute_field, COLUMNS, "value");
    measure("float16 array, header and row", read_array, 2u * COLUMNS, "value");
    return 0;
}
