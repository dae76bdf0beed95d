// A station's main loop: devices into frames, frames to the server, replies into figures.
#pragma once

#include "link/link.h"
#include "loop/config.h"

#include <signal.h>

struct loop_options {
    double seconds; // stop after so long; 0: until *stop
    bool live;      // a line on stdout each second
    bool json;      // at the end one JSON line on stdout, instead of a sentence
};

// Runs until *stop becomes nonzero or the time is over. Devices and link problems are logged and
// mended on the way; an error is one of the config or of missing keys.
enum result loop_run(const struct station_config *config, const struct loop_options *options,
                     const volatile sig_atomic_t *stop, struct error *err);

// How a station of this config introduces itself. Its texts are the config's.
struct link_config loop_link_config(const struct station_config *config);
