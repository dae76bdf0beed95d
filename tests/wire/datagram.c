// The datagram endpoint against stations with real sockets on loopback.
#include "net/datagram.h"

#include "base/clock.h"
#include "test.h"

#include <arpa/inet.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define QUIET_MS 20 // a datagram on loopback is there at once
#define PLACES 8

// ---- a station ----------------------------------------------------------------------------------

struct station {
    int fd;
    uint32_t connection;
    struct seal *to_server, *to_station;
};

static int open_socket(int port) {
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(connect(fd, (struct sockaddr *)&to, sizeof to), 0);
    return fd;
}

static void take_keys(struct station *s, const arthron_UdpKeys *keys) {
    seal_destroy(&s->to_server);
    seal_destroy(&s->to_station);
    uint8_t epoch = (uint8_t)keys->epoch;
    s->connection = keys->connection;
    s->to_server = seal_create(SEAL_TO_SERVER, epoch, keys->connection, keys->key_to_server,
                               keys->iv_to_server);
    s->to_station = seal_create(SEAL_TO_STATION, epoch, keys->connection, keys->key_to_station,
                                keys->iv_to_station);
}

static int owner; // of every connection

static struct station open_station(struct datagram_endpoint *endpoint, uint32_t connection) {
    struct station s = {.fd = open_socket(datagram_port(endpoint))};
    arthron_UdpKeys keys;
    datagram_new_epoch(endpoint, connection, &owner, clock_now_ns(), &keys);
    assert_int_equal(keys.port, datagram_port(endpoint));
    take_keys(&s, &keys);
    return s;
}

static void close_station(struct station *s) {
    seal_destroy(&s->to_server);
    seal_destroy(&s->to_station);
    close(s->fd);
}

static arthron_Frame probe_frame(uint64_t number) {
    arthron_Frame frame = {.number = number, .samples_count = 1};
    frame.samples[0].channel = CHANNEL_PROBE;
    frame.samples[0].which_value = arthron_Sample_pose_tag;
    frame.samples[0].value.pose.qw = 1;
    return frame;
}

static size_t seal_frame(struct station *s, uint64_t number, uint8_t *out_datagram) {
    uint8_t message[WIRE_DATAGRAM_MAX];
    size_t size;
    arthron_Frame frame = probe_frame(number);
    wire_frame_pad(&frame);
    assert_int_equal(wire_encode_frame(&frame, message, sizeof message, &size), RESULT_OK);
    return seal_seal(s->to_server, message, size, out_datagram);
}

static void send_bytes(int fd, const void *bytes, size_t size) {
    assert_int_equal(send(fd, bytes, size, 0), size);
}

static void send_frame(struct station *s, uint64_t number) {
    uint8_t datagram[WIRE_DATAGRAM_MAX];
    send_bytes(s->fd, datagram, seal_frame(s, number, datagram));
}

static bool hears(int fd) {
    return poll(&(struct pollfd){.fd = fd, .events = POLLIN}, 1, QUIET_MS) == 1;
}

// The number of the frame that was answered, 0 for silence.
static arthron_Reply hear_whole_reply(struct station *s) {
    if (!hears(s->fd))
        return (arthron_Reply){0};
    uint8_t datagram[2048], message[2048];
    ssize_t got = recv(s->fd, datagram, sizeof datagram, 0);
    size_t size;
    uint64_t sequence;
    arthron_Reply reply;
    assert_true(got > 0);
    assert_true(seal_open(s->to_station, datagram, (size_t)got, message, &size, &sequence));
    assert_int_equal(wire_decode_reply(message, size, &reply, NULL), RESULT_OK);
    return reply;
}

static uint64_t hear_reply(struct station *s) {
    return hear_whole_reply(s).frame_number;
}

// ---- the server's side --------------------------------------------------------------------------

static struct datagram_endpoint *open_endpoint(void) {
    struct datagram_endpoint *endpoint = NULL;
    struct error err = {""};
    assert_int_equal(datagram_create("127.0.0.1", 0, PLACES, &endpoint, &err), RESULT_OK);
    return endpoint;
}

static struct datagram_in frames[DATAGRAM_BATCH];

static int receive(struct datagram_endpoint *endpoint) {
    poll(&(struct pollfd){.fd = datagram_fd(endpoint), .events = POLLIN}, 1, QUIET_MS);
    return datagram_receive(endpoint, frames);
}

// The shortest reply, or the longest that a frame with one probe can have.
static arthron_Reply reply_to(uint64_t number, bool long_one) {
    arthron_Reply reply = {.frame_number = number};
    if (!long_one)
        return reply;
    reply.events = 1;
    reply.frame_time_ns = 1;
    reply.state = arthron_SessionState_RUNNING;
    reply.instruments_count = 1;
    arthron_WarpedInstrument *w = &reply.instruments[0];
    w->channel = CHANNEL_PROBE;
    w->has_pose = w->has_lead = true;
    w->pose = (arthron_Pose){0.5, 0.5, 0.5, 0.5, 1, 2, 3};
    w->lead = (arthron_Lead){.v_count = 3, .v = {1, 2, 3}, .slope_count = 9};
    return reply;
}

static bool answer(struct datagram_endpoint *endpoint, uint32_t connection, uint64_t number) {
    arthron_Reply reply = reply_to(number, true);
    bool queued = datagram_reply(endpoint, connection, &reply);
    datagram_flush(endpoint);
    return queued;
}

// One frame there and its reply back.
static bool passes(struct datagram_endpoint *endpoint, struct station *s, uint64_t number) {
    send_frame(s, number);
    return receive(endpoint) == 1 && answer(endpoint, s->connection, number) &&
           hear_reply(s) == number;
}

// ---- there and back -----------------------------------------------------------------------------

static void a_frame_comes_in_and_its_reply_goes_back(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    send_frame(&s, 1);
    assert_int_equal(receive(endpoint), 1);
    assert_int_equal(frames[0].connection, 77);
    assert_ptr_equal(frames[0].user, &owner);
    assert_int_equal(frames[0].frame.number, 1);
    assert_true(answer(endpoint, 77, 1));
    assert_int_equal(hear_reply(&s), 1);
    struct datagram_counts counts = datagram_counts(endpoint);
    assert_true(counts.received == 1 && counts.opened == 1 && counts.sent == 1);
    assert_int_equal(receive(endpoint), 0);
    close_station(&s);
    datagram_destroy(&endpoint);
    assert_null(endpoint);
}

static void a_hundred_frames_of_three_stations_come_in_batches(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s[3];
    for (uint32_t i = 0; i < 3; i++)
        s[i] = open_station(endpoint, 100 + i);
    for (uint64_t n = 1; n <= 100; n++)
        send_frame(&s[n % 3], n);
    uint64_t expected = 1;
    for (int got; (got = receive(endpoint)) > 0;)
        for (int i = 0; i < got; i++, expected++) {
            assert_int_equal(frames[i].frame.number, expected);
            assert_int_equal(frames[i].connection, 100 + expected % 3);
            arthron_Reply reply = reply_to(expected, false);
            assert_true(datagram_reply(endpoint, frames[i].connection, &reply));
            if (i == got - 1)
                datagram_flush(endpoint);
        }
    assert_int_equal(expected, 101);
    for (uint64_t n = 1; n <= 100; n++)
        assert_int_equal(hear_reply(&s[n % 3]), n);
    for (int i = 0; i < 3; i++)
        close_station(&s[i]);
    datagram_destroy(&endpoint);
}

static void a_port_in_use_is_named(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint(), *second = NULL;
    struct error err = {""};
    char port[16];
    snprintf(port, sizeof port, "%d", datagram_port(endpoint));
    assert_int_equal(datagram_create("127.0.0.1", datagram_port(endpoint), PLACES, &second, &err),
                     RESULT_IO);
    assert_non_null(strstr(err.text, port));
    assert_non_null(strstr(err.text, "127.0.0.1"));
    datagram_destroy(&endpoint);
}

static void an_endpoint_on_all_addresses_answers_ipv4(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = NULL;
    assert_int_equal(datagram_create(NULL, 0, PLACES, &endpoint, NULL), RESULT_OK);
    struct station s = open_station(endpoint, 1);
    assert_true(passes(endpoint, &s, 1));
    close_station(&s);
    datagram_destroy(&endpoint);
}

// ---- strangers ----------------------------------------------------------------------------------

static void strangers_get_silence_and_a_count(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    uint8_t good[WIRE_DATAGRAM_MAX], changed[2048] = {0};
    size_t size = seal_frame(&s, 1, good);
    // Byte of the header that is changed, and what to.
    static const struct {
        int byte;
        uint8_t value;
    } rows[] = {{0, 2}, {0, 0}, {1, SEAL_TO_STATION}, {1, 3}, {2, 1}, {3, 1}, {4, 9}, {7, 78}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        memcpy(changed, good, size);
        changed[rows[i].byte] = rows[i].value;
        send_bytes(s.fd, changed, size);
    }
    send_bytes(s.fd, "", 0);
    send_bytes(s.fd, "GET / HTTP/1.1\r\n\r\n", 18);
    send_bytes(s.fd, good, SEAL_OVERHEAD - 1);
    memcpy(changed, good, size);
    send_bytes(s.fd, changed, WIRE_DATAGRAM_MAX + 1);
    assert_int_equal(receive(endpoint), 0);
    datagram_flush(endpoint);
    assert_int_equal(datagram_counts(endpoint).strangers, 12);
    assert_int_equal(datagram_counts(endpoint).sent, 0);
    assert_false(hears(s.fd));
    assert_true(passes(endpoint, &s, 2));
    close_station(&s);
    datagram_destroy(&endpoint);
}

static void forged_and_replayed_and_malformed_datagrams_are_told_apart(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    uint8_t datagram[WIRE_DATAGRAM_MAX];
    size_t size = seal_frame(&s, 1, datagram);
    datagram[size - 1] ^= 1;
    send_bytes(s.fd, datagram, size);
    datagram[size - 1] ^= 1;
    send_bytes(s.fd, datagram, size);
    send_bytes(s.fd, datagram, size);
    size = seal_seal(s.to_server, (const uint8_t *)"\x1a\x09", 2, datagram);
    send_bytes(s.fd, datagram, size);
    assert_int_equal(receive(endpoint), 1);
    struct datagram_counts counts = datagram_counts(endpoint);
    assert_true(counts.forged == 1 && counts.replayed == 1 && counts.malformed == 1);
    assert_true(counts.received == 4 && counts.opened == 2 && counts.strangers == 0);
    datagram_flush(endpoint);
    assert_false(hears(s.fd));
    close_station(&s);
    datagram_destroy(&endpoint);
}

static void a_connection_that_was_forgotten_is_a_stranger(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    assert_true(passes(endpoint, &s, 1));
    datagram_forget(endpoint, 77);
    datagram_forget(endpoint, 78);
    send_frame(&s, 2);
    assert_int_equal(receive(endpoint), 0);
    assert_int_equal(datagram_counts(endpoint).strangers, 1);
    assert_false(answer(endpoint, 77, 2));
    close_station(&s);
    datagram_destroy(&endpoint);
}

// ---- amplification ------------------------------------------------------------------------------

static void a_reply_answers_one_frame_once(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    send_frame(&s, 5);
    assert_int_equal(receive(endpoint), 1);
    assert_false(answer(endpoint, 77, 4));
    assert_false(answer(endpoint, 78, 5));
    assert_true(answer(endpoint, 77, 5));
    assert_false(answer(endpoint, 77, 5));
    assert_int_equal(hear_reply(&s), 5);
    assert_false(hears(s.fd));
    close_station(&s);
    datagram_destroy(&endpoint);
}

// A frame whose message takes just `wanted` bytes.
static void send_frame_of(struct station *s, uint64_t number, size_t wanted) {
    uint8_t message[WIRE_DATAGRAM_MAX], datagram[WIRE_DATAGRAM_MAX];
    arthron_Frame frame = {.number = number};
    size_t size = 0;
    for (frame.padding.size = 1; size < wanted; frame.padding.size++)
        wire_encode_frame(&frame, message, sizeof message, &size);
    assert_int_equal(size, wanted);
    send_bytes(s->fd, datagram, seal_seal(s->to_server, message, size, datagram));
}

static void a_reply_longer_than_its_frame_is_not_sent(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    arthron_Reply reply = reply_to(1, true);
    uint8_t message[WIRE_DATAGRAM_MAX];
    size_t size;
    wire_encode_reply(&reply, message, sizeof message, &size);
    send_frame_of(&s, 1, size - 1);
    assert_int_equal(receive(endpoint), 1);
    assert_false(answer(endpoint, 77, 1));
    assert_int_equal(datagram_counts(endpoint).too_long, 1);
    send_frame_of(&s, 2, size);
    assert_int_equal(receive(endpoint), 1);
    assert_true(answer(endpoint, 77, 2));
    assert_int_equal(hear_reply(&s), 2);
    close_station(&s);
    datagram_destroy(&endpoint);
}

static void a_reply_gives_up_its_counts_before_it_is_too_long(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    arthron_Reply reply = reply_to(1, true);
    uint8_t message[WIRE_DATAGRAM_MAX];
    size_t without, with;
    for (int i = 0; i < WIRE_REPLY_LOOSE; i++)
        reply.loose[i] = (arthron_CarriedLoose){.number = (uint8_t)(i + 1),
                                                .state = arthron_LooseMoment_State_OUT};
    reply.loose_count = 1;
    wire_encode_reply(&reply, message, sizeof message, &without);
    reply.loose_count = WIRE_REPLY_LOOSE;
    reply.event_counts_count = 9;
    reply.event_counts[8] = 300;
    reply.has_frames_lost = true;
    reply.frames_lost = 70000;
    wire_encode_reply(&reply, message, sizeof message, &with);
    for (uint64_t number = 1; number <= 2; number++) {
        bool fits = number == 2;
        send_frame_of(&s, number, fits ? with : without);
        assert_int_equal(receive(endpoint), 1);
        reply.frame_number = number;
        assert_true(datagram_reply(endpoint, 77, &reply));
        datagram_flush(endpoint);
        arthron_Reply heard = hear_whole_reply(&s);
        assert_int_equal(heard.frame_number, number);
        assert_int_equal(heard.event_counts_count, fits ? 9 : 0);
        assert_true(!fits || heard.event_counts[8] == 300);
        assert_int_equal(heard.has_frames_lost, fits);
        assert_int_equal(heard.frames_lost, fits ? 70000 : 0);
        assert_int_equal(heard.loose_count, fits ? 2 : 1);
        assert_int_equal(heard.loose[0].number, 1);
    }
    assert_int_equal(datagram_counts(endpoint).too_long, 0);
    close_station(&s);
    datagram_destroy(&endpoint);
}

// ---- addresses ----------------------------------------------------------------------------------

static void confirm_first_address(struct datagram_endpoint *endpoint, struct station *s) {
    send_frame(s, 1);
    assert_int_equal(receive(endpoint), 1);
    assert_true(frames[0].path_challenge != 0);
    datagram_confirm(endpoint, s->connection, frames[0].path_challenge);
    send_frame(s, 2);
    assert_int_equal(receive(endpoint), 1);
    assert_true(frames[0].path_challenge == 0);
}

static void wait_for_next_challenge(void) {
    poll(NULL, 0, 110); // challenges keep a distance of 100 ms
}

static void replies_follow_the_station_to_a_new_address(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    confirm_first_address(endpoint, &s);
    wait_for_next_challenge();
    int old_fd = s.fd;
    s.fd = open_socket(datagram_port(endpoint));
    send_frame(&s, 3);
    assert_int_equal(receive(endpoint), 1);
    uint64_t challenge = frames[0].path_challenge;
    assert_true(challenge != 0);
    assert_true(answer(endpoint, 77, 3));
    assert_int_equal(hear_reply(&s), 3);
    assert_false(hears(old_fd));
    datagram_confirm(endpoint, 77, challenge);
    assert_true(passes(endpoint, &s, 4));
    assert_true(frames[0].path_challenge == 0);
    close(old_fd);
    close_station(&s);
    datagram_destroy(&endpoint);
}

// Fills the next frame so that its reply has room for a challenge.
static arthron_Reply hear_answer(struct datagram_endpoint *endpoint, struct station *s,
                                 uint64_t number) {
    arthron_Reply reply = {.frame_number = number};
    send_frame_of(s, number, 64);
    assert_int_equal(receive(endpoint), 1);
    assert_true(frames[0].path_challenge == 0); // nothing for the control connection
    assert_true(datagram_reply(endpoint, s->connection, &reply));
    datagram_flush(endpoint);
    return hear_whole_reply(s);
}

static void a_challenge_goes_to_the_address_that_it_is_about(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    datagram_challenge_in_replies(endpoint, 77);
    uint64_t first = hear_answer(endpoint, &s, 1).path_challenge;
    assert_true(first != 0);
    assert_true(hear_answer(endpoint, &s, 2).path_challenge == first); // the first may be lost
    datagram_confirm(endpoint, 77, first);
    assert_true(hear_answer(endpoint, &s, 3).path_challenge == 0);
    wait_for_next_challenge();
    int home = s.fd;
    s.fd = open_socket(datagram_port(endpoint));
    uint64_t second = hear_answer(endpoint, &s, 4).path_challenge;
    assert_true(second != 0 && second != first);
    assert_false(hears(home));
    datagram_confirm(endpoint, 77, first); // what is known of the other address is no proof
    assert_true(hear_answer(endpoint, &s, 5).path_challenge == second);
    datagram_confirm(endpoint, 77, second);
    assert_true(hear_answer(endpoint, &s, 6).path_challenge == 0);
    close(home);
    close_station(&s);
    datagram_destroy(&endpoint);
}

// What one frame from the station's present address is asked, in its reply or beside it.
static uint64_t hear_challenge(struct datagram_endpoint *endpoint, struct station *s,
                               uint64_t number) {
    arthron_Reply reply = {.frame_number = number};
    send_frame_of(s, number, 64);
    assert_int_equal(receive(endpoint), 1);
    assert_true(datagram_reply(endpoint, s->connection, &reply));
    datagram_flush(endpoint);
    return frames[0].path_challenge | hear_whole_reply(s).path_challenge;
}

// Challenges keep a distance: the third address gets none at once, nor that of the second.
static void a_challenge_confirms_the_address_that_it_was_about(void **state) {
    (void)state;
    for (int in_replies = 0; in_replies < 2; in_replies++) {
        struct datagram_endpoint *endpoint = open_endpoint();
        struct station s = open_station(endpoint, 77);
        int first = s.fd, second = open_socket(datagram_port(endpoint));
        if (in_replies)
            datagram_challenge_in_replies(endpoint, 77);
        datagram_confirm(endpoint, 77, hear_challenge(endpoint, &s, 1));
        wait_for_next_challenge();
        s.fd = second;
        uint64_t about_second = hear_challenge(endpoint, &s, 2);
        assert_true(about_second != 0);
        s.fd = open_socket(datagram_port(endpoint));
        assert_true(hear_challenge(endpoint, &s, 3) == 0);
        datagram_confirm(endpoint, 77, about_second);
        wait_for_next_challenge();
        uint64_t about_third = hear_challenge(endpoint, &s, 4);
        assert_true(about_third != 0 && about_third != about_second);
        close(first);
        close(second);
        close_station(&s);
        datagram_destroy(&endpoint);
    }
}

static void an_older_datagram_from_elsewhere_moves_nothing(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    confirm_first_address(endpoint, &s);
    wait_for_next_challenge();
    int thief = open_socket(datagram_port(endpoint));
    uint8_t held_back[WIRE_DATAGRAM_MAX];
    size_t size = seal_frame(&s, 3, held_back);
    assert_true(passes(endpoint, &s, 4));
    send_bytes(thief, held_back, size);
    assert_int_equal(receive(endpoint), 1);
    assert_true(frames[0].path_challenge == 0);
    assert_true(answer(endpoint, 77, 3));
    assert_int_equal(hear_reply(&s), 3);
    assert_false(hears(thief));
    close(thief);
    close_station(&s);
    datagram_destroy(&endpoint);
}

static void a_way_back_to_the_confirmed_address_needs_no_new_challenge(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    confirm_first_address(endpoint, &s);
    wait_for_next_challenge();
    int home = s.fd, elsewhere = open_socket(datagram_port(endpoint));
    s.fd = elsewhere;
    send_frame(&s, 3);
    assert_int_equal(receive(endpoint), 1);
    assert_true(frames[0].path_challenge != 0);
    wait_for_next_challenge();
    s.fd = home;
    assert_true(passes(endpoint, &s, 4));
    assert_true(frames[0].path_challenge == 0);
    close(elsewhere);
    close_station(&s);
    datagram_destroy(&endpoint);
}

static void an_address_never_confirmed_gets_a_limited_number_of_replies(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    uint64_t challenge = 0, number = 1;
    for (; number <= DATAGRAM_UNCONFIRMED_REPLIES; number++) {
        send_frame(&s, number);
        assert_int_equal(receive(endpoint), 1);
        challenge = frames[0].path_challenge ? frames[0].path_challenge : challenge;
        assert_true(answer(endpoint, 77, number));
        assert_int_equal(hear_reply(&s), number);
    }
    assert_false(passes(endpoint, &s, number++));
    wait_for_next_challenge();
    int home = s.fd;
    s.fd = open_socket(datagram_port(endpoint)); // another one has no replies of its own
    assert_false(passes(endpoint, &s, number++));
    challenge = frames[0].path_challenge;
    close(home);
    datagram_confirm(endpoint, 77, challenge ^ 1);
    datagram_confirm(endpoint, 77, 0);
    assert_false(passes(endpoint, &s, number++));
    datagram_confirm(endpoint, 77, challenge);
    for (int i = 0; i < DATAGRAM_UNCONFIRMED_REPLIES + 10; i++)
        assert_true(passes(endpoint, &s, number++));
    close_station(&s);
    datagram_destroy(&endpoint);
}

// ---- epochs -------------------------------------------------------------------------------------

static void the_old_epoch_is_good_until_and_after_the_new_one_is_used(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station old = open_station(endpoint, 77), new = {.fd = old.fd};
    assert_true(passes(endpoint, &old, 1));
    arthron_UdpKeys keys;
    datagram_new_epoch(endpoint, 77, NULL, clock_now_ns(), &keys);
    assert_int_equal(keys.epoch, 1);
    take_keys(&new, &keys);
    assert_true(passes(endpoint, &old, 2)); // answered in the epoch that the station knows
    uint8_t late[WIRE_DATAGRAM_MAX];
    size_t size = seal_frame(&old, 3, late);
    assert_true(passes(endpoint, &new, 4));
    send_bytes(old.fd, late, size);
    assert_int_equal(receive(endpoint), 1);
    assert_true(answer(endpoint, 77, 3));
    assert_int_equal(hear_reply(&new), 3);
    seal_destroy(&new.to_server);
    seal_destroy(&new.to_station);
    close_station(&old);
    datagram_destroy(&endpoint);
}

static void an_old_epoch_from_elsewhere_moves_nothing_once_the_new_one_is_used(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station old = open_station(endpoint, 77), new = {.fd = old.fd};
    uint8_t held_back[WIRE_DATAGRAM_MAX];
    size_t size = seal_frame(&old, 1, held_back);
    arthron_UdpKeys keys;
    datagram_new_epoch(endpoint, 77, NULL, clock_now_ns(), &keys);
    take_keys(&new, &keys);
    assert_true(passes(endpoint, &new, 2));
    int thief = open_socket(datagram_port(endpoint));
    send_bytes(thief, held_back, size);
    assert_int_equal(receive(endpoint), 1);
    assert_true(answer(endpoint, 77, 1));
    assert_int_equal(hear_reply(&new), 1);
    assert_false(hears(thief));
    close(thief);
    seal_destroy(&new.to_server);
    seal_destroy(&new.to_station);
    close_station(&old);
    datagram_destroy(&endpoint);
}

static void the_old_epoch_ends_after_five_seconds(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    arthron_UdpKeys keys;
    datagram_new_epoch(endpoint, 77, NULL, clock_now_ns() - 4 * NS_PER_S, &keys);
    assert_true(passes(endpoint, &s, 1));
    datagram_forget(endpoint, 77);
    close_station(&s);

    s = open_station(endpoint, 77);
    datagram_new_epoch(endpoint, 77, NULL, clock_now_ns() - 5 * NS_PER_S, &keys);
    assert_false(passes(endpoint, &s, 2));
    assert_int_equal(datagram_counts(endpoint).strangers, 1);
    take_keys(&s, &keys);
    assert_true(passes(endpoint, &s, 3));
    close_station(&s);
    datagram_destroy(&endpoint);
}

static void epochs_count_round_to_0_with_keys_of_their_own(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    struct station s = open_station(endpoint, 77);
    arthron_UdpKeys keys, before = {0};
    for (unsigned i = 1; i <= 300; i++) {
        datagram_new_epoch(endpoint, 77, NULL, clock_now_ns(), &keys);
        assert_int_equal(keys.epoch, i % 256);
        assert_memory_not_equal(keys.key_to_server, before.key_to_server, SEAL_KEY_SIZE);
        assert_memory_not_equal(keys.key_to_server, keys.key_to_station, SEAL_KEY_SIZE);
        assert_memory_not_equal(keys.iv_to_server, before.iv_to_server, SEAL_IV_SIZE);
        before = keys;
    }
    take_keys(&s, &keys);
    assert_true(passes(endpoint, &s, 1));
    close_station(&s);
    datagram_destroy(&endpoint);
}

static void an_epoch_is_old_after_an_hour(void **state) {
    (void)state;
    struct datagram_endpoint *endpoint = open_endpoint();
    arthron_UdpKeys keys;
    int64_t start = 5 * NS_PER_S, hour = 3600 * NS_PER_S;
    datagram_new_epoch(endpoint, 77, NULL, start, &keys);
    assert_false(datagram_epoch_is_old(endpoint, 77, start + hour - 1));
    assert_true(datagram_epoch_is_old(endpoint, 77, start + hour));
    datagram_destroy(&endpoint);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_frame_comes_in_and_its_reply_goes_back),
        cmocka_unit_test(a_hundred_frames_of_three_stations_come_in_batches),
        cmocka_unit_test(a_port_in_use_is_named),
        cmocka_unit_test(an_endpoint_on_all_addresses_answers_ipv4),
        cmocka_unit_test(strangers_get_silence_and_a_count),
        cmocka_unit_test(forged_and_replayed_and_malformed_datagrams_are_told_apart),
        cmocka_unit_test(a_connection_that_was_forgotten_is_a_stranger),
        cmocka_unit_test(a_reply_answers_one_frame_once),
        cmocka_unit_test(a_reply_longer_than_its_frame_is_not_sent),
        cmocka_unit_test(a_reply_gives_up_its_counts_before_it_is_too_long),
        cmocka_unit_test(replies_follow_the_station_to_a_new_address),
        cmocka_unit_test(a_challenge_goes_to_the_address_that_it_is_about),
        cmocka_unit_test(a_challenge_confirms_the_address_that_it_was_about),
        cmocka_unit_test(an_older_datagram_from_elsewhere_moves_nothing),
        cmocka_unit_test(a_way_back_to_the_confirmed_address_needs_no_new_challenge),
        cmocka_unit_test(an_address_never_confirmed_gets_a_limited_number_of_replies),
        cmocka_unit_test(the_old_epoch_is_good_until_and_after_the_new_one_is_used),
        cmocka_unit_test(an_old_epoch_from_elsewhere_moves_nothing_once_the_new_one_is_used),
        cmocka_unit_test(the_old_epoch_ends_after_five_seconds),
        cmocka_unit_test(epochs_count_round_to_0_with_keys_of_their_own),
        cmocka_unit_test(an_epoch_is_old_after_an_hour),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
