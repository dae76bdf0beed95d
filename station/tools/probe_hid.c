#include "base/check.h"
#include "drivers/hid_descriptor.h"
#include "tools/probe.h"

#include <stdlib.h>
#include <string.h>

#define PLUGGED_MAX 32

// Interfaces of one device are plugged in at "PLACE/input0", "PLACE/input1" and so on.
static bool is_same_device(const struct hid_plugged *a, const struct hid_plugged *b) {
    const char *end = strrchr(a->identity.port, '/');
    size_t length = end ? (size_t)(end - a->identity.port) + 1 : 0;
    return length && a->identity.vid == b->identity.vid && a->identity.pid == b->identity.pid &&
           !strncmp(a->identity.port, b->identity.port, length);
}

// Another device has the same vendor and product; or, by_serial, another device or interface has
// the same serial number, too.
static bool is_alike(const struct hid_plugged *plugged, int count, int at, bool by_serial) {
    struct hid_identity wanted = {.vid = plugged[at].identity.vid, .pid = plugged[at].identity.pid};
    if (by_serial)
        strcpy(wanted.serial, plugged[at].identity.serial);
    for (int i = 0; i < count; i++)
        if (strcmp(plugged[i].path, plugged[at].path) &&
            (by_serial || !is_same_device(&plugged[i], &plugged[at])) &&
            hid_matches(&wanted, &plugged[i].identity))
            return true;
    return false;
}

// before: stands before each line; of a second interface the section is a comment, because two
// devices that give the same values are no station.
static void propose(const struct hid_plugged *plugged, int count, int at, int number, char *lines,
                    const char *before, FILE *config) {
    const struct hid_identity *identity = &plugged[at].identity;
    char *rest;
    fprintf(config, "%s[device hid-%d]\n%sdriver = hid\n%svid = %04x\n%spid = %04x\n", before,
            number, before, before, identity->vid, before, identity->pid);
    if (identity->serial[0])
        fprintf(config, "%sserial = %s\n", before, identity->serial);
    if (is_alike(plugged, count, at, true) && identity->port[0])
        fprintf(config, "%sport = %s\n", before, identity->port);
    for (char *line = strtok_r(lines, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest))
        fprintf(config, "%s%s\n", before, line);
}

// The lines of a section, empty where nothing can be proposed.
static void describe_plugged(const struct hid_plugged *p, enum channel channel,
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

// The section that another interface of this device has; 0: none.
static int section_of_device(const struct hid_plugged *plugged, const int *sections, int at) {
    for (int i = 0; i < at; i++)
        if (sections[i] && is_same_device(&plugged[i], &plugged[at]))
            return sections[i];
    return 0;
}

static enum channel channel_of(int section) {
    return (enum channel)(CHANNEL_PUNCH + (section - 1) % (CHANNEL_COUNT - CHANNEL_PUNCH));
}

static void list(const struct hid_plugged *p, json_t *out) {
    const struct hid_identity *identity = &p->identity;
    json_array_append_new(out, json_pack("{s:s, s:s, s:i, s:i, s:s, s:s, s:i, s:i}", "path",
                                         p->path, "product", p->product, "vid", identity->vid,
                                         "pid", identity->pid, "serial", identity->serial, "port",
                                         identity->port, "usage_page", identity->usage_page,
                                         "usage", identity->usage));
}

void probe_hid_plugged(const struct hid_plugged *plugged, int count,
                       descriptor_reader *read_descriptor, FILE *config, json_t *out) {
    char lines[HID_PROPOSAL_BYTES_MAX];
    int sections[PLUGGED_MAX] = {0}, last = 0;
    CHECK(count <= PLUGGED_MAX);
    for (int i = 0; i < count; i++) {
        const struct hid_plugged *p = &plugged[i];
        int other = section_of_device(plugged, sections, i);
        list(p, out);
        if (is_listed(plugged, i))
            continue;
        if (other)
            fprintf(config,
                    "\n; %s: another interface of %s: if its values are here, take this section\n",
                    p->path, p->product);
        else
            fprintf(config, "\n; %s: %s; which instrument is it?%s\n", p->path, p->product,
                    is_alike(plugged, count, i, false)
                        ? " Another one is alike: unplug one to tell them apart"
                        : "");
        describe_plugged(p, channel_of(other ? other : last + 1), read_descriptor, config, lines);
        if (lines[0] && !other)
            sections[i] = ++last;
        if (lines[0])
            propose(plugged, count, i, other ? other : last, lines, other ? "; " : "", config);
    }
}

void probe_hid(FILE *config, json_t *out) {
    struct hid_plugged *plugged = alloc(PLUGGED_MAX, sizeof *plugged);
    int count = hid_list(plugged, PLUGGED_MAX);
    probe_hid_plugged(plugged, count, hid_read_descriptor, config, out);
    free(plugged);
}
