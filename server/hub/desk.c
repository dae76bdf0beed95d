// The desk opens and closes sessions. It may take its time (files are made and loaded here), so
// workers and the control thread only leave word: a flag for the clerk, a ring of sessions that
// have ended. What instructors ask for is in steer.c.
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "hub/grades.h"
#include "hub/seat.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#define CLERK_ROUND_MS 100
#define GRADES_EVERY_NS NS_PER_S
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

void desk_clear_figures(struct card *card) {
    memset(card->tissues, 0, sizeof card->tissues);
    memset(card->mesh_hashes, 0, sizeof card->mesh_hashes);
}

void desk_announce(struct hub *hub, int index, struct live *live, const struct trace_header *header,
                   const char *trace) {
    struct seat *seat = &hub->seats[index];
    struct card *card = &seat->card;
    live->serial = ++hub->sessions_made;
    pthread_mutex_lock(&hub->card_lock);
    desk_clear_figures(card);
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
    desk_announce(hub, index, live, &header, path);
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

void desk_attach(struct hub *hub, int index, struct live *live) {
    struct note note = {.kind = NOTE_ATTACH, .seat = index, .live = live};
    struct worker *worker = seat_worker(hub, index);
    atomic_store(&hub->seats[index].counts.state, (int)live->state);
    bool told = worker_tell(worker, worker->from_desk, &note);
    CHECK(told);
}

enum result desk_open(struct hub *hub, int index, struct error *err) {
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
    desk_attach(hub, index, live);
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
            log_warning("hub", "station %s: no frame for %d s; its session ends",
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

void desk_put_in_order(struct hub *hub) {
    release_all_retired(hub);
    for (int i = 0; i < hub->config.station_count; i++) {
        pthread_mutex_lock(&hub->card_lock);
        bool needed = needs_session(&hub->seats[i], clock_now_ns());
        pthread_mutex_unlock(&hub->card_lock);
        struct error err;
        if (needed)
            desk_open(hub, i, &err);
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
        log_warning("hub", "station %s: tip is %.2f mm off the surface; recalibrate",
                    seat->station->name, drift_mm);
    seat->drift_warned = told && drift_mm > hub->config.calibration_mm;
}

// Once for each session.
static void warn_of_trace(struct seat *seat) {
    bool incomplete = atomic_load(&seat->counts.trace_missing) > 0;
    if (incomplete && !seat->trace_warned)
        log_error("hub", "station %s: its trace is incomplete: the disk is too slow or full",
                  seat->station->name);
    seat->trace_warned = incomplete;
}

static void *clerk(void *argument) {
    struct hub *hub = argument;
    int64_t grades_ns = clock_now_ns();
    while (!clerk_should_stop(hub)) {
        pthread_mutex_lock(&hub->desk_lock);
        desk_put_in_order(hub);
        pthread_mutex_unlock(&hub->desk_lock);
        for (int i = 0; i < hub->config.station_count; i++) {
            warn_of_drift(hub, &hub->seats[i]);
            warn_of_trace(&hub->seats[i]);
        }
        if (clock_now_ns() - grades_ns > GRADES_EVERY_NS) {
            grades_refresh(hub->grades);
            grades_ns = clock_now_ns();
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
