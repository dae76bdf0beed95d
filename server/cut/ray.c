#include "cut/ray.h"

#include "cut/stage.h"

// Off the lattices on which vertices like to lie.
#define NUDGE_X_MM 1.2345e-10
#define NUDGE_Y_MM 0.7391e-10

// On which side of the edge q lies, seen from above; the same for both triangles of the edge.
static bool is_left(const struct cut_mesh *mesh, uint32_t from, uint32_t to, vec3 q) {
    bool turned = from > to;
    vec3 a = mesh->points[turned ? to : from], b = mesh->points[turned ? from : to];
    double area = (b.x - a.x) * (q.y - a.y) - (b.y - a.y) * (q.x - a.x);
    return (area >= 0) != turned;
}

// 1 where the ray comes out through the triangle, -1 where it goes in, 0 where it misses.
static int crossing(const struct cut_mesh *mesh, const uint32_t *c, vec3 q) {
    bool left = is_left(mesh, c[0], c[1], q);
    if (is_left(mesh, c[1], c[2], q) != left || is_left(mesh, c[2], c[0], q) != left)
        return 0;
    vec3 p[3];
    triangle_points(mesh, c, p);
    vec3 n = vec3_cross(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[0]));
    double above = vec3_dot(n, vec3_sub(p[0], q)); // n.z times the height of the plane over q
    return left ? above > 0 : -(above < 0);
}

static vec3 nudged(vec3 p) {
    return (vec3){p.x + NUDGE_X_MM, p.y + NUDGE_Y_MM, p.z};
}

int ray_winding_of(const struct cut_mesh *mesh, const uint32_t *triangles, uint32_t count,
                   vec3 point) {
    vec3 q = nudged(point);
    int winding = 0;
    for (uint32_t i = 0; i < count; i++)
        winding += crossing(mesh, mesh->corners + 3 * (size_t)triangles[i], q);
    return winding;
}

int ray_winding(const struct cut_mesh *mesh, struct stamped_set *slots, struct ids *hits,
                vec3 point) {
    vec3 q = nudged(point);
    near_collect(mesh, (struct box){q, {q.x, q.y, INFINITY}}, NULL, slots, hits);
    return ray_winding_of(mesh, hits->at, hits->count, point);
}
