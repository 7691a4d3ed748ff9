/*
 * Cases of firmware/vectors/manifests/cases.txt: a document or a file, what the device knows and wants, and the
 * verdict.
 *
 *   keyring FILE KNOWN NOW VERDICT LINE
 *   manifest FILE KNOWN NOW DISPLAY OPTICS FORMAT GENERATION VERDICT LINE
 *   body FILE SIZE DIGEST VERDICT
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef LIGHTPATH_MANIFEST_CASES_H
#define LIGHTPATH_MANIFEST_CASES_H

#include "../lightpath_manifest.h"
#include "vector_files.h"

#define WORDS_MAX 10

/* The words of a case. */
typedef struct question {
    char line[TEXT_MAX];
    const char *words[WORDS_MAX];
    size_t count;
} question;

/* What the code says about a case. */
typedef struct answer {
    lightpath_verdict verdict;
    unsigned line;
    lightpath_keyring keyring;
    lightpath_manifest manifest;
} answer;

/* SHA-256 is that of sha256.c. Ed25519 is Monocypher's, or a list of all signatures that are right. */
const lightpath_crypto *test_crypto(void);

/* Makes a signature one of those that are right: a key, the SHA-256 of what it signed, the signature. */
#define SIGNATURE_BYTES 128u
void add_signature(const uint8_t bytes[SIGNATURE_BYTES]);
void forget_signatures(void);

/* Reads hexadecimal digits: `count` bytes. */
void read_hex_word(const char *digits, uint8_t *bytes, size_t count);

/* Splits a line of cases.txt. */
void read_question(question *asked, const char *line);

/* Whether the case is about a keyring, a manifest, a body. */
bool is_about(const question *asked, const char *kind);

/* The name of a verdict in cases.txt. */
const char *verdict_name(lightpath_verdict verdict);

/* Gives the case to the code. `bytes` are those of its file; `known` is the device's keyring. */
void answer_question(
    answer *given, const question *asked, const lightpath_keyring *known, const uint8_t *bytes, size_t length);

/* Reads a keyring that the device knows: one that a pinned root key signed. */
void know_keyring(lightpath_keyring *known, const lightpath_keyring *pinned, const uint8_t *bytes, size_t length);

#endif
