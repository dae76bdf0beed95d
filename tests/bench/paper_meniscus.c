// Fig. 11: the meniscectomy.
#include "base/check.h"
#include "meniscectomy.h"
#include "paper.h"
#include "report/anatomy.h"
#include "report/tissue.h"
#include "samples.h"

#include <stdlib.h>

#define WIDTH 360
#define HEIGHT 420
#define EYE_HEIGHTS 6
#define LINE_MM 0.05 // vertices that are displaced by less get no line

// The paper's: in the text of 5.3.
static const double paper_cut_cm3 = 2.360, paper_warped_cm3 = 2.358, paper_match_ms = 3.8;

static double cm3(double mm3) {
    return mm3 / 1000;
}

enum moment { BEFORE, AFTER_FIRST, AFTER_ALL, MOMENT_COUNT };

struct fig11 {
    struct knee_case *knee;
    struct meniscectomy m;
    double whole_mm3;
    struct bite_report bites[BITE_COUNT]; // times: medians over all rounds
    double gap_mean_mm, gap_largest_mm;   // after the last bite
    struct samples rounds_ms[BITE_COUNT][WORK_COUNT], ms[WORK_COUNT];
    struct picture plateau, seen[MOMENT_COUNT], felt[MOMENT_COUNT];
};

// ---- pictures ----

static enum result draw(const struct fig11 *fig, const struct tissue_look *look,
                        struct picture *out_picture, struct error *err) {
    struct box box = mesh_bounds(&fig->m.whole);
    double inward = box.min.x + box.max.x < 0 ? 1 : -1; // where the C is open
    struct camera camera = camera_fit(&box, (vec3){0.45 * inward, -0.1, 1}, (vec3){0, 1, 0},
                                      (double)WIDTH / HEIGHT, EYE_HEIGHTS);
    return tissue_picture(look, &camera, WIDTH, HEIGHT, out_picture, err);
}

static enum result draw_seen(struct fig11 *fig, enum moment moment, struct error *err) {
    struct mesh mesh;
    uint32_t *triangles;
    cut_mesh_flatten(fig->m.cut, &mesh, NULL, &triangles);
    for (uint32_t t = 0; t < mesh.triangle_count; t++)
        triangles[t] = cut_mesh_label(fig->m.cut, triangles[t]);
    struct tissue_look look = {
        .mesh = &mesh, .colour = tissue_colour(TISSUE_MENISCUS), .labels = triangles};
    enum result result = draw(fig, &look, &fig->seen[moment], err);
    free(triangles);
    mesh_fini(&mesh);
    return result;
}

static enum result draw_felt(struct fig11 *fig, enum moment moment, struct error *err) {
    const struct meniscectomy *m = &fig->m;
    struct rod *lines = alloc(m->whole.vertex_count, sizeof *lines);
    struct mesh mesh;
    meniscectomy_warped(m, &mesh);
    struct tissue_look look = {.mesh = &mesh,
                               .colour = tissue_colour(TISSUE_MENISCUS),
                               .blends = match_blends(m->match),
                               .lines = lines};
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        struct rod line = {mesh_vertex(&m->group->mesh, v), mesh_vertex(&mesh, v)};
        if (vec3_distance(line.from, line.to) > LINE_MM)
            lines[look.line_count++] = line;
    }
    enum result result = draw(fig, &look, &fig->felt[moment], err);
    mesh_fini(&mesh);
    free(lines);
    return result;
}

static enum result draw_moment(struct fig11 *fig, enum moment moment, struct error *err) {
    enum result result = draw_seen(fig, moment, err);
    return result == RESULT_OK ? draw_felt(fig, moment, err) : result;
}

static enum result draw_plateau(struct fig11 *fig, struct error *err) {
    struct anatomy_view view = {.view = VIEWPOINT_TOP};
    anatomy_choose(fig->knee, VIEWPOINT_TOP, view.shown);
    return anatomy_picture(fig->knee, &view, 640, 480, &fig->plateau, err);
}

// ---- measuring ----

static enum result make_case(const struct bench_options *options, struct fig11 *fig,
                             struct error *err) {
    if (options->input_count)
        return case_load(options->inputs[0], NULL, &fig->knee, err);
    return paper_knee("healthy", &fig->knee, err);
}

static enum result bite_all(struct fig11 *fig, bool draw, struct error *err) {
    enum result result = draw ? draw_moment(fig, BEFORE, err) : RESULT_OK;
    for (int i = 0; i < BITE_COUNT && result == RESULT_OK; i++) {
        struct bite_report *bite = &fig->bites[i];
        result = meniscectomy_bite(&fig->m, i, bite, err);
        if (result != RESULT_OK)
            break;
        for (int work = 0; work < WORK_COUNT; work++)
            samples_add(&fig->rounds_ms[i][work], bite->ms[work]);
        if (draw && i == 0)
            result = draw_moment(fig, AFTER_FIRST, err);
        if (draw && i == BITE_COUNT - 1)
            result = draw_moment(fig, AFTER_ALL, err);
    }
    return result;
}

static void take_medians(struct fig11 *fig) {
    for (int i = 0; i < BITE_COUNT; i++)
        for (int work = 0; work < WORK_COUNT; work++) {
            double ms = samples_quantile(&fig->rounds_ms[i][work], 0.5);
            fig->bites[i].ms[work] = ms;
            samples_add(&fig->ms[work], ms);
        }
}

static enum result measure(struct fig11 *fig, const struct bench_options *options,
                           struct error *err) {
    int rounds = options->quick ? 5 : 40;
    enum result result = meniscectomy_init(&fig->m, fig->knee, err);
    fig->whole_mm3 = result == RESULT_OK ? mesh_volume(&fig->m.whole) : 0;
    for (int i = 0; i < rounds && result == RESULT_OK; i++) {
        meniscectomy_restart(&fig->m);
        result = bite_all(fig, options->out && i == rounds - 1, err);
    }
    take_medians(fig);
    if (result == RESULT_OK)
        result = meniscectomy_gap(&fig->m, &fig->gap_mean_mm, &fig->gap_largest_mm, err);
    return result == RESULT_OK && options->out ? draw_plateau(fig, err) : result;
}

// The largest over the bites.
static double volume_off(const struct fig11 *fig) {
    double largest = 0;
    for (int i = 0; i < BITE_COUNT; i++)
        largest = fmax(largest, fabs(fig->bites[i].warped_mm3 - fig->bites[i].cut_mm3));
    return largest;
}

static int most_steps(const struct fig11 *fig, enum work work) {
    int most = 0;
    for (int i = 0; i < BITE_COUNT; i++)
        most = fig->bites[i].steps[work] > most ? fig->bites[i].steps[work] : most;
    return most;
}

static void report_all(struct fig11 *fig, struct report *report) {
    const struct bite_report *first = &fig->bites[0], *last = &fig->bites[BITE_COUNT - 1];
    report_text(report, "case", fig->knee->title);
    report_figure(report, cm3(fig->whole_mm3), "cm3", "fig 11/before/cut meniscus");
    report_figure(report, cm3(first->cut_mm3), "cm3", "fig 11/after 1/cut meniscus");
    report_figure(report, cm3(first->warped_mm3), "cm3", "fig 11/after 1/warped meniscus");
    report_figure(report, cm3(last->cut_mm3), "cm3", "fig 11/after 15/cut meniscus");
    report_figure(report, cm3(last->warped_mm3), "cm3", "fig 11/after 15/warped meniscus");
    report_figure(report, paper_cut_cm3, "cm3", "fig 11/after 15/cut meniscus/paper");
    report_figure(report, paper_warped_cm3, "cm3", "fig 11/after 15/warped meniscus/paper");
    report_figure(report, fig->gap_mean_mm, "mm", "fig 11/after 15/cut to warped/mean");
    report_figure(report, fig->gap_largest_mm, "mm", "fig 11/after 15/cut to warped/max");
    struct samples *match_ms = &fig->ms[WORK_MATCH];
    report_figure(report, samples_quantile(&fig->ms[WORK_CUT], 0.5), "ms", "cut/median");
    report_figure(report, samples_mean(match_ms), "ms", "match/mean");
    report_figure(report, samples_max(match_ms), "ms", "match/max");
    report_figure(report, most_steps(fig, WORK_MATCH), "steps", "match/most steps");
    report_figure(report, paper_match_ms, "ms", "match/mean/paper");
    report_figure(report, 5, "steps", "match/most steps/paper");
    report_figure(report, samples_mean(&fig->ms[WORK_BISECTION]), "ms", "algorithm 1/mean");
    report_figure(report, most_steps(fig, WORK_BISECTION), "steps", "algorithm 1/most steps");
    report_mark(report, "match_median_ms", samples_quantile(match_ms, 0.5), "ms", paper_match_ms,
                BETTER_LOW);
    report_mark(report, "warped_volume_off_mm3", volume_off(fig), "mm3",
                1000 * (paper_cut_cm3 - paper_warped_cm3), BETTER_LOW);
}

// ---- the page ----

static void write_rows(struct paper_page *page, struct fig11 *fig) {
    const struct bite_report *last = &fig->bites[BITE_COUNT - 1];
    struct samples *match_ms = &fig->ms[WORK_MATCH];
    paper_rows(page, "Fig. 11: a meniscectomy");
    paper_row(page, "Meniscus before the first cut", "not told", "%.3f cm³", cm3(fig->whole_mm3));
    paper_row(page, "Cut meniscus, V(S)", "2.360 cm³", "%.3f cm³", cm3(last->cut_mm3));
    paper_row(page, "Warped meniscus, V(S′)", "2.358 cm³", "%.3f cm³", cm3(last->warped_mm3));
    paper_row(page, "Between the two, the most after any of 15 cuts", "2 mm³", "%.2g mm³",
              volume_off(fig));
    paper_row(page, "From cut surfaces to the warped meniscus, mean and most", "not told",
              "%.2f mm, %.2f mm", fig->gap_mean_mm, fig->gap_largest_mm);
    paper_row(page, "Match after a cut, mean", "3.8 ms", "%.3f ms", samples_mean(match_ms));
    paper_row(page, "Match after a cut, median", "not told", "%.3f ms",
              samples_quantile(match_ms, 0.5));
    paper_row(page, "Steps of a match until only rounding is left, the most", "5", "%d",
              most_steps(fig, WORK_MATCH));
    paper_row(page, "Match by Algorithm 1 to 2 mm³, mean", "3.8 ms", "%.3f ms",
              samples_mean(&fig->ms[WORK_BISECTION]));
    paper_row(page, "Steps of Algorithm 1, the most", "5", "%d", most_steps(fig, WORK_BISECTION));
    paper_row(page, "Cut, median", "not told", "%.3f ms",
              samples_quantile(&fig->ms[WORK_CUT], 0.5));
}

static void write_bites(FILE *file, const struct fig11 *fig) {
    fputs("<table>\n<tr><th class=\"n\">cut</th><th class=\"n\">taken, mm³</th>"
          "<th class=\"n\">V(S), cm³</th><th class=\"n\">V(S′), cm³</th>"
          "<th class=\"n\">between, mm³</th><th class=\"n\">cut, ms</th>"
          "<th class=\"n\">match, ms</th></tr>\n",
          file);
    for (int i = 0; i < BITE_COUNT; i++) {
        const struct bite_report *bite = &fig->bites[i];
        fprintf(file,
                "<tr><td class=\"n\">%d</td><td class=\"n\">%.2f</td><td class=\"n\">%.5f</td>"
                "<td class=\"n\">%.5f</td><td class=\"n\">%.1e</td><td class=\"n\">%.3f</td>"
                "<td class=\"n\">%.3f</td></tr>\n",
                i + 1, bite->removed_mm3, cm3(bite->cut_mm3), cm3(bite->warped_mm3),
                bite->warped_mm3 - bite->cut_mm3, bite->ms[WORK_CUT], bite->ms[WORK_MATCH]);
    }
    fputs("</table>\n", file);
}

static enum result write_pictures(struct paper_page *page,
                                  const struct picture pictures[MOMENT_COUNT], const char *name,
                                  const char *what, struct error *err) {
    static const struct {
        const char *name, *caption;
    } moments[MOMENT_COUNT] = {{"before", "Before the first cut"},
                               {"after-1", "After the first cut"},
                               {"after-15", "After 15 cuts"}};
    enum result result = RESULT_OK;
    fputs("<div class=\"row\">\n", page->sections);
    for (int i = 0; i < MOMENT_COUNT && result == RESULT_OK; i++) {
        char file[64];
        snprintf(file, sizeof file, "fig11-%s-%s", name, moments[i].name);
        result = paper_picture(page, file, &pictures[i], what, moments[i].caption, err);
    }
    fputs("</div>\n", page->sections);
    return result;
}

static enum result write_section(struct paper_page *page, struct fig11 *fig, struct error *err) {
    FILE *file = page->sections;
    fputs("<h2>Fig. 11: the meniscectomy</h2>\n<p>On the case <i>", file);
    html_text(file, fig->knee->title);
    fputs("</i> a punch bites 15 times into the inner margin of the medial meniscus, in two rows. "
          "After each bite the physical meniscus, which nobody cuts, is warped until it encloses "
          "what the cut one still does.</p>\n<h3>What the trainee sees</h3>\n"
          "<p>The cut meniscus from above, front up. Salmon: surfaces that cuts made.</p>\n",
          file);
    enum result result = write_pictures(page, fig->seen, "seen", "The cut meniscus", err);
    fputs("<h3>What the trainee touches</h3>\n<p>The physical meniscus, warped. Lines: the warp's "
          "displacements, from the physical meniscus to the warped one. The more purple, the "
          "farther on its way to the largest resection.</p>\n",
          file);
    if (result == RESULT_OK)
        result = write_pictures(page, fig->felt, "felt", "The warped meniscus", err);
    fprintf(file,
            "<h3>Each cut</h3>\n<p>Of a meniscus of %u triangles; the match goes on until only "
            "rounding is left. The paper tells neither after which cut its volumes were taken nor "
            "of how many triangles.</p>\n",
            fig->m.whole.triangle_count);
    write_bites(file, fig);
    fputs("<h3>Where</h3>\n<div class=\"row\">\n", file);
    if (result == RESULT_OK)
        result = html_picture(file, &fig->plateau, "The plateau of the tibia with both menisci",
                              "The plateau of the tibia with both menisci, whole", err);
    fputs("</div>\n", file);
    return result;
}

static void fig11_fini(struct fig11 *fig) {
    for (int i = 0; i < MOMENT_COUNT; i++) {
        picture_fini(&fig->seen[i]);
        picture_fini(&fig->felt[i]);
    }
    picture_fini(&fig->plateau);
    for (int work = 0; work < WORK_COUNT; work++) {
        samples_fini(&fig->ms[work]);
        for (int i = 0; i < BITE_COUNT; i++)
            samples_fini(&fig->rounds_ms[i][work]);
    }
    meniscectomy_fini(&fig->m);
    case_destroy(&fig->knee);
}

enum result paper_meniscus(const struct bench_options *options, struct report *report,
                           struct paper_page *page, struct error *err) {
    struct fig11 *fig = alloc(1, sizeof *fig);
    enum result result = make_case(options, fig, err);
    if (result == RESULT_OK)
        result = measure(fig, options, err);
    if (result == RESULT_OK) {
        report_all(fig, report);
        write_rows(page, fig);
    }
    if (result == RESULT_OK && page->dir)
        result = write_section(page, fig, err);
    fig11_fini(fig);
    free(fig);
    return result;
}
