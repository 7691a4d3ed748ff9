/*
 * A program that uses all code for manifests and nothing else: its size is that of the code with the compiler's
 * functions that it uses, and with Monocypher's Ed25519 and a plain SHA-256 if they are asked for.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "../../lightpath_manifest.h"

#ifdef LIGHTPATH_WITH_MONOCYPHER
#include "../sha256.h"

#include <monocypher-ed25519.h>
#endif

extern volatile uint8_t flash[4096];
extern volatile uint8_t ram[4096];

#ifdef LIGHTPATH_WITH_MONOCYPHER
static bool verify(const uint8_t key[32], const uint8_t *message, size_t length, const uint8_t signature[64])
{
    return crypto_ed25519_check(signature, key, message, length) == 0;
}

static const lightpath_crypto crypto = {verify, sha256_begin, sha256_update, sha256_end, (void *)(ram + 3072)};
#else
/* The compiler must believe that any functions are there. */
#define crypto (*(const lightpath_crypto *)(ram + 3072))
#endif

int main(void)
{
    lightpath_keyring *known = (lightpath_keyring *)ram;
    lightpath_keyring *next = (lightpath_keyring *)(ram + 1024);
    lightpath_manifest *manifest = (lightpath_manifest *)(ram + 2048);
    lightpath_body *body = (lightpath_body *)(ram + 2304);
    const lightpath_wanted *wanted = (const lightpath_wanted *)(ram + 2560);
    const int64_t now = *(volatile int64_t *)(ram + 2816);
    const uint8_t *bytes = (const uint8_t *)flash;
    lightpath_keyring_pin(known, (const uint8_t(*)[32])bytes, (size_t)now);
    lightpath_optics_digest((uint8_t *)(ram + 2752), now, now, &crypto);
    lightpath_verdict verdict = lightpath_keyring_renew(next, known, bytes, (size_t)now, now, &crypto);
    verdict |= lightpath_manifest_check(manifest, next, bytes, (size_t)now, wanted, now, &crypto);
    lightpath_body_begin(body, manifest, &crypto, (void *)(ram + 3584));
    verdict |= lightpath_body_update(body, bytes, (size_t)now);
    verdict |= lightpath_body_end(body);
    return lightpath_verdict_text(verdict)[0];
}
