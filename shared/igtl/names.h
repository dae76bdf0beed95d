// What a session is called in OpenIGTLink: the same from a station and from a recorded session.
#pragma once

#include "base/marker.h"
#include "igtl/server.h"

// Of STRING messages. No pose and no mesh has such a name, so a client that keeps the newest
// message of each device keeps all of them.
#define IGTL_DEVICE "Arthron" // TDATA, QTDATA, STATUS
#define IGTL_EVENTS "events"  // "contact", "cut", ... or the session's new state
#define IGTL_REMARKS "remarks"
#define IGTL_MARKERS "markers" // igtl_marker_text
#define IGTL_MARKER_SIZE (MARKER_TEXT_MAX + 32)

// A bone: "tibia" of the mock-up, "virtual_tibia" as shown. An instrument's tip: "probe" as
// measured, "probe_warped" as shown. Of a name that is too long the channel's number takes the
// place of the end: "curette-an-09_warped".
void igtl_pose_name(enum channel channel, bool shown, char out_name[IGTL_DEVICE_SIZE]);

// A mesh: its group in the case. Of a name that is too long four hexadecimal digits of its checksum
// take the place of the end, so that no two groups of a case share one: "meniscus_medial-3f07".
void igtl_mesh_name(const char *group, char out_name[IGTL_DEVICE_SIZE]);

// A marker's name and value: "pulse 1".
void igtl_marker_text(const struct marker *marker, char out_text[IGTL_MARKER_SIZE]);

// `state`: "waiting", "running", "paused" or "closed". OK while it runs, else NOT_READY; the text
// is the state.
struct igtl_state igtl_session_state(const char *state, int64_t utc_ns);
