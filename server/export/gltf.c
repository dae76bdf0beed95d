#include "base/check.h"
#include "base/draft.h"
#include "export/atlas.h"
#include "export/landings.h"
#include "export/look.h"
#include "export/model.h"
#include "export/tracks.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define BESIDE_MM 250.0 // the mock-up, so that both knees are seen

// A cut mesh, shown from one landing to the next.
struct state {
    int node;
    double on_s, off_s;
};

struct animation {
    struct walk walk;
    struct contents contents;
    struct tracks tracks;
    struct model *model;
    int times;                      // the instants
    int materials[CASE_GROUPS_MAX]; // of the case's groups
    int nodes[TRACK_COUNT];
    struct mesh before[TISSUES_MAX]; // as it was before the first step
    int state_count;
    struct state *states;
    int newest[TISSUES_MAX]; // state of each tissue
};

// ---- what there is ------------------------------------------------------------------------------

static void make_materials(struct animation *animation, const struct knee_case *knee) {
    for (int i = 0; i < knee->group_count; i++) {
        float rgba[4];
        look_of_group(&knee->groups[i], rgba);
        animation->materials[i] = model_material(animation->model, knee->groups[i].name, rgba);
    }
}

// z is up in the mock-up's frame, y in glTF.
static int make_root(struct animation *animation, const char *name, double x_mm) {
    int node = model_node(animation->model, name, MODEL_NONE, MODEL_NONE);
    double half = sqrt(0.5);
    model_place(animation->model, node, (pose){{half, -half, 0, 0}, {x_mm, 0, 0}});
    return node;
}

static void add_instrument(struct animation *animation, int i, int seen, int mockup) {
    const char *name = channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + i));
    char in_hand[32];
    struct mesh shape;
    float rgba[4];
    snprintf(in_hand, sizeof in_hand, "mockup_%s", name);
    look_instrument(&animation->contents.header.settings.bodies[i], &shape);
    look_of_instrument(&animation->contents.header.settings.instruments.of[i], rgba);
    int material = model_material(animation->model, name, rgba);
    int made = model_mesh(animation->model, name, &shape, material);
    mesh_fini(&shape);
    animation->nodes[TRACK_WARPED + i] = model_node(animation->model, name, seen, made);
    animation->nodes[TRACK_HAND + i] = model_node(animation->model, in_hand, mockup, made);
}

static void animate_loose(struct animation *animation, const struct case_loose *loose, int i,
                          int seen) {
    struct mesh shape;
    float rgba[4];
    look_loose(loose->radii_mm, &shape, rgba);
    int material = model_material(animation->model, loose->name, rgba);
    int made = model_mesh(animation->model, loose->name, &shape, material);
    mesh_fini(&shape);
    animation->nodes[TRACK_LOOSE + i] = model_node(animation->model, loose->name, seen, made);
}

static void add_virtual_group(struct animation *animation, const struct case_group *group,
                              int material) {
    struct mesh mesh;
    case_group_virtual(group, &mesh);
    int made = model_mesh(animation->model, group->name, &mesh, material);
    mesh_fini(&mesh);
    model_node(animation->model, group->name, animation->nodes[TRACK_VIRTUAL + (int)group->body],
               made);
}

static void add_physical_group(struct animation *animation, const struct case_group *group,
                               int material) {
    const struct mesh *mesh = &group->mesh;
    struct atlas atlas = atlas_of(mesh->triangle_count);
    float *uv = alloc(6 * (size_t)mesh->triangle_count, sizeof *uv);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (uint32_t corner = 0; corner < 3; corner++)
            atlas_uv(&atlas, t, (int)corner, uv + 6 * (size_t)t + 2 * corner);
    int made;
    char name[CASE_NAME_MAX + 16];
    snprintf(name, sizeof name, "mockup_%s", group->name);
    if (group->cuttable)
        made = model_textured_mesh(animation->model, name, mesh, uv, material);
    else
        made = model_mesh(animation->model, name, mesh, material);
    free(uv);
    model_node(animation->model, name, animation->nodes[TRACK_PHYSICAL + (int)group->body], made);
}

static void build(struct animation *animation) {
    const struct knee_case *knee = scene_case(animation->walk.request->scene);
    make_materials(animation, knee);
    int seen = make_root(animation, "seen", 0);
    int mockup = make_root(animation, "mockup", -BESIDE_MM);
    for (int i = 0; i < BODY_COUNT; i++) {
        char name[32];
        const char *body = body_name((enum body)i);
        snprintf(name, sizeof name, "bone_%s", body);
        animation->nodes[TRACK_VIRTUAL + i] = model_node(animation->model, name, seen, MODEL_NONE);
        snprintf(name, sizeof name, "mockup_bone_%s", body);
        animation->nodes[TRACK_PHYSICAL + i] =
            model_node(animation->model, name, mockup, MODEL_NONE);
    }
    for (int i = 0; i < knee->group_count; i++) {
        add_physical_group(animation, &knee->groups[i], animation->materials[i]);
        if (!knee->groups[i].cuttable)
            add_virtual_group(animation, &knee->groups[i], animation->materials[i]);
    }
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (animation->contents.present[i])
            add_instrument(animation, i, seen, mockup);
    for (int i = 0; i < knee->loose_count; i++)
        animate_loose(animation, &knee->loose[i], i, seen);
}

// ---- tissue that is cut -------------------------------------------------------------------------

static void add_state(struct animation *animation, int tissue, const struct mesh *mesh,
                      double on_s) {
    const struct scene *scene = animation->walk.request->scene;
    int index = scene_tissue_group(scene, tissue);
    const struct case_group *group = &scene_case(scene)->groups[index];
    char name[CASE_NAME_MAX + 24];
    snprintf(name, sizeof name, on_s > 0 ? "%s.%d" : "%s", group->name, animation->state_count);
    int made = model_mesh(animation->model, name, mesh, animation->materials[index]);
    animation->states = alloc_resize(animation->states, (size_t)animation->state_count + 1,
                                     sizeof *animation->states);
    animation->states[animation->state_count] =
        (struct state){.node = model_node(animation->model, name,
                                          animation->nodes[TRACK_VIRTUAL + (int)group->body], made),
                       .on_s = on_s,
                       .off_s = INFINITY};
    animation->newest[tissue] = animation->state_count++;
}

static void animate_mesh(const struct operation *operation, int tissue, struct mesh *out_mesh) {
    mesh_fini(out_mesh);
    cut_mesh_flatten(operation_mesh(operation, tissue), out_mesh, NULL, NULL);
}

static void animate_start(void *context, const struct operation *operation) {
    struct animation *animation = context;
    for (int i = 0; i < scene_tissue_count(animation->walk.request->scene); i++)
        animate_mesh(operation, i, &animation->before[i]);
}

static void animate_landing(void *context, struct landing *landing,
                            const struct operation *operation) {
    struct animation *animation = context;
    int tissue = landing->result->tissue;
    double seconds = landing->seconds - animation->tracks.first_s;
    if (!landing->wanted || seconds <= 0)
        return animate_mesh(operation, tissue, &animation->before[tissue]);
    if (animation->newest[tissue] < 0)
        add_state(animation, tissue, &animation->before[tissue], 0);
    struct mesh mesh = {0};
    animate_mesh(operation, tissue, &mesh);
    animation->states[animation->newest[tissue]].off_s = seconds;
    add_state(animation, tissue, &mesh, seconds);
    mesh_fini(&mesh);
}

static enum result animate_tissues(struct animation *animation, struct error *err) {
    struct landing_watcher watcher = {animation, animate_start, animate_landing};
    int count = scene_tissue_count(animation->walk.request->scene);
    for (int i = 0; i < count; i++)
        animation->newest[i] = -1;
    enum result result = landings_run(&animation->walk, &watcher, err);
    for (int i = 0; i < count && result == RESULT_OK; i++)
        if (animation->newest[i] < 0)
            add_state(animation, i, &animation->before[i], 0);
    for (int i = 0; i < count; i++)
        mesh_fini(&animation->before[i]);
    return result;
}

// ---- what moves and changes ---------------------------------------------------------------------

static void show_state(struct animation *animation, const struct state *state) {
    float seconds[3] = {0};
    bool shown[3] = {state->on_s == 0};
    uint32_t count = 1;
    if (state->on_s == 0 && state->off_s == INFINITY)
        return;
    if ((float)state->on_s > 0) {
        seconds[count] = (float)state->on_s;
        shown[count++] = true;
    }
    if (state->off_s < INFINITY && (float)state->off_s > seconds[count - 1])
        seconds[count++] = (float)state->off_s;
    model_show(animation->model, state->node, model_times(animation->model, seconds, count), shown,
               count);
}

static bool stands_still(const pose *poses, uint32_t count) {
    for (uint32_t i = 1; i < count; i++)
        if (memcmp(&poses[i], &poses[0], sizeof poses[0]) != 0)
            return false;
    return true;
}

// Only where it changes: instants of its own.
static void show_track(struct animation *animation, int node, const bool *shown) {
    const struct tracks *t = &animation->tracks;
    float *seconds = alloc(t->count, sizeof *seconds);
    bool *kept = alloc(t->count, sizeof *kept);
    uint32_t count = 0;
    for (uint32_t i = 0; i < t->count; i++) {
        if (count && kept[count - 1] == shown[i])
            continue;
        seconds[count] = t->seconds[i];
        kept[count++] = shown[i];
    }
    model_show(animation->model, node, model_times(animation->model, seconds, count), kept, count);
    free(seconds);
    free(kept);
}

static void animate(struct animation *animation) {
    const struct tracks *t = &animation->tracks;
    animation->times = model_times(animation->model, t->seconds, t->count);
    for (int i = 0; i < TRACK_COUNT; i++) {
        if (!t->poses[i])
            continue;
        model_place(animation->model, animation->nodes[i], t->poses[i][0]);
        if (!stands_still(t->poses[i], t->count))
            model_move(animation->model, animation->nodes[i], animation->times, t->poses[i],
                       t->count);
        if (t->shown[i])
            show_track(animation, animation->nodes[i], t->shown[i]);
    }
    for (int i = 0; i < animation->state_count; i++)
        show_state(animation, &animation->states[i]);
}

static void describe_animation(struct animation *animation) {
    const struct trace_header *h = &animation->contents.header;
    char text[2 * TRACE_HASH_SIZE + 1];
    bytes_text(h->session_id, sizeof h->session_id, text);
    model_note(animation->model, "session", text);
    model_note(animation->model, "case", h->case_name);
    bytes_text(animation->contents.hash, sizeof animation->contents.hash, text);
    model_note(animation->model, "trace_hash", text);
    snprintf(text, sizeof text, "%.9f", animation->tracks.first_s);
    model_note(animation->model, "start_s", text);
}

// ---- the file -----------------------------------------------------------------------------------

static enum result make(struct animation *animation, const char *path, struct error *err) {
    uint8_t *bytes = NULL;
    size_t size;
    enum result result =
        tracks_create(&animation->walk, &animation->contents, &animation->tracks, err);
    if (result != RESULT_OK)
        return result;
    build(animation);
    result = animate_tissues(animation, err);
    if (result == RESULT_OK) {
        animate(animation);
        describe_animation(animation);
        result = model_encode(animation->model, &bytes, &size, err);
    }
    if (result == RESULT_OK)
        result = draft_write(path, bytes, size, err);
    free(bytes);
    tracks_fini(&animation->tracks);
    return result;
}

enum result export_gltf(const struct export_request *request, const char *path, struct error *err) {
    CHECK(request->scene);
    struct animation animation = {.walk = {.request = request, .passes = 2}};
    enum result result = contents_read(request, &animation.contents, err);
    if (result != RESULT_OK)
        return result;
    animation.model = model_create();
    result = make(&animation, path, err);
    model_destroy(&animation.model);
    free(animation.states);
    return result == RESULT_OK ? contents_end(&animation.contents, err) : result;
}
