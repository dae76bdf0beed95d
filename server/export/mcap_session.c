#include "export/export.h"
#include "export/inputs.h"
#include "export/look.h"
#include "export/mcap.h"
#include "export/mcap_messages.h"
#include "export/tissue_states.h"

#include <string.h>

#define FRAME_MOCKUP "mockup"
#define NAME_ROOM (CASE_NAME_MAX + 32)

// A frame of reference that moves in the mock-up's. Its name is that of its columns in a table.
struct moving_frame {
    char name[NAME_ROOM];
    uint16_t channel;
};

struct schemas {
    uint16_t transform, scene, log, joint, instrument, force, marker, resection, loose;
};

struct loose_frame {
    struct moving_frame frame;
    uint16_t told, mesh; // channels; mesh: where there is a case
    struct loose_output last;
};

struct recording {
    struct walk walk;
    struct contents contents;
    struct mcap *mcap;
    struct message message;
    struct schemas schemas;
    struct moving_frame bones[2][BODY_COUNT];       // physical, virtual
    struct moving_frame tools[2][INSTRUMENT_COUNT]; // as measured, as shown
    uint16_t tool_meshes[2][INSTRUMENT_COUNT];      // channels
    uint16_t group_meshes[2][CASE_GROUPS_MAX];      // physical, virtual
    uint16_t instruments[INSTRUMENT_COUNT], tissues[TISSUES_MAX];
    uint16_t forces[CHANNEL_COUNT];
    struct loose_frame loose[CASE_LOOSE_MAX];
    uint16_t joint, events, remarks, markers;
    struct tissue_states tissue;
    int next_cut;
    bool begun, shown[INSTRUMENT_COUNT];
};

static const struct knee_case *case_of(const struct recording *r) {
    return r->walk.request->scene ? scene_case(r->walk.request->scene) : NULL;
}

static uint64_t utc_of(const struct recording *r, int64_t time_ns) {
    const struct trace_header *h = &r->contents.header;
    int64_t utc_ns = (int64_t)((uint64_t)h->start_utc_ns + (uint64_t)(time_ns - h->start_ns));
    return utc_ns < 0 ? 0 : (uint64_t)utc_ns;
}

// ---- what there is ------------------------------------------------------------------------------

static uint16_t add_channel(struct recording *r, uint16_t schema, const char *folder,
                            const char *name) {
    char topic[NAME_ROOM + 32];
    snprintf(topic, sizeof topic, "%s%s", folder, name);
    return mcap_channel(r->mcap, schema, topic);
}

static void add_frame(struct recording *r, struct moving_frame *frame, const char *before,
                      const char *name, const char *after) {
    snprintf(frame->name, sizeof frame->name, "%s%s%s", before, name, after);
    frame->channel = add_channel(r, r->schemas.transform, "/pose/", frame->name);
}

static void add_schemas(struct recording *r) {
    struct {
        const char *name;
        uint16_t *out;
    } all[] = {{"foxglove.FrameTransform", &r->schemas.transform},
               {"foxglove.SceneUpdate", &r->schemas.scene},
               {"foxglove.Log", &r->schemas.log},
               {"arthron.session.Joint", &r->schemas.joint},
               {"arthron.session.Instrument", &r->schemas.instrument},
               {"arthron.session.Force", &r->schemas.force},
               {"arthron.session.Marker", &r->schemas.marker},
               {"arthron.session.Resection", &r->schemas.resection},
               {"arthron.session.Loose", &r->schemas.loose}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        *all[i].out = mcap_schema(r->mcap, all[i].name, mcap_schemas, mcap_schemas_size);
}

static void add_tool(struct recording *r, int i) {
    const char *name = channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + i));
    add_frame(r, &r->tools[0][i], "", name, "");
    add_frame(r, &r->tools[1][i], "", name, "_warped");
    for (int shown = 0; shown < 2; shown++)
        r->tool_meshes[shown][i] =
            add_channel(r, r->schemas.scene, "/mesh/instrument/", r->tools[shown][i].name);
    r->instruments[i] = add_channel(r, r->schemas.instrument, "/instrument/", name);
}

static void add_groups(struct recording *r) {
    const struct knee_case *knee = case_of(r);
    for (int i = 0; knee && i < knee->group_count; i++) {
        r->group_meshes[0][i] =
            add_channel(r, r->schemas.scene, "/mesh/mockup/", knee->groups[i].name);
        r->group_meshes[1][i] =
            add_channel(r, r->schemas.scene, "/mesh/patient/", knee->groups[i].name);
    }
}

static void record_tissues(struct recording *r) {
    const struct scene *scene = r->walk.request->scene;
    for (int i = 0; i < (scene ? scene_tissue_count(scene) : TISSUES_MAX); i++) {
        char number[16];
        snprintf(number, sizeof number, "%d", i);
        const char *name = scene ? case_of(r)->groups[scene_tissue_group(scene, i)].name : number;
        r->tissues[i] = add_channel(r, r->schemas.resection, "/resection/", name);
    }
}

static void record_loose(struct recording *r) {
    for (int i = 0; i < r->contents.header.loose_count; i++) {
        struct loose_frame *loose = &r->loose[i];
        char number[16];
        snprintf(number, sizeof number, "%d", i + 1);
        add_frame(r, &loose->frame, "loose_", number, "");
        loose->told = add_channel(r, r->schemas.loose, "/loose/", loose->frame.name);
        if (case_of(r))
            loose->mesh = add_channel(r, r->schemas.scene, "/mesh/loose/", loose->frame.name);
    }
}

static void add_channels(struct recording *r) {
    add_schemas(r);
    for (int i = 0; i < BODY_COUNT; i++) {
        add_frame(r, &r->bones[0][i], "", body_name((enum body)i), "");
        add_frame(r, &r->bones[1][i], "virtual_", body_name((enum body)i), "");
    }
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (r->contents.present[i])
            add_tool(r, i);
    for (int i = 0; i < CHANNEL_COUNT; i++)
        if (r->contents.sampled[i][SAMPLE_FORCE])
            r->forces[i] =
                add_channel(r, r->schemas.force, "/force/", channel_name((enum channel)i));
    r->joint = add_channel(r, r->schemas.joint, "/", "joint");
    r->events = add_channel(r, r->schemas.log, "/", "events");
    r->remarks = add_channel(r, r->schemas.log, "/", "remarks");
    r->markers = add_channel(r, r->schemas.marker, "/", "markers");
    add_groups(r);
    record_loose(r);
    if (r->contents.landed)
        record_tissues(r);
}

static void describe_recording(struct recording *r) {
    const struct trace_header *h = &r->contents.header;
    char session[2 * sizeof h->session_id + 1], hash[2 * TRACE_HASH_SIZE + 1];
    bytes_text(h->session_id, sizeof h->session_id, session);
    bytes_text(r->contents.hash, sizeof r->contents.hash, hash);
    const char *const pairs[] = {"session", session,      "station",    h->station,
                                 "case",    h->case_name, "trace_hash", hash};
    mcap_metadata(r->mcap, "arthron", pairs, sizeof pairs / sizeof *pairs / 2);
}

// ---- messages -----------------------------------------------------------------------------------

static void send(struct recording *r, uint16_t channel, uint64_t utc_ns) {
    mcap_message(r->mcap, channel, utc_ns, r->message.data, r->message.size);
}

static void send_pose(struct recording *r, uint64_t utc_ns, const struct moving_frame *frame,
                      pose p) {
    message_transform(&r->message, utc_ns, FRAME_MOCKUP, frame->name, p);
    send(r, frame->channel, utc_ns);
}

// The virtual surface of a group, or the given mesh of it.
static void send_group(struct recording *r, uint64_t utc_ns, int group, bool is_virtual,
                       const struct mesh *mesh) {
    const struct case_group *g = &case_of(r)->groups[group];
    float rgba[4];
    look_of_group(g, rgba);
    message_mesh(&r->message, utc_ns, r->bones[is_virtual][g->body].name, g->name, mesh, rgba);
    send(r, r->group_meshes[is_virtual][group], utc_ns);
}

static void send_tissue(struct recording *r, uint64_t utc_ns, int tissue, const struct mesh *mesh) {
    send_group(r, utc_ns, scene_tissue_group(r->walk.request->scene, tissue), true, mesh);
}

// All that does not change; tissue that is cut as it was before.
static void send_groups(struct recording *r, uint64_t utc_ns) {
    const struct knee_case *knee = case_of(r);
    if (!knee)
        return;
    for (int i = 0; i < knee->group_count; i++) {
        struct mesh mesh;
        send_group(r, utc_ns, i, false, &knee->groups[i].mesh);
        if (knee->groups[i].cuttable)
            continue;
        case_group_virtual(&knee->groups[i], &mesh);
        send_group(r, utc_ns, i, true, &mesh);
        mesh_fini(&mesh);
    }
    for (int i = 0; i < scene_tissue_count(r->walk.request->scene); i++)
        send_tissue(r, utc_ns, i, &r->tissue.before[i]);
}

// When an instrument comes, and when it goes.
static void send_tool_meshes(struct recording *r, uint64_t utc_ns, int i, bool present) {
    if (r->begun && present == r->shown[i])
        return;
    r->shown[i] = present;
    for (int shown = 0; shown < 2; shown++) {
        const char *name = r->tools[shown][i].name;
        struct mesh mesh;
        float rgba[4];
        look_instrument(&r->contents.header.settings.bodies[i], &mesh);
        look_of_instrument(&r->contents.header.settings.instruments.of[i], rgba);
        if (present)
            message_mesh(&r->message, utc_ns, name, name, &mesh, rgba);
        else
            message_no_mesh(&r->message, utc_ns, name);
        mesh_fini(&mesh);
        send(r, r->tool_meshes[shown][i], utc_ns);
    }
}

static const char *nearest_name_of(const struct recording *r, const struct warp *warp) {
    const struct knee_case *knee = case_of(r);
    return knee && warp->nearest >= 0 && warp->nearest < knee->group_count
               ? knee->groups[warp->nearest].name
               : "";
}

static void send_tool(struct recording *r, uint64_t utc_ns, const struct input_row *row, int i,
                      const struct instrument_output *o) {
    if (!r->contents.present[i])
        return;
    send_tool_meshes(r, utc_ns, i, o->present);
    if (!o->present)
        return;
    int channel = CHANNEL_FIRST_INSTRUMENT + i;
    uint64_t measured_ns = utc_of(r, row->samples[channel][SAMPLE_POSE].time_ns);
    send_pose(r, utc_ns, &r->tools[0][i], o->T_mockup_tip);
    send_pose(r, utc_ns, &r->tools[1][i], o->T_mockup_warped);
    message_instrument(&r->message, utc_ns,
                       row->sampled[channel][SAMPLE_POSE] ? &measured_ns : NULL,
                       nearest_name_of(r, &o->warp), o);
    send(r, r->instruments[i], utc_ns);
}

// When it comes, and when it leaves the knee.
static void send_loose_mesh(struct recording *r, uint64_t utc_ns, int i, bool is_out) {
    const struct loose_frame *loose = &r->loose[i];
    struct mesh mesh;
    float rgba[4];
    look_loose(case_of(r)->loose[i].radii_mm, &mesh, rgba);
    if (is_out)
        message_no_mesh(&r->message, utc_ns, loose->frame.name);
    else
        message_mesh(&r->message, utc_ns, loose->frame.name, loose->frame.name, &mesh, rgba);
    mesh_fini(&mesh);
    send(r, loose->mesh, utc_ns);
}

static void send_loose(struct recording *r, uint64_t utc_ns, int i, const struct loose_output *o) {
    struct loose_frame *loose = &r->loose[i];
    bool is_out = o->state == LOOSE_OUT, was_out = loose->last.state == LOOSE_OUT;
    if (!is_out)
        send_pose(r, utc_ns, &loose->frame, o->T_mockup_loose);
    if (case_of(r) && (!r->begun || is_out != was_out))
        send_loose_mesh(r, utc_ns, i, is_out);
    if (!r->begun || o->state != loose->last.state || o->carrier != loose->last.carrier) {
        message_loose(&r->message, utc_ns, case_of(r) ? case_of(r)->loose[i].name : "", o);
        send(r, loose->told, utc_ns);
    }
    loose->last = *o;
}

static void send_forces(struct recording *r, uint64_t utc_ns, const struct input_row *row) {
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        const struct sample *force = &row->samples[i][SAMPLE_FORCE];
        if (!row->sampled[i][SAMPLE_FORCE])
            continue;
        message_force(&r->message, utc_ns, utc_of(r, force->time_ns), force);
        send(r, r->forces[i], utc_ns);
    }
}

static void send_events(struct recording *r, uint64_t utc_ns, const struct session_output *o) {
    const uint32_t warnings = EVENT_DEVICE_LOST | EVENT_REFUSED;
    for (int i = 0; i < EVENT_COUNT; i++) {
        uint32_t event = 1U << i;
        if (!(o->events & event))
            continue;
        const char *text = event == EVENT_STATE ? session_state_name(o->state) : event_name(i);
        message_log(&r->message, utc_ns, event & warnings, text, event_name(i));
        send(r, r->events, utc_ns);
    }
}

static void send_landed(struct recording *r, uint64_t utc_ns, const struct session_output *o) {
    const struct tissue_states *tissue = &r->tissue;
    for (; r->next_cut < tissue->cut_count && tissue->cuts[r->next_cut].step <= o->step;
         r->next_cut++) {
        struct cut_mesh_state *cut = &tissue->cuts[r->next_cut];
        send_tissue(r, utc_ns, cut->tissue, &cut->mesh);
        mesh_fini(&cut->mesh);
    }
    if (!o->landed.job)
        return;
    message_resection(&r->message, utc_ns, &o->landed);
    send(r, r->tissues[o->landed.tissue], utc_ns);
}

static bool on_recorded_step(void *user, const struct trace_record *record, double seconds) {
    struct recording *r = user;
    const struct session_output *o = &record->output;
    uint64_t utc_ns = utc_of(r, o->time_ns);
    struct input_row row;
    (void)seconds;
    input_row_of(record, &row);
    for (int i = 0; i < BODY_COUNT; i++) {
        send_pose(r, utc_ns, &r->bones[0][i], o->T_mockup_body[i]);
        send_pose(r, utc_ns, &r->bones[1][i], o->T_mockup_virtual[i]);
    }
    if (!r->begun)
        send_groups(r, utc_ns);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        send_tool(r, utc_ns, &row, i, &o->instruments[i]);
    for (int i = 0; i < o->loose_count; i++)
        send_loose(r, utc_ns, i, &o->loose[i]);
    send_forces(r, utc_ns, &row);
    message_joint(&r->message, utc_ns, o);
    send(r, r->joint, utc_ns);
    send_events(r, utc_ns, o);
    send_landed(r, utc_ns, o);
    r->begun = true;
    return true;
}

static void on_recorded_remark(void *user, const struct remark *remark) {
    struct recording *r = user;
    uint64_t utc_ns = utc_of(r, remark->time_ns);
    char text[REMARK_DESCRIPTION_SIZE];
    remark_describe(remark, text);
    message_log(&r->message, utc_ns, false, text, remark->author);
    send(r, r->remarks, utc_ns);
}

static void on_recorded_marker(void *user, const struct marker *marker) {
    struct recording *r = user;
    uint64_t utc_ns = utc_of(r, marker->time_ns);
    message_marker(&r->message, utc_ns, marker);
    send(r, r->markers, utc_ns);
}

// ---- the file -----------------------------------------------------------------------------------

static enum result write_file(struct recording *r, const char *path, struct error *err) {
    enum result result = mcap_create(path, "arthron " ARTHRON_VERSION, &r->mcap, err);
    if (result != RESULT_OK)
        return result;
    describe_recording(r);
    add_channels(r);
    r->walk.remark = on_recorded_remark;
    r->walk.marker = on_recorded_marker;
    result = walk_run(&r->walk, &r->contents, on_recorded_step, r, err);
    if (result == RESULT_OK)
        return mcap_finish(&r->mcap, err);
    mcap_abandon(&r->mcap);
    return result;
}

enum result export_mcap(const struct export_request *request, const char *path, struct error *err) {
    struct recording r = {.walk = {.request = request, .passes = request->scene ? 2 : 1}};
    enum result result = contents_read(request, &r.contents, err);
    if (result == RESULT_OK && request->scene)
        result = tissue_states_read(&r.walk, &r.tissue, err);
    if (result == RESULT_OK)
        result = write_file(&r, path, err);
    tissue_states_fini(&r.tissue);
    message_fini(&r.message);
    return result == RESULT_OK ? contents_end(&r.contents, err) : result;
}
