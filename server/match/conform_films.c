// Films: T where another side of it lies close behind.
#include "match/conform_parts.h"
#include "match/room.h"

#define FILM_MM 0.15
#define AGAINST 0.3   // −N·N' of the two sides, at least
#define SLACK_MM 1e-6 // more than heights are rounded

// 0.8 of one corner and 0.1 of the others, and the middle.
static vec3 point_in(const vec3 c[3], int which) {
    double w[3];
    for (int i = 0; i < 3; i++)
        w[i] = which == 3 ? 1.0 / 3 : which == i ? 0.8 : 0.1;
    vec3 p = vec3_scale(w[0], c[0]);
    return vec3_add_scaled(vec3_add_scaled(p, w[1], c[1]), w[2], c[2]);
}

static bool is_film_at(struct conform *c, vec3 p, vec3 normal) {
    struct soup_search search = {p, vec3_scale(-1, normal), AGAINST, FILM_MM, MESH_NONE};
    struct soup_closest closest;
    return soup_closest_among(&c->whole_target, &search, c->across, c->across_count, &closest) &&
           vec3_dot(normal, vec3_sub(closest.point, p)) <= 0;
}

static void note_across(void *context, uint32_t index) {
    struct conform *c = context;
    room_for(&c->across, &c->across_room, c->across_count + 1);
    c->across[c->across_count++] = index;
}

// Whether all corners of one triangle are farther from another's plane than what may be a film, to
// one side of it.
static bool is_beside(const struct soup_plane *plane, const vec3 corners[3]) {
    bool above = true, below = true;
    for (int i = 0; i < 3; i++) {
        double height = vec3_dot(plane->normal, corners[i]) - plane->offset;
        above &= height > FILM_MM + SLACK_MM;
        below &= height < -FILM_MM - SLACK_MM;
    }
    return above || below;
}

// What is so near that a point of each may be film with the other.
static void drop_beside(struct conform *c, uint32_t of) {
    const struct soup *soup = &c->whole_target;
    uint32_t left = 0;
    for (uint32_t i = 0; i < c->across_count; i++) {
        uint32_t t = c->across[i];
        if (!is_beside(&soup->planes[of], soup->at[t].corners) &&
            !is_beside(&soup->planes[t], soup->at[of].corners))
            c->across[left++] = t;
    }
    c->across_count = left;
}

// All that points of it may be film with.
static void find_across(struct conform *c, const struct soup_triangle *of) {
    const vec3 *p = of->corners;
    vec3 by = {FILM_MM, FILM_MM, FILM_MM};
    struct box box = {{lower(p[0].x, lower(p[1].x, p[2].x)), lower(p[0].y, lower(p[1].y, p[2].y)),
                       lower(p[0].z, lower(p[1].z, p[2].z))},
                      {higher(p[0].x, higher(p[1].x, p[2].x)),
                       higher(p[0].y, higher(p[1].y, p[2].y)),
                       higher(p[0].z, higher(p[1].z, p[2].z))}};
    box = (struct box){vec3_sub(box.min, by), vec3_add(box.max, by)};
    c->across_count = 0;
    soup_near_facing(&c->whole_target, box, vec3_scale(-1, of->normal), AGAINST, note_across, c);
}

// Of four points those that are film. Counting ends where it is known to be 2 or more or not, or,
// of a triangle that may be split, where some are film and some are not.
static int film_points(struct conform *c, const vec3 corners[3], vec3 normal, int splits) {
    int count = 0;
    bool known = false;
    for (int i = 0; i < 4 && !known; i++) {
        count += is_film_at(c, point_in(corners, i), normal);
        known = splits ? count > 0 && count <= i : count == 2 || count + 3 - i < 2;
    }
    return count;
}

// A triangle that is film in part is split in four, twice; then the majority counts.
static void add_without_films(struct conform *c, const vec3 corners[3],
                              const struct soup_triangle *of, int splits) {
    int films = film_points(c, corners, of->normal, splits);
    if (films == 4 || (films >= 2 && !splits))
        return;
    if (films == 0 || !splits) {
        soup_add(&c->target, corners, of->id, of->mark);
        return;
    }
    vec3 m[3];
    for (int i = 0; i < 3; i++)
        m[i] = vec3_lerp(corners[i], corners[(i + 1) % 3], 0.5);
    for (int i = 0; i < 3; i++) {
        vec3 corner[3] = {corners[i], m[i], m[(i + 2) % 3]};
        add_without_films(c, corner, of, splits - 1);
    }
    add_without_films(c, m, of, splits - 1);
}

void conform_leave_out_films(struct conform *c) {
    soup_clear(&c->target);
    for (uint32_t i = 0; i < c->whole_target.count; i++) {
        const struct soup_triangle t = c->whole_target.at[i];
        find_across(c, &t);
        drop_beside(c, i);
        if (!c->across_count)
            soup_add(&c->target, t.corners, t.id, t.mark);
        else
            add_without_films(c, t.corners, &t, 2);
    }
    soup_build(&c->target);
}
