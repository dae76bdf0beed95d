// Instrument handles and foot pedals that are HID devices.
//
//   vid, pid   which device: its vendor and product, as lsusb prints them (hexadecimal)
//   serial     its serial number; any
//   port       where it is plugged in, as `arthron-station probe` prints it; any
//   usage      PAGE USAGE of one of its collections, hexadecimal; any
//   on_change  yes: while it says nothing its last values hold, as HID devices may do that report
//              changes only; no: it reports all the time, and silence is a fault; yes
//
// and for each value a field of its input reports (device/hid_report.h):
//   CHANNEL.opening  [REPORT:]BIT COUNT CLOSED OPEN [DEAD]
//   CHANNEL.buttons  [REPORT:]BIT COUNT
//   counter          [REPORT:]BIT COUNT MS: counts reports, or the device's time; MS each; none
//
// A sample is made when all values of its channel have come since the device was opened. Reports
// that wait together are taken together, each with a time of its own (device/hid_stamp.h).

#include "base/check.h"
#include "base/clock.h"
#include "device/drivers.h"
#include "device/hid_find.h"
#include "device/hid_report.h"
#include "device/hid_stamp.h"
#include "device/options.h"

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

    hid_device *line;
    struct hid_state state;
    struct hid_stamps stamps;
};

// What came in one poll: the newest reports that have news, as many as one reading has room for.
struct pack {
    int count, room;
    struct hid_report {
        uint32_t news; // instruments
        struct hid_state state;
    } reports[DEVICE_SAMPLES_MAX];
};

// ---- config -------------------------------------------------------------------------------------

static bool parse_hex(const char *text, uint16_t *out) {
    char *end;
    unsigned long value = strtoul(text, &end, 16);
    *out = (uint16_t)value;
    return *text && strspn(text, "0123456789abcdefABCDEFx") == strlen(text) && !*end &&
           value <= UINT16_MAX;
}

static enum result read_number(const struct device_config *config, const char *key, uint16_t *out,
                               struct error *err) {
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
                           "\"%s\" is not [REPORT:]BIT COUNT CLOSED OPEN [DEAD]", text);
    snprintf(key, sizeof key, "%s.buttons", channel_name(channel));
    text = option_text(config, key);
    if (text && !hid_field_parse(text, &out->buttons))
        return option_fail(config, key, err, RESULT_INVALID, "\"%s\" is not [REPORT:]BIT COUNT",
                           text);
    return RESULT_OK;
}

static bool lacks_number(const struct hid_field *field) {
    return field->count && !field->report;
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
    const char *counter = option_text(config, "counter");
    if (counter && !hid_counter_parse(counter, &layout->counter, &layout->count_ms))
        return option_fail(config, "counter", err, RESULT_INVALID,
                           "\"%s\" is not [REPORT:]BIT COUNT MS", counter);
    unnumbered |= lacks_number(&layout->counter);
    if (!outputs->count)
        return fail(err, RESULT_MISSING,
                    "[device %s]: the section needs a CHANNEL.opening or CHANNEL.buttons",
                    config->name);
    if (unnumbered && hid_layout_is_numbered(layout))
        return fail(err, RESULT_INVALID, "[device %s]: only some values name their report",
                    config->name);
    return RESULT_OK;
}

static enum result configure(struct handle_device *d, const struct device_config *config,
                             struct device_outputs *outputs, struct error *err) {
    static const char *const keys[] = {"vid",       "pid",      "serial",   "port",    "usage",
                                       "on_change", ".opening", ".buttons", "counter", NULL};
    enum result result = options_check(config, keys, err);
    if (result == RESULT_OK)
        result = read_number(config, "vid", &d->identity.vid, err);
    if (result == RESULT_OK)
        result = read_number(config, "pid", &d->identity.pid, err);
    if (result == RESULT_OK)
        result = read_text(config, "serial", d->identity.serial, err);
    if (result == RESULT_OK)
        result = read_text(config, "port", d->identity.port, err);
    if (result == RESULT_OK)
        result = read_usage(config, &d->identity, err);
    if (result == RESULT_OK)
        result = option_switch(config, "on_change", true, &d->on_change, err);
    if (result == RESULT_OK)
        result = read_layout(config, &d->layout, outputs, err);
    d->stamps.counter_bits = d->layout.counter.count;
    d->stamps.count_ms = d->layout.count_ms;
    return result;
}

static enum result handle_create(const struct device_config *config, void **out_device,
                                 struct device_outputs *out_outputs, struct error *err) {
    struct handle_device *d = alloc(1, sizeof *d);
    enum result result = configure(d, config, out_outputs, err);
    if (result == RESULT_OK)
        *out_device = d;
    else
        free(d);
    return result;
}

// ---- readings -----------------------------------------------------------------------------------

static enum result handle_open(void *device, struct error *err) {
    struct handle_device *d = device;
    d->state = (struct hid_state){0};
    hid_stamps_begin(&d->stamps);
    return hid_find(&d->identity, &d->line, err);
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
}

static uint32_t instruments_of(const struct hid_layout *layout) {
    uint32_t instruments = 0;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (layout->handles[i].opening.field.count || layout->handles[i].buttons.count)
            instruments |= 1u << i;
    return instruments;
}

static enum result take_silence(struct handle_device *d, struct device_reading *reading,
                                struct error *err) {
    if (!d->on_change)
        return fail(err, RESULT_TIMEOUT, "HID device %04x:%04x: no report within %d ms",
                    d->identity.vid, d->identity.pid, (int)(POLL_MAX_NS / NS_PER_MS));
    const struct hid_report last = {instruments_of(&d->layout), d->state};
    int64_t time_ns;
    hid_stamps_of(&d->stamps, NULL, 1, clock_now_ns(), &time_ns);
    add_samples(d, &last, time_ns, reading);
    return RESULT_OK;
}

// Neither the count nor a value is new: the report was said before.
static bool is_repeated(const struct handle_device *d, const struct hid_state *before) {
    return d->state.has_count && before->has_count && d->state.count == before->count &&
           !memcmp(d->state.handles, before->handles, sizeof before->handles);
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
    if (pack->count == pack->room)
        memmove(pack->reports, pack->reports + 1, (size_t)--pack->count * sizeof *pack->reports);
    pack->reports[pack->count++] = (struct hid_report){news, d->state};
    return RESULT_OK;
}

static void add_pack(struct handle_device *d, const struct pack *pack,
                     struct device_reading *reading) {
    int64_t times_ns[DEVICE_SAMPLES_MAX];
    uint32_t counts[DEVICE_SAMPLES_MAX];
    bool all_count = true;
    if (!pack->count)
        return;
    for (int i = 0; i < pack->count; i++) {
        counts[i] = pack->reports[i].state.count;
        all_count &= pack->reports[i].state.has_count;
    }
    hid_stamps_of(&d->stamps, all_count ? counts : NULL, pack->count, clock_now_ns(), times_ns);
    for (int i = 0; i < pack->count; i++)
        add_samples(d, &pack->reports[i], times_ns[i], reading);
}

static int count_of(uint32_t instruments) {
    int count = 0;
    for (; instruments; instruments &= instruments - 1)
        count++;
    return count;
}

static enum result handle_poll(void *device, struct device_reading *reading, struct error *err) {
    struct handle_device *d = device;
    uint8_t bytes[1 + HID_REPORT_BYTES_MAX];
    struct pack pack = {.room = DEVICE_SAMPLES_MAX / count_of(instruments_of(&d->layout))};
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
