#include "check/section.h"

#include "base/check.h"
#include "check/parallel.h"

#include <stdlib.h>
#include <string.h>

#define WIDTH_MM 100
#define BELOW_MM 30
#define ABOVE_MM 40
#define TOP_MM 15
#define PATCH_MM 0.5
#define SEEN_MM 0.02 // what is displaced by less has one outline

const char *section_name(enum section_kind kind) {
    static const char *const names[SECTION_KIND_COUNT] = {"coronal, through both contacts",
                                                          "sagittal, medial", "sagittal, lateral"};
    return (unsigned)kind < SECTION_KIND_COUNT ? names[kind] : "unknown";
}

// ---- the joint, seen from the tibia -------------------------------------------------------------

// The stance with the tibia's joint frame for a world.
struct section_view {
    struct scene_stance stance;
    struct warp_scene scene;
    pose T_world_body[BODY_COUNT], correction[BODY_COUNT];
};

static void view_init(struct section_view *view, const struct scene *scene,
                      enum adaptive_kind adaptive, const struct joint_angles *joint) {
    struct scene_stance *stance = &view->stance;
    scene_stand(scene, adaptive, joint, stance);
    pose T_femur_world =
        pose_compose(stance->T_femur_body[BODY_TIBIA], scene_case(scene)->joint.T_tibia_joint);
    pose T_world_femur = pose_inverse(T_femur_world);
    for (int i = 0; i < BODY_COUNT; i++) {
        view->T_world_body[i] = pose_compose(T_world_femur, stance->T_femur_body[i]);
        view->correction[i] =
            pose_compose(T_world_femur, pose_compose(stance->correction[i], T_femur_world));
    }
    view->scene = stance->warp;
    view->scene.T_world_body = view->T_world_body;
    view->scene.correction = view->correction;
}

static int surface_of(const struct knee_case *knee, const char *name) {
    for (int i = 0; i < knee->group_count; i++)
        if (!strcmp(knee->groups[i].name, name))
            return i;
    CHECK(!"a case has tibia and femur");
    return -1;
}

static double gap_over(const struct section_view *view, int femur, vec3 p) {
    const struct warp_surface *s = &view->scene.surfaces[femur];
    struct closest closest;
    vec3 q = pose_apply_inverse(view->T_world_body[s->body], p);
    return query_closest(s->query, q, INFINITY, MESH_NONE, &closest) ? closest.distance : INFINITY;
}

// Of the tibia's upper vertices on one side, the middle of those that are nearest to the femur.
static vec3 contact_on(const struct section_view *view, const struct knee_case *knee, double side) {
    const struct warp_surface *tibia = &view->scene.surfaces[surface_of(knee, "tibia")];
    int femur = surface_of(knee, "femur");
    pose T = view->T_world_body[tibia->body];
    double top = -INFINITY, nearest = INFINITY;
    double *gaps = alloc(tibia->mesh->vertex_count, sizeof *gaps);
    for (uint32_t v = 0; v < tibia->mesh->vertex_count; v++)
        top = fmax(top, pose_apply(T, mesh_vertex(tibia->mesh, v)).z);
    for (uint32_t v = 0; v < tibia->mesh->vertex_count; v++) {
        vec3 p = pose_apply(T, mesh_vertex(tibia->mesh, v));
        bool counts = p.z > top - TOP_MM && side * p.x > 8;
        gaps[v] = counts ? gap_over(view, femur, p) : INFINITY;
        nearest = fmin(nearest, gaps[v]);
    }
    vec3 sum = {0};
    double count = 0;
    for (uint32_t v = 0; v < tibia->mesh->vertex_count; v++)
        if (gaps[v] <= nearest + PATCH_MM && isfinite(gaps[v])) {
            sum = vec3_add(sum, pose_apply(T, mesh_vertex(tibia->mesh, v)));
            count++;
        }
    free(gaps);
    return count > 0 ? vec3_scale(1 / count, sum) : (vec3){side * 20, 0, 0};
}

static struct box box_of_view(const struct section_view *view, const struct knee_case *knee,
                              enum section_kind kind) {
    double lateral_side = knee->joint.side == SIDE_RIGHT ? 1 : -1;
    vec3 medial = contact_on(view, knee, -lateral_side),
         lateral = contact_on(view, knee, lateral_side);
    vec3 middle = vec3_lerp(medial, lateral, 0.5);
    vec3 at = kind == SECTION_MEDIAL ? medial : kind == SECTION_LATERAL ? lateral : middle;
    vec3 half =
        kind == SECTION_CORONAL ? (vec3){WIDTH_MM / 2.0, 0, 0} : (vec3){0, WIDTH_MM / 2.0, 0};
    struct box box = {vec3_sub(at, half), vec3_add(at, half)};
    box.min.z -= BELOW_MM;
    box.max.z += ABOVE_MM;
    return box;
}

// ---- cells --------------------------------------------------------------------------------------

struct fill {
    const struct section_view *view;
    const struct field *field;
    const struct space *space;
    struct section *section;
};

static size_t node_of(const struct section *s, const struct space *space, int i, int k) {
    return s->kind == SECTION_CORONAL ? space_node(space, i, 0, k) : space_node(space, 0, i, k);
}

static vec3 place_of_cell(const struct section *s, const struct space *space, int i, int k) {
    return s->kind == SECTION_CORONAL ? space_at(space, i, 0, k) : space_at(space, 0, i, k);
}

static void fill_cell(const struct fill *fill, vec3 y, struct warp_memory *memory,
                      struct section_cell *cell) {
    struct warp warp;
    struct warp_contact contacts[WARP_SURFACES_MAX];
    int count = warp_contacts(&fill->view->scene, fill->field, y, memory, &warp, contacts),
        near = 0;
    for (int i = 0; i < count; i++)
        near += contacts[i].distance < SECOND_GROUP_MM;
    cell->close = near >= 2;
    cell->still = vec3_length(warp.displacement) == 0;
    cell->gain = (float)mat3_norm(warp.gradient);
    cell->folds = mat3_determinant(mat3_add_scaled(mat3_identity(), 1, warp.gradient)) <= 0;
}

static void fill_row(void *context, int k) {
    const struct fill *fill = context;
    struct section *s = fill->section;
    struct warp_memory memory;
    warp_memory_init(&memory);
    for (int i = 0; i < s->size[0]; i++) {
        struct section_cell *cell = &s->cells[i + s->size[0] * k];
        cell->place = fill->space->places[node_of(s, fill->space, i, k)];
        if (cell->place == PLACE_FREE)
            fill_cell(fill, place_of_cell(s, fill->space, i, k), &memory, cell);
    }
}

// Which solid: the last one in the case's order that holds it, as menisci come after bones.
static enum result name_solids(const struct section_view *view, const struct space_setup *setup,
                               struct section *s, struct error *err) {
    for (int g = 0; g < view->scene.surface_count; g++) {
        struct warp_scene one = view->scene;
        one.surfaces += g;
        one.surface_count = 1;
        struct space_setup alone = *setup;
        alone.scene = &one;
        alone.surfaces += g;
        alone.plane_count = 0;
        struct space space;
        enum result result = space_init(&alone, &space, err);
        if (result != RESULT_OK)
            return result;
        for (int k = 0; k < s->size[1]; k++)
            for (int i = 0; i < s->size[0]; i++)
                if (space.places[node_of(s, &space, i, k)] == PLACE_SOLID)
                    s->cells[i + s->size[0] * k].group = (uint8_t)g;
        space_fini(&space);
    }
    return RESULT_OK;
}

// ---- outlines -----------------------------------------------------------------------------------

static double off_plane(const struct section *s, vec3 p) {
    return (s->kind == SECTION_CORONAL ? p.y : p.x) - s->at;
}

// Where the plane crosses a triangle: both ends by their weights; false where it does not.
static bool cross(const struct section *s, const vec3 corners[3], double out_weights[2][3]) {
    int found = 0;
    memset(out_weights, 0, 6 * sizeof(double));
    for (int i = 0; i < 3 && found < 2; i++) {
        int next = (i + 1) % 3;
        double a = off_plane(s, corners[i]), b = off_plane(s, corners[next]);
        if ((a > 0) == (b > 0))
            continue;
        out_weights[found][i] = b / (b - a);
        out_weights[found++][next] = -a / (b - a);
    }
    return found == 2;
}

static void add_line(struct section *s, const vec3 corners[3], double weights[2][3],
                     struct section_line line) {
    float *ends[2] = {line.from, line.to};
    for (int e = 0; e < 2; e++) {
        vec3 p = {0};
        for (int i = 0; i < 3; i++)
            p = vec3_add_scaled(p, weights[e][i], corners[i]);
        ends[e][0] = (float)(s->kind == SECTION_CORONAL ? p.x : p.y);
        ends[e][1] = (float)p.z;
    }
    if ((s->line_count & (s->line_count + 1)) == 0) // at 0, 1, 3, 7, ...: room for as many again
        s->lines = alloc_resize(s->lines, 2 * s->line_count + 1, sizeof *s->lines);
    s->lines[s->line_count++] = line;
}

static void outline(struct section *s, const struct section_view *view, uint32_t skipped,
                    int surface, uint32_t triangle) {
    const struct warp_surface *w = &view->scene.surfaces[surface];
    vec3 physical[3], shown[3];
    double weights[2][3], middle[3], moved = 0;
    for (int i = 0; i < 3; i++) {
        struct closest at = {.triangle = triangle, .weights = {i == 0, i == 1, i == 2}};
        at.point = mesh_corner(w->mesh, triangle, i);
        physical[i] = pose_apply(view->T_world_body[w->body], at.point);
        vec3 delta = warp_of_contact(&view->scene, surface, &at);
        shown[i] = vec3_add(physical[i], delta);
        moved = fmax(moved, vec3_length(delta));
    }
    if (cross(s, physical, weights)) {
        struct section_line line = {.group = (uint8_t)surface};
        struct facing_spot filling, strain;
        for (int i = 0; i < 3; i++)
            middle[i] = 0.5 * (weights[0][i] + weights[1][i]);
        if (!(skipped >> surface & 1) &&
            facing_at(&view->scene, skipped, surface, triangle, middle, &filling, &strain)) {
            line.filled = facing_is_filled(&filling);
            line.strained = facing_is_strained(&strain);
        }
        add_line(s, physical, weights, line);
    }
    if (moved > SEEN_MM && cross(s, shown, weights))
        add_line(s, shown, weights,
                 (struct section_line){.group = (uint8_t)surface, .is_virtual = true});
}

// ---- the section --------------------------------------------------------------------------------

static void frame(struct section *s, const struct space *space) {
    bool coronal = s->kind == SECTION_CORONAL;
    s->at = coronal ? space->origin.y : space->origin.x;
    s->origin[0] = coronal ? space->origin.x : space->origin.y;
    s->origin[1] = space->origin.z;
    s->size[0] = space->size[coronal ? 0 : 1];
    s->size[1] = space->size[2];
    s->cells = alloc((size_t)s->size[0] * (size_t)s->size[1], sizeof *s->cells);
}

enum result section_make(const struct scene *scene, const struct check_settings *settings,
                         const struct joint_angles *joint, enum section_kind kind,
                         double spacing_mm, struct section *out, struct error *err) {
    struct section_view view;
    struct space_surface roles[CASE_GROUPS_MAX];
    struct plane planes[CONVEX_PLANES_MAX];
    view_init(&view, scene, settings->adaptive, joint);
    check_roles(scene, roles);
    *out = (struct section){.kind = kind, .spacing_mm = spacing_mm};
    struct space_setup setup = {.scene = &view.scene,
                                .surfaces = roles,
                                .planes = planes,
                                .plane_count = check_planes(scene, &view.stance, planes),
                                .box = box_of_view(&view, scene_case(scene), kind),
                                .spacing_mm = spacing_mm};
    pose T_femur_world =
        pose_compose(view.stance.T_femur_body[BODY_TIBIA], scene_case(scene)->joint.T_tibia_joint);
    for (int i = 0; i < setup.plane_count; i++) {
        planes[i].offset -= vec3_dot(planes[i].normal, T_femur_world.translation);
        planes[i].normal = quat_rotate(quat_conjugate(T_femur_world.rotation), planes[i].normal);
    }
    struct space space;
    enum result result = space_init(&setup, &space, err);
    if (result != RESULT_OK)
        return result;
    frame(out, &space);
    struct fill fill = {&view, &settings->field, &space, out};
    parallel_for(out->size[1], fill_row, &fill, NULL);
    space_fini(&space);
    uint32_t skipped = 0;
    for (int g = 0; g < view.scene.surface_count; g++)
        skipped |= roles[g].role == SPACE_SKIN ? UINT32_C(1) << g : 0;
    for (int g = 0; g < view.scene.surface_count; g++)
        for (uint32_t t = 0; t < view.scene.surfaces[g].mesh->triangle_count; t++)
            outline(out, &view, skipped, g, t);
    result = name_solids(&view, &setup, out, err);
    if (result != RESULT_OK)
        section_fini(out);
    return result;
}

void section_fini(struct section *section) {
    free(section->cells);
    free(section->lines);
    *section = (struct section){0};
}
