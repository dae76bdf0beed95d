#include "case/case.h"

#include "base/check.h"
#include "mesh/topology.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#define DISPLACEMENT_MAX_MM 1e4f

static const char *const body_names[BODY_COUNT] = {"femur", "tibia", "patella"};

const char *body_name(enum body body) {
    CHECK((unsigned)body < BODY_COUNT);
    return body_names[body];
}

bool body_from_name(const char *name, enum body *out_body) {
    for (int i = 0; i < BODY_COUNT; i++) {
        if (strcmp(name, body_names[i]) == 0) {
            *out_body = (enum body)i;
            return true;
        }
    }
    return false;
}

bool case_name_is_valid(const char *name) {
    size_t length = strlen(name);
    if (length == 0 || length >= CASE_NAME_MAX)
        return false;
    for (const char *c = name; *c; c++)
        if (!isalnum((unsigned char)*c) && !strchr("_-.", *c))
            return false;
    return true;
}

static void set_name(char *out_name, const char *name) {
    CHECK(case_name_is_valid(name));
    memcpy(out_name, name, strlen(name) + 1);
}

struct case_limits case_limits_default(void) {
    return (struct case_limits){.file_bytes = (size_t)512 << 20, .group_triangles = 2000000};
}

// Cut between two characters of UTF-8.
static void set_title(struct knee_case *knee, const char *title) {
    size_t length = strnlen(title, sizeof knee->title);
    if (length == sizeof knee->title)
        for (length--; length > 0 && ((unsigned char)title[length] & 0xc0) == 0x80;)
            length--;
    memcpy(knee->title, title, length);
}

struct knee_case *case_create(const char *name, const char *title) {
    struct knee_case *knee = alloc(1, sizeof *knee);
    set_name(knee->name, name);
    set_title(knee, title);
    knee->joint.T_femur_joint = pose_identity();
    knee->joint.T_tibia_joint = pose_identity();
    return knee;
}

void case_destroy(struct knee_case **knee) {
    if (!*knee)
        return;
    for (int i = 0; i < (*knee)->group_count; i++) {
        struct case_group *group = &(*knee)->groups[i];
        mesh_fini(&group->mesh);
        free(group->warp);
        free(group->maxcut);
        free(group->other_share);
        free(group->covered);
        free(group->wear);
        free(group->lesion.tear.parts);
        free(group->lesion.damage.parts);
        free(group->lesion.plan.parts);
    }
    free(*knee);
    *knee = NULL;
}

bool case_group_is_skin(const struct case_group *group) {
    return group->tissue.kind == TISSUE_SKIN;
}

bool case_group_is_bone(const struct case_group *group) {
    return !strcmp(group->name, body_name(group->body));
}

struct case_group *case_skin(struct knee_case *knee) {
    for (int i = 0; i < knee->group_count; i++)
        if (case_group_is_skin(&knee->groups[i]))
            return &knee->groups[i];
    return NULL;
}

struct case_group *case_meniscus(struct knee_case *knee, enum tissue_side side) {
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_tissue *tissue = &knee->groups[i].tissue;
        if (tissue->kind == TISSUE_MENISCUS && tissue->side == side)
            return &knee->groups[i];
    }
    return NULL;
}

struct case_tissue case_group_usual(const struct case_group *group) {
    struct case_tissue tissue = tissue_usual(group->name);
    if (group->bridges && tissue.kind == TISSUE_OTHER)
        tissue_set_kind(&tissue, TISSUE_LIGAMENT);
    return tissue;
}

struct case_group *case_group(struct knee_case *knee, const char *name) {
    for (int i = 0; i < knee->group_count; i++)
        if (strcmp(knee->groups[i].name, name) == 0)
            return &knee->groups[i];
    return NULL;
}

struct case_group *case_add_group(struct knee_case *knee, const char *name, enum body body) {
    CHECK(!case_group(knee, name));
    if (knee->group_count == CASE_GROUPS_MAX)
        return NULL;
    struct case_group *group = &knee->groups[knee->group_count++];
    set_name(group->name, name);
    group->body = body;
    group->tissue = case_group_usual(group);
    return group;
}

static float *append_floats(float *values, size_t count, const float *more, size_t more_count) {
    values = alloc_resize(values, count + more_count, sizeof *values);
    if (more)
        memcpy(values + count, more, more_count * sizeof *values);
    else
        memset(values + count, 0, more_count * sizeof *values);
    return values;
}

static void append_mesh(struct case_group *group, const struct mesh *mesh) {
    struct mesh *joined = &group->mesh;
    size_t old = 3 * (size_t)joined->vertex_count, more = 3 * (size_t)mesh->vertex_count;
    joined->positions = append_floats(joined->positions, old, mesh->positions, more);
    if (group->warp)
        group->warp = append_floats(group->warp, old, NULL, more);
    if (group->maxcut)
        group->maxcut = append_floats(group->maxcut, old, NULL, more);
    if (group->bridges)
        group->other_share =
            append_floats(group->other_share, joined->vertex_count, NULL, mesh->vertex_count);
    if (group->covered)
        group->covered =
            append_floats(group->covered, joined->vertex_count, NULL, mesh->vertex_count);
    if (group->wear)
        group->wear = append_floats(group->wear, joined->vertex_count, NULL, mesh->vertex_count);
    size_t corners = 3 * (size_t)joined->triangle_count;
    size_t more_corners = 3 * (size_t)mesh->triangle_count;
    joined->triangles =
        alloc_resize(joined->triangles, corners + more_corners, sizeof *joined->triangles);
    for (size_t i = 0; i < more_corners; i++)
        joined->triangles[corners + i] = mesh->triangles[i] + joined->vertex_count;
    joined->vertex_count += mesh->vertex_count;
    joined->triangle_count += mesh->triangle_count;
}

static enum result check_part_name(const struct case_group *group, const char *name,
                                   struct error *err) {
    if (!case_name_is_valid(name))
        return fail(err, RESULT_INVALID, "\"%.80s\" cannot be the name of a part", name);
    for (int i = 0; i < group->part_count; i++)
        if (strcmp(group->parts[i].name, name) == 0)
            return fail(err, RESULT_INVALID, "there are two parts %s", name);
    return RESULT_OK;
}

enum result case_add_part(struct case_group *group, const char *name, const struct mesh *mesh,
                          struct error *err) {
    enum result result = check_part_name(group, name, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "group %s: ", group->name);
    if (group->part_count == CASE_PARTS_MAX)
        return fail(err, RESULT_LIMIT, "group %s: more than %d parts", group->name, CASE_PARTS_MAX);
    result = mesh_validate(mesh, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "group %s: part %s: ", group->name, name);
    if (mesh->vertex_count > UINT32_MAX / 3 - group->mesh.vertex_count ||
        mesh->triangle_count > UINT32_MAX / 3 - group->mesh.triangle_count)
        return fail(err, RESULT_LIMIT, "group %s: part %s: too large", group->name, name);
    struct case_part *part = &group->parts[group->part_count++];
    set_name(part->name, name);
    part->first_vertex = group->mesh.vertex_count;
    part->vertex_count = mesh->vertex_count;
    part->first_triangle = group->mesh.triangle_count;
    part->triangle_count = mesh->triangle_count;
    append_mesh(group, mesh);
    return RESULT_OK;
}

float *case_group_need_warp(struct case_group *group) {
    if (!group->warp)
        group->warp = alloc(3 * (size_t)group->mesh.vertex_count, sizeof *group->warp);
    return group->warp;
}

float *case_group_need_maxcut(struct case_group *group) {
    if (!group->maxcut)
        group->maxcut = alloc(3 * (size_t)group->mesh.vertex_count, sizeof *group->maxcut);
    return group->maxcut;
}

float *case_group_need_covered(struct case_group *group) {
    if (!group->covered)
        group->covered = alloc(group->mesh.vertex_count, sizeof *group->covered);
    return group->covered;
}

bool case_group_wears(const struct case_group *group) {
    enum tissue_kind kind = group->tissue.kind;
    return (kind == TISSUE_BONE || kind == TISSUE_CARTILAGE) && !group->cuttable;
}

void case_group_make_whole(struct case_group *group) {
    free(group->wear);
    group->wear = NULL;
}

float *case_group_need_wear(struct case_group *group) {
    if (!group->wear)
        group->wear = alloc(group->mesh.vertex_count, sizeof *group->wear);
    return group->wear;
}

static bool is_covered(const struct case_group *group, uint32_t triangle) {
    const uint32_t *v = group->mesh.triangles + 3 * (size_t)triangle;
    return group->covered && group->covered[v[0]] > 0 && group->covered[v[1]] > 0 &&
           group->covered[v[2]] > 0;
}

void case_group_surface(const struct case_group *group, struct mesh *out_mesh) {
    mesh_copy(out_mesh, &group->mesh);
    uint32_t count = 0;
    for (uint32_t t = 0; t < group->mesh.triangle_count; t++)
        if (!is_covered(group, t))
            memcpy(out_mesh->triangles + 3 * (size_t)count++, group->mesh.triangles + 3 * (size_t)t,
                   3 * sizeof *out_mesh->triangles);
    out_mesh->triangle_count = count;
}

void case_group_bridge(struct case_group *group, enum body other) {
    CHECK(!group->bridges);
    group->bridges = true;
    group->other_body = other;
    if (group->tissue.kind == TISSUE_OTHER)
        tissue_set_kind(&group->tissue, TISSUE_LIGAMENT);
    if (group->mesh.vertex_count)
        group->other_share = alloc(group->mesh.vertex_count, sizeof *group->other_share);
}

void case_group_virtual(const struct case_group *group, struct mesh *out_mesh) {
    mesh_copy(out_mesh, &group->mesh);
    for (size_t i = 0; group->warp && i < 3 * (size_t)group->mesh.vertex_count; i++)
        out_mesh->positions[i] += group->warp[i];
}

enum result case_region_add(struct case_region *region, const struct plane *planes, int count,
                            struct error *err) {
    if (region->part_count == CASE_REGION_PARTS_MAX)
        return fail(err, RESULT_LIMIT, "more than %d parts", CASE_REGION_PARTS_MAX);
    if (!region->parts)
        region->parts = alloc(CASE_REGION_PARTS_MAX, sizeof *region->parts);
    enum result result = convex_create(planes, count, &region->parts[region->part_count], err);
    region->part_count += result == RESULT_OK;
    return result;
}

pose case_patella_pose(const struct knee_case *knee, double flexion_deg) {
    return patella_pose(knee->patella_keys, knee->patella_key_count, flexion_deg);
}

// ---- what every case must be --------------------------------------------------------------------

static enum result check_displacement(const struct case_group *group, const char *name,
                                      const float *values, struct error *err) {
    for (size_t i = 0; values && i < 3 * (size_t)group->mesh.vertex_count; i++)
        if (!(fabsf(values[i]) <= DISPLACEMENT_MAX_MM))
            return fail(err, RESULT_INVALID,
                        "group %s: %s of vertex %zu is not finite or beyond %g m", group->name,
                        name, i / 3, (double)DISPLACEMENT_MAX_MM / 1000);
    return RESULT_OK;
}

static enum result check_bridge(const struct case_group *group, struct error *err) {
    if (!group->bridges)
        return RESULT_OK;
    if (group->cuttable)
        return fail(err, RESULT_INVALID, "group %s bridges two bones, so it cannot be cuttable",
                    group->name);
    if (group->other_body == group->body)
        return fail(err, RESULT_INVALID, "group %s bridges from its body %s to the same",
                    group->name, body_name(group->body));
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++)
        if (!(group->other_share[v] >= 0 && group->other_share[v] <= 1))
            return fail(err, RESULT_INVALID, "group %s: other_share of vertex %u is not 0 to 1",
                        group->name, v);
    return RESULT_OK;
}

static enum result check_covered(const struct case_group *group, struct error *err) {
    uint32_t bare = 0;
    if (!group->covered)
        return RESULT_OK;
    if (group->cuttable)
        return fail(err, RESULT_INVALID, "group %s is cuttable, so nothing of it can be covered",
                    group->name);
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++)
        if (group->covered[v] != 0 && group->covered[v] != 1)
            return fail(err, RESULT_INVALID, "group %s: covered of vertex %u is neither 0 nor 1",
                        group->name, v);
    for (uint32_t t = 0; t < group->mesh.triangle_count; t++)
        bare += !is_covered(group, t);
    return bare ? RESULT_OK
                : fail(err, RESULT_INVALID, "group %s: all of it is covered", group->name);
}

static enum result check_wear(const struct case_group *group, struct error *err) {
    if (group->wear && group->cuttable)
        return fail(err, RESULT_INVALID, "group %s is cuttable, so nothing of it can be worn",
                    group->name);
    if (group->wear && !case_group_wears(group))
        return fail(err, RESULT_INVALID,
                    "group %s is neither bone nor cartilage, so nothing of it can be worn",
                    group->name);
    for (uint32_t v = 0; group->wear && v < group->mesh.vertex_count; v++)
        if (!(group->wear[v] >= 0 && group->wear[v] <= CASE_WEAR_MOST))
            return fail(err, RESULT_INVALID, "group %s: wear of vertex %u is not 0 to %g",
                        group->name, v, CASE_WEAR_MOST);
    return RESULT_OK;
}

static enum result check_cuttable(const struct case_group *group, struct error *err) {
    struct topology t = topology_of(&group->mesh);
    if (group->part_count != 1)
        return fail(err, RESULT_INVALID, "group %s is cuttable but has %d parts", group->name,
                    group->part_count);
    if (!t.closed)
        return fail(err, RESULT_INVALID,
                    "group %s is cuttable but open: %u edges with one triangle", group->name,
                    t.open_edges);
    if (!t.manifold)
        return fail(err, RESULT_INVALID,
                    "group %s is cuttable but not manifold: %u edges, %u vertices", group->name,
                    t.non_manifold_edges, t.non_manifold_vertices);
    if (!t.oriented)
        return fail(err, RESULT_INVALID,
                    "group %s is cuttable but not oriented: triangles disagree along %u edges",
                    group->name, t.flipped_edges);
    if (t.components != 1)
        return fail(err, RESULT_INVALID, "group %s is cuttable but has %u components", group->name,
                    t.components);
    if (!(mesh_volume(&group->mesh) > 0))
        return fail(err, RESULT_INVALID, "group %s is cuttable but inside out", group->name);
    return RESULT_OK;
}

static bool boxes_meet(struct box a, struct box b) {
    return a.min.x <= b.max.x && b.min.x <= a.max.x && a.min.y <= b.max.y && b.min.y <= a.max.y &&
           a.min.z <= b.max.z && b.min.z <= a.max.z;
}

static enum result check_region(const struct case_group *group, const char *name,
                                const struct case_region *region, struct error *err) {
    if (region->part_count == 0)
        return RESULT_OK;
    if (!group->cuttable)
        return fail(err, RESULT_INVALID, "group %s has lesion.%s but is not cuttable", group->name,
                    name);
    struct mesh mesh;
    case_group_virtual(group, &mesh);
    struct box box = mesh_bounds(&mesh);
    mesh_fini(&mesh);
    for (int i = 0; i < region->part_count; i++)
        if (!boxes_meet(region->parts[i].box, box))
            return fail(err, RESULT_INVALID, "group %s: lesion.%s[%d] lies outside the mesh",
                        group->name, name, i);
    return RESULT_OK;
}

static enum result check_lesion(const struct case_group *group, struct error *err) {
    enum result result = check_region(group, "tear", &group->lesion.tear, err);
    if (result == RESULT_OK)
        result = check_region(group, "damage", &group->lesion.damage, err);
    if (result == RESULT_OK)
        result = check_region(group, "plan", &group->lesion.plan, err);
    return result;
}

static enum result check_group(const struct case_group *group, struct error *err) {
    if (group->part_count == 0)
        return fail(err, RESULT_MISSING, "group %s has no mesh", group->name);
    enum result result = check_displacement(group, "warp", group->warp, err);
    if (result == RESULT_OK)
        result = check_displacement(group, "maxcut", group->maxcut, err);
    if (result == RESULT_OK)
        result = check_bridge(group, err);
    if (result == RESULT_OK)
        result = check_covered(group, err);
    if (result == RESULT_OK)
        result = check_wear(group, err);
    if (result == RESULT_OK && group->cuttable)
        result = check_cuttable(group, err);
    if (result == RESULT_OK)
        result = check_lesion(group, err);
    return result;
}

static enum result check_portals(const struct knee_case *knee, struct error *err) {
    for (int i = 0; i < knee->portal_count; i++) {
        const struct case_portal *portal = &knee->portals[i];
        if (!case_name_is_valid(portal->name))
            return fail(err, RESULT_INVALID, "portal %d has no valid name", i + 1);
        for (int k = 0; k < i; k++)
            if (strcmp(portal->name, knee->portals[k].name) == 0)
                return fail(err, RESULT_INVALID, "there are two portals %s", portal->name);
        if (!vec3_is_finite(portal->position))
            return fail(err, RESULT_INVALID, "portal %s: position is not finite", portal->name);
        if (!(fabs(vec3_length(portal->direction) - 1) < 1e-3))
            return fail(err, RESULT_INVALID, "portal %s: direction has not unit length",
                        portal->name);
    }
    return RESULT_OK;
}

static bool is_radius(double radius_mm) { // NaN is none
    return radius_mm >= CASE_LOOSE_RADIUS_LEAST_MM && radius_mm <= CASE_LOOSE_RADIUS_MOST_MM;
}

static enum result check_loose(const struct knee_case *knee, struct error *err) {
    for (int i = 0; i < knee->loose_count; i++) {
        const struct case_loose *loose = &knee->loose[i];
        if (!case_name_is_valid(loose->name))
            return fail(err, RESULT_INVALID, "loose[%d] has no valid name", i);
        if (case_loose_index(knee, loose->name) != i)
            return fail(err, RESULT_INVALID, "there are two loose bodies %s", loose->name);
        if (!vec3_is_finite(loose->at))
            return fail(err, RESULT_INVALID, "loose body %s: the place is not finite", loose->name);
        if (!is_radius(loose->radii_mm.x) || !is_radius(loose->radii_mm.y) ||
            !is_radius(loose->radii_mm.z))
            return fail(err, RESULT_INVALID, "loose body %s: its radii are not from %g to %g mm",
                        loose->name, CASE_LOOSE_RADIUS_LEAST_MM, CASE_LOOSE_RADIUS_MOST_MM);
    }
    return RESULT_OK;
}

static enum result check_landmarks(const struct knee_case *knee, struct error *err) {
    for (int i = 0; i < knee->landmark_count; i++) {
        const struct case_landmark *landmark = &knee->landmarks[i];
        if (!case_name_is_valid(landmark->name))
            return fail(err, RESULT_INVALID, "landmarks[%d] has no valid name", i);
        if (case_landmark(knee, landmark->name) != landmark)
            return fail(err, RESULT_INVALID, "there are two landmarks %s", landmark->name);
        if (!vec3_is_finite(landmark->at))
            return fail(err, RESULT_INVALID, "landmark %s: the place is not finite",
                        landmark->name);
        if (!(isfinite(landmark->error_mm) && landmark->error_mm >= 0))
            return fail(err, RESULT_INVALID, "landmark %s: error_mm is not a number from 0 on",
                        landmark->name);
    }
    return RESULT_OK;
}

static enum result check_patella(const struct knee_case *knee, struct error *err) {
    for (int i = 0; i < knee->patella_key_count; i++) {
        const struct patella_key *key = &knee->patella_keys[i];
        if (!isfinite(key->flexion_deg) || !pose_is_valid(key->T_femur_patella))
            return fail(err, RESULT_INVALID, "patella[%d]: not a flexion and a pose", i);
        if (i > 0 && !(key->flexion_deg > knee->patella_keys[i - 1].flexion_deg))
            return fail(err, RESULT_INVALID, "patella[%d]: flexion_deg does not rise", i);
    }
    return RESULT_OK;
}

static enum result check_torn(const struct knee_case *knee, int ligament, struct error *err) {
    const char *name = knee->torn[ligament];
    bool has_key = false;
    if (!case_name_is_valid(name))
        return fail(err, RESULT_INVALID, "torn[%d] has no valid name", ligament);
    for (int i = 0; i < ligament; i++)
        if (strcmp(name, knee->torn[i]) == 0)
            return fail(err, RESULT_INVALID, "there are two torn ligaments %s", name);
    for (int i = 0; i < knee->key_count; i++)
        has_key |= knee->keys[i].ligament == ligament;
    if (!has_key)
        return fail(err, RESULT_INVALID, "the torn ligament %s has no key", name);
    return RESULT_OK;
}

static enum result check_keys(const struct knee_case *knee, struct error *err) {
    if (knee->torn_count > CASE_LIGAMENTS_MAX || knee->key_count > CASE_KEYS_MAX ||
        knee->rest_count > CASE_KEYS_MAX)
        return fail(err, RESULT_LIMIT, "more than %d torn ligaments, or %d keys, or poses at rest",
                    CASE_LIGAMENTS_MAX, CASE_KEYS_MAX);
    for (int i = 0; i < knee->rest_count; i++)
        if (!pose_is_valid(knee->rest[i]))
            return fail(err, RESULT_INVALID, "rest[%d]: not a pose", i);
    for (int i = 0; i < knee->key_count; i++) {
        const struct case_key *key = &knee->keys[i];
        if (key->ligament < 0 || key->ligament >= knee->torn_count)
            return fail(err, RESULT_INVALID, "key %d: there is no torn ligament %d", i,
                        key->ligament);
        if (!pose_is_valid(key->physical) || !pose_is_valid(key->target))
            return fail(err, RESULT_INVALID, "key %d (%s): not two poses", i,
                        knee->torn[key->ligament]);
    }
    enum result result = RESULT_OK;
    for (int i = 0; i < knee->torn_count && result == RESULT_OK; i++)
        result = check_torn(knee, i, err);
    return result;
}

enum result case_validate(const struct knee_case *knee, struct error *err) {
    // case_group gives a pointer for changing, which this does not do.
    struct knee_case *reading = (struct knee_case *)knee;
    if (!case_group(reading, "tibia"))
        return fail(err, RESULT_MISSING, "there is no group tibia");
    if (!case_group(reading, "femur"))
        return fail(err, RESULT_MISSING, "there is no group femur");
    if (!pose_is_valid(knee->joint.T_femur_joint))
        return fail(err, RESULT_INVALID, "joint.T_femur_joint is not a pose");
    if (!pose_is_valid(knee->joint.T_tibia_joint))
        return fail(err, RESULT_INVALID, "joint.T_tibia_joint is not a pose");
    enum result result = check_portals(knee, err);
    if (result == RESULT_OK)
        result = check_landmarks(knee, err);
    if (result == RESULT_OK)
        result = check_loose(knee, err);
    if (result == RESULT_OK)
        result = check_patella(knee, err);
    if (result == RESULT_OK)
        result = check_keys(knee, err);
    for (int i = 0; result == RESULT_OK && i < knee->group_count; i++)
        result = check_group(&knee->groups[i], err);
    return result;
}
