#include "check/verdict.h"

#include "base/check.h"
#include "case/files.h"

#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MOST 0.999

static void set(json_t *object, const char *key, json_t *value) {
    CHECK(json_object_set_new(object, key, value) == 0);
}

// What is quoted of a file or a folder's name need not be UTF-8.
static json_t *quoted(const char *text) {
    json_t *string = json_string(text);
    return string ? string : json_string("not UTF-8");
}

static json_t *count(uint64_t value) {
    return json_integer((json_int_t)value);
}

static json_t *place(vec3 p) {
    return json_pack("[f, f, f]", p.x, p.y, p.z);
}

static json_t *group(const struct case_check *check, int surface) {
    return surface < 0 ? json_null() : json_string(check->groups[surface]);
}

static json_t *spot(const struct case_check *check, const struct field_spot *s) {
    return json_pack("{s:f, s:o, s:[o, o], s:f, s:f}", "value", s->value, "place_mm",
                     place(s->place), "nearest", group(check, s->nearest[0]),
                     group(check, s->nearest[1]), "gap_mm", s->gap_mm, "left_mm", s->left_mm);
}

static json_t *field(const struct field_figures *f) {
    json_t *object = json_object();
    set(object, "warped", count(f->looked));
    set(object, "still", count(f->still));
    set(object, "close", count(f->close));
    set(object, "folded", count(f->folded));
    set(object, "folded_fading", count(f->faded));
    set(object, "folded_by_case", count(f->filled));
    set(object, "jumps", count(f->jumped));
    if (f->looked) {
        set(object, "fold_share", json_real((double)f->folded / (double)f->looked));
        set(object, "gain_p999", json_real(field_gain_within(f, MOST)));
        set(object, "gain_max", json_real(f->gain.value));
    }
    return object;
}

static void set_spots(json_t *object, const struct case_check *check,
                      const struct field_figures *f) {
    if (f->looked)
        set(object, "largest_gain", spot(check, &f->gain));
    if (field_own_folds(f))
        set(object, "worst_fold", spot(check, &f->fold));
    if (f->filled)
        set(object, "worst_fold_by_case", spot(check, &f->filling));
    if (f->faded)
        set(object, "worst_fold_fading", spot(check, &f->fading));
    if (f->jumped)
        set(object, "largest_jump", spot(check, &f->jump));
}

static json_t *eased(const struct case_check *check, const struct field_figures *f) {
    json_t *object =
        json_pack("{s:o, s:o}", "warped", count(f->looked), "folded", count(f->folded));
    const struct field_spot *worst = field_worst_fold(f);
    if (worst)
        set(object, "worst_fold", spot(check, worst));
    return object;
}

static json_t *facing_spot(const struct facing_spot *s) {
    return json_pack("{s:o, s:f, s:f, s:f}", "place_mm", place(s->place), "gap_mm", s->gap_mm,
                     "closed_mm", s->closed_mm, "apart_mm", s->apart_mm);
}

static json_t *facing(const struct case_check *check, const struct facing_figures *f) {
    json_t *pairs = json_array();
    for (int i = 0; f && i < f->count; i++) {
        const struct facing_pair *p = &f->pairs[i];
        json_t *pair = json_pack("{s:[o, o], s:o, s:o, s:o}", "groups", group(check, p->a),
                                 group(check, p->b), "facing", count(p->count), "filled",
                                 count(p->filled), "strained", count(p->strained));
        if (p->filled)
            set(pair, "filling", facing_spot(&p->filling));
        if (p->strained)
            set(pair, "strain", facing_spot(&p->strain));
        json_array_append_new(pairs, pair);
    }
    return pairs;
}

static json_t *joint(const struct joint_angles *j) {
    return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f}", "flexion_deg", j->flexion_deg, "varus_deg",
                     j->varus_deg, "internal_deg", j->internal_deg, "shift_mm", j->shift_mm,
                     "drawer_mm", j->drawer_mm, "distraction_mm", j->distraction_mm);
}

static json_t *pose_object(const struct case_check *check, const struct check_pose *at) {
    json_t *object = json_pack("{s:s, s:o}", "name", at->name, "joint", joint(&at->joint));
    if (at->key >= 0) {
        set(object, "bones_overlap_mm", json_real(at->bones.physical_mm));
        set(object, "virtual_bones_overlap_mm", json_real(at->bones.virtual_mm));
        set(object, "ligament_gain", json_real(at->gain));
    }
    if (at->eased)
        set(object, "to_maxcut", eased(check, at->eased));
    if (at->is_still)
        return object;
    set(object, "in_solids", count(at->places[PLACE_SOLID]));
    set(object, "outside", count(at->places[PLACE_OUTSIDE]));
    set(object, "in_pockets", count(at->places[PLACE_POCKET]));
    json_t *figures = field(at->field);
    set_spots(figures, check, at->field);
    set(object, "field", figures);
    const struct touch_figures *t = &at->touch;
    if (t->count)
        set(object, "touch",
            json_pack("{s:o, s:f, s:f, s:o, s:o}", "places", count(t->count), "mean_mm",
                      t->sum_mm / (double)t->count, "largest_mm", t->largest_mm, "group",
                      group(check, t->surface), "place_mm", place(t->place)));
    set(object, "facing", facing(check, at->facing));
    return object;
}

static json_t *contact_state(const struct contact *contact, int index) {
    const struct contact_state *s = &contact->states[index];
    json_t *state =
        json_pack("{s:i, s:f, s:f}", "flexion_deg", index * CONTACT_STEP_DEG, "overlap_mm",
                  s->overlap.depth_mm, "overlap_mm3", s->overlap.volume_mm3);
    if (s->overlap.depth_mm > 0)
        set(state, "overlap_place_mm", place(s->overlap.place));
    if (contact->has_gap && isfinite(s->gap.mm)) {
        set(state, "gap_mm", json_real(s->gap.mm));
        set(state, "gap_place_mm", place(s->gap.place));
    }
    return state;
}

static json_t *contacts(const struct case_check *check) {
    json_t *array = json_array();
    for (int i = 0; i < check->contacts.count; i++) {
        const struct contact *c = &check->contacts.all[i];
        json_t *states = json_array();
        for (int k = 0; k < c->count; k++)
            json_array_append_new(states, contact_state(c, k));
        json_array_append_new(array, json_pack("{s:[o, o], s:o}", "groups", group(check, c->a),
                                               group(check, c->b), "at_rest", states));
    }
    return array;
}

static json_t *curve(const double *values, int length) {
    json_t *array = json_array();
    for (int i = 0; i < length; i++)
        json_array_append_new(array, json_real(values[i]));
    return array;
}

static json_t *opening(const struct opening *o) {
    return json_pack("{s:s, s:s, s:o, s:o, s:o, s:o, s:o}", "coordinate", o->coordinate, "unit",
                     o->unit, "flexion_deg", curve(o->flexion, OPENING_STEPS), "held",
                     curve(o->physical, OPENING_STEPS), "shown", curve(o->shown, OPENING_STEPS),
                     "key_flexion_deg", curve(o->key_flexion, o->key_count), "key_target",
                     curve(o->key_target, o->key_count));
}

static json_t *settings(const struct check_settings *s) {
    json_t *object = json_object();
    set(object, "field", json_string(field_name(s->field.kind)));
    set(object, "unit_mm", json_real(s->field.unit_mm));
    set(object, "radius_mm", json_real(s->field.radius_mm));
    set(object, "background_per_mm", json_real(s->field.background_per_mm));
    set(object, "skin_mm", json_real(s->field.skin_mm));
    set(object, "strength", json_real(s->field.strength));
    set(object, "adaptive", json_string(adaptive_name(s->adaptive)));
    set(object, "grid_mm", json_real(s->spacing_mm));
    set(object, "flexion_step_deg", json_real(s->flexion_step_deg));
    return object;
}

static json_t *findings(const struct inspection *inspection) {
    static const char *const levels[] = {
        [FINDING_NOTE] = "note", [FINDING_WARNING] = "warning", [FINDING_FAULT] = "fault"};
    json_t *array = json_array();
    for (int i = 0; i < inspection->count; i++) {
        const struct check_finding *f = &inspection->findings[i];
        json_array_append_new(array, json_pack("{s:s, s:o, s:o}", "level", levels[f->level],
                                               "where", quoted(f->where), "text", quoted(f->text)));
    }
    return array;
}

static json_t *whole_verdict(const struct case_check *check, int64_t utc_s) {
    char hash[17], date[32];
    time_t now = (time_t)utc_s;
    struct tm utc;
    gmtime_r(&now, &utc);
    strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", &utc);
    snprintf(hash, sizeof hash, "%016" PRIx64, check->hash);
    json_t *root = json_object();
    set(root, "format", json_string(GRADE_FORMAT));
    set(root, "version", json_integer(GRADE_VERSION));
    set(root, "case", quoted(check->case_or_folder));
    set(root, "hash", json_string(hash));
    set(root, "grade", json_string(grade_name(check->grade)));
    set(root, "date", json_string(date));
    set(root, "software", json_string("arthron " ARTHRON_VERSION));
    set(root, "quick", json_boolean(check->settings.quick));
    set(root, "faults", json_integer(check->findings.faults));
    set(root, "settings", settings(&check->settings));
    set(root, "findings", findings(&check->findings));
    set(root, "findings_left_out", json_integer(check->findings.left_out));
    set(root, "contacts", contacts(check));
    set(root, "field", field(check->field));
    json_t *poses = json_array(), *openings = json_array();
    for (int i = 0; i < check->pose_count; i++)
        json_array_append_new(poses, pose_object(check, &check->poses[i]));
    for (int i = 0; i < check->opening_count; i++)
        json_array_append_new(openings, opening(&check->openings[i]));
    set(root, "poses", poses);
    set(root, "openings", openings);
    return root;
}

char *verdict_text(const struct case_check *check, int64_t utc_s) {
    json_t *root = whole_verdict(check, utc_s);
    char *text = json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(9));
    json_decref(root);
    NEED(text, "memory");
    return text;
}

enum result verdict_save(const struct case_check *check, int64_t utc_s, const char *dir,
                         struct error *err) {
    char *text = verdict_text(check, utc_s);
    struct named_bytes file = {GRADE_FILE, text, strlen(text)};
    enum result noted = grade_note(dir, check->hash, text, file.size, utc_s, err);
    enum result written = files_write(dir, &file, 1, noted == RESULT_OK ? err : NULL);
    free(text);
    return noted == RESULT_OK ? written : noted;
}
