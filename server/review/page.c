#include "review/page.h"

#include "base/check.h"
#include "base/clock.h"
#include "metrics/subject.h"
#include "report/html.h"
#include "report/strip.h"
#include "review/cohort.h"
#include "review/outcome.h"
#include "review/plots.h"
#include "review/words.h"
#include "step/settings.h"

#include <ctype.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MARKERS_MOST 100 // that are listed

struct review_page {
    FILE *file;
    const struct trace_header *header;
    const struct knee_case *knee; // NULL: groups have no names
    struct survey survey;
    struct metrics metrics;
    struct report_lines lines;
    bool beside; // others
    const char *course;
    bool hide_few;
    struct cohort cohort;
    char seal[TRACE_SIGNED_BY_MAX + sizeof((struct error){0}).text];
};

// ---- words --------------------------------------------------------------------------------------

// Texts come from a file: what is no UTF-8 cannot be shown.
static const char *shown(const char *text) {
    json_t *value = json_string(text);
    json_decref(value);
    return value ? text : "(not UTF-8)";
}

static void write_row(FILE *file, const char *name, const char *text) {
    fprintf(file, "<tr><th>%s</th><td>", name);
    html_text(file, text);
    fputs("</td></tr>\n", file);
}

__attribute__((format(printf, 3, 4))) static void write_fact(FILE *file, const char *name,
                                                             const char *format, ...) {
    char text[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    write_row(file, name, text);
}

static void write_origin(const struct review_page *page) {
    const struct trace_header *h = page->header;
    char start[32];
    time_t seconds = (time_t)(h->start_utc_ns / NS_PER_S);
    struct tm utc;
    strftime(start, sizeof start, "%Y-%m-%d %H:%M:%S UTC", gmtime_r(&seconds, &utc));
    fputs("<table>\n", page->file);
    write_row(page->file, "Trainee", shown(h->trainee));
    write_row(page->file, "Case", shown(h->case_name));
    write_row(page->file, "Station", shown(h->station));
    write_row(page->file, "Start", start);
    write_fact(page->file, "Length", "%.2f s", survey_seconds(&page->survey));
    fputs("</table>\n", page->file);
    if (page->survey.end != RESULT_CLOSED)
        fputs("<p>The record is not whole: this page ends where it does.</p>\n", page->file);
}

// Where the page's figures come from.
static void write_record(const struct review_page *page) {
    const struct survey *s = &page->survey;
    const struct trace_header *h = page->header;
    const struct session_settings *settings = &h->settings;
    char id[33];
    for (size_t i = 0; i < sizeof h->session_id; i++)
        snprintf(id + 2 * i, 3, "%02x", h->session_id[i]);
    fputs("<h2>Record</h2>\n<table>\n", page->file);
    write_row(page->file, "Session", id);
    write_row(page->file, "State", session_state_name(s->state));
    write_fact(page->file, "Steps", "%" PRIu64 ", %" PRIu64 " missing", s->steps, s->missing);
    if (s->resumes)
        write_fact(page->file, "Resumed", "%" PRIu64 " times after its server was killed",
                   s->resumes);
    write_fact(page->file, "Warp", "%s, strength %g, ligaments %s, instruments %s",
               field_name(settings->field.kind), settings->field.strength,
               adaptive_name(settings->adaptive), avatar_mode_name(settings->avatar));
    write_row(page->file, "Record", s->end == RESULT_CLOSED ? "whole" : "not whole");
    if (s->end != RESULT_CLOSED)
        write_row(page->file, "Why", shown(error_without_folder(s->why.text)));
    write_row(page->file, "Signature", shown(page->seal));
    fputs("</table>\n", page->file);
}

// ---- markers ------------------------------------------------------------------------------------

static void write_marker(const struct review_page *page, const struct marker *marker) {
    double seconds = (double)(marker->time_ns - page->header->start_ns) / (double)NS_PER_S;
    fprintf(page->file, "<tr><td>%.3f s</td><td>%s</td><td>", seconds, marker->name);
    html_text(page->file, shown(marker->device));
    fprintf(page->file, "</td><td>%.6g</td></tr>\n", marker->value);
}

static void write_markers(const struct review_page *page) {
    const struct survey *s = &page->survey;
    uint64_t most = s->marker_count < MARKERS_MOST ? s->marker_count : MARKERS_MOST;
    if (!s->marker_count)
        return;
    fputs("<h2>Markers</h2>\n<table>\n<tr><th>time</th><th>marker</th><th>device</th>"
          "<th>value</th></tr>\n",
          page->file);
    for (uint64_t i = 0; i < most; i++)
        write_marker(page, &s->markers[i]);
    fputs("</table>\n", page->file);
    if (s->marker_count > most)
        fprintf(page->file, "<p>%" PRIu64 " more are in the trace.</p>\n", s->marker_count - most);
}

// ---- sections -----------------------------------------------------------------------------------

static void write_instruments(const struct review_page *page) {
    fputs("<h2>Instruments</h2>\n<p>Long lines are thinned; no peak is lost. The femur's frame: x "
          "to the right, y anterior, z proximal.</p>\n",
          page->file);
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        if (!page->survey.present[i])
            continue;
        fprintf(page->file, "<h3>%s</h3>\n<div class=\"row\">\n",
                page->header->settings.instruments.of[i].name);
        report_plot_tip(page->file, &page->lines.tips[i]);
        if (page->lines.forces[i].any)
            report_plot_force(page->file, &page->lines.forces[i]);
        fputs("</div>\n", page->file);
    }
}

static void write_joint(const struct review_page *page) {
    fputs("<h2>Joint</h2>\n<div class=\"row\">\n", page->file);
    report_plot_joint(page->file, &page->lines);
    fputs("</div>\n", page->file);
}

// ---- resection ----------------------------------------------------------------------------------

// Sessions of earlier rules did not measure it.
static bool tells_mismatch(const struct review_page *page) {
    return page->header->settings.rules >= RULES_TOUCH_FITTED;
}

static void write_value(FILE *file, double value) {
    fprintf(file, "<td class=\"n\">%.2f</td>", fabs(value) < 0.005 ? 0 : value); // never -0.00
}

static void write_resection_row(const struct review_page *page, int tissue) {
    const struct tissue_figures *f = &page->survey.tissues[tissue];
    const double figures[] = {
        f->volume_mm3,       f->quality.removed_mm3, f->pieces_mm3, f->quality.planned_mm3,
        f->quality.over_mm3, f->quality.under_mm3,   f->left_mm3};
    const double of_zones[] = {f->quality.rim_mm, f->quality.step_mm};
    char name[SUBJECT_LABEL_MAX];
    subject_tissue_label(page->knee, tissue, name);
    fputs("<tr><td>", page->file);
    html_text(page->file, name);
    fprintf(page->file,
            "</td><td class=\"n\">%" PRIu32 "</td><td class=\"n\">%" PRIu32
            "</td><td class=\"n\">%" PRIu32 "</td>",
            f->cuts, f->refused, f->pieces);
    for (size_t i = 0; i < sizeof figures / sizeof figures[0]; i++)
        write_value(page->file, figures[i]);
    for (size_t i = 0; i < sizeof of_zones / sizeof of_zones[0]; i++)
        if (metrics_has_zones(page->knee, tissue))
            write_value(page->file, of_zones[i]);
        else
            fputs("<td class=\"n\">-</td>", page->file);
    fputs("</tr>\n", page->file);
}

static void write_tissue_plots(const struct review_page *page, int tissue) {
    char title[SUBJECT_LABEL_MAX + 32], name[SUBJECT_LABEL_MAX];
    const struct tissue_lines *lines = &page->lines.tissues[tissue];
    subject_tissue_label(page->knee, tissue, name);
    snprintf(title, sizeof title, "%s: volume", name);
    report_plot_volume(page->file, title, lines);
    snprintf(title, sizeof title, "%s: touch and sight", name);
    if (tells_mismatch(page))
        report_plot_mismatch(page->file, title, lines);
}

static void write_mismatch(const struct review_page *page) {
    fputs("<table>\n<tr><th>tissue</th><th class=\"n\">touched where nothing is seen, mm³</th>"
          "<th class=\"n\">seen where nothing is touched, mm³</th></tr>\n",
          page->file);
    for (int i = 0; i < TISSUES_MAX; i++) {
        const struct tissue_figures *f = &page->survey.tissues[i];
        char name[SUBJECT_LABEL_MAX];
        if (!survey_is_resected(&page->survey, i))
            continue;
        subject_tissue_label(page->knee, i, name);
        fputs("<tr><td>", page->file);
        html_text(page->file, name);
        fputs("</td>", page->file);
        write_value(page->file, f->touched_unseen_mm3);
        write_value(page->file, f->seen_untouched_mm3);
        fputs("</tr>\n", page->file);
    }
    fputs("</table>\n", page->file);
}

static void write_resection(const struct review_page *page) {
    static const char *const heads[] = {
        "cuts",      "refused", "pieces",           "left, mm³",      "by blades",
        "in pieces", "planned", "removed too much", "left to remove", "feel not yet adapted",
        "rim, mm",   "step, mm"};
    bool any = false;
    for (int i = 0; i < TISSUES_MAX; i++)
        any = any || survey_is_resected(&page->survey, i);
    if (!any)
        return;
    fputs("<h2>Resection</h2>\n<table>\n<tr><th>tissue</th>", page->file);
    for (size_t i = 0; i < sizeof heads / sizeof heads[0]; i++)
        fprintf(page->file, "<th class=\"n\">%s</th>", heads[i]);
    fputs("</tr>\n", page->file);
    for (int i = 0; i < TISSUES_MAX; i++)
        if (survey_is_resected(&page->survey, i))
            write_resection_row(page, i);
    fputs("</table>\n", page->file);
    if (tells_mismatch(page))
        write_mismatch(page);
    fputs("<div class=\"row\">\n", page->file);
    for (int i = 0; i < TISSUES_MAX; i++)
        if (page->lines.tissues[i].landed)
            write_tissue_plots(page, i);
    fputs("</div>\n", page->file);
}

// ---- figures ------------------------------------------------------------------------------------

// Of so few, quartiles and a box would say more than there is.
#define FEW 5

static void write_few(FILE *file, const double *values, size_t count) {
    fprintf(file, "<td class=\"n\">%zu</td><td colspan=\"2\">", count);
    for (size_t i = 0; i < count; i++)
        fprintf(file, "%s%.4g", i ? ", " : "", values[i]);
    fputs("</td>", file);
}

static void write_spread(FILE *file, const double *values, size_t count, double value) {
    fprintf(file, "<td class=\"n\">%zu</td>", count);
    if (values[0] == values[count - 1] && value == values[0]) {
        fprintf(file, "<td colspan=\"2\">all %.4g</td>", value);
        return;
    }
    fprintf(file, "<td class=\"n\">%.4g &middot; <b>%.4g</b> &middot; %.4g</td><td>",
            strip_quantile(values, count, 0.25), strip_quantile(values, count, 0.5),
            strip_quantile(values, count, 0.75));
    strip_write(file, &(struct strip){values, count, value});
    fputs("</td>", file);
}

static void write_beside(const struct review_page *page, const struct metric_kind *kind,
                         const char *about, double value) {
    const struct spread *spread = cohort_find(&page->cohort, kind, about);
    if (!spread || !isfinite(value)) {
        fprintf(page->file, "<td class=\"n\">%s</td><td colspan=\"2\">-</td>",
                page->hide_few ? "few" : "0");
        return;
    }
    const double *values = page->cohort.values + spread->first;
    if (spread->count < FEW)
        write_few(page->file, values, spread->count);
    else
        write_spread(page->file, values, spread->count, value);
}

// "probe Femur from 0.5 mm", "Medial meniscus posterior_horn.outer": as people write it.
static void make_words(char *label) {
    for (char *at = label; *at; at++)
        if (*at == '_' || (*at == '.' && isalpha((unsigned char)at[1])))
            *at = ' ';
    if (isalpha((unsigned char)*label))
        *label = (char)toupper((unsigned char)*label);
}

static const char *unit_words(const char *unit) {
    if (strcmp(unit, "1") == 0 || strcmp(unit, "count") == 0)
        return "";
    return strcmp(unit, "mm3") == 0 ? "mm³" : unit;
}

static void write_figure(void *context, const struct metric_value *v) {
    const struct review_page *page = context;
    const struct metric_kind *kind = &metric_kinds[v->metric];
    char about[SUBJECT_MAX], label[SUBJECT_LABEL_MAX], value[48] = "-";
    if (v->depth >= 0 && v->value == 0)
        return; // nearly all are
    subject_text(page->knee, v, about);
    subject_label(page->knee, v, label);
    if (isfinite(v->value))
        snprintf(value, sizeof value, v->below_floor ? "(%.4g)" : "%.4g", v->value);
    fprintf(
        page->file,
        "<tr><td title=\"%s\">%s</td><td class=\"n\">%d</td><td class=\"n\">%s</td><td>%s</td><td>",
        kind->name, review_metric_words(v->metric), kind->version, value, unit_words(kind->unit));
    make_words(label);
    html_text(page->file, label);
    fputs("</td>", page->file);
    if (page->beside)
        write_beside(page, kind, about, v->value);
    fputs("</tr>\n", page->file);
}

static void write_whose(const struct review_page *page) {
    fputs("<p>Beside each: the same figure, of the same version, of the sessions", page->file);
    if (page->course) {
        fputs(" of the trainees of course ", page->file);
        html_text(page->file, shown(page->course));
    }
    fputs(" on case ", page->file);
    html_text(page->file, shown(page->header->case_name));
    fprintf(page->file,
            " that the records have, this one too where they have it; how many these are, their "
            "quartiles with the median in the middle, and where this session (the diamond) stands "
            "among them. Of fewer than %d %s.</p>\n",
            page->hide_few ? STORE_TRAINEES_MIN : FEW,
            page->hide_few
                ? "trainees, nothing; the others' figures are rounded means of groups of at "
                  "least as many trainees"
                : "sessions, the figures themselves");
}

static void write_figures(const struct review_page *page) {
    fprintf(
        page->file,
        "<h2>Figures</h2>\n<p>As of arthron-trace score, with an optic of %g degrees and a field "
        "of %g. (&hellip;): too little data, noise may have made a tenth of it.</p>\n",
        page->metrics.optic.tilt_deg, page->metrics.optic.field_deg);
    if (page->beside)
        write_whose(page);
    fprintf(page->file,
            "<table>\n<tr><th>figure</th><th class=\"n\">version</th><th class=\"n\">value</th>"
            "<th>unit</th><th>of</th>%s</tr>\n",
            page->beside ? "<th class=\"n\">n</th><th class=\"n\">quartiles</th><th>among them</th>"
                         : "");
    metrics_each(&page->metrics, page->knee, write_figure, (void *)page);
    fputs("</table>\n", page->file);
}

// ---- the page -----------------------------------------------------------------------------------

static void describe_seal(const struct trace_reader *reader, struct review_page *page) {
    struct trace_seal seal;
    struct error why;
    char by[TRACE_SIGNED_BY_MAX];
    if (!trace_reader_seal(reader, &seal))
        snprintf(page->seal, sizeof page->seal, "none");
    else if (trace_seal_check(&seal, NULL, page->header->start_utc_ns, by, &why) == RESULT_OK)
        snprintf(page->seal, sizeof page->seal, "of %s; no authority was asked", by);
    else
        snprintf(page->seal, sizeof page->seal, "bad: %s", why.text);
}

static enum result read_all(struct trace_reader *reader, const struct review_source *source,
                            struct review_page *page, struct error *err) {
    struct trace_reader *again;
    survey_read(reader, source->progress, &page->survey);
    describe_seal(reader, page);
    if (page->survey.end == RESULT_IO)
        return fail(err, RESULT_IO, "%s", page->survey.why.text);
    enum result result = trace_reader_create(source->trace, &again, err);
    if (result != RESULT_OK)
        return result;
    metrics_init(&page->metrics, &page->header->settings.instruments, page->header->optic);
    result = report_lines_read(again, &page->survey, source->progress, &page->lines, &page->metrics,
                               err);
    trace_reader_destroy(&again);
    if (result != RESULT_OK)
        return result;
    page->beside = source->records != NULL;
    page->course = source->course;
    page->hide_few = source->hide_few;
    return page->beside ? cohort_read(source->records, page->header->case_name, source->course,
                                      source->hide_few, &page->cohort, err)
                        : RESULT_OK;
}

static void write_page(struct review_page *page) {
    html_begin(page->file, "Session report");
    write_origin(page);
    report_outcome(page->file, &page->survey, page->knee);
    write_resection(page);
    write_figures(page);
    write_instruments(page);
    write_joint(page);
    write_markers(page);
    write_record(page);
    html_end(page->file);
}

static enum result review(struct trace_reader *reader, const struct review_source *source,
                          FILE *file, bool *out_whole, struct error *err) {
    struct review_page *page = alloc(1, sizeof *page);
    page->file = file;
    page->header = trace_reader_header(reader);
    struct knee_case *read =
        source->find_case ? NULL : review_case(page->header, source->case_dir, err);
    page->knee =
        source->find_case ? source->find_case(source->user, page->header->case_hash) : read;
    enum result result = page->knee || !source->case_dir ? RESULT_OK : RESULT_INVALID;
    if (result == RESULT_OK)
        result = read_all(reader, source, page, err);
    if (result == RESULT_OK)
        write_page(page);
    *out_whole = page->survey.end == RESULT_CLOSED && !page->survey.missing;
    case_destroy(&read);
    cohort_fini(&page->cohort);
    free(page);
    return result;
}

enum result review_write_page(const struct review_source *source, FILE *file, bool *out_whole,
                              struct error *err) {
    struct trace_reader *reader;
    *out_whole = false;
    enum result result = trace_reader_create(source->trace, &reader, err);
    if (result != RESULT_OK)
        return result;
    result = review(reader, source, file, out_whole, err);
    trace_reader_destroy(&reader);
    return result;
}

struct knee_case *review_case(const struct trace_header *header, const char *case_dir,
                              struct error *err) {
    struct case_limits limits = case_limits_default();
    const char *dir = case_dir ? case_dir : header->case_dir;
    struct knee_case *knee;
    if (case_load(dir, &limits, &knee, err) != RESULT_OK)
        return NULL;
    if (knee->hash == header->case_hash)
        return knee;
    fail(err, RESULT_INVALID, "%s: not the case of this trace", dir);
    case_destroy(&knee);
    return NULL;
}
