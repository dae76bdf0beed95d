// One case, its meshes written in m, cm and mm, imported, displaced, saved and loaded: the warp
// must not tell which.
#include "base/check.h"
#include "fidelity.h"
#include "folder.h"
#include "generate/generate.h"
#include "import/import.h"

#include <stdio.h>
#include <stdlib.h>

#define POINTS 2000
#define AROUND_MM 10.0

static const struct {
    const char *name;
    double mm;
} units[] = {{"mm", 1}, {"cm", 10}, {"m", 1000}};

enum { UNITS = sizeof units / sizeof units[0] };

static enum result write_mesh(const struct mesh *mesh, double mm_per_unit, const char *path,
                              struct error *err) {
    FILE *file = fopen(path, "we");
    if (!file)
        return fail(err, RESULT_IO, "%s: cannot be written", path);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = vec3_scale(1 / mm_per_unit, mesh_vertex(mesh, v));
        fprintf(file, "v %.9g %.9g %.9g\n", p.x, p.y, p.z);
    }
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *c = mesh->triangles + 3 * (size_t)t;
        fprintf(file, "f %u %u %u\n", c[0] + 1, c[1] + 1, c[2] + 1);
    }
    bool written = !ferror(file);
    return fclose(file) == 0 && written ? RESULT_OK
                                        : fail(err, RESULT_IO, "%s: cannot be written", path);
}

static enum result import_group(const struct case_group *from, double mm_per_unit, const char *dir,
                                struct knee_case *to, struct error *err) {
    char path[256];
    struct mesh mesh;
    struct repair_report repair;
    struct case_limits limits = case_limits_default();
    snprintf(path, sizeof path, "%s/mesh.obj", dir);
    enum result result = write_mesh(&from->mesh, mm_per_unit, path, err);
    struct import_source source = {path, mm_per_unit, pose_identity(), NULL};
    if (result == RESULT_OK)
        result = import_mesh(&source, &limits, &mesh, &repair, err);
    remove(path);
    if (result != RESULT_OK)
        return result;
    struct case_group *group = case_add_group(to, from->name, from->body);
    result = case_add_part(group, from->name, &mesh, err);
    mesh_fini(&mesh);
    return result;
}

// Imported and displaced, then saved in `dir` and loaded.
static enum result make(const struct knee_case *from, double mm_per_unit, const char *dir,
                        struct anatomy *out, struct error *err) {
    struct knee_case *made = case_create("units", ""), *loaded = NULL;
    enum result result = RESULT_OK;
    made->joint = from->joint;
    for (int i = 0; result == RESULT_OK && i < from->group_count; i++)
        result = import_group(&from->groups[i], mm_per_unit, dir, made, err);
    if (result == RESULT_OK)
        result = lesion_make(made, LESION_CAVITY, 1, err);
    if (result == RESULT_OK)
        result = case_save(made, dir, err);
    if (result == RESULT_OK)
        result = case_load(dir, NULL, &loaded, err);
    case_destroy(&made);
    if (result == RESULT_OK)
        result = anatomy_init(out, &loaded, err);
    case_destroy(&loaded);
    return result;
}

// Around what is displaced, in the space and in solids.
static double largest_off(const struct anatomy *a, const struct anatomy *b, enum variant variant) {
    struct random r = {1};
    struct box box;
    double largest = 0;
    anatomy_largest(&a->scene, &box);
    for (int i = 0; i < POINTS; i++) {
        vec3 y = {random_between(&r, box.min.x - AROUND_MM, box.max.x + AROUND_MM),
                  random_between(&r, box.min.y - AROUND_MM, box.max.y + AROUND_MM),
                  random_between(&r, box.min.z - AROUND_MM, box.max.z + AROUND_MM)};
        largest = fmax(largest, vec3_distance(variant_warp(a, variant, y).displacement,
                                              variant_warp(b, variant, y).displacement));
    }
    return largest;
}

static double compare(struct fidelity *f, const struct anatomy made[UNITS]) {
    double largest = 0;
    for (int v = 0; v < VARIANT_COUNT; v++)
        for (int u = 1; u < UNITS; u++) {
            double off = largest_off(&made[0], &made[u], (enum variant)v);
            report_figure(f->report, off, "mm", "units/%s/%s to mm", variant_name((enum variant)v),
                          units[u].name);
            largest = v == VARIANT_INTEGRAL_SKIN ? fmax(largest, off) : largest;
        }
    return largest;
}

static enum result make_all(struct anatomy made[UNITS], struct error *err) {
    char dir[FOLDER_MAX];
    struct recipe recipe;
    struct knee_case *knee;
    folder_make(dir);
    enum result result = recipe_load(CASES "/healthy", &recipe, err);
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &knee, err);
    for (int u = 0; result == RESULT_OK && u < UNITS; u++)
        result = make(knee, units[u].mm, dir, &made[u], err);
    if (result == RESULT_OK)
        case_destroy(&knee);
    folder_remove(dir);
    return result;
}

enum result fidelity_units(struct fidelity *f, double *out_largest_mm, struct error *err) {
    struct anatomy *made = alloc(UNITS, sizeof *made); // surfaces point into them
    enum result result = make_all(made, err);
    if (result == RESULT_OK)
        *out_largest_mm = compare(f, made);
    for (int u = 0; u < UNITS; u++)
        anatomy_fini(&made[u]);
    free(made);
    return result;
}
