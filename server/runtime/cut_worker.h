// Where tissue is cut: a thread beside each worker runs the jobs of its sessions, one after the
// other, and brings the changed meshes to stations and pages. It has a lower priority than the
// worker.
#pragma once

#include "runtime/mesh_subscribers.h"
#include "runtime/parts.h"

struct cut_worker *cut_worker_create(struct worker *worker);         // starts the thread
struct progress *cut_worker_progress(struct cut_worker *cut_worker); // of its thread
// After the worker's thread: finishes what was asked for.
void cut_worker_stop(struct cut_worker *cut_worker);
void cut_worker_destroy(struct cut_worker **cut_worker); // NULL inside is fine

// ---- the worker's thread; none waits ----

void cut_worker_open(struct cut_worker *cut_worker, int station, struct session_runtime *session);
// The job stays where it is until its result is there.
void cut_worker_run(struct cut_worker *cut_worker, int station, uint64_t session,
                    const struct job *job);
// Keeps the session beside its trace: the image has the worker's part, and the cut worker adds its
// own, as it is behind the jobs given before.
void cut_worker_keep(struct cut_worker *cut_worker, int station, uint64_t session,
                     struct session_image *image);
// The session goes to its owner (NOTICE_ENDED) once its jobs are done.
void cut_worker_close(struct cut_worker *cut_worker, int station, struct session_runtime *session,
                      enum session_end end);
// A job that is done; false where there is none. The result goes back with
// cut_worker_release_result.
bool cut_worker_take(struct cut_worker *cut_worker, int *out_station, uint64_t *out_session,
                     struct job_result **out_result);
void cut_worker_release_result(struct cut_worker *cut_worker, struct job_result *result);

// ---- others ----

// The control thread: a station's MeshAsk or mesh_ack, and that it has gone. There is always room.
void cut_worker_message(struct cut_worker *cut_worker, int station, struct control_peer peer,
                        const arthron_Control *message);
void cut_worker_leave(struct cut_worker *cut_worker, int station);
// The thread of the pages. The request's mailbox is the cut worker's from then on; false: no room,
// and the mailbox is still the caller's.
bool cut_worker_mesh_request(struct cut_worker *cut_worker, const struct mesh_request *request);
// Any thread: adds what waits.
void cut_worker_waiting(const struct cut_worker *cut_worker, size_t *jobs, size_t *mesh_requests);
// The owner of the sessions: NOTICE_OPENED, NOTICE_ENDED; false where there is none.
bool cut_worker_next_notice(struct cut_worker *cut_worker, struct runtime_notice *out_notice);
