#include "study/study.h"

#include "base/check.h"
#include "base/clock.h"
#include "store/exams.h"
#include "study/tables.h"

#include <archive.h>
#include <archive_entry.h>
#include <inttypes.h>
#include <jansson.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#define FIGURE_NAME_MAX 160

struct page {
    FILE *file;
    char *text;
    size_t size;
};

struct writing {
    const struct study_request *request;
    struct store *store;
    struct page pages[TABLE_COUNT];
    int64_t rows[TABLE_COUNT];
    int withheld;     // attempts of exams
    json_t *sessions; // { id: { number: true } }: the attempts that are in
    json_t *raters;   // { name: number }
};

static void open_page(struct page *page) {
    page->file = open_memstream(&page->text, &page->size);
    NEED(page->file, "memory");
}

// ---- rows ---------------------------------------------------------------------------------------

static int64_t number_of_rater(struct writing *w, const char *name) {
    json_t *number = json_object_get(w->raters, name);
    if (!number) {
        number = json_integer((json_int_t)json_object_size(w->raters) + 1);
        json_object_set_new(w->raters, name, number);
    }
    return json_integer_value(number);
}

static void put_cell(struct writing *w, FILE *file, const struct study_column *column,
                     const struct store_cell *cell, const struct store_cell *number) {
    bool last = !column[1].name;
    char text[64];
    if (cell->kind == STORE_NULL) {
        study_put_text(file, "", last);
        return;
    }
    if (cell->kind == STORE_INTEGER && column->as == CELL_AS_IT_IS) {
        study_put_number(file, (double)cell->integer, last);
        return;
    }
    if (cell->kind == STORE_REAL) {
        study_put_number(file, cell->real, last);
        return;
    }
    if (column->as == CELL_TIME)
        clock_utc_text(cell->integer, text);
    else if (column->as == CELL_TRAINEE && !w->request->names)
        snprintf(text, sizeof text, "trainee-%" PRId64, number->integer);
    else if (column->as == CELL_RATER && !w->request->names)
        snprintf(text, sizeof text, "rater-%" PRId64, number_of_rater(w, cell->text));
    else if (cell->kind == STORE_INTEGER)
        snprintf(text, sizeof text, "%" PRId64, cell->integer);
    else {
        study_put_text(file, cell->text, last);
        return;
    }
    study_put_text(file, text, last);
}

static void put_row(struct writing *w, enum study_table_id id, const struct store_cell *cells,
                    int count) {
    FILE *file = w->pages[id].file;
    const struct store_cell *number = study_cell_of(cells, count, "trainee_number");
    for (const struct study_column *c = study_tables[id].columns; c->name; c++)
        put_cell(w, file, c, study_cell_of(cells, count, c->source ? c->source : c->name), number);
    w->rows[id]++;
}

// ---- what the JSON of an attempt has ------------------------------------------------------------

struct attempt_id {
    const char *session;
    int64_t number;
};

static FILE *begin_row(struct writing *w, enum study_table_id table, struct attempt_id id) {
    FILE *file = w->pages[table].file;
    study_put_text(file, id.session, false);
    fprintf(file, "%" PRId64 ",", id.number);
    w->rows[table]++;
    return file;
}

static const char *text_of(const json_t *object, const char *key) {
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

static void put_figure(struct writing *w, struct attempt_id id, const char *name,
                       const json_t *value) {
    FILE *file = begin_row(w, TABLE_FIGURES, id);
    study_put_text(file, name, false);
    if (json_is_number(value))
        study_put_number(file, json_number_value(value), true);
    else
        study_put_text(file, json_is_boolean(value) ? json_is_true(value) ? "1" : "0" : "", true);
}

// OUTER.INNER; false where it is too long to be one of ours.
static bool join(const char *outer, const char *inner, char out[FIGURE_NAME_MAX]) {
    return snprintf(out, FIGURE_NAME_MAX, "%s%s%s", outer, *outer ? "." : "", inner) <
           FIGURE_NAME_MAX;
}

static void put_figures(struct writing *w, struct attempt_id id, const char *outer,
                        json_t *figures);

// Those of a list by the name of its member, or by the tissue's.
static void put_members(struct writing *w, struct attempt_id id, const char *outer, json_t *list) {
    char name[FIGURE_NAME_MAX];
    json_t *member;
    size_t i;
    json_array_foreach(list, i, member) {
        const char *own = text_of(member, json_object_get(member, "name") ? "name" : "group");
        if (join(outer, own, name))
            put_figures(w, id, name, member);
    }
}

// A text is no figure.
static void put_figures(struct writing *w, struct attempt_id id, const char *outer,
                        json_t *figures) {
    const char *key;
    char name[FIGURE_NAME_MAX];
    json_t *value;
    json_object_foreach(figures, key, value) {
        if (!join(outer, key, name) || json_is_string(value))
            continue;
        if (json_is_object(value))
            put_figures(w, id, name, value);
        else if (json_is_array(value))
            put_members(w, id, name, value);
        else
            put_figure(w, id, name, value);
    }
}

static void put_errors(struct writing *w, struct attempt_id id, json_t *occurrences) {
    json_t *one;
    size_t i;
    json_array_foreach(occurrences, i, one) {
        FILE *file = begin_row(w, TABLE_ERRORS, id);
        study_put_text(file, text_of(one, "error"), false);
        study_put_text(file, text_of(one, "tool"), false);
        fprintf(file, "%" JSON_INTEGER_FORMAT ",",
                json_integer_value(json_object_get(one, "step")));
        study_put_number(file, json_number_value(json_object_get(one, "time_s")), true);
    }
}

static json_t *json_of(const struct store_cell *cells, int count, const char *column) {
    const struct store_cell *cell = study_cell_of(cells, count, column);
    return cell->kind == STORE_TEXT ? json_loads(cell->text, 0, NULL) : NULL;
}

static bool is_withheld(const struct store_cell *cells, int count) {
    const struct store_cell *purpose = study_cell_of(cells, count, "purpose");
    const struct store_cell *state = study_cell_of(cells, count, "exam_state");
    return purpose->kind == STORE_TEXT && !strcmp(purpose->text, "exam") &&
           !(state->kind == STORE_TEXT && !strcmp(state->text, "released"));
}

static void remember(struct writing *w, struct attempt_id id) {
    char number[24];
    if (!json_object_get(w->sessions, id.session))
        json_object_set_new(w->sessions, id.session, json_object());
    snprintf(number, sizeof number, "%" PRId64, id.number);
    json_object_set_new(json_object_get(w->sessions, id.session), number, json_true());
}

static void take_attempt(void *user, const struct store_cell *cells, int count) {
    struct writing *w = user;
    const struct attempt_id id = {study_cell_of(cells, count, "session")->text,
                                  study_cell_of(cells, count, "number")->integer};
    if (is_withheld(cells, count)) {
        w->withheld++;
        return;
    }
    remember(w, id);
    put_row(w, TABLE_ATTEMPTS, cells, count);
    json_t *figures = json_of(cells, count, "figures");
    put_figures(w, id, "", figures);
    json_decref(figures);
    json_t *occurrences = json_of(cells, count, "occurrences");
    put_errors(w, id, occurrences);
    json_decref(occurrences);
}

// ---- what belongs to the attempts ---------------------------------------------------------------

static void take_rating(void *user, const struct store_cell *cells, int count) {
    struct writing *w = user;
    char number[24];
    json_t *of_session = json_object_get(w->sessions, study_cell_of(cells, count, "session")->text);
    snprintf(number, sizeof number, "%" PRId64, study_cell_of(cells, count, "number")->integer);
    if (json_object_get(of_session, number))
        put_row(w, TABLE_RATINGS, cells, count);
}

static void take_result(void *user, const struct store_cell *cells, int count) {
    put_row(user, TABLE_RESULTS, cells, count);
}

static enum result take_belongings(struct writing *w, struct error *err) {
    enum result result = RESULT_OK;
    const char *session;
    json_t *numbers;
    json_object_foreach(w->sessions, session, numbers) {
        bool withheld = false;
        result = store_rows(w->store, LIST_RATINGS, session, take_rating, w, err);
        if (result == RESULT_OK)
            result = store_is_withheld(w->store, session, &withheld, err);
        if (result == RESULT_OK && !withheld)
            result = store_rows(w->store, LIST_RESULTS, session, take_result, w, err);
        if (result != RESULT_OK)
            break;
    }
    return result;
}

static void take_course(void *found, const struct store_cell *cells, int count) {
    (void)cells, (void)count;
    *(bool *)found = true;
}

static enum result take_all(struct writing *w, struct error *err) {
    const struct study_request *r = w->request;
    const struct attempt_filter filter = {.course = r->course,
                                          .task = r->task,
                                          .from_utc_ns = r->from_utc_ns,
                                          .to_utc_ns = r->to_utc_ns,
                                          .limit = INT_MAX};
    bool found = false;
    enum result result = store_rows(w->store, LIST_COURSES, r->course, take_course, &found, err);
    if (result == RESULT_OK && !found)
        return fail(err, RESULT_MISSING, "there is no course '%.63s'", r->course);
    if (result == RESULT_OK)
        result = store_attempt_list(w->store, &filter, take_attempt, w, err);
    return result == RESULT_OK ? take_belongings(w, err) : result;
}

// ---- the zip ------------------------------------------------------------------------------------

static void put_about(const struct writing *w, FILE *file) {
    const struct study_request *r = w->request;
    char when[32];
    clock_utc_text(clock_utc_ns(), when);
    fprintf(file, "All attempts of the trainees of course %s", r->course);
    if (r->task)
        fprintf(file, " at task %s", r->task);
    fprintf(file, ", written by arthron-server " ARTHRON_VERSION " on %s.\r\n", when);
    if (r->from_utc_ns) {
        clock_utc_text(r->from_utc_ns, when);
        fprintf(file, "Begun on %s or later.\r\n", when);
    }
    if (r->to_utc_ns) {
        clock_utc_text(r->to_utc_ns, when);
        fprintf(file, "Begun before %s.\r\n", when);
    }
    fputs("\r\ncodebook.csv describes each column. All files are UTF-8; a cell without a value is "
          "empty.\r\nA text that begins with =, +, - or @ has an apostrophe before it: a "
          "spreadsheet would take it for a formula.\r\nsession and number join the tables.\r\n\r\n",
          file);
    for (int i = 0; i < TABLE_COUNT; i++)
        fprintf(file, "%s: %" PRId64 " rows, %s\r\n", study_tables[i].file, w->rows[i],
                study_tables[i].rows);
    fprintf(file, "\r\nLeft out: %d attempts of exams whose results are not released.\r\n",
            w->withheld);
    fputs(r->names ? "It names persons: keep it as your rules for personal data demand.\r\n"
                   : "It names no trainee. Whoever has the records can tell who a number is.\r\n",
          file);
}

static enum result add_file(struct archive *zip, const char *name, const struct page *page,
                            struct error *err) {
    struct archive_entry *entry = archive_entry_new();
    NEED(entry, "memory");
    archive_entry_set_pathname(entry, name);
    archive_entry_set_filetype(entry, AE_IFREG);
    archive_entry_set_perm(entry, 0600);
    archive_entry_set_size(entry, (la_int64_t)page->size);
    archive_entry_set_mtime(entry, clock_utc_ns() / NS_PER_S, 0);
    bool done = archive_write_header(zip, entry) == ARCHIVE_OK &&
                archive_write_data(zip, page->text, page->size) == (la_ssize_t)page->size;
    archive_entry_free(entry);
    const char *why = done ? NULL : archive_error_string(zip);
    return done ? RESULT_OK
                : fail(err, RESULT_IO, "%s: it could not be written: %s", name, why ? why : "full");
}

static enum result add_text(struct archive *zip, const struct writing *w, const char *name,
                            void (*put)(const struct writing *w, FILE *file), struct error *err) {
    struct page page;
    open_page(&page);
    put(w, page.file);
    fclose(page.file);
    enum result result = add_file(zip, name, &page, err);
    free(page.text);
    return result;
}

static void put_codebook(const struct writing *w, FILE *file) {
    (void)w;
    study_put_codebook(file);
}

static enum result write_zip(const struct writing *w, FILE *file, struct error *err) {
    struct archive *zip = archive_write_new();
    NEED(zip, "memory");
    enum result result = RESULT_OK;
    if (archive_write_set_format_zip(zip) != ARCHIVE_OK ||
        archive_write_open_FILE(zip, file) != ARCHIVE_OK)
        result = fail(err, RESULT_IO, "the zip cannot be written: %s", archive_error_string(zip));
    if (result == RESULT_OK)
        result = add_text(zip, w, "about.txt", put_about, err);
    if (result == RESULT_OK)
        result = add_text(zip, w, "codebook.csv", put_codebook, err);
    for (int i = 0; i < TABLE_COUNT && result == RESULT_OK; i++)
        result = add_file(zip, study_tables[i].file, &w->pages[i], err);
    if (archive_write_close(zip) != ARCHIVE_OK && result == RESULT_OK)
        result = fail(err, RESULT_IO, "the zip is not whole: %s", archive_error_string(zip));
    archive_write_free(zip);
    return result;
}

enum result study_write(struct store *store, const struct study_request *request, FILE *file,
                        struct error *err) {
    struct writing w = {
        .request = request, .store = store, .sessions = json_object(), .raters = json_object()};
    for (int i = 0; i < TABLE_COUNT; i++) {
        open_page(&w.pages[i]);
        study_put_heading(w.pages[i].file, &study_tables[i]);
    }
    enum result result = take_all(&w, err);
    for (int i = 0; i < TABLE_COUNT; i++)
        fclose(w.pages[i].file);
    if (result == RESULT_OK)
        result = write_zip(&w, file, err);
    for (int i = 0; i < TABLE_COUNT; i++)
        free(w.pages[i].text);
    json_decref(w.sessions);
    json_decref(w.raters);
    return result;
}
