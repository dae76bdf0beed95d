// Meshes on a control connection behind what is more urgent; read by a client that takes its time.
#include "base/clock.h"
#include "net/control.h"
#include "test.h"
#include "wire/test_server.h"
#include "wire/websocket.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define LARGE (32u << 20) // more than sockets hold
#define CHUNKS (LARGE / WIRE_CHUNK_DATA)

static struct test_server test_server;
static char anna[128];
static uint8_t bytes[WIRE_CHUNK_MAX];
static arthron_MeshChunk chunk;

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

static void tell(struct websocket *socket, const arthron_Control *message) {
    size_t size;
    assert_int_equal(wire_encode_control(message, bytes, sizeof bytes, &size), RESULT_OK);
    assert_true(websocket_send(socket, WEBSOCKET_BINARY, true, bytes, size));
}

// The kind of the next message; a chunk's is 0, and it is in `chunk`.
static int hear(struct websocket *socket, arthron_Control *out_message) {
    int size = websocket_receive(socket, bytes, sizeof bytes);
    assert_true(size > 0);
    if (wire_is_chunk(bytes, (size_t)size)) {
        assert_int_equal(wire_decode_chunk(bytes, (size_t)size, &chunk, NULL), RESULT_OK);
        return 0;
    }
    assert_int_equal(wire_decode_control(bytes, (size_t)size, out_message, NULL), RESULT_OK);
    return out_message->which_message;
}

static struct websocket *greet(const char *capability) {
    struct websocket *socket = websocket_open(test_server.port, anna, WIRE_SUBPROTOCOL);
    arthron_Control message = {.which_message = arthron_Control_hello_tag};
    arthron_Hello *hello = &message.message.hello;
    assert_non_null(socket);
    hello->version_min = WIRE_VERSION_MIN;
    hello->version_max = WIRE_VERSION_MAX;
    strcpy(hello->station, "anna");
    strcpy(hello->capabilities[hello->capabilities_count++], capability);
    tell(socket, &message);
    assert_int_equal(hear(socket, &message), arthron_Control_welcome_tag);
    assert_int_equal(message.message.welcome.capabilities_count, 1);
    assert_string_equal(message.message.welcome.capabilities[0], capability);
    return socket;
}

static struct mesh_payload *payload_of(const char *group, size_t size) {
    struct mesh_payload *payload = mesh_payload_create(group, 0, 1, size);
    for (size_t i = 0; i < size; i += WIRE_CHUNK_DATA)
        payload->bytes[i] = (uint8_t)(i / WIRE_CHUNK_DATA);
    mesh_payload_seal(payload);
    return payload;
}

static bool send(struct mesh_payload *payload) {
    return control_send_mesh(test_server.control, test_server.peer, payload);
}

// ---- tests --------------------------------------------------------------------------------------

static void expect_chunk(const struct mesh_payload *payload, uint32_t index) {
    assert_string_equal(chunk.group, payload->group);
    assert_int_equal(chunk.number, 1);
    assert_int_equal(chunk.base, 0);
    assert_int_equal(chunk.size, payload->size);
    assert_int_equal(chunk.hash, payload->hash);
    assert_int_equal(chunk.index, index);
    assert_memory_equal(chunk.data.bytes, payload->bytes + index * (size_t)WIRE_CHUNK_DATA,
                        chunk.data.size);
}

// A frame every hundred chunks: its reply comes while the mesh is still on its way.
static void a_reply_overtakes_a_mesh(void **state) {
    (void)state;
    struct websocket *socket = greet("meshes");
    struct mesh_payload *payload = payload_of("meniscus", LARGE);
    arthron_Control message, frame = {.which_message = arthron_Control_frame_tag};
    uint64_t asked = 0, answered = 0;
    assert_true(send(payload));
    for (uint32_t heard = 0; heard < CHUNKS;) {
        int kind = hear(socket, &message);
        if (kind == 0)
            expect_chunk(payload, heard++);
        if (kind == arthron_Control_reply_tag)
            assert_int_equal(message.message.reply.frame_number, ++answered);
        if (asked == answered && heard % 100 == 1 && heard < CHUNKS / 2) {
            frame.message.frame.number = ++asked;
            tell(socket, &frame);
        }
    }
    assert_true(answered >= 1);
    assert_int_equal(answered, asked);
    mesh_payload_release(&payload);
    websocket_close(socket);
}

static void messages_sent_before_a_mesh_arrive_before_it(void **state) {
    (void)state;
    struct websocket *socket = greet("meshes");
    struct mesh_payload *payload = payload_of("meniscus", 100);
    arthron_Control message, change = {.which_message = arthron_Control_session_change_tag};
    for (int i = 1; i <= 20; i++) {
        snprintf(change.message.session_change.text, 8, "%d", i);
        assert_true(control_send(test_server.control, test_server.peer, &change));
    }
    assert_true(send(payload));
    int last = 0, kind;
    while ((kind = hear(socket, &message)) != 0)
        if (kind == arthron_Control_session_change_tag)
            last = atoi(message.message.session_change.text);
    assert_int_equal(last, 20);
    expect_chunk(payload, 0);
    mesh_payload_release(&payload);
    websocket_close(socket);
}

static void a_small_payload_does_not_wait_for_a_large_one_of_another_group(void **state) {
    (void)state;
    struct websocket *socket = greet("meshes");
    struct mesh_payload *large = payload_of("medial", LARGE);
    struct mesh_payload *small = payload_of("lateral", 10 * WIRE_CHUNK_DATA - 5);
    arthron_Control message;
    uint32_t heard_large = 0, heard_small = 0;
    assert_true(send(large));
    assert_true(send(small));
    while (heard_large < CHUNKS) {
        if (hear(socket, &message) != 0)
            continue;
        if (!strcmp(chunk.group, "medial"))
            expect_chunk(large, heard_large++);
        else
            expect_chunk(small, heard_small++);
        assert_true(heard_large < CHUNKS || heard_small == 10);
    }
    mesh_payload_release(&large);
    mesh_payload_release(&small);
    websocket_close(socket);
}

static void wait_for_references(struct mesh_payload *payload, int wanted) {
    for (int i = 0; i < 5000 && atomic_load(&payload->references) != wanted; i++)
        usleep(2000);
    assert_int_equal(atomic_load(&payload->references), wanted);
}

static void a_newer_payload_of_the_group_takes_the_place_of_the_older(void **state) {
    (void)state;
    struct websocket *socket = greet("meshes");
    struct mesh_payload *older = payload_of("meniscus", LARGE), *newer = payload_of("meniscus", 99);
    arthron_Control message;
    assert_true(send(older));
    while (hear(socket, &message) != 0)
        ;
    assert_true(send(newer));
    wait_for_references(older, 1);
    uint32_t heard = 0;
    do
        heard += hear(socket, &message) == 0;
    while (chunk.size != newer->size);
    assert_in_range(heard, 1, CHUNKS - 1);
    expect_chunk(newer, 0);
    mesh_payload_release(&older);
    mesh_payload_release(&newer);
    websocket_close(socket);
}

static void payloads_go_with_their_peer(void **state) {
    (void)state;
    struct websocket *socket = greet("meshes");
    struct mesh_payload *payload = payload_of("meniscus", LARGE);
    assert_true(send(payload));
    wait_for_references(payload, 2); // who writes a piece holds it meanwhile
    websocket_close(socket);
    assert_true(wait_for(&test_server.gone, 1));
    wait_for_references(payload, 1);
    assert_false(send(payload));
    assert_int_equal(atomic_load(&payload->references), 1);
    mesh_payload_release(&payload);
}

static void a_ninth_group_has_no_place(void **state) {
    (void)state;
    struct websocket *socket = greet("meshes");
    struct mesh_payload *payloads[WIRE_MESH_GROUPS_MAX + 1];
    for (int i = 0; i <= WIRE_MESH_GROUPS_MAX; i++) {
        payloads[i] = payload_of((char[]){(char)('a' + i), '\0'}, LARGE / 4);
        assert_int_equal(send(payloads[i]), i < WIRE_MESH_GROUPS_MAX);
    }
    assert_int_equal(atomic_load(&payloads[WIRE_MESH_GROUPS_MAX]->references), 1);
    test_server_stop(&test_server); // with all of them on their way
    for (int i = 0; i <= WIRE_MESH_GROUPS_MAX; i++) {
        assert_int_equal(atomic_load(&payloads[i]->references), 1);
        mesh_payload_release(&payloads[i]);
    }
    test_server_start(&test_server);
    websocket_close(socket);
}

static void without_the_capability_nothing_of_meshes_may_be_said(void **state) {
    (void)state;
    static const int kinds[] = {arthron_Control_mesh_ask_tag, arthron_Control_mesh_ack_tag};
    struct mesh_payload *payload = payload_of("meniscus", 100);
    for (int i = 0; i < 2; i++) {
        struct websocket *socket = greet("datagrams");
        arthron_Control message = {.which_message = (pb_size_t)kinds[i]};
        assert_false(send(payload));
        tell(socket, &message);
        while (hear(socket, &message) != arthron_Control_refusal_tag)
            ;
        assert_int_equal(message.message.refusal.reason, arthron_Refusal_Reason_MALFORMED);
        websocket_close(socket);
    }
    mesh_payload_release(&payload);
}

static void a_chunk_is_not_a_stations_to_say(void **state) {
    (void)state;
    struct websocket *socket = greet("meshes");
    arthron_Control message;
    size_t size;
    chunk = (arthron_MeshChunk){.group = "meniscus", .number = 1, .size = 1, .data.size = 1};
    assert_int_equal(wire_encode_chunk(&chunk, bytes, sizeof bytes, &size), RESULT_OK);
    assert_true(websocket_send(socket, WEBSOCKET_BINARY, true, bytes, size));
    while (hear(socket, &message) != arthron_Control_refusal_tag)
        ;
    assert_int_equal(message.message.refusal.reason, arthron_Refusal_Reason_MALFORMED);
    websocket_close(socket);
}

#define WITH_SERVER(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)

int main(void) {
    const struct CMUnitTest tests[] = {
        WITH_SERVER(a_reply_overtakes_a_mesh),
        WITH_SERVER(messages_sent_before_a_mesh_arrive_before_it),
        WITH_SERVER(a_small_payload_does_not_wait_for_a_large_one_of_another_group),
        WITH_SERVER(a_newer_payload_of_the_group_takes_the_place_of_the_older),
        WITH_SERVER(payloads_go_with_their_peer),
        WITH_SERVER(a_ninth_group_has_no_place),
        WITH_SERVER(without_the_capability_nothing_of_meshes_may_be_said),
        WITH_SERVER(a_chunk_is_not_a_stations_to_say),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
