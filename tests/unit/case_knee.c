#include "case_knee.h"

#include "base/check.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

void box_mesh(vec3 centre, vec3 half, struct mesh *out_mesh) {
    static const uint32_t triangles[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    mesh_init(out_mesh, 8, 12);
    memcpy(out_mesh->triangles, triangles, sizeof triangles);
    for (uint32_t v = 0; v < 8; v++)
        mesh_set_vertex(out_mesh, v,
                        (vec3){centre.x + (v & 1 ? half.x : -half.x),
                               centre.y + (v & 2 ? half.y : -half.y),
                               centre.z + (v & 4 ? half.z : -half.z)});
}

static struct case_group *add_box(struct knee_case *knee, const char *group_name, enum body body,
                                  const char *part, vec3 centre, vec3 half) {
    struct case_group *group = case_group(knee, group_name);
    if (!group)
        group = case_add_group(knee, group_name, body);
    struct mesh mesh;
    box_mesh(centre, half, &mesh);
    struct error err;
    CHECK(case_add_part(group, part, &mesh, &err) == RESULT_OK);
    mesh_fini(&mesh);
    return group;
}

static void add_region(struct case_region *region, vec3 centre, vec3 half) {
    const struct plane planes[] = {
        {{1, 0, 0}, half.x + centre.x}, {{-1, 0, 0}, half.x - centre.x},
        {{0, 1, 0}, half.y + centre.y}, {{0, -1, 0}, half.y - centre.y},
        {{0, 0, 1}, half.z + centre.z}, {{0, 0, -1}, half.z - centre.z},
    };
    struct error err;
    CHECK(case_region_add(region, planes, 6, &err) == RESULT_OK);
}

static pose bent(double flexion_deg, double valgus_deg, double drawer_mm) {
    quat q = quat_from_axis_angle((vec3){1, 0, 0}, -flexion_deg * RAD_PER_DEG);
    quat opened = quat_from_axis_angle((vec3){0, 1, 0}, -valgus_deg * RAD_PER_DEG);
    return (pose){quat_multiply(q, opened), {0, drawer_mm, 0}};
}

static void add_ligaments(struct knee_case *knee) {
    struct case_group *lcl =
        add_box(knee, "lcl", BODY_TIBIA, "lcl", (vec3){42, 0, -10}, (vec3){1, 5, 25});
    case_group_bridge(lcl, BODY_FEMUR);
    for (uint32_t v = 4; v < 8; v++)
        lcl->other_share[v] = 0.875f;
    knee->rest[knee->rest_count++] = bent(0, 0, 0);
    knee->rest[knee->rest_count++] = bent(90, 0.25, -3);
    strcpy(knee->torn[knee->torn_count++], "mcl");
    strcpy(knee->torn[knee->torn_count++], "acl");
    knee->keys[0] = (struct case_key){0, bent(15, 5, 0), bent(15, 12, 0)};
    knee->keys[1] = (struct case_key){0, bent(60, 5, 0), bent(60, 11, 0)};
    knee->keys[2] = (struct case_key){1, bent(30, 0, 6), bent(30, 0, 11)};
    knee->key_count = 3;
}

struct knee_case *box_knee(void) {
    struct knee_case *knee = case_create("boxes", "A knee of boxes – ½");
    add_box(knee, "tibia", BODY_TIBIA, "bone", (vec3){0, 0, -52}, (vec3){38, 25, 30});
    case_group_need_warp(case_group(knee, "tibia"))[3 * 5 + 2] = -3.25f;
    add_box(knee, "tibia", BODY_TIBIA, "cartilage", (vec3){-18, 0, -21}, (vec3){14, 20, 1});
    add_box(knee, "femur", BODY_FEMUR, "femur", (vec3){0, 0, 25}, (vec3){40, 30, 38});
    add_box(knee, "patella", BODY_PATELLA, "patella", (vec3){0, 45, 10}, (vec3){20, 10, 20});
    struct case_group *meniscus = add_box(knee, "meniscus_medial", BODY_TIBIA, "meniscus_medial",
                                          (vec3){-25, 0, -16}, (vec3){6, 15, 3});
    meniscus->cuttable = true;
    case_group_need_maxcut(meniscus)[0] = 0.125f;
    add_region(&meniscus->lesion.tear, (vec3){-20, 2, -16}, (vec3){3, 0.0625, 4});
    add_region(&meniscus->lesion.plan, (vec3){-20, 2, -16}, (vec3){3, 2, 4});
    add_region(&meniscus->lesion.plan, (vec3){-19, 2, -16}, (vec3){2, 4, 4});
    knee->portals[knee->portal_count++] =
        (struct case_portal){"anteromedial", {-20, 50, -10}, {0.48, -0.8, -0.36}};
    add_ligaments(knee);
    quat tilted = quat_from_axis_angle((vec3){1, 0, 0}, -1.1);
    knee->patella_keys[0] = (struct patella_key){0, pose_identity()};
    knee->patella_keys[1] = (struct patella_key){90, {tilted, {1, -12, -30}}};
    knee->patella_key_count = 2;
    knee->joint.T_femur_joint = (pose){quat_from_axis_angle((vec3){0, 0, 1}, 0.02), {0, -5, 10}};
    knee->joint.T_tibia_joint = knee->joint.T_femur_joint;
    return knee;
}

void write_file(const char *dir, const char *name, const void *bytes, size_t size) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    FILE *file = fopen(path, "wb");
    CHECK(file && fwrite(bytes, 1, size, file) == size && fclose(file) == 0);
}

char *read_file(const char *dir, const char *name, size_t *out_size) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    struct stat status;
    FILE *file = fopen(path, "rb");
    CHECK(file && fstat(fileno(file), &status) == 0);
    char *bytes = alloc((size_t)status.st_size + 1, 1);
    CHECK(fread(bytes, 1, (size_t)status.st_size, file) == (size_t)status.st_size);
    fclose(file);
    if (out_size)
        *out_size = (size_t)status.st_size;
    return bytes;
}
