/*
 * SHA-256 as FIPS 180-4 writes it, sections 5.1.1 and 6.2.2. The names of numbers and functions are those of the
 * standard.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "sha256.h"

static const uint32_t k[64] = {0x428a2f98u, 0x71374491u, 0xb5c0fbcfu, 0xe9b5dba5u, 0x3956c25bu, 0x59f111f1u,
    0x923f82a4u, 0xab1c5ed5u, 0xd807aa98u, 0x12835b01u, 0x243185beu, 0x550c7dc3u, 0x72be5d74u, 0x80deb1feu,
    0x9bdc06a7u, 0xc19bf174u, 0xe49b69c1u, 0xefbe4786u, 0x0fc19dc6u, 0x240ca1ccu, 0x2de92c6fu, 0x4a7484aau,
    0x5cb0a9dcu, 0x76f988dau, 0x983e5152u, 0xa831c66du, 0xb00327c8u, 0xbf597fc7u, 0xc6e00bf3u, 0xd5a79147u,
    0x06ca6351u, 0x14292967u, 0x27b70a85u, 0x2e1b2138u, 0x4d2c6dfcu, 0x53380d13u, 0x650a7354u, 0x766a0abbu,
    0x81c2c92eu, 0x92722c85u, 0xa2bfe8a1u, 0xa81a664bu, 0xc24b8b70u, 0xc76c51a3u, 0xd192e819u, 0xd6990624u,
    0xf40e3585u, 0x106aa070u, 0x19a4c116u, 0x1e376c08u, 0x2748774cu, 0x34b0bcb5u, 0x391c0cb3u, 0x4ed8aa4au,
    0x5b9cca4fu, 0x682e6ff3u, 0x748f82eeu, 0x78a5636fu, 0x84c87814u, 0x8cc70208u, 0x90befffau, 0xa4506cebu,
    0xbef9a3f7u, 0xc67178f2u};

static uint32_t rotr(uint32_t x, unsigned n)
{
    return x >> n | x << (32u - n);
}

static void compress(sha256 *hash)
{
    uint32_t w[64];
    uint32_t v[8]; /* a to h */
    for (size_t t = 0; t < 16u; t++) {
        const uint8_t *at = hash->block + 4u * t;
        w[t] = (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | (uint32_t)at[3];
    }
    for (size_t t = 16; t < 64u; t++) {
        const uint32_t s0 = rotr(w[t - 15u], 7) ^ rotr(w[t - 15u], 18) ^ w[t - 15u] >> 3;
        const uint32_t s1 = rotr(w[t - 2u], 17) ^ rotr(w[t - 2u], 19) ^ w[t - 2u] >> 10;
        w[t] = s1 + w[t - 7u] + s0 + w[t - 16u];
    }
    for (size_t i = 0; i < 8u; i++) {
        v[i] = hash->state[i];
    }
    for (size_t t = 0; t < 64u; t++) {
        const uint32_t sum1 = rotr(v[4], 6) ^ rotr(v[4], 11) ^ rotr(v[4], 25);
        const uint32_t ch = (v[4] & v[5]) ^ (~v[4] & v[6]);
        const uint32_t t1 = v[7] + sum1 + ch + k[t] + w[t];
        const uint32_t sum0 = rotr(v[0], 2) ^ rotr(v[0], 13) ^ rotr(v[0], 22);
        const uint32_t maj = (v[0] & v[1]) ^ (v[0] & v[2]) ^ (v[1] & v[2]);
        for (size_t i = 7; i > 0u; i--) {
            v[i] = v[i - 1u];
        }
        v[4] += t1;
        v[0] = t1 + sum0 + maj;
    }
    for (size_t i = 0; i < 8u; i++) {
        hash->state[i] += v[i];
    }
}

void sha256_begin(void *context)
{
    static const uint32_t start[8] = {0x6a09e667u, 0xbb67ae85u, 0x3c6ef372u, 0xa54ff53au, 0x510e527fu, 0x9b05688cu,
        0x1f83d9abu, 0x5be0cd19u};
    sha256 *hash = (sha256 *)context;
    hash->length = 0;
    for (size_t i = 0; i < 8u; i++) {
        hash->state[i] = start[i];
    }
}

void sha256_update(void *context, const uint8_t *bytes, size_t length)
{
    sha256 *hash = (sha256 *)context;
    for (size_t i = 0; i < length; i++) {
        const size_t place = (size_t)(hash->length & 63u);
        hash->block[place] = bytes[i];
        hash->length++;
        if (place == 63u) {
            compress(hash);
        }
    }
}

void sha256_end(void *context, uint8_t digest[32])
{
    static const uint8_t one = 0x80, zero = 0;
    sha256 *hash = (sha256 *)context;
    const uint64_t bits = hash->length * 8u;
    sha256_update(hash, &one, 1);
    while ((hash->length & 63u) != 56u) {
        sha256_update(hash, &zero, 1);
    }
    for (unsigned i = 0; i < 8u; i++) {
        const uint8_t byte = (uint8_t)(bits >> (56u - 8u * i));
        sha256_update(hash, &byte, 1);
    }
    for (size_t i = 0; i < 32u; i++) {
        digest[i] = (uint8_t)(hash->state[i / 4u] >> (24u - 8u * (unsigned)(i % 4u)));
    }
}
