/*
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "vector_files.h"

#include <stdlib.h>
#include <string.h>

void fail(const char *message, const char *about)
{
    printf("FAILED: %s: %s\n", message, about);
    exit(1);
}

void *allocate(size_t bytes)
{
    void *memory = malloc(bytes > 0u ? bytes : 1u);
    if (memory == NULL) {
        fail("there is no memory", "allocate");
    }
    return memory;
}

void join(char path[TEXT_MAX], const char *folder, const char *name, const char *ending)
{
    if (strlen(folder) + strlen(name) + strlen(ending) + 2u > TEXT_MAX) {
        fail("the path is too long", name);
    }
    strcpy(path, folder);
    strcat(path, "/");
    strcat(path, name);
    strcat(path, ending);
}

uint8_t *read_file(const char *path, size_t *length)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL || fseek(file, 0, SEEK_END) != 0) {
        fail("the file cannot be read", path);
    }
    const long end = ftell(file);
    if (end < 0 || fseek(file, 0, SEEK_SET) != 0) {
        fail("the file cannot be read", path);
    }
    *length = (size_t)end;
    uint8_t *bytes = allocate(*length);
    if (fread(bytes, 1, *length, file) != *length) {
        fail("the file cannot be read", path);
    }
    fclose(file);
    return bytes;
}

FILE *open_text(const char *path)
{
    FILE *text = fopen(path, "r");
    if (text == NULL) {
        fail("the text cannot be read", path);
    }
    return text;
}

bool next_line(FILE *text, char line[TEXT_MAX])
{
    while (fgets(line, TEXT_MAX, text) != NULL) {
        line[strcspn(line, "\r\n")] = '\0';
        if (line[0] != '\0' && line[0] != '#') {
            return true;
        }
    }
    return false;
}

void read_numbers(FILE *text, size_t count, double *numbers)
{
    char line[TEXT_MAX];
    size_t found = 0;
    while (found < count && next_line(text, line)) {
        char *at = line;
        for (;;) {
            char *end = at;
            const double number = strtod(at, &end);
            if (end == at) {
                break;
            }
            if (found == count) {
                fail("the text has too many numbers", line);
            }
            numbers[found++] = number;
            at = end;
        }
        if (at[strspn(at, " ")] != '\0') {
            fail("the text has a line that is not of numbers", line);
        }
    }
    if (found < count) {
        fail("the text has too few numbers", "at its end");
    }
}

uint32_t plain_checksum(const uint8_t *bytes, size_t length)
{
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < length; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc & 1u) != 0u ? crc >> 1 ^ 0xedb88320u : crc >> 1;
        }
    }
    return ~crc;
}

void renew_checksum(uint8_t *bytes, size_t length)
{
    if (length >= 4u) {
        const uint32_t crc = plain_checksum(bytes, length - 4u);
        for (size_t i = 0; i < 4u; i++) {
            bytes[length - 4u + i] = (uint8_t)(crc >> 8u * i);
        }
    }
}
