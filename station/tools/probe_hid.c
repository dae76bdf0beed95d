#include "base/check.h"
#include "drivers/hid_descriptor.h"
#include "tools/probe.h"

#include <stdlib.h>
#include <string.h>

#define PLUGGED_MAX 32

// Another device has the same vendor, product and, where it counts, serial number.
static bool is_alike(const struct hid_plugged *plugged, int count, int at, bool by_serial) {
    struct hid_identity wanted = {.vid = plugged[at].identity.vid, .pid = plugged[at].identity.pid};
    if (by_serial)
        strcpy(wanted.serial, plugged[at].identity.serial);
    for (int i = 0; i < count; i++)
        if (strcmp(plugged[i].path, plugged[at].path) && hid_matches(&wanted, &plugged[i].identity))
            return true;
    return false;
}

static void propose(const struct hid_plugged *plugged, int count, int at, int number,
                    const char *lines, FILE *config) {
    const struct hid_identity *identity = &plugged[at].identity;
    fprintf(config, "[device hid-%d]\ndriver = hid\nvid = %04x\npid = %04x\n", number,
            identity->vid, identity->pid);
    if (identity->serial[0])
        fprintf(config, "serial = %s\n", identity->serial);
    if (is_alike(plugged, count, at, true) && identity->port[0])
        fprintf(config, "port = %s\n", identity->port);
    fputs(lines, config);
}

// The lines of a section, empty where nothing can be proposed.
static void describe(const struct hid_plugged *p, enum channel channel,
                     descriptor_reader *read_descriptor, FILE *config,
                     char lines[HID_PROPOSAL_BYTES_MAX]) {
    uint8_t bytes[HID_DESCRIPTOR_BYTES_MAX];
    struct error why;
    size_t size;
    struct hid_descriptor *descriptor = alloc(1, sizeof *descriptor);
    lines[0] = '\0';
    if (read_descriptor(p->path, bytes, &size, &why) != RESULT_OK ||
        hid_descriptor_read(bytes, size, descriptor, &why) != RESULT_OK)
        fprintf(config, "; %s\n", why.text);
    else
        hid_propose(descriptor, channel, lines);
    free(descriptor);
}

// A device is listed once for each of its collections.
static bool is_listed(const struct hid_plugged *plugged, int at) {
    for (int i = 0; i < at; i++)
        if (!strcmp(plugged[i].path, plugged[at].path))
            return true;
    return false;
}

void probe_hid_plugged(const struct hid_plugged *plugged, int count,
                       descriptor_reader *read_descriptor, FILE *config, json_t *out) {
    char lines[HID_PROPOSAL_BYTES_MAX];
    int number = 0;
    for (int i = 0; i < count; i++) {
        const struct hid_plugged *p = &plugged[i];
        const struct hid_identity *identity = &p->identity;
        json_array_append_new(out, json_pack("{s:s, s:s, s:i, s:i, s:s, s:s, s:i, s:i}", "path",
                                             p->path, "product", p->product, "vid", identity->vid,
                                             "pid", identity->pid, "serial", identity->serial,
                                             "port", identity->port, "usage_page",
                                             identity->usage_page, "usage", identity->usage));
        if (is_listed(plugged, i))
            continue;
        enum channel channel =
            (enum channel)(CHANNEL_PUNCH + number % (CHANNEL_COUNT - CHANNEL_PUNCH));
        fprintf(config, "\n; %s: %s; which instrument is it?%s\n", p->path, p->product,
                is_alike(plugged, count, i, false)
                    ? " Another one is alike: unplug one to tell them apart"
                    : "");
        describe(p, channel, read_descriptor, config, lines);
        if (lines[0])
            propose(plugged, count, i, ++number, lines, config);
    }
}

void probe_hid(FILE *config, json_t *out) {
    struct hid_plugged *plugged = alloc(PLUGGED_MAX, sizeof *plugged);
    int count = hid_list(plugged, PLUGGED_MAX);
    probe_hid_plugged(plugged, count, hid_read_descriptor, config, out);
    free(plugged);
}
