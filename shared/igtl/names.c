#include "igtl/names.h"

#include <openigtlink/igtl_util.h>
#include <stdio.h>
#include <string.h>

enum { STATUS_READY = 1, STATUS_NOT_READY = 13 };

void igtl_pose_name(enum channel channel, bool shown, char out_name[IGTL_DEVICE_SIZE]) {
    const char *name = channel_name(channel);
    bool bone = channel < CHANNEL_FIRST_INSTRUMENT;
    const char *before = shown && bone ? "virtual_" : "", *after = shown && !bone ? "_warped" : "";
    char whole[IGTL_DEVICE_SIZE + CHANNEL_NAME_MAX];
    int length = snprintf(whole, sizeof whole, "%s%s%s", before, name, after);
    int over = length - (IGTL_DEVICE_SIZE - 1), kept = (int)strlen(name) - over - 3;
    if (over > 0)
        snprintf(whole, sizeof whole, "%s%.*s-%02d%s", before, kept, name, (int)channel, after);
    memcpy(out_name, whole, IGTL_DEVICE_SIZE);
}

void igtl_mesh_name(const char *group, char out_name[IGTL_DEVICE_SIZE]) {
    size_t length = strlen(group);
    unsigned check = (unsigned)(crc64((unsigned char *)group, length, 0) & 0xffff); // only reads
    if (length < IGTL_DEVICE_SIZE)
        snprintf(out_name, IGTL_DEVICE_SIZE, "%s", group);
    else
        snprintf(out_name, IGTL_DEVICE_SIZE, "%.*s-%04x", IGTL_DEVICE_SIZE - 6, group, check);
}

void igtl_marker_text(const struct marker *marker, char out_text[IGTL_MARKER_SIZE]) {
    snprintf(out_text, IGTL_MARKER_SIZE, "%s %.12g", marker->name, marker->value);
}

struct igtl_state igtl_session_state(const char *state, int64_t utc_ns) {
    bool runs = !strcmp(state, "running");
    struct igtl_state told = {.code = runs ? STATUS_READY : STATUS_NOT_READY, .utc_ns = utc_ns};
    snprintf(told.text, sizeof told.text, "%s", state);
    return told;
}
