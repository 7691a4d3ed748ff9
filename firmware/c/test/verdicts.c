/*
 * Opens kernels from one file, in which each follows its length as a little-endian u32, and prints the status of each
 * as a number.
 *
 *   verdicts FILE
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "../lightpath_kernel.h"
#include "vector_files.h"

#include <stdlib.h>
#include <string.h>

int main(int count, char **arguments)
{
    size_t length = 0;
    size_t at = 0;
    if (count != 2) {
        fail("usage", "verdicts FILE");
    }
    uint8_t *bytes = read_file(arguments[1], &length);
    while (at + 4u <= length) {
        lightpath_kernel kernel;
        size_t size = 0;
        for (size_t i = 0; i < 4u; i++) {
            size |= (size_t)bytes[at + i] << 8u * i;
        }
        /* An allocation of this length, so that a sanitizer sees a byte read too much. */
        uint8_t *exact = allocate(size);
        memcpy(exact, bytes + at + 4u, size);
        printf("%d\n", (int)lightpath_kernel_open(&kernel, exact, size));
        free(exact);
        at += 4u + size;
    }
    free(bytes);
    return 0;
}
