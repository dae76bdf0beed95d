#include "import/import.h"

#include "base/check.h"
#include "import/reader.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#define BONE_MIDDLE_MIN_MM 40
#define BONE_MIDDLE_MAX_MM 130

static double middle_side(const struct mesh *mesh) {
    struct box box = mesh_bounds(mesh);
    vec3 side = vec3_sub(box.max, box.min);
    return side.x + side.y + side.z - fmax(side.x, fmax(side.y, side.z)) -
           fmin(side.x, fmin(side.y, side.z));
}

static const char *unit_that_fits(double middle_in_units) {
    static const struct {
        const char *name;
        double mm;
    } units[] = {{"mm", 1}, {"cm", 10}, {"m", 1000}};
    for (int i = 0; i < 3; i++)
        if (middle_in_units * units[i].mm >= BONE_MIDDLE_MIN_MM &&
            middle_in_units * units[i].mm <= BONE_MIDDLE_MAX_MM)
            return units[i].name;
    return NULL;
}

static enum result check_file(const char *path, size_t max_bytes, struct error *err) {
    struct stat status;
    if (stat(path, &status) != 0)
        return fail(err, RESULT_MISSING, "%s: there is no such file", path);
    if (!S_ISREG(status.st_mode))
        return fail(err, RESULT_INVALID, "%s: not a regular file", path);
    if ((uint64_t)status.st_size > max_bytes)
        return fail(err, RESULT_LIMIT, "%s: %lld bytes, more than %zu", path,
                    (long long)status.st_size, max_bytes);
    return RESULT_OK;
}

static bool is_soup(const char *path, const struct mesh *mesh) {
    const char *dot = strrchr(path, '.');
    return (dot && strcasecmp(dot, ".stl") == 0) ||
           (mesh->triangle_count > 1 && mesh->vertex_count >= 3 * (uint64_t)mesh->triangle_count);
}

static enum result refuse(const struct import_source *source, struct mesh *mesh, enum result result,
                          struct error *err) {
    const char *unit =
        mesh->vertex_count ? unit_that_fits(middle_side(mesh) / source->mm_per_unit) : NULL;
    mesh_fini(mesh);
    return fail_in(err, result, "%s: %s%s%s", source->path,
                   unit ? "the unit that would fit is " : "", unit ? unit : "", unit ? ": " : "");
}

enum result import_mesh(const struct import_source *source, const struct case_limits *limits,
                        struct mesh *out_mesh, struct repair_report *out_report,
                        struct error *err) {
    *out_mesh = (struct mesh){0};
    *out_report = (struct repair_report){0};
    enum result result = check_file(source->path, limits->file_bytes, err);
    struct import_arrays arrays;
    if (result == RESULT_OK)
        result = import_reader_read(source->path, limits->group_triangles, &arrays, err);
    if (result != RESULT_OK)
        return result;
    *out_mesh = (struct mesh){.vertex_count = arrays.vertex_count,
                              .triangle_count = arrays.triangle_count,
                              .positions = arrays.positions,
                              .triangles = arrays.triangles};
    for (uint32_t v = 0; v < out_mesh->vertex_count; v++) {
        vec3 mm = vec3_scale(source->mm_per_unit, mesh_vertex(out_mesh, v));
        mesh_set_vertex(out_mesh, v, pose_apply(source->T_case_file, mm));
    }
    result = mesh_validate(out_mesh, err);
    if (result != RESULT_OK)
        return refuse(source, out_mesh, result, err);
    struct repair_settings settings = {
        .weld_mm = is_soup(source->path, out_mesh) ? IMPORT_SOUP_WELD_MM : 0,
        .island_share = IMPORT_ISLAND_SHARE,
    };
    bool left = repair_mesh(out_mesh, &settings, out_report);
    out_report->triangles_before += arrays.dropped;
    out_report->repeated_corners += arrays.dropped;
    if (!left)
        return refuse(source, out_mesh, fail(err, RESULT_INVALID, "no triangle is left"), err);
    return RESULT_OK;
}

bool import_axes(const char *letters, pose *out_T_case_common) {
    static const char directions[] = "RLAPSI"; // two for each axis of the case, forward first
    if (strlen(letters) != 3)
        return false;
    mat3 r = {0};
    for (int column = 0; column < 3; column++) {
        const char *found = strchr(directions, letters[column]);
        if (!found)
            return false;
        int which = (int)(found - directions);
        r.m[which / 2][column] = which % 2 == 0 ? 1 : -1;
    }
    if (mat3_determinant(r) != 1)
        return false;
    *out_T_case_common = (pose){quat_from_mat3(r), {0, 0, 0}};
    return true;
}

static const char *const ligaments[] = {"acl", "pcl", "mcl", "lcl", NULL};

static bool is_one_of(const char *name, const char *const *names) {
    while (*names && strcmp(*names, name) != 0)
        names++;
    return *names;
}

enum body import_default_body(const char *group) {
    if (strncmp(group, "patella", 7) == 0)
        return BODY_PATELLA;
    if (strncmp(group, "tibia", 5) == 0 || strncmp(group, "meniscus", 8) == 0)
        return BODY_TIBIA;
    return is_one_of(group, ligaments) ? BODY_TIBIA : BODY_FEMUR;
}

enum body import_default_bridge(const char *group, enum body body) {
    static const char *const to_tibia[] = {"patellar_ligament", "patellar_tendon", "skin", NULL};
    if (is_one_of(group, ligaments))
        return body == BODY_FEMUR ? BODY_TIBIA : BODY_FEMUR;
    return is_one_of(group, to_tibia) && body != BODY_TIBIA ? BODY_TIBIA : BODY_COUNT;
}

// ---- size ---------------------------------------------------------------------------------------

enum result import_check_bone(const struct case_group *bone, double mm_per_unit,
                              struct error *err) {
    double middle = middle_side(&bone->mesh);
    if (middle >= BONE_MIDDLE_MIN_MM && middle <= BONE_MIDDLE_MAX_MM)
        return RESULT_OK;
    const char *unit = unit_that_fits(middle / mm_per_unit);
    return fail(err, RESULT_INVALID, "%s: %.3g mm wide, where a knee has %d to %d mm; %s%s",
                bone->name, middle, BONE_MIDDLE_MIN_MM, BONE_MIDDLE_MAX_MM,
                unit ? "the unit that would fit is " : "neither mm, cm nor m would fit",
                unit ? unit : "");
}

// ---- joint --------------------------------------------------------------------------------------

pose import_estimate_joint(struct knee_case *knee) {
    const struct case_group *femur = case_group(knee, "femur");
    CHECK(femur);
    double distal = mesh_bounds(&femur->mesh).min.z;
    vec3 low = {INFINITY, INFINITY, distal}, high = {-INFINITY, -INFINITY, distal};
    for (uint32_t v = 0; v < femur->mesh.vertex_count; v++) {
        vec3 p = mesh_vertex(&femur->mesh, v);
        if (p.z > distal + 35)
            continue;
        low = (vec3){fmin(low.x, p.x), fmin(low.y, p.y), distal};
        high = (vec3){fmax(high.x, p.x), fmax(high.y, p.y), distal};
    }
    double radius = 0.27 * (high.x - low.x);
    return (pose){quat_identity(), {(low.x + high.x) / 2, low.y + radius, distal + radius}};
}
