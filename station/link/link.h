// A station's connection to its server: control connection, sealed datagrams where they pass,
// frames in the control connection where they do not, and back again; the offset between the two
// clocks; another server where one is lost or names it; reconnecting with back-off. A thread of its
// own serves the control connection.
#pragma once

#include "link/certificate.h"
#include "link/config.h"
#include "link/enrol.h"
#include "link/marker_queue.h"
#include "link/meshes.h"
#include "wire/tissue.h"
#include "wire/wire.h"

enum link_path { LINK_DOWN, LINK_CONTROL, LINK_DATAGRAM };

struct link_status {
    enum link_path path;
    bool welcomed;
    bool clock_known;
    int64_t clock_offset_ns, clock_uncertainty_ns; // server = station + offset
    int64_t round_trip_ns;                         // of the shortest of the last pings
    int hold_ms;         // how long the server holds a silent channel; 0: not told
    int64_t utc_ahead_s; // the server's time of day less ours, when it said Welcome
    bool utc_known;
    uint64_t connects; // successful ones, 1 after the first
    uint64_t frames_sent;
    uint64_t replies; // to frames of ours, each counted once
    uint64_t unknown_messages;
    int64_t server_until_utc_s;   // when the server's certificate ends; 0: none was good yet
    struct server_address server; // that serves the station, or is tried
    char session_case[64];
    arthron_SessionState state;
    char refusal[256]; // what the server last said, empty: nothing
    arthron_Refusal_Reason refusal_reason;
    char problem[256]; // why there is no connection, in a sentence; empty: nothing is known of one
    bool clock_is_wrong; // that is: by our clock the server's certificate is not valid now
};

// The session as the server last told it.
struct link_session {
    uint64_t connection; // as link_status.connects
    struct server_address server;
    arthron_SessionState state;
    char case_name[64];
    uint64_t case_hash;
    bool has_knee; // false: there is no session
    struct knee_frame knee;
};

struct link;

// Starts connecting in the background. The station's certificate is renewed in time (but on a
// visit), and other files in keys_dir are taken with the next connection, which is made anew as
// soon as no session runs. RESULT_MISSING names a key file that is not there.
enum result link_create(const struct link_config *config, struct link **out_link,
                        struct error *err);
void link_destroy(struct link **link);

// One frame, numbered by the caller; from one thread only. False where it could not be sent at once
// (no connection, clock unknown, session not open, path full): the frame is dropped, not queued,
// and its number may be used again. True: it left on one way at least.
bool link_send(struct link *link, const struct frame *frame);

// A marker, on our clock; from one thread only. Its run and number are set here. It waits until the
// server has it for good, also while there is no connection. False: it is lost, because
// MARKERS_QUEUED others wait or the server is too old to take markers.
bool link_mark(struct link *link, const struct marker *marker);

// Waits until `until_ns` (monotonic) or the next reply. True with a reply; the same thread as
// link_send.
bool link_wait(struct link *link, int64_t until_ns, arthron_Reply *out_reply);

void link_get_status(struct link *link, struct link_status *out_status);

// True where the server told of the session since the call that left its number in *seen (0 at
// first). Takes no lock where it did not.
bool link_get_session(struct link *link, uint64_t *seen, struct link_session *out_session);

// The same for the attempt at a task. Number 0: the session had none yet.
bool link_get_attempt(struct link *link, uint64_t *seen, arthron_AttemptState *out_attempt);

// How many there are; their order does not change while the case stays.
int link_get_tissues(struct link *link, struct link_tissue out_tissues[WIRE_MESH_GROUPS_MAX]);

// The mesh as it is now, which the caller releases. False where none of that name is followed.
bool link_copy_tissue(struct link *link, const char *group, struct tissue *out_tissue);
