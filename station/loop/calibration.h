// The calibration file: what `arthron-station calibrate` found, when, and how well. An INI file of
// its own, named by `calibration` in the config; written whole, beside and renamed.
//
//   [tip DEVICE CHANNEL]     tip_mm = x y z               in the tool's frame
//   [registration DEVICE]    T_mockup_tracker = x y z qw qx qy qz
//   [encoder DEVICE KEY]     scale, offset                as in the device's `KEY = REGISTER ...`
//   [delay DEVICE]           delay_ms
//
// Each with date (UTC, as 2026-11-21T08:30:00Z), residual (root mean square; mm, degrees for the
// encoders of angles and delays) and details (a sentence for people).
#pragma once

#include "base/pose.h"
#include "base/result.h"

#include <stdbool.h>
#include <stdint.h>

#define CALIBRATION_ENTRIES_MAX 64
#define CALIBRATION_NAME_MAX 32
#define CALIBRATION_DETAILS_MAX 200 // what a line of an INI file can hold

enum calibration_kind {
    CALIBRATION_TIP,
    CALIBRATION_REGISTRATION,
    CALIBRATION_ENCODER,
    CALIBRATION_DELAY,
    CALIBRATION_KIND_COUNT
};

struct calibration_entry {
    enum calibration_kind kind;
    char device[CALIBRATION_NAME_MAX];
    char of[CALIBRATION_NAME_MAX]; // tip: the channel; encoder: the key; else empty
    int64_t utc_s;
    double residual;
    char details[CALIBRATION_DETAILS_MAX];
    union {
        vec3 tip_mm;
        pose T_mockup_tracker;
        double delay_ms;
        struct {
            double scale, offset;
        };
    };
};

struct calibration {
    int count;
    struct calibration_entry entries[CALIBRATION_ENTRIES_MAX];
};

// RESULT_MISSING: there is no such file. Other errors name file, line, section and key.
enum result calibration_read(const char *path, struct calibration *out, struct error *err);
// Whether calibration_write could write there. It changes nothing.
enum result calibration_can_write(const char *path, struct error *err);
enum result calibration_write(const char *path, const struct calibration *calibration,
                              struct error *err);

// Replaces the entry of that kind, device and `of`, or adds it. False where there is no room.
bool calibration_put(struct calibration *calibration, const struct calibration_entry *entry);

bool calibration_is_angle(const struct calibration_entry *entry); // its residual is in degrees

// What the server is told: the oldest date, the largest residuals. Not for an empty calibration.
struct calibration_summary {
    int64_t utc_s;
    double residual_mm, residual_deg; // those of delays aside, which are judged as they are found
};

struct calibration_summary calibration_summarise(const struct calibration *calibration);
