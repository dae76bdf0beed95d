// Real cuts on their way to a station: after each one it has the mesh that the server cut.
#include "cutting/bites.h"
#include "cutting/specimens.h"
#include "runtime/tissue_delta.h"
#include "net/mesh_feed.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

#define TRIANGLES 20000
#define BITES 150

static void assert_same_mesh(const struct tissue *tissue, const struct cut_mesh *mesh) {
    uint32_t vertices = 0;
    assert_int_equal(tissue->triangle_count, cut_mesh_triangle_count(mesh));
    for (uint32_t i = 0; i < cut_mesh_triangle_bound(mesh); i++) {
        assert_int_equal(tissue_triangle_alive(tissue, i), cut_mesh_triangle_alive(mesh, i));
        if (!cut_mesh_triangle_alive(mesh, i))
            continue;
        assert_memory_equal(tissue->corners + 3 * (size_t)i, cut_mesh_triangle(mesh, i), 12);
        assert_int_equal(tissue->labels[i], cut_mesh_label(mesh, i));
    }
    for (uint32_t i = 0; i < cut_mesh_vertex_bound(mesh); i++) {
        if (!cut_mesh_vertex_alive(mesh, i))
            continue;
        vec3 p = cut_mesh_vertex(mesh, i);
        const float position[3] = {(float)p.x, (float)p.y, (float)p.z};
        assert_memory_equal(tissue->positions + 3 * (size_t)i, position, sizeof position);
        vertices++;
    }
    assert_int_equal(tissue->vertex_count, vertices);
}

// What one cut takes on the wire, and what was cut.
struct sent {
    size_t bytes;
    uint32_t made;
    uint32_t pieces;
};

struct operation_by_hand {
    struct cut_mesh *mesh;
    struct mesh_feed *feed;
    struct mesh_cursor cursor;
    struct tissue station;
    size_t whole; // bytes
};

static size_t send(struct operation_by_hand *o) {
    struct mesh_payload *payload = mesh_feed_next(o->feed, &o->cursor);
    assert_non_null(payload);
    size_t size = payload->size;
    assert_int_equal(tissue_apply(&o->station, payload->bytes, size, NULL), RESULT_OK);
    arthron_MeshState ack = {"meniscus", o->station.number, o->station.hash};
    mesh_cursor_ack(&o->cursor, &ack);
    mesh_payload_release(&payload);
    return size;
}

static void begin(struct operation_by_hand *o) {
    struct mesh mesh;
    struct mesh_delta whole;
    specimen_meniscus(&mesh, false, TRIANGLES);
    *o = (struct operation_by_hand){.cursor.asked = true};
    assert_int_equal(cut_mesh_create(&mesh, &o->mesh, NULL), RESULT_OK);
    tissue_delta_whole(o->mesh, &whole);
    assert_int_equal(mesh_feed_create("meniscus", &whole, &o->feed, NULL), RESULT_OK);
    o->whole = send(o);
    mesh_delta_fini(&whole);
    mesh_fini(&mesh);
}

static void end(struct operation_by_hand *o) {
    mesh_feed_destroy(&o->feed);
    cut_mesh_destroy(&o->mesh);
    tissue_fini(&o->station);
}

// False where the bite changed nothing.
static bool cut(struct operation_by_hand *o, const struct bite *bite, struct sent *out) {
    struct cut_change change = {0};
    struct mesh_delta delta;
    struct error err;
    if (cut_apply(o->mesh, bite->parts, bite->part_count, &change, &err) != CUT_CHANGED)
        return false;
    tissue_delta_of_change(o->mesh, &change, &delta);
    if (mesh_feed_push(o->feed, &delta, &err) != RESULT_OK)
        fail_msg("cut %u: %s", change.number, err.text);
    assert_int_equal(mesh_feed_tissue(o->feed)->number, change.number + 1);
    *out = (struct sent){.made = change.made_count, .pieces = (uint32_t)change.piece_count};
    mesh_delta_fini(&delta);
    cut_change_fini(&change);
    return true;
}

static void a_station_has_the_mesh_that_was_cut(void **state) {
    (void)state;
    struct operation_by_hand o;
    struct biter biter;
    int changes = 0, nibbles = 0;
    size_t bytes = 0, made = 0;
    begin(&o);
    assert_same_mesh(&o.station, o.mesh);
    biter_init(&biter, 1);
    for (int i = 0; i < BITES; i++) {
        struct sent sent;
        biter_next(&biter, o.mesh);
        if (!cut(&o, &biter.last, &sent))
            continue;
        sent.bytes = send(&o);
        assert_same_mesh(&o.station, o.mesh);
        changes++;
        if (biter.kind != BITE_NIBBLE || sent.pieces)
            continue;
        nibbles++;
        bytes += sent.bytes;
        made += sent.made;
    }
    assert_true(changes > BITES / 3);
    print_message("whole %zu bytes; of %d bites %d changed it; a nibble on average %zu bytes, "
                  "%.2f %%, for %zu triangles\n",
                  o.whole, BITES, changes, bytes / (size_t)nibbles,
                  100.0 * (double)bytes / nibbles / (double)o.whole, made / (size_t)nibbles);
    end(&o);
}

static void a_station_that_was_away_has_it_too(void **state) {
    (void)state;
    struct operation_by_hand o;
    struct biter biter;
    begin(&o);
    biter_init(&biter, 2);
    for (int i = 0; i < 40; i++) {
        struct sent sent;
        biter_next(&biter, o.mesh);
        cut(&o, &biter.last, &sent);
    }
    assert_true(send(&o) <= o.whole);
    assert_same_mesh(&o.station, o.mesh);
    end(&o);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_station_has_the_mesh_that_was_cut),
        cmocka_unit_test(a_station_that_was_away_has_it_too),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
