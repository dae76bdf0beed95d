#include "generate/bridge.h"

#include "mesh/solid.h"
#include "mesh/topology.h"

#define TOUCHING 1e-6 // mm, as in warp/warp.h

struct bone_solid {
    struct solid solid;
    bool has_inside;
    uint32_t hint;
};

static enum result bone_init(struct bone_solid *bone, struct knee_case *knee, enum body body,
                             struct error *err) {
    const struct case_group *group = case_group(knee, body_name(body));
    *bone = (struct bone_solid){.hint = MESH_NONE};
    if (!group || !group->part_count)
        return fail(err, RESULT_MISSING, "there is no %s to bridge to", body_name(body));
    struct topology t = topology_of(&group->mesh);
    bone->has_inside = t.closed && t.oriented;
    return solid_init(&bone->solid, &group->mesh, err);
}

static double bone_distance(struct bone_solid *bone, vec3 p) {
    double distance = solid_distance(&bone->solid, p, &bone->hint);
    distance = bone->has_inside ? distance : fabs(distance);
    return distance > TOUCHING ? distance : 0;
}

static void find_shares(struct case_group *group, struct bone_solid *own,
                        struct bone_solid *other) {
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
        vec3 p = mesh_vertex(&group->mesh, v);
        double near = bone_distance(own, p), far = bone_distance(other, p);
        group->other_share[v] = near + far > 0 ? (float)(near / (near + far)) : 0.5f;
    }
}

enum result bridge_make(struct knee_case *knee, struct case_group *group, enum body other,
                        struct error *err) {
    if (group->body == other)
        return fail(err, RESULT_INVALID, "group %s: cannot bridge from the %s to itself",
                    group->name, body_name(other));
    struct bone_solid bones[2] = {0};
    enum result result = bone_init(&bones[0], knee, group->body, err);
    if (result == RESULT_OK)
        result = bone_init(&bones[1], knee, other, err);
    if (result == RESULT_OK) {
        case_group_bridge(group, other);
        find_shares(group, &bones[0], &bones[1]);
    }
    solid_fini(&bones[0].solid);
    solid_fini(&bones[1].solid);
    return result == RESULT_OK ? result : fail_in(err, result, "group %s: ", group->name);
}
