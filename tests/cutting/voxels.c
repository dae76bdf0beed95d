#include "cutting/voxels.h"

#include "base/check.h"
#include "cutting/bites.h"
#include "cutting/inside.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SIDE_MAX 16 // voxels of 0.5 mm

struct voxels {
    int side;
    bool filled[SIDE_MAX][SIDE_MAX][SIDE_MAX];
};

struct span {
    int low[3], high[3]; // in voxels; high is past the last
};

static bool is_filled(const struct voxels *v, int x, int y, int z) {
    return x >= 0 && y >= 0 && z >= 0 && x < v->side && y < v->side && z < v->side &&
           v->filled[x][y][z];
}

static vec3 centre_of(const struct voxels *v, int x, int y, int z) {
    return (vec3){(x + 0.5 - v->side / 2.0) / 2, (y + 0.5 - v->side / 2.0) / 2,
                  (z + 0.5 - v->side / 2.0) / 2};
}

// Calls for each voxel.
typedef void each(struct voxels *voxels, int x, int y, int z, void *context);

static void for_each(struct voxels *voxels, each *call, void *context) {
    for (int x = 0; x < voxels->side; x++)
        for (int y = 0; y < voxels->side; y++)
            for (int z = 0; z < voxels->side; z++)
                call(voxels, x, y, z, context);
}

struct count {
    int filled, faces; // faces between filled and empty
};

static void count_one(struct voxels *v, int x, int y, int z, void *context) {
    struct count *count = context;
    if (!is_filled(v, x, y, z))
        return;
    count->filled++;
    count->faces += !is_filled(v, x - 1, y, z) + !is_filled(v, x + 1, y, z) +
                    !is_filled(v, x, y - 1, z) + !is_filled(v, x, y + 1, z) +
                    !is_filled(v, x, y, z - 1) + !is_filled(v, x, y, z + 1);
}

static struct count count_all(struct voxels *voxels) {
    struct count count = {0};
    for_each(voxels, count_one, &count);
    return count;
}

static void empty_in_span(struct voxels *v, int x, int y, int z, void *context) {
    const struct span *s = context;
    if (x >= s->low[0] && x < s->high[0] && y >= s->low[1] && y < s->high[1] && z >= s->low[2] &&
        z < s->high[2])
        v->filled[x][y][z] = false;
}

static void empty_inside(struct voxels *v, int x, int y, int z, void *context) {
    if (locator_inside(context, centre_of(v, x, y, z)))
        v->filled[x][y][z] = false;
}

struct comparison {
    const struct locator *locator;
    int differing;
};

static void compare_one(struct voxels *v, int x, int y, int z, void *context) {
    struct comparison *c = context;
    c->differing += locator_inside(c->locator, centre_of(v, x, y, z)) != v->filled[x][y][z];
}

// ---- bites --------------------------------------------------------------------------------------

static void next_span(struct random *r, int side, struct span *s) {
    int axis = (int)(random_bits(r) % 3), width = s->high[axis] - s->low[axis];
    bool flush = random_bits(r) % 3 == 0, is_sheet = !flush && random_bits(r) % 6 == 0;
    for (int i = 0; i < 3 && !flush; i++) {
        s->low[i] = (int)(random_bits(r) % (unsigned)(side + 1)) - 1;
        s->high[i] = s->low[i] + 1 + (int)(random_bits(r) % (unsigned)(side / 2));
        if (is_sheet && i == axis)
            s->high[i] = s->low[i] + 1;
        else if (is_sheet) {
            s->low[i] = -1;
            s->high[i] = side + 1;
        }
    }
    if (flush) {
        int step = random_bits(r) % 2 ? width : -width;
        s->low[axis] += step;
        s->high[axis] += step;
    }
}

static void span_convex(const struct span *s, int side, struct convex *out) {
    double low[3], high[3];
    for (int i = 0; i < 3; i++) {
        low[i] = (s->low[i] - side / 2.0) / 2;
        high[i] = (s->high[i] - side / 2.0) / 2;
    }
    pose middle = {quat_identity(),
                   {(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2}};
    convex_box(middle,
               (vec3){(high[0] - low[0]) / 2, (high[1] - low[1]) / 2, (high[2] - low[2]) / 2}, out);
}

// ---- a sequence ---------------------------------------------------------------------------------

static double area_of(const struct snapshot *surface) {
    double area = 0;
    for (uint32_t t = 0; t < surface->triangle_bound; t++) {
        if (!snapshot_has(surface, t))
            continue;
        vec3 c[3];
        snapshot_corners(surface, t, c);
        area += vec3_length(vec3_cross(vec3_sub(c[1], c[0]), vec3_sub(c[2], c[0]))) / 2;
    }
    return area;
}

static void take_piece_out(struct voxels *voxels, const struct cut_piece *piece,
                           struct voxel_run *run) {
    struct snapshot surface;
    snapshot_of_mesh(&piece->mesh, &surface);
    struct locator *locator = locator_create(&surface);
    int before = count_all(voxels).filled;
    for_each(voxels, empty_inside, locator);
    double counted = (before - count_all(voxels).filled) / 8.0;
    run->volume_error = fmax(run->volume_error, fabs(counted - piece->volume));
    run->pieces++;
    locator_destroy(&locator);
    snapshot_fini(&surface);
}

static void hold_against(struct voxels *voxels, const struct trial *trial, struct voxel_run *run) {
    for (int i = 0; i < trial->change.piece_count; i++)
        take_piece_out(voxels, &trial->change.pieces[i], run);
    struct locator *locator = locator_create(&trial->now);
    struct comparison comparison = {locator, 0};
    for_each(voxels, compare_one, &comparison);
    locator_destroy(&locator);
    struct count count = count_all(voxels);
    double volume = snapshot_volume(&trial->now), area = area_of(&trial->now);
    run->volume_error = fmax(run->volume_error, fabs(volume - count.filled / 8.0));
    run->area_error = fmax(run->area_error, fabs(area - count.faces / 4.0));
    if (comparison.differing && !run->fault)
        run->fault = "a voxel's centre is on the wrong side";
}

static void one_bite(struct voxels *voxels, struct trial *trial, const struct span *span,
                     struct voxel_run *run) {
    struct convex box;
    int before = count_all(voxels).filled;
    for_each(voxels, empty_in_span, (void *)span);
    int left = count_all(voxels).filled;
    enum cut_outcome due = left == before ? CUT_NOTHING : left ? CUT_CHANGED : CUT_REFUSED;
    span_convex(span, voxels->side, &box);
    trial_cut(trial, &box, 1);
    run->retries += trial->change.retries;
    run->cuts += trial->outcome == CUT_CHANGED;
    run->fault = trial->fault;
    if (!run->fault && trial->outcome != due)
        run->fault = due == CUT_NOTHING   ? "a bite off nothing was one"
                     : due == CUT_CHANGED ? "a bite was none"
                                          : "a bite took all";
    if (!run->fault && left)
        hold_against(voxels, trial, run);
}

struct voxel_run voxel_sequence(uint64_t seed, int bites) {
    struct random random = {seed};
    struct voxels *voxels = alloc(1, sizeof *voxels);
    struct voxel_run run = {0};
    struct span span = {.high = {1, 1, 1}};
    struct trial trial;
    struct mesh cube;
    int size = 4 + 2 * (int)(random_bits(&random) % 3);
    voxels->side = 2 * size;
    memset(voxels->filled, true, sizeof voxels->filled);
    lattice_cube(&cube, size / 2.0, random_bits(&random) % 2 ? 1 : size);
    trial_init(&trial, &cube);
    for (int i = 0; i < bites && !run.fault && count_all(voxels).filled; i++) {
        next_span(&random, voxels->side, &span);
        one_bite(voxels, &trial, &span, &run);
    }
    trial_fini(&trial);
    mesh_fini(&cube);
    free(voxels);
    return run;
}

// ---- the cube -----------------------------------------------------------------------------------

struct lattice {
    struct mesh *mesh;
    double half;
    int n;
    uint32_t *ids; // of lattice points, MESH_NONE where there is none yet
};

static uint32_t lattice_vertex(struct lattice *l, const int at[3]) {
    uint32_t *id = l->ids + (at[0] * (l->n + 1) + at[1]) * (l->n + 1) + at[2];
    if (*id == MESH_NONE) {
        double step = 2 * l->half / l->n;
        *id = l->mesh->vertex_count++;
        mesh_set_vertex(
            l->mesh, *id,
            (vec3){step * at[0] - l->half, step * at[1] - l->half, step * at[2] - l->half});
    }
    return *id;
}

static void lattice_square(struct lattice *l, int axis, bool high, int u, int v) {
    static const int around[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    uint32_t c[4];
    for (int i = 0; i < 4; i++) {
        int at[3], k = high ? i : 3 - i;
        at[axis] = high ? l->n : 0;
        at[(axis + 1) % 3] = u + around[k][0];
        at[(axis + 2) % 3] = v + around[k][1];
        c[i] = lattice_vertex(l, at);
    }
    uint32_t *t = l->mesh->triangles + 3 * (size_t)l->mesh->triangle_count;
    memcpy(t, (const uint32_t[6]){c[0], c[1], c[2], c[0], c[2], c[3]}, 6 * sizeof *t);
    l->mesh->triangle_count += 2;
}

void lattice_cube(struct mesh *out, double half, int n) {
    size_t points = (size_t)(n + 1) * (size_t)(n + 1) * (size_t)(n + 1);
    struct lattice lattice = {out, half, n, alloc(points, sizeof *lattice.ids)};
    memset(lattice.ids, 0xff, points * sizeof *lattice.ids);
    mesh_init(out, (uint32_t)(6 * n * n + 2), (uint32_t)(12 * n * n));
    out->vertex_count = out->triangle_count = 0;
    for (int side = 0; side < 6; side++)
        for (int u = 0; u < n; u++)
            for (int v = 0; v < n; v++)
                lattice_square(&lattice, side / 2, side % 2, u, v);
    free(lattice.ids);
}
