// What the parts of `arthron-station calibrate` share.
#pragma once

#include "tools/gather.h"

#include <jansson.h>

#define CALIBRATE_VALUES_MAX 32

struct calibrate_arguments {
    const char *config, *device, *key, *points, *channel_name;
    enum channel channel;
    double seconds;
    int value_count;
    double values[CALIBRATE_VALUES_MAX];
    bool json;
};

// Each asks for what it needs on stderr, measures, and fills kind-specific values, residual and
// details of *out; what it found goes into `report` (an object) too. RESULT_INVALID: what was
// measured is not good enough; the error says what to do.
enum result calibrate_tip(struct station_config *config,
                          const struct calibrate_arguments *arguments,
                          struct calibration_entry *out, json_t *report, struct error *err);
enum result calibrate_landmarks(struct station_config *config,
                                const struct calibrate_arguments *arguments,
                                struct calibration_entry *out, json_t *report, struct error *err);
enum result calibrate_encoder(struct station_config *config,
                              const struct calibrate_arguments *arguments,
                              struct calibration_entry *out, json_t *report, struct error *err);
enum result calibrate_delay(struct station_config *config,
                            const struct calibrate_arguments *arguments,
                            struct calibration_entry *out, json_t *report, struct error *err);
