// The calibration in the place of what the config says.
#include "drivers/options.h"
#include "loop/config.h"

#include <stdio.h>
#include <string.h>

static enum result set_key(struct station_config *config, const struct calibration_entry *entry,
                           const char *key, const char *value, struct error *err) {
    if (station_config_set(config, entry->device, key, value))
        return RESULT_OK;
    return fail(err, RESULT_LIMIT, "[device %s] has too many keys", entry->device);
}

// The direction of the shaft is the tool's; a pivot tells only where the tip is.
static enum result set_tip(struct station_config *config, const struct station_device *device,
                           const struct calibration_entry *entry, struct error *err) {
    char key[64], value[256];
    pose tip;
    snprintf(key, sizeof key, "tip.%s", entry->of);
    enum result result = option_pose(&device->config, key, &tip, err);
    if (result != RESULT_OK)
        return result;
    vec3 at = entry->tip_mm;
    quat q = tip.rotation;
    snprintf(value, sizeof value, "%.9g %.9g %.9g %.17g %.17g %.17g %.17g", at.x, at.y, at.z, q.w,
             q.x, q.y, q.z);
    return set_key(config, entry, key, value, err);
}

static enum result set_registration(struct station_config *config,
                                    const struct calibration_entry *entry, struct error *err) {
    char value[256];
    vec3 t = entry->T_mockup_tracker.translation;
    quat q = entry->T_mockup_tracker.rotation;
    snprintf(value, sizeof value, "%.9g %.9g %.9g %.17g %.17g %.17g %.17g", t.x, t.y, t.z, q.w, q.x,
             q.y, q.z);
    return set_key(config, entry, "T_mockup_tracker", value, err);
}

// The last word of REGISTER [SCALE [OFFSET]] [TYPE], if that is no number.
static const char *type_of(const char *text) {
    size_t at = strlen(text);
    while (at && !strchr(" \t", text[at - 1]))
        at--;
    return at && strchr("uifs", text[at]) ? text + at : "";
}

// Scale and offset change, the rest stays.
enum result station_config_scale(struct station_config *config, const char *device_name,
                                 const char *key, double scale, double offset, struct error *err) {
    struct station_device *device = station_config_device(config, device_name);
    const char *old = device ? option_text(&device->config, key) : NULL;
    char register_text[16], value[256];
    if (!old)
        return fail(err, RESULT_INVALID, "[device %s] %s: the config has no such key", device_name,
                    key);
    if (sscanf(old, "%15s", register_text) != 1)
        return fail(err, RESULT_INVALID, "[device %s] %s: names no register", device_name, key);
    snprintf(value, sizeof value, "%s %.9g %.9g %s", register_text, scale, offset, type_of(old));
    return station_config_set(config, device_name, key, value)
               ? RESULT_OK
               : fail(err, RESULT_LIMIT, "[device %s] has too many keys", device_name);
}

static enum result set_entry(struct station_config *config, const struct calibration_entry *entry,
                             struct error *err) {
    const struct station_device *device = station_config_device(config, entry->device);
    if (!device)
        return fail(err, RESULT_INVALID, "the config has no [device %s]", entry->device);
    switch (entry->kind) {
    case CALIBRATION_TIP:
        return set_tip(config, device, entry, err);
    case CALIBRATION_REGISTRATION:
        return set_registration(config, entry, err);
    case CALIBRATION_DELAY: {
        char value[32];
        snprintf(value, sizeof value, "%.2f", entry->delay_ms);
        return set_key(config, entry, "delay_ms", value, err);
    }
    default:
        return station_config_scale(config, entry->device, entry->of, entry->scale, entry->offset,
                                    err);
    }
}

enum result station_config_calibrate(struct station_config *config, struct error *err) {
    for (int i = 0; i < config->calibration.count; i++) {
        enum result result = set_entry(config, &config->calibration.entries[i], err);
        if (result != RESULT_OK)
            return fail_in(err, result, "%s: ", config->calibration_path);
    }
    return RESULT_OK;
}
