#include "commands/records_rows.h"

#include "base/clock.h"
#include "base/csv.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define WIDTH_MAX 48

static json_t *cell_to_json(const struct store_cell *cell) {
    switch (cell->kind) {
    case STORE_INTEGER:
        return json_integer(cell->integer);
    case STORE_REAL:
        return json_real(cell->real);
    case STORE_TEXT:
        return json_string(cell->text);
    default:
        return json_null();
    }
}

void rows_take(void *array, const struct store_cell *cells, int count) {
    json_t *row = json_object();
    for (int i = 0; i < count; i++)
        json_object_set_new(row, cells[i].column, cell_to_json(&cells[i]));
    json_array_append_new(array, row);
}

// ---- table --------------------------------------------------------------------------------------

static bool ends_in(const char *column, const char *end) {
    size_t length = strlen(column), of_end = strlen(end);
    return length >= of_end && !strcmp(column + length - of_end, end);
}

static bool is_time(const char *column) {
    return ends_in(column, "utc_ns");
}

static bool is_shown(const char *column) {
    return !ends_in(column, "hash") && !ends_in(column, "xxh3");
}

static void cell_text(const char *column, const json_t *value, char *out, size_t size) {
    char when[32];
    if (json_is_integer(value) && is_time(column)) {
        clock_utc_text(json_integer_value(value), when);
        snprintf(out, size, "%.19sZ", when);
    } else if (json_is_integer(value)) {
        snprintf(out, size, "%" JSON_INTEGER_FORMAT, json_integer_value(value));
    } else if (json_is_real(value)) {
        snprintf(out, size, "%.4g", json_real_value(value));
    } else {
        snprintf(out, size, "%s", json_is_string(value) ? json_string_value(value) : "-");
    }
}

// Times are not shown in ns: start_utc_ns is headed start_utc.
static int heading_length(const char *column) {
    return (int)(strlen(column) - (is_time(column) ? strlen("_ns") : 0));
}

static int column_width(const json_t *rows, const char *column) {
    char text[STORE_TEXT_MAX];
    int width = heading_length(column);
    for (size_t i = 0; i < json_array_size(rows); i++) {
        cell_text(column, json_object_get(json_array_get(rows, i), column), text, sizeof text);
        int length = (int)strlen(text);
        width = length > width ? length : width;
    }
    return width < WIDTH_MAX ? width : WIDTH_MAX;
}

static void print_row(const json_t *rows, json_t *row, bool names) {
    char text[STORE_TEXT_MAX];
    const char *column;
    json_t *value;
    json_object_foreach(row, column, value) {
        if (!is_shown(column))
            continue;
        if (names)
            snprintf(text, sizeof text, "%.*s", heading_length(column), column);
        else
            cell_text(column, value, text, sizeof text);
        printf("%-*s  ", column_width(rows, column), text);
    }
    putchar('\n');
}

void rows_print(const json_t *rows) {
    if (json_array_size(rows))
        print_row(rows, json_array_get(rows, 0), true);
    for (size_t i = 0; i < json_array_size(rows); i++)
        print_row(rows, json_array_get(rows, i), false);
}

// ---- files --------------------------------------------------------------------------------------

enum result rows_create(const char *path, FILE **out_file, struct error *err) {
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    *out_file = fd < 0 ? NULL : fdopen(fd, "w");
    return *out_file ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
}

enum result rows_close(FILE *file, const char *path, struct error *err) {
    bool failed = ferror(file);
    if (fclose(file) || failed)
        return fail(err, RESULT_IO, "%s: it could not be written whole: %s", path, strerror(errno));
    return RESULT_OK;
}

static void put_names(void *file, const struct store_cell *cells, int count) {
    for (int i = 0; i < count; i++)
        fprintf(file, "%s%s", cells[i].column, i + 1 < count ? "," : "\r\n");
}

static void put_row(void *file, const struct store_cell *cells, int count) {
    for (int i = 0; i < count; i++) {
        if (cells[i].kind == STORE_INTEGER)
            fprintf(file, "%" PRId64, cells[i].integer);
        else if (cells[i].kind == STORE_REAL)
            fprintf(file, "%.17g", cells[i].real);
        else if (cells[i].kind == STORE_TEXT)
            csv_put_text(file, cells[i].text);
        fputs(i + 1 < count ? "," : "\r\n", file);
    }
}

static enum result export_list(struct store *store, enum store_list list, const char *dir,
                               struct error *err) {
    char path[PATH_MAX];
    FILE *file;
    if (snprintf(path, sizeof path, "%s/%s.csv", dir, store_list_name(list)) >= (int)sizeof path)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", dir);
    enum result result = rows_create(path, &file, err);
    if (result != RESULT_OK)
        return result;
    result = store_columns(store, list, put_names, file, err);
    if (result == RESULT_OK)
        result = store_rows(store, list, NULL, put_row, file, err);
    enum result closed = rows_close(file, path, result == RESULT_OK ? err : NULL);
    return result == RESULT_OK ? closed : result;
}

enum result rows_export_csv(struct store *store, const char *dir, struct error *err) {
    enum result result = RESULT_OK;
    if (mkdir(dir, 0700) && errno != EEXIST)
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    for (int i = 0; i < LIST_COUNT && result == RESULT_OK; i++)
        result = export_list(store, (enum store_list)i, dir, err);
    return result;
}
