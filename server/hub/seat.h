// What the files of this room share: seats, live sessions, and the notes between threads.
#pragma once

#include "base/newest.h"
#include "base/ring.h"
#include "hub/calibration.h"
#include "hub/devices.h"
#include "hub/hub.h"
#include "hub/moment.h"
#include "hub/onlookers.h"
#include "records/claim.h"
#include "records/recorder.h"
#include "hub/remarks.h"
#include "metrics/metrics.h"
#include "net/console.h"
#include "net/control.h"
#include "net/datagram.h"
#include "net/signer.h"
#include "trace/trace.h"

#include <pthread.h>
#include <stdatomic.h>

// What a session is worth so far, and which it is.
struct tally {
    uint8_t session_id[16];
    const struct scene *scene;
    struct metrics metrics;
};

// What stays the same in a session, for those who look on.
struct about {
    uint64_t session; // struct live's serial; 0: there was none yet
    uint8_t id[16];
    char trainee[HUB_NAME_MAX];
    int scene; // index into hub.scenes
    int64_t start_utc_ns;
    int64_t start_ns; // on its own clock
    double strength;  // of its warp
};

// A session with its trace. The desk makes and releases it; in between session and trace are one
// worker's alone, the operation its theatre's.
struct live {
    uint64_t serial; // no two are equal
    struct session *session;
    struct trace_writer *trace;
    struct operation *operation;
    const struct scene *scene;
    struct store_session row; // the desk's
    struct tally tally;       // the worker's
    struct moments moments;   // too
    // Of a session that is resumed: where it was, how far its clock is ahead of the server's (which
    // began anew), and what was cut and has not landed yet, or NULL.
    enum session_state state;
    int64_t last_ns, ahead_ns;
    struct job_result *pending;
};

// What any thread may know of a seat, under hub.card_lock, which is held for copies only.
struct card {
    // Written by the control thread alone:
    bool connected;
    struct control_peer peer;
    uint64_t connection; // Hello.connection: tells a reconnect from a rival
    bool calibrated;
    arthron_Calibration calibration; // as Hello told it
    uint8_t session_id[16];          // of the session, or of the one to come where it is fresh
    bool id_is_fresh;
    bool stopped;               // by command: no session until start, case or the next connection
    int64_t retry_ns;           // not before this time: the last attempt to open one failed
    int scene;                  // index into hub.scenes
    double strength;            // of the warp of the sessions to come; NaN: the config's
    char trainee[HUB_NAME_MAX]; // of the sessions to come
    struct tissue_figures tissues[TISSUES_MAX]; // of the session, as its last jobs left them
    uint64_t mesh_hashes[TISSUES_MAX];          // as its stations follow them
    uint64_t figures_of;                        // the session that both are of
    arthron_Undone undone;                      // by the last undo
    uint64_t undo_of;                           // the session that was asked for it
    bool undo_awaited;                          // who asked for it has not been told yet
    struct about about;                         // of the last session
    int device_count;
    arthron_Device devices[WIRE_DEVICES_MAX]; // as Hello told them
    int64_t start_utc_ns;
    char trace[HUB_PATH_MAX];
};

// Numbers that the seat's worker (steps, frames) and the control thread (times) publish.
struct seat_counts {
    atomic_uint_fast64_t steps;
    atomic_uint_fast64_t frames_lost;  // numbers that never came
    atomic_uint_fast64_t frames_old;   // older than one that came before: dropped
    atomic_uint_fast64_t frames_early; // before the clock offset or the session was known: dropped
    atomic_uint_fast64_t frames_invalid; // values out of range: dropped
    atomic_uint_fast64_t inputs;         // of the desk that are taken
    atomic_int state; // enum session_state; from the wish for a session until its end not closed
    atomic_int_fast64_t rtt_ns, clock_uncertainty_ns;
    atomic_uint_fast64_t touches;       // of this session
    atomic_int_fast64_t drift_nm;       // of the instrument that is farthest off
    atomic_uint_fast64_t trace_missing; // as of trace_status
    atomic_bool trace_failing;
    struct device_counts devices[WIRE_DEVICES_MAX];
    atomic_int_fast64_t warp_nm; // at any tip, the largest since it was last taken
    atomic_int undo; // enum job_outcome of the last one, from its theatre; UNDO_ASKED until then
};

#define UNDO_ASKED (-1)

// A configured station: its card for all, the rest for its worker alone.
struct seat {
    const struct hub_station *station;
    struct card card;
    struct seat_counts counts;
    struct newest *moment_news; // of struct moment, from the worker
    struct moment moment;       // the last one taken, under hub.card_lock
    struct remarks remarks;     // of the last session, under hub.card_lock
    struct newest *tallies;     // of struct tally, the same way
    struct tally tally;
    uint64_t inputs_told; // by the desk, with desk_lock

    struct live *live; // NULL: no session
    bool connected;
    struct control_peer peer;
    uint32_t udp_connection;
    bool clock_known;
    int64_t clock_offset_ns; // server = station + offset
    uint64_t last_frame;
    arthron_Reply reply; // to last_frame
    uint32_t events;     // of all steps since
    int64_t last_step_ns, last_frame_ns;
    int64_t tally_ns; // of the session's clock, when it was last left
    struct device_watch device_watch;
    struct drift drift[INSTRUMENT_COUNT];
    bool drift_warned; // the clerk's
    bool trace_warned; // too
};

// To a worker.
enum note_kind {
    NOTE_JOINED,
    NOTE_GONE,
    NOTE_CLOCK,
    NOTE_FRAME,
    NOTE_CONFIRM,
    NOTE_ATTACH,
    NOTE_INPUT,
    NOTE_REMARK
};

struct note {
    enum note_kind kind;
    int seat;
    struct control_peer peer;
    union {
        int64_t clock_offset_ns; // NOTE_CLOCK
        uint64_t challenge;      // NOTE_CONFIRM
        struct live *live;       // NOTE_ATTACH
        enum input_kind input;   // NOTE_INPUT
        struct {                 // NOTE_REMARK
            uint64_t session;
            struct remark remark;
        };
        struct { // NOTE_FRAME: times on the station's clock
            int64_t received_ns;
            struct frame frame;
        };
    };
};

// From a theatre to the desk: a session that has ended.
struct retired {
    int seat;
    bool deserted; // its station stayed away for too long
    struct live *live;
};

// What a worker's socket did not take, for whoever asks.
struct worker_counts {
    atomic_uint_fast64_t strangers, forged, replayed, malformed, too_long;
};

struct theatre;

struct worker {
    struct hub *hub;
    int index;
    pthread_t thread;
    struct theatre *theatre;
    struct datagram_endpoint *endpoint;
    int wake_fd;
    struct ring *from_control; // of struct note
    struct ring *from_desk;    // of struct note
    struct worker_counts counts;
};

struct hub {
    struct hub_config config;
    struct scene *scenes[HUB_CASES_MAX];
    struct grades *grades;
    struct seat seats[HUB_STATIONS_MAX];
    struct worker *workers;
    int worker_count;
    atomic_bool workers_stop;
    struct control *control;
    struct console *console;
    struct signer *signer;
    struct resumed *resumed;     // while the server starts
    struct trace_signer vouches; // with it
    struct recorder *recorder;   // NULL: no records
    struct claim *claim;         // of the records and the traces

    pthread_mutex_t card_lock;
    pthread_mutex_t desk_lock;  // one at a time opens, closes or commands sessions; may take long
    uint64_t sessions_made;     // with desk_lock
    pthread_rwlock_t bell_lock; // of both: whom pages are told by that there may be something
    void (*bell)(void *user);
    void *bell_user;
    pthread_t clerk;
    pthread_cond_t clerk_wake; // with card_lock
    bool clerk_runs, clerk_stop;
    atomic_bool ending; // hub_break_off was called
};

static inline bool seat_has_session(const struct seat *seat) {
    return atomic_load(&seat->counts.state) != SESSION_CLOSED;
}

static inline struct worker *seat_worker(struct hub *hub, int seat) {
    return &hub->workers[seat % hub->worker_count];
}

// hub.c: an index, -1 where there is none of that name
int hub_find_case(const struct hub_config *config, const char *name);
int hub_find_station(const struct hub_config *config, const char *name);

// seat.c: any thread but the worker's; card_lock not held

// The newest moment of the seat's last session; step 0: there was none yet.
void seat_moment(struct hub *hub, int seat, struct moment *out_moment);
// What is told of the seat in a list.
void seat_info(struct hub *hub, int seat, arthron_SessionInfo *out_info);
// A session begins, or goes on, and what was said in it is taken over; said: or NULL.
void seat_introduce(struct hub *hub, int seat, const struct live *live,
                    const struct trace_header *header, struct remarks *said);

// Rings the bell of the pages (audience.h); from any thread, never waits. hub: struct hub
void hub_ring(void *hub);

// worker.c
enum result worker_start(struct hub *hub, int index, struct error *err);
void worker_stop(struct worker *worker);    // ends its sessions, joins, closes the socket
void worker_release(struct worker *worker); // its rings, once no other thread uses them
// Pushes a note and wakes the worker; false where the ring is full.
bool worker_tell(struct worker *worker, struct ring *ring, const struct note *note);

// theatre.c: beside each worker, the thread that runs the jobs of its sessions and brings their
// meshes to the stations, whenever nothing else wants the processor.
void theatre_start(struct worker *worker);
void theatre_stop(struct worker *worker); // after the worker's thread: finishes what was asked for
void theatre_release(struct worker *worker); // its rings, once no other thread uses them

// The worker's thread. None waits.
void theatre_open(struct theatre *theatre, int seat, struct live *live);
void theatre_run(struct theatre *theatre, int seat, const struct live *live, const struct job *job);
void theatre_landed(struct theatre *theatre, int seat, uint64_t serial, struct job_result *result);
void theatre_close(struct theatre *theatre, int seat, struct live *live, bool deserted);
// False where there is none. The result goes back with theatre_landed.
bool theatre_take(struct theatre *theatre, int *out_seat, uint64_t *out_serial,
                  struct job_result **out_result);

// The control thread: a station's MeshAsk or mesh_ack, or NULL where it is gone.
void theatre_tell(struct theatre *theatre, int seat, struct control_peer peer,
                  const arthron_Control *message);

// The thread of the pages (audience.h). The look's tray is the theatre's from then on; false: it is
// too busy, and the tray still the caller's.
bool theatre_look(struct theatre *theatre, const struct look *look);

// The desk.
bool theatre_retired(struct theatre *theatre, struct retired *out_retired);

// desk.c
void desk_start(struct hub *hub);
void desk_stop(struct hub *hub);    // before the workers
void desk_release(struct hub *hub); // after the workers: what they retired
void desk_new_id(uint8_t out_id[16]);
// Of a session on the card's case that begins now.
void desk_header(const struct hub *hub, const struct seat *seat, const struct card *card,
                 struct trace_header *out);
enum result desk_trace_path(const struct hub *hub, const struct seat *seat,
                            const struct trace_header *header, char *out_path, struct error *err);
void desk_call(struct hub *hub);            // card_lock held: someone may need a session
void desk_clear_figures(struct card *card); // card_lock held
// The rest with desk_lock held. From here on nothing is half open: a session that is not closed has
// a worker.
void desk_put_in_order(struct hub *hub);
// The seat has no session: makes one on the card's case for the worker.
enum result desk_open(struct hub *hub, int seat, struct error *err);
// A session and its trace are there: into the card, the records and the log; and to the worker.
void desk_announce(struct hub *hub, int seat, struct live *live, const struct trace_header *header,
                   const char *trace);
void desk_attach(struct hub *hub, int seat, struct live *live);

// listing.c
void listing_all(struct hub *hub, arthron_CommandReply *reply);
void listing_seat(struct hub *hub, int seat, arthron_CommandReply *reply);

// steer.c
// actor: who asks for it, as the records are to call them.
void desk_command(void *hub, const char *actor, const arthron_Command *command,
                  arthron_CommandReply *out_reply);

// tally.c
void tally_begin(const struct trace_header *header, const struct scene *scene,
                 struct tally *out_tally);
// The worker, after a step.
void tally_step(struct seat *seat, const struct session_input *input,
                const struct session_output *output);
// Of the session that the station has, or had last. False where there is no such station.
bool desk_metrics(void *hub, const char *station, arthron_Metrics *out_metrics);

// deeds.c
void deed_of_server(struct hub *hub, const struct seat *seat, const char *action,
                    const uint8_t session_id[16]);
// info: as the command left the session.
void deed_of_command(struct hub *hub, const char *actor, const char *action,
                     const arthron_Command *command, const arthron_SessionInfo *info);

// resume.c: while the server starts, one after the other
void resume_replay(struct hub *hub);  // before the doors are open: runs open sessions again
void resume_attach(struct hub *hub);  // then they go on, in their traces, and others get their end
void resume_record(struct hub *hub);  // and into the records
void resume_release(struct hub *hub); // where the server does not come so far

// door.c: what the control thread calls
struct control_handler door_handler(struct hub *hub);
