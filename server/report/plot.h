// Plots of lines over two linear axes, as SVG: inside a page of HTML, or as a file of its own. They
// follow the reader's light or dark scheme, and differ in lightness as well as hue (after Okabe and
// Ito), so that the colour-blind can tell them apart. Texts: UTF-8, escaped here.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#define PLOT_LABELS_MAX 16

enum plot_colour {
    PLOT_INK, // the text's
    PLOT_BLUE,
    PLOT_ORANGE,
    PLOT_GREEN,
    PLOT_PURPLE,
    PLOT_OCHRE,
    PLOT_GREY,
    PLOT_COLOUR_COUNT
};

enum plot_style { PLOT_SOLID, PLOT_DASHED, PLOT_DOTTED, PLOT_POINTS };

// What is not finite, or beyond 1e300, is left out; a line breaks there.
struct plot_line {
    const char *name;  // in the legend; NULL: not in it
    const char *label; // at its right end; NULL: none
    const double *x, *y;
    size_t count; // may be 0
    enum plot_colour colour;
    enum plot_style style;
};

// A shaded range, across the whole plot; an infinite end is the plot's.
struct plot_band {
    const char *label; // inside; NULL: none
    bool of_y;         // a range of y, otherwise of x
    double from, to;
};

struct plot_axis {
    const char *title;
    double min, max; // where not min < max: what the lines ask for
};

struct plot {
    const char *title;
    const char *description; // stands in for the plot where it cannot be seen
    int width, height;       // pixels, from 200 x 120
    struct plot_axis x, y;
    const struct plot_line *lines;
    int line_count;
    const struct plot_band *bands;
    int band_count;
};

// One svg element. At most PLOT_LABELS_MAX lines have labels. The same plot gives the same bytes.
void plot_write(FILE *file, const struct plot *plot);
