// arthron-trace report: the page that it writes of a recorded session.

#include "metrics/metrics.h"
#include "replay/program.h"
#include "replay/recording.h"
#include "review/words.h"
#include "store/store.h"
#include "test.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char said[1 << 16], page_path[128];
static char *page;

static int run(const char *file, const char *options) {
    char arguments[1024];
    snprintf(page_path, sizeof page_path, "%s.html", trace_path);
    snprintf(arguments, sizeof arguments, "%s %s", file, options);
    return run_program(TRACE_PROGRAM " report", arguments, said, sizeof said);
}

// `page` gets what was written. Returns the exit code.
static int report_with(const char *options) {
    char out[512];
    size_t size;
    snprintf(out, sizeof out, "--out %s.html %s", trace_path, options);
    int code = run(trace_path, out);
    FILE *copy = open_memstream(&page, &size), *file = fopen(page_path, "r");
    assert_non_null(file);
    for (int c; (c = fgetc(file)) != EOF;)
        fputc(c, copy);
    fclose(file);
    fclose(copy);
    unlink(page_path);
    return code;
}

static int report(void) {
    return report_with("");
}

static void record_with(const char *trainee) {
    struct trace_header header = honest_header();
    snprintf(header.case_dir, sizeof header.case_dir, "%s", case_dir);
    snprintf(header.station, sizeof header.station, "bench 3");
    snprintf(header.trainee, sizeof header.trainee, "%s", trainee);
    record(&header, 0, NULL);
}

static void assert_has(const char *text) {
    if (!strstr(page, text))
        fail_msg("no '%s' in the page", text);
}

static int count_of(const char *what) {
    int count = 0;
    for (const char *at = page; (at = strstr(at, what)); at++)
        count++;
    return count;
}

// By somebody else's parser, each drawing of the page.
static void assert_drawings_are_xml(void) {
    FILE *parser =
        popen("python3 -c 'import re, sys, xml.etree.ElementTree as tree\n"
              "drawn = re.findall(\"<figure>(.*?)<figcaption>\", sys.stdin.read(), re.S)\n"
              "assert len(drawn) >= 7\n"
              "for text in drawn: tree.fromstring(text)'",
              "w");
    assert_non_null(parser);
    fputs(page, parser);
    assert_int_equal(pclose(parser), 0);
}

static void a_session_becomes_a_page_of_its_own(void **state) {
    (void)state;
    static const char *const wanted[] = {"bench 3",
                                         "<h2>Outcome</h2>",
                                         "mm³ removed. Thinnest remaining rim",
                                         "<h2>Instruments</h2>",
                                         "<h3>probe</h3>",
                                         "Path, coronal",
                                         "Path, sagittal",
                                         "Shown–real offset",
                                         "<h2>Joint</h2>",
                                         "Flexion",
                                         "Varus",
                                         "<h2>Resection</h2>",
                                         "touched where nothing is seen, mm³",
                                         ": touch and sight",
                                         "<h2>Record</h2>",
                                         "<h2>Figures</h2>",
                                         ">Path, hand<",
                                         ">whole<",
                                         "plot-band"};
    record_with("Ada");
    assert_int_equal(report(), 0);
    assert_non_null(strstr(said, page_path));
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++)
        assert_has(wanted[i]);
    assert_true(strstr(page, "<h2>Outcome</h2>") < strstr(page, "<h2>Figures</h2>"));
    assert_true(strstr(page, "<h2>Figures</h2>") < strstr(page, "<h2>Record</h2>"));
    assert_int_equal(count_of(">ldlj_hand<"), 0);
    assert_drawings_are_xml();
    assert_int_equal(count_of("href="), 0);
    assert_int_equal(count_of("src="), 0);
    assert_int_equal(count_of("<script"), 0);
    free(page);
}

// ---- beside others ------------------------------------------------------------------------------

static char records_path[FOLDER_MAX + 24];

// A session of the records with one figure, and trainee and case of its own.
struct other {
    const char *trainee, *case_name;
    enum metric metric;
    int version;
    double value;
};

static void put_other(struct store *store, int number, const struct other *other) {
    const struct metric_kind *kind = &metric_kinds[other->metric];
    struct store_session session = {.start_utc_ns = 1 + number,
                                    .end_utc_ns = 2 + number,
                                    .part = 1,
                                    .state = STATE_CLOSED,
                                    .steps = 9};
    struct store_result figure = {.version = other->version, .value = other->value};
    struct error err;
    snprintf(session.id, sizeof session.id, "%032x", number);
    snprintf(session.station, sizeof session.station, "bench 3");
    snprintf(session.trainee, sizeof session.trainee, "%s", other->trainee);
    snprintf(session.case_name, sizeof session.case_name, "%s", other->case_name);
    snprintf(session.trace, sizeof session.trace, "/t/%d", number);
    snprintf(figure.metric, sizeof figure.metric, "%s", kind->name);
    snprintf(figure.unit, sizeof figure.unit, "%s", kind->unit);
    snprintf(figure.subject, sizeof figure.subject, "probe");
    if (store_put_session(store, &session, &figure, 1, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

// Five of ada's and one of eve's path, three of ada's smoothness; what is of another case or of
// another version of the figure is no company.
static void make_records(void) {
    const struct other others[] = {
        {"ada", "arthrosis", METRIC_PATH_HAND, 1, 100},
        {"ada", "arthrosis", METRIC_PATH_HAND, 1, 104},
        {"ada", "arthrosis", METRIC_PATH_HAND, 1, 101},
        {"ada", "arthrosis", METRIC_PATH_HAND, 1, 103},
        {"ada", "arthrosis", METRIC_PATH_HAND, 1, 102},
        {"eve", "arthrosis", METRIC_PATH_HAND, 1, 900},
        {"ada", "healthy", METRIC_PATH_HAND, 1, 5},
        {"ada", "arthrosis", METRIC_PATH_HAND, 2, 5},
        {"ada", "arthrosis", METRIC_LDLJ_HAND, 1, -9},
        {"ada", "arthrosis", METRIC_LDLJ_HAND, 1, -11},
        {"ada", "arthrosis", METRIC_LDLJ_HAND, 1, -10},
    };
    struct store *store;
    snprintf(records_path, sizeof records_path, "%s.db", trace_path);
    assert_int_equal(store_open(records_path, STORE_MAKE, "tester", &store, NULL), RESULT_OK);
    for (int i = 0; i < (int)(sizeof others / sizeof *others); i++)
        put_other(store, i, &others[i]);
    assert_int_equal(store_add_course(store, "autumn <26>", NULL), RESULT_OK);
    assert_int_equal(store_enrol(store, "ada", "autumn <26>", NULL), RESULT_OK);
    store_close(&store);
}

static void remove_records(void) {
    static const char *const ends[] = {"", "-wal", "-shm", "-lock"};
    char file[sizeof records_path + 8];
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        snprintf(file, sizeof file, "%s%s", records_path, ends[i]);
        unlink(file);
    }
}

static void figures_stand_beside_those_of_a_course(void **state) {
    (void)state;
    char options[400];
    record_with("Ada");
    make_records();
    snprintf(options, sizeof options, "--records %s --course 'autumn <26>'", records_path);
    assert_int_equal(report_with(options), 0);
    assert_has("course autumn &lt;26&gt; on case arthrosis");
    assert_has(
        "<td class=\"n\">5</td><td class=\"n\">101 &middot; <b>102</b> &middot; 103</td><td><svg");
    assert_has("<td class=\"n\">3</td><td colspan=\"2\">-11, -10, -9</td>");
    assert_int_equal(count_of("fill=\"#d55e00\""), 1);
    assert_drawings_are_xml();
    free(page);

    snprintf(options, sizeof options, "--records %s", records_path);
    assert_int_equal(report_with(options), 0);
    assert_has(
        "<td class=\"n\">6</td><td class=\"n\">101.2 &middot; <b>102.5</b> &middot; 103.8</td>");
    free(page);

    snprintf(options, sizeof options, "--out %s.html --records %s --course spring", trace_path,
             records_path);
    assert_int_equal(run(trace_path, options), 1);
    assert_non_null(strstr(said, "spring"));
    snprintf(options, sizeof options, "--out %s.html --course spring", trace_path);
    assert_int_equal(run(trace_path, options), 2);
    remove_records();
    snprintf(options, sizeof options, "--out %s.html --records %s", trace_path, records_path);
    assert_int_equal(run(trace_path, options), 1);
    assert_non_null(strstr(said, records_path));
    assert_int_equal(access(page_path, F_OK), -1);
}

static const char *words_of(const char *name) {
    for (int i = 0; i < METRIC_COUNT; i++)
        if (strcmp(metric_kinds[i].name, name) == 0)
            return review_metric_words(i);
    fail_msg("no metric %s", name);
    return NULL;
}

static void every_figure_has_words(void **state) {
    (void)state;
    for (int i = 0; i < METRIC_COUNT; i++)
        assert_non_null(review_metric_words(i));
}

// The figures are those of score: each line's name and value stand side by side in a row.
static void its_figures_are_those_of_score(void **state) {
    (void)state;
    char line[512], name[64], version[16], value[48], row[256];
    int count = 0;
    record_with("Ada");
    assert_int_equal(report(), 0);
    snprintf(line, sizeof line, "%s score %s", TRACE_PROGRAM, trace_path);
    FILE *program = popen(line, "r");
    assert_non_null(program);
    while (fgets(line, sizeof line, program)) {
        if (sscanf(line, "%63s %15s %47s", name, version, value) != 3 || version[0] != 'v')
            continue;
        snprintf(row, sizeof row,
                 "<td title=\"%s\">%s</td><td class=\"n\">%s</td><td class=\"n\">%s</td>", name,
                 words_of(name), version + 1, value);
        assert_has(row);
        count++;
    }
    assert_int_equal(pclose(program), 0);
    assert_true(count > 10);
    free(page);
}

static void texts_of_the_trace_are_escaped(void **state) {
    (void)state;
    record_with("<b>Eve</b> & \"co\"");
    assert_int_equal(report(), 0);
    assert_has("&lt;b&gt;Eve&lt;/b&gt; &amp; &quot;co&quot;");
    assert_int_equal(count_of("<b>"), 0);
    free(page);
    record_with("\xff\xfe");
    assert_int_equal(report(), 0);
    assert_has("not UTF-8");
    assert_int_equal(count_of("\xff"), 0);
    free(page);
}

static void a_trace_that_lost_its_end_gives_a_page_that_says_so(void **state) {
    (void)state;
    struct stat status;
    record_with("Ada");
    assert_int_equal(stat(trace_path, &status), 0);
    assert_int_equal(truncate(trace_path, status.st_size / 2), 0);
    assert_int_equal(report(), 1);
    assert_has("not whole");
    assert_has("<h3>probe</h3>");
    assert_drawings_are_xml();
    free(page);
}

static void what_cannot_be_is_refused_by_name(void **state) {
    (void)state;
    char options[160];
    record_with("Ada");
    assert_int_equal(run("/nowhere.trace", "--out /tmp/never.html"), 1);
    assert_non_null(strstr(said, "/nowhere.trace"));
    assert_int_equal(run(trace_path, "--out /nowhere/x.html"), 1);
    assert_non_null(strstr(said, "/nowhere/x.html"));
    snprintf(options, sizeof options, "--case /nowhere --out %s.html", trace_path);
    assert_int_equal(run(trace_path, options), 1);
    assert_non_null(strstr(said, "/nowhere"));
    assert_int_equal(access(page_path, F_OK), -1);
    assert_int_equal(run(trace_path, ""), 2);
    assert_int_equal(run("--help", ""), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_session_becomes_a_page_of_its_own),
        cmocka_unit_test(its_figures_are_those_of_score),
        cmocka_unit_test(every_figure_has_words),
        cmocka_unit_test(figures_stand_beside_those_of_a_course),
        cmocka_unit_test(texts_of_the_trace_are_escaped),
        cmocka_unit_test(a_trace_that_lost_its_end_gives_a_page_that_says_so),
        cmocka_unit_test(what_cannot_be_is_refused_by_name),
    };
    return cmocka_run_group_tests_name("trace_report", tests, make_session, remove_session);
}
