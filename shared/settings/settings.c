#include "settings/settings.h"

#include <ini.h>
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct reading {
    setting_taker take;
    void *user;
    struct error *err;
    bool refused;
    char last[256]; // section and key of the line before
};

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

static int refuse_line(struct reading *r, const char *section, const char *key, const char *value,
                       const char *reason) {
    r->refused = true;
    fail(r->err, RESULT_INVALID, "[%s] %s = %s: %s", section, key, value, reason);
    return 0;
}

// To inih a line that begins with a blank goes on with the value before: it gives the key again.
static bool is_given_again(struct reading *r, const char *section, const char *key) {
    char entry[sizeof r->last];
    snprintf(entry, sizeof entry, "%s/%s", section, key);
    bool again = !strcmp(entry, r->last);
    memcpy(r->last, entry, sizeof entry);
    return again;
}

// inih reads on behind a refused entry and tells the line of the first: so only that one counts.
static int take_entry(void *user, const char *section, const char *key, const char *value) {
    struct reading *r = user;
    if (r->refused)
        return 0;
    if (r->take(r->user, section, key, value))
        return 1;
    return refuse_line(r, section, key, value, "no such key, or a value out of its range");
}

static int take_line(void *user, const char *section, const char *key, const char *value) {
    struct reading *r = user;
    if (!r->refused && is_given_again(r, section, key))
        return refuse_line(r, section, key, value,
                           "given twice; lines must not begin with a blank");
    return take_entry(r, section, key, value);
}

enum result settings_read(const char *path, const struct setting_override *overrides,
                          int override_count, setting_taker take, void *user, struct error *err) {
    struct reading r = {.take = take, .user = user, .err = err};
    int line = ini_parse(path, take_line, &r);
    if (line < 0)
        return fail(err, RESULT_MISSING, "%s cannot be read", path);
    if (r.refused)
        return fail_in(err, RESULT_INVALID, "%s: line %d: ", path, line);
    if (line > 0)
        return fail(err, RESULT_FORMAT, "%s: line %d is neither [section] nor key = value", path,
                    line);
    for (int i = 0; i < override_count; i++)
        if (!take_entry(&r, overrides[i].section, overrides[i].key, overrides[i].value))
            return fail_in(err, RESULT_INVALID, "--set: ");
    return RESULT_OK;
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
