/*
 * Measures the code for manifests on an emulated Cortex-M: instructions and stack. SHA-256 is the plain one of the
 * tests. Without Monocypher, every signature is right.
 *
 *   measure_manifest FOLDER       FOLDER is firmware/vectors/manifests
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "../manifest_cases.h"
#include "../sha256.h"
#include "stopwatch.h"

#include <stdlib.h>
#include <string.h>

#define PIECE 4096u
/* The last line of a manifest: "signature ", 128 digits, a line feed. */
#define SIGNATURE_LINE_BYTES 139u

/* What the work is done on. */
typedef struct bench {
    lightpath_crypto crypto;
    lightpath_keyring pinned;
    lightpath_keyring next;
    lightpath_keyring known;
    lightpath_manifest manifest;
    lightpath_body body;
    sha256 body_hash;
    uint8_t *bytes;
    size_t length;
    uint8_t signature[64];
    uint8_t piece[PIECE];
} bench;

static bench all;

#ifndef LIGHTPATH_WITH_MONOCYPHER
static bool believe(const uint8_t key[32], const uint8_t *message, size_t length, const uint8_t signature[64])
{
    (void)key;
    (void)message;
    (void)length;
    (void)signature;
    return true;
}
#endif

static void expect(lightpath_verdict verdict)
{
    if (verdict != LIGHTPATH_TRUSTED) {
        fail("the document is refused", lightpath_verdict_text(verdict));
    }
}

static void renew(void)
{
    expect(lightpath_keyring_renew(
        &all.next, &all.pinned, all.bytes, all.length, LIGHTPATH_NO_CLOCK, &all.crypto));
}

static void check(void)
{
    lightpath_wanted wanted = {"pluto", "compact", {0}, 0};
    lightpath_optics_digest(wanted.optics, 515000, 150000000, &all.crypto);
    expect(lightpath_manifest_check(
        &all.manifest, &all.known, all.bytes, all.length, &wanted, LIGHTPATH_NO_CLOCK, &all.crypto));
}

static void update(void)
{
    expect(lightpath_body_update(&all.body, all.piece, PIECE));
}

static void hash(void)
{
    sha256_update(&all.body_hash, all.piece, PIECE);
}

static void verify(void)
{
    if (!all.crypto.verify(all.known.keys[0].key, all.bytes, all.length - SIGNATURE_LINE_BYTES, all.signature)) {
        fail("the signature is wrong", "verify");
    }
}

static void load(const char *folder, const char *name)
{
    char path[TEXT_MAX];
    free(all.bytes);
    join(path, folder, name, "");
    all.bytes = read_file(path, &all.length);
}

int main(int count, char **arguments)
{
    char line[TEXT_MAX];
    char path[TEXT_MAX];
    uint8_t roots[2][32];
    if (count < 2) {
        fail("usage", "measure_manifest FOLDER");
    }
    const char *folder = arguments[1];
    all.crypto = *test_crypto();
#ifndef LIGHTPATH_WITH_MONOCYPHER
    all.crypto.verify = believe;
#endif
    join(path, folder, "roots.txt", "");
    FILE *text = open_text(path);
    for (size_t i = 0; i < 2u && next_line(text, line); i++) {
        read_hex_word(line, roots[i], 32u);
    }
    fclose(text);
    lightpath_keyring_pin(&all.pinned, (const uint8_t(*)[32])roots, 2u);
    begin_measuring();
    load(folder, "first.keyring");
    measure("keyring of 7 keys", renew, 1u, "document");
    all.known = all.next;
    load(folder, "largest.keyring");
    measure("largest keyring", renew, 1u, "document");
    load(folder, "good.manifest");
    measure("manifest, 3 names of keys", check, 1u, "document");
    strncpy(line, (const char *)all.bytes + all.length - 129u, 128u);
    line[128] = '\0';
    read_hex_word(line, all.signature, sizeof all.signature);
    measure("verify alone", verify, 1u, "signature");
    all.manifest.size_bytes = 2u * PIECE;
    lightpath_body_begin(&all.body, &all.manifest, &all.crypto, &all.body_hash);
    measure("file", update, PIECE, "byte");
    measure("plain SHA-256 alone", hash, PIECE, "byte");
    return 0;
}
