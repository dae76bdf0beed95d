#include "step/input.h"

const char *input_kind_name(enum input_kind kind) {
    static const char *const names[INPUT_KIND_COUNT] = {"frame", "empty", "start", "pause",
                                                        "stop",  "reset", "job",   "undo"};
    return (unsigned)kind < INPUT_KIND_COUNT ? names[kind] : "unknown";
}

bool input_is_command(enum input_kind kind) {
    return kind >= INPUT_START && (unsigned)kind < INPUT_KIND_COUNT && kind != INPUT_JOB;
}
