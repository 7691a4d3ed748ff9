/*
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "manifest_cases.h"

#include "sha256.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#ifdef LIGHTPATH_WITH_MONOCYPHER
#include <monocypher-ed25519.h>
#endif

#define SIGNATURES_MAX 512

static uint8_t right_signatures[SIGNATURES_MAX][SIGNATURE_BYTES];
static size_t signature_count;

void add_signature(const uint8_t bytes[SIGNATURE_BYTES])
{
    if (signature_count == SIGNATURES_MAX) {
        fail("there are more signatures than expected", "add_signature");
    }
    memcpy(right_signatures[signature_count++], bytes, SIGNATURE_BYTES);
}

void forget_signatures(void)
{
    signature_count = 0;
}

#ifdef LIGHTPATH_WITH_MONOCYPHER
static bool verify(const uint8_t key[32], const uint8_t *message, size_t length, const uint8_t signature[64])
{
    return crypto_ed25519_check(signature, key, message, length) == 0;
}
#else
static bool verify(const uint8_t key[32], const uint8_t *message, size_t length, const uint8_t signature[64])
{
    uint8_t wanted[SIGNATURE_BYTES];
    sha256 hash;
    sha256_begin(&hash);
    sha256_update(&hash, message, length);
    memcpy(wanted, key, 32u);
    sha256_end(&hash, wanted + 32);
    memcpy(wanted + 64, signature, 64u);
    for (size_t i = 0; i < signature_count; i++) {
        if (memcmp(right_signatures[i], wanted, SIGNATURE_BYTES) == 0) {
            return true;
        }
    }
    return false;
}
#endif

const lightpath_crypto *test_crypto(void)
{
    static sha256 context;
    static const lightpath_crypto crypto = {verify, sha256_begin, sha256_update, sha256_end, &context};
    return &crypto;
}

void read_hex_word(const char *digits, uint8_t *bytes, size_t count)
{
    if (strlen(digits) < 2u * count) {
        fail("the text has too few digits", digits);
    }
    for (size_t i = 0; i < count; i++) {
        const char pair[3] = {digits[2u * i], digits[2u * i + 1u], '\0'};
        char *end;
        bytes[i] = (uint8_t)strtoul(pair, &end, 16);
        if (end != pair + 2) {
            fail("the text is no hexadecimal number", digits);
        }
    }
}

void read_question(question *asked, const char *line)
{
    asked->count = 0;
    strcpy(asked->line, line);
    for (char *word = strtok(asked->line, " "); word != NULL; word = strtok(NULL, " ")) {
        if (asked->count == WORDS_MAX) {
            fail("the case has too many words", line);
        }
        asked->words[asked->count++] = word;
    }
    const size_t wanted = is_about(asked, "manifest") ? 10u : is_about(asked, "keyring") ? 6u : 5u;
    if (asked->count != wanted) {
        fail("the case has another number of words", line);
    }
}

bool is_about(const question *asked, const char *kind)
{
    return strcmp(asked->words[0], kind) == 0;
}

const char *verdict_name(lightpath_verdict verdict)
{
    static const char *const names[LIGHTPATH_VERDICT_COUNT] = {"trusted", "document_too_large", "document_not_text",
        "document_other_line", "document_other_version", "document_wrong_value", "document_too_long",
        "keyring_wrong_signature", "keyring_older", "keyring_different", "keyring_not_yet", "keyring_expired", "key_unknown", "key_revoked", "key_not_yet",
        "key_expired", "manifest_wrong_signature", "manifest_not_yet", "manifest_expired", "other_display",
        "other_optics", "other_format", "lower_generation", "body_longer", "body_shorter",
        "body_corrupt"};
    if (verdict >= LIGHTPATH_VERDICT_COUNT) {
        fail("the code gave no verdict", "verdict_name");
    }
    return names[verdict];
}

static int64_t signed_word(const char *word)
{
    return (int64_t)strtoimax(word, NULL, 10);
}

static int64_t time_word(const char *word)
{
    if (strcmp(word, "none") == 0) {
        return LIGHTPATH_NO_CLOCK;
    }
    const bool is_bound = word[strlen(word) - 1u] == '+';
    return is_bound ? LIGHTPATH_AT_LEAST(signed_word(word)) : signed_word(word);
}

/* The file in pieces of one length. */
static lightpath_verdict check_body(
    const lightpath_manifest *manifest, const uint8_t *bytes, size_t length, size_t piece)
{
    lightpath_body body;
    sha256 context;
    lightpath_body_begin(&body, manifest, test_crypto(), &context);
    for (size_t at = 0; at < length; at += piece) {
        const lightpath_verdict now =
            lightpath_body_update(&body, bytes + at, length - at < piece ? length - at : piece);
        const bool is_longer = (at + piece < length ? at + piece : length) > manifest->size_bytes;
        if (now != (is_longer ? LIGHTPATH_BODY_LONGER : LIGHTPATH_TRUSTED)) {
            fail("a body was not refused where it became too long, or before", verdict_name(now));
        }
    }
    const lightpath_verdict verdict = lightpath_body_end(&body);
    if (lightpath_body_end(&body) != verdict) {
        fail("the second end of a body gave another verdict", verdict_name(verdict));
    }
    if (lightpath_body_update(&body, bytes, length > 0u ? 1u : 0u) == LIGHTPATH_TRUSTED && length > 0u) {
        fail("a body was continued after its end", verdict_name(verdict));
    }
    return verdict;
}

static lightpath_verdict check_pieces(const question *asked, const uint8_t *bytes, size_t length)
{
    static const size_t pieces[] = {1, 7, 64, 4096};
    lightpath_manifest manifest;
    manifest.size_bytes = (uint64_t)strtoumax(asked->words[2], NULL, 10);
    read_hex_word(asked->words[3] + strlen("sha256-"), manifest.digest, sizeof manifest.digest);
    const lightpath_verdict verdict = check_body(&manifest, bytes, length, pieces[0]);
    for (size_t i = 1; i < sizeof pieces / sizeof pieces[0]; i++) {
        if (check_body(&manifest, bytes, length, pieces[i]) != verdict) {
            fail("the verdict depends on the pieces of the body", asked->words[1]);
        }
    }
    return verdict;
}

void answer_question(
    answer *given, const question *asked, const lightpath_keyring *known, const uint8_t *bytes, size_t length)
{
    const char *const *words = asked->words;
    given->line = 0;
    if (is_about(asked, "body")) {
        given->verdict = check_pieces(asked, bytes, length);
    } else if (is_about(asked, "keyring")) {
        given->verdict =
            lightpath_keyring_renew(&given->keyring, known, bytes, length, time_word(words[3]), test_crypto());
        given->line = given->keyring.line;
    } else {
        lightpath_wanted wanted;
        wanted.display = words[4];
        read_hex_word(words[5], wanted.optics, sizeof wanted.optics);
        wanted.format = words[6];
        wanted.generation = (uint64_t)strtoumax(words[7], NULL, 10);
        given->verdict = lightpath_manifest_check(
            &given->manifest, known, bytes, length, &wanted, time_word(words[3]), test_crypto());
        given->line = given->manifest.line;
    }
}

void know_keyring(lightpath_keyring *known, const lightpath_keyring *pinned, const uint8_t *bytes, size_t length)
{
    const lightpath_verdict verdict =
        lightpath_keyring_renew(known, pinned, bytes, length, LIGHTPATH_NO_CLOCK, test_crypto());
    if (verdict != LIGHTPATH_TRUSTED) {
        fail("the device's own keyring is refused", lightpath_verdict_text(verdict));
    }
}
