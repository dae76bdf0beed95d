#include "cutting/inside.h"

#include "base/check.h"
#include "scene/brute.h"
#include "winding.h"

#include <math.h>
#include <stdlib.h>

// ---- columns of triangles over a grid of x and y ------------------------------------------------

struct locator {
    const struct snapshot *surface;
    double low_x, low_y, cell;
    uint32_t columns, rows;
    uint32_t *starts; // of each cell's triangles, and the end
    uint32_t *triangles;
};

static uint32_t clamp_cell(double where, uint32_t count) {
    return where <= 0 ? 0 : where >= count - 1 ? count - 1 : (uint32_t)where;
}

struct cells {
    uint32_t from_x, to_x, from_y, to_y;
};

static struct cells cells_of(const struct locator *locator, uint32_t triangle) {
    vec3 c[3];
    snapshot_corners(locator->surface, triangle, c);
    double from_x = fmin(c[0].x, fmin(c[1].x, c[2].x)) - locator->low_x;
    double to_x = fmax(c[0].x, fmax(c[1].x, c[2].x)) - locator->low_x;
    double from_y = fmin(c[0].y, fmin(c[1].y, c[2].y)) - locator->low_y;
    double to_y = fmax(c[0].y, fmax(c[1].y, c[2].y)) - locator->low_y;
    return (struct cells){clamp_cell(from_x / locator->cell, locator->columns),
                          clamp_cell(to_x / locator->cell, locator->columns),
                          clamp_cell(from_y / locator->cell, locator->rows),
                          clamp_cell(to_y / locator->cell, locator->rows)};
}

// Counts each cell's triangles into `counts`, or lays them down at `places`, which move on.
static void visit_cells(struct locator *locator, uint32_t *counts, uint32_t *places) {
    for (uint32_t t = 0; t < locator->surface->triangle_bound; t++) {
        if (!snapshot_has(locator->surface, t))
            continue;
        struct cells cells = cells_of(locator, t);
        for (uint32_t y = cells.from_y; y <= cells.to_y; y++)
            for (uint32_t x = cells.from_x; x <= cells.to_x; x++) {
                size_t cell = (size_t)y * locator->columns + x;
                if (counts)
                    counts[cell]++;
                else
                    locator->triangles[places[cell]++] = t;
            }
    }
}

static void frame_grid(struct locator *locator) {
    const struct snapshot *surface = locator->surface;
    double high_x = -INFINITY, high_y = -INFINITY;
    locator->low_x = locator->low_y = INFINITY;
    for (uint32_t v = 0; v < surface->vertex_bound; v++) {
        if (!surface->vertex_alive[v])
            continue;
        locator->low_x = fmin(locator->low_x, surface->vertices[v].x);
        locator->low_y = fmin(locator->low_y, surface->vertices[v].y);
        high_x = fmax(high_x, surface->vertices[v].x);
        high_y = fmax(high_y, surface->vertices[v].y);
    }
    double width = high_x - locator->low_x, depth = high_y - locator->low_y;
    locator->cell = fmax(sqrt(width * depth / (surface->triangle_count + 1.0)), 1e-6);
    locator->columns = (uint32_t)(width / locator->cell) + 1;
    locator->rows = (uint32_t)(depth / locator->cell) + 1;
}

struct locator *locator_create(const struct snapshot *surface) {
    struct locator *locator = alloc(1, sizeof *locator);
    locator->surface = surface;
    frame_grid(locator);
    size_t cells = (size_t)locator->columns * locator->rows;
    locator->starts = alloc(cells + 1, sizeof *locator->starts);
    uint32_t *places = alloc(cells, sizeof *places);
    visit_cells(locator, places, NULL);
    for (size_t i = 0; i < cells; i++) {
        locator->starts[i + 1] = locator->starts[i] + places[i];
        places[i] = locator->starts[i];
    }
    locator->triangles = alloc(locator->starts[cells], sizeof *locator->triangles);
    visit_cells(locator, NULL, places);
    free(places);
    return locator;
}

void locator_destroy(struct locator **locator) {
    free((*locator)->starts);
    free((*locator)->triangles);
    free(*locator);
    *locator = NULL;
}

// On which side of a to b p lies, seen along z. Both triangles at an edge get the same answer, as
// it is always asked from the lower id to the higher.
static bool lies_left(const struct snapshot *surface, uint32_t a, uint32_t b, vec3 p) {
    vec3 from = surface->vertices[a < b ? a : b], to = surface->vertices[a < b ? b : a];
    double side = (to.x - from.x) * (p.y - from.y) - (to.y - from.y) * (p.x - from.x);
    return (side >= 0) == (a < b);
}

// 1 where a line from p upwards leaves the surface through the triangle, -1 where it enters.
static int crossing(const struct snapshot *surface, uint32_t triangle, vec3 p) {
    const uint32_t *v = surface->triangles + 3 * (size_t)triangle;
    bool left = lies_left(surface, v[0], v[1], p);
    if (lies_left(surface, v[1], v[2], p) != left || lies_left(surface, v[2], v[0], p) != left)
        return 0;
    vec3 c[3];
    snapshot_corners(surface, triangle, c);
    vec3 normal = vec3_cross(vec3_sub(c[1], c[0]), vec3_sub(c[2], c[0]));
    double above = vec3_dot(normal, vec3_sub(c[0], p)); // the height of the crossing times normal.z
    return left ? above > 0 : -(above < 0);
}

bool locator_inside(const struct locator *locator, vec3 p) {
    double x = (p.x - locator->low_x) / locator->cell, y = (p.y - locator->low_y) / locator->cell;
    if (!(x >= 0 && y >= 0 && x < locator->columns && y < locator->rows))
        return false;
    size_t cell = (size_t)y * locator->columns + (size_t)x;
    int winding = 0;
    for (uint32_t i = locator->starts[cell]; i < locator->starts[cell + 1]; i++)
        winding += crossing(locator->surface, locator->triangles[i], p);
    return winding > 0;
}

// ---- the winding number -------------------------------------------------------------------------

bool winding_inside(const struct snapshot *surface, vec3 p) {
    double sum = 0;
    for (uint32_t t = 0; t < surface->triangle_bound; t++) {
        if (!snapshot_has(surface, t))
            continue;
        vec3 c[3];
        snapshot_corners(surface, t, c);
        sum += solid_angle(vec3_sub(c[0], p), vec3_sub(c[1], p), vec3_sub(c[2], p));
    }
    return sum > 6.283185307179586;
}

// ---- random points ------------------------------------------------------------------------------

static double outside_by(const struct convex *part, vec3 p) {
    double farthest = -INFINITY;
    for (int i = 0; i < part->plane_count; i++)
        farthest = fmax(farthest, vec3_dot(part->planes[i].normal, p) - part->planes[i].offset);
    return farthest;
}

bool parts_contain(const struct convex *parts, int count, vec3 p) {
    for (int i = 0; i < count; i++)
        if (outside_by(&parts[i], p) <= 0)
            return true;
    return false;
}

struct box parts_box(const struct convex *parts, int count) {
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int i = 0; i < count; i++)
        for (int k = 0; k < parts[i].vertex_count; k++) {
            vec3 p = parts[i].vertices[k];
            box.min = (vec3){fmin(box.min.x, p.x), fmin(box.min.y, p.y), fmin(box.min.z, p.z)};
            box.max = (vec3){fmax(box.max.x, p.x), fmax(box.max.y, p.y), fmax(box.max.z, p.z)};
        }
    return box;
}

vec3 point_in_box(struct random *random, struct box box) {
    double x = random_between(random, box.min.x, box.max.x);
    double y = random_between(random, box.min.y, box.max.y);
    return (vec3){x, y, random_between(random, box.min.z, box.max.z)};
}

struct estimate estimate_common(const struct locator *locator, const struct convex *parts,
                                int count, int points, struct random *random) {
    struct box box = parts_box(parts, count);
    vec3 size = vec3_sub(box.max, box.min);
    int hits = 0;
    for (int i = 0; i < points; i++) {
        vec3 p = point_in_box(random, box);
        hits += parts_contain(parts, count, p) && locator_inside(locator, p);
    }
    double share = (double)hits / points, whole = size.x * size.y * size.z;
    // As if one more point had hit and one more missed: no sigma is 0.
    double spread = (hits + 1.0) * (points - hits + 1.0) / ((points + 2.0) * (points + 2.0));
    return (struct estimate){whole * share, whole * sqrt(spread / points)};
}

double snapshot_distance(const struct snapshot *surface, vec3 p) {
    double nearest = INFINITY;
    for (uint32_t t = 0; t < surface->triangle_bound; t++) {
        if (!snapshot_has(surface, t))
            continue;
        vec3 c[3];
        snapshot_corners(surface, t, c);
        nearest = fmin(nearest, brute_triangle(p, c));
    }
    return nearest;
}

double parts_clearance(const struct convex *parts, int count, vec3 p) {
    double nearest = INFINITY;
    for (int i = 0; i < count; i++)
        nearest = fmin(nearest, fabs(outside_by(&parts[i], p)));
    return nearest;
}
