// The control connection as the server sees it, spoken to by a client that knows no manners.
#include "base/clock.h"
#include "net/authority.h"
#include "net/authority_files.h"
#include "net/registrar.h"
#include "test.h"
#include "wire/browser.h"
#include "wire/test_server.h"
#include "wire/websocket.h"

#include <openssl/evp.h>
#include <openssl/x509.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct test_server test_server;
static char anna[128];
static int keys_lock = -1; // of hold_the_keys

static int set_up(void **state) {
    (void)state;
    test_server = (struct test_server){.hello_timeout_ns = 300 * NS_PER_MS};
    test_server_open(&test_server);
    test_server_enrol(&test_server, "anna", anna);
    return 0;
}

static void let_go_of_the_keys(void) {
    if (keys_lock >= 0)
        close(keys_lock);
    keys_lock = -1;
}

static int tear_down(void **state) {
    (void)state;
    let_go_of_the_keys(); // where the test failed before it could
    test_server_close(&test_server);
    return 0;
}

// ---- talking ------------------------------------------------------------------------------------

static arthron_Control good_hello(void) {
    arthron_Control message = {.which_message = arthron_Control_hello_tag};
    arthron_Hello *hello = &message.message.hello;
    hello->version_min = WIRE_VERSION_MIN;
    hello->version_max = WIRE_VERSION_MAX;
    strcpy(hello->station, "anna");
    return message;
}

static void tell(struct websocket *socket, const arthron_Control *message) {
    uint8_t bytes[WIRE_CONTROL_MAX];
    size_t size;
    assert_int_equal(wire_encode_control(message, bytes, sizeof bytes, &size), RESULT_OK);
    assert_true(websocket_send(socket, WEBSOCKET_BINARY, true, bytes, size));
}

static bool hear(struct websocket *socket, arthron_Control *out_message) {
    uint8_t bytes[WIRE_CONTROL_MAX];
    int size = websocket_receive(socket, bytes, sizeof bytes);
    return size >= 0 && wire_decode_control(bytes, (size_t)size, out_message, NULL) == RESULT_OK;
}

// The next message of that kind, whatever comes before it.
static bool hear_kind(struct websocket *socket, int kind, arthron_Control *out_message) {
    while (hear(socket, out_message))
        if (out_message->which_message == kind)
            return true;
    return false;
}

static struct websocket *call_as(const char *keys_dir) {
    struct websocket *socket = websocket_open(test_server.port, keys_dir, WIRE_SUBPROTOCOL);
    assert_non_null(socket);
    return socket;
}

static struct websocket *call_and_greet(void) {
    struct websocket *socket = call_as(anna);
    arthron_Control message = good_hello();
    tell(socket, &message);
    assert_true(hear(socket, &message));
    assert_int_equal(message.which_message, arthron_Control_welcome_tag);
    return socket;
}

static void expect_refusal(struct websocket *socket, arthron_Refusal_Reason reason) {
    arthron_Control message;
    assert_true(hear_kind(socket, arthron_Control_refusal_tag, &message));
    assert_int_equal(message.message.refusal.reason, reason);
    assert_true(message.message.refusal.text[0]);
    assert_false(hear(socket, &message));
    websocket_close(socket);
}

// An answered ping: the connection lives.
static void expect_pong(struct websocket *socket) {
    arthron_Control message = {.which_message = arthron_Control_ping_tag};
    message.message.ping.sent_ns = 4711;
    tell(socket, &message);
    assert_true(hear_kind(socket, arthron_Control_pong_tag, &message));
    assert_int_equal(message.message.pong.sent_ns, 4711);
}

// ---- hello --------------------------------------------------------------------------------------

static void a_hello_is_welcomed_with_what_both_sides_can_do(void **state) {
    (void)state;
    struct websocket *socket = call_as(anna);
    arthron_Control message = good_hello();
    arthron_Hello *hello = &message.message.hello;
    hello->version_max = 7;
    strcpy(hello->capabilities[0], "teleport");
    strcpy(hello->capabilities[1], "datagrams");
    hello->capabilities_count = 2;
    tell(socket, &message);
    assert_true(hear(socket, &message));
    assert_int_equal(message.which_message, arthron_Control_welcome_tag);
    const arthron_Welcome *welcome = &message.message.welcome;
    assert_int_equal(welcome->version, WIRE_VERSION_MAX);
    assert_int_equal(welcome->capabilities_count, 1);
    assert_string_equal(welcome->capabilities[0], "datagrams");
    assert_string_equal(welcome->software, "test_server");
    assert_string_equal(welcome->case_name, "healthy");
    websocket_close(socket);
    assert_true(wait_for(&test_server.gone, 1));
}

static void a_hello_in_three_fragments_is_one_message(void **state) {
    (void)state;
    uint8_t bytes[WIRE_CONTROL_MAX];
    size_t size;
    struct websocket *socket = call_as(anna);
    arthron_Control message = good_hello();
    assert_int_equal(wire_encode_control(&message, bytes, sizeof bytes, &size), RESULT_OK);
    assert_true(websocket_send(socket, WEBSOCKET_BINARY, false, bytes, 2));
    assert_true(websocket_send(socket, WEBSOCKET_MORE, false, bytes + 2, 3));
    assert_true(websocket_send(socket, WEBSOCKET_MORE, true, bytes + 5, size - 5));
    assert_true(hear(socket, &message));
    assert_int_equal(message.which_message, arthron_Control_welcome_tag);
    websocket_close(socket);
}

static void a_version_that_is_not_ours_is_refused(void **state) {
    (void)state;
    static const struct {
        uint32_t min, max;
    } rows[] = {{WIRE_VERSION_MAX + 1, WIRE_VERSION_MAX + 3}, {0, 0}, {2, 1}, {~0u, ~0u}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct websocket *socket = call_as(anna);
        arthron_Control message = good_hello();
        message.message.hello.version_min = rows[i].min;
        message.message.hello.version_max = rows[i].max;
        tell(socket, &message);
        expect_refusal(socket, arthron_Refusal_Reason_VERSION);
    }
    assert_int_equal(atomic_load(&test_server.hellos), 0);
}

static void a_name_that_is_not_the_certificates_is_refused(void **state) {
    (void)state;
    static const char *const names[] = {"bert", "", "ann", "annaa"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        struct websocket *socket = call_as(anna);
        arthron_Control message = good_hello();
        strcpy(message.message.hello.station, names[i]);
        tell(socket, &message);
        expect_refusal(socket, arthron_Refusal_Reason_IDENTITY);
    }
    assert_int_equal(atomic_load(&test_server.hellos), 0);
}

static void what_the_handler_refuses_is_refused_with_its_words(void **state) {
    (void)state;
    test_server.refusal = &(arthron_Refusal){arthron_Refusal_Reason_ELSEWHERE, "", "b:4810", 250};
    struct websocket *socket = call_as(anna);
    arthron_Control message = good_hello();
    tell(socket, &message);
    assert_true(hear(socket, &message));
    assert_int_equal(message.which_message, arthron_Control_refusal_tag);
    assert_int_equal(message.message.refusal.reason, arthron_Refusal_Reason_ELSEWHERE);
    assert_string_equal(message.message.refusal.text, "the request was refused");
    assert_string_equal(message.message.refusal.server, "b:4810");
    assert_int_equal(message.message.refusal.retry_ms, 250);
    websocket_close(socket);
    assert_int_equal(atomic_load(&test_server.gone), 0);
}

static void a_silent_peer_is_refused_in_time(void **state) {
    (void)state;
    expect_refusal(call_as(anna), arthron_Refusal_Reason_MALFORMED);
    struct websocket *stranger = websocket_open(test_server.port, NULL, WIRE_ENROL_SUBPROTOCOL);
    expect_refusal(stranger, arthron_Refusal_Reason_MALFORMED);
}

static void a_connection_that_does_not_become_a_websocket_is_closed(void **state) {
    (void)state;
    static const char *const requests[] = {
        "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "CONNECT localhost:22 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade, HTTP2-Settings\r\n"
        "Upgrade: h2c\r\nHTTP2-Settings: AAMAAABkAARAAAAAAAIAAAAA\r\n\r\n"};
    for (int i = 0; i < 3; i++) {
        struct browser *browser = browser_open(test_server.port);
        assert_true(browser_say(browser, requests[i], strlen(requests[i])));
        assert_true(browser_is_ended(browser));
        browser_close(browser);
    }
}

static void nothing_is_heard_before_hello(void **state) {
    (void)state;
    struct websocket *socket = call_as(anna);
    arthron_Control message = {.which_message = arthron_Control_frame_tag};
    tell(socket, &message);
    expect_refusal(socket, arthron_Refusal_Reason_MALFORMED);
    assert_int_equal(atomic_load(&test_server.frames), 0);
}

// ---- certificates -------------------------------------------------------------------------------

static void without_a_certificate_there_is_only_enrolment(void **state) {
    (void)state;
    expect_refusal(call_as(NULL), arthron_Refusal_Reason_IDENTITY);
    assert_int_equal(control_counts(test_server.control).refused_certificates, 1);
    struct websocket *stranger = websocket_open(test_server.port, NULL, WIRE_ENROL_SUBPROTOCOL);
    arthron_Control message = good_hello();
    tell(stranger, &message);
    expect_refusal(stranger, arthron_Refusal_Reason_MALFORMED);
    assert_null(websocket_open(test_server.port, anna, "chat"));
}

static void a_certificate_of_another_authority_ends_the_handshake(void **state) {
    (void)state;
    struct test_server other = {0};
    char foreign[128];
    test_server_open(&other);
    test_server_enrol(&other, "anna", foreign);
    assert_null(websocket_open(test_server.port, foreign, WIRE_SUBPROTOCOL));
    assert_int_equal(control_counts(test_server.control).refused_certificates, 1);
    test_server_close(&other);
}

static void revoking_closes_the_connection_and_refuses_the_next(void **state) {
    (void)state;
    struct error err;
    struct websocket *socket = call_and_greet();
    assert_int_equal(authority_revoke(test_server.keys, "anna", &err), RESULT_OK);
    expect_pong(socket);
    expect_refusal(socket, arthron_Refusal_Reason_IDENTITY);
    assert_true(wait_for(&test_server.gone, 1));
    expect_refusal(call_as(anna), arthron_Refusal_Reason_IDENTITY);
}

// ---- enrolment ----------------------------------------------------------------------------------

// As another process would.
static void hold_the_keys(void) {
    assert_int_equal(authority_lock(test_server.keys, true, &keys_lock, NULL), RESULT_OK);
}

static arthron_Control good_enrol(const char *station) {
    arthron_Control message = {.which_message = arthron_Control_enrol_tag};
    arthron_Enrol *enrol = &message.message.enrol;
    assert_int_equal(authority_issue_code(test_server.keys, station, enrol->code, NULL), RESULT_OK);
    EVP_PKEY *key = EVP_EC_gen("P-256");
    X509_REQ *request = X509_REQ_new();
    X509_NAME_add_entry_by_txt(X509_REQ_get_subject_name(request), "CN", MBSTRING_UTF8,
                               (const unsigned char *)station, -1, -1, 0);
    X509_REQ_set_pubkey(request, key);
    assert_true(X509_REQ_sign(request, key, EVP_sha256()) > 0);
    unsigned char *der = enrol->request_der.bytes;
    enrol->request_der.size = (pb_size_t)i2d_X509_REQ(request, &der);
    X509_REQ_free(request);
    EVP_PKEY_free(key);
    return message;
}

static struct websocket *apply(const arthron_Control *enrol) {
    struct websocket *socket = websocket_open(test_server.port, NULL, WIRE_ENROL_SUBPROTOCOL);
    assert_non_null(socket);
    tell(socket, enrol);
    return socket;
}

static void expect_enrolled(struct websocket *socket) {
    arthron_Control message;
    assert_true(hear(socket, &message));
    assert_int_equal(message.which_message, arthron_Control_enrolled_tag);
    assert_false(hear(socket, &message));
    websocket_close(socket);
}

static void expect_reply(struct websocket *socket, uint32_t number) {
    arthron_Control message = {.which_message = arthron_Control_frame_tag};
    message.message.frame.number = number;
    tell(socket, &message);
    assert_true(hear_kind(socket, arthron_Control_reply_tag, &message));
    assert_int_equal(message.message.reply.frame_number, number);
}

static void while_another_process_holds_the_keys_frames_are_answered(void **state) {
    (void)state;
    arthron_Control enrol = good_enrol("bert");
    struct websocket *station = call_and_greet();
    hold_the_keys();
    struct websocket *stranger = apply(&enrol);
    for (uint32_t number = 1; number <= 50; number++) {
        expect_reply(station, number);
        usleep(10000);
    }
    let_go_of_the_keys();
    expect_enrolled(stranger);
    expect_reply(station, 51);
    websocket_close(station);
}

static void revoking_works_while_an_enrolment_waits(void **state) {
    (void)state;
    arthron_Control enrol = good_enrol("bert");
    struct websocket *station = call_and_greet();
    assert_int_equal(authority_revoke(test_server.keys, "anna", NULL), RESULT_OK);
    hold_the_keys();
    struct websocket *stranger = apply(&enrol);
    expect_refusal(station, arthron_Refusal_Reason_IDENTITY);
    expect_refusal(call_as(anna), arthron_Refusal_Reason_IDENTITY);
    let_go_of_the_keys();
    expect_enrolled(stranger);
}

static void an_applicant_that_goes_while_it_waits_keeps_its_code(void **state) {
    (void)state;
    arthron_Control enrol = good_enrol("bert");
    hold_the_keys();
    struct websocket *impatient = apply(&enrol);
    tell(impatient, &enrol); // once is enough: what follows ends the first
    expect_refusal(impatient, arthron_Refusal_Reason_MALFORMED);
    let_go_of_the_keys();
    expect_enrolled(apply(&enrol));
}

static void count_news(void *user) {
    atomic_fetch_add((atomic_int *)user, 1);
}

static struct tls_files *servers_files(void) {
    char certificate[160], key[160];
    struct tls_files *files;
    snprintf(certificate, sizeof certificate, "%s/server.pem", test_server.keys);
    snprintf(key, sizeof key, "%s/server.key", test_server.keys);
    assert_int_equal(tls_files_create(certificate, key, &files, NULL, NULL), RESULT_OK);
    return files;
}

static void no_more_than_ten_wait_to_be_enrolled(void **state) {
    (void)state;
    static char places[REGISTRAR_APPLICANTS_MAX + 1]; // an applicant is only an address
    arthron_Control enrol = good_enrol("bert"), answer;
    struct peer *applicant, *last = (struct peer *)&places[REGISTRAR_APPLICANTS_MAX];
    atomic_int news = 0;
    int enrolled = 0;
    hold_the_keys();
    const struct identity stranger = {.certified = false};
    struct registrar *registrar =
        registrar_create(test_server.keys, servers_files(), count_news, &news);
    for (int i = 0; i < REGISTRAR_APPLICANTS_MAX; i++)
        assert_true(
            registrar_apply(registrar, (struct peer *)&places[i], &stranger, &enrol.message.enrol));
    assert_false(registrar_apply(registrar, last, &stranger, &enrol.message.enrol));
    registrar_withdraw(registrar, (struct peer *)&places[0]);
    for (int tries = 0; !registrar_apply(registrar, last, &stranger, &enrol.message.enrol);
         tries++) {
        assert_in_range(tries, 0, 1000);
        usleep(2000);
    }
    assert_false(registrar_next_answer(registrar, &applicant, &answer));
    let_go_of_the_keys();
    assert_true(wait_for(&news, REGISTRAR_APPLICANTS_MAX));
    for (int i = 0; i < REGISTRAR_APPLICANTS_MAX; i++) {
        assert_true(registrar_next_answer(registrar, &applicant, &answer));
        assert_ptr_not_equal(applicant, &places[0]);
        enrolled += answer.which_message == arthron_Control_enrolled_tag;
    }
    assert_int_equal(enrolled, 1); // they all had the same code
    assert_false(registrar_next_answer(registrar, &applicant, &answer));
    registrar_destroy(&registrar);
}

static void a_server_can_stop_while_an_enrolment_waits(void **state) {
    (void)state;
    arthron_Control enrol = good_enrol("bert");
    struct websocket *station = call_and_greet();
    hold_the_keys();
    struct websocket *stranger = apply(&enrol);
    expect_pong(station);
    test_server_stop(&test_server);
    websocket_close(stranger);
    websocket_close(station);
    let_go_of_the_keys();
    test_server_start(&test_server);
    expect_enrolled(apply(&enrol));
}

static void a_stranger_learns_nothing_of_the_servers_files(void **state) {
    (void)state;
    static const char *const broken[] = {"authority.key", "authority.pem", "codes", "issued"};
    for (size_t i = 0; i < sizeof broken / sizeof *broken; i++) {
        arthron_Control enrol = good_enrol("bert"), message;
        char path[128], aside[160];
        snprintf(path, sizeof path, "%s/%s", test_server.keys, broken[i]);
        snprintf(aside, sizeof aside, "%s.aside", path);
        assert_int_equal(rename(path, aside), 0);
        assert_int_equal(authority_write(test_server.keys, broken[i], "?", 1, NULL), RESULT_OK);
        struct websocket *socket = apply(&enrol);
        assert_true(hear(socket, &message));
        assert_int_equal(message.message.refusal.reason, arthron_Refusal_Reason_BUSY);
        assert_true(message.message.refusal.text[0]);
        assert_null(strstr(message.message.refusal.text, test_server.dir));
        websocket_close(socket);
        assert_int_equal(rename(aside, path), 0);
    }
}

// ---- messages -----------------------------------------------------------------------------------

static void an_unknown_message_is_skipped_and_counted(void **state) {
    (void)state;
    static const uint8_t field_99[] = {0x9a, 0x06, 0x03, 'a', 'b', 'c'};
    struct websocket *socket = call_and_greet();
    assert_true(websocket_send(socket, WEBSOCKET_BINARY, true, field_99, sizeof field_99));
    expect_pong(socket);
    assert_int_equal(control_counts(test_server.control).unknown_messages, 1);
    websocket_close(socket);
}

static const struct {
    const char *what;
    int opcode;
    size_t size;
    uint8_t bytes[20];
} malformed[] = {
    {"a length beyond the end", WEBSOCKET_BINARY, 3, {0x22, 0x7f, 0x08}},
    {"an endless varint",
     WEBSOCKET_BINARY,
     12,
     {0x22, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff}},
    {"a wire type that does not exist", WEBSOCKET_BINARY, 2, {0x27, 0x00}},
    {"a text", WEBSOCKET_TEXT, 5, "hello"},
    {"a message only a server says", WEBSOCKET_BINARY, 2, {0x12, 0x00}},
    {"a second Hello", WEBSOCKET_BINARY, 2, {0x0a, 0x00}},
    {"an Enrol", WEBSOCKET_BINARY, 2, {0x5a, 0x00}},
    {"an acknowledgement of markers", WEBSOCKET_BINARY, 3, {0x92, 0x01, 0x00}},
    {"a good marker without the capability",
     WEBSOCKET_BINARY,
     18,
     {0x8a, 0x01, 0x0f, 0x09, 1, 0, 0, 0, 0, 0, 0, 0, 0x1a, 1, 'a', 0x22, 1, 'b'}},
};

static void a_malformed_message_closes_its_peer_and_no_other(void **state) {
    (void)state;
    char bert[128];
    test_server_enrol(&test_server, "bert", bert);
    struct websocket *other = call_as(bert);
    arthron_Control message = good_hello();
    strcpy(message.message.hello.station, "bert");
    tell(other, &message);
    size_t rows = sizeof malformed / sizeof *malformed;
    for (size_t i = 0; i < rows; i++) {
        struct websocket *socket = call_and_greet();
        websocket_send(socket, malformed[i].opcode, true, malformed[i].bytes, malformed[i].size);
        expect_refusal(socket, arthron_Refusal_Reason_MALFORMED);
        expect_pong(other);
    }
    assert_int_equal(control_counts(test_server.control).malformed_messages, rows);
    websocket_close(other);
}

static void a_message_that_is_too_long_is_not_collected(void **state) {
    (void)state;
    static const uint8_t bytes[WIRE_CONTROL_MAX + 1];
    struct websocket *socket = call_and_greet();
    websocket_send(socket, WEBSOCKET_BINARY, true, bytes, sizeof bytes);
    expect_refusal(socket, arthron_Refusal_Reason_MALFORMED);
    socket = call_and_greet();
    for (int i = 0; i < 5; i++) // in fragments, and it never ends
        websocket_send(socket, i ? WEBSOCKET_MORE : WEBSOCKET_BINARY, false, bytes, 2048);
    expect_refusal(socket, arthron_Refusal_Reason_MALFORMED);
}

static void times_that_no_clock_shows_are_ignored(void **state) {
    (void)state;
    static const arthron_Pong rows[] = {
        {INT64_MIN, INT64_MAX, INT64_MIN}, {INT64_MAX, 0, 0}, {0, INT64_MIN, INT64_MAX},
        {0, INT64_MAX, INT64_MAX},         {1, 2, 1},
    };
    struct websocket *socket = call_and_greet();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        arthron_Control message = {.which_message = arthron_Control_pong_tag};
        message.message.pong = rows[i];
        tell(socket, &message);
    }
    expect_pong(socket);
    assert_int_equal(atomic_load(&test_server.clocks), 0);
    websocket_close(socket);
}

static void the_offset_leads_from_the_stations_clock_to_the_servers(void **state) {
    (void)state;
    const int64_t ahead_ns = 1000 * NS_PER_S;
    struct websocket *socket = call_and_greet();
    arthron_Control message;
    assert_true(hear_kind(socket, arthron_Control_ping_tag, &message));
    int64_t sent_ns = message.message.ping.sent_ns, station_ns = clock_now_ns() + ahead_ns;
    message.which_message = arthron_Control_pong_tag;
    message.message.pong = (arthron_Pong){sent_ns, station_ns, station_ns};
    tell(socket, &message);
    assert_true(wait_for(&test_server.clocks, 1));
    assert_in_range(llabs(test_server.offset_ns + ahead_ns), 0, test_server.uncertainty_ns);
    websocket_close(socket);
}

static void a_peer_that_reads_nothing_loses_replies_and_holds_up_nobody(void **state) {
    (void)state;
    struct websocket *deaf = call_and_greet();
    arthron_Control reply = {.which_message = arthron_Control_reply_tag};
    reply.message.reply.instruments_count = 5;
    for (int i = 0; i < 5; i++)
        reply.message.reply.instruments[i] =
            (arthron_WarpedInstrument){.channel = (uint8_t)(CHANNEL_PROBE + i),
                                       .has_pose = true,
                                       .pose.qw = 1,
                                       .has_lead = true,
                                       .lead = {.v_count = 3, .slope_count = 9}};
    int sent = 0;
    while (control_counts(test_server.control).replies_dropped < 100 && sent < 1000000)
        sent += control_send(test_server.control, test_server.peer, &reply);
    assert_true(control_counts(test_server.control).replies_dropped >= 100);
    for (int i = 0; i < sent; i++) // it was only slow: what was accepted arrives
        assert_true(hear_kind(deaf, arthron_Control_reply_tag, &reply));
    expect_pong(deaf);
    websocket_close(deaf);
}

// Until nothing more goes to a peer that does not read.
static void stall(void) {
    arthron_Control reply = {.which_message = arthron_Control_reply_tag};
    int taken = 1;
    for (int round = 0; round < 200 && taken; round++) {
        taken = 0;
        for (int i = 0; i < 5000; i++)
            taken += control_send(test_server.control, test_server.peer, &reply);
        usleep(50000); // what can still go goes
    }
}

static bool send_figures(const char *group, uint32_t cuts) {
    arthron_Control message = {.which_message = arthron_Control_resection_tag};
    strcpy(message.message.resection.group, group);
    message.message.resection.cuts = cuts;
    return control_send(test_server.control, test_server.peer, &message);
}

// Figures of one group after the other, each newer, until something else comes; the newest of each.
static arthron_Control hear_figures(struct websocket *socket, uint32_t *out_medial,
                                    uint32_t *out_lateral) {
    arthron_Control message;
    while (hear(socket, &message)) {
        const arthron_Resection *figures = &message.message.resection;
        const arthron_SessionChange *change = &message.message.session_change;
        if (message.which_message == arthron_Control_pong_tag ||
            (message.which_message == arthron_Control_session_change_tag &&
             !strcmp(change->case_name, "other")))
            break;
        if (message.which_message != arthron_Control_resection_tag)
            continue;
        uint32_t *newest = !strcmp(figures->group, "medial") ? out_medial : out_lateral;
        assert_true(figures->cuts > *newest);
        *newest = figures->cuts;
    }
    return message;
}

static void a_peer_that_stalls_gets_the_newest_figures_of_each_group(void **state) {
    (void)state;
    struct websocket *slow = call_and_greet();
    arthron_Control message = {.which_message = arthron_Control_session_change_tag};
    uint32_t medial = 0, lateral = 0;
    strcpy(message.message.session_change.case_name, "other");
    stall();
    for (uint32_t cut = 1; cut <= 300; cut++) {
        assert_true(send_figures("medial", cut));
        assert_true(send_figures("lateral", 1000 + cut));
    }
    assert_true(control_send(test_server.control, test_server.peer, &message));
    assert_true(send_figures("lateral", 1));
    message = hear_figures(slow, &medial, &lateral);
    assert_int_equal(message.which_message, arthron_Control_session_change_tag);
    assert_int_equal(medial, 300); // what was before the change is told before it
    assert_int_equal(lateral, 1300);
    lateral = 0;
    message = (arthron_Control){.which_message = arthron_Control_ping_tag};
    tell(slow, &message);
    message = hear_figures(slow, &medial, &lateral);
    assert_int_equal(message.which_message, arthron_Control_pong_tag);
    assert_int_equal(lateral, 1);
    websocket_close(slow);
}

static void a_message_for_a_peer_that_is_gone_goes_nowhere(void **state) {
    (void)state;
    websocket_close(call_and_greet());
    assert_true(wait_for(&test_server.gone, 1));
    arthron_Control message = {.which_message = arthron_Control_udp_path_tag};
    assert_false(control_send(test_server.control, test_server.peer, &message));
    struct control_peer first = test_server.peer;
    struct websocket *socket = call_and_greet();
    assert_int_equal(test_server.peer.index, first.index);
    assert_false(control_send(test_server.control, first, &message));
    assert_true(control_send(test_server.control, test_server.peer, &message));
    websocket_close(socket);
}

static void a_stopping_server_says_so(void **state) {
    (void)state;
    struct websocket *socket = call_and_greet();
    test_server_stop(&test_server);
    expect_refusal(socket, arthron_Refusal_Reason_SHUTDOWN);
    assert_int_equal(atomic_load(&test_server.gone), 1);
}

static void a_port_that_is_taken_is_named(void **state) {
    (void)state;
    struct control_handler handler = {0};
    struct control_config config = {.address = "127.0.0.1",
                                    .port = test_server.port,
                                    .stations = 1,
                                    .authority_dir = test_server.keys,
                                    .software = "second",
                                    .hello_timeout_ns = NS_PER_S};
    struct control *second;
    struct error err;
    char port[16];
    snprintf(port, sizeof port, "%d", test_server.port);
    assert_int_equal(control_create(&config, &handler, &second, &err), RESULT_IO);
    assert_non_null(strstr(err.text, port));
    config.authority_dir = test_server.dir;
    assert_int_equal(control_create(&config, &handler, &second, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, test_server.dir));
}

#define WITH_SERVER(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)

int main(void) {
    const struct CMUnitTest tests[] = {
        WITH_SERVER(a_hello_is_welcomed_with_what_both_sides_can_do),
        WITH_SERVER(a_hello_in_three_fragments_is_one_message),
        WITH_SERVER(a_version_that_is_not_ours_is_refused),
        WITH_SERVER(a_name_that_is_not_the_certificates_is_refused),
        WITH_SERVER(what_the_handler_refuses_is_refused_with_its_words),
        WITH_SERVER(a_silent_peer_is_refused_in_time),
        WITH_SERVER(a_connection_that_does_not_become_a_websocket_is_closed),
        WITH_SERVER(nothing_is_heard_before_hello),
        WITH_SERVER(without_a_certificate_there_is_only_enrolment),
        WITH_SERVER(a_certificate_of_another_authority_ends_the_handshake),
        WITH_SERVER(revoking_closes_the_connection_and_refuses_the_next),
        WITH_SERVER(an_unknown_message_is_skipped_and_counted),
        WITH_SERVER(a_malformed_message_closes_its_peer_and_no_other),
        WITH_SERVER(a_message_that_is_too_long_is_not_collected),
        WITH_SERVER(times_that_no_clock_shows_are_ignored),
        WITH_SERVER(the_offset_leads_from_the_stations_clock_to_the_servers),
        WITH_SERVER(a_peer_that_reads_nothing_loses_replies_and_holds_up_nobody),
        WITH_SERVER(a_peer_that_stalls_gets_the_newest_figures_of_each_group),
        WITH_SERVER(a_message_for_a_peer_that_is_gone_goes_nowhere),
        WITH_SERVER(a_stopping_server_says_so),
        WITH_SERVER(while_another_process_holds_the_keys_frames_are_answered),
        WITH_SERVER(revoking_works_while_an_enrolment_waits),
        WITH_SERVER(an_applicant_that_goes_while_it_waits_keeps_its_code),
        WITH_SERVER(no_more_than_ten_wait_to_be_enrolled),
        WITH_SERVER(a_server_can_stop_while_an_enrolment_waits),
        WITH_SERVER(a_stranger_learns_nothing_of_the_servers_files),
        WITH_SERVER(a_port_that_is_taken_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
