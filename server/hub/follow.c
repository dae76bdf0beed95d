// What goes to the pages that follow a wall or one station: the newest only, as fast as they draw.
#include "base/check.h"
#include "base/clock.h"
#include "hub/reply.h"
#include "hub/viewer.h"

#include <stdio.h>
#include <string.h>

#define REMARKS_AT_ONCE 16

// Pages of the same rate are due at the same times, so that one moment serves them all.
static int64_t next_due(const struct viewer *viewer, int64_t now_ns) {
    return (now_ns / viewer->period_ns + 1) * viewer->period_ns;
}

// False where the batch is full.
static bool put_moment(const struct shown *shown, struct sent *sent, struct batch *batch) {
    if (!shown->item_size ||
        (sent->session == shown->item_session && sent->step == shown->item_step))
        return true;
    if (!batch_put(batch, shown->item, shown->item_size))
        return false;
    sent->session = shown->item_session;
    sent->step = shown->item_step;
    return true;
}

static bool put_place(const struct shown *shown, struct sent *sent, struct batch *batch) {
    if (sent->place == shown->place_number)
        return true;
    if (!batch_put(batch, shown->place, shown->place_size))
        return false;
    sent->place = shown->place_number;
    return true;
}

// ---- the wall -----------------------------------------------------------------------------------

int64_t follow_wall(struct audience *a, struct viewer *viewer, int64_t now_ns,
                    struct batch *batch) {
    if (now_ns < viewer->due_ns)
        return viewer->due_ns;
    int count = a->hub->config.station_count;
    for (int i = 0; i < count; i++) {
        int seat = (viewer->turn + i) % count;
        struct sent *sent = &viewer->sent[seat];
        shown_refresh(a, seat, now_ns, viewer->period_ns / 2);
        shown_place(a, seat, now_ns);
        if (!put_place(&a->shown[seat], sent, batch) || !put_moment(&a->shown[seat], sent, batch)) {
            viewer->turn = seat;
            return now_ns;
        }
    }
    return viewer->due_ns = next_due(viewer, now_ns);
}

// ---- one station --------------------------------------------------------------------------------

static void clear_sendings(struct viewer *viewer) {
    for (int i = 0; i < TISSUES_MAX; i++)
        mesh_payload_release(&viewer->sendings[i].payload);
}

void follow_end(struct viewer *viewer) {
    clear_sendings(viewer);
    if (viewer->tray) {
        tray_leave(viewer->tray);
        tray_release(&viewer->tray);
    }
    viewer->seat = -1;
    viewer->introduced = viewer->barred = false;
    viewer->turn = 0;
}

static void fill_session(struct audience *a, const struct viewer *viewer,
                         arthron_LiveSession *out) {
    const struct about *about = &a->shown[viewer->seat].about;
    const struct hub *hub = a->hub;
    const struct hub_station *station = hub->seats[viewer->seat].station;
    *out = (arthron_LiveSession){.seat = (uint32_t)viewer->seat,
                                 .optic_deg = (float)station->optic.tilt_deg,
                                 .optic_view_deg = (float)station->optic.field_deg};
    snprintf(out->station, sizeof out->station, "%s", station->name);
    if (!about->session)
        return;
    const struct knee_case *knee = scene_case(hub->scenes[about->scene]);
    memcpy(out->id, about->id, sizeof out->id);
    snprintf(out->trainee, sizeof out->trainee, "%s", about->trainee);
    snprintf(out->case_name, sizeof out->case_name, "%s", hub->config.cases[about->scene].name);
    memcpy(out->own_case, out->case_name, sizeof out->own_case);
    out->case_hash = knee->hash;
    out->start_utc_ns = about->start_utc_ns;
    out->strength = (float)about->strength;
}

// A trainee sees the sessions that are the trainee's own.
static bool may_see(const struct viewer *viewer, const struct about *about) {
    if (is_staff(viewer))
        return true;
    return viewer->role == ROLE_TRAINEE && about->session && viewer->guest.trainee[0] &&
           !strcmp(viewer->guest.trainee, about->trainee);
}

// A new session, from its first step on: then its theatre knows of it, too.
static bool introduce(struct audience *a, struct viewer *viewer, struct batch *batch) {
    const struct shown *shown = &a->shown[viewer->seat];
    if (viewer->introduced && viewer->session == shown->about.session)
        return true;
    if (!may_see(viewer, &shown->about)) {
        if (!viewer->barred)
            viewer_trouble(viewer, arthron_Trouble_Kind_NOT_THERE,
                           "there is no session of yours at %s",
                           a->hub->seats[viewer->seat].station->name);
        viewer->barred = true;
        return viewer->introduced = false;
    }
    if (shown->moment.session != shown->about.session)
        return viewer->introduced;
    a->item = (arthron_Live){.which_message = arthron_Live_session_tag};
    fill_session(a, viewer, &a->item.message.session);
    if (!batch_say(batch, &a->item))
        return false;
    clear_sendings(viewer);
    viewer->introduced = true;
    viewer->barred = false;
    viewer->session = shown->about.session;
    viewer->remarks = 0;
    memset(viewer->remarked, 0, sizeof viewer->remarked);
    viewer->metrics_ns = 0;
    memset(viewer->resected, 0, sizeof viewer->resected);
    return true;
}

// The next few that the page has not as they are now. True where these are all.
static bool take_remarks(struct audience *a, const struct viewer *viewer,
                         struct kept_remark out[REMARKS_AT_ONCE], int *out_count,
                         uint64_t *out_revision) {
    const struct remarks *remarks = &a->hub->seats[viewer->seat].remarks;
    bool all = true;
    *out_count = 0;
    pthread_mutex_lock(&a->hub->card_lock);
    *out_revision = remarks->revision;
    bool fresh = remarks->session == viewer->session && remarks->revision != viewer->remarks;
    for (int i = 0; fresh && all && i < remarks->count; i++) {
        if (remarks->all[i].revision == viewer->remarked[i])
            continue;
        all = *out_count < REMARKS_AT_ONCE;
        if (all)
            out[(*out_count)++] = remarks->all[i];
    }
    pthread_mutex_unlock(&a->hub->card_lock);
    return all;
}

static void put_remarks(struct audience *a, struct viewer *viewer, struct batch *batch) {
    struct kept_remark remarks[REMARKS_AT_ONCE];
    uint64_t revision;
    int count;
    bool all = take_remarks(a, viewer, remarks, &count, &revision);
    for (int i = 0; i < count; i++) {
        a->item = (arthron_Live){.which_message = arthron_Live_remark_tag};
        remark_to_wire(&remarks[i].remark, a->shown[viewer->seat].about.start_ns,
                       &a->item.message.remark);
        if (!batch_say(batch, &a->item))
            return;
        viewer->remarked[remarks[i].remark.number - 1] = remarks[i].revision;
    }
    if (all)
        viewer->remarks = revision;
    else
        batch->full = true;
}

// ---- resections ---------------------------------------------------------------------------------

static bool is_told(const struct viewer *viewer, int tissue, const struct tissue_figures *f) {
    const struct tissue_figures *told = &viewer->figures[tissue];
    return viewer->resected[tissue] && told->mesh_number == f->mesh_number &&
           told->refused == f->refused;
}

static void put_resections(struct audience *a, struct viewer *viewer, struct batch *batch) {
    const struct card *card = &a->hub->seats[viewer->seat].card;
    const struct scene *scene = a->hub->scenes[a->shown[viewer->seat].about.scene];
    struct tissue_figures figures[TISSUES_MAX];
    uint64_t hashes[TISSUES_MAX];
    pthread_mutex_lock(&a->hub->card_lock);
    bool there = card->figures_of == viewer->session;
    memcpy(figures, card->tissues, sizeof figures);
    memcpy(hashes, card->mesh_hashes, sizeof hashes);
    pthread_mutex_unlock(&a->hub->card_lock);
    for (int i = 0; there && i < scene_tissue_count(scene); i++) {
        if (is_told(viewer, i, &figures[i]))
            continue;
        a->item = (arthron_Live){.which_message = arthron_Live_resection_tag};
        reply_resection(&figures[i], scene_case(scene)->groups[scene_tissue_group(scene, i)].name,
                        hashes[i], &a->item.message.resection);
        if (!batch_say(batch, &a->item))
            return;
        viewer->resected[i] = true;
        viewer->figures[i] = figures[i];
    }
}

// ---- meshes -------------------------------------------------------------------------------------

static void take_payloads(struct viewer *viewer) {
    for (int i = 0; i < TISSUES_MAX; i++) {
        uint64_t session;
        struct mesh_payload *payload = tray_take(viewer->tray, i, &session);
        if (payload && session == viewer->session) {
            mesh_payload_release(&viewer->sendings[i].payload);
            viewer->sendings[i] = (struct sending){payload, 0};
        } else {
            mesh_payload_release(&payload);
        }
    }
}

// One chunk in a batch, so that what moves does not wait for what is large. True: more is to come.
static bool put_chunk(struct audience *a, struct viewer *viewer, struct batch *batch) {
    take_payloads(viewer);
    for (int i = 0; i < TISSUES_MAX; i++) {
        struct sending *sending = &viewer->sendings[i];
        if (!sending->payload)
            continue;
        if (!chunk_say(sending->payload, sending->index, &a->chunk, batch))
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

bool follow_meshes(struct audience *a, struct viewer *viewer, const arthron_Page *message) {
    if (!viewer->tray || !viewer->introduced)
        return true;
    struct look look = {.seat = viewer->seat,
                        .session = viewer->session,
                        .asks = message->which_message == arthron_Page_mesh_ask_tag};
    if (look.asks)
        look.ask = message->message.mesh_ask;
    else
        look.ack = message->message.mesh_ack;
    look.tray = tray_hold(viewer->tray);
    if (theatre_look(seat_worker(a->hub, viewer->seat)->theatre, &look))
        return true;
    tray_release(&look.tray);
    return false;
}

// ---- all of one station -------------------------------------------------------------------------

static void put_metrics(struct audience *a, struct viewer *viewer, int64_t now_ns,
                        struct batch *batch) {
    struct shown *shown = &a->shown[viewer->seat];
    shown_metrics(a, viewer->seat, now_ns);
    if (viewer->metrics_ns == shown->metrics_ns || shown->metrics_of != viewer->session)
        return;
    if (batch_put(batch, shown->metrics, shown->metrics_size))
        viewer->metrics_ns = shown->metrics_ns;
}

static void put_what_moves(struct audience *a, struct viewer *viewer, int64_t now_ns,
                           struct batch *batch) {
    struct sent *sent = &viewer->sent[viewer->seat];
    const struct shown *shown = &a->shown[viewer->seat];
    put_remarks(a, viewer, batch);
    put_resections(a, viewer, batch);
    put_moment(shown, sent, batch);
    put_metrics(a, viewer, now_ns, batch);
}

int64_t follow_station(struct audience *a, struct viewer *viewer, int64_t now_ns,
                       struct batch *batch) {
    const struct shown *shown = &a->shown[viewer->seat];
    if (now_ns >= viewer->due_ns) {
        shown_refresh(a, viewer->seat, now_ns, viewer->period_ns / 2);
        shown_place(a, viewer->seat, now_ns);
        bool introduced = introduce(a, viewer, batch);
        if (is_staff(viewer))
            put_place(shown, &viewer->sent[viewer->seat], batch);
        if (introduced && viewer->session)
            put_what_moves(a, viewer, now_ns, batch);
        if (!batch->full)
            viewer->due_ns = next_due(viewer, now_ns);
    }
    bool more = viewer->introduced && viewer->tray && put_chunk(a, viewer, batch);
    return more ? now_ns : viewer->due_ns;
}
