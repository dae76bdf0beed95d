// What the paper shows (Spillmann, Tuchschmid, Harders), made again, beside its own figures.
#include "base/check.h"
#include "bench.h"
#include "case/generate.h"
#include "meniscectomy.h"
#include "report/anatomy.h"
#include "report/html.h"
#include "report/tissue.h"
#include "samples.h"

#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define RECIPE CASES "/healthy"
#define WIDTH 480
#define HEIGHT 560
#define EYE_HEIGHTS 6
#define LINE_MM 0.05 // vertices that are displaced by less get no line

// The paper's: in the text of 5.3.
static const double paper_cut_cm3 = 2.360, paper_warped_cm3 = 2.358, paper_match_ms = 3.8;

static double cm3(double mm3) {
    return mm3 / 1000;
}

enum moment { BEFORE, AFTER_FIRST, AFTER_ALL, MOMENT_COUNT };

struct paper {
    struct knee_case *knee;
    struct meniscectomy m;
    double whole_mm3;
    struct bite_report bites[BITE_COUNT]; // times: medians over all rounds
    double gap_mean_mm, gap_largest_mm;   // after the last bite
    struct samples rounds_ms[BITE_COUNT][WORK_COUNT], ms[WORK_COUNT];
    struct picture plateau, seen[MOMENT_COUNT], felt[MOMENT_COUNT];
};

// ---- pictures ----

static enum result draw(const struct paper *paper, const struct tissue_look *look,
                        struct picture *out_picture, struct error *err) {
    struct box box = mesh_bounds(&paper->m.whole);
    double inward = box.min.x + box.max.x < 0 ? 1 : -1; // where the C is open
    struct camera camera = camera_fit(&box, (vec3){0.45 * inward, -0.1, 1}, (vec3){0, 1, 0},
                                      (double)WIDTH / HEIGHT, EYE_HEIGHTS);
    return tissue_picture(look, &camera, WIDTH, HEIGHT, out_picture, err);
}

static enum result draw_seen(struct paper *paper, enum moment moment, struct error *err) {
    struct mesh mesh;
    uint32_t *triangles;
    cut_mesh_flatten(paper->m.cut, &mesh, NULL, &triangles);
    for (uint32_t t = 0; t < mesh.triangle_count; t++)
        triangles[t] = cut_mesh_label(paper->m.cut, triangles[t]);
    struct tissue_look look = {.mesh = &mesh, .labels = triangles};
    enum result result = draw(paper, &look, &paper->seen[moment], err);
    free(triangles);
    mesh_fini(&mesh);
    return result;
}

static enum result draw_felt(struct paper *paper, enum moment moment, struct error *err) {
    const struct meniscectomy *m = &paper->m;
    struct line *lines = alloc(m->whole.vertex_count, sizeof *lines);
    struct mesh mesh;
    meniscectomy_warped(m, &mesh);
    struct tissue_look look = {.mesh = &mesh, .blends = match_blends(m->match), .lines = lines};
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        struct line line = {mesh_vertex(&m->group->mesh, v), mesh_vertex(&mesh, v)};
        if (vec3_distance(line.from, line.to) > LINE_MM)
            lines[look.line_count++] = line;
    }
    enum result result = draw(paper, &look, &paper->felt[moment], err);
    mesh_fini(&mesh);
    free(lines);
    return result;
}

static enum result draw_moment(struct paper *paper, enum moment moment, struct error *err) {
    enum result result = draw_seen(paper, moment, err);
    return result == RESULT_OK ? draw_felt(paper, moment, err) : result;
}

static enum result draw_plateau(struct paper *paper, struct error *err) {
    struct anatomy_view view = {.view = VIEW_TOP};
    anatomy_choose(paper->knee, VIEW_TOP, view.shown);
    return anatomy_picture(paper->knee, &view, 640, 480, &paper->plateau, err);
}

// ---- measuring ----

static enum result make_case(const struct bench_options *options, struct paper *paper,
                             struct error *err) {
    struct recipe recipe;
    if (options->input_count)
        return case_load(options->inputs[0], NULL, &paper->knee, err);
    enum result result = recipe_load(RECIPE, &recipe, err);
    return result == RESULT_OK ? generate_knee(&recipe, &paper->knee, err) : result;
}

static enum result bite_all(struct paper *paper, bool draw, struct error *err) {
    enum result result = draw ? draw_moment(paper, BEFORE, err) : RESULT_OK;
    for (int i = 0; i < BITE_COUNT && result == RESULT_OK; i++) {
        struct bite_report *bite = &paper->bites[i];
        result = meniscectomy_bite(&paper->m, i, bite, err);
        if (result != RESULT_OK)
            break;
        for (int work = 0; work < WORK_COUNT; work++)
            samples_add(&paper->rounds_ms[i][work], bite->ms[work]);
        if (draw && i == 0)
            result = draw_moment(paper, AFTER_FIRST, err);
        if (draw && i == BITE_COUNT - 1)
            result = draw_moment(paper, AFTER_ALL, err);
    }
    return result;
}

static void take_medians(struct paper *paper) {
    for (int i = 0; i < BITE_COUNT; i++)
        for (int work = 0; work < WORK_COUNT; work++) {
            double ms = samples_quantile(&paper->rounds_ms[i][work], 0.5);
            paper->bites[i].ms[work] = ms;
            samples_add(&paper->ms[work], ms);
        }
}

static enum result measure(struct paper *paper, const struct bench_options *options,
                           struct error *err) {
    int rounds = options->quick ? 5 : 40;
    enum result result = meniscectomy_init(&paper->m, paper->knee, err);
    paper->whole_mm3 = result == RESULT_OK ? mesh_volume(&paper->m.whole) : 0;
    for (int i = 0; i < rounds && result == RESULT_OK; i++) {
        meniscectomy_restart(&paper->m);
        result = bite_all(paper, options->out && i == rounds - 1, err);
    }
    take_medians(paper);
    if (result == RESULT_OK)
        result = meniscectomy_gap(&paper->m, &paper->gap_mean_mm, &paper->gap_largest_mm, err);
    return result == RESULT_OK && options->out ? draw_plateau(paper, err) : result;
}

// The largest over the bites.
static double volume_off(const struct paper *paper) {
    double largest = 0;
    for (int i = 0; i < BITE_COUNT; i++)
        largest = fmax(largest, fabs(paper->bites[i].warped_mm3 - paper->bites[i].cut_mm3));
    return largest;
}

static int most_steps(const struct paper *paper, enum work work) {
    int most = 0;
    for (int i = 0; i < BITE_COUNT; i++)
        most = paper->bites[i].steps[work] > most ? paper->bites[i].steps[work] : most;
    return most;
}

static void report_all(struct paper *paper, struct report *report) {
    const struct bite_report *first = &paper->bites[0], *last = &paper->bites[BITE_COUNT - 1];
    report_text(report, "case", paper->knee->title);
    report_figure(report, cm3(paper->whole_mm3), "cm3", "fig 11/before/cut meniscus");
    report_figure(report, cm3(first->cut_mm3), "cm3", "fig 11/after 1/cut meniscus");
    report_figure(report, cm3(first->warped_mm3), "cm3", "fig 11/after 1/warped meniscus");
    report_figure(report, cm3(last->cut_mm3), "cm3", "fig 11/after 15/cut meniscus");
    report_figure(report, cm3(last->warped_mm3), "cm3", "fig 11/after 15/warped meniscus");
    report_figure(report, paper->gap_mean_mm, "mm", "fig 11/after 15/cut to warped/mean");
    report_figure(report, paper->gap_largest_mm, "mm", "fig 11/after 15/cut to warped/max");
    struct samples *match_ms = &paper->ms[WORK_MATCH];
    report_figure(report, samples_quantile(&paper->ms[WORK_CUT], 0.5), "ms", "cut/median");
    report_figure(report, samples_mean(match_ms), "ms", "match/mean");
    report_figure(report, samples_max(match_ms), "ms", "match/max");
    report_figure(report, most_steps(paper, WORK_MATCH), "steps", "match/most steps");
    report_figure(report, samples_mean(&paper->ms[WORK_BISECTION]), "ms", "algorithm 1/mean");
    report_figure(report, most_steps(paper, WORK_BISECTION), "steps", "algorithm 1/most steps");
    report_mark(report, "match_median_ms", samples_quantile(match_ms, 0.5), "ms", paper_match_ms,
                BETTER_LOW);
    report_mark(report, "warped_volume_off_mm3", volume_off(paper), "mm3",
                1000 * (paper_cut_cm3 - paper_warped_cm3), BETTER_LOW);
}

// ---- the page ----

// One row: a figure, the paper's, ours.
static void row(FILE *file, const char *what, const char *paper, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

static void row(FILE *file, const char *what, const char *paper, const char *format, ...) {
    char here[64];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(here, sizeof here, format, arguments);
    va_end(arguments);
    const char *const cells[] = {paper, here};
    fputs("<tr><th>", file);
    html_text(file, what);
    fputs("</th>", file);
    for (int i = 0; i < 2; i++) {
        fputs("<td class=\"n\">", file);
        html_text(file, cells[i]);
        fputs("</td>", file);
    }
    fputs("</tr>\n", file);
}

static void write_comparison(FILE *file, struct paper *paper) {
    const struct bite_report *last = &paper->bites[BITE_COUNT - 1];
    fputs("<table>\n<tr><th></th><th class=\"n\">paper</th><th class=\"n\">here</th></tr>\n", file);
    row(file, "Meniscus before the first cut", "not told", "%.3f cm³", cm3(paper->whole_mm3));
    row(file, "Cut meniscus, V(S)", "2.360 cm³", "%.3f cm³", cm3(last->cut_mm3));
    row(file, "Warped meniscus, V(S′)", "2.358 cm³", "%.3f cm³", cm3(last->warped_mm3));
    row(file, "Between the two, the most after any cut", "2 mm³", "%.2g mm³", volume_off(paper));
    row(file, "From cut surfaces to the warped meniscus, mean and most", "not told",
        "%.2f mm, %.2f mm", paper->gap_mean_mm, paper->gap_largest_mm);
    struct samples *match_ms = &paper->ms[WORK_MATCH];
    row(file, "Match after a cut, mean", "3.8 ms", "%.3f ms", samples_mean(match_ms));
    row(file, "Match after a cut, median", "not told", "%.3f ms", samples_quantile(match_ms, 0.5));
    row(file, "Steps of a match, the most", "5", "%d", most_steps(paper, WORK_MATCH));
    row(file, "Match by Algorithm 1 to 2 mm³, mean", "3.8 ms", "%.3f ms",
        samples_mean(&paper->ms[WORK_BISECTION]));
    row(file, "Steps of Algorithm 1, the most", "5", "%d", most_steps(paper, WORK_BISECTION));
    row(file, "Cut, median", "not told", "%.3f ms", samples_quantile(&paper->ms[WORK_CUT], 0.5));
    fputs("</table>\n", file);
}

static void write_bites(FILE *file, const struct paper *paper) {
    fputs("<table>\n<tr><th class=\"n\">cut</th><th class=\"n\">taken, mm³</th>"
          "<th class=\"n\">V(S), cm³</th><th class=\"n\">V(S′), cm³</th>"
          "<th class=\"n\">between, mm³</th><th class=\"n\">cut, ms</th>"
          "<th class=\"n\">match, ms</th></tr>\n",
          file);
    for (int i = 0; i < BITE_COUNT; i++) {
        const struct bite_report *bite = &paper->bites[i];
        fprintf(file,
                "<tr><td class=\"n\">%d</td><td class=\"n\">%.2f</td><td class=\"n\">%.5f</td>"
                "<td class=\"n\">%.5f</td><td class=\"n\">%.1e</td><td class=\"n\">%.3f</td>"
                "<td class=\"n\">%.3f</td></tr>\n",
                i + 1, bite->removed_mm3, cm3(bite->cut_mm3), cm3(bite->warped_mm3),
                bite->warped_mm3 - bite->cut_mm3, bite->ms[WORK_CUT], bite->ms[WORK_MATCH]);
    }
    fputs("</table>\n", file);
}

static enum result write_pictures(FILE *file, const struct picture pictures[MOMENT_COUNT],
                                  const char *what, struct error *err) {
    static const char *const captions[MOMENT_COUNT] = {"Before the first cut",
                                                       "After the first cut", "After 15 cuts"};
    enum result result = RESULT_OK;
    fputs("<div class=\"row\">\n", file);
    for (int i = 0; i < MOMENT_COUNT && result == RESULT_OK; i++)
        result = html_picture(file, &pictures[i], what, captions[i], err);
    fputs("</div>\n", file);
    return result;
}

static enum result write_body(FILE *file, struct paper *paper, struct error *err) {
    html_begin(file, "Meniscectomy: Fig. 11 of the paper, made again");
    fputs("<p>Spillmann, Tuchschmid, Harders: <i>Adaptive Space Warping to Enhance Passive Haptics "
          "in an Arthroscopy Surgical Simulator</i>, section 5.3. On the case <i>",
          file);
    html_text(file, paper->knee->title);
    fputs("</i> a punch bites 15 times into the inner margin of the medial meniscus, in two rows. "
          "After each bite the physical meniscus, which nobody cuts, is warped until it encloses "
          "what the cut one still does.</p>\n<h2>What the trainee sees</h2>\n"
          "<p>The cut meniscus from above, front up. Salmon: surfaces that cuts made.</p>\n",
          file);
    enum result result = write_pictures(file, paper->seen, "The cut meniscus", err);
    fputs("<h2>What the trainee touches</h2>\n<p>The physical meniscus, warped. Lines: the warp's "
          "displacements, from the physical meniscus to the warped one. The more purple, the "
          "farther on its way to the largest resection.</p>\n",
          file);
    if (result == RESULT_OK)
        result = write_pictures(file, paper->felt, "The warped meniscus", err);
    fputs("<h2>Figures</h2>\n", file);
    write_comparison(file, paper);
    fprintf(
        file,
        "<p>Ours after 15 cuts of %u triangles, on one core of the machine that made this page; "
        "the match goes on until only rounding is left. The paper tells neither after which cut "
        "its volumes were taken nor of how many triangles.</p>\n<h2>Each cut</h2>\n",
        paper->m.whole.triangle_count);
    write_bites(file, paper);
    fputs("<h2>Where</h2>\n<div class=\"row\">\n", file);
    if (result == RESULT_OK)
        result = html_picture(file, &paper->plateau, "The plateau of the tibia with both menisci",
                              "The plateau of the tibia with both menisci, whole", err);
    fputs("</div>\n", file);
    html_end(file);
    return result;
}

static enum result write_page(struct paper *paper, const char *dir, struct error *err) {
    char path[4096];
    if (mkdir(dir, 0777) != 0 && errno != EEXIST)
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    snprintf(path, sizeof path, "%s/paper.html", dir);
    FILE *file = fopen(path, "we");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    enum result result = write_body(file, paper, err);
    bool written = !ferror(file);
    if ((fclose(file) != 0 || !written) && result == RESULT_OK)
        result = fail(err, RESULT_IO, "%s: cannot be written", path);
    return result;
}

static void paper_fini(struct paper *paper) {
    for (int i = 0; i < MOMENT_COUNT; i++) {
        picture_fini(&paper->seen[i]);
        picture_fini(&paper->felt[i]);
    }
    picture_fini(&paper->plateau);
    for (int work = 0; work < WORK_COUNT; work++) {
        samples_fini(&paper->ms[work]);
        for (int i = 0; i < BITE_COUNT; i++)
            samples_fini(&paper->rounds_ms[i][work]);
    }
    meniscectomy_fini(&paper->m);
    case_destroy(&paper->knee);
}

enum result bench_paper(const struct bench_options *options, struct report *report,
                        struct error *err) {
    struct paper *paper = alloc(1, sizeof *paper);
    enum result result = make_case(options, paper, err);
    if (result == RESULT_OK)
        result = measure(paper, options, err);
    if (result == RESULT_OK)
        report_all(paper, report);
    if (result == RESULT_OK && options->out)
        result = write_page(paper, options->out, err);
    paper_fini(paper);
    free(paper);
    return result;
}
