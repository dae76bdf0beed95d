#include "view/openigtlink.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "igtl/attempt.h"
#include "igtl/names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EVENT_BITS (sizeof((arthron_View){0}.events) / sizeof(uint32_t))
#define STATE_EVENT 0 // the session's state changed: its name is told
#define NO_VERTEX UINT32_MAX
#define CLOSE_NS 10000 // two readings of clocks
#define TRIES 4

// Of the bits of Reply.events (PROTOCOL.md); those without a name are not told.
static const char *const event_names[] = {"state",   "device_lost", "device_back", "contact",
                                          "release", "cut",         "piece",       "refused",
                                          "undone",  "grasped",     "dropped",     "taken_out"};

struct openigtlink {
    struct igtl_server *server;
    bool was_watched; // when something was shown, and since
    bool has_state;
    arthron_SessionState state;
    uint32_t events[EVENT_BITS]; // that were told, or came while nobody watched
    struct igtl_attempt_told attempt;
};

static void log_address(const char *address, int port) {
    bool own = !address[0] || !strncmp(address, "127.", 4) || !strcmp(address, "::1");
    log_info("openigtlink", "serving at %s, port %d", address[0] ? address : "127.0.0.1", port);
    if (!own)
        log_warning("openigtlink", "whoever reaches %s can read, and nothing is encrypted",
                    address);
}

enum result openigtlink_create(const struct igtl_server_config *config, struct openigtlink **out,
                               struct error *err) {
    struct igtl_server_config whole = *config;
    struct openigtlink *o = alloc(1, sizeof *o);
    snprintf(whole.device, sizeof whole.device, "%s", IGTL_DEVICE);
    enum result result = igtl_server_create(&whole, &o->server, err);
    if (result == RESULT_OK)
        log_address(whole.address, openigtlink_port(o));
    else
        openigtlink_destroy(&o);
    *out = o;
    return result;
}

void openigtlink_destroy(struct openigtlink **outlet) {
    if (!*outlet)
        return;
    igtl_server_destroy(&(*outlet)->server);
    free(*outlet);
    *outlet = NULL;
}

int openigtlink_port(const struct openigtlink *o) {
    return igtl_server_port(o->server);
}

// UTC less the monotonic clock. Where the thread was interrupted between the two, it looks again.
static int64_t utc_ahead(void) {
    int64_t shortest_ns = INT64_MAX, ahead_ns = 0;
    for (int i = 0; i < TRIES && shortest_ns > CLOSE_NS; i++) {
        int64_t before_ns = clock_now_ns(), utc_ns = clock_utc_ns(), after_ns = clock_now_ns();
        if (after_ns - before_ns >= shortest_ns)
            continue;
        shortest_ns = after_ns - before_ns;
        ahead_ns = utc_ns - before_ns - shortest_ns / 2;
    }
    return ahead_ns;
}

// ---- poses --------------------------------------------------------------------------------------

static void add(struct igtl_poses *set, enum channel channel, bool shown, arthron_Validity validity,
                int64_t utc_ns, const arthron_Pose *p) {
    struct igtl_pose *out = &set->poses[set->count++];
    *out = (struct igtl_pose){
        .validity = (enum validity)validity, .utc_ns = utc_ns, .T_world_body = wire_pose_to(p)};
    igtl_pose_name(channel, shown, out->name);
}

static void add_instrument(struct igtl_poses *set, const arthron_ViewInstrument *i,
                           int64_t utc_ahead_ns) {
    enum channel channel = (enum channel)i->channel;
    int64_t utc_ns = i->time_ns + utc_ahead_ns;
    if (i->has_tip)
        add(set, channel, false, i->validity, utc_ns, &i->tip);
    if (i->has_warped)
        add(set, channel, true, i->warp_validity, utc_ns, &i->warped);
}

static struct igtl_poses poses_of(const arthron_View *view, int64_t utc_ahead_ns) {
    _Static_assert(2 * (sizeof view->bodies / sizeof *view->bodies +
                        sizeof view->instruments / sizeof *view->instruments) <=
                       IGTL_POSES_MAX,
                   "a set has room for all");
    struct igtl_poses set = {.utc_ns = view->time_ns + utc_ahead_ns};
    for (pb_size_t i = 0; i < view->bodies_count; i++) {
        const arthron_ViewBody *body = &view->bodies[i];
        enum channel channel = (enum channel)(CHANNEL_FEMUR + (int)body->body);
        add(&set, channel, false, body->validity, set.utc_ns, &body->pose);
        add(&set, channel, true, body->validity, set.utc_ns, &body->virtual_pose);
    }
    for (pb_size_t i = 0; i < view->instruments_count; i++)
        add_instrument(&set, &view->instruments[i], utc_ahead_ns);
    return set;
}

// ---- events and the state -----------------------------------------------------------------------

static const char *state_name(arthron_SessionState state) {
    static const char *const names[] = {"waiting", "running", "paused", "closed"};
    return (size_t)state < sizeof names / sizeof *names ? names[state] : "unknown";
}

// However often it came since the last time, it is told once.
static void tell_events(struct openigtlink *o, const arthron_View *view, int64_t utc_ns) {
    for (unsigned bit = 0; bit < sizeof event_names / sizeof *event_names; bit++) {
        bool state = bit == STATE_EVENT;
        if (view->events[bit] != o->events[bit])
            igtl_server_put_string(o->server, IGTL_EVENTS,
                                   state ? state_name(view->state) : event_names[bit], utc_ns);
    }
}

// ---- the attempt --------------------------------------------------------------------------------

_Static_assert(sizeof((arthron_ViewAttempt){0}.goals) / sizeof(arthron_AttemptGoal) ==
                       IGTL_GOALS_MAX &&
                   sizeof((arthron_ViewAttempt){0}.errors) / sizeof(arthron_AttemptError) ==
                       IGTL_ERRORS_MAX &&
                   sizeof((arthron_AttemptGoal){0}.name) == IGTL_TASK_NAME_SIZE &&
                   sizeof((arthron_AttemptError){0}.name) == IGTL_TASK_NAME_SIZE &&
                   sizeof((arthron_ViewAttempt){0}.task) == IGTL_TASK_NAME_SIZE,
               "all of an attempt can be told");
_Static_assert((int)arthron_AttemptState_End_ENDED == ATTEMPT_END_COUNT &&
                   (int)arthron_AttemptState_Verdict_NOT_YET == VERDICT_NOT_YET &&
                   (int)arthron_AttemptState_Purpose_EXAM == ATTEMPT_EXAM &&
                   (int)arthron_AttemptState_Hand_LEFT_HAND == ATTEMPT_LEFT_HAND,
               "words of the wire are those of base/attempt_words.h");

static struct igtl_attempt attempt_of(const arthron_View *view) {
    const arthron_ViewAttempt *a = &view->attempt;
    if (!view->has_attempt)
        return (struct igtl_attempt){.number = 0};
    struct igtl_attempt out = {.number = a->number,
                               .purpose = (enum attempt_purpose)a->purpose,
                               .hand = (enum attempt_hand)a->hand,
                               .time_s = 1e-9 * (double)a->time_ns,
                               .limit_s = a->limit_s,
                               .goal_count = a->goals_count,
                               .error_count = a->errors_count,
                               .ended = a->end != arthron_AttemptState_End_RUNS,
                               .verdict = (enum verdict)a->verdict};
    if (a->end != arthron_AttemptState_End_ENDED)
        out.end = (enum attempt_end)a->end;
    memcpy(out.task, a->task, sizeof out.task);
    for (int i = 0; i < out.goal_count; i++) {
        memcpy(out.goals[i].name, a->goals[i].name, sizeof out.goals[i].name);
        out.goals[i].met = a->goals[i].has_met_ns;
    }
    for (int i = 0; i < out.error_count; i++) {
        memcpy(out.errors[i].name, a->errors[i].name, sizeof out.errors[i].name);
        out.errors[i].count = a->errors[i].count;
    }
    return out;
}

static void tell_attempt(struct openigtlink *o, const arthron_View *view, int64_t utc_ns) {
    struct igtl_attempt now = attempt_of(view);
    struct igtl_attempt_word word;
    if (!o->was_watched)
        o->attempt = (struct igtl_attempt_told){.last = now};
    while (igtl_attempt_next(&o->attempt, &now, utc_ns, &word))
        igtl_server_put_string(o->server, word.device, word.text, utc_ns);
}

void openigtlink_show(struct openigtlink *o, const arthron_View *view) {
    int64_t utc_ahead_ns = utc_ahead();
    struct igtl_poses set = poses_of(view, utc_ahead_ns);
    igtl_server_put_poses(o->server, &set);
    if (o->was_watched)
        tell_events(o, view, set.utc_ns);
    tell_attempt(o, view, set.utc_ns);
    o->was_watched = true;
    memcpy(o->events, view->events, sizeof o->events);
}

void openigtlink_mark(struct openigtlink *o, const struct marker *marker) {
    char text[IGTL_MARKER_SIZE];
    igtl_marker_text(marker, text);
    igtl_server_put_string(o->server, IGTL_MARKERS, text, marker->time_ns + utc_ahead());
}

static void tell_state(struct openigtlink *o, arthron_SessionState state) {
    struct igtl_state told = igtl_session_state(state_name(state), clock_utc_ns());
    o->has_state = igtl_server_put_status(o->server, &told);
    o->state = state;
}

bool openigtlink_follow(struct openigtlink *o, arthron_SessionState state) {
    bool watched = igtl_server_clients(o->server) > 0;
    if (!o->has_state || o->state != state)
        tell_state(o, state);
    o->was_watched &= watched;
    return watched;
}

// ---- meshes -------------------------------------------------------------------------------------

// The living vertices in a row; out_places: where each id is in it.
static float *pack_vertices(const struct tissue *tissue, uint32_t *out_places) {
    float *positions = alloc(3 * (size_t)tissue->vertex_count + 1, sizeof *positions);
    uint32_t count = 0;
    for (uint32_t v = 0; v < tissue->vertex_bound; v++) {
        out_places[v] = tissue->uses[v] ? count : NO_VERTEX;
        if (tissue->uses[v])
            memcpy(positions + 3 * (size_t)count++, tissue->positions + 3 * (size_t)v,
                   3 * sizeof *positions);
    }
    return positions;
}

static uint32_t *pack_triangles(const struct tissue *tissue, const uint32_t *places) {
    uint32_t *triangles = alloc(3 * (size_t)tissue->triangle_count + 1, sizeof *triangles);
    uint32_t *end = triangles;
    for (uint32_t t = 0; t < tissue->triangle_bound; t++)
        for (int corner = 0; corner < 3 && tissue_triangle_alive(tissue, t); corner++)
            *end++ = places[tissue->corners[3 * (size_t)t + (size_t)corner]];
    return triangles;
}

void openigtlink_mesh(void *outlet, const char *group, const struct tissue *tissue) {
    struct openigtlink *o = outlet;
    struct igtl_mesh mesh = {.utc_ns = clock_utc_ns(),
                             .vertex_count = (int)tissue->vertex_count,
                             .triangle_count = (int)tissue->triangle_count};
    uint32_t *places = alloc((size_t)tissue->vertex_bound + 1, sizeof *places);
    float *positions = pack_vertices(tissue, places);
    uint32_t *triangles = pack_triangles(tissue, places);
    mesh.positions = positions;
    mesh.triangles = triangles;
    igtl_mesh_name(group, mesh.name);
    if (mesh.name[0])
        igtl_server_put_mesh(o->server, &mesh);
    free(places);
    free(positions);
    free(triangles);
}
