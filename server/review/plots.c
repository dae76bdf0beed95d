#include "review/plots.h"

#include "base/check.h"
#include "report/html.h"

#include <math.h>
#include <stdlib.h>

#define LINES_MAX 4
#define SQUARE_PX 560

struct drawing {
    struct plot plot;
    struct plot_line lines[LINES_MAX];
    double x[LINES_MAX][THIN_POINTS], y[LINES_MAX][THIN_POINTS];
};

static struct drawing *drawing_create(const char *title, const char *x, const char *y) {
    struct drawing *d = calloc(1, sizeof *d);
    CHECK(d);
    d->plot = (struct plot){.title = title,
                            .description = title,
                            .width = 640,
                            .height = 320,
                            .x = {.title = x},
                            .y = {.title = y},
                            .lines = d->lines};
    return d;
}

static void draw_line(struct drawing *d, const char *name, const struct thin *thin,
                      enum plot_colour colour, enum plot_style style) {
    int i = d->plot.line_count++;
    CHECK(i < LINES_MAX);
    size_t count = thin_points(thin, d->x[i], d->y[i]);
    d->lines[i] = (struct plot_line){name, NULL, d->x[i], d->y[i], count, colour, style};
}

static void range_of(const double *values, size_t count, double *least, double *most) {
    for (size_t i = 0; i < count; i++) {
        *least = fmin(*least, values[i]); // NaN is left out
        *most = fmax(*most, values[i]);
    }
}

// A square of the same millimetres both ways around all that is drawn.
static void square(struct drawing *d) {
    double x[2] = {INFINITY, -INFINITY}, y[2] = {INFINITY, -INFINITY};
    for (int i = 0; i < d->plot.line_count; i++) {
        range_of(d->x[i], d->lines[i].count, &x[0], &x[1]);
        range_of(d->y[i], d->lines[i].count, &y[0], &y[1]);
    }
    double half = 0.52 * fmax(fmax(x[1] - x[0], y[1] - y[0]), 1);
    d->plot.width = d->plot.height = SQUARE_PX;
    d->plot.x.min = (x[0] + x[1]) / 2 - half;
    d->plot.x.max = (x[0] + x[1]) / 2 + half;
    d->plot.y.min = (y[0] + y[1]) / 2 - half;
    d->plot.y.max = (y[0] + y[1]) / 2 + half;
}

static void drawing_finish(FILE *file, struct drawing *d, const char *caption) {
    html_plot(file, &d->plot, caption);
    free(d);
}

static void draw_path(FILE *file, const struct tip_lines *tip, enum tip_line hand,
                      const char *title, const char *x) {
    struct drawing *d = drawing_create(title, x, "z, mm (proximal)");
    draw_line(d, "as seen", &tip->lines[hand + 1], PLOT_ORANGE, PLOT_SOLID);
    draw_line(d, "as measured", &tip->lines[hand], PLOT_BLUE, PLOT_DOTTED);
    square(d);
    drawing_finish(file, d, "The tip in the femur's frame.");
}

static void draw_offset(FILE *file, const struct tip_lines *tip) {
    struct drawing *d = drawing_create("Shown–real offset", "time, s", "mm");
    d->plot.width = d->plot.height = SQUARE_PX; // as the paths beside it
    draw_line(d, NULL, &tip->lines[TIP_OFFSET], PLOT_BLUE, PLOT_SOLID);
    d->plot.y.max = 1;
    range_of(d->y[0], d->lines[0].count, &d->plot.y.min, &d->plot.y.max);
    drawing_finish(file, d, "How far the tip is shown from where it is.");
}

static void draw_gain(FILE *file, const struct tip_lines *tip) {
    const struct plot_band bands[] = {{NULL, true, NOTICED_GAIN_MOST, INFINITY},
                                      {NULL, true, -INFINITY, NOTICED_GAIN_LEAST}};
    struct drawing *d = drawing_create("Motion scale", "time, s", "mm seen a mm of hand");
    draw_line(d, "largest", &tip->lines[TIP_GAIN], PLOT_BLUE, PLOT_SOLID);
    draw_line(d, "smallest", &tip->lines[TIP_GAIN_LEAST], PLOT_ORANGE, PLOT_DASHED);
    d->plot.bands = bands;
    d->plot.band_count = 2;
    d->plot.y.min = 0.8;
    d->plot.y.max = 1.2;
    for (int i = 0; i < 2; i++)
        range_of(d->y[i], d->lines[i].count, &d->plot.y.min, &d->plot.y.max);
    char caption[128];
    snprintf(caption, sizeof caption, "May be noticed below %g and above %g (shaded).",
             NOTICED_GAIN_LEAST, NOTICED_GAIN_MOST);
    drawing_finish(file, d, caption);
}

static void draw_turn(FILE *file, const struct tip_lines *tip) {
    const struct plot_band band = {NULL, true, NOTICED_TURN_DEG, INFINITY};
    struct drawing *d = drawing_create("Turn of motion, tilt of shaft", "time, s", "degrees");
    draw_line(d, "turn", &tip->lines[TIP_TURN], PLOT_BLUE, PLOT_SOLID);
    draw_line(d, "tilt", &tip->lines[TIP_TILT], PLOT_ORANGE, PLOT_DASHED);
    d->plot.bands = &band;
    d->plot.band_count = 1;
    d->plot.y.max = 6;
    for (int i = 0; i < 2; i++)
        range_of(d->y[i], d->lines[i].count, &d->plot.y.min, &d->plot.y.max);
    char caption[128];
    snprintf(caption, sizeof caption, "May be noticed above %g degrees (shaded).",
             NOTICED_TURN_DEG);
    drawing_finish(file, d, caption);
}

void report_plot_tip(FILE *file, const struct tip_lines *tip) {
    draw_path(file, tip, TIP_CORONAL_HAND, "Path, coronal", "x, mm (right)");
    draw_path(file, tip, TIP_SAGITTAL_HAND, "Path, sagittal", "y, mm (anterior)");
    draw_offset(file, tip);
    draw_gain(file, tip);
    draw_turn(file, tip);
}

void report_plot_force(FILE *file, const struct force_lines *force) {
    struct drawing *d = drawing_create("Force", "time, s", "N");
    draw_line(d, NULL, &force->line, PLOT_BLUE, PLOT_SOLID);
    d->plot.y.max = 5;
    range_of(d->y[0], d->lines[0].count, &d->plot.y.min, &d->plot.y.max);
    drawing_finish(file, d, "As its gauge measured it; above 0 it presses.");
}

void report_plot_joint(FILE *file, const struct report_lines *lines) {
    struct drawing *d = drawing_create("Flexion", "time, s", "degrees");
    draw_line(d, NULL, &lines->flexion, PLOT_BLUE, PLOT_SOLID);
    drawing_finish(file, d, "How far the knee is bent.");
    d = drawing_create("Varus", "time, s", "degrees");
    draw_line(d, NULL, &lines->varus, PLOT_ORANGE, PLOT_SOLID);
    drawing_finish(file, d, "Valgus is negative.");
}

void report_plot_volume(FILE *file, const char *title, const struct tissue_lines *tissue) {
    struct drawing *d = drawing_create(title, "time, s", "mm³");
    draw_line(d, NULL, &tissue->lines[TISSUE_VOLUME], PLOT_BLUE, PLOT_SOLID);
    drawing_finish(file, d, "What is left after each cut, from the first that landed.");
}

void report_plot_mismatch(FILE *file, const char *title, const struct tissue_lines *tissue) {
    struct drawing *d = drawing_create(title, "time, s", "mm³");
    draw_line(d, "touched, not seen", &tissue->lines[TISSUE_TOUCHED_UNSEEN], PLOT_ORANGE,
              PLOT_SOLID);
    draw_line(d, "seen, not touched", &tissue->lines[TISSUE_SEEN_UNTOUCHED], PLOT_BLUE,
              PLOT_DASHED);
    d->plot.y.max = 1;
    for (int i = 0; i < 2; i++)
        range_of(d->y[i], d->lines[i].count, &d->plot.y.min, &d->plot.y.max);
    drawing_finish(file, d,
                   "What the warped mock-up and the cut tissue do not have in common after each "
                   "cut, without clefts of tears.");
}
