#include "base/check.h"
#include "base/nearest.h"
#include "export/contents.h"
#include "export/inputs.h"
#include "step/field_types.h"

#include <errno.h>
#include <fnmatch.h>
#include <stdlib.h>
#include <string.h>

enum column_source { OF_TIME, OF_INPUT, OF_OUTPUT, OF_GROUP };

struct csv_column {
    enum column_source source;
    struct step_field field; // OF_GROUP: the index whose name this is
    char name[sizeof((struct step_field *)0)->name + 8];
    bool usual; // there unless others are asked for
};

#define COLUMNS_MAX (STEP_FIELDS_MAX + INPUT_FIELDS_MAX + 32)

struct table {
    FILE *file;
    const struct scene *scene; // or NULL
    struct csv_column *all, *columns;
    int all_count, count;
    int trouble; // errno of what could not be written
};

// ---- which columns ------------------------------------------------------------------------------

static void add_column(struct table *table, enum column_source source,
                       const struct step_field *field, const char *name, bool usual) {
    CHECK(table->all_count < COLUMNS_MAX);
    struct csv_column *column = &table->all[table->all_count++];
    *column = (struct csv_column){.source = source, .usual = usual};
    if (field)
        column->field = *field;
    snprintf(column->name, sizeof column->name, "%.*s", (int)sizeof column->name - 1, name);
}

// The name of the group behind an index: of "job_tissue" it is "job_group".
static void add_group(struct table *table, const struct step_field *field) {
    char name[64];
    size_t stem = strlen(field->name) - (field->type == &field_tissue ? strlen("_tissue") : 0);
    snprintf(name, sizeof name, "%.*s_group", (int)stem, field->name);
    add_column(table, OF_GROUP, field, name, true);
}

static void list_columns(struct table *table, const struct contents *contents) {
    struct step_field fields[STEP_FIELDS_MAX];
    add_column(table, OF_TIME, NULL, "t_seconds", true);
    int count = input_fields(contents->sampled, fields);
    for (int i = 0; i < count; i++)
        add_column(table, OF_INPUT, &fields[i], fields[i].name, input_field_is_time(&fields[i]));
    count = contents_fields(contents, fields);
    for (int i = 0; i < count; i++) {
        add_column(table, OF_OUTPUT, &fields[i], fields[i].name, true);
        if (fields[i].type == &field_tissue || fields[i].type == &field_nearest)
            add_group(table, &fields[i]);
    }
}

static bool is_chosen(const struct table *table, const char *name) {
    for (int i = 0; i < table->count; i++)
        if (!strcmp(table->columns[i].name, name))
            return true;
    return false;
}

static enum result unknown_column(const struct table *table, const char *word, struct error *err) {
    const char **names = alloc((size_t)table->all_count + 1, sizeof *names);
    for (int i = 0; i < table->all_count; i++)
        names[i] = table->all[i].name;
    const char *meant = nearest_name(word, names);
    free(names);
    if (!meant)
        return fail(err, RESULT_INVALID, "the session has no column '%s'", word);
    return fail(err, RESULT_INVALID, "the session has no column '%s'; did you mean '%s'?", word,
                meant);
}

static enum result choose_some(struct table *table, const char *pattern, struct error *err) {
    bool found = false;
    for (int i = 0; i < table->all_count; i++) {
        if (fnmatch(pattern, table->all[i].name, 0) != 0)
            continue;
        found = true;
        if (!is_chosen(table, table->all[i].name))
            table->columns[table->count++] = table->all[i];
    }
    return found ? RESULT_OK : unknown_column(table, pattern, err);
}

static enum result choose(struct table *table, const char *patterns, struct error *err) {
    if (!patterns) {
        for (int i = 0; i < table->all_count; i++)
            if (table->all[i].usual)
                table->columns[table->count++] = table->all[i];
        return RESULT_OK;
    }
    char *list = alloc_text(patterns), *rest = NULL;
    enum result result = RESULT_OK;
    for (char *one = strtok_r(list, ",", &rest); one && result == RESULT_OK;
         one = strtok_r(NULL, ",", &rest))
        result = choose_some(table, one, err);
    free(list);
    if (result == RESULT_OK && table->count == 0)
        return fail(err, RESULT_INVALID, "the list of columns is empty");
    return result;
}

static void list_known(const struct table *table, const struct export_request *request) {
    for (int i = 0; i < table->all_count && request->known_column; i++)
        request->known_column(table->all[i].name);
}

// ---- rows ---------------------------------------------------------------------------------------

// errno tells why only right after the call that failed.
static void put(struct table *table, const char *text) {
    if (!table->trouble && fputs(text, table->file) < 0)
        table->trouble = errno;
}

static void print_names(struct table *table) {
    for (int i = 0; i < table->count; i++) {
        put(table, i ? "," : "");
        put(table, table->columns[i].name);
    }
    put(table, "\n");
}

static const char *group_name(const struct table *table, const struct step_field *field,
                              const struct session_output *output) {
    int index = (int)step_field_number(field, output);
    if (field->type == &field_tissue && index < scene_tissue_count(table->scene))
        index = scene_tissue_group(table->scene, index);
    const struct knee_case *knee = scene_case(table->scene);
    return index >= 0 && index < knee->group_count ? knee->groups[index].name : "";
}

static void print_cell(struct table *table, const struct csv_column *column,
                       const struct trace_record *record, const struct input_row *row,
                       double seconds) {
    const struct session_output *output = &record->output;
    const struct step_field *field = &column->field;
    char text[FIELD_TEXT_MAX] = "";
    if (column->source == OF_TIME)
        snprintf(text, sizeof text, "%.9f", seconds);
    else if (column->source == OF_INPUT && input_field_is_there(field, row))
        step_field_text(field, row, text);
    else if (column->source == OF_OUTPUT && step_field_is_there(field, output))
        step_field_text(field, output, text);
    else if (column->source == OF_GROUP && table->scene && step_field_is_there(field, output))
        snprintf(text, sizeof text, "%s", group_name(table, field, output));
    put(table, text);
}

static bool print_row(void *user, const struct trace_record *record, double seconds) {
    struct table *table = user;
    struct input_row row;
    input_row_of(record, &row);
    for (int i = 0; i < table->count; i++) {
        put(table, i ? "," : "");
        print_cell(table, &table->columns[i], record, &row, seconds);
    }
    put(table, "\n");
    return !table->trouble;
}

static enum result print_table(struct table *table, const struct export_request *request,
                               const struct contents *contents, struct error *err) {
    struct walk walk = {.request = request, .passes = 1};
    list_columns(table, contents);
    enum result result = choose(table, request->columns, err);
    if (result != RESULT_OK) {
        list_known(table, request);
        return result;
    }
    print_names(table);
    result = walk_run(&walk, contents, print_row, table, err);
    if (!table->trouble && fflush(table->file) != 0)
        table->trouble = errno;
    if (table->trouble)
        return fail(err, RESULT_IO, "the table: %s", strerror(table->trouble));
    return result;
}

enum result export_csv(const struct export_request *request, FILE *out, struct error *err) {
    struct contents contents;
    enum result result = contents_read(request, &contents, err);
    if (result != RESULT_OK)
        return result;
    struct table table = {.file = out};
    if (request->scene && scene_case(request->scene)->hash == contents.header.case_hash)
        table.scene = request->scene;
    table.all = alloc(COLUMNS_MAX, sizeof *table.all);
    table.columns = alloc(COLUMNS_MAX, sizeof *table.columns);
    result = print_table(&table, request, &contents, err);
    free(table.all);
    free(table.columns);
    return result == RESULT_OK ? contents_end(&contents, err) : result;
}
