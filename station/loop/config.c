#include "loop/config.h"

#include "base/check.h"
#include "base/number.h"

#include <ini.h>
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct reading {
    const char *path;
    char dir[PATH_MAX];
    struct station_config *config;
    struct error *err;
    enum result result;
};

static bool take_text(const char *value, char *out, size_t size) {
    return *value && (size_t)snprintf(out, size, "%s", value) < size;
}

static bool take_path(const struct reading *r, const char *value, char *out, size_t size) {
    if (*value == '/')
        return take_text(value, out, size);
    return *value && (size_t)snprintf(out, size, "%s/%s", r->dir, value) < size;
}

bool station_parse_server(const char *text, char *out_host, size_t host_size, int *out_port) {
    const char *colon = strrchr(text, ':');
    int64_t port;
    if (!colon || colon == text || !number_int(colon + 1, 1, 65535, &port))
        return false;
    bool bracketed = text[0] == '[' && colon[-1] == ']';
    const char *start = text + bracketed;
    size_t length = (size_t)(colon - text) - 2 * (size_t)bracketed;
    if (!length || length >= host_size)
        return false;
    memcpy(out_host, start, length);
    out_host[length] = '\0';
    *out_port = (int)port;
    return true;
}

static bool take_station_key(struct reading *r, const char *key, const char *value) {
    struct station_config *c = r->config;
    if (!strcmp(key, "name"))
        return take_text(value, c->name, sizeof c->name);
    if (!strcmp(key, "server"))
        return station_parse_server(value, c->host, sizeof c->host, &c->port);
    if (!strcmp(key, "keys"))
        return take_path(r, value, c->keys_dir, sizeof c->keys_dir);
    if (!strcmp(key, "rate_hz"))
        return number_double(value, 1, 2000, &c->rate_hz);
    if (!strcmp(key, "datagrams"))
        return number_bool(value, &c->datagrams);
    return false;
}

static struct station_device *device_entry(struct station_config *c, const char *name) {
    for (int i = 0; i < c->device_count; i++)
        if (!strcmp(c->devices[i].config.name, name))
            return &c->devices[i];
    if (c->device_count == STATION_DEVICES_MAX ||
        !take_text(name, c->devices[c->device_count].config.name, DEVICE_NAME_MAX))
        return NULL;
    struct station_device *device = &c->devices[c->device_count++];
    device->config.options = device->options;
    return device;
}

// A key given again (by --set) replaces the first.
static bool take_device_key(struct reading *r, const char *name, const char *key,
                            const char *value) {
    struct station_device *device = device_entry(r->config, name);
    if (!device)
        return false;
    int at = 0;
    while (at < device->config.option_count && strcmp(device->options[at].key, key))
        at++;
    if (at == STATION_OPTIONS_MAX)
        return false;
    if (at == device->config.option_count) {
        device->options[at].key = alloc_text(key);
        device->config.option_count++;
    } else {
        free((char *)device->options[at].value);
    }
    device->options[at].value = alloc_text(value);
    return true;
}

static bool take_key(struct reading *r, const char *section, const char *key, const char *value) {
    if (!strcmp(section, "station"))
        return take_station_key(r, key, value);
    if (!strncmp(section, "device ", 7))
        return take_device_key(r, section + 7, key, value);
    return false;
}

static int handle_line(void *user, const char *section, const char *key, const char *value) {
    struct reading *r = user;
    if (take_key(r, section, key, value))
        return 1;
    if (r->result == RESULT_OK)
        r->result =
            fail(r->err, RESULT_INVALID, "[%s] %s = %s: no such key, or a value out of its range",
                 section, key, value);
    return 0;
}

static enum result read_all(struct reading *r, const struct station_override *overrides,
                            int override_count) {
    const struct station_config *c = r->config;
    int line = ini_parse(r->path, handle_line, r);
    if (line < 0)
        return fail(r->err, RESULT_MISSING, "cannot be read");
    if (r->result != RESULT_OK)
        return fail_in(r->err, r->result, "line %d: ", line);
    if (line > 0)
        return fail(r->err, RESULT_FORMAT, "line %d is neither [section] nor key = value", line);
    for (int i = 0; i < override_count; i++)
        if (!handle_line(r, overrides[i].section, overrides[i].key, overrides[i].value))
            return fail_in(r->err, r->result, "--set: ");
    if (!c->name[0] || !c->host[0] || !c->keys_dir[0])
        return fail(r->err, RESULT_MISSING, "[station] needs name, server and keys");
    if (!c->device_count)
        return fail(r->err, RESULT_MISSING, "there is no [device NAME]");
    return RESULT_OK;
}

enum result station_config_load(const char *path, const struct station_override *overrides,
                                int override_count, struct station_config **out_config,
                                struct error *err) {
    struct station_config *config = alloc(1, sizeof *config);
    config->rate_hz = 200;
    config->datagrams = true;
    struct reading r = {.path = path, .config = config, .err = err};
    char copy[PATH_MAX];
    snprintf(copy, sizeof copy, "%s", path);
    snprintf(r.dir, sizeof r.dir, "%s", dirname(copy));
    enum result result = read_all(&r, overrides, override_count);
    if (result != RESULT_OK) {
        station_config_destroy(&config);
        return fail_in(err, result, "%s: ", path);
    }
    *out_config = config;
    return RESULT_OK;
}

void station_config_destroy(struct station_config **config) {
    if (!*config)
        return;
    for (int i = 0; i < (*config)->device_count; i++) {
        struct station_device *device = &(*config)->devices[i];
        for (int k = 0; k < device->config.option_count; k++) {
            free((char *)device->options[k].key);
            free((char *)device->options[k].value);
        }
    }
    free(*config);
    *config = NULL;
}
