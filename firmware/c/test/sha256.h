/*
 * SHA-256 of FIPS 180-4, plain and slow.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef LIGHTPATH_TEST_SHA256_H
#define LIGHTPATH_TEST_SHA256_H

#include <stddef.h>
#include <stdint.h>

typedef struct sha256 {
    uint64_t length;
    uint32_t state[8];
    uint8_t block[64];
} sha256;

/* In the form that lightpath_crypto has them: the context is a sha256. */
void sha256_begin(void *context);
void sha256_update(void *context, const uint8_t *bytes, size_t length);
void sha256_end(void *context, uint8_t digest[32]);

#endif
