// What a tracker sends beside what its station wants, and how often that comes: so that a silence
// can be told from a pause, and a wrong name from a tool out of view.
#pragma once

#include "base/result.h"
#include "base/sample.h"
#include "igtl/stream.h"

#include <stdbool.h>
#include <stdint.h>

#define HEARD_NAMES_MAX 6

struct tracker_tools {
    char names[CHANNEL_COUNT][IGTL_TOOL_SIZE]; // as the config has them; empty: not tracked
    char meant[CHANNEL_COUNT][IGTL_TOOL_SIZE]; // the long name that came for one of 20 bytes
};

// Is the tool that a message names the channel's? A name of 20 bytes in the config stands for the
// first longer one that begins so; one that the protocol cut stands for the config's, if it has one
// such only.
bool tracker_tool_is(struct tracker_tools *tools, enum channel channel, const char *name);

// Zeroed: a connection begins.
struct tracker_heard {
    int64_t begin_ns; // of the connection
    int64_t value_ns; // when a wanted value came last; 0: none yet
    int64_t usual_ns; // between two of them
    int64_t other_ns; // when something else came last; 0: never
    int count;
    char names[HEARD_NAMES_MAX][IGTL_TOOL_SIZE]; // of other tools
    char type[IGTL_TYPE_SIZE];                   // of other messages, the newest
};

void heard_value(struct tracker_heard *heard, int64_t now_ns);

void heard_tool(struct tracker_heard *heard, const char *name, int64_t now_ns);

// A message without any pose.
void heard_message(struct tracker_heard *heard, const char *type, int64_t now_ns);

// Longer than twice the usual time.
bool heard_is_silent(const struct tracker_heard *heard, int64_t now_ns);

// The names, between commas; what cannot be printed is '?'. Empty: none.
void heard_names(const struct tracker_heard *heard, char out[128]);

// RESULT_TIMEOUT and what comes instead; RESULT_OK: nothing does.
enum result heard_tell(const struct tracker_heard *heard, int64_t now_ns, struct error *err);
