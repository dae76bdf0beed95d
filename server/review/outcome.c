#include "review/outcome.h"

#include "base/clock.h"
#include "metrics/subject.h"
#include "report/html.h"

#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>

static const char *many(uint64_t count) {
    return count == 1 ? "" : "s";
}

// "steady-camera": as people write it.
static void write_task(FILE *file, const char *name) {
    char words[TRACE_TASK_NAME_MAX];
    snprintf(words, sizeof words, "%s", name);
    for (char *at = words; *at; at++)
        if (*at == '-' || *at == '_')
            *at = ' ';
    words[0] = (char)toupper((unsigned char)words[0]);
    html_text(file, words);
}

static void write_attempt(FILE *file, const struct survey_attempt *attempt) {
    static const char *const verdicts[] = {"no verdict", "passed", "not yet passed"};
    static const char *const ends[] = {"",
                                       "",
                                       ", time over",
                                       ", a grave error ended it",
                                       ", its trainee ended it",
                                       ", another ended it"};
    const struct trace_outcome *o = &attempt->ended;
    fputs("<p><strong>", file);
    write_task(file, attempt->begun.task);
    fputs(attempt->begun.purpose == ATTEMPT_EXAM ? "</strong> (exam): " : "</strong>: ", file);
    if (o->number)
        fprintf(file, "%s. %" PRIu32 " goal%s met, %" PRIu32 " error%s, %.1f s%s.</p>\n",
                verdicts[o->verdict], o->goals_met, many(o->goals_met), o->errors, many(o->errors),
                (double)o->time_ns / (double)NS_PER_S, ends[o->end]);
    else
        fputs("the record has no end of it.</p>\n", file);
}

static void write_cuts(FILE *file, const struct survey *survey, const struct knee_case *knee,
                       int tissue) {
    const struct tissue_figures *f = &survey->tissues[tissue];
    const struct quality_report *q = &f->quality;
    char name[SUBJECT_LABEL_MAX];
    subject_tissue_label(knee, tissue, name);
    fputs("<p><strong>", file);
    html_text(file, name);
    fputs("</strong>: ", file);
    if (q->planned_mm3 > 0)
        fprintf(file, "%.1f of %.1f mm³ planned removed, %.1f mm³ too much.",
                fmax(0, q->planned_mm3 - q->under_mm3), q->planned_mm3, q->over_mm3);
    else
        fprintf(file, "%.1f mm³ removed.", q->removed_mm3 + f->pieces_mm3);
    if (metrics_has_zones(knee, tissue))
        fprintf(file, " Thinnest remaining rim %.1f mm.", q->rim_mm);
    fprintf(file, " %" PRIu32 " cut%s.</p>\n", f->cuts, many(f->cuts));
}

void report_outcome(FILE *file, const struct survey *survey, const struct knee_case *knee) {
    uint64_t attempts = survey_attempts(survey);
    bool any = attempts > 0;
    fputs("<h2>Outcome</h2>\n", file);
    for (uint64_t i = 0; i < attempts; i++)
        write_attempt(file, &survey->attempts[i]);
    if (survey->attempt_count > attempts)
        fprintf(file, "<p>%" PRIu64 " more attempts are in the trace.</p>\n",
                survey->attempt_count - attempts);
    for (int i = 0; i < TISSUES_MAX; i++) {
        if (survey_is_resected(survey, i))
            write_cuts(file, survey, knee, i);
        any = any || survey_is_resected(survey, i);
    }
    if (!any)
        fputs("<p>Nothing was cut.</p>\n", file);
}
