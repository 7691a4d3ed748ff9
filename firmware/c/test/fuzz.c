/*
 * Gives the decoder damaged copies of all test vectors. Each must be refused or decoded, within a small amount of work.
 * Compiled with sanitizers, it ends at the first access beyond a buffer and the first undefined operation.
 *
 *   fuzz FOLDER COUNT [SEED]     FOLDER is firmware/vectors
 *
 * Every input, and every buffer that the decoder fills, ends at the end of its allocation.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "../lightpath_f16.h"
#include "../lightpath_kernel.h"
#include "vector_files.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FILES_MAX 128
/* Longest damaged file. */
#define INPUT_MAX 8192u
/* Values and additions for which every input may ask. */
#define WORK_EACH 512u
/*
 * Work that each input adds to each pool, from which costly rows take theirs: the time of a run stays bounded. Each
 * method has a pool, or the rows of one would leave nothing to another. The modulator has the last one.
 */
#define WORK_SHARED 16u
#define POOLS 7
#define POOL_OF_MODULATOR 6
/* A value of a row takes as long as some additions. */
#define WORK_OF_VALUE 8u
#define SCRATCH_MAX (1u << 20)
#define VALUES_MAX (2u * LIGHTPATH_SIDE_PX_MAX)

typedef struct file {
    uint8_t *bytes;
    size_t length;
    bool is_array;
} file;

typedef struct fuzzer {
    uint64_t state;
    file files[FILES_MAX];
    size_t count;
    uint8_t *input; /* INPUT_MAX bytes */
    uint8_t *work;  /* the file that is being damaged */
    size_t length;
    double *scratch;
    lightpath_complex *values;
    float *phases;
    uint64_t pools[POOLS];
    unsigned long accepted;
    unsigned long rows;
    unsigned long costly;
    unsigned long arrays;
} fuzzer;

/* Numbers that look random, the same in every run. */
static uint32_t below(fuzzer *run, uint32_t end)
{
    run->state ^= run->state << 13;
    run->state ^= run->state >> 7;
    run->state ^= run->state << 17;
    return (uint32_t)(run->state >> 16) % end;
}

static void put_word(fuzzer *run, size_t at, uint32_t word)
{
    for (size_t i = 0; i < 4u && at + i < run->length; i++) {
        run->work[at + i] = (uint8_t)(word >> 8u * i);
    }
}

/* A number at the end of a range, or beyond it. */
static uint32_t edge_word(fuzzer *run)
{
    static const uint32_t words[] = {0u, 1u, 16384u, 16385u, 0xffffffffu, 0x7fffffffu, 0x80000000u, 0x7f800000u,
        0x7fc00000u, 0x7f7fffffu, 0xff7fffffu, 0x3f19999au, 0x00000001u, 0x42c80000u, 0xc2c80000u};
    return words[below(run, sizeof words / sizeof words[0])];
}

/* A length of the optics: many magnitudes, so that all methods meet near and far, fine and coarse displays. */
static void change_length(fuzzer *run)
{
    union {
        uint64_t bits;
        double number;
    } word;
    word.number = (below(run, 2u) == 0u ? 1.0 : -1.0) * pow(10.0, (double)below(run, 12000u) / 1000.0 - 10.0);
    const size_t at = 20u + 8u * below(run, 3u);
    put_word(run, at, (uint32_t)word.bits);
    put_word(run, at + 4u, (uint32_t)(word.bits >> 32));
}

/* A part of another file. */
static void splice(fuzzer *run)
{
    const file *other = &run->files[below(run, (uint32_t)run->count)];
    const size_t from = below(run, (uint32_t)other->length);
    const size_t to = below(run, (uint32_t)run->length);
    const size_t wanted = 1u + below(run, 64u);
    for (size_t i = 0; i < wanted && from + i < other->length && to + i < run->length; i++) {
        run->work[to + i] = other->bytes[from + i];
    }
}

static void damage(fuzzer *run)
{
    if (run->length == 0u) {
        return;
    }
    const size_t at = below(run, (uint32_t)run->length);
    switch (below(run, 9u)) {
    case 0:
        run->work[at] = (uint8_t)below(run, 256u);
        break;
    case 1:
        run->work[at] = (uint8_t)(run->work[at] ^ 1u << below(run, 8u));
        break;
    case 2: /* the small numbers of a kernel's header */
        run->work[(4u + at % 8u) % run->length] = (uint8_t)below(run, 16u);
        break;
    case 3:
        put_word(run, at / 4u * 4u, edge_word(run));
        break;
    case 4:
        change_length(run);
        break;
    case 5: /* a side of the display */
        put_word(run, 12u + 4u * (at % 2u), 1u + below(run, at % 16u == 0u ? 20000u : 40u));
        break;
    case 6:
        splice(run);
        break;
    case 7:
        run->length = below(run, 4u) == 0u ? at : run->length;
        break;
    default: /* the header of an array is of texts */
        run->work[at % 138u % run->length] = (uint8_t)("0123456789(){},:'< \n"[below(run, 20u)]);
        break;
    }
}

static size_t terms(size_t order)
{
    return (order + 1u) * (order + 2u) / 2u - 1u;
}

/* Gives a kernel the length that its header says, so that most damage reaches the later checks. */
static void fit_length(fuzzer *run)
{
    const uint8_t *header = run->work;
    if (run->length < 12u) {
        return;
    }
    size_t numbers = 2u * (terms(header[6]) + terms(header[7]) + header[8] + 5u * terms(header[10]));
    numbers += header[4] == 3u ? 2u : 0u;
    numbers += header[11] > 0u ? 1u + terms(header[11] - 1u) : 0u;
    const size_t length = 64u + 4u * numbers;
    if (length > INPUT_MAX) {
        return;
    }
    for (size_t i = run->length; i < length; i++) {
        run->work[i] = (uint8_t)(i % 4u == 3u ? 0x3du : below(run, 256u));
    }
    run->length = length;
}

static bool is_affordable(fuzzer *run, int pool, uint64_t work)
{
    if (work <= WORK_EACH) {
        return true;
    }
    if (work > run->pools[pool]) {
        return false;
    }
    run->pools[pool] -= work;
    run->costly++;
    return true;
}

static void expect_row(const lightpath_complex *values, size_t count)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += fabs((double)values[i].re) + fabs((double)values[i].im);
    }
    if (!(sum <= 1e300)) {
        fail("the decoder gave a row that is not finite", "fuzz");
    }
}

static void expect_status(lightpath_status status)
{
    if (status >= LIGHTPATH_STATUS_COUNT) {
        fail("the decoder gave no status", "fuzz");
    }
}

static void compute_transfer(fuzzer *run, const lightpath_kernel *kernel)
{
    lightpath_transfer transfer;
    size_t doubles = 0;
    const size_t columns = 2u * (size_t)kernel->width_px;
    const lightpath_status counted = lightpath_scratch_doubles(kernel, 1u + below(run, 3u), &doubles);
    expect_status(counted);
    if (counted != LIGHTPATH_OK || doubles > SCRATCH_MAX) {
        return;
    }
    double *scratch = run->scratch + (SCRATCH_MAX - doubles);
    if (lightpath_transfer_begin(&transfer, kernel, scratch, doubles) != LIGHTPATH_OK) {
        fail("the decoder refuses its own size of scratch memory", "fuzz");
    }
    const uint32_t row = below(run, 2u * kernel->height_px);
    const uint64_t work = WORK_OF_VALUE * columns + lightpath_transfer_additions(&transfer, row);
    if (is_affordable(run, kernel->method, work)) {
        lightpath_complex *values = run->values + (VALUES_MAX - columns);
        const double x = (double)below(run, 2001u) / 1000.0 - 1.0;
        const lightpath_status status = lightpath_transfer_row(&transfer, row, x, -x, values);
        expect_status(status);
        if (status == LIGHTPATH_OK) {
            expect_row(values, columns);
        }
        run->rows++;
    }
}

static void compute_modulator(fuzzer *run, const lightpath_kernel *kernel)
{
    const float *near[LIGHTPATH_CROSSTALK_TAPS];
    const size_t columns = kernel->width_px;
    const uint32_t row = below(run, kernel->height_px);
    if (!is_affordable(run, POOL_OF_MODULATOR, 2u * WORK_OF_VALUE * columns)) {
        return;
    }
    lightpath_complex *values = run->values + (VALUES_MAX - columns);
    const double v = lightpath_response_variation(kernel, 1.0, -1.0);
    if (!(fabs(v) <= 1e300)) {
        fail("the decoder gave a variation that is not finite", "fuzz");
    }
    if (lightpath_source_row(kernel, row, values) == LIGHTPATH_OK) {
        expect_row(values, columns);
    }
    for (size_t k = 0; k < LIGHTPATH_CROSSTALK_TAPS; k++) {
        near[k] = kernel->crosstalk_y > 0.0 || k == 3u ? run->phases + (LIGHTPATH_SIDE_PX_MAX - columns) : NULL;
    }
    const lightpath_status status = lightpath_field_row(kernel, row, near, values);
    expect_status(status);
    if (status == LIGHTPATH_OK) {
        expect_row(values, columns);
    }
    run->rows += 2u;
}

static void decode_kernel(fuzzer *run)
{
    lightpath_kernel kernel;
    const uint8_t *bytes = run->input + (INPUT_MAX - run->length);
    const lightpath_status status = lightpath_kernel_open(&kernel, bytes, run->length);
    expect_status(status);
    if (status != LIGHTPATH_OK) {
        return;
    }
    run->accepted++;
    if (below(run, 2u) == 0u) {
        compute_transfer(run, &kernel);
    } else {
        compute_modulator(run, &kernel);
    }
}

static void decode_array(fuzzer *run)
{
    const size_t values_max = 32u;
    const uint8_t *bytes = run->input + (INPUT_MAX - run->length);
    size_t at = 0;
    lightpath_f16 reader;
    lightpath_status status = LIGHTPATH_OK;
    lightpath_f16_begin(&reader, run->values + (VALUES_MAX - values_max), values_max);
    while (status == LIGHTPATH_OK && at < run->length) {
        const size_t piece = 1u + below(run, 512u);
        const size_t left = run->length - at;
        size_t used = 0;
        status = lightpath_f16_feed(&reader, bytes + at, piece < left ? piece : left, &used);
        expect_status(status);
        if (reader.row_ready) {
            if (reader.row >= reader.rows || reader.columns > values_max) {
                fail("the decoder gave a row that the array has not", "fuzz");
            }
            expect_row(reader.values, reader.columns);
            run->rows++;
        }
        if (used == 0u) {
            fail("the decoder did not read", "fuzz");
        }
        at += used;
    }
    if (lightpath_f16_end(&reader) == LIGHTPATH_OK) {
        run->arrays++;
    }
}

static void run_once(fuzzer *run)
{
    const file *chosen = &run->files[below(run, (uint32_t)run->count)];
    memcpy(run->work, chosen->bytes, chosen->length);
    run->length = chosen->length;
    for (uint32_t i = 0, times = 1u + below(run, 4u); i < times; i++) {
        damage(run);
    }
    if (!chosen->is_array && below(run, 4u) > 0u) {
        fit_length(run);
    }
    if (!chosen->is_array && below(run, 16u) > 0u) {
        renew_checksum(run->work, run->length);
    }
    memcpy(run->input + (INPUT_MAX - run->length), run->work, run->length);
    for (int pool = 0; pool < POOLS; pool++) {
        run->pools[pool] += WORK_SHARED;
    }
    if (chosen->is_array) {
        decode_array(run);
    } else {
        decode_kernel(run);
    }
}

static void load(fuzzer *run, const char *folder)
{
    char path[TEXT_MAX];
    char line[TEXT_MAX];
    join(path, folder, "vectors.txt", "");
    FILE *names = open_text(path);
    while (next_line(names, line)) {
        file *next = &run->files[run->count];
        if (run->count == FILES_MAX) {
            fail("there are more vectors than expected", line);
        }
        join(path, folder, line, "");
        next->bytes = read_file(path, &next->length);
        next->is_array = strstr(line, ".npy") != NULL;
        if (next->length > INPUT_MAX) {
            fail("the file is longer than expected", line);
        }
        run->count++;
    }
    fclose(names);
}

int main(int count, char **arguments)
{
    static fuzzer run;
    if (count < 3) {
        fail("usage", "fuzz FOLDER COUNT [SEED]");
    }
    const unsigned long inputs = strtoul(arguments[2], NULL, 10);
    run.state = count > 3 ? strtoul(arguments[3], NULL, 10) + 1u : 0x9e3779b97f4a7c15u;
    run.input = allocate(INPUT_MAX);
    run.work = allocate(INPUT_MAX);
    run.scratch = allocate(SCRATCH_MAX * sizeof *run.scratch);
    run.values = allocate(VALUES_MAX * sizeof *run.values);
    run.phases = allocate(LIGHTPATH_SIDE_PX_MAX * sizeof *run.phases);
    for (size_t i = 0; i < LIGHTPATH_SIDE_PX_MAX; i++) {
        run.phases[i] = (float)((double)(i * 7u % 512u) * 0.0371 - 6.0);
    }
    load(&run, arguments[1]);
    for (unsigned long i = 0; i < inputs; i++) {
        run_once(&run);
    }
    printf("%lu damaged files: %lu kernels and %lu arrays were accepted, %lu rows computed, %lu of them costly\n",
        inputs, run.accepted, run.arrays, run.rows, run.costly);
    if (run.accepted < inputs / 20u) {
        fail("too few kernels were accepted for a test of their rows", "fuzz");
    }
    for (size_t i = 0; i < run.count; i++) {
        free(run.files[i].bytes);
    }
    free(run.input);
    free(run.work);
    free(run.scratch);
    free(run.values);
    free(run.phases);
    return 0;
}
