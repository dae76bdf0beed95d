#include "import/split.h"

#include "base/check.h"
#include "mesh/edges.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LARGE_MAX (4 * IMPORT_PARTS_MAX) // parts, and voids in them

struct component {
    uint32_t triangles;
    double area, volume; // in the file's units
    struct box box;
    uint32_t set;    // the vertex that stands for it
    uint32_t joined; // index of the component that it stays with; its own
    uint32_t part;   // MESH_NONE: left out
};

static vec3 corner(const struct import_arrays *arrays, size_t i) {
    const double *p = arrays->positions + 3 * (size_t)arrays->triangles[i];
    return (vec3){p[0], p[1], p[2]};
}

static void widen(struct box *box, vec3 p) {
    box->min = (vec3){fmin(box->min.x, p.x), fmin(box->min.y, p.y), fmin(box->min.z, p.z)};
    box->max = (vec3){fmax(box->max.x, p.x), fmax(box->max.y, p.y), fmax(box->max.z, p.z)};
}

static void add_component_triangle(struct component *c, const struct import_arrays *arrays,
                                   uint32_t t) {
    vec3 p[3], origin = corner(arrays, 0);
    for (size_t i = 0; i < 3; i++) {
        p[i] = corner(arrays, 3 * (size_t)t + i);
        if (!c->triangles && i == 0)
            c->box = (struct box){p[0], p[0]};
        widen(&c->box, p[i]);
    }
    vec3 normal = vec3_cross(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[0]));
    c->area += vec3_length(normal) / 2;
    c->volume += vec3_dot(vec3_sub(p[0], origin), normal) / 6;
    c->triangles++;
}

// By falling area, then by vertex.
static int compare_components(const void *a, const void *b) {
    const struct component *s = a, *t = b;
    if (s->area != t->area)
        return s->area > t->area ? -1 : 1;
    return s->set < t->set ? -1 : s->set > t->set;
}

static bool box_holds(const struct box *outer, const struct box *inner) {
    return outer->min.x < inner->min.x && outer->min.y < inner->min.y &&
           outer->min.z < inner->min.z && outer->max.x > inner->max.x &&
           outer->max.y > inner->max.y && outer->max.z > inner->max.z;
}

// Each with the smallest of the large ones around it that runs the other way round.
static void join_voids(struct component *all, uint32_t count, uint32_t large) {
    for (uint32_t i = 0; i < count; i++) {
        all[i].joined = i;
        for (uint32_t k = 0; k < i && k < large; k++)
            if (all[k].joined == k && all[k].volume * all[i].volume < 0 &&
                box_holds(&all[k].box, &all[i].box))
                all[i].joined = k;
    }
}

// With its own vertices, in their order.
static void take_out(const struct import_arrays *from, const uint32_t *part_of_set, uint32_t *sets,
                     uint32_t part, struct import_arrays *out) {
    uint32_t *place = alloc(from->vertex_count, sizeof *place);
    *out = (struct import_arrays){0};
    memcpy(out->space, from->space, sizeof out->space);
    for (uint32_t v = 0; v < from->vertex_count; v++)
        if (part_of_set[sets_find(sets, v)] == part)
            place[v] = out->vertex_count++;
    out->positions = alloc(3 * (size_t)out->vertex_count, sizeof *out->positions);
    for (uint32_t v = 0; v < from->vertex_count; v++)
        if (part_of_set[sets_find(sets, v)] == part)
            memcpy(out->positions + 3 * (size_t)place[v], from->positions + 3 * (size_t)v,
                   3 * sizeof *out->positions);
    for (uint32_t t = 0; t < from->triangle_count; t++)
        out->triangle_count += part_of_set[sets_find(sets, from->triangles[3 * (size_t)t])] == part;
    out->triangles = alloc(3 * (size_t)out->triangle_count, sizeof *out->triangles);
    uint32_t *to = out->triangles;
    for (uint32_t t = 0; t < from->triangle_count; t++) {
        const uint32_t *v = from->triangles + 3 * (size_t)t;
        for (int i = 0; i < 3 && part_of_set[sets_find(sets, v[0])] == part; i++)
            *to++ = place[v[i]];
    }
    free(place);
}

struct placed {
    double at[3];
    uint32_t vertex;
};

static int compare_places(const void *a, const void *b) {
    const struct placed *s = a, *t = b;
    for (int i = 0; i < 3; i++)
        if (s->at[i] != t->at[i])
            return s->at[i] < t->at[i] ? -1 : 1;
    return 0;
}

// Closed surfaces that touch stay apart.
static void join_seams(const struct import_arrays *arrays, uint32_t *sets) {
    struct mesh mesh = {arrays->vertex_count, arrays->triangle_count, NULL, arrays->triangles};
    bool *open = edges_open_vertices(&mesh);
    struct placed *placed = alloc(arrays->vertex_count, sizeof *placed);
    uint32_t count = 0;
    for (uint32_t v = 0; v < arrays->vertex_count; v++) {
        if (!open[v])
            continue;
        memcpy(placed[count].at, arrays->positions + 3 * (size_t)v, sizeof placed->at);
        placed[count++].vertex = v;
    }
    qsort(placed, count, sizeof *placed, compare_places);
    for (uint32_t i = 1; i < count; i++)
        if (compare_places(&placed[i - 1], &placed[i]) == 0)
            sets_join(sets, placed[i].vertex, placed[i - 1].vertex);
    free(placed);
    free(open);
}

static uint32_t find_components(const struct import_arrays *arrays, uint32_t *sets,
                                struct component *all) {
    uint32_t count = 0;
    for (size_t i = 0; i < 3 * (size_t)arrays->triangle_count; i++)
        sets_join(sets, arrays->triangles[i - i % 3], arrays->triangles[i]);
    join_seams(arrays, sets);
    for (uint32_t t = 0; t < arrays->triangle_count; t++) {
        uint32_t set = sets_find(sets, arrays->triangles[3 * (size_t)t]);
        all[set].set = set;
        add_component_triangle(&all[set], arrays, t);
    }
    for (uint32_t v = 0; v < arrays->vertex_count; v++)
        if (all[v].triangles)
            all[count++] = all[v];
    qsort(all, count, sizeof *all, compare_components);
    return count;
}

static void leave_out(const struct component *c, struct import_parts *parts) {
    if (parts->left_out < IMPORT_SPECKS_MAX)
        parts->specks[parts->left_out] =
            (struct import_speck){c->triangles, vec3_scale(0.5, vec3_add(c->box.min, c->box.max))};
    parts->left_out++;
}

static uint32_t number_parts(struct component *all, uint32_t count, uint32_t large,
                             struct import_parts *out_parts) {
    uint32_t parts = 0;
    join_voids(all, count, large);
    for (uint32_t i = 0; i < count; i++) {
        bool own = all[i].joined == i;
        all[i].part = own ? i < large ? parts++ : MESH_NONE : all[all[i].joined].part;
        if (all[i].part == MESH_NONE)
            leave_out(&all[i], out_parts);
    }
    return parts;
}

enum result import_split(const struct import_arrays *arrays, struct import_parts *out_parts,
                         struct error *err) {
    uint32_t *sets = sets_create(arrays->vertex_count);
    struct component *all = alloc(arrays->vertex_count, sizeof *all);
    uint32_t *part_of_set = alloc(arrays->vertex_count, sizeof *part_of_set);
    *out_parts = (struct import_parts){0};
    memset(part_of_set, 0xff, arrays->vertex_count * sizeof *part_of_set); // MESH_NONE: unused
    uint32_t count = find_components(arrays, sets, all), large = 0;
    while (large < count && all[large].area >= IMPORT_PART_SHARE * all[0].area)
        large++;
    uint32_t parts = large <= LARGE_MAX ? number_parts(all, count, large, out_parts) : large;
    for (uint32_t i = 0; i < count; i++)
        part_of_set[all[i].set] = all[i].part;
    if (parts <= IMPORT_PARTS_MAX)
        for (; out_parts->count < (int)parts; out_parts->count++)
            take_out(arrays, part_of_set, sets, (uint32_t)out_parts->count,
                     &out_parts->parts[out_parts->count]);
    free(part_of_set);
    free(all);
    free(sets);
    return parts <= IMPORT_PARTS_MAX
               ? RESULT_OK
               : fail(err, RESULT_LIMIT, "%u parts, more than %d", parts, IMPORT_PARTS_MAX);
}

void import_parts_fini(struct import_parts *parts) {
    for (int i = 0; i < parts->count; i++)
        import_arrays_fini(&parts->parts[i]);
    parts->count = 0;
}

// ---- names --------------------------------------------------------------------------------------

static struct box turned_box(const struct import_arrays *part, const struct import_frame *frame) {
    vec3 first = mat3_apply(frame->R_case_common, corner(part, 0));
    struct box box = {first, first};
    for (size_t i = 1; i < 3 * (size_t)part->triangle_count; i++)
        widen(&box, mat3_apply(frame->R_case_common, corner(part, i)));
    return box;
}

static vec3 middle(struct box box) {
    return vec3_scale(0.5, vec3_add(box.min, box.max));
}

struct places {
    int femur, tibia, patella, fibula, menisci[2], meniscus_count;
    double width; // of the femur
    struct box boxes[IMPORT_PARTS_MAX];
};

// Few vertices lie in the middle of its box, seen from above: cartilage of the tibia is a plate.
static bool is_open_inside(const struct import_arrays *part, const struct import_frame *frame,
                           struct box box) {
    uint32_t inside = 0;
    vec3 m = middle(box), side = vec3_sub(box.max, box.min);
    for (uint32_t v = 0; v < part->vertex_count; v++) {
        const double *at = part->positions + 3 * (size_t)v;
        vec3 p = mat3_apply(frame->R_case_common, (vec3){at[0], at[1], at[2]});
        inside += fabs(p.x - m.x) < 0.2 * side.x && fabs(p.y - m.y) < 0.2 * side.y;
    }
    return inside < 0.06 * part->vertex_count;
}

// Between the bones, flat, and about half as wide as the femur.
static bool lies_as_meniscus(const struct places *p, struct box box) {
    vec3 side = vec3_sub(box.max, box.min);
    double z = middle(box).z, w = p->width;
    return side.z < 0.3 * w && side.x > 0.2 * w && side.x < 0.75 * w && side.y > 0.25 * w &&
           side.y < 0.75 * w && z > p->boxes[p->tibia].max.z - 0.3 * w &&
           z < p->boxes[p->femur].min.z + 0.3 * w;
}

static void place(struct places *p, int i, bool open_inside) {
    vec3 m = middle(p->boxes[i]), side = vec3_sub(p->boxes[i].max, p->boxes[i].min);
    struct box femur = p->boxes[p->femur], tibia = p->boxes[p->tibia];
    bool before = m.y > middle(femur).y + 0.2 * p->width;
    bool beside = fabs(m.x - middle(tibia).x) > 0.3 * p->width;
    bool upright = side.z > 0.8 * fmax(side.x, side.y);
    if (p->meniscus_count < 2 && open_inside && lies_as_meniscus(p, p->boxes[i]))
        p->menisci[p->meniscus_count++] = i;
    else if (p->patella < 0 && before && m.z > tibia.max.z && side.x > 0.25 * p->width &&
             side.x < 0.9 * p->width)
        p->patella = i;
    else if (p->fibula < 0 && beside && upright && m.z < tibia.max.z && side.x < 0.5 * p->width &&
             p->boxes[i].max.z < femur.min.z + 0.2 * p->width)
        p->fibula = i;
}

static enum result name_menisci(struct import_parts *parts, const struct places *p,
                                const char *side, struct error *err) {
    if (!p->meniscus_count)
        return RESULT_OK;
    if (!side && p->fibula < 0)
        return fail(err, RESULT_MISSING, "nothing tells which meniscus is lateral: give --side");
    vec3 tibia = middle(p->boxes[p->tibia]);
    bool right = side ? strcmp(side, "right") == 0 : middle(p->boxes[p->fibula]).x > tibia.x;
    for (int i = 0; i < p->meniscus_count; i++) {
        double x = middle(p->boxes[p->menisci[i]]).x;
        double other = p->meniscus_count == 2 ? middle(p->boxes[p->menisci[1 - i]]).x : tibia.x;
        snprintf(parts->names[p->menisci[i]], sizeof parts->names[0], "meniscus_%s",
                 (x > other) == right ? "lateral" : "medial");
    }
    return RESULT_OK;
}

static bool are_above_one_another(struct box upper, struct box lower) {
    double narrow = fmin(upper.max.x - upper.min.x, lower.max.x - lower.min.x);
    double wide = fmax(upper.max.x - upper.min.x, lower.max.x - lower.min.x);
    double common = fmin(upper.max.x, lower.max.x) - fmax(upper.min.x, lower.min.x);
    return upper.min.z > middle(lower).z && lower.max.z < middle(upper).z && narrow > 0.5 * wide &&
           common > 0.5 * wide;
}

// The two largest ones that lie above one another: between them may be a bone's cartilage.
static bool find_bones(struct places *p, int count) {
    for (int k = 1; k < count; k++) {
        for (int i = 0; i < k; i++) {
            bool first_above = are_above_one_another(p->boxes[i], p->boxes[k]);
            if (!first_above && !are_above_one_another(p->boxes[k], p->boxes[i]))
                continue;
            p->femur = first_above ? i : k;
            p->tibia = first_above ? k : i;
            p->width = p->boxes[p->femur].max.x - p->boxes[p->femur].min.x;
            return true;
        }
    }
    return false;
}

enum result import_name_parts(struct import_parts *parts, const struct import_frame *frame,
                              const char *side, struct error *err) {
    struct places p = {.patella = -1, .fibula = -1};
    if (parts->count < 2)
        return fail(err, RESULT_MISSING, "it has %d part, and a knee has two bones at least",
                    parts->count);
    for (int i = 0; i < parts->count; i++)
        p.boxes[i] = turned_box(&parts->parts[i], frame);
    if (!find_bones(&p, parts->count))
        return fail(err, RESULT_INVALID,
                    "no two bones lie above one another: give --axes, or the parts one by one");
    for (int i = 0; i < parts->count; i++)
        if (i != p.femur && i != p.tibia)
            place(&p, i, is_open_inside(&parts->parts[i], frame, p.boxes[i]));
    for (int i = 0; i < parts->count; i++)
        snprintf(parts->names[i], sizeof parts->names[i], "part_%d", i + 1);
    strcpy(parts->names[p.femur], "femur");
    strcpy(parts->names[p.tibia], "tibia");
    if (p.patella >= 0)
        strcpy(parts->names[p.patella], "patella");
    if (p.fibula >= 0)
        strcpy(parts->names[p.fibula], "fibula");
    return name_menisci(parts, &p, side, err);
}

// 0 where there is no patella.
static int count_names(struct import_parts *parts, const struct import_frame *frame) {
    int count = 0;
    bool patella = false;
    struct error err;
    if (import_name_parts(parts, frame, "right", &err) != RESULT_OK)
        return 0;
    for (int i = 0; i < parts->count; i++) {
        count += strncmp(parts->names[i], "part_", 5) != 0;
        patella |= strcmp(parts->names[i], "patella") == 0;
    }
    return patella ? count : 0;
}

void import_guess_axes(struct import_parts *parts, char out_letters[4]) {
    static const char directions[] = "RASLPI";
    int most = 0;
    strcpy(out_letters, "RAS");
    for (int i = 0; i < 6 * 6 * 6; i++) {
        char letters[4] = {directions[i / 36], directions[i / 6 % 6], directions[i % 6], '\0'};
        struct import_frame frame;
        if (!import_axes(letters, &frame) || mat3_determinant(frame.R_case_common) < 0)
            continue;
        int count = count_names(parts, &frame);
        if (count > most || (count == most && strcmp(letters, "RAS") == 0))
            strcpy(out_letters, letters);
        most = count > most ? count : most;
    }
}
