#include "settings/settings.h"

#include "settings/entries.h"

#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool setting_split(char *text, struct setting_override *out) {
    char *equals = strchr(text, '=');
    if (!equals)
        return false;
    *equals = '\0';
    char *dot = strchr(text, '.');
    if (!dot || dot == text || !dot[1])
        return false;
    *dot = '\0';
    *out = (struct setting_override){text, dot + 1, equals + 1};
    return true;
}

void settings_folder(const char *path, char *out_dir, size_t size) {
    char copy[PATH_MAX], whole[PATH_MAX];
    snprintf(copy, sizeof copy, "%s", path);
    const char *dir = dirname(copy);
    snprintf(out_dir, size, "%s", realpath(dir, whole) ? whole : dir);
}

bool setting_text(const char *value, char *out, size_t size) {
    return *value && (size_t)snprintf(out, size, "%s", value) < size;
}

bool setting_path(const char *dir, const char *value, char *out, size_t size) {
    if (*value == '/')
        return setting_text(value, out, size);
    return *value && (size_t)snprintf(out, size, "%s/%s", dir, value) < size;
}

struct taking {
    setting_taker take;
    void *user;
};

static bool take_entry(void *user, const char *section, const char *key, const char *value,
                       struct error *err) {
    const struct taking *t = user;
    if (t->take(t->user, section, key, value))
        return true;
    fail(err, RESULT_INVALID, "[%s] %s = %s: no such key, or a value out of its range", section,
         key, value);
    return false;
}

enum result settings_read(const char *path, const struct setting_override *overrides,
                          int override_count, setting_taker take, void *user, struct error *err) {
    struct taking t = {take, user};
    enum result result = entries_read(path, take_entry, &t, err);
    for (int i = 0; i < override_count && result == RESULT_OK; i++)
        if (!take_entry(&t, overrides[i].section, overrides[i].key, overrides[i].value, err))
            result = fail_in(err, RESULT_INVALID, "--set: ");
    return result;
}
