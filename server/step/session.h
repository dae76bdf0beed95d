// A session of one trainee on one case: it turns samples into warped poses.
//
// A step is a function of the session and its input: no clock, no file, no socket, no thread, no
// allocation. The same inputs give the same bytes, which is what a trace replays.
#pragma once

#include "step/input.h"
#include "step/operation.h"
#include "step/output.h"
#include "step/scene.h"
#include "step/settings.h"

struct session;

// The caller runs the job of an output (operation_run) beside the steps and gives its result to the
// session with INPUT_JOB, or the id alone where the result is lost. The scene must outlive the
// session.
struct session *session_create(const struct scene *scene, const struct session_settings *settings);
void session_destroy(struct session **session);

// Whether a reset would change anything: a tissue was cut, or a loose body has moved.
bool session_is_changed(const struct session *session);

// Whether another step without an input would change nothing but its time.
bool session_rests(const struct session *session);

// Memory for what the result changes, which its step else would have to allocate. For the thread
// that ran the job, before the result lands.
void session_make_room(struct session *session, const struct job_result *result);

// Keeps a session behind a step, or reads one into a new one of the same scene and settings, which
// then goes on with the same bits. asked: the job of that step's output; who reads runs it.
// operation: read before, as it was before that job; who writes gives NULL.
//
// session_can_be_kept: not while tissues wait to be made whole, once a result was lost, by older
// rules than RULES_NEWEST, or while so much is eased in that it would take long. Where what is read
// is bad, the session can only be destroyed. Writing copies SESSION_KEPT_MAX bytes at most.
#define SESSION_KEPT_MAX ((size_t)1 << 19)
bool session_can_be_kept(const struct session *session, const struct job *asked);
void session_keep(struct session *session, struct job *asked, const struct operation *operation,
                  struct kept *kept);
uint64_t session_hash(const struct session *session); // of its last step's output

// Goes on with a session that was kept elsewhere and lacks the poses since: what waits to be cut is
// dropped, and until session_go_on it asks for no job. Jobs that it asked for elsewhere are given
// to it, each before the step at which it lands.
//
// session_take_job: false where the session cannot have asked for it: another one is on its way, or
// it names what there is not. The one that it asked for before it was kept is none of another.
// session_void_job: a reset came before the job landed, whose tissue this is.
void session_take_over(struct session *session);
bool session_take_job(struct session *session, const struct job *job);
void session_void_job(struct session *session, int tissue);
void session_go_on(struct session *session);

// Frame numbers must rise: dropping older ones is the caller's work (the runtime counts them).
void session_step(struct session *session, const struct session_input *input,
                  struct session_output *out);
