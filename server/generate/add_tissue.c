#include "generate/add_tissue.h"

#include "base/number.h"
#include "generate/bridge.h"
#include "generate/tube.h"

#include <math.h>
#include <string.h>

static const double path_most = 100, section_least = 0.5, section_most = 30, length_least = 3;
static const double edge_least = 0.3, edge_most = 1;
static const double thread = 0.2; // of the section

void add_tissue_init(struct add_tissue *step) {
    *step = (struct add_tissue){.body = BODY_COUNT, .bridges = BODY_COUNT, .flat = {0, 0, 1}};
}

// ---- words --------------------------------------------------------------------------------------

static enum result refuse(struct error *err, const char *key, const char *reason) {
    return fail(err, RESULT_INVALID, "%s: %s", key, reason);
}

static bool take_points(const char *value, int most, vec3 *out, int *out_count) {
    char text[256], *rest;
    double numbers[3 * TISSUE_PATH_MAX];
    int count = 0;
    if (strlen(value) >= sizeof text)
        return false;
    strcpy(text, value);
    for (char *w = strtok_r(text, " \t,", &rest); w; w = strtok_r(NULL, " \t,", &rest))
        if (count == 3 * most || !number_double(w, -path_most, path_most, &numbers[count++]))
            return false;
    for (int i = 0; i < count / 3; i++)
        out[i] = (vec3){numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]};
    *out_count = count / 3;
    return count > 0 && count % 3 == 0;
}

static enum result take_description(struct add_tissue *step, const char *key, const char *value,
                                    bool *out_known, struct error *err) {
    *out_known = true;
    if (strcmp(key, "kind") == 0)
        return (step->has_kind = tissue_kind_from_name(value, &step->kind))
                   ? RESULT_OK
                   : refuse(err, key,
                            "must be bone, cartilage, meniscus, ligament, synovium, skin or other");
    if (strcmp(key, "side") == 0)
        return (step->has_side = tissue_side_from_name(value, &step->side))
                   ? RESULT_OK
                   : refuse(err, key, "must be medial, lateral or none");
    if (strcmp(key, "colour") == 0)
        return (step->has_colour = tissue_colour_from_text(value, &step->colour))
                   ? RESULT_OK
                   : refuse(err, key, "must be #rrggbb");
    *out_known = strcmp(key, "label") == 0;
    if (*out_known && !tissue_label_is_valid(value))
        return refuse(err, key, "must be 1 to 63 bytes of text");
    if (*out_known)
        strcpy(step->label, value);
    return RESULT_OK;
}

static enum result take_told(enum told *out, const char *key, const char *value,
                             struct error *err) {
    *out = strcmp(value, "yes") == 0 ? TOLD_YES : TOLD_NO;
    return *out == TOLD_YES || strcmp(value, "no") == 0 ? RESULT_OK
                                                        : refuse(err, key, "must be yes or no");
}

static enum result take_length(double *out, const char *key, const char *value, struct error *err) {
    if (number_double(value, section_least, section_most, out))
        return RESULT_OK;
    return fail(err, RESULT_INVALID, "%s = %s: must be a number from %g to %g", key, value,
                section_least, section_most);
}

enum result add_tissue_take(struct add_tissue *step, const char *key, const char *value,
                            struct error *err) {
    int count;
    bool known;
    enum result result = take_description(step, key, value, &known, err);
    if (known)
        return result;
    if (strcmp(key, "zones") == 0)
        return take_told(&step->zones, key, value, err);
    if (strcmp(key, "cuttable") == 0)
        return take_told(&step->cuttable, key, value, err);
    if (strcmp(key, "width_mm") == 0)
        return take_length(&step->width_mm, key, value, err);
    if (strcmp(key, "thickness_mm") == 0)
        return take_length(&step->thickness_mm, key, value, err);
    if (strcmp(key, "body") == 0 || strcmp(key, "bridges") == 0)
        return body_from_name(value, key[1] == 'o' ? &step->body : &step->bridges)
                   ? RESULT_OK
                   : refuse(err, key, "must be femur, tibia or patella");
    if (strcmp(key, "path") == 0)
        return take_points(value, TISSUE_PATH_MAX, step->path, &step->path_count) &&
                       step->path_count >= 2
                   ? RESULT_OK
                   : refuse(err, key, "must be 2 to 4 places, each x y z, within 100 mm");
    if (strcmp(key, "flat") == 0)
        return take_points(value, 1, &step->flat, &count) && vec3_length(step->flat) > 0
                   ? RESULT_OK
                   : refuse(err, key, "must be a direction, x y z");
    return refuse(err, key, "unknown key");
}

enum result add_tissue_check(const struct add_tissue *step, struct error *err) {
    bool shaped = step->path_count && step->width_mm && step->thickness_mm;
    bool partly = step->path_count || step->width_mm || step->thickness_mm;
    if (partly != shaped || shaped != (step->body != BODY_COUNT) ||
        (step->bridges != BODY_COUNT && !shaped))
        return fail(err, RESULT_MISSING,
                    "a new group needs body, path, width_mm and thickness_mm; one that is there "
                    "has none of these, and no bridges");
    if (shaped && !(vec3_distance(step->path[0], step->path[step->path_count - 1]) >= length_least))
        return fail(err, RESULT_INVALID, "path: its ends must be %g mm apart at least",
                    length_least);
    return RESULT_OK;
}

// ---- the group ----------------------------------------------------------------------------------

// The same curve with four control points.
static void raise_degree(const vec3 *path, int count, vec3 out[4]) {
    vec3 p[4];
    memcpy(p, path, (size_t)count * sizeof *p);
    for (; count < 4; count++) {
        p[count] = p[count - 1];
        for (int i = count - 1; i > 0; i--)
            p[i] = vec3_lerp(p[i], p[i - 1], (double)i / count);
    }
    memcpy(out, p, 4 * sizeof *p);
}

static vec3 to_body(const struct knee_case *knee, const struct add_tissue *step, vec3 p) {
    pose T = step->body == BODY_TIBIA ? knee->joint.T_tibia_joint : knee->joint.T_femur_joint;
    if (knee->joint.side == SIDE_LEFT)
        p.x = -p.x;
    return pose_apply(T, p);
}

static struct ligament tube_of(const struct add_tissue *step) {
    struct ligament tube = {.flat = step->flat,
                            .half_width = step->width_mm / 2,
                            .half_thickness = step->thickness_mm / 2};
    raise_degree(step->path, step->path_count, tube.path);
    return tube;
}

static void make_mesh(const struct knee_case *knee, const struct add_tissue *step,
                      struct mesh *out_mesh) {
    struct ligament tube = tube_of(step);
    bool mirrored = knee->joint.side == SIDE_LEFT;
    tube_ligament(&tube, fmin(fmax(step->thickness_mm / 3, edge_least), edge_most), out_mesh);
    for (uint32_t v = 0; v < out_mesh->vertex_count; v++)
        mesh_set_vertex(out_mesh, v, to_body(knee, step, mesh_vertex(out_mesh, v)));
    for (size_t t = 0; t < out_mesh->triangle_count && mirrored; t++) {
        uint32_t *corner = out_mesh->triangles + 3 * t, first = corner[0];
        corner[0] = corner[1];
        corner[1] = first;
    }
}

// The greatest resection leaves a thin thread round the curve.
static void make_maxcut(const struct knee_case *knee, struct case_group *group,
                        const struct add_tissue *step) {
    enum { FINE = 256 };
    struct ligament tube = tube_of(step);
    vec3 curve[FINE + 1];
    for (int i = 0; i <= FINE; i++)
        curve[i] = to_body(knee, step, tube_curve(tube.path, (double)i / FINE));
    float *maxcut = case_group_need_maxcut(group);
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
        vec3 p = mesh_vertex(&group->mesh, v), nearest = curve[0];
        for (int i = 1; i <= FINE; i++)
            if (vec3_distance(curve[i], p) < vec3_distance(nearest, p))
                nearest = curve[i];
        vec3 way = vec3_scale(1 - thread, vec3_sub(nearest, p));
        maxcut[3 * v] = (float)way.x;
        maxcut[3 * v + 1] = (float)way.y;
        maxcut[3 * v + 2] = (float)way.z;
    }
}

static enum result add_group(struct knee_case *knee, const char *name,
                             const struct add_tissue *step, struct error *err) {
    if (case_group(knee, name))
        return fail(err, RESULT_INVALID, "the case has a group %s already", name);
    struct case_group *group = case_add_group(knee, name, step->body);
    struct mesh mesh;
    if (!group)
        return fail(err, RESULT_LIMIT, "the case has %d groups already", CASE_GROUPS_MAX);
    make_mesh(knee, step, &mesh);
    enum result result = case_add_part(group, name, &mesh, err);
    mesh_fini(&mesh);
    if (result == RESULT_OK && step->bridges != BODY_COUNT)
        result = bridge_make(knee, group, step->bridges, err);
    if (result == RESULT_OK && step->cuttable == TOLD_YES)
        make_maxcut(knee, group, step);
    return result;
}

static void describe(struct case_group *group, const struct add_tissue *step) {
    struct case_tissue *tissue = &group->tissue;
    if (step->has_kind)
        tissue_set_kind(tissue, step->kind);
    if (step->has_colour)
        tissue->colour = step->colour;
    if (step->has_side)
        tissue->side = step->side;
    if (step->label[0])
        strcpy(tissue->label, step->label);
    if (step->zones != TOLD_NOTHING)
        tissue->has_zones = step->zones == TOLD_YES;
    if (step->cuttable != TOLD_NOTHING)
        group->cuttable = step->cuttable == TOLD_YES;
}

enum result add_tissue_apply(struct knee_case *knee, const char *name,
                             const struct add_tissue *step, struct error *err) {
    enum result result = step->path_count ? add_group(knee, name, step, err) : RESULT_OK;
    struct case_group *group = case_group(knee, name);
    if (result != RESULT_OK)
        return result;
    if (!group)
        return fail(err, RESULT_MISSING, "the case has no group %s; a new one needs a path", name);
    describe(group, step);
    if (!case_group_wears(group))
        case_group_make_whole(group);
    return case_validate(knee, err);
}
