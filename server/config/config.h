// The server's config file (INI), read once at the start and never written.
//
//   [server]  address, port, udp_port, workers, keys, traces, socket, records,
//            unfit, wait_s, calibration_days, calibration_mm, calibration_deg
//   [warp]    field, unit_mm, radius_mm, background_per_mm, skin_mm, strength, hold_ms,
//             adaptive, avatar, ease_share, ease_mm_s
//   [instrument NAME]  point.1, point.2, ...
//   [case NAME]     dir
//   [station NAME]  case, start = auto|command, trainee, contact.CHANNEL
//
// docs/CONFIG.md explains every key.
#pragma once

#include "hub/hub.h"
#include "settings/settings.h"

// Paths in the file are relative to the file's folder. The error names file and line, section and
// key: an unknown one, a value out of range, a station whose case is missing.
enum result config_load(const char *path, const struct setting_override *overrides,
                        int override_count, struct hub_config *out_config, struct error *err);
