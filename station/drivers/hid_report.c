#include "drivers/hid_report.h"

#include "base/check.h"
#include "base/number.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { WORDS_MAX = 6, REPORT_TEXT_MAX = FORCE_TEXT_MAX };
_Static_assert(HID_FORCE_NEWS + CHANNEL_COUNT <= 32, "the bits of news");

// ---- text ---------------------------------------------------------------------------------------

static int split(char *text, char *out_words[WORDS_MAX]) {
    int count = 0;
    char *rest;
    for (char *word = strtok_r(text, " \t", &rest); word; word = strtok_r(NULL, " \t", &rest)) {
        if (count == WORDS_MAX)
            return 0;
        out_words[count++] = word;
    }
    return count;
}

static bool parse_place(char *words[], struct hid_field *out) {
    int64_t report = 0, bit, count;
    char *colon = strchr(words[0], ':'), *first_bit = colon ? colon + 1 : words[0];
    if (colon)
        *colon = 0;
    if ((colon && !number_int(words[0], 1, 255, &report)) ||
        !number_int(first_bit, 0, 8 * HID_REPORT_BYTES_MAX, &bit) ||
        !number_int(words[1], 1, 32, &count) || bit + count > 8 * HID_REPORT_BYTES_MAX)
        return false;
    *out = (struct hid_field){(uint8_t)report, (int)bit, (int)count};
    return true;
}

static bool axis_is_signed(const struct hid_axis *axis) {
    return axis->is_signed || axis->closed < 0 || axis->open < 0;
}

static bool is_value_of(const struct hid_axis *axis, int64_t value) {
    int64_t half = INT64_C(1) << (axis->field.count - 1);
    return axis_is_signed(axis) ? value >= -half && value < half : value >= 0 && value < 2 * half;
}

bool hid_axis_parse(const char *text, struct hid_axis *out_axis) {
    char copy[REPORT_TEXT_MAX], *words[WORDS_MAX];
    if (strlen(text) >= sizeof copy)
        return false;
    strcpy(copy, text);
    int count = split(copy, words);
    struct hid_axis axis = {.dead = 0};
    if (count > 4 && !strcmp(words[count - 1], "signed")) {
        axis.is_signed = true;
        count--;
    }
    if ((count != 4 && count != 5) || !parse_place(words, &axis.field) ||
        !number_int(words[2], INT32_MIN, UINT32_MAX, &axis.closed) ||
        !number_int(words[3], INT32_MIN, UINT32_MAX, &axis.open) ||
        (count == 5 && !number_double(words[4], 0, 0.4, &axis.dead)) || axis.closed == axis.open ||
        !is_value_of(&axis, axis.closed) || !is_value_of(&axis, axis.open))
        return false;
    *out_axis = axis;
    return true;
}

bool hid_field_parse(const char *text, struct hid_field *out_field) {
    char copy[REPORT_TEXT_MAX], *words[WORDS_MAX];
    if (strlen(text) >= sizeof copy)
        return false;
    strcpy(copy, text);
    return split(copy, words) == 2 && parse_place(words, out_field);
}

bool hid_gauge_parse(const char *text, struct hid_gauge *out_gauge) {
    char copy[REPORT_TEXT_MAX], *words[WORDS_MAX];
    if (strlen(text) >= sizeof copy)
        return false;
    strcpy(copy, text);
    int count = split(copy, words);
    struct hid_gauge gauge = {.is_signed = true, .scale = 1};
    if (count > 2 && (!strcmp(words[count - 1], "signed") || !strcmp(words[count - 1], "unsigned")))
        gauge.is_signed = words[--count][0] == 's';
    if (count < 2 || count > 4 || !parse_place(words, &gauge.field) ||
        (count > 2 && !number_double(words[2], -1e9, 1e9, &gauge.scale)) ||
        (count > 3 && !number_double(words[3], -1e9, 1e9, &gauge.offset)))
        return false;
    *out_gauge = gauge;
    return true;
}

bool hid_counter_parse(const char *text, struct hid_field *out_field, double *out_count_ms) {
    char copy[REPORT_TEXT_MAX], *words[WORDS_MAX];
    if (strlen(text) >= sizeof copy)
        return false;
    strcpy(copy, text);
    return split(copy, words) == 3 && parse_place(words, out_field) &&
           number_double(words[2], 0.01, 1000, out_count_ms);
}

// ---- reports ------------------------------------------------------------------------------------

static bool is_numbered(const struct hid_field *field) {
    return field->count && field->report;
}

bool hid_layout_is_numbered(const struct hid_layout *layout) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (is_numbered(&layout->handles[i].opening.field) ||
            is_numbered(&layout->handles[i].buttons))
            return true;
    for (int c = 0; c < CHANNEL_COUNT; c++)
        for (int i = 0; i < layout->forces[c].force.count; i++)
            if (is_numbered(&layout->forces[c].parts[i].field))
                return true;
    for (int i = 0; i < layout->mark_count; i++)
        if (is_numbered(&layout->marks[i]))
            return true;
    return is_numbered(&layout->counter);
}

static uint32_t bits_of_field(const uint8_t *bytes, const struct hid_field *field) {
    uint32_t value = 0;
    for (int i = 0; i < field->count; i++) {
        int bit = field->bit + i;
        value |= (uint32_t)(bytes[bit / 8] >> bit % 8 & 1) << i;
    }
    return value;
}

static int64_t raw_of(const uint8_t *bytes, const struct hid_axis *axis) {
    int64_t value = bits_of_field(bytes, &axis->field), half = INT64_C(1)
                                                               << (axis->field.count - 1);
    return axis_is_signed(axis) && value >= half ? value - 2 * half : value;
}

double hid_opening(const struct hid_axis *axis, int64_t raw) {
    double way = (double)(raw - axis->closed) / (double)(axis->open - axis->closed);
    return fmax(0, fmin(1, (way - axis->dead) / (1 - 2 * axis->dead)));
}

static double newtons_of(const uint8_t *bytes, const struct hid_gauge *gauge) {
    int bits = gauge->field.count;
    int64_t range = INT64_C(1) << bits, raw = bits_of_field(bytes, &gauge->field);
    int64_t lowest = gauge->is_signed ? -range / 2 : 0, highest = lowest + range - 1;
    if (raw > highest)
        raw -= range;
    bool at_end = raw == highest || (gauge->is_signed && raw == lowest);
    return at_end && bits >= 8 ? NAN : gauge->scale * (double)raw + gauge->offset;
}

static bool is_in(const struct hid_field *field, uint8_t report) {
    return field->count && field->report == report;
}

static enum result check_size(const struct hid_field *field, uint8_t report, size_t size,
                              struct error *err) {
    size_t needed = (size_t)(field->bit + field->count + 7) / 8;
    if (!is_in(field, report) || size >= needed)
        return RESULT_OK;
    return fail(err, RESULT_FORMAT, "report %u: %zu bytes, bits %d to %d need %zu", report, size,
                field->bit, field->bit + field->count - 1, needed);
}

static enum result check_sizes(const struct hid_layout *layout, uint8_t report, size_t size,
                               struct error *err) {
    enum result result = check_size(&layout->counter, report, size, err);
    for (int i = 0; i < INSTRUMENT_COUNT && result == RESULT_OK; i++) {
        result = check_size(&layout->handles[i].opening.field, report, size, err);
        if (result == RESULT_OK)
            result = check_size(&layout->handles[i].buttons, report, size, err);
    }
    for (int c = 0; c < CHANNEL_COUNT; c++)
        for (int i = 0; i < layout->forces[c].force.count && result == RESULT_OK; i++)
            result = check_size(&layout->forces[c].parts[i].field, report, size, err);
    for (int i = 0; i < layout->mark_count && result == RESULT_OK; i++)
        result = check_size(&layout->marks[i], report, size, err);
    return result;
}

static void read_forces(const struct hid_layout *layout, uint8_t report, const uint8_t *bytes,
                        struct hid_state *state, uint32_t *news) {
    for (int c = 0; c < CHANNEL_COUNT; c++)
        for (int i = 0; i < layout->forces[c].force.count; i++) {
            const struct hid_gauge *gauge = &layout->forces[c].parts[i];
            if (!is_in(&gauge->field, report))
                continue;
            state->forces_n[c][i] = newtons_of(bytes, gauge);
            state->has_force[c] |= (uint8_t)(1 << i);
            *news |= 1u << (HID_FORCE_NEWS + c);
        }
}

static uint32_t read_mark_bits(const struct hid_layout *layout, uint8_t report,
                               const uint8_t *bytes, struct hid_state *state) {
    uint32_t news = 0;
    for (int i = 0; i < layout->mark_count; i++) {
        uint32_t bit = 1u << i;
        if (!is_in(&layout->marks[i], report))
            continue;
        state->marks =
            bits_of_field(bytes, &layout->marks[i]) ? state->marks | bit : state->marks & ~bit;
        state->has_marks |= bit;
        news = HID_MARK_NEWS;
    }
    return news;
}

enum result hid_report_read(const struct hid_layout *layout, const uint8_t *bytes, size_t size,
                            struct hid_state *state, uint32_t *out_news, struct error *err) {
    bool numbered = hid_layout_is_numbered(layout);
    *out_news = 0;
    if (!size)
        return fail(err, RESULT_FORMAT, "an empty report");
    uint8_t report = numbered ? bytes[0] : 0;
    bytes += numbered;
    enum result result = check_sizes(layout, report, size - numbered, err);
    state->has_count = result == RESULT_OK && is_in(&layout->counter, report);
    if (state->has_count)
        state->count = bits_of_field(bytes, &layout->counter);
    for (int i = 0; i < INSTRUMENT_COUNT && result == RESULT_OK; i++) {
        const struct hid_handle *handle = &layout->handles[i];
        bool opening = is_in(&handle->opening.field, report),
             buttons = is_in(&handle->buttons, report);
        if (opening)
            state->handles[i].opening =
                hid_opening(&handle->opening, raw_of(bytes, &handle->opening));
        if (buttons)
            state->handles[i].buttons = bits_of_field(bytes, &handle->buttons);
        state->has_opening[i] |= opening;
        state->has_buttons[i] |= buttons;
        *out_news |= (uint32_t)(opening || buttons) << i;
    }
    if (result == RESULT_OK) {
        read_forces(layout, report, bytes, state, out_news);
        *out_news |= read_mark_bits(layout, report, bytes, state);
    }
    return result;
}

bool hid_state_is_whole(const struct hid_layout *layout, const struct hid_state *state, int i) {
    CHECK(i >= 0 && i < INSTRUMENT_COUNT);
    const struct hid_handle *handle = &layout->handles[i];
    return (state->has_opening[i] || !handle->opening.field.count) &&
           (state->has_buttons[i] || !handle->buttons.count);
}

bool hid_force_is_whole(const struct hid_layout *layout, const struct hid_state *state,
                        enum channel channel) {
    return state->has_force[channel] == (1 << layout->forces[channel].force.count) - 1;
}
