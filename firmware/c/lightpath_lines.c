/*
 * Lines of documents, and the values in them.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "lightpath_lines.h"

/* The last second that a document can name: that of the year 9999. */
#define LAST_UNIX_S 253402300799

#define WORD_LENGTH_MAX 63u
/* Instead of a length, where a text does not begin as it must. */
#define NOT_THERE SIZE_MAX

bool lightpath_same(const uint8_t *a, const uint8_t *b, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        if (a[i] != b[i]) {
            return false;
        }
    }
    return true;
}

/* Length of the string if the text begins with it, or NOT_THERE. */
static size_t prefix(lightpath_text text, const char *string)
{
    size_t i = 0;
    for (; string[i] != '\0'; i++) {
        if (i == text.length || text.at[i] != (uint8_t)string[i]) {
            return NOT_THERE;
        }
    }
    return i;
}

bool lightpath_is(lightpath_text text, const char *string)
{
    return prefix(text, string) == text.length;
}

static bool is_text(const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        if ((bytes[i] < (uint8_t)' ' || bytes[i] > (uint8_t)'~') && bytes[i] != (uint8_t)'\n') {
            return false;
        }
    }
    return length > 0u && bytes[length - 1u] == (uint8_t)'\n';
}

void lightpath_lines_begin(lightpath_lines *lines, const uint8_t *bytes, size_t length)
{
    lines->all.at = bytes;
    lines->all.length = length;
    lines->place = 0;
    lines->line = 0;
    lines->verdict = LIGHTPATH_TRUSTED;
    if (length > LIGHTPATH_DOCUMENT_BYTES_MAX) {
        lines->verdict = LIGHTPATH_DOCUMENT_TOO_LARGE;
    } else if (!is_text(bytes, length)) {
        lines->verdict = LIGHTPATH_DOCUMENT_NOT_TEXT;
    }
}

/* The next line, without its line feed; of no length at the end of the document. */
static lightpath_text next_line(const lightpath_lines *lines)
{
    lightpath_text line = {lines->all.at + lines->place, 0};
    while (lines->place + line.length < lines->all.length && line.at[line.length] != (uint8_t)'\n') {
        line.length++;
    }
    return line;
}

/* Length of the name and the space after it, or NOT_THERE. */
static size_t name_length(lightpath_text line, const char *name)
{
    const size_t length = prefix(line, name);
    return length < line.length && line.at[length] == (uint8_t)' ' ? length + 1u : NOT_THERE;
}

bool lightpath_lines_comes(const lightpath_lines *lines, const char *name)
{
    return lines->verdict == LIGHTPATH_TRUSTED && name_length(next_line(lines), name) != NOT_THERE;
}

void lightpath_lines_wrong_value(lightpath_lines *lines)
{
    if (lines->verdict == LIGHTPATH_TRUSTED) {
        lines->verdict = LIGHTPATH_DOCUMENT_WRONG_VALUE;
    }
}

void lightpath_lines_end(lightpath_lines *lines)
{
    if (lines->verdict == LIGHTPATH_TRUSTED && lines->place < lines->all.length) {
        lines->verdict = LIGHTPATH_DOCUMENT_TOO_LONG;
        lines->line++;
    }
}

lightpath_text lightpath_lines_text(lightpath_lines *lines, const char *name)
{
    lightpath_text nothing = {lines->all.at, 0};
    if (lines->verdict != LIGHTPATH_TRUSTED) {
        return nothing;
    }
    lightpath_text text = next_line(lines);
    const size_t start = name_length(text, name);
    lines->line++;
    if (start == NOT_THERE) {
        lines->verdict = LIGHTPATH_DOCUMENT_OTHER_LINE;
        return nothing;
    }
    lines->place += text.length + 1u;
    text.at += start;
    text.length -= start;
    return text;
}

void lightpath_lines_head(lightpath_lines *lines, const char *kind, const char *version)
{
    const bool is_version = lightpath_is(lightpath_lines_text(lines, kind), version);
    if (lines->verdict == LIGHTPATH_TRUSTED && !is_version) {
        lines->verdict = LIGHTPATH_DOCUMENT_OTHER_VERSION;
    }
}

static bool is_between(uint8_t character, char first, char last)
{
    return character >= (uint8_t)first && character <= (uint8_t)last;
}

bool lightpath_is_word(lightpath_text text)
{
    bool is_word = text.length > 0u && text.length <= WORD_LENGTH_MAX;
    for (size_t i = 0; is_word && i < text.length; i++) {
        const uint8_t c = text.at[i];
        is_word = is_between(c, 'a', 'z') || is_between(c, 'A', 'Z') || is_between(c, '0', '9') ||
                  is_between(c, '-', '.') || c == (uint8_t)'_';
    }
    return is_word;
}

lightpath_text lightpath_lines_word(lightpath_lines *lines, const char *name)
{
    const lightpath_text text = lightpath_lines_text(lines, name);
    if (!lightpath_is_word(text)) {
        lightpath_lines_wrong_value(lines);
    }
    return text;
}

/* Whether a text is a whole number without leading zeros, of 0 to `max`. */
static bool read_number(lightpath_text text, uint64_t max, uint64_t *number)
{
    uint64_t sum = 0;
    if (text.length == 0u || (text.length > 1u && text.at[0] == (uint8_t)'0')) {
        return false;
    }
    for (size_t i = 0; i < text.length; i++) {
        const uint64_t digit = (uint64_t)text.at[i] - (uint64_t)'0';
        /* The product must fit before the sum is compared. */
        if (digit > 9u || sum > UINT64_MAX / 10u || sum * 10u > UINT64_MAX - digit) {
            return false;
        }
        sum = sum * 10u + digit;
    }
    *number = sum;
    return sum <= max;
}

uint64_t lightpath_lines_number(lightpath_lines *lines, const char *name, uint64_t max)
{
    uint64_t number = 0;
    if (!read_number(lightpath_lines_text(lines, name), max, &number)) {
        lightpath_lines_wrong_value(lines);
    }
    return number;
}

int64_t lightpath_lines_signed(lightpath_lines *lines, const char *name)
{
    lightpath_text text = lightpath_lines_text(lines, name);
    uint64_t size = 0;
    const bool is_negative = text.length > 0u && text.at[0] == (uint8_t)'-';
    if (is_negative) {
        text.at++;
        text.length--;
    }
    const uint64_t max = (uint64_t)INT64_MAX + (is_negative ? 1u : 0u);
    if (!read_number(text, max, &size) || (is_negative && size == 0u)) {
        lightpath_lines_wrong_value(lines);
        return 0;
    }
    /* The smallest number has no positive twin. */
    return is_negative ? -(int64_t)(size - 1u) - 1 : (int64_t)size;
}

int64_t lightpath_lines_time(lightpath_lines *lines, const char *name)
{
    int64_t unix_s = 0;
    if (!lightpath_read_time(lightpath_lines_text(lines, name), &unix_s)) {
        lightpath_lines_wrong_value(lines);
    }
    return unix_s;
}

/* Whether a time is a lower bound, which no clock says. */
static bool is_bound(int64_t now_unix_s)
{
    return now_unix_s <= LIGHTPATH_AT_LEAST(LAST_UNIX_S);
}

int64_t lightpath_not_before(int64_t now_unix_s, int64_t issued_unix_s)
{
    const int64_t bound = LIGHTPATH_AT_LEAST(issued_unix_s);
    return is_bound(now_unix_s) && now_unix_s < bound ? bound : now_unix_s;
}

lightpath_verdict lightpath_check_time(int64_t from_unix_s, int64_t until_unix_s, int64_t now_unix_s,
    lightpath_verdict not_yet, lightpath_verdict expired)
{
    if (is_bound(now_unix_s)) {
        return now_unix_s - INT64_MIN < until_unix_s ? LIGHTPATH_TRUSTED : expired;
    }
    if (now_unix_s < from_unix_s) {
        return not_yet;
    }
    return now_unix_s < until_unix_s ? LIGHTPATH_TRUSTED : expired;
}

/* 16 for what is no digit. */
static unsigned hex_digit(uint8_t character)
{
    if (is_between(character, '0', '9')) {
        return (unsigned)character - (unsigned)'0';
    }
    return is_between(character, 'a', 'f') ? (unsigned)character - (unsigned)'a' + 10u : 16u;
}

bool lightpath_read_hex(lightpath_text text, uint8_t *bytes, size_t count)
{
    if (text.length != 2u * count) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const unsigned high = hex_digit(text.at[2u * i]);
        const unsigned low = hex_digit(text.at[2u * i + 1u]);
        if (high > 15u || low > 15u) {
            return false;
        }
        bytes[i] = (uint8_t)(16u * high + low);
    }
    return true;
}

/* Days from the start of 1970 to the start of a year: the years before, and those of them with a day more. */
static uint32_t days_before_year(uint32_t year)
{
    const uint32_t before = year - 1u;
    /* 719162 = 1969 * 365 + 1969 / 4 - 1969 / 100 + 1969 / 400 */
    return before * 365u + before / 4u - before / 100u + before / 400u - 719162u;
}

bool lightpath_read_time(lightpath_text text, int64_t *unix_s)
{
    static const char form[] = "0000-00-00T00:00:00Z";
    static const uint8_t month_days[12] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    uint32_t numbers[6] = {0, 0, 0, 0, 0, 0}; /* year, month, day, hour, minute, second */
    size_t part = 0;
    if (text.length != sizeof form - 1u) {
        return false;
    }
    for (size_t i = 0; i < text.length; i++) {
        if (form[i] != '0') {
            if (text.at[i] != (uint8_t)form[i]) {
                return false;
            }
            part++;
        } else if (is_between(text.at[i], '0', '9')) {
            numbers[part] = numbers[part] * 10u + (uint32_t)text.at[i] - (uint32_t)'0';
        } else {
            return false;
        }
    }
    const uint32_t year = numbers[0], month = numbers[1], day = numbers[2];
    if (year < 1970u || month < 1u || month > 12u || numbers[3] > 23u || numbers[4] > 59u || numbers[5] > 59u) {
        return false;
    }
    const uint32_t year_days = days_before_year(year + 1u) - days_before_year(year);
    uint32_t days = days_before_year(year) + day - 1u;
    for (uint32_t m = 1; m < month; m++) {
        days += month_days[m - 1u];
    }
    /* February has a day more in a year of 366 days. */
    days += month > 2u ? year_days - 365u : 0u;
    const uint32_t last_day = month_days[month - 1u] + (month == 2u ? year_days - 365u : 0u);
    *unix_s = (int64_t)days * 86400 + (int64_t)(numbers[3] * 3600u + numbers[4] * 60u + numbers[5]);
    return day >= 1u && day <= last_day;
}
