#include "study/tables.h"

#include "base/csv.h"

#include <string.h>

#define SESSION                                                                                    \
    { "session", NULL, CELL_AS_IT_IS, "text", "", "id of the session", "never" }
#define NUMBER                                                                                     \
    {                                                                                              \
        "number", NULL, CELL_AS_IT_IS, "integer", "",                                              \
            "number of the attempt within the session, from 1", "never"                            \
    }
#define TRAINEE                                                                                    \
    {                                                                                              \
        "trainee", NULL, CELL_TRAINEE, "text", "",                                                 \
            "who tried: the trainee's number in the records, or the name if it was asked for",     \
            "never"                                                                                \
    }

static const struct study_column attempts[] = {
    SESSION,
    NUMBER,
    TRAINEE,
    {"station", NULL, CELL_AS_IT_IS, "text", "",
     "where; as in all text, an apostrophe comes before =, +, - or @ at the start", "never"},
    {"task", NULL, CELL_AS_IT_IS, "text", "", "the task's name: that of its file", "never"},
    {"task_version", NULL, CELL_AS_IT_IS, "integer", "", "the version that the task's file names",
     "never"},
    {"title", NULL, CELL_AS_IT_IS, "text", "", "the task's title", "never"},
    {"task_hash", "file_hash", CELL_AS_IT_IS, "text", "", "SHA-256 of the task's file", "never"},
    {"case", NULL, CELL_AS_IT_IS, "text", "", "the case", "never"},
    {"case_hash", NULL, CELL_AS_IT_IS, "text", "", "XXH3 of the case, 16 hexadecimal digits",
     "never"},
    {"purpose", NULL, CELL_AS_IT_IS, "text", "", "practice or exam", "never"},
    {"hand", NULL, CELL_AS_IT_IS, "text", "", "the hand that held the arthroscope: right or left",
     "never"},
    {"begun_utc", "begun_utc_ns", CELL_TIME, "time", "UTC", "when it began, ISO 8601", "never"},
    {"first_step", NULL, CELL_AS_IT_IS, "integer", "", "its first step in the session's trace",
     "never"},
    {"last_step", NULL, CELL_AS_IT_IS, "integer", "", "its last step in the session's trace",
     "never"},
    {"time_s", NULL, CELL_AS_IT_IS, "number", "s", "how long it took, without pauses", "never"},
    {"goals", NULL, CELL_AS_IT_IS, "integer", "", "goals of the task", "never"},
    {"goals_met", NULL, CELL_AS_IT_IS, "integer", "", "goals that were met", "never"},
    {"errors", NULL, CELL_AS_IT_IS, "integer", "", "errors, each occurrence counted", "never"},
    {"sentinel", NULL, CELL_SWITCH, "switch", "", "1: an error ended it that fails any attempt",
     "never"},
    {"verdict", NULL, CELL_AS_IT_IS, "text", "", "passed or not yet", "never"},
    {"end", NULL, CELL_AS_IT_IS, "text", "", "done, time out, sentinel error, left or stopped",
     "never"},
    {"pass_time_s", NULL, CELL_AS_IT_IS, "number", "s",
     "the pass mark that it was judged by: the longest time", "never"},
    {"pass_errors", NULL, CELL_AS_IT_IS, "integer", "",
     "the pass mark that it was judged by: the most errors", "never"},
    {"mark_version", NULL, CELL_AS_IT_IS, "integer", "",
     "version of the pass mark; 0: the one of the task's file", "never"},
    {"exam", NULL, CELL_AS_IT_IS, "integer", "", "number of the exam", "it belongs to no exam"},
    {0},
};

static const struct study_column figures[] = {
    SESSION,
    NUMBER,
    {"figure", NULL, CELL_AS_IT_IS, "text", "",
     "name of a figure of the attempt with its unit at the end: goals.NAME.met_s is when a goal "
     "was met, resections.TISSUE.over_mm3 what was cut beyond the plan",
     "never"},
    {"value", NULL, CELL_AS_IT_IS, "number", "that of the figure", "its value",
     "there is none: the goal was not met"},
    {0},
};

static const struct study_column errors[] = {
    SESSION,
    NUMBER,
    {"error", NULL, CELL_AS_IT_IS, "text", "", "name of the error in the task's file", "never"},
    {"tool", NULL, CELL_AS_IT_IS, "text", "", "the instrument", "the error is of no instrument"},
    {"step", NULL, CELL_AS_IT_IS, "integer", "", "the step in the session's trace", "never"},
    {"time_s", NULL, CELL_AS_IT_IS, "number", "s", "since the attempt began", "never"},
    {0},
};

#define LEVEL(name, meaning)                                                                       \
    { name, NULL, CELL_AS_IT_IS, "integer", "1 to 5", meaning, "never" }
static const struct study_column ratings[] = {
    SESSION,
    NUMBER,
    {"rater", NULL, CELL_RATER, "text", "",
     "who rated: a number that holds within this archive, or the name if it was asked for",
     "the rater's account is gone"},
    {"rated_utc", "utc_ns", CELL_TIME, "time", "UTC", "when, ISO 8601", "never"},
    LEVEL("safety", "ASSET: safety"),
    LEVEL("field_of_view", "ASSET: field of view"),
    LEVEL("camera_dexterity", "ASSET: camera dexterity"),
    LEVEL("instrument_dexterity", "ASSET: instrument dexterity"),
    LEVEL("bimanual_dexterity", "ASSET: bimanual dexterity"),
    LEVEL("flow", "ASSET: flow of the procedure"),
    LEVEL("quality", "ASSET: quality of the procedure"),
    {"autonomy", NULL, CELL_AS_IT_IS, "integer", "1 to 3", "ASSET: autonomy", "never"},
    {0},
};

static const struct study_column results[] = {
    SESSION,
    {"metric", NULL, CELL_AS_IT_IS, "text", "",
     "name of a metric of the whole session (METRICS.md)", "never"},
    {"subject", NULL, CELL_AS_IT_IS, "text", "", "of what: an instrument, a tissue",
     "of the session as a whole"},
    {"version", NULL, CELL_AS_IT_IS, "integer", "", "of the metric's definition", "never"},
    {"unit", NULL, CELL_AS_IT_IS, "text", "", "unit of the value", "it is a number"},
    {"value", NULL, CELL_AS_IT_IS, "number", "that of the row", "its value", "it is not finite"},
    {0},
};

const struct study_table study_tables[TABLE_COUNT] = {
    [TABLE_ATTEMPTS] = {"attempts.csv", "attempts, newest first", attempts},
    [TABLE_FIGURES] = {"figures.csv", "figures of attempts", figures},
    [TABLE_ERRORS] = {"errors.csv",
                      "occurrences of errors: the first 64 of an attempt, whose row counts all",
                      errors},
    [TABLE_RATINGS] = {"ratings.csv", "ratings of attempts", ratings},
    [TABLE_RESULTS] = {"results.csv", "metrics of the sessions with these attempts", results},
};

// ---- writing ------------------------------------------------------------------------------------

static void put_end(FILE *file, bool last) {
    fputs(last ? "\r\n" : ",", file);
}

void study_put_text(FILE *file, const char *text, bool last) {
    csv_put_text(file, text);
    put_end(file, last);
}

void study_put_number(FILE *file, double value, bool last) {
    fprintf(file, "%.17g", value);
    put_end(file, last);
}

void study_put_heading(FILE *file, const struct study_table *table) {
    for (const struct study_column *c = table->columns; c->name; c++)
        study_put_text(file, c->name, !c[1].name);
}

void study_put_codebook(FILE *file) {
    fputs("file,column,type,unit,meaning,missing\r\n", file);
    for (const struct study_table *t = study_tables; t < study_tables + TABLE_COUNT; t++)
        for (const struct study_column *c = t->columns; c->name; c++) {
            study_put_text(file, t->file, false);
            study_put_text(file, c->name, false);
            study_put_text(file, c->type, false);
            study_put_text(file, c->unit, false);
            study_put_text(file, c->meaning, false);
            study_put_text(file, c->missing, true);
        }
}

const struct store_cell *study_cell_of(const struct store_cell *cells, int count,
                                       const char *column) {
    static const struct store_cell none = {.kind = STORE_NULL, .text = ""};
    for (int i = 0; i < count; i++)
        if (!strcmp(cells[i].column, column))
            return &cells[i];
    return &none;
}
