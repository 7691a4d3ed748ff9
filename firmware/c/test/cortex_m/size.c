/*
 * A program that uses the whole decoder and nothing else: its size is that of the decoder with the library below it.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "../../lightpath_f16.h"
#include "../../lightpath_kernel.h"

extern volatile uint8_t flash[4096];
extern volatile uint8_t ram[4096];

int main(void)
{
    /* The addresses come from the linker's command line: the compiler must believe that anything is there. */
    lightpath_kernel *kernel = (lightpath_kernel *)ram;
    lightpath_transfer *transfer = (lightpath_transfer *)(ram + 256);
    lightpath_f16 *reader = (lightpath_f16 *)(ram + 512);
    lightpath_complex *values = (lightpath_complex *)(ram + 1024);
    double *numbers = (double *)(ram + 2048);
    size_t *count = (size_t *)(ram + 768);
    const float *const *near = (const float *const *)(ram + 3072);
    const uint8_t *bytes = (const uint8_t *)flash;
    lightpath_status status = lightpath_kernel_open(kernel, bytes, *count);
    status |= lightpath_scratch_doubles(kernel, 1u, count);
    status |= lightpath_transfer_begin(transfer, kernel, numbers, *count);
    *count = (size_t)lightpath_transfer_additions(transfer, 1u);
    status |= lightpath_transfer_row(transfer, 1u, numbers[0], numbers[1], values);
    status |= lightpath_source_row(kernel, 1u, values);
    numbers[2] = lightpath_response(kernel, numbers[0], lightpath_response_variation(kernel, numbers[0], numbers[1]));
    lightpath_crosstalk_weights(numbers[2], numbers);
    status |= lightpath_field_row(kernel, 1u, near, values);
    lightpath_f16_begin(reader, values, 64u);
    status |= lightpath_f16_feed(reader, bytes, *count, count);
    status |= lightpath_f16_end(reader);
    return lightpath_status_text(status)[0];
}
