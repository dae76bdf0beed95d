#include "replay/program.h"
#include "replay/recording.h"
#include "test.h"

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char output[64 << 20]; // a table of a whole session is large

// Runs arthron-trace; `output` gets stdout and stderr. Returns the exit code.
static int run(const char *arguments) {
    return run_program(TRACE_PROGRAM, arguments, output, sizeof output);
}

static int run_on_trace(const char *command, const char *rest) {
    char arguments[512];
    snprintf(arguments, sizeof arguments, "%s %s %s", command, trace_path, rest);
    return run(arguments);
}

static json_t *output_object(void) {
    json_error_t err;
    json_t *root = json_loads(output, 0, &err);
    if (!root)
        fail_msg("%s in: %s", err.text, output);
    return root;
}

static json_int_t number(json_t *object, const char *key) {
    json_t *value = json_object_get(object, key);
    assert_true(json_is_integer(value));
    return json_integer_value(value);
}

static void record_honestly(void) {
    struct trace_header header = honest_header();
    snprintf(header.case_dir, sizeof header.case_dir, "%s", case_dir);
    snprintf(header.station, sizeof header.station, "bench 3");
    record(&header, 0, NULL);
}

static void info_tells_whose_session_it_is(void **state) {
    (void)state;
    record_honestly();
    assert_int_equal(run_on_trace("info", "--json"), 0);
    json_t *root = output_object();
    assert_int_equal(number(root, "steps"), recorded_steps);
    assert_string_equal(json_string_value(json_object_get(root, "station")), "bench 3");
    assert_string_equal(json_string_value(json_object_get(root, "state")), "closed");
    json_t *probe = json_object_get(json_object_get(root, "instruments"), "probe");
    assert_true(number(probe, "steps") > 500);
    json_t *noticed = json_object_get(json_object_get(probe, "noticeable_share"), "any");
    assert_true(json_real_value(noticed) > 0 && json_real_value(noticed) < 1);
    assert_true(json_real_value(json_object_get(probe, "gain_max")) > 1);
    assert_true(number(json_object_get(root, "events"), "contact") > 0);
    assert_true(json_is_true(json_object_get(root, "whole")));
    json_decref(root);
    assert_int_equal(run_on_trace("info", ""), 0);
    assert_non_null(strstr(output, "bench 3"));
}

static void verify_tells_up_to_where_a_file_is_whole(void **state) {
    (void)state;
    record_honestly();
    assert_int_equal(run_on_trace("verify", ""), 0);
    assert_int_equal(run_on_trace("verify", "--json"), 0);
    json_t *root = output_object();
    json_int_t size = number(root, "file_bytes");
    assert_int_equal(number(root, "whole_bytes"), size);
    json_decref(root);
    assert_int_equal(truncate(trace_path, size - 100), 0);
    assert_int_equal(run_on_trace("verify", "--json"), 1);
    root = output_object();
    assert_true(json_is_false(json_object_get(root, "whole")));
    assert_true(number(root, "whole_bytes") < size - 100);
    assert_true(number(root, "records") < (json_int_t)recorded_steps);
    json_decref(root);
}

static void flip_byte_at(long offset) {
    FILE *file = fopen(trace_path, "r+b");
    assert_non_null(file);
    fseek(file, offset, SEEK_SET);
    int byte = fgetc(file);
    fseek(file, offset, SEEK_SET);
    fputc(byte ^ 4, file);
    fclose(file);
}

static void verify_tells_what_was_changed_and_reads_behind_it(void **state) {
    (void)state;
    record_honestly();
    assert_int_equal(run_on_trace("verify", ""), 0);
    assert_non_null(strstr(output, "not signed"));
    struct stat status;
    assert_int_equal(stat(trace_path, &status), 0);
    flip_byte_at(status.st_size / 3);
    flip_byte_at(status.st_size / 2);
    assert_int_equal(run_on_trace("verify", "--json"), 1);
    json_t *root = output_object(), *damages = json_object_get(root, "damages");
    assert_int_equal(json_array_size(damages), 2);
    for (int i = 0; i < 2; i++) {
        json_t *damage = json_array_get(damages, (size_t)i);
        json_int_t at = status.st_size / (3 - i), begin = number(damage, "byte");
        assert_true(begin <= at && at < begin + number(damage, "bytes"));
    }
    json_int_t readable = number(root, "records") + number(root, "records_behind");
    assert_int_equal(readable, recorded_steps - 2);
    json_decref(root);
    assert_int_equal(run_on_trace("verify", "--authority /nowhere.pem"), 1);
    assert_int_equal(run_on_trace("info", ""), 0);
}

static void replay_finds_the_case_that_the_trace_names(void **state) {
    (void)state;
    record_honestly();
    assert_int_equal(run_on_trace("replay", ""), 0);
    assert_int_equal(run_on_trace("replay", "--json"), 0);
    json_t *root = output_object();
    assert_int_equal(number(root, "different"), 0);
    assert_string_equal(json_string_value(json_object_get(root, "verdict")), "identical");
    assert_true(json_is_true(json_object_get(root, "same_build")));
    json_decref(root);
    struct trace_header moved = honest_header();
    snprintf(moved.case_dir, sizeof moved.case_dir, "/nowhere");
    record(&moved, 0, NULL);
    assert_int_equal(run_on_trace("replay", ""), 1);
    assert_non_null(strstr(output, "/nowhere"));
    char option[128];
    snprintf(option, sizeof option, "--case %s", case_dir);
    assert_int_equal(run_on_trace("replay", option), 0);
}

// Without the optimizer, and with other code of the mathematics library.
static void other_builds_and_processors_give_the_same(void **state) {
    (void)state;
    char line[512];
    record_honestly();
    snprintf(line, sizeof line, "%s %s %s 2>&1", UNOPTIMIZED, trace_path, case_dir);
    assert_int_equal(system(line), 0);
    setenv("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2_Usable,-FMA_Usable,-AVX2,-FMA,-FMA4", 1);
    int code = run_on_trace("replay", "--json");
    unsetenv("GLIBC_TUNABLES");
    json_t *root = output_object();
    assert_int_equal(code, 0);
    assert_true(json_is_false(json_object_get(root, "same_cpu")));
    assert_true(json_is_true(json_object_get(root, "same_events")));
    assert_true(json_real_value(json_object_get(root, "largest_mm")) <= 1e-6);
    const char *verdict = json_string_value(json_object_get(root, "verdict"));
    assert_true(!strcmp(verdict, "identical") || !strcmp(verdict, "equivalent"));
    json_decref(root);
}

static void lie(struct session_output *out) {
    out->joint.flexion_deg += 1;
}

static void replay_of_a_forged_trace_fails_and_says_where(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    snprintf(header.case_dir, sizeof header.case_dir, "%s", case_dir);
    record(&header, 77, lie);
    assert_int_equal(run_on_trace("replay", ""), 1);
    assert_non_null(strstr(output, "first in step 77: flexion_deg was "));
    assert_int_equal(run_on_trace("replay", "--json"), 1);
    json_t *root = output_object();
    assert_int_equal(number(json_object_get(root, "first"), "step"), 77);
    json_decref(root);
}

static void replay_of_a_span_compares_that_and_no_more(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    snprintf(header.case_dir, sizeof header.case_dir, "%s", case_dir);
    record(&header, 400, lie); // from about 4 s on
    assert_int_equal(run_on_trace("replay", "--to 3 --json"), 0);
    json_t *root = output_object();
    json_int_t steps = number(root, "steps");
    assert_true(steps > 250 && steps < 350);
    json_decref(root);
    assert_int_equal(run_on_trace("replay", "--from 3 --to 5 --json"), 1);
    root = output_object();
    assert_int_equal(number(json_object_get(root, "first"), "step"), 400);
    assert_true(number(root, "steps") > 150 && number(root, "steps") < 250);
    json_decref(root);
}

static double real_at(json_t *object, const char *first, const char *second, const char *third) {
    object = json_object_get(json_object_get(json_object_get(object, first), second), third);
    assert_true(json_is_real(object));
    return json_real_value(object);
}

static void other_settings_are_tried_on_the_same_hands(void **state) {
    (void)state;
    record_honestly();
    struct {
        const char *option;
        bool same;
    } rows[] = {{"--strength 1 --json", true},
                {"--strength 0 --json", false},
                {"--field smooth --json", false},
                {"--field integral --json", true}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_equal(run_on_trace("replay", rows[i].option), 0);
        json_t *root = output_object();
        double mean = real_at(root, "instruments", "probe", "mean_mm");
        double most = real_at(root, "instruments", "probe", "max_mm");
        json_t *tried = json_object_get(json_object_get(root, "instruments"), "probe");
        double offset =
            json_real_value(json_object_get(json_object_get(tried, "tried"), "offset_mean_mm"));
        assert_int_equal(number(root, "steps"), recorded_steps);
        assert_true(rows[i].same ? most == 0 : mean > 0 && most > mean);
        assert_true(i == 1 ? offset < 1e-9 : offset > 0.01);
        json_t *tissue = json_array_get(json_object_get(root, "resections"), 0);
        json_t *recorded = json_object_get(tissue, "recorded");
        if (rows[i].same)
            assert_true(json_equal(recorded, json_object_get(tissue, "tried")));
        json_decref(root);
    }
    assert_int_equal(run_on_trace("replay", "--field square"), 2);
    assert_int_equal(run_on_trace("replay", "--strength 2"), 2);
}

static void a_piece_replays_and_names_what_it_is_of(void **state) {
    (void)state;
    char piece[128], arguments[384];
    record_honestly();
    snprintf(piece, sizeof piece, "%s.piece", trace_path);
    snprintf(arguments, sizeof arguments, "--from 3 --to 5 --out %s", piece);
    assert_int_equal(run_on_trace("cut", arguments), 0);
    assert_non_null(strstr(output, "wrote "));
    assert_int_equal(run_on_trace("cut", arguments), 1); // it is there
    snprintf(arguments, sizeof arguments, "replay %s --json", piece);
    assert_int_equal(run(arguments), 0);
    json_t *root = output_object();
    json_int_t steps = number(root, "steps");
    assert_true(steps > 150 && steps < 250);
    assert_int_equal(number(root, "different"), 0);
    json_decref(root);
    snprintf(arguments, sizeof arguments, "info %s --json", piece);
    assert_int_equal(run(arguments), 0);
    root = output_object();
    assert_int_equal(number(root, "steps"), steps);
    assert_true(number(root, "past") > 250);
    assert_int_equal(json_string_length(json_object_get(root, "parent")), 64);
    assert_string_equal(json_string_value(json_object_get(root, "parent_session")),
                        json_string_value(json_object_get(root, "session")));
    json_decref(root);
    snprintf(arguments, sizeof arguments, "verify %s", piece);
    assert_int_equal(run(arguments), 0);
    snprintf(arguments, sizeof arguments, "cut %s --from 4 --out %s.piece", piece, piece);
    assert_int_equal(run(arguments), 0); // of a piece too
    snprintf(arguments, sizeof arguments, "replay %s.piece", piece);
    assert_int_equal(run(arguments), 0);
    unlink(piece);
    snprintf(arguments, sizeof arguments, "%s.piece", piece);
    unlink(arguments);
}

static size_t count(const char *text, char c) {
    size_t n = 0;
    for (; *text; text++)
        n += *text == c;
    return n;
}

static void export_writes_a_row_for_each_step(void **state) {
    (void)state;
    record_honestly();
    assert_int_equal(run_on_trace("export", "--csv -"), 0);
    assert_int_equal(count(output, '\n'), recorded_steps + 1);
    assert_non_null(strstr(output, ",probe_tx_mm,"));
    assert_non_null(strstr(output, ",probe_warped_tx_mm,"));
    assert_null(strstr(output, "shaver")); // there was none
    char *line = strtok(output, "\n");
    size_t commas = count(line, ',');
    while ((line = strtok(NULL, "\n")))
        assert_int_equal(count(line, ','), commas);
    assert_int_equal(run_on_trace("export", "--csv - --from 2 --to 2.5"), 0);
    assert_int_equal(count(output, '\n'), 1 + 51); // 100 Hz, both ends
}

static void picture_draws_what_was_cut(void **state) {
    (void)state;
    char path[128], arguments[192];
    struct stat status;
    record_honestly();
    snprintf(path, sizeof path, "%s.png", trace_path);
    snprintf(arguments, sizeof arguments, "--out %s --group meniscus_medial", path);
    assert_int_equal(run_on_trace("picture", arguments), 0);
    assert_non_null(strstr(output, ".png\n"));
    assert_int_equal(stat(path, &status), 0);
    assert_true(status.st_size > 1000);
    unlink(path);
    assert_int_equal(run_on_trace("picture", "--out /nowhere/x.png"), 1);
    assert_non_null(strstr(output, "/nowhere/x.png"));
    snprintf(arguments, sizeof arguments, "--out %s --group spleen", path);
    assert_int_equal(run_on_trace("picture", arguments), 1);
    assert_non_null(strstr(output, "spleen"));
}

static void wrong_use_exits_2_and_says_why(void **state) {
    (void)state;
    static const char *const rows[] = {"",
                                       "fly",
                                       "info",
                                       "info a b",
                                       "verify --fast a",
                                       "replay --case",
                                       "export a",
                                       "export a --csv - --from soon",
                                       "export a --csv - --exr b",
                                       "cut a",
                                       "cut a --from 3 --to 2 --out b"};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_equal(run(rows[i]), 2);
        assert_true(strlen(output) > 0);
    }
    static const char *const helps[] = {"--help",        "--version",     "info --help",
                                        "verify --help", "replay --help", "export --help",
                                        "cut --help"};
    for (size_t i = 0; i < sizeof helps / sizeof *helps; i++)
        assert_int_equal(run(helps[i]), 0);
}

static void a_file_that_is_no_trace_is_refused_by_name(void **state) {
    (void)state;
    static const char *const rows[] = {"info /dev/null", "verify /nowhere.trace",
                                       "replay " TRACE_PROGRAM, "export / --csv -"};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_equal(run(rows[i]), 1);
        assert_non_null(strchr(output, '/'));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(info_tells_whose_session_it_is),
        cmocka_unit_test(verify_tells_up_to_where_a_file_is_whole),
        cmocka_unit_test(verify_tells_what_was_changed_and_reads_behind_it),
        cmocka_unit_test(replay_finds_the_case_that_the_trace_names),
        cmocka_unit_test(other_builds_and_processors_give_the_same),
        cmocka_unit_test(replay_of_a_forged_trace_fails_and_says_where),
        cmocka_unit_test(replay_of_a_span_compares_that_and_no_more),
        cmocka_unit_test(other_settings_are_tried_on_the_same_hands),
        cmocka_unit_test(a_piece_replays_and_names_what_it_is_of),
        cmocka_unit_test(export_writes_a_row_for_each_step),
        cmocka_unit_test(picture_draws_what_was_cut),
        cmocka_unit_test(wrong_use_exits_2_and_says_why),
        cmocka_unit_test(a_file_that_is_no_trace_is_refused_by_name),
    };
    return cmocka_run_group_tests_name("trace_commands", tests, make_session, remove_session);
}
