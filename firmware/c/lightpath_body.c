/*
 * The file of a manifest, checked while it arrives.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_lines.h"

void lightpath_body_begin(
    lightpath_body *body, const lightpath_manifest *manifest, const lightpath_crypto *crypto, void *sha256)
{
    body->crypto = crypto;
    body->sha256 = sha256;
    body->left_bytes = manifest->size_bytes;
    for (size_t i = 0; i < sizeof body->digest; i++) {
        body->digest[i] = manifest->digest[i];
    }
    body->verdict = LIGHTPATH_TRUSTED;
    body->is_ended = false;
    crypto->sha256_begin(sha256);
}

lightpath_verdict lightpath_body_update(lightpath_body *body, const uint8_t *bytes, size_t length)
{
    if (body->verdict == LIGHTPATH_TRUSTED && length > body->left_bytes) {
        body->verdict = LIGHTPATH_BODY_LONGER;
    }
    if (body->verdict == LIGHTPATH_TRUSTED && length > 0u) {
        body->left_bytes -= length;
        body->crypto->sha256_update(body->sha256, bytes, length);
    }
    return body->verdict;
}

lightpath_verdict lightpath_body_end(lightpath_body *body)
{
    uint8_t digest[32] = {0};
    if (body->verdict != LIGHTPATH_TRUSTED || body->is_ended) {
        return body->verdict;
    }
    body->is_ended = true;
    if (body->left_bytes > 0u) {
        body->verdict = LIGHTPATH_BODY_SHORTER;
        return body->verdict;
    }
    body->crypto->sha256_end(body->sha256, digest);
    if (!lightpath_same(digest, body->digest, sizeof digest)) {
        body->verdict = LIGHTPATH_BODY_CORRUPT;
    }
    return body->verdict;
}
