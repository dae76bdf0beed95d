#include "records/recorder.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "records/audit_seal.h"
#include "records/audit_spool.h"
#include "records/scoring.h"
#include "records/unrecorded.h"
#include "records/waiting.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#define LIVE_MAX 256
#define SIGN_NS (60 * NS_PER_S)
#define RECORDER_NICE 5 // workers go first

struct recorder {
    char *records, *traces_dir, *authority;
    struct trace_signer signer;
    scene_finder find;
    void *find_user;
    void (*read_attempts)(const char *trace, const struct scene *scene, attempt_row_taker take,
                          void *taker);
    void (*attempt_written)(void *user, struct store *store, const char *session, int number);
    void *attempt_user;
    int64_t start_utc_ns;
    struct scoring *scoring;
    pthread_t thread;
    pthread_mutex_t mutex; // of all below
    pthread_cond_t wake;
    struct waiting_list waiting;
    struct store_session live[LIVE_MAX]; // sessions that go on; without a trace: a free place
    bool stop;
    atomic_bool spool_is_read; // else nothing replaces it
    // The thread's own.
    bool took_over, failing, unsigned_told;
    int64_t signed_ns;          // when it looked for something to sign
    size_t spooled;             // of an earlier server, before all else that waits
    struct store_identity file; // that was written last
};

// ---- what waits ---------------------------------------------------------------------------------

// The entry of a running session with this trace, or a free one for ""; or NULL.
static struct store_session *find_live(struct recorder *r, const char *trace) {
    for (int i = 0; i < LIVE_MAX; i++)
        if (!strcmp(r->live[i].trace, trace))
            return &r->live[i];
    return NULL;
}

static void note_live(struct recorder *r, const struct store_session *session) {
    struct store_session *place = find_live(r, session->trace);
    if (session->state != STATE_OPEN && place)
        place->trace[0] = '\0';
    if (session->state == STATE_OPEN && !place && (place = find_live(r, "")))
        *place = *session;
}

static void put(struct recorder *r, const struct waiting *waiting) {
    pthread_mutex_lock(&r->mutex);
    if (waiting->kind == WAITING_ROW)
        note_live(r, &waiting->row);
    waiting_append(&r->waiting, waiting);
    pthread_cond_signal(&r->wake);
    pthread_mutex_unlock(&r->mutex);
}

void recorder_put(struct recorder *r, const struct store_session *session) {
    if (r)
        put(r, &(struct waiting){.kind = WAITING_ROW, .row = *session});
}

void recorder_attempt(struct recorder *r, const struct attempt_row *attempt) {
    struct attempt_row *copy;
    if (!r)
        return;
    copy = alloc(1, sizeof *copy);
    *copy = *attempt;
    put(r, &(struct waiting){.kind = WAITING_ATTEMPT, .attempt = copy});
}

static void put_read_attempt(void *recorder, const struct attempt_row *attempt) {
    recorder_attempt(recorder, attempt);
}

// Where they cannot be asked, or lack the session: none.
static int64_t attempts_recorded(const struct recorder *r, const char *session) {
    struct store *store;
    int64_t count = 0;
    if (store_open(r->records, STORE_THERE, RECORDER_ACTOR, &store, NULL) == RESULT_OK)
        store_attempt_count(store, session, &count, NULL);
    store_close(&store);
    return count;
}

// The attempts first: a session with its score is not looked at again.
static void put_score(void *recorder, const struct session_score *score) {
    struct recorder *r = recorder;
    const struct store_session *session = &score->session;
    if (r->read_attempts && score->attempts > attempts_recorded(r, session->id))
        r->read_attempts(session->trace, r->find(r->find_user, session->case_hash),
                         put_read_attempt, r);
    put(r, &(struct waiting){.kind = WAITING_SCORE, .score = *score});
}

void recorder_note(struct recorder *r, const char *actor, const char *action, const char *subject) {
    struct waiting waiting = {.kind = WAITING_ENTRY};
    struct store_audit_entry *entry = &waiting.entry;
    if (!r)
        return;
    entry->utc_ns = clock_utc_ns();
    snprintf(entry->actor, sizeof entry->actor, "%s", *actor ? actor : RECORDER_ACTOR);
    snprintf(entry->action, sizeof entry->action, "%s", action);
    snprintf(entry->subject, sizeof entry->subject, "%s", subject);
    put(r, &waiting);
}

static void put_live_again(struct recorder *r) {
    pthread_mutex_lock(&r->mutex);
    for (int i = 0; i < LIVE_MAX; i++)
        if (r->live[i].trace[0])
            waiting_append(&r->waiting, &(struct waiting){.kind = WAITING_ROW, .row = r->live[i]});
    pthread_mutex_unlock(&r->mutex);
}

// Only the recorder's thread takes away, so the first stays the first meanwhile.
static struct waiting *first_waiting(struct recorder *r) {
    pthread_mutex_lock(&r->mutex);
    struct waiting *first = r->waiting.first;
    pthread_mutex_unlock(&r->mutex);
    return first;
}

static void drop_first(struct recorder *r) {
    pthread_mutex_lock(&r->mutex);
    struct waiting *first = waiting_take(&r->waiting);
    pthread_mutex_unlock(&r->mutex);
    waiting_free(first);
}

static bool should_recorder_stop(struct recorder *r) {
    pthread_mutex_lock(&r->mutex);
    bool stop = r->stop;
    pthread_mutex_unlock(&r->mutex);
    return stop;
}

int recorder_waiting(struct recorder *r) {
    int count = 0;
    if (!r)
        return 0;
    pthread_mutex_lock(&r->mutex);
    for (const struct waiting *w = r->waiting.first; w; w = w->next)
        count++;
    pthread_mutex_unlock(&r->mutex);
    return count;
}

// ---- writing ------------------------------------------------------------------------------------

static void tell_failure(struct recorder *r, const struct error *err) {
    if (!r->failing)
        log_error("records", "%s; sessions go on, and the server tries again", err->text);
    r->failing = true;
}

static void tell_success(struct recorder *r) {
    if (r->failing)
        log_warning("records", "%s: the records accept sessions again", r->records);
    r->failing = false;
}

// After a restore, or if the file was moved away, the traces have the missing sessions.
static void notice_exchange(struct recorder *r) {
    struct store_identity now;
    struct error err;
    enum result result = store_identify(r->records, &r->file, &now, &err);
    if (result != RESULT_OK && result != RESULT_MISSING)
        return; // it is locked, or damaged: writing will tell
    if (store_is_other(&r->file, &now)) {
        log_warning("records", "%s: somebody replaced this file", r->records);
        r->took_over = false;
    }
    r->file = now;
}

static enum result put_row(struct store *store, const struct store_session *session,
                           const struct session_score *score, struct error *err) {
    const struct store_result *results = score ? score->results : NULL;
    int count = score ? score->count : 0;
    return session->state == STATE_OPEN ? store_put_session(store, session, results, count, err)
                                        : store_put_ended(store, session, results, count, err);
}

static bool copy_live(struct recorder *r, const char *id, struct store_session *out) {
    bool found = false;
    pthread_mutex_lock(&r->mutex);
    for (int i = 0; i < LIVE_MAX && !found; i++) {
        found = r->live[i].trace[0] && !strcmp(r->live[i].id, id);
        if (found)
            *out = r->live[i];
    }
    pthread_mutex_unlock(&r->mutex);
    return found;
}

// Records that replaced the others may lack a session that goes on.
static enum result put_attempt(struct recorder *r, struct store *store,
                               const struct attempt_row *attempt, struct error *err) {
    struct store_session session;
    bool is_new;
    enum result result = store_attempt_add(store, attempt, &is_new, err);
    if (result == RESULT_MISSING && copy_live(r, attempt->session, &session)) {
        result = store_put_session(store, &session, NULL, 0, err);
        if (result == RESULT_OK)
            result = store_attempt_add(store, attempt, &is_new, err);
    }
    if (result == RESULT_OK && is_new && r->attempt_written)
        r->attempt_written(r->attempt_user, store, attempt->session, attempt->number);
    return result;
}

static enum result write_in(struct recorder *r, struct store *store, const struct waiting *w,
                            struct error *err) {
    switch (w->kind) {
    case WAITING_ROW:
        return put_row(store, &w->row, NULL, err);
    case WAITING_SCORE:
        return put_row(store, &w->score.session, &w->score, err);
    case WAITING_ENTRY:
        return store_put_audit(store, &w->entry, err);
    case WAITING_ATTEMPT:
        return put_attempt(r, store, w->attempt, err);
    }
    return RESULT_OK;
}

// A session that is missing was removed meanwhile, and stays removed.
static void tell_refused(const struct waiting *w, enum result result, const struct error *err) {
    const struct store_session *s = w->kind == WAITING_SCORE ? &w->score.session : &w->row;
    if (w->kind == WAITING_ENTRY)
        log_error("records", "%s: it cannot be in the audit log: %s", w->entry.action, err->text);
    else if (w->kind == WAITING_ATTEMPT)
        log_error("records", "attempt %d of session %s: it cannot be recorded: %s",
                  w->attempt->number, w->attempt->session, err->text);
    else if (result != RESULT_MISSING)
        log_error("records", "session %s, trace %s: it cannot be recorded: %s", s->id, s->trace,
                  err->text);
}

static enum result write_one(struct recorder *r, const struct waiting *w, struct error *err) {
    struct store *store;
    enum result result = store_open(r->records, STORE_MAKE, RECORDER_ACTOR, &store, err);
    if (result != RESULT_OK)
        return result;
    result = write_in(r, store, w, err);
    store_close(&store);
    if (result == RESULT_OK && w->kind == WAITING_ROW && w->row.end_utc_ns && r->scoring)
        scoring_put(r->scoring, &w->row);
    if (result == RESULT_INVALID || result == RESULT_REFUSED || result == RESULT_MISSING) {
        tell_refused(w, result, err);
        result = RESULT_OK; // nothing would change by trying again
    }
    if (result == RESULT_OK)
        tell_success(r);
    return result;
}

// False if the rest has to wait.
static bool write_all(struct recorder *r) {
    struct waiting *first;
    while ((first = first_waiting(r))) {
        struct error err;
        if (write_one(r, first, &err) != RESULT_OK) {
            tell_failure(r, &err);
            return false;
        }
        drop_first(r);
        if (r->spooled && !--r->spooled)
            audit_spool_drop(r->records);
    }
    return true;
}

// ---- the audit log's signature ------------------------------------------------------------------

// The log of the server is a witness outside the records.
static void look_at_audit(struct recorder *r, bool tell) {
    struct store *store;
    struct store_audit_head head = {0};
    struct error err;
    r->signed_ns = clock_now_ns();
    if (!r->signer.sign ||
        store_open(r->records, STORE_THERE, RECORDER_ACTOR, &store, &err) != RESULT_OK)
        return;
    enum result result = audit_seal_renew(store, &r->signer, r->authority, &head, &err);
    store_close(&store);
    if (result == RESULT_OK && tell && head.entry)
        log_info("records", "the audit log is signed up to entry %lld, %s", (long long)head.entry,
                 head.hash);
    if (result != RESULT_OK && result != RESULT_TIMEOUT && !r->unsigned_told)
        log_error("records", "the audit log is not signed any more: %s", err.text);
    r->unsigned_told = result != RESULT_OK && result != RESULT_TIMEOUT;
}

// ---- taking over --------------------------------------------------------------------------------

// Its header alone is read here, the rest when it is written.
bool recorder_put_trace(struct recorder *r, const char *path) {
    struct trace_reader *reader;
    struct store_session session;
    struct error err;
    if (!r || trace_is_written(path)) // its session is running
        return false;
    if (trace_reader_create(path, &reader, &err) != RESULT_OK) {
        log_warning("records", "not recorded: %s", err.text);
        return false;
    }
    const struct trace_header *header = trace_reader_header(reader);
    bool is_piece = trace_header_is_piece(header);
    session_row_begin(header, path, &session);
    trace_reader_destroy(&reader);
    if (is_piece)
        return false;
    session.state = STATE_INTERRUPTED; // until its end is found
    session.end_utc_ns = session.start_utc_ns;
    recorder_put(r, &session);
    return true;
}

static bool take_over(struct recorder *r) {
    struct trace_paths paths;
    struct error err;
    enum result result = unrecorded_find(r->records, r->traces_dir, r->start_utc_ns, &paths, &err);
    size_t taken = 0;
    if (result == RESULT_OK) // before traces that take their time
        put_live_again(r);
    else
        tell_failure(r, &err);
    for (size_t i = 0; result == RESULT_OK && i < paths.count && !should_recorder_stop(r); i++)
        taken += recorder_put_trace(r, paths.at[i]);
    if (taken)
        log_info("records", "%s: %zu sessions are taken over from their traces", r->records, taken);
    trace_paths_fini(&paths);
    return result == RESULT_OK;
}

// ---- the spool ----------------------------------------------------------------------------------

static void take_spooled(void *list, const struct store_audit_entry *entry) {
    waiting_append(list, &(struct waiting){.kind = WAITING_ENTRY, .entry = *entry});
}

static void put_before_all(struct recorder *r, struct waiting_list *spooled) {
    pthread_mutex_lock(&r->mutex);
    waiting_put_before(&r->waiting, spooled);
    pthread_mutex_unlock(&r->mutex);
}

// What an earlier server could not write. All of it or nothing: where it cannot be read, the thread
// tries again.
static void read_spool(struct recorder *r) {
    struct waiting_list spooled = {0};
    struct error err;
    if (audit_spool_read(r->records, take_spooled, &spooled, &r->spooled, &err) == RESULT_OK) {
        put_before_all(r, &spooled);
        atomic_store(&r->spool_is_read, true);
        return;
    }
    waiting_clear(&spooled);
    r->spooled = 0;
    tell_failure(r, &err);
}

// ---- the thread ---------------------------------------------------------------------------------

// For a second at most, to try again and to look at the file.
static void wait_for_work(struct recorder *r, bool again) {
    int64_t when_ns = clock_now_ns() + NS_PER_S;
    struct timespec when = {when_ns / NS_PER_S, when_ns % NS_PER_S};
    int code = 0;
    pthread_mutex_lock(&r->mutex);
    while (!r->stop && (again || !r->waiting.first) && code != ETIMEDOUT)
        code = pthread_cond_timedwait(&r->wake, &r->mutex, &when);
    pthread_mutex_unlock(&r->mutex);
}

static const struct store_audit_entry *next_entry(void *user) {
    struct waiting **at = user;
    while (*at && (*at)->kind != WAITING_ENTRY)
        *at = (*at)->next;
    const struct waiting *found = *at;
    *at = found ? found->next : NULL;
    return found ? &found->entry : NULL;
}

static enum result write_spool(struct recorder *r, struct waiting **at, struct error *err) {
    return atomic_load(&r->spool_is_read) ? audit_spool_write(r->records, next_entry, at, err)
                                          : audit_spool_add(r->records, next_entry, at, err);
}

// The traces contain sessions and attempts, but only the spool keeps the audit entries.
static void leave_the_rest(struct recorder *r) {
    struct error err;
    size_t sessions = 0, attempts = 0, count = 0;
    struct waiting *first = first_waiting(r), *at = first;
    for (const struct waiting *w = first; w; w = w->next)
        w->kind == WAITING_ENTRY ? count++ : w->kind == WAITING_ATTEMPT ? attempts++ : sessions++;
    log_error("records",
              "%s: %zu sessions, %zu attempts and %zu audit entries are not written: the next "
              "start does it",
              r->records, sessions, attempts, count);
    if (!count || write_spool(r, &at, &err) == RESULT_OK)
        return;
    log_error("records", "the audit entries are lost: %s", err.text);
    at = first;
    for (const struct store_audit_entry *entry; (entry = next_entry(&at));)
        log_error("records", "lost: %s %s: %s", entry->actor, entry->action, entry->subject);
}

#define LAST_PATIENCE_NS (500 * NS_PER_MS)

// Whoever holds the lock may be this very thread, in the middle of an append: then the list is
// whole without it.
void recorder_write_last(struct recorder *r) {
    struct error err;
    int64_t end_ns = clock_now_ns() + LAST_PATIENCE_NS;
    struct timespec when = {end_ns / NS_PER_S, end_ns % NS_PER_S};
    bool locked = pthread_mutex_clocklock(&r->mutex, CLOCK_MONOTONIC, &when) == 0;
    struct waiting *at = r->waiting.first;
    const struct waiting *look = at;
    while (look && look->kind != WAITING_ENTRY)
        look = look->next;
    if (look)
        write_spool(r, &at, &err);
    if (locked)
        pthread_mutex_unlock(&r->mutex);
}

// The rows first, then the scores of those that had still to be read.
static bool write_the_rest(struct recorder *r) {
    bool wrote = write_all(r);
    scoring_stop(&r->scoring);
    return wrote && write_all(r);
}

static void *run_recorder(void *argument) {
    struct recorder *r = argument;
    setpriority(PRIO_PROCESS, 0, RECORDER_NICE); // Linux: of this thread
    while (!should_recorder_stop(r)) {
        notice_exchange(r);
        if (!atomic_load(&r->spool_is_read))
            read_spool(r);
        bool wrote = write_all(r);
        if (!r->took_over)
            r->took_over = wrote && take_over(r);
        if (wrote && clock_now_ns() - r->signed_ns > SIGN_NS)
            look_at_audit(r, r->signed_ns < 0);
        wait_for_work(r, !wrote || !r->took_over);
    }
    if (!write_the_rest(r))
        leave_the_rest(r);
    look_at_audit(r, true);
    return NULL;
}

struct recorder *recorder_start(const struct recorder_config *config) {
    struct recorder *r = alloc(1, sizeof *r);
    r->records = alloc_text(config->records);
    r->traces_dir = alloc_text(config->traces_dir);
    r->authority = alloc_text(config->authority);
    r->signer = config->signer;
    r->find = config->find;
    r->find_user = config->user;
    r->read_attempts = config->read_attempts;
    r->attempt_written = config->attempt_written;
    r->attempt_user = config->attempt_user;
    r->signed_ns = -SIGN_NS;
    r->start_utc_ns = clock_utc_ns();
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&r->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    pthread_mutex_init(&r->mutex, NULL);
    read_spool(r);
    sigset_t all, before; // a file size limit then is an error like a full disk
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    r->scoring = scoring_start(&(struct scoring_config){.authority = r->authority,
                                                        .find = config->find,
                                                        .user = config->user,
                                                        .scored = put_score,
                                                        .owner = r});
    int failed = pthread_create(&r->thread, NULL, run_recorder, r);
    NEED(!failed, "thread");
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return r;
}

void recorder_stop(struct recorder **recorder) {
    struct recorder *r = *recorder;
    if (!r)
        return;
    scoring_hurry(r->scoring); // before a row that waits for the records brings a large trace
    pthread_mutex_lock(&r->mutex);
    r->stop = true;
    pthread_cond_signal(&r->wake);
    pthread_mutex_unlock(&r->mutex);
    pthread_join(r->thread, NULL);
    *recorder = NULL; // recorder_write_last has nothing to say from here on
    waiting_clear(&r->waiting);
    pthread_cond_destroy(&r->wake);
    pthread_mutex_destroy(&r->mutex);
    free(r->records);
    free(r->traces_dir);
    free(r->authority);
    free(r);
}
