// The server's config: where browsers are served.
#include "config/config.h"
#include "folder.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

#define SERVER "[server]\naddress = 10.0.0.1\nkeys = keys\ntraces = traces\nsocket = s\n"
#define RECORDS "records = records.db\n"

static char dir[FOLDER_MAX];
static struct server_config config;
static struct error err;

static int begin(void **state) {
    (void)state;
    folder_make(dir);
    return 0;
}

static int end(void **state) {
    (void)state;
    folder_remove(dir);
    return 0;
}

static enum result load(const char *text) {
    char path[FOLDER_MAX + 16];
    snprintf(path, sizeof path, "%s/server.ini", dir);
    FILE *file = fopen(path, "w");
    fputs(text, file);
    fclose(file);
    err.text[0] = '\0';
    return config_load(path, NULL, 0, &config, &err);
}

static void expect_path(const char *path, const char *name) {
    char expected[FOLDER_MAX + 64];
    snprintf(expected, sizeof expected, "%s/%s", dir, name);
    assert_string_equal(path, expected);
}

static void browsers_are_served_where_somebody_says_so(void **state) {
    (void)state;
    assert_int_equal(load(SERVER), RESULT_OK);
    assert_int_equal(config.web.port, 0);
    assert_int_equal(load(SERVER RECORDS "[web]\nport = 4880\n"), RESULT_OK);
    assert_int_equal(config.web.port, 4880);
    assert_string_equal(config.web.address, "10.0.0.1");
    expect_path(config.web.certificate, "keys/server.pem");
    expect_path(config.web.key, "keys/server.key");
    assert_string_equal(config.web.names[0], "");
}

static void all_of_it_can_be_said(void **state) {
    (void)state;
    assert_int_equal(load("[web]\nport = 443\naddress = ::\ncertificate = c.pem\nkey = /k.pem\n"
                          "names = hall.example  arthron\n" SERVER RECORDS),
                     RESULT_OK);
    assert_int_equal(config.web.port, 443);
    assert_string_equal(config.web.address, "::");
    expect_path(config.web.certificate, "c.pem");
    assert_string_equal(config.web.key, "/k.pem");
    assert_string_equal(config.web.names[0], "hall.example");
    assert_string_equal(config.web.names[1], "arthron");
    assert_string_equal(config.web.names[2], "");
}

static void what_cannot_be_is_named(void **state) {
    (void)state;
    static const struct {
        const char *text, *named;
    } rows[] = {
        {SERVER "[web]\nport = 4880\n", "[web] needs [server] records"},
        {SERVER RECORDS "[web]\nport = 4880\nkey = k.pem\n", "both certificate and key"},
        {SERVER RECORDS "[web]\nport = 4880\ncertificate = c.pem\n", "both certificate and key"},
        {SERVER RECORDS "[web]\nport = 65536\n", "port"},
        {SERVER RECORDS "[web]\nport = -1\n", "port"},
        {SERVER RECORDS "[web]\nport = 4880\nnames = a b c d e f g h i\n", "names"},
        {SERVER RECORDS "[web]\nport = 4880\nname = a\n", "name"},
        {SERVER RECORDS "[browsers]\nport = 4880\n", "browsers"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_not_equal(load(rows[i].text), RESULT_OK);
        if (!strstr(err.text, rows[i].named) || !strstr(err.text, "server.ini"))
            fail_msg("%s: %s", rows[i].text, err.text);
    }
}

static void eight_names_are_kept_whole(void **state) {
    (void)state;
    char text[1024];
    const char *longest = "a123456789b123456789c123456789d123456789e123456789f123456789abc";
    snprintf(text, sizeof text, SERVER RECORDS "[web]\nport = 1\nnames = 1 2 3 4 5 6 7 %s\n",
             longest);
    assert_int_equal(load(text), RESULT_OK);
    assert_string_equal(config.web.names[7], longest);
    snprintf(text, sizeof text, SERVER RECORDS "[web]\nport = 1\nnames = %sd\n", longest);
    assert_int_not_equal(load(text), RESULT_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(browsers_are_served_where_somebody_says_so, begin, end),
        cmocka_unit_test_setup_teardown(all_of_it_can_be_said, begin, end),
        cmocka_unit_test_setup_teardown(what_cannot_be_is_named, begin, end),
        cmocka_unit_test_setup_teardown(eight_names_are_kept_whole, begin, end),
    };
    return cmocka_run_group_tests_name("server_config", tests, NULL, NULL);
}
