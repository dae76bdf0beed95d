// What a station serves by OpenIGTLink of what it shows: names, times, events, meshes.

#include "base/clock.h"
#include "igtl/framing.h"
#include "igtl/names.h"
#include "igtl_bytes.h"
#include "test.h"
#include "view/openigtlink.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static struct openigtlink *outlet;
static int fd;
static struct igtl_framing framing;
static arthron_SessionState state_now;

static int begin(void **state) {
    (void)state;
    const struct igtl_server_config config = {.port = 0};
    struct error err;
    state_now = arthron_SessionState_WAITING;
    assert_ok(openigtlink_create(&config, &outlet, &err));
    return 0;
}

static int end(void **state) {
    (void)state;
    close(fd);
    openigtlink_destroy(&outlet);
    assert_null(outlet);
    return 0;
}

// ---- a client -----------------------------------------------------------------------------------

static void wait_until_watched(bool watched) {
    for (int i = 0; i < 5000 && openigtlink_follow(outlet, state_now) != watched; i++)
        nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);
    assert_int_equal(watched, openigtlink_follow(outlet, state_now));
}

static void look(void) {
    struct timeval patience = {20, 0};
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons((uint16_t)openigtlink_port(outlet)),
                                  .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    assert_int_equal(0, connect(fd, (struct sockaddr *)&address, sizeof address));
    igtl_framing_init(&framing);
    wait_until_watched(true);
}

// The next message, whatever it is; its bytes are good until the next one.
static struct igtl_frame next(struct igtl_content *content) {
    enum igtl_framing_event event;
    struct igtl_frame frame;
    struct error err;
    uint8_t byte;
    do {
        assert_int_equal(1, recv(fd, &byte, 1, 0));
        assert_int_equal(1, igtl_framing_feed(&framing, &byte, 1, &event, &frame, &err));
    } while (event != IGTL_FRAMING_MESSAGE);
    assert_ok(igtl_frame_content(&frame, content, &err));
    return frame;
}

static struct igtl_frame next_of(const char *type, struct igtl_content *content) {
    for (;;) {
        struct igtl_frame frame = next(content);
        if (!strcmp(frame.type, type))
            return frame;
    }
}

// ---- what is shown ------------------------------------------------------------------------------

static arthron_Pose at(double x) {
    return (arthron_Pose){.qw = 1, .x = x};
}

// A tibia, and a probe that was measured 20 ms before.
static arthron_View shown(void) {
    arthron_View view = {.time_ns = clock_now_ns(), .state = arthron_SessionState_RUNNING};
    view.bodies_count = 1;
    view.bodies[0] = (arthron_ViewBody){.body = arthron_Body_BODY_TIBIA,
                                        .has_pose = true,
                                        .pose = at(1),
                                        .has_virtual_pose = true,
                                        .virtual_pose = at(2)};
    view.instruments_count = 2;
    view.instruments[0] = (arthron_ViewInstrument){.channel = CHANNEL_PROBE,
                                                   .time_ns = view.time_ns - 20 * NS_PER_MS,
                                                   .has_tip = true,
                                                   .tip = at(3),
                                                   .has_warped = true,
                                                   .warped = at(4)};
    view.instruments[1] = (arthron_ViewInstrument){.channel = CHANNEL_PUNCH,
                                                   .validity = arthron_Validity_LOST,
                                                   .warp_validity = arthron_Validity_LOST};
    return view;
}

static void poses_have_their_names_and_the_utc_of_their_measurement(void **state) {
    (void)state;
    static const struct {
        const char *name;
        double x;
        int age_ms;
    } rows[] = {
        {"tibia", 1, 0}, {"virtual_tibia", 2, 0}, {"probe", 3, 20}, {"probe_warped", 4, 20}};
    struct igtl_content content;
    look();
    arthron_View view = shown();
    int64_t ahead_ns = clock_utc_ns() - clock_now_ns(), first_ns = 0;
    openigtlink_show(outlet, &view);
    for (int i = 0; i < 4; i++) {
        struct igtl_frame frame = next_of("TRANSFORM", &content);
        int64_t stamp_ns = igtl_stamp_ns(frame.stamp) + rows[i].age_ms * NS_PER_MS;
        assert_string_equal(rows[i].name, frame.device);
        assert_near(rows[i].x, float_at(content.bytes + 36), 0);
        assert_near((double)(stamp_ns - view.time_ns - ahead_ns) / NS_PER_MS, 0, 500);
        first_ns = i ? first_ns : stamp_ns;
        assert_int_equal(first_ns, stamp_ns);
    }
}

static void assert_event(const char *want) {
    struct igtl_content content;
    struct igtl_frame frame = next_of("STRING", &content);
    assert_string_equal("events", frame.device);
    assert_int_equal(strlen(want), content.size - 4);
    assert_memory_equal(want, content.bytes + 4, content.size - 4);
}

static void events_are_told_from_when_somebody_watches(void **state) {
    (void)state;
    arthron_View view = shown();
    view.events[3] = 7; // contacts that nobody watched
    look();
    openigtlink_show(outlet, &view);
    view.events[3] = 9;
    view.events[5] = 1;
    openigtlink_show(outlet, &view);
    openigtlink_show(outlet, &view);
    view.events[0]++;
    view.state = arthron_SessionState_PAUSED;
    openigtlink_show(outlet, &view);
    assert_event("contact");
    assert_event("cut");
    assert_event("paused");
    close(fd);
    wait_until_watched(false);
    view.events[4]++; // a release that nobody watched
    look();
    openigtlink_show(outlet, &view);
    view.events[6]++;
    openigtlink_show(outlet, &view);
    assert_event("piece");
}

static void assert_string(const char *device, const char *begins) {
    struct igtl_content content;
    struct igtl_frame frame = next_of("STRING", &content);
    assert_string_equal(device, frame.device);
    assert_true(content.size - 4 >= strlen(begins));
    assert_memory_equal(begins, content.bytes + 4, strlen(begins));
}

// A client that comes later than it gets its figures, and what happens from then on.
static void an_attempt_is_told_from_when_somebody_watches(void **state) {
    (void)state;
    arthron_View view = shown();
    view.has_attempt = true;
    view.attempt = (arthron_ViewAttempt){.number = 1, .goals_count = 2, .errors_count = 1};
    strcpy(view.attempt.task, "centring");
    strcpy(view.attempt.goals[0].name, "one");
    strcpy(view.attempt.goals[1].name, "two");
    strcpy(view.attempt.errors[0].name, "bump");
    view.attempt.goals[0].has_met_ns = true;
    look();
    openigtlink_show(outlet, &view);
    view.attempt.goals[1].has_met_ns = true;
    view.attempt.errors[0].count = 1;
    openigtlink_show(outlet, &view);
    openigtlink_show(outlet, &view);
    view.attempt.end = arthron_AttemptState_End_DONE;
    view.attempt.verdict = arthron_AttemptState_Verdict_PASSED;
    openigtlink_show(outlet, &view);
    assert_string("progress", "{\"number\":1,\"task\":\"centring\"");
    assert_string("attempt", "goal two");
    assert_string("attempt", "error bump 1");
    assert_string("progress", "{");
    assert_string("attempt", "ended passed (done)");
}

static void a_marker_has_its_value_and_the_utc_of_its_measurement(void **state) {
    (void)state;
    struct marker marker = {.time_ns = clock_now_ns() - NS_PER_S, .value = 0.5, .name = "pulse"};
    struct igtl_content content;
    look();
    openigtlink_mark(outlet, &marker);
    int64_t want_ns = marker.time_ns + clock_utc_ns() - clock_now_ns();
    struct igtl_frame frame = next_of("STRING", &content);
    assert_string_equal("markers", frame.device);
    assert_memory_equal("pulse 0.5", content.bytes + 4, content.size - 4);
    assert_int_equal(9, content.size - 4);
    assert_near((double)(igtl_stamp_ns(frame.stamp) - want_ns) / NS_PER_MS, 0, 500);
}

static void the_state_is_a_status_when_it_changes(void **state) {
    (void)state;
    struct igtl_content content;
    look();
    next_of("STATUS", &content);
    assert_int_equal(13, content.bytes[1]);
    assert_string_equal("waiting", (const char *)content.bytes + 30);
    openigtlink_follow(outlet, arthron_SessionState_WAITING);
    openigtlink_follow(outlet, arthron_SessionState_RUNNING);
    next_of("STATUS", &content);
    assert_int_equal(1, content.bytes[1]);
    assert_string_equal("running", (const char *)content.bytes + 30);
}

// ---- meshes -------------------------------------------------------------------------------------

// Four vertices of six live, and two triangles of three.
static void what_is_dead_in_a_mesh_is_left_out(void **state) {
    (void)state;
    float positions[18];
    uint32_t uses[] = {0, 2, 2, 0, 1, 1};
    uint32_t corners[] = {1, 2, 4, 0, 0, 0, 2, 1, 5};
    static const uint32_t packed[2][3] = {{0, 1, 2}, {1, 0, 3}};
    static const int living[] = {1, 2, 4, 5};
    struct tissue tissue = {.number = 3,
                            .vertex_count = 4,
                            .triangle_count = 2,
                            .vertex_bound = 6,
                            .triangle_bound = 3,
                            .positions = positions,
                            .uses = uses,
                            .corners = corners};
    struct igtl_content content;
    for (int i = 0; i < 18; i++)
        positions[i] = (float)i;
    look();
    openigtlink_mesh(outlet, "meniscus_medial", &tissue);
    struct igtl_frame frame = next_of("POLYDATA", &content);
    assert_string_equal("meniscus_medial", frame.device);
    assert_int_equal(igtl_polydata_size(4, 2), content.size);
    assert_int_equal(4, number_at(content.bytes));
    for (int v = 0; v < 4; v++)
        for (int k = 0; k < 3; k++)
            assert_near(3 * living[v] + k, float_at(content.bytes + 40 + 12 * v + 4 * k), 0);
    for (int t = 0; t < 2; t++)
        for (int k = 0; k < 3; k++)
            assert_int_equal(packed[t][k], number_at(content.bytes + 40 + 48 + 16 * t + 4 + 4 * k));
    openigtlink_mesh(outlet, "meniscus_medial", &(struct tissue){0});
    next_of("POLYDATA", &content);
    assert_int_equal(igtl_polydata_size(0, 0), content.size);
}

static const char name_of_20[] = "a_group_of_20_letter";

// A server may have more cases than this one has places for names.
static void meshes_of_other_cases_make_room(void **state) {
    (void)state;
    float positions[9] = {0};
    uint32_t uses[] = {1, 1, 1}, corners[] = {0, 1, 2};
    struct tissue tissue = {.number = 1,
                            .vertex_count = 3,
                            .triangle_count = 1,
                            .vertex_bound = 3,
                            .triangle_bound = 1,
                            .positions = positions,
                            .uses = uses,
                            .corners = corners};
    struct igtl_content content;
    for (int i = 0; i < 3 * IGTL_MESHES_MAX; i++) {
        char name[32];
        snprintf(name, sizeof name, "group_%d", i);
        openigtlink_mesh(outlet, name, &tissue);
        if (i < 3 * IGTL_MESHES_MAX - 1)
            openigtlink_mesh(outlet, name, &(struct tissue){0});
    }
    look();
    do
        next_of("POLYDATA", &content);
    while (content.size != igtl_polydata_size(3, 1));
    openigtlink_mesh(outlet, name_of_20, &tissue);
    while (strcmp(name_of_20, next_of("POLYDATA", &content).device) != 0)
        continue;
}

// Two groups whose names are alike as far as a device's name goes.
static void long_names_of_groups_stay_apart(void **state) {
    (void)state;
    char front[IGTL_DEVICE_SIZE], back[IGTL_DEVICE_SIZE], again[IGTL_DEVICE_SIZE];
    igtl_mesh_name("meniscus_medial_horn_anterior", front);
    igtl_mesh_name("meniscus_medial_horn_posterior", back);
    igtl_mesh_name("meniscus_medial_horn_anterior", again);
    assert_int_equal(strlen(front), IGTL_DEVICE_SIZE - 1);
    assert_memory_equal(front, "meniscus_medial-", 16);
    assert_memory_equal(back, "meniscus_medial-", 16);
    assert_string_not_equal(front, back);
    assert_string_equal(front, again);
}

// ---- its port ----------------------------------------------------------------------------------

static void a_port_is_free_or_a_stations_or_taken(void **state) {
    (void)state;
    struct igtl_server_config config = {.port = openigtlink_port(outlet)};
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    struct error err = {0};
    openigtlink_follow(outlet, arthron_SessionState_WAITING);
    assert_int_equal(VIEW_PORT_VIEW, openigtlink_look_at_port(&config, &err));
    openigtlink_destroy(&outlet);
    assert_int_equal(VIEW_PORT_FREE, openigtlink_look_at_port(&config, &err));
    fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(0, bind(fd, (struct sockaddr *)&address, size));
    assert_int_equal(0, listen(fd, 1));
    assert_int_equal(0, getsockname(fd, (struct sockaddr *)&address, &size));
    config.port = ntohs(address.sin_port);
    assert_int_equal(VIEW_PORT_TAKEN, openigtlink_look_at_port(&config, &err));
    assert_non_null(strstr(err.text, "in use"));
    strcpy(config.address, "203.0.113.7");
    assert_int_equal(VIEW_PORT_TAKEN, openigtlink_look_at_port(&config, &err));
    assert_non_null(strstr(err.text, "203.0.113.7"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(poses_have_their_names_and_the_utc_of_their_measurement),
        TEST(events_are_told_from_when_somebody_watches),
        TEST(an_attempt_is_told_from_when_somebody_watches),
        TEST(a_marker_has_its_value_and_the_utc_of_its_measurement),
        TEST(the_state_is_a_status_when_it_changes),
        TEST(what_is_dead_in_a_mesh_is_left_out),
        TEST(meshes_of_other_cases_make_room),
        TEST(long_names_of_groups_stay_apart),
        TEST(a_port_is_free_or_a_stations_or_taken),
    };
    return cmocka_run_group_tests_name("openigtlink_out", tests, NULL, NULL);
}
