#include "sessions/attempts.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "runtime/attempt_state.h"
#include "runtime/reply.h"
#include "sessions/attempt_rows.h"
#include "store/courses.h"
#include "store/exams.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TAKEN_WAIT_NS (5 * NS_PER_S)

// The runtime gives back the address of the first member.
struct open_attempt {
    struct session_attempt runtime;
    char session[STORE_ID_MAX];
    int64_t start_utc_ns; // of the session
};

static struct open_attempt *attempt_of(const struct trace_attempt *begun, const uint8_t id[16],
                                       int64_t start_utc_ns) {
    struct open_attempt *a = alloc(1, sizeof *a);
    a->runtime = (struct session_attempt){
        .purpose = begun->purpose,
        .hand = begun->hand,
        .mark_version = (int)begun->mark_version,
        .pass_time_s = begun->pass_time_s,
        .pass_errors = (int)begun->pass_errors,
        .number = begun->number,
    };
    a->start_utc_ns = start_utc_ns;
    for (int i = 0; i < 16; i++)
        snprintf(a->session + 2 * i, 3, "%02x", id[i]);
    return a;
}

void attempts_free(struct session_attempt **attempt) {
    struct open_attempt *a = (struct open_attempt *)*attempt;
    *attempt = NULL;
    if (!a)
        return;
    shared_site_release(&a->runtime.site);
    free(a);
}

// ---- begin --------------------------------------------------------------------------------------

// Who trains may begin and leave practice.
static bool is_allowed(const struct sessions *s, int station, const arthron_Command *command,
                       enum attempt_purpose purpose, arthron_CommandReply *reply) {
    return !command->trainee[0] || purpose == ATTEMPT_PRACTICE ||
           reply_refuse(reply, "station %s: an exam is for instructors", station_name(s, station));
}

static bool is_running(struct sessions *s, int station, struct live_attempt *out) {
    runtime_shown_attempt(s->runtime, station, out);
    return out->state.number && out->state.end == arthron_AttemptState_End_RUNS;
}

static bool is_exam_running(struct sessions *s, int station, struct live_attempt *out) {
    return is_running(s, station, out) && out->state.purpose == arthron_AttemptState_Purpose_EXAM;
}

bool attempts_exam_runs(struct sessions *s, int station) {
    struct live_attempt shown;
    return is_exam_running(s, station, &shown);
}

static bool take_site(struct sessions *s, const struct station_status *status, int station,
                      const struct task_file *file, struct session_attempt *attempt,
                      arthron_CommandReply *reply) {
    struct error err;
    return shared_site_take(s->sites, file, s->scenes[status->about.scene],
                            &status->about.instruments, &s->config.stations[station].optic,
                            &attempt->site, &err) == RESULT_OK ||
           reply_refuse(reply, "station %s: %s", station_name(s, station), err.text);
}

static enum result read_mark(struct store *store, const struct task *task,
                             struct trace_attempt *begun, struct error *err) {
    struct pass_mark mark;
    enum result result = store_task_mark(store, task->name, task->version, &mark, err);
    if (result != RESULT_OK)
        return result == RESULT_MISSING ? RESULT_OK : result;
    if (!(mark.time_s >= 1 && mark.time_s <= MARK_TIME_MAX_S) || mark.errors < 0 ||
        mark.errors > MARK_ERRORS_MAX)
        return fail(err, RESULT_INVALID, "task %s: version %d of its pass mark is out of range",
                    task->name, mark.version);
    begun->mark_version = (uint32_t)mark.version;
    begun->pass_time_s = mark.time_s;
    begun->pass_errors = (uint32_t)mark.errors;
    return RESULT_OK;
}

static enum result find_place(const struct sessions *s, const struct station_status *status,
                              struct store *store, const char *task, enum attempt_hand hand,
                              int64_t *out_exam, struct error *err) {
    int scene = status->about.scene;
    struct exam_place place = {.trainee = status->about.trainee,
                               .task = task,
                               .knee_case = s->config.cases[scene].name,
                               .case_hash = scene_case(s->scenes[scene])->hash,
                               .hand = attempt_hand_name(hand)};
    return store_find_exam_place(store, &place, out_exam, err);
}

// The mark in force; where the records have none, the task file's. Practice goes on where they
// cannot be read; an exam has no place then.
static bool look_up(const struct sessions *s, int station, const struct station_status *status,
                    const struct task *task, struct trace_attempt *begun,
                    arthron_CommandReply *reply) {
    struct store *store = NULL;
    struct error err;
    int64_t exam;
    bool is_exam = begun->purpose == ATTEMPT_EXAM;
    if (!s->recorder)
        return !is_exam || reply_refuse(reply, "station %s: this server has no records for an exam",
                                        station_name(s, station));
    enum result result = store_open(s->config.records, STORE_THERE, "server", &store, &err);
    if (result == RESULT_OK)
        result = read_mark(store, task, begun, &err);
    if (result == RESULT_OK && is_exam)
        result = find_place(s, status, store, task->name, begun->hand, &exam, &err);
    store_close(&store);
    if (result == RESULT_OK)
        return true;
    if (is_exam)
        return reply_refuse(reply, "station %s: %s", station_name(s, station), err.text);
    log_warning("sessions", "task %s: its own pass mark counts: %s", task->name, err.text);
    return true;
}

// From here on the attempt is the worker's.
static bool give_attempt(struct sessions *s, int station, struct session_attempt *attempt,
                 arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    uint64_t ticket = station_slot_new_ticket(slot);
    bool done;
    if (!runtime_attempt(s->runtime, station, attempt, ticket)) {
        attempts_free(&attempt);
        return reply_refuse(reply, "station %s: its worker is too busy", station_name(s, station));
    }
    if (!station_slot_wait_taken(slot, ticket, clock_now_ns() + TAKEN_WAIT_NS, &done))
        return reply_refuse(reply, "station %s: its worker is too busy", station_name(s, station));
    return done ? (reply->ok = true)
                : reply_refuse(reply,
                               "station %s: no attempt can begin in this session: it has ended, an "
                               "attempt runs, or its trace takes none",
                               station_name(s, station));
}

bool attempts_begin_command(struct sessions *s, int station, const arthron_Command *command,
                            arthron_CommandReply *reply) {
    struct station_status status;
    struct live_attempt shown;
    station_slot_status(&s->slots[station], &status);
    const struct task_file *file = library_find(s->tasks, command->task);
    if ((unsigned)command->purpose >= ATTEMPT_PURPOSE_COUNT ||
        (unsigned)command->hand >= ATTEMPT_HAND_COUNT)
        return reply_refuse(reply, "an attempt is practice or exam, with the right or left hand");
    if (!file)
        return reply_refuse(reply, "there is no task %s", command->task);
    if (!is_allowed(s, station, command, (enum attempt_purpose)command->purpose, reply))
        return false;
    if (is_running(s, station, &shown) && shown.session == status.about.serial)
        return reply_refuse(reply, "station %s: an attempt runs: %s", station_name(s, station),
                            shown.state.task);
    struct trace_attempt begun = {.purpose = (enum attempt_purpose)command->purpose,
                                  .hand = (enum attempt_hand)command->hand,
                                  .pass_time_s = file->task.pass_time_s,
                                  .pass_errors = (uint32_t)file->task.pass_errors};
    if (!look_up(s, station, &status, &file->task, &begun, reply))
        return false;
    struct open_attempt *open = attempt_of(&begun, status.about.id, status.about.start_utc_ns);
    struct session_attempt *attempt = &open->runtime;
    attempt->session = status.about.serial;
    if (take_site(s, &status, station, file, attempt, reply))
        return give_attempt(s, station, attempt, reply);
    attempts_free(&attempt);
    return false;
}

static bool leave(struct sessions *s, int station, bool by_trainee, bool *out_done) {
    struct station_slot *slot = &s->slots[station];
    uint64_t ticket = station_slot_new_ticket(slot);
    return runtime_leave_attempt(s->runtime, station, by_trainee, ticket) &&
           station_slot_wait_taken(slot, ticket, clock_now_ns() + TAKEN_WAIT_NS, out_done);
}

void attempts_leave_own(struct sessions *s, int station) {
    struct live_attempt shown;
    bool done;
    if (is_running(s, station, &shown) &&
        shown.state.purpose == arthron_AttemptState_Purpose_PRACTICE)
        leave(s, station, true, &done);
}

bool attempts_leave_command(struct sessions *s, int station, const arthron_Command *command,
                            arthron_CommandReply *reply) {
    struct station_status status;
    struct live_attempt shown;
    bool done;
    station_slot_status(&s->slots[station], &status);
    bool runs = is_running(s, station, &shown);
    if (!is_allowed(s, station, command, (enum attempt_purpose)shown.state.purpose, reply))
        return false;
    if (!runs || shown.session != status.about.serial)
        return reply_refuse(reply, "station %s: no attempt runs", station_name(s, station));
    if (!leave(s, station, command->trainee[0], &done))
        return reply_refuse(reply, "station %s: its worker is too busy", station_name(s, station));
    return done ? (reply->ok = true)
                : reply_refuse(reply,
                               "station %s: the attempt has ended, or its trace has no room now",
                               station_name(s, station));
}

// ---- intervene ----------------------------------------------------------------------------------

// An exam that was taken away meanwhile has nothing to be flagged.
static enum result flag_exam(struct sessions *s, int station, const arthron_AttemptState *attempt,
                             const char *reason, struct error *err) {
    struct station_status status;
    struct store *store = NULL;
    int64_t exam;
    station_slot_status(&s->slots[station], &status);
    enum result result = store_open(s->config.records, STORE_THERE, "server", &store, err);
    if (result != RESULT_OK)
        return result;
    result =
        find_place(s, &status, store, attempt->task, (enum attempt_hand)attempt->hand, &exam, err);
    if (result == RESULT_OK)
        result = store_add_intervention(store, exam, reason, err);
    store_close(&store);
    return result == RESULT_MISSING ? RESULT_OK : result;
}

bool attempts_intervene(struct sessions *s, int station, const char *reason,
                        arthron_CommandReply *reply) {
    struct live_attempt shown;
    struct error err;
    if (!is_exam_running(s, station, &shown))
        return true;
    if (strlen(reason) < EXAM_REASON_MIN)
        return reply_refuse_as(reply, arthron_Why_Code_EXAM_REASON, NULL,
                               "station %s: an exam runs: give a reason", station_name(s, station));
    return flag_exam(s, station, &shown.state, reason, &err) == RESULT_OK ||
           reply_refuse(reply, "station %s: %s", station_name(s, station), err.text);
}

// ---- from its trace -----------------------------------------------------------------------------

enum result attempts_restore(const struct sessions *s, int scene, const struct trace_header *header,
                             const struct trace_attempt *begun, int64_t at_ns,
                             struct session_attempt **out_attempt, struct error *err) {
    struct task_file file = {.size = begun->size};
    char name[TASK_NAME_MAX + 8];
    snprintf(name, sizeof name, "%s.ini", begun->task);
    memcpy(file.text, begun->text, begun->size);
    enum result result = task_parse(name, begun->text, begun->size, &file.task, err);
    if (result != RESULT_OK)
        return fail_in(err, RESULT_REFUSED, "attempt %u: ", begun->number);
    struct open_attempt *a = attempt_of(begun, header->session_id, header->start_utc_ns);
    struct session_attempt *attempt = &a->runtime;
    attempt->begun_ns = at_ns - header->start_ns;
    attempt_init(&attempt->attempt);
    result = shared_site_take(s->sites, &file, s->scenes[scene], &header->settings.instruments,
                              &header->optic, &attempt->site, err);
    if (result == RESULT_OK) {
        *out_attempt = attempt;
        return RESULT_OK;
    }
    attempts_free(&attempt);
    return fail_in(err, RESULT_REFUSED, "attempt %u: ", begun->number);
}

// ---- its end ------------------------------------------------------------------------------------

static void log_attempt_end(const struct sessions *s, int station,
                            const struct session_attempt *a) {
    struct trace_outcome outcome;
    attempt_outcome(a, &outcome);
    log_info("sessions", "station %s: attempt %u at %s: %s, %s after %.1f s, %u errors",
             station_name(s, station), a->number, shared_site_file(a->site)->task.name,
             verdict_name(outcome.verdict), attempt_end_name(outcome.end),
             attempt_time_s(&a->attempt), outcome.errors);
}

static void put_row(struct sessions *s, const struct open_attempt *open) {
    struct attempt_row *row = alloc(1, sizeof *row);
    attempt_row_of(&open->runtime, open->session, open->start_utc_ns, row);
    recorder_attempt(s->recorder, row);
    free(row);
}

void attempts_release(struct sessions *s, int station, struct session_attempt *attempt) {
    if (attempt->number) {
        log_attempt_end(s, station, attempt);
        put_row(s, (const struct open_attempt *)attempt);
    }
    attempts_free(&attempt);
}
