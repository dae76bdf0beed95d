// A mesh from a feed through real connections to a station's link.
#include "base/clock.h"
#include "base/log.h"
#include "link/link.h"
#include "net/mesh_feed.h"
#include "test.h"
#include "wire/mesh_model.h"
#include "wire/test_server.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct test_server test_server;
static char anna[128];

// The mesh of a session, and what its one station has of it, as a cut worker would keep it.
static struct {
    pthread_mutex_t lock;
    struct model model;
    struct random random;
    struct mesh_feed *feed;
    struct mesh_cursor cursor;
    arthron_MeshAsk ask; // the last one
    uint32_t base;       // of the last payload sent
    atomic_int asks, acks;
} stage = {.lock = PTHREAD_MUTEX_INITIALIZER};

// Under the lock.
static void send_next(struct control_peer peer) {
    struct mesh_payload *payload = mesh_feed_next(stage.feed, &stage.cursor);
    if (!payload)
        return;
    stage.base = payload->base;
    assert_true(control_send_mesh(test_server.control, peer, payload));
    mesh_payload_release(&payload);
}

static void on_mesh(struct test_server *d, struct control_peer peer,
                    const arthron_Control *message) {
    (void)d;
    pthread_mutex_lock(&stage.lock);
    if (message->which_message == arthron_Control_mesh_ask_tag) {
        stage.ask = message->message.mesh_ask;
        mesh_cursor_ask(&stage.cursor, "meniscus", &stage.ask);
        atomic_fetch_add(&stage.asks, 1);
    } else {
        mesh_cursor_ack(&stage.cursor, &message->message.mesh_ack);
        atomic_fetch_add(&stage.acks, 1);
    }
    send_next(peer);
    pthread_mutex_unlock(&stage.lock);
}

static void open_session(uint64_t seed) {
    stage.model = (struct model){0};
    stage.random = (struct random){seed};
    stage.cursor = (struct mesh_cursor){0};
    struct mesh_delta whole = model_change(&stage.model, &stage.random, 1, 0);
    mesh_feed_destroy(&stage.feed);
    assert_int_equal(mesh_feed_create("meniscus", &whole, &stage.feed, NULL), RESULT_OK);
    mesh_delta_fini(&whole);
}

static void push(void) {
    struct mesh_delta change = model_change(&stage.model, &stage.random, 0.02, 1);
    assert_int_equal(mesh_feed_push(stage.feed, &change, NULL), RESULT_OK);
    mesh_delta_fini(&change);
}

static void push_and_send(void) {
    pthread_mutex_lock(&stage.lock);
    push();
    send_next(test_server.peer);
    pthread_mutex_unlock(&stage.lock);
}

static int set_up(void **state) {
    (void)state;
    test_server = (struct test_server){.on_mesh = on_mesh};
    atomic_store(&stage.asks, 0);
    atomic_store(&stage.acks, 0);
    open_session(1);
    test_server_open(&test_server);
    test_server_enrol(&test_server, "anna", anna);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    test_server_close(&test_server);
    mesh_feed_destroy(&stage.feed);
    return 0;
}

static struct link *new_link(bool meshes) {
    struct link_config config = {.server_count = 1,
                                 .servers = {{"localhost", test_server.port}},
                                 .keys_dir = anna,
                                 .station = "anna",
                                 .software = "test",
                                 .meshes = meshes};
    struct link *link;
    assert_int_equal(link_create(&config, &link, NULL), RESULT_OK);
    return link;
}

static struct link_tissue status_of(struct link *link) {
    struct link_tissue tissues[WIRE_MESH_GROUPS_MAX] = {0};
    link_get_tissues(link, tissues);
    return tissues[0];
}

// And the server knows it.
static bool is_up_to_date(struct link *link) {
    pthread_mutex_lock(&stage.lock);
    struct link_tissue status = status_of(link);
    const struct tissue *tissue = mesh_feed_tissue(stage.feed);
    bool equal = status.number == tissue->number && status.hash == tissue->hash &&
                 stage.cursor.number == tissue->number && stage.cursor.hash == tissue->hash;
    pthread_mutex_unlock(&stage.lock);
    return equal;
}

static void expect_the_servers_mesh(struct link *link) {
    struct tissue tissue;
    for (int i = 0; i < 5000 && !is_up_to_date(link); i++)
        usleep(2000);
    assert_true(is_up_to_date(link));
    assert_true(link_copy_tissue(link, "meniscus", &tissue));
    model_assert_same(&tissue, &stage.model);
    tissue_fini(&tissue);
}

// ---- tests --------------------------------------------------------------------------------------

static void a_link_follows_a_mesh(void **state) {
    (void)state;
    struct link *link = new_link(true);
    expect_the_servers_mesh(link);
    assert_string_equal(test_server.hello.capabilities[0], "meshes");
    for (int i = 0; i < 100; i++) {
        push_and_send();
        if (i % 10 == 0)
            expect_the_servers_mesh(link);
    }
    expect_the_servers_mesh(link);
    assert_int_equal(status_of(link).resyncs, 0);
    assert_int_equal(atomic_load(&stage.asks), 1);
    link_destroy(&link);
}

static void a_link_that_comes_back_goes_on_where_it_was(void **state) {
    (void)state;
    struct link *link = new_link(true);
    expect_the_servers_mesh(link);
    push_and_send();
    expect_the_servers_mesh(link);
    test_server_stop(&test_server);
    stage.cursor = (struct mesh_cursor){0};
    for (int i = 0; i < 3; i++)
        push();
    test_server_start(&test_server);
    expect_the_servers_mesh(link);
    assert_int_equal(stage.ask.have_count, 1);
    assert_string_equal(stage.ask.have[0].group, "meniscus");
    assert_int_equal(stage.ask.have[0].number, 2);
    assert_int_equal(stage.base, 2); // the three changes, not the whole mesh
    assert_int_equal(status_of(link).resyncs, 0);
    link_destroy(&link);
}

static void a_link_that_comes_back_to_another_session_gets_its_mesh(void **state) {
    (void)state;
    struct link *link = new_link(true);
    expect_the_servers_mesh(link);
    test_server_stop(&test_server);
    open_session(2); // the number is the same, the mesh is not
    test_server_start(&test_server);
    expect_the_servers_mesh(link);
    assert_int_equal(stage.ask.have[0].number, 1);
    assert_int_equal(stage.base, 0);
    link_destroy(&link);
}

static void a_link_that_missed_a_change_asks_for_it(void **state) {
    (void)state;
    struct link *link = new_link(true);
    expect_the_servers_mesh(link);
    pthread_mutex_lock(&stage.lock);
    push();
    stage.cursor.number = 2; // as if it had been sent
    stage.cursor.hash = mesh_feed_tissue(stage.feed)->hash;
    pthread_mutex_unlock(&stage.lock);
    push_and_send();
    expect_the_servers_mesh(link);
    assert_int_equal(stage.ask.have[0].number, 1);
    assert_int_equal(stage.base, 1);
    assert_int_equal(status_of(link).resyncs, 1);
    link_destroy(&link);
}

static void a_link_that_got_other_bytes_asks_again(void **state) {
    (void)state;
    struct link *link = new_link(true);
    expect_the_servers_mesh(link);
    for (int seals = 0; seals < 2; seals++) {
        pthread_mutex_lock(&stage.lock);
        push();
        struct mesh_payload *payload = mesh_feed_next(stage.feed, &stage.cursor), *other;
        other = mesh_payload_create("meniscus", payload->base, payload->number, payload->size);
        memcpy(other->bytes, payload->bytes, payload->size);
        other->hash = payload->hash;
        other->bytes[other->size - 1] ^= 1;
        if (seals)
            mesh_payload_seal(other);
        assert_true(control_send_mesh(test_server.control, test_server.peer, other));
        mesh_payload_release(&payload);
        mesh_payload_release(&other);
        pthread_mutex_unlock(&stage.lock);
        expect_the_servers_mesh(link);
        assert_int_equal(stage.base, seals ? 0 : 1);
        assert_int_equal(status_of(link).resyncs, seals + 1);
    }
    link_destroy(&link);
}

static void a_link_without_the_capability_gets_no_mesh(void **state) {
    (void)state;
    struct link_tissue tissues[WIRE_MESH_GROUPS_MAX];
    struct link *link = new_link(false);
    assert_true(wait_for(&test_server.clocks, 3));
    struct mesh_cursor cursor = {.asked = true};
    struct mesh_payload *payload = mesh_feed_next(stage.feed, &cursor);
    assert_false(control_send_mesh(test_server.control, test_server.peer, payload));
    assert_int_equal(atomic_load(&payload->references), 2); // ours and the feed's
    assert_int_equal(atomic_load(&stage.asks), 0);
    assert_int_equal(link_get_tissues(link, tissues), 0);
    mesh_payload_release(&payload);
    link_destroy(&link);
}

#define WITH_SERVER(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)

int main(void) {
    log_set_level(LOG_ERROR);
    const struct CMUnitTest tests[] = {
        WITH_SERVER(a_link_follows_a_mesh),
        WITH_SERVER(a_link_that_comes_back_goes_on_where_it_was),
        WITH_SERVER(a_link_that_comes_back_to_another_session_gets_its_mesh),
        WITH_SERVER(a_link_that_missed_a_change_asks_for_it),
        WITH_SERVER(a_link_that_got_other_bytes_asks_again),
        WITH_SERVER(a_link_without_the_capability_gets_no_mesh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
