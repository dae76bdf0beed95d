#include "export/contents.h"

#include <errno.h>
#include <string.h>

struct table {
    FILE *file;
    struct step_field columns[STEP_FIELDS_MAX];
    int count;
};

static void print_names(const struct table *table) {
    fputs("t_seconds", table->file);
    for (int i = 0; i < table->count; i++)
        fprintf(table->file, ",%s", table->columns[i].name);
    fputc('\n', table->file);
}

static void print_row(const struct table *table, const struct session_output *output,
                      double seconds) {
    fprintf(table->file, "%.9f", seconds);
    for (int i = 0; i < table->count; i++) {
        const struct step_field *column = &table->columns[i];
        char text[FIELD_TEXT_MAX];
        step_field_text(column, output, text);
        fprintf(table->file, ",%s", step_field_is_there(column, output) ? text : "");
    }
    fputc('\n', table->file);
}

enum result export_csv(const struct export_request *request, FILE *out, struct error *err) {
    struct contents contents;
    struct table table = {.file = out};
    struct walk walk = {.request = request, .passes = 1};
    struct trace_record record;
    double seconds;
    enum result result = contents_read(request, &contents, err);
    if (result == RESULT_OK)
        result = walk_begin(&walk, &contents, err);
    if (result != RESULT_OK)
        return result;
    table.count = contents_fields(&contents, table.columns);
    print_names(&table);
    while (walk_next(&walk, &record, &seconds))
        print_row(&table, &record.output, seconds);
    walk_end(&walk);
    if (ferror(out) || fflush(out) != 0)
        return fail(err, RESULT_IO, "the table: %s", strerror(errno));
    return contents_end(&contents, err);
}
