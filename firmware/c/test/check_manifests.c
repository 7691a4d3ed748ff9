/*
 * Gives the code every case of firmware/vectors/manifests and compares the verdicts.
 *
 *   check_manifests FOLDER       FOLDER is firmware/vectors/manifests
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "manifest_cases.h"

#include <stdlib.h>
#include <string.h>

static void read_signatures(const char *folder)
{
    char path[TEXT_MAX];
    char line[TEXT_MAX];
    uint8_t bytes[SIGNATURE_BYTES];
    join(path, folder, "signatures.txt", "");
    FILE *text = open_text(path);
    while (next_line(text, line)) {
        /* Two spaces stand between the numbers. */
        read_hex_word(line, bytes, 32u);
        read_hex_word(line + 65, bytes + 32, 32u);
        read_hex_word(line + 130, bytes + 64, 64u);
        add_signature(bytes);
    }
    fclose(text);
}

static void read_roots(const char *folder, lightpath_keyring *pinned)
{
    char path[TEXT_MAX];
    char line[TEXT_MAX];
    uint8_t roots[LIGHTPATH_KEYS_MAX][32];
    size_t count = 0;
    join(path, folder, "roots.txt", "");
    FILE *text = open_text(path);
    while (count < LIGHTPATH_KEYS_MAX && next_line(text, line)) {
        read_hex_word(line, roots[count++], 32u);
    }
    fclose(text);
    lightpath_keyring_pin(pinned, (const uint8_t(*)[32])roots, count);
}

/* The device's keyring of a case. */
static void read_known(const char *folder, const char *name, const lightpath_keyring *pinned, lightpath_keyring *known)
{
    char path[TEXT_MAX];
    size_t length = 0;
    *known = *pinned;
    if (strcmp(name, "pinned") != 0) {
        join(path, folder, name, "");
        uint8_t *bytes = read_file(path, &length);
        know_keyring(known, pinned, bytes, length);
        free(bytes);
    }
}

/* The digests that a device computes are those of vectors whose optics are at these distances. */
static void check_optics(const char *folder)
{
    static const struct {
        const char *file;
        int64_t wavelength_pm;
        int64_t distance_nm;
    } all[] = {{"good.manifest", 515000, 150000000}, {"extreme.manifest", INT64_MAX, INT64_MIN}};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        char path[TEXT_MAX];
        char digits[2u * 32u + 1u] = {0};
        uint8_t computed[32], wanted[32];
        size_t length = 0;
        join(path, folder, all[i].file, "");
        uint8_t *bytes = read_file(path, &length);
        /* The digest stands in the third line. */
        size_t at = 0;
        for (size_t line = 1; line < 3u; line++) {
            while (bytes[at++] != (uint8_t)'\n') {
            }
        }
        memcpy(digits, bytes + at + strlen("optics "), sizeof digits - 1u);
        read_hex_word(digits, wanted, sizeof wanted);
        free(bytes);
        lightpath_optics_digest(computed, all[i].wavelength_pm, all[i].distance_nm, test_crypto());
        if (memcmp(computed, wanted, sizeof wanted) != 0) {
            fail("the digest of the optics is another one", all[i].file);
        }
    }
}

int main(int count, char **arguments)
{
    static lightpath_keyring pinned, known;
    static answer given;
    static question asked;
    static bool is_seen[LIGHTPATH_VERDICT_COUNT];
    char path[TEXT_MAX];
    char line[TEXT_MAX];
    unsigned cases = 0;
    if (count < 2) {
        fail("usage", "check_manifests FOLDER");
    }
    const char *folder = arguments[1];
    read_signatures(folder);
    read_roots(folder, &pinned);
    check_optics(folder);
    join(path, folder, "cases.txt", "");
    FILE *list = open_text(path);
    while (next_line(list, line)) {
        size_t length = 0;
        read_question(&asked, line);
        read_known(folder, is_about(&asked, "body") ? "pinned" : asked.words[2], &pinned, &known);
        join(path, folder, asked.words[1], "");
        uint8_t *bytes = read_file(path, &length);
        answer_question(&given, &asked, &known, bytes, length);
        free(bytes);
        const char *verdict = asked.words[is_about(&asked, "body") ? asked.count - 1u : asked.count - 2u];
        const unsigned long at = is_about(&asked, "body") ? 0u : strtoul(asked.words[asked.count - 1u], NULL, 10);
        if (strcmp(verdict_name(given.verdict), verdict) != 0 || given.line != at) {
            printf("%s, line %u\n", verdict_name(given.verdict), given.line);
            fail("the code gave this verdict instead", line);
        }
        is_seen[given.verdict] = true;
        cases++;
    }
    fclose(list);
    for (int verdict = 0; verdict < LIGHTPATH_VERDICT_COUNT; verdict++) {
        if (!is_seen[verdict]) {
            fail("no case has this verdict", verdict_name((lightpath_verdict)verdict));
        }
    }
    printf("%u cases of manifests, keyrings and bodies have their verdicts\n", cases);
    return 0;
}
