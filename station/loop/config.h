// The station's config file (INI), read once at the start and never written.
//
//   [station]      name, server = HOST:PORT, ..., keys = DIR, rate_hz, datagrams = yes|no,
//                  calibration = FILE
//   [view]         port, origins, token = FILE
//   [openigtlink]  port, address, rate_hz
//   [instrument NAME]  kind, cuts, button, length_mm, width_mm, thickness_mm, opening_deg, colour
//   [device NAME]  driver, and the keys of that driver (docs/CONFIG.md)
#pragma once

#include "base/instrument.h"
#include "base/result.h"
#include "drivers/device.h"
#include "igtl/server.h"
#include "link/servers.h"
#include "loop/calibration.h"
#include "settings/settings.h"
#include "view/view.h"

#define STATION_DEVICES_MAX 16
#define STATION_OPTIONS_MAX 64 // of one device

struct station_device {
    struct device_config config;
    struct device_option options[STATION_OPTIONS_MAX];
};

struct station_config {
    char name[64];
    int server_count;
    struct server_address servers[SERVERS_MAX];
    char keys_dir[256];
    double rate_hz;
    bool datagrams;
    struct view_config view;               // port 0: there is none
    struct igtl_server_config openigtlink; // port 0: there is none
    char calibration_path[256];            // empty: none is named
    struct calibration calibration;        // what is in it; empty where there is no such file yet
    struct instruments instruments;        // described ones behind the usual ones
    int device_count;
    struct station_device devices[STATION_DEVICES_MAX];
};

// Reads the config and the calibration that it names. Paths in the file are relative to the file's
// folder. The error names file, line, section and key.
// The channels of described instruments get their names (channel_set_name).
// A device's own keys are checked when the device is made. The caller releases it.
enum result station_config_load(const char *path, const struct setting_override *overrides,
                                int override_count, struct station_config **out_config,
                                struct error *err);
void station_config_destroy(struct station_config **config);

// Puts the calibration in the place of the devices' own options: tip offsets (their rotations
// stay), T_mockup_tracker, scales and offsets. RESULT_INVALID: it is about a device or a key that
// the config does not have.
enum result station_config_calibrate(struct station_config *config, struct error *err);

// A device's option, replaced or added; NULL removes it. False where there is no such device or no
// room.
bool station_config_set(struct station_config *config, const char *device, const char *key,
                        const char *value);

// Scale and offset of a device's `KEY = REGISTER SCALE OFFSET`; RESULT_INVALID: no such key.
enum result station_config_scale(struct station_config *config, const char *device, const char *key,
                                 double scale, double offset, struct error *err);

struct station_device *station_config_device(struct station_config *config, const char *name);
