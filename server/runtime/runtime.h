// Runs sessions on worker threads: frames in, steps, replies out, cuts beside the steps.
//
// Threads: a worker for each core (datagrams, steps, replies) and a cut worker beside it (cuts, and
// the meshes that they change). A station belongs to one worker, so workers share nothing. A worker
// waits for no other thread. Other threads leave frames, requests and the newest state of a
// connection for it, and it leaves notices for the owner of the sessions.
#pragma once

#include "net/control.h"
#include "runtime/mesh_subscribers.h"
#include "runtime/types.h"

struct runtime;

// Opens the datagram sockets and starts the threads. The stations of the config must outlive
// the runtime. RESULT_IO names address and port.
enum result runtime_create(const struct runtime_config *config, struct runtime **out_runtime,
                           struct error *err);

// Ends every session, or with `hand_over` gives it back open. Tells the stations, and joins all
// threads. Until runtime_destroy the caller can take the last notices. `runtime` may be NULL.
void runtime_stop(struct runtime *runtime, bool hand_over);
void runtime_destroy(struct runtime **runtime); // NULL inside is fine

// ---- a station's connection: the control thread ----

// confirms_in_replies: it has the capability "path".
void runtime_join(struct runtime *runtime, int station, struct control_peer peer,
                  bool confirms_in_replies);
void runtime_leave(struct runtime *runtime, int station);
void runtime_set_clock(struct runtime *runtime, int station, int64_t offset_ns);
void runtime_confirm_path(struct runtime *runtime, int station, uint64_t challenge);
// A frame that came over TCP. At most RUNTIME_FRAMES_MAX frames of a station wait for its worker;
// further ones are counted and dropped.
#define RUNTIME_FRAMES_MAX 16
void runtime_frame(struct runtime *runtime, int station, const struct frame *frame,
                   int64_t received_ns);
// A marker, on the station's clock. The worker acknowledges it once it is on disk. One that finds
// RUNTIME_MARKERS_MAX others waiting is dropped, so a station has fewer on their way.
#define RUNTIME_MARKERS_MAX 64
void runtime_marker(struct runtime *runtime, int station, const struct marker *marker);
// A MeshAsk or mesh_ack.
void runtime_mesh_message(struct runtime *runtime, int station, struct control_peer peer,
                          const arthron_Control *message);

// ---- its session: any thread but a worker's ----

// The station must have no session. The runtime owns it until NOTICE_ENDED.
void runtime_attach(struct runtime *runtime, int station, struct session_runtime *session);
// Keeps the state of the station's session as soon as a step lets it. False as below.
bool runtime_keep(struct runtime *runtime, int station);
// Gives the station's session back open (NOTICE_ENDED, END_HANDED_OVER), with a cut that is on its
// way not landed. Nothing happens if it has none. False if the worker has too much to do.
bool runtime_hand_over(struct runtime *runtime, int station);
// NOTICE_TAKEN with the ticket answers these two, and NOTICE_UNDONE with the same an INPUT_UNDO
// that was taken. None is taken while another is on its way. False if the worker has too much to
// do.
bool runtime_input(struct runtime *runtime, int station, enum input_kind kind, uint64_t ticket);
// session: serial of the session.
bool runtime_remark(struct runtime *runtime, int station, uint64_t session,
                    const struct remark *remark, uint64_t ticket);
// NOTICE_TAKEN with the ticket answers these two, too. The attempt is the worker's from here on,
// unless the worker has too much to do (false). One that was not taken comes back as
// NOTICE_ATTEMPT.
bool runtime_attempt(struct runtime *runtime, int station, struct session_attempt *attempt,
                     uint64_t ticket);
bool runtime_leave_attempt(struct runtime *runtime, int station, bool by_trainee, uint64_t ticket);
// Subscribes a page, or passes its message on. On success it takes over the request's mailbox.
bool runtime_mesh_request(struct runtime *runtime, const struct mesh_request *request);

// Only for the owner's thread. False: no notice is left.
bool runtime_next_notice(struct runtime *runtime, struct runtime_notice *out_notice);
// Only for the owner's thread: the next marker that was recorded, with the serial of its session.
// The worker takes no more of the station's markers while RUNTIME_MARKERS_MAX wait here.
bool runtime_next_marker(struct runtime *runtime, int station, struct session_marker *out_marker);

// ---- its state and figures: any thread but a worker's ----

// The last step of the station's last session; step 0: there was none yet.
void runtime_snapshot(struct runtime *runtime, int station, struct step_snapshot *out_snapshot);
void runtime_metrics(struct runtime *runtime, int station, struct live_metrics *out_metrics);
void runtime_shown_attempt(struct runtime *runtime, int station, struct live_attempt *out_attempt);
void runtime_tissues(struct runtime *runtime, int station, struct tissue_report *out_report);
const struct station_counts *runtime_counts(const struct runtime *runtime, int station);
// The station does this too often, and it was held back.
void runtime_slowed(struct runtime *runtime, int station, enum slowed what);
void runtime_count_invalid_frame(struct runtime *runtime, int station);
double runtime_take_warp_mm(struct runtime *runtime, int station);
// The longest time without a frame since the last call, up to now.
int64_t runtime_take_pause_ns(struct runtime *runtime, int station, int64_t now_ns);
struct socket_counts runtime_socket_counts(const struct runtime *runtime);
void runtime_figures(const struct runtime *runtime, struct runtime_figures *out_figures);
// When the watchdog last found that no worker hangs; monotonic.
int64_t runtime_looked_ns(const struct runtime *runtime);
