#include "paper.h"

#include "generate/generate.h"

#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static paper_part *const parts[] = {paper_path, paper_opening, paper_meniscus};

#define PART_COUNT (sizeof parts / sizeof parts[0])

enum result paper_knee(const char *recipe, struct knee_case **out_knee, struct error *err) {
    char path[4096];
    struct recipe read;
    snprintf(path, sizeof path, "%s/%s", CASES, recipe);
    enum result result = recipe_load(path, &read, err);
    return result == RESULT_OK ? generate_knee(&read, out_knee, err) : result;
}

// ---- the page ----

void paper_rows(struct paper_page *page, const char *title) {
    fputs("<tr><th colspan=\"3\">", page->rows);
    html_text(page->rows, title);
    fputs("</th></tr>\n", page->rows);
}

void paper_row(struct paper_page *page, const char *what, const char *paper, const char *format,
               ...) {
    char here[160];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(here, sizeof here, format, arguments);
    va_end(arguments);
    const char *const cells[] = {paper, here};
    fputs("<tr><td>", page->rows);
    html_text(page->rows, what);
    fputs("</td>", page->rows);
    for (int i = 0; i < 2; i++) {
        fputs("<td class=\"n\">", page->rows);
        html_text(page->rows, cells[i]);
        fputs("</td>", page->rows);
    }
    fputs("</tr>\n", page->rows);
}

static enum result open_file(const struct paper_page *page, const char *name, const char *suffix,
                             FILE **out_file, struct error *err) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s.%s", page->dir, name, suffix);
    *out_file = fopen(path, "we");
    return *out_file ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
}

static enum result close_file(FILE *file, const char *name, struct error *err) {
    bool written = !ferror(file);
    if (fclose(file) != 0 || !written)
        return fail(err, RESULT_IO, "%s: cannot be written", name);
    return RESULT_OK;
}

enum result paper_plot(struct paper_page *page, const char *name, const struct plot *plot,
                       const char *caption, struct error *err) {
    FILE *file;
    html_plot(page->sections, plot, caption);
    enum result result = open_file(page, name, "svg", &file, err);
    if (result != RESULT_OK)
        return result;
    plot_write(file, plot);
    return close_file(file, name, err);
}

enum result paper_picture(struct paper_page *page, const char *name, const struct picture *picture,
                          const char *alt, const char *caption, struct error *err) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s.png", page->dir, name);
    enum result result = html_picture(page->sections, picture, alt, caption, err);
    return result == RESULT_OK ? picture_write(picture, path, err) : result;
}

static enum result write_page(const struct paper_page *page, const char *rows, const char *sections,
                              struct error *err) {
    FILE *file;
    enum result result = open_file(page, "paper", "html", &file, err);
    if (result != RESULT_OK)
        return result;
    html_begin(file, "The paper's figures, made again");
    fprintf(file,
            "<p>Spillmann, Tuchschmid, Harders: <i>Adaptive Space Warping to Enhance Passive "
            "Haptics in an Arthroscopy Surgical Simulator</i>. What its section 5 shows, on knees "
            "that Arthron generates. Times are of one core of the machine that made this page.</p>"
            "\n<table>\n<tr><th></th><th class=\"n\">paper</th><th class=\"n\">Arthron</th></tr>\n"
            "%s</table>\n%s",
            rows, sections);
    html_end(file);
    return close_file(file, "paper.html", err);
}

// ---- all ----

enum result bench_paper(const struct bench_options *options, struct report *report,
                        struct error *err) {
    char *rows, *sections;
    size_t rows_size, sections_size;
    if (options->out && mkdir(options->out, 0777) != 0 && errno != EEXIST)
        return fail(err, RESULT_IO, "%s: %s", options->out, strerror(errno));
    struct paper_page page = {options->out, open_memstream(&rows, &rows_size),
                              open_memstream(&sections, &sections_size)};
    enum result result = RESULT_OK;
    for (size_t i = 0; i < PART_COUNT && result == RESULT_OK; i++)
        result = parts[i](options, report, &page, err);
    fclose(page.rows);
    fclose(page.sections);
    if (result == RESULT_OK && page.dir)
        result = write_page(&page, rows, sections, err);
    free(rows);
    free(sections);
    return result;
}
