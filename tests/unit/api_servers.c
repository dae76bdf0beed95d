// What /api/v1 of one of several servers answers itself, to whom, and what it leaves to another
// one.
#include "case/content.h"
#include "net/authority.h"
#include "test.h"
#include "unit/api_files.h"
#include "unit/case_knee.h"

#include <stdio.h>
#include <string.h>

static struct error err;
static bool b_lives;

// This is server a. Server b serves room-1.
static void tell_self(void *user, struct cluster_peer *out) {
    (void)user;
    *out = (struct cluster_peer){.name = "a", .pages = "a:4880", .secret = "5ec", .lives = true};
}

static int list_peers(void *user, struct cluster_peer *out, int room) {
    (void)user;
    assert_true(room > 1);
    out[0] = (struct cluster_peer){.name = "b",
                                   .pages = "127.0.0.1:1", // nobody is there
                                   .secret = "b's",
                                   .lives = b_lives,
                                   .stations = 3};
    return 1;
}

static void find_server(void *user, int station, char out_name[SERVER_NAME_SIZE]) {
    (void)user;
    snprintf(out_name, SERVER_NAME_SIZE, "%s", station == 0 ? "b" : "");
}

static int begin(void **state) {
    static struct api_cluster cluster = {NULL, tell_self, list_peers, find_server, api_dir};
    b_lives = true;
    api_cluster = &cluster;
    int status = api_begin(state);
    api_cluster = NULL;
    return status;
}

static void ask_for_content(const char *token, const char *path, const char *hash, int status) {
    char whole[160];
    snprintf(whole, sizeof whole, "/peer/cases%s?hash=%s", path, hash);
    assert_int_equal(ask("GET", whole, token, NULL), status);
}

static void another_server_gets_a_case_by_its_hash_and_this_ones_secret(void **state) {
    (void)state;
    struct content_file files[CONTENT_FILES];
    char hash[CONTENT_HASH_SIZE];
    assert_ok(content_read(in_api("healthy"), files, &err));
    content_hash(files, hash);
    ask_for_content("b's", "", hash, 401);
    ask_for_content("5e", "", hash, 401);
    ask_for_content(NULL, "", hash, 401);
    ask_for_content(token_of("grace"), "", hash, 403);
    ask_for_content("5ec", "", hash, 200);
    assert_int_equal(count_at("files"), 2);
    assert_string_equal(text_at("files.1.name"), "case.json");
    assert_string_equal(text_at("files.1.sha256"), files[1].hash);
    assert_int_equal((uint64_t)number_at("files.0.size"), files[0].size);
    write_file(in_api("healthy"), "check.json", "{}", 2);
    ask_for_content("5ec", "", hash, 200);
    assert_string_equal(text_at("files.2.name"), "check.json");
    ask_for_content("5ec", "/anatomy.glb", hash, 200);
    assert_string_equal(answer.file, in_api("healthy/anatomy.glb"));
    ask_for_content("5ec", "/check.json", hash, 200);
    ask_for_content("5ec", "/..", hash, 404);
    ask_for_content("5ec", "/records.db", hash, 404);
    ask_for_content("5ec", "", "00", 404);
    ask_for_content("5ec", "", "", 404);
    write_file(in_api("healthy"), "case.json", "{}", 2);
    ask_for_content("5ec", "", hash, 404);
    ask_for_content("5ec", "/anatomy.glb", hash, 404);
    assert_int_equal(ask("GET", "/accounts", "5ec", NULL), 401); // it is nobody's
    assert_int_equal(ask("GET", "/servers", token_of("tom"), NULL), 200);
    assert_string_equal(text_at("servers.0.pages"), "a:4880");
    assert_null(strstr(answer.body, "5ec"));
    assert_int_equal((int)number_at("servers.1.stations"), 3);
}

static void a_command_goes_to_the_server_of_the_station(void **state) {
    (void)state;
    const char *token = token_of("grace");
    const char *body = "{\"task\":\"centring\"}";
    assert_int_equal(ask("POST", "/stations/room-2/attempt", token, body), 204); // it is here
    assert_int_equal(ask("POST", "/stations/none/attempt", token, body), 404);
    assert_int_equal(ask("POST", "/stations/room-1/attempt", token, body), 503);
    assert_string_equal(error_code(), "away");
    assert_string_equal(text_at("error.text"), "Server b has this, and does not answer.");
    assert_int_equal(ask("DELETE", "/stations/room-1/attempt", token_of("ada.l"), NULL), 503);
    assert_int_equal(ask("POST", "/stations/room-1/attempt", token_of("tom"), body), 403);
    assert_int_equal(ask("POST", "/stations/room-1/attempt", NULL, body), 401);
    b_lives = false;
    assert_int_equal(ask("POST", "/stations/room-1/attempt", token, body), 503);
    assert_string_equal(text_at("error.text"), "Server b has this, and is away.");
}

static void what_was_passed_on_is_not_passed_on_again(void **state) {
    (void)state;
    api_passed_on = true;
    int status =
        ask("POST", "/stations/room-1/attempt", token_of("grace"), "{\"task\":\"centring\"}");
    api_passed_on = false;
    assert_int_equal(status, 204);
}

static void a_station_is_revoked_here_and_who_was_not_told_is_named(void **state) {
    (void)state;
    const char *token = token_of("tom");
    for (int lives = 0; lives < 2; lives++) {
        b_lives = lives;
        assert_int_equal(ask("POST", "/stations/room-1/revoke", token, NULL), 503);
        assert_string_equal(error_code(), "away");
        assert_non_null(strstr(text_at("error.text"), "which are away: b."));
    }
}

static void tell(const char *serials, int status) {
    char body[256];
    snprintf(body, sizeof body, "{\"station\":\"room-1\",\"serials\":\"%s\"}", serials);
    assert_int_equal(ask("POST", "/peer/revocations", "5ec", body), status);
}

static void another_server_tells_what_it_revoked(void **state) {
    (void)state;
    char serials[AUTHORITY_SERIALS_SIZE] = "";
    tell("", 200);
    assert_string_equal(text_at("serials"), "");
    tell("0A1B ff", 200);
    assert_string_equal(text_at("serials"), "ff 0A1B");
    tell("0a1b", 200); // the same
    assert_string_equal(text_at("serials"), "ff 0A1B");
    tell("xy", 500);
    tell("0A1B  1; 2", 500);
    assert_ok(authority_revoke_all(in_api("keys"), "room-1", serials, &err));
    assert_string_equal(serials, "ff 0A1B");
    assert_int_equal(ask("POST", "/peer/revocations", "5ec", "{\"station\":\"room-1\"}"), 400);
}

int main(void) {
#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, api_end)
    const struct CMUnitTest tests[] = {
        TEST(another_server_gets_a_case_by_its_hash_and_this_ones_secret),
        TEST(a_command_goes_to_the_server_of_the_station),
        TEST(what_was_passed_on_is_not_passed_on_again),
        TEST(a_station_is_revoked_here_and_who_was_not_told_is_named),
        TEST(another_server_tells_what_it_revoked),
    };
    return cmocka_run_group_tests_name("api_servers", tests, NULL, NULL);
}
