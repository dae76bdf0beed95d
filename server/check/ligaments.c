#include "check/ligaments.h"

#include "base/check.h"

#include <string.h>

#define INSIDE_COSINE (-0.5)
#define LEVER_MM 57
#define COORDINATES 6

static double *coordinate(struct joint_angles *joint, int i) {
    double *const all[COORDINATES] = {&joint->flexion_deg,  &joint->varus_deg,
                                      &joint->internal_deg, &joint->shift_mm,
                                      &joint->drawer_mm,    &joint->distraction_mm};
    return all[i];
}

// ---- the joint over flexion ---------------------------------------------------------------------

static struct joint_angles between(const struct joint_angles *keys, int count, double flexion) {
    int next = 0;
    while (next < count && keys[next].flexion_deg < flexion)
        next++;
    struct joint_angles low = keys[next > 0 ? next - 1 : 0];
    struct joint_angles high = keys[next < count ? next : count - 1], out = low;
    double span = high.flexion_deg - low.flexion_deg;
    double t = span > 0 ? (flexion - low.flexion_deg) / span : 0;
    for (int i = 0; i < COORDINATES; i++)
        *coordinate(&out, i) += t * (*coordinate(&high, i) - *coordinate(&low, i));
    out.flexion_deg = flexion;
    return out;
}

static void sort(struct joint_angles *keys, int count) {
    for (int i = 1; i < count; i++)
        for (int k = i; k > 0 && keys[k].flexion_deg < keys[k - 1].flexion_deg; k--) {
            struct joint_angles key = keys[k];
            keys[k] = keys[k - 1];
            keys[k - 1] = key;
        }
}

struct joint_angles ligaments_held(const struct knee_case *knee, int ligament, double flexion_deg) {
    struct joint_angles keys[CASE_KEYS_MAX];
    int count = 0;
    for (int i = 0; i < knee->key_count; i++)
        if (knee->keys[i].ligament == ligament)
            keys[count++] = joint_from_pose(&knee->joint, knee->keys[i].physical);
    CHECK(count > 0);
    sort(keys, count);
    return between(keys, count, flexion_deg);
}

// ---- at rest ------------------------------------------------------------------------------------

static double moved_by(const struct scene *scene, enum adaptive_kind kind,
                       const struct joint_angles *joint) {
    struct scene_stance stance;
    scene_stand(scene, kind, joint, &stance);
    pose T = pose_compose(stance.T_femur_body[BODY_TIBIA], scene_case(scene)->joint.T_tibia_joint);
    double largest = 0;
    for (int i = 0; i < 6; i++) {
        double way = i & 1 ? -LEVER_MM : LEVER_MM;
        vec3 at = {i / 2 == 0 ? way : 0, i / 2 == 1 ? way : 0, i / 2 == 2 ? way : 0};
        vec3 p = pose_apply(T, at);
        largest = fmax(largest, vec3_distance(pose_apply(stance.correction[BODY_TIBIA], p), p));
    }
    return largest;
}

// With a rest path, only its keys lie on it exactly.
double ligaments_rest_mm(const struct scene *scene, enum adaptive_kind kind) {
    const struct knee_case *knee = scene_case(scene);
    double largest = 0;
    for (int i = 0; i <= 240 && !knee->rest_count; i++) {
        struct joint_angles joint = {.flexion_deg = 0.5 * i};
        largest = fmax(largest, moved_by(scene, kind, &joint));
    }
    for (int i = 0; i < knee->rest_count; i++) {
        struct joint_angles joint = joint_from_pose(&knee->joint, knee->rest[i]);
        largest = fmax(largest, moved_by(scene, kind, &joint));
    }
    return largest;
}

// ---- from rest to a key -------------------------------------------------------------------------

#define GAIN_STEPS 64
#define LEVERS 6

static void levers_at(const struct scene *scene, enum adaptive_kind kind,
                      const struct joint_angles *joint, vec3 out_held[LEVERS],
                      vec3 out_further[LEVERS]) {
    struct scene_stance stance;
    scene_stand(scene, kind, joint, &stance);
    pose T = pose_compose(stance.T_femur_body[BODY_TIBIA], scene_case(scene)->joint.T_tibia_joint);
    for (int i = 0; i < LEVERS; i++) {
        double way = i & 1 ? -LEVER_MM : LEVER_MM;
        vec3 at = {i / 2 == 0 ? way : 0, i / 2 == 1 ? way : 0, i / 2 == 2 ? way : 0};
        out_held[i] = pose_apply(T, at);
        out_further[i] =
            vec3_sub(pose_apply(stance.correction[BODY_TIBIA], out_held[i]), out_held[i]);
    }
}

static double longest(const vec3 from[LEVERS], const vec3 to[LEVERS]) {
    double most = 0;
    for (int i = 0; i < LEVERS; i++)
        most = fmax(most, vec3_distance(from[i], to[i]));
    return most;
}

double ligaments_gain(const struct scene *scene, enum adaptive_kind kind, int key) {
    const struct knee_case *knee = scene_case(scene);
    struct joint_angles ends[2], joint;
    ends[1] = joint_from_pose(&knee->joint, knee->keys[key].physical);
    ends[0] = case_rest(knee, ends[1].flexion_deg);
    vec3 held[2][LEVERS], further[2][LEVERS];
    double largest = 0;
    for (int n = 0; n <= GAIN_STEPS; n++) {
        for (int i = 0; i < COORDINATES; i++) {
            double from = *coordinate(&ends[0], i), to = *coordinate(&ends[1], i);
            *coordinate(&joint, i) = from + (to - from) * n / GAIN_STEPS;
        }
        levers_at(scene, kind, &joint, held[n % 2], further[n % 2]);
        double way = n ? longest(held[0], held[1]) : 0;
        if (way > 0)
            largest = fmax(largest, longest(further[0], further[1]) / way);
    }
    return largest;
}

// ---- in the key poses ---------------------------------------------------------------------------

static int group_index(const struct knee_case *knee, const char *name) {
    for (int i = 0; i < knee->group_count; i++)
        if (!strcmp(knee->groups[i].name, name))
            return i;
    CHECK(!"a case has tibia and femur");
    return -1;
}

// Depth of p behind the surface; 0 where it is not. At an edge or a corner the triangle's own
// normal tells too, but for sharp ones.
static double depth_of(const struct query *query, const struct mesh *mesh, vec3 p) {
    struct closest closest;
    if (!query_closest(query, p, 30, MESH_NONE, &closest))
        return 0;
    vec3 a = mesh_corner(mesh, closest.triangle, 0), zero = {0};
    vec3 m = vec3_cross(vec3_sub(mesh_corner(mesh, closest.triangle, 1), a),
                        vec3_sub(mesh_corner(mesh, closest.triangle, 2), a));
    double height = vec3_dot(vec3_unit_or(m, zero), vec3_sub(p, closest.point));
    return height < INSIDE_COSINE * closest.distance ? closest.distance : 0;
}

static double deepest(const struct mesh *tibia, pose T, const struct query *femur_query,
                      const struct mesh *femur, vec3 *out_place) {
    double largest = 0;
    for (uint32_t v = 0; v < tibia->vertex_count; v++) {
        vec3 p = pose_apply(T, mesh_vertex(tibia, v));
        double depth = depth_of(femur_query, femur, p);
        if (depth > largest) {
            largest = depth;
            *out_place = p;
        }
    }
    return largest;
}

static double overlap(const struct mesh *tibia, pose T, const struct mesh *femur, vec3 *out_place) {
    struct query *query;
    struct error err;
    if (query_create(femur, &query, &err) != RESULT_OK)
        return INFINITY;
    double depth = deepest(tibia, T, query, femur, out_place);
    query_destroy(&query);
    return depth;
}

struct key_figures ligaments_key(const struct scene *scene, enum adaptive_kind kind, int key) {
    const struct knee_case *knee = scene_case(scene);
    const struct case_group *tibia = &knee->groups[group_index(knee, "tibia")];
    const struct case_group *femur = &knee->groups[group_index(knee, "femur")];
    struct joint_angles joint = joint_from_pose(&knee->joint, knee->keys[key].physical);
    struct scene_stance stance;
    scene_stand(scene, kind, &joint, &stance);
    pose T = stance.T_femur_body[BODY_TIBIA];
    struct mesh virtual_tibia, virtual_femur;
    case_group_virtual(tibia, &virtual_tibia);
    case_group_virtual(femur, &virtual_femur);
    struct key_figures figures = {0};
    vec3 place;
    figures.physical_mm = overlap(&tibia->mesh, T, &femur->mesh, &place);
    figures.virtual_mm = overlap(&virtual_tibia, pose_compose(stance.correction[BODY_TIBIA], T),
                                 &virtual_femur, &figures.place);
    mesh_fini(&virtual_tibia);
    mesh_fini(&virtual_femur);
    return figures;
}

// ---- the opening --------------------------------------------------------------------------------

// Names, with the sign that makes an opening of that name positive.
static const struct {
    const char *name[2]; // positive, negative
    const char *unit;
} coordinates[COORDINATES] = {
    {{"flexion", "extension"}, "degrees"},
    {{"varus", "valgus"}, "degrees"},
    {{"internal rotation", "external rotation"}, "degrees"},
    {{"lateral shift", "medial shift"}, "mm"},
    {{"drawer", "posterior drawer"}, "mm"},
    {{"distraction", "compression"}, "mm"},
};

static int most_changed(const struct knee_case *knee, int ligament, int *out_sign) {
    double most = 0;
    int found = 1;
    *out_sign = 1;
    for (int k = 0; k < knee->key_count; k++) {
        if (knee->keys[k].ligament != ligament)
            continue;
        struct joint_angles from = joint_from_pose(&knee->joint, knee->keys[k].physical);
        struct joint_angles to = joint_from_pose(&knee->joint, knee->keys[k].target);
        for (int i = 0; i < COORDINATES; i++) {
            double change = *coordinate(&to, i) - *coordinate(&from, i);
            if (fabs(change) > most) {
                most = fabs(change);
                found = i;
                *out_sign = change < 0 ? -1 : 1;
            }
        }
    }
    return found;
}

void ligaments_opening(const struct scene *scene, enum adaptive_kind kind, int ligament,
                       struct opening *out) {
    const struct knee_case *knee = scene_case(scene);
    int sign, which = most_changed(knee, ligament, &sign);
    memset(out, 0, sizeof *out);
    out->coordinate = coordinates[which].name[sign < 0];
    out->unit = coordinates[which].unit;
    for (int i = 0; i < OPENING_STEPS; i++) {
        double flexion = 120.0 * i / (OPENING_STEPS - 1);
        struct joint_angles joint = ligaments_held(knee, ligament, flexion);
        struct scene_stance stance;
        scene_stand(scene, kind, &joint, &stance);
        pose shown = pose_compose(stance.correction[BODY_TIBIA], stance.T_femur_body[BODY_TIBIA]);
        struct joint_angles virtual = joint_from_pose(&knee->joint, shown);
        out->flexion[i] = flexion;
        out->physical[i] = sign * *coordinate(&joint, which);
        out->shown[i] = sign * *coordinate(&virtual, which);
    }
    for (int k = 0; k < knee->key_count; k++) {
        if (knee->keys[k].ligament != ligament)
            continue;
        struct joint_angles from = joint_from_pose(&knee->joint, knee->keys[k].physical);
        struct joint_angles to = joint_from_pose(&knee->joint, knee->keys[k].target);
        out->key_flexion[out->key_count] = from.flexion_deg;
        out->key_target[out->key_count++] = sign * *coordinate(&to, which);
    }
}
