#include "motion/take.h"

#include "motion/way.h"

#include <string.h>

// Where the middle of a loose body lies: its half height over the surface under it.
static enum result middle_of(const struct plan *plan, const struct case_loose *loose,
                             vec3 *out_middle) {
    const struct case_group *bone = case_group(plan->knee, body_name(loose->body));
    struct mesh mesh;
    struct solid solid;
    struct closest closest = {.triangle = 0};
    if (!bone)
        return fail(plan->err, RESULT_MISSING, "the case has no group %s", body_name(loose->body));
    case_group_virtual(bone, &mesh);
    enum result result = solid_init(&solid, &mesh, plan->err);
    if (result == RESULT_OK) {
        query_closest(solid.query, loose->at, INFINITY, MESH_NONE, &closest);
        *out_middle =
            vec3_add_scaled(closest.point, loose->radii_mm.z, solid.face_normals[closest.triangle]);
    }
    solid_fini(&solid);
    mesh_fini(&mesh);
    return result;
}

enum result take(struct plan *plan, struct hand *hand, const struct motion_step *step) {
    int index = case_loose_index(plan->knee, step->name);
    vec3 at = step->from.at;
    if (index < 0)
        return fail(plan->err, RESULT_MISSING, "the case has no loose body %s", step->name);
    const struct case_loose *loose = &plan->knee->loose[index];
    enum result result = step->is_free ? RESULT_OK : middle_of(plan, loose, &at);
    if (result != RESULT_OK)
        return result;
    vec3 target = pose_apply(plan_body_pose(plan, loose->body), at);
    if (!plan_is_clear(plan, hand, target))
        return fail_in(plan->err, plan_refuse(plan, hand, target),
                       "%s cannot be reached: ", loose->name);
    if (plan_reach(plan, hand, plan_before_grasp(hand, target)) != RESULT_OK ||
        plan_grasp(plan, hand, target) != RESULT_OK || plan_withdraw(plan, hand) != RESULT_OK ||
        plan_open(plan, hand, 1) != RESULT_OK)
        return RESULT_INVALID;
    return plan_open(plan, hand, 0);
}
