#include "check/field.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

#define STILL_MM 1e-6
#define FACING_COSINE (-0.5)
#define SLAB 8 // nodes of a block along each axis
#define REACH_STEPS 8
#define EASED_SHARES 16

// ---- what is displaced --------------------------------------------------------------------------

static vec3 corner_delta(const struct warp_scene *scene, int surface, uint32_t triangle,
                         int corner) {
    struct closest at = {.triangle = triangle, .weights = {corner == 0, corner == 1, corner == 2}};
    at.point = mesh_corner(scene->surfaces[surface].mesh, triangle, corner);
    return warp_of_contact(scene, surface, &at);
}

static bool is_moved(const struct warp_scene *scene, int surface, uint32_t triangle) {
    for (int i = 0; i < 3; i++)
        if (vec3_length(corner_delta(scene, surface, triangle, i)) > STILL_MM)
            return true;
    return false;
}

static uint32_t moved_of(const struct warp_scene *scene, const struct field *field, int surface,
                         bool *out_moved) {
    const struct warp_surface *s = &scene->surfaces[surface];
    uint32_t count = 0;
    if (!field_takes(field, s))
        return 0;
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++) {
        out_moved[t] = is_moved(scene, surface, t);
        count += out_moved[t];
    }
    if (!count || field->kind != FIELD_SMOOTH || !s->mean)
        return count;
    memset(out_moved, true, s->mesh->triangle_count);
    return s->mesh->triangle_count;
}

static void append(struct mesh *mesh, const struct mesh *from, pose T, const bool *wanted,
                   uint32_t count) {
    uint32_t next = mesh->triangle_count;
    mesh->triangle_count += count;
    mesh->vertex_count = 3 * mesh->triangle_count;
    mesh->positions =
        alloc_resize(mesh->positions, 3 * (size_t)mesh->vertex_count, sizeof *mesh->positions);
    mesh->triangles =
        alloc_resize(mesh->triangles, (size_t)mesh->vertex_count, sizeof *mesh->triangles);
    for (uint32_t t = 0; t < from->triangle_count; t++) {
        if (!wanted[t])
            continue;
        for (int i = 0; i < 3; i++) {
            uint32_t vertex = 3 * next + (uint32_t)i;
            mesh_set_vertex(mesh, vertex, pose_apply(T, mesh_corner(from, t, i)));
            mesh->triangles[vertex] = vertex;
        }
        next++;
    }
}

static struct box grown(struct box box, double by) {
    vec3 around = {by, by, by};
    return (struct box){vec3_sub(box.min, around), vec3_add(box.max, around)};
}

// How far it reaches depends on the place, and which places count on how far it reaches.
static double reach_of(const struct warp_scene *scene, const struct field *field,
                       const struct mesh *mesh) {
    double reach = 0;
    for (int i = 0; i < REACH_STEPS; i++)
        reach = field_reach(scene, field, grown(mesh_bounds(mesh), reach));
    return reach;
}

enum result moved_init(const struct warp_scene *scene, const struct field *field, struct moved *out,
                       struct error *err) {
    *out = (struct moved){0};
    for (int i = 0; i < scene->surface_count; i++) {
        const struct warp_surface *s = &scene->surfaces[i];
        bool *wanted = alloc(s->mesh->triangle_count, sizeof *wanted);
        uint32_t count = moved_of(scene, field, i, wanted);
        if (count)
            append(&out->mesh, s->mesh, scene->T_world_body[s->body], wanted, count);
        free(wanted);
    }
    if (!out->mesh.triangle_count)
        return RESULT_OK;
    out->reach_mm = reach_of(scene, field, &out->mesh);
    enum result result = query_create(&out->mesh, &out->query, err);
    if (result != RESULT_OK)
        moved_fini(out);
    return result;
}

void moved_fini(struct moved *moved) {
    query_destroy(&moved->query);
    mesh_fini(&moved->mesh);
}

struct box moved_box(const struct moved *moved) {
    return grown(mesh_bounds(&moved->mesh), moved->reach_mm);
}

// ---- one place ----------------------------------------------------------------------------------

bool field_gap(const struct warp_contact *a, const struct warp_contact *b, vec3 y, double *out_gap,
               double *out_left) {
    *out_gap = *out_left = 0;
    if (vec3_dot(a->normal, b->normal) > FACING_COSINE)
        return false;
    vec3 from = vec3_add_scaled(y, -a->distance, a->normal);
    vec3 across = vec3_sub(vec3_add_scaled(y, -b->distance, b->normal), from);
    vec3 way = vec3_unit_or(across, a->normal);
    *out_gap = vec3_length(across);
    *out_left = *out_gap + vec3_dot(way, vec3_sub(b->delta, a->delta));
    return true;
}

struct field_node {
    bool is_there; // reachable, no second surface too close
    vec3 displacement;
    double norm; // |∇W|
};

struct field_walk {
    const struct warp_scene *scene, *aimed; // aimed: NULL, or what the scene is eased into
    const struct field *field;
    const struct moved *moved;
    const struct space *space;
    struct field_figures *slabs;
};

// What a thread works with in one slab.
struct field_slab {
    const struct field_walk *walk;
    struct field_figures *figures;
    struct warp_memory memory;
    struct warp_contact contacts[WARP_SURFACES_MAX];
    int count; // of contacts
    struct field_node *planes[2];
    bool *is_near; // of each block across: something is displaced within reach
    int blocks[2];
};

static void find_two(const struct field_slab *slab, int out[2]) {
    out[0] = out[1] = -1;
    for (int i = 0; i < slab->count; i++) {
        if (out[0] < 0 || slab->contacts[i].distance < slab->contacts[out[0]].distance) {
            out[1] = out[0];
            out[0] = i;
        } else if (out[1] < 0 || slab->contacts[i].distance < slab->contacts[out[1]].distance) {
            out[1] = i;
        }
    }
}

static struct field_spot spot_of(const struct field_slab *slab, vec3 y, double value) {
    int two[2];
    find_two(slab, two);
    struct field_spot spot = {.value = value, .place = y, .nearest = {-1, -1}};
    for (int i = 0; i < 2; i++)
        spot.nearest[i] = two[i] < 0 ? -1 : slab->contacts[two[i]].surface;
    if (two[1] >= 0)
        field_gap(&slab->contacts[two[0]], &slab->contacts[two[1]], y, &spot.gap_mm, &spot.left_mm);
    return spot;
}

static bool is_filled(const struct field_spot *spot) {
    return spot->gap_mm > 0 && spot->left_mm <= (1 - FILLED_SHARE) * spot->gap_mm;
}

static void keep_lesser(struct field_spot *spot, bool had, const struct field_spot *other) {
    if (!had || other->value < spot->value)
        *spot = *other;
}

static void take_fold(struct field_slab *slab, vec3 y, double determinant) {
    struct field_figures *f = slab->figures;
    struct field_spot spot = spot_of(slab, y, determinant);
    if (spot.nearest[1] < 0)
        keep_lesser(&f->fading, f->faded++, &spot);
    else if (is_filled(&spot))
        keep_lesser(&f->filling, f->filled++, &spot);
    else
        keep_lesser(&f->fold, field_own_folds(f), &spot);
    f->folded++;
}

static double determinant_of(const struct warp *warp) {
    return mat3_determinant(mat3_add_scaled(mat3_identity(), 1, warp->gradient));
}

static void take_node(struct field_slab *slab, vec3 y, const struct warp *warp, double norm) {
    struct field_figures *f = slab->figures;
    double bin = norm / GAIN_BIN;
    f->gains[bin < GAIN_BINS - 1 ? (int)bin : GAIN_BINS - 1]++;
    if (!f->looked++ || norm > f->gain.value)
        f->gain = spot_of(slab, y, norm);
    double determinant = determinant_of(warp);
    if (determinant <= 0)
        take_fold(slab, y, determinant);
}

static struct warp blend(const struct warp *from, const struct warp *to, double share) {
    struct warp out = *from;
    out.displacement = vec3_lerp(from->displacement, to->displacement, share);
    out.gradient = mat3_add_scaled(out.gradient, -share, from->gradient);
    out.gradient = mat3_add_scaled(out.gradient, share, to->gradient);
    return out;
}

// W is linear in the displacements. Takes warp and contacts to the share of the way that folds
// most; false where it folds from the beginning.
static bool ease(struct field_slab *slab, vec3 y, struct warp *warp) {
    const struct field_walk *w = slab->walk;
    struct warp_contact contacts[WARP_SURFACES_MAX];
    struct warp from = *warp, to;
    if (determinant_of(warp) <= 0)
        return false;
    int count = warp_contacts(w->aimed, w->field, y, &slab->memory, &to, contacts);
    CHECK(count == slab->count);
    double least = INFINITY, at = 1;
    for (int i = 1; i <= EASED_SHARES; i++) {
        struct warp between = blend(&from, &to, (double)i / EASED_SHARES);
        if (determinant_of(&between) >= least)
            continue;
        *warp = between;
        least = determinant_of(&between);
        at = (double)i / EASED_SHARES;
    }
    for (int i = 0; i < count; i++)
        slab->contacts[i].delta = vec3_lerp(slab->contacts[i].delta, contacts[i].delta, at);
    return true;
}

static struct field_node look_at_node(struct field_slab *slab, vec3 y, bool counts) {
    const struct field_walk *w = slab->walk;
    struct warp warp;
    slab->count = warp_contacts(w->scene, w->field, y, &slab->memory, &warp, slab->contacts);
    int two[2];
    find_two(slab, two);
    if (two[1] >= 0 && slab->contacts[two[1]].distance < SECOND_GROUP_MM) {
        slab->figures->close += counts;
        return (struct field_node){0};
    }
    if (w->aimed && !ease(slab, y, &warp))
        return (struct field_node){0};
    struct field_node node = {true, warp.displacement, mat3_norm(warp.gradient)};
    bool matters = vec3_length(warp.displacement) > MATTERS || node.norm > MATTERS;
    if (counts && matters)
        take_node(slab, y, &warp, node.norm);
    else if (counts)
        slab->figures->still++;
    return node;
}

// ---- jumps --------------------------------------------------------------------------------------

static vec3 warp_at(struct field_slab *slab, vec3 y) {
    const struct field_walk *w = slab->walk;
    struct warp warp;
    slab->count = warp_contacts(w->scene, w->field, y, &slab->memory, &warp, slab->contacts);
    return warp.displacement;
}

// Halves the way from *a to *b, keeping the half over which W changes more.
static double change_within(struct field_slab *slab, vec3 *a, vec3 *b, vec3 at_a, vec3 at_b) {
    while (vec3_distance(*a, *b) > JUMP_WAY_MM) {
        vec3 middle = vec3_lerp(*a, *b, 0.5), at = warp_at(slab, middle);
        bool first = vec3_distance(at, at_a) >= vec3_distance(at_b, at);
        *(first ? b : a) = middle;
        *(first ? &at_b : &at_a) = at;
    }
    return vec3_distance(at_a, at_b);
}

// Of the surfaces within reach of both, the one whose Δ changes most; -1 where none does by half of
// the jump, which is then a steep place and nothing else.
static int jumping(struct field_slab *slab, vec3 a, vec3 b, double jump) {
    struct warp_contact before[WARP_SURFACES_MAX];
    warp_at(slab, a);
    int count = slab->count, found = -1;
    memcpy(before, slab->contacts, (size_t)count * sizeof *before);
    warp_at(slab, b);
    double most = 0.5 * jump;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < slab->count; k++) {
            double change = vec3_distance(before[i].delta, slab->contacts[k].delta);
            if (before[i].surface == slab->contacts[k].surface && change > most) {
                most = change;
                found = before[i].surface;
            }
        }
    return found;
}

static void compare(struct field_slab *slab, vec3 y, const struct field_node *node, vec3 other_y,
                    const struct field_node *other) {
    double spacing = slab->walk->space->spacing_mm;
    double change = vec3_distance(node->displacement, other->displacement);
    if (!other->is_there || change < 1.5 * spacing * fmax(node->norm, other->norm) + JUMP_MM)
        return;
    vec3 a = other_y, b = y;
    double jump = change_within(slab, &a, &b, other->displacement, node->displacement);
    int surface = jump > JUMP_MM ? jumping(slab, a, b, jump) : -1;
    struct field_figures *f = slab->figures;
    if (surface < 0 || (f->jumped++ && jump <= f->jump.value))
        return;
    f->jump = spot_of(slab, b, jump);
    if (surface != f->jump.nearest[0]) {
        f->jump.nearest[1] = f->jump.nearest[0];
        f->jump.nearest[0] = surface;
    }
}

// ---- slabs --------------------------------------------------------------------------------------

static void find_near(struct field_slab *slab, int k_first) {
    const struct space *s = slab->walk->space;
    double half = 0.5 * (SLAB - 1) * s->spacing_mm;
    vec3 middle = {half, half, half};
    double reach = slab->walk->moved->reach_mm + sqrt(3) * (half + s->spacing_mm);
    struct closest closest;
    for (int b = 0; b < slab->blocks[1]; b++)
        for (int a = 0; a < slab->blocks[0]; a++) {
            vec3 at = vec3_add(space_at(s, SLAB * a, SLAB * b, k_first), middle);
            slab->is_near[b * slab->blocks[0] + a] =
                query_closest(slab->walk->moved->query, at, reach, MESH_NONE, &closest);
        }
}

static void walk_plane(struct field_slab *slab, int k, bool counts) {
    const struct space *s = slab->walk->space;
    struct field_node *plane = slab->planes[k & 1];
    const struct field_node *below = slab->planes[(k + 1) & 1];
    double h = s->spacing_mm;
    for (int j = 0; j < s->size[1]; j++)
        for (int i = 0; i < s->size[0]; i++) {
            int n = i + s->size[0] * j;
            plane[n] = (struct field_node){0};
            if (s->places[space_node(s, i, j, k)] != PLACE_FREE)
                continue;
            vec3 y = space_at(s, i, j, k);
            if (!slab->is_near[j / SLAB * slab->blocks[0] + i / SLAB]) {
                plane[n].is_there = true;
                slab->figures->still += counts;
                continue;
            }
            plane[n] = look_at_node(slab, y, counts);
            if (!plane[n].is_there || !counts || slab->walk->aimed)
                continue;
            if (i > 0)
                compare(slab, y, &plane[n], (vec3){y.x - h, y.y, y.z}, &plane[n - 1]);
            if (j > 0)
                compare(slab, y, &plane[n], (vec3){y.x, y.y - h, y.z}, &plane[n - s->size[0]]);
            if (k > 0)
                compare(slab, y, &plane[n], (vec3){y.x, y.y, y.z - h}, &below[n]);
        }
}

// The plane below the slab is looked at once more, for its neighbours above.
static void walk_slab(void *context, int index) {
    const struct field_walk *walk = context;
    const struct space *s = walk->space;
    struct field_slab slab = {.walk = walk, .figures = &walk->slabs[index]};
    size_t across = (size_t)s->size[0] * (size_t)s->size[1];
    for (int i = 0; i < 2; i++) {
        slab.blocks[i] = (s->size[i] + SLAB - 1) / SLAB;
        slab.planes[i] = alloc(across, sizeof *slab.planes[i]);
    }
    slab.is_near = alloc((size_t)(slab.blocks[0] * slab.blocks[1]), sizeof *slab.is_near);
    warp_memory_init(&slab.memory);
    find_near(&slab, index * SLAB);
    if (index > 0 && !walk->aimed)
        walk_plane(&slab, index * SLAB - 1, false);
    for (int k = index * SLAB; k < (index + 1) * SLAB && k < s->size[2]; k++)
        walk_plane(&slab, k, true);
    for (int i = 0; i < 2; i++)
        free(slab.planes[i]);
    free(slab.is_near);
}

static void keep_larger(struct field_spot *spot, bool had, const struct field_spot *other) {
    if (!had || other->value > spot->value)
        *spot = *other;
}

void field_counts_add(struct field_figures *sum, const struct field_figures *figures) {
    sum->looked += figures->looked;
    sum->still += figures->still;
    sum->close += figures->close;
    sum->folded += figures->folded;
    sum->faded += figures->faded;
    sum->filled += figures->filled;
    sum->jumped += figures->jumped;
    for (int i = 0; i < GAIN_BINS; i++)
        sum->gains[i] += figures->gains[i];
}

static void add_figures(struct field_figures *f, const struct field_figures *g) {
    if (g->looked)
        keep_larger(&f->gain, f->looked, &g->gain);
    if (g->jumped)
        keep_larger(&f->jump, f->jumped, &g->jump);
    if (g->faded)
        keep_lesser(&f->fading, f->faded, &g->fading);
    if (g->filled)
        keep_lesser(&f->filling, f->filled, &g->filling);
    if (field_own_folds(g))
        keep_lesser(&f->fold, field_own_folds(f), &g->fold);
    field_counts_add(f, g);
}

void field_walk(const struct warp_scene *scene, const struct warp_scene *aimed,
                const struct field *field, const struct moved *moved, const struct space *space,
                const struct progress *progress, struct field_figures *figures) {
    CHECK(moved->query);
    int slabs = (space->size[2] + SLAB - 1) / SLAB;
    struct field_walk walk = {scene, aimed, field, moved, space, NULL};
    walk.slabs = alloc((size_t)slabs, sizeof *walk.slabs);
    parallel_for(slabs, walk_slab, &walk, progress);
    for (int i = 0; i < slabs; i++)
        add_figures(figures, &walk.slabs[i]);
    free(walk.slabs);
}

const struct field_spot *field_worst_fold(const struct field_figures *f) {
    const struct field_spot *worst = NULL;
    const struct field_spot *spots[] = {&f->fold, &f->filling, &f->fading};
    const uint64_t counts[] = {field_own_folds(f), f->filled, f->faded};
    for (int i = 0; i < 3; i++)
        if (counts[i] && (!worst || spots[i]->value < worst->value))
            worst = spots[i];
    return worst;
}

double field_gain_within(const struct field_figures *figures, double share) {
    double wanted = ceil(share * (double)figures->looked), seen = 0;
    for (int i = 0; i < GAIN_BINS && figures->looked; i++) {
        seen += (double)figures->gains[i];
        if (seen >= wanted && i < GAIN_BINS - 1)
            return fmin((i + 1) * GAIN_BIN, figures->gain.value);
    }
    return figures->looked ? figures->gain.value : 0;
}

// ---- touch --------------------------------------------------------------------------------------

static vec3 middle_of(const struct mesh *mesh, uint32_t triangle) {
    vec3 sum = vec3_add(mesh_corner(mesh, triangle, 0), mesh_corner(mesh, triangle, 1));
    return vec3_scale(1.0 / 3, vec3_add(sum, mesh_corner(mesh, triangle, 2)));
}

static bool is_clear(const struct warp_contact *contacts, int count, int surface) {
    for (int i = 0; i < count; i++)
        if (contacts[i].surface != surface && contacts[i].distance < SECOND_GROUP_MM)
            return false;
    return true;
}

static void touch_triangle(const struct warp_scene *scene, const struct field *field, int surface,
                           uint32_t triangle, struct warp_memory *memory,
                           struct touch_figures *figures) {
    const struct warp_surface *s = &scene->surfaces[surface];
    struct closest at = {.triangle = triangle, .weights = {1.0 / 3, 1.0 / 3, 1.0 / 3}};
    at.point = middle_of(s->mesh, triangle);
    vec3 y = pose_apply(scene->T_world_body[s->body], at.point);
    struct warp warp;
    struct warp_contact contacts[WARP_SURFACES_MAX];
    int count = warp_contacts(scene, field, y, memory, &warp, contacts);
    if (!is_clear(contacts, count, surface))
        return;
    vec3 wanted = vec3_scale(field->strength, warp_of_contact(scene, surface, &at));
    double off = vec3_distance(wanted, warp.displacement);
    if (!figures->count++ || off > figures->largest_mm) {
        figures->largest_mm = off;
        figures->surface = surface;
        figures->place = y;
    }
    figures->sum_mm += off;
}

void field_touch(const struct warp_scene *scene, const struct field *field,
                 struct touch_figures *figures) {
    struct warp_memory memory;
    warp_memory_init(&memory);
    for (int i = 0; i < scene->surface_count; i++)
        for (uint32_t t = 0; t < scene->surfaces[i].mesh->triangle_count; t++)
            if (field_takes(field, &scene->surfaces[i]) && is_moved(scene, i, t))
                touch_triangle(scene, field, i, t, &memory, figures);
}
