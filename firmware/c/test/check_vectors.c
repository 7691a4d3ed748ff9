/*
 * Checks the decoder against every test vector, to 1e-6 of each row's norm, and every refusal.
 *
 *   check_vectors FOLDER [once]     FOLDER is firmware/vectors
 *
 * Rows are computed in two sizes of groups, with `once` in one. It prints the largest errors, and ends with status 0 if
 * all is right.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "../lightpath_f16.h"
#include "../lightpath_kernel.h"
#include "vector_files.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ERROR_MAX 1e-6
#define METHODS 6

/* Largest errors of the whole run. */
typedef struct errors {
    double of_method[METHODS];
    double of_source;
    double of_response;
    double of_crosstalk;
    double of_field;
    double of_f16;
    unsigned blocks;
} errors;

/* The vector that is being checked. */
typedef struct vector {
    char name[TEXT_MAX];
    FILE *text;
    uint8_t *bytes;
    lightpath_kernel kernel;
    lightpath_transfer transfer;
    double *scratch;
    lightpath_complex *row; /* long enough for all rows */
    float *phases;          /* given to the modulator, row by row */
} vector;

static void expect_ok(lightpath_status status, const char *about)
{
    if (status != LIGHTPATH_OK) {
        fail(about, lightpath_status_text(status));
    }
}

/* The norm of the difference relative to that of the expected numbers. Where all of these are 0, so must the others. */
static double error_of(const double *expected, const double *found, size_t count)
{
    double off = 0.0;
    double all = 0.0;
    for (size_t i = 0; i < count; i++) {
        off += (found[i] - expected[i]) * (found[i] - expected[i]);
        all += expected[i] * expected[i];
    }
    if (off == 0.0) {
        return 0.0;
    }
    return all > 0.0 ? sqrt(off / all) : HUGE_VAL;
}

static void compare_with(
    const vector *checked, const double *expected, const double *found, size_t count, const char *what, double *largest)
{
    const double error = error_of(expected, found, count);
    if (!(error <= ERROR_MAX)) {
        printf("%s: %s: the error is %g\n", checked->name, what, error);
        fail("the decoder does not give the vector's numbers", checked->name);
    }
    *largest = error > *largest ? error : *largest;
}

/* Compares `count` numbers with those that follow in the text. */
static void compare(const vector *checked, const double *found, size_t count, const char *what, double *largest)
{
    double *expected = allocate(count * sizeof *expected);
    read_numbers(checked->text, count, expected);
    compare_with(checked, expected, found, count, what, largest);
    free(expected);
}

static void compare_values(
    const vector *checked, const lightpath_complex *values, size_t count, const char *what, double *largest)
{
    double *numbers = allocate(2u * count * sizeof *numbers);
    for (size_t i = 0; i < count; i++) {
        numbers[2u * i] = (double)values[i].re;
        numbers[2u * i + 1u] = (double)values[i].im;
    }
    compare(checked, numbers, 2u * count, what, largest);
    free(numbers);
}

static void check_value(const vector *checked, const char *name, double expected)
{
    const lightpath_kernel *kernel = &checked->kernel;
    const struct {
        const char *name;
        double value;
    } found[] = {
        {"version", kernel->version},
        {"model", kernel->model},
        {"method", kernel->method},
        {"rows", kernel->height_px},
        {"columns", kernel->width_px},
        {"pitch", kernel->pixel_pitch_m},
        {"wavelength", kernel->wavelength_m},
        {"distance", kernel->distance_m},
        {"gain", (double)kernel->gain},
        {"offset", (double)kernel->offset},
        {"zero_order_re", (double)kernel->zero_order.re},
        {"zero_order_im", (double)kernel->zero_order.im},
    };
    for (size_t i = 0; i < sizeof found / sizeof found[0]; i++) {
        if (strcmp(name, found[i].name) == 0) {
            if (fabs(found[i].value - expected) > 1e-8 * fabs(expected)) {
                fail("the decoder gives another number", name);
            }
            return;
        }
    }
    fail("the vector has a value of an unknown name", name);
}

static void check_transfer(vector *checked, const char *arguments, errors *all)
{
    unsigned row = 0;
    unsigned count = 0;
    double x = 0.0;
    double y = 0.0;
    if (sscanf(arguments, "%u %lf %lf %u", &row, &x, &y, &count) != 4 || count != 2u * checked->kernel.width_px) {
        fail("the vector has a wrong line", arguments);
    }
    expect_ok(lightpath_transfer_row(&checked->transfer, row, x, y, checked->row), checked->name);
    if (lightpath_transfer_additions(&checked->transfer, row) != 0u) {
        fail("the row that was just computed would be summed again", checked->name);
    }
    compare_values(checked, checked->row, count, "transfer", &all->of_method[checked->kernel.method]);
}

static void check_source(vector *checked, const char *arguments, errors *all)
{
    unsigned row = 0;
    unsigned count = 0;
    if (sscanf(arguments, "%u %u", &row, &count) != 2 || count != checked->kernel.width_px) {
        fail("the vector has a wrong line", arguments);
    }
    expect_ok(lightpath_source_row(&checked->kernel, row, checked->row), checked->name);
    compare_values(checked, checked->row, count, "source", &all->of_source);
}

/* The block has phases, then the response to each. */
static void check_response(const vector *checked, const char *arguments, errors *all)
{
    double x = 0.0;
    double y = 0.0;
    unsigned count = 0;
    if (sscanf(arguments, "%lf %lf %u", &x, &y, &count) != 3) {
        fail("the vector has a wrong line", arguments);
    }
    double *phases = allocate(2u * count * sizeof *phases);
    double *found = allocate(count * sizeof *found);
    read_numbers(checked->text, 2u * (size_t)count, phases);
    const double v = lightpath_response_variation(&checked->kernel, x, y);
    for (unsigned i = 0; i < count; i++) {
        found[i] = lightpath_response(&checked->kernel, phases[i], v);
    }
    compare_with(checked, phases + count, found, count, "response", &all->of_response);
    free(phases);
    free(found);
}

static void check_crosstalk(vector *checked, const char *arguments, errors *all)
{
    double weights[LIGHTPATH_CROSSTALK_TAPS];
    const bool is_x = arguments[0] == 'x';
    lightpath_crosstalk_weights(is_x ? checked->kernel.crosstalk_x : checked->kernel.crosstalk_y, weights);
    compare(checked, weights, LIGHTPATH_CROSSTALK_TAPS, "crosstalk", &all->of_crosstalk);
}

/* Phases are whole numbers in units of a 512th of a turn. */
static void read_phases(vector *checked, const char *arguments)
{
    const size_t columns = checked->kernel.width_px;
    unsigned row = 0;
    unsigned count = 0;
    if (sscanf(arguments, "%u %u", &row, &count) != 2 || count != columns || row >= checked->kernel.height_px) {
        fail("the vector has a wrong line", arguments);
    }
    double *numbers = allocate(columns * sizeof *numbers);
    read_numbers(checked->text, columns, numbers);
    for (size_t i = 0; i < columns; i++) {
        checked->phases[row * columns + i] = (float)(numbers[i] * 6.283185307179586 / 512.0);
    }
    free(numbers);
}

static void check_field(vector *checked, const char *arguments, errors *all)
{
    const lightpath_kernel *kernel = &checked->kernel;
    const float *near[LIGHTPATH_CROSSTALK_TAPS];
    unsigned row = 0;
    unsigned count = 0;
    if (sscanf(arguments, "%u %u", &row, &count) != 2 || count != kernel->width_px) {
        fail("the vector has a wrong line", arguments);
    }
    for (unsigned k = 0; k < LIGHTPATH_CROSSTALK_TAPS; k++) {
        const unsigned least = row + k < 3u ? 0u : row + k - 3u;
        const unsigned place = least < kernel->height_px ? least : kernel->height_px - 1u;
        near[k] = kernel->crosstalk_y > 0.0 || k == 3u ? checked->phases + (size_t)place * kernel->width_px : NULL;
    }
    expect_ok(lightpath_field_row(kernel, row, near, checked->row), checked->name);
    compare_values(checked, checked->row, count, "field", &all->of_field);
}

static void check_line(vector *checked, char *line, errors *all)
{
    char word[TEXT_MAX];
    int length = 0;
    char name[TEXT_MAX];
    double expected = 0.0;
    if (sscanf(line, "%511s %n", word, &length) != 1) {
        fail("the vector has a wrong line", line);
    }
    const char *arguments = line + length;
    all->blocks++;
    if (strcmp(word, "value") == 0 && sscanf(arguments, "%511s %lf", name, &expected) == 2) {
        check_value(checked, name, expected);
    } else if (strcmp(word, "transfer") == 0) {
        check_transfer(checked, arguments, all);
    } else if (strcmp(word, "source") == 0) {
        check_source(checked, arguments, all);
    } else if (strcmp(word, "response") == 0) {
        check_response(checked, arguments, all);
    } else if (strcmp(word, "crosstalk") == 0) {
        check_crosstalk(checked, arguments, all);
    } else if (strcmp(word, "phases") == 0) {
        read_phases(checked, arguments);
    } else if (strcmp(word, "field") == 0) {
        check_field(checked, arguments, all);
    } else {
        fail("the vector has an unknown line", line);
    }
}

static void expect_refusal(lightpath_status found, lightpath_status expected, const char *about)
{
    if (found != expected) {
        fail(about, lightpath_status_text(found));
    }
}

/* Requests beyond the grid, beyond the modulator, and with too little memory. */
static void check_requests(vector *checked, size_t doubles)
{
    const lightpath_kernel *kernel = &checked->kernel;
    lightpath_transfer *transfer = &checked->transfer;
    const float *const near[LIGHTPATH_CROSSTALK_TAPS] = {NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    const uint32_t rows = kernel->height_px;
    const double outside[] = {1.0001, -1.0001, HUGE_VAL, HUGE_VAL - HUGE_VAL};
    size_t one = 0;
    expect_ok(lightpath_scratch_doubles(kernel, 1u, &one), checked->name);
    if (one > 0u) {
        expect_refusal(lightpath_transfer_begin(transfer, kernel, checked->scratch, one - 1u),
            LIGHTPATH_SCRATCH_TOO_SMALL, "memory that is too small");
    }
    expect_ok(lightpath_transfer_begin(transfer, kernel, checked->scratch, doubles), checked->name);
    lightpath_complex *row = checked->row;
    expect_refusal(lightpath_transfer_row(transfer, 2u * rows, 0.0, 0.0, row), LIGHTPATH_NO_SUCH_ROW, "row of H");
    expect_refusal(lightpath_source_row(kernel, rows, row), LIGHTPATH_NO_SUCH_ROW, "row of the source");
    expect_refusal(lightpath_field_row(kernel, rows, near, row), LIGHTPATH_NO_SUCH_ROW, "row of the field");
    for (size_t i = 0; i < sizeof outside / sizeof outside[0]; i++) {
        expect_refusal(lightpath_transfer_row(transfer, 0u, outside[i], 0.0, row), LIGHTPATH_NO_SUCH_PLACE, "x");
        expect_refusal(lightpath_transfer_row(transfer, 0u, 0.0, outside[i], row), LIGHTPATH_NO_SUCH_PLACE, "y");
    }
}

static void open_vector(vector *checked, const char *folder, const char *name, uint32_t rows_together)
{
    char path[TEXT_MAX];
    size_t length = 0;
    size_t doubles = 0;
    strcpy(checked->name, name);
    join(path, folder, name, ".lpk");
    checked->bytes = read_file(path, &length);
    expect_ok(lightpath_kernel_open(&checked->kernel, checked->bytes, length), name);
    const lightpath_kernel *kernel = &checked->kernel;
    const uint32_t all_rows = kernel->height_px + 1u;
    const uint32_t group = rows_together > 0u && rows_together < all_rows ? rows_together : all_rows;
    expect_ok(lightpath_scratch_doubles(kernel, group, &doubles), name);
    checked->scratch = allocate(doubles * sizeof *checked->scratch);
    checked->row = allocate(2u * kernel->width_px * sizeof *checked->row);
    checked->phases = allocate((size_t)kernel->height_px * kernel->width_px * sizeof *checked->phases);
    check_requests(checked, doubles);
    join(path, folder, name, ".txt");
    checked->text = open_text(path);
}

static void check_kernel(const char *folder, const char *name, uint32_t rows_together, errors *all)
{
    char line[TEXT_MAX];
    vector checked;
    open_vector(&checked, folder, name, rows_together);
    while (next_line(checked.text, line)) {
        check_line(&checked, line, all);
    }
    fclose(checked.text);
    free(checked.bytes);
    free(checked.scratch);
    free(checked.row);
    free(checked.phases);
}

/* Reads the array in pieces of 1, 2, 3 ... bytes, and writes the rows to `plane`, which may be NULL. */
static lightpath_status read_array(
    lightpath_f16 *reader, const uint8_t *bytes, size_t length, lightpath_complex *plane, unsigned *rows)
{
    size_t piece = 1;
    size_t at = 0;
    *rows = 0;
    while (at < length) {
        const size_t left = length - at;
        size_t used = 0;
        const lightpath_status status = lightpath_f16_feed(reader, bytes + at, piece < left ? piece : left, &used);
        if (status != LIGHTPATH_OK) {
            return status;
        }
        if (reader->row_ready) {
            *rows += 1u;
            for (uint32_t i = 0; plane != NULL && i < reader->columns; i++) {
                plane[(size_t)reader->row * reader->columns + i] = reader->values[i];
            }
        }
        at += used;
        piece++;
    }
    return lightpath_f16_end(reader);
}

static void check_array(const char *folder, const char *name, errors *all)
{
    char path[TEXT_MAX];
    char line[TEXT_MAX];
    size_t length = 0;
    unsigned rows = 0;
    unsigned row = 0;
    unsigned count = 0;
    lightpath_f16 reader;
    vector checked;
    strcpy(checked.name, name);
    join(path, folder, name, ".npy");
    checked.bytes = read_file(path, &length);
    checked.row = allocate(length * sizeof *checked.row);
    lightpath_complex *plane = allocate(length * sizeof *plane);
    lightpath_f16_begin(&reader, checked.row, length);
    expect_ok(read_array(&reader, checked.bytes, length, plane, &rows), name);
    if (rows != reader.rows) {
        fail("the array has another number of rows", name);
    }
    join(path, folder, name, ".txt");
    checked.text = open_text(path);
    while (next_line(checked.text, line)) {
        if (sscanf(line, "transfer %u 0 0 %u", &row, &count) != 2 || count != reader.columns || row >= rows) {
            fail("the vector has a wrong line", line);
        }
        compare_values(&checked, plane + (size_t)row * reader.columns, count, "transfer", &all->of_f16);
        all->blocks++;
    }
    fclose(checked.text);
    free(checked.bytes);
    free(checked.row);
    free(plane);
}

/* Names of refusals in the vectors. */
static const char *name_of(lightpath_status status)
{
    static const char *const names[LIGHTPATH_STATUS_COUNT] = {
        "ok", "not_a_kernel", "unknown_version", "wrong_response_order", "wrong_order", "wrong_variation_order",
        "wrong_length", "wrong_checksum", "unknown_model", "unknown_method", "too_many_harmonics", "wrong_side",
        "wrong_pitch", "wrong_wavelength", "wrong_distance", "number_not_finite", "wrong_crosstalk",
        "too_many_frequencies", "scratch_too_small", "no_such_row", "no_such_place", "value_not_finite",
        "f16_not_an_array", "f16_wrong_header", "f16_wrong_shape", "f16_row_too_long", "f16_cut", "f16_too_long",
    };
    return names[status];
}

/* Makes one change: a new length, or bytes from an offset on. */
static void change(uint8_t *bytes, size_t *length, const char *edit, size_t length_max)
{
    char *at = NULL;
    const size_t place = strtoul(edit, &at, 10);
    if (strncmp(edit, "length=", 7) == 0) {
        const size_t wanted = strtoul(edit + 7, NULL, 10);
        for (size_t i = *length; i < wanted && i < length_max; i++) {
            bytes[i] = 0;
        }
        *length = wanted;
    } else {
        for (size_t i = 0; at[0] == '=' && at[1 + 2 * i] != '\0'; i++) {
            const char digits[3] = {at[1 + 2 * i], at[2 + 2 * i], '\0'};
            if (place + i < *length) {
                bytes[place + i] = (uint8_t)strtoul(digits, NULL, 16);
            }
        }
    }
}

static lightpath_status status_of(const char *file, const uint8_t *bytes, size_t length)
{
    lightpath_kernel kernel;
    lightpath_transfer transfer;
    lightpath_f16 reader;
    lightpath_complex values[64];
    unsigned rows = 0;
    if (strstr(file, ".npy") != NULL) {
        lightpath_f16_begin(&reader, values, sizeof values / sizeof values[0]);
        return read_array(&reader, bytes, length, NULL, &rows);
    }
    const lightpath_status status = lightpath_kernel_open(&kernel, bytes, length);
    if (status != LIGHTPATH_OK) {
        return status;
    }
    const lightpath_status begun = lightpath_transfer_begin(&transfer, &kernel, NULL, 0u);
    /* These refusals have no scratch memory, which kernels of a sum need. */
    return begun == LIGHTPATH_SCRATCH_TOO_SMALL ? LIGHTPATH_OK : begun;
}

/* A line has a file, the refusal, whether the checksum is renewed, and the changes. */
static void check_refusal(const char *folder, char *line)
{
    char path[TEXT_MAX];
    size_t length = 0;
    const char *file = strtok(line, " ");
    const char *reason = strtok(NULL, " ");
    const char *checksum = strtok(NULL, " ");
    join(path, folder, file, "");
    uint8_t *original = read_file(path, &length);
    const size_t length_max = length + TEXT_MAX;
    uint8_t *bytes = allocate(length_max);
    memcpy(bytes, original, length);
    for (const char *edit = strtok(NULL, " "); edit != NULL; edit = strtok(NULL, " ")) {
        change(bytes, &length, edit, length_max);
    }
    if (checksum != NULL && strcmp(checksum, "renewed") == 0) {
        renew_checksum(bytes, length);
    }
    /* An allocation of this length, so that a sanitizer sees a byte read too much. */
    uint8_t *exact = allocate(length);
    memcpy(exact, bytes, length);
    const char *found = name_of(status_of(file, exact, length));
    if (reason == NULL || strcmp(found, reason) != 0) {
        printf("%s must be refused as %s, but gives %s\n", file, reason != NULL ? reason : "?", found);
        fail("a wrong refusal", file);
    }
    free(exact);
    free(bytes);
    free(original);
}

static unsigned check_refusals(const char *folder)
{
    char path[TEXT_MAX];
    char line[TEXT_MAX];
    unsigned count = 0;
    join(path, folder, "refusals.txt", "");
    FILE *text = open_text(path);
    while (next_line(text, line)) {
        check_refusal(folder, line);
        count++;
    }
    fclose(text);
    return count;
}

/* Every status has a sentence of its own. */
static void check_sentences(void)
{
    const char *none = lightpath_status_text(LIGHTPATH_STATUS_COUNT);
    for (int status = 0; status < (int)LIGHTPATH_STATUS_COUNT; status++) {
        const char *text = lightpath_status_text((lightpath_status)status);
        if (strcmp(text, none) == 0 || text[strlen(text) - 1u] != '.') {
            fail("a status has no sentence", name_of((lightpath_status)status));
        }
    }
}

static void report(const errors *all, unsigned vectors, unsigned refusals)
{
    static const char *const methods[METHODS] = {"band-limited angular spectrum", "angular spectrum", "band response",
        "Rayleigh-Sommerfeld impulse response", "Fresnel transfer function", "Fresnel impulse response"};
    printf("%u vectors, %u blocks of numbers, %u refusals: all right\n", vectors, all->blocks, refusals);
    printf("largest errors, relative, over a row:\n");
    for (int method = 0; method < METHODS; method++) {
        printf("  %.1e  method %d, %s\n", all->of_method[method], method, methods[method]);
    }
    printf("  %.1e  source\n  %.1e  phase response\n", all->of_source, all->of_response);
    printf("  %.1e  cross-talk\n  %.1e  field behind the modulator\n", all->of_crosstalk, all->of_field);
    printf("  %.1e  float16 array\n", all->of_f16);
}

int main(int count, char **arguments)
{
    char path[TEXT_MAX];
    char line[TEXT_MAX];
    errors all = {{0.0}, 0.0, 0.0, 0.0, 0.0, 0.0, 0u};
    unsigned vectors = 0;
    if (count < 2) {
        fail("usage", "check_vectors FOLDER [once]");
    }
    const bool once = count > 2 && strcmp(arguments[2], "once") == 0;
    check_sentences();
    join(path, arguments[1], "vectors.txt", "");
    FILE *names = open_text(path);
    while (next_line(names, line)) {
        char *ending = strchr(line, '.');
        if (ending == NULL) {
            fail("the list of vectors has a wrong line", line);
        }
        const bool is_array = strcmp(ending, ".npy") == 0;
        *ending = '\0';
        if (is_array) {
            check_array(arguments[1], line, &all);
        } else {
            check_kernel(arguments[1], line, 0u, &all);
            if (!once) {
                check_kernel(arguments[1], line, 5u, &all);
            }
        }
        vectors++;
    }
    fclose(names);
    report(&all, vectors, check_refusals(arguments[1]));
    return 0;
}
