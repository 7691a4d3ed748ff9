/*
 * Keyrings: the keys that may sign manifests.
 *
 *   lightpath keyring 1
 *   version, issued, expires
 *   root KEY                   none to eight times, as the next two
 *   key KEY FROM UNTIL
 *   revoked KEY
 *   signature ROOT SIGNATURE   once to eight times, over all bytes before the first of these lines
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_lines.h"

#define KEY_LENGTH 64u
#define TIME_LENGTH 20u
#define SIGNATURE_LENGTH 128u

/* Unused places and gaps hold zeros, so that copies of equal keyrings are equal. */
static void clear(lightpath_keyring *keyring)
{
    uint8_t *bytes = (uint8_t *)keyring;
    for (size_t i = 0; i < sizeof *keyring; i++) {
        bytes[i] = 0;
    }
}

void lightpath_keyring_pin(lightpath_keyring *keyring, const uint8_t (*roots)[32], size_t count)
{
    clear(keyring);
    keyring->is_pinned = true;
    keyring->root_count = (uint8_t)(count < LIGHTPATH_KEYS_MAX ? count : LIGHTPATH_KEYS_MAX);
    for (size_t i = 0; i < keyring->root_count; i++) {
        for (size_t k = 0; k < 32u; k++) {
            keyring->roots[i][k] = roots[i][k];
        }
    }
}

/* Reads lines with one key each, and returns their number. */
static uint8_t read_keys(lightpath_lines *lines, const char *name, uint8_t keys[LIGHTPATH_KEYS_MAX][32])
{
    uint8_t count = 0;
    while (lightpath_lines_comes(lines, name)) {
        const lightpath_text text = lightpath_lines_text(lines, name);
        if (count == LIGHTPATH_KEYS_MAX || !lightpath_read_hex(text, keys[count], 32u)) {
            lightpath_lines_wrong_value(lines);
        } else {
            count++;
        }
    }
    return count;
}

/* The word of a text that begins at `from` and has this length. */
static lightpath_text word(lightpath_text text, size_t from, size_t length)
{
    const lightpath_text part = {text.at + from, length};
    return part;
}

/* A key, a space, its first time, a space, its last time: all have fixed lengths. */
static bool read_listed(lightpath_text text, lightpath_listed_key *listed)
{
    const size_t from = KEY_LENGTH + 1u;
    const size_t until = from + TIME_LENGTH + 1u;
    return text.length == until + TIME_LENGTH && text.at[from - 1u] == (uint8_t)' ' &&
           text.at[until - 1u] == (uint8_t)' ' && lightpath_read_hex(word(text, 0, KEY_LENGTH), listed->key, 32u) &&
           lightpath_read_time(word(text, from, TIME_LENGTH), &listed->from_unix_s) &&
           lightpath_read_time(word(text, until, TIME_LENGTH), &listed->until_unix_s);
}

static void read_listed_keys(lightpath_lines *lines, lightpath_keyring *keyring)
{
    while (lightpath_lines_comes(lines, "key")) {
        const lightpath_text text = lightpath_lines_text(lines, "key");
        if (keyring->key_count == LIGHTPATH_KEYS_MAX || !read_listed(text, &keyring->keys[keyring->key_count])) {
            lightpath_lines_wrong_value(lines);
        } else {
            keyring->key_count++;
        }
    }
}

static bool is_root(const lightpath_keyring *known, const uint8_t key[32])
{
    for (size_t i = 0; i < known->root_count; i++) {
        if (lightpath_same(known->roots[i], key, 32u)) {
            return true;
        }
    }
    return false;
}

/*
 * Reads the signatures to the end of the document. With `known`, says whether one of them is that of a root key which
 * `known` has; without, false. Documents are read once without it, so that nothing is computed for one that is wrong.
 */
static bool read_signatures(lightpath_lines *lines, const lightpath_keyring *known, const lightpath_crypto *crypto)
{
    const size_t signed_bytes = lines->place;
    size_t count = 0;
    bool is_signed = false;
    do {
        const lightpath_text text = lightpath_lines_text(lines, "signature");
        uint8_t key[32];
        uint8_t signature[64];
        if (count == LIGHTPATH_KEYS_MAX || text.length != KEY_LENGTH + 1u + SIGNATURE_LENGTH ||
            text.at[KEY_LENGTH] != (uint8_t)' ' || !lightpath_read_hex(word(text, 0, KEY_LENGTH), key, 32u) ||
            !lightpath_read_hex(word(text, KEY_LENGTH + 1u, SIGNATURE_LENGTH), signature, 64u)) {
            lightpath_lines_wrong_value(lines);
        } else if (known != NULL && !is_signed && is_root(known, key)) {
            is_signed = crypto->verify(key, lines->all.at, signed_bytes, signature);
        }
        count++;
    } while (lightpath_lines_comes(lines, "signature"));
    lightpath_lines_end(lines);
    return is_signed;
}

/* Whether two keyrings of the same version say the same. */
static bool is_same(const lightpath_keyring *a, const lightpath_keyring *b)
{
    bool same = a->issued_unix_s == b->issued_unix_s && a->expires_unix_s == b->expires_unix_s &&
                a->root_count == b->root_count && a->key_count == b->key_count && a->revoked_count == b->revoked_count;
    for (size_t i = 0; same && i < LIGHTPATH_KEYS_MAX; i++) {
        same = lightpath_same(a->roots[i], b->roots[i], 32u) && lightpath_same(a->revoked[i], b->revoked[i], 32u) &&
               lightpath_same(a->keys[i].key, b->keys[i].key, 32u) &&
               a->keys[i].from_unix_s == b->keys[i].from_unix_s && a->keys[i].until_unix_s == b->keys[i].until_unix_s;
    }
    return same;
}

lightpath_verdict lightpath_keyring_renew(lightpath_keyring *next, const lightpath_keyring *known, const uint8_t *bytes,
    size_t length, int64_t now_unix_s, const lightpath_crypto *crypto)
{
    lightpath_lines lines;
    clear(next);
    lightpath_lines_begin(&lines, bytes, length);
    lightpath_lines_head(&lines, "lightpath keyring", "1");
    next->version = (uint32_t)lightpath_lines_number(&lines, "version", UINT32_MAX);
    next->issued_unix_s = lightpath_lines_time(&lines, "issued");
    next->expires_unix_s = lightpath_lines_time(&lines, "expires");
    next->root_count = read_keys(&lines, "root", next->roots);
    read_listed_keys(&lines, next);
    next->revoked_count = read_keys(&lines, "revoked", next->revoked);
    lightpath_lines at_signatures = lines;
    (void)read_signatures(&lines, NULL, crypto);
    if (lines.verdict != LIGHTPATH_TRUSTED) {
        next->line = lines.line;
        return lines.verdict;
    }
    if (!read_signatures(&at_signatures, known, crypto)) {
        return LIGHTPATH_KEYRING_WRONG_SIGNATURE;
    }
    if (!known->is_pinned && next->version < known->version) {
        return LIGHTPATH_KEYRING_OLDER;
    }
    if (!known->is_pinned && next->version == known->version && !is_same(next, known)) {
        return LIGHTPATH_KEYRING_DIFFERENT;
    }
    return lightpath_check_time(next->issued_unix_s, next->expires_unix_s,
        lightpath_not_before(now_unix_s, next->issued_unix_s), LIGHTPATH_KEYRING_NOT_YET, LIGHTPATH_KEYRING_EXPIRED);
}
