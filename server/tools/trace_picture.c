#include "base/check.h"
#include "base/clock.h"
#include "base/number.h"
#include "report/tissue.h"
#include "trace/player.h"
#include "trace/replay.h"
#include "trace_commands.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WIDTH 640
#define HEIGHT 480
#define LINE_MM 0.05 // shorter displacements are not drawn

static const char picture_help[] =
    "Usage: arthron-trace picture FILE --out FILE.png [--at S] [--group NAME] [--case DIR]\n"
    "\n"
    "Runs the session again and draws a meniscus after its cuts, seen from above with the front "
    "at\n"
    "the top. Cut surfaces are salmon. Purple lines show how far the touch has given way.\n"
    "\n"
    "  --out FILE    write the picture here: PNG, 640x480 pixels\n"
    "  --at S        draw it after S seconds (default: at the end)\n"
    "  --group NAME  the meniscus (default: the one with the most cuts)\n"
    "  --case DIR    the folder of the case, if it has moved\n";

struct picture_request {
    const char *file, *out, *group, *case_dir;
    double at_s;
};

// ---- the tissue to be drawn ---------------------------------------------------------------------

static enum result choose(const struct scene *scene, const struct operation *operation,
                          const char *name, int *out_tissue, struct error *err) {
    int count = scene_tissue_count(scene);
    uint32_t most = 0;
    *out_tissue = -1;
    for (int i = 0; i < count; i++) {
        uint32_t cuts = operation_figures(operation, i)->cuts;
        const char *group = scene_case(scene)->groups[scene_tissue_group(scene, i)].name;
        if (name ? strcmp(name, group) : *out_tissue >= 0 && cuts <= most)
            continue;
        *out_tissue = i;
        most = cuts;
    }
    if (*out_tissue >= 0)
        return RESULT_OK;
    return fail(err, RESULT_MISSING,
                name ? "no such cuttable group: \"%s\"" : "%snothing is cuttable",
                name ? name : "");
}

// From S' to S'', of each vertex that has given way.
static struct rod *lines_of(const struct case_group *group, const struct operation *operation,
                            int tissue, size_t *out_count) {
    static const float none[3];
    struct rod *lines = alloc(group->mesh.vertex_count, sizeof *lines);
    *out_count = 0;
    bool gives_way = operation_touch_width(operation, tissue) > 0;
    for (uint32_t i = 0; gives_way && i < group->mesh.vertex_count; i++) {
        vec3 from = mesh_vertex(&group->mesh, i), to = operation_touched(operation, tissue, i);
        const float *warp = group->warp ? group->warp + 3 * (size_t)i : none;
        from = vec3_add(from, (vec3){(double)warp[0], (double)warp[1], (double)warp[2]});
        if (vec3_distance(from, to) > LINE_MM)
            lines[(*out_count)++] = (struct rod){from, to};
    }
    return lines;
}

static enum result draw(const struct scene *scene, const struct operation *operation, int tissue,
                        const char *path, struct error *err) {
    const struct knee_case *knee = scene_case(scene);
    const struct case_group *group = &knee->groups[scene_tissue_group(scene, tissue)];
    const struct cut_mesh *cut = operation_mesh(operation, tissue);
    struct mesh mesh;
    uint32_t *ids;
    cut_mesh_flatten(cut, &mesh, NULL, &ids);
    for (uint32_t i = 0; i < mesh.triangle_count; i++)
        ids[i] = cut_mesh_label(cut, ids[i]);
    struct tissue_look look = {.mesh = &mesh, .colour = group->tissue.colour, .labels = ids};
    struct rod *lines = lines_of(group, operation, tissue, &look.line_count);
    look.lines = lines;
    quat axes = knee->joint.T_femur_joint.rotation;
    struct box box = mesh_bounds(&mesh);
    struct camera camera =
        camera_fit(&box, quat_rotate(axes, (vec3){0, -0.3, 1}), quat_rotate(axes, (vec3){0, 1, 0}),
                   (double)WIDTH / HEIGHT, INFINITY);
    struct picture picture = {0};
    enum result result = tissue_picture(&look, &camera, WIDTH, HEIGHT, &picture, err);
    if (result == RESULT_OK)
        result = picture_write(&picture, path, err);
    picture_fini(&picture);
    free(lines);
    free(ids);
    mesh_fini(&mesh);
    return result;
}

// ---- the command --------------------------------------------------------------------------------

struct picture_run {
    struct rerun *rerun;
    int64_t to_ns;
    enum result result;
    struct error *err;
};

static bool on_picture_step(void *user, const struct trace_record *record) {
    struct picture_run *r = user;
    struct session_output output;
    if (record->input.time_ns > r->to_ns)
        return false;
    rerun_step(r->rerun, record, &output);
    return true;
}

static bool on_picture_state(void *user, const struct trace_state *state) {
    struct picture_run *r = user;
    r->result = rerun_take_over(r->rerun, state, r->err);
    return r->result == RESULT_OK;
}

static bool on_picture_gap(void *user, uint64_t missing) {
    (void)user, (void)missing;
    return false;
}

// Up to the wanted time, the record's end, or its first gap.
static enum result run_to(struct rerun *rerun, struct trace_reader *reader, double at_s,
                          struct error *err) {
    double to_ns = (double)trace_reader_header(reader)->start_ns + at_s * NS_PER_S;
    struct picture_run r = {rerun, to_ns < (double)INT64_MAX ? (int64_t)to_ns : INT64_MAX,
                            RESULT_OK, err};
    struct trace_player player = {.user = &r,
                                  .step = on_picture_step,
                                  .past = on_picture_step,
                                  .taken = on_picture_step,
                                  .state = on_picture_state,
                                  .gap = on_picture_gap,
                                  .progress = show_progress};
    return trace_play(reader, &player, err) == RESULT_IO ? RESULT_IO : r.result;
}

static enum result picture(const struct picture_request *request, struct error *err) {
    struct trace_reader *reader;
    struct scene *scene = NULL;
    enum result result = trace_reader_create(request->file, &reader, err);
    if (result != RESULT_OK)
        return result;
    result = load_scene(reader, request->case_dir, &scene, err);
    if (result == RESULT_OK && scene_case(scene)->hash != trace_reader_header(reader)->case_hash)
        result = fail(err, RESULT_REFUSED, "%s was recorded with another case than %s",
                      request->file, scene_case(scene)->name);
    if (result == RESULT_OK) {
        struct rerun *rerun = rerun_create(scene, &trace_reader_header(reader)->settings);
        int tissue;
        result = run_to(rerun, reader, request->at_s, err);
        if (result == RESULT_OK)
            result = choose(scene, rerun_operation(rerun), request->group, &tissue, err);
        if (result == RESULT_OK)
            result = draw(scene, rerun_operation(rerun), tissue, request->out, err);
        rerun_destroy(&rerun);
    }
    scene_destroy(&scene);
    trace_reader_destroy(&reader);
    return result;
}

static bool parse_picture_option(int option, struct picture_request *request) {
    switch (option) {
    case 'o':
        request->out = optarg;
        return true;
    case 'g':
        request->group = optarg;
        return true;
    case 'c':
        request->case_dir = optarg;
        return true;
    default:
        return option == 'a' && number_double(optarg, 0, 1e6, &request->at_s);
    }
}

int command_picture(int argc, char **argv) {
    static const struct option options[] = {
        {"out", required_argument, NULL, 'o'},   {"at", required_argument, NULL, 'a'},
        {"group", required_argument, NULL, 'g'}, {"case", required_argument, NULL, 'c'},
        {"help", no_argument, NULL, 'h'},        {NULL, 0, NULL, 0}};
    struct picture_request request = {.at_s = INFINITY};
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(picture_help, stdout) < 0;
        if (!parse_picture_option(c, &request))
            return usage_error(argv[0], "unknown option, or a value that is no number of seconds");
    }
    if (take_file(argc, argv, &request.file) != EXIT_GOOD)
        return EXIT_USAGE;
    if (!request.out)
        return usage_error(argv[0], "--out is missing");
    struct error err;
    if (picture(&request, &err) != RESULT_OK)
        return failed(argv[0], &err);
    wrote(argv[0], request.out);
    return EXIT_GOOD;
}
