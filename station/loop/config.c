#include "loop/config.h"

#include "base/check.h"
#include "base/log.h"
#include "base/number.h"
#include "loop/config_instruments.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static bool take_server(void *target, const char *rest, const char *value) {
    (void)rest;
    struct station_config *c = target;
    c->server_count = servers_parse(value, c->servers);
    return c->server_count > 0;
}

// Names of origins, separated by blanks or commas.
static bool take_origins(void *target, const char *rest, const char *value) {
    (void)rest;
    struct view_config *view = target;
    static const char between[] = " \t,";
    view->origin_count = 0;
    for (value += strspn(value, between); *value; value += strspn(value, between)) {
        size_t length = strcspn(value, between);
        if (view->origin_count == VIEW_ORIGINS_MAX || length >= sizeof *view->origins)
            return false;
        char *origin = view->origins[view->origin_count++];
        memcpy(origin, value, length);
        origin[length] = '\0';
        const char *host = strstr(origin, "://");
        if (!host || !host[3] || strpbrk(host + 3, "/?#"))
            return false;
        value += length;
    }
    return true;
}

struct station_device *station_config_device(struct station_config *c, const char *name) {
    for (int i = 0; i < c->device_count; i++)
        if (!strcmp(c->devices[i].config.name, name))
            return &c->devices[i];
    return NULL;
}

static void remove_option(struct station_device *device, int at) {
    free((char *)device->options[at].key);
    free((char *)device->options[at].value);
    int behind = --device->config.option_count - at;
    memmove(&device->options[at], &device->options[at + 1],
            (size_t)behind * sizeof *device->options);
}

static bool set_option(struct station_device *device, const char *key, const char *value) {
    int at = 0;
    while (at < device->config.option_count && strcmp(device->options[at].key, key))
        at++;
    if (at < device->config.option_count)
        remove_option(device, at);
    at = device->config.option_count;
    if (!value)
        return true;
    if (at == STATION_OPTIONS_MAX)
        return false;
    device->options[at] = (struct device_option){alloc_text(key), alloc_text(value)};
    device->config.option_count++;
    return true;
}

bool station_config_set(struct station_config *config, const char *name, const char *key,
                        const char *value) {
    struct station_device *device = station_config_device(config, name);
    return device && set_option(device, key, value);
}

// ---- tables of the file's keys ------------------------------------------------------------------

// A key given again (by --set) replaces the first.
static bool take_option(void *target, const char *key, const char *value) {
    return set_option(target, key, value);
}

static void *find_station(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return user;
}

static void *find_view(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return &((struct station_config *)user)->view;
}

static void *find_openigtlink(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return &((struct station_config *)user)->openigtlink;
}

static void *find_device(void *user, const char *name, struct error *err) {
    struct station_config *c = user;
    struct station_device *device = station_config_device(c, name);
    if (device)
        return device;
    if (c->device_count == STATION_DEVICES_MAX) {
        fail(err, RESULT_LIMIT, "a station has at most %d devices", STATION_DEVICES_MAX);
        return NULL;
    }
    device = &c->devices[c->device_count];
    if (!setting_text(name, device->config.name, DEVICE_NAME_MAX)) {
        fail(err, RESULT_LIMIT, "a device's name has at most %d bytes", DEVICE_NAME_MAX - 1);
        return NULL;
    }
    c->device_count++;
    device->config.options = device->options;
    return device;
}

static const struct setting_key station_keys[] = {
    {"name", SETTING_TEXT, SETTING_IN(struct station_config, name)},
    {"server", .take = take_server,
     .wanted = "HOST:PORT, the port from 1 to 65535, or up to 8 of them between commas"},
    {"keys", SETTING_PATH, SETTING_IN(struct station_config, keys_dir)},
    {"rate_hz", SETTING_NUMBER, SETTING_IN(struct station_config, rate_hz), 1, 2000},
    {"datagrams", SETTING_SWITCH, SETTING_IN(struct station_config, datagrams)},
    {"calibration", SETTING_PATH, SETTING_IN(struct station_config, calibration_path)},
    {0},
};

static const struct setting_key view_keys[] = {
    {"port", SETTING_INTEGER, SETTING_IN(struct view_config, port), 0, 65535},
    {"origins", .take = take_origins, .wanted = "up to 8 origins as http://localhost:8080"},
    {"token", SETTING_PATH, SETTING_IN(struct view_config, token_path)},
    {0},
};

static const struct setting_key openigtlink_keys[] = {
    {"port", SETTING_INTEGER, SETTING_IN(struct igtl_server_config, port), 0, 65535},
    {"address", SETTING_TEXT, SETTING_IN(struct igtl_server_config, address)},
    {"rate_hz", SETTING_NUMBER, SETTING_IN(struct igtl_server_config, rate_hz), 1, 2000},
    {0},
};

static const struct setting_key device_keys[] = {
    {"*", .take = take_option, .wanted = "left out: the device has as many keys as it may have"},
    {0},
};

static void *find_instrument(void *user, const char *name, struct error *err) {
    return instrument_section(&((struct station_config *)user)->instruments, name, err);
}

static const struct setting_section config_sections[] = {
    {"station", station_keys, find_station},
    {"view", view_keys, find_view},
    {"openigtlink", openigtlink_keys, find_openigtlink},
    {"instrument NAME", instrument_keys, find_instrument},
    {"device NAME", device_keys, find_device},
    {0},
};

// ---- the whole ----------------------------------------------------------------------------------

static enum result complete(struct station_config *c, struct error *err) {
    if (!c->name[0] || !c->server_count || !c->keys_dir[0])
        return fail(err, RESULT_MISSING, "[station] needs name, server and keys");
    if (!c->device_count)
        return fail(err, RESULT_MISSING, "the config has no [device NAME]");
    if (instruments_complete(&c->instruments, err) != RESULT_OK)
        return RESULT_INVALID;
    if (!c->view.token_path[0] &&
        !setting_path(c->keys_dir, "view.token", c->view.token_path, sizeof c->view.token_path))
        return fail(err, RESULT_LIMIT, "[station] keys is too long");
    return RESULT_OK;
}

static enum result read_calibration(struct station_config *config, struct error *err) {
    const char *path = config->calibration_path;
    if (!path[0])
        return RESULT_OK;
    if (!access(path, F_OK))
        return calibration_read(path, &config->calibration, err);
    log_warning("station", "%s: does not exist yet. `arthron-station calibrate` makes it", path);
    return RESULT_OK;
}

enum result station_config_load(const char *path, const struct setting_override *overrides,
                                int override_count, struct station_config **out_config,
                                struct error *err) {
    struct station_config *config = alloc(1, sizeof *config);
    config->rate_hz = 200;
    config->instruments = *instruments_usual();
    config->datagrams = true;
    config->openigtlink.rate_hz = 60;
    enum result result =
        settings_load(path, overrides, override_count, config_sections, config, err);
    if (result == RESULT_OK) {
        result = complete(config, err);
        if (result != RESULT_OK)
            fail_in(err, result, "%s: ", path);
    }
    if (result == RESULT_OK)
        result = read_calibration(config, err);
    if (result != RESULT_OK) {
        station_config_destroy(&config);
        return result;
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
