#include "generate/wear.h"

#include "base/check.h"

static double share_at(double distance, double radius) {
    double t = fmin(fmax(2 - 2 * distance / radius, 0), 1);
    return t * t * (3 - 2 * t);
}

// Whether any of it that can be seen lies in the patch.
static bool is_met(const struct case_group *group, vec3 middle, const struct wear_patch *patch) {
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++)
        if (vec3_distance(mesh_vertex(&group->mesh, v), middle) < patch->radius_mm &&
            !(group->covered && group->covered[v]))
            return true;
    return false;
}

static void wear_group(struct case_group *group, vec3 middle, const struct wear_patch *patch) {
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
        double distance = vec3_distance(mesh_vertex(&group->mesh, v), middle);
        if (distance >= patch->radius_mm)
            continue;
        float *wear = &case_group_need_wear(group)[v];
        *wear = fmaxf(*wear, (float)(patch->grade * share_at(distance, patch->radius_mm)));
    }
}

enum result wear_add(struct case_group *const *groups, int group_count,
                     const struct wear_patch *patch, struct error *err) {
    CHECK(group_count > 0 && groups[0]->part_count > 0);
    CHECK(patch->grade > 0 && patch->grade <= CASE_WEAR_MOST && patch->radius_mm > 0);
    const struct mesh *bone = &groups[0]->mesh;
    vec3 middle = mesh_vertex(bone, mesh_nearest_vertex(bone, patch->at));
    double distance = vec3_distance(middle, patch->at);
    if (distance > patch->radius_mm / 2)
        return fail(err, RESULT_INVALID,
                    "wear at %g,%g,%g: the nearest vertex of %s is %.1f mm away, more than half of "
                    "the radius",
                    patch->at.x, patch->at.y, patch->at.z, groups[0]->name, distance);
    bool met = false;
    for (int i = 0; i < group_count; i++)
        met |= case_group_wears(groups[i]) && is_met(groups[i], middle, patch);
    if (!met)
        return fail(err, RESULT_MISSING,
                    "wear at %g,%g,%g: neither bone nor cartilage that stays uncut is there",
                    patch->at.x, patch->at.y, patch->at.z);
    for (int i = 0; i < group_count; i++)
        if (case_group_wears(groups[i]))
            wear_group(groups[i], middle, patch);
    return RESULT_OK;
}
