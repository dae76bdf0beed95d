#include "step/output.h"

const char *session_state_name(enum session_state state) {
    static const char *const names[SESSION_STATE_COUNT] = {"waiting", "running", "paused",
                                                           "closed"};
    return (unsigned)state < SESSION_STATE_COUNT ? names[state] : "unknown";
}

const char *event_name(int bit) {
    static const char *const names[EVENT_COUNT] = {
        "state", "device_lost", "device_back", "contact", "release", "cut",
        "piece", "refused",     "undone",      "grasped", "dropped", "taken_out"};
    return bit >= 0 && bit < EVENT_COUNT ? names[bit] : "unknown";
}

const char *loose_state_name(enum loose_state state) {
    static const char *const names[LOOSE_STATE_COUNT] = {"lying", "held", "out"};
    return (unsigned)state < LOOSE_STATE_COUNT ? names[state] : "unknown";
}

const char *output_carrier_name(int carrier) {
    if (carrier < BODY_COUNT)
        return body_name((enum body)carrier);
    return channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + carrier - BODY_COUNT));
}
