// What a client of a server of OpenIGTLink gets, without sockets: bytes in, bytes out.

#include "base/clock.h"
#include "igtl/client.h"
#include "igtl_bytes.h"
#include "random.h"
#include "test.h"

#include <string.h>

static struct served served;
static struct igtl_client *client;
static int64_t now_ns;

static int begin(void **state) {
    (void)state;
    memset(&served, 0, sizeof served);
    strcpy(served.device, "Arthron");
    now_ns = 1000 * NS_PER_S;
    client = igtl_client_create(&served, 1);
    return 0;
}

static int end(void **state) {
    (void)state;
    igtl_client_destroy(&client);
    served_fini(&served);
    return 0;
}

// ---- what is served -----------------------------------------------------------------------------

static struct igtl_pose named(const char *name, enum validity validity, double x) {
    struct igtl_pose p = {
        .validity = validity, .utc_ns = 1700000000 * NS_PER_S, .T_world_body = pose_identity()};
    strcpy(p.name, name);
    p.T_world_body.translation.x = x;
    return p;
}

// Its number is the probe's x.
static void put_set(double x) {
    struct igtl_poses set = {.utc_ns = 1700000001 * NS_PER_S, .count = 4};
    set.poses[0] = named("tibia", VALIDITY_OK, 7);
    set.poses[1] = named("probe", VALIDITY_OK, x);
    set.poses[2] = named("knife", VALIDITY_LOST, 3);
    set.poses[3] = named("probe_warped", VALIDITY_HELD, x + 0.5);
    served_put_poses(&served, &set, now_ns);
}

static void put_string(const char *text) {
    struct served_string string = {.utc_ns = 5};
    strcpy(string.device, "events");
    strcpy(string.text, text);
    served_put_string(&served, &string);
}

static void put_state(int code, const char *text) {
    struct igtl_state state = {.code = code};
    strcpy(state.text, text);
    served_put_state(&served, &state);
}

static void put_mesh(int place, const char *name, size_t size, int fill) {
    char whole[IGTL_DEVICE_SIZE] = "";
    struct served_bytes *content = served_bytes_create(size);
    strcpy(whole, name);
    memset(content->bytes, fill, size);
    served_put_mesh(&served, place, whole, 9 * NS_PER_S, content);
}

// ---- what the client says and gets --------------------------------------------------------------

static void say(int version, const char *type, const char *device, const void *body, size_t size) {
    struct igtl_head head = {.version = version, .type = type, .device = device};
    struct error err;
    uint8_t bytes[1024];
    if (size)
        memcpy(bytes + igtl_message_content(version), body, size);
    assert_ok(igtl_client_hear(client, bytes, igtl_message_finish(&head, size, bytes), &err));
}

static void ask(int version, const char *type, const char *device) {
    say(version, type, device, NULL, 0);
}

static void start(const char *type, int interval_ms) {
    uint8_t body[IGTL_START_SIZE];
    say(1, type, "", body, igtl_write_start(interval_ms, "", body));
}

struct got {
    int count;
    struct one {
        int version;
        char type[IGTL_TYPE_SIZE], device[IGTL_DEVICE_SIZE];
        int64_t stamp_ns;
        size_t size;
        uint8_t content[4096]; // its start
    } of[2000];
};

static struct got got;

static void take_frame(const struct igtl_frame *frame) {
    struct igtl_content content;
    struct error err;
    struct one *one = &got.of[got.count++];
    assert_true(frame->intact && frame->known);
    assert_ok(igtl_frame_content(frame, &content, &err));
    *one = (struct one){
        .version = frame->version, .stamp_ns = igtl_stamp_ns(frame->stamp), .size = content.size};
    strcpy(one->type, frame->type);
    strcpy(one->device, frame->device);
    memcpy(one->content, content.bytes,
           content.size < sizeof one->content ? content.size : sizeof one->content);
}

static struct igtl_framing framing;

static void take_bytes(const uint8_t *bytes, size_t size) {
    while (size) {
        enum igtl_framing_event event;
        struct igtl_frame frame;
        struct error err;
        size_t taken = igtl_framing_feed(&framing, bytes, size, &event, &frame, &err);
        assert_int_not_equal(IGTL_FRAMING_BROKEN, event);
        if (event == IGTL_FRAMING_MESSAGE)
            take_frame(&frame);
        bytes += taken;
        size -= taken;
    }
}

// So many writes, at most; then the connection takes no more.
static void give(int writes) {
    const uint8_t *bytes;
    got.count = 0;
    for (int i = 0; i < writes; i++) {
        size_t size = igtl_client_next(client, now_ns, &bytes);
        if (!size) {
            assert_false(igtl_client_waits(client));
            return;
        }
        take_bytes(bytes, size);
    }
    igtl_client_choked(client);
}

static void give_all(void) {
    give(1 << 20);
}

static void assert_got(int i, const char *type, const char *device) {
    assert_true(i < got.count);
    assert_string_equal(type, got.of[i].type);
    assert_string_equal(device, got.of[i].device);
}

// Of a TRANSFORM.
static double x_of(int i) {
    return float_at(got.of[i].content + 36);
}

// ---- tests --------------------------------------------------------------------------------------

static void a_client_that_says_nothing_gets_what_is_there_and_what_comes(void **state) {
    put_state(1, "running");
    put_set(1);
    put_mesh(0, "meniscus", 100, 1);
    (void)state;
    igtl_client_destroy(&client);
    put_string("before");
    client = igtl_client_create(&served, 2);
    put_string("after");
    give_all();
    assert_int_equal(6, got.count);
    assert_got(0, "STATUS", "Arthron");
    assert_got(1, "STRING", "events");
    assert_memory_equal("after", got.of[1].content + 4, 5);
    assert_got(2, "TRANSFORM", "tibia");
    assert_got(3, "TRANSFORM", "probe");
    assert_got(4, "TRANSFORM", "probe_warped");
    assert_got(5, "POLYDATA", "meniscus");
    for (int i = 0; i < 6; i++)
        assert_int_equal(1, got.of[i].version);
    assert_int_equal(1700000000 * NS_PER_S, got.of[3].stamp_ns);
    assert_near(1, x_of(3), 0);
    give_all();
    assert_int_equal(0, got.count);
}

static void answers_come_in_the_highest_version_that_the_client_has_sent(void **state) {
    (void)state;
    static const int rows[][2] = {{1, 1}, {2, 2}, {1, 2}, {3, 3}, {9, 3}, {0, 3}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        ask(rows[i][0], "GET_STATUS", "");
        put_set(2);
        give_all();
        assert_int_equal(rows[i][0] >= 1 && rows[i][0] <= 3 ? 4 : 3, got.count);
        for (int k = 0; k < got.count; k++)
            assert_int_equal(rows[i][1], got.of[k].version);
    }
}

// Behind the content: its count, key and value lengths, then the texts.
static void held_poses_say_so_from_version_2_on(void **state) {
    (void)state;
    const uint8_t *bytes;
    ask(2, "GET_STATUS", "");
    give_all();
    put_set(1);
    size_t size = igtl_client_next(client, now_ns, &bytes);
    static const char ok[] = "TransformStatusOK", held[] = "TransformStatusMISSING";
    size_t first = (size - (strlen(held) - strlen(ok))) / 3; // three messages, the last one longer
    assert_memory_equal(ok, bytes + first - strlen(ok), strlen(ok));
    assert_memory_equal(held, bytes + size - strlen(held), strlen(held));
    take_bytes(bytes, size);
}

static void started_tracking_data_take_the_place_of_transforms_until_it_is_stopped(void **state) {
    (void)state;
    static const struct {
        const char *start, *stop, *ready, *type;
        size_t size;
    } rows[] = {{"STT_TDATA", "STP_TDATA", "RTS_TDATA", "TDATA", IGTL_TDATA_SIZE},
                {"STT_QTDATA", "STP_QTDATA", "RTS_QTDATA", "QTDATA", IGTL_QTDATA_SIZE}};
    for (size_t i = 0; i < 2; i++) {
        start(rows[i].start, 0);
        put_set(3);
        give_all();
        assert_int_equal(2, got.count);
        assert_got(0, rows[i].ready, "Arthron");
        assert_int_equal(0, got.of[0].content[0]);
        assert_got(1, rows[i].type, "Arthron");
        assert_int_equal(3 * rows[i].size, got.of[1].size);
        assert_string_equal("tibia", (char *)got.of[1].content);
        assert_string_equal("probe", (char *)got.of[1].content + rows[i].size);
        assert_int_equal(1700000001 * NS_PER_S, got.of[1].stamp_ns);
        ask(1, rows[i].stop, "");
        put_set(4);
        give_all();
        assert_got(0, rows[i].ready, "Arthron");
        assert_got(1, "TRANSFORM", "tibia");
    }
}

static void a_get_brings_one_message_or_that_there_is_none(void **state) {
    (void)state;
    ask(1, "GET_TRANS", "probe");
    give_all();
    assert_int_equal(1, got.count);
    assert_got(0, "STATUS", "probe");
    assert_int_equal(4, got.of[0].content[1]);
    put_set(5);
    put_mesh(2, "meniscus", 60, 1);
    give_all();
    ask(1, "GET_TRANS", "probe");
    ask(1, "GET_TRANS", "knife"); // lost
    ask(1, "GET_TDATA", "");
    ask(1, "GET_QTDATA", "");
    ask(1, "GET_CAPABIL", "");
    ask(1, "GET_POLYDATA", "nothing");
    ask(1, "GET_POLYDATA", "meniscus");
    give_all();
    assert_int_equal(7, got.count);
    assert_got(0, "TRANSFORM", "probe");
    assert_got(1, "STATUS", "knife");
    assert_got(2, "TDATA", "Arthron");
    assert_got(3, "QTDATA", "Arthron");
    assert_got(4, "CAPABILITY", "Arthron");
    assert_got(5, "RTS_POLYDATA", "Arthron");
    assert_int_equal(1, got.of[5].content[0]);
    assert_got(6, "POLYDATA", "meniscus");
}

static void an_interval_is_kept_and_a_rate_that_only_jitters_loses_nothing(void **state) {
    (void)state;
    struct random random = {5};
    const int64_t first_ns = now_ns;
    int at_60_hz = 0, at_200_hz = 0;
    start("STT_TDATA", 16);
    give_all();
    for (int i = 0; i < 600; i++) {
        now_ns = first_ns + i * NS_PER_S / 60 + (int64_t)random_between(&random, 0, 3e6);
        put_set(i);
        give_all();
        at_60_hz += got.count;
    }
    assert_int_equal(600, at_60_hz);
    start("STT_TDATA", 50);
    give_all();
    for (int i = 0; i < 2000; i++) {
        now_ns = first_ns + 20 * NS_PER_S + i * NS_PER_S / 200;
        put_set(i);
        give_all();
        at_200_hz += got.count;
    }
    assert_near(200, at_200_hz, 1);
}

// The server's thread may be late: what the connection takes is not skipped.
static void a_client_that_reads_gets_every_set_however_late_the_server_is(void **state) {
    (void)state;
    for (int i = 0; i < SERVED_SETS; i++, now_ns += NS_PER_S / 60)
        put_set(i);
    now_ns += 10 * NS_PER_S;
    give_all();
    assert_int_equal(3 * SERVED_SETS, got.count);
    for (int i = 0; i < SERVED_SETS; i++)
        assert_near(i, x_of(3 * i + 1), 0);
}

static void a_client_that_does_not_read_skips_to_the_newest_set(void **state) {
    (void)state;
    put_set(0);
    put_set(1);
    give(1);
    for (int i = 2; i < 50; i++, now_ns += NS_PER_S / 60)
        put_set(i);
    give_all();
    assert_int_equal(3, got.count);
    assert_near(49, x_of(1), 0);
    put_set(50); // it keeps up again
    put_set(51);
    now_ns += NS_PER_S;
    give_all();
    assert_int_equal(6, got.count);
    for (int i = 0; i < 10 * SERVED_SETS; i++)
        put_set(i);
    give_all();
    assert_near(10 * SERVED_SETS - 1, x_of(1), 0);
}

// A hiccup shorter than a quarter of a second loses nothing.
static void a_connection_that_is_full_for_a_moment_loses_no_set(void **state) {
    (void)state;
    put_set(0);
    put_set(1);
    give(1);
    for (int i = 2; i < 12; i++, now_ns += NS_PER_S / 60)
        put_set(i);
    give_all();
    assert_int_equal(3 * 11, got.count);
}

static void of_a_mesh_the_newest_is_sent_and_a_begun_one_ends_first(void **state) {
    (void)state;
    enum { SIZE = 50000 };
    put_mesh(0, "meniscus", SIZE, 1);
    give(1);
    assert_int_equal(0, got.count); // its first piece
    put_mesh(0, "meniscus", SIZE, 2);
    put_mesh(0, "meniscus", SIZE, 3);
    put_mesh(0, "meniscus", SIZE, 4);
    give_all();
    assert_int_equal(2, got.count);
    assert_int_equal(1, got.of[0].content[0]);
    assert_int_equal(4, got.of[1].content[0]);
    assert_int_equal(SIZE, got.of[1].size);
}

static void sets_and_meshes_take_turns(void **state) {
    (void)state;
    int meshes = 0, sets = 0;
    for (int i = 0; i < 40; i++, now_ns += NS_PER_S) {
        put_set(i);
        put_mesh(0, "meniscus", 100, i);
        give(1);
        for (int k = 0; k < got.count; k++)
            meshes += !strcmp(got.of[k].type, "POLYDATA"),
                sets += !strcmp(got.of[k].device, "probe");
    }
    assert_true(meshes >= 15 && sets >= 15);
}

static void a_status_is_sent_when_it_changes(void **state) {
    (void)state;
    put_state(1, "running");
    put_state(1, "running");
    give_all();
    assert_int_equal(1, got.count);
    put_state(1, "running");
    give_all();
    assert_int_equal(0, got.count);
    put_state(13, "paused");
    give_all();
    assert_int_equal(1, got.count);
    assert_int_equal(13, got.of[0].content[1]);
    assert_string_equal("paused", (char *)got.of[0].content + 30);
}

static void who_lets_too_many_strings_wait_is_full(void **state) {
    (void)state;
    for (int i = 0; i < IGTL_STRINGS_MAX - 1; i++)
        put_string("x");
    assert_false(igtl_client_is_full(client));
    give_all();
    assert_int_equal(IGTL_STRINGS_MAX - 1, got.count);
    for (int i = 0; i < IGTL_STRINGS_MAX; i++)
        put_string("x");
    assert_true(igtl_client_is_full(client));
}

static void who_asks_and_does_not_read_is_dropped(void **state) {
    (void)state;
    struct igtl_head head = {.version = 1, .type = "GET_STATUS", .device = ""};
    struct error err = {0};
    uint8_t bytes[64];
    size_t size = igtl_message_finish(&head, 0, bytes);
    for (int i = 0; i < IGTL_CLIENT_QUERIES_MAX; i++)
        assert_ok(igtl_client_hear(client, bytes, size, &err));
    assert_int_equal(RESULT_LIMIT, igtl_client_hear(client, bytes, size, &err));
    assert_true(err.text[0]);
}

// ---- malformed requests -------------------------------------------------------------------------

static const struct {
    int version;
    const char *type;
    size_t size;
    bool spoiled; // its checksum
    const char *answer;
} malformed[] = {
    {1, "STT_TDATA", 35, false, "RTS_TDATA"},
    {1, "STT_TDATA", 37, false, "RTS_TDATA"},
    {1, "STT_QTDATA", 1, false, "RTS_QTDATA"},
    {1, "STT_TDATA", 36, true, "RTS_TDATA"},
    {1, "GET_TRANS", 5, true, NULL},
    {1, "GET_STATUS", 200, true, NULL},
    {1, "NONSENSE", 20, false, NULL},
    {1, "NONSENSE", 20, true, NULL},
    {1, "", 0, false, NULL},
    {1, "TRANSFORM", 48, false, NULL},
    {7, "STT_TDATA", 36, false, NULL},
    {0, "GET_STATUS", 0, false, NULL},
};

static void malformed_requests_are_refused_and_the_next_one_is_answered(void **state) {
    (void)state;
    static const uint8_t zeros[200];
    for (size_t i = 0; i < sizeof malformed / sizeof *malformed; i++) {
        struct igtl_head head = {
            .version = malformed[i].version, .type = malformed[i].type, .device = "x"};
        struct error err;
        uint8_t bytes[512];
        memcpy(bytes + igtl_message_content(head.version), zeros, malformed[i].size);
        size_t size = igtl_message_finish(&head, malformed[i].size, bytes);
        bytes[size - 1] ^= malformed[i].spoiled;
        assert_ok(igtl_client_hear(client, bytes, size, &err));
        ask(1, "GET_CAPABIL", "");
        give_all();
        assert_int_equal(malformed[i].answer ? 2 : 1, got.count);
        assert_got(got.count - 1, "CAPABILITY", "Arthron");
        if (!malformed[i].answer)
            continue;
        assert_got(0, malformed[i].answer, "Arthron");
        assert_int_equal(1, got.of[0].content[0]);
    }
    put_set(1); // nothing was started
    give_all();
    assert_got(0, "TRANSFORM", "tibia");
}

static void an_absurd_length_ends_the_connection(void **state) {
    (void)state;
    struct igtl_head head = {.version = 1, .type = "GET_STATUS", .device = ""};
    struct error err = {0};
    uint8_t bytes[64];
    size_t size = igtl_message_finish(&head, 0, bytes);
    memset(bytes + 42, 0xff, 8);
    assert_int_equal(RESULT_LIMIT, igtl_client_hear(client, bytes, size, &err));
    assert_true(err.text[0]);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(a_client_that_says_nothing_gets_what_is_there_and_what_comes),
        TEST(answers_come_in_the_highest_version_that_the_client_has_sent),
        TEST(held_poses_say_so_from_version_2_on),
        TEST(started_tracking_data_take_the_place_of_transforms_until_it_is_stopped),
        TEST(a_get_brings_one_message_or_that_there_is_none),
        TEST(an_interval_is_kept_and_a_rate_that_only_jitters_loses_nothing),
        TEST(a_client_that_reads_gets_every_set_however_late_the_server_is),
        TEST(a_client_that_does_not_read_skips_to_the_newest_set),
        TEST(a_connection_that_is_full_for_a_moment_loses_no_set),
        TEST(of_a_mesh_the_newest_is_sent_and_a_begun_one_ends_first),
        TEST(sets_and_meshes_take_turns),
        TEST(a_status_is_sent_when_it_changes),
        TEST(who_lets_too_many_strings_wait_is_full),
        TEST(who_asks_and_does_not_read_is_dropped),
        TEST(malformed_requests_are_refused_and_the_next_one_is_answered),
        TEST(an_absurd_length_ends_the_connection),
    };
    return cmocka_run_group_tests_name("igtl_client", tests, NULL, NULL);
}
