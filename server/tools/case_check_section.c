#include "case_check_section.h"

#include <math.h>
#include <string.h>

struct ink {
    double r, g, b;
};

static const struct ink fold_ink = {0, 190, 80}, outside_ink = {236, 238, 240};
static const struct ink physical_ink = {90, 90, 90}, virtual_ink = {205, 20, 30};
static const struct ink filled_ink = {0, 70, 230}, strained_ink = {70, 170, 255};

// Lightness falls evenly (matplotlib's magma, from its light end; CC0).
static struct ink gain_ink(double share) {
    static const struct ink stops[] = {{252, 253, 245}, {254, 224, 160}, {254, 188, 128},
                                       {253, 150, 106}, {244, 104, 92},  {219, 71, 106},
                                       {182, 54, 121},  {141, 41, 129},  {101, 26, 128},
                                       {62, 15, 114},   {26, 12, 60}};
    int last = sizeof stops / sizeof stops[0] - 1;
    double at = fmin(fmax(share, 0), 1) * last;
    int i = at < last ? (int)at : last - 1;
    double t = at - i;
    const struct ink *a = &stops[i], *b = &stops[i + 1];
    return (struct ink){a->r + t * (b->r - a->r), a->g + t * (b->g - a->g),
                        a->b + t * (b->b - a->b)};
}

static struct ink solid_ink(uint32_t colour) {
    double rgb[3];
    tissue_rgb(colour, rgb);
    return (struct ink){255 * rgb[0], 255 * rgb[1], 255 * rgb[2]};
}

static void put(struct picture *picture, int x, int y, struct ink ink, double cover) {
    if (x < 0 || y < 0 || x >= picture->width || y >= picture->height)
        return;
    uint8_t *rgb = picture->rgb + 3 * ((size_t)x + (size_t)picture->width * (size_t)y);
    const double wanted[3] = {ink.r, ink.g, ink.b};
    for (int i = 0; i < 3; i++)
        rgb[i] = (uint8_t)lround(rgb[i] + cover * (wanted[i] - rgb[i]));
}

// ---- cells --------------------------------------------------------------------------------------

static struct ink cell_ink(const struct section_cell *cell, const struct case_check *check,
                           double gain_most, int x, int y) {
    static const struct ink white = {255, 255, 255}, hatch = {176, 176, 180};
    if (cell->place == PLACE_SOLID)
        return solid_ink(check->group_colours[cell->group]);
    if (cell->place == PLACE_OUTSIDE)
        return outside_ink;
    if (cell->close)
        return (x + y) % 6 < 2 ? hatch : white;
    if (cell->folds)
        return fold_ink;
    return cell->still ? white : gain_ink((double)cell->gain / gain_most);
}

static void draw_cells(const struct section *s, const struct case_check *check, double gain_most,
                       struct picture *picture) {
    for (int y = 0; y < picture->height; y++)
        for (int x = 0; x < picture->width; x++) {
            int i = x / SECTION_SCALE, k = s->size[1] - 1 - y / SECTION_SCALE;
            put(picture, x, y, cell_ink(&s->cells[i + s->size[0] * k], check, gain_most, x, y), 1);
        }
}

// ---- outlines -----------------------------------------------------------------------------------

// Pixels from the left and from the top.
static void to_pixels(const struct section *s, const struct picture *picture, const float at[2],
                      double out[2]) {
    double scale = SECTION_SCALE / s->spacing_mm, half = 0.5 * s->spacing_mm;
    out[0] = ((double)at[0] - s->origin[0] + half) * scale - 0.5;
    out[1] = picture->height - ((double)at[1] - s->origin[1] + half) * scale - 0.5;
}

static double distance_to(const double a[2], const double b[2], double x, double y) {
    double dx = b[0] - a[0], dy = b[1] - a[1], squares = dx * dx + dy * dy;
    double t = squares > 0 ? ((x - a[0]) * dx + (y - a[1]) * dy) / squares : 0;
    t = fmin(fmax(t, 0), 1);
    return hypot(a[0] + t * dx - x, a[1] + t * dy - y);
}

static void draw_line(const struct section *s, const struct section_line *line, struct ink ink,
                      double width, struct picture *picture) {
    double a[2], b[2], reach = width / 2 + 1;
    to_pixels(s, picture, line->from, a);
    to_pixels(s, picture, line->to, b);
    double left = fmax(fmin(a[0], b[0]) - reach, 0), top = fmax(fmin(a[1], b[1]) - reach, 0);
    double right = fmin(fmax(a[0], b[0]) + reach, picture->width - 1);
    double bottom = fmin(fmax(a[1], b[1]) + reach, picture->height - 1);
    for (int y = (int)top; y <= bottom; y++)
        for (int x = (int)left; x <= right; x++) {
            double cover = width / 2 + 0.5 - distance_to(a, b, x, y);
            put(picture, x, y, ink, fmin(fmax(cover, 0), 1));
        }
}

// What matters most is drawn last.
static void draw_lines(const struct section *s, struct picture *picture) {
    for (int pass = 0; pass < 4; pass++)
        for (size_t i = 0; i < s->line_count; i++) {
            const struct section_line *line = &s->lines[i];
            if (pass == 0 && !line->is_virtual)
                draw_line(s, line, physical_ink, 1.4, picture);
            if (pass == 1 && line->strained && !line->filled)
                draw_line(s, line, strained_ink, 3, picture);
            if (pass == 2 && line->is_virtual)
                draw_line(s, line, virtual_ink, 1.6, picture);
            if (pass == 3 && line->filled)
                draw_line(s, line, filled_ink, 4.5, picture);
        }
}

void section_picture(const struct section *section, const struct case_check *check,
                     double gain_most, struct picture *out_picture) {
    picture_init(out_picture, SECTION_SCALE * section->size[0], SECTION_SCALE * section->size[1]);
    draw_cells(section, check, gain_most, out_picture);
    draw_lines(section, out_picture);
}

void section_scale(struct picture *out_picture) {
    picture_init(out_picture, 600, 24);
    for (int y = 0; y < out_picture->height; y++)
        for (int x = 0; x < out_picture->width; x++)
            put(out_picture, x, y, gain_ink((x + 0.5) / out_picture->width), 1);
}
