// The secret that viewers must know.
#include "view/token.h"

#include "folder.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char dir[FOLDER_MAX], path[FOLDER_MAX + 16];

static int begin(void **state) {
    (void)state;
    folder_make(dir);
    snprintf(path, sizeof path, "%s/token", dir);
    return 0;
}

static int end(void **state) {
    (void)state;
    unlink(path);
    return rmdir(dir);
}

static void write_file(const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    fclose(file);
}

static void the_first_start_makes_one_for_its_owner_alone_and_keeps_it(void **state) {
    (void)state;
    char token[TOKEN_LENGTH + 1], again[TOKEN_LENGTH + 1], other[TOKEN_LENGTH + 1];
    umask(0);
    assert_int_equal(token_check(path, NULL), RESULT_OK);
    assert_int_equal(token_get(path, token, NULL), RESULT_OK);
    assert_int_equal(strspn(token, "0123456789abcdef"), TOKEN_LENGTH);
    struct stat status;
    assert_int_equal(stat(path, &status), 0);
    assert_int_equal(status.st_mode & 0777, 0600);
    assert_int_equal(token_get(path, again, NULL), RESULT_OK);
    assert_string_equal(token, again);
    unlink(path);
    assert_int_equal(token_get(path, other, NULL), RESULT_OK);
    assert_string_not_equal(token, other);
}

static void a_file_that_others_may_use_is_told(void **state) {
    (void)state;
    char token[TOKEN_LENGTH + 1];
    struct error err = {""};
    assert_int_equal(token_get(path, token, NULL), RESULT_OK);
    assert_int_equal(token_check(path, &err), RESULT_OK);
    assert_int_equal(chmod(path, 0640), 0);
    assert_int_equal(token_check(path, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, path));
    assert_non_null(strstr(err.text, "640"));
}

static void a_file_without_a_token_is_refused_and_left_alone(void **state) {
    (void)state;
    static const char good[] = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
    char token[TOKEN_LENGTH + 1], text[128];
    struct error err = {""};
    write_file(good);
    assert_int_equal(token_get(path, token, &err), RESULT_OK);
    static const struct {
        const char *before;
        int digits;
        const char *behind;
    } forms[] = {{"", 0, ""},     {"", 0, "\n"}, {"", 63, "\n"},  {"", 63, "g\n"},
                 {"", 64, "0\n"}, {" ", 63, ""}, {"", 62, "\n\n"}};
    for (size_t i = 0; i < sizeof forms / sizeof *forms; i++) {
        snprintf(text, sizeof text, "%s%.*s%s", forms[i].before, forms[i].digits, good,
                 forms[i].behind);
        write_file(text);
        assert_int_equal(token_get(path, token, &err), RESULT_FORMAT);
        assert_non_null(strstr(err.text, path));
    }
}

static void a_folder_that_is_not_there_is_told(void **state) {
    (void)state;
    char token[TOKEN_LENGTH + 1];
    struct error err = {""};
    assert_int_equal(token_get("/nowhere/at/all", token, &err), RESULT_IO);
    assert_non_null(strstr(err.text, "/nowhere/at/all"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_first_start_makes_one_for_its_owner_alone_and_keeps_it,
                                        begin, end),
        cmocka_unit_test_setup_teardown(a_file_that_others_may_use_is_told, begin, end),
        cmocka_unit_test_setup_teardown(a_file_without_a_token_is_refused_and_left_alone, begin,
                                        end),
        cmocka_unit_test(a_folder_that_is_not_there_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
