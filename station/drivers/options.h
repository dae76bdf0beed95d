// Reads the options of a device's section. Every error names the section and the key:
// "[device probe] jump_mm: ...". An absent key gives the value named `otherwise`.
#pragma once

#include "base/pose.h"
#include "base/result.h"
#include "base/sample.h"
#include "drivers/device.h"

#include <stdbool.h>
#include <stddef.h>

#define OPTION_TEXT_MAX 256 // bytes of a value that names an address or a file, with the final 0

// The keys of every device, which the runner reads; ended by NULL.
extern const char *const runner_keys[];

// Refuses keys that are not among `keys` (ended by NULL) and keys given twice. An entry "tip."
// stands for tip.CHANNEL of every channel, ".opening" for CHANNEL.opening of every instrument,
// ".force" for CHANNEL.force of every instrument and bone, "marker.*" for each key that begins so.
// The error names the nearest key, of the runner's too, or all.
enum result options_check(const struct device_config *config, const char *const keys[],
                          struct error *err);

// Writes "[device NAME] KEY: " and the text, returns `code`.
enum result option_fail(const struct device_config *config, const char *key, struct error *err,
                        enum result code, const char *format, ...)
    __attribute__((format(printf, 5, 6)));

// Fails as option_fail does, with the nearest of `names` or all of them behind the text.
enum result option_fail_name(const struct device_config *config, const char *key, struct error *err,
                             const char *text, const char *word, const char *const *names);

const char *option_text(const struct device_config *config, const char *key); // NULL: absent

// A copy, at most OPTION_TEXT_MAX - 1 bytes. RESULT_MISSING where absent.
enum result option_required(const struct device_config *config, const char *key,
                            char out_text[OPTION_TEXT_MAX], struct error *err);

enum result option_number(const struct device_config *config, const char *key, double low,
                          double high, double otherwise, double *out_value, struct error *err);
enum result option_integer(const struct device_config *config, const char *key, int low, int high,
                           int otherwise, int *out_value, struct error *err);
enum result option_switch(const struct device_config *config, const char *key, bool otherwise,
                          bool *out_value, struct error *err);
enum result option_channel(const struct device_config *config, const char *key,
                           enum channel otherwise, enum channel *out_channel, struct error *err);

// As number_pose reads it. The identity where absent.
enum result option_pose(const struct device_config *config, const char *key, pose *out_pose,
                        struct error *err);

// The poses PREFIX.CHANNEL of all channels.
enum result option_poses(const struct device_config *config, const char *prefix,
                         pose out_poses[CHANNEL_COUNT], struct error *err);
