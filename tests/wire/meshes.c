// What a station makes of the pieces of meshes, in order and not.
#include "link/meshes.h"

#include "base/log.h"
#include "net/mesh_feed.h"
#include "test.h"
#include "wire/mesh_model.h"

#include <stdlib.h>
#include <string.h>

#define PIECE_VERTICES 7000 // 84 kB: with them a payload has three chunks
#define CHUNKS 3

static struct model model;
static struct random dice;
static struct mesh_feed *feed;
static struct meshes *meshes;

// A change of the model that takes three chunks.
static struct mesh_delta large_change(double share) {
    struct mesh_delta delta = model_change(&model, &dice, share, 1);
    if (!delta.piece_count)
        delta.pieces[delta.piece_count++] = (struct delta_piece){0};
    struct delta_piece *piece = &delta.pieces[0];
    free(piece->positions);
    piece->vertex_count = PIECE_VERTICES;
    piece->positions = calloc(PIECE_VERTICES, 3 * sizeof *piece->positions);
    return delta;
}

static struct told {
    int count;
    uint32_t number, triangles;
} told;

static void hear_of_change(void *user, const char *group, const struct tissue *tissue) {
    (void)group;
    struct told *t = user;
    *t = (struct told){t->count + 1, tissue->number, tissue->triangle_count};
}

static int open_meshes(void **state) {
    (void)state;
    dice = (struct random){1};
    model = (struct model){0};
    struct mesh_delta whole = model_change(&model, &dice, 1, 0);
    assert_int_equal(mesh_feed_create("meniscus", &whole, &feed, NULL), RESULT_OK);
    mesh_delta_fini(&whole);
    told = (struct told){0};
    meshes = meshes_create(hear_of_change, &told);
    return 0;
}

static int close_meshes(void **state) {
    (void)state;
    mesh_feed_destroy(&feed);
    meshes_destroy(&meshes);
    return 0;
}

// What a station that has that mesh is sent.
static struct mesh_payload *payload_for(uint32_t number, uint64_t hash) {
    struct mesh_cursor cursor = {.asked = true, .number = number, .hash = hash};
    return mesh_feed_next(feed, &cursor);
}

// A payload of the next change, whatever a feed would do.
static struct mesh_payload *next_change(double share) {
    struct mesh_delta delta = large_change(share);
    delta.base = mesh_feed_tissue(feed)->number;
    delta.number = delta.base + 1;
    assert_int_equal(mesh_feed_push(feed, &delta, NULL), RESULT_OK);
    struct mesh_bytes bytes = mesh_bytes_of(&delta);
    struct mesh_payload *payload =
        mesh_payload_create("meniscus", delta.base, delta.number, bytes.size);
    memcpy(payload->bytes, bytes.data, bytes.size);
    mesh_payload_seal(payload);
    assert_in_range(payload->size, 2 * WIRE_CHUNK_DATA + 1, CHUNKS * WIRE_CHUNK_DATA);
    mesh_delta_fini(&delta);
    free(bytes.data);
    return payload;
}

// The answer to a chunk: 0, or the number of a field of Control.
static int hear(const struct mesh_payload *payload, uint32_t index, arthron_Control *out_answer) {
    static arthron_MeshChunk chunk;
    size_t from = index * (size_t)WIRE_CHUNK_DATA, left = payload->size - from;
    chunk = (arthron_MeshChunk){.base = payload->base,
                                .number = payload->number,
                                .size = (uint32_t)payload->size,
                                .hash = payload->hash,
                                .index = index};
    memcpy(chunk.group, payload->group, sizeof chunk.group);
    chunk.data.size = (pb_size_t)(left < WIRE_CHUNK_DATA ? left : WIRE_CHUNK_DATA);
    memcpy(chunk.data.bytes, payload->bytes + from, chunk.data.size);
    return meshes_hear(meshes, &chunk, out_answer) ? (int)out_answer->which_message : 0;
}

// The answer to a whole payload, which only its last chunk may have.
static int hear_all(const struct mesh_payload *payload, arthron_Control *out_answer) {
    uint32_t last = (uint32_t)((payload->size - 1) / WIRE_CHUNK_DATA);
    for (uint32_t i = 0; i < last; i++)
        assert_int_equal(hear(payload, i, out_answer), 0);
    return hear(payload, last, out_answer);
}

static void assert_up_to_date(void) {
    struct tissue tissue;
    assert_true(meshes_copy(meshes, "meniscus", &tissue));
    assert_int_equal(tissue.number, mesh_feed_tissue(feed)->number);
    model_assert_same(&tissue, &model);
    tissue_fini(&tissue);
}

static struct link_tissue status(void) {
    struct link_tissue tissues[WIRE_MESH_GROUPS_MAX];
    assert_true(meshes_get(meshes, tissues) >= 1);
    assert_string_equal(tissues[0].group, "meniscus");
    return tissues[0];
}

// Takes the answer as a server would, and gives what is missing.
static void answer_ask(const arthron_Control *ask) {
    struct mesh_cursor cursor;
    arthron_Control answer;
    assert_int_equal(ask->which_message, arthron_Control_mesh_ask_tag);
    mesh_cursor_ask(&cursor, "meniscus", &ask->message.mesh_ask);
    struct mesh_payload *payload = mesh_feed_next(feed, &cursor);
    assert_int_equal(hear_all(payload, &answer), arthron_Control_mesh_ack_tag);
    assert_int_equal(answer.message.mesh_ack.number, mesh_feed_tissue(feed)->number);
    assert_int_equal(answer.message.mesh_ack.hash, mesh_feed_tissue(feed)->hash);
    mesh_payload_release(&payload);
    assert_up_to_date();
}

static void begin_with_the_whole_mesh(void) {
    arthron_Control ask;
    meshes_ask(meshes, &ask);
    assert_int_equal(ask.message.mesh_ask.have_count, 0);
    answer_ask(&ask);
}

// ---- tests --------------------------------------------------------------------------------------

static void each_mesh_is_told_once_and_that_it_is_void_with_another_case(void **state) {
    (void)state;
    arthron_Control answer;
    begin_with_the_whole_mesh();
    assert_int_equal(1, told.count);
    struct mesh_payload *payload = next_change(0.1);
    for (int i = 0; i < 2; i++) // again: a change that was made already is acknowledged, no more
        assert_int_equal(hear_all(payload, &answer), arthron_Control_mesh_ack_tag);
    mesh_payload_release(&payload);
    assert_int_equal(2, told.count);
    assert_int_equal(mesh_feed_tissue(feed)->number, told.number);
    assert_int_equal(mesh_feed_tissue(feed)->triangle_count, told.triangles);
    meshes_set_case(meshes, 77);
    assert_int_equal(3, told.count);
    assert_int_equal(0, told.number);
    assert_int_equal(0, told.triangles);
}

static void a_change_in_chunks_is_made_and_acknowledged(void **state) {
    (void)state;
    arthron_Control answer;
    begin_with_the_whole_mesh();
    uint64_t bytes = status().bytes_received;
    struct mesh_payload *payload = next_change(0.1);
    assert_int_equal(hear_all(payload, &answer), arthron_Control_mesh_ack_tag);
    assert_string_equal(answer.message.mesh_ack.group, "meniscus");
    assert_int_equal(answer.message.mesh_ack.number, 2);
    assert_int_equal(answer.message.mesh_ack.hash, model_hash(&model));
    assert_up_to_date();
    assert_int_equal(status().bytes_received, bytes + payload->size);
    assert_int_equal(status().resyncs, 0);
    assert_int_equal(status().number, 2);
    assert_int_equal(status().triangles, mesh_feed_tissue(feed)->triangle_count);
    mesh_payload_release(&payload);
}

static void a_missing_chunk_is_asked_for_once(void **state) {
    (void)state;
    begin_with_the_whole_mesh();
    for (uint32_t missing = 0; missing < CHUNKS - 1; missing++) {
        struct mesh_payload *payload = next_change(0.1);
        arthron_Control answer, ask = {0};
        int asks = 0;
        for (uint32_t i = 0; i < CHUNKS; i++)
            if (i != missing && hear(payload, i, &answer)) {
                asks++;
                ask = answer;
            }
        assert_int_equal(asks, 1);
        assert_int_equal(ask.message.mesh_ask.have[0].number, payload->base);
        assert_int_equal(status().number, payload->base);
        answer_ask(&ask);
        assert_int_equal(status().resyncs, missing + 1);
        mesh_payload_release(&payload);
    }
}

static void a_chunk_that_comes_twice_is_out_of_order(void **state) {
    (void)state;
    arthron_Control answer;
    begin_with_the_whole_mesh();
    struct mesh_payload *payload = next_change(0.1);
    assert_int_equal(hear(payload, 0, &answer), 0);
    assert_int_equal(hear(payload, 1, &answer), 0);
    assert_int_equal(hear(payload, 1, &answer), arthron_Control_mesh_ask_tag);
    answer_ask(&answer);
    mesh_payload_release(&payload);
}

static void chunks_of_two_payloads_make_none(void **state) {
    (void)state;
    begin_with_the_whole_mesh();
    for (int field = 0; field < 4; field++) {
        arthron_Control answer;
        struct mesh_payload *payload = next_change(0.1), *other;
        other = mesh_payload_create("meniscus", payload->base, payload->number,
                                    payload->size - (field == 3));
        memcpy(other->bytes, payload->bytes, other->size);
        other->hash = payload->hash + (field == 0);
        other->base += field == 1;
        other->number += field == 2;
        assert_int_equal(hear(payload, 0, &answer), 0);
        assert_int_equal(hear(other, 1, &answer), arthron_Control_mesh_ask_tag);
        answer_ask(&answer);
        mesh_payload_release(&payload);
        mesh_payload_release(&other);
    }
}

static void a_first_chunk_ends_the_payload_before(void **state) {
    (void)state;
    arthron_Control answer;
    begin_with_the_whole_mesh();
    struct mesh_payload *payload = next_change(0.1), *whole = payload_for(0, 0);
    assert_int_equal(hear(payload, 0, &answer), 0);
    assert_int_equal(hear(payload, 1, &answer), 0);
    assert_int_equal(hear_all(whole, &answer), arthron_Control_mesh_ack_tag);
    assert_up_to_date();
    mesh_payload_release(&payload);
    mesh_payload_release(&whole);
}

static void payloads_of_two_groups_may_alternate(void **state) {
    (void)state;
    arthron_Control answer;
    begin_with_the_whole_mesh();
    struct mesh_payload *whole = payload_for(0, 0), *payload = next_change(0.1);
    strcpy(whole->group, "lateral");
    assert_int_equal(hear(payload, 0, &answer), 0);
    assert_int_equal(hear_all(whole, &answer), arthron_Control_mesh_ack_tag);
    assert_string_equal(answer.message.mesh_ack.group, "lateral");
    assert_int_equal(hear(payload, 1, &answer), 0);
    assert_int_equal(hear(payload, 2, &answer), arthron_Control_mesh_ack_tag);
    assert_up_to_date();
    meshes_ask(meshes, &answer);
    assert_int_equal(answer.message.mesh_ask.have_count, 2);
    assert_string_equal(answer.message.mesh_ask.have[1].group, "lateral");
    assert_int_equal(answer.message.mesh_ask.have[1].number, 1);
    mesh_payload_release(&whole);
    mesh_payload_release(&payload);
}

static void after_a_gap_it_asks_with_what_it_has(void **state) {
    (void)state;
    arthron_Control answer;
    begin_with_the_whole_mesh();
    struct mesh_payload *missed = next_change(0.1), *payload = next_change(0.1);
    assert_int_equal(hear_all(payload, &answer), arthron_Control_mesh_ask_tag);
    assert_int_equal(answer.message.mesh_ask.have_count, 1);
    assert_int_equal(answer.message.mesh_ask.have[0].number, 1);
    assert_int_equal(status().number, 1);
    answer_ask(&answer);
    mesh_payload_release(&missed);
    mesh_payload_release(&payload);
}

static void what_it_has_passed_is_acknowledged_and_nothing_else(void **state) {
    (void)state;
    arthron_Control answer;
    begin_with_the_whole_mesh();
    struct mesh_payload *old = next_change(0.1), *newer = next_change(0.1);
    assert_int_equal(hear_all(old, &answer), arthron_Control_mesh_ack_tag);
    assert_int_equal(hear_all(newer, &answer), arthron_Control_mesh_ack_tag);
    assert_int_equal(hear_all(old, &answer), arthron_Control_mesh_ack_tag);
    assert_int_equal(answer.message.mesh_ack.number, 3);
    assert_up_to_date();
    mesh_payload_release(&old);
    mesh_payload_release(&newer);
}

static void a_flipped_bit_is_asked_for_again(void **state) {
    (void)state;
    arthron_Control answer;
    begin_with_the_whole_mesh();
    struct mesh_payload *payload = next_change(0.1);
    payload->bytes[payload->size / 2] ^= 4; // in the piece, of which the mesh's hash knows nothing
    assert_int_equal(hear_all(payload, &answer), arthron_Control_mesh_ask_tag);
    assert_int_equal(answer.message.mesh_ask.have[0].number, 1);
    answer_ask(&answer);
    mesh_payload_release(&payload);
}

static void what_cannot_be_made_is_asked_for_from_nothing(void **state) {
    (void)state;
    begin_with_the_whole_mesh();
    for (int what = 0; what < 3; what++) {
        arthron_Control answer;
        struct mesh_payload *payload = next_change(0.1);
        if (what == 0)
            payload->bytes[payload->size - 1] ^= 1; // the mesh's hash
        else if (what == 1)
            payload->bytes[2] = 0xff; // how many are freed
        else
            payload->number++; // not where the changes lead
        mesh_payload_seal(payload);
        assert_int_equal(hear_all(payload, &answer), arthron_Control_mesh_ask_tag);
        assert_int_equal(answer.message.mesh_ask.have_count, 0);
        assert_int_equal(status().number, 0);
        answer_ask(&answer);
        mesh_payload_release(&payload);
    }
}

static void it_does_not_ask_for_ever(void **state) {
    (void)state;
    arthron_Control answer;
    int asks = 0;
    begin_with_the_whole_mesh();
    struct mesh_payload *whole = payload_for(0, 0);
    whole->hash ^= 1;
    for (int i = 0; i < 10; i++)
        asks += hear_all(whole, &answer) == arthron_Control_mesh_ask_tag;
    assert_int_equal(asks, 3);
    meshes_ask(meshes, &answer); // the session opens again
    assert_int_equal(hear_all(whole, &answer), arthron_Control_mesh_ask_tag);
    mesh_payload_release(&whole);
}

static void a_ninth_group_is_not_followed(void **state) {
    (void)state;
    arthron_Control answer;
    struct mesh_payload *whole = payload_for(0, 0);
    for (int i = 0; i < WIRE_MESH_GROUPS_MAX; i++) {
        whole->group[0] = (char)('a' + i);
        assert_int_equal(hear_all(whole, &answer), arthron_Control_mesh_ack_tag);
    }
    whole->group[0] = 'z';
    assert_int_equal(hear_all(whole, &answer), 0);
    whole->group[0] = 'a';
    assert_int_equal(hear_all(whole, &answer), arthron_Control_mesh_ack_tag);
    meshes_ask(meshes, &answer);
    assert_int_equal(answer.message.mesh_ask.have_count, WIRE_MESH_GROUPS_MAX);
    mesh_payload_release(&whole);
}

static void meshes_of_another_case_are_void(void **state) {
    (void)state;
    struct link_tissue tissues[WIRE_MESH_GROUPS_MAX];
    struct tissue tissue;
    arthron_Control ask;
    meshes_set_case(meshes, 7);
    begin_with_the_whole_mesh();
    meshes_set_case(meshes, 7);
    assert_up_to_date();
    meshes_set_case(meshes, 8);
    assert_int_equal(meshes_get(meshes, tissues), 0);
    assert_false(meshes_copy(meshes, "meniscus", &tissue));
    meshes_ask(meshes, &ask);
    assert_int_equal(ask.message.mesh_ask.have_count, 0);
    answer_ask(&ask);
}

#define WITH_MESHES(test) cmocka_unit_test_setup_teardown(test, open_meshes, close_meshes)

int main(void) {
    log_set_level(LOG_ERROR);
    const struct CMUnitTest tests[] = {
        WITH_MESHES(each_mesh_is_told_once_and_that_it_is_void_with_another_case),
        WITH_MESHES(a_change_in_chunks_is_made_and_acknowledged),
        WITH_MESHES(a_missing_chunk_is_asked_for_once),
        WITH_MESHES(a_chunk_that_comes_twice_is_out_of_order),
        WITH_MESHES(chunks_of_two_payloads_make_none),
        WITH_MESHES(a_first_chunk_ends_the_payload_before),
        WITH_MESHES(payloads_of_two_groups_may_alternate),
        WITH_MESHES(after_a_gap_it_asks_with_what_it_has),
        WITH_MESHES(what_it_has_passed_is_acknowledged_and_nothing_else),
        WITH_MESHES(a_flipped_bit_is_asked_for_again),
        WITH_MESHES(what_cannot_be_made_is_asked_for_from_nothing),
        WITH_MESHES(it_does_not_ask_for_ever),
        WITH_MESHES(a_ninth_group_is_not_followed),
        WITH_MESHES(meshes_of_another_case_are_void),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
