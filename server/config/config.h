// The server's config file (INI), read once at the start and never written.
// docs/CONFIG.md explains every key.
#pragma once

#include "sessions/config.h"
#include "settings/settings.h"
#include "signon/settings.h"
#include "xapi/xapi.h"

#define SERVER_NAMES_MAX 8

// Where browsers are served.
struct web_settings {
    int port; // 0: none are
    char address[STATION_NAME_MAX];
    bool is_plain; // HTTP without TLS, which only this machine can reach
    char certificate[SESSIONS_PATH_MAX],
        key[SESSIONS_PATH_MAX];                     // the server's own where they are not given
    char names[SERVER_NAMES_MAX][STATION_NAME_MAX]; // empty behind the last
};

struct server_config {
    struct sessions_config sessions;
    struct web_settings web;
    struct xapi_settings xapi;
    struct signon_settings sign_on;
};

// Paths in the file are relative to the file's folder. The error names file, line, section and key:
// an unknown one with the nearest name, a value with its range or choices, a key that is missing.
enum result config_load(const char *path, const struct setting_override *overrides,
                        int override_count, struct server_config *out_config, struct error *err);
void config_fini(struct server_config *config); // also of one that was not loaded
