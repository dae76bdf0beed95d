#include "case/arc.h"

#include "base/check.h"
#include "mesh/columns.h"

#include <stdlib.h>
#include <string.h>

#define TURN (2 * 3.14159265358979323846)
#define RAYS 360
#define SAMPLES 256

static const double lattice_step = 0.2, ray_step = 0.05, beside_mm = 3;
static const double widest = 200;        // mm: of a meniscus, whatever its scan
static const double least_width = 0.5;   // of tissue on a ray that meets the C
static const double smoothing_deg = 2.5; // of the margins

struct arc {
    pose T_mesh_joint;
    vec3 middle;  // in plan
    double start; // angle of the anterior end
    double angle; // to the posterior end: negative where that way is clockwise
    double outer[SAMPLES + 1], inner[SAMPLES + 1]; // margins: radii over along
    double x, y;                                   // of the lattice
    int nx, ny;
    double *lower, *upper; // heights of its columns, NAN far from the mesh
};

// ---- the middle ---------------------------------------------------------------------------------

// The circle with the least Σ w (|p − c|² − r²)² (Kåsa 1976): of triangles' middles, each with its
// area in plan.
static vec3 fit_middle(const struct mesh *mesh, const vec3 *points) {
    vec3 about = points[0];
    double w = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0, q = 0, qx = 0, qy = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *c = mesh->triangles + 3 * (size_t)t;
        vec3 a = vec3_sub(points[c[0]], about), ab = vec3_sub(points[c[1]], points[c[0]]),
             ac = vec3_sub(points[c[2]], points[c[0]]);
        double area = fabs(ab.x * ac.y - ab.y * ac.x);
        double px = a.x + (ab.x + ac.x) / 3, py = a.y + (ab.y + ac.y) / 3, pq = px * px + py * py;
        w += area, x += area * px, y += area * py;
        xx += area * px * px, xy += area * px * py, yy += area * py * py;
        q += area * pq, qx += area * px * pq, qy += area * py * pq;
    }
    mat3 normal = {{{xx, xy, x}, {xy, yy, y}, {x, y, w}}};
    mat3 first = {{{qx, xy, x}, {qy, yy, y}, {q, y, w}}};
    mat3 second = {{{xx, qx, x}, {xy, qy, y}, {x, q, w}}};
    double size = mat3_determinant(normal);
    if (size == 0)
        return about;
    return (vec3){about.x + mat3_determinant(first) / size / 2,
                  about.y + mat3_determinant(second) / size / 2, 0};
}

// ---- heights ------------------------------------------------------------------------------------

// Columns beside the mesh get the mean of their neighbours, ring by ring.
static void spread(const struct arc *arc, double *values) {
    size_t count = (size_t)arc->nx * (size_t)arc->ny;
    double *next = alloc(count, sizeof *next);
    for (int ring = 0; ring < beside_mm / lattice_step; ring++) {
        memcpy(next, values, count * sizeof *next);
        for (int j = 0; j < arc->ny; j++)
            for (int i = 0; i < arc->nx; i++) {
                size_t c = (size_t)j * (size_t)arc->nx + (size_t)i;
                double sum = 0;
                int known = 0;
                for (int n = 0; isnan(values[c]) && n < 9; n++) {
                    int x = i + n % 3 - 1, y = j + n / 3 - 1;
                    if (x < 0 || y < 0 || x >= arc->nx || y >= arc->ny)
                        continue;
                    double value = values[(size_t)y * (size_t)arc->nx + (size_t)x];
                    if (!isnan(value)) {
                        sum += value;
                        known++;
                    }
                }
                if (known)
                    next[c] = sum / known;
            }
        memcpy(values, next, count * sizeof *next);
    }
    free(next);
}

static void take_heights(struct arc *arc, const struct columns *columns) {
    size_t count = (size_t)columns->nx * (size_t)columns->ny;
    arc->x = columns->x;
    arc->y = columns->y;
    arc->nx = columns->nx;
    arc->ny = columns->ny;
    arc->lower = alloc(count, sizeof *arc->lower);
    arc->upper = alloc(count, sizeof *arc->upper);
    for (size_t c = 0; c < count; c++) {
        bool empty = columns->first[c] == columns->first[c + 1];
        arc->lower[c] = empty ? NAN : columns->heights[columns->first[c]];
        arc->upper[c] = empty ? NAN : columns->heights[columns->first[c + 1] - 1];
    }
}

// ---- margins ------------------------------------------------------------------------------------

// The margins on a ray from the middle; false where it misses the C.
static bool cast(const struct arc *arc, double angle, double *out_inner, double *out_outer) {
    double reach = hypot(arc->nx, arc->ny) * lattice_step, tissue = 0;
    *out_inner = INFINITY;
    for (double r = 0; r < reach; r += ray_step) {
        int i = (int)lround((arc->middle.x + r * cos(angle) - arc->x) / lattice_step);
        int j = (int)lround((arc->middle.y + r * sin(angle) - arc->y) / lattice_step);
        if (i < 0 || j < 0 || i >= arc->nx || j >= arc->ny ||
            isnan(arc->lower[(size_t)j * (size_t)arc->nx + (size_t)i]))
            continue;
        tissue += ray_step;
        *out_inner = fmin(*out_inner, r);
        *out_outer = r;
    }
    return tissue > least_width;
}

struct rays {
    bool met[RAYS];
    double inner[RAYS], outer[RAYS];
};

// The longest run of rays that miss; *out_start is the one after it.
static int find_gap(const struct rays *rays, int *out_start) {
    int longest = 0, run = 0;
    for (int i = 0; i < 2 * RAYS; i++) {
        run = rays->met[i % RAYS] ? 0 : run + 1;
        if (run > longest && run <= RAYS) {
            longest = run;
            *out_start = (i + 1) % RAYS;
        }
    }
    return longest;
}

// A margin at a share of the way along, smooth: rays weighted by their distance.
static double smooth_margin(const double *radii, int start, int met, double along) {
    double at = along * (met - 1), width = smoothing_deg * RAYS / 360, sum = 0, weights = 0;
    for (int i = 0; i < met; i++) {
        double weight = exp(-(i - at) * (i - at) / (2 * width * width));
        sum += weight * radii[(start + i) % RAYS];
        weights += weight;
    }
    return sum / weights;
}

static enum result find_margins(struct arc *arc, struct error *err) {
    struct rays rays;
    int start = 0;
    for (int i = 0; i < RAYS; i++)
        rays.met[i] = cast(arc, i * TURN / RAYS, &rays.inner[i], &rays.outer[i]);
    int met = RAYS - find_gap(&rays, &start);
    if (met == RAYS || met < RAYS / 4)
        return fail(err, RESULT_INVALID, "not a C in plan: %d of 360 degrees about its middle",
                    met);
    for (int i = 0; i < met; i++)
        if (!rays.met[(start + i) % RAYS] || rays.inner[(start + i) % RAYS] < 1)
            return fail(err, RESULT_INVALID, "not a C in plan: it has a second gap, or a middle");
    for (int i = 0; i <= SAMPLES; i++) {
        arc->inner[i] = smooth_margin(rays.inner, start, met, (double)i / SAMPLES);
        arc->outer[i] = smooth_margin(rays.outer, start, met, (double)i / SAMPLES);
    }
    arc->start = start * TURN / RAYS;
    arc->angle = (met - 1) * TURN / RAYS;
    return RESULT_OK;
}

// The end with the larger y is the anterior one.
static void begin_anterior(struct arc *arc) {
    double end = arc->start + arc->angle;
    if (sin(arc->start) >= sin(end))
        return;
    arc->start = end;
    arc->angle = -arc->angle;
    for (int i = 0; i < SAMPLES - i; i++) {
        double inner = arc->inner[i], outer = arc->outer[i];
        arc->inner[i] = arc->inner[SAMPLES - i];
        arc->outer[i] = arc->outer[SAMPLES - i];
        arc->inner[SAMPLES - i] = inner;
        arc->outer[SAMPLES - i] = outer;
    }
}

static enum result check_size(const vec3 *points, uint32_t count, struct error *err) {
    vec3 low = points[0], high = points[0];
    for (uint32_t v = 1; v < count; v++) {
        low = (vec3){fmin(low.x, points[v].x), fmin(low.y, points[v].y), 0};
        high = (vec3){fmax(high.x, points[v].x), fmax(high.y, points[v].y), 0};
    }
    double size = fmax(high.x - low.x, high.y - low.y);
    if (size <= widest)
        return RESULT_OK;
    return fail(err, RESULT_INVALID, "%.3g mm wide, where a meniscus has at most %g mm", size,
                widest);
}

// ---- making -------------------------------------------------------------------------------------

enum result arc_create(const struct mesh *mesh, pose T_mesh_joint, struct arc **out_arc,
                       struct error *err) {
    struct arc *arc = alloc(1, sizeof *arc);
    vec3 *points = alloc(mesh->vertex_count, sizeof *points);
    struct columns columns;
    arc->T_mesh_joint = T_mesh_joint;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        points[v] = pose_apply_inverse(T_mesh_joint, mesh_vertex(mesh, v));
    enum result result = check_size(points, mesh->vertex_count, err);
    if (result == RESULT_OK) {
        arc->middle = fit_middle(mesh, points);
        columns_init(&columns, mesh, points, lattice_step);
        take_heights(arc, &columns);
        columns_fini(&columns);
        result = find_margins(arc, err);
    }
    if (result == RESULT_OK) {
        begin_anterior(arc);
        spread(arc, arc->lower);
        spread(arc, arc->upper);
    }
    free(points);
    if (result != RESULT_OK)
        arc_destroy(&arc);
    *out_arc = arc;
    return result;
}

void arc_destroy(struct arc **arc) {
    if (!*arc)
        return;
    free((*arc)->lower);
    free((*arc)->upper);
    free(*arc);
    *arc = NULL;
}

// ---- asking -------------------------------------------------------------------------------------

static double margin_at(const double *margin, double along) {
    double at = fmin(fmax(along, 0), 1) * SAMPLES;
    int i = (int)fmin(at, SAMPLES - 1);
    return margin[i] + (at - i) * (margin[i + 1] - margin[i]);
}

double arc_radius(const struct arc *arc, double along) {
    return margin_at(arc->outer, along);
}

double arc_width(const struct arc *arc, double along) {
    return margin_at(arc->outer, along) - margin_at(arc->inner, along);
}

double arc_angle(const struct arc *arc) {
    return fabs(arc->angle);
}

static vec3 direction_at(const struct arc *arc, double along) {
    double angle = arc->start + along * arc->angle;
    return (vec3){cos(angle), sin(angle), 0};
}

vec3 arc_outward(const struct arc *arc, double along) {
    return quat_rotate(arc->T_mesh_joint.rotation, direction_at(arc, along));
}

vec3 arc_up(const struct arc *arc) {
    return quat_rotate(arc->T_mesh_joint.rotation, (vec3){0, 0, 1});
}

// Past an end as far as half of the gap.
struct arc_place arc_place(const struct arc *arc, vec3 p) {
    vec3 q = pose_apply_inverse(arc->T_mesh_joint, p);
    double x = q.x - arc->middle.x, y = q.y - arc->middle.y;
    double half = arc->angle / 2, from_half = atan2(y, x) - arc->start - half;
    from_half = remainder(from_half, TURN);
    double along = 0.5 + from_half / arc->angle;
    return (struct arc_place){along, arc_radius(arc, along) - hypot(x, y), q.z};
}

static vec3 plan_point(const struct arc *arc, double along, double inward) {
    return vec3_add_scaled(arc->middle, arc_radius(arc, along) - inward, direction_at(arc, along));
}

vec3 arc_point(const struct arc *arc, struct arc_place place) {
    vec3 q = plan_point(arc, place.along, place.inward);
    q.z = place.height;
    return pose_apply(arc->T_mesh_joint, q);
}

// Between the four columns around; those without a height do not count.
static double height_at(const struct arc *arc, const double *values, double x, double y) {
    double u = fmin(fmax((x - arc->x) / lattice_step, 0), arc->nx - 1);
    double v = fmin(fmax((y - arc->y) / lattice_step, 0), arc->ny - 1);
    int i = (int)fmin(u, arc->nx - 2), j = (int)fmin(v, arc->ny - 2);
    double sum = 0, weights = 0;
    for (int n = 0; n < 4; n++) {
        int dx = n % 2, dy = n / 2;
        double value = values[(size_t)(j + dy) * (size_t)arc->nx + (size_t)(i + dx)];
        double weight = (dx ? u - i : i + 1 - u) * (dy ? v - j : j + 1 - v);
        if (!isnan(value)) {
            sum += weight * value;
            weights += weight;
        }
    }
    return weights > 0 ? sum / weights : NAN;
}

void arc_heights(const struct arc *arc, double along, double inward, double *out_lower,
                 double *out_upper) {
    vec3 q = plan_point(arc, along, inward);
    *out_lower = height_at(arc, arc->lower, q.x, q.y);
    *out_upper = height_at(arc, arc->upper, q.x, q.y);
}
