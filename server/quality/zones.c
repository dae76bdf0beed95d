#include "quality/zones.h"

#include "base/check.h"

#define TURN 6.283185307179586
#define RAY (TURN / ZONE_RAYS)
#define SMOOTHED 6 // rays to either side: a margin is the mean over 6.5 degrees

static void set_axes(struct plan_view *view, vec3 up, vec3 anterior) {
    vec3 forward = vec3_add_scaled(anterior, -vec3_dot(anterior, up), up);
    CHECK(vec3_length(forward) > 1e-3);
    forward = vec3_unit_or(forward, anterior);
    vec3 side = vec3_cross(up, forward);
    view->axes =
        (mat3){{{forward.x, forward.y, forward.z}, {side.x, side.y, side.z}, {up.x, up.y, up.z}}};
}

// ---- the centre ---------------------------------------------------------------------------------

// Means over the triangles, weighted by their area in plan: of the length r of their middles, of
// the direction u = (x, y) / r, and of products.
struct plan_means {
    double weight, r, z, ux, uy, uxx, uxy, uyy, rux, ruy;
};

static void add_to_means(struct plan_means *m, const vec3 c[3]) {
    double area =
        fabs((c[1].x - c[0].x) * (c[2].y - c[0].y) - (c[2].x - c[0].x) * (c[1].y - c[0].y));
    double x = (c[0].x + c[1].x + c[2].x) / 3, y = (c[0].y + c[1].y + c[2].y) / 3;
    double r = fmax(hypot(x, y), 1e-9), ux = x / r, uy = y / r;
    double total = m->weight + area, share = area > 0 ? area / total : 0;
    m->weight = total;
    m->r += share * (r - m->r);
    m->z += share * ((c[0].z + c[1].z + c[2].z) / 3 - m->z);
    m->ux += share * (ux - m->ux);
    m->uy += share * (uy - m->uy);
    m->uxx += share * (ux * ux - m->uxx);
    m->uxy += share * (ux * uy - m->uxy);
    m->uyy += share * (uy * uy - m->uyy);
    m->rux += share * (r * ux - m->rux);
    m->ruy += share * (r * uy - m->ruy);
}

// One Gauss-Newton step towards the circle with the least Σ area (r − R)²: r is regressed on u, for
// moving the centre by d takes u·d from r.
static double step_to_centre(struct plan_view *view, const struct mesh *mesh) {
    struct plan_means m = {0};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 c[3];
        view_corners(view, mesh, t, c);
        add_to_means(&m, c);
    }
    CHECK(m.weight > 0);
    double xx = m.uxx - m.ux * m.ux, xy = m.uxy - m.ux * m.uy, yy = m.uyy - m.uy * m.uy;
    double rx = m.rux - m.r * m.ux, ry = m.ruy - m.r * m.uy;
    double determinant = fmax(xx * yy - xy * xy, 1e-9);
    vec3 d = {(rx * yy - ry * xy) / determinant, (ry * xx - rx * xy) / determinant, m.z};
    view->origin = vec3_add(view->origin, mat3_apply_transposed(view->axes, d));
    return vec3_length(d);
}

static void find_centre(struct plan_view *view, const struct mesh *mesh) {
    struct box box = mesh_bounds(mesh);
    view->origin = vec3_lerp(box.min, box.max, 0.5);
    for (int i = 0; i < 50 && step_to_centre(view, mesh) > 1e-6; i++)
        ;
}

// ---- the margins --------------------------------------------------------------------------------

static int ray_index(int ray) {
    return ((ray % ZONE_RAYS) + ZONE_RAYS) % ZONE_RAYS;
}

// Where the rays between the ends of an edge meet it.
static void add_edge(struct zones *zones, vec3 a, vec3 b) {
    double angle = atan2(a.y, a.x);
    double turn = atan2(a.x * b.y - a.y * b.x, a.x * b.x + a.y * b.y);
    double low = fmin(angle, angle + turn) / RAY, high = fmax(angle, angle + turn) / RAY;
    for (int ray = (int)ceil(low); ray <= high; ray++) {
        double x = cos(ray * RAY), y = sin(ray * RAY);
        double off_a = x * a.y - y * a.x, off_b = x * b.y - y * b.x;
        double t = off_a == off_b ? 0.5 : fmin(fmax(off_a / (off_a - off_b), 0), 1);
        double r = x * (a.x + t * (b.x - a.x)) + y * (a.y + t * (b.y - a.y));
        int i = ray_index(ray);
        zones->inner[i] = fmin(zones->inner[i], r);
        zones->outer[i] = fmax(zones->outer[i], r);
    }
}

static void find_margins(struct zones *zones, const struct mesh *mesh) {
    for (int i = 0; i < ZONE_RAYS; i++) {
        zones->inner[i] = INFINITY;
        zones->outer[i] = 0;
    }
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 c[3];
        view_corners(&zones->view, mesh, t, c);
        for (int i = 0; i < 3; i++)
            add_edge(zones, c[i], c[(i + 1) % 3]);
    }
}

// ---- the arc ------------------------------------------------------------------------------------

// The longest run of rays that meet nothing: the first after it and how many the others are. A disc
// has no such run: it is taken to begin and end where it is narrowest.
static int find_gap(const struct zones *zones, int *out_covered) {
    int first = 0, longest = 0, run = 0, narrowest = 0;
    for (int i = 0; i < 2 * ZONE_RAYS; i++) {
        run = zones->outer[i % ZONE_RAYS] > 0 ? 0 : run + 1;
        if (run > longest) {
            longest = run;
            first = i + 1;
        }
        if (zones->outer[i % ZONE_RAYS] < zones->outer[narrowest])
            narrowest = i % ZONE_RAYS;
    }
    *out_covered = ZONE_RAYS - longest;
    return longest ? first : narrowest;
}

// Within the arc; beyond its ends a margin goes on as it ends.
static void smooth_margin(double *radii, int first, int covered) {
    double raw[ZONE_RAYS];
    for (int i = 0; i < covered; i++)
        raw[i] = radii[ray_index(first + i)];
    for (int i = 0; i < ZONE_RAYS; i++) {
        int to_first = ZONE_RAYS - i, past_last = i - covered + 1;
        int middle = i < covered ? i : past_last < to_first ? covered - 1 : 0;
        int reach = middle < covered - 1 - middle ? middle : covered - 1 - middle;
        double sum = 0;
        reach = reach < SMOOTHED ? reach : SMOOTHED;
        for (int k = middle - reach; k <= middle + reach; k++)
            sum += raw[k];
        radii[ray_index(first + i)] = sum / (2 * reach + 1);
    }
}

static void find_arc(struct zones *zones) {
    int covered, first = find_gap(zones, &covered);
    CHECK(covered > 0);
    smooth_margin(zones->inner, first, covered);
    smooth_margin(zones->outer, first, covered);
    int sixth = covered / 6;
    int begin = ray_index(first + sixth), end = ray_index(first + covered - 1 - sixth);
    bool forward = zones->outer[begin] * cos(begin * RAY) > zones->outer[end] * cos(end * RAY);
    double arc = fmax(covered - 1, 1) * RAY;
    zones->start = forward ? first * RAY : first * RAY + arc;
    zones->arc = forward ? arc : -arc;
}

void zones_of(const struct mesh *mesh, vec3 up, vec3 anterior, struct zones *out_zones) {
    set_axes(&out_zones->view, up, anterior);
    find_centre(&out_zones->view, mesh);
    find_margins(out_zones, mesh);
    find_arc(out_zones);
}

// ---- places -------------------------------------------------------------------------------------

static double margin_at(const double *radii, double angle) {
    double ray = angle / RAY, below = floor(ray), t = ray - below;
    int i = ray_index((int)below);
    return (1 - t) * radii[i] + t * radii[i + 1 < ZONE_RAYS ? i + 1 : 0];
}

struct zone_place zones_place(const struct zones *zones, double x, double y) {
    double angle = atan2(y, x), middle = zones->start + zones->arc / 2;
    double from_middle = remainder(angle - middle, TURN);
    double inner = margin_at(zones->inner, angle), outer = margin_at(zones->outer, angle);
    return (struct zone_place){0.5 + from_middle / zones->arc,
                               (hypot(x, y) - inner) / fmax(outer - inner, 0.1)};
}

double zones_angle(const struct zones *zones, double along) {
    return zones->start + along * zones->arc;
}

double zones_rim(const struct zones *zones, double angle) {
    return margin_at(zones->outer, angle);
}

int zones_third(double share) {
    return share < 1.0 / 3 ? 0 : share < 2.0 / 3 ? 1 : 2;
}
