// Whether the system gives enough for one more session. What is left is kept for the sessions that
// run, for the local console and for instructors.
#pragma once

#include "base/result.h"

#include <stdint.h>

// RESULT_LIMIT says what is missing, and what to do.
enum result resources_allow_session(struct error *err);

// What the system gives a server.
struct resource_limits {
    uint64_t bytes, descriptors;
};

void resources_look(struct resource_limits *out_limits);

// RESULT_LIMIT: so many stations may need more, and the error says of what and what to do.
enum result resources_reckon(int stations, const struct resource_limits *limits, struct error *err);
