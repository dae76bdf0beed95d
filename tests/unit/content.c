// What a case is to the byte: as sha256sum sees it.
#include "case/content.h"

#include "case/case.h"
#include "folder.h"
#include "test.h"
#include "unit/case_knee.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char dir[FOLDER_MAX];
static struct error err;

static int begin(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    folder_make(dir);
    assert_ok(case_save(knee, dir, &err));
    case_destroy(&knee);
    return 0;
}

static int end(void **state) {
    (void)state;
    folder_remove(dir);
    return 0;
}

static void shell(const char *command, char *out, size_t size) {
    char whole[FOLDER_MAX + 128];
    snprintf(whole, sizeof whole, "cd %s && %s", dir, command);
    FILE *pipe = popen(whole, "r");
    assert_non_null(pipe);
    assert_non_null(fgets(out, (int)size, pipe));
    pclose(pipe);
}

static void the_hash_is_what_sha256sum_says(void **state) {
    (void)state;
    struct content_file files[CONTENT_FILES];
    char hash[CONTENT_HASH_SIZE], expected[256];
    assert_ok(content_read(dir, files, &err));
    content_hash(files, hash);
    shell("sha256sum anatomy.glb case.json | sha256sum", expected, sizeof expected);
    assert_memory_equal(hash, expected, 64);
    assert_true(content_is_hash(hash));
    shell("sha256sum anatomy.glb", expected, sizeof expected);
    assert_memory_equal(files[0].hash, expected, 64);
    shell("stat -c %s case.json", expected, sizeof expected);
    assert_int_equal(files[1].size, atoi(expected));
}

static void a_hash_is_64_small_digits(void **state) {
    (void)state;
    char text[] = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
    assert_true(content_is_hash(text));
    assert_false(content_is_hash(text + 1));
    assert_false(content_is_hash(""));
    text[5] = 'A';
    assert_false(content_is_hash(text));
    text[5] = '/';
    assert_false(content_is_hash(text));
}

static void what_is_no_file_or_too_large_is_refused(void **state) {
    (void)state;
    struct content_file files[CONTENT_FILES];
    char path[FOLDER_MAX + 16];
    snprintf(path, sizeof path, "%s/case.json", dir);
    assert_int_equal(content_read_file(path, 10, files, &err), RESULT_LIMIT);
    assert_int_equal(content_read_file(dir, 10, files, &err), RESULT_INVALID);
    unlink(path);
    assert_int_equal(content_read(dir, files, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "case.json"));
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(content_read(dir, files, &err), RESULT_INVALID);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_hash_is_what_sha256sum_says, begin, end),
        cmocka_unit_test(a_hash_is_64_small_digits),
        cmocka_unit_test_setup_teardown(what_is_no_file_or_too_large_is_refused, begin, end),
    };
    return cmocka_run_group_tests_name("content", tests, NULL, NULL);
}
