// What the paper shows (Spillmann, Tuchschmid, Harders), made again, beside its own figures. Each
// part of `arthron-bench paper` measures, reports, and writes its rows and its section.
#pragma once

#include "bench.h"
#include "case/case.h"
#include "report/html.h"

// A page that grows: its top is a table of figures, the sections follow.
struct paper_page {
    const char *dir; // for plots and pictures as files; NULL: none are made
    FILE *rows, *sections;
};

// Above the rows of a part.
void paper_rows(struct paper_page *page, const char *title);

// One figure: what it is, the paper's, ours.
void paper_row(struct paper_page *page, const char *what, const char *paper, const char *format,
               ...) __attribute__((format(printf, 4, 5)));

// Into the section, and as DIR/NAME.svg or .png.
enum result paper_plot(struct paper_page *page, const char *name, const struct plot *plot,
                       const char *caption, struct error *err);
enum result paper_picture(struct paper_page *page, const char *name, const struct picture *picture,
                          const char *alt, const char *caption, struct error *err);

// The knee of a recipe in cases/; the caller destroys it.
enum result paper_knee(const char *recipe, struct knee_case **out_knee, struct error *err);

typedef enum result paper_part(const struct bench_options *options, struct report *report,
                               struct paper_page *page, struct error *err);

paper_part paper_path;     // Fig. 7: a hook over a cavity
paper_part paper_opening;  // Fig. 8 to 10: a torn ligament
paper_part paper_meniscus; // Fig. 11: a meniscectomy
