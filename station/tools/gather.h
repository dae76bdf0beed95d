// Samples of devices as they give them, for calibration: no filter, no guard against jumps.
#pragma once

#include "loop/config.h"
#include "samples/runner.h"

struct gather;

// Starts the device of that name. RESULT_MISSING: there is none.
enum result gather_create(struct station_config *config, const char *device,
                          struct gather **out_gather, struct error *err);
// All devices, none of which calls its values late; a sample's `device` is its index in the config.
enum result gather_create_all(struct station_config *config, struct gather **out_gather,
                              struct error *err);
void gather_destroy(struct gather **gather);

// The samples of a channel and kind that are measured from now on, for so long, at most `max` of
// them. RESULT_TIMEOUT: not a single one came; the error says what is wrong with the device.
enum result gather_take(struct gather *gather, enum channel channel, enum sample_kind kind,
                        double seconds, struct sample *out_samples, int max, int *out_count,
                        struct error *err);

// The same of two channels at once.
struct gather_wish {
    enum channel channel;
    enum sample_kind kind;
    struct sample *samples; // room for `max`
    int max, count;
};
enum result gather_take_both(struct gather *gather, struct gather_wish wishes[2], double seconds,
                             struct error *err);

// Says on stderr what to do, and waits for Enter. RESULT_CLOSED: stdin has ended.
enum result gather_prompt(const char *text, struct error *err);
