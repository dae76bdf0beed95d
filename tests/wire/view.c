// A station's view: who may look, and what a viewer gets that is slow, silent, rude or one too
// many.
#include "view/view.h"

#include "base/clock.h"
#include "folder.h"
#include "test.h"
#include "view/token.h"
#include "wire/websocket.h"

#include <arpa/inet.h>
#include <pb_decode.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static char dir[FOLDER_MAX];
static struct view_config config;
static struct view *view;
static char token[TOKEN_LENGTH + 1];

static int begin(void **state) {
    (void)state;
    folder_make(dir);
    config = (struct view_config){.origin_count = 2,
                                  .origins = {"http://localhost:8080", "https://school.example"}};
    snprintf(config.token_path, sizeof config.token_path, "%s/token", dir);
    assert_int_equal(view_create(&config, &view, NULL), RESULT_OK);
    assert_int_equal(token_get(config.token_path, token, NULL), RESULT_OK);
    return 0;
}

static int end(void **state) {
    (void)state;
    view_destroy(&view);
    folder_remove(dir);
    return 0;
}

// ---- asking -------------------------------------------------------------------------------------

struct question {
    const char *what;
    int status;
    const char *path, *host, *subprotocol, *origin,
        *with_token; // NULL: the right one; origin: none
};

static struct websocket *ask(const struct question *q, int *out_status) {
    char text[2048], origin[512] = "", protocol[256];
    const char *subprotocol = q->subprotocol ? q->subprotocol : WIRE_VIEW_SUBPROTOCOL;
    if (q->origin)
        snprintf(origin, sizeof origin, "Origin: %s\r\n", q->origin);
    snprintf(protocol, sizeof protocol, "Sec-WebSocket-Protocol: %s\r\n", subprotocol);
    snprintf(text, sizeof text,
             "GET %s?token=%s HTTP/1.1\r\nHost: %s\r\nUpgrade: websocket\r\n"
             "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
             "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n%s%s\r\n",
             q->path ? q->path : "/view", q->with_token ? q->with_token : token,
             q->host ? q->host : "127.0.0.1:1", origin, *subprotocol ? protocol : "");
    return websocket_ask(view_port(view), text, out_status);
}

static struct websocket *look(void) {
    const struct question good = {.what = "good"};
    int status;
    struct websocket *socket = ask(&good, &status);
    assert_int_equal(status, 101);
    return socket;
}

static void wait_for_viewers(bool any) {
    for (int i = 0; i < 5000 && view_is_watched(view) != any; i++)
        usleep(1000);
    assert_int_equal(view_is_watched(view), any);
}

static void show(const char *case_name) {
    arthron_View message = {.bodies_count = 3, .instruments_count = 5, .events_count = 32};
    snprintf(message.case_name, sizeof message.case_name, "%s", case_name);
    view_show(view, &message);
}

// What comes next; its number, 0 where the station closes.
static uint64_t see(struct websocket *socket, arthron_View *out) {
    uint8_t bytes[WIRE_VIEW_MAX];
    int size = websocket_receive(socket, bytes, sizeof bytes);
    if (size < 0)
        return 0;
    pb_istream_t stream = pb_istream_from_buffer(bytes, (size_t)size);
    assert_true(pb_decode(&stream, arthron_View_fields, out));
    return out->number;
}

// Shows the newest until the viewer has it: a message may come before the viewer is let in.
static uint64_t see_first(struct websocket *socket, arthron_View *out) {
    struct pollfd fd = {.fd = websocket_fd(socket), .events = POLLIN};
    for (int i = 0; i < 500 && poll(&fd, 1, 10) == 0; i++)
        show("first");
    return see(socket, out);
}

// ---- tests --------------------------------------------------------------------------------------

static void a_viewer_gets_what_is_shown(void **state) {
    (void)state;
    assert_false(view_is_watched(view));
    show("before anybody came");
    struct websocket *socket = look();
    arthron_View message;
    uint64_t first = see_first(socket, &message);
    assert_string_equal(message.case_name, "first");
    assert_true(view_is_watched(view));
    assert_int_equal(message.bodies_count, 3);
    show("second");
    while (see(socket, &message) && !strcmp(message.case_name, "first"))
        ;
    assert_string_equal(message.case_name, "second");
    assert_true(message.number > first);
    websocket_close(socket);
    wait_for_viewers(false);
}

static void fill(char *text, size_t size) {
    memset(text, 'n', size - 1);
}

// More than a station has: every text, list and number as long as the schema lets it be.
static arthron_View most(void) {
    arthron_View m = {.time_ns = -1, .case_hash = 1, .events_count = 32, .has_attempt = true};
    arthron_Pose place = {1, 1, 1, 1, 1, 1, 1};
    arthron_ViewAttempt *a = &m.attempt;
    fill(m.case_name, sizeof m.case_name);
    fill(m.server, sizeof m.server);
    for (int i = 0; i < 3; i++)
        m.bodies[m.bodies_count++] = (arthron_ViewBody){2, 2, true, place, true, place};
    for (int i = 0; i < 8; i++) {
        arthron_ViewInstrument *tool = &m.instruments[m.instruments_count++];
        *tool = (arthron_ViewInstrument){.channel = 200,
                                         .validity = 2,
                                         .time_ns = 1,
                                         .has_tip = true,
                                         .tip = place,
                                         .warp_validity = 2,
                                         .has_warped = true,
                                         .warped = place,
                                         .age_ms = 1,
                                         .clamped = true,
                                         .has_handle = true,
                                         .handle = {1, 1},
                                         .has_force_n = true,
                                         .force_n = 1};
        fill(tool->name, sizeof tool->name);
        m.loose[m.loose_count++] = (arthron_ViewLoose){200, 2, 200, true, place};
    }
    memset(m.events, 0xff, sizeof m.events);
    *a = (arthron_ViewAttempt){.number = ~0U,
                               .purpose = 1,
                               .hand = 1,
                               .time_ns = 1,
                               .limit_s = 1,
                               .goals_count = 24,
                               .errors_count = 12,
                               .end = 6,
                               .verdict = 2,
                               .pass_time_s = 1,
                               .pass_errors = ~0U,
                               .in_order = true};
    fill(a->task, sizeof a->task);
    fill(a->title, sizeof a->title);
    for (int i = 0; i < 24; i++) {
        a->goals[i].has_met_ns = true;
        fill(a->goals[i].name, sizeof a->goals[i].name);
    }
    for (int i = 0; i < 12; i++) {
        a->errors[i] = (arthron_AttemptError){.count = ~0U, .sentinel = true};
        fill(a->errors[i].name, sizeof a->errors[i].name);
    }
    return m;
}

static void see_what(struct websocket *socket, arthron_View *shown, arthron_View *out) {
    int64_t time_ns = ++shown->time_ns;
    view_show(view, shown);
    do
        assert_true(see(socket, out));
    while (out->time_ns != time_ns || out->bodies_count != shown->bodies_count);
}

// A viewer that was written when there were no attempts may have room for so many bytes and no more
// (see() has WIRE_VIEW_MAX).
static void the_most_of_everything_leaves_out_goals_and_errors(void **state) {
    (void)state;
    struct websocket *socket = look();
    arthron_View message, all = most();
    assert_true(see_first(socket, &message));
    see_what(socket, &all, &message);
    assert_int_equal(message.instruments_count, 8);
    assert_int_equal(message.attempt.verdict, 2);
    assert_int_equal(message.attempt.goals_count + message.attempt.errors_count, 0);
    all.instruments_count = 4;
    see_what(socket, &all, &message);
    assert_int_equal(message.attempt.goals_count, 24);
    assert_true(message.attempt.goals[23].has_met_ns);
    assert_int_equal(message.attempt.errors_count, 12);
    websocket_close(socket);
    wait_for_viewers(false);
}

static void a_viewer_without_permission_is_told_so(void **state) {
    (void)state;
    static const char zeros[] = "0000000000000000000000000000000000000000000000000000000000000000";
    char longer[TOKEN_LENGTH + 2], huge[1200];
    snprintf(longer, sizeof longer, "%s0", token);
    memset(huge, 'a', sizeof huge - 1);
    huge[sizeof huge - 1] = '\0';
    const struct question questions[] = {
        {"no token", 403, .with_token = ""},
        {"another token", 403, .with_token = zeros},
        {"the token and more", 403, .with_token = longer},
        {"a huge token", 403, .with_token = huge},
        {"another site's page", 403, .origin = "http://evil.example"},
        {"a page of no site", 403, .origin = "null"},
        {"a listed origin's prefix", 403, .origin = "http://localhost:80"},
        {"a listed origin and more", 403, .origin = "http://localhost:80801"},
        {"a huge origin", 403, .origin = huge},
        {"a name that somebody points here", 403, .host = "evil.example"},
        {"a name that begins well", 403, .host = "localhost.evil.example"},
        {"a port that is none", 403, .host = "localhost:80.evil.example"},
        {"no subprotocol", 400, .subprotocol = ""},
        {"another subprotocol", 400, .subprotocol = "arthron.1"},
        {"another path", 404, .path = "/"},
        {"a path below", 404, .path = "/view/x"},
    };
    for (size_t i = 0; i < sizeof questions / sizeof *questions; i++) {
        int status;
        struct websocket *socket = ask(&questions[i], &status);
        if (socket || status != questions[i].status)
            fail_msg("%s: %d, not %d", questions[i].what, status, questions[i].status);
    }
    assert_false(view_is_watched(view));
}

static void a_viewer_with_the_token_is_let_in(void **state) {
    (void)state;
    const struct question questions[] = {
        {"a program", 101},
        {"a listed page", 101, .origin = "http://localhost:8080"},
        {"another", 101, .origin = "https://school.example", .host = "localhost:9"},
        {"without a port", 101, .host = "LOCALHOST"},
    };
    for (size_t i = 0; i < sizeof questions / sizeof *questions; i++) {
        int status;
        struct websocket *socket = ask(&questions[i], &status);
        if (!socket)
            fail_msg("%s: %d", questions[i].what, status);
        websocket_close(socket);
    }
}

static void what_is_no_websocket_is_not_found(void **state) {
    (void)state;
    int status;
    assert_null(
        websocket_ask(view_port(view), "GET /view HTTP/1.1\r\nHost: localhost\r\n\r\n", &status));
    assert_int_equal(status, 404);
    assert_null(websocket_ask(view_port(view), "\x16\x03\x01 no HTTP at all\r\n\r\n", &status));
    arthron_View message;
    struct websocket *socket = look();
    assert_true(see_first(socket, &message));
    websocket_close(socket);
}

static void the_ninth_viewer_is_refused_until_another_goes(void **state) {
    (void)state;
    struct websocket *sockets[VIEW_VIEWERS_MAX];
    arthron_View message;
    for (int i = 0; i < VIEW_VIEWERS_MAX; i++) {
        sockets[i] = look();
        assert_true(see_first(sockets[i], &message)); // it is let in
    }
    const struct question one_more = {.what = "one more"};
    int status;
    assert_null(ask(&one_more, &status));
    assert_int_equal(status, 503);
    websocket_close(sockets[3]);
    for (int i = 0; i < 500 && !(sockets[3] = ask(&one_more, &status)); i++)
        usleep(10000);
    assert_int_equal(status, 101);
    for (int i = 0; i < VIEW_VIEWERS_MAX; i++)
        assert_true(see_first(sockets[i], &message));
    for (int i = 0; i < VIEW_VIEWERS_MAX; i++)
        websocket_close(sockets[i]);
    wait_for_viewers(false);
}

// Shows `count` messages, each seen by the fast viewer before the next.
static uint64_t show_to(struct websocket *fast, int count) {
    arthron_View message;
    uint64_t number = 0;
    for (int i = 0; i < count; i++) {
        show("more");
        number = see(fast, &message);
        assert_true(number);
    }
    return number;
}

static void a_slow_viewer_skips_and_holds_up_nobody(void **state) {
    (void)state;
    struct websocket *slow = look(), *fast = look();
    arthron_View message;
    int small = 2048, received = 0;
    setsockopt(websocket_fd(slow), SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    uint64_t first = see_first(slow, &message);
    assert_true(see_first(fast, &message));
    usleep(20000); // what see_first showed once more has come
    struct pollfd fd = {.fd = websocket_fd(fast), .events = POLLIN};
    while (poll(&fd, 1, 20) == 1)
        see(fast, &message);
    uint64_t last = show_to(fast, 5000), number = first, skips = 0;
    // What waited in the kernel is old; behind it comes the newest.
    while (number < last) {
        uint64_t next = see(slow, &message);
        assert_true(next > number);
        skips += next - number - 1;
        number = next;
        received++;
    }
    assert_true(skips > 2500);
    assert_in_range(received, 1, 2500);
    websocket_close(slow);
    websocket_close(fast);
    wait_for_viewers(false);
}

static void a_viewer_that_says_anything_is_disconnected(void **state) {
    (void)state;
    static const char text[] = "hello";
    struct websocket *polite = look(), *rude = look(), *wild = look();
    arthron_View message;
    assert_true(see_first(polite, &message) && see_first(rude, &message) &&
                see_first(wild, &message));
    assert_true(websocket_send(rude, WEBSOCKET_TEXT, true, text, sizeof text));
    assert_int_equal(send(websocket_fd(wild), "\xff\xff\xff\xff\xff\xff\xff\xff", 8, 0), 8);
    assert_true(websocket_is_ended(rude) && websocket_is_ended(wild));
    websocket_close(rude), websocket_close(wild);
    assert_true(see_first(polite, &message));
    websocket_close(polite);
    wait_for_viewers(false);
}

static void a_port_in_use_is_refused(void **state) {
    (void)state;
    struct view_config same = config;
    struct view *second = NULL;
    struct error err = {""};
    same.port = view_port(view);
    assert_int_equal(view_create(&same, &second, &err), RESULT_IO);
    assert_null(second);
    assert_non_null(strstr(err.text, "in use"));
}

static void *answer_something(void *argument) {
    int caller = accept(*(int *)argument, NULL, NULL);
    static const char answer[] = "HTTP/1.1 200 OK\r\n\r\n";
    send(caller, answer, sizeof answer - 1, MSG_NOSIGNAL);
    close(caller);
    return NULL;
}

static void what_has_a_port_is_told(void **state) {
    (void)state;
    int port = view_port(view);
    assert_int_equal(view_look_at_port(port), VIEW_PORT_VIEW);
    assert_false(view_is_watched(view));
    view_destroy(&view);
    assert_int_equal(view_look_at_port(port), VIEW_PORT_FREE);
    pthread_t other;
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&address, size), 0);
    assert_int_equal(listen(fd, 1), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&address, &size), 0);
    pthread_create(&other, NULL, answer_something, &fd);
    assert_int_equal(view_look_at_port(ntohs(address.sin_port)), VIEW_PORT_TAKEN);
    pthread_join(other, NULL);
    close(fd);
    assert_int_equal(view_create(&config, &view, NULL), RESULT_OK);
}

static void viewers_are_sent_away_when_the_station_ends(void **state) {
    struct websocket *socket = look();
    arthron_View message;
    assert_true(see_first(socket, &message));
    view_destroy(&view);
    assert_true(websocket_is_ended(socket));
    websocket_close(socket);
    assert_int_equal(view_create(&config, &view, NULL), RESULT_OK);
    (void)state;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_viewer_gets_what_is_shown, begin, end),
        cmocka_unit_test_setup_teardown(the_most_of_everything_leaves_out_goals_and_errors, begin,
                                        end),
        cmocka_unit_test_setup_teardown(a_viewer_without_permission_is_told_so, begin, end),
        cmocka_unit_test_setup_teardown(a_viewer_with_the_token_is_let_in, begin, end),
        cmocka_unit_test_setup_teardown(what_is_no_websocket_is_not_found, begin, end),
        cmocka_unit_test_setup_teardown(the_ninth_viewer_is_refused_until_another_goes, begin, end),
        cmocka_unit_test_setup_teardown(a_slow_viewer_skips_and_holds_up_nobody, begin, end),
        cmocka_unit_test_setup_teardown(a_viewer_that_says_anything_is_disconnected, begin, end),
        cmocka_unit_test_setup_teardown(a_port_in_use_is_refused, begin, end),
        cmocka_unit_test_setup_teardown(what_has_a_port_is_told, begin, end),
        cmocka_unit_test_setup_teardown(viewers_are_sent_away_when_the_station_ends, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
