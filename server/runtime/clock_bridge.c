#include "runtime/clock_bridge.h"

#include "base/clock.h"

#include <stdlib.h>

#define BACK_NS NS_PER_MS                // frames of one moment are no step
#define OFFSET_AHEAD_NS (50 * NS_PER_MS) // an offset that is measured badly is no step

// The ping has found the step too.
static bool is_measured(const struct clock_bridge *b, int64_t measured_ns) {
    return llabs(measured_ns - b->offset_ns) > llabs(b->bridge_ns) / 2;
}

int64_t clock_bridge_now(const struct clock_bridge *b, int64_t measured_ns) {
    return b->bridge_ns && !is_measured(b, measured_ns) ? measured_ns + b->bridge_ns : measured_ns;
}

int64_t clock_bridge_offset(struct clock_bridge *b, int64_t time_ns, int64_t received_ns,
                            int64_t measured_ns, int64_t *out_step_ns) {
    *out_step_ns = 0;
    if (b->bridge_ns && is_measured(b, measured_ns))
        b->bridge_ns = 0;
    int64_t by_station_ns = time_ns - b->time_ns, by_us_ns = received_ns - b->received_ns;
    int64_t ahead_ns = time_ns + measured_ns + b->bridge_ns - received_ns;
    bool back = by_station_ns < -BACK_NS;
    bool ahead = by_station_ns - by_us_ns > OFFSET_AHEAD_NS && ahead_ns > OFFSET_AHEAD_NS;
    if (b->time_ns && (back || ahead)) {
        *out_step_ns = by_station_ns - by_us_ns;
        b->bridge_ns -= *out_step_ns;
        b->offset_ns = measured_ns;
    }
    b->time_ns = time_ns;
    b->received_ns = received_ns;
    return measured_ns + b->bridge_ns;
}
