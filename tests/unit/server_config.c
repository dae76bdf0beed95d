// The server's config: where browsers are served, and what is said of a wrong entry.
#include "base/check.h"
#include "config/config.h"
#include "folder.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SERVER "[server]\naddress = 10.0.0.1\nkeys = keys\ntraces = traces\nsocket = s\n"
#define HASH "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"
#define RECORDS "records = records.db\n"
#define SIGN_ON SERVER RECORDS "[web]\nport = 4880\n[sign_on]\n"

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
    config_fini(&config);
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
    config_fini(&config);
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
        {SERVER RECORDS "[web]\nport = 4880\nplain = yes\n", "it needs address = 127.0.0.1"},
        {SERVER RECORDS "[web]\nport = 4880\nplain = yes\naddress = ::1\n", "address = 127.0.0.1"},
        {SERVER RECORDS "[web]\nport = 65536\n", "port"},
        {SERVER RECORDS "[web]\nport = -1\n", "port"},
        {SERVER RECORDS "[web]\nport = 4880\nnames = a b c d e f g h i\n", "names"},
        {SERVER RECORDS "[web]\nport = 4880\nname = a\n", "name"},
        {SERVER RECORDS "[xapi]\nserver = https://a/xapi\n", "[xapi] needs the key \"file\""},
        {SERVER RECORDS "[xapi]\nnames = yes\n", "[xapi] needs the key \"file\""},
        {SERVER RECORDS "[xapi]\nfile = x\nserver = https://a/xapi\n", "needs the key \"user\""},
        {SERVER RECORDS "[xapi]\nfile = x\nserver = https://a/xapi\nuser = u\n",
         "needs the key \"password\""},
        {SERVER "[xapi]\nfile = x\n", "[xapi] needs [server] records"},
        {SERVER RECORDS "[xapi]\nfile = x\nnames = some\n", "names = some"},
        {SIGN_ON "client_id = a\nname = b\n", "[sign_on] needs the key \"issuer\""},
        {SIGN_ON "issuer = https://a\nname = b\n", "[sign_on] needs the key \"client_id\""},
        {SIGN_ON "issuer = https://a\nclient_id = b\n", "[sign_on] needs the key \"name\""},
        {SIGN_ON "issuer = https://a\nclient_id = b\nname = c\n",
         "[sign_on] needs the key \"claim\""},
        {SIGN_ON "issuer = http://a\nclient_id = b\nname = c\nclaim = d\n",
         "it must begin with https://"},
        {SERVER RECORDS "[sign_on]\nissuer = https://a\nclient_id = b\nname = c\nclaim = d\n",
         "[sign_on] needs [web]"},
        {SERVER RECORDS "[web]\nport = 4880\naddress = 127.0.0.1\nplain = yes\n"
                        "[sign_on]\nissuer = https://a\nclient_id = b\nname = c\nclaim = d\n",
         "no plain there"},
        {SERVER RECORDS "[browsers]\nport = 4880\n", "browsers"},
        {SERVER "[sever]\nport = 1\n",
         "line 7: there is no section [sever]; did you mean [server]?"},
        {"[server]\nport = 99999\n",
         "[server] port = 99999: must be a whole number from 1 to 65535"},
        {"[server]\nprot = 4810\n", "[server] has no key \"prot\"; did you mean port?"},
        {"[server]\nunfit = perhaps\n", "must be refuse or serve"},
        {"[server]\naddress = 10.0.0.1\n", "[server] needs the key \"keys\""},
        {SERVER "[warp]\nfield = inverse-distance\n",
         "[warp] field = inverse-distance: must be integral: with the other fields the shown tip "
         "jumps"},
        {SERVER "[warp]\nfield = smooth\n", "only benches use them (--bench-field)"},
        {SERVER "[warp]\nfield = gaussian\n", "must be integral"},
        {SERVER "[warp]\navatar = tips\n", "must be tip, rigid or points"},
        {SERVER "[warp]\nadaptive = hing\n", "must be hinge, paper or paper-narrow"},
        {SERVER "[warp]\nhold_ms = -1\n", "must be a whole number from 0 to 10000"},
        {SERVER "[instrument prob]\npoint.1 = 0 0 0 1\n", "did you mean probe?"},
        {SERVER "[instrument probe]\npoint.2 = 0 0 0 1\n", "numbered from 1 to 15"},
        {SERVER "[case knee]\ndirr = k\n", "[case knee] has no key \"dirr\"; did you mean dir?"},
        {SERVER "[case knee]\ndir = k\nhash = 0123456789abcdef\n", "64 hexadecimal digits"},
        {SERVER "[case knee]\n[station a]\nstart = auto\n", "[station a] needs the key \"case\""},
        {SERVER "[station a]\nstart = maybe\n", "must be auto or command"},
        {SERVER "[station a]\ncontact.prob = 0\n", "of contact.probe"},
        {SERVER "[case knee]\ndir = k\n[station a]\ncase = kne\n",
         "[station a] case = kne: there is no section [case kne]; did you mean knee?"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_not_equal(load(rows[i].text), RESULT_OK);
        if (!strstr(err.text, rows[i].named) || !strstr(err.text, "server.ini"))
            fail_msg("%s: %s", rows[i].text, err.text);
    }
}

static void every_kind_of_value_goes_where_it_belongs(void **state) {
    (void)state;
    assert_int_equal(load(SERVER "port = 4900\nworkers = 3\nunfit = serve\ncalibration_mm = 0.5\n"
                                 "[warp]\nfield = integral\nradius_mm = 12\nhold_ms = 250\n"
                                 "avatar = rigid\nadaptive = paper\nease_share = 0.3\n"
                                 "[instrument probe]\npoint.1 = 0 3 0 0.5\npoint.2 = 0 3 -7 1\n"
                                 "[instrument instrument_7]\npoint.1 = 1 0 -7 2\n"
                                 "[instrument probe-2]\npoint.1 = 0 3 0 0.5\npoint.2 = 0 3 -7 1\n"
                                 "[instrument curette]\npoint.1 = 0 4 0 1\n"
                                 "[case knee]\ndir = k\nhash = " HASH "\n"
                                 "[station a]\ncase = knee\nstart = command\ntrainee = ada\n"
                                 "optic_deg = 70\ncontact.punch = 4\ncontact.instrument_8 = 5\n"),
                     RESULT_OK);
    const struct sessions_config *c = &config.sessions;
    assert_int_equal(c->port, 4900);
    assert_int_equal(c->workers, 3);
    assert_true(c->serve_unfit);
    assert_float_equal(c->calibration_mm, 0.5, 0);
    assert_int_equal(c->settings.field.kind, FIELD_INTEGRAL);
    assert_float_equal(c->settings.field.radius_mm, 12, 0);
    assert_int_equal(c->settings.hold_ns, 250000000);
    assert_string_equal(avatar_mode_name(c->settings.avatar), "rigid");
    assert_string_equal(adaptive_name(c->settings.adaptive), "paper");
    assert_float_equal(c->settings.ease_share, 0.3, 0);
    assert_int_equal(c->settings.bodies[0].point_count, 3);
    assert_float_equal(c->settings.bodies[0].points[2].radius_mm, 1, 0);
    assert_int_equal(c->settings.bodies[6].point_count, 2);
    assert_float_equal(c->settings.bodies[6].points[1].radius_mm, 2, 0);
    assert_int_equal(c->instrument_count, 2);
    assert_string_equal(c->instruments[0].name, "probe-2");
    assert_int_equal(c->instruments[0].body.point_count, 3);
    assert_string_equal(c->instruments[1].name, "curette");
    assert_float_equal(c->instruments[1].body.points[1].at.y, 4, 0);
    expect_path(c->cases[0].dir, "k");
    assert_string_equal(c->cases[0].hash, HASH);
    const struct session_station *station = &c->stations[0];
    assert_string_equal(station->case_name, "knee");
    assert_true(station->start_by_command);
    assert_string_equal(station->trainee, "ada");
    assert_float_equal(station->optic.tilt_deg, 70, 0);
    assert_float_equal(station->optic.field_deg, 90, 0);
    assert_int_equal(station->contact_buttons[1], 1 << 4);
    assert_int_equal(station->contact_buttons[7], 1 << 5);
}

static void statements_go_where_somebody_says_so(void **state) {
    (void)state;
    assert_int_equal(load(SERVER RECORDS), RESULT_OK);
    assert_string_equal(config.xapi.file, "");
    assert_int_equal(load(SERVER RECORDS "[xapi]\nfile = out.jsonl\nserver = https://a/xapi\n"
                                         "user = u\npassword = p\nauthority = a.pem\nnames = yes\n"
                                         "site = https://a/b\n"),
                     RESULT_OK);
    expect_path(config.xapi.file, "out.jsonl");
    expect_path(config.xapi.password, "p");
    expect_path(config.xapi.authority, "a.pem");
    assert_string_equal(config.xapi.server, "https://a/xapi");
    assert_string_equal(config.xapi.site, "https://a/b");
    assert_true(config.xapi.names);
}

static void people_sign_on_where_somebody_says_so(void **state) {
    (void)state;
    assert_int_equal(load(SERVER RECORDS), RESULT_OK);
    assert_string_equal(config.sign_on.issuer, "");
    assert_int_equal(
        load(SIGN_ON "issuer = https://a/b\nclient_id = c\nname = Sign on\nclaim = email\n"),
        RESULT_OK);
    assert_string_equal(config.sign_on.client_secret, "");
    assert_int_equal(load(SIGN_ON "issuer = https://a/b\nclient_id = c\nname = Sign on\n"
                                  "client_secret = s\nauthority = a.pem\nclaim = upn\n"),
                     RESULT_OK);
    assert_string_equal(config.sign_on.issuer, "https://a/b");
    assert_string_equal(config.sign_on.client_id, "c");
    assert_string_equal(config.sign_on.name, "Sign on");
    assert_string_equal(config.sign_on.claim, "upn");
    expect_path(config.sign_on.client_secret, "s");
    expect_path(config.sign_on.authority, "a.pem");
}

static void others_find_the_pages_where_stations_find_the_server(void **state) {
    (void)state;
    static const char cluster[] = "[cluster]\nname = a\nnats = nats://n:4222\n";
    static const struct {
        const char *more, *pages;
    } rows[] = {
        {"stations = a.example:4810\n", ""},
        {"stations = a.example:4810\n[web]\nport = 4880\n", "a.example:4880"},
        {"stations = [fe80::1]:4810\n[web]\nport = 443\n", "[fe80::1]:443"},
        {"stations = a:4810\npages = p:80\n[web]\nport = 443\n", "p:80"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[512];
        snprintf(text, sizeof text, SERVER RECORDS "%s%s", cluster, rows[i].more);
        assert_int_equal(load(text), RESULT_OK);
        assert_string_equal(config.sessions.cluster.pages, rows[i].pages);
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

// The config of so many stations; the caller frees it.
static char *with_stations(int count) {
    char *text = alloc((size_t)count + 10, 64);
    size_t used = (size_t)sprintf(text, SERVER "[case knee]\ndir = .\n");
    for (int i = 0; i < count; i++)
        used += (size_t)sprintf(text + used, "[station room-%d]\ncase = knee\n", i);
    return text;
}

static void a_server_has_thousands_of_stations_and_says_when_they_are_too_many(void **state) {
    (void)state;
    char *most = with_stations(STATIONS_MAX), *more = with_stations(STATIONS_MAX + 1);
    if (load(most) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_int_equal(config.sessions.station_count, STATIONS_MAX);
    assert_string_equal(config.sessions.stations[0].name, "room-0");
    assert_string_equal(config.sessions.stations[4095].name, "room-4095");
    assert_true(config.sessions.stations[77].optic.field_deg > 0);
    assert_int_equal(load(more), RESULT_INVALID);
    assert_non_null(strstr(err.text, "at most 4096 stations"));
    free(most);
    free(more);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(
            a_server_has_thousands_of_stations_and_says_when_they_are_too_many, begin, end),
        cmocka_unit_test_setup_teardown(browsers_are_served_where_somebody_says_so, begin, end),
        cmocka_unit_test_setup_teardown(all_of_it_can_be_said, begin, end),
        cmocka_unit_test_setup_teardown(what_cannot_be_is_named, begin, end),
        cmocka_unit_test_setup_teardown(every_kind_of_value_goes_where_it_belongs, begin, end),
        cmocka_unit_test_setup_teardown(statements_go_where_somebody_says_so, begin, end),
        cmocka_unit_test_setup_teardown(people_sign_on_where_somebody_says_so, begin, end),
        cmocka_unit_test_setup_teardown(others_find_the_pages_where_stations_find_the_server, begin,
                                        end),
        cmocka_unit_test_setup_teardown(eight_names_are_kept_whole, begin, end),
    };
    return cmocka_run_group_tests_name("server_config", tests, NULL, NULL);
}
