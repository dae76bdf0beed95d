#include "sessions/station_slot.h"

#include "base/chance.h"
#include "base/check.h"
#include "base/clock.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

void station_slot_init(struct station_slot *slot, int scene, const char *trainee) {
    memset(slot, 0, sizeof *slot);
    pthread_mutex_init(&slot->command_lock, NULL);
    pthread_mutex_init(&slot->lock, NULL);
    pthread_cond_init(&slot->changed, NULL);
    slot->status.state = SESSION_CLOSED;
    slot->status.scene = scene;
    slot->status.strength = NAN;
    slot->status.instruments = *instruments_usual();
    snprintf(slot->status.trainee, sizeof slot->status.trainee, "%s", trainee);
}

void station_slot_fini(struct station_slot *slot) {
    pthread_mutex_destroy(&slot->command_lock);
    pthread_mutex_destroy(&slot->lock);
    pthread_cond_destroy(&slot->changed);
    remarks_fini(&slot->remarks);
    marker_list_fini(&slot->markers);
}

static struct station_status *begin(struct station_slot *slot) {
    pthread_mutex_lock(&slot->lock);
    return &slot->status;
}

static void end(struct station_slot *slot) {
    pthread_cond_broadcast(&slot->changed);
    pthread_mutex_unlock(&slot->lock);
}

void station_slot_status(struct station_slot *slot, struct station_status *out_status) {
    pthread_mutex_lock(&slot->lock);
    *out_status = slot->status;
    pthread_mutex_unlock(&slot->lock);
}

// ---- the session --------------------------------------------------------------------------------

static void claim(struct station_status *s, const uint8_t id[16]) {
    s->phase = SLOT_OPENING;
    s->state = SESSION_WAITING;
    s->stopped = false;
    if (id)
        memcpy(s->session_id, id, sizeof s->session_id);
    else
        chance_fill(s->session_id, 16);
}

bool station_slot_claim(struct station_slot *slot, const uint8_t id[16]) {
    struct station_status *s = begin(slot);
    bool is_free = s->phase == SLOT_EMPTY;
    if (is_free)
        claim(s, id);
    end(slot);
    return is_free;
}

static bool needs_session(const struct station_status *s, int64_t now_ns) {
    return s->phase == SLOT_EMPTY && s->connected && !s->stopped && now_ns >= s->retry_ns;
}

bool station_slot_claim_needed(struct station_slot *slot, int64_t now_ns) {
    struct station_status *s = begin(slot);
    bool needed = needs_session(s, now_ns);
    if (needed)
        claim(s, NULL);
    end(slot);
    return needed;
}

void station_slot_attached(struct station_slot *slot, const struct session_about *about,
                           enum session_state state, struct remarks *said,
                           struct marker_list *marked, void (*give)(void *user), void *user) {
    struct station_status *s = begin(slot);
    CHECK(s->phase == SLOT_OPENING && state != SESSION_CLOSED);
    s->phase = SLOT_ATTACHED;
    s->state = state;
    s->refused[0] = '\0';
    s->about = *about;
    s->scene = about->scene;
    s->has_tissues = true;
    remarks_begin(&slot->remarks, about->serial, said);
    marker_list_begin(&slot->markers, about->serial, marked);
    give(user);
    end(slot);
}

void station_slot_put_marker(struct station_slot *slot, uint64_t session,
                             const struct marker *marker) {
    begin(slot);
    if (slot->markers.session == session)
        marker_list_put(&slot->markers, marker);
    end(slot);
}

void station_slot_failed(struct station_slot *slot, int64_t retry_ns) {
    struct station_status *s = begin(slot);
    CHECK(s->phase == SLOT_OPENING);
    s->phase = SLOT_EMPTY;
    s->state = SESSION_CLOSED;
    s->retry_ns = retry_ns;
    end(slot);
}

void station_slot_refused(struct station_slot *slot, const char *why) {
    struct station_status *s = begin(slot);
    snprintf(s->refused, sizeof s->refused, "%.*s", (int)sizeof s->refused - 1, why);
    s->refused_ns = clock_now_ns();
    end(slot);
}

void station_slot_ending(struct station_slot *slot) {
    struct station_status *s = begin(slot);
    if (s->phase == SLOT_ATTACHED)
        s->phase = SLOT_ENDING;
    end(slot);
}

bool station_slot_goes_on(struct station_slot *slot) {
    struct station_status *s = begin(slot);
    bool goes_on = s->phase != SLOT_EMPTY;
    if (s->phase == SLOT_ENDING)
        s->phase = SLOT_ATTACHED;
    end(slot);
    return goes_on;
}

void station_slot_set_state(struct station_slot *slot, uint64_t session, enum session_state state) {
    struct station_status *s = begin(slot);
    bool is_of_it = s->phase == SLOT_ATTACHED || s->phase == SLOT_ENDING;
    if (is_of_it && s->about.serial == session) {
        s->state = state;
        if (state == SESSION_CLOSED)
            s->phase = SLOT_EMPTY;
    }
    end(slot);
}

void station_slot_set_tissues(struct station_slot *slot, uint64_t session) {
    struct station_status *s = begin(slot);
    s->tissues_of = session;
    end(slot);
}

// ---- the sessions to come -----------------------------------------------------------------------

void station_slot_set_stopped(struct station_slot *slot, bool stopped) {
    struct station_status *s = begin(slot);
    s->stopped = stopped;
    end(slot);
}

void station_slot_set_case(struct station_slot *slot, int scene, double strength) {
    struct station_status *s = begin(slot);
    s->scene = scene;
    s->strength = strength;
    s->has_tissues = false;
    s->stopped = false;
    end(slot);
}

void station_slot_set_trainee(struct station_slot *slot, const char *trainee) {
    struct station_status *s = begin(slot);
    snprintf(s->trainee, sizeof s->trainee, "%s", trainee);
    end(slot);
}

void station_slot_set_help(struct station_slot *slot, uint64_t session) {
    begin(slot)->help_of = session;
    end(slot);
}

// ---- the station --------------------------------------------------------------------------------

bool station_slot_join(struct station_slot *slot, struct control_peer peer,
                       const arthron_Hello *hello, struct station_status *out_status) {
    struct station_status *s = begin(slot);
    bool is_rival = s->connected && s->connection != hello->connection;
    if (!is_rival) {
        s->stopped = s->stopped && s->connection == hello->connection;
        s->retry_ns = 0;
        s->connected = true;
        s->peer = peer;
        s->connection = hello->connection;
        s->calibrated = hello->has_calibration;
        s->calibration = hello->calibration;
        wire_instruments_to(hello, &s->instruments, NULL); // the connection has checked them
        s->device_count = hello->devices_count;
        memcpy(s->devices, hello->devices, sizeof s->devices);
    }
    *out_status = *s;
    end(slot);
    return !is_rival;
}

bool station_slot_is_of(struct station_slot *slot, struct control_peer peer) {
    pthread_mutex_lock(&slot->lock);
    const struct station_status *s = &slot->status;
    bool is_of =
        s->connected && s->peer.index == peer.index && s->peer.generation == peer.generation;
    pthread_mutex_unlock(&slot->lock);
    return is_of;
}

void station_slot_leave(struct station_slot *slot) {
    struct station_status *s = begin(slot);
    s->connected = false;
    end(slot);
}

void station_slot_set_clock(struct station_slot *slot, int64_t rtt_ns, int64_t uncertainty_ns) {
    pthread_mutex_lock(&slot->lock);
    slot->status.rtt_ns = rtt_ns;
    slot->status.clock_uncertainty_ns = uncertainty_ns;
    pthread_mutex_unlock(&slot->lock);
}

// ---- waiting ------------------------------------------------------------------------------------

// lock held. False where the wait is over.
static bool wait_on(struct station_slot *slot, int64_t until_ns) {
    struct timespec until = {until_ns / NS_PER_S, until_ns % NS_PER_S};
    return !slot->broken_off &&
           !pthread_cond_clockwait(&slot->changed, &slot->lock, CLOCK_MONOTONIC, &until);
}

bool station_slot_wait_open(struct station_slot *slot, int64_t until_ns) {
    struct station_status *s = begin(slot);
    bool waits = true;
    while (s->phase == SLOT_OPENING || s->phase == SLOT_ENDING)
        if (!(waits = wait_on(slot, until_ns)))
            break;
    pthread_mutex_unlock(&slot->lock);
    return waits;
}

bool station_slot_wait_tissues(struct station_slot *slot, int64_t until_ns) {
    struct station_status *s = begin(slot);
    bool waits = true;
    while (s->phase != SLOT_EMPTY && (s->phase == SLOT_OPENING || s->tissues_of != s->about.serial))
        if (!(waits = wait_on(slot, until_ns)))
            break;
    pthread_mutex_unlock(&slot->lock);
    return waits;
}

void station_slot_set_ended(struct station_slot *slot, uint64_t session) {
    begin(slot);
    slot->ended = session;
    end(slot);
}

bool station_slot_wait_ended(struct station_slot *slot, uint64_t session, int64_t until_ns) {
    bool waits = true;
    begin(slot);
    while (slot->ended != session)
        if (!(waits = wait_on(slot, until_ns)))
            break;
    pthread_mutex_unlock(&slot->lock);
    return waits;
}

uint64_t station_slot_new_ticket(struct station_slot *slot) {
    pthread_mutex_lock(&slot->lock);
    uint64_t ticket = ++slot->ticket;
    pthread_mutex_unlock(&slot->lock);
    return ticket;
}

void station_slot_set_taken(struct station_slot *slot, uint64_t ticket, bool done) {
    begin(slot);
    slot->taken = ticket;
    slot->taken_done = done;
    end(slot);
}

bool station_slot_wait_taken(struct station_slot *slot, uint64_t ticket, int64_t until_ns,
                             bool *out_done) {
    bool waits = true;
    begin(slot);
    while (slot->taken < ticket)
        if (!(waits = wait_on(slot, until_ns)))
            break;
    *out_done = slot->taken == ticket && slot->taken_done;
    pthread_mutex_unlock(&slot->lock);
    return waits;
}

// ---- undo ---------------------------------------------------------------------------------------

static bool undo_may_come(const struct station_slot *slot) {
    const struct station_status *s = &slot->status;
    return s->phase != SLOT_EMPTY && s->about.serial == slot->undo.session;
}

bool station_slot_begin_undo(struct station_slot *slot, uint64_t *out_ticket) {
    begin(slot);
    bool is_free = !slot->undo.awaited && !(slot->undo.pending && undo_may_come(slot));
    if (is_free) {
        memset(&slot->undo, 0, sizeof slot->undo);
        slot->undo.awaited = slot->undo.pending = true;
        slot->undo.session = slot->status.about.serial;
        slot->undo.ticket = *out_ticket = ++slot->ticket;
    }
    end(slot);
    return is_free;
}

void station_slot_add_undone(struct station_slot *slot, uint64_t ticket,
                             const struct undo_answer *undone, bool more) {
    begin(slot);
    if (slot->undo.pending && slot->undo.ticket == ticket) {
        slot->undo.undone.outcome = undone->outcome;
        slot->undo.undone.cuts += undone->cuts;
        slot->undo.undone.volume_mm3 += undone->volume_mm3;
        slot->undo.pending = more;
    }
    end(slot);
}

void station_slot_cancel_undo(struct station_slot *slot) {
    begin(slot);
    slot->undo.awaited = slot->undo.pending = false;
    end(slot);
}

bool station_slot_end_undo(struct station_slot *slot, int64_t until_ns,
                           struct undo_answer *out_undone) {
    begin(slot);
    while (slot->undo.pending && undo_may_come(slot))
        if (!wait_on(slot, until_ns))
            break;
    bool answered = !slot->undo.pending;
    *out_undone = slot->undo.undone;
    slot->undo.awaited = false;
    end(slot);
    return answered;
}

void station_slot_break_off(struct station_slot *slot) {
    begin(slot);
    slot->broken_off = true;
    end(slot);
}
