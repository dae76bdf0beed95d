#include "generate/shape.h"

// The trochlea is a pulley about an axis parallel to the flexion axis.
static const double trochlea_y = 15, trochlea_z = 8;
static const double condyle_half_width = 13;

static double square(double x) {
    return x * x;
}

// 0 below `low`, 1 above `high`, smooth between.
double shape_ramp(double low, double high, double x) {
    double t = fmin(fmax((x - low) / (high - low), 0), 1);
    return t * t * (3 - 2 * t);
}

// About the distance to an ellipse (or ellipsoid) whose scaled coordinates have length q.
static double from_ellipse(double q, double smallest_half_axis) {
    return (q - 1) * smallest_half_axis;
}

static double ellipsoid(vec3 p, vec3 centre, vec3 half) {
    vec3 d = vec3_sub(p, centre);
    double q = sqrt(square(d.x / half.x) + square(d.y / half.y) + square(d.z / half.z));
    return from_ellipse(q, fmin(half.x, fmin(half.y, half.z)));
}

static double sphere(vec3 p, vec3 centre, double radius) {
    return vec3_distance(p, centre) - radius;
}

static double capsule(vec3 p, vec3 a, vec3 b, double radius) {
    vec3 ab = vec3_sub(b, a);
    double t = fmin(fmax(vec3_dot(vec3_sub(p, a), ab) / vec3_dot(ab, ab), 0), 1);
    return vec3_distance(p, vec3_lerp(a, b, t)) - radius;
}

// A barrel round the flexion axis: an arc of radius 20 in the frontal plane, two flat sides.
static double condyle(vec3 p, double ridge_x) {
    const double arc = 20;
    double dx = p.x - ridge_x;
    double barrel = hypot(dx, hypot(p.y, p.z) - (SHAPE_CONDYLE_RADIUS - arc)) - arc;
    return smooth_max(barrel, fabs(dx) - condyle_half_width, 5);
}

static double femur_condyles(vec3 p) {
    double near_x = copysign(SHAPE_CONDYLE_X, p.x), near = condyle(p, near_x);
    bool is_far = fabs(p.x + near_x) - condyle_half_width >= near; // the other one's flat side
    return is_far ? near : fmin(near, condyle(p, -near_x));
}

static double ring(double x, double radial, double ring_x, double outer, double thickness) {
    return hypot(x - ring_x, radial - (outer - thickness)) - thickness;
}

static double trochlea(vec3 p) {
    double radial = hypot(p.y - trochlea_y, p.z - trochlea_z);
    double lateral = ring(p.x, radial, 17, 24.5, 12), medial = ring(p.x, radial, -16, 22.5, 12);
    double groove = smooth_max(radial - 18, fabs(p.x) - 20, 4);
    return smooth_min(smooth_min(lateral, medial, 4), groove, 8);
}

static double shaft_ends(vec3 p) {
    return fmax(8 - p.z, p.z - 72);
}

static double femur_shaft(vec3 p) {
    double flare = shape_ramp(62, 10, p.z);
    double half_x = 14 + 19 * flare, half_y = 13 + 2 * flare;
    double q = hypot(p.x / half_x, (p.y - 16) / half_y);
    return smooth_max(from_ellipse(q, half_y), shaft_ends(p), 8);
}

static double femur_epicondyles(vec3 p) {
    return fmin(sphere(p, (vec3){30, 2, 4}, 9), sphere(p, (vec3){-31, 2, 4}, 9));
}

double shape_femur(vec3 p) {
    const double blend = 8;
    double condyles = smooth_min(femur_condyles(p), femur_epicondyles(p), 6);
    double end = smooth_min(condyles, trochlea(p), blend);
    bool shaft_is_far = shaft_ends(p) >= end + blend;
    return shaft_is_far ? end : smooth_min(end, femur_shaft(p), blend);
}

// Medially a shallow dish, laterally a slight hill from front to back, two spines between.
static double plateau_height(double x, double y) {
    double medial = (square(x + SHAPE_CONDYLE_X) + square(y)) / 500;
    double lateral = square(x - SHAPE_CONDYLE_X) / 200 - square(y) / 140;
    double side = shape_ramp(-8, 8, x);
    double spines = 0;
    for (int i = -1; i <= 1; i += 2)
        spines += 7 * square(fmax(1 - square((x - 4.5 * i) / 6.5) - square((y + 2) / 13), 0));
    double level = -SHAPE_CONDYLE_RADIUS - SHAPE_CONTACT_GAP;
    return level + (1 - side) * medial + side * lateral + spines;
}

// Sections of the tibia are ovals, wide at the plateau and narrow at the shaft.
static double tibia_side(vec3 p) {
    double flare = shape_ramp(-72, -31, p.z);
    double half_x = 13 + 25.5 * flare, half_y = 13 + 11 * flare;
    double q = pow(pow(fabs(p.x) / half_x, 2.5) + pow(fabs(p.y + 1) / half_y, 2.5), 0.4);
    return from_ellipse(q, half_y);
}

static double fibula(vec3 p) {
    double head = sphere(p, (vec3){33, -16, -43}, 8);
    return smooth_min(head, capsule(p, (vec3){34, -18, -45}, (vec3){34, -20, -80}, 5.5), 6);
}

double shape_tibia(vec3 p) {
    double top = 0.9 * (p.z - plateau_height(p.x, p.y));
    double body = smooth_max(top, tibia_side(p), 4);
    body = smooth_max(body, -90 - p.z, 6);
    body = smooth_min(body, ellipsoid(p, (vec3){3, 17, -48}, (vec3){8, 10, 12}), 8);
    body = smooth_min(body, fibula(p), 3);
    double notch = capsule(p, (vec3){0, -31, -10}, (vec3){0, -31, -36}, 9);
    return smooth_max(body, -notch, 5);
}

// In the rest pose the patella lies 25 degrees up the trochlea; its back is a keel of two facets.
static const vec3 patella_radial = {0, 0.90630778703664994, 0.42261826174069944};
static const double patella_distance = 32; // of its centre from the trochlea's axis

double shape_patella(vec3 p) {
    vec3 d = vec3_sub(p, (vec3){0, trochlea_y, trochlea_z});
    double out = vec3_dot(d, patella_radial) - patella_distance;
    double up = d.z * patella_radial.y - d.y * patella_radial.z;
    double body = ellipsoid((vec3){p.x, out, up}, (vec3){0}, (vec3){22, 11.5, 20});
    double facets = 0.94 * (-8 - out + 0.3 * sqrt(square(p.x) + 9));
    return smooth_max(body, facets, 4);
}

double shape_skin(vec3 p) {
    double q = hypot(p.x / 52, (p.y - 3) / 52);
    double sleeve = smooth_max(from_ellipse(q, 52), fabs(p.z + 8) - 95, 30);
    vec3 patella = vec3_add_scaled((vec3){0, trochlea_y, trochlea_z}, 32, patella_radial);
    return smooth_min(sleeve, ellipsoid(p, patella, (vec3){28, 18, 26}), 14);
}

static struct box box_of(double x, double y_min, double y_max, double z_min, double z_max) {
    return (struct box){{-x, y_min, z_min}, {x, y_max, z_max}};
}

struct box shape_femur_box(void) {
    return box_of(50, -32, 50, -34, 82);
}

struct box shape_tibia_box(void) {
    return box_of(50, -40, 42, -100, -4);
}

struct box shape_patella_box(void) {
    return box_of(32, 8, 72, -10, 66);
}

struct box shape_skin_box(void) {
    return box_of(68, -65, 80, -120, 104);
}

static pose patella_at(double flexion_deg, double outward) {
    quat turn = quat_from_axis_angle((vec3){1, 0, 0}, -0.5 * flexion_deg * RAD_PER_DEG);
    vec3 axis = {0, trochlea_y, trochlea_z};
    vec3 shifted = vec3_add_scaled(vec3_scale(-1, axis), outward, patella_radial);
    return (pose){turn, vec3_add(axis, quat_rotate(turn, shifted))};
}

// Begins with the vertex `hint`, which becomes the one that does not clear it.
static bool patella_is_clear(const struct mesh *patella, pose T_femur_patella, double gap,
                             uint32_t *hint) {
    for (uint32_t i = 0; i < patella->vertex_count; i++) {
        uint32_t v = (*hint + i) % patella->vertex_count;
        if (shape_femur(pose_apply(T_femur_patella, mesh_vertex(patella, v))) < gap) {
            *hint = v;
            return false;
        }
    }
    return true;
}

pose shape_patella_pose(const struct mesh *patella, double flexion_deg, double gap) {
    double inside = -12, outside = 12;
    uint32_t hint = 0;
    for (int i = 0; i < 20; i++) {
        double middle = (inside + outside) / 2;
        bool clear = patella_is_clear(patella, patella_at(flexion_deg, middle), gap, &hint);
        *(clear ? &outside : &inside) = middle;
    }
    return patella_at(flexion_deg, outside);
}

_Static_assert(SHAPE_FLEXION_MAX % 10 == 0, "the femur is turned by 10 degrees at a time");

bool shape_femur_sweeps(vec3 p_tibia, double gap) {
    const double cosine = 0.98480775301220806, sine = 0.17364817766693035; // of 10 degrees
    vec3 p = p_tibia;
    for (int flexion = 0;; flexion += 10) {
        if (shape_femur(p) <= gap)
            return true;
        if (flexion == SHAPE_FLEXION_MAX)
            return false;
        p = (vec3){p.x, cosine * p.y + sine * p.z, cosine * p.z - sine * p.y};
    }
}

double shape_plateau(double x, double y) {
    double low = -45, high = -10;
    for (int i = 0; i < 40; i++) {
        double middle = (low + high) / 2;
        *(shape_tibia((vec3){x, y, middle}) < 0 ? &low : &high) = middle;
    }
    return (low + high) / 2;
}
