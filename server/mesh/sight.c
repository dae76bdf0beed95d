#include "mesh/sight.h"

#include "base/check.h"
#include "mesh/device.h"

#include <float.h>
#include <stdlib.h>

struct surface {
    const struct mesh *mesh;
    double margin; // how far single precision may be off, mm
};

struct sight {
    struct surface surfaces[SIGHT_MESHES_MAX]; // of a NULL mesh: not one of them
    double box[2][3];                          // the least and the largest coordinates
    RTCScene scene;
};

// ---- building -----------------------------------------------------------------------------------

static void triangle_bounds(const struct RTCBoundsFunctionArguments *arguments) {
    const struct surface *surface = arguments->geometryUserPtr;
    vec3 low = mesh_corner(surface->mesh, arguments->primID, 0), high = low;
    for (int i = 1; i < 3; i++) {
        vec3 p = mesh_corner(surface->mesh, arguments->primID, i);
        low = (vec3){fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z)};
        high = (vec3){fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z)};
    }
    struct RTCBounds *out = arguments->bounds_o;
    out->lower_x = (float)(low.x - surface->margin);
    out->lower_y = (float)(low.y - surface->margin);
    out->lower_z = (float)(low.z - surface->margin);
    out->upper_x = (float)(high.x + surface->margin);
    out->upper_y = (float)(high.y + surface->margin);
    out->upper_z = (float)(high.z + surface->margin);
}

static void meet_triangle(const struct RTCOccludedFunctionNArguments *arguments);

static void attach(struct sight *sight, RTCDevice device, unsigned index) {
    struct surface *surface = &sight->surfaces[index];
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, surface->mesh->triangle_count);
    rtcSetGeometryUserData(geometry, surface);
    rtcSetGeometryBoundsFunction(geometry, triangle_bounds, NULL);
    rtcSetGeometryOccludedFunction(geometry, meet_triangle);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(sight->scene, geometry, index);
    rtcReleaseGeometry(geometry);
}

static void build_scene(struct sight *sight, RTCDevice device) {
    sight->scene = rtcNewScene(device);
    rtcSetSceneFlags(sight->scene, RTC_SCENE_FLAG_ROBUST);
    for (unsigned i = 0; i < SIGHT_MESHES_MAX; i++)
        if (sight->surfaces[i].mesh)
            attach(sight, device, i);
    rtcCommitScene(sight->scene);
}

static double margin_of(const struct mesh *mesh) {
    float largest = 0;
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++)
        largest = fmaxf(largest, fabsf(mesh->positions[i]));
    return 16 * (double)FLT_EPSILON * (double)largest;
}

static void widen(struct sight *sight, const struct surface *surface) {
    struct box box = mesh_bounds(surface->mesh);
    const double least[3] = {box.min.x, box.min.y, box.min.z};
    const double most[3] = {box.max.x, box.max.y, box.max.z};
    for (int axis = 0; axis < 3; axis++) {
        sight->box[0][axis] = fmin(sight->box[0][axis], least[axis] - surface->margin);
        sight->box[1][axis] = fmax(sight->box[1][axis], most[axis] + surface->margin);
    }
}

static void take_surfaces(struct sight *sight, const struct mesh *meshes, uint32_t which) {
    for (int axis = 0; axis < 3; axis++)
        sight->box[0][axis] = INFINITY, sight->box[1][axis] = -INFINITY;
    for (int i = 0; i < SIGHT_MESHES_MAX; i++) {
        if (!(which >> i & 1))
            continue;
        sight->surfaces[i] = (struct surface){&meshes[i], margin_of(&meshes[i])};
        widen(sight, &sight->surfaces[i]);
    }
}

enum result sight_create(const struct mesh *meshes, uint32_t which, struct sight **out_sight,
                         struct error *err) {
    RTCDevice device;
    if (embree_device(&device, err) != RESULT_OK)
        return RESULT_IO;
    struct sight *sight = alloc(1, sizeof *sight);
    take_surfaces(sight, meshes, which);
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
    double last;    // share of the way up to which triangles count
    uint32_t which; // meshes that count, a bit each
    struct sight_hint crossing;
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
    const struct surface *surface = arguments->geometryUserPtr;
    struct asking *asking = (struct asking *)(void *)arguments->context;
    CHECK(arguments->N == 1);
    if (!arguments->valid[0] || !(asking->which >> arguments->geomID & 1) ||
        !crosses(asking, surface->mesh, arguments->primID))
        return;
    asking->crossing = (struct sight_hint){arguments->geomID, arguments->primID};
    ((struct RTCRay *)(void *)arguments->ray)->tfar = -INFINITY;
}

// A hint may be of another sight's mesh.
static bool crosses_hinted(const struct sight *sight, const struct asking *asking,
                           const struct sight_hint *hint) {
    const struct mesh *mesh = sight->surfaces[hint->mesh].mesh;
    CHECK(!mesh || hint->triangle < mesh->triangle_count);
    return mesh && (asking->which >> hint->mesh & 1) && crosses(asking, mesh, hint->triangle);
}

bool sight_is_clear(const struct sight *sight, uint32_t which, vec3 from, vec3 to, double spare_mm,
                    struct sight_hint *hint) {
    CHECK(vec3_is_finite(from) && vec3_is_finite(to) && hint->mesh < SIGHT_MESHES_MAX);
    struct asking asking = {.from = from, .way = vec3_sub(to, from), .which = which};
    double length = vec3_length(asking.way);
    if (length <= spare_mm || !comes_by(sight, from, asking.way))
        return true;
    asking.last = 1 - spare_mm / length;
    if (crosses_hinted(sight, &asking, hint))
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
