#include "drivers/hid_find.h"

#include "drivers/hid_descriptor.h"

#include <errno.h>
#include <hidapi.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

// hidapi keeps its errors and the kernel's version in globals without a lock.
static pthread_mutex_t hidapi_lock = PTHREAD_MUTEX_INITIALIZER;

static void copy_text(char out[HID_TEXT_MAX], const wchar_t *text) {
    int length = 0;
    for (; text && text[length] && length < HID_TEXT_MAX - 1; length++)
        out[length] = text[length] >= ' ' && text[length] <= '~' ? (char)text[length] : '?';
    out[length] = 0;
}

// "usb-0000:00:14.0-2/input0": the same as long as the device stays in its socket. hidapi does not
// tell it.
static void read_port(const char *path, char out[HID_TEXT_MAX]) {
    char name[HID_PATH_MAX + 64], line[HID_TEXT_MAX + 16];
    const char *slash = strrchr(path, '/');
    snprintf(name, sizeof name, "/sys/class/hidraw/%s/device/uevent", slash ? slash + 1 : path);
    FILE *file = fopen(name, "re");
    while (file && fgets(line, sizeof line, file))
        if (sscanf(line, "HID_PHYS=%127s", out) == 1)
            break;
    if (file)
        fclose(file);
}

static struct hid_plugged plugged_of(const struct hid_device_info *info) {
    struct hid_plugged plugged = {.identity = {.vid = info->vendor_id,
                                               .pid = info->product_id,
                                               .usage_page = info->usage_page,
                                               .usage = info->usage}};
    copy_text(plugged.identity.serial, info->serial_number);
    copy_text(plugged.product, info->product_string);
    snprintf(plugged.path, sizeof plugged.path, "%s", info->path);
    read_port(plugged.path, plugged.identity.port);
    return plugged;
}

int hid_list(struct hid_plugged *out_plugged, int max) {
    int count = 0;
    pthread_mutex_lock(&hidapi_lock);
    struct hid_device_info *all = hid_enumerate(0, 0);
    for (const struct hid_device_info *info = all; info && count < max; info = info->next)
        out_plugged[count++] = plugged_of(info);
    hid_free_enumeration(all);
    pthread_mutex_unlock(&hidapi_lock);
    return count;
}

bool hid_matches(const struct hid_identity *wanted, const struct hid_identity *found) {
    bool serial = !wanted->serial[0] || !strcmp(wanted->serial, found->serial);
    bool port = !wanted->port[0] || !strcmp(wanted->port, found->port);
    bool usage = !wanted->usage_page ||
                 (wanted->usage_page == found->usage_page && wanted->usage == found->usage);
    return wanted->vid == found->vid && wanted->pid == found->pid && serial && port && usage;
}

// The path of the one device that matches. A device with several collections is listed several
// times.
static enum result find_path(const struct hid_identity *identity, char out_path[HID_PATH_MAX],
                             struct error *err) {
    struct hid_device_info *all = hid_enumerate(identity->vid, identity->pid);
    bool several = false;
    out_path[0] = 0;
    for (const struct hid_device_info *info = all; info; info = info->next) {
        struct hid_plugged plugged = plugged_of(info);
        if (!hid_matches(identity, &plugged.identity))
            continue;
        several |= out_path[0] && strcmp(out_path, plugged.path) != 0;
        strcpy(out_path, plugged.path);
    }
    hid_free_enumeration(all);
    if (!out_path[0])
        return fail(err, RESULT_MISSING, "found no HID device %04x:%04x%s%s%s%s%s", identity->vid,
                    identity->pid, identity->serial[0] ? " " : "", identity->serial,
                    identity->port[0] ? " in port " : "", identity->port,
                    identity->usage_page ? " with this usage" : "");
    if (several)
        return fail(err, RESULT_INVALID,
                    "found several HID devices %04x:%04x: add serial, port or usage to the config",
                    identity->vid, identity->pid);
    return RESULT_OK;
}

enum result hid_find(const struct hid_identity *identity, struct hid_device_ **out_device,
                     struct error *err) {
    char path[HID_PATH_MAX];
    pthread_mutex_lock(&hidapi_lock);
    enum result result = find_path(identity, path, err);
    *out_device = result == RESULT_OK ? hid_open_path(path) : NULL;
    if (result == RESULT_OK && !*out_device)
        result = fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    pthread_mutex_unlock(&hidapi_lock);
    return result;
}

// hidapi has no call for it before 0.14.
enum result hid_read_descriptor(const char *path, uint8_t *out_bytes, size_t *out_size,
                                struct error *err) {
    char file_name[HID_PATH_MAX + 64];
    const char *slash = strrchr(path, '/');
    snprintf(file_name, sizeof file_name, "/sys/class/hidraw/%s/device/report_descriptor",
             slash ? slash + 1 : path);
    FILE *file = fopen(file_name, "rb");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", file_name, strerror(errno));
    *out_size = fread(out_bytes, 1, HID_DESCRIPTOR_BYTES_MAX, file);
    int fault = ferror(file) ? errno : 0;
    fclose(file);
    return fault ? fail(err, RESULT_IO, "%s: %s", file_name, strerror(fault)) : RESULT_OK;
}
