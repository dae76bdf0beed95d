// Makes the corpora's first inputs, small and good: fuzz-seeds FOLDER writes FOLDER/TARGET/NAME.
#include "base/bytes.h"
#include "base/check.h"
#include "base/kept.h"
#include "igtl/content.h"
#include "igtl/stream.h"
#include "mockup/encode.h"
#include "trace/part.h"
#include "trace/state_session.h"
#include "unit/case_knee.h"
#include "wire/live.h"
#include "wire/mesh_delta.h"
#include "wire/seal.h"
#include "wire/wire.h"

#include <pb_encode.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *root;

static void seed(const char *target, const char *name, const void *bytes, size_t size) {
    char folder[512];
    snprintf(folder, sizeof folder, "%s/%s", root, target);
    mkdir(folder, 0777);
    write_file(folder, name, bytes, size);
}

static void seed_text(const char *target, const char *name, const char *text) {
    seed(target, name, text, strlen(text));
}

static struct frame some_frame(void) {
    pose p = {quat_from_axis_angle((vec3){0, 0, 1}, 0.5), {1, -2, 30}};
    return (struct frame){
        .number = 7,
        .time_ns = 5000000000,
        .count = 4,
        .samples = {{.channel = CHANNEL_JOINT,
                     .kind = SAMPLE_JOINT,
                     .time_ns = 4999000000,
                     .joint = {30, 1, -2, 0.5, 1, 0}},
                    {.channel = CHANNEL_PROBE,
                     .kind = SAMPLE_POSE,
                     .device = 1,
                     .filter = FILTER_ONE_EURO,
                     .filter_latency_us = 4000,
                     .time_ns = 4999500000,
                     .T_mockup_body = p},
                    {.channel = CHANNEL_PUNCH,
                     .kind = SAMPLE_HANDLE,
                     .validity = VALIDITY_HELD,
                     .device = 2,
                     .time_ns = 4990000000,
                     .handle = {0.25, 5}},
                    {.channel = CHANNEL_TIBIA,
                     .kind = SAMPLE_FORCE,
                     .device = 2,
                     .time_ns = 4998000000,
                     .force_n = -3.5}},
    };
}

// The usual ones, a grasper and a curette.
static struct instruments described_instruments(void) {
    struct instruments all = *instruments_usual();
    struct instrument grasper = instrument_of_kind(INSTRUMENT_JAW);
    struct instrument curette = instrument_of_kind(INSTRUMENT_BLADE);
    strcpy(grasper.name, "grasper");
    strcpy(curette.name, "curette");
    grasper.cuts = false;
    grasper.button = 3;
    curette.colour = 0x33aa55;
    CHECK(instruments_add(&all, &grasper, NULL) == RESULT_OK);
    CHECK(instruments_add(&all, &curette, NULL) == RESULT_OK);
    return all;
}

static void messages(void) {
    static arthron_Control control;
    static arthron_Console console;
    static uint8_t data[WIRE_CONSOLE_MAX];
    size_t used;
    struct frame frame = some_frame();
    control.which_message = arthron_Control_frame_tag;
    wire_frame_from(&frame, &control.message.frame);
    CHECK(wire_encode_control(&control, data, sizeof data, &used) == RESULT_OK);
    seed("control", "frame", data, used);

    control = (arthron_Control){.which_message = arthron_Control_hello_tag};
    arthron_Hello *hello = &control.message.hello;
    hello->version_min = hello->version_max = 1;
    snprintf(hello->station, sizeof hello->station, "bench");
    hello->devices_count = 1;
    snprintf(hello->devices[0].name, sizeof hello->devices[0].name, "probe");
    hello->has_calibration = true;
    hello->calibration = (arthron_Calibration){1790000000, 0.25, 0.125};
    CHECK(wire_encode_control(&control, data, sizeof data, &used) == RESULT_OK);
    seed("control", "hello", data, used);
    struct instruments instruments = described_instruments();
    for (int i = INSTRUMENTS_USUAL; i < instruments.count; i++)
        wire_instrument_from(&instruments, i, &hello->instruments[hello->instruments_count++]);
    CHECK(wire_encode_control(&control, data, sizeof data, &used) == RESULT_OK);
    seed("control", "hello-described", data, used);

    control = (arthron_Control){.which_message = arthron_Control_welcome_tag};
    snprintf(control.message.welcome.case_name, sizeof control.message.welcome.case_name, "boxes");
    CHECK(wire_encode_control(&control, data, sizeof data, &used) == RESULT_OK);
    seed("control", "welcome", data, used);

    control = (arthron_Control){
        .which_message = arthron_Control_refusal_tag,
        .message.refusal = {arthron_Refusal_Reason_ELSEWHERE, "go", "b.example.org:4810", 250}};
    CHECK(wire_encode_control(&control, data, sizeof data, &used) == RESULT_OK);
    seed("control", "refusal", data, used);

    control = (arthron_Control){.which_message = arthron_Control_moved_tag,
                                .message.moved = {"[fd00::2]:4810"}};
    CHECK(wire_encode_control(&control, data, sizeof data, &used) == RESULT_OK);
    seed("control", "moved", data, used);

    control = (arthron_Control){.which_message = arthron_Control_marker_tag,
                                .message.marker = {2, 5000000000, "start", "pedal", 1}};
    CHECK(wire_encode_control(&control, data, sizeof data, &used) == RESULT_OK);
    seed("control", "marker", data, used);

    control = (arthron_Control){.which_message = arthron_Control_attempt_tag,
                                .message.attempt = {.number = 1,
                                                    .task = "look",
                                                    .goals_count = 1,
                                                    .goals = {{"notch", true, 5}},
                                                    .errors_count = 1,
                                                    .errors = {{"deep", 1, true}},
                                                    .occurrences_count = 1,
                                                    .end = arthron_AttemptState_End_SENTINEL}};
    CHECK(wire_encode_control(&control, data, sizeof data, &used) == RESULT_OK);
    seed("control", "attempt", data, used);

    struct knee_frame knee = {.joint = {SIDE_LEFT, pose_identity(), pose_identity()},
                              .patella_count = 2};
    for (int i = 0; i < 2; i++)
        knee.patella[i] = (struct patella_key){90.0 * i, pose_identity()};
    control = (arthron_Control){.which_message = arthron_Control_session_change_tag};
    control.message.session_change.has_knee = true;
    wire_knee_from(&knee, &control.message.session_change.knee);
    CHECK(wire_encode_control(&control, data, sizeof data, &used) == RESULT_OK);
    seed("control", "change", data, used);

    console.which_message = arthron_Console_command_tag;
    CHECK(wire_encode_console(&console, data, sizeof data, &used) == RESULT_OK);
    seed("control", "console", data, used);
}

static void seed_page(const char *name, const arthron_Page *page) {
    uint8_t data[WIRE_PAGE_MAX];
    pb_ostream_t stream = pb_ostream_from_buffer(data, sizeof data);
    CHECK(pb_encode(&stream, arthron_Page_fields, page));
    seed("browser", name, data, stream.bytes_written);
}

static void browsers(void) {
    static arthron_Page page;
    page = (arthron_Page){.which_message = arthron_Page_watch_tag,
                          .message.watch = {.what = arthron_Watch_What_RECORDED,
                                            .session = "00112233445566778899aabbccddeeff",
                                            .case_name = "healthy",
                                            .rate_hz = 60,
                                            .meshes = true}};
    seed_page("watch", &page);
    page = (arthron_Page){.which_message = arthron_Page_drawn_tag, .message.drawn.batches = 7};
    seed_page("drawn", &page);
    page = (arthron_Page){.which_message = arthron_Page_command_tag,
                          .message.command = {.kind = arthron_Command_Kind_COPY,
                                              .station = "room-1",
                                              .from = "00112233445566778899aabbccddeeff",
                                              .at_s = 60}};
    seed_page("copy", &page);
    page = (arthron_Page){.which_message = arthron_Page_command_tag,
                          .message.command = {.kind = arthron_Command_Kind_BEGIN,
                                              .station = "room-1",
                                              .task = "centring",
                                              .purpose = arthron_AttemptState_Purpose_EXAM,
                                              .hand = arthron_AttemptState_Hand_LEFT_HAND}};
    seed_page("begin", &page);
    page = (arthron_Page){.which_message = arthron_Page_mesh_ask_tag};
    page.message.mesh_ask.have_count = 1;
    snprintf(page.message.mesh_ask.have[0].group, sizeof page.message.mesh_ask.have[0].group,
             "meniscus_medial");
    seed_page("ask", &page);
    seed_text("browser", "cookie", "a=b; arthron=0123456789abcdef");
    seed_text("browser", "bearer", "Bearer 0123456789abcdef");
    seed_text("browser", "range", "bytes=10-99");
    seed_text("browser", "origin", "https://localhost:4880");
}

static void datagrams(void) {
    static arthron_Frame message;
    static const uint8_t key[SEAL_KEY_SIZE] = "arthron fuzzing", iv[SEAL_IV_SIZE] = "a known one";
    uint8_t data[WIRE_DATAGRAM_MAX], sealed[WIRE_DATAGRAM_MAX];
    size_t used;
    struct frame frame = some_frame();
    wire_frame_from(&frame, &message);
    CHECK(wire_encode_frame(&message, data, sizeof data, &used) == RESULT_OK);
    seed("datagram", "frame", data, used);
    struct seal *seal = seal_create(SEAL_TO_SERVER, 1, 7, key, iv);
    seed("datagram", "sealed", sealed, seal_seal(seal, data, used, sealed));
    seal_destroy(&seal);
    arthron_Reply reply = {.frame_number = 7, .instruments_count = 1};
    const struct avatar_extrapolation extrapolation = {.mode = AVATAR_RIGID, .trust_radius_mm = 1};
    reply.instruments[0].channel = CHANNEL_PROBE;
    reply.instruments[0].has_pose = true;
    reply.instruments[0].pose.qw = 1;
    wire_extrapolation_from(&extrapolation, &reply.instruments[0]);
    CHECK(wire_encode_reply(&reply, data, sizeof data, &used) == RESULT_OK);
    seed("datagram", "reply", data, used);
}

static size_t encode_change(const struct mesh_delta *delta, uint8_t *data, size_t size) {
    CHECK(mesh_delta_validate(delta, NULL) == RESULT_OK);
    return mesh_delta_encode(delta, data, size);
}

// A whole mesh, a change of the target's small one, and a chunk of both.
static void mesh_changes(void) {
    static arthron_MeshChunk chunk = {.group = "m", .number = 2};
    uint8_t data[1024], encoded[2048];
    float positions[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    uint32_t corners[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2}, freed[] = {1};
    struct delta_vertex vertices[] = {{4, {0, 0, 2}}, {6, {1, 0, -2}}, {300, {0, 1, 0.5f}}};
    struct delta_triangle made[] = {{0, {4, 6, 300}, 0}, {2, {6, 4, 300}, 3}};
    struct delta_triangle whole_made[] = {{0, {4, 6, 300}, 0}, {90, {6, 4, 300}, 3}};
    struct delta_piece piece = {1, {2, 3, 4}, 4, 4, positions, corners};
    struct mesh_delta whole = {
        .number = 1, .vertex_count = 3, .vertices = vertices, .made_count = 2, .made = whole_made};
    struct mesh_delta change = {.base = 1,
                                .number = 2,
                                .freed_count = 1,
                                .freed = freed,
                                .vertex_count = 3,
                                .vertices = vertices,
                                .made_count = 2,
                                .made = made,
                                .piece_count = 1,
                                .pieces = &piece};
    size_t used = encode_change(&whole, data, sizeof data), more;
    seed("mesh_delta", "whole", data, used);
    more = encode_change(&change, data + used, sizeof data - used);
    seed("mesh_delta", "change", data + used, more);
    seed("mesh_delta", "both", data, used + more);
    chunk.size = (uint32_t)(used + more);
    chunk.data.size = (pb_size_t)chunk.size;
    memcpy(chunk.data.bytes, data, chunk.size);
    CHECK(wire_encode_chunk(&chunk, encoded, sizeof encoded, &used) == RESULT_OK);
    seed("mesh_delta", "chunk", encoded, used);
}

// The manifest without the anatomy's hash, for no mutated anatomy has it.
static void take_out_line(char *text, const char *key) {
    char *begin = strstr(text, key), *end;
    CHECK(begin && (end = strchr(begin, '\n')));
    while (begin[-1] != '\n')
        begin--;
    memmove(begin, end + 1, strlen(end + 1) + 1);
}

static void seed_case(const char *name, struct knee_case *knee) {
    char folder[FOLDER_MAX];
    struct error err;
    size_t size;
    folder_make(folder);
    CHECK(case_save(knee, folder, &err) == RESULT_OK);
    char *manifest = read_file(folder, "case.json", NULL);
    char *anatomy = read_file(folder, "anatomy.glb", &size);
    take_out_line(manifest, "anatomy_xxh3");
    size_t first = strlen(manifest) + 1;
    manifest = alloc_resize(manifest, first + size, 1);
    memcpy(manifest + first, anatomy, size);
    seed("case", name, manifest, first + size);
    free(manifest);
    free(anatomy);
    folder_remove(folder);
}

static void cases(void) {
    struct knee_case *knee = box_knee();
    seed_case("boxes", knee);
    case_group_need_wear(case_group(knee, "femur"))[2] = 3;
    seed_case("worn", knee);
    knee->groups[0].tissue =
        (struct case_tissue){TISSUE_OTHER, TISSUE_LATERAL, true, 0xe05a5a, "A ½"};
    seed_case("described", knee);
    case_destroy(&knee);
}

static void meshes(void) {
    static const char stl_facet[] = "facet normal 0 0 1\nouter loop\nvertex %d 0 0\nvertex %d 1 0\n"
                                    "vertex 0 %d 1\nendloop\nendfacet\n";
    char stl[1024];
    int used = snprintf(stl, sizeof stl, "2solid a\n");
    for (int i = 1; i < 4; i++)
        used += snprintf(stl + used, sizeof stl - (size_t)used, stl_facet, i, -i, i);
    snprintf(stl + used, sizeof stl - (size_t)used, "endsolid a\n");
    seed_text("mesh", "stl", stl);

    uint8_t binary[1 + 84 + 50 * 2] = "2 two facets";
    struct writer w = {binary, sizeof binary, 81};
    write_u32(&w, 2);
    for (int i = 0; i < 24; i++) {
        float value = (float)(i * i % 7);
        write_bytes(&w, &value, sizeof value);
        if (i % 12 == 11)
            write_u16(&w, 0);
    }
    seed("mesh", "stl_binary", binary, sizeof binary);

    seed_text("mesh", "ply",
              "0ply\nformat ascii 1.0\ncomment a square\nelement vertex 4\nproperty float x\n"
              "property float y\nproperty float z\nelement face 2\n"
              "property list uchar int vertex_indices\nend_header\n"
              "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n");
    seed_text("mesh", "obj",
              "1# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n"
              "f 1/1/1 2/1/1 3/1/1 4/1/1\nf -4 -3 -1\n");
    seed_text("mesh", "off",
              "3OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n");
    seed_text("mesh", "vtk",
              "4# vtk DataFile Version 3.0\nSPACE=LPS\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n"
              "0 0 0 1 0 0\n1 1 0 0 1 0\nMETADATA\nINFORMATION 0\n\nTRIANGLE_STRIPS 1 5\n"
              "4 0 1 3 2\nPOLYGONS 1 5\n4 0 1 2 3\nPOINT_DATA 4\n");
    static const char vtk_binary[] =
        "4# vtk DataFile Version 5.1\nv\nBINARY\nDATASET POLYDATA\nFIELD FieldData 1\n"
        "TimeValue 1 1 short\n\0\1\nPOINTS 3 short\n"
        "\0\0\0\0\0\0"
        "\0\1\0\0\0\0"
        "\0\0\0\1\0\0"
        "\nPOLYGONS 2 3\nOFFSETS unsigned_char\n\0\3\nCONNECTIVITY vtktypeint64\n"
        "\0\0\0\0\0\0\0\0"
        "\0\0\0\0\0\0\0\1"
        "\0\0\0\0\0\0\0\2\n";
    seed("mesh", "vtk_binary", vtk_binary, sizeof vtk_binary - 1);
}

static struct trace_writer *begin_trace(const char *file, const struct instruments *instruments) {
    struct trace_header header = {.station = "bench", .trainee = "Zoë", .case_name = "boxes"};
    header.settings = session_settings_default();
    header.settings.instruments = *instruments;
    header.optic = view_optic_usual();
    struct trace_writer *writer;
    CHECK(trace_writer_create(file, &header, NULL, NULL, &writer, NULL) == RESULT_OK);
    return writer;
}

static void seed_trace(const char *name, const char *folder, struct trace_writer *writer) {
    size_t size;
    trace_writer_destroy(&writer);
    char *bytes = read_file(folder, "a.trace", &size);
    seed("trace", name, bytes, size);
    free(bytes);
    folder_remove(folder);
}

static struct session_input shaver_input(uint64_t number) {
    struct session_input input = {.kind = INPUT_FRAME};
    vec3 tip = {-19, 0.5 * (double)number, -11};
    input.frame = (struct frame){.number = number, .count = 2};
    input.frame.samples[0] = (struct sample){
        .channel = CHANNEL_SHAVER, .kind = SAMPLE_POSE, .T_mockup_body = {quat_identity(), tip}};
    input.frame.samples[1] =
        (struct sample){.channel = CHANNEL_SHAVER, .kind = SAMPLE_HANDLE, .handle = {0, 1}};
    return input;
}

// A burr that cuts, and the tissue made whole again.
struct cut_session {
    struct session *session;
    struct operation *operation;
    struct job_result *result;
    struct session_output output;
};

static const enum input_kind cut_kinds[] = {INPUT_START, INPUT_FRAME, INPUT_FRAME, INPUT_JOB,
                                            INPUT_FRAME, INPUT_RESET, INPUT_JOB,   INPUT_JOB};
#define CUT_STEPS (sizeof cut_kinds / sizeof *cut_kinds)

static struct cut_session begin_cuts(const struct scene *scene) {
    struct session_settings settings = session_settings_default();
    return (struct cut_session){.session = session_create(scene, &settings),
                                .operation =
                                    operation_create(scene, settings.rules, instruments_usual())};
}

static void step_cuts(struct cut_session *c, uint64_t i, struct trace_writer *writer) {
    struct session_input input = {.kind = cut_kinds[i]};
    if (cut_kinds[i] == INPUT_FRAME)
        input = shaver_input(i);
    if (cut_kinds[i] == INPUT_JOB) {
        input.job = c->result->job;
        input.result = c->result;
    }
    session_step(c->session, &input, &c->output);
    CHECK(trace_append(writer, &input, &c->output));
}

static void run_cut(struct cut_session *c) {
    if (!c->output.job.id)
        return;
    job_result_destroy(&c->result);
    c->result = operation_run(c->operation, &c->output.job);
}

static void end_cuts(struct cut_session *c) {
    job_result_destroy(&c->result);
    session_destroy(&c->session);
    operation_destroy(&c->operation);
}

static void a_cut_trace(const struct scene *scene) {
    char folder[FOLDER_MAX], file[300];
    struct cut_session c = begin_cuts(scene);
    folder_make(folder);
    snprintf(file, sizeof file, "%s/a.trace", folder);
    struct trace_writer *writer = begin_trace(file, instruments_usual());
    for (uint64_t i = 0; i < CUT_STEPS; i++) {
        step_cuts(&c, i, writer);
        run_cut(&c);
    }
    seed_trace("cut", folder, writer);
    end_cuts(&c);
}

// ---- the next part of that ----------------------------------------------------------------------

struct packed {
    struct trace_journal journal;
    uint8_t bytes[1 << 16];
    size_t size;
};

static void pack_tapped(void *user, const struct trace_record *tapped) {
    static struct trace_record kept;
    struct packed *p = user;
    CHECK(p->size + TRACE_PACKED_MAX <= sizeof p->bytes);
    if (trace_journal_take(&p->journal, tapped, &kept))
        p->size += trace_record_pack(&kept, RULES_NEWEST, p->bytes + p->size);
}

// Session and tissue alone.
static void keep_cuts(struct cut_session *c, const char *trace, struct trace_state *state) {
    struct job asked = c->output.job;
    struct kept k = kept_growing();
    for (int section = 0; section < STATE_SECTION_COUNT; section++) {
        size_t begin = state_section_begin(&k);
        if (section == STATE_SESSION)
            session_keep(c->session, &asked, NULL, &k);
        if (section == STATE_OPERATION)
            operation_keep(c->operation, &k);
        state_section_end(&k, begin);
    }
    state->output_hash = c->output.hash;
    state->content = k.data;
    state->size = k.used;
    enum result result;
    while ((result = trace_state_write(trace, state, NULL)) == RESULT_MISSING)
        usleep(1000);
    CHECK(result == RESULT_OK);
    free(k.data);
}

static void write_part(const char *file, const struct trace_header *header, const uint8_t *state,
                       size_t size, const struct packed *packed, struct cut_session *c) {
    static struct trace_record record;
    struct trace_writer *writer;
    size_t at = 0;
    uint64_t step = 1; // of the state
    CHECK(trace_part_create(file, header, state, size, NULL, NULL, &writer, NULL) == RESULT_OK);
    while (trace_record_unpack(packed->bytes, packed->size, RULES_NEWEST, &at, &record, NULL) ==
           RESULT_OK) {
        CHECK(trace_append_record(writer, &record, NULL) == RESULT_OK);
        step += record_is_input(&record);
    }
    c->output = (struct session_output){.step = step + 1, .state = SESSION_CLOSED};
    CHECK(trace_append(writer, &(struct session_input){.kind = INPUT_STOP}, &c->output));
    trace_writer_destroy(&writer);
}

static void a_later_part(const struct scene *scene) {
    static struct packed packed;
    char folder[FOLDER_MAX], file[300], part[300];
    struct trace_header header = {.station = "bench", .case_name = "boxes", .part = 1};
    struct trace_tap tap = {pack_tapped, &packed};
    struct trace_writer *writer;
    struct cut_session c = begin_cuts(scene);
    uint8_t *state_bytes;
    size_t size;
    header.settings = session_settings_default();
    header.optic = view_optic_usual();
    folder_make(folder);
    snprintf(file, sizeof file, "%s/b.trace", folder);
    snprintf(part, sizeof part, "%s/a.trace", folder);
    CHECK(trace_writer_create(file, &header, NULL, &tap, &writer, NULL) == RESULT_OK);
    for (uint64_t i = 0; i < CUT_STEPS; i++) {
        step_cuts(&c, i, writer);
        if (i == 0) {
            struct trace_state state = {0};
            trace_place_behind(writer, trace_position(writer), &c.output, &state.place);
            keep_cuts(&c, file, &state);
            packed.size = 0;
        }
        run_cut(&c);
    }
    trace_writer_leave(&writer);
    seed("journal", "cut", (char *)packed.bytes, packed.size);
    header.part = 2;
    header.token = 3;
    snprintf(header.server, sizeof header.server, "beta");
    CHECK(trace_state_load(file, &state_bytes, &size, NULL) == RESULT_OK);
    write_part(part, &header, state_bytes, size, &packed, &c);
    free(state_bytes);
    char *bytes = read_file(folder, "a.trace", &size);
    seed("trace", "part", bytes, size);
    free(bytes);
    folder_remove(folder);
    end_cuts(&c);
}

// A step in which instrument `seen` is there.
static void seed_steps(const char *name, const struct instruments *instruments, int seen) {
    static struct session_input input;
    static struct session_output output;
    char folder[FOLDER_MAX], file[300];
    folder_make(folder);
    snprintf(file, sizeof file, "%s/a.trace", folder);
    struct trace_writer *writer = begin_trace(file, instruments);
    memset(&output, 0, sizeof output);
    output.described = instruments->count - INSTRUMENTS_USUAL;
    struct trace_attempt begun = {.number = 1,
                                  .hand = ATTEMPT_LEFT_HAND,
                                  .task = "look",
                                  .pass_time_s = 9,
                                  .size = 6,
                                  .text = "[task]"};
    CHECK(trace_append_begun(writer, &begun));
    for (uint64_t step = 1; step <= 3; step++) {
        input.kind = step == 1 ? INPUT_START : step == 2 ? INPUT_FRAME : INPUT_STOP;
        input.time_ns = output.time_ns = 5000000000 + (int64_t)step;
        input.frame = step == 2 ? some_frame() : (struct frame){0};
        output.step = step;
        output.instruments[seen].present = step == 2;
        CHECK(trace_append(writer, &input, &output));
    }
    struct remark remark = {.number = 1,
                            .time_ns = 5000000003,
                            .author = "otto",
                            .text = "Lift the hand",
                            .has_marker = true,
                            .body = BODY_TIBIA,
                            .point = {1, 2, 3}};
    CHECK(trace_append_remark(writer, &remark));
    struct marker marker = {1, 2, 5000000002, 1, "start", "pedal"};
    CHECK(trace_append_marker(writer, &marker));
    struct trace_outcome ended = {.number = 1,
                                  .end = ATTEMPT_LEFT,
                                  .verdict = VERDICT_NOT_YET,
                                  .first_step = 1,
                                  .last_step = 3};
    CHECK(trace_append_ended(writer, &ended));
    seed_trace(name, folder, writer);
}

static void traces(void) {
    struct instruments described = described_instruments();
    seed_steps("steps", instruments_usual(), 0);
    seed_steps("described", &described, INSTRUMENTS_USUAL + 1);
    struct knee_case *knee = box_knee();
    struct scene *scene;
    CHECK(scene_create(&knee, &scene, NULL) == RESULT_OK);
    a_cut_trace(scene);
    a_later_part(scene);
    scene_destroy(&scene);
}

// What clients of a server say.
static void clients(void) {
    static const struct {
        const char *name, *type, *device;
        size_t size;
    } rows[] = {
        {"start", "STT_TDATA", "", IGTL_START_SIZE},
        {"quaternions", "STT_QTDATA", "Arthron", IGTL_START_SIZE},
        {"stop", "STP_TDATA", "", 0},
        {"transform", "GET_TRANS", "probe", 0},
        {"tdata", "GET_TDATA", "", 0},
        {"mesh", "GET_POLYDATA", "meniscus", 0},
        {"status", "GET_STATUS", "", 0},
        {"capability", "GET_CAPABIL", "", 0},
    };
    uint8_t all[4096];
    size_t used = 0;
    for (int version = 1; version <= 2; version++)
        for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
            struct igtl_head head = {
                .version = version, .type = rows[i].type, .device = rows[i].device};
            uint8_t *bytes = all + used;
            char name[32];
            snprintf(name, sizeof name, "%s_%d", rows[i].name, version);
            igtl_write_start(50, "", bytes + igtl_message_content(version));
            size_t size = igtl_message_finish(&head, rows[i].size, bytes);
            seed("igtl", name, bytes, size);
            used += size;
        }
    seed("igtl", "all", all, used);
}

static void trackers(void) {
    static const char *const names[] = {"transform", "tdata", "position", "qtdata"};
    uint8_t bytes[ENCODE_BYTES_MAX];
    struct tracked_tool tools[] = {
        {"probe", {quat_from_axis_angle((vec3){0, 1, 0}, 0.3), {10, 20, -1500}}},
        {"a tool of 20 letters", {quat_identity(), {0, 0, 0}}},
    };
    for (int type = MESSAGE_TRANSFORM; type <= MESSAGE_QTDATA; type++)
        for (int version = 1; version <= 2; version++) {
            char name[32];
            snprintf(name, sizeof name, "%s_%d", names[type], version);
            size_t used =
                encode_tools((enum message_type)type, version, 1790000000, tools, 2, bytes);
            seed("tracker", name, bytes, used);
        }
    for (int version = 1; version <= 2; version++) {
        char name[32];
        snprintf(name, sizeof name, "sensor_%d", version);
        seed("tracker", name, bytes, encode_force(version, 1790000000, "Gauge", 2.5, bytes));
    }
    struct igtl_head head = {.version = 1, .type = "STRING", .device = "Stimulus"};
    size_t size = igtl_write_string("17", bytes + igtl_message_content(1));
    seed("tracker", "string", bytes, igtl_message_finish(&head, size, bytes));
}

static void recordings(void) {
    seed_text("csv", "tool",
              "t_seconds,tx_mm,ty_mm,tz_mm,qw,qx,qy,qz,valid\n0,1,2,3,1,0,0,0,1\n"
              "0.01,1,2,3,0.6,0.8,0,0,1\n0.02,0,0,0,0,0,0,0,0\n");
    seed_text("csv", "motion",
              "t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm,"
              "punch_tx_mm,punch_ty_mm,punch_tz_mm,punch_qw,punch_qx,punch_qy,punch_qz,"
              "punch_valid,punch_opening,touch\n0,10,0,0,0,0,0,1,2,3,1,0,0,0,1,0.5,tibia\n"
              "0.5,20,0,0,0,0,0.25,1,2,3,1,0,0,0,1,1,-\n");
    seed_text("csv", "force",
              "t_seconds,tx_mm,ty_mm,tz_mm,qw,qx,qy,qz,valid,force_n\n0,1,2,3,1,0,0,0,1,2.5\n"
              "0.01,1,2,3,0.6,0.8,0,0,1,-999\n");
}

static void metafiles(void) {
    seed_text("csv", "metafile",
              "ObjectType = Image\nNDims = 3\nDimSize = 0 0 2\nKinds = domain domain list\n"
              "Seq_Frame0000_Timestamp = 1.5\n"
              "Seq_Frame0000_ProbeToTrackerTransform = 0 -1 0 10.5 1 0 0 -20 0 0 1 30 0 0 0 1\n"
              "Seq_Frame0000_ProbeToTrackerTransformStatus = OK\n"
              "Seq_Frame0001_Timestamp = 1.75\n"
              "Seq_Frame0001_ProbeToTrackerTransform = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"
              "Seq_Frame0001_ProbeToTrackerTransformStatus = INVALID\n"
              "ElementDataFile = LOCAL\n");
}

static void handles(void) {
    static const uint8_t descriptor[] =
        "0 16 0 4095 0.05\n16 8\n"
        "\x05\x01\x09\x04\xa1\x01\x09\x30\x16\x00\x00\x26\xff\x0f\x75\x10\x95\x01\x81\x02\x05\x09"
        "\x19\x01\x29\x08\x15\x00\x25\x01\x75\x01\x95\x08\x81\x02\xc0";
    static const uint8_t numbered[] = "2:0 12 -5 2000\n2:16 3\n\x02\x34\x12\x05\x01\xff";
    seed("hid", "descriptor", descriptor, sizeof descriptor - 1);
    seed("hid", "numbered", numbered, sizeof numbered - 1);
}

// A body; vertices that move; for each cut the number of its parts less one, and each part.
static void cuts(void) {
    static const uint8_t flush[] = {0, 0,                         // a box
                                    0, 0, 0,  0,  32, 15, 15, 15, // a box of 2 mm at its upper side
                                    0, 0, 32, 0,  32, 15, 15, 15, // flush beside it
                                    0, 0, 32, 0,  32, 15, 15, 15, // nothing is left there
                                    0, 0, 0,  32, 32, 47, 15, 15, // across, flush to both
                                    0, 0, 0,  0,  0,  7,  7,  127};     // through
    static const uint8_t corners[] = {3, 0,                             // a lattice
                                      1, 0,  48, 48, 48, 31, 31,  31,   // two boxes that
                                      0, 16, 16, 16, 31, 31, 31,        // touch in a corner
                                      0, 0,  0,  0,  0,  1,  127, 127}; // split it
    static const uint8_t turned[] = {
        2, 3,   4,  20, 240, 7,  9,  0,  90, 128, 30, 1,  2,   3, // a torus
        0, 3,   80, 0,  0,   15, 20, 30, 1,  2,   3,  20, 2,   3,  0, 80, 0,  20, 10, 10, 5,
        1, 250, 70, 4,  0,   70, 8,  20, 10, 10,  5,  2,  250, 71, 0, 0,  60, 16, 20, 10, 10};
    static const uint8_t
        planes[] = {1, 0, // a ball
                    0, 5, 6,   10,  0,  0,  36, 246, 0, 0, 228, 0,   10,  0,
                    8, 0, 246, 0,   8,  0,  0,  10,  8, 0, 0,   246, 8, // a box of half-spaces
                    0, 6, 5,   10,  10, 10, 20, 246, 0, 0, 8,   0,   246, 0,
                    8, 0, 0,   246, 8,  10, 10, 9,   19}; // the corner of an octant
    seed("cut", "flush", flush, sizeof flush);
    seed("cut", "corners", corners, sizeof corners);
    seed("cut", "turned", turned, sizeof turned);
    seed("cut", "planes", planes, sizeof planes);
}

// The letter of a route, as fuzz/api.c has it.
static char route_letter(const char *route) {
    static const char *const routes[] = {
#define ROUTE(method, path, ...) method " " path,
#include "routes.inc"
#undef ROUTE
    };
    for (size_t i = 0; i < sizeof routes / sizeof *routes; i++)
        if (!strcmp(routes[i], route))
            return (char)('A' + i);
    CHECK(!"a route");
    return 0;
}

static void requests(void) {
    static const struct {
        const char *name, *route, *text;
    } rows[] = {
        {"sign-in", "POST /sign-in", "- \n{\"code\":\"ABCD EFGH\"}"},
        {"password", "POST /sign-in", "- \n{\"name\":\"eve\",\"password\":7}"},
        {"first", "POST /first",
         "- \n{\"secret\":\"0\",\"name\":\"eve\",\"password\":\"0123456789\"}"},
        {"me", "GET /me", "o \n"},
        {"token", "POST /tokens", "t \n{\"name\":\"night export\"}"},
        {"account", "POST /accounts",
         "i \n{\"name\":\"eve\",\"role\":\"trainee\",\"trainee\":\"eve\","
         "\"password\":\"short\"}"},
        {"role", "PATCH /accounts/*", "i tom\n{\"role\":\"instructor\"}"},
        {"remove", "DELETE /accounts/*", "t ada\n"},
        {"trainee", "POST /trainees", "i \n{\"name\":\"j\u00f6\",\"full_name\":null}"},
        {"code", "POST /trainees/*/code", "i ada\n{}"},
        {"course", "POST /courses/*/trainees", "i autumn\n{\"trainee\":\"eve\"}"},
        {"station", "POST /stations/*/code", "t room-1\n{}"},
        {"sessions", "GET /sessions",
         "o ?trainee=%65ve&course=autumn&case=healthy&limit=3&before="
         "0123456789abcdef0123456789abcdef\n"},
        {"other", "GET /sessions/*/trace", "o fedcba9876543210fedcba9876543210\n"},
        {"own", "GET /sessions/*/report", "o 0123456789abcdef0123456789abcdef\n"},
        {"distribution", "GET /distributions", "o ?case=healthy&course=autumn\n"},
        {"case", "GET /cases/*/case.json", "o healthy\n"},
        {"audit", "GET /audit", "t ?limit=10\n"},
        {"description", "GET /openapi.json", "- \n"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[256];
        snprintf(text, sizeof text, "%c%s", route_letter(rows[i].route), rows[i].text);
        seed_text("api", rows[i].name, text);
    }
}

// A file without a right key, and what is done to good ones: size, then kind, where, how much.
static void sealed_files(void) {
    static const uint8_t changes[][14] = {{'c', 5},
                                          {'c', 4, 0, 0, 60, 0, 1},
                                          {'c', 5, 1, 1, 84},
                                          {'c', 2, 2, 0, 0, 1, 16},
                                          {'c', 3, 3, 0, 68, 0, 200},
                                          {'c', 5, 5, 0, 0, 0, 0, 0, 4}};
    uint8_t file[17 + 12 + 16 + 8 + 16 + 30 + 16] = "farthron sealed\0\1";
    struct writer w = {file, sizeof file, 17, false};
    write_u32(&w, 64 * 1024);
    write_u32(&w, 3);
    write_u32(&w, 1);
    seed("sealed", "file", file, sizeof file);
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++)
        seed("sealed", (char[]){(char)('0' + i), 0}, changes[i], sizeof changes[i]);
}

static size_t put_item(const arthron_Live *item, uint8_t *out, size_t size) {
    size_t used;
    CHECK(live_encode(item, out, size, &used) == RESULT_OK);
    return used;
}

// What a server tells another one: a station, its moment and an end; and two lists.
static void batches(void) {
    static uint8_t bytes[2 * LIVE_ITEM_MAX];
    static arthron_Live item;
    size_t size = 0;
    item = (arthron_Live){.which_message = arthron_Live_place_tag};
    item.message.place = (arthron_Place){
        .station_number = 2, .has_info = true, .info.station = "room-1", .server = "a"};
    size += put_item(&item, bytes + size, LIVE_ITEM_MAX);
    item = (arthron_Live){.which_message = arthron_Live_moment_tag};
    item.message.moment = (arthron_Moment){.station_number = 2, .step = 9};
    size += put_item(&item, bytes + size, LIVE_ITEM_MAX);
    item = (arthron_Live){.which_message = arthron_Live_attempt_tag};
    item.message.attempt = (arthron_AttemptState){.number = 1, .task = "probe"};
    size += put_item(&item, bytes + size, LIVE_ITEM_MAX);
    item = (arthron_Live){.which_message = arthron_Live_trouble_tag};
    item.message.trouble =
        (arthron_Trouble){.has_why = true, .why.code = arthron_Why_Code_NOT_HERE};
    size += put_item(&item, bytes + size, LIVE_ITEM_MAX);
    seed("passing", "wall", bytes, size);
    item = (arthron_Live){.which_message = arthron_Live_command_reply_tag};
    arthron_CommandReply *reply = &item.message.command_reply;
    reply->sessions_count = 1;
    reply->sessions[0] = (arthron_SessionInfo){.station = "room-1", .server = "b:4810"};
    size = put_item(&item, bytes, LIVE_ITEM_MAX);
    reply->sessions[0].server[0] = '\0';
    size += put_item(&item, bytes + size, LIVE_ITEM_MAX);
    seed("passing", "lists", bytes, size);
}

int main(int argc, char **argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
        return 2;
    }
    root = argv[1];
    messages();
    browsers();
    datagrams();
    mesh_changes();
    cases();
    meshes();
    traces();
    trackers();
    clients();
    requests();
    recordings();
    metafiles();
    handles();
    cuts();
    sealed_files();
    batches();
    return 0;
}
