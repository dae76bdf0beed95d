#include "report/strip.h"
#include "test.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void quartiles_are_those_of_a_table(void **state) {
    (void)state;
    // As R's quantile (type 7) and numpy's percentile say.
    static const double four[] = {1, 2, 3, 4}, odd[] = {2, 3, 5, 7, 11}, one[] = {42};
    assert_true(strip_quantile(four, 4, 0.25) == 1.75);
    assert_true(strip_quantile(four, 4, 0.5) == 2.5);
    assert_true(strip_quantile(four, 4, 0.75) == 3.25);
    assert_true(strip_quantile(odd, 5, 0.25) == 3);
    assert_true(strip_quantile(odd, 5, 0.5) == 5);
    assert_true(strip_quantile(odd, 5, 1) == 11);
    assert_true(strip_quantile(one, 1, 0.75) == 42);
}

static void draw(const double *values, size_t count, double mark, char **out_text) {
    size_t size;
    FILE *file = open_memstream(out_text, &size);
    strip_write(file, &(struct strip){values, count, mark});
    fclose(file);
}

static double number_behind(const char *text, const char *what) {
    const char *at = strstr(text, what);
    assert_non_null(at);
    return strtod(at + strlen(what), NULL);
}

static void the_mark_stands_where_its_value_is_among_the_dots(void **state) {
    (void)state;
    static const double values[] = {0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100};
    char *text;
    draw(values, 11, 30, &text);
    double least = number_behind(text, "<path d=\"M"); // where the whiskers begin
    double box = number_behind(text, "<rect x=\"");
    const char *last = strstr(text, "fill=\"#d55e00\"");
    while (strncmp(last, "d=\"M", 4) != 0)
        last--;
    double mark = strtod(last + 4, NULL), most = 240 - least;
    assert_near(mark, least + 0.3 * (most - least), 0.1);
    assert_near(box, least + 0.25 * (most - least), 0.1);
    free(text);
}

static void a_value_beyond_all_others_is_still_inside(void **state) {
    (void)state;
    static const double same[] = {5, 5, 5, 5, 5}, tiny[] = {1e-300, 2e-300},
                        huge[] = {-1.7e308, 1.7e308};
    const struct {
        const double *values;
        size_t count;
        double mark;
    } rows[] = {{same, 5, 5}, {same, 5, 900}, {same, 5, -900}, {tiny, 2, 0}, {huge, 2, 0}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char *text;
        draw(rows[i].values, rows[i].count, rows[i].mark, &text);
        for (const char *at = text; (at = strstr(at, " d=\"M")); at++) {
            double x = strtod(at + 5, NULL);
            assert_true(x >= 6.9 && x <= 233.1);
        }
        assert_null(strstr(text, "nan"));
        assert_null(strstr(text, "inf"));
        free(text);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quartiles_are_those_of_a_table),
        cmocka_unit_test(the_mark_stands_where_its_value_is_among_the_dots),
        cmocka_unit_test(a_value_beyond_all_others_is_still_inside),
    };
    return cmocka_run_group_tests_name("report_strip", tests, NULL, NULL);
}
