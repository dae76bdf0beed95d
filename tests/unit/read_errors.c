// A read that fails is never taken for the end of a file: each in turn fails, and each reader says
// so.
#undef _FORTIFY_SOURCE // whose inline functions stand where those of this file are

#include "import/claim.h"
#include "import/reader.h"
#include "records/audit_spool.h"
#include "records/session_row.h"
#include "review/lines.h"
#include "test.h"
#include "trace/catalogue.h"
#include "unit/trace_files.h"

#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define STEPS 6
#define ERROR_FLAG 0x20 // of glibc: what ferror reads

// ---- the failing calls, instead of the system's -------------------------------------------------

static int left; // until a call fails; 0: none does
static bool failed;

static bool fails(FILE *file) {
    if (!left || --left)
        return false;
    failed = true;
    if (file)
        file->_flags |= ERROR_FLAG;
    errno = EIO;
    return true;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

size_t fread(void *restrict data, size_t size, size_t count, FILE *restrict file) {
    return fails(file) ? 0 : REAL(fread)(data, size, count, file);
}

size_t __fread_chk(void *restrict data, size_t room, size_t size, size_t count,
                   FILE *restrict file);
size_t __fread_chk(void *restrict data, size_t room, size_t size, size_t count,
                   FILE *restrict file) {
    (void)room;
    return fails(file) ? 0 : REAL(fread)(data, size, count, file);
}

int fgetc(FILE *file) {
    return fails(file) ? EOF : REAL(fgetc)(file);
}

ssize_t getline(char **restrict text, size_t *restrict size, FILE *restrict file) {
    return fails(file) ? -1 : REAL(getline)(text, size, file);
}

ssize_t __getdelim(char **restrict text, size_t *restrict size, int end, FILE *restrict file);
ssize_t __getdelim(char **restrict text, size_t *restrict size, int end, FILE *restrict file) {
    return fails(file) ? -1 : REAL(getdelim)(text, size, end, file);
}

char *fgets(char *restrict text, int size, FILE *restrict file) {
    return fails(file) ? NULL : REAL(fgets)(text, size, file);
}

struct dirent *readdir(DIR *folder) {
    return fails(NULL) ? NULL : REAL(readdir)(folder);
}

// The n-th call fails, for n = 1, 2, ..., until none does. Returns how many did.
static int with_each_failing(void (*try)(void)) {
    for (int n = 1;; n++) {
        left = n;
        failed = false;
        try();
        left = 0;
        if (!failed)
            return n - 1;
    }
}

#define assert_told(result, otherwise) assert_int_equal(result, failed ? RESULT_IO : (otherwise))

// ---- readers ------------------------------------------------------------------------------------

static void read_all(void) {
    struct trace_reader *reader;
    struct trace_record record;
    enum result result = trace_reader_create(path, &reader, NULL);
    if (result == RESULT_OK) {
        while ((result = trace_read(reader, &record, NULL)) == RESULT_OK)
            ;
        trace_reader_destroy(&reader);
    }
    assert_told(result, RESULT_CLOSED);
}

static void look_whether_open(void) {
    bool open = trace_is_open(path);
    assert_int_equal(open, failed);
}

static void find_last_time(void) {
    int64_t time_ns;
    enum result result = trace_last_time(path, &time_ns, NULL);
    assert_told(result, RESULT_OK);
}

static void draw_lines(void) {
    struct trace_reader *reader;
    static struct report_lines lines;
    static struct metrics metrics;
    const struct survey survey = {.last_ns = STEPS};
    int before = left;
    left = 0;
    assert_int_equal(trace_reader_create(path, &reader, NULL), RESULT_OK);
    left = before;
    metrics_init(&metrics, instruments_usual(), view_optic_usual());
    enum result result = report_lines_read(reader, &survey, NULL, &lines, &metrics, NULL);
    trace_reader_destroy(&reader);
    assert_told(result, RESULT_OK);
}

static const struct scene *no_scene(void *user, uint64_t case_hash) {
    (void)user, (void)case_hash;
    return NULL;
}

static void score(void) {
    struct session_score score;
    enum result result = session_score_trace(path, "/nowhere.pem", no_scene, NULL, &score, NULL);
    if (result == RESULT_OK)
        session_score_fini(&score);
    assert_told(result, RESULT_OK);
}

static void a_read_error_is_no_end_of_a_trace(void **state) {
    (void)state;
    write_trace(STEPS);
    assert_true(with_each_failing(read_all) > 2 * STEPS);
    assert_true(with_each_failing(look_whether_open) > 2 * STEPS);
    assert_true(with_each_failing(find_last_time) > 2 * STEPS);
    assert_true(with_each_failing(draw_lines) > 2 * STEPS);
    assert_true(with_each_failing(score) > 2 * STEPS);
}

static void skip_damage(void) {
    struct trace_reader *reader;
    struct trace_record record;
    uint64_t bytes;
    int before = left;
    left = 0;
    assert_int_equal(trace_reader_create(path, &reader, NULL), RESULT_OK);
    enum result result;
    while ((result = trace_read(reader, &record, NULL)) == RESULT_OK)
        ;
    left = before;
    assert_false(trace_ends_torn(reader));
    if (!failed) {
        result = trace_skip_damage(reader, &bytes, NULL);
        assert_told(result, RESULT_MISSING);
    }
    trace_reader_destroy(&reader);
}

static void a_read_error_is_neither_damage_nor_its_end(void **state) {
    (void)state;
    write_trace(STEPS);
    assert_int_equal(truncate(path, 4000), 0);
    FILE *file = fopen(path, "ae");
    for (int i = 0; i < 1000; i++)
        fputc('x', file);
    fclose(file);
    assert_int_equal(with_each_failing(skip_damage), 2);
}

static char folder[FOLDER_MAX + 16];

static bool count_entry(void *user, const struct trace_entry *entry) {
    (void)entry;
    ++*(int *)user;
    return true;
}

static void list(void) {
    int count = 0;
    enum result result = catalogue_each(folder, count_entry, &count, NULL);
    assert_told(result, RESULT_OK);
}

static void a_folder_that_cannot_be_read_is_not_empty(void **state) {
    (void)state;
    assert_true(with_each_failing(list) >= 3); // ".", ".." and the end
}

static void take(void *user, const struct store_audit_entry *entry) {
    (void)entry;
    ++*(size_t *)user;
}

static char records[300];

static void read_spool(void) {
    size_t taken = 0, count;
    enum result result = audit_spool_read(records, take, &taken, &count, NULL);
    assert_told(result, RESULT_OK);
    assert_true(failed || (count == 2 && taken == 2));
}

static void entries_that_wait_are_read_to_their_end(void **state) {
    (void)state;
    char spool[320];
    snprintf(records, sizeof records, "%s/records.db", folder);
    snprintf(spool, sizeof spool, "%s.arrears", records);
    FILE *file = fopen(spool, "we");
    fputs("1\tada\tstart\troom-1\n2\tada\tstop\troom-1\n", file);
    fclose(file);
    assert_int_equal(with_each_failing(read_spool), 3);
    audit_spool_drop(records);
}

static int make_named_folder(void **state) {
    int made = make_folder(state);
    snprintf(folder, sizeof folder, "%.*s", (int)(strrchr(path, '/') - path), path);
    return made;
}

static char surface[FOLDER_MAX + 32];

static void read_surface(void) {
    struct import_arrays arrays;
    enum result result = import_reader_read(surface, 10, &arrays, NULL);
    assert_told(result, RESULT_OK);
    if (result == RESULT_OK) {
        assert_string_equal(arrays.space, "LPS");
        import_arrays_fini(&arrays);
    }
}

static void claim_surface(void) {
    struct import_claim claim;
    enum result result = import_claim_of(surface, 10, &claim, NULL);
    assert_told(result, RESULT_OK);
    import_claim_fini(&claim);
}

static void write_surface(const char *name, const char *text) {
    snprintf(surface, sizeof surface, "%s/%s", folder, name);
    FILE *file = fopen(surface, "we");
    fputs(text, file);
    fclose(file);
}

static void a_surface_that_cannot_be_read_has_no_space_and_no_size(void **state) {
    (void)state;
    write_surface("a.vtk", "# vtk DataFile Version 3.0\nSPACE=LPS\nASCII\nDATASET POLYDATA\n"
                           "POINTS 3 float\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\n");
    assert_int_equal(with_each_failing(read_surface), 2);
    unlink(surface);
    write_surface("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    assert_true(with_each_failing(claim_surface) > 5);
    unlink(surface);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_read_error_is_no_end_of_a_trace),
        cmocka_unit_test(a_read_error_is_neither_damage_nor_its_end),
        cmocka_unit_test(a_folder_that_cannot_be_read_is_not_empty),
        cmocka_unit_test(entries_that_wait_are_read_to_their_end),
        cmocka_unit_test(a_surface_that_cannot_be_read_has_no_space_and_no_size),
    };
    return cmocka_run_group_tests_name("read_errors", tests, make_named_folder, remove_folder);
}
