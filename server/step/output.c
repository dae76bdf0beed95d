#include "step/output.h"

const char *session_state_name(enum session_state state) {
    static const char *const names[SESSION_STATE_COUNT] = {"waiting", "running", "paused",
                                                           "closed"};
    return (unsigned)state < SESSION_STATE_COUNT ? names[state] : "unknown";
}

const char *event_name(int bit) {
    static const char *const names[EVENT_COUNT] = {"state",   "device_lost", "device_back",
                                                   "contact", "release",     "cut",
                                                   "piece",   "refused",     "undone"};
    return bit >= 0 && bit < EVENT_COUNT ? names[bit] : "unknown";
}
