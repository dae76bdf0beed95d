#include "generate/tube.h"

#include "base/check.h"
#include "generate/shape.h"

#include <math.h>
#include <stdlib.h>

#define TURN (2 * 3.14159265358979323846)

// Points of a tube: `rings` closed rings of `sides` points, and a point that closes either end.
struct tube {
    uint32_t rings, sides;
    vec3 *points; // rings * sides, then the first and the last end
};

static struct tube tube_create(double length, double girth, double edge) {
    struct tube tube = {.rings = (uint32_t)ceil(length / edge), .sides = 2};
    tube.sides *= (uint32_t)ceil(girth / edge / 2);
    CHECK(tube.rings >= 3 && tube.sides >= 4);
    tube.points = alloc((size_t)tube.rings * tube.sides + 2, sizeof *tube.points);
    return tube;
}

static void add_triangle(struct mesh *mesh, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *t = mesh->triangles + 3 * (size_t)mesh->triangle_count++;
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

static void add_quad(struct mesh *mesh, const struct tube *tube, uint32_t a, uint32_t b, uint32_t c,
                     uint32_t d) {
    if (vec3_distance(tube->points[a], tube->points[c]) <=
        vec3_distance(tube->points[b], tube->points[d])) {
        add_triangle(mesh, a, b, c);
        add_triangle(mesh, a, c, d);
    } else {
        add_triangle(mesh, a, b, d);
        add_triangle(mesh, b, c, d);
    }
}

// The rings run clockwise seen from the end that they go to.
static void tube_mesh(const struct tube *tube, struct mesh *out_mesh) {
    uint32_t n = tube->sides, ends = tube->rings * n;
    mesh_init(out_mesh, ends + 2, 2 * ends);
    out_mesh->triangle_count = 0;
    for (uint32_t v = 0; v < ends + 2; v++)
        mesh_set_vertex(out_mesh, v, tube->points[v]);
    for (uint32_t i = 0; i < n; i++) {
        uint32_t j = (i + 1) % n, last = ends - n;
        add_triangle(out_mesh, ends, i, j);
        for (uint32_t r = 0; r < last; r += n)
            add_quad(out_mesh, tube, r + i, r + n + i, r + n + j, r + j);
        add_triangle(out_mesh, ends + 1, last + j, last + i);
    }
}

// How far along the tube ring r lies, and how much its section has shrunk there: as half a circle
// over the last `cap` of the length.
static double ring_at(const struct tube *tube, uint32_t r, double cap, double *out_scale) {
    double along = (r + 0.5) / tube->rings;
    double from_end = fmin(fmin(along, 1 - along) / cap, 1);
    *out_scale = sqrt(1 - (1 - from_end) * (1 - from_end));
    return along;
}

// Angles that part a section's outline into `sides` pieces of equal length.
static void even_angles(vec3 (*outline)(double angle, const void *shape), const void *shape,
                        uint32_t sides, double *out_angles) {
    enum { FINE = 1440 };
    double way[FINE + 1] = {0};
    for (int i = 0; i < FINE; i++)
        way[i + 1] = way[i] + vec3_distance(outline(TURN * i / FINE, shape),
                                            outline(TURN * (i + 1) / FINE, shape));
    int i = 0;
    for (uint32_t side = 0; side < sides; side++) {
        double wanted = way[FINE] * side / sides;
        while (way[i + 1] <= wanted)
            i++;
        out_angles[side] = TURN * (i + (wanted - way[i]) / (way[i + 1] - way[i])) / FINE;
    }
}

// ---- menisci ------------------------------------------------------------------------------------

// Angles about the middle of the compartment: 0 outward, 90 degrees anterior.
struct outline {
    double centre_x, centre_y, side;    // side: 1 lateral, -1 medial
    double half_x, half_y;              // of the outer margin, an ellipse
    double width_x, width_y;            // from outer to inner margin, outward and in front
    double anterior_deg, posterior_deg; // where the horns end
};

static const struct outline medial = {-21, -1, -1, 16, 20.5, 9.5, 12, 130, -140};
static const struct outline lateral = {21, -1, 1, 16, 20, 9, 11, 142, -146};

// Clear of the tibia below and of the femur above.
static const double meniscus_gap = 0.2, femur_gap = 0.35;

// across: 0 at the inner margin, 1 at the rim.
static vec3 outline_point(const struct outline *o, double along, double across) {
    double angle = (o->anterior_deg + along * (o->posterior_deg - o->anterior_deg)) * RAD_PER_DEG;
    double c = cos(angle), s = sin(angle);
    double width = (o->width_x * c * c + o->width_y * s * s) * (1 - 0.3 * pow(2 * along - 1, 4));
    double outer = hypot(o->half_x * c, o->half_y * s);
    double scale = 1 - (1 - across) * width / outer;
    double x = o->centre_x + o->side * scale * o->half_x * c;
    double y = o->centre_y + scale * o->half_y * s;
    return (vec3){x, y, shape_plateau(x, y) + meniscus_gap};
}

// How high above p there is nothing of the femur at any flexion.
static double room_above(vec3 p) {
    const double step = 0.5, enough = 13;
    double clear = 0;
    while (clear < enough && !shape_femur_sweeps((vec3){p.x, p.y, p.z + clear + step}, femur_gap))
        clear += step;
    double blocked = clear + step;
    for (int i = 0; i < 8 && clear < enough; i++) {
        double middle = (clear + blocked) / 2;
        bool swept = shape_femur_sweeps((vec3){p.x, p.y, p.z + middle}, femur_gap);
        *(swept ? &blocked : &clear) = middle;
    }
    return clear;
}

// A point of a section: its place on the plateau, how far out (0 to 1), how far up (0 to 1).
struct section_point {
    vec3 base;
    double room, across, up;
};

// A square with round corners from -1 to 1: a superellipse of exponent 5.
static vec3 rounded_square(double angle) {
    double c = cos(angle), s = sin(angle);
    return (vec3){copysign(pow(fabs(c), 0.4), c), copysign(pow(fabs(s), 0.4), s), 0};
}

// The outline of a usual section in mm, to space its points evenly.
static vec3 wedge_outline(double angle, const void *unused) {
    (void)unused;
    vec3 p = rounded_square(angle);
    return (vec3){5 * p.x, (2 + 1.2 * p.x) * p.y, 0};
}

static void section_points(const struct outline *o, const struct tube *tube,
                           struct section_point *out_points) {
    double *angles = alloc(tube->sides, sizeof *angles);
    even_angles(wedge_outline, NULL, tube->sides, angles);
    for (uint32_t r = 0; r < tube->rings; r++) {
        double scale, along = ring_at(tube, r, 0.06, &scale);
        for (uint32_t i = 0; i < tube->sides; i++) {
            vec3 square = rounded_square(-o->side * angles[i]);
            struct section_point *p = out_points + (size_t)r * tube->sides + i;
            p->across = 0.5 + 0.5 * scale * square.x;
            p->up = scale * (0.5 + 0.5 * square.y);
            p->base = outline_point(o, along, p->across);
            p->room = room_above(p->base);
        }
    }
    free(angles);
}

static vec3 lifted(const struct section_point *p, double rim_height) {
    const double inner_height = 0.9;
    double wedge = inner_height + (rim_height - inner_height) * p->across;
    double height = fmax(smooth_min(wedge, p->room, 1), 0.05);
    return vec3_add_scaled(p->base, p->up * height, (vec3){0, 0, 1});
}

static void raise_rim(struct tube *tube, const struct section_point *points, double rim_height,
                      struct mesh *out_mesh) {
    size_t count = (size_t)tube->rings * tube->sides;
    for (size_t i = 0; i < count; i++)
        tube->points[i] = lifted(&points[i], rim_height);
    tube_mesh(tube, out_mesh);
}

bool tube_meniscus(bool is_lateral, double volume, double edge, struct mesh *out_mesh) {
    const struct outline *o = is_lateral ? &lateral : &medial;
    struct tube tube = tube_create(85, 30, edge);
    size_t count = (size_t)tube.rings * tube.sides;
    struct section_point *points = alloc(count, sizeof *points);
    section_points(o, &tube, points);
    tube.points[count] = outline_point(o, 0, 0.5);
    tube.points[count + 1] = outline_point(o, 1, 0.5);
    double low = 2, high = 12;
    raise_rim(&tube, points, high, out_mesh);
    bool reached = mesh_volume(out_mesh) >= volume;
    for (int i = 0; i < 20; i++) {
        double middle = (low + high) / 2;
        mesh_fini(out_mesh);
        raise_rim(&tube, points, middle, out_mesh);
        *(mesh_volume(out_mesh) < volume ? &low : &high) = middle;
    }
    free(points);
    free(tube.points);
    return reached;
}

// ---- ligaments ----------------------------------------------------------------------------------

// They move with the tibia, so their femoral ends lie near the flexion axis.
const struct ligament ligaments[LIGAMENT_COUNT] = {
    {"acl", {{8, -7, 3}, {6, -3, -4}, {2, 3, -12}, {-1, 8, -22}}, {1, 0, 0}, 4.5, 3},
    {"pcl", {{-8, 3, -1}, {-6, -4, -4}, {-2, -15, -14}, {0, -23, -32}}, {1, 0, 0}, 5, 3.5},
    {"mcl", {{-42, 1, 4}, {-46, 1, -18}, {-40, 3, -40}, {-17, 8, -60}}, {1, 0, 0}, 6, 1.5},
    {"lcl", {{41, 0, 4}, {42, -4, -12}, {41, -12, -26}, {37, -17, -39}}, {1, 0, 0}, 3, 2},
};

static vec3 ligament_outline(double angle, const void *shape) {
    const struct ligament *l = shape;
    return (vec3){l->half_width * cos(angle), l->half_thickness * sin(angle), 0};
}

vec3 tube_curve(const vec3 *p, double t) {
    vec3 a = vec3_lerp(p[0], p[1], t), b = vec3_lerp(p[1], p[2], t), c = vec3_lerp(p[2], p[3], t);
    return vec3_lerp(vec3_lerp(a, b, t), vec3_lerp(b, c, t), t);
}

static vec3 curve_direction(const vec3 *p, double t) {
    vec3 ab = vec3_lerp(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[1]), t);
    vec3 bc = vec3_lerp(vec3_sub(p[2], p[1]), vec3_sub(p[3], p[2]), t);
    return vec3_unit_or(vec3_lerp(ab, bc, t), (vec3){0, 0, -1});
}

void tube_ligament(const struct ligament *l, double edge, struct mesh *out_mesh) {
    double length = vec3_distance(l->path[0], l->path[3]);
    struct tube tube = tube_create(length, 4 * (l->half_width + l->half_thickness / 2), edge);
    double *angles = alloc(tube.sides, sizeof *angles);
    even_angles(ligament_outline, l, tube.sides, angles);
    for (uint32_t r = 0; r < tube.rings; r++) {
        double scale, along = ring_at(&tube, r, l->half_width / length, &scale);
        vec3 centre = tube_curve(l->path, along), forward = curve_direction(l->path, along);
        vec3 wide = vec3_unit_or(vec3_cross(forward, l->flat), (vec3){0, 1, 0});
        vec3 thin = vec3_cross(wide, forward);
        for (uint32_t i = 0; i < tube.sides; i++) {
            vec3 section = ligament_outline(angles[i], l);
            vec3 p = vec3_add_scaled(centre, scale * section.x, wide);
            p = vec3_add_scaled(p, scale * section.y, thin);
            tube.points[(size_t)r * tube.sides + i] = p;
        }
    }
    size_t count = (size_t)tube.rings * tube.sides;
    tube.points[count] = l->path[0];
    tube.points[count + 1] = l->path[3];
    tube_mesh(&tube, out_mesh);
    free(angles);
    free(tube.points);
}
