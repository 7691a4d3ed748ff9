/*
 * Answers cases from one file, and prints for each: the verdict, the line, and what an accepted document says.
 *
 *   manifest_verdicts FILE
 *
 * The file has pinned root keys, then cases. Everything follows its length as a little-endian u32: the root keys; the
 * line of a case, the device's keyring (nothing: the root keys), the document, and the signatures that are right.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "manifest_cases.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

typedef struct packed {
    const uint8_t *bytes;
    size_t length;
    size_t at;
} packed;

/* The next part, in an allocation of its length: a sanitizer sees a byte read too much. */
static uint8_t *next_part(packed *file, size_t *length)
{
    *length = 0;
    if (file->length - file->at < 4u) {
        fail("the file ends too early", "next_part");
    }
    for (size_t i = 0; i < 4u; i++) {
        *length |= (size_t)file->bytes[file->at + i] << 8u * i;
    }
    file->at += 4u;
    if (file->length - file->at < *length) {
        fail("the file ends too early", "next_part");
    }
    uint8_t *part = allocate(*length);
    memcpy(part, file->bytes + file->at, *length);
    file->at += *length;
    return part;
}

static void print_hex(const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        printf("%02x", bytes[i]);
    }
}

static void print_keyring(const lightpath_keyring *keyring)
{
    printf(" %" PRIu32 " %" PRId64 " %" PRId64, keyring->version, keyring->issued_unix_s, keyring->expires_unix_s);
    for (size_t i = 0; i < keyring->root_count; i++) {
        printf(" root ");
        print_hex(keyring->roots[i], 32u);
    }
    for (size_t i = 0; i < keyring->key_count; i++) {
        printf(" key ");
        print_hex(keyring->keys[i].key, 32u);
        printf(" %" PRId64 " %" PRId64, keyring->keys[i].from_unix_s, keyring->keys[i].until_unix_s);
    }
    for (size_t i = 0; i < keyring->revoked_count; i++) {
        printf(" revoked ");
        print_hex(keyring->revoked[i], 32u);
    }
}

static void print_manifest(const lightpath_manifest *manifest)
{
    printf(" ");
    print_hex(manifest->optics, 32u);
    printf(" %" PRId64 " %.*s %" PRIu64 " %" PRIu32 " %.*s ", manifest->wavelength_pm, (int)manifest->place_length,
        manifest->place, manifest->generation, manifest->version, (int)LIGHTPATH_DIGEST_TEXT, manifest->digest_text);
    print_hex(manifest->digest, 32u);
    printf(" %" PRIu64 " %" PRIu32 " %" PRIu32 " %" PRIu64 " %d %" PRId64 " %" PRId64 " %.*s", manifest->size_bytes,
        manifest->width_px, manifest->height_px, manifest->pixel_pitch_pm, manifest->interpolated ? 1 : 0,
        manifest->issued_unix_s, manifest->expires_unix_s, (int)manifest->orders_length, manifest->orders);
}

static void answer_next(packed *file, const lightpath_keyring *pinned)
{
    static lightpath_keyring known;
    static answer given;
    static question asked;
    char line[TEXT_MAX];
    size_t line_length, known_length, length, signatures_length;
    uint8_t *text = next_part(file, &line_length);
    uint8_t *known_bytes = next_part(file, &known_length);
    uint8_t *bytes = next_part(file, &length);
    uint8_t *signatures = next_part(file, &signatures_length);
    if (line_length >= TEXT_MAX) {
        fail("the line is too long", "answer_next");
    }
    memcpy(line, text, line_length);
    line[line_length] = '\0';
    forget_signatures();
    for (size_t at = 0; at < signatures_length; at += SIGNATURE_BYTES) {
        add_signature(signatures + at);
    }
    known = *pinned;
    if (known_length > 0u) {
        know_keyring(&known, pinned, known_bytes, known_length);
    }
    read_question(&asked, line);
    /* What the code does not write must not look like what the case before it left. */
    memset(&given, 0xa5, sizeof given);
    answer_question(&given, &asked, &known, bytes, length);
    printf("%s %u", verdict_name(given.verdict), given.line);
    if (given.verdict == LIGHTPATH_TRUSTED && is_about(&asked, "keyring")) {
        print_keyring(&given.keyring);
    } else if (given.verdict == LIGHTPATH_TRUSTED && is_about(&asked, "manifest")) {
        print_manifest(&given.manifest);
    }
    printf("\n");
    free(text);
    free(known_bytes);
    free(bytes);
    free(signatures);
}

int main(int count, char **arguments)
{
    packed file = {NULL, 0, 0};
    lightpath_keyring pinned;
    size_t roots_length = 0;
    if (count != 2) {
        fail("usage", "manifest_verdicts FILE");
    }
    uint8_t *bytes = read_file(arguments[1], &file.length);
    file.bytes = bytes;
    uint8_t *roots = next_part(&file, &roots_length);
    lightpath_keyring_pin(&pinned, (const uint8_t(*)[32])roots, roots_length / 32u);
    free(roots);
    while (file.at < file.length) {
        answer_next(&file, &pinned);
    }
    free(bytes);
    return 0;
}
