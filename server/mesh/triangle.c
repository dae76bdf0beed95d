#include "mesh/query.h"

struct edge_point {
    double square, t; // t: from the corner `from` towards the next
    vec3 point;
};

// From the lower vertex to the higher, so that both triangles of an edge compute the same bits.
static struct edge_point closest_on_edge(const struct mesh *mesh, const uint32_t *vertices,
                                         int corner, vec3 p) {
    uint32_t from = vertices[corner], to = vertices[(corner + 1) % 3];
    bool turned = from > to;
    vec3 low = mesh_vertex(mesh, turned ? to : from);
    vec3 high = mesh_vertex(mesh, turned ? from : to);
    vec3 along = vec3_sub(high, low);
    double square = vec3_dot(along, along);
    double t = square > 0 ? vec3_dot(vec3_sub(p, low), along) / square : 0;
    t = t > 0 ? t : 0;
    vec3 point = t >= 1 ? high : vec3_add_scaled(low, t, along);
    t = t < 1 ? t : 1;
    vec3 off = vec3_sub(p, point);
    return (struct edge_point){vec3_dot(off, off), turned ? 1 - t : t, point};
}

static void take_edge(const struct edge_point *edge, int corner, struct closest *out) {
    int next = (corner + 1) % 3;
    out->point = edge->point;
    out->distance = sqrt(edge->square);
    out->weights[0] = out->weights[1] = out->weights[2] = 0;
    out->weights[corner] = 1 - edge->t;
    out->weights[next] = edge->t;
    bool at_end = edge->t <= 0 || edge->t >= 1;
    out->feature = at_end ? FEATURE_VERTEX : FEATURE_EDGE;
    out->corner = edge->t >= 1 ? next : corner;
}

// On a thin triangle the first solution is off by rounding times the distance of p from a; solving
// again for what is left brings that down to rounding times the distance from the triangle.
static bool closest_on_face(const struct mesh *mesh, uint32_t triangle, vec3 p,
                            struct closest *out) {
    vec3 a = mesh_corner(mesh, triangle, 0), point = a;
    vec3 ab = vec3_sub(mesh_corner(mesh, triangle, 1), a);
    vec3 ac = vec3_sub(mesh_corner(mesh, triangle, 2), a);
    vec3 normal = vec3_cross(ab, ac);
    double square = vec3_dot(normal, normal), s = 0, t = 0;
    bool thin = square < 1e-6 * vec3_dot(ab, ab) * vec3_dot(ac, ac);
    for (int pass = 0; pass <= thin; pass++) {
        vec3 off = vec3_sub(p, point);
        s += vec3_dot(vec3_cross(off, ac), normal) / square;
        t += vec3_dot(vec3_cross(ab, off), normal) / square;
        point = vec3_add_scaled(vec3_add_scaled(a, s, ab), t, ac);
    }
    if (!(s > 0 && t > 0 && s + t < 1)) // no area: NaN, and not inside
        return false;
    out->feature = FEATURE_FACE;
    out->corner = 0;
    out->weights[0] = 1 - s - t;
    out->weights[1] = s;
    out->weights[2] = t;
    out->point = point;
    out->distance = vec3_distance(p, point);
    return true;
}

void closest_on_triangle(const struct mesh *mesh, uint32_t triangle, vec3 p, struct closest *out) {
    out->triangle = triangle;
    if (closest_on_face(mesh, triangle, p, out))
        return;
    const uint32_t *vertices = mesh->triangles + 3 * (size_t)triangle;
    struct edge_point best = closest_on_edge(mesh, vertices, 0, p);
    int corner = 0;
    for (int i = 1; i < 3; i++) {
        struct edge_point other = closest_on_edge(mesh, vertices, i, p);
        if (other.square < best.square) {
            best = other;
            corner = i;
        }
    }
    take_edge(&best, corner, out);
}
