// arthron-trace score beside the same figures made while the session ran.

#include "metrics/metrics.h"
#include "replay/program.h"
#include "replay/recording.h"
#include "test.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static char output[1 << 20];

static int run(const char *arguments) {
    return run_program(TRACE_PROGRAM " score", arguments, output, sizeof output);
}

static int score(const char *options) {
    char arguments[400];
    snprintf(arguments, sizeof arguments, "%s %s", trace_path, options);
    return run(arguments);
}

static const struct view_optic recorded_optic = {70, 85};

static void record_on(const char *dir) {
    struct trace_header header = honest_header();
    header.optic = recorded_optic;
    snprintf(header.case_dir, sizeof header.case_dir, "%s", dir);
    record(&header, 0, NULL);
}

static json_t *output_object(void) {
    json_error_t err;
    json_t *root = json_loads(output, 0, &err);
    if (!root)
        fail_msg("%s in: %s", err.text, output);
    return root;
}

static const char *text_of(const json_t *object, const char *key) {
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

// ---- live and from the trace --------------------------------------------------------------------

static void live_step(void *context, const struct session_input *input,
                      const struct session_output *out) {
    metrics_step(context, input, out);
}

struct comparison {
    const json_t *figures;
    size_t at, groups, moved;
};

static void compare(void *context, const struct metric_value *v) {
    struct comparison *c = context;
    const struct metric_kind *kind = &metric_kinds[v->metric];
    const json_t *figure = json_array_get(c->figures, c->at++);
    assert_string_equal(text_of(figure, "name"), kind->name);
    assert_string_equal(text_of(figure, "unit"), kind->unit);
    assert_int_equal(json_integer_value(json_object_get(figure, "version")), kind->version);
    const json_t *value = json_object_get(figure, "value");
    if (isnan(v->value))
        assert_true(json_is_null(value));
    else
        assert_true(json_real_value(value) == v->value);
    assert_int_equal(json_is_true(json_object_get(figure, "below_floor")), v->below_floor);
    if (v->group >= 0) {
        const struct knee_case *knee = scene_case(played.scene);
        assert_string_equal(text_of(figure, "group"), knee->groups[v->group].name);
        c->groups++;
    }
    if (v->instrument >= 0) {
        enum channel channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + v->instrument);
        assert_string_equal(text_of(figure, "instrument"), channel_name(channel));
    }
    c->moved += v->metric == METRIC_PATH_SEEN && v->value > 5;
}

static void a_trace_scores_as_its_session_did(void **state) {
    (void)state;
    static struct metrics live;
    struct session_settings settings = session_settings_default();
    record_on(case_dir);
    metrics_init(&live, instruments_usual(), recorded_optic);
    played_run(&played, &settings, played.motion.row_count, live_step, &live);
    assert_int_equal(score("--json"), 0);
    json_t *root = output_object();
    assert_true(json_is_true(json_object_get(root, "whole")));
    assert_int_equal(strlen(text_of(root, "session")), 32);
    struct comparison c = {.figures = json_object_get(root, "metrics")};
    metrics_each(&live, NULL, compare, &c);
    assert_int_equal(c.at, json_array_size(c.figures));
    assert_true(c.groups > 0 && c.moved > 0);
    json_decref(root);
}

// ---- what else it says --------------------------------------------------------------------------

static void without_its_case_groups_have_numbers(void **state) {
    (void)state;
    record_on("/nowhere");
    assert_int_equal(score(""), 0);
    assert_non_null(strstr(output, "group-"));
    assert_non_null(strstr(output, "/nowhere"));
    char option[128];
    snprintf(option, sizeof option, "--case %s", case_dir);
    assert_int_equal(score(option), 0);
    assert_null(strstr(output, "group-"));
    assert_int_equal(score("--case /elsewhere"), 1);
    assert_non_null(strstr(output, "/elsewhere"));
}

static void another_case_lends_no_names(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    snprintf(header.case_dir, sizeof header.case_dir, "%s", case_dir);
    header.case_hash++;
    record(&header, 0, NULL);
    assert_int_equal(score(""), 0);
    assert_non_null(strstr(output, "group-"));
}

static void what_is_left_of_a_trace_is_scored(void **state) {
    (void)state;
    record_on(case_dir);
    assert_int_equal(truncate(trace_path, 400000), 0);
    assert_int_equal(score("--json"), 1);
    json_t *root = output_object();
    assert_true(json_is_false(json_object_get(root, "whole")));
    assert_true(strlen(text_of(root, "end")) > 0);
    const json_t *time = json_array_get(json_object_get(root, "metrics"), 0);
    assert_string_equal(text_of(time, "name"), "time");
    assert_true(json_real_value(json_object_get(time, "value")) > 1);
    json_decref(root);
}

static void assert_optic(const char *options, double tilt_deg, double field_deg) {
    assert_int_equal(score(options), 0);
    json_t *root = output_object();
    json_t *optic = json_object_get(root, "optic");
    assert_true(json_real_value(json_object_get(optic, "tilt_deg")) == tilt_deg);
    assert_true(json_real_value(json_object_get(optic, "field_deg")) == field_deg);
    json_decref(root);
}

static void the_optic_is_the_recorded_one_unless_another_is_asked_for(void **state) {
    (void)state;
    record_on(case_dir);
    assert_optic("--json", recorded_optic.tilt_deg, recorded_optic.field_deg);
    assert_optic("--json --optic 30", 30, recorded_optic.field_deg);
    assert_optic("--json --field 90", recorded_optic.tilt_deg, 90);
}

static void wrong_use_exits_2(void **state) {
    (void)state;
    static const char *const rows[] = {"",          "a b",          "a --optic 91", "a --field 0",
                                       "a --field", "a --optic up", "a --optic nan"};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        if (run(rows[i]) != 2)
            fail_msg("%s", rows[i]);
    assert_int_equal(run("--help"), 0);
    assert_int_equal(run("/dev/null"), 1);
    assert_int_equal(run("/nowhere.trace"), 1);
    assert_non_null(strstr(output, "/nowhere.trace"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_trace_scores_as_its_session_did),
        cmocka_unit_test(without_its_case_groups_have_numbers),
        cmocka_unit_test(another_case_lends_no_names),
        cmocka_unit_test(what_is_left_of_a_trace_is_scored),
        cmocka_unit_test(the_optic_is_the_recorded_one_unless_another_is_asked_for),
        cmocka_unit_test(wrong_use_exits_2),
    };
    return cmocka_run_group_tests_name("score", tests, make_session, remove_session);
}
