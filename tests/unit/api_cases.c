// What /api/v1 tells of stations and cases.
#include "case/case.h"
#include "check/grade.h"
#include "test.h"
#include "unit/api_files.h"
#include "unit/case_knee.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct error err;

static void stations_are_enrolled_by_code_and_revoked(void **state) {
    (void)state;
    const char *token = token_of("tom");
    assert_int_equal(ask("GET", "/stations", token, NULL), 200);
    assert_int_equal(count_at("stations"), 2);
    assert_string_equal(text_at("stations.0.name"), "room-1");
    assert_string_equal(text_at("stations.0.trainee"), "ada");
    assert_string_equal(text_at("stations.1.start"), "command");
    assert_null(strstr(answer.body, "true"));
    assert_int_equal(ask("POST", "/stations/room-2/code", token, NULL), 201);
    assert_true(strlen(text_at("code")) > 20);
    assert_true(number_at("until_utc_s") > 1e9);
    assert_true(number_at("port") == 4810);
    assert_int_equal(ask("POST", "/stations/room-2/revoke", token, NULL), 409);
}

static void put_check(uint64_t hash, bool made_here) {
    char text[512];
    snprintf(text, sizeof text,
             "{\"format\":\"arthron-check\",\"version\":1,\"grade\":\"fit with warnings\","
             "\"hash\":\"%016" PRIx64 "\",\"quick\":false,\"settings\":{\"field\":\"smooth\"},"
             "\"findings\":[]}",
             hash);
    write_file(in_api("healthy"), "check.json", text, strlen(text));
    if (made_here)
        assert_int_equal(grade_note(in_api("healthy"), hash, text, strlen(text), 0, &err),
                         RESULT_OK);
}

static void cases_come_with_their_grade_and_files(void **state) {
    (void)state;
    char etag[80];
    const char *token = token_of("ada.l");
    api_wait_for_cases(token);
    assert_int_equal(count_at("cases"), 2);
    assert_string_equal(text_at("cases.0.title"), "A knee of boxes – ½");
    assert_string_equal(text_at("cases.0.groups.0.name"), "tibia");
    assert_string_equal(text_at("cases.0.groups.3.name"), "meniscus_medial");
    assert_string_equal(text_at("cases.0.groups.3.tissue"), "meniscus");
    assert_string_equal(text_at("cases.0.groups.3.label"), "Medial meniscus");
    assert_string_equal(text_at("cases.0.groups.3.colour"), "#a8c4d6");
    assert_string_equal(text_at("cases.0.groups.3.side"), "medial");
    assert_string_equal(text_at("cases.0.grade"), "unchecked");
    assert_string_equal(text_at("cases.1.grade"), "broken");
    assert_null(strchr(text_at("cases.1.grade_reason"), '/')); // whose disk it is on is no page's
    uint64_t hash = strtoull(text_at("cases.0.hash"), NULL, 16);
    put_check(hash, false);
    assert_int_equal(ask("GET", "/cases/healthy", token, NULL), 200);
    assert_string_equal(text_at("case.grade"), "unchecked");
    assert_string_equal(text_at("case.grade_reason"), "its check was made elsewhere");
    put_check(hash, true);
    assert_int_equal(ask("GET", "/cases/healthy", token, NULL), 200);
    assert_string_equal(text_at("case.grade"), "fit with warnings");
    assert_string_equal(text_at("check.format"), "arthron-check");
    put_check(hash + 1, true);
    assert_int_equal(ask("GET", "/cases/healthy", token, NULL), 200);
    assert_string_equal(text_at("case.grade"), "outdated");
    assert_int_equal(ask("GET", "/cases/healthy/anatomy.glb", token, NULL), 200);
    assert_string_equal(answer.file, in_api("healthy/anatomy.glb"));
    assert_int_equal(strtoull(answer.etag, NULL, 16), hash);
    snprintf(etag, sizeof etag, "%s", answer.etag);
    assert_int_equal(ask("GET", "/cases/healthy/check.json", token, NULL), 200);
    assert_string_not_equal(answer.etag, etag);
    assert_int_equal(ask("GET", "/cases/torn/case.json", token, NULL), 404);
}

static void a_case_that_changes_is_told_as_it_is(void **state) {
    (void)state;
    char etag[80];
    const char *token = token_of("ada.l");
    api_wait_for_cases(token);
    assert_int_equal(ask("GET", "/cases/healthy/case.json", token, NULL), 200);
    snprintf(etag, sizeof etag, "%s", answer.etag);
    struct knee_case *knee = box_knee();
    snprintf(knee->title, sizeof knee->title, "Other boxes");
    assert_int_equal(case_save(knee, in_api("healthy"), &err), RESULT_OK);
    case_destroy(&knee);
    assert_int_equal(ask("GET", "/cases/healthy/case.json", token, NULL), 200);
    assert_string_not_equal(answer.etag, etag);
    api_wait_for_cases(token);
    assert_int_equal(ask("GET", "/cases/healthy", token, NULL), 200);
    assert_string_equal(text_at("case.title"), "Other boxes");
    assert_string_not_equal(text_at("case.hash"), etag);
}

int main(void) {
#define TEST(f) cmocka_unit_test_setup_teardown(f, api_begin, api_end)
    const struct CMUnitTest tests[] = {
        TEST(stations_are_enrolled_by_code_and_revoked),
        TEST(cases_come_with_their_grade_and_files),
        TEST(a_case_that_changes_is_told_as_it_is),
    };
    return cmocka_run_group_tests_name("api_cases", tests, NULL, NULL);
}
