#include "cut/grid.h"

#include <stdlib.h>
#include <string.h>

#define CELLS_MAX (1 << 20)
#define LEVEL 1e-3 // of a normal along z: less bounds no column

// ---- the whole ----

static size_t cell_count(const struct triangle_grid *grid) {
    return (size_t)grid->size[0] * (size_t)grid->size[1] * (size_t)grid->size[2];
}

static void set_size(struct triangle_grid *grid, struct box box) {
    vec3 extent = vec3_sub(box.max, box.min);
    grid->size[0] = 1 + (int)(extent.x / grid->cell);
    grid->size[1] = 1 + (int)(extent.y / grid->cell);
    grid->size[2] = 1 + (int)(extent.z / grid->cell);
}

void grid_init(struct triangle_grid *grid, struct box box, double cell) {
    vec3 extent = vec3_sub(box.max, box.min);
    double longest = higher(extent.x, higher(extent.y, extent.z));
    *grid = (struct triangle_grid){
        .origin = box.min, .cell = higher(cell, longest / 1024), .free = MESH_NONE};
    for (set_size(grid, box); cell_count(grid) > CELLS_MAX; set_size(grid, box))
        grid->cell *= 1.25;
    grid->per_mm = 1 / grid->cell;
    grid->heads = alloc(cell_count(grid), sizeof *grid->heads);
    grid_clear(grid);
}

void grid_clear(struct triangle_grid *grid) {
    memset(grid->heads, 0xff, cell_count(grid) * sizeof *grid->heads);
    grid->entry_count = 0;
    grid->free = MESH_NONE;
}

void grid_fini(struct triangle_grid *grid) {
    free(grid->heads);
    free(grid->entries);
    *grid = (struct triangle_grid){0};
}

void grid_copy(struct triangle_grid *out, const struct triangle_grid *grid) {
    *out = *grid;
    out->heads = array_copy(grid->heads, cell_count(grid), sizeof *grid->heads);
    out->entry_room = grid->entry_count + grid->entry_count / 4 + 256;
    out->entries = alloc_resize(NULL, out->entry_room, sizeof *out->entries);
    memcpy(out->entries, grid->entries, grid->entry_count * sizeof *out->entries);
}

// ---- cells ----

struct cell_range {
    int low[3], high[3];
};

static int cell_along(const struct triangle_grid *grid, int axis, double offset) {
    double i = offset * grid->per_mm;
    return i <= 0 ? 0 : i >= grid->size[axis] - 1 ? grid->size[axis] - 1 : (int)i;
}

static struct cell_range cells_of(const struct triangle_grid *grid, struct box box) {
    vec3 low = vec3_sub(box.min, grid->origin), high = vec3_sub(box.max, grid->origin);
    return (struct cell_range){
        {cell_along(grid, 0, low.x), cell_along(grid, 1, low.y), cell_along(grid, 2, low.z)},
        {cell_along(grid, 0, high.x), cell_along(grid, 1, high.y), cell_along(grid, 2, high.z)}};
}

static uint32_t *column_of(const struct triangle_grid *grid, int x, int y) {
    return grid->heads + ((size_t)x * (size_t)grid->size[1] + (size_t)y) * (size_t)grid->size[2];
}

// The triangle's plane misses most cells of its box where it is large and oblique.
struct plane_slab {
    vec3 normal;
    double offset, reach;
};

static struct plane_slab slab_of(const struct triangle_grid *grid, const vec3 corners[3]) {
    vec3 n = vec3_cross(vec3_sub(corners[1], corners[0]), vec3_sub(corners[2], corners[0]));
    double reach = (fabs(n.x) + fabs(n.y) + fabs(n.z)) * grid->cell / 2;
    return (struct plane_slab){n, vec3_dot(n, vec3_sub(corners[0], grid->origin)),
                               reach * (1 + 1e-6)};
}

static bool slab_misses(const struct plane_slab *slab, const struct triangle_grid *grid, int x,
                        int y, int z) {
    vec3 centre = vec3_scale(grid->cell, (vec3){x + 0.5, y + 0.5, z + 0.5});
    return fabs(vec3_dot(slab->normal, centre) - slab->offset) > slab->reach;
}

static struct box box_of(const vec3 c[3]) {
    return (struct box){{lower(c[0].x, lower(c[1].x, c[2].x)), lower(c[0].y, lower(c[1].y, c[2].y)),
                         lower(c[0].z, lower(c[1].z, c[2].z))},
                        {higher(c[0].x, higher(c[1].x, c[2].x)),
                         higher(c[0].y, higher(c[1].y, c[2].y)),
                         higher(c[0].z, higher(c[1].z, c[2].z))}};
}

// ---- entries ----

static void add_to(struct triangle_grid *grid, uint32_t *head, uint32_t triangle) {
    uint32_t entry = grid->free;
    if (entry != MESH_NONE) {
        grid->free = grid->entries[entry].next;
    } else {
        entry = grid->entry_count++;
        grid->entries =
            array_grow(grid->entries, &grid->entry_room, grid->entry_count, sizeof *grid->entries);
    }
    grid->entries[entry] = (struct grid_entry){triangle, *head};
    *head = entry;
}

static void remove_from(struct triangle_grid *grid, uint32_t *head, uint32_t triangle) {
    while (*head != MESH_NONE && grid->entries[*head].triangle != triangle)
        head = &grid->entries[*head].next;
    CHECK(*head != MESH_NONE);
    uint32_t entry = *head;
    *head = grid->entries[entry].next;
    grid->entries[entry].next = grid->free;
    grid->free = entry;
}

static inline void for_cells(struct triangle_grid *grid, uint32_t triangle, const vec3 corners[3],
                             void (*act)(struct triangle_grid *grid, uint32_t *head,
                                         uint32_t triangle)) {
    struct cell_range cells = cells_of(grid, box_of(corners));
    if (cells.low[0] == cells.high[0] && cells.low[1] == cells.high[1] &&
        cells.low[2] == cells.high[2]) {
        act(grid, &column_of(grid, cells.low[0], cells.low[1])[cells.low[2]], triangle);
        return;
    }
    struct plane_slab slab = slab_of(grid, corners);
    for (int x = cells.low[0]; x <= cells.high[0]; x++)
        for (int y = cells.low[1]; y <= cells.high[1]; y++)
            for (int z = cells.low[2]; z <= cells.high[2]; z++)
                if (!slab_misses(&slab, grid, x, y, z))
                    act(grid, &column_of(grid, x, y)[z], triangle);
}

void grid_add(struct triangle_grid *grid, uint32_t triangle, const vec3 corners[3]) {
    for_cells(grid, triangle, corners, add_to);
}

void grid_remove(struct triangle_grid *grid, uint32_t triangle, const vec3 corners[3]) {
    for_cells(grid, triangle, corners, remove_from);
}

static void collect_cell(const struct triangle_grid *grid, uint32_t entry, struct stamped_set *seen,
                         struct ids *out) {
    for (; entry != MESH_NONE; entry = grid->entries[entry].next) {
        uint32_t triangle = grid->entries[entry].triangle;
        if (stamped_set_has(seen, triangle))
            continue;
        stamped_set_put(seen, triangle, 0);
        ids_push(out, triangle);
    }
}

// A plane for cells: n times the numbers of a cell is at most `rest` where the cell is not outside.
struct cell_plane {
    vec3 n;
    double rest;
};

static struct cell_plane cell_plane_of(const struct triangle_grid *grid,
                                       const struct plane *plane) {
    vec3 n = plane->normal, middle = {0.5, 0.5, 0.5};
    double reach = (fabs(n.x) + fabs(n.y) + fabs(n.z)) / 2 * (1 + 1e-6);
    double offset = (plane->offset - vec3_dot(n, grid->origin)) * grid->per_mm;
    return (struct cell_plane){n, offset + reach - vec3_dot(n, middle)};
}

// In a column of cells, those that do not lie outside a plane.
static void cut_column(const struct triangle_grid *grid, const struct cell_plane *plane, int x,
                       int y, int *low, int *high) {
    vec3 n = plane->n;
    double rest = plane->rest - n.x * x - n.y * y;
    if (fabs(n.z) < LEVEL)
        *high = rest < -LEVEL * grid->size[2] ? -1 : *high;
    else if (n.z > 0)
        *high = rest < *high * n.z ? (int)floor(rest / n.z) : *high;
    else
        *low = rest < *low * n.z ? (int)ceil(rest / n.z) : *low;
}

void grid_collect(const struct triangle_grid *grid, struct box box, const struct plane *planes,
                  int plane_count, struct stamped_set *seen, struct ids *out) {
    struct cell_range cells = cells_of(grid, box);
    struct cell_plane bounds[CONVEX_PLANES_MAX];
    for (int i = 0; i < plane_count; i++)
        bounds[i] = cell_plane_of(grid, &planes[i]);
    for (int x = cells.low[0]; x <= cells.high[0]; x++)
        for (int y = cells.low[1]; y <= cells.high[1]; y++) {
            int low = cells.low[2], high = cells.high[2];
            for (int i = 0; i < plane_count && low <= high; i++)
                cut_column(grid, &bounds[i], x, y, &low, &high);
            for (int z = low; z <= high; z++)
                collect_cell(grid, column_of(grid, x, y)[z], seen, out);
        }
}
