#include "rehearsal/remains.h"

#include "base/check.h"
#include "mesh/solid.h"

#include <math.h>
#include <stdlib.h>

static const double spacing = 0.5;  // mm
static const double margin = 4;     // of the samples about the plan, mm
static const double jaw_root = 1.0; // from the hinge, that takes nothing (cut/blade.h), mm

static struct box plan_box(const struct case_group *group) {
    struct box box = group->lesion.plan.parts[0].box;
    for (int i = 1; i < group->lesion.plan.part_count; i++) {
        const struct box *part = &group->lesion.plan.parts[i].box;
        box.min = (vec3){fmin(box.min.x, part->min.x), fmin(box.min.y, part->min.y),
                         fmin(box.min.z, part->min.z)};
        box.max = (vec3){fmax(box.max.x, part->max.x), fmax(box.max.y, part->max.y),
                         fmax(box.max.z, part->max.z)};
    }
    return box;
}

static bool is_planned(const struct case_group *group, vec3 p) {
    for (int i = 0; i < group->lesion.plan.part_count; i++)
        if (convex_contains(&group->lesion.plan.parts[i], p))
            return true;
    return false;
}

static void add_point(struct remains *r, const struct case_group *group, const struct solid *solid,
                      vec3 p, uint32_t *hint) {
    if (solid_distance(solid, p, hint) >= 0)
        return;
    r->points[r->count] = p;
    r->is_planned[r->count] = is_planned(group, p);
    r->is_there[r->count++] = true;
}

static void fill(struct remains *r, const struct case_group *group, const struct solid *solid) {
    struct box box = plan_box(group);
    vec3 low = vec3_sub(box.min, (vec3){margin, margin, margin});
    vec3 size = vec3_sub(vec3_add(box.max, (vec3){margin, margin, margin}), low);
    int wide = (int)(size.x / spacing), deep = (int)(size.y / spacing),
        high = (int)(size.z / spacing);
    size_t most = (size_t)wide * (size_t)deep * (size_t)high;
    uint32_t hint = MESH_NONE;
    r->points = alloc(most, sizeof *r->points);
    r->is_planned = alloc(most, sizeof *r->is_planned);
    r->is_there = alloc(most, sizeof *r->is_there);
    for (int i = 0; i < wide; i++)
        for (int k = 0; k < deep; k++)
            for (int l = 0; l < high; l++)
                add_point(r, group, solid,
                          vec3_add(low, (vec3){spacing * i, spacing * k, spacing * l}), &hint);
}

enum result remains_init(struct remains *r, const struct case_group *group, const struct mesh *now,
                         struct error *err) {
    *r = (struct remains){0};
    if (group->lesion.plan.part_count == 0)
        return fail(err, RESULT_MISSING, "%s has no planned resection", group->name);
    struct solid solid = {0};
    enum result result = solid_init(&solid, now, err);
    if (result == RESULT_OK)
        fill(r, group, &solid);
    solid_fini(&solid);
    return result;
}

void remains_fini(struct remains *r) {
    free(r->points);
    free(r->is_planned);
    free(r->is_there);
    *r = (struct remains){0};
}

enum result remains_take(struct remains *r, const struct mesh *now, struct error *err) {
    struct solid solid = {0};
    enum result result = solid_init(&solid, now, err);
    uint32_t hint = MESH_NONE;
    for (int i = 0; i < r->count && result == RESULT_OK; i++)
        if (r->is_there[i])
            r->is_there[i] = solid_distance(&solid, r->points[i], &hint) < 0;
    solid_fini(&solid);
    return result;
}

// Between the jaws, from the hinge's side.
static bool is_bitten(const struct instrument *jaw, double tangent, vec3 in_tip) {
    double along = in_tip.z + jaw->length_mm, up = in_tip.y;
    if (fabs(in_tip.x) > jaw->width_mm / 2 || up < 0 || up > along * tangent)
        return false;
    double reach = along * along + up * up;
    return reach > jaw_root * jaw_root && reach < jaw->length_mm * jaw->length_mm;
}

struct bite_gain remains_bite(const struct remains *r, const struct instrument *jaw,
                              pose T_mesh_tip) {
    double tangent = tan(RAD_PER_DEG * jaw->opening_deg);
    double far = jaw->length_mm + jaw->width_mm;
    int planned = 0, beyond = 0;
    mat3 axes = quat_to_mat3(T_mesh_tip.rotation);
    for (int i = 0; i < r->count; i++) {
        vec3 way = vec3_sub(r->points[i], T_mesh_tip.translation);
        if (!r->is_there[i] || vec3_dot(way, way) > far * far ||
            !is_bitten(jaw, tangent, mat3_apply_transposed(axes, way)))
            continue;
        *(r->is_planned[i] ? &planned : &beyond) += 1;
    }
    double each = spacing * spacing * spacing;
    return (struct bite_gain){planned * each, beyond * each};
}
