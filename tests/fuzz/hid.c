// A line with an axis, a line with buttons, as in a config; then bytes that are a report descriptor
// and a report.
#include "base/check.h"
#include "drivers/hid_descriptor.h"
#include "fuzz/fuzz.h"

#include <stdio.h>
#include <string.h>

static void copy_line(char out[128], const uint8_t *line, size_t size) {
    snprintf(out, 128, "%.*s", (int)(size < 127 ? size : 127), (const char *)line);
}

static void report(const struct hid_layout *layout, const uint8_t *bytes, size_t size) {
    struct hid_state state = {0};
    uint32_t news;
    struct error err;
    if (hid_report_read(layout, bytes, size, &state, &news, &err) != RESULT_OK || !news)
        return;
    CHECK(news == 1);
    CHECK(state.handles[0].opening >= 0 && state.handles[0].opening <= 1);
}

static void descriptor(const uint8_t *bytes, size_t size) {
    static struct hid_descriptor read;
    char text[HID_PROPOSAL_BYTES_MAX];
    struct error err;
    if (hid_descriptor_read(bytes, size, &read, &err) != RESULT_OK)
        return;
    for (int i = 0; i < read.count; i++)
        CHECK(read.fields[i].place.count >= 1 && read.fields[i].low <= read.fields[i].high);
    hid_propose(&read, CHANNEL_PROBE, text);
    CHECK(strnlen(text, sizeof text) < sizeof text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct hid_layout layout = {0};
    char text[128];
    size_t line;
    const uint8_t *rest = fuzz_split(data, size, '\n', &line, &size);
    copy_line(text, data, line);
    bool axis = hid_axis_parse(text, &layout.handles[0].opening);
    data = rest;
    rest = fuzz_split(data, size, '\n', &line, &size);
    copy_line(text, data, line);
    bool buttons = hid_field_parse(text, &layout.handles[0].buttons);
    bool numbered = layout.handles[0].opening.field.report && layout.handles[0].buttons.report;
    bool unnumbered = !layout.handles[0].opening.field.report && !layout.handles[0].buttons.report;
    if (axis && buttons && (numbered || unnumbered))
        report(&layout, rest, size);
    descriptor(rest, size);
    return 0;
}
