#include "runtime/mesh_sender.h"

#include "base/check.h"
#include "base/log.h"
#include "runtime/reply.h"
#include "runtime/tissue_delta.h"

#include <string.h>

static const char *group_name(const struct session_runtime *session, int tissue) {
    int group = scene_tissue_group(session->scene, tissue);
    return scene_case(session->scene)->groups[group].name;
}

uint64_t mesh_sender_hash(const struct mesh_sender *s, int tissue) {
    const struct mesh_feed *feed = s->feeds[tissue];
    return feed ? mesh_feed_tissue(feed)->hash : 0;
}

static void send_meshes(struct mesh_sender *s) {
    for (int i = 0; i < TISSUES_MAX; i++) {
        struct mesh_payload *payload = NULL;
        if (s->feeds[i])
            payload = mesh_feed_next(s->feeds[i], &s->cursors[i]);
        if (payload)
            control_send_mesh(s->control, s->peer, payload);
        mesh_payload_release(&payload);
    }
    struct mesh_offer offer = {s->session->serial, s->session->operation, s->feeds, &s->mismatch};
    mesh_subscribers_serve(&s->subscribers, &offer);
}

static void send_figures(struct mesh_sender *s, int tissue) {
    arthron_Control message = {.which_message = arthron_Control_resection_tag};
    if (!s->cursors[tissue].asked)
        return;
    reply_resection(operation_figures(s->session->operation, tissue),
                    group_name(s->session, tissue), mesh_sender_hash(s, tissue),
                    &message.message.resection);
    control_send(s->control, s->peer, &message);
}

// ---- a session begins and ends ------------------------------------------------------------------

static void drop_feed(struct mesh_sender *s, int tissue, const struct error *err) {
    log_error("meshes", "%s: its mesh cannot be sent: %s", group_name(s->session, tissue),
              err->text);
    mesh_feed_destroy(&s->feeds[tissue]);
}

// Of a resumed session.
static void feed_changed(struct mesh_sender *s, int tissue) {
    const struct operation *operation = s->session->operation;
    struct mesh_delta whole;
    struct error err;
    tissue_delta_whole(operation_mesh(operation, tissue), &whole);
    whole.number = operation_figures(operation, tissue)->mesh_number;
    if (mesh_feed_create(group_name(s->session, tissue), &whole, &s->feeds[tissue], &err) !=
        RESULT_OK)
        drop_feed(s, tissue, &err);
    mesh_delta_fini(&whole);
}

void mesh_sender_open(struct mesh_sender *s, struct control *control,
                      const struct session_runtime *session, struct mesh_starts *starts) {
    s->control = control;
    s->session = session;
    for (int i = 0; i < scene_tissue_count(session->scene); i++) {
        if (operation_figures(session->operation, i)->mesh_number > 1) {
            feed_changed(s, i);
            continue;
        }
        const struct mesh_feed *start = mesh_starts_of(starts, session->scene, i);
        if (start)
            s->feeds[i] = mesh_feed_share(start);
    }
}

void mesh_sender_close(struct mesh_sender *s) {
    for (int i = 0; i < TISSUES_MAX; i++)
        mesh_feed_destroy(&s->feeds[i]);
    memset(s->cursors, 0, sizeof s->cursors);
    mesh_subscribers_forget(&s->subscribers);
    mismatch_feed_fini(&s->mismatch);
    s->session = NULL;
}

void mesh_sender_fini(struct mesh_sender *s) {
    mesh_subscribers_fini(&s->subscribers);
    mismatch_feed_fini(&s->mismatch);
}

// ---- what a job changed -------------------------------------------------------------------------

static void push_change(struct mesh_sender *s, const struct job_result *result) {
    struct mesh_feed *feed = s->feeds[result->tissue];
    const struct cut_mesh *mesh = operation_mesh(s->session->operation, result->tissue);
    if (!feed || mesh_feed_tissue(feed)->number == result->figures.mesh_number)
        return;
    struct mesh_delta delta;
    struct error err;
    if (result->change.made_count) {
        tissue_delta_of_change(mesh, &result->change, &delta);
    } else {
        tissue_delta_between(mesh_feed_tissue(feed), mesh, &delta);
        tissue_delta_add_pieces(&result->change, &delta);
    }
    if (mesh_feed_push(feed, &delta, &err) != RESULT_OK)
        drop_feed(s, result->tissue, &err);
    mesh_delta_fini(&delta);
}

void mesh_sender_push(struct mesh_sender *s, const struct job_result *result) {
    push_change(s, result);
    send_meshes(s);
    send_figures(s, result->tissue);
}

// ---- what the station and pages say -------------------------------------------------------------

static void take_ack(struct mesh_sender *s, const arthron_MeshState *ack) {
    for (int i = 0; i < scene_tissue_count(s->session->scene); i++)
        if (!strcmp(group_name(s->session, i), ack->group))
            mesh_cursor_ack(&s->cursors[i], ack);
}

static void take_ask(struct mesh_sender *s, const arthron_MeshAsk *ask) {
    for (int i = 0; i < scene_tissue_count(s->session->scene); i++) {
        mesh_cursor_ask(&s->cursors[i], group_name(s->session, i), ask);
        send_figures(s, i);
    }
}

void mesh_sender_take(struct mesh_sender *s, const struct mesh_words *words) {
    if (words->left)
        memset(s->cursors, 0, sizeof s->cursors);
    if (!words->asks && !words->ack_count)
        return;
    s->peer = words->peer;
    if (!s->session)
        return;
    if (words->asks)
        take_ask(s, &words->ask);
    for (int i = 0; i < words->ack_count; i++)
        take_ack(s, &words->acks[i]);
    send_meshes(s);
}

void mesh_sender_request(struct mesh_sender *s, const struct mesh_request *request) {
    const char *groups[TISSUES_MAX];
    if (!s->session || s->session->serial != request->session)
        return;
    int count = scene_tissue_count(s->session->scene);
    for (int i = 0; i < count; i++)
        groups[i] = group_name(s->session, i);
    mesh_subscribers_take(&s->subscribers, request, groups, count);
    send_meshes(s);
}
