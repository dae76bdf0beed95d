#include "config/config.h"

#include "base/clock.h"
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
    struct hub_config *config;
    struct error *err;
    enum result result;
};

// ---- values
// -----------------------------------------------------------------------------------------

static bool take_text(const char *value, char *out, size_t size) {
    return *value && (size_t)snprintf(out, size, "%s", value) < size;
}

static bool take_path(const struct reading *r, const char *value, char *out) {
    if (*value == '/')
        return take_text(value, out, HUB_PATH_MAX);
    return *value && snprintf(out, HUB_PATH_MAX, "%s/%s", r->dir, value) < HUB_PATH_MAX;
}

static bool take_int(const char *value, int low, int high, int *out) {
    int64_t number;
    if (!number_int(value, low, high, &number))
        return false;
    *out = (int)number;
    return true;
}

// ---- sections: true where the key is known and the value good ---------------------------------

static bool take_server_key(struct reading *r, const char *key, const char *value) {
    struct hub_config *c = r->config;
    if (!strcmp(key, "address"))
        return take_text(value, c->address, sizeof c->address);
    if (!strcmp(key, "port"))
        return take_int(value, 1, 65535, &c->port);
    if (!strcmp(key, "udp_port"))
        return take_int(value, 0, 65535, &c->udp_port);
    if (!strcmp(key, "workers"))
        return take_int(value, 0, 64, &c->workers);
    if (!strcmp(key, "keys"))
        return take_path(r, value, c->keys_dir);
    if (!strcmp(key, "traces"))
        return take_path(r, value, c->traces_dir);
    if (!strcmp(key, "socket"))
        return take_path(r, value, c->socket);
    if (!strcmp(key, "wait_s"))
        return take_int(value, 1, 86400, &c->wait_s);
    return false;
}

static bool take_warp_key(struct reading *r, const char *key, const char *value) {
    struct session_settings *s = &r->config->settings;
    if (!strcmp(key, "field"))
        return field_from_name(value, &s->field.kind);
    if (!strcmp(key, "unit_mm"))
        return number_double(value, 1e-3, 1e4, &s->field.unit_mm);
    if (!strcmp(key, "radius_mm"))
        return number_double(value, 0.1, 1000, &s->field.radius_mm);
    if (!strcmp(key, "background_per_mm"))
        return number_double(value, 0, 100, &s->field.background_per_mm);
    if (!strcmp(key, "strength"))
        return number_double(value, 0, 1, &s->strength);
    int ms;
    if (strcmp(key, "hold_ms") || !take_int(value, 0, 10000, &ms))
        return false;
    s->hold_ns = ms * NS_PER_MS;
    return true;
}

static struct hub_case *case_entry(struct hub_config *c, const char *name) {
    for (int i = 0; i < c->case_count; i++)
        if (!strcmp(c->cases[i].name, name))
            return &c->cases[i];
    if (c->case_count == HUB_CASES_MAX ||
        !take_text(name, c->cases[c->case_count].name, sizeof c->cases[0].name))
        return NULL;
    return &c->cases[c->case_count++];
}

static bool take_case_key(struct reading *r, const char *name, const char *key, const char *value) {
    struct hub_case *entry = case_entry(r->config, name);
    return entry && !strcmp(key, "dir") && take_path(r, value, entry->dir);
}

static struct hub_station *station_entry(struct hub_config *c, const char *name) {
    for (int i = 0; i < c->station_count; i++)
        if (!strcmp(c->stations[i].name, name))
            return &c->stations[i];
    if (c->station_count == HUB_STATIONS_MAX ||
        !take_text(name, c->stations[c->station_count].name, sizeof c->stations[0].name))
        return NULL;
    return &c->stations[c->station_count++];
}

static bool take_station_key(struct reading *r, const char *name, const char *key,
                             const char *value) {
    struct hub_station *station = station_entry(r->config, name);
    if (!station)
        return false;
    if (!strcmp(key, "case"))
        return take_text(value, station->case_name, sizeof station->case_name);
    if (!strcmp(key, "trainee"))
        return take_text(value, station->trainee, sizeof station->trainee);
    if (strcmp(key, "start") || (strcmp(value, "auto") && strcmp(value, "command")))
        return false;
    station->start_by_command = !strcmp(value, "command");
    return true;
}

static bool take_key(struct reading *r, const char *section, const char *key, const char *value) {
    if (!strcmp(section, "server"))
        return take_server_key(r, key, value);
    if (!strcmp(section, "warp"))
        return take_warp_key(r, key, value);
    if (!strncmp(section, "case ", 5))
        return take_case_key(r, section + 5, key, value);
    if (!strncmp(section, "station ", 8))
        return take_station_key(r, section + 8, key, value);
    return false;
}

// ---- file
// -------------------------------------------------------------------------------------------

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

static enum result complete(const struct reading *r) {
    const struct hub_config *c = r->config;
    if (!c->keys_dir[0] || !c->traces_dir[0] || !c->socket[0])
        return fail(r->err, RESULT_MISSING, "[server] needs keys, traces and socket");
    for (int i = 0; i < c->case_count; i++)
        if (!c->cases[i].dir[0])
            return fail(r->err, RESULT_MISSING, "[case %s] needs dir", c->cases[i].name);
    for (int i = 0; i < c->station_count; i++)
        if (!c->stations[i].case_name[0])
            return fail(r->err, RESULT_MISSING, "[station %s] needs case", c->stations[i].name);
    return RESULT_OK;
}

static void set_defaults(struct hub_config *config) {
    memset(config, 0, sizeof *config);
    config->port = 4810;
    config->udp_port = 4811;
    config->wait_s = 300;
    config->settings = session_settings_default();
}

static enum result read_all(struct reading *r, const struct config_override *overrides,
                            int override_count) {
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
    return complete(r);
}

enum result config_load(const char *path, const struct config_override *overrides,
                        int override_count, struct hub_config *out_config, struct error *err) {
    struct reading r = {.path = path, .config = out_config, .err = err};
    char copy[PATH_MAX];
    snprintf(copy, sizeof copy, "%s", path);
    const char *dir = dirname(copy);
    if (!realpath(dir, r.dir)) // traces name their case for good, from wherever they are read
        snprintf(r.dir, sizeof r.dir, "%s", dir);
    set_defaults(out_config);
    enum result result = read_all(&r, overrides, override_count);
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", path);
}
