#include "case_check_report.h"

#include "report/html.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static void write_row(FILE *file, const struct finding *finding) {
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
}

static void write_grade(FILE *file, const struct check *check) {
    const struct check_settings *s = &check->settings;
    fprintf(file,
            "<p>Grade: <strong>%s</strong>. Field %s, grid %g mm, %d poses of the joint%s.</p>\n",
            grade_name(check->grade), field_name(s->field.kind), s->spacing_mm, check->pose_count,
            s->quick ? ": a quick check" : "");
}

enum result check_report(const struct check *check, const struct scene *scene, const char *path,
                         struct error *err) {
    char title[CASE_NAME_MAX + 16];
    FILE *file = fopen(path, "we");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    snprintf(title, sizeof title, "Case %s, checked", check->case_name);
    html_begin(file, title);
    write_grade(file, check);
    write_findings(file, &check->findings);
    (void)scene;
    html_end(file);
    int bad = ferror(file);
    if (fclose(file) || bad)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}
