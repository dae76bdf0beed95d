#include "import/import.h"

#include "base/check.h"
#include "import/judge.h"
#include "import/reader.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

// The middle one of the sides of the box of a bone's part at the knee.
#define KNEE_BONE_MIN_MM 40
#define KNEE_BONE_MAX_MM 130
#define FAR_UNITS 1e30 // what a float can hold

static double middle_side_of_mesh(const struct mesh *mesh) {
    struct box box = mesh_bounds(mesh);
    vec3 side = vec3_sub(box.max, box.min);
    return side.x + side.y + side.z - fmax(side.x, fmax(side.y, side.z)) -
           fmin(side.x, fmin(side.y, side.z));
}

static const char *unit_that_fits(double middle_in_units) {
    for (int i = 0; i < IMPORT_UNITS; i++)
        if (middle_in_units * import_units[i].mm >= KNEE_BONE_MIN_MM &&
            middle_in_units * import_units[i].mm <= KNEE_BONE_MAX_MM)
            return import_units[i].name;
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

static enum result refuse_source(const struct import_source *source, struct mesh *mesh,
                                 enum result result, struct error *err) {
    const char *unit =
        mesh->vertex_count ? unit_that_fits(middle_side_of_mesh(mesh) / source->mm_per_unit) : NULL;
    mesh_fini(mesh);
    return fail_in(err, result, "%s: %s%s%s", source->path,
                   unit ? "the unit that would fit is " : "", unit ? unit : "", unit ? ": " : "");
}

enum result import_read(const char *path, const struct case_limits *limits,
                        struct import_arrays *out_arrays, struct error *err) {
    *out_arrays = (struct import_arrays){0};
    enum result result = check_file(path, limits->file_bytes, err);
    return result == RESULT_OK ? import_reader_read(path, limits->group_triangles, out_arrays, err)
                               : result;
}

// A mirror turns triangles over.
static void place_mesh(const struct import_source *source, const struct import_arrays *arrays,
                       struct mesh *mesh) {
    bool mirrored = source->frame && mat3_determinant(source->frame->R_case_common) < 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const double *p = arrays->positions + 3 * (size_t)v;
        vec3 mm = vec3_scale(source->mm_per_unit, (vec3){p[0], p[1], p[2]});
        vec3 common = pose_apply(source->T_common_file, mm);
        mesh_set_vertex(mesh, v, source->frame ? import_to_case(source->frame, common) : common);
    }
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *from = arrays->triangles + 3 * (size_t)t;
        uint32_t *to = mesh->triangles + 3 * (size_t)t;
        to[0] = from[0];
        to[1] = from[mirrored ? 2 : 1];
        to[2] = from[mirrored ? 1 : 2];
    }
}

static enum result check_reach(const struct import_arrays *arrays, struct error *err) {
    for (size_t i = 0; i < 3 * (size_t)arrays->vertex_count; i++)
        if (!(fabs(arrays->positions[i]) <= FAR_UNITS))
            return fail(err, RESULT_INVALID, "vertex %zu lies at %g, beyond 10 m", i / 3,
                        arrays->positions[i]);
    return RESULT_OK;
}

enum result import_make(const struct import_source *source, const struct import_arrays *arrays,
                        struct mesh *out_mesh, struct repair_report *out_report,
                        struct error *err) {
    *out_report = (struct repair_report){0};
    *out_mesh = (struct mesh){0};
    enum result result = check_reach(arrays, err);
    if (result == RESULT_OK) {
        mesh_init(out_mesh, arrays->vertex_count, arrays->triangle_count);
        place_mesh(source, arrays, out_mesh);
        result = mesh_validate(out_mesh, err);
    }
    if (result != RESULT_OK)
        return refuse_source(source, out_mesh, result, err);
    struct repair_settings settings = {
        .weld_mm = is_soup(source->path, out_mesh) ? IMPORT_SOUP_WELD_MM : 0,
        .island_share = IMPORT_ISLAND_SHARE,
    };
    bool left = repair_mesh(out_mesh, &settings, out_report);
    out_report->triangles_before += arrays->dropped;
    out_report->repeated_corners += arrays->dropped;
    if (!left)
        return refuse_source(source, out_mesh, fail(err, RESULT_INVALID, "no triangle is left"),
                             err);
    return RESULT_OK;
}

enum result import_mesh(const struct import_source *source, const struct case_limits *limits,
                        struct mesh *out_mesh, struct repair_report *out_report,
                        struct error *err) {
    struct import_arrays arrays;
    *out_mesh = (struct mesh){0};
    enum result result = import_read(source->path, limits, &arrays, err);
    if (result != RESULT_OK)
        return result;
    result = import_make(source, &arrays, out_mesh, out_report, err);
    import_arrays_fini(&arrays);
    return result;
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
    if (strstr(group, "tibia") || strstr(group, "fibula") || strncmp(group, "meniscus", 8) == 0)
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
    double middle = middle_side_of_mesh(&bone->mesh);
    if (middle >= KNEE_BONE_MIN_MM && middle <= KNEE_BONE_MAX_MM)
        return RESULT_OK;
    const char *unit = unit_that_fits(middle / mm_per_unit);
    return fail(err, RESULT_INVALID, "%s: %.3g mm wide, where a knee has %d to %d mm; %s%s",
                bone->name, middle, KNEE_BONE_MIN_MM, KNEE_BONE_MAX_MM,
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
