#include "config/config.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/nearest.h"
#include "base/number.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- values that no table describes -------------------------------------------------------------

static bool take_int(const char *value, int low, int high, int *out) {
    int64_t number;
    if (!number_int(value, low, high, &number))
        return false;
    *out = (int)number;
    return true;
}

static bool take_unfit(void *target, const char *rest, const char *value) {
    (void)rest;
    struct sessions_config *c = target;
    c->serve_unfit = !strcmp(value, "serve");
    return c->serve_unfit || !strcmp(value, "refuse");
}

static bool take_names(void *target, const char *rest, const char *value) {
    (void)rest;
    struct web_settings *web = target;
    int count = 0;
    memset(web->names, 0, sizeof web->names);
    for (const char *at = value + strspn(value, " "); *at; at += strspn(at, " ")) {
        size_t length = strcspn(at, " ");
        if (count == SERVER_NAMES_MAX || length >= STATION_NAME_MAX)
            return false;
        memcpy(web->names[count++], at, length);
        at += length;
    }
    return true;
}

// nats = ADDRESS, ADDRESS, ...
static bool take_nats(void *target, const char *rest, const char *value) {
    (void)rest;
    struct jet_settings *jet = target;
    jet->server_count = 0;
    for (const char *at = value + strspn(value, ", "); *at; at += strspn(at, ", ")) {
        size_t length = strcspn(at, ", ");
        if (jet->server_count == JET_SERVERS_MAX || length >= JET_TEXT_SIZE)
            return false;
        snprintf(jet->servers[jet->server_count++], JET_TEXT_SIZE, "%.*s", (int)length, at);
        at += length;
    }
    return jet->server_count > 0;
}

static bool take_field(void *target, const char *rest, const char *value) {
    (void)target, (void)rest;
    return !strcmp(value, field_name(FIELD_INTEGRAL));
}

static bool take_adaptive(void *target, const char *rest, const char *value) {
    (void)rest;
    return adaptive_from_name(value, &((struct session_settings *)target)->adaptive);
}

static bool take_avatar(void *target, const char *rest, const char *value) {
    (void)rest;
    return avatar_mode_from_name(value, &((struct session_settings *)target)->avatar);
}

static bool take_hold(void *target, const char *rest, const char *value) {
    (void)rest;
    int ms;
    if (!take_int(value, 0, 10000, &ms))
        return false;
    ((struct session_settings *)target)->hold_ns = ms * NS_PER_MS;
    return true;
}

// point.1 = x y z radius: the first point beside the tip replaces the default ones.
static bool take_point(void *target, const char *number, const char *value) {
    struct instrument_body *body = target;
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

static bool take_start(void *target, const char *rest, const char *value) {
    (void)rest;
    struct session_station *station = target;
    station->start_by_command = !strcmp(value, "command");
    return station->start_by_command || !strcmp(value, "auto");
}

static bool take_hash(void *target, const char *rest, const char *value) {
    (void)rest;
    struct session_case *one = target;
    snprintf(one->hash, sizeof one->hash, "%s", value);
    return content_is_hash(value);
}

// contact.CHANNEL = BUTTON
static bool take_contact(void *target, const char *name, const char *value) {
    struct session_station *station = target;
    enum channel channel;
    int button;
    if (!channel_from_name(name, &channel) || channel < CHANNEL_FIRST_INSTRUMENT ||
        !take_int(value, 0, 31, &button))
        return false;
    station->contact_buttons[channel - CHANNEL_FIRST_INSTRUMENT] = UINT32_C(1) << button;
    return true;
}

// ---- where values go ----------------------------------------------------------------------------

static void *find_server(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return &((struct server_config *)user)->sessions;
}

static void *find_web(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return &((struct server_config *)user)->web;
}

static void *find_xapi(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return &((struct server_config *)user)->xapi;
}

static void *find_sign_on(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return &((struct server_config *)user)->sign_on;
}

static void *find_cluster(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return &((struct server_config *)user)->sessions.cluster;
}

static void *find_warp(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return &((struct server_config *)user)->sessions.settings;
}

// A shorter name than that of a usual instrument is a mistyped one.
static bool is_mistyped(const char *name, struct error *err) {
    const char *usual[INSTRUMENTS_USUAL + 1] = {NULL};
    for (int i = 0; i < INSTRUMENTS_USUAL; i++)
        usual[i] = channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + i));
    const char *nearest = nearest_name(name, usual);
    bool mistyped = nearest && strlen(name) <= strlen(nearest);
    if (mistyped)
        fail(err, RESULT_INVALID, "there is no such instrument; did you mean %s?", nearest);
    return mistyped;
}

// Which stations describe it is known when they come.
static void *find_described(struct sessions_config *c, const char *name, struct error *err) {
    struct session_instrument *one = c->instruments;
    while (one < c->instruments + c->instrument_count && strcmp(one->name, name) != 0)
        one++;
    if (one < c->instruments + c->instrument_count)
        return &one->body;
    if (is_mistyped(name, err))
        return NULL;
    if (c->instrument_count == SESSIONS_INSTRUMENTS_MAX ||
        !setting_text(name, one->name, sizeof one->name)) {
        fail(err, RESULT_LIMIT, "the config names at most %d instruments, of %d bytes each",
             SESSIONS_INSTRUMENTS_MAX, INSTRUMENT_NAME_MAX - 1);
        return NULL;
    }
    one->body = c->settings.bodies[INSTRUMENTS_USUAL];
    c->instrument_count++;
    return &one->body;
}

static void *find_instrument(void *user, const char *name, struct error *err) {
    struct sessions_config *c = &((struct server_config *)user)->sessions;
    enum channel channel;
    if (channel_from_name(name, &channel) && channel >= CHANNEL_FIRST_INSTRUMENT)
        return &c->settings.bodies[channel - CHANNEL_FIRST_INSTRUMENT];
    return find_described(c, name, err);
}

static bool take_name(const char *name, char out[STATION_NAME_MAX], struct error *err) {
    if (setting_text(name, out, STATION_NAME_MAX))
        return true;
    fail(err, RESULT_LIMIT, "the name is longer than %d bytes", STATION_NAME_MAX - 1);
    return false;
}

static int index_of_case(const struct sessions_config *c, const char *name) {
    for (int i = 0; i < c->case_count; i++)
        if (!strcmp(c->cases[i].name, name))
            return i;
    return -1;
}

// The keys of a section come one after the other: so it is mostly the last one.
static int index_of_station(const struct sessions_config *c, const char *name) {
    for (int i = c->station_count - 1; i >= 0; i--)
        if (!strcmp(c->stations[i].name, name))
            return i;
    return -1;
}

static struct session_station *next_station(struct sessions_config *c) {
    int count = c->station_count;
    if ((count & (count - 1)) == 0) // 0, 1, 2, 4, ...
        c->stations = alloc_resize(c->stations, count ? 2 * (size_t)count : 1, sizeof *c->stations);
    memset(&c->stations[count], 0, sizeof *c->stations);
    return &c->stations[count];
}

static void *find_case(void *user, const char *name, struct error *err) {
    struct sessions_config *c = &((struct server_config *)user)->sessions;
    int index = index_of_case(c, name);
    if (index >= 0)
        return &c->cases[index];
    if (c->case_count == SESSIONS_CASES_MAX) {
        fail(err, RESULT_LIMIT, "a server has at most %d cases", SESSIONS_CASES_MAX);
        return NULL;
    }
    struct session_case *entry = &c->cases[c->case_count];
    if (!take_name(name, entry->name, err))
        return NULL;
    c->case_count++;
    return entry;
}

static void *find_station(void *user, const char *name, struct error *err) {
    struct sessions_config *c = &((struct server_config *)user)->sessions;
    int index = index_of_station(c, name);
    if (index >= 0)
        return &c->stations[index];
    if (c->station_count == STATIONS_MAX) {
        fail(err, RESULT_LIMIT, "a server has at most %d stations", STATIONS_MAX);
        return NULL;
    }
    struct session_station *station = next_station(c);
    if (!take_name(name, station->name, err))
        return NULL;
    station->optic = view_optic_usual();
    c->station_count++;
    return station;
}

// ---- tables of the file's keys ------------------------------------------------------------------

#define SESSIONS(member) SETTING_IN(struct sessions_config, member)
#define WEB(member) SETTING_IN(struct web_settings, member)
#define XAPI(member) SETTING_IN(struct xapi_settings, member)
#define SIGN_ON(member) SETTING_IN(struct signon_settings, member)
#define CLUSTER(member) SETTING_IN(struct cluster_settings, member)
#define WARP(member) SETTING_IN(struct session_settings, member)
#define STATION(member) SETTING_IN(struct session_station, member)

static const struct setting_key server_keys[] = {
    {"address", SETTING_TEXT, SESSIONS(address)},
    {"port", SETTING_INTEGER, SESSIONS(port), 1, 65535},
    {"udp_port", SETTING_INTEGER, SESSIONS(udp_port), 0, 65535},
    {"workers", SETTING_INTEGER, SESSIONS(workers), 0, 64},
    {"keys", SETTING_PATH, SESSIONS(keys_dir)},
    {"authority", SETTING_PATH, SESSIONS(authority_key_dir)},
    {"authority_passphrase", SETTING_PATH, SESSIONS(authority_passphrase)},
    {"traces", SETTING_PATH, SESSIONS(traces_dir)},
    {"socket", SETTING_PATH, SESSIONS(socket)},
    {"records", SETTING_PATH, SESSIONS(records)},
    {"tasks", SETTING_PATH, SESSIONS(tasks_dir)},
    {"unfit", .take = take_unfit, .wanted = "refuse or serve"},
    {"keep_days", SETTING_INTEGER, SESSIONS(keep_days), 0, 36500},
    {"keep_gb", SETTING_INTEGER, SESSIONS(keep_gb), 0, 1000000},
    {"case_memory_mb", SETTING_INTEGER, SESSIONS(case_memory_mb), 64, 65536},
    {"wait_s", SETTING_INTEGER, SESSIONS(wait_s), 1, 86400},
    {"calibration_days", SETTING_INTEGER, SESSIONS(calibration_days), 1, 3650},
    {"calibration_mm", SETTING_NUMBER, SESSIONS(calibration_mm), 0.01, 100},
    {"calibration_deg", SETTING_NUMBER, SESSIONS(calibration_deg), 0.01, 100},
    {0},
};

static const struct setting_key web_keys[] = {
    {"port", SETTING_INTEGER, WEB(port), 0, 65535},
    {"address", SETTING_TEXT, WEB(address)},
    {"certificate", SETTING_PATH, WEB(certificate)},
    {"key", SETTING_PATH, WEB(key)},
    {"plain", SETTING_SWITCH, WEB(is_plain)},
    {"names", .take = take_names,
     .wanted = "up to 8 names of at most 63 bytes, separated by blanks"},
    {0},
};

static const struct setting_key xapi_keys[] = {
    {"file", SETTING_PATH, XAPI(file)},         {"site", SETTING_TEXT, XAPI(site)},
    {"server", SETTING_TEXT, XAPI(server)},     {"user", SETTING_TEXT, XAPI(user)},
    {"password", SETTING_PATH, XAPI(password)}, {"authority", SETTING_PATH, XAPI(authority)},
    {"names", SETTING_SWITCH, XAPI(names)},     {0},
};

static const struct setting_key sign_on_keys[] = {
    {"issuer", SETTING_TEXT, SIGN_ON(issuer)},
    {"client_id", SETTING_TEXT, SIGN_ON(client_id)},
    {"client_secret", SETTING_PATH, SIGN_ON(client_secret)},
    {"name", SETTING_TEXT, SIGN_ON(name)},
    {"claim", SETTING_TEXT, SIGN_ON(claim)},
    {"authority", SETTING_PATH, SIGN_ON(authority)},
    {0},
};

static const struct setting_key cluster_keys[] = {
    {"name", SETTING_TEXT, CLUSTER(jet.name)},
    {"nats", .take = take_nats,
     .wanted = "1 to 8 addresses as nats://HOST:4222 or tls://HOST:4222, separated by commas"},
    {"replicas", SETTING_INTEGER, CLUSTER(jet.replicas), 1, 5},
    {"authority", SETTING_PATH, CLUSTER(jet.authority)},
    {"certificate", SETTING_PATH, CLUSTER(jet.certificate)},
    {"key", SETTING_PATH, CLUSTER(jet.key)},
    {"user", SETTING_TEXT, CLUSTER(jet.user)},
    {"password", SETTING_PATH, CLUSTER(jet.password)},
    {"stations", SETTING_TEXT, CLUSTER(stations)},
    {"pages", SETTING_TEXT, CLUSTER(pages)},
    {0},
};

static const struct setting_key warp_keys[] = {
    {"field", .take = take_field,
     .wanted = "integral: with the other fields the shown tip jumps, and only benches use them "
               "(--bench-field)"},
    {"unit_mm", SETTING_NUMBER, WARP(field.unit_mm), 1e-3, 1e4},
    {"radius_mm", SETTING_NUMBER, WARP(field.radius_mm), 0.1, 1000},
    {"background_per_mm", SETTING_NUMBER, WARP(field.background_per_mm), 0, 100},
    {"skin_mm", SETTING_NUMBER, WARP(field.skin_mm), 0, 0.1},
    {"strength", SETTING_NUMBER, WARP(field.strength), 0, 1},
    {"ease_share", SETTING_NUMBER, WARP(ease_share), 0, 1000},
    {"ease_mm_s", SETTING_NUMBER, WARP(ease_mm_s), 0, 1e6},
    {"adaptive", .take = take_adaptive, .wanted = "hinge, paper or paper-narrow"},
    {"avatar", .take = take_avatar, .wanted = "tip, rigid or points"},
    {"hold_ms", .take = take_hold, .wanted = "a whole number from 0 to 10000"},
    {0},
};

static const struct setting_key instrument_keys[] = {
    {"point.", .take = take_point,
     .wanted = "\"x y z radius\" in mm; points are numbered from 1 to 15 without a gap"},
    {0},
};

static const struct setting_key case_keys[] = {
    {"dir", SETTING_PATH, SETTING_IN(struct session_case, dir)},
    {"hash", .take = take_hash,
     .wanted = "64 hexadecimal digits, as arthron-case info prints them"},
    {0},
};

static const struct setting_key station_keys[] = {
    {"case", SETTING_TEXT, STATION(case_name)},
    {"start", .take = take_start, .wanted = "auto or command"},
    {"trainee", SETTING_TEXT, STATION(trainee)},
    {"optic_deg", SETTING_NUMBER, STATION(optic.tilt_deg), 0, 90},
    {"optic_view_deg", SETTING_NUMBER, STATION(optic.field_deg), 1, 179},
    {"contact.", .take = take_contact,
     .wanted = "a button from 0 to 31, of contact.probe, contact.punch and so on"},
    {0},
};

static const struct setting_section sections[] = {
    {"server", server_keys, find_server},
    {"web", web_keys, find_web},
    {"xapi", xapi_keys, find_xapi},
    {"sign_on", sign_on_keys, find_sign_on},
    {"cluster", cluster_keys, find_cluster},
    {"warp", warp_keys, find_warp},
    {"instrument NAME", instrument_keys, find_instrument},
    {"case NAME", case_keys, find_case},
    {"station NAME", station_keys, find_station},
    {0},
};

// ---- file ---------------------------------------------------------------------------------------

static enum result refuse_case(const struct sessions_config *c,
                               const struct session_station *station, struct error *err) {
    const char *names[SESSIONS_CASES_MAX + 1] = {NULL};
    for (int i = 0; i < c->case_count; i++)
        names[i] = c->cases[i].name;
    const char *nearest = nearest_name(station->case_name, names);
    return fail(err, RESULT_INVALID, "[station %s] case = %s: there is no section [case %s]%s%s%s",
                station->name, station->case_name, station->case_name,
                nearest ? "; did you mean " : "", nearest ? nearest : "", nearest ? "?" : "");
}

static enum result complete(const struct sessions_config *c, struct error *err) {
    if (c->udp_port && c->udp_port + sessions_worker_count(c) - 1 > 65535)
        return fail(err, RESULT_INVALID,
                    "[server] udp_port = %d: %d workers need ports beyond 65535", c->udp_port,
                    sessions_worker_count(c));
    const char *missing = !c->keys_dir[0]     ? "keys"
                          : !c->traces_dir[0] ? "traces"
                          : !c->socket[0]     ? "socket"
                                              : NULL;
    if (missing)
        return fail(err, RESULT_MISSING, "[server] needs the key \"%s\"", missing);
    if ((c->keep_days || c->keep_gb) && !c->records[0])
        return fail(err, RESULT_MISSING,
                    "[server] keep_days and keep_gb need records, which has the sessions");
    for (int i = 0; i < c->case_count; i++)
        if (!c->cases[i].dir[0])
            return fail(err, RESULT_MISSING, "[case %s] needs the key \"dir\"", c->cases[i].name);
    for (int i = 0; i < c->station_count; i++)
        if (!c->stations[i].case_name[0])
            return fail(err, RESULT_MISSING, "[station %s] needs the key \"case\"",
                        c->stations[i].name);
    for (int i = 0; i < c->station_count; i++)
        if (index_of_case(c, c->stations[i].case_name) < 0)
            return refuse_case(c, &c->stations[i], err);
    return RESULT_OK;
}

// The tasks lie beside the cases.
static enum result complete_tasks(struct sessions_config *c, struct error *err) {
    char parent[SESSIONS_PATH_MAX];
    if (c->tasks_dir[0] || !c->case_count)
        return RESULT_OK;
    settings_folder(c->cases[0].dir, parent, sizeof parent);
    if (snprintf(c->tasks_dir, sizeof c->tasks_dir, "%.*s/tasks", (int)sizeof parent - 1, parent) <
        (int)sizeof c->tasks_dir)
        return RESULT_OK;
    return fail(err, RESULT_LIMIT, "[server] tasks: the path is too long");
}

static enum result complete_plain(const struct sessions_config *c, const struct web_settings *w,
                                  struct error *err) {
    if (strcmp(w->address, "127.0.0.1") != 0)
        return fail(err, RESULT_INVALID,
                    "[web] plain: passwords would cross the network for all to read; it needs "
                    "address = 127.0.0.1");
    if (c->cluster.jet.name[0])
        return fail(err, RESULT_INVALID, "[web] plain: one of several servers has TLS");
    return RESULT_OK;
}

// Browsers are served where stations are, with the server's own certificate, unless they are told
// otherwise.
static enum result complete_web(const struct sessions_config *c, struct web_settings *w,
                                struct error *err) {
    if (!w->port)
        return RESULT_OK;
    if (!c->records[0])
        return fail(err, RESULT_MISSING, "[web] needs [server] records, which has the accounts");
    if (!w->certificate[0] != !w->key[0])
        return fail(err, RESULT_MISSING, "[web] needs both certificate and key, or neither");
    if (!w->address[0])
        memcpy(w->address, c->address, sizeof w->address);
    if (w->is_plain)
        return complete_plain(c, w, err);
    if (w->certificate[0])
        return RESULT_OK;
    const int most = SESSIONS_PATH_MAX - (int)sizeof "/server.pem";
    if (strlen(c->keys_dir) > (size_t)most)
        return fail(err, RESULT_LIMIT, "[server] keys: the path is too long");
    snprintf(w->certificate, sizeof w->certificate, "%.*s/server.pem", most, c->keys_dir);
    snprintf(w->key, sizeof w->key, "%.*s/server.key", most, c->keys_dir);
    return RESULT_OK;
}

static enum result complete_xapi(const struct sessions_config *c, const struct xapi_settings *x,
                                 struct error *err) {
    const char *missing = !x->file[0]       ? "file"
                          : !x->server[0]   ? NULL
                          : !x->user[0]     ? "user"
                          : !x->password[0] ? "password"
                                            : NULL;
    bool is_used = x->file[0] || x->site[0] || x->server[0] || x->user[0] || x->password[0] ||
                   x->authority[0] || x->names;
    if (!is_used)
        return RESULT_OK;
    if (missing)
        return fail(err, RESULT_MISSING, "[xapi] needs the key \"%s\"", missing);
    if (!c->records[0])
        return fail(err, RESULT_MISSING, "[xapi] needs [server] records, which has the attempts");
    return RESULT_OK;
}

static enum result complete_sign_on(const struct web_settings *w, struct signon_settings *s,
                                    struct error *err) {
    bool is_used = s->issuer[0] || s->client_id[0] || s->client_secret[0] || s->name[0] ||
                   s->claim[0] || s->authority[0];
    const char *missing = !s->issuer[0]      ? "issuer"
                          : !s->client_id[0] ? "client_id"
                          : !s->name[0]      ? "name"
                          : !s->claim[0]     ? "claim"
                                             : NULL;
    if (!is_used)
        return RESULT_OK;
    if (missing)
        return fail(err, RESULT_MISSING, "[sign_on] needs the key \"%s\"", missing);
    if (!w->port || w->is_plain)
        return fail(err, RESULT_INVALID, "[sign_on] needs [web], and no plain there");
    if (strncmp(s->issuer, "https://", 8) != 0)
        return fail(
            err, RESULT_INVALID,
            "[sign_on] issuer = %s: anybody could answer for it; it must begin with https://",
            s->issuer);
    return RESULT_OK;
}

// Where stations reach the server, with the port of the pages.
static void complete_pages(const struct web_settings *w, struct cluster_settings *c) {
    const char *colon = strrchr(c->stations, ':');
    if (c->pages[0] || !w->port || !colon)
        return;
    int length = snprintf(c->pages, sizeof c->pages, "%.*s:%d", (int)(colon - c->stations),
                          c->stations, w->port);
    if (length >= (int)sizeof c->pages)
        c->pages[0] = '\0';
}

static enum result complete_cluster(const struct web_settings *w, struct cluster_settings *c,
                                    struct error *err) {
    bool is_used = c->jet.name[0] || c->jet.server_count || c->stations[0] || c->pages[0] ||
                   c->jet.user[0] || c->jet.authority[0] || c->jet.certificate[0];
    const char *missing = !c->jet.name[0]        ? "name"
                          : !c->jet.server_count ? "nats"
                          : !c->stations[0]      ? "stations"
                                                 : NULL;
    if (!is_used)
        return RESULT_OK;
    if (missing)
        return fail(err, RESULT_MISSING, "[cluster] needs the key \"%s\"", missing);
    if (!c->jet.certificate[0] != !c->jet.key[0])
        return fail(err, RESULT_MISSING, "[cluster] needs both certificate and key, or neither");
    complete_pages(w, c);
    return RESULT_OK;
}

static void set_defaults(struct sessions_config *config) {
    config->port = 4810;
    config->udp_port = 4811;
    config->wait_s = 300;
    config->case_memory_mb = 1024;
    config->calibration_days = 30;
    config->calibration_mm = 1;
    config->calibration_deg = 1;
    config->cluster.jet.replicas = 3;
    config->settings = session_settings_default();
}

enum result config_load(const char *path, const struct setting_override *overrides,
                        int override_count, struct server_config *out_config, struct error *err) {
    memset(out_config, 0, sizeof *out_config);
    set_defaults(&out_config->sessions);
    enum result result = settings_load(path, overrides, override_count, sections, out_config, err);
    if (result != RESULT_OK)
        return result;
    result = complete(&out_config->sessions, err);
    if (result == RESULT_OK)
        result = complete_tasks(&out_config->sessions, err);
    if (result == RESULT_OK)
        result = complete_web(&out_config->sessions, &out_config->web, err);
    if (result == RESULT_OK)
        result = complete_xapi(&out_config->sessions, &out_config->xapi, err);
    if (result == RESULT_OK)
        result = complete_sign_on(&out_config->web, &out_config->sign_on, err);
    if (result == RESULT_OK)
        result = complete_cluster(&out_config->web, &out_config->sessions.cluster, err);
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", path);
}

void config_fini(struct server_config *config) {
    free(config->sessions.stations);
    config->sessions.stations = NULL;
}
