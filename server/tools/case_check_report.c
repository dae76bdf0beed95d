#include "case_check_report.h"

#include "case_check_section.h"
#include "report/html.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CELL_MM 0.25
#define MOST 0.999

struct check_page {
    const struct case_check *check;
    const struct scene *scene;
    FILE *file;
    double gain_most; // at the dark end of the colours
};

// ---- words --------------------------------------------------------------------------------------

static void write_row(FILE *file, const struct check_finding *finding) {
    static const char *const levels[] = {
        [FINDING_NOTE] = "note", [FINDING_WARNING] = "warning", [FINDING_FAULT] = "fault"};
    fprintf(file, "<tr><td>%s</td><td>", levels[finding->level]);
    html_text(file, finding->where);
    fputs("</td><td>", file);
    html_text(file, finding->text);
    fputs("</td></tr>\n", file);
}

// The worst first.
static void write_findings(FILE *file, const struct inspection *inspection) {
    fputs("<table>\n<tr><th></th><th>where</th><th>what</th></tr>\n", file);
    for (int level = FINDING_FAULT; level >= FINDING_NOTE; level--)
        for (int i = 0; i < inspection->count; i++)
            if ((int)inspection->findings[i].level == level)
                write_row(file, &inspection->findings[i]);
    fputs("</table>\n", file);
    if (inspection->left_out)
        fprintf(file, "<p>And %d more.</p>\n", inspection->left_out);
}

static void write_grade(const struct check_page *page) {
    const struct check_settings *s = &page->check->settings;
    fprintf(page->file,
            "<p>Grade: <strong>%s</strong>. Field %s, grid %g mm, %d poses of the joint%s. Places "
            "are in the femur's frame, mm: x to the right, y anterior, z proximal.</p>\n",
            grade_name(page->check->grade), field_name(s->field.kind), s->spacing_mm,
            page->check->pose_count, s->quick ? ": a quick check" : "");
}

// A cell: how deep they overlap, or how far they are apart.
static void write_contact(FILE *file, const struct case_check *check,
                          const struct contact *contact) {
    fputs("<tr><td>", file);
    html_text(file, check->groups[contact->a]);
    fputs(", ", file);
    html_text(file, check->groups[contact->b]);
    fputs("</td>", file);
    for (int i = 0; i < contact->count; i++) {
        const struct contact_state *s = &contact->states[i];
        if (s->overlap.depth_mm > 0)
            fprintf(file, "<td class=\"n\">&minus;%.2f (%.0f)</td>", s->overlap.depth_mm,
                    s->overlap.volume_mm3);
        else if (contact->has_gap && isfinite(s->gap.mm))
            fprintf(file, "<td class=\"n\">%.2f</td>", s->gap.mm);
        else
            fputs("<td class=\"n\">apart</td>", file);
    }
    fputs("</tr>\n", file);
}

static void write_contacts(const struct check_page *page) {
    if (!page->check->contacts.count)
        return;
    fputs("<h2>Overlaps and gaps</h2>\n<p>Of bones and menisci, the joint at rest. A gap in mm; of "
          "an overlap the depth, negative, and in brackets its volume in mm<sup>3</sup>. Groups of "
          "one body do not move against each other.</p>\n<table>\n<tr><th></th>",
          page->file);
    for (int i = 0; i < CONTACT_FLEXIONS; i++)
        fprintf(page->file, "<th class=\"n\">%d&deg;</th>", i * CONTACT_STEP_DEG);
    fputs("</tr>\n", page->file);
    for (int i = 0; i < page->check->contacts.count; i++)
        write_contact(page->file, page->check, &page->check->contacts.all[i]);
    fputs("</table>\n", page->file);
}

static double per_cent(uint64_t part, uint64_t whole) {
    return whole ? 100 * (double)part / (double)whole : 0;
}

static void write_pose(FILE *file, const struct check_pose *at) {
    const struct field_figures *f = at->field;
    fputs("<tr><td>", file);
    html_text(file, at->name);
    if (at->is_still) {
        fputs("</td><td colspan=\"7\">nothing is displaced</td></tr>\n", file);
        return;
    }
    fprintf(file,
            "</td><td class=\"n\">%llu</td><td class=\"n\">%.2f</td><td class=\"n\">%.2f</td>"
            "<td class=\"n\">%.3g</td><td class=\"n\">%.3g</td><td class=\"n\">%.3g</td>"
            "<td class=\"n\">%.2f</td></tr>\n",
            (unsigned long long)f->looked, f->gain.value, field_gain_within(f, MOST),
            per_cent(field_own_folds(f), f->looked), per_cent(f->filled, f->looked),
            per_cent(f->faded, f->looked), f->jumped ? f->jump.value : 0);
}

static void write_poses(const struct check_page *page) {
    fputs("<h2>Poses</h2>\n<p>Shares are of the reachable space in which something is displaced. A "
          "gap is filled where displacements leave less than a tenth of it: no field could do "
          "without a fold there. The field fades where only one surface is near; it folds there if "
          "that is displaced by as much as the field reaches.</p>\n"
          "<table>\n<tr><th>pose</th><th class=\"n\">places</th><th class=\"n\">largest gain</th>"
          "<th class=\"n\">99.9 % within</th><th class=\"n\">folds, %</th>"
          "<th class=\"n\">gap filled, %</th><th class=\"n\">fading, %</th>"
          "<th class=\"n\">jump, mm</th></tr>\n",
          page->file);
    for (int i = 0; i < page->check->pose_count; i++)
        write_pose(page->file, &page->check->poses[i]);
    fputs("</table>\n", page->file);
}

// ---- plots --------------------------------------------------------------------------------------

struct series {
    int count;
    double x[CHECK_POSES_MAX], gain[CHECK_POSES_MAX], most[CHECK_POSES_MAX], folds[CHECK_POSES_MAX];
};

static struct series series_of(const struct case_check *check, bool keys) {
    struct series s = {0};
    for (int i = 0; i < check->pose_count; i++) {
        const struct check_pose *at = &check->poses[i];
        if ((at->key >= 0) != keys)
            continue;
        s.x[s.count] = at->joint.flexion_deg;
        s.gain[s.count] = at->field->gain.value;
        s.most[s.count] = field_gain_within(at->field, MOST);
        s.folds[s.count++] = per_cent(at->field->folded, at->field->looked);
    }
    return s;
}

static void plot_over_flexion(const struct check_page *page, const char *title, const char *y_title,
                              const struct plot_line *lines, int count, const char *caption) {
    struct plot plot = {.title = title,
                        .description = caption,
                        .width = 560,
                        .height = 320,
                        .x = {"flexion, degrees", 0, 120},
                        .y = {y_title, 0, 0},
                        .lines = lines,
                        .line_count = count};
    double top = 0;
    for (int i = 0; i < count; i++)
        for (size_t k = 0; k < lines[i].count; k++)
            top = fmax(top, lines[i].y[k]);
    plot.y.max = top > 0 ? 1.08 * top : 1;
    html_plot(page->file, &plot, caption);
}

static void write_plots(const struct check_page *page) {
    struct series rest = series_of(page->check, false), keys = series_of(page->check, true);
    size_t n = (size_t)rest.count, k = (size_t)keys.count;
    struct plot_line gains[] = {
        {"largest, at rest", NULL, rest.x, rest.gain, n, PLOT_BLUE, PLOT_SOLID},
        {"99.9 % within, at rest", NULL, rest.x, rest.most, n, PLOT_BLUE, PLOT_DASHED},
        {"largest, in key poses", NULL, keys.x, keys.gain, k, PLOT_ORANGE, PLOT_POINTS},
        {"99.9 % within, in key poses", NULL, keys.x, keys.most, k, PLOT_PURPLE, PLOT_POINTS}};
    struct plot_line folds[] = {
        {"at rest", NULL, rest.x, rest.folds, n, PLOT_BLUE, PLOT_SOLID},
        {"in key poses", NULL, keys.x, keys.folds, k, PLOT_ORANGE, PLOT_POINTS}};
    fputs("<h2>Over flexion</h2>\n<div class=\"row\">\n", page->file);
    plot_over_flexion(page, "Gain", "mm of warp a mm of hand", gains, k ? 4 : 2,
                      "How fast the displacement changes with the hand.");
    plot_over_flexion(page, "Folds", "% of the warped space", folds, k ? 2 : 1,
                      "Where the warped tip goes backwards as the hand goes forwards.");
    fputs("</div>\n", page->file);
}

static void write_opening(const struct check_page *page, const struct opening *o,
                          const char *name) {
    char title[CASE_NAME_MAX + 48], unit[64];
    snprintf(title, sizeof title, "%s torn: %s", name, o->coordinate);
    snprintf(unit, sizeof unit, "%s, %s", o->coordinate, o->unit);
    struct plot_line lines[] = {
        {"mock-up, held", NULL, o->flexion, o->physical, OPENING_STEPS, PLOT_GREY, PLOT_DASHED},
        {"shown", NULL, o->flexion, o->shown, OPENING_STEPS, PLOT_BLUE, PLOT_SOLID},
        {"targets of its keys", NULL, o->key_flexion, o->key_target, (size_t)o->key_count,
         PLOT_ORANGE, PLOT_POINTS}};
    plot_over_flexion(page, title, unit, lines, 3,
                      "The mock-up's joint held against the ligament's end, and what is shown.");
}

static void write_openings(const struct check_page *page) {
    const struct knee_case *knee = scene_case(page->scene);
    if (!page->check->opening_count)
        return;
    fputs("<h2>Torn ligaments</h2>\n<div class=\"row\">\n", page->file);
    for (int i = 0; i < page->check->opening_count; i++)
        write_opening(page, &page->check->openings[i], knee->torn[i]);
    fputs("</div>\n", page->file);
}

// ---- sections -----------------------------------------------------------------------------------

static enum result write_section(const struct check_page *page, const struct check_pose *at,
                                 enum section_kind kind, struct error *err) {
    struct section section;
    struct picture picture;
    char caption[256];
    enum result result =
        section_make(page->scene, &page->check->settings, &at->joint, kind, CELL_MM, &section, err);
    if (result != RESULT_OK)
        return result;
    section_picture(&section, page->check, page->gain_most, &picture);
    bool right = scene_case(page->scene)->joint.side == SIDE_RIGHT;
    snprintf(caption, sizeof caption, "%s: %s, at %c = %.1f; %s to the right", at->name,
             section_name(kind), kind == SECTION_CORONAL ? 'y' : 'x', section.at,
             kind != SECTION_CORONAL ? "front"
             : right                 ? "lateral"
                                     : "medial");
    result = html_picture(page->file, &picture, caption, caption, err);
    picture_fini(&picture);
    section_fini(&section);
    return result;
}

static enum result write_sections_at(const struct check_page *page, const struct check_pose *at,
                                     struct error *err) {
    enum result result = RESULT_OK;
    fputs("<div class=\"row\">\n", page->file);
    for (int kind = 0; kind < SECTION_KIND_COUNT && result == RESULT_OK; kind++)
        result = write_section(page, at, (enum section_kind)kind, err);
    fputs("</div>\n", page->file);
    return result;
}

static enum result write_legend(const struct check_page *page, struct error *err) {
    struct picture scale;
    char caption[512];
    section_scale(&scale);
    snprintf(caption, sizeof caption,
             "Gain from 0 to %.1f and more. Green: folds. Hatched: left out, within %.1f mm of a "
             "second group. White: not displaced. Lines: grey, the surfaces of the mock-up; red, "
             "where they are shown; blue and thick, facing surfaces that are displaced into each "
             "other; light blue, ones whose displacements differ by more than their gap.",
             page->gain_most, SECOND_GROUP_MM);
    enum result result = html_picture(page->file, &scale, "colours of gain", caption, err);
    picture_fini(&scale);
    return result;
}

// At rest at 0, 30, 60 and 90 degrees where something is displaced, and with each torn ligament
// held in its first key.
static bool is_drawn(const struct check_page *page, int index) {
    const struct check_pose *at = &page->check->poses[index];
    if (at->is_still)
        return false;
    if (at->key < 0)
        return at->joint.flexion_deg <= 90 && fmod(at->joint.flexion_deg, 30) == 0;
    const struct knee_case *knee = scene_case(page->scene);
    for (int i = 0; i < index; i++)
        if (page->check->poses[i].key >= 0 &&
            knee->keys[page->check->poses[i].key].ligament == knee->keys[at->key].ligament)
            return false;
    return true;
}

static enum result write_sections(const struct check_page *page, struct error *err) {
    fputs("<h2>Sections</h2>\n<p>Through the contacts of femur and tibia, 100 mm wide, in the "
          "tibia's frame.</p>\n",
          page->file);
    enum result result = write_legend(page, err);
    for (int i = 0; i < page->check->pose_count && result == RESULT_OK; i++)
        if (is_drawn(page, i))
            result = write_sections_at(page, &page->check->poses[i], err);
    return result;
}

// ---- the page -----------------------------------------------------------------------------------

static enum result write_check_page(const struct check_page *page, struct error *err) {
    write_grade(page);
    write_findings(page->file, &page->check->findings);
    write_contacts(page);
    if (!page->scene || !page->check->field->looked)
        return RESULT_OK;
    write_plots(page);
    write_openings(page);
    enum result result = write_sections(page, err);
    write_poses(page);
    return result;
}

enum result check_report(const struct case_check *check, const struct scene *scene,
                         const char *path, struct error *err) {
    char title[PATH_MAX + 16];
    struct check_page page = {check, scene, fopen(path, "we"), 0};
    if (!page.file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    page.gain_most = fmax(1, ceil(field_gain_within(check->field, MOST)));
    snprintf(title, sizeof title, "Case %s, checked", check->case_or_folder);
    html_begin(page.file, title);
    enum result result = write_check_page(&page, err);
    html_end(page.file);
    bool bad = ferror(page.file);
    if ((fclose(page.file) || bad) && result == RESULT_OK)
        result = fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return result;
}
