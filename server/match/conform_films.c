// Films: T where another side of it lies close behind.
#include "match/conform_parts.h"
#include "match/room.h"

#include <stdlib.h>
#include <string.h>

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

// Visits all that points of it may be film with, and that may be film with it.
static void visit_across(struct conform *c, const struct soup_triangle *of,
                         void (*visit)(void *context, uint32_t index)) {
    const vec3 *p = of->corners;
    vec3 by = {FILM_MM, FILM_MM, FILM_MM};
    struct box box = {{lower(p[0].x, lower(p[1].x, p[2].x)), lower(p[0].y, lower(p[1].y, p[2].y)),
                       lower(p[0].z, lower(p[1].z, p[2].z))},
                      {higher(p[0].x, higher(p[1].x, p[2].x)),
                       higher(p[0].y, higher(p[1].y, p[2].y)),
                       higher(p[0].z, higher(p[1].z, p[2].z))}};
    box = (struct box){vec3_sub(box.min, by), vec3_add(box.max, by)};
    soup_near_facing(&c->whole_target, box, vec3_scale(-1, of->normal), AGAINST, visit, c);
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

static void look_for_films(struct conform *c, uint32_t index) {
    const struct soup_triangle t = c->whole_target.at[index];
    c->across_count = 0;
    visit_across(c, &t, note_across);
    drop_beside(c, index);
    if (!c->across_count)
        soup_add(&c->target, t.corners, t.id, t.mark);
    else
        add_without_films(c, t.corners, &t, 2);
}

// ---- what the last call knows -------------------------------------------------------------------

// A triangle of T with the same corners is film where it was, as long as all is the same that it
// may be film with. Same triangles are looked for in the order of both, so that which of two counts
// stays the same.

void films_before_fini(struct films_before *films) {
    void *const arrays[] = {films->whole, films->target, films->parts,
                            films->stays, films->same,   films->table};
    for (size_t i = 0; i < sizeof arrays / sizeof arrays[0]; i++)
        free(arrays[i]);
}

#define SWAP(a, b)                                                                                 \
    do {                                                                                           \
        __typeof__(a) kept_ = (a);                                                                 \
        (a) = (b);                                                                                 \
        (b) = kept_;                                                                               \
    } while (0)

void conform_keep_films(struct conform *c) {
    struct films_before *f = &c->films;
    f->whole_count = c->whole_target.count;
    SWAP(f->whole, c->whole_target.at);
    SWAP(f->whole_room, c->whole_target.room);
    SWAP(f->target, c->target.at);
    SWAP(f->target_room, c->target.room);
    SWAP(f->parts, c->parts);
    SWAP(f->part_room, c->part_room);
}

static uint32_t place_in_table(const vec3 corners[3], uint32_t mask) {
    uint64_t bits[5], sum = 0;
    memcpy(bits, corners, sizeof bits);
    for (int i = 0; i < 5; i++)
        sum = (sum ^ bits[i]) * UINT64_C(0x9e3779b97f4a7c15);
    return (uint32_t)(sum >> 32) & mask;
}

static uint32_t make_table(struct films_before *f) {
    uint32_t size = 64;
    while (size < 2 * f->whole_count)
        size *= 2;
    room_for(&f->table, &f->table_room, size);
    memset(f->table, 0xff, size * sizeof *f->table);
    for (uint32_t i = 0; i < f->whole_count; i++) {
        uint32_t at = place_in_table(f->whole[i].corners, size - 1);
        while (f->table[at] != MESH_NONE)
            at = (at + 1) & (size - 1);
        f->table[at] = i;
    }
    return size - 1;
}

// Its index before, from one on, or MESH_NONE.
static uint32_t find_before(const struct films_before *f, const vec3 corners[3], uint32_t from,
                            uint32_t mask) {
    for (uint32_t at = place_in_table(corners, mask); f->table[at] != MESH_NONE;
         at = (at + 1) & mask) {
        uint32_t i = f->table[at];
        if (i >= from && !memcmp(f->whole[i].corners, corners, sizeof f->whole[i].corners))
            return i;
    }
    return MESH_NONE;
}

static void find_same(struct conform *c) {
    struct films_before *f = &c->films;
    uint32_t mask = make_table(f), from = 0;
    room_for(&f->stays, &f->stays_room, f->whole_count);
    room_for(&f->same, &f->same_room, c->whole_target.count);
    if (f->whole_count)
        memset(f->stays, 0, f->whole_count * sizeof *f->stays);
    for (uint32_t i = 0; i < c->whole_target.count; i++) {
        f->same[i] = find_before(f, c->whole_target.at[i].corners, from, mask);
        if (f->same[i] == MESH_NONE)
            continue;
        f->stays[f->same[i]] = true;
        from = f->same[i] + 1;
    }
}

static void forget(void *context, uint32_t index) {
    ((struct conform *)context)->films.same[index] = MESH_NONE;
}

// Beside what is new and what is gone nothing is known.
static void forget_beside_changes(struct conform *c) {
    struct films_before *f = &c->films;
    uint32_t news = 0;
    room_for(&c->across, &c->across_room, c->whole_target.count);
    for (uint32_t i = 0; i < c->whole_target.count; i++)
        if (f->same[i] == MESH_NONE)
            c->across[news++] = i;
    for (uint32_t i = 0; i < news; i++)
        visit_across(c, &c->whole_target.at[c->across[i]], forget);
    for (uint32_t i = 0; i < f->whole_count; i++)
        if (!f->stays[i])
            visit_across(c, &f->whole[i], forget);
}

static void add_as_before(struct conform *c, uint32_t index) {
    const struct films_before *f = &c->films;
    const struct soup_triangle *t = &c->whole_target.at[index];
    uint32_t before = f->same[index];
    for (uint32_t i = f->parts[before]; i < f->parts[before + 1]; i++)
        soup_add(&c->target, f->target[i].corners, t->id, t->mark);
}

void conform_leave_out_films(struct conform *c) {
    soup_clear(&c->target);
    find_same(c);
    forget_beside_changes(c);
    room_for(&c->parts, &c->part_room, c->whole_target.count + 1);
    for (uint32_t i = 0; i < c->whole_target.count; i++) {
        c->parts[i] = c->target.count;
        if (c->films.same[i] == MESH_NONE)
            look_for_films(c, i);
        else
            add_as_before(c, i);
    }
    c->parts[c->whole_target.count] = c->target.count;
    soup_build(&c->target);
}
