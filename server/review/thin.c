#include "review/thin.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

enum { FIRST, LEFT, RIGHT, LOW, HIGH };

static struct thin_cell *cell_at(struct thin *thin, double order) {
    int i = (int)(fmin(fmax(order, 0), 1) * THIN_CELLS);
    return &thin->cells[i < THIN_CELLS ? i : THIN_CELLS - 1];
}

void thin_init(struct thin *thin) {
    for (int i = 0; i < THIN_CELLS; i++)
        thin->cells[i] = (struct thin_cell){.broken = NAN};
}

void thin_add(struct thin *thin, double order, double x, double y) {
    struct thin_cell *cell = cell_at(thin, order);
    struct thin_point point = {order, x, y}, *kept = cell->kept;
    if (cell->count++ == 0) {
        for (int i = 0; i < THIN_KEPT; i++)
            kept[i] = point;
        return;
    }
    if (x < kept[LEFT].x)
        kept[LEFT] = point;
    if (x > kept[RIGHT].x)
        kept[RIGHT] = point;
    if (y < kept[LOW].y)
        kept[LOW] = point;
    if (y > kept[HIGH].y)
        kept[HIGH] = point;
}

void thin_break(struct thin *thin, double order) {
    cell_at(thin, order)->broken = order;
}

static int compare(const void *a, const void *b) {
    double x = ((const struct thin_point *)a)->order, y = ((const struct thin_point *)b)->order;
    return (x > y) - (x < y);
}

static bool is_same(const struct thin_point *a, const struct thin_point *b) {
    return a->order == b->order && a->x == b->x && a->y == b->y;
}

// The points of one cell in order, each once.
static size_t list_cell(const struct thin_cell *cell, double *out_x, double *out_y) {
    struct thin_point points[THIN_KEPT + 1];
    int count = 0;
    size_t used = 0;
    for (int i = 0; cell->count && i < THIN_KEPT; i++)
        points[count++] = cell->kept[i];
    if (!isnan(cell->broken))
        points[count++] = (struct thin_point){cell->broken, NAN, NAN};
    qsort(points, (size_t)count, sizeof points[0], compare);
    for (int i = 0; i < count; i++) {
        if (i && is_same(&points[i], &points[i - 1]))
            continue;
        out_x[used] = points[i].x;
        out_y[used++] = points[i].y;
    }
    return used;
}

size_t thin_points(const struct thin *thin, double out_x[THIN_POINTS], double out_y[THIN_POINTS]) {
    size_t count = 0;
    for (int i = 0; i < THIN_CELLS; i++)
        count += list_cell(&thin->cells[i], out_x + count, out_y + count);
    return count;
}
