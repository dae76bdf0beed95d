#include "drivers/options.h"

#include "base/nearest.h"
#include "base/number.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

const char *const runner_keys[] = {"driver",   "delay_ms",  "hold_ms", "jump_mm", "jump_deg",
                                   "noise_mm", "noise_deg", "filter",  NULL};

enum result option_fail(const struct device_config *config, const char *key, struct error *err,
                        enum result code, const char *format, ...) {
    char text[sizeof err->text];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return fail(err, code, "[device %s] %s: %s", config->name, key, text);
}

enum result option_fail_name(const struct device_config *config, const char *key, struct error *err,
                             const char *text, const char *word, const char *const *names) {
    char list[sizeof err->text] = "";
    const char *nearest = nearest_name(word, names);
    for (int i = 0; names[i] && !nearest; i++) {
        size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s", i ? ", " : "", names[i]);
    }
    return option_fail(config, key, err, RESULT_INVALID, "%s; %s %s%s", text,
                       nearest ? "did you mean" : "there are", nearest ? nearest : list,
                       nearest ? "?" : "");
}

// A place for an instrument that the station does not describe: nobody would see its samples.
static bool channel_is_free(enum channel channel) {
    return channel >= CHANNEL_FIRST_DESCRIBED && channel_is_reserved(channel_name(channel));
}

static bool is_channel(const char *name, size_t length, enum channel first) {
    char text[32];
    enum channel channel;
    if (length >= sizeof text)
        return false;
    memcpy(text, name, length);
    text[length] = 0;
    return channel_from_name(text, &channel) && channel >= first && !channel_is_free(channel);
}

// Which channels an entry with a suffix or a prefix stands for: the first of them.
static enum channel first_channel(const char *known) {
    if (!strcmp(known, ".force") || known[0] != '.')
        return CHANNEL_JOINT + 1;
    return CHANNEL_FIRST_INSTRUMENT;
}

static bool key_matches(const char *key, const char *known) {
    size_t length = strlen(key), known_length = strlen(known);
    if (known[0] == '.')
        return length > known_length && !strcmp(key + length - known_length, known) &&
               is_channel(key, length - known_length, first_channel(known));
    if (known[known_length - 1] == '*')
        return length >= known_length && !strncmp(key, known, known_length - 1);
    if (known[known_length - 1] == '.')
        return !strncmp(key, known, known_length) &&
               is_channel(key + known_length, length - known_length, CHANNEL_JOINT);
    return !strcmp(key, known);
}

// All keys in full, then the runner's.
static enum result refuse_key(const struct device_config *config, const char *key,
                              const char *const keys[], struct error *err) {
    enum { NAMES_MAX = 192, TEXT_MAX = 32 };
    char texts[NAMES_MAX][TEXT_MAX];
    const char *names[NAMES_MAX + 1] = {NULL}, *shown[NAMES_MAX + 1] = {NULL};
    int count = 0, shown_count = 0;
    for (int i = 0; keys[i]; i++) {
        bool suffix = keys[i][0] == '.', prefix = keys[i][strlen(keys[i]) - 1] == '.';
        int first = suffix || prefix ? (int)first_channel(keys[i]) : 0;
        int end = suffix || prefix ? CHANNEL_COUNT : 1;
        for (int c = first; c < end && count < NAMES_MAX; c++) {
            if ((suffix || prefix) && channel_is_free((enum channel)c))
                continue;
            const char *channel = suffix || prefix ? channel_name((enum channel)c) : "";
            snprintf(texts[count], TEXT_MAX, "%s%s%s", suffix ? channel : "", keys[i],
                     prefix ? channel : "");
            names[count] = texts[count];
            count++;
        }
        shown[shown_count++] = keys[i];
    }
    for (int i = 0; runner_keys[i] && count < NAMES_MAX; i++)
        shown[shown_count++] = names[count++] = runner_keys[i];
    const char *nearest = nearest_name(key, names);
    const char *const only[] = {nearest, NULL};
    return option_fail_name(config, key, err, "unknown key", key, nearest ? only : shown);
}

enum result options_check(const struct device_config *config, const char *const keys[],
                          struct error *err) {
    for (int i = 0; i < config->option_count; i++) {
        const char *key = config->options[i].key;
        bool known = false;
        for (int k = 0; keys[k] && !known; k++)
            known = key_matches(key, keys[k]);
        if (!known)
            return refuse_key(config, key, keys, err);
        for (int k = 0; k < i; k++)
            if (!strcmp(key, config->options[k].key))
                return option_fail(config, key, err, RESULT_INVALID, "given twice");
    }
    return RESULT_OK;
}

const char *option_text(const struct device_config *config, const char *key) {
    for (int i = 0; i < config->option_count; i++)
        if (!strcmp(config->options[i].key, key))
            return config->options[i].value;
    return NULL;
}

enum result option_required(const struct device_config *config, const char *key,
                            char out_text[OPTION_TEXT_MAX], struct error *err) {
    const char *text = option_text(config, key);
    if (!text || !*text)
        return option_fail(config, key, err, RESULT_MISSING, "is required");
    if (strlen(text) >= OPTION_TEXT_MAX)
        return option_fail(config, key, err, RESULT_LIMIT, "longer than %d bytes",
                           OPTION_TEXT_MAX - 1);
    strcpy(out_text, text);
    return RESULT_OK;
}

enum result option_number(const struct device_config *config, const char *key, double low,
                          double high, double otherwise, double *out_value, struct error *err) {
    const char *text = option_text(config, key);
    *out_value = otherwise;
    if (text && !number_double(text, low, high, out_value))
        return option_fail(config, key, err, RESULT_INVALID, "\"%s\" is not a number from %g to %g",
                           text, low, high);
    return RESULT_OK;
}

enum result option_integer(const struct device_config *config, const char *key, int low, int high,
                           int otherwise, int *out_value, struct error *err) {
    const char *text = option_text(config, key);
    int64_t value = otherwise;
    if (text && !number_int(text, low, high, &value))
        return option_fail(config, key, err, RESULT_INVALID,
                           "\"%s\" is not a whole number from %d to %d", text, low, high);
    *out_value = (int)value;
    return RESULT_OK;
}

enum result option_switch(const struct device_config *config, const char *key, bool otherwise,
                          bool *out_value, struct error *err) {
    const char *text = option_text(config, key);
    *out_value = otherwise;
    if (text && !number_bool(text, out_value))
        return option_fail(config, key, err, RESULT_INVALID, "\"%s\" is neither yes nor no", text);
    return RESULT_OK;
}

enum result option_channel(const struct device_config *config, const char *key,
                           enum channel otherwise, enum channel *out_channel, struct error *err) {
    const char *text = option_text(config, key);
    *out_channel = otherwise;
    if (!text || channel_from_name(text, out_channel))
        return RESULT_OK;
    const char *names[CHANNEL_COUNT + 1] = {NULL};
    char what[64];
    for (int i = 0; i < CHANNEL_COUNT; i++)
        names[i] = channel_name((enum channel)i);
    snprintf(what, sizeof what, "\"%.32s\" is not a channel", text);
    return option_fail_name(config, key, err, what, text, names);
}

enum result option_pose(const struct device_config *config, const char *key, pose *out_pose,
                        struct error *err) {
    const char *text = option_text(config, key);
    *out_pose = pose_identity();
    if (text && !number_pose(text, out_pose))
        return option_fail(config, key, err, RESULT_INVALID,
                           "\"%s\" is not a pose: x y z (mm) and a unit quaternion qw qx qy qz",
                           text);
    return RESULT_OK;
}

enum result option_poses(const struct device_config *config, const char *prefix,
                         pose out_poses[CHANNEL_COUNT], struct error *err) {
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        char key[64];
        snprintf(key, sizeof key, "%s.%s", prefix, channel_name((enum channel)i));
        if (option_pose(config, key, &out_poses[i], err) != RESULT_OK)
            return RESULT_INVALID;
    }
    return RESULT_OK;
}
