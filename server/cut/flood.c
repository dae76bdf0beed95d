#include "cut/flood.h"

#include <stdlib.h>

#define STRIDE 32 // triangles at a time

void flood_fini(struct flood *flood) {
    stamped_set_fini(&flood->owner);
    cavities_fini(&flood->cavities);
    ids_fini(&flood->list);
    free(flood->entries);
    free(flood->bodies);
    *flood = (struct flood){0};
}

// ---- lists ----

static void append(struct flood *flood, struct triangle_list *list, uint32_t entry) {
    flood->entries[entry].next = MESH_NONE;
    if (list->first == MESH_NONE)
        list->first = entry;
    else
        flood->entries[list->last].next = entry;
    list->last = entry;
}

static void append_all(struct flood *flood, struct triangle_list *list, struct triangle_list more) {
    if (more.first == MESH_NONE)
        return;
    if (list->first == MESH_NONE)
        list->first = more.first;
    else
        flood->entries[list->last].next = more.first;
    list->last = more.last;
}

static void claim(struct flood *flood, uint32_t body, uint32_t triangle) {
    flood->entries = array_grow(flood->entries, &flood->entry_room, flood->entry_count + 1,
                                sizeof *flood->entries);
    flood->entries[flood->entry_count].triangle = triangle;
    append(flood, &flood->bodies[body].waiting, flood->entry_count++);
    flood->bodies[body].count++;
    stamped_set_put(&flood->owner, triangle, body);
}

// ---- bodies ----

static uint32_t body_of(struct flood *flood, uint32_t triangle) {
    uint32_t body = stamped_set_get(&flood->owner, triangle);
    while (flood->bodies[body].parent != body)
        body = flood->bodies[body].parent = flood->bodies[flood->bodies[body].parent].parent;
    return body;
}

static void merge_bodies(struct flood *flood, uint32_t body, uint32_t other) {
    struct flood_body *b = &flood->bodies[body], *o = &flood->bodies[other];
    append_all(flood, &b->done, o->done);
    append_all(flood, &b->waiting, o->waiting);
    b->count += o->count;
    o->parent = body;
}

// What the cut has touched and hangs together with a triangle.
static void add_body(const struct cut_mesh *mesh, struct flood *flood, uint32_t triangle) {
    uint32_t body = flood->body_count++;
    struct triangle_list none = {MESH_NONE, MESH_NONE};
    flood->bodies =
        array_grow(flood->bodies, &flood->body_room, flood->body_count, sizeof *flood->bodies);
    flood->bodies[body] = (struct flood_body){.parent = body, .done = none, .waiting = none};
    claim(flood, body, triangle);
    for (uint32_t e = flood->entry_count - 1; e != MESH_NONE; e = flood->entries[e].next)
        for (size_t i = 0; i < 3; i++) {
            uint32_t beside = mesh->twins[3 * (size_t)flood->entries[e].triangle + i] / 3;
            if (stamped_set_has(&mesh->scratch->undo.triangles_seen, beside) &&
                !stamped_set_has(&flood->owner, beside))
                claim(flood, body, beside);
        }
}

// One triangle further. The number of bodies that have become part of this one.
static uint32_t advance(const struct cut_mesh *mesh, struct flood *flood, uint32_t body) {
    uint32_t merged = 0;
    uint32_t entry = flood->bodies[body].waiting.first;
    uint32_t triangle = flood->entries[entry].triangle;
    flood->bodies[body].waiting.first = flood->entries[entry].next;
    append(flood, &flood->bodies[body].done, entry);
    for (size_t i = 0; i < 3; i++) {
        uint32_t beside = mesh->twins[3 * (size_t)triangle + i] / 3;
        if (!stamped_set_has(&flood->owner, beside)) {
            claim(flood, body, beside);
        } else if (body_of(flood, beside) != body) {
            merge_bodies(flood, body, body_of(flood, beside));
            merged++;
        }
    }
    return merged;
}

static uint32_t smallest(const struct flood *flood) {
    uint32_t best = MESH_NONE;
    for (uint32_t b = 0; b < flood->body_count; b++)
        if (flood->bodies[b].parent == b && !flood->bodies[b].whole &&
            (best == MESH_NONE || flood->bodies[b].count < flood->bodies[best].count))
            best = b;
    return best;
}

uint32_t flood_run(const struct cut_mesh *mesh, struct flood *flood) {
    flood->entry_count = flood->body_count = 0;
    stamped_set_begin(&flood->owner, mesh->triangle_room);
    for (uint32_t i = 0; i < mesh->scratch->undo.triangle_count; i++) {
        uint32_t triangle = mesh->scratch->undo.triangles[i].id;
        if (cut_mesh_triangle_alive(mesh, triangle) && !stamped_set_has(&flood->owner, triangle))
            add_body(mesh, flood, triangle);
    }
    uint32_t bodies = flood->body_count;
    for (uint32_t growing = bodies; growing > 1;) {
        uint32_t body = smallest(flood);
        const struct triangle_list *waiting = &flood->bodies[body].waiting;
        for (int i = 0; i < STRIDE && waiting->first != MESH_NONE; i++) {
            uint32_t merged = advance(mesh, flood, body);
            growing -= merged;
            bodies -= merged;
        }
        if (waiting->first == MESH_NONE) {
            flood->bodies[body].whole = true;
            growing--;
        }
    }
    return bodies;
}

void flood_finish(const struct cut_mesh *mesh, struct flood *flood, uint32_t body) {
    while (flood->bodies[body].waiting.first != MESH_NONE)
        advance(mesh, flood, body);
    flood->bodies[body].whole = true;
}
