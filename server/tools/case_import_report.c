#include "case_import_report.h"

#include <stdio.h>

#define COUNTS_MAX 16

// A count of something, and how it reads: "%u open edges".
struct count {
    const char *key, *one, *many;
    int64_t value;
};

struct counts {
    int count;
    struct count all[COUNTS_MAX];
};

static void add(struct counts *counts, const char *key, const char *one, const char *many,
                int64_t value) {
    counts->all[counts->count++] = (struct count){key, one, many, value};
}

static void add_topology(struct counts *counts, const struct topology *t) {
    add(counts, "open_edges", "open edge", "open edges", t->open_edges);
    add(counts, "non_manifold_edges", "edge of more than two triangles",
        "edges of more than two triangles", t->non_manifold_edges);
    add(counts, "non_manifold_vertices", "vertex where sheets touch", "vertices where sheets touch",
        t->non_manifold_vertices);
    add(counts, "flipped_edges", "edge where triangles disagree", "edges where triangles disagree",
        t->flipped_edges);
    add(counts, "handles", "handle", "handles", t->genus > 0 ? t->genus : 0);
    add(counts, "further_components", "further component", "further components",
        t->components ? t->components - 1 : 0);
}

static struct counts wrong(const struct repair_report *r) {
    struct counts counts = {0};
    add_topology(&counts, &r->before);
    add(&counts, "repeated_corners", "triangle with a repeated corner",
        "triangles with a repeated corner", r->repeated_corners);
    add(&counts, "duplicate_triangles", "triangle that is there already",
        "triangles that are there already", r->duplicate_triangles + r->wall_triangles / 2);
    add(&counts, "unused_vertices", "unused vertex", "unused vertices", r->before.unused_vertices);
    return counts;
}

static struct counts done(const struct repair_report *r) {
    struct counts counts = {0};
    add(&counts, "welded_vertices", "vertex welded", "vertices welded", r->welded_vertices);
    add(&counts, "removed_triangles", "bad triangle removed", "bad triangles removed",
        (int64_t)r->repeated_corners + r->duplicate_triangles);
    add(&counts, "removed_wall_triangles", "triangle of flat walls removed",
        "triangles of flat walls removed", r->wall_triangles);
    add(&counts, "removed_fins", "fin taken off", "fins taken off", r->fin_count);
    add(&counts, "turned_triangles", "triangle turned", "triangles turned", r->turned_triangles);
    add(&counts, "split_vertices", "vertex split off", "vertices split off", r->split_vertices);
    add(&counts, "removed_islands", "island removed", "islands removed", r->island_count);
    add(&counts, "dropped_vertices", "unused vertex dropped", "unused vertices dropped",
        r->before.unused_vertices);
    return counts;
}

static struct counts remains(const struct repair_report *r) {
    struct counts counts = {0};
    add_topology(&counts, &r->after);
    add(&counts, "voids", "void inside", "voids inside", r->voids);
    add(&counts, "flat_triangles", "triangle without height", "triangles without height",
        r->flat_triangles);
    return counts;
}

static bool is_empty(const struct counts *counts) {
    for (int i = 0; i < counts->count; i++)
        if (counts->all[i].value)
            return false;
    return true;
}

static void print_counts(const char *heading, const struct counts *counts) {
    const char *between = "";
    printf("  %-8s ", heading);
    for (int i = 0; i < counts->count; i++) {
        const struct count *c = &counts->all[i];
        if (!c->value)
            continue;
        printf("%s%lld %s", between, (long long)c->value, c->value == 1 ? c->one : c->many);
        between = ", ";
    }
    puts(is_empty(counts) ? "nothing" : "");
}

static void print_places(const char *what, const struct repair_island *places, uint32_t count,
                         double area_mm2) {
    for (uint32_t i = 0; i < count && i < REPAIR_ISLANDS_MAX; i++)
        printf("           %s: %u triangles, %.3g mm2 of %.0f, at %.1f %.1f %.1f mm\n", what,
               places[i].triangles, places[i].area_mm2, area_mm2, places[i].centre.x,
               places[i].centre.y, places[i].centre.z);
    if (count > REPAIR_ISLANDS_MAX)
        printf("           and %u more\n", count - REPAIR_ISLANDS_MAX);
}

static void print_islands(const struct repair_report *r) {
    print_places("fin", r->fins, r->fin_count, r->area_mm2);
    print_places("island", r->islands, r->island_count, r->area_mm2);
    if (r->island_count > REPAIR_ISLANDS_MAX)
        printf("           all islands: %u triangles, %.3g mm2\n", r->island_triangles,
               r->island_area_mm2);
}

static bool can_be_cut(const struct topology *t) {
    return t->closed && t->manifold && t->oriented && t->components == 1;
}

void import_print(const struct import_said *said) {
    const struct repair_report *r = said->report;
    struct counts was = wrong(r), did = done(r), left = remains(r);
    printf("%s: %s: %u vertices, %u triangles, %s%s\n", said->group, said->file,
           said->mesh->vertex_count, said->mesh->triangle_count,
           r->after.closed ? "closed" : "open", can_be_cut(&r->after) ? "" : ", not cuttable");
    if (said->clip->planes)
        printf("  clipped: %u triangles left out far from the joint, %s\n",
               said->clip->removed_triangles,
               said->clip->open ? "without a cap, for the mesh is not closed" : "and a cap made");
    if (is_empty(&was) && is_empty(&did) && is_empty(&left))
        return;
    print_counts("wrong:", &was);
    print_counts("done:", &did);
    if (r->welded_mm > 0)
        printf("           a corner was moved by up to %.2g mm\n", r->welded_mm);
    print_islands(r);
    print_counts("remains:", &left);
}

static json_t *counts_json(const struct counts *counts) {
    json_t *object = json_object();
    for (int i = 0; i < counts->count; i++)
        json_object_set_new(object, counts->all[i].key, json_integer(counts->all[i].value));
    return object;
}

static json_t *places_json(const struct repair_island *places, uint32_t count) {
    json_t *array = json_array();
    for (uint32_t i = 0; i < count && i < REPAIR_ISLANDS_MAX; i++)
        json_array_append_new(array, json_pack("{s:I, s:f, s:[f,f,f]}", "triangles",
                                               (json_int_t)places[i].triangles, "area_mm2",
                                               places[i].area_mm2, "centre_mm", places[i].centre.x,
                                               places[i].centre.y, places[i].centre.z));
    return array;
}

json_t *import_json(const struct import_said *said) {
    const struct repair_report *r = said->report;
    struct counts was = wrong(r), did = done(r), left = remains(r);
    json_t *all = counts_json(&did);
    json_object_set_new(all, "welded_mm", json_real(r->welded_mm));
    json_object_set_new(all, "island_triangles", json_integer(r->island_triangles));
    json_object_set_new(all, "island_area_mm2", json_real(r->island_area_mm2));
    json_object_set_new(all, "islands", places_json(r->islands, r->island_count));
    json_object_set_new(all, "fins", places_json(r->fins, r->fin_count));
    return json_pack("{s:s, s:s, s:I, s:I, s:b, s:b, s:o, s:o, s:o}", "group", said->group, "file",
                     said->file, "vertices", (json_int_t)said->mesh->vertex_count, "triangles",
                     (json_int_t)said->mesh->triangle_count, "cuttable", can_be_cut(&r->after),
                     "clipped", said->clip->planes > 0, "wrong", counts_json(&was), "done", all,
                     "remains", counts_json(&left));
}
