/*
 * Files of test vectors: whole files, and lines of text. docs/compact-kernel.md describes the vectors.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef LIGHTPATH_VECTOR_FILES_H
#define LIGHTPATH_VECTOR_FILES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* Longest path and longest line of a text. */
#define TEXT_MAX 512

/* Ends the program with a message. */
void fail(const char *message, const char *about);

/* Memory that must be freed. It ends the program where there is none. */
void *allocate(size_t bytes);

/* Joins folder, name and ending to a path. */
void join(char path[TEXT_MAX], const char *folder, const char *name, const char *ending);

/* Reads a whole file, which must be freed. */
uint8_t *read_file(const char *path, size_t *length);

/* Opens a text. */
FILE *open_text(const char *path);

/* Reads the next line that is neither empty nor a comment, without its line feed; false at the end. */
bool next_line(FILE *text, char line[TEXT_MAX]);

/* Reads `count` numbers from the next lines. */
void read_numbers(FILE *text, size_t count, double *numbers);

/* CRC-32 of IEEE 802.3, bit by bit: another way than that of the decoder. */
uint32_t plain_checksum(const uint8_t *bytes, size_t length);

/* Writes the checksum of a compact kernel into its last four bytes. */
void renew_checksum(uint8_t *bytes, size_t length);

#endif
