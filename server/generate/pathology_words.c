#include "base/check.h"
#include "base/number.h"
#include "generate/pathology.h"

#include <stdio.h>
#include <string.h>

const char *pathology_kind_name(enum pathology_kind kind) {
    static const char *const names[PATHOLOGY_KIND_COUNT] = {"ligament", "cavity", "wear", "tear",
                                                            "plan",     "tissue", "loose"};
    CHECK((unsigned)kind < PATHOLOGY_KIND_COUNT);
    return names[kind];
}

// NULL: the step is at no place.
static struct pathology_place *place_of(struct pathology *step) {
    return step->kind == PATHOLOGY_CAVITY ? &step->cavity.place
           : step->kind == PATHOLOGY_WEAR ? &step->wear.place
                                          : NULL;
}

void pathology_init(struct pathology *step, enum pathology_kind kind, const char *name) {
    *step = (struct pathology){.kind = kind};
    CHECK(strlen(name) < sizeof step->name);
    strcpy(step->name, name);
    if (place_of(step))
        *place_of(step) = (struct pathology_place){.body = BODY_COUNT, .at.x = NAN};
    if (kind == PATHOLOGY_TEAR)
        step->tear.tear.kind = TEAR_KIND_COUNT;
    if (kind == PATHOLOGY_TISSUE)
        add_tissue_init(&step->tissue);
    if (kind == PATHOLOGY_LOOSE)
        add_loose_init(&step->loose);
}

// ---- numbers ------------------------------------------------------------------------------------

struct word {
    enum pathology_kind kind;
    const char *key;
    size_t offset; // in struct pathology
    double low, high;
};

#define AT(member) offsetof(struct pathology, member)

static const struct word numbers[] = {
    {PATHOLOGY_CAVITY, "radius_mm", AT(cavity.radius_mm), 3, 25},
    {PATHOLOGY_CAVITY, "depth_mm", AT(cavity.depth_mm), 0.1, 6},
    {PATHOLOGY_WEAR, "radius_mm", AT(wear.radius_mm), 3, 25},
    {PATHOLOGY_WEAR, "grade", AT(wear.grade), 1, CASE_WEAR_MOST},
    {PATHOLOGY_TEAR, "at", AT(tear.tear.at), 0.1, 0.9},
    {PATHOLOGY_TEAR, "depth_mm", AT(tear.tear.depth_mm), 1, 8},
    {PATHOLOGY_TEAR, "length_mm", AT(tear.tear.length_mm), 2, 30},
    {PATHOLOGY_PLAN, "at", AT(plan.resection.at), 0.1, 0.9},
    {PATHOLOGY_PLAN, "depth_mm", AT(plan.resection.depth_mm), 1, 9},
    {PATHOLOGY_PLAN, "length_mm", AT(plan.resection.length_mm), 2, 30},
};

// Of a ligament's keys; the flexions are the first.
static const struct word series[] = {
    {PATHOLOGY_LIGAMENT, "flexion_deg", AT(ligament.flexion_deg), 0, 120},
    {PATHOLOGY_LIGAMENT, "valgus_deg", AT(ligament.valgus_deg), -15, 15},
    {PATHOLOGY_LIGAMENT, "internal_deg", AT(ligament.internal_deg), -30, 30},
    {PATHOLOGY_LIGAMENT, "drawer_mm", AT(ligament.drawer_mm), -10, 10},
    {PATHOLOGY_LIGAMENT, "extra_valgus_deg", AT(ligament.extra_valgus_deg), -15, 15},
    {PATHOLOGY_LIGAMENT, "extra_internal_deg", AT(ligament.extra_internal_deg), -30, 30},
    {PATHOLOGY_LIGAMENT, "extra_drawer_mm", AT(ligament.extra_drawer_mm), -15, 15},
};

#define COUNT(table) (sizeof(table) / sizeof *(table))

static const struct word *word_of(const struct word *table, size_t count,
                                  const struct pathology *step, const char *key) {
    for (size_t i = 0; i < count; i++)
        if (table[i].kind == step->kind && strcmp(table[i].key, key) == 0)
            return &table[i];
    return NULL;
}

static enum result take_number(struct pathology *step, const struct word *word, const char *value,
                               struct error *err) {
    if (number_double(value, word->low, word->high, (double *)((char *)step + word->offset)))
        return RESULT_OK;
    return fail(err, RESULT_INVALID, "%s = %s: must be a number from %g to %g", word->key, value,
                word->low, word->high);
}

static bool parse_series(const char *value, const struct word *word, struct pathology_values *out) {
    char text[256], *rest;
    out->count = 0;
    if (snprintf(text, sizeof text, "%s", value) >= (int)sizeof text)
        return false;
    for (char *w = strtok_r(text, " \t,", &rest); w; w = strtok_r(NULL, " \t,", &rest))
        if (out->count == PATHOLOGY_VALUES_MAX ||
            !number_double(w, word->low, word->high, &out->values[out->count++]))
            return false;
    return out->count > 0;
}

static enum result take_series(struct pathology *step, const struct word *word, const char *value,
                               struct error *err) {
    if (parse_series(value, word, (struct pathology_values *)((char *)step + word->offset)))
        return RESULT_OK;
    return fail(err, RESULT_INVALID, "%s = %s: must be up to %d numbers from %g to %g", word->key,
                value, PATHOLOGY_VALUES_MAX, word->low, word->high);
}

// ---- other words --------------------------------------------------------------------------------

static enum result refuse_word(struct error *err, const char *key, const char *reason) {
    return fail(err, RESULT_INVALID, "%s: %s", key, reason);
}

static enum result take_body(struct pathology *step, const char *value, struct error *err) {
    enum body *body = &place_of(step)->body;
    bool has_patella = step->kind == PATHOLOGY_WEAR;
    if (body_from_name(value, body) && (has_patella || *body != BODY_PATELLA))
        return RESULT_OK;
    return refuse_word(err, "body",
                       has_patella ? "must be femur, tibia or patella" : "must be femur or tibia");
}

static enum result take_place(struct pathology *step, const char *key, const char *value,
                              struct error *err) {
    struct pathology_place *place = place_of(step);
    if (strcmp(key, "body") == 0)
        return take_body(step, value, err);
    if (strcmp(key, "at") != 0)
        return refuse_word(err, key, "unknown key");
    pose p;
    place->at = (vec3){0};
    if (case_name_is_valid(value)) {
        strcpy(place->landmark, value);
        return RESULT_OK;
    }
    if (!number_pose(value, &p) || p.rotation.w != 1 || !(vec3_length(p.translation) <= 100))
        return refuse_word(
            err, key, "must be a landmark, or three numbers, x y z, within 100 mm of the origin");
    place->landmark[0] = '\0';
    place->at = p.translation;
    return RESULT_OK;
}

static enum result take_group(char group[CASE_NAME_MAX], const char *value, struct error *err) {
    if (!case_name_is_valid(value))
        return refuse_word(err, "group", "must be the name of a group, as meniscus_medial");
    strcpy(group, value);
    return RESULT_OK;
}

enum result pathology_take(struct pathology *step, const char *key, const char *value,
                           struct error *err) {
    const struct word *word = word_of(numbers, COUNT(numbers), step, key);
    if (word)
        return take_number(step, word, value, err);
    word = word_of(series, COUNT(series), step, key);
    if (word)
        return take_series(step, word, value, err);
    if (step->kind == PATHOLOGY_TISSUE)
        return add_tissue_take(&step->tissue, key, value, err);
    if (step->kind == PATHOLOGY_LOOSE)
        return add_loose_take(&step->loose, key, value, err);
    if (place_of(step))
        return take_place(step, key, value, err);
    if (step->kind == PATHOLOGY_TEAR && strcmp(key, "group") == 0)
        return take_group(step->tear.group, value, err);
    if (step->kind == PATHOLOGY_PLAN && strcmp(key, "group") == 0)
        return take_group(step->plan.group, value, err);
    if (step->kind != PATHOLOGY_TEAR || strcmp(key, "kind") != 0)
        return refuse_word(err, key, "unknown key");
    return tear_kind_from_name(value, &step->tear.tear.kind)
               ? RESULT_OK
               : refuse_word(err, key, "must be radial, flap, bucket-handle or horizontal");
}

// ---- all of them --------------------------------------------------------------------------------

static bool is_told(const struct pathology_place *place) {
    return place->body != BODY_COUNT && !isnan(place->at.x);
}

static enum result check_cavity_words(const struct pathology_cavity *c, struct error *err) {
    if (!is_told(&c->place) || c->radius_mm == 0 || c->depth_mm == 0)
        return fail(err, RESULT_MISSING, "needs body, at, radius_mm and depth_mm");
    if (c->depth_mm > c->radius_mm / 2)
        return fail(err, RESULT_INVALID, "depth_mm = %g: must be at most %g, half of radius_mm",
                    c->depth_mm, c->radius_mm / 2);
    return RESULT_OK;
}

static enum result check_wear(const struct pathology_wear *w, struct error *err) {
    if (!is_told(&w->place) || w->radius_mm == 0 || w->grade == 0)
        return fail(err, RESULT_MISSING, "needs body, at, radius_mm and grade");
    return RESULT_OK;
}

static enum result check_tear(const struct pathology_tear *t, struct error *err) {
    bool radial = t->tear.kind == TEAR_RADIAL;
    if (t->tear.kind == TEAR_KIND_COUNT || t->group[0] == '\0' || t->tear.at == 0 ||
        t->tear.depth_mm == 0 || (t->tear.length_mm == 0) != radial)
        return fail(err, RESULT_MISSING,
                    "needs kind, group, at and depth_mm; length_mm too where it is not radial, "
                    "and only there");
    return RESULT_OK;
}

static enum result check_plan(const struct pathology_plan *p, struct error *err) {
    const struct resection *r = &p->resection;
    if (p->group[0] == '\0' || r->at == 0 || r->depth_mm == 0 || r->length_mm == 0)
        return fail(err, RESULT_MISSING, "needs group, at, depth_mm and length_mm");
    return RESULT_OK;
}

static bool is_zero(const struct pathology_values *values) {
    for (int i = 0; i < values->count; i++)
        if (values->values[i] != 0)
            return false;
    return true;
}

static enum result check_ligament(const struct pathology *step, struct error *err) {
    const struct pathology_ligament *l = &step->ligament;
    bool opens = !is_zero(&l->valgus_deg) || !is_zero(&l->internal_deg) || !is_zero(&l->drawer_mm);
    bool gives = !is_zero(&l->extra_valgus_deg) || !is_zero(&l->extra_internal_deg) ||
                 !is_zero(&l->extra_drawer_mm);
    if (!l->flexion_deg.count || !opens || !gives)
        return fail(err, RESULT_MISSING,
                    "needs flexion_deg, where the mock-up's holds (valgus_deg, internal_deg, "
                    "drawer_mm), and extra_ of one of these");
    for (int i = 1; i < l->flexion_deg.count; i++)
        if (!(l->flexion_deg.values[i] >= l->flexion_deg.values[i - 1] + 1))
            return fail(err, RESULT_INVALID, "flexion_deg: must rise by a degree at least");
    for (size_t i = 1; i < COUNT(series); i++) {
        const void *values = (const char *)step + series[i].offset;
        int count = ((const struct pathology_values *)values)->count;
        if (count > 1 && count != l->flexion_deg.count)
            return fail(err, RESULT_INVALID, "%s: must be one number, or %d as flexion_deg has",
                        series[i].key, l->flexion_deg.count);
    }
    return RESULT_OK;
}

enum result pathology_check(const struct pathology *step, struct error *err) {
    switch (step->kind) {
    case PATHOLOGY_LIGAMENT:
        return check_ligament(step, err);
    case PATHOLOGY_CAVITY:
        return check_cavity_words(&step->cavity, err);
    case PATHOLOGY_WEAR:
        return check_wear(&step->wear, err);
    case PATHOLOGY_TEAR:
        return check_tear(&step->tear, err);
    case PATHOLOGY_TISSUE:
        return add_tissue_check(&step->tissue, err);
    case PATHOLOGY_LOOSE:
        return add_loose_check(&step->loose, err);
    default:
        return check_plan(&step->plan, err);
    }
}
