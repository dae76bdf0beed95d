// A station's clock that is stepped while frames come. The control connection measures the new
// offset with its next ping; until then the frames themselves tell it: of two frames in order the
// later one was closed later, and none comes before it was closed. Plain state of one connection.
#pragma once

#include <stdbool.h>
#include <stdint.h>

struct clock_bridge {
    int64_t bridge_ns;            // on top of the measured offset
    int64_t offset_ns;            // that was measured when the bridge was made
    int64_t time_ns, received_ns; // of the newest frame; time_ns 0: none yet
};

// Returns the offset of the newest frame's clock (server = station + offset). *out_step_ns: by how
// much the clock has just been stepped; 0: it was not.
int64_t clock_bridge_offset(struct clock_bridge *bridge, int64_t time_ns, int64_t received_ns,
                            int64_t measured_ns, int64_t *out_step_ns);

// The offset as the frames so far tell it.
int64_t clock_bridge_now(const struct clock_bridge *bridge, int64_t measured_ns);
