// The shares of a triangle in the volumes by zone: of the prism between it and the plane of the
// view.
#include "quality/plan.h"

#define EDGE_MM 1.0 // in a triangle of shorter edges, places are linear: off by 0.02 mm at most
#define HALVINGS_MAX 14

struct zone_corner {
    vec3 p;
    double places[2]; // along, across
};

static struct zone_corner corner_at(const struct zones *zones, vec3 p) {
    struct zone_place place = zones_place(zones, p.x, p.y);
    return (struct zone_corner){p, {place.along, place.across}};
}

static double prism(vec3 a, vec3 b, vec3 c) {
    double twice_area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    return twice_area * (a.z + b.z + c.z) / 6;
}

static struct zone_corner between(const struct zone_corner *a, const struct zone_corner *b,
                                  double t) {
    struct zone_corner c = {vec3_lerp(a->p, b->p, t)};
    for (int i = 0; i < 2; i++)
        c.places[i] = (1 - t) * a->places[i] + t * b->places[i];
    return c;
}

// ---- cutting a triangle at the thirds -----------------------------------------------------------

#define CORNERS_MAX 7 // a triangle, cut four times

struct polygon {
    int count;
    struct zone_corner corners[CORNERS_MAX];
};

static void keep_corner(struct polygon *polygon, const struct zone_corner *corner) {
    if (polygon->count < CORNERS_MAX)
        polygon->corners[polygon->count++] = *corner;
}

// What lies beyond a level of a place: above it where sign is 1, below where it is -1.
static struct polygon beyond(const struct polygon *polygon, int place, double level, double sign) {
    struct polygon out = {0};
    for (int i = 0; i < polygon->count; i++) {
        const struct zone_corner *a = &polygon->corners[i];
        const struct zone_corner *b = &polygon->corners[(i + 1) % polygon->count];
        double to_a = a->places[place] - level, to_b = b->places[place] - level;
        bool a_in = sign * to_a >= 0, b_in = sign * to_b >= 0;
        if (a_in)
            keep_corner(&out, a);
        if (a_in != b_in) {
            struct zone_corner cut = between(a, b, to_a / (to_a - to_b));
            keep_corner(&out, &cut);
        }
    }
    return out;
}

static struct polygon third_of(const struct polygon *polygon, int place, int third) {
    struct polygon out = *polygon;
    if (third > 0)
        out = beyond(&out, place, third / 3.0, 1);
    if (third < 2)
        out = beyond(&out, place, (third + 1) / 3.0, -1);
    return out;
}

static double polygon_prism(const struct polygon *polygon) {
    double volume = 0;
    for (int i = 2; i < polygon->count; i++)
        volume += prism(polygon->corners[0].p, polygon->corners[i - 1].p, polygon->corners[i].p);
    return volume;
}

static void thirds_of(const struct zone_corner c[3], int place, int *out_first, int *out_last) {
    *out_first = *out_last = zones_third(c[0].places[place]);
    for (int i = 1; i < 3; i++) {
        int third = zones_third(c[i].places[place]);
        *out_first = third < *out_first ? third : *out_first;
        *out_last = third > *out_last ? third : *out_last;
    }
}

static void add_small(const struct zone_corner c[3], double times, struct zone_volumes *volumes) {
    int first[2], last[2];
    for (int place = 0; place < 2; place++)
        thirds_of(c, place, &first[place], &last[place]);
    if (first[0] == last[0] && first[1] == last[1]) {
        volumes->mm3[first[0]][first[1]] += times * prism(c[0].p, c[1].p, c[2].p);
        return;
    }
    struct polygon whole = {3, {c[0], c[1], c[2]}};
    for (int along = first[0]; along <= last[0]; along++) {
        struct polygon slice = third_of(&whole, 0, along);
        for (int across = first[1]; across <= last[1]; across++) {
            struct polygon piece = third_of(&slice, 1, across);
            volumes->mm3[along][across] += times * polygon_prism(&piece);
        }
    }
}

// ---- halving it first ---------------------------------------------------------------------------

static void add_halves(const struct zones *zones, const struct zone_corner c[3], double times,
                       int halvings, struct zone_volumes *volumes) {
    int longest = 0;
    double lengths[3];
    for (int i = 0; i < 3; i++) {
        vec3 side = vec3_sub(c[(i + 1) % 3].p, c[i].p);
        lengths[i] = side.x * side.x + side.y * side.y;
        longest = lengths[i] > lengths[longest] ? i : longest;
    }
    if (lengths[longest] <= EDGE_MM * EDGE_MM || halvings == 0) {
        add_small(c, times, volumes);
        return;
    }
    const struct zone_corner *a = &c[longest], *b = &c[(longest + 1) % 3],
                             *d = &c[(longest + 2) % 3];
    struct zone_corner middle = corner_at(zones, vec3_lerp(a->p, b->p, 0.5));
    add_halves(zones, (struct zone_corner[]){*a, middle, *d}, times, halvings - 1, volumes);
    add_halves(zones, (struct zone_corner[]){middle, *b, *d}, times, halvings - 1, volumes);
}

void quality_add_triangle(const struct quality_plan *plan, const vec3 corners[3], double times,
                          struct zone_volumes *volumes) {
    struct zone_corner c[3];
    for (int i = 0; i < 3; i++)
        c[i] = corner_at(&plan->zones, view_point(&plan->zones.view, corners[i]));
    add_halves(&plan->zones, c, times, HALVINGS_MAX, volumes);
}
