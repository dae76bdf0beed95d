// A station's link against a real control room and a real datagram socket.
#include "link/link.h"

#include "base/clock.h"
#include "net/datagram.h"
#include "test.h"
#include "wire/test_server.h"

#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct test_server test_server;
static char anna[128];

static int set_up(void **state) {
    (void)state;
    test_server = (struct test_server){0};
    test_server_open(&test_server);
    test_server_enrol(&test_server, "anna", anna);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    test_server_close(&test_server);
    return 0;
}

static struct link *link_to(const char *host, const char *keys_dir) {
    struct link_config config = {.server_count = 1,
                                 .servers = {{.port = test_server.port}},
                                 .keys_dir = keys_dir,
                                 .station = "anna",
                                 .software = "test",
                                 .datagrams = true,
                                 .device_count = 1,
                                 .devices = {{"arm", "modbus"}}};
    struct link *link;
    struct error err;
    snprintf(config.servers[0].host, sizeof config.servers[0].host, "%s", host);
    if (link_create(&config, &link, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return link;
}

static struct link_status status_of(struct link *link) {
    struct link_status status;
    link_get_status(link, &status);
    return status;
}

// ---- frames -------------------------------------------------------------------------------------

struct traffic {
    uint64_t number; // of the last frame tried
    uint64_t sent, answered;
    bool was_answered[10000];
};

// Sends one frame and takes what comes within a millisecond. Each reply answers a frame of ours,
// and no frame is answered twice.
static void exchange(struct link *link, struct traffic *t) {
    struct frame frame = {.number = ++t->number, .time_ns = clock_now_ns(), .count = 1};
    frame.samples[0] = (struct sample){.channel = CHANNEL_PROBE,
                                       .kind = SAMPLE_POSE,
                                       .time_ns = frame.time_ns,
                                       .T_mockup_body = pose_identity()};
    arthron_Reply reply;
    assert_true(t->number < sizeof t->was_answered);
    t->sent += link_send(link, &frame);
    while (link_wait(link, frame.time_ns + NS_PER_MS, &reply)) {
        assert_in_range(reply.frame_number, 1, t->number);
        assert_false(t->was_answered[reply.frame_number]);
        t->was_answered[reply.frame_number] = true;
        t->answered++;
    }
}

static void exchange_until_path(struct link *link, struct traffic *t, enum link_path path) {
    int64_t until_ns = clock_now_ns() + 8 * NS_PER_S;
    while (status_of(link).path != path && clock_now_ns() < until_ns)
        exchange(link, t);
    assert_int_equal(status_of(link).path, path);
}

static void take_the_rest(struct link *link, struct traffic *t) {
    arthron_Reply reply;
    int64_t until_ns = clock_now_ns() + 5 * NS_PER_S;
    while (t->answered < t->sent && link_wait(link, until_ns, &reply))
        t->answered++;
}

static void wait_until_ready(struct link *link) {
    assert_true(wait_for(&test_server.clocks, 1));
    for (int i = 0; i < 5000 && status_of(link).path == LINK_DOWN; i++)
        usleep(2000);
    assert_int_not_equal(status_of(link).path, LINK_DOWN);
}

// ---- the attempt --------------------------------------------------------------------------------

static void the_newest_attempt_is_kept(void **state) {
    (void)state;
    struct link *link = link_to("localhost", anna);
    arthron_Control message = {.which_message = arthron_Control_attempt_tag};
    arthron_AttemptState *told = &message.message.attempt, found;
    uint64_t seen = 0;
    wait_until_ready(link);
    assert_false(link_get_attempt(link, &seen, &found));
    *told = (arthron_AttemptState){.number = 3, .goals_count = 2, .errors_count = 1};
    strcpy(told->task, "centring");
    for (uint32_t count = 1; count <= 3; count++) {
        told->errors[0].count = count;
        assert_true(control_send(test_server.control, test_server.peer, &message));
    }
    for (int i = 0; i < 5000 && seen < 3; i++, usleep(2000))
        link_get_attempt(link, &seen, &found);
    assert_int_equal(found.number, 3);
    assert_string_equal(found.task, "centring");
    assert_int_equal(found.errors[0].count, 3);
    assert_false(link_get_attempt(link, &seen, &found));
    link_destroy(&link);
}

// ---- control connection -------------------------------------------------------------------------

static void a_link_says_who_it_is_and_what_it_has(void **state) {
    (void)state;
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    assert_string_equal(test_server.hello.station, "anna");
    assert_string_equal(test_server.hello.software, "test");
    assert_int_equal(test_server.hello.devices_count, 1);
    assert_string_equal(test_server.hello.devices[0].name, "arm");
    assert_string_equal(test_server.hello.capabilities[0], "datagrams");
    struct link_status status = status_of(link);
    assert_true(status.welcomed && status.clock_known);
    assert_string_equal(status.session_case, "healthy");
    assert_int_equal(status.hold_ms, 100);
    assert_true(status.utc_known && llabs(status.utc_ahead_s) <= 1);
    assert_int_equal(status.connects, 1);
    link_destroy(&link);
    assert_true(wait_for(&test_server.gone, 1));
}

static void a_link_tells_of_the_session_when_it_changed(void **state) {
    (void)state;
    struct knee_frame knee = {.joint = {SIDE_LEFT, pose_identity(), pose_identity()},
                              .patella_count = 1,
                              .patella = {{30, pose_identity()}}};
    knee.joint.T_tibia_joint.translation.z = 17;
    test_server.knee = &knee;
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    struct link_session session = {0};
    uint64_t seen = 0;
    assert_true(link_get_session(link, &seen, &session));
    assert_int_equal(session.state, arthron_SessionState_RUNNING);
    assert_string_equal(session.case_name, "healthy");
    assert_true(session.has_knee);
    assert_int_equal(session.knee.joint.side, SIDE_LEFT);
    assert_near(session.knee.joint.T_tibia_joint.translation.z, 17, 0);
    assert_int_equal(session.knee.patella_count, 1);
    for (int i = 0; i < 100 && link_get_session(link, &seen, &session); i++)
        usleep(10000);
    assert_false(link_get_session(link, &seen, &session));
    link_destroy(&link);
    assert_true(wait_for(&test_server.gone, 1));
    test_server.knee = NULL;
}

static void both_ends_know_the_offset_of_the_clocks(void **state) {
    (void)state;
    struct link *link = link_to("127.0.0.1", anna);
    assert_true(wait_for(&test_server.clocks, 5));
    wait_until_ready(link);
    struct link_status status = status_of(link);
    pthread_mutex_lock(&test_server.lock);
    // One machine, one clock: the offset is nothing.
    assert_in_range(llabs(test_server.offset_ns), 0, test_server.uncertainty_ns);
    assert_in_range(llabs(status.clock_offset_ns), 0, status.clock_uncertainty_ns);
    assert_true(test_server.uncertainty_ns < NS_PER_S);
    assert_true(test_server.rtt_ns > 0);
    pthread_mutex_unlock(&test_server.lock);
    link_destroy(&link);
}

static void no_frame_leaves_before_the_clock_is_known(void **state) {
    (void)state;
    test_server_stop(&test_server);
    struct link *link = link_to("localhost", anna);
    struct frame frame = {.number = 1};
    assert_false(link_send(link, &frame));
    assert_int_equal(status_of(link).path, LINK_DOWN);
    test_server_start(&test_server);
    wait_until_ready(link);
    assert_true(link_send(link, &frame));
    link_destroy(&link);
}

static void both_sides_ping_little_until_a_frame_ends_the_rest(void **state) {
    (void)state;
    static struct traffic traffic;
    traffic = (struct traffic){0};
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    sleep(3);
    int before = atomic_load(&test_server.clocks);
    sleep(3); // three pings of a server that does not know
    assert_int_equal(atomic_load(&test_server.clocks), before);
    exchange(link, &traffic);
    assert_true(wait_for(&test_server.clocks, before + 10)); // as at the beginning
    link_destroy(&link);
}

static void every_frame_is_answered_once_in_the_control_connection(void **state) {
    (void)state;
    struct link *link = link_to("localhost", anna);
    static struct traffic traffic;
    traffic = (struct traffic){0};
    wait_until_ready(link);
    for (int i = 0; i < 500; i++)
        exchange(link, &traffic);
    take_the_rest(link, &traffic);
    assert_true(traffic.sent > 400); // a machine in a hurry may find the queue full
    assert_int_equal(traffic.answered, traffic.sent);
    assert_int_equal(status_of(link).replies, traffic.sent);
    assert_int_equal(status_of(link).frames_sent, traffic.sent);
    assert_int_equal(status_of(link).path, LINK_CONTROL);
    link_destroy(&link);
}

static void a_link_comes_back_when_the_server_does(void **state) {
    (void)state;
    static struct traffic traffic;
    traffic = (struct traffic){0};
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    uint64_t id = test_server.hello.connection;
    test_server_stop(&test_server);
    for (int i = 0; i < 5000 && status_of(link).path != LINK_DOWN; i++)
        usleep(2000);
    assert_int_equal(status_of(link).path, LINK_DOWN);
    assert_string_equal(status_of(link).refusal, "the server stops");
    test_server_start(&test_server);
    assert_true(wait_for(&test_server.hellos, 2));
    exchange_until_path(link, &traffic, LINK_CONTROL);
    assert_int_equal(status_of(link).connects, 2);
    assert_int_equal(test_server.hello.connection, id);
    assert_string_equal(status_of(link).refusal, "");
    exchange(link, &traffic);
    take_the_rest(link, &traffic);
    assert_true(traffic.sent > 0);
    assert_int_equal(traffic.answered, traffic.sent);
    link_destroy(&link);
}

static void what_the_server_refuses_is_kept(void **state) {
    (void)state;
    test_server.refusal = &(arthron_Refusal){arthron_Refusal_Reason_BUSY, "full", "", 0};
    struct link *link = link_to("localhost", anna);
    for (int i = 0; i < 5000 && !status_of(link).refusal[0]; i++)
        usleep(2000);
    assert_string_equal(status_of(link).refusal, "full");
    assert_false(status_of(link).welcomed);
    link_destroy(&link);
}

static void a_link_trusts_only_its_authority(void **state) {
    (void)state;
    struct test_server other = {0};
    char foreign[128];
    test_server_open(&other);
    test_server_enrol(&other, "anna", foreign);
    struct link *link = link_to("localhost", foreign);
    usleep(500000);
    assert_false(status_of(link).welcomed);
    assert_int_equal(atomic_load(&test_server.hellos), 0);
    // Not even asked for a certificate: the link hung up first.
    assert_int_equal(control_counts(test_server.control).refused_certificates, 0);
    link_destroy(&link);
    test_server_close(&other);
}

static void copy_key_file(const char *from_dir, const char *to_dir, const char *name) {
    char command[512];
    snprintf(command, sizeof command, "cp %s/%s %s/%s", from_dir, name, to_dir, name);
    assert_int_equal(system(command), 0);
}

static void
a_certificate_of_another_authority_is_refused_and_the_link_goes_on_trying(void **state) {
    (void)state;
    struct test_server other = {0};
    char foreign[128];
    test_server_open(&other);
    test_server_enrol(&other, "anna", foreign);
    copy_key_file(anna, foreign, "authority.pem");
    struct link *link = link_to("localhost", foreign);
    for (int i = 0; i < 5000 && control_counts(test_server.control).refused_certificates < 3; i++)
        usleep(2000);
    assert_true(control_counts(test_server.control).refused_certificates >= 3);
    assert_int_equal(status_of(link).connects, 0);
    link_destroy(&link);
    test_server_close(&other);
}

// This server names "path": a challenge that does not come where datagrams arrive proves nothing.
static void a_challenge_in_the_control_connection_gets_no_answer(void **state) {
    (void)state;
    static struct traffic traffic;
    traffic = (struct traffic){0};
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    arthron_Control message = {.which_message = arthron_Control_udp_path_tag};
    message.message.udp_path.challenge = 0x123456789abcdef0;
    assert_true(control_send(test_server.control, test_server.peer, &message));
    for (int i = 0; i < 3; i++) // an answer would come before the last frame
        exchange(link, &traffic);
    take_the_rest(link, &traffic);
    assert_int_equal(traffic.answered, 3);
    assert_int_equal(atomic_load(&test_server.messages), 0);
    link_destroy(&link);
}

static void a_missing_key_is_named(void **state) {
    (void)state;
    char path[160];
    struct error err;
    struct link *link;
    struct link_config config = {.server_count = 1,
                                 .servers = {{"localhost", test_server.port}},
                                 .keys_dir = anna,
                                 .station = "anna",
                                 .software = "test"};
    snprintf(path, sizeof path, "%s/station.key", anna);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(link_create(&config, &link, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, path));
    assert_null(link);
}

// ---- datagrams ----------------------------------------------------------------------------------

struct responder {
    struct datagram_endpoint *endpoint;
    arthron_UdpKeys keys;
    pthread_t thread;
    pthread_mutex_t lock; // around the endpoint
    atomic_bool mute, stopping;
    atomic_int answered;
    atomic_uint_fast64_t newest; // number of the last frame that came
    uint64_t challenge;          // in each reply
};

static void answer_batch(struct responder *r) {
    static struct datagram_in batch[DATAGRAM_BATCH];
    pthread_mutex_lock(&r->lock);
    int count = datagram_receive(r->endpoint, batch);
    for (int i = 0; i < count; i++)
        atomic_store(&r->newest, batch[i].frame.number);
    for (int i = 0; i < count && !atomic_load(&r->mute); i++) {
        arthron_Reply reply = {.frame_number = batch[i].frame.number,
                               .frame_time_ns = batch[i].frame.time_ns,
                               .path_challenge = r->challenge};
        atomic_fetch_add(&r->answered, datagram_reply(r->endpoint, batch[i].connection, &reply));
    }
    datagram_flush(r->endpoint);
    pthread_mutex_unlock(&r->lock);
}

static void *respond(void *argument) {
    struct responder *r = argument;
    while (!atomic_load(&r->stopping)) {
        struct pollfd fd = {.fd = datagram_fd(r->endpoint), .events = POLLIN};
        if (poll(&fd, 1, 10) > 0)
            answer_batch(r);
    }
    return NULL;
}

static void responder_open(struct responder *r) {
    struct error err;
    *r = (struct responder){.lock = PTHREAD_MUTEX_INITIALIZER};
    if (datagram_create("127.0.0.1", 0, 1, &r->endpoint, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    datagram_new_epoch(r->endpoint, 77, NULL, clock_now_ns(), &r->keys);
    test_server.keys_at_hello = &r->keys;
    pthread_create(&r->thread, NULL, respond, r);
}

static void responder_stop(struct responder *r) {
    atomic_store(&r->stopping, true);
    pthread_join(r->thread, NULL);
}

static void datagrams_are_taken_left_and_taken_again_as_they_pass(void **state) {
    (void)state;
    static struct responder responder;
    static struct traffic traffic;
    traffic = (struct traffic){0};
    responder_open(&responder);
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    exchange_until_path(link, &traffic, LINK_DATAGRAM);
    atomic_store(&responder.mute, true);
    exchange_until_path(link, &traffic, LINK_CONTROL);
    uint64_t answered = traffic.answered;
    for (int i = 0; i < 50; i++)
        exchange(link, &traffic);
    assert_true(traffic.answered > answered);
    atomic_store(&responder.mute, false);
    exchange_until_path(link, &traffic, LINK_DATAGRAM);
    int by_datagram = atomic_load(&responder.answered);
    for (int i = 0; i < 50; i++)
        exchange(link, &traffic);
    assert_true(atomic_load(&responder.answered) > by_datagram);
    link_destroy(&link);
    responder_stop(&responder);
    datagram_destroy(&responder.endpoint);
}

static void a_challenge_in_a_reply_is_sent_back_in_the_control_connection(void **state) {
    (void)state;
    static struct responder responder;
    static struct traffic traffic;
    traffic = (struct traffic){0};
    responder_open(&responder);
    responder.challenge = 0x123456789abcdef0;
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    exchange_until_path(link, &traffic, LINK_DATAGRAM);
    assert_true(wait_for(&test_server.messages, 1));
    for (int i = 0; i < 50; i++)
        exchange(link, &traffic);
    assert_int_equal(atomic_load(&test_server.messages), 1); // once
    link_destroy(&link);
    responder_stop(&responder);
    assert_int_equal(test_server.challenge, 0x123456789abcdef0);
    datagram_destroy(&responder.endpoint);
}

// On trial a frame goes both ways; meanwhile the server takes nothing out of the control connection
// (its thread waits for the lock), so that the queue of that is full.
static void a_frame_that_left_by_datagram_is_called_sent(void **state) {
    (void)state;
    static struct responder responder;
    static bool refused[4000000];
    struct frame frame = {.count = 16};
    for (int i = 0; i < frame.count; i++)
        frame.samples[i] = (struct sample){
            .channel = CHANNEL_PROBE, .kind = SAMPLE_POSE, .T_mockup_body = pose_identity()};
    memset(refused, 0, sizeof refused);
    responder_open(&responder);
    atomic_store(&responder.mute, true); // so that trials go on
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    pthread_mutex_lock(&test_server.lock);
    int64_t until_ns = clock_now_ns() + 10 * NS_PER_S;
    uint64_t seen = 0, full = 0;
    int trials = 0;
    while (trials < 4 && clock_now_ns() < until_ns && frame.number + 1 < sizeof refused) {
        arthron_Reply reply;
        frame.number++;
        frame.time_ns = clock_now_ns();
        refused[frame.number] = !link_send(link, &frame);
        full += refused[frame.number];
        if (frame.number % 64 == 0)
            link_wait(link, 0, &reply);
        uint64_t newest = atomic_load(&responder.newest);
        trials += newest != seen;
        seen = newest;
        if (refused[newest])
            break;
    }
    pthread_mutex_unlock(&test_server.lock);
    assert_false(refused[seen]);
    assert_int_equal(trials, 4);
    assert_true(full > 0);
    link_destroy(&link);
    responder_stop(&responder);
    datagram_destroy(&responder.endpoint);
}

static void a_new_epoch_loses_no_frame(void **state) {
    (void)state;
    static struct responder responder;
    static struct traffic traffic;
    traffic = (struct traffic){0};
    responder_open(&responder);
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    exchange_until_path(link, &traffic, LINK_DATAGRAM);
    for (int epoch = 0; epoch < 3; epoch++) {
        arthron_Control message = {.which_message = arthron_Control_udp_keys_tag};
        pthread_mutex_lock(&responder.lock);
        datagram_new_epoch(responder.endpoint, 77, NULL, clock_now_ns(), &message.message.udp_keys);
        pthread_mutex_unlock(&responder.lock);
        assert_true(control_send(test_server.control, test_server.peer, &message));
        for (int i = 0; i < 100; i++)
            exchange(link, &traffic);
        assert_int_equal(status_of(link).path, LINK_DATAGRAM);
    }
    take_the_rest(link, &traffic);
    assert_int_equal(traffic.answered, traffic.sent);
    link_destroy(&link);
    responder_stop(&responder);
    assert_int_equal(datagram_counts(responder.endpoint).forged, 0);
    datagram_destroy(&responder.endpoint);
}

static void where_no_datagram_is_answered_frames_stay_in_the_control_connection(void **state) {
    (void)state;
    static struct traffic traffic;
    traffic = (struct traffic){0};
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    int silent = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    assert_int_equal(bind(silent, (struct sockaddr *)&address, size), 0);
    assert_int_equal(getsockname(silent, (struct sockaddr *)&address, &size), 0);
    arthron_UdpKeys keys = {.port = ntohs(address.sin_port), .connection = 5};
    test_server.keys_at_hello = &keys;
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    for (int i = 0; i < 500; i++)
        exchange(link, &traffic);
    take_the_rest(link, &traffic);
    assert_true(traffic.sent > 400);
    assert_int_equal(traffic.answered, traffic.sent);
    assert_int_equal(status_of(link).path, LINK_CONTROL);
    char datagram[2048];
    assert_true(recv(silent, datagram, sizeof datagram, 0) > 0); // it was tried
    link_destroy(&link);
    close(silent);
}

static void a_closed_port_is_no_worse_than_a_silent_one(void **state) {
    (void)state;
    static struct traffic traffic;
    traffic = (struct traffic){0};
    arthron_UdpKeys keys = {.port = 1, .connection = 5};
    test_server.keys_at_hello = &keys;
    struct link *link = link_to("localhost", anna);
    wait_until_ready(link);
    for (int i = 0; i < 300; i++)
        exchange(link, &traffic);
    take_the_rest(link, &traffic);
    assert_int_equal(traffic.answered, traffic.sent);
    assert_int_equal(status_of(link).path, LINK_CONTROL);
    link_destroy(&link);
}

#define WITH_SERVER(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)

int main(void) {
    const struct CMUnitTest tests[] = {
        WITH_SERVER(a_link_says_who_it_is_and_what_it_has),
        WITH_SERVER(a_link_tells_of_the_session_when_it_changed),
        WITH_SERVER(the_newest_attempt_is_kept),
        WITH_SERVER(both_ends_know_the_offset_of_the_clocks),
        WITH_SERVER(no_frame_leaves_before_the_clock_is_known),
        WITH_SERVER(both_sides_ping_little_until_a_frame_ends_the_rest),
        WITH_SERVER(every_frame_is_answered_once_in_the_control_connection),
        WITH_SERVER(a_link_comes_back_when_the_server_does),
        WITH_SERVER(what_the_server_refuses_is_kept),
        WITH_SERVER(a_link_trusts_only_its_authority),
        WITH_SERVER(a_certificate_of_another_authority_is_refused_and_the_link_goes_on_trying),
        WITH_SERVER(a_challenge_in_the_control_connection_gets_no_answer),
        WITH_SERVER(a_missing_key_is_named),
        WITH_SERVER(datagrams_are_taken_left_and_taken_again_as_they_pass),
        WITH_SERVER(a_challenge_in_a_reply_is_sent_back_in_the_control_connection),
        WITH_SERVER(a_frame_that_left_by_datagram_is_called_sent),
        WITH_SERVER(a_new_epoch_loses_no_frame),
        WITH_SERVER(where_no_datagram_is_answered_frames_stay_in_the_control_connection),
        WITH_SERVER(a_closed_port_is_no_worse_than_a_silent_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
