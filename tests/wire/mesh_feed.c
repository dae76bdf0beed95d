// What a station is sent of a mesh, whatever it has; its tissue beside the plain model.
#include "net/mesh_feed.h"

#include "test.h"
#include "wire/mesh_model.h"

#include <stdlib.h>
#include <string.h>

// A feed with the model that it was made of.
struct source {
    struct model model;
    struct random random;
    struct mesh_feed *feed;
};

static void open_source(struct source *s, uint64_t seed) {
    *s = (struct source){.random = {seed}};
    struct mesh_delta whole = model_change(&s->model, &s->random, 1, 0);
    assert_int_equal(mesh_feed_create("meniscus", &whole, &s->feed, NULL), RESULT_OK);
    mesh_delta_fini(&whole);
}

static void push(struct source *s, double share) {
    struct mesh_delta change = model_change(&s->model, &s->random, share, 77);
    uint32_t number = mesh_feed_tissue(s->feed)->number;
    assert_int_equal(mesh_feed_push(s->feed, &change, NULL), RESULT_OK);
    assert_int_equal(mesh_feed_tissue(s->feed)->number, number + 1);
    assert_int_equal(mesh_feed_tissue(s->feed)->hash, model_hash(&s->model));
    mesh_delta_fini(&change);
}

static arthron_MeshState state_of(const struct tissue *tissue) {
    return (arthron_MeshState){"meniscus", tissue->number, tissue->hash};
}

static struct mesh_cursor asking(uint32_t number, uint64_t hash) {
    arthron_MeshAsk ask = {.have_count = 2, .have = {{"other", 3, 4}, {"meniscus", number, hash}}};
    struct mesh_cursor cursor = {0};
    mesh_cursor_ask(&cursor, "meniscus", &ask);
    return cursor;
}

// What is sent next, taken and acknowledged; false where there is nothing. *out: as it was sent.
static bool take(struct source *s, struct mesh_cursor *cursor, struct tissue *tissue,
                 struct mesh_payload *out) {
    struct mesh_payload *payload = mesh_feed_next(s->feed, cursor);
    if (!payload)
        return false;
    *out = *payload;
    assert_string_equal(payload->group, "meniscus");
    assert_int_equal(payload->hash, tissue_payload_hash(payload->bytes, payload->size));
    assert_int_equal(tissue_apply(tissue, payload->bytes, payload->size, NULL), RESULT_OK);
    assert_int_equal(tissue->number, payload->number);
    model_assert_same(tissue, &s->model);
    mesh_payload_release(&payload);
    arthron_MeshState ack = state_of(tissue);
    mesh_cursor_ack(cursor, &ack);
    return true;
}

static void a_station_that_asks_gets_the_whole_mesh_and_then_each_change(void **state) {
    (void)state;
    struct source source;
    struct mesh_cursor cursor = {0};
    struct tissue tissue = {0};
    struct mesh_payload sent;
    open_source(&source, 1);
    assert_false(take(&source, &cursor, &tissue, &sent)); // it has not asked
    cursor = asking(0, 0);
    assert_true(take(&source, &cursor, &tissue, &sent));
    assert_int_equal(sent.base, 0);
    for (uint32_t i = 1; i < 100; i++) {
        assert_false(take(&source, &cursor, &tissue, &sent)); // it has all
        push(&source, 0.02);
        assert_true(take(&source, &cursor, &tissue, &sent));
        assert_int_equal(sent.base, i);
        assert_int_equal(sent.number, i + 1);
    }
    tissue_fini(&tissue);
    mesh_feed_destroy(&source.feed);
}

static void changes_while_a_payload_is_on_its_way_share_the_next_one(void **state) {
    (void)state;
    struct source source;
    struct tissue tissue = {0};
    struct mesh_payload sent;
    open_source(&source, 2);
    struct mesh_cursor cursor = asking(0, 0);
    struct mesh_payload *first = mesh_feed_next(source.feed, &cursor);
    assert_int_equal(tissue_apply(&tissue, first->bytes, first->size, NULL), RESULT_OK);
    for (int i = 0; i < 4; i++) {
        push(&source, 0.02);
        assert_null(mesh_feed_next(source.feed, &cursor));
    }
    arthron_MeshState ack = state_of(&tissue);
    mesh_cursor_ack(&cursor, &ack);
    assert_true(take(&source, &cursor, &tissue, &sent));
    assert_int_equal(sent.base, 1);
    assert_int_equal(sent.number, 5);
    mesh_payload_release(&first);
    tissue_fini(&tissue);
    mesh_feed_destroy(&source.feed);
}

// Whatever it has, it is brought up to date by no more bytes than the whole mesh has.
static void a_station_that_comes_back_gets_what_it_lacks(void **state) {
    (void)state;
    enum { CHANGES = 120 };
    static struct tissue old[CHANGES + 1];
    struct source source;
    struct mesh_payload sent;
    size_t by_changes = 0;
    open_source(&source, 3);
    for (uint32_t i = 1; i <= CHANGES; i++) {
        tissue_copy(&old[i], mesh_feed_tissue(source.feed));
        push(&source, 0.01);
    }
    struct tissue fresh = {0};
    struct mesh_cursor cursor = asking(0, 0);
    assert_true(take(&source, &cursor, &fresh, &sent));
    size_t whole = sent.size;
    for (uint32_t i = CHANGES; i >= 1; i--) {
        cursor = asking(i, old[i].hash);
        assert_true(take(&source, &cursor, &old[i], &sent));
        assert_true(sent.base == 0 || sent.base == i);
        assert_true(sent.size <= whole);
        if (sent.base == i)
            assert_int_equal(by_changes++, CHANGES - i); // the last ones are kept, without a gap
        tissue_fini(&old[i]);
    }
    assert_in_range(by_changes, 5, CHANGES - 5);
    tissue_fini(&fresh);
    mesh_feed_destroy(&source.feed);
}

static void a_station_with_another_mesh_gets_the_whole(void **state) {
    (void)state;
    struct source source;
    struct mesh_payload sent;
    open_source(&source, 4);
    push(&source, 0.01);
    push(&source, 0.01);
    uint64_t hash = mesh_feed_tissue(source.feed)->hash;
    const struct {
        uint32_t number;
        uint64_t hash;
    } rows[] = {{1, 5}, {2, hash}, {3, hash + 1}, {4, hash}, {UINT32_MAX, hash}, {0, hash}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct tissue tissue = {0};
        struct mesh_cursor cursor = asking(rows[i].number, rows[i].hash);
        assert_true(take(&source, &cursor, &tissue, &sent));
        assert_int_equal(sent.base, 0);
        assert_false(take(&source, &cursor, &tissue, &sent));
        tissue_fini(&tissue);
    }
    struct mesh_cursor cursor = asking(3, hash);
    assert_null(mesh_feed_next(source.feed, &cursor));
    mesh_feed_destroy(&source.feed);
}

static void only_the_awaited_acknowledgement_counts(void **state) {
    (void)state;
    struct source source;
    open_source(&source, 5);
    struct mesh_cursor cursor = asking(0, 0);
    struct mesh_payload *payload = mesh_feed_next(source.feed, &cursor);
    arthron_MeshState ack = {"meniscus", 2, mesh_feed_tissue(source.feed)->hash};
    mesh_payload_release(&payload);
    push(&source, 0.01);
    mesh_cursor_ack(&cursor, &ack);
    assert_null(mesh_feed_next(source.feed, &cursor));
    ack.number = 1; // the right one, but of another mesh
    ack.hash++;
    mesh_cursor_ack(&cursor, &ack);
    payload = mesh_feed_next(source.feed, &cursor);
    assert_int_equal(payload->base, 0);
    mesh_payload_release(&payload);
    mesh_feed_destroy(&source.feed);
}

static void a_mesh_that_cannot_travel_is_refused(void **state) {
    (void)state;
    struct delta_vertex vertices[] = {{0, {0}}, {1, {1}}, {2, {2}}};
    struct delta_triangle made = {0, {0, 1, 2}, 0};
    struct mesh_delta whole = {
        .vertex_count = 3, .vertices = vertices, .made_count = 1, .made = &made};
    struct mesh_feed *feed;
    struct error err;
    made.id = MESH_DELTA_IDS_MAX;
    assert_int_equal(mesh_feed_create("m", &whole, &feed, &err), RESULT_LIMIT);
    assert_null(feed);
    made.id = MESH_DELTA_IDS_MAX - 1;
    made.corners[1] = 3;
    assert_int_equal(mesh_feed_create("m", &whole, &feed, &err), RESULT_INVALID);
    made.corners[1] = 1;
    assert_int_equal(mesh_feed_create("m", &whole, &feed, &err), RESULT_OK);
    whole.vertex_count = 0; // its vertices are there, its triangle gets the same corners again
    made.corners[2] = 3;
    assert_int_equal(mesh_feed_push(feed, &whole, &err), RESULT_INVALID);
    mesh_feed_destroy(&feed);
}

static void a_payload_outlives_its_feed(void **state) {
    (void)state;
    struct source source;
    struct tissue tissue = {0};
    open_source(&source, 6);
    struct mesh_cursor cursor = asking(0, 0);
    struct mesh_payload *payload = mesh_feed_next(source.feed, &cursor), *other;
    other = mesh_payload_hold(payload);
    mesh_feed_destroy(&source.feed);
    mesh_payload_release(&other);
    assert_null(other);
    assert_int_equal(tissue_apply(&tissue, payload->bytes, payload->size, NULL), RESULT_OK);
    model_assert_same(&tissue, &source.model);
    mesh_payload_release(&payload);
    tissue_fini(&tissue);
}

// Two sessions of a case: what one cuts, the other does not see, nor who comes later.
static void feeds_that_begin_with_one_mesh_change_apart(void **state) {
    (void)state;
    struct source cut, whole;
    struct tissue of_cut = {0}, of_whole = {0};
    struct mesh_payload sent;
    open_source(&whole, 9);
    open_source(&cut, 9); // the same model
    struct mesh_feed *start = whole.feed;
    mesh_feed_destroy(&cut.feed);
    cut.feed = mesh_feed_share(start);
    whole.feed = mesh_feed_share(start);
    struct mesh_cursor first = asking(0, 0), second = asking(0, 0);
    assert_true(take(&cut, &first, &of_cut, &sent));
    push(&cut, 0.2);
    push(&cut, 0.2);
    assert_true(take(&cut, &first, &of_cut, &sent));
    assert_int_equal(sent.base, 1);
    assert_true(take(&whole, &second, &of_whole, &sent));
    assert_int_equal(of_whole.number, 1);
    assert_false(take(&whole, &second, &of_whole, &sent));
    mesh_feed_destroy(&cut.feed);
    mesh_feed_destroy(&whole.feed);
    mesh_feed_destroy(&start);
    tissue_fini(&of_cut);
    tissue_fini(&of_whole);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_station_that_asks_gets_the_whole_mesh_and_then_each_change),
        cmocka_unit_test(changes_while_a_payload_is_on_its_way_share_the_next_one),
        cmocka_unit_test(a_station_that_comes_back_gets_what_it_lacks),
        cmocka_unit_test(a_station_with_another_mesh_gets_the_whole),
        cmocka_unit_test(only_the_awaited_acknowledgement_counts),
        cmocka_unit_test(a_mesh_that_cannot_travel_is_refused),
        cmocka_unit_test(a_payload_outlives_its_feed),
        cmocka_unit_test(feeds_that_begin_with_one_mesh_change_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
