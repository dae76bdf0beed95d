#include "mesh/sight.h"

#include "base/check.h"
#include "mesh/device.h"

#include <float.h>
#include <stdlib.h>

struct sight {
    const struct mesh *mesh;
    double margin;    // how far single precision may be off, mm
    double box[2][3]; // the least and the largest coordinates
    RTCScene scene;
};

// ---- building -----------------------------------------------------------------------------------

static void triangle_bounds(const struct RTCBoundsFunctionArguments *arguments) {
    const struct sight *sight = arguments->geometryUserPtr;
    vec3 low = mesh_corner(sight->mesh, arguments->primID, 0), high = low;
    for (int i = 1; i < 3; i++) {
        vec3 p = mesh_corner(sight->mesh, arguments->primID, i);
        low = (vec3){fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z)};
        high = (vec3){fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z)};
    }
    struct RTCBounds *out = arguments->bounds_o;
    out->lower_x = (float)(low.x - sight->margin);
    out->lower_y = (float)(low.y - sight->margin);
    out->lower_z = (float)(low.z - sight->margin);
    out->upper_x = (float)(high.x + sight->margin);
    out->upper_y = (float)(high.y + sight->margin);
    out->upper_z = (float)(high.z + sight->margin);
}

static void meet_triangle(const struct RTCOccludedFunctionNArguments *arguments);

static void build_scene(struct sight *sight, RTCDevice device) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, sight->mesh->triangle_count);
    rtcSetGeometryUserData(geometry, sight);
    rtcSetGeometryBoundsFunction(geometry, triangle_bounds, NULL);
    rtcSetGeometryOccludedFunction(geometry, meet_triangle);
    rtcCommitGeometry(geometry);
    sight->scene = rtcNewScene(device);
    rtcSetSceneFlags(sight->scene, RTC_SCENE_FLAG_ROBUST);
    rtcAttachGeometry(sight->scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(sight->scene);
}

static double margin_of(const struct mesh *mesh) {
    float largest = 0;
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++)
        largest = fmaxf(largest, fabsf(mesh->positions[i]));
    return 16 * (double)FLT_EPSILON * (double)largest;
}

static void find_box(struct sight *sight) {
    const struct mesh *mesh = sight->mesh;
    for (int axis = 0; axis < 3; axis++) {
        double *low = &sight->box[0][axis], *high = &sight->box[1][axis];
        *low = INFINITY, *high = -INFINITY;
        for (uint32_t v = 0; v < mesh->vertex_count; v++) {
            double at = (double)mesh->positions[3 * (size_t)v + (size_t)axis];
            *low = at < *low ? at : *low;
            *high = at > *high ? at : *high;
        }
        *low -= sight->margin;
        *high += sight->margin;
    }
}

enum result sight_create(const struct mesh *mesh, struct sight **out_sight, struct error *err) {
    RTCDevice device;
    if (embree_device(&device, err) != RESULT_OK)
        return RESULT_IO;
    struct sight *sight = alloc(1, sizeof *sight);
    sight->mesh = mesh;
    sight->margin = margin_of(mesh);
    find_box(sight);
    build_scene(sight, device);
    enum RTCError problem = rtcGetDeviceError(device);
    if (problem != RTC_ERROR_NONE) {
        sight_destroy(&sight);
        return fail(err, RESULT_IO, "Embree cannot build a structure of rays: error %d", problem);
    }
    *out_sight = sight;
    return RESULT_OK;
}

void sight_destroy(struct sight **sight) {
    if (!*sight)
        return;
    rtcReleaseScene((*sight)->scene);
    free(*sight);
    *sight = NULL;
}

// ---- asking -------------------------------------------------------------------------------------

// Embree passes the context on to each triangle.
struct asking {
    struct RTCIntersectContext context; // first
    vec3 from, way;
    double last; // share of the way up to which triangles count
    uint32_t crossing;
};

// Whether the way crosses the triangle's plane inside it, at a share from 0 to `last`. Signed
// volumes, so neighbours agree about the edge that they share.
static bool crosses(const struct asking *a, const struct mesh *mesh, uint32_t triangle) {
    vec3 p = vec3_sub(mesh_corner(mesh, triangle, 0), a->from);
    vec3 q = vec3_sub(mesh_corner(mesh, triangle, 1), a->from);
    vec3 r = vec3_sub(mesh_corner(mesh, triangle, 2), a->from);
    double u = vec3_dot(a->way, vec3_cross(r, q));
    double v = vec3_dot(a->way, vec3_cross(p, r));
    double w = vec3_dot(a->way, vec3_cross(q, p));
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0))
        return false;
    double whole = u + v + w;
    double along = vec3_dot(p, vec3_cross(r, q));
    return whole != 0 && along / whole >= 0 && along / whole <= a->last;
}

// Whether the box, which has a margin, may be met: most ways go past most surfaces.
static bool comes_by(const struct sight *sight, vec3 from, vec3 way) {
    const double at[3] = {from.x, from.y, from.z}, by[3] = {way.x, way.y, way.z};
    double first = 0, last = 1;
    for (int axis = 0; axis < 3; axis++) {
        double low = sight->box[0][axis] - at[axis], high = sight->box[1][axis] - at[axis];
        if (by[axis] == 0 && (low > 0 || high < 0))
            return false;
        if (by[axis] == 0)
            continue;
        double enters = (by[axis] > 0 ? low : high) / by[axis];
        double leaves = (by[axis] > 0 ? high : low) / by[axis];
        first = enters > first ? enters : first;
        last = leaves < last ? leaves : last;
    }
    return first <= last;
}

static void meet_triangle(const struct RTCOccludedFunctionNArguments *arguments) {
    const struct sight *sight = arguments->geometryUserPtr;
    struct asking *asking = (struct asking *)(void *)arguments->context;
    CHECK(arguments->N == 1);
    if (!arguments->valid[0] || !crosses(asking, sight->mesh, arguments->primID))
        return;
    asking->crossing = arguments->primID;
    ((struct RTCRay *)(void *)arguments->ray)->tfar = -INFINITY;
}

bool sight_is_clear(const struct sight *sight, vec3 from, vec3 to, double spare_mm,
                    uint32_t *hint) {
    CHECK(vec3_is_finite(from) && vec3_is_finite(to) && *hint < sight->mesh->triangle_count);
    struct asking asking = {.from = from, .way = vec3_sub(to, from)};
    double length = vec3_length(asking.way);
    if (length <= spare_mm || !comes_by(sight, from, asking.way))
        return true;
    asking.last = 1 - spare_mm / length;
    if (crosses(&asking, sight->mesh, *hint))
        return false;
    struct RTCRay ray = {.org_x = (float)from.x,
                         .org_y = (float)from.y,
                         .org_z = (float)from.z,
                         .dir_x = (float)asking.way.x,
                         .dir_y = (float)asking.way.y,
                         .dir_z = (float)asking.way.z,
                         .tfar = 1,
                         .mask = UINT32_MAX};
    rtcInitIntersectContext(&asking.context);
    rtcOccluded1(sight->scene, &asking.context, &ray);
    if (ray.tfar >= 0)
        return true;
    *hint = asking.crossing;
    return false;
}
