// The station's config file (INI), read once at the start and never written.
//
//   [station]      name, server = HOST:PORT, keys = DIR, rate_hz, datagrams = yes|no
//   [device NAME]  driver, and the keys of that driver (docs/CONFIG.md)
#pragma once

#include "base/result.h"
#include "device/device.h"
#include "settings/settings.h"

#define STATION_DEVICES_MAX 16
#define STATION_OPTIONS_MAX 64 // of one device

struct station_device {
    struct device_config config;
    struct device_option options[STATION_OPTIONS_MAX];
};

struct station_config {
    char name[64];
    char host[256];
    int port;
    char keys_dir[256];
    double rate_hz;
    bool datagrams;
    int device_count;
    struct station_device devices[STATION_DEVICES_MAX];
};

// Paths in the file are relative to the file's folder. The error names file, line, section and key.
// A device's own keys are checked when the device is made. The caller releases it.
enum result station_config_load(const char *path, const struct setting_override *overrides,
                                int override_count, struct station_config **out_config,
                                struct error *err);
void station_config_destroy(struct station_config **config);

// "host:port" or "[address]:port"; false where it is not that.
bool station_parse_server(const char *text, char *out_host, size_t host_size, int *out_port);
