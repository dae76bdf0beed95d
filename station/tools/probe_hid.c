#include "base/check.h"
#include "device/hid_descriptor.h"
#include "device/hid_find.h"
#include "tools/probe.h"

#include <stdlib.h>

#define PLUGGED_MAX 32

static void propose(const struct hid_plugged *p, enum channel channel, FILE *config) {
    uint8_t bytes[HID_DESCRIPTOR_BYTES_MAX];
    char lines[HID_PROPOSAL_BYTES_MAX] = "";
    struct error why;
    size_t size;
    struct hid_descriptor *descriptor = alloc(1, sizeof *descriptor);
    if (hid_read_descriptor(p->path, bytes, &size, &why) != RESULT_OK ||
        hid_descriptor_read(bytes, size, descriptor, &why) != RESULT_OK)
        fprintf(config, "; %s\n", why.text);
    else
        hid_propose(descriptor, channel, lines);
    free(descriptor);
    if (!lines[0])
        return;
    fprintf(config, "[device hid-%04x-%04x]\ndriver = hid\nvid = %04x\npid = %04x\n",
            p->identity.vid, p->identity.pid, p->identity.vid, p->identity.pid);
    if (p->identity.serial[0])
        fprintf(config, "serial = %s\n", p->identity.serial);
    fputs(lines, config);
}

void probe_hid(FILE *config, json_t *out) {
    struct hid_plugged *plugged = alloc(PLUGGED_MAX, sizeof *plugged);
    int count = hid_list(plugged, PLUGGED_MAX);
    for (int i = 0; i < count; i++) {
        const struct hid_plugged *p = &plugged[i];
        enum channel channel = (enum channel)(CHANNEL_PUNCH + i % (CHANNEL_COUNT - CHANNEL_PUNCH));
        fprintf(config, "\n; %s: %s; which instrument is it?\n", p->path, p->product);
        propose(p, channel, config);
        json_array_append_new(out,
                              json_pack("{s:s, s:s, s:i, s:i, s:s, s:i, s:i}", "path", p->path,
                                        "product", p->product, "vid", p->identity.vid, "pid",
                                        p->identity.pid, "serial", p->identity.serial, "usage_page",
                                        p->identity.usage_page, "usage", p->identity.usage));
    }
    free(plugged);
}
