#include "report.h"

#include "base/check.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// {"bench", "marks": [{"name", "value", "unit", "mark", "better", "holds"}],
//  "figures": [{"name", "value", "unit"}], "texts": {name: text}}
struct report {
    json_t *root, *marks, *figures, *texts;
    bool holds;
};

struct report *report_create(const char *bench) {
    struct report *report = alloc(1, sizeof *report);
    report->marks = json_array();
    report->figures = json_array();
    report->texts = json_object();
    report->root = json_pack("{s:s, s:o, s:o, s:o}", "bench", bench, "marks", report->marks,
                             "figures", report->figures, "texts", report->texts);
    CHECK(report->root);
    report->holds = true;
    return report;
}

void report_destroy(struct report **report) {
    json_decref((*report)->root);
    free(*report);
    *report = NULL;
}

static json_t *number(double value) {
    return isfinite(value) ? json_real(value) : json_null();
}

void report_mark(struct report *report, const char *name, double value, const char *unit,
                 double mark, enum better better) {
    bool holds = better == BETTER_LOW ? value <= mark : value >= mark; // NaN does not
    report->holds = report->holds && holds;
    json_array_append_new(report->marks,
                          json_pack("{s:s, s:o, s:s, s:o, s:s, s:b}", "name", name, "value",
                                    number(value), "unit", unit, "mark", number(mark), "better",
                                    better == BETTER_LOW ? "low" : "high", "holds", holds));
}

void report_figure(struct report *report, double value, const char *unit, const char *name, ...) {
    char text[160];
    va_list arguments;
    va_start(arguments, name);
    vsnprintf(text, sizeof text, name, arguments);
    va_end(arguments);
    json_array_append_new(report->figures, json_pack("{s:s, s:o, s:s}", "name", text, "value",
                                                     number(value), "unit", unit));
}

void report_text(struct report *report, const char *name, const char *text) {
    json_object_set_new(report->texts, name, json_string(text));
}

bool report_holds(const struct report *report) {
    return report->holds;
}

void report_print_json(const struct report *report) {
    json_dumpf(report->root, stdout, JSON_COMPACT | JSON_REAL_PRECISION(10));
    putchar('\n');
}

static const char *text_of(const json_t *item, const char *key) {
    return json_string_value(json_object_get(item, key));
}

static double number_of(const json_t *item, const char *key) {
    const json_t *value = json_object_get(item, key);
    return json_is_null(value) ? NAN : json_number_value(value);
}

void report_print_table(const struct report *report) {
    const char *name;
    json_t *item;
    size_t i;
    json_object_foreach(report->texts, name, item)
        printf("%s: %s\n", name, json_string_value(item));
    json_array_foreach(report->figures, i, item)
        printf("%-56s %12.6g %s\n", text_of(item, "name"), number_of(item, "value"),
               text_of(item, "unit"));
    json_array_foreach(report->marks, i, item) {
        bool low = text_of(item, "better")[0] == 'l';
        printf("%-56s %12.6g %s, %s %g: %s\n", text_of(item, "name"), number_of(item, "value"),
               text_of(item, "unit"), low ? "at most" : "at least", number_of(item, "mark"),
               json_is_true(json_object_get(item, "holds")) ? "holds" : "DOES NOT HOLD");
    }
}
