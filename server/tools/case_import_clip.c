#include "case_import_clip.h"

#include "cut/cut.h"
#include "mesh/topology.h"

#include <math.h>
#include <string.h>

#define WIDE_MM 480 // half the blade's width; a leg is narrower
#define NEAR_PLANE_MM 1e-4
#define LONG_MM 700 // of the blade: the longest femur and a margin

// Of one size, so that a bone that was clipped before gives the same cut.
static enum result blade_beyond(double distance_mm, int way, struct convex *out,
                                struct error *err) {
    struct plane planes[6] = {{{1, 0, 0}, WIDE_MM},
                              {{-1, 0, 0}, WIDE_MM},
                              {{0, 1, 0}, WIDE_MM},
                              {{0, -1, 0}, WIDE_MM},
                              {{0, 0, way}, distance_mm + LONG_MM},
                              {{0, 0, -way}, -distance_mm}};
    return convex_create(planes, 6, out, err);
}

static enum result cut_off(struct mesh *mesh, double distance_mm, int way, struct error *err) {
    struct cut_mesh *cut;
    struct convex blade;
    struct cut_change change = {0};
    enum result result = blade_beyond(distance_mm, way, &blade, err);
    if (result == RESULT_OK)
        result = cut_mesh_create(mesh, &cut, err);
    if (result != RESULT_OK)
        return result;
    enum cut_outcome outcome = cut_apply(cut, &blade, 1, &change, err);
    if (outcome == CUT_CHANGED) {
        mesh_fini(mesh);
        cut_mesh_flatten(cut, mesh, NULL, NULL);
    }
    cut_change_fini(&change);
    cut_mesh_destroy(&cut);
    return outcome == CUT_REFUSED ? RESULT_REFUSED : RESULT_OK;
}

static double reach_of(const struct mesh *mesh, uint32_t triangle, int way) {
    double reach = -INFINITY;
    for (int i = 0; i < 3; i++)
        reach = fmax(reach, way * mesh_corner(mesh, triangle, i).z);
    return reach;
}

static void leave_out(struct mesh *mesh, double distance_mm, int way) {
    uint32_t kept = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        if (reach_of(mesh, t, way) <= distance_mm)
            memmove(mesh->triangles + 3 * (size_t)kept++, mesh->triangles + 3 * (size_t)t,
                    3 * sizeof *mesh->triangles);
    mesh->triangle_count = kept;
    mesh_drop_unused(mesh);
}

// The cut's vertices lie in the plane, as far as floats tell.
static struct clip_plane find_cap(const struct mesh *mesh, double z) {
    struct clip_plane plane = {
        .z = z, .capped = true, .cap = {{INFINITY, INFINITY, z}, {-INFINITY, -INFINITY, z}}};
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = mesh_vertex(mesh, v);
        if (fabs(p.z - z) > NEAR_PLANE_MM)
            continue;
        plane.cap.min = (vec3){fmin(plane.cap.min.x, p.x), fmin(plane.cap.min.y, p.y), z};
        plane.cap.max = (vec3){fmax(plane.cap.max.x, p.x), fmax(plane.cap.max.y, p.y), z};
    }
    return plane;
}

static struct clip_plane clip_at(struct mesh *mesh, double distance_mm, int way) {
    struct clip_plane plane = {.z = way * distance_mm};
    struct topology t = topology_of(mesh);
    if (!t.closed || !t.manifold || !t.oriented)
        fail(&plane.why, RESULT_INVALID, "the mesh is %s",
             t.closed ? "no manifold, or its triangles face different ways" : "not closed");
    else if (cut_off(mesh, distance_mm, way, &plane.why) == RESULT_OK)
        return find_cap(mesh, plane.z);
    leave_out(mesh, distance_mm, way);
    return plane;
}

enum result import_clip(struct mesh *mesh, double distance_mm, struct clip_report *out_report,
                        struct error *err) {
    *out_report = (struct clip_report){0};
    struct box box = mesh_bounds(mesh);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        out_report->far_triangles +=
            fmax(reach_of(mesh, t, -1), reach_of(mesh, t, 1)) > distance_mm;
    for (int way = -1; way <= 1; way += 2) {
        if ((way < 0 ? -box.min.z : box.max.z) <= distance_mm)
            continue;
        out_report->planes[out_report->plane_count++] = clip_at(mesh, distance_mm, way);
        if (!mesh->triangle_count)
            return fail(err, RESULT_INVALID, "it lies wholly more than %g mm %s the joint",
                        distance_mm, way < 0 ? "below" : "above");
    }
    return RESULT_OK;
}
