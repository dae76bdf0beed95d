// Instrument handles and foot pedals that are HID devices.
//
//   vid, pid   which device: its vendor and product, as lsusb prints them (hexadecimal)
//   serial     its serial number; any
//   port       where it is plugged in, as `arthron-station probe` prints it; any
//   usage      PAGE USAGE of one of its collections, hexadecimal; any
//   on_change  yes: while it says nothing its last values hold, as HID devices may do that report
//              changes only; it is asked for its values when it is opened; no: it reports all the
//              time, and silence is a fault; yes
//
// and for each value a field of its input reports (drivers/hid_report.h):
//   CHANNEL.opening  [REPORT:]BIT COUNT CLOSED OPEN [DEAD] [signed]
//   CHANNEL.buttons  [REPORT:]BIT COUNT
//   CHANNEL.force    [REPORT:]BIT COUNT [SCALE [OFFSET]] [signed | unsigned]: newtons; three of
//                    them, separated by commas: the length of the vector
//   zero.CHANNEL     the force, or its three components, with nothing pressing (drivers/force.h)
//   marker.NAME      bit [REPORT:]BIT [both]: a marker, when the bit is set; both: when it is
//                    cleared too
//   counter          [REPORT:]BIT COUNT MS: counts reports, or the device's time; MS each; none
//
// A sample is made when all its values have come since the device was opened. Reports
// that wait together are taken together, each with a time of its own (drivers/hid_stamp.h).

#include "base/check.h"
#include "base/clock.h"
#include "drivers/drivers.h"
#include "drivers/hid_find.h"
#include "drivers/hid_report.h"
#include "drivers/hid_stamp.h"
#include "drivers/options.h"

#include <hidapi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REPORTS_MAX = 64 }; // that the kernel keeps

static const int repeat_ms = 20; // of what a silent device said last

struct handle_device {
    struct hid_identity identity;
    struct hid_layout layout;
    bool on_change;
    uint32_t all_news;            // of the values that are read
    struct edge edges[EDGES_MAX]; // of layout.marks

    hid_device *line;
    struct hid_state state;
    struct hid_stamps stamps;
};

// What came in one poll: the reports that have news. One reading has room for the samples of the
// newest.
struct pack {
    int count, room;
    struct hid_report {
        uint32_t news; // as hid_report_read has it
        struct hid_state state;
    } reports[REPORTS_MAX];
};

// ---- config -------------------------------------------------------------------------------------

static bool parse_hex(const char *text, uint16_t *out) {
    char *end;
    unsigned long value = strtoul(text, &end, 16);
    *out = (uint16_t)value;
    return *text && strspn(text, "0123456789abcdefABCDEFx") == strlen(text) && !*end &&
           value <= UINT16_MAX;
}

static enum result read_key_number(const struct device_config *config, const char *key,
                                   uint16_t *out, struct error *err) {
    const char *text = option_text(config, key);
    if (!text)
        return option_fail(config, key, err, RESULT_MISSING, "is required");
    if (!parse_hex(text, out))
        return option_fail(config, key, err, RESULT_INVALID,
                           "\"%s\" is not a hexadecimal number up to ffff", text);
    return RESULT_OK;
}

static enum result read_text(const struct device_config *config, const char *key,
                             char out[HID_TEXT_MAX], struct error *err) {
    const char *text = option_text(config, key);
    if (text && strlen(text) >= HID_TEXT_MAX)
        return option_fail(config, key, err, RESULT_LIMIT, "longer than %d bytes",
                           HID_TEXT_MAX - 1);
    strcpy(out, text ? text : "");
    return RESULT_OK;
}

static enum result read_usage(const struct device_config *config, struct hid_identity *identity,
                              struct error *err) {
    const char *text = option_text(config, "usage");
    char page[8], usage[8], rest;
    if (text && (sscanf(text, "%7s %7s %c", page, usage, &rest) != 2 ||
                 !parse_hex(page, &identity->usage_page) || !parse_hex(usage, &identity->usage) ||
                 !identity->usage_page))
        return option_fail(config, "usage", err, RESULT_INVALID,
                           "\"%s\" is not PAGE USAGE in hexadecimal", text);
    return RESULT_OK;
}

static enum result read_handle(const struct device_config *config, enum channel channel,
                               struct hid_handle *out, struct error *err) {
    char key[64];
    snprintf(key, sizeof key, "%s.opening", channel_name(channel));
    const char *text = option_text(config, key);
    if (text && !hid_axis_parse(text, &out->opening))
        return option_fail(config, key, err, RESULT_INVALID,
                           "\"%s\" is not [REPORT:]BIT COUNT CLOSED OPEN [DEAD] [signed]", text);
    snprintf(key, sizeof key, "%s.buttons", channel_name(channel));
    text = option_text(config, key);
    if (text && !hid_field_parse(text, &out->buttons))
        return option_fail(config, key, err, RESULT_INVALID, "\"%s\" is not [REPORT:]BIT COUNT",
                           text);
    return RESULT_OK;
}

static enum result read_force(const struct device_config *config, enum channel channel,
                              struct hid_force *out, struct error *err) {
    char key[64], parts[FORCE_PARTS_MAX][FORCE_TEXT_MAX];
    snprintf(key, sizeof key, "%s.force", channel_name(channel));
    const char *text = option_text(config, key);
    bool good = !text || (out->force.count = force_split(text, parts));
    for (int i = 0; i < out->force.count && good; i++)
        good = hid_gauge_parse(parts[i], &out->parts[i]);
    if (!good)
        return option_fail(config, key, err, RESULT_INVALID,
                           "\"%s\" is neither one nor three of [REPORT:]BIT COUNT [SCALE [OFFSET]] "
                           "[signed | unsigned]",
                           text);
    return force_read_zero(config, channel, &out->force, err);
}

static enum result add_mark(struct handle_device *d, const struct device_config *config,
                            const struct device_option *option, struct error *err) {
    struct hid_layout *layout = &d->layout;
    char text[64], field[sizeof text + 4];
    if (layout->mark_count == EDGES_MAX)
        return option_fail(config, option->key, err, RESULT_LIMIT,
                           "a device has at most %d markers", EDGES_MAX);
    struct edge *edge = &d->edges[layout->mark_count];
    enum result result = edge_init(edge, config, option->key, err);
    if (result != RESULT_OK)
        return result;
    snprintf(text, sizeof text, "%s", option->value);
    edge->each = edge_take_both(text);
    snprintf(field, sizeof field, "%s 1", strncmp(text, "bit ", 4) ? "" : text + 4);
    if (!hid_field_parse(field, &layout->marks[layout->mark_count]))
        return option_fail(config, option->key, err, RESULT_INVALID,
                           "\"%s\" is not bit [REPORT:]BIT [both]", option->value);
    layout->mark_count++;
    return edge_check(edge, config, option->key, err);
}

static enum result read_marks(struct handle_device *d, const struct device_config *config,
                              struct error *err) {
    for (int i = 0; i < config->option_count; i++)
        if (edge_key(&config->options[i]) &&
            add_mark(d, config, &config->options[i], err) != RESULT_OK)
            return RESULT_INVALID;
    return RESULT_OK;
}

static bool lacks_number(const struct hid_field *field) {
    return field->count && !field->report;
}

static enum result add_hid_force(const struct device_config *config, enum channel channel,
                                 struct hid_layout *layout, bool *unnumbered,
                                 struct device_outputs *outputs, struct error *err) {
    struct hid_force *force = &layout->forces[channel];
    enum result result = read_force(config, channel, force, err);
    for (int i = 0; i < force->force.count && result == RESULT_OK; i++)
        *unnumbered |= lacks_number(&force->parts[i].field);
    if (force->force.count && result == RESULT_OK)
        outputs_add(outputs, channel, SAMPLE_FORCE);
    return result;
}

static enum result read_layout(const struct device_config *config, struct hid_layout *layout,
                               struct device_outputs *outputs, struct error *err) {
    bool unnumbered = false;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        enum channel channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + i);
        struct hid_handle *handle = &layout->handles[i];
        enum result result = read_handle(config, channel, handle, err);
        if (result != RESULT_OK)
            return result;
        if (handle->opening.field.count || handle->buttons.count)
            outputs_add(outputs, channel, SAMPLE_HANDLE);
        unnumbered |= lacks_number(&handle->opening.field) || lacks_number(&handle->buttons);
    }
    for (int c = 0; c < CHANNEL_COUNT; c++) {
        enum result result =
            add_hid_force(config, (enum channel)c, layout, &unnumbered, outputs, err);
        if (result != RESULT_OK)
            return result;
    }
    const char *counter = option_text(config, "counter");
    if (counter && !hid_counter_parse(counter, &layout->counter, &layout->count_ms))
        return option_fail(config, "counter", err, RESULT_INVALID,
                           "\"%s\" is not [REPORT:]BIT COUNT MS", counter);
    unnumbered |= lacks_number(&layout->counter);
    for (int i = 0; i < layout->mark_count; i++)
        unnumbered |= lacks_number(&layout->marks[i]);
    if (!outputs->count && !layout->mark_count)
        return fail(err, RESULT_MISSING,
                    "[device %s]: the section needs a CHANNEL.opening, CHANNEL.buttons, "
                    "CHANNEL.force or marker.NAME",
                    config->name);
    if (unnumbered && hid_layout_is_numbered(layout))
        return fail(err, RESULT_INVALID, "[device %s]: only some values name their report",
                    config->name);
    return RESULT_OK;
}

static uint32_t news_of(const struct device_output *output) {
    return 1u << (output->kind == SAMPLE_FORCE ? HID_FORCE_NEWS + output->channel
                                               : output->channel - CHANNEL_FIRST_INSTRUMENT);
}

static enum result configure_hid(struct handle_device *d, const struct device_config *config,
                                 struct device_outputs *outputs, struct error *err) {
    static const char *const keys[] = {"vid",       "pid",      "serial",   "port",   "usage",
                                       "on_change", ".opening", ".buttons", ".force", "zero.",
                                       "counter",   "marker.*", NULL};
    enum result result = options_check(config, keys, err);
    if (result == RESULT_OK)
        result = read_key_number(config, "vid", &d->identity.vid, err);
    if (result == RESULT_OK)
        result = read_key_number(config, "pid", &d->identity.pid, err);
    if (result == RESULT_OK)
        result = read_text(config, "serial", d->identity.serial, err);
    if (result == RESULT_OK)
        result = read_text(config, "port", d->identity.port, err);
    if (result == RESULT_OK)
        result = read_usage(config, &d->identity, err);
    if (result == RESULT_OK)
        result = option_switch(config, "on_change", true, &d->on_change, err);
    if (result == RESULT_OK)
        result = read_marks(d, config, err);
    if (result == RESULT_OK)
        result = read_layout(config, &d->layout, outputs, err);
    for (int i = 0; i < outputs->count; i++)
        d->all_news |= news_of(&outputs->outputs[i]);
    d->stamps.counter_bits = d->layout.counter.count;
    d->stamps.count_ms = d->layout.count_ms;
    return result;
}

static enum result handle_create(const struct device_config *config, void **out_device,
                                 struct device_outputs *out_outputs, struct error *err) {
    struct handle_device *d = alloc(1, sizeof *d);
    enum result result = configure_hid(d, config, out_outputs, err);
    if (result == RESULT_OK)
        *out_device = d;
    else
        free(d);
    return result;
}

// ---- readings -----------------------------------------------------------------------------------

static bool is_read(const struct hid_layout *layout, uint8_t report) {
    const uint8_t zeros[1 + HID_REPORT_BYTES_MAX] = {report};
    struct hid_state unused = {0};
    uint32_t news;
    return hid_report_read(layout, zeros, sizeof zeros, &unused, &news, NULL) == RESULT_OK && news;
}

// One that reports changes only would else be unknown until the first. Not every device answers.
static void ask_for_state(struct handle_device *d) {
    bool numbered = hid_layout_is_numbered(&d->layout);
    for (int report = numbered; report <= (numbered ? UINT8_MAX : 0); report++) {
        uint8_t bytes[1 + HID_REPORT_BYTES_MAX] = {
            (uint8_t)report}; // its number first, in any case
        uint32_t news;
        if (!is_read(&d->layout, (uint8_t)report))
            continue;
        int size = hid_get_input_report(d->line, bytes, sizeof bytes);
        if (size > 1)
            hid_report_read(&d->layout, bytes + !numbered, (size_t)(size - !numbered), &d->state,
                            &news, NULL);
    }
    d->state.has_count = false; // of an answer, which is none of the reports that are counted
}

static enum result handle_open(void *device, struct error *err) {
    struct handle_device *d = device;
    d->state = (struct hid_state){0};
    hid_stamps_begin(&d->stamps);
    for (int i = 0; i < d->layout.mark_count; i++)
        edge_begin(&d->edges[i]);
    enum result result = hid_find(&d->identity, &d->line, err);
    if (result == RESULT_OK && d->on_change)
        ask_for_state(d);
    return result;
}

static void handle_close(void *device) {
    struct handle_device *d = device;
    hid_close(d->line);
}

static void add_samples(const struct handle_device *d, const struct hid_report *report,
                        int64_t time_ns, struct device_reading *reading) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (report->news >> i & 1 && hid_state_is_whole(&d->layout, &report->state, i))
            reading->samples[reading->count++] =
                (struct sample){.channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + i),
                                .kind = SAMPLE_HANDLE,
                                .time_ns = time_ns,
                                .handle = report->state.handles[i]};
    for (int c = 0; c < CHANNEL_COUNT; c++)
        if (report->news >> (HID_FORCE_NEWS + c) & 1 &&
            hid_force_is_whole(&d->layout, &report->state, (enum channel)c))
            reading->samples[reading->count++] = (struct sample){
                .channel = (enum channel)c,
                .kind = SAMPLE_FORCE,
                .time_ns = time_ns,
                .force_n = force_of(&d->layout.forces[c].force, report->state.forces_n[c])};
}

static void add_markers(struct handle_device *d, const struct hid_report *report, int64_t time_ns,
                        struct device_reading *reading) {
    for (int i = 0; i < d->layout.mark_count; i++)
        if (report->state.has_marks >> i & 1)
            edge_see(&d->edges[i], report->state.marks >> i & 1, time_ns, reading);
}

static enum result take_silence(struct handle_device *d, struct device_reading *reading,
                                struct error *err) {
    if (!d->on_change)
        return fail(err, RESULT_TIMEOUT, "HID device %04x:%04x: no report within %d ms",
                    d->identity.vid, d->identity.pid, (int)(POLL_MAX_NS / NS_PER_MS));
    reading->heard = true;
    const struct hid_report last = {d->all_news, d->state};
    int64_t time_ns;
    hid_stamps_of(&d->stamps, NULL, 1, clock_now_ns(), &time_ns);
    add_samples(d, &last, time_ns, reading);
    add_markers(d, &last, time_ns, reading); // what bounced has come to rest
    return RESULT_OK;
}

// Neither the count nor a value is new: the report was said before.
static bool is_repeated(const struct handle_device *d, const struct hid_state *before) {
    return d->state.has_count && before->has_count && d->state.count == before->count &&
           d->state.marks == before->marks &&
           !memcmp(d->state.handles, before->handles, sizeof before->handles) &&
           !memcmp(d->state.forces_n, before->forces_n, sizeof before->forces_n);
}

static enum result take_report(struct handle_device *d, const uint8_t *bytes, size_t size,
                               struct pack *pack, struct device_reading *reading,
                               struct error *err) {
    struct hid_state before = d->state;
    uint32_t news;
    enum result result = hid_report_read(&d->layout, bytes, size, &d->state, &news, err);
    if (result != RESULT_OK) {
        reading->malformed++;
        return fail_in(err, result, "HID device %04x:%04x: ", d->identity.vid, d->identity.pid);
    }
    if (!news || is_repeated(d, &before)) {
        reading->skipped++;
        return RESULT_OK;
    }
    pack->reports[pack->count++] = (struct hid_report){news, d->state};
    return RESULT_OK;
}

static void add_pack(struct handle_device *d, const struct pack *pack,
                     struct device_reading *reading) {
    int64_t times_ns[REPORTS_MAX];
    uint32_t counts[REPORTS_MAX] = {0};
    bool all_count = true;
    if (!pack->count)
        return;
    for (int i = 0; i < pack->count; i++) {
        counts[i] = pack->reports[i].state.count;
        all_count &= pack->reports[i].state.has_count;
    }
    hid_stamps_of(&d->stamps, all_count ? counts : NULL, pack->count, clock_now_ns(), times_ns);
    reading->heard = true;
    for (int i = 0; i < pack->count; i++) {
        add_markers(d, &pack->reports[i], times_ns[i], reading);
        if (i >= pack->count - pack->room)
            add_samples(d, &pack->reports[i], times_ns[i], reading);
    }
}

static int count_of(uint32_t news) {
    int count = 0;
    for (; news; news &= news - 1)
        count++;
    return count;
}

static enum result handle_poll(void *device, struct device_reading *reading, struct error *err) {
    struct handle_device *d = device;
    uint8_t bytes[1 + HID_REPORT_BYTES_MAX];
    int values = count_of(d->all_news);
    struct pack pack = {.room = values ? DEVICE_SAMPLES_MAX / values : 0};
    int wait_ms = d->on_change ? repeat_ms : (int)(POLL_MAX_NS / NS_PER_MS), size = 0;
    enum result result = RESULT_OK;
    for (int i = 0; i < REPORTS_MAX; i++) {
        size = hid_read_timeout(d->line, bytes, sizeof bytes, i ? 0 : wait_ms);
        if (size == 0 && i == 0)
            return take_silence(d, reading, err);
        if (size <= 0)
            break;
        enum result taken = take_report(d, bytes, (size_t)size, &pack, reading, err);
        result = taken == RESULT_OK ? result : taken;
    }
    add_pack(d, &pack, reading);
    if (size < 0)
        return fail(err, RESULT_CLOSED, "HID device %04x:%04x was unplugged", d->identity.vid,
                    d->identity.pid);
    return result;
}

const struct device_driver hid_driver = {
    "hid", handle_create, handle_open, handle_poll, handle_close, free,
};
