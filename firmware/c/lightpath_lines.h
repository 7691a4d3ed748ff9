/*
 * Documents of lines `name value`, which manifests and keyrings are. Private to the files that read them.
 *
 * A reader keeps its first refusal: after it, every function does nothing. So the readers of whole documents ask once,
 * at the end.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef LIGHTPATH_LINES_H
#define LIGHTPATH_LINES_H

#include "lightpath_manifest.h"

/* A part of a document. */
typedef struct lightpath_text {
    const uint8_t *at;
    size_t length;
} lightpath_text;

typedef struct lightpath_lines {
    lightpath_text all;
    size_t place; /* where the next line begins */
    uint16_t line; /* number of the present line, from 1 */
    lightpath_verdict verdict;
} lightpath_lines;

/* Begins to read a document, and refuses one that is too large or no text. */
void lightpath_lines_begin(lightpath_lines *lines, const uint8_t *bytes, size_t length);

/* Reads the first line: the kind of the document, and the version of its format, which must be this one. */
void lightpath_lines_head(lightpath_lines *lines, const char *kind, const char *version);

/* Whether the next line has this name. */
bool lightpath_lines_comes(const lightpath_lines *lines, const char *name);

/* Refuses the value of the present line. */
void lightpath_lines_wrong_value(lightpath_lines *lines);

/* Refuses a document that has more lines. Then the number of the present line is that of the next one. */
void lightpath_lines_end(lightpath_lines *lines);

/* The value of the next line, which must have this name; of no length after a refusal. */
lightpath_text lightpath_lines_text(lightpath_lines *lines, const char *name);

/* The same, and the value must be an id or a name. */
lightpath_text lightpath_lines_word(lightpath_lines *lines, const char *name);

/* The same, and the value must be a whole number of 0 to `max`, or of 64 bits with a sign. */
uint64_t lightpath_lines_number(lightpath_lines *lines, const char *name, uint64_t max);
int64_t lightpath_lines_signed(lightpath_lines *lines, const char *name);

/* The same, and the value must be a time. */
int64_t lightpath_lines_time(lightpath_lines *lines, const char *name);

/* Whether a text is an id or a name: 1 to 63 letters, digits, dots, lines below and hyphens. */
bool lightpath_is_word(lightpath_text text);

/* Whether a text is twice `count` hexadecimal digits, lower case; if so, their bytes. */
bool lightpath_read_hex(lightpath_text text, uint8_t *bytes, size_t count);

/* Whether a text is a time such as 2026-11-23T18:30:00Z, of the years 1970 to 9999; if so, its seconds since 1970. */
bool lightpath_read_time(lightpath_text text, int64_t *unix_s);

/* Whether a text is this string; whether two runs of bytes are the same. */
bool lightpath_is(lightpath_text text, const char *string);
bool lightpath_same(const uint8_t *a, const uint8_t *b, size_t length);

/*
 * The time for the check of a document that was issued then: without a clock, it is that time or later. So a stolen key
 * cannot name a time after its own end, or after that of the keyring which lists it.
 */
int64_t lightpath_not_before(int64_t now_unix_s, int64_t issued_unix_s);

/* The verdict about something that counts from the first time to before the second. */
lightpath_verdict lightpath_check_time(int64_t from_unix_s, int64_t until_unix_s, int64_t now_unix_s,
    lightpath_verdict not_yet, lightpath_verdict expired);

#endif
