// Whose check of a case counts.
#include "check/standing.h"
#include "check/verdict.h"
#include "folder.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char around[FOLDER_MAX], folder[FOLDER_MAX + 8]; // the folder of a case, and that around it
static struct case_check *check;

static int setup(void **state) {
    (void)state;
    folder_make(around);
    snprintf(folder, sizeof folder, "%s/case", around);
    check = check_of_none("knee", &(struct check_settings){0}, &(struct error){"no"});
    check->hash = 7;
    check->grade = GRADE_FIT;
    return mkdir(folder, 0700);
}

static int teardown(void **state) {
    (void)state;
    check_destroy(&check);
    folder_remove(around);
    return 0;
}

static void expect_standing(const char *name, enum standing_kind kind) {
    struct case_standing standing = {0};
    assert_true(standing_refresh(&standing, folder, 7));
    assert_int_equal(standing.kind, kind);
    assert_string_equal(standing_name(&standing), name);
}

static void a_check_made_elsewhere_counts_only_where_it_says_unfit(void **state) {
    (void)state;
    char list[FOLDER_MAX + 16];
    struct error err;
    snprintf(list, sizeof list, "%s/%s", around, GRADE_MADE_HERE);
    for (int grade = GRADE_FIT; grade < GRADE_COUNT; grade++) {
        check->grade = (enum grade)grade;
        assert_int_equal(verdict_save(check, grade, folder, &err), RESULT_OK);
        expect_standing(grade_name(check->grade), STANDING_GRADED);
        assert_int_equal(unlink(list), 0); // as if the folder had been copied
        bool unfit = grade == GRADE_UNFIT;
        expect_standing(unfit ? "unfit" : "not checked",
                        unfit ? STANDING_GRADED : STANDING_FOREIGN);
    }
}

static void a_check_that_was_changed_since_does_not_count(void **state) {
    (void)state;
    char path[FOLDER_MAX + 24];
    struct error err;
    assert_int_equal(verdict_save(check, 1, folder, &err), RESULT_OK);
    snprintf(path, sizeof path, "%s/%s", folder, GRADE_FILE);
    FILE *file = fopen(path, "a");
    assert_non_null(file);
    fputc('\n', file);
    fclose(file);
    expect_standing("not checked", STANDING_FOREIGN);
}

static void a_check_that_cannot_be_noted_is_there_and_does_not_count(void **state) {
    (void)state;
    char list[FOLDER_MAX + 16];
    struct error err;
    snprintf(list, sizeof list, "%s/%s", around, GRADE_MADE_HERE);
    assert_int_equal(mkdir(list, 0700), 0);
    assert_int_equal(verdict_save(check, 1, folder, &err), RESULT_IO);
    assert_non_null(strstr(err.text, GRADE_MADE_HERE));
    expect_standing("not checked", STANDING_FOREIGN);
}

static void a_check_of_other_files_does_not_count(void **state) {
    (void)state;
    struct case_standing standing = {0};
    assert_int_equal(verdict_save(check, 1, folder, &(struct error){""}), RESULT_OK);
    assert_true(standing_refresh(&standing, folder, 8));
    assert_int_equal(standing.kind, STANDING_OUTDATED);
    assert_string_equal(standing_name(&standing), "not checked");
}

static void checks_made_here_are_listed_one_after_the_other(void **state) {
    (void)state;
    char path[FOLDER_MAX + 24], first[FOLDER_MAX + 24];
    struct case_standing standing = {0};
    snprintf(path, sizeof path, "%s/%s", folder, GRADE_FILE);
    snprintf(first, sizeof first, "%s/first", around);
    assert_true(standing_refresh(&standing, folder, 7));
    assert_int_equal(standing.kind, STANDING_UNCHECKED);
    assert_int_equal(verdict_save(check, 1, folder, &(struct error){""}), RESULT_OK);
    assert_true(standing_refresh(&standing, folder, 7)); // it is there now
    assert_int_equal(standing.kind, STANDING_GRADED);
    assert_false(standing_refresh(&standing, folder, 7));
    assert_int_equal(rename(path, first), 0);
    assert_int_equal(verdict_save(check, 2, folder, &(struct error){""}), RESULT_OK);
    expect_standing("fit", STANDING_GRADED);
    assert_int_equal(rename(first, path), 0);
    expect_standing("fit", STANDING_GRADED);
}

static void the_list_is_no_link_to_another_file(void **state) {
    (void)state;
    char list[FOLDER_MAX + 16], other[FOLDER_MAX + 16];
    snprintf(list, sizeof list, "%s/%s", around, GRADE_MADE_HERE);
    snprintf(other, sizeof other, "%s/other", around);
    assert_int_equal(symlink(other, list), 0);
    assert_int_equal(verdict_save(check, 1, folder, &(struct error){""}), RESULT_IO);
    assert_int_equal(access(other, F_OK), -1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_check_made_elsewhere_counts_only_where_it_says_unfit,
                                        setup, teardown),
        cmocka_unit_test_setup_teardown(a_check_that_was_changed_since_does_not_count, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(a_check_of_other_files_does_not_count, setup, teardown),
        cmocka_unit_test_setup_teardown(checks_made_here_are_listed_one_after_the_other, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(the_list_is_no_link_to_another_file, setup, teardown),
        cmocka_unit_test_setup_teardown(a_check_that_cannot_be_noted_is_there_and_does_not_count,
                                        setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
