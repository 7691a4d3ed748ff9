/*
 * Lightpath's signed manifests for firmware, in C99: whether a kernel that a network offers is the one to use.
 * docs/firmware.md describes the documents. The device knows root keys from its manufacture, and trusts nothing else.
 *
 *   root key -- signs --> keyring -- lists --> keys -- sign --> manifests -- name --> file
 *
 *   lightpath_keyring_pin      the first keyring of a device: only root keys
 *   lightpath_keyring_renew    a keyring that the device keeps from then on
 *   lightpath_optics_digest    what the device's kernel is for: wavelength and distance
 *   lightpath_manifest_check   a manifest: which file is the kernel that the device wants
 *   lightpath_body_...         the file, piece by piece as it arrives
 *
 * It allocates nothing, has no global variables and no recursion, and calls nothing but the functions of
 * lightpath_crypto. Compilers may also emit calls of memcpy and memset. It needs no other file of the decoder's.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef LIGHTPATH_MANIFEST_H
#define LIGHTPATH_MANIFEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What a check found. Only LIGHTPATH_TRUSTED means that the device may use what it checked. */
typedef enum lightpath_verdict {
    LIGHTPATH_TRUSTED = 0,
    /* The bytes are no document of this kind, whoever signed it. */
    LIGHTPATH_DOCUMENT_TOO_LARGE,
    LIGHTPATH_DOCUMENT_NOT_TEXT,
    LIGHTPATH_DOCUMENT_OTHER_LINE,
    LIGHTPATH_DOCUMENT_OTHER_VERSION,
    LIGHTPATH_DOCUMENT_WRONG_VALUE,
    LIGHTPATH_DOCUMENT_TOO_LONG,
    /* The keyring must not be used. A manifest, too, is refused while the device's keyring does not count. */
    LIGHTPATH_KEYRING_WRONG_SIGNATURE,
    LIGHTPATH_KEYRING_OLDER,
    LIGHTPATH_KEYRING_DIFFERENT,
    LIGHTPATH_KEYRING_NOT_YET,
    LIGHTPATH_KEYRING_EXPIRED,
    /* The manifest must not be used: its key. */
    LIGHTPATH_KEY_UNKNOWN,
    LIGHTPATH_KEY_REVOKED,
    LIGHTPATH_KEY_NOT_YET,
    LIGHTPATH_KEY_EXPIRED,
    /* The manifest must not be used: itself. */
    LIGHTPATH_MANIFEST_WRONG_SIGNATURE,
    LIGHTPATH_MANIFEST_NOT_YET,
    LIGHTPATH_MANIFEST_EXPIRED,
    LIGHTPATH_OTHER_DISPLAY,
    LIGHTPATH_OTHER_OPTICS,
    LIGHTPATH_OTHER_FORMAT,
    LIGHTPATH_LOWER_GENERATION,
    /* The file must not be used. */
    LIGHTPATH_BODY_LONGER,
    LIGHTPATH_BODY_SHORTER,
    LIGHTPATH_BODY_CORRUPT,
    LIGHTPATH_VERDICT_COUNT
} lightpath_verdict;

/* A sentence about a verdict, in English, for people. Never NULL. */
const char *lightpath_verdict_text(lightpath_verdict verdict);

/* Size of the largest document of both kinds [bytes]: room for it is enough. A longer answer is no document. */
#define LIGHTPATH_DOCUMENT_BYTES_MAX 4096u
/* Limit on the keys of each kind in a keyring. */
#define LIGHTPATH_KEYS_MAX 8u

/*
 * The present time in seconds since the start of 1970, UTC, without leap seconds. Or, for a device that has no clock,
 * LIGHTPATH_NO_CLOCK: then nothing is too old or too new, and the device loses
 *
 *   - the end of a freeze: a server or mirror may offer an old manifest, once signed, for ever. The device still
 *     refuses lower generations and older keyrings than it has, so it stays where it is and never goes back;
 *   - the end of a stolen key: a key counts until the device has the keyring that revokes it. Who holds the key, and
 *     the network between, can keep that keyring away for ever.
 *
 * Any other negative number but those of LIGHTPATH_AT_LEAST is a time before all documents, which are then refused: a clock that fails with -1 does
 * not become a missing clock.
 */
#define LIGHTPATH_NO_CLOCK INT64_MIN

/*
 * The present time of a device without a clock that keeps a lower bound: it is this second or a later one, from 0 to the
 * last second of the year 9999. Nothing is too new, and what ended by then is too old. The latest issued_unix_s of all
 * keyrings and manifests that the device accepted is such a bound; add the time that has passed since, as long as the
 * device counts it. Then a mirror cannot offer documents that ended before another was signed, and a key that ended stays
 * ended. LIGHTPATH_AT_LEAST(0) is LIGHTPATH_NO_CLOCK.
 */
#define LIGHTPATH_AT_LEAST(unix_s) (INT64_MIN + (int64_t)(unix_s))

/*
 * Ed25519 and SHA-256, from a library or from the chip. README.md has an example with Monocypher.
 *
 * The contexts of SHA-256 are the caller's memory, which these functions know. sha256_end is called with zeros in
 * `digest`; a device that can fail may leave them, and then nothing is trusted.
 */
typedef struct lightpath_crypto {
    /* Whether the signature (RFC 8032) is that of this key over the message. */
    bool (*verify)(const uint8_t key[32], const uint8_t *message, size_t length, const uint8_t signature[64]);
    void (*sha256_begin)(void *sha256);
    void (*sha256_update)(void *sha256, const uint8_t *bytes, size_t length);
    void (*sha256_end)(void *sha256, uint8_t digest[32]);
    void *sha256; /* context for optics and for the names of keys; in use only while a function of this header runs */
} lightpath_crypto;

/* A key of a keyring, and the time within which its manifests count. */
typedef struct lightpath_listed_key {
    int64_t from_unix_s;  /* first second */
    int64_t until_unix_s; /* the second after the last */
    uint8_t key[32];
} lightpath_listed_key;

/*
 * What a device trusts. It has no pointers: keep a copy of its bytes where only the firmware writes, and start from it
 * after a reset. Its members are for reading.
 */
typedef struct lightpath_keyring {
    int64_t issued_unix_s;
    int64_t expires_unix_s;
    lightpath_listed_key keys[LIGHTPATH_KEYS_MAX]; /* that may sign manifests */
    uint8_t roots[LIGHTPATH_KEYS_MAX][32];         /* that may sign the next keyring */
    uint8_t revoked[LIGHTPATH_KEYS_MAX][32];       /* that may sign manifests no more */
    uint32_t version;
    uint16_t line; /* of the document that was refused with a LIGHTPATH_DOCUMENT_ verdict, from 1; 0: none */
    uint8_t key_count;
    uint8_t root_count;
    uint8_t revoked_count;
    bool is_pinned; /* whether it has only the root keys of the manufacture */
} lightpath_keyring;

/* The keyring of a new device: `count` root keys, at most LIGHTPATH_KEYS_MAX; it takes no more of them. */
void lightpath_keyring_pin(lightpath_keyring *keyring, const uint8_t (*roots)[32], size_t count);

/*
 * Reads a keyring into `next`, which must not be `known`. The device accepts it if a root key of `known` signed it, its
 * version is not lower than that of `known`, a keyring of the same version is the same one, and it counts now. Then
 * keep `next` instead of `known`. The root keys of an expired keyring still count, for the device that slept for long.
 *
 * LIGHTPATH_TRUSTED, or the reason why the keyring is refused. Then `next` must not be used, except for its `line`.
 */
lightpath_verdict lightpath_keyring_renew(lightpath_keyring *next, const lightpath_keyring *known, const uint8_t *bytes,
    size_t length, int64_t now_unix_s, const lightpath_crypto *crypto);

/*
 * The digest of the optics of a distance from the modulator, negative behind it: SHA-256 over these two lines of a
 * manifest, with their line feeds.
 *
 *   wavelength_pm 515000
 *   place distance_nm 150000000
 *
 * Compute it at the start, or once and for all, and keep the 32 bytes in the firmware.
 */
void lightpath_optics_digest(
    uint8_t digest[32], int64_t wavelength_pm, int64_t distance_nm, const lightpath_crypto *crypto);

/* What a device asks for. Keep the generation of each accepted manifest, and give it with the next one. */
typedef struct lightpath_wanted {
    const char *display; /* id of the display */
    const char *format;  /* of the file, such as "compact" */
    uint8_t optics[32];  /* digest of wavelength and place */
    uint64_t generation; /* of the manifest that the device accepted last; 0: none */
} lightpath_wanted;

/* An accepted manifest. */
typedef struct lightpath_manifest {
    uint64_t generation;
    uint64_t size_bytes; /* of the file */
    uint64_t pixel_pitch_pm;
    int64_t wavelength_pm;
    int64_t issued_unix_s;
    int64_t expires_unix_s;
    const char *place;       /* for people, in the caller's document, not ended by a zero: copy it before that goes */
    const char *orders;      /* likewise: the diffraction orders */
    const char *digest_text; /* likewise: the LIGHTPATH_DIGEST_TEXT characters that the file's address has */
    uint32_t version;
    uint32_t width_px; /* compare both with your display's */
    uint32_t height_px;
    uint16_t place_length;
    uint16_t orders_length;
    uint16_t line; /* as that of lightpath_keyring */
    uint8_t optics[32]; /* SHA-256 of the lines of wavelength and place */
    uint8_t digest[32]; /* SHA-256 of the file */
    bool interpolated;  /* between photographed distances */
} lightpath_manifest;

/* Length of digest_text: "sha256-" and 64 hexadecimal digits. */
#define LIGHTPATH_DIGEST_TEXT 71u

/*
 * Reads a manifest. The device accepts it if `keyring` counts now and lists its key, the key counts now and is not
 * revoked, the signature is right, the manifest counts now, it is about what the device wants, and its generation is
 * not lower than the last one.
 *
 * LIGHTPATH_TRUSTED, or the reason why the manifest is refused. Then `manifest` must not be used, except for its
 * `line`. LIGHTPATH_KEY_UNKNOWN and LIGHTPATH_KEYRING_EXPIRED: ask for the newest keyring first, then try again.
 */
lightpath_verdict lightpath_manifest_check(lightpath_manifest *manifest, const lightpath_keyring *keyring,
    const uint8_t *bytes, size_t length, const lightpath_wanted *wanted, int64_t now_unix_s,
    const lightpath_crypto *crypto);

/*
 * Checks a file while it arrives.
 *
 *   lightpath_body_begin(&body, &manifest, &crypto, &context);
 *   while bytes arrive:
 *       if (lightpath_body_update(&body, bytes, length) != LIGHTPATH_TRUSTED) stop;
 *       store the bytes where nothing uses them yet;
 *   verdict = lightpath_body_end(&body);
 *
 * Only LIGHTPATH_TRUSTED from lightpath_body_end means that the file is the manifest's. A download that was cut may go
 * on with the same checker. The members are private.
 */
typedef struct lightpath_body {
    const lightpath_crypto *crypto;
    void *sha256;
    uint64_t left_bytes;
    uint8_t digest[32];
    lightpath_verdict verdict;
    bool is_ended;
} lightpath_body;

/*
 * `sha256` is a context of its own, so that manifests can be checked meanwhile. `crypto` and `sha256` must stay in
 * their places while `body` is in use; `manifest` need not.
 */
void lightpath_body_begin(
    lightpath_body *body, const lightpath_manifest *manifest, const lightpath_crypto *crypto, void *sha256);

/* The next bytes of the file. LIGHTPATH_BODY_LONGER once there are more than the manifest says, and ever after. */
lightpath_verdict lightpath_body_update(lightpath_body *body, const uint8_t *bytes, size_t length);

/* LIGHTPATH_TRUSTED, LIGHTPATH_BODY_LONGER, LIGHTPATH_BODY_SHORTER or LIGHTPATH_BODY_CORRUPT. */
lightpath_verdict lightpath_body_end(lightpath_body *body);

#ifdef __cplusplus
}
#endif

#endif
