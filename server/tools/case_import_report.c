#include "case_import_report.h"

#include <stdio.h>

#define COUNTS_MAX 16

// A count of something, and how it reads: "%u open edges".
struct count {
    const char *key, *one, *many;
    int64_t value;
    const struct repair_place *place; // NULL: it has none
};

struct counts {
    int count;
    struct count all[COUNTS_MAX];
};

static struct count *add(struct counts *counts, const char *key, const char *one, const char *many,
                         int64_t value) {
    struct count *count = &counts->all[counts->count++];
    *count = (struct count){key, one, many, value, NULL};
    return count;
}

static void add_at(struct counts *counts, const char *key, const char *one, const char *many,
                   int64_t value, const struct repair_report *report, enum repair_kind kind) {
    const struct repair_place *place = &report->places[kind];
    add(counts, key, one, many, value)->place = place->somewhere ? place : NULL;
}

// places: of what is left, or NULL.
static void add_topology(struct counts *counts, const struct topology *t,
                         const struct repair_place *places) {
    struct count *open = add(counts, "open_edges", "open edge", "open edges", t->open_edges);
    struct count *crowded = add(counts, "non_manifold_edges", "edge of more than two triangles",
                                "edges of more than two triangles", t->non_manifold_edges);
    open->place = places && places[REPAIR_OPEN].somewhere ? &places[REPAIR_OPEN] : NULL;
    crowded->place = places && places[REPAIR_CROWDED].somewhere ? &places[REPAIR_CROWDED] : NULL;
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
    add_topology(&counts, &r->before, NULL);
    add(&counts, "repeated_corners", "triangle with a repeated corner",
        "triangles with a repeated corner", r->repeated_corners);
    add(&counts, "duplicate_triangles", "triangle that is there already",
        "triangles that are there already", r->duplicate_triangles + r->wall_triangles / 2);
    add(&counts, "unused_vertices", "unused vertex", "unused vertices", r->before.unused_vertices);
    return counts;
}

static struct counts done(const struct repair_report *r) {
    struct counts counts = {0};
    add_at(&counts, "welded_vertices", "vertex welded", "vertices welded", r->welded_vertices, r,
           REPAIR_WELDED);
    add_at(&counts, "removed_bad_triangles", "triangle with a repeated corner removed",
           "triangles with a repeated corner removed", r->repeated_corners, r, REPAIR_REPEATED);
    add_at(&counts, "removed_duplicates", "duplicate triangle removed",
           "duplicate triangles removed", r->duplicate_triangles, r, REPAIR_DUPLICATE);
    add_at(&counts, "removed_wall_triangles", "triangle of flat walls removed",
           "triangles of flat walls removed", r->wall_triangles, r, REPAIR_WALL);
    add(&counts, "removed_fins", "fin taken off", "fins taken off", r->fin_count);
    add_at(&counts, "turned_triangles", "triangle turned", "triangles turned", r->turned_triangles,
           r, REPAIR_TURNED);
    add_at(&counts, "split_vertices", "vertex split off", "vertices split off", r->split_vertices,
           r, REPAIR_SPLIT);
    add(&counts, "removed_islands", "island removed", "islands removed", r->island_count);
    add(&counts, "dropped_vertices", "unused vertex dropped", "unused vertices dropped",
        r->before.unused_vertices);
    return counts;
}

static struct counts remains(const struct repair_report *r) {
    struct counts counts = {0};
    add_topology(&counts, &r->after, r->places);
    add_at(&counts, "voids", "void inside", "voids inside", r->voids, r, REPAIR_VOID);
    add_at(&counts, "flat_triangles", "triangle without height", "triangles without height",
           r->flat_triangles, r, REPAIR_FLAT);
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

vec3 import_in_scan(const struct knee_case *knee, vec3 p) {
    vec3 in_scan = pose_apply(pose_inverse(knee->T_case_scan), p);
    if (knee->scan_mirrored)
        in_scan.x = -in_scan.x;
    return in_scan;
}

static vec3 middle_of(struct box box) {
    return vec3_scale(0.5, vec3_add(box.min, box.max));
}

static void print_at(const struct import_said *said, vec3 p) {
    vec3 s = import_in_scan(said->knee, p);
    printf("at %.1f %.1f %.1f mm; in the scan at %.1f %.1f %.1f\n", p.x, p.y, p.z, s.x, s.y, s.z);
}

static void print_boxes(const struct import_said *said, const struct counts *counts) {
    for (int i = 0; i < counts->count; i++) {
        const struct count *c = &counts->all[i];
        if (!c->value || !c->place)
            continue;
        printf("           %s: %.1f mm across, ", c->value == 1 ? c->one : c->many,
               vec3_distance(c->place->box.min, c->place->box.max));
        print_at(said, middle_of(c->place->box));
    }
}

static void print_islands_of(const struct import_said *said, const char *what,
                             const struct repair_island *islands, uint32_t count) {
    for (uint32_t i = 0; i < count && i < REPAIR_ISLANDS_MAX; i++) {
        printf("           %s: %u triangles, %.3g mm2 of %.0f, ", what, islands[i].triangles,
               islands[i].area_mm2, said->report->area_mm2);
        print_at(said, islands[i].centre);
    }
    if (count > REPAIR_ISLANDS_MAX)
        printf("           and %u more\n", count - REPAIR_ISLANDS_MAX);
}

static void print_islands(const struct import_said *said) {
    const struct repair_report *r = said->report;
    print_islands_of(said, "fin", r->fins, r->fin_count);
    print_islands_of(said, "island", r->islands, r->island_count);
    if (r->island_count > REPAIR_ISLANDS_MAX)
        printf("           all islands: %u triangles, %.3g mm2\n", r->island_triangles,
               r->island_area_mm2);
}

static void print_clip(const struct import_said *said) {
    if (said->clip->plane_count)
        printf("  clipped: %u triangles reached too far from the joint\n",
               said->clip->far_triangles);
    for (int i = 0; i < said->clip->plane_count; i++) {
        const struct clip_plane *plane = &said->clip->planes[i];
        vec3 size = vec3_sub(plane->cap.max, plane->cap.min);
        if (!plane->capped) {
            printf("           no cap at z = %.1f mm: %s\n", plane->z, plane->why.text);
            continue;
        }
        printf("           a cap made: %.1f by %.1f mm, ", size.x, size.y);
        print_at(said, middle_of(plane->cap));
    }
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
    print_clip(said);
    if (is_empty(&was) && is_empty(&did) && is_empty(&left))
        return;
    print_counts("wrong:", &was);
    print_counts("done:", &did);
    if (r->welded_mm > 0)
        printf("           a corner was moved by up to %.2g mm\n", r->welded_mm);
    print_boxes(said, &did);
    print_islands(said);
    print_counts("remains:", &left);
    print_boxes(said, &left);
}

static json_t *counts_json(const struct counts *counts) {
    json_t *object = json_object();
    for (int i = 0; i < counts->count; i++)
        json_object_set_new(object, counts->all[i].key, json_integer(counts->all[i].value));
    return object;
}

static json_t *point_json(vec3 p) {
    return json_pack("[f, f, f]", p.x, p.y, p.z);
}

static json_t *box_json(const struct import_said *said, struct box box) {
    return json_pack("{s:o, s:o, s:o}", "centre_mm", point_json(middle_of(box)), "size_mm",
                     point_json(vec3_sub(box.max, box.min)), "scan_mm",
                     point_json(import_in_scan(said->knee, middle_of(box))));
}

static void add_boxes(const struct import_said *said, const struct counts *counts, json_t *to) {
    for (int i = 0; i < counts->count; i++)
        if (counts->all[i].value && counts->all[i].place)
            json_object_set_new(to, counts->all[i].key, box_json(said, counts->all[i].place->box));
}

static json_t *islands_json(const struct import_said *said, const struct repair_island *islands,
                            uint32_t count) {
    json_t *array = json_array();
    for (uint32_t i = 0; i < count && i < REPAIR_ISLANDS_MAX; i++)
        json_array_append_new(
            array,
            json_pack("{s:I, s:f, s:o, s:o}", "triangles", (json_int_t)islands[i].triangles,
                      "area_mm2", islands[i].area_mm2, "centre_mm", point_json(islands[i].centre),
                      "scan_mm", point_json(import_in_scan(said->knee, islands[i].centre))));
    return array;
}

static json_t *clip_json(const struct import_said *said) {
    json_t *array = json_array();
    for (int i = 0; i < said->clip->plane_count; i++) {
        const struct clip_plane *plane = &said->clip->planes[i];
        json_t *one = json_pack("{s:f}", "z_mm", plane->z);
        json_object_set_new(one, plane->capped ? "cap" : "no_cap",
                            plane->capped ? box_json(said, plane->cap)
                                          : json_string(plane->why.text));
        json_array_append_new(array, one);
    }
    return array;
}

// A path need not be UTF-8.
static json_t *quoted(const char *path) {
    json_t *string = json_string(path);
    return string ? string : json_string("not UTF-8");
}

json_t *import_json(const struct import_said *said) {
    const struct repair_report *r = said->report;
    struct counts was = wrong(r), did = done(r), left = remains(r);
    json_t *all = counts_json(&did), *places = json_object();
    add_boxes(said, &did, places);
    add_boxes(said, &left, places);
    json_object_set_new(all, "welded_mm", json_real(r->welded_mm));
    json_object_set_new(all, "island_triangles", json_integer(r->island_triangles));
    json_object_set_new(all, "island_area_mm2", json_real(r->island_area_mm2));
    json_object_set_new(all, "islands", islands_json(said, r->islands, r->island_count));
    json_object_set_new(all, "fins", islands_json(said, r->fins, r->fin_count));
    return json_pack("{s:s, s:o, s:I, s:I, s:b, s:o, s:o, s:o, s:o, s:o}", "group", said->group,
                     "file", quoted(said->file), "vertices", (json_int_t)said->mesh->vertex_count,
                     "triangles", (json_int_t)said->mesh->triangle_count, "cuttable",
                     can_be_cut(&r->after), "clipped", clip_json(said), "wrong", counts_json(&was),
                     "done", all, "remains", counts_json(&left), "places", places);
}
