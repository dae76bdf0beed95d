// A station's first contact with its server.
#include "link/link.h"
#include "net/authority.h"
#include "test.h"
#include "wire/code.h"
#include "wire/test_server.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static struct test_server test_server;

static int set_up(void **state) {
    (void)state;
    test_server = (struct test_server){0};
    test_server_open(&test_server);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    test_server_close(&test_server);
    return 0;
}

static mode_t mode_of(const char *dir, const char *name) {
    char path[256];
    struct stat status;
    snprintf(path, sizeof path, "%s/%s", dir, name);
    assert_int_equal(stat(path, &status), 0);
    return status.st_mode & 0777;
}

static void a_code_enrols_once(void **state) {
    (void)state;
    struct error err;
    char code[AUTHORITY_CODE_MAX], keys[160], again[160];
    snprintf(keys, sizeof keys, "%s/bert", test_server.dir);
    snprintf(again, sizeof again, "%s/again", test_server.dir);
    assert_int_equal(authority_issue_code(test_server.keys, "bert", code, &err), RESULT_OK);
    assert_int_equal(link_enrol("localhost", test_server.port, code, "bert", keys, &err),
                     RESULT_OK);
    assert_int_equal(mode_of(keys, "station.key"), 0600);
    mode_of(keys, "station.pem");
    mode_of(keys, "authority.pem");
    assert_int_equal(link_enrol("localhost", test_server.port, code, "bert", again, &err),
                     RESULT_REFUSED);
    assert_true(err.text[0]);
    assert_int_equal(access(again, F_OK), -1);
}

static void a_wrong_code_enrols_nobody(void **state) {
    (void)state;
    struct error err;
    char code[AUTHORITY_CODE_MAX], keys[160];
    struct test_server other = {0};
    snprintf(keys, sizeof keys, "%s/bert", test_server.dir);
    assert_int_equal(link_enrol("localhost", test_server.port, "tomato", "bert", keys, &err),
                     RESULT_FORMAT);
    test_server_open(&other);
    assert_int_equal(authority_issue_code(other.keys, "bert", code, &err), RESULT_OK);
    // This server's authority is not the one that the code names: it is not even asked.
    assert_int_equal(link_enrol("localhost", test_server.port, code, "bert", keys, &err),
                     RESULT_REFUSED);
    assert_non_null(strstr(err.text, "certificate"));
    assert_int_equal(link_enrol("localhost", other.port, code, "bert", keys, &err), RESULT_OK);
    test_server_close(&other);
}

static void keep_aside(const char *dir, const char *aside) {
    static const char *const names[] = {"station.key", "station.pem", "authority.pem"};
    char from[256], to[256];
    assert_int_equal(mkdir(aside, 0700), 0);
    for (int i = 0; i < 3; i++) {
        snprintf(from, sizeof from, "%s/%s", dir, names[i]);
        snprintf(to, sizeof to, "%s/%s", aside, names[i]);
        assert_int_equal(link(from, to), 0); // a new file takes its name, not its place
    }
}

static struct link *start_link(const char *keys) {
    struct error err;
    struct link *link;
    struct link_config config = {.server_count = 1,
                                 .servers = {{"localhost", test_server.port}},
                                 .keys_dir = keys,
                                 .station = "bert",
                                 .software = "test"};
    assert_int_equal(link_create(&config, &link, &err), RESULT_OK);
    return link;
}

static void expect_refusal(struct link *link, const char *text) {
    struct link_status status;
    for (int i = 0; i < 5000; i++) {
        link_get_status(link, &status);
        if (strstr(status.refusal, text))
            return;
        usleep(2000);
    }
    fail_msg("refused with '%s'", status.refusal);
}

static void
who_is_enrolled_again_goes_on_with_the_new_certificate_and_the_old_one_is_void(void **state) {
    (void)state;
    char keys[128], aside[160], again[128];
    test_server_enrol(&test_server, "bert", keys);
    snprintf(aside, sizeof aside, "%s/aside", test_server.dir);
    keep_aside(keys, aside);
    struct link *station = start_link(keys);
    assert_true(wait_for(&test_server.hellos, 1));
    test_server_enrol(&test_server, "bert", again); // into the same folder
    assert_true(wait_for(&test_server.hellos, 2));
    struct link *thief = start_link(aside);
    expect_refusal(thief, "revoked");
    link_destroy(&thief);
    link_destroy(&station);
}

static void a_guesser_is_slowed_down(void **state) {
    (void)state;
    struct error err;
    char text[AUTHORITY_CODE_MAX], keys[160];
    struct code code;
    snprintf(keys, sizeof keys, "%s/bert", test_server.dir);
    assert_int_equal(authority_issue_code(test_server.keys, "bert", text, &err), RESULT_OK);
    assert_int_equal(code_read(text, &code, &err), RESULT_OK);
    int tries = 0;
    enum result result;
    do { // the right authority, another secret
        code.secret[0]++;
        code_write(&code, text);
        result = link_enrol("localhost", test_server.port, text, "bert", keys, &err);
    } while (result == RESULT_REFUSED && ++tries < 100);
    assert_int_equal(result, RESULT_CLOSED); // the code may be good: it was not looked at
    assert_non_null(strstr(err.text, "too many"));
    assert_in_range(tries, 10, 99);
}

static void enrolling_where_nobody_listens_fails(void **state) {
    (void)state;
    struct error err;
    char code[AUTHORITY_CODE_MAX];
    assert_int_equal(authority_issue_code(test_server.keys, "bert", code, &err), RESULT_OK);
    test_server_stop(&test_server);
    assert_int_equal(link_enrol("localhost", test_server.port, code, "bert", test_server.dir, &err),
                     RESULT_IO);
    assert_non_null(strstr(err.text, "localhost"));
}

static void a_station_trusts_only_the_host_it_called(void **state) {
    (void)state;
    struct test_server other = {.only_host = "elsewhere.example"};
    struct error err;
    char code[AUTHORITY_CODE_MAX], keys[160];
    test_server_open(&other);
    snprintf(keys, sizeof keys, "%s/anna", other.dir);
    assert_int_equal(authority_issue_code(other.keys, "anna", code, &err), RESULT_OK);
    assert_int_equal(link_enrol("localhost", other.port, code, "anna", keys, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "certificate"));
    test_server_close(&other);
}

#define WITH_SERVER(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)

int main(void) {
    const struct CMUnitTest tests[] = {
        WITH_SERVER(a_code_enrols_once),
        WITH_SERVER(a_wrong_code_enrols_nobody),
        WITH_SERVER(who_is_enrolled_again_goes_on_with_the_new_certificate_and_the_old_one_is_void),
        WITH_SERVER(a_guesser_is_slowed_down),
        WITH_SERVER(enrolling_where_nobody_listens_fails),
        WITH_SERVER(a_station_trusts_only_the_host_it_called),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
