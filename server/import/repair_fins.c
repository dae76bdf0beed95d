#include "base/check.h"
#include "import/repair_steps.h"
#include "mesh/edges.h"

#include <math.h>
#include <stdlib.h>

#define FIN_MM2 1.0
#define FIN_SHARE 0.01 // of the mesh's area
#define ROUNDS_MAX 8   // fins on fins

// A sheet: triangles that hang together by edges of two triangles.
struct sheet {
    uint32_t triangles;
    double area;
    struct box box;
    bool open;     // it has an edge with one triangle
    bool attached; // and one with three or more
};

static void add_to_sheet(struct sheet *sheet, const struct mesh *mesh, uint32_t t) {
    vec3 p[3];
    for (int i = 0; i < 3; i++) {
        p[i] = mesh_corner(mesh, t, i);
        if (!sheet->triangles && i == 0)
            sheet->box = (struct box){p[0], p[0]};
        struct box *b = &sheet->box;
        b->min = (vec3){fmin(b->min.x, p[i].x), fmin(b->min.y, p[i].y), fmin(b->min.z, p[i].z)};
        b->max = (vec3){fmax(b->max.x, p[i].x), fmax(b->max.y, p[i].y), fmax(b->max.z, p[i].z)};
    }
    sheet->area += vec3_length(vec3_cross(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[0]))) / 2;
    sheet->triangles++;
}

static uint32_t *find_sheets(const struct mesh *mesh, struct sheet *sheets) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    uint32_t *sets = sets_create(mesh->triangle_count);
    struct triangle_side *sides = edges_sorted(mesh);
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        if (end - i == 2)
            sets_join(sets, sides[i].triangle, sides[i + 1].triangle);
    }
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        for (size_t k = i; k < end; k++) {
            struct sheet *sheet = &sheets[sets_find(sets, sides[k].triangle)];
            sheet->open |= end - i == 1;
            sheet->attached |= end - i > 2;
        }
    }
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        add_to_sheet(&sheets[sets_find(sets, t)], mesh, t);
    free(sides);
    return sets;
}

static uint32_t remove_once(struct mesh *mesh, double area_max, struct repair_report *report) {
    uint32_t before = mesh->triangle_count;
    struct sheet *sheets = alloc(before, sizeof *sheets);
    bool *kept = alloc(before, sizeof *kept);
    uint32_t *sets = find_sheets(mesh, sheets);
    for (uint32_t t = 0; t < before; t++) {
        const struct sheet *sheet = &sheets[sets_find(sets, t)];
        kept[t] = !(sheet->open && sheet->attached && sheet->area < area_max);
        if (kept[t] || sets_find(sets, t) != t)
            continue;
        if (report->fin_count < REPAIR_ISLANDS_MAX)
            report->fins[report->fin_count] =
                (struct repair_island){sheet->triangles, sheet->area,
                                       vec3_scale(0.5, vec3_add(sheet->box.min, sheet->box.max))};
        report->fin_count++;
        report->fin_triangles += sheet->triangles;
    }
    repair_keep(mesh, kept, NULL);
    free(sets);
    free(kept);
    free(sheets);
    return before - mesh->triangle_count;
}

void repair_fins(struct mesh *mesh, struct repair_report *report) {
    double area_max = fmin(FIN_MM2, FIN_SHARE * mesh_area(mesh));
    for (int round = 0; round < ROUNDS_MAX && remove_once(mesh, area_max, report); round++)
        continue;
}
