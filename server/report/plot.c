#include "report/plot.h"

#include "base/check.h"
#include "report/html.h"

#include <math.h>
#include <string.h>

#define FONT_PX 13.0
#define GLYPH_PX (0.56 * FONT_PX) // on average
#define ROW_PX 18.0
#define GAP_PX 6.0
#define SWATCH_PX 24.0
#define TICK_X_PX 70.0 // between two ticks, more or less
#define TICK_Y_PX 40.0
#define VALUE_MAX 1e300

// Inside a page, an element's style is everybody's: hence the prefix.
static const char plot_css[] =
    "<style>"
    ".plot-paper{fill:#fff}.plot-text{fill:#222}.plot-grid{stroke:#e4e4e4}.plot-frame{stroke:#888}"
    ".plot-band{fill:#f1ead8}.plot-note{fill:#222;stroke:#f1ead8;stroke-width:4;stroke-linejoin:"
    "round;paint-order:stroke}.plot-c0{color:#222}.plot-c1{color:#0072b2}.plot-c2{color:#d55e00}"
    ".plot-c3{color:#00805d}.plot-c4{color:#a8478d}.plot-c5{color:#8a6d00}.plot-c6{color:#808080}"
    "@media (prefers-color-scheme:dark){"
    ".plot-paper{fill:#16181b}.plot-text{fill:#ddd}.plot-grid{stroke:#2d3136}.plot-frame{stroke:"
    "#888}.plot-band{fill:#2b2820}.plot-note{fill:#ddd;stroke:#2b2820}.plot-c0{color:#ddd}.plot-c1{"
    "color:#56b4e9}.plot-c2{color:"
    "#ff8a3c}.plot-c3{color:#35d0a5}.plot-c4{color:#e39bc4}.plot-c5{color:#e3c84a}.plot-c6{color:"
    "#999}}"
    "</style>\n";

static const char *const strokes[] = {
    [PLOT_SOLID] = "",
    [PLOT_DASHED] = " stroke-dasharray=\"7 4\"",
    [PLOT_DOTTED] = " stroke-dasharray=\"1.5 4\" stroke-linecap=\"round\"",
};

// Where one axis' values go.
struct axis_scale {
    double min, max;     // values
    double start, along; // pixels: of min, and to max
    double step;         // of ticks
};

struct layout {
    struct axis_scale x, y;
    double left, top, width, height; // the area of the lines
};

static bool is_value(double value) {
    return fabs(value) < VALUE_MAX; // NaN is not
}

static double place_on_axis(const struct axis_scale *scale, double value) {
    return scale->start + scale->along * ((value - scale->min) / (scale->max - scale->min));
}

static bool is_within(const struct axis_scale *scale, double value) {
    return value >= scale->min && value <= scale->max;
}

// ---- text ----

static double width_of(const char *text) {
    double glyphs = 0;
    for (; *text; text++)
        glyphs += (*text & 0xc0) != 0x80; // UTF-8: not a continuation
    return GLYPH_PX * glyphs;
}

// XML knows no control characters, not even escaped.
static void write_text(FILE *file, const char *text) {
    for (char c[2] = {0}; *text; text++) {
        c[0] = (unsigned char)*text < 0x20 || *text == 0x7f ? ' ' : *text;
        html_text(file, c);
    }
}

static void text_at(FILE *file, const char *kind, double x, double y, const char *anchor,
                    const char *more, const char *text) {
    fprintf(file, "<text class=\"%s\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\"%s>", kind, x, y,
            anchor, more);
    write_text(file, text);
    fputs("</text>\n", file);
}

// A text in a line's colour, at the middle of its height.
static void coloured_text(FILE *file, double x, double y, enum plot_colour colour,
                          const char *text) {
    fprintf(file, "<text class=\"plot-c%d\" fill=\"currentColor\" x=\"%.1f\" y=\"%.1f\">",
            (int)colour, x, y + 0.35 * FONT_PX);
    write_text(file, text);
    fputs("</text>\n", file);
}

// ---- axes ----

static bool is_given(const struct plot_axis *axis) {
    return is_value(axis->min) && is_value(axis->max) && axis->min < axis->max;
}

static bool is_shown(const struct plot *plot, double x, double y) {
    return is_value(x) && is_value(y) &&
           (!is_given(&plot->x) || (x >= plot->x.min && x <= plot->x.max));
}

// A little more than the values, so that no line runs along the frame; for one value, about it.
static void widen(double *min, double *max) {
    double size = fmax(fabs(*min), fabs(*max)), span = *max - *min;
    double more = 0.05 * span;
    if (!(*min <= *max))
        *min = 0, *max = 1, more = 0;
    else if (span <= 1e-9 * size || span < 1e-290)
        more = size > 1e-280 ? 0.05 * size : 0.5;
    *min -= more;
    *max += more;
}

static void range_of(const struct plot *plot, bool of_y, double *out_min, double *out_max) {
    const struct plot_axis *axis = of_y ? &plot->y : &plot->x;
    *out_min = axis->min;
    *out_max = axis->max;
    if (is_given(axis))
        return;
    *out_min = INFINITY;
    *out_max = -INFINITY;
    for (int i = 0; i < plot->line_count; i++) {
        const struct plot_line *line = &plot->lines[i];
        for (size_t k = 0; k < line->count; k++) {
            if (!is_shown(plot, line->x[k], line->y[k]))
                continue;
            double value = of_y ? line->y[k] : line->x[k];
            *out_min = fmin(*out_min, value);
            *out_max = fmax(*out_max, value);
        }
    }
    if (of_y || !(*out_min < *out_max))
        widen(out_min, out_max);
}

// 1, 2 or 5 times a power of ten.
static double step_of(double wanted) {
    double ten = pow(10, floor(log10(wanted)));
    double times = wanted / ten;
    return (times < 1.5 ? 1 : times < 3.5 ? 2 : times < 7.5 ? 5 : 10) * ten;
}

static void write_number(char *out, size_t size, double value, const struct axis_scale *scale) {
    double most = fmax(fabs(scale->min), fabs(scale->max));
    if (most >= 1e6 || scale->step < 1e-5)
        snprintf(out, size, "%.6g", value);
    else
        snprintf(out, size, "%.*f", (int)fmax(0, ceil(-log10(scale->step) - 1e-9)), value);
}

static double first_tick(const struct axis_scale *scale) {
    return ceil(scale->min / scale->step - 1e-9);
}

static double last_tick(const struct axis_scale *scale) {
    return floor(scale->max / scale->step + 1e-9);
}

static double widest_tick(const struct axis_scale *scale) {
    double widest = 0;
    char text[32];
    for (double i = first_tick(scale); i <= last_tick(scale); i++) {
        write_number(text, sizeof text, i * scale->step + 0.0, scale);
        widest = fmax(widest, width_of(text));
    }
    return widest;
}

static void write_ticks_x(FILE *file, const struct layout *at) {
    double bottom = at->top + at->height;
    char text[32];
    for (double i = first_tick(&at->x); i <= last_tick(&at->x); i++) {
        double value = i * at->x.step + 0.0, x = place_on_axis(&at->x, value);
        fprintf(file, "<path class=\"plot-grid\" d=\"M%.1f %.1fV%.1f\"/>", x, at->top, bottom);
        write_number(text, sizeof text, value, &at->x);
        text_at(file, "plot-text", x, bottom + ROW_PX, "middle", "", text);
    }
}

static void write_ticks_y(FILE *file, const struct layout *at) {
    char text[32];
    for (double i = first_tick(&at->y); i <= last_tick(&at->y); i++) {
        double value = i * at->y.step + 0.0, y = place_on_axis(&at->y, value);
        fprintf(file, "<path class=\"plot-grid\" d=\"M%.1f %.1fH%.1f\"/>", at->left, y,
                at->left + at->width);
        write_number(text, sizeof text, value, &at->y);
        text_at(file, "plot-text", at->left - GAP_PX, y + 0.35 * FONT_PX, "end", "", text);
    }
}

static void write_axis_titles(FILE *file, const struct plot *plot, const struct layout *at) {
    char turned[64];
    double x = 1.2 * FONT_PX, y = at->top + at->height / 2;
    snprintf(turned, sizeof turned, " transform=\"rotate(-90 %.1f %.1f)\"", x, y);
    text_at(file, "plot-text", at->left + at->width / 2, at->top + at->height + 2.2 * ROW_PX,
            "middle", "", plot->x.title);
    text_at(file, "plot-text", x, y, "middle", turned, plot->y.title);
}

// ---- lines ----

struct area {
    double x, y, width, height;
};

static bool band_area(const struct plot_band *band, const struct layout *at,
                      struct area *out_area) {
    const struct axis_scale *scale = band->of_y ? &at->y : &at->x;
    double from = fmax(band->from, scale->min), to = fmin(band->to, scale->max);
    if (isnan(band->from) || isnan(band->to) || !(from < to))
        return false;
    double a = place_on_axis(scale, from), b = place_on_axis(scale, to);
    *out_area = band->of_y ? (struct area){at->left, b, at->width, a - b}
                           : (struct area){a, at->top, b - a, at->height};
    return true;
}

static void write_band(FILE *file, const struct plot_band *band, const struct layout *at) {
    struct area area;
    if (band_area(band, at, &area))
        fprintf(file,
                "<rect class=\"plot-band\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" "
                "height=\"%.1f\"/>\n",
                area.x, area.y, area.width, area.height);
}

// Over the lines, which its edge keeps off.
static void write_band_label(FILE *file, const struct plot_band *band, const struct layout *at) {
    struct area area;
    if (band->label && band_area(band, at, &area))
        text_at(file, "plot-note", area.x + GAP_PX, area.y + FONT_PX + 2, "start", "", band->label);
}

static void write_dot(FILE *file, double x, double y) {
    fprintf(file, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3.5\" fill=\"currentColor\"/>", x, y);
}

static bool is_point(const struct plot_line *line, size_t i) {
    return i < line->count && is_value(line->x[i]) && is_value(line->y[i]);
}

// From `i` on as far as it does not break; how many points.
static size_t write_run(FILE *file, const struct plot_line *line, size_t i,
                        const struct layout *at) {
    size_t count = 0;
    while (is_point(line, i + count))
        count++;
    if (count < 2) {
        write_dot(file, place_on_axis(&at->x, line->x[i]), place_on_axis(&at->y, line->y[i]));
        return count;
    }
    fputs("<path d=\"", file);
    for (size_t k = 0; k < count; k++)
        fprintf(file, "%s%.1f %.1f",
                k == 0   ? "M"
                : k == 1 ? "L"
                         : " ",
                place_on_axis(&at->x, line->x[i + k]), place_on_axis(&at->y, line->y[i + k]));
    fputs("\"/>", file);
    return count;
}

// What leaves the axes' ranges is cut off by an inner svg.
static void write_line(FILE *file, const struct plot_line *line, const struct layout *at) {
    fprintf(file,
            "<svg x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" viewBox=\"%.1f %.1f %.1f "
            "%.1f\"><g class=\"plot-c%d\" fill=\"none\" stroke-width=\"2\" "
            "stroke-linejoin=\"round\"",
            at->left, at->top, at->width, at->height, at->left, at->top, at->width, at->height,
            (int)line->colour);
    if (line->style != PLOT_POINTS)
        fprintf(file, " stroke=\"currentColor\"%s", strokes[line->style]);
    fputs(">", file);
    for (size_t i = 0; i < line->count; i++) {
        if (!is_point(line, i))
            continue;
        if (line->style == PLOT_POINTS)
            write_dot(file, place_on_axis(&at->x, line->x[i]), place_on_axis(&at->y, line->y[i]));
        else
            i += write_run(file, line, i, at) - 1;
    }
    fputs("</g></svg>\n", file);
}

// ---- names ----

struct label {
    const struct plot_line *line;
    double x, y;
};

// The last point that is seen.
static bool label_of(const struct plot_line *line, const struct layout *at, struct label *out) {
    for (size_t i = line->count; i-- > 0;)
        if (is_point(line, i) && is_within(&at->x, line->x[i]) && is_within(&at->y, line->y[i])) {
            *out = (struct label){line, place_on_axis(&at->x, line->x[i]),
                                  place_on_axis(&at->y, line->y[i])};
            return true;
        }
    return false;
}

// From above; lines that end in the same place keep their order.
static void insert_label(struct label *labels, int count, struct label label) {
    int i = count;
    for (; i > 0 && labels[i - 1].y > label.y; i--)
        labels[i] = labels[i - 1];
    labels[i] = label;
}

static void write_labels(FILE *file, const struct plot *plot, const struct layout *at) {
    struct label labels[PLOT_LABELS_MAX], label;
    int count = 0;
    for (int i = 0; i < plot->line_count; i++)
        if (plot->lines[i].label && label_of(&plot->lines[i], at, &label)) {
            CHECK(count < PLOT_LABELS_MAX);
            insert_label(labels, count++, label);
        }
    for (int i = 1; i < count; i++)
        labels[i].y = fmax(labels[i].y, labels[i - 1].y + ROW_PX - 2);
    double lowest = at->top + at->height;
    for (int i = count; i-- > 0; lowest = labels[i].y - ROW_PX + 2)
        labels[i].y = fmin(labels[i].y, lowest);
    for (int i = 0; i < count; i++)
        coloured_text(file, labels[i].x + GAP_PX, labels[i].y, labels[i].line->colour,
                      labels[i].line->label);
}

static void write_swatch(FILE *file, const struct plot_line *line, double x, double y) {
    fprintf(file, "<g class=\"plot-c%d\">", (int)line->colour);
    if (line->style == PLOT_POINTS)
        write_dot(file, x + SWATCH_PX / 2, y);
    else
        fprintf(file, "<path stroke=\"currentColor\" stroke-width=\"2\"%s d=\"M%.1f %.1fh%.1f\"/>",
                strokes[line->style], x, y, SWATCH_PX);
    fputs("</g>", file);
}

// Into rows from y on; y of the last one. Without a file it only measures.
static double write_legend(FILE *file, const struct plot *plot, double left, double y) {
    double x = left;
    for (int i = 0; i < plot->line_count; i++) {
        const struct plot_line *line = &plot->lines[i];
        double width = line->name ? SWATCH_PX + GAP_PX + width_of(line->name) + 3 * GAP_PX : 0;
        if (x > left && x + width > plot->width)
            x = left, y += ROW_PX;
        if (file && line->name) {
            write_swatch(file, line, x, y);
            text_at(file, "plot-text", x + SWATCH_PX + GAP_PX, y + 0.35 * FONT_PX, "start", "",
                    line->name);
        }
        x += width;
    }
    return y;
}

// ---- all ----

#define LEGEND_LEFT 12.0
#define LEGEND_TOP 44.0

static struct layout lay_out(const struct plot *plot) {
    struct layout at = {0};
    double labels = 2 * GAP_PX;
    bool named = false;
    for (int i = 0; i < plot->line_count; i++) {
        named = named || plot->lines[i].name;
        if (plot->lines[i].label)
            labels = fmax(labels, width_of(plot->lines[i].label) + 2 * GAP_PX);
    }
    at.top = named ? write_legend(NULL, plot, LEGEND_LEFT, LEGEND_TOP) + ROW_PX : LEGEND_TOP;
    at.height = fmax(20, plot->height - at.top - 2.8 * ROW_PX);
    range_of(plot, false, &at.x.min, &at.x.max);
    range_of(plot, true, &at.y.min, &at.y.max);
    at.y.step = step_of((at.y.max - at.y.min) * TICK_Y_PX / at.height);
    at.left = 1.6 * FONT_PX + widest_tick(&at.y) + 2 * GAP_PX;
    at.width = fmax(20, plot->width - at.left - labels);
    at.x.step = step_of((at.x.max - at.x.min) * TICK_X_PX / at.width);
    at.x.start = at.left, at.x.along = at.width;
    at.y.start = at.top + at.height, at.y.along = -at.height;
    return at;
}

static void write_frame(FILE *file, const struct layout *at) {
    fprintf(file,
            "<rect class=\"plot-frame\" fill=\"none\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" "
            "height=\"%.1f\"/>\n",
            at->left, at->top, at->width, at->height);
}

void plot_write(FILE *file, const struct plot *plot) {
    CHECK(plot->width >= 200 && plot->height >= 120);
    struct layout at = lay_out(plot);
    fprintf(file,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" width=\"%d\" "
            "height=\"%d\" font-family=\"DejaVu Sans, Verdana, sans-serif\" font-size=\"%g\" "
            "role=\"img\">\n<title>",
            plot->width, plot->height, plot->width, plot->height, FONT_PX);
    write_text(file, plot->title);
    fputs("</title>\n<desc>", file);
    write_text(file, plot->description);
    fprintf(file, "</desc>\n%s<rect class=\"plot-paper\" width=\"%d\" height=\"%d\"/>\n", plot_css,
            plot->width, plot->height);
    text_at(file, "plot-text", LEGEND_LEFT, 22, "start", " font-weight=\"bold\"", plot->title);
    for (int i = 0; i < plot->band_count; i++)
        write_band(file, &plot->bands[i], &at);
    write_ticks_x(file, &at);
    write_ticks_y(file, &at);
    write_axis_titles(file, plot, &at);
    write_frame(file, &at);
    for (int i = 0; i < plot->line_count; i++)
        write_line(file, &plot->lines[i], &at);
    for (int i = 0; i < plot->band_count; i++)
        write_band_label(file, &plot->bands[i], &at);
    write_legend(file, plot, LEGEND_LEFT, LEGEND_TOP);
    write_labels(file, plot, &at);
    fputs("</svg>\n", file);
}
