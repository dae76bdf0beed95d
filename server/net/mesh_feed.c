#include "net/mesh_feed.h"

#include "base/check.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// One change, encoded, and the hash of the mesh before it.
struct kept_change {
    uint64_t base_hash;
    size_t size;
    uint8_t *bytes;
};

struct mesh_feed {
    char group[MESH_GROUP_MAX];
    const struct mesh_feed *start; // has the tissue until a change; NULL: it is here
    struct tissue tissue;
    struct mesh_payload *whole; // of the tissue as it is; NULL: not made yet
    size_t whole_size;          // of the last one made
    struct kept_change *kept;   // the last ones, oldest first
    uint32_t kept_count;
    size_t kept_size; // of all their bytes
};

// ---- the whole mesh -----------------------------------------------------------------------------

static void make_whole(struct mesh_feed *feed) {
    struct mesh_delta whole;
    tissue_whole(&feed->tissue, &whole);
    size_t bound = mesh_delta_bound(&whole);
    uint8_t *bytes = alloc(bound, 1);
    feed->whole_size = mesh_delta_encode(&whole, bytes, bound);
    feed->whole = mesh_payload_create(feed->group, 0, whole.number, feed->whole_size);
    memcpy(feed->whole->bytes, bytes, feed->whole_size);
    mesh_payload_seal(feed->whole);
    mesh_delta_fini(&whole);
    free(bytes);
}

// ---- the changes that are kept ------------------------------------------------------------------

static void forget(struct mesh_feed *feed, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        feed->kept_size -= feed->kept[i].size;
        free(feed->kept[i].bytes);
    }
    feed->kept_count -= count;
    if (feed->kept_count)
        memmove(feed->kept, feed->kept + count, feed->kept_count * sizeof *feed->kept);
}

// No more than half of what a whole mesh takes: always worth sending instead of it.
static void forget_what_is_too_much(struct mesh_feed *feed) {
    size_t size = feed->kept_size;
    uint32_t count = 0;
    while (size > feed->whole_size / 2)
        size -= feed->kept[count++].size;
    forget(feed, count);
}

static void keep(struct mesh_feed *feed, const struct mesh_delta *change, uint64_t base_hash) {
    size_t bound = mesh_delta_bound(change);
    struct kept_change kept = {.base_hash = base_hash, .bytes = alloc(bound, 1)};
    kept.size = mesh_delta_encode(change, kept.bytes, bound);
    kept.bytes = alloc_resize(kept.bytes, kept.size, 1);
    feed->kept = alloc_resize(feed->kept, feed->kept_count + 1ul, sizeof *feed->kept);
    feed->kept[feed->kept_count++] = kept;
    feed->kept_size += kept.size;
    forget_what_is_too_much(feed);
}

// ---- making -------------------------------------------------------------------------------------

enum result mesh_feed_create(const char *group, const struct mesh_delta *whole,
                             struct mesh_feed **out_feed, struct error *err) {
    struct mesh_feed *feed = alloc(1, sizeof *feed);
    struct mesh_delta first = {.number = whole->number ? whole->number : 1,
                               .vertex_count = whole->vertex_count,
                               .vertices = whole->vertices,
                               .made_count = whole->made_count,
                               .made = whole->made};
    snprintf(feed->group, sizeof feed->group, "%s", group);
    enum result result = mesh_delta_validate(&first, err);
    if (result == RESULT_OK)
        result = tissue_change(&feed->tissue, &first, err);
    if (result == RESULT_OK)
        make_whole(feed);
    else
        mesh_feed_destroy(&feed);
    *out_feed = feed;
    return result;
}

struct mesh_feed *mesh_feed_share(const struct mesh_feed *start) {
    struct mesh_feed *feed = alloc(1, sizeof *feed);
    CHECK(!start->start && start->whole);
    memcpy(feed->group, start->group, sizeof feed->group);
    feed->start = start;
    feed->whole = mesh_payload_hold(start->whole);
    feed->whole_size = start->whole_size;
    return feed;
}

void mesh_feed_destroy(struct mesh_feed **feed) {
    if (!*feed)
        return;
    forget(*feed, (*feed)->kept_count);
    free((*feed)->kept);
    mesh_payload_release(&(*feed)->whole);
    tissue_fini(&(*feed)->tissue);
    free(*feed);
    *feed = NULL;
}

enum result mesh_feed_push(struct mesh_feed *feed, const struct mesh_delta *change,
                           struct error *err) {
    struct mesh_delta next = *change;
    if (feed->start)
        tissue_copy(&feed->tissue, &feed->start->tissue);
    feed->start = NULL;
    uint64_t base_hash = feed->tissue.hash;
    next.base = feed->tissue.number;
    next.number = next.base + 1;
    enum result result = mesh_delta_validate(&next, err);
    if (result == RESULT_OK)
        result = tissue_change(&feed->tissue, &next, err);
    if (result != RESULT_OK)
        return result;
    next.hash = feed->tissue.hash;
    keep(feed, &next, base_hash);
    mesh_payload_release(&feed->whole);
    return RESULT_OK;
}

const struct tissue *mesh_feed_tissue(const struct mesh_feed *feed) {
    return feed->start ? &feed->start->tissue : &feed->tissue;
}

// ---- what a station lacks -----------------------------------------------------------------------

void mesh_cursor_ask(struct mesh_cursor *cursor, const char *group, const arthron_MeshAsk *ask) {
    *cursor = (struct mesh_cursor){.asked = true};
    for (int i = 0; i < ask->have_count; i++)
        if (!strcmp(ask->have[i].group, group)) {
            cursor->number = ask->have[i].number;
            cursor->hash = ask->have[i].hash;
        }
}

void mesh_cursor_ack(struct mesh_cursor *cursor, const arthron_MeshState *ack) {
    if (cursor->sent && ack->number == cursor->sent)
        *cursor = (struct mesh_cursor){.asked = true, .number = ack->number, .hash = ack->hash};
}

static bool has_all(const struct mesh_feed *feed, const struct mesh_cursor *cursor) {
    const struct tissue *tissue = mesh_feed_tissue(feed);
    return cursor->number == tissue->number && cursor->hash == tissue->hash;
}

// The kept changes from `first` on, one behind the other.
static struct mesh_payload *changes_from(const struct mesh_feed *feed, uint32_t first) {
    size_t size = 0, used = 0;
    for (uint32_t i = first; i < feed->kept_count; i++)
        size += feed->kept[i].size;
    uint32_t number = mesh_feed_tissue(feed)->number;
    struct mesh_payload *payload =
        mesh_payload_create(feed->group, number - (feed->kept_count - first), number, size);
    for (uint32_t i = first; i < feed->kept_count; i++) {
        memcpy(payload->bytes + used, feed->kept[i].bytes, feed->kept[i].size);
        used += feed->kept[i].size;
    }
    mesh_payload_seal(payload);
    return payload;
}

// The changes behind what the station has; NULL where they are not kept, or it has another mesh.
static struct mesh_payload *lacking_changes(const struct mesh_feed *feed,
                                            const struct mesh_cursor *cursor) {
    uint32_t oldest =
        mesh_feed_tissue(feed)->number - feed->kept_count; // the base of the first one kept
    uint32_t first = cursor->number - oldest;
    if (cursor->number < oldest || first >= feed->kept_count ||
        feed->kept[first].base_hash != cursor->hash)
        return NULL;
    return changes_from(feed, first);
}

struct mesh_payload *mesh_feed_next(struct mesh_feed *feed, struct mesh_cursor *cursor) {
    if (!cursor->asked || cursor->sent || has_all(feed, cursor))
        return NULL;
    cursor->sent = mesh_feed_tissue(feed)->number;
    struct mesh_payload *changes = lacking_changes(feed, cursor);
    if (changes)
        return changes;
    if (!feed->whole)
        make_whole(feed);
    return mesh_payload_hold(feed->whole);
}
