// What goes to the pages that follow a wall or one station: the newest only, as fast as they draw.
#include "base/check.h"
#include "base/clock.h"
#include "live/viewer.h"
#include "runtime/attempt_state.h"
#include "runtime/reply.h"

#include <stdio.h>
#include <string.h>

#define REMARKS_AT_ONCE 16
#define MARKERS_AT_ONCE 64

// Of one page, to the thread that lands all cuts: what comes faster waits, and only the last
// counts.
#define ASKS_HZ 2
#define ASKS_BURST 4
#define ACKS_HZ 60
#define ACKS_BURST 120

// Pages of the same rate are due at the same times, so that one moment serves them all.
static int64_t next_due(const struct viewer *viewer, int64_t now_ns) {
    return (now_ns / viewer->period_ns + 1) * viewer->period_ns;
}

// False where the batch is full.
static bool put_moment(const struct station_cache *cache, struct sent_state *sent,
                       struct live_batch *batch) {
    if (!cache->item_size ||
        (sent->session == cache->item_session && sent->step == cache->item_step))
        return true;
    if (!batch_put(batch, cache->item, cache->item_size))
        return false;
    sent->session = cache->item_session;
    sent->step = cache->item_step;
    return true;
}

static bool is_blind(struct live_server *live, const struct viewer *viewer, const char *trainee) {
    return is_blind_to(&live->blindness, viewer->account.name, trainee);
}

static bool put_place(struct live_server *live, const struct viewer *viewer, int station,
                      struct sent_state *sent, struct live_batch *batch) {
    const struct station_cache *cache = &live->cache[station];
    if (sent->place == cache->place_number)
        return true;
    bool blind =
        is_blind(live, viewer, cache->trainee) || is_blind(live, viewer, cache->next_trainee);
    if (!batch_put(batch, blind ? cache->nameless : cache->place,
                   blind ? cache->nameless_size : cache->place_size))
        return false;
    sent->place = cache->place_number;
    return true;
}

// Behind the session that it belongs to. False where the batch is full.
static bool put_attempt(struct live_server *live, const struct viewer *viewer, int station,
                        struct sent_state *sent, struct live_batch *batch) {
    const struct station_cache *cache = &live->cache[station];
    const struct live_attempt *attempt = &cache->attempt;
    if (attempt->session != cache->about.serial || !attempt->session ||
        (sent->attempt_of == attempt->session && sent->attempt == attempt->news))
        return true;
    if (attempt->state.number && viewer->role != ROLE_TECHNICIAN) { // to whom no result is shown
        live->item = (arthron_Live){.which_message = arthron_Live_attempt_tag};
        live->item.message.attempt = attempt->state;
        live->item.message.attempt.station_number = (uint32_t)station;
        if (!is_staff(viewer))
            attempt_state_withhold(&live->item.message.attempt);
        if (!batch_say(batch, &live->item))
            return false;
    }
    sent->attempt_of = attempt->session;
    sent->attempt = attempt->news;
    return true;
}

// ---- the wall -----------------------------------------------------------------------------------

int64_t follow_wall(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                    struct live_batch *batch) {
    if (now_ns < viewer->due_ns)
        return viewer->due_ns;
    int count = sessions_config(live->sessions)->station_count;
    for (int i = 0; i < count; i++) {
        int station = (viewer->turn + i) % count;
        struct sent_state *sent = &viewer->sent[station];
        if (!elsewhere_tells_here(live, viewer, station))
            continue;
        cache_refresh(live, station, now_ns, viewer->period_ns / 2);
        cache_place(live, station, now_ns);
        if (!put_place(live, viewer, station, sent, batch) ||
            !put_attempt(live, viewer, station, sent, batch) ||
            !put_moment(&live->cache[station], sent, batch)) {
            viewer->turn = station;
            return now_ns;
        }
    }
    return viewer->due_ns = next_due(viewer, now_ns);
}

// ---- one station --------------------------------------------------------------------------------

static void clear_meshes(struct viewer *viewer) {
    for (int i = 0; i < TISSUES_MAX; i++)
        mesh_payload_release(&viewer->sendings[i].payload);
    viewer->words = (struct mesh_words){.asks = false};
}

static void leave_meshes(struct viewer *viewer) {
    clear_meshes(viewer);
    if (!viewer->mailbox)
        return;
    mailbox_leave(viewer->mailbox);
    mailbox_release(&viewer->mailbox);
}

// Only for one who may see the session: places for meshes are few.
static void follow_its_meshes(struct live_server *live, struct viewer *viewer) {
    char most[12];
    int watching = 0;
    snprintf(most, sizeof most, "%d", MESH_SUBSCRIBERS_MAX);
    if (!viewer->watch.meshes || viewer->mailbox)
        return;
    for (int i = 0; i < LIVE_VIEWERS_MAX; i++)
        watching += live->viewers[i].used && live->viewers[i].mailbox &&
                    live->viewers[i].station == viewer->station;
    if (watching < MESH_SUBSCRIBERS_MAX)
        viewer->mailbox = mailbox_create(live_news, live);
    else
        viewer_trouble(viewer, arthron_Trouble_Kind_NOTE, arthron_Why_Code_MESHES_FULL, most,
                       "%d pages follow the meshes of %s already: this one gets none",
                       MESH_SUBSCRIBERS_MAX, viewer->watch.station);
}

void follow_end(struct viewer *viewer) {
    leave_meshes(viewer);
    viewer->station = -1;
    viewer->introduced = viewer->barred = false;
    viewer->turn = 0;
}

void follow_anew(struct viewer *viewer) {
    int station = viewer->station;
    follow_end(viewer);
    viewer->station = station;
    viewer->due_ns = 0;
    viewer->sent[station] = (struct sent_state){0};
}

static void fill_session(struct live_server *live, const struct viewer *viewer,
                         arthron_LiveSession *out) {
    const struct session_about *about = &live->cache[viewer->station].about;
    const struct sessions_config *config = sessions_config(live->sessions);
    const struct session_station *station = &config->stations[viewer->station];
    *out = (arthron_LiveSession){.station_number = (uint32_t)viewer->station,
                                 .optic_deg = (float)station->optic.tilt_deg,
                                 .optic_view_deg = (float)station->optic.field_deg};
    snprintf(out->station, sizeof out->station, "%s", station->name);
    if (!about->serial)
        return;
    const struct knee_case *knee = scene_case(sessions_scene(live->sessions, about->scene));
    memcpy(out->id, about->id, sizeof out->id);
    wire_session_instruments_from(&about->instruments, out);
    reply_groups(knee, out);
    if (!is_blind(live, viewer, about->trainee))
        snprintf(out->trainee, sizeof out->trainee, "%s", about->trainee);
    snprintf(out->case_name, sizeof out->case_name, "%s", config->cases[about->scene].name);
    memcpy(out->own_case, out->case_name, sizeof out->own_case);
    out->case_hash = knee->hash;
    out->start_utc_ns = about->start_utc_ns;
    out->strength = (float)about->strength;
}

// A trainee sees the sessions that are the trainee's own.
static bool may_see(const struct viewer *viewer, const struct session_about *about) {
    if (is_staff(viewer))
        return true;
    return viewer->role == ROLE_TRAINEE && about->serial && viewer->account.trainee[0] &&
           !strcmp(viewer->account.trainee, about->trainee);
}

void follow_bar(struct viewer *viewer, const char *station) {
    viewer_trouble(viewer, arthron_Trouble_Kind_NOT_THERE, arthron_Why_Code_NOT_YOURS, station,
                   "there is no session of yours at %s", station);
}

// A new session, from its first step on: then its cut worker knows of it, too.
static bool introduce(struct live_server *live, struct viewer *viewer, struct live_batch *batch) {
    const struct station_cache *cache = &live->cache[viewer->station];
    if (viewer->introduced && viewer->session == cache->about.serial)
        return true;
    if (!may_see(viewer, &cache->about)) {
        if (!viewer->barred)
            follow_bar(viewer, viewer->watch.station);
        leave_meshes(viewer);
        viewer->barred = true;
        return viewer->introduced = false;
    }
    if (cache->moment.session != cache->about.serial)
        return viewer->introduced;
    live->item = (arthron_Live){.which_message = arthron_Live_session_tag};
    fill_session(live, viewer, &live->item.message.session);
    if (!batch_say(batch, &live->item))
        return false;
    clear_meshes(viewer);
    follow_its_meshes(live, viewer);
    viewer->introduced = true;
    viewer->barred = false;
    viewer->session = cache->about.serial;
    viewer->remarks = 0;
    memset(viewer->remarked, 0, sizeof viewer->remarked);
    viewer->markers = 0;
    viewer->metrics_ns = 0;
    memset(viewer->resected, 0, sizeof viewer->resected);
    return true;
}

// A trainee gets neither the plan's figures nor what others remark, as long as the exam is the
// session's newest attempt.
static bool is_examined(const struct live_server *live, const struct viewer *viewer) {
    const struct live_attempt *attempt = &live->cache[viewer->station].attempt;
    return !is_staff(viewer) && attempt->session == viewer->session && attempt->state.number &&
           attempt->state.purpose == arthron_AttemptState_Purpose_EXAM;
}

static void put_remarks(struct live_server *live, struct viewer *viewer, struct live_batch *batch) {
    struct kept_remark remarks[REMARKS_AT_ONCE];
    uint64_t revision;
    int count;
    bool all = sessions_remarks(live->sessions, viewer->station, viewer->session, viewer->remarks,
                                viewer->remarked, remarks, REMARKS_AT_ONCE, &count, &revision);
    for (int i = 0; i < count; i++) {
        live->item = (arthron_Live){.which_message = arthron_Live_remark_tag};
        remark_to_wire(&remarks[i].remark, live->cache[viewer->station].about.start_ns,
                       &live->item.message.remark);
        if (!batch_say(batch, &live->item))
            return;
        viewer->remarked[remarks[i].remark.number - 1] = remarks[i].revision;
    }
    if (all)
        viewer->remarks = revision;
    else
        batch->full = true;
}

static void put_markers(struct live_server *live, struct viewer *viewer, struct live_batch *batch) {
    struct marker markers[MARKERS_AT_ONCE];
    uint64_t told = viewer->markers;
    int count = sessions_markers(live->sessions, viewer->station, viewer->session, &told, markers,
                                 MARKERS_AT_ONCE);
    viewer->markers = told - (uint64_t)count;
    for (int i = 0; i < count; i++, viewer->markers++) {
        live->item = (arthron_Live){.which_message = arthron_Live_marker_tag,
                                    .message.marker = wire_marker_from(&markers[i])};
        live->item.message.marker.time_ns -= live->cache[viewer->station].about.start_ns;
        if (!batch_say(batch, &live->item))
            return;
    }
}

// ---- resections ---------------------------------------------------------------------------------

static bool is_told(const struct viewer *viewer, int tissue, const struct tissue_figures *f) {
    const struct tissue_figures *told = &viewer->figures[tissue];
    return viewer->resected[tissue] && told->mesh_number == f->mesh_number &&
           told->refused == f->refused;
}

static void withhold_plan(arthron_Resection *resection) {
    resection->planned_mm3 = resection->over_mm3 = resection->under_mm3 = 0;
    resection->damage_mm3 = resection->left_mm3 = 0;
    resection->rim_mm = resection->step_mm = 0;
}

static void put_resections(struct live_server *live, struct viewer *viewer,
                           struct live_batch *batch) {
    const struct scene *scene =
        sessions_scene(live->sessions, live->cache[viewer->station].about.scene);
    struct tissue_report report;
    runtime_tissues(sessions_runtime(live->sessions), viewer->station, &report);
    bool there = report.session == viewer->session;
    for (int i = 0; there && i < scene_tissue_count(scene); i++) {
        if (is_told(viewer, i, &report.figures[i]))
            continue;
        live->item = (arthron_Live){.which_message = arthron_Live_resection_tag};
        reply_resection(&report.figures[i],
                        scene_case(scene)->groups[scene_tissue_group(scene, i)].name,
                        report.mesh_hashes[i], &live->item.message.resection);
        if (is_examined(live, viewer))
            withhold_plan(&live->item.message.resection);
        if (!batch_say(batch, &live->item))
            return;
        viewer->resected[i] = true;
        viewer->figures[i] = report.figures[i];
    }
}

// ---- meshes -------------------------------------------------------------------------------------

static void take_payloads(struct viewer *viewer) {
    for (int i = 0; i < TISSUES_MAX; i++) {
        uint64_t session;
        struct mesh_payload *payload = mailbox_take(viewer->mailbox, i, &session);
        if (payload && session == viewer->session) {
            mesh_payload_release(&viewer->sendings[i].payload);
            viewer->sendings[i] = (struct sending){payload, 0};
        } else {
            mesh_payload_release(&payload);
        }
    }
}

// One chunk in a batch, so that what moves does not wait for what is large. True: more is to come.
static bool put_chunk(struct live_server *live, struct viewer *viewer, struct live_batch *batch) {
    take_payloads(viewer);
    for (int i = 0; i < TISSUES_MAX; i++) {
        struct sending *sending = &viewer->sendings[i];
        if (!sending->payload)
            continue;
        if (!chunk_say(sending->payload, sending->index, &live->chunk, batch))
            return true;
        if (++sending->index == chunk_count(sending->payload))
            mesh_payload_release(&sending->payload);
        break;
    }
    for (int i = 0; i < TISSUES_MAX; i++)
        if (viewer->sendings[i].payload)
            return true;
    return false;
}

static void send_words(struct live_server *live, struct viewer *viewer) {
    const struct mesh_words *words = &viewer->words;
    int64_t now_ns = clock_now_ns();
    if (!words->asks && !words->ack_count)
        return;
    if (words->asks ? !bucket_take(&viewer->asks, ASKS_HZ, ASKS_BURST, now_ns)
                    : !bucket_take(&viewer->acks, ACKS_HZ, ACKS_BURST, now_ns))
        return;
    struct mesh_request request = {.station = viewer->station,
                                   .session = viewer->session,
                                   .mailbox = mailbox_hold(viewer->mailbox),
                                   .mismatch = viewer->watch.mismatch,
                                   .words = *words};
    if (runtime_mesh_request(sessions_runtime(live->sessions), &request))
        viewer->words = (struct mesh_words){.asks = false};
    else
        mailbox_release(&request.mailbox); // the next batch tries again
}

void follow_meshes(struct live_server *live, struct viewer *viewer, const arthron_Page *message) {
    if (!viewer->mailbox || !viewer->introduced)
        return;
    if (message->which_message == arthron_Page_mesh_ask_tag)
        mesh_words_ask(&viewer->words, &message->message.mesh_ask);
    else
        mesh_words_ack(&viewer->words, &message->message.mesh_ack);
    send_words(live, viewer);
}

// ---- all of one station -------------------------------------------------------------------------

static void put_metrics(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                        struct live_batch *batch) {
    struct station_cache *cache = &live->cache[viewer->station];
    cache_metrics(live, viewer->station, now_ns);
    if (viewer->metrics_ns == cache->metrics_ns || cache->metrics_of != viewer->session)
        return;
    if (batch_put(batch, cache->metrics, cache->metrics_size))
        viewer->metrics_ns = cache->metrics_ns;
}

static void put_what_moves(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                           struct live_batch *batch) {
    struct sent_state *sent = &viewer->sent[viewer->station];
    const struct station_cache *cache = &live->cache[viewer->station];
    bool examined = is_examined(live, viewer);
    if (!examined)
        put_remarks(live, viewer, batch);
    put_markers(live, viewer, batch);
    put_resections(live, viewer, batch);
    put_attempt(live, viewer, viewer->station, sent, batch);
    put_moment(cache, sent, batch);
    if (!examined)
        put_metrics(live, viewer, now_ns, batch);
}

int64_t follow_station(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                       struct live_batch *batch) {
    if (now_ns >= viewer->due_ns) {
        cache_refresh(live, viewer->station, now_ns, viewer->period_ns / 2);
        cache_place(live, viewer->station, now_ns);
        bool introduced = introduce(live, viewer, batch);
        if (is_staff(viewer))
            put_place(live, viewer, viewer->station, &viewer->sent[viewer->station], batch);
        if (introduced && viewer->session)
            put_what_moves(live, viewer, now_ns, batch);
        if (!batch->full)
            viewer->due_ns = next_due(viewer, now_ns);
    }
    if (!viewer->introduced || !viewer->mailbox)
        return viewer->due_ns;
    send_words(live, viewer);
    return put_chunk(live, viewer, batch) ? now_ns : viewer->due_ns;
}
