#include "report/strip.h"

#include "base/check.h"

#include <math.h>

#define WIDTH_PX 240.0
#define HEIGHT_PX 26.0
#define MARGIN_PX 7.0
#define MIDDLE_PX (0.5 * HEIGHT_PX)
#define BOX_PX 14.0
#define DOTS_MAX 60 // more would be a bar

double strip_quantile(const double *values, size_t count, double share) {
    CHECK(count > 0 && share >= 0 && share <= 1);
    double at = share * (double)(count - 1);
    size_t below = (size_t)at;
    size_t above = below + 1 < count ? below + 1 : below;
    double share_above = at - (double)below;
    return (1 - share_above) * values[below] + share_above * values[above];
}

// Halved, for twice the largest number is none.
struct strip_scale {
    double least, span;
};

static struct strip_scale scale_of(const struct strip *s) {
    double least = fmin(s->values[0], s->mark), most = fmax(s->values[s->count - 1], s->mark);
    return (struct strip_scale){0.5 * least, 0.5 * most - 0.5 * least};
}

// Where all are one value, in the middle.
static double place_on_strip(const struct strip_scale *scale, double value) {
    double share = scale->span > 0 ? (0.5 * value - scale->least) / scale->span : 0.5;
    return MARGIN_PX + share * (WIDTH_PX - 2 * MARGIN_PX);
}

static void write_box(FILE *file, const struct strip *s, const struct strip_scale *scale) {
    double q[5];
    for (int i = 0; i < 5; i++)
        q[i] = place_on_strip(scale, strip_quantile(s->values, s->count, 0.25 * i));
    fprintf(file,
            "<path d=\"M%.1f %.1fH%.1f\" stroke=\"currentColor\" opacity=\"0.6\"/>"
            "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"currentColor\" "
            "fill-opacity=\"0.14\" stroke=\"currentColor\" stroke-opacity=\"0.6\"/>"
            "<path d=\"M%.1f %.1fv%.1f\" stroke=\"currentColor\" stroke-width=\"2\"/>",
            q[0], MIDDLE_PX, q[4], q[1], MIDDLE_PX - 0.5 * BOX_PX, q[3] - q[1], BOX_PX, q[2],
            MIDDLE_PX - 0.5 * BOX_PX, BOX_PX);
}

void strip_write(FILE *file, const struct strip *s) {
    CHECK(s->count > 0);
    struct strip_scale scale = scale_of(s);
    fprintf(file,
            "<svg viewBox=\"0 0 %g %g\" width=\"%g\" height=\"%g\" role=\"img\"><title>%zu values, "
            "quartiles %.4g, %.4g, %.4g; here %.4g</title>",
            WIDTH_PX, HEIGHT_PX, WIDTH_PX, HEIGHT_PX, s->count,
            strip_quantile(s->values, s->count, 0.25), strip_quantile(s->values, s->count, 0.5),
            strip_quantile(s->values, s->count, 0.75), s->mark);
    write_box(file, s, &scale);
    for (size_t i = 0; s->count <= DOTS_MAX && i < s->count; i++)
        fprintf(file,
                "<circle cx=\"%.1f\" cy=\"%g\" r=\"2\" fill=\"currentColor\" "
                "fill-opacity=\"0.55\"/>",
                place_on_strip(&scale, s->values[i]), MIDDLE_PX);
    fprintf(file, "<path d=\"M%.1f 1l5 6-5 6-5-6z\" fill=\"#d55e00\"/></svg>",
            place_on_strip(&scale, s->mark));
}
