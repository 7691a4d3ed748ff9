/*
 * Sentences about statuses. A program that does not call lightpath_status_text does not need this file.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_kernel.h"

const char *lightpath_status_text(lightpath_status status)
{
    switch (status) {
    case LIGHTPATH_OK:
        return "Everything is right.";
    case LIGHTPATH_NOT_A_KERNEL:
        return "The file is no compact kernel: it has less than 64 bytes or does not start with LPKC.";
    case LIGHTPATH_UNKNOWN_VERSION:
        return "The file's layout has a version that this decoder does not know: it reads 1, 2 and 3.";
    case LIGHTPATH_WRONG_RESPONSE_ORDER:
        return "Byte 11, the response's variation, must be 0 to 13 in version 3 and 0 in the others.";
    case LIGHTPATH_WRONG_ORDER:
        return "The order of the kernel's or the source's series is above 12.";
    case LIGHTPATH_WRONG_VARIATION_ORDER:
        return "The order of the variation must be 0 in version 1, 1 to 8 in version 2, 0 to 8 in version 3.";
    case LIGHTPATH_WRONG_LENGTH:
        return "The file is longer or shorter than its header says.";
    case LIGHTPATH_WRONG_CHECKSUM:
        return "The file does not match its checksum: it was damaged, copy it again.";
    case LIGHTPATH_UNKNOWN_MODEL:
        return "The number of the model must be 3, 4 or 5.";
    case LIGHTPATH_UNKNOWN_METHOD:
        return "The number of the method must be 0 to 5.";
    case LIGHTPATH_TOO_MANY_HARMONICS:
        return "The phase response has more than 8 harmonics.";
    case LIGHTPATH_WRONG_SIDE:
        return "The display must have 1 to 16384 rows and columns.";
    case LIGHTPATH_WRONG_PITCH:
        return "The pixel pitch must be 10 nm to 10 mm.";
    case LIGHTPATH_WRONG_WAVELENGTH:
        return "The wavelength must be 100 nm to 10 micrometres.";
    case LIGHTPATH_WRONG_DISTANCE:
        return "The distance must be -10 m to 10 m, and not 0.";
    case LIGHTPATH_NUMBER_NOT_FINITE:
        return "The file holds a number that is not finite.";
    case LIGHTPATH_WRONG_CROSSTALK:
        return "The cross-talk must be 0 to 0.6.";
    case LIGHTPATH_TOO_MANY_FREQUENCIES:
        return "The band response has no sum of an allowed size for this pitch, wavelength and distance.";
    case LIGHTPATH_SCRATCH_TOO_SMALL:
        return "The scratch memory is too small for one row.";
    case LIGHTPATH_NO_SUCH_ROW:
        return "The grid has fewer rows.";
    case LIGHTPATH_NO_SUCH_PLACE:
        return "The place is not on the modulator, whose x and y are from -1 to 1.";
    case LIGHTPATH_VALUE_NOT_FINITE:
        return "A value of this row is not finite, or too large for 32 bits.";
    case LIGHTPATH_F16_NOT_AN_ARRAY:
        return "The file does not start like a .npy file of version 1.0.";
    case LIGHTPATH_F16_WRONG_HEADER:
        return "The header is not that of a float16 array in C order.";
    case LIGHTPATH_F16_WRONG_SHAPE:
        return "The array must have the shape [rows, columns, 2], with even sides from 2 to 32768.";
    case LIGHTPATH_F16_ROW_TOO_LONG:
        return "A row of the array is longer than the memory for it.";
    case LIGHTPATH_F16_CUT:
        return "The array ends before its last row is complete.";
    case LIGHTPATH_F16_TOO_LONG:
        return "The file has more bytes than its array.";
    case LIGHTPATH_STATUS_COUNT:
        break;
    }
    return "This number is no status.";
}
