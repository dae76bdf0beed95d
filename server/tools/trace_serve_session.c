#include "trace_serve_session.h"

#include "base/check.h"
#include "base/clock.h"
#include "export/inputs.h"
#include "export/tissue_states.h"
#include "igtl/names.h"
#include "trace_serve_attempt.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#define BETWEEN_ROUNDS_NS (10 * NS_PER_MS)

struct served_session {
    struct walk walk;
    struct contents contents;
    struct tissue_states tissue;
    struct served_attempt attempt;
    struct served_counts counts;
    struct sample newest[CHANNEL_COUNT]; // poses and the joint, as they were measured
    bool known[CHANNEL_COUNT];
    int64_t first_ns, last_ns; // of the steps, on the session's clock
    int64_t later_ns;          // by which a further round is later
    enum session_state first_state;
    // Of the round that is on:
    struct igtl_server *server;
    bool (*wait)(void *user, double seconds);
    void *user;
    bool begun, ended;
    enum session_state state;
    int next_cut;
    int64_t step_ns; // of the last step
};

static int64_t utc_of(const struct served_session *s, int64_t time_ns) {
    const struct trace_header *h = &s->contents.header;
    uint64_t since_ns = (uint64_t)time_ns - (uint64_t)h->start_ns + (uint64_t)s->later_ns;
    int64_t utc_ns = (int64_t)((uint64_t)h->start_utc_ns + since_ns);
    return utc_ns < 0 ? 0 : utc_ns;
}

// The server's thread never waits, so there is soon room again.
static void wait_for_room(void) {
    nanosleep(&(struct timespec){.tv_nsec = NS_PER_MS}, NULL);
}

// ---- meshes -------------------------------------------------------------------------------------

static void put_tissue(struct served_session *s, int tissue, const struct mesh *mesh,
                       int64_t utc_ns) {
    const struct scene *scene = s->walk.request->scene;
    struct igtl_mesh out = {.utc_ns = utc_ns,
                            .vertex_count = (int)mesh->vertex_count,
                            .triangle_count = (int)mesh->triangle_count,
                            .positions = mesh->positions,
                            .triangles = mesh->triangles};
    igtl_mesh_name(scene_case(scene)->groups[scene_tissue_group(scene, tissue)].name, out.name);
    igtl_server_put_mesh(s->server, &out);
    s->counts.meshes++;
}

static void put_first_meshes(struct served_session *s) {
    const struct scene *scene = s->walk.request->scene;
    for (int i = 0; scene && i < scene_tissue_count(scene); i++)
        put_tissue(s, i, &s->tissue.before[i], utc_of(s, s->first_ns));
}

static void put_cut_meshes(struct served_session *s, const struct session_output *o) {
    const struct tissue_states *tissue = &s->tissue;
    for (; s->next_cut < tissue->cut_count && tissue->cuts[s->next_cut].step <= o->step;
         s->next_cut++) {
        const struct cut_mesh_state *cut = &tissue->cuts[s->next_cut];
        put_tissue(s, cut->tissue, &cut->mesh, utc_of(s, o->time_ns));
    }
}

// ---- strings and the state ----------------------------------------------------------------------

static void put_string(struct served_session *s, const char *device, const char *text,
                       int64_t time_ns) {
    while (!igtl_server_put_string(s->server, device, text, utc_of(s, time_ns)))
        wait_for_room();
    s->counts.strings++;
}

static void put_state(struct served_session *s, const struct session_output *o) {
    struct igtl_state state =
        igtl_session_state(session_state_name(o->state), utc_of(s, o->time_ns));
    if (s->begun && s->state == o->state)
        return;
    while (!igtl_server_put_status(s->server, &state))
        wait_for_room();
    s->state = o->state;
}

static void put_events(struct served_session *s, const struct session_output *o) {
    for (int i = 0; i < EVENT_COUNT; i++) {
        bool state = 1U << i == EVENT_STATE;
        if (o->events & 1U << i)
            put_string(s, IGTL_EVENTS, state ? session_state_name(o->state) : event_name(i),
                       o->time_ns);
    }
}

static void on_remark(void *user, const struct remark *remark) {
    struct served_session *s = user;
    char text[REMARK_DESCRIPTION_SIZE];
    remark_describe(remark, text);
    put_string(s, IGTL_REMARKS, text, remark->time_ns);
}

static void on_marker(void *user, const struct marker *marker) {
    struct served_session *s = user;
    char text[IGTL_MARKER_SIZE];
    igtl_marker_text(marker, text);
    put_string(s, IGTL_MARKERS, text, marker->time_ns);
}

// ---- attempts -----------------------------------------------------------------------------------

static void put_attempt(struct served_session *s, int64_t time_ns) {
    struct igtl_attempt_word word;
    while (served_attempt_next(&s->attempt, utc_of(s, time_ns), &word))
        put_string(s, word.device, word.text, time_ns);
}

static void on_begun(void *user, const struct trace_attempt *begun) {
    struct served_session *s = user;
    served_attempt_begin(&s->attempt, begun);
    put_attempt(s, s->step_ns);
}

static void on_ended(void *user, const struct trace_outcome *ended) {
    struct served_session *s = user;
    served_attempt_end(&s->attempt, ended);
    put_attempt(s, s->step_ns);
}

// ---- poses --------------------------------------------------------------------------------------

static void take_samples(struct served_session *s, const struct frame *frame) {
    for (int i = 0; i < frame->count; i++) {
        const struct sample *sample = &frame->samples[i];
        if (sample->kind != SAMPLE_POSE && sample->kind != SAMPLE_JOINT)
            continue;
        s->newest[sample->channel] = *sample;
        s->known[sample->channel] = true;
    }
}

static void add_pose(struct igtl_poses *set, enum channel channel, bool shown,
                     enum validity validity, int64_t utc_ns, pose p) {
    struct igtl_pose *out = &set->poses[set->count++];
    *out = (struct igtl_pose){.validity = validity, .utc_ns = utc_ns, .T_world_body = p};
    igtl_pose_name(channel, shown, out->name);
}

// An untracked femur is the mock-up's own frame, and never lost.
static void add_bone(const struct served_session *s, const struct session_output *o, int bone,
                     struct igtl_poses *set) {
    enum channel channel = (enum channel)(CHANNEL_FEMUR + bone);
    enum channel source = s->known[channel] ? channel : CHANNEL_JOINT;
    int64_t time_ns = s->known[source] ? s->newest[source].time_ns : o->time_ns;
    enum validity validity = o->joint_validity;
    if (channel == CHANNEL_FEMUR)
        validity = s->known[channel] ? s->newest[channel].validity : VALIDITY_OK;
    add_pose(set, channel, false, validity, utc_of(s, time_ns), o->T_mockup_body[bone]);
    add_pose(set, channel, true, validity, utc_of(s, time_ns), o->T_mockup_virtual[bone]);
}

static void add_instrument(const struct served_session *s, const struct session_output *o, int i,
                           struct igtl_poses *set) {
    enum channel channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + i);
    const struct instrument_output *tool = &o->instruments[i];
    if (!tool->present)
        return;
    int64_t utc_ns = utc_of(s, s->known[channel] ? s->newest[channel].time_ns : o->time_ns);
    add_pose(set, channel, false, tool->validity, utc_ns, tool->T_mockup_tip);
    add_pose(set, channel, true, tool->validity, utc_ns, tool->T_mockup_warped);
}

static void put_poses(struct served_session *s, const struct trace_record *record) {
    const struct session_output *o = &record->output;
    struct igtl_poses set = {.utc_ns = utc_of(s, o->time_ns)};
    if (record->input.kind != INPUT_FRAME)
        return;
    take_samples(s, &record->input.frame);
    for (int i = 0; i < BODY_COUNT; i++)
        add_bone(s, o, i, &set);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        add_instrument(s, o, i, &set);
    while (!igtl_server_put_poses(s->server, &set))
        wait_for_room();
    s->counts.sets++;
}

// ---- the session --------------------------------------------------------------------------------

static bool on_served_step(void *user, const struct trace_record *record, double seconds) {
    struct served_session *s = user;
    const struct session_output *o = &record->output;
    (void)seconds;
    if (!s->wait(s->user, (double)(o->time_ns - s->first_ns) / (double)NS_PER_S)) {
        s->ended = true;
        return false;
    }
    put_poses(s, record);
    put_state(s, o);
    put_events(s, o);
    put_cut_meshes(s, o);
    served_attempt_step(&s->attempt, record);
    put_attempt(s, o->time_ns);
    s->begun = true;
    s->step_ns = o->time_ns;
    return true;
}

static bool note_times(void *user, const struct trace_record *record, double seconds) {
    struct served_session *s = user;
    (void)seconds;
    if (!s->begun) {
        s->first_ns = record->output.time_ns;
        s->first_state = record->output.state;
    }
    s->last_ns = record->output.time_ns;
    s->begun = true;
    return true;
}

enum result served_session_create(const struct export_request *request,
                                  struct served_session **out_session, struct error *err) {
    struct served_session *s = alloc(1, sizeof *s);
    s->walk = (struct walk){.request = request, .passes = request->scene ? 2 : 1};
    enum result result = contents_read(request, &s->contents, err);
    if (result == RESULT_OK)
        result = walk_run(&s->walk, &s->contents, note_times, s, err);
    s->attempt.scene = request->scene;
    s->attempt.header = &s->contents.header;
    if (result == RESULT_OK && request->scene)
        result = tissue_states_read(&s->walk, &s->tissue, err);
    *out_session = s;
    if (result != RESULT_OK)
        served_session_destroy(out_session);
    return result;
}

void served_session_destroy(struct served_session **session) {
    if (*session) {
        tissue_states_fini(&(*session)->tissue);
        served_attempt_clear(&(*session)->attempt);
    }
    free(*session);
    *session = NULL;
}

const struct trace_header *served_session_header(const struct served_session *session) {
    return &session->contents.header;
}

double served_session_seconds(const struct served_session *session) {
    return (double)(session->last_ns - session->first_ns) / (double)NS_PER_S;
}

static void begin_round(struct served_session *s, struct igtl_server *server) {
    s->server = server;
    s->begun = false;
    s->next_cut = 0;
    served_attempt_clear(&s->attempt);
    memset(s->known, 0, sizeof s->known);
}

void served_session_show(struct served_session *session, struct igtl_server *server) {
    begin_round(session, server);
    struct session_output first = {.state = session->first_state, .time_ns = session->first_ns};
    put_state(session, &first);
    put_first_meshes(session);
}

enum result served_session_play(struct served_session *session, struct igtl_server *server,
                                bool (*wait)(void *user, double seconds), void *user,
                                struct error *err) {
    struct served_session *s = session;
    if (s->counts.rounds++ > 0) {
        s->later_ns += s->last_ns - s->first_ns + BETWEEN_ROUNDS_NS;
        served_session_show(s, server);
    }
    s->wait = wait;
    s->user = user;
    s->walk.remark = on_remark;
    s->walk.marker = on_marker;
    s->walk.begun = on_begun;
    s->walk.ended = on_ended;
    return walk_run(&s->walk, &s->contents, on_served_step, s, err);
}

struct served_counts served_session_counts(const struct served_session *session) {
    return session->counts;
}

enum result served_session_end(const struct served_session *session, struct error *err) {
    return contents_end(&session->contents, err);
}
