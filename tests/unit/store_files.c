#include "unit/store_files.h"

#include "test.h"

#include <ftw.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

char store_dir[FOLDER_MAX], store_path[FOLDER_MAX + 16];

int store_folder_begin(void **state) {
    (void)state;
    folder_make_in_memory(store_dir); // a disk would be waited for at every row
    snprintf(store_path, sizeof store_path, "%s/records.db", store_dir);
    return 0;
}

int store_folder_end(void **state) {
    (void)state;
    folder_remove(store_dir);
    return 0;
}

const char *in_folder(const char *name) {
    static char paths[4][256];
    static int next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", store_dir, name);
    return path;
}

void put_file(const char *name, const void *data, size_t size) {
    FILE *file = fopen(in_folder(name), "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    fclose(file);
}

static void *read_all(FILE *file, size_t *out_size) {
    fseek(file, 0, SEEK_END);
    *out_size = (size_t)ftell(file);
    rewind(file);
    void *data = malloc(*out_size + 1);
    assert_int_equal(fread(data, 1, *out_size, file), *out_size);
    fclose(file);
    return data;
}

void *get_file(const char *name, size_t *out_size) {
    FILE *file = fopen(in_folder(name), "rb");
    assert_non_null(file);
    return read_all(file, out_size);
}

bool file_has(const char *name, const char *text) {
    size_t size;
    FILE *file = fopen(in_folder(name), "rb");
    if (!file)
        return false;
    void *data = read_all(file, &size);
    bool has = memmem(data, size, text, strlen(text)) != NULL;
    free(data);
    return has;
}

bool sql_passes(const char *name, const char *sql) {
    sqlite3 *db;
    assert_int_equal(sqlite3_open(in_folder(name), &db), SQLITE_OK);
    bool passes = sqlite3_exec(db, sql, NULL, NULL, NULL) == SQLITE_OK;
    sqlite3_close(db);
    return passes;
}

// ---- rows ---------------------------------------------------------------------------------------

struct text {
    char *at;
    size_t left;
    int rows;
};

static void add(struct text *text, const char *more) {
    size_t length = strlen(more);
    assert_true(length < text->left);
    memcpy(text->at, more, length + 1);
    text->at += length;
    text->left -= length;
}

static void take_row(void *user, const struct store_cell *cells, int count) {
    struct text *text = user;
    for (int i = 0; i < count; i++) {
        char number[64] = "";
        if (cells[i].kind == STORE_INTEGER)
            snprintf(number, sizeof number, "%lld", (long long)cells[i].integer);
        else if (cells[i].kind == STORE_REAL)
            snprintf(number, sizeof number, "%.17g", cells[i].real);
        add(text, cells[i].column);
        add(text, "=");
        add(text, cells[i].kind == STORE_TEXT ? cells[i].text : number);
        add(text, i + 1 < count ? "|" : "\n");
    }
    text->rows++;
}

static int take_rows(struct store *store, enum store_list list, const char *key,
                     const char **out_text) {
    static char rows[1 << 20];
    struct text text = {rows, sizeof rows, 0};
    struct error err = {""};
    rows[0] = '\0';
    if (store_rows(store, list, key, take_row, &text, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    *out_text = rows;
    return text.rows;
}

const char *rows_of(struct store *store, enum store_list list, const char *key) {
    const char *text;
    take_rows(store, list, key, &text);
    return text;
}

int row_count(struct store *store, enum store_list list) {
    const char *text;
    return take_rows(store, list, NULL, &text);
}

struct store *open_records(void) {
    struct store *store;
    struct error err = {""};
    if (store_open(store_path, STORE_MAKE, "tester", &store, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return store;
}

struct store_session a_session(unsigned number) {
    struct store_session session = {
        .case_hash = 0x1234abcd,
        .part = 1,
        .start_utc_ns = 1000000000LL * (1000 + number),
        .station = "room-1",
        .trainee = "ada",
        .case_name = "tear-radial",
    };
    snprintf(session.id, sizeof session.id, "%032x", number);
    snprintf(session.trace, sizeof session.trace, "/traces/%u.trace", number);
    return session;
}

struct attempt_row an_attempt(const char *session, int number) {
    struct attempt_row row = {
        .number = number,
        .task = "centring",
        .task_version = 1,
        .title = "Centring and horizon",
        .purpose = "practice",
        .hand = "right",
        .first_step = 100 * (uint64_t)number,
        .last_step = 100 * (uint64_t)number + 90,
        .begun_utc_ns = 60000000000LL * (100 + number),
        .time_s = 40,
        .goals = 4,
        .goals_met = 4,
        .verdict = "passed",
        .end = "done",
        .pass_time_s = 75,
    };
    snprintf(row.session, sizeof row.session, "%s", session);
    snprintf(row.file_hash, sizeof row.file_hash, "%064d", 7);
    return row;
}
