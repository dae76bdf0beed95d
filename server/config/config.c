#include "config/config.h"

#include "base/clock.h"
#include "base/number.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

struct reading {
    char dir[PATH_MAX];
    struct hub_config *config;
    struct web_settings *web;
};

// ---- values -------------------------------------------------------------------------------------

static bool take_path(const struct reading *r, const char *value, char out[HUB_PATH_MAX]) {
    return setting_path(r->dir, value, out, HUB_PATH_MAX);
}

static bool take_int(const char *value, int low, int high, int *out) {
    int64_t number;
    if (!number_int(value, low, high, &number))
        return false;
    *out = (int)number;
    return true;
}

// ---- sections: true where the key is known and the value good -----------------------------------

static bool take_server_key(struct reading *r, const char *key, const char *value) {
    struct hub_config *c = r->config;
    if (!strcmp(key, "address"))
        return setting_text(value, c->address, sizeof c->address);
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
    if (!strcmp(key, "records"))
        return take_path(r, value, c->records);
    if (!strcmp(key, "unfit")) {
        c->serve_unfit = !strcmp(value, "serve");
        return c->serve_unfit || !strcmp(value, "refuse");
    }
    if (!strcmp(key, "wait_s"))
        return take_int(value, 1, 86400, &c->wait_s);
    if (!strcmp(key, "calibration_days"))
        return take_int(value, 1, 3650, &c->calibration_days);
    if (!strcmp(key, "calibration_mm"))
        return number_double(value, 0.01, 100, &c->calibration_mm);
    if (!strcmp(key, "calibration_deg"))
        return number_double(value, 0.01, 100, &c->calibration_deg);
    return false;
}

// Separated by blanks.
static bool take_names(const char *value, char out[SERVER_NAMES_MAX][HUB_NAME_MAX]) {
    int count = 0;
    memset(out, 0, SERVER_NAMES_MAX * sizeof *out);
    for (const char *at = value + strspn(value, " "); *at; at += strspn(at, " ")) {
        size_t length = strcspn(at, " ");
        if (count == SERVER_NAMES_MAX || length >= HUB_NAME_MAX)
            return false;
        memcpy(out[count++], at, length);
        at += length;
    }
    return true;
}

static bool take_web_key(struct reading *r, const char *key, const char *value) {
    struct web_settings *w = r->web;
    if (!strcmp(key, "address"))
        return setting_text(value, w->address, sizeof w->address);
    if (!strcmp(key, "port"))
        return take_int(value, 0, 65535, &w->port);
    if (!strcmp(key, "certificate"))
        return take_path(r, value, w->certificate);
    if (!strcmp(key, "key"))
        return take_path(r, value, w->key);
    return !strcmp(key, "names") && take_names(value, w->names);
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
    if (!strcmp(key, "skin_mm"))
        return number_double(value, 0, 0.1, &s->field.skin_mm);
    if (!strcmp(key, "strength"))
        return number_double(value, 0, 1, &s->field.strength);
    if (!strcmp(key, "ease_share"))
        return number_double(value, 0, 1000, &s->ease_share);
    if (!strcmp(key, "ease_mm_s"))
        return number_double(value, 0, 1e6, &s->ease_mm_s);
    if (!strcmp(key, "adaptive"))
        return adaptive_from_name(value, &s->adaptive);
    if (!strcmp(key, "avatar"))
        return avatar_mode_from_name(value, &s->avatar);
    int ms;
    if (strcmp(key, "hold_ms") || !take_int(value, 0, 10000, &ms))
        return false;
    s->hold_ns = ms * NS_PER_MS;
    return true;
}

// point.1 = x y z radius: the first one beside the tip takes the place of the default ones.
static bool take_point(const char *number, const char *value, struct instrument_body *body) {
    int index;
    double n[4];
    if (!take_int(number, 1, AVATAR_POINTS_MAX - 1, &index) || number_list(value, 4, n) != 4)
        return false;
    if (index == 1)
        *body = (struct instrument_body){.point_count = 1};
    if (index != body->point_count)
        return false;
    body->points[body->point_count++] = (struct avatar_point){{n[0], n[1], n[2]}, n[3]};
    return instrument_body_is_valid(body);
}

static bool take_instrument_key(struct reading *r, const char *name, const char *key,
                                const char *value) {
    enum channel channel;
    if (!channel_from_name(name, &channel) || channel < CHANNEL_FIRST_INSTRUMENT)
        return false;
    int instrument = (int)channel - CHANNEL_FIRST_INSTRUMENT;
    return !strncmp(key, "point.", 6) &&
           take_point(key + 6, value, &r->config->settings.bodies[instrument]);
}

static struct hub_case *case_entry(struct hub_config *c, const char *name) {
    for (int i = 0; i < c->case_count; i++)
        if (!strcmp(c->cases[i].name, name))
            return &c->cases[i];
    if (c->case_count == HUB_CASES_MAX ||
        !setting_text(name, c->cases[c->case_count].name, sizeof c->cases[0].name))
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
        !setting_text(name, c->stations[c->station_count].name, sizeof c->stations[0].name))
        return NULL;
    c->stations[c->station_count].optic = view_optic_usual();
    return &c->stations[c->station_count++];
}

// contact.CHANNEL = BUTTON
static bool take_contact_key(struct hub_station *station, const char *name, const char *value) {
    enum channel channel;
    int button;
    if (!channel_from_name(name, &channel) || channel < CHANNEL_FIRST_INSTRUMENT ||
        !take_int(value, 0, 31, &button))
        return false;
    station->contact_buttons[channel - CHANNEL_FIRST_INSTRUMENT] = UINT32_C(1) << button;
    return true;
}

static bool take_station_key(struct reading *r, const char *name, const char *key,
                             const char *value) {
    struct hub_station *station = station_entry(r->config, name);
    if (!station)
        return false;
    if (!strcmp(key, "case"))
        return setting_text(value, station->case_name, sizeof station->case_name);
    if (!strcmp(key, "trainee"))
        return setting_text(value, station->trainee, sizeof station->trainee);
    if (!strcmp(key, "optic_deg"))
        return number_double(value, 0, 90, &station->optic.tilt_deg);
    if (!strcmp(key, "optic_view_deg"))
        return number_double(value, 1, 179, &station->optic.field_deg);
    if (!strncmp(key, "contact.", 8))
        return take_contact_key(station, key + 8, value);
    if (strcmp(key, "start") || (strcmp(value, "auto") && strcmp(value, "command")))
        return false;
    station->start_by_command = !strcmp(value, "command");
    return true;
}

static bool take_key(void *user, const char *section, const char *key, const char *value) {
    struct reading *r = user;
    if (!strcmp(section, "server"))
        return take_server_key(r, key, value);
    if (!strcmp(section, "web"))
        return take_web_key(r, key, value);
    if (!strcmp(section, "warp"))
        return take_warp_key(r, key, value);
    if (!strncmp(section, "instrument ", 11))
        return take_instrument_key(r, section + 11, key, value);
    if (!strncmp(section, "case ", 5))
        return take_case_key(r, section + 5, key, value);
    if (!strncmp(section, "station ", 8))
        return take_station_key(r, section + 8, key, value);
    return false;
}

// ---- file ---------------------------------------------------------------------------------------

static enum result complete(const struct hub_config *c, struct error *err) {
    if (c->udp_port && c->udp_port + hub_worker_count(c) - 1 > 65535)
        return fail(err, RESULT_INVALID,
                    "[server] udp_port = %d: %d workers need ports beyond 65535", c->udp_port,
                    hub_worker_count(c));
    if (!c->keys_dir[0] || !c->traces_dir[0] || !c->socket[0])
        return fail(err, RESULT_MISSING, "[server] needs keys, traces and socket");
    for (int i = 0; i < c->case_count; i++)
        if (!c->cases[i].dir[0])
            return fail(err, RESULT_MISSING, "[case %s] needs dir", c->cases[i].name);
    for (int i = 0; i < c->station_count; i++)
        if (!c->stations[i].case_name[0])
            return fail(err, RESULT_MISSING, "[station %s] needs case", c->stations[i].name);
    return RESULT_OK;
}

// Browsers are served where stations are, with the server's own certificate, unless they are told
// otherwise.
static enum result complete_web(const struct hub_config *c, struct web_settings *w,
                                struct error *err) {
    if (!w->port)
        return RESULT_OK;
    if (!c->records[0])
        return fail(err, RESULT_MISSING, "[web] needs [server] records: who may sign in is there");
    if (!w->certificate[0] != !w->key[0])
        return fail(err, RESULT_MISSING, "[web] needs both certificate and key, or neither");
    if (!w->address[0])
        memcpy(w->address, c->address, sizeof w->address);
    if (w->certificate[0])
        return RESULT_OK;
    const int most = HUB_PATH_MAX - (int)sizeof "/server.pem";
    if (strlen(c->keys_dir) > (size_t)most)
        return fail(err, RESULT_LIMIT, "[server] keys: the path is too long");
    snprintf(w->certificate, sizeof w->certificate, "%.*s/server.pem", most, c->keys_dir);
    snprintf(w->key, sizeof w->key, "%.*s/server.key", most, c->keys_dir);
    return RESULT_OK;
}

static void set_defaults(struct hub_config *config) {
    config->port = 4810;
    config->udp_port = 4811;
    config->wait_s = 300;
    config->calibration_days = 30;
    config->calibration_mm = 1;
    config->calibration_deg = 1;
    config->settings = session_settings_default();
}

enum result config_load(const char *path, const struct setting_override *overrides,
                        int override_count, struct server_config *out_config, struct error *err) {
    struct reading r = {.config = &out_config->hub, .web = &out_config->web};
    settings_folder(path, r.dir, sizeof r.dir);
    memset(out_config, 0, sizeof *out_config);
    set_defaults(r.config);
    enum result result = settings_read(path, overrides, override_count, take_key, &r, err);
    if (result != RESULT_OK)
        return result;
    result = complete(r.config, err);
    if (result == RESULT_OK)
        result = complete_web(r.config, r.web, err);
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", path);
}
