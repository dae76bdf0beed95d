#include "plain_query.h"

#include "base/check.h"

#include <embree3/rtcore.h>
#include <stdlib.h>
#include <string.h>

struct plain_query {
    const struct mesh *mesh;
    RTCDevice device;
    RTCScene scene;
};

// Embree reads four bytes behind the last element.
static void *buffer(RTCGeometry geometry, enum RTCBufferType type, enum RTCFormat format,
                    size_t count) {
    void *made = rtcSetNewGeometryBuffer(geometry, type, 0, format, 3 * sizeof(float), count);
    CHECK(made);
    return made;
}

struct plain_query *plain_query_create(const struct mesh *mesh) {
    struct plain_query *query = alloc(1, sizeof *query);
    query->mesh = mesh;
    query->device = rtcNewDevice(NULL);
    query->scene = rtcNewScene(query->device);
    RTCGeometry geometry = rtcNewGeometry(query->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    memcpy(buffer(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh->vertex_count),
           mesh->positions, 3 * (size_t)mesh->vertex_count * sizeof(float));
    memcpy(buffer(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh->triangle_count),
           mesh->triangles, 3 * (size_t)mesh->triangle_count * sizeof(uint32_t));
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(geometry);
    rtcSetSceneBuildQuality(query->scene, RTC_BUILD_QUALITY_HIGH);
    rtcAttachGeometry(query->scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(query->scene);
    return query;
}

void plain_query_destroy(struct plain_query **query) {
    rtcReleaseScene((*query)->scene);
    rtcReleaseDevice((*query)->device);
    free(*query);
    *query = NULL;
}

// ---- a triangle in single precision -------------------------------------------------------------

struct point {
    float x, y, z;
};

static inline struct point from_to(struct point a, struct point b) {
    return (struct point){b.x - a.x, b.y - a.y, b.z - a.z};
}

static inline float dot(struct point a, struct point b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline float square_to(struct point ap, struct point ab, float s, struct point ac, float t) {
    struct point off = {ap.x - s * ab.x - t * ac.x, ap.y - s * ab.y - t * ac.y,
                        ap.z - s * ab.z - t * ac.z};
    return dot(off, off);
}

static inline float share(float part, float rest) {
    float whole = part + rest;
    return whole > 0 ? part / whole : 0;
}

// By the region of the corner, side or face that p is above (Ericson 2004, 5.1.5).
static float square_to_triangle(struct point p, struct point a, struct point b, struct point c) {
    struct point ab = from_to(a, b), ac = from_to(a, c), ap = from_to(a, p);
    float d1 = dot(ab, ap), d2 = dot(ac, ap);
    if (d1 <= 0 && d2 <= 0)
        return dot(ap, ap);
    float d3 = d1 - dot(ab, ab), d4 = d2 - dot(ab, ac);
    if (d3 >= 0 && d4 <= d3)
        return square_to(ap, ab, 1, ac, 0);
    float d5 = d1 - dot(ab, ac), d6 = d2 - dot(ac, ac);
    if (d6 >= 0 && d5 <= d6)
        return square_to(ap, ab, 0, ac, 1);
    float by_c = d1 * d4 - d3 * d2, by_b = d5 * d2 - d1 * d6, by_a = d3 * d6 - d5 * d4;
    if (by_c <= 0 && d1 >= 0 && d3 <= 0)
        return square_to(ap, ab, share(d1, -d3), ac, 0);
    if (by_b <= 0 && d2 >= 0 && d6 <= 0)
        return square_to(ap, ab, 0, ac, share(d2, -d6));
    if (by_a <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        float t = share(d4 - d3, d5 - d6);
        return square_to(ap, ab, 1 - t, ac, t);
    }
    float sum = by_a + by_b + by_c;
    return square_to(ap, ab, by_b / sum, ac, by_c / sum);
}

// ---- asking -------------------------------------------------------------------------------------

static struct point corner(const struct mesh *mesh, uint32_t triangle, uint32_t i) {
    const float *p = mesh->positions + 3 * (size_t)mesh->triangles[3 * (size_t)triangle + i];
    return (struct point){p[0], p[1], p[2]};
}

static bool visit(struct RTCPointQueryFunctionArguments *arguments) {
    const struct mesh *mesh = arguments->userPtr;
    struct RTCPointQuery *query = arguments->query;
    uint32_t t = arguments->primID;
    float square = square_to_triangle((struct point){query->x, query->y, query->z},
                                      corner(mesh, t, 0), corner(mesh, t, 1), corner(mesh, t, 2));
    if (square >= query->radius * query->radius)
        return false;
    query->radius = sqrtf(square);
    return true;
}

double plain_query_distance(const struct plain_query *query, vec3 p, double reach_mm) {
    struct RTCPointQuery point = {(float)p.x, (float)p.y, (float)p.z, 0, (float)reach_mm};
    struct RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(query->scene, &point, &context, visit, (void *)query->mesh);
    return point.radius < (float)reach_mm ? (double)point.radius : INFINITY;
}
