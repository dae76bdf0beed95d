#include "mesh/query.h"

#include "base/check.h"
#include "mesh/cluster.h"
#include "mesh/device.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

struct query {
    const struct mesh *mesh;
    struct cluster *clusters;
    uint32_t cluster_count;
    double reach; // largest coordinate: what single precision is relative to
    RTCScene scene;
};

// ---- building ----

static void cluster_bounds(const struct RTCBoundsFunctionArguments *arguments) {
    const struct query *query = arguments->geometryUserPtr;
    const struct cluster *cluster = &query->clusters[arguments->primID];
    struct RTCBounds *b = arguments->bounds_o;
    b->lower_x = cluster->low[0];
    b->lower_y = cluster->low[1];
    b->lower_z = cluster->low[2];
    b->upper_x = cluster->high[0];
    b->upper_y = cluster->high[1];
    b->upper_z = cluster->high[2];
}

static void build_scene(struct query *query, RTCDevice device) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
    rtcSetGeometryUserPrimitiveCount(geometry, query->cluster_count);
    rtcSetGeometryUserData(geometry, query);
    rtcSetGeometryBoundsFunction(geometry, cluster_bounds, NULL);
    rtcCommitGeometry(geometry);
    query->scene = rtcNewScene(device);
    rtcSetSceneFlags(query->scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(query->scene, RTC_BUILD_QUALITY_HIGH);
    rtcAttachGeometry(query->scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(query->scene);
}

static double largest_coordinate(const struct mesh *mesh) {
    float largest = 0;
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++)
        largest = fmaxf(largest, fabsf(mesh->positions[i]));
    return (double)largest;
}

enum result query_create(const struct mesh *mesh, struct query **out_query, struct error *err) {
    RTCDevice device;
    if (embree_device(&device, err) != RESULT_OK)
        return RESULT_IO;
    struct query *query = alloc(1, sizeof *query);
    query->mesh = mesh;
    query->reach = largest_coordinate(mesh);
    query->clusters = clusters_create(mesh, &query->cluster_count);
    build_scene(query, device);
    enum RTCError problem = rtcGetDeviceError(device);
    if (problem != RTC_ERROR_NONE) {
        query_destroy(&query);
        return fail(err, RESULT_IO, "Embree cannot build a search structure: error %d", problem);
    }
    *out_query = query;
    return RESULT_OK;
}

void query_destroy(struct query **query) {
    if (!*query)
        return;
    rtcReleaseScene((*query)->scene);
    free((*query)->clusters);
    free(*query);
    *query = NULL;
}

// ---- asking ----

#define FAR_MM 1e9 // from there single precision tells no two triangles apart, and then overflows

struct nearest_search {
    const struct query *query;
    vec3 p;
    float p_single[3];
    double margin; // how far a distance in single precision may be off
    double limit;  // max_distance until something is found
    bool found;
    struct closest best;
};

static bool is_better(const struct nearest_search *s, const struct closest *c) {
    if (!s->found)
        return c->distance <= s->limit;
    if (c->distance != s->best.distance)
        return c->distance < s->best.distance;
    return c->triangle < s->best.triangle;
}

static void try_triangle(struct nearest_search *s, uint32_t triangle) {
    struct closest c;
    closest_on_triangle(s->query->mesh, triangle, s->p, &c);
    if (!is_better(s, &c))
        return;
    s->best = c;
    s->limit = c.distance;
    s->found = true;
}

// Single precision finds who may be the closest, double precision decides.
static bool visit_cluster(struct RTCPointQueryFunctionArguments *arguments) {
    struct nearest_search *s = arguments->userPtr;
    const struct cluster *cluster = &s->query->clusters[arguments->primID];
    float squares[CLUSTER_SIZE];
    cluster_distances(cluster, s->p_single, squares);
    double before = s->limit;
    for (int i = 0; i < CLUSTER_SIZE; i++) {
        double near = s->limit + s->margin;
        if ((double)squares[i] <= near * near)
            try_triangle(s, cluster->triangles[i]);
    }
    if (s->limit == before)
        return false;
    arguments->query->radius = (float)(s->limit + s->margin);
    return true;
}

static void search_clusters(struct nearest_search *s) {
    struct RTCPointQuery point = {
        .x = s->p_single[0],
        .y = s->p_single[1],
        .z = s->p_single[2],
        .radius = (float)(s->limit + s->margin),
    };
    struct RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(s->query->scene, &point, &context, visit_cluster, s);
}

static void search_all(struct nearest_search *s) {
    for (uint32_t t = 0; t < s->query->mesh->triangle_count; t++)
        try_triangle(s, t);
}

bool query_closest(const struct query *query, vec3 p, double max_distance, uint32_t hint,
                   struct closest *out) {
    CHECK(vec3_is_finite(p));
    double farthest = fmax(fabs(p.x), fmax(fabs(p.y), fabs(p.z)));
    bool far = farthest > FAR_MM;
    if (far && max_distance < farthest - query->reach)
        return false;
    struct nearest_search s = {
        .query = query,
        .p = p,
        .p_single = {(float)p.x, (float)p.y, (float)p.z},
        .margin = 16 * (double)FLT_EPSILON * (query->reach + farthest),
        .limit = max_distance,
    };
    if (hint < query->mesh->triangle_count)
        try_triangle(&s, hint);
    (far ? search_all : search_clusters)(&s);
    if (s.found)
        *out = s.best;
    return s.found;
}
