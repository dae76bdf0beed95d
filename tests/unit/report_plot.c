#include "base/check.h"
#include "report/plot.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static struct plot plot_of(const struct plot_line *lines, int count) {
    return (struct plot){
        .title = "Height",
        .description = "Height along the way",
        .width = 640,
        .height = 400,
        .x = {.title = "way, mm"},
        .y = {.title = "height, mm"},
        .lines = lines,
        .line_count = count,
    };
}

// The caller frees *out_text.
static void draw(const struct plot *plot, char **out_text) {
    size_t size;
    FILE *file = open_memstream(out_text, &size);
    plot_write(file, plot);
    fclose(file);
}

// By somebody else's parser.
static void assert_is_xml(const char *text) {
    FILE *parser = popen("python3 -c 'import sys, xml.etree.ElementTree as tree; "
                         "tree.fromstring(sys.stdin.buffer.read())'",
                         "w");
    assert_non_null(parser);
    fputs(text, parser);
    if (pclose(parser) != 0)
        fail_msg("not XML: %s", text);
}

static int count_of(const char *text, const char *what) {
    int count = 0;
    for (const char *at = text; (at = strstr(at, what)); at++)
        count++;
    return count;
}

static const char *after(const char *text, const char *what) {
    const char *at = strstr(text, what);
    assert_non_null(at);
    return at + strlen(what);
}

static double number_after(const char *text, const char *what) {
    return strtod(after(text, what), NULL);
}

// ---- any data ----

static const struct {
    const char *what;
    double x[4], y[4];
    size_t count;
} series[] = {
    {"nothing", {0}, {0}, 0},
    {"one point", {3}, {4}, 1},
    {"one point at the origin", {0}, {0}, 1},
    {"no number at all", {NAN, 1, 2, NAN}, {1, NAN, INFINITY, NAN}, 4},
    {"numbers between none", {0, 1, NAN, 3}, {NAN, 1, 2, -INFINITY}, 4},
    {"level", {1, 2, 3, 4}, {5, 5, 5, 5}, 4},
    {"upright", {2, 2, 2, 2}, {1, 2, 3, 4}, 4},
    {"nearly level", {1, 2, 3, 4}, {1e9, 1e9 + 1e-7, 1e9, 1e9}, 4},
    {"huge", {-1e299, 1e299, 0, 1}, {-9e299, 9e299, 0, 1}, 4},
    {"beyond huge", {-1e308, 1e308, 0, 1}, {-1e308, 1e308, 0, 1}, 4},
    {"tiny", {0, 5e-324, 1e-323, 2e-300}, {0, 5e-324, 1e-310, 2e-300}, 4},
    {"back and forth", {3, 1, 2, 0}, {-0.0, -1e-9, 1e-9, 0}, 4},
};

static void any_series_gives_a_document_with_a_frame_and_ticks(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof series / sizeof series[0]; i++)
        for (int style = PLOT_SOLID; style <= PLOT_POINTS; style++) {
            const struct plot_line line = {
                "name",          "label",   series[i].x,           series[i].y,
                series[i].count, PLOT_BLUE, (enum plot_style)style};
            struct plot plot = plot_of(&line, 1);
            char *text;
            draw(&plot, &text);
            if (style == PLOT_SOLID)
                assert_is_xml(text);
            int ticks = count_of(text, "<path class=\"plot-grid\"");
            if (strstr(text, "nan") || strstr(text, "inf") || ticks < 4 || ticks > 40)
                fail_msg("%s: %d ticks: %s", series[i].what, ticks, text);
            free(text);
        }
}

static void a_plot_of_nothing_is_one(void **state) {
    (void)state;
    struct plot plot = plot_of(NULL, 0);
    plot.x = (struct plot_axis){"x", NAN, 1};
    plot.y = (struct plot_axis){"y", 3, 3};
    char *text;
    draw(&plot, &text);
    assert_is_xml(text);
    assert_int_equal(count_of(text, "class=\"plot-frame\""), 1);
    free(text);
}

static void a_line_breaks_where_a_point_is_none_and_a_lone_point_is_a_dot(void **state) {
    (void)state;
    const double x[] = {0, 1, 2, 3, 4, 5, 6, 7}, y[] = {1, 2, NAN, 4, INFINITY, 3, 2, 1};
    const struct plot_line line = {.x = x, .y = y, .count = 8};
    struct plot plot = plot_of(&line, 1);
    char *text;
    draw(&plot, &text);
    const char *lines = strstr(text, "<svg x=");
    assert_non_null(lines);
    assert_int_equal(count_of(lines, "<path d=\"M"), 2);
    assert_int_equal(count_of(lines, "<circle"), 1);
    free(text);
}

// ---- any text ----

static void any_text_is_escaped(void **state) {
    (void)state;
    const char *odd = "</text><script>&\"'\x01\x1b\x7f\t\n µ′ ]]> <!--";
    const double x[] = {0, 1}, y[] = {0, 1};
    const struct plot_line line = {odd, odd, x, y, 2, PLOT_INK, PLOT_SOLID};
    const struct plot_band band = {odd, false, 0.2, 0.4};
    struct plot plot = plot_of(&line, 1);
    plot.title = plot.description = plot.x.title = plot.y.title = odd;
    plot.bands = &band;
    plot.band_count = 1;
    char *text;
    draw(&plot, &text);
    assert_is_xml(text);
    assert_int_equal(count_of(text, "&lt;script&gt;&amp;"), 8); // the title is there twice
    assert_null(strstr(text, "<script"));
    free(text);
}

// ---- where things are ----

struct area {
    double left, top, width, height;
};

static struct area area_of(const char *text) {
    const char *frame = after(text, "class=\"plot-frame\"");
    return (struct area){number_after(frame, " x=\""), number_after(frame, " y=\""),
                         number_after(frame, " width=\""), number_after(frame, " height=\"")};
}

static void points_lie_where_the_axes_say(void **state) {
    (void)state;
    const double x[] = {-2, 8, 3}, y[] = {10, 30, 15};
    const struct plot_line line = {.x = x, .y = y, .count = 3};
    struct plot plot = plot_of(&line, 1);
    plot.x = (struct plot_axis){"x", -2, 8};
    plot.y = (struct plot_axis){"y", 10, 30};
    char *text;
    draw(&plot, &text);
    struct area area = area_of(text);
    assert_true(area.left > 0 && area.left + area.width < plot.width);
    assert_true(area.top > 0 && area.top + area.height < plot.height);
    double bottom = area.top + area.height, px[3], py[3];
    char *next = (char *)after(strstr(text, "<svg x="), "<path d=\"M");
    for (int i = 0; i < 3; i++) {
        px[i] = strtod(next, &next);
        py[i] = strtod(next, &next);
        next += *next == 'L';
    }
    assert_near(px[0], area.left, 0.11);
    assert_near(px[1], area.left + area.width, 0.11);
    assert_near(px[2], area.left + area.width / 2, 0.11);
    assert_near(py[0], bottom, 0.11);
    assert_near(py[1], area.top, 0.11);
    assert_near(py[2], bottom - area.height / 4, 0.11);
    free(text);
}

static void a_band_ends_at_the_frame(void **state) {
    (void)state;
    const struct plot_band bands[] = {
        {"across", true, -INFINITY, 5}, {NULL, false, 8, INFINITY}, {"none", true, NAN, 3},
        {"outside", false, 20, 30},     {"turned", false, 5, 4},
    };
    struct plot plot = plot_of(NULL, 0);
    plot.x = plot.y = (struct plot_axis){"mm", 0, 10};
    plot.bands = bands;
    plot.band_count = sizeof bands / sizeof bands[0];
    char *text;
    draw(&plot, &text);
    struct area area = area_of(text);
    assert_int_equal(count_of(text, "<rect class=\"plot-band\""), 2);
    const char *band = after(text, "<rect class=\"plot-band\"");
    assert_near(number_after(band, " y=\""), area.top + area.height / 2, 0.11);
    assert_near(number_after(band, " height=\""), area.height / 2, 0.11);
    assert_near(number_after(band, " width=\""), area.width, 0.11);
    band = after(band, "<rect class=\"plot-band\"");
    assert_near(number_after(band, " x=\""), area.left + 0.8 * area.width, 0.11);
    assert_near(number_after(band, " width=\""), 0.2 * area.width, 0.11);
    assert_near(number_after(band, " height=\""), area.height, 0.11);
    free(text);
}

// Lines that all end in the same place, above or below.
static void labels_do_not_cover_each_other(void **state) {
    (void)state;
    for (double end = 0; end <= 1; end += 0.25) {
        const double x[] = {0, 1}, y[] = {0.5, end};
        struct plot_line lines[9];
        for (int i = 0; i < 9; i++)
            lines[i] = (struct plot_line){"a name",  "a label", x, y, 2, (enum plot_colour)(i % 7),
                                          PLOT_SOLID};
        struct plot plot = plot_of(lines, 9);
        plot.y = (struct plot_axis){"y", 0, 1};
        char *text;
        draw(&plot, &text);
        struct area area = area_of(text);
        const char *at = text;
        double above = -INFINITY;
        for (int i = 0; i < 9; i++) {
            at = after(at, "fill=\"currentColor\" x=\"");
            double y_px = number_after(at, " y=\"");
            assert_true(y_px - above > 15);
            assert_true(y_px > area.top && y_px < area.top + area.height + 8);
            assert_true(strtod(at, NULL) > area.left + area.width);
            above = y_px;
        }
        free(text);
    }
}

static void a_legend_goes_on_in_the_next_row(void **state) {
    (void)state;
    const double x[] = {0, 1}, y[] = {0, 1};
    struct plot_line lines[7];
    for (int i = 0; i < 7; i++)
        lines[i] = (struct plot_line){"a name of some length", NULL, x, y, 2, PLOT_INK, PLOT_SOLID};
    struct plot one = plot_of(lines, 1), seven = plot_of(lines, 7);
    char *text_one, *text_seven;
    draw(&one, &text_one);
    draw(&seven, &text_seven);
    assert_true(area_of(text_seven).top > area_of(text_one).top + 30);
    for (const char *at = text_seven; (at = strstr(at, ">a name of some length")); at++) {
        const char *element = at;
        while (*element != '<')
            element--;
        assert_true(number_after(element, " x=\"") < seven.width - 100);
        assert_true(number_after(element, " y=\"") < area_of(text_seven).top);
    }
    free(text_one);
    free(text_seven);
}

// ---- to be seen by all ----

static double luminance(const char *hex) {
    double sum = 0;
    const double weights[] = {0.2126, 0.7152, 0.0722};
    size_t digits = strspn(hex, "0123456789abcdef") / 3;
    assert_true(digits == 1 || digits == 2);
    for (size_t i = 0; i < 3; i++) {
        char part[3] = {hex[digits * i], hex[digits * i + digits - 1], 0};
        double c = (double)strtol(part, NULL, 16) / 255;
        sum += weights[i] * (c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4));
    }
    return sum;
}

// The Web Content Accessibility Guidelines ask for 3 for lines, 4.5 for small text.
static double contrast(const char *a, const char *b) {
    double one = luminance(a), other = luminance(b);
    return (fmax(one, other) + 0.05) / (fmin(one, other) + 0.05);
}

static void colours_stand_out_in_both_schemes(void **state) {
    (void)state;
    struct plot plot = plot_of(NULL, 0);
    char *text;
    draw(&plot, &text);
    const char *schemes[] = {text, after(text, "prefers-color-scheme:dark")};
    for (int s = 0; s < 2; s++) {
        const char *paper = after(schemes[s], ".plot-paper{fill:#");
        assert_true(contrast(after(schemes[s], ".plot-text{fill:#"), paper) > 7);
        assert_true(contrast(after(schemes[s], ".plot-text{fill:#"),
                             after(schemes[s], ".plot-band{fill:#")) > 7);
        for (int i = 0; i < PLOT_COLOUR_COUNT; i++) {
            char name[32];
            snprintf(name, sizeof name, ".plot-c%d{color:#", i);
            assert_true(contrast(after(schemes[s], name), paper) > 3);
        }
    }
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_series_gives_a_document_with_a_frame_and_ticks),
        cmocka_unit_test(a_plot_of_nothing_is_one),
        cmocka_unit_test(a_line_breaks_where_a_point_is_none_and_a_lone_point_is_a_dot),
        cmocka_unit_test(any_text_is_escaped),
        cmocka_unit_test(points_lie_where_the_axes_say),
        cmocka_unit_test(a_band_ends_at_the_frame),
        cmocka_unit_test(labels_do_not_cover_each_other),
        cmocka_unit_test(a_legend_goes_on_in_the_next_row),
        cmocka_unit_test(colours_stand_out_in_both_schemes),
    };
    return cmocka_run_group_tests_name("report_plot", tests, NULL, NULL);
}
