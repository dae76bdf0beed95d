// What a station serves by OpenIGTLink, read by clients of the library's own classes beside one
// that never reads.
#include "base/clock.h"
#include "library_poses.h"
#include "random.h"
#include "test.h"
#include "view/openigtlink.h"

#include <string.h>
#include <time.h>

enum { SETS = 60, POSES = 4 };

static const char *const names[POSES] = {"tibia", "virtual_tibia", "probe", "probe_warped"};

static struct openigtlink *outlet;
static pose sent[SETS][POSES];
static struct library_client *reads, *deaf, *tdata, *qtdata, *newest;

// ---- what is shown ------------------------------------------------------------------------------

static pose any_pose(struct random *random) {
    vec3 v = random_in_box(random, 1);
    quat q = {random_between(random, 0.1, 1), v.x, v.y, v.z};
    return (pose){quat_unit(q), random_in_box(random, 200)};
}

static void show(pose poses[POSES]) {
    arthron_View view = {.time_ns = clock_now_ns(), .state = arthron_SessionState_RUNNING};
    view.bodies_count = view.instruments_count = 1;
    view.bodies[0] = (arthron_ViewBody){.body = arthron_Body_BODY_TIBIA,
                                        .has_pose = true,
                                        .pose = wire_pose_from(poses[0]),
                                        .has_virtual_pose = true,
                                        .virtual_pose = wire_pose_from(poses[1])};
    view.instruments[0] = (arthron_ViewInstrument){.channel = CHANNEL_PROBE,
                                                   .time_ns = view.time_ns,
                                                   .has_tip = true,
                                                   .tip = wire_pose_from(poses[2]),
                                                   .has_warped = true,
                                                   .warped = wire_pose_from(poses[3])};
    openigtlink_show(outlet, &view);
}

// A tetrahedron.
static void show_mesh(void) {
    static float positions[] = {0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3};
    static uint32_t uses[] = {3, 3, 3, 3}, corners[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
    struct tissue tissue = {.number = 1,
                            .vertex_count = 4,
                            .triangle_count = 4,
                            .vertex_bound = 4,
                            .triangle_bound = 4,
                            .positions = positions,
                            .uses = uses,
                            .corners = corners};
    openigtlink_mesh(outlet, "meniscus_medial", &tissue);
}

// ---- clients ------------------------------------------------------------------------------------

static void pause_ms(int ms) {
    nanosleep(&(struct timespec){.tv_nsec = ms * NS_PER_MS}, NULL);
}

static int count_of(struct library_client *client, const char *type) {
    int count = 0;
    for (int i = 0; i < library_client_count(client); i++)
        count += !strcmp(library_client_message(client, i).type, type);
    return count;
}

// The number-th of that type, which must come.
static struct library_message message(struct library_client *client, const char *type, int number) {
    for (int i = 0; i < 10000 && count_of(client, type) <= number; i++)
        pause_ms(2);
    for (int i = 0; i < library_client_count(client); i++) {
        struct library_message m = library_client_message(client, i);
        if (!strcmp(m.type, type) && number-- == 0) {
            assert_true(m.read);
            return m;
        }
    }
    fail_msg("no %s", type);
    return (struct library_message){0};
}

static void ask(struct library_client *client, int version, const char *type, const char *answer) {
    assert_true(library_client_ask(client, version, type, "", 1));
    struct library_message m = message(client, answer, 0);
    assert_int_equal(m.version, version);
    assert_int_equal(m.status, 0);
}

static int begin(void **state) {
    (void)state;
    const struct igtl_server_config config = {.port = 0};
    struct error err;
    assert_ok(openigtlink_create(&config, &outlet, &err));
    int port = openigtlink_port(outlet);
    deaf = library_client_start_deaf(port);
    reads = library_client_start(port);
    tdata = library_client_start(port);
    qtdata = library_client_start(port);
    newest = library_client_start(port);
    assert_true(deaf && reads && tdata && qtdata && newest);
    show_mesh();
    openigtlink_follow(outlet, arthron_SessionState_RUNNING);
    message(reads, "STATUS", 0);
    ask(tdata, 1, "STT_TDATA", "RTS_TDATA");
    ask(qtdata, 2, "STT_QTDATA", "RTS_QTDATA");
    ask(newest, 3, "STT_TDATA", "RTS_TDATA");
    openigtlink_follow(outlet, arthron_SessionState_RUNNING);
    struct random random = {17};
    for (int i = 0; i < SETS; i++) {
        for (int k = 0; k < POSES; k++)
            sent[i][k] = any_pose(&random);
        show(sent[i]);
        pause_ms(3);
    }
    return 0;
}

static int end(void **state) {
    (void)state;
    struct library_client *clients[] = {deaf, reads, tdata, qtdata, newest};
    openigtlink_destroy(&outlet);
    for (size_t i = 0; i < sizeof clients / sizeof *clients; i++)
        library_client_end(clients[i]);
    return 0;
}

// ---- what they get ------------------------------------------------------------------------------

static void a_client_that_asks_for_nothing_gets_each_pose(void **state) {
    (void)state;
    message(reads, "TRANSFORM", SETS * POSES - 1);
    for (int at = 0, i = 0; i < library_client_count(reads); i++) {
        struct library_message m = library_client_message(reads, i);
        if (strcmp(m.type, "TRANSFORM") != 0)
            continue;
        assert_true(m.read && m.version == 1);
        assert_string_equal(m.device, names[at % POSES]);
        assert_library_matrix(&m.tools[0], sent[at / POSES][at % POSES]);
        at++;
    }
}

static void assert_sets(struct library_client *client, const char *type, int version,
                        void (*check)(const struct library_tool *tool, pose p)) {
    for (int i = 0; i < SETS; i++) {
        struct library_message m = message(client, type, i);
        assert_int_equal(m.version, version);
        assert_int_equal(m.tool_count, POSES);
        for (int k = 0; k < POSES; k++) {
            assert_string_equal(m.tools[k].name, names[k]);
            check(&m.tools[k], sent[i][k]);
        }
    }
}

static void tracking_data_comes_in_the_version_in_which_it_was_asked_for(void **state) {
    (void)state;
    assert_sets(tdata, "TDATA", 1, assert_library_matrix);
    assert_sets(qtdata, "QTDATA", 2, assert_library_quaternion);
    assert_sets(newest, "TDATA", 3, assert_library_matrix);
    assert_int_equal(count_of(tdata, "TRANSFORM"), 0);
}

static void a_mesh_is_the_one_that_was_cut(void **state) {
    (void)state;
    assert_true(library_client_ask(newest, 3, "GET_POLYDATA", "meniscus_medial", 0));
    struct library_message all[] = {message(reads, "POLYDATA", 0), message(newest, "POLYDATA", 1)};
    for (int i = 0; i < 2; i++) {
        assert_string_equal(all[i].device, "meniscus_medial");
        assert_int_equal(all[i].point_count, 4);
        assert_int_equal(all[i].triangle_count, 4);
        assert_near((double)all[i].points[11], 3, 0);
        assert_int_equal(all[i].triangles[11], 3);
    }
}

static void an_event_and_the_state_are_told(void **state) {
    (void)state;
    arthron_View view = {.time_ns = clock_now_ns(), .state = arthron_SessionState_PAUSED};
    view.events[0] = 1;
    openigtlink_follow(outlet, arthron_SessionState_PAUSED);
    openigtlink_show(outlet, &view);
    struct library_message m = message(reads, "STRING", 0);
    assert_string_equal(m.device, "events");
    assert_string_equal(m.text, "paused");
    m = message(reads, "STATUS", count_of(reads, "STATUS") - 1);
    assert_int_equal(m.status, 13);
    assert_string_equal(m.text, "paused");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_client_that_asks_for_nothing_gets_each_pose),
        cmocka_unit_test(tracking_data_comes_in_the_version_in_which_it_was_asked_for),
        cmocka_unit_test(a_mesh_is_the_one_that_was_cut),
        cmocka_unit_test(an_event_and_the_state_are_told),
    };
    return cmocka_run_group_tests(tests, begin, end);
}
