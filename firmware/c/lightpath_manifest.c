/*
 * Manifests: which file is the kernel that a device wants.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_lines.h"

#define DIGEST_NAME_LENGTH 7u /* sha256- */
#define KEY_ID_BYTES 8u

/* What a manifest has besides the members of lightpath_manifest. */
typedef struct document {
    lightpath_text display;
    lightpath_text form;
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

/* Reads all lines in their order. */
static lightpath_verdict read_document(
    lightpath_manifest *manifest, document *rest, const uint8_t *bytes, size_t length)
{
    lightpath_lines lines;
    lightpath_lines_begin(&lines, bytes, length);
    lightpath_lines_exactly(&lines, "lightpath manifest", "1");
    rest->display = lightpath_lines_word(&lines, "display");
    manifest->wavelength_pm = lightpath_lines_signed(&lines, "wavelength_pm");
    manifest->distance_nm = lightpath_lines_signed(&lines, "distance_nm");
    manifest->generation = lightpath_lines_number(&lines, "generation", UINT64_MAX);
    manifest->version = (uint32_t)lightpath_lines_number(&lines, "version", UINT32_MAX);
    rest->form = lightpath_lines_word(&lines, "form");
    read_digest(&lines, manifest);
    manifest->size_bytes = lightpath_lines_number(&lines, "size_bytes", UINT64_MAX);
    manifest->width_px = (uint32_t)lightpath_lines_number(&lines, "width_px", UINT32_MAX);
    manifest->height_px = (uint32_t)lightpath_lines_number(&lines, "height_px", UINT32_MAX);
    manifest->pixel_pitch_pm = lightpath_lines_number(&lines, "pixel_pitch_pm", UINT64_MAX);
    const lightpath_text optics = lightpath_lines_text(&lines, "optics");
    manifest->optics = (const char *)optics.at;
    manifest->optics_length = (uint16_t)optics.length;
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
    if (manifest->wavelength_pm != wanted->wavelength_pm) {
        return LIGHTPATH_OTHER_WAVELENGTH;
    }
    if (manifest->distance_nm != wanted->distance_nm) {
        return LIGHTPATH_OTHER_DISTANCE;
    }
    if (!lightpath_is(rest->form, wanted->form)) {
        return LIGHTPATH_OTHER_FORM;
    }
    return manifest->generation < wanted->generation ? LIGHTPATH_LOWER_GENERATION : LIGHTPATH_TRUSTED;
}

lightpath_verdict lightpath_manifest_check(lightpath_manifest *manifest, const lightpath_keyring *keyring,
    const uint8_t *bytes, size_t length, const lightpath_wanted *wanted, int64_t now_unix_s,
    const lightpath_crypto *crypto)
{
    document rest;
    const lightpath_listed_key *listed;
    lightpath_verdict verdict = read_document(manifest, &rest, bytes, length);
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
