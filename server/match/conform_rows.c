// What pulls at S'': rows weight · (n · Σ share_i step_i + rest)² over the corners of a triangle.
#include "match/conform_parts.h"
#include "match/room.h"

#include <math.h>
#include <string.h>

#define LEAST_FACING -0.3
#define ANY_FACING -2.0
#define SEARCH_MM 8.0
#define KEPT_MM 0.03 // the triangle that was found is kept until its point has moved so far
#define AREA_MIN 0.02
#define SAMPLE_MM2 0.09
#define SAMPLES_MAX 64 // of one triangle of T
#define BESIDE_MM 1.0

// ---- a row --------------------------------------------------------------------------------------

struct row {
    uint32_t live;
    double shares[3];
    vec3 normal;
    double rest, weight;
};

static void add_row(struct conform *c, const struct row *row) {
    static const int one[6] = {0, 0, 0, 1, 1, 2}, other[6] = {0, 1, 2, 1, 2, 2};
    const uint32_t *v = c->surface->triangles + 3 * (size_t)c->live[row->live];
    double trust = lower(c->trust[v[0]], lower(c->trust[v[1]], c->trust[v[2]]));
    struct triangle_rows *rows = &c->rows[row->live];
    struct sym3 square = sym3_outer(row->normal);
    double weight = trust * row->weight;
    for (int i = 0; i < 6; i++)
        sym3_add(&rows->pairs[i], weight * row->shares[one[i]] * row->shares[other[i]], square);
    for (int i = 0; i < 3; i++)
        rows->gradient[i] =
            vec3_add_scaled(rows->gradient[i], weight * row->shares[i] * row->rest, row->normal);
}

// ---- from S'' to T ------------------------------------------------------------------------------

static void pull_shares(int which, double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = which == 3 ? 1.0 / 3 : which == i ? 0.8 : 0.1;
}

static vec3 mix(const double shares[3], const vec3 v[3]) {
    vec3 sum = vec3_scale(shares[0], v[0]);
    return vec3_add_scaled(vec3_add_scaled(sum, shares[1], v[1]), shares[2], v[2]);
}

static bool find_target(struct conform *c, struct pull *pull, uint32_t hint, vec3 p, vec3 normal,
                        struct soup_closest *out) {
    if (pull->target != MESH_NONE && vec3_distance(p, pull->found_at) < KEPT_MM) {
        soup_closest_on(&c->target, pull->target, p, out);
        return true;
    }
    struct soup_search search = {p, normal, ANY_FACING, SEARCH_MM, hint};
    bool found = soup_closest(&c->target, &search, out) &&
                 vec3_dot(normal, c->target.at[out->index].normal) >= LEAST_FACING;
    *pull = (struct pull){found ? out->index : MESH_NONE, p};
    return found;
}

// Towards a face the distance along its normal counts, beside an edge the way to it.
static void aim(struct row *row, const struct soup_closest *closest, vec3 normal, vec3 apart) {
    row->normal = closest->on_face || closest->distance < 1e-6
                      ? normal
                      : vec3_scale(1 / closest->distance, apart);
    row->rest = vec3_dot(row->normal, apart);
}

static void pull_triangle(struct conform *c, uint32_t live, int pulls) {
    const uint32_t *v = c->surface->triangles + 3 * (size_t)c->live[live];
    vec3 corners[3], normals[3];
    conform_corners(c, c->live[live], corners);
    for (int i = 0; i < 3; i++)
        normals[i] = c->normals[v[i]];
    double area = 0.5 * vec3_length(soup_area2(corners));
    uint32_t hint = MESH_NONE;
    for (int i = PULLS_PER_TRIANGLE - pulls; i < PULLS_PER_TRIANGLE; i++) {
        struct row row = {.live = live, .weight = higher(area, AREA_MIN) / pulls};
        struct soup_closest closest;
        pull_shares(i, row.shares);
        vec3 p = mix(row.shares, corners);
        vec3 normal = vec3_unit_or(mix(row.shares, normals), (vec3){0});
        struct pull *pull = &c->pulls[PULLS_PER_TRIANGLE * live + (uint32_t)i];
        if (pull->target != MESH_NONE)
            hint = pull->target;
        if (!find_target(c, pull, hint, p, normal, &closest))
            continue;
        hint = closest.index;
        aim(&row, &closest, c->target.at[closest.index].normal, vec3_sub(p, closest.point));
        add_row(c, &row);
    }
}

// ---- from T to S'' ------------------------------------------------------------------------------

// As splitmix64: the same samples for the same triangle.
static double hashed(uint64_t seed) {
    uint64_t z = (seed + 1) * UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static void sample_triangle(struct conform *c, uint32_t index, struct box beside) {
    const struct soup_triangle *t = &c->target.at[index];
    vec3 ab = vec3_sub(t->corners[1], t->corners[0]), ac = vec3_sub(t->corners[2], t->corners[0]);
    double area = 0.5 * vec3_length(vec3_cross(ab, ac));
    uint64_t seed = (uint64_t)index << 16;
    int count = (int)(lower(area / SAMPLE_MM2, SAMPLES_MAX) + hashed(seed));
    for (int i = 0; i < count; i++) {
        double u = hashed(seed + 2 * (uint64_t)i + 1), v = hashed(seed + 2 * (uint64_t)i + 2);
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        vec3 p = vec3_add_scaled(vec3_add_scaled(t->corners[0], u, ab), v, ac);
        bool in = p.x >= beside.min.x && p.x <= beside.max.x && p.y >= beside.min.y &&
                  p.y <= beside.max.y && p.z >= beside.min.z && p.z <= beside.max.z;
        if (!in && !t->mark)
            continue;
        room_for(&c->samples, &c->sample_room, c->sample_count + 1);
        c->samples[c->sample_count++] = (struct sample){
            .point = p,
            .normal = t->normal,
            .area = higher(SAMPLE_MM2, area / SAMPLES_MAX),
            .source = MESH_NONE,
            .fresh = t->mark,
        };
    }
}

void conform_take_samples(struct conform *c) {
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t i = 0; i < c->active_count; i++) {
        vec3 p = c->positions[c->active[i]];
        box.min = (vec3){lower(box.min.x, p.x), lower(box.min.y, p.y), lower(box.min.z, p.z)};
        box.max = (vec3){higher(box.max.x, p.x), higher(box.max.y, p.y), higher(box.max.z, p.z)};
    }
    vec3 by = {BESIDE_MM, BESIDE_MM, BESIDE_MM};
    box = (struct box){vec3_sub(box.min, by), vec3_add(box.max, by)};
    c->sample_count = 0;
    for (uint32_t i = 0; i < c->target.count; i++)
        sample_triangle(c, i, box);
    for (uint32_t i = 0; i < PULLS_PER_TRIANGLE * c->live_count; i++)
        c->pulls[i].target = MESH_NONE;
}

static bool find_source(struct conform *c, struct sample *s, uint32_t hint,
                        struct soup_closest *out) {
    struct soup_search search = {s->point, s->normal, ANY_FACING, SEARCH_MM, hint};
    if (!soup_closest(&c->self, &search, out) ||
        vec3_dot(s->normal, c->self.at[out->index].normal) < LEAST_FACING)
        return false;
    s->source = out->index;
    s->found_at = out->point;
    return true;
}

static bool keep_source(struct conform *c, struct sample *s, struct soup_closest *out) {
    if (s->source >= c->self.count)
        return false;
    soup_closest_on(&c->self, s->source, s->point, out);
    return vec3_distance(out->point, s->found_at) < KEPT_MM;
}

static void pull_sample(struct conform *c, struct sample *s, uint32_t *hint) {
    struct soup_closest closest;
    if (s->source != MESH_NONE)
        *hint = s->source;
    if (s->out || (!keep_source(c, s, &closest) && !find_source(c, s, *hint, &closest)))
        return;
    *hint = closest.index;
    const struct soup_triangle *t = &c->self.at[closest.index];
    if (!t->mark) {
        s->out = !s->fresh;
        return;
    }
    struct row row = {.live = c->live_of[t->id], .weight = s->area};
    memcpy(row.shares, closest.weights, sizeof row.shares);
    aim(&row, &closest, t->normal, vec3_sub(closest.point, s->point));
    add_row(c, &row);
}

void conform_find_rows(struct conform *c, const struct conform_pass *pass) {
    memset(c->rows, 0, c->live_count * sizeof *c->rows);
    conform_make_self(c);
    for (uint32_t i = 0; i < c->live_count; i++)
        pull_triangle(c, i, pass->pulls);
    uint32_t hint = MESH_NONE;
    for (uint32_t i = 0; i < c->sample_count; i++)
        pull_sample(c, &c->samples[i], &hint);
    conform_find_contacts(c);
    conform_clear_system(c);
    conform_add_rows(c);
    conform_add_smoothing(c, pass->stiffness);
}
