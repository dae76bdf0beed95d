// The desk opens, closes and commands sessions. It may take its time (files are made and loaded
// here), so workers and the control thread only leave word: a flag for the clerk, a ring of
// sessions that have ended.
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "hub/copied.h"
#include "hub/reply.h"

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#define CLERK_ROUND_MS 100
#define STATE_WAIT_MS 500
#define UNDO_WAIT_MS 60000
#define RETRY_NS (3 * NS_PER_S)

// ---- opening and closing ------------------------------------------------------------------------

static void utc_stamp(int64_t utc_ns, char *out_text, size_t size) {
    time_t seconds = (time_t)(utc_ns / NS_PER_S);
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(out_text, size, "%Y%m%dT%H%M%SZ", &utc);
}

void desk_header(const struct hub *hub, const struct seat *seat, const struct card *card,
                 struct trace_header *out) {
    const struct hub_case *hub_case = &hub->config.cases[card->scene];
    const struct knee_case *knee = scene_case(hub->scenes[card->scene]);
    *out = (struct trace_header){
        .version = TRACE_VERSION,
        .case_hash = knee->hash,
        .start_utc_ns = card->start_utc_ns,
        .start_ns = clock_now_ns(),
        .settings = hub->config.settings,
        .optic = seat->station->optic,
    };
    memcpy(out->session_id, card->session_id, sizeof out->session_id);
    snprintf(out->station, sizeof out->station, "%s", seat->station->name);
    snprintf(out->trainee, sizeof out->trainee, "%s", card->trainee);
    snprintf(out->case_name, sizeof out->case_name, "%s", knee->name);
    snprintf(out->case_dir, sizeof out->case_dir, "%s", hub_case->dir);
    if (!isnan(card->strength))
        out->settings.field.strength = card->strength;
    trace_header_set_machine(out);
}

enum result desk_trace_path(const struct hub *hub, const struct seat *seat,
                            const struct trace_header *header, char *out_path, struct error *err) {
    char when[32];
    utc_stamp(header->start_utc_ns, when, sizeof when);
    const uint8_t *id = header->session_id;
    int length =
        snprintf(out_path, HUB_PATH_MAX, "%s/%s-%s-%02x%02x%02x%02x.trace", hub->config.traces_dir,
                 seat->station->name, when, id[0], id[1], id[2], id[3]);
    if (length >= HUB_PATH_MAX)
        return fail(err, RESULT_LIMIT, "%s: the path of the traces is too long",
                    hub->config.traces_dir);
    return RESULT_OK;
}

// card_lock held.
static void clear_figures(struct card *card) {
    memset(card->tissues, 0, sizeof card->tissues);
    memset(card->mesh_hashes, 0, sizeof card->mesh_hashes);
}

// A session and its trace are there: into the card, the records and the log.
static void announce_session(struct hub *hub, int index, struct live *live,
                             const struct trace_header *header, const char *trace) {
    struct seat *seat = &hub->seats[index];
    struct card *card = &seat->card;
    live->serial = ++hub->sessions_made;
    pthread_mutex_lock(&hub->card_lock);
    clear_figures(card);
    card->start_utc_ns = header->start_utc_ns;
    snprintf(card->trace, sizeof card->trace, "%s", trace);
    pthread_mutex_unlock(&hub->card_lock);
    moments_begin(&live->moments, live->serial, header->start_ns);
    seat_introduce(hub, index, live, header, NULL);
    session_row_begin(header, trace, &live->row);
    tally_begin(header, live->scene, &live->tally);
    recorder_put(hub->recorder, &live->row);
    deed_of_server(hub, seat, "open", header->session_id);
    log_info("hub", "station %s: session on case %s, trace %s", seat->station->name,
             scene_case(live->scene)->name, trace);
}

static enum result make_live(struct hub *hub, int index, struct live **out_live,
                             struct error *err) {
    struct seat *seat = &hub->seats[index];
    pthread_mutex_lock(&hub->card_lock);
    struct card card = seat->card;
    pthread_mutex_unlock(&hub->card_lock);
    struct trace_header header;
    char path[HUB_PATH_MAX];
    card.start_utc_ns = clock_utc_ns();
    desk_header(hub, seat, &card, &header);
    enum result result = desk_trace_path(hub, seat, &header, path, err);
    if (result != RESULT_OK)
        return result;
    struct trace_writer *trace;
    result = trace_writer_create(path, &header, &hub->vouches, &trace, err);
    if (result != RESULT_OK)
        return result;
    struct live *live = alloc(1, sizeof *live);
    live->trace = trace;
    live->scene = hub->scenes[card.scene];
    live->session = session_create(live->scene, &header.settings);
    live->operation = operation_create(live->scene);
    announce_session(hub, index, live, &header, path);
    *out_live = live;
    return RESULT_OK;
}

static void tell_failure(struct hub *hub, struct seat *seat, const struct error *err) {
    arthron_Control message = {.which_message = arthron_Control_session_change_tag};
    arthron_SessionChange *change = &message.message.session_change;
    change->state = arthron_SessionState_CLOSED;
    snprintf(change->text, sizeof change->text, "no session: %.200s", err->text);
    pthread_mutex_lock(&hub->card_lock);
    atomic_store(&seat->counts.state, SESSION_CLOSED);
    seat->card.trace[0] = '\0';
    seat->card.retry_ns = clock_now_ns() + RETRY_NS;
    struct control_peer peer = seat->card.peer;
    pthread_mutex_unlock(&hub->card_lock);
    control_send(hub->control, peer, &message);
    log_error("hub", "station %s: no session: %s", seat->station->name, err->text);
}

static void give_worker(struct hub *hub, int index, struct live *live) {
    struct note note = {.kind = NOTE_ATTACH, .seat = index, .live = live};
    struct worker *worker = seat_worker(hub, index);
    atomic_store(&hub->seats[index].counts.state, (int)live->state);
    bool told = worker_tell(worker, worker->from_desk, &note);
    CHECK(told);
}

// desk_lock held, and the seat has no session. Makes one on the card's case for the worker.
static enum result open_session(struct hub *hub, int index, struct error *err) {
    struct seat *seat = &hub->seats[index];
    struct live *live;
    pthread_mutex_lock(&hub->card_lock);
    if (!seat->card.id_is_fresh)
        desk_new_id(seat->card.session_id);
    seat->card.id_is_fresh = false;
    seat->card.stopped = false;
    pthread_mutex_unlock(&hub->card_lock);
    enum result result = make_live(hub, index, &live, err);
    if (result != RESULT_OK) {
        tell_failure(hub, seat, err);
        return result;
    }
    give_worker(hub, index, live);
    return RESULT_OK;
}

static void log_trace_end(const struct seat *seat, struct trace_status status) {
    const char *name = seat->station->name;
    if (status.missing)
        log_error("hub", "station %s: session ended, %llu of its records could not be written",
                  name, (unsigned long long)status.missing);
    else
        log_info("hub", "station %s: session ended after %llu steps", name,
                 (unsigned long long)status.records);
}

static void record_end(struct hub *hub, struct live *live, struct trace_status status,
                       bool deserted) {
    live->row.state = deserted ? STATE_DESERTED : STATE_CLOSED;
    live->row.end_utc_ns = clock_utc_ns();
    live->row.steps = status.records;
    live->row.missing = status.missing;
    recorder_put(hub->recorder, &live->row);
}

// desk_lock held.
static void release_retired(struct hub *hub, struct worker *worker) {
    struct retired retired;
    while (theatre_retired(worker->theatre, &retired)) {
        struct seat *seat = &hub->seats[retired.seat];
        if (retired.deserted)
            log_warning("hub", "station %s: no frame for %d s, its session ends",
                        seat->station->name, hub->config.wait_s);
        if (retired.deserted)
            deed_of_server(hub, seat, "end", retired.live->tally.session_id);
        struct trace_status status = trace_writer_status(retired.live->trace);
        log_trace_end(seat, status);
        trace_writer_destroy(&retired.live->trace);
        record_end(hub, retired.live, status, retired.deserted);
        session_destroy(&retired.live->session);
        operation_destroy(&retired.live->operation);
        free(retired.live);
    }
}

static void release_all_retired(struct hub *hub) {
    for (int i = 0; i < hub->worker_count; i++)
        if (hub->workers[i].theatre)
            release_retired(hub, &hub->workers[i]);
}

// A connected station has a session, unless a command stopped it.
static bool needs_session(const struct seat *seat, int64_t now_ns) {
    const struct card *card = &seat->card;
    return card->connected && !card->stopped && !seat_has_session(seat) && now_ns >= card->retry_ns;
}

// card_lock held.
static bool anyone_needs_session(const struct hub *hub) {
    for (int i = 0; i < hub->config.station_count; i++)
        if (needs_session(&hub->seats[i], clock_now_ns()))
            return true;
    return false;
}

// desk_lock held. From here on nothing is half open: a session that is not closed has a worker.
static void put_in_order(struct hub *hub) {
    release_all_retired(hub);
    for (int i = 0; i < hub->config.station_count; i++) {
        pthread_mutex_lock(&hub->card_lock);
        bool needed = needs_session(&hub->seats[i], clock_now_ns());
        pthread_mutex_unlock(&hub->card_lock);
        struct error err;
        if (needed)
            open_session(hub, i, &err);
    }
}

// ---- the clerk's thread -------------------------------------------------------------------------

static void wait_for_work(struct hub *hub) {
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += CLERK_ROUND_MS * NS_PER_MS;
    if (until.tv_nsec >= NS_PER_S) {
        until.tv_nsec -= NS_PER_S;
        until.tv_sec++;
    }
    pthread_mutex_lock(&hub->card_lock);
    if (!hub->clerk_stop && !anyone_needs_session(hub))
        pthread_cond_timedwait(&hub->clerk_wake, &hub->card_lock, &until);
    pthread_mutex_unlock(&hub->card_lock);
}

static bool clerk_should_stop(struct hub *hub) {
    pthread_mutex_lock(&hub->card_lock);
    bool stop = hub->clerk_stop;
    pthread_mutex_unlock(&hub->card_lock);
    return stop;
}

// Once for each session, when enough touches have told.
static void warn_of_drift(const struct hub *hub, struct seat *seat) {
    bool told = atomic_load(&seat->counts.touches) >= DRIFT_TOUCHES;
    double drift_mm = (double)atomic_load(&seat->counts.drift_nm) / 1e6;
    if (told && !seat->drift_warned && drift_mm > hub->config.calibration_mm)
        log_warning("hub", "station %s: it touches %.2f mm beside the surface: calibrate it",
                    seat->station->name, drift_mm);
    seat->drift_warned = told && drift_mm > hub->config.calibration_mm;
}

// Once for each session.
static void warn_of_trace(struct seat *seat) {
    bool incomplete = atomic_load(&seat->counts.trace_missing) > 0;
    if (incomplete && !seat->trace_warned)
        log_error("hub", "station %s: its trace is incomplete, the disk is too slow or full",
                  seat->station->name);
    seat->trace_warned = incomplete;
}

static void *clerk(void *argument) {
    struct hub *hub = argument;
    while (!clerk_should_stop(hub)) {
        pthread_mutex_lock(&hub->desk_lock);
        put_in_order(hub);
        pthread_mutex_unlock(&hub->desk_lock);
        for (int i = 0; i < hub->config.station_count; i++) {
            warn_of_drift(hub, &hub->seats[i]);
            warn_of_trace(&hub->seats[i]);
        }
        wait_for_work(hub);
    }
    return NULL;
}

void desk_start(struct hub *hub) {
    int failed = pthread_create(&hub->clerk, NULL, clerk, hub);
    CHECK(!failed);
    hub->clerk_runs = true;
}

void desk_stop(struct hub *hub) {
    if (!hub->clerk_runs)
        return;
    pthread_mutex_lock(&hub->card_lock);
    hub->clerk_stop = true;
    pthread_cond_signal(&hub->clerk_wake);
    pthread_mutex_unlock(&hub->card_lock);
    pthread_join(hub->clerk, NULL);
}

void desk_release(struct hub *hub) {
    release_all_retired(hub);
}

void desk_new_id(uint8_t out_id[16]) {
    ssize_t got = getrandom(out_id, 16, 0);
    CHECK(got == 16);
}

void desk_call(struct hub *hub) {
    pthread_cond_signal(&hub->clerk_wake);
}

// ---- commands -----------------------------------------------------------------------------------

__attribute__((format(printf, 2, 3))) static void refuse(arthron_CommandReply *reply,
                                                         const char *format, ...) {
    va_list args;
    va_start(args, format);
    vsnprintf(reply->text, sizeof reply->text, format, args);
    va_end(args);
    reply->ok = false;
}

static void show_joint(struct hub *hub, int index, arthron_CommandReply *reply) {
    struct moment moment;
    seat_moment(hub, index, &moment);
    reply->has_joint = seat_has_session(&hub->seats[index]) && moment.step > 0;
    if (!reply->has_joint)
        return;
    const pose *bodies = moment.T_mockup_body;
    pose T_femur_tibia = pose_compose(pose_inverse(bodies[BODY_FEMUR]), bodies[BODY_TIBIA]);
    reply->joint = (arthron_JointReading){
        .step = moment.step,
        .time_ns = moment.time_ns,
        .validity = (arthron_Validity)moment.joint_validity,
        .has_joint = true,
        .joint = wire_joint_from(&moment.joint),
        .has_pose = true,
        .pose = wire_pose_from(T_femur_tibia),
    };
}

static void show_seat(struct hub *hub, int index, arthron_CommandReply *reply) {
    struct seat *seat = &hub->seats[index];
    pthread_mutex_lock(&hub->card_lock);
    struct card card = seat->card;
    pthread_mutex_unlock(&hub->card_lock);
    const struct scene *scene = hub->scenes[card.scene];
    seat_info(hub, index, &reply->sessions[0]);
    reply->sessions_count = 1;
    reply->resections_count = (pb_size_t)scene_tissue_count(scene);
    for (int i = 0; i < scene_tissue_count(scene); i++)
        reply_resection(&card.tissues[i],
                        scene_case(scene)->groups[scene_tissue_group(scene, i)].name,
                        card.mesh_hashes[i], &reply->resections[i]);
    show_joint(hub, index, reply);
    reply->ok = true;
}

static bool wait_for_state(struct seat *seat, enum session_state state) {
    const struct timespec pause = {0, 5 * NS_PER_MS};
    for (int waited = 0; waited < STATE_WAIT_MS; waited += 5) {
        if (atomic_load(&seat->counts.state) == (int)state)
            return true;
        nanosleep(&pause, NULL);
    }
    return false;
}

static void give_input(struct hub *hub, int index, enum input_kind kind,
                       enum session_state expected, arthron_CommandReply *reply) {
    struct worker *worker = seat_worker(hub, index);
    struct note note = {.kind = NOTE_INPUT, .seat = index, .input = kind};
    if (!worker_tell(worker, worker->from_desk, &note))
        refuse(reply, "station %s: its worker is too busy", hub->seats[index].station->name);
    else if (!wait_for_state(&hub->seats[index], expected))
        refuse(reply, "station %s: the session stayed as it was", hub->seats[index].station->name);
    else
        reply->ok = true;
}

static void ask_for_undo(struct hub *hub, int index, arthron_CommandReply *reply) {
    struct seat *seat = &hub->seats[index];
    struct worker *worker = seat_worker(hub, index);
    struct note note = {.kind = NOTE_INPUT, .seat = index, .input = INPUT_UNDO};
    atomic_store(&seat->counts.undo, UNDO_ASKED);
    reply->ok = worker_tell(worker, worker->from_desk, &note);
    if (!reply->ok)
        refuse(reply, "station %s: its worker is too busy", seat->station->name);
}

// Without the desk's lock: no other station waits for a theatre.
static void wait_for_undo(struct seat *seat, arthron_CommandReply *reply) {
    const struct timespec pause = {0, 5 * NS_PER_MS};
    int outcome = UNDO_ASKED;
    for (int waited = 0; outcome == UNDO_ASKED && waited < UNDO_WAIT_MS; waited += 5) {
        bool lives = seat_has_session(seat);
        outcome = atomic_load(&seat->counts.undo);
        if (!lives)
            break;
        nanosleep(&pause, NULL);
    }
    if (outcome == JOB_NOTHING)
        refuse(reply, "station %s: there is no cut to be undone", seat->station->name);
    else if (outcome == UNDO_ASKED)
        refuse(reply, "station %s: its session ended, or is too busy to undo a cut in %d s",
               seat->station->name, UNDO_WAIT_MS / 1000);
}

static bool is_connected(struct hub *hub, int index) {
    pthread_mutex_lock(&hub->card_lock);
    bool connected = hub->seats[index].card.connected;
    pthread_mutex_unlock(&hub->card_lock);
    return connected;
}

// A new session where there is none. False: the reply says why not.
static bool have_session(struct hub *hub, int index, arthron_CommandReply *reply) {
    struct error err;
    if (seat_has_session(&hub->seats[index]))
        return true;
    if (!is_connected(hub, index)) {
        refuse(reply, "station %s is not connected", hub->seats[index].station->name);
        return false;
    }
    if (open_session(hub, index, &err) == RESULT_OK)
        return true;
    refuse(reply, "%s", err.text);
    return false;
}

static void stop(struct hub *hub, int index, arthron_CommandReply *reply) {
    pthread_mutex_lock(&hub->card_lock);
    hub->seats[index].card.stopped = true;
    pthread_mutex_unlock(&hub->card_lock);
    give_input(hub, index, INPUT_STOP, SESSION_CLOSED, reply);
}

// A station that is away meets the new case when it comes.
static void change_case(struct hub *hub, int index, const arthron_Command *command,
                        arthron_CommandReply *reply) {
    int scene = hub_find_case(&hub->config, command->case_name);
    if (scene < 0) {
        refuse(reply, "there is no case %s", command->case_name);
        return;
    }
    if (command->has_strength && !(command->strength >= 0 && command->strength <= 1)) {
        refuse(reply, "the strength of a warp is from 0 to 1");
        return;
    }
    if (hub->unfit[scene].text[0]) {
        refuse(reply, "%s", hub->unfit[scene].text);
        return;
    }
    reply->ok = true;
    if (seat_has_session(&hub->seats[index]))
        stop(hub, index, reply);
    if (!reply->ok)
        return;
    pthread_mutex_lock(&hub->card_lock);
    hub->seats[index].card.scene = scene;
    hub->seats[index].card.strength = command->has_strength ? command->strength : NAN;
    clear_figures(&hub->seats[index].card);
    pthread_mutex_unlock(&hub->card_lock);
    if (is_connected(hub, index))
        have_session(hub, index, reply);
}

static void assign(struct hub *hub, int index, const char *trainee, arthron_CommandReply *reply) {
    struct card *card = &hub->seats[index].card;
    for (const char *c = trainee; *c; c++)
        if (iscntrl((unsigned char)*c)) {
            refuse(reply, "a trainee's name has no control characters");
            return;
        }
    pthread_mutex_lock(&hub->card_lock);
    snprintf(card->trainee, sizeof card->trainee, "%s", trainee);
    pthread_mutex_unlock(&hub->card_lock);
    reply->ok = true;
}

// desk_lock held. The session is made, and takes the place of that which the station has.
static void take_copied(struct hub *hub, int index, struct copied *copied,
                        arthron_CommandReply *reply) {
    struct card *card = &hub->seats[index].card;
    struct live *live = copied->again.live;
    struct error err;
    reply->ok = true;
    if (seat_has_session(&hub->seats[index]))
        stop(hub, index, reply);
    if (!reply->ok)
        return;
    if (copied_begin(copied, &err) != RESULT_OK) {
        refuse(reply, "%s", err.text);
        return;
    }
    copied->again.live = NULL;
    pthread_mutex_lock(&hub->card_lock);
    memcpy(card->session_id, copied->header.session_id, sizeof card->session_id);
    card->id_is_fresh = card->stopped = false;
    card->scene = copied->again.scene;
    pthread_mutex_unlock(&hub->card_lock);
    announce_session(hub, index, live, &copied->header, copied->path);
    give_worker(hub, index, live);
}

// What takes long comes first, while no other station waits for the desk.
static void copy_session(struct hub *hub, int index, const arthron_Command *command,
                         arthron_CommandReply *reply) {
    struct copied *copied;
    struct error err;
    if (!(command->at_s >= 0)) {
        refuse(reply, "%g s: a session is copied at its end or at a time after its start",
               command->at_s);
        return;
    }
    double at_s = command->at_s > 0 ? command->at_s : INFINITY;
    if (copied_create(hub, index, command->from, at_s, &copied, &err) != RESULT_OK) {
        refuse(reply, "%s", err.text);
        return;
    }
    pthread_mutex_lock(&hub->desk_lock);
    put_in_order(hub);
    take_copied(hub, index, copied, reply);
    seat_info(hub, index, &reply->sessions[0]);
    reply->sessions_count = 1;
    pthread_mutex_unlock(&hub->desk_lock);
    copied_destroy(&copied);
}

static void command_station(struct hub *hub, const char *actor, const arthron_Command *command,
                            int index, arthron_CommandReply *reply) {
    if (command->kind == arthron_Command_Kind_START) {
        if (have_session(hub, index, reply))
            give_input(hub, index, INPUT_START, SESSION_RUNNING, reply);
    } else if (command->kind == arthron_Command_Kind_CASE) {
        change_case(hub, index, command, reply);
    } else if (command->kind == arthron_Command_Kind_ASSIGN) {
        assign(hub, index, command->trainee, reply);
    } else if (!seat_has_session(&hub->seats[index])) {
        refuse(reply, "station %s has no session", command->station);
    } else if (command->kind == arthron_Command_Kind_PAUSE) {
        give_input(hub, index, INPUT_PAUSE, SESSION_PAUSED, reply);
    } else if (command->kind == arthron_Command_Kind_STOP) {
        stop(hub, index, reply);
    } else if (command->kind == arthron_Command_Kind_UNDO) {
        ask_for_undo(hub, index, reply);
    } else if (command->kind == arthron_Command_Kind_NOTE) {
        reply->ok = remarks_command(hub, index, actor, &command->remark, reply);
    } else {
        give_input(hub, index, INPUT_RESET, SESSION_RUNNING, reply);
        int asked = UNDO_ASKED; // what was asked for before will not be
        atomic_compare_exchange_strong(&hub->seats[index].counts.undo, &asked, JOB_NOTHING);
    }
    seat_info(hub, index, &reply->sessions[0]);
    reply->sessions_count = 1;
}

static void list_refused(struct hub *hub, arthron_Refused *out) {
    for (int i = 0; i < hub->worker_count; i++) {
        const struct worker_counts *counts = &hub->workers[i].counts;
        out->strangers += atomic_load(&counts->strangers);
        out->forged += atomic_load(&counts->forged);
        out->replayed += atomic_load(&counts->replayed);
        out->malformed += atomic_load(&counts->malformed);
        out->too_long += atomic_load(&counts->too_long);
    }
    struct control_counts control = control_counts(hub->control);
    out->certificates = control.refused_certificates;
    out->control_malformed = control.malformed_messages;
    out->control_unknown = control.unknown_messages;
    out->replies_dropped = control.replies_dropped;
}

static void list_all(struct hub *hub, arthron_CommandReply *reply) {
    reply->has_refused = true;
    list_refused(hub, &reply->refused);
    for (int i = 0; i < hub->config.station_count; i++)
        seat_info(hub, i, &reply->sessions[reply->sessions_count++]);
    reply->ok = true;
}

static const char *command_name(arthron_Command_Kind kind) {
    static const char *const names[_arthron_Command_Kind_ARRAYSIZE] = {
        "list", "start", "pause", "stop", "case",  "reset",
        "show", "undo",  "copy",  "note", "assign"};
    return names[kind];
}

void desk_command(void *user, const char *actor, const arthron_Command *command,
                  arthron_CommandReply *reply) {
    struct hub *hub = user;
    memset(reply, 0, sizeof *reply);
    if (command->kind == arthron_Command_Kind_LIST) {
        list_all(hub, reply);
        return;
    }
    if (!command_name(command->kind)) {
        refuse(reply, "this server does not know that command");
        return;
    }
    int index = hub_find_station(&hub->config, command->station);
    if (index < 0) {
        refuse(reply, "there is no station %s in the server's config", command->station);
        return;
    }
    if (command->kind == arthron_Command_Kind_SHOW) {
        show_seat(hub, index, reply);
        return;
    }
    if (command->kind == arthron_Command_Kind_COPY) {
        copy_session(hub, index, command, reply);
    } else {
        pthread_mutex_lock(&hub->desk_lock);
        put_in_order(hub);
        command_station(hub, actor, command, index, reply);
        pthread_mutex_unlock(&hub->desk_lock);
    }
    if (command->kind == arthron_Command_Kind_UNDO && reply->ok)
        wait_for_undo(&hub->seats[index], reply);
    if (reply->ok)
        deed_of_command(hub, actor, command_name(command->kind), command, &reply->sessions[0]);
    log_info("hub", "station %s: %s by %s: %s", command->station, command_name(command->kind),
             actor, reply->ok ? "done" : reply->text);
}
