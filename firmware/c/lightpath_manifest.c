/*
 * Manifests: which file is the kernel that a device wants.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_lines.h"

#define DIGEST_NAME_LENGTH 7u /* sha256- */
#define KEY_ID_BYTES 8u
/* Limit on the length of a place after its kind. */
#define PLACE_TEXT_MAX 128u
/* Room for a whole number of 64 bits: a sign and 19 digits. */
#define NUMBER_TEXT_MAX 20u

/* What a manifest has besides the members of lightpath_manifest. */
typedef struct document {
    lightpath_text display;
    lightpath_text format;
    size_t signed_bytes;
    uint8_t key_id[KEY_ID_BYTES];
    uint8_t signature[64];
} document;

static void read_digest(lightpath_lines *lines, lightpath_manifest *manifest)
{
    static const char name[] = "sha256-";
    lightpath_text text = lightpath_lines_text(lines, "digest");
    manifest->digest_text = (const char *)text.at;
    bool is_digest = text.length == LIGHTPATH_DIGEST_TEXT;
    for (size_t i = 0; is_digest && i < DIGEST_NAME_LENGTH; i++) {
        is_digest = text.at[i] == (uint8_t)name[i];
    }
    if (is_digest) {
        text.at += DIGEST_NAME_LENGTH;
        text.length -= DIGEST_NAME_LENGTH;
    }
    if (!is_digest || !lightpath_read_hex(text, manifest->digest, sizeof manifest->digest)) {
        lightpath_lines_wrong_value(lines);
    }
}

static bool read_yes_or_no(lightpath_lines *lines, const char *name)
{
    const lightpath_text text = lightpath_lines_text(lines, name);
    const bool is_yes = lightpath_is(text, "yes");
    if (!is_yes && !lightpath_is(text, "no")) {
        lightpath_lines_wrong_value(lines);
    }
    return is_yes;
}

static void hash_string(const lightpath_crypto *crypto, const char *string)
{
    size_t length = 0;
    while (string[length] != '\0') {
        length++;
    }
    crypto->sha256_update(crypto->sha256, (const uint8_t *)string, length);
}

static void hash_number(const lightpath_crypto *crypto, int64_t number)
{
    uint8_t text[NUMBER_TEXT_MAX];
    size_t at = NUMBER_TEXT_MAX;
    /* The smallest number has no positive twin. */
    uint64_t size = number < 0 ? (uint64_t) - (number + 1) + 1u : (uint64_t)number;
    do {
        text[--at] = (uint8_t)((uint64_t)'0' + size % 10u);
        size /= 10u;
    } while (size > 0u);
    if (number < 0) {
        text[--at] = (uint8_t)'-';
    }
    crypto->sha256_update(crypto->sha256, text + at, NUMBER_TEXT_MAX - at);
}

void lightpath_optics_digest(
    uint8_t digest[32], int64_t wavelength_pm, int64_t distance_nm, const lightpath_crypto *crypto)
{
    for (size_t i = 0; i < 32u; i++) {
        digest[i] = 0;
    }
    crypto->sha256_begin(crypto->sha256);
    hash_string(crypto, "wavelength_pm ");
    hash_number(crypto, wavelength_pm);
    hash_string(crypto, "\nplace distance_nm ");
    hash_number(crypto, distance_nm);
    hash_string(crypto, "\n");
    crypto->sha256_end(crypto->sha256, digest);
}

/* A place of any kind: its kind, a space, and 1 to PLACE_TEXT_MAX characters that nobody reads here. */
static bool is_place(lightpath_text text)
{
    lightpath_text kind = {text.at, 0};
    while (kind.length < text.length && text.at[kind.length] != (uint8_t)' ') {
        kind.length++;
    }
    const size_t rest = text.length - kind.length;
    return lightpath_is_word(kind) && rest >= 2u && rest <= PLACE_TEXT_MAX + 1u;
}

/* Reads the digest and the two lines that it must be of. */
static void read_optics(lightpath_lines *lines, lightpath_manifest *manifest, const lightpath_crypto *crypto)
{
    uint8_t digest[32] = {0};
    if (!lightpath_read_hex(lightpath_lines_text(lines, "optics"), manifest->optics, sizeof manifest->optics)) {
        lightpath_lines_wrong_value(lines);
    }
    const size_t from = lines->place;
    manifest->wavelength_pm = lightpath_lines_signed(lines, "wavelength_pm");
    const lightpath_text place = lightpath_lines_text(lines, "place");
    manifest->place = (const char *)place.at;
    manifest->place_length = (uint16_t)place.length;
    if (!is_place(place)) {
        lightpath_lines_wrong_value(lines);
    }
    if (lines->verdict == LIGHTPATH_TRUSTED) {
        crypto->sha256_begin(crypto->sha256);
        crypto->sha256_update(crypto->sha256, lines->all.at + from, lines->place - from);
        crypto->sha256_end(crypto->sha256, digest);
        if (!lightpath_same(digest, manifest->optics, sizeof digest)) {
            lightpath_lines_wrong_value(lines);
        }
    }
}

/* Reads all lines in their order. */
static lightpath_verdict read_document(lightpath_manifest *manifest, document *rest, const uint8_t *bytes,
    size_t length, const lightpath_crypto *crypto)
{
    lightpath_lines lines;
    lightpath_lines_begin(&lines, bytes, length);
    lightpath_lines_head(&lines, "lightpath manifest", "2");
    rest->display = lightpath_lines_word(&lines, "display");
    read_optics(&lines, manifest, crypto);
    manifest->generation = lightpath_lines_number(&lines, "generation", UINT64_MAX);
    manifest->version = (uint32_t)lightpath_lines_number(&lines, "version", UINT32_MAX);
    rest->format = lightpath_lines_word(&lines, "format");
    read_digest(&lines, manifest);
    manifest->size_bytes = lightpath_lines_number(&lines, "size_bytes", UINT64_MAX);
    manifest->width_px = (uint32_t)lightpath_lines_number(&lines, "width_px", UINT32_MAX);
    manifest->height_px = (uint32_t)lightpath_lines_number(&lines, "height_px", UINT32_MAX);
    manifest->pixel_pitch_pm = lightpath_lines_number(&lines, "pixel_pitch_pm", UINT64_MAX);
    const lightpath_text orders = lightpath_lines_text(&lines, "orders");
    manifest->orders = (const char *)orders.at;
    manifest->orders_length = (uint16_t)orders.length;
    manifest->interpolated = read_yes_or_no(&lines, "interpolated");
    manifest->issued_unix_s = lightpath_lines_time(&lines, "issued");
    manifest->expires_unix_s = lightpath_lines_time(&lines, "expires");
    if (!lightpath_read_hex(lightpath_lines_text(&lines, "key"), rest->key_id, sizeof rest->key_id)) {
        lightpath_lines_wrong_value(&lines);
    }
    rest->signed_bytes = lines.place;
    if (!lightpath_read_hex(lightpath_lines_text(&lines, "signature"), rest->signature, sizeof rest->signature)) {
        lightpath_lines_wrong_value(&lines);
    }
    lightpath_lines_end(&lines);
    manifest->line = lines.verdict == LIGHTPATH_TRUSTED ? 0u : lines.line;
    return lines.verdict;
}

/* Whether the id is that of the key: the first eight bytes of its SHA-256. */
static bool is_id_of(const uint8_t id[KEY_ID_BYTES], const uint8_t key[32], const lightpath_crypto *crypto)
{
    uint8_t digest[32] = {0};
    crypto->sha256_begin(crypto->sha256);
    crypto->sha256_update(crypto->sha256, key, 32u);
    crypto->sha256_end(crypto->sha256, digest);
    return lightpath_same(digest, id, KEY_ID_BYTES);
}

/* The first listed key with the id that the document names, if it may sign now; `listed` is NULL otherwise. */
static lightpath_verdict find_key(const lightpath_listed_key **listed, const lightpath_keyring *keyring,
    const uint8_t id[KEY_ID_BYTES], int64_t now_unix_s, const lightpath_crypto *crypto)
{
    *listed = NULL;
    for (size_t i = 0; i < keyring->revoked_count; i++) {
        if (is_id_of(id, keyring->revoked[i], crypto)) {
            return LIGHTPATH_KEY_REVOKED;
        }
    }
    for (size_t i = 0; i < keyring->key_count; i++) {
        const lightpath_listed_key *key = &keyring->keys[i];
        if (is_id_of(id, key->key, crypto)) {
            *listed = key;
            return lightpath_check_time(
                key->from_unix_s, key->until_unix_s, now_unix_s, LIGHTPATH_KEY_NOT_YET, LIGHTPATH_KEY_EXPIRED);
        }
    }
    return LIGHTPATH_KEY_UNKNOWN;
}

static lightpath_verdict check_wanted(
    const lightpath_manifest *manifest, const document *rest, const lightpath_wanted *wanted)
{
    if (!lightpath_is(rest->display, wanted->display)) {
        return LIGHTPATH_OTHER_DISPLAY;
    }
    if (!lightpath_same(manifest->optics, wanted->optics, sizeof manifest->optics)) {
        return LIGHTPATH_OTHER_OPTICS;
    }
    if (!lightpath_is(rest->format, wanted->format)) {
        return LIGHTPATH_OTHER_FORMAT;
    }
    return manifest->generation < wanted->generation ? LIGHTPATH_LOWER_GENERATION : LIGHTPATH_TRUSTED;
}

lightpath_verdict lightpath_manifest_check(lightpath_manifest *manifest, const lightpath_keyring *keyring,
    const uint8_t *bytes, size_t length, const lightpath_wanted *wanted, int64_t now_unix_s,
    const lightpath_crypto *crypto)
{
    document rest;
    const lightpath_listed_key *listed;
    lightpath_verdict verdict = read_document(manifest, &rest, bytes, length, crypto);
    if (verdict != LIGHTPATH_TRUSTED) {
        return verdict;
    }
    now_unix_s = lightpath_not_before(now_unix_s, manifest->issued_unix_s);
    if (keyring->is_pinned) {
        return LIGHTPATH_KEY_UNKNOWN;
    }
    verdict = lightpath_check_time(keyring->issued_unix_s, keyring->expires_unix_s, now_unix_s,
        LIGHTPATH_KEYRING_NOT_YET, LIGHTPATH_KEYRING_EXPIRED);
    if (verdict != LIGHTPATH_TRUSTED) {
        return verdict;
    }
    verdict = find_key(&listed, keyring, rest.key_id, now_unix_s, crypto);
    if (verdict != LIGHTPATH_TRUSTED) {
        return verdict;
    }
    if (!crypto->verify(listed->key, bytes, rest.signed_bytes, rest.signature)) {
        return LIGHTPATH_MANIFEST_WRONG_SIGNATURE;
    }
    verdict = lightpath_check_time(manifest->issued_unix_s, manifest->expires_unix_s, now_unix_s,
        LIGHTPATH_MANIFEST_NOT_YET, LIGHTPATH_MANIFEST_EXPIRED);
    return verdict == LIGHTPATH_TRUSTED ? check_wanted(manifest, &rest, wanted) : verdict;
}
