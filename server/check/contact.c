#include "check/contact.h"

#include "base/check.h"
#include "check/bounds.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum kind { KIND_OTHER, KIND_BONE, KIND_CARTILAGE, KIND_MENISCUS };

static enum kind kind_of(const struct case_group *group) {
    if (case_group_is_bone(group))
        return KIND_BONE;
    if (group->tissue.kind == TISSUE_CARTILAGE)
        return KIND_CARTILAGE;
    return group->tissue.kind == TISSUE_MENISCUS ? KIND_MENISCUS : KIND_OTHER;
}

// ---- pairs --------------------------------------------------------------------------------------

static bool is_pair(const struct case_group *a, const struct case_group *b) {
    enum kind of_a = kind_of(a), of_b = kind_of(b);
    if (of_a == KIND_OTHER || of_b == KIND_OTHER)
        return false;
    bool menisci = of_a == KIND_MENISCUS && of_b == KIND_MENISCUS;
    bool one_meniscus = of_a == KIND_MENISCUS || of_b == KIND_MENISCUS;
    return !menisci && (a->body != b->body || one_meniscus);
}

static bool is_of(const struct case_group *a, const struct case_group *b, enum kind kind) {
    return kind_of(a) == kind || kind_of(b) == kind;
}

static bool has_body(const struct case_group *a, const struct case_group *b, enum body body) {
    return a->body == body || b->body == body;
}

// Where cartilage is a group of its own, the bones below are what is bound.
static bool should_touch(const struct case_group *a, const struct case_group *b) {
    if (is_of(a, b, KIND_CARTILAGE))
        return false;
    if (is_of(a, b, KIND_MENISCUS))
        return !has_body(a, b, BODY_PATELLA);
    return has_body(a, b, BODY_FEMUR);
}

static enum bound_id gap_bound(const struct case_group *a, const struct case_group *b) {
    if (is_of(a, b, KIND_MENISCUS))
        return a->body == b->body ? BOUND_MENISCUS_TIBIA_GAP : BOUND_MENISCUS_FEMUR_GAP;
    return has_body(a, b, BODY_PATELLA) ? BOUND_PATELLA_GAP : BOUND_TIBIA_GAP;
}

static void choose_pairs(const struct knee_case *knee, struct contacts *contacts) {
    *contacts = (struct contacts){0};
    for (int a = 0; a < knee->group_count; a++)
        for (int b = a + 1; b < knee->group_count; b++) {
            const struct case_group *of_a = &knee->groups[a], *of_b = &knee->groups[b];
            if (!is_pair(of_a, of_b) || contacts->count == CONTACTS_MAX)
                continue;
            contacts->all[contacts->count++] =
                (struct contact){.a = a,
                                 .b = b,
                                 .count = of_a->body == of_b->body ? 1 : CONTACT_FLEXIONS,
                                 .has_gap = should_touch(of_a, of_b)};
        }
}

// ---- figures ------------------------------------------------------------------------------------

struct look {
    const struct knee_case *knee;
    struct contacts *contacts;
    struct touching touching[CASE_GROUPS_MAX];
    enum result results[CASE_GROUPS_MAX];
    struct error errors[CASE_GROUPS_MAX];
};

static bool is_wanted(const struct contacts *contacts, int group) {
    for (int i = 0; i < contacts->count; i++)
        if (contacts->all[i].a == group || contacts->all[i].b == group)
            return true;
    return false;
}

static void prepare(void *context, int group) {
    struct look *look = context;
    if (is_wanted(look->contacts, group))
        look->results[group] = touching_init(&look->touching[group],
                                             &look->knee->groups[group].mesh, &look->errors[group]);
}

pose contact_body_pose(const struct knee_case *knee, enum body body, double flexion_deg) {
    struct joint_angles joint = case_rest(knee, flexion_deg);
    return body == BODY_FEMUR   ? pose_identity()
           : body == BODY_TIBIA ? joint_to_pose(&knee->joint, &joint)
                                : case_patella_pose(knee, flexion_deg);
}

static void measure(void *context, int index) {
    const struct look *look = context;
    struct contact *contact = &look->contacts->all[index / CONTACT_FLEXIONS];
    int which = index % CONTACT_FLEXIONS;
    if (which >= contact->count)
        return;
    const struct case_group *groups = look->knee->groups;
    const struct touching *a = &look->touching[contact->a], *b = &look->touching[contact->b];
    double flexion = which * CONTACT_STEP_DEG;
    pose T_femur_a = contact_body_pose(look->knee, groups[contact->a].body, flexion);
    pose T_femur_b = contact_body_pose(look->knee, groups[contact->b].body, flexion);
    pose T_a_b = pose_compose(pose_inverse(T_femur_a), T_femur_b);
    struct contact_state *state = &contact->states[which];
    state->overlap = overlap_of(a, b, T_a_b);
    state->overlap.place = pose_apply(T_femur_a, state->overlap.place);
    if (contact->has_gap && state->overlap.depth_mm <= 0) {
        state->gap = gap_of(a, b, T_a_b);
        state->gap.place = pose_apply(T_femur_a, state->gap.place);
    }
}

enum result contacts_look(struct knee_case *knee, const struct progress *progress,
                          struct contacts *out, struct error *err) {
    choose_pairs(knee, out);
    struct look *look = alloc(1, sizeof *look);
    look->knee = knee;
    look->contacts = out;
    parallel_for(knee->group_count, prepare, look, NULL);
    enum result result = RESULT_OK;
    for (int i = 0; i < knee->group_count && result == RESULT_OK; i++) {
        result = look->results[i];
        if (result != RESULT_OK)
            *err = look->errors[i];
    }
    if (result == RESULT_OK) {
        parallel_for(out->count * CONTACT_FLEXIONS, measure, look, progress);
        portals_look(knee, look->touching, out->portals);
        landmarks_look(knee, look->touching, out->landmark_off_mm);
    }
    for (int i = 0; i < knee->group_count; i++)
        touching_fini(&look->touching[i]);
    free(look);
    return result;
}

// ---- findings -----------------------------------------------------------------------------------

static void inspect_overlap(const struct knee_case *knee, const struct contact *contact,
                            struct inspection *inspection) {
    const struct case_group *a = &knee->groups[contact->a], *b = &knee->groups[contact->b];
    enum bound_id id = is_of(a, b, KIND_MENISCUS) ? BOUND_MENISCUS_OVERLAP : BOUND_BONES_OVERLAP;
    int worst = 0;
    for (int i = 1; i < contact->count; i++)
        if (contact->states[i].overlap.depth_mm > contact->states[worst].overlap.depth_mm)
            worst = i;
    const struct overlap *o = &contact->states[worst].overlap;
    enum finding_level level = bound_level(id, o->depth_mm);
    if (level != FINDING_NOTE)
        inspection_note(inspection, level, a->name,
                        "overlaps with %s by up to %.2f mm, %.0f mm3 at %d degrees "
                        "(%.1f %.1f %.1f); more than %g mm: %s",
                        b->name, o->depth_mm, o->volume_mm3, worst * CONTACT_STEP_DEG, o->place.x,
                        o->place.y, o->place.z, bound_of(id)->most, bound_of(id)->source);
}

static void inspect_gap(const struct knee_case *knee, const struct contact *contact,
                        struct inspection *inspection) {
    const struct case_group *a = &knee->groups[contact->a], *b = &knee->groups[contact->b];
    enum bound_id id = gap_bound(a, b);
    int worst = 0;
    for (int i = 1; i < contact->count; i++)
        if (contact->states[i].gap.mm > contact->states[worst].gap.mm)
            worst = i;
    const struct gap *g = &contact->states[worst].gap;
    enum finding_level level = bound_level(id, g->mm);
    if (level != FINDING_NOTE && isfinite(g->mm))
        inspection_note(inspection, level, a->name,
                        "does not touch %s: at %d degrees the least gap is %.2f mm (%.1f %.1f "
                        "%.1f); more than %g mm: %s",
                        b->name, worst * CONTACT_STEP_DEG, g->mm, g->place.x, g->place.y,
                        g->place.z, bound_of(id)->most, bound_of(id)->source);
}

void contacts_inspect(const struct knee_case *knee, const struct contacts *contacts,
                      struct inspection *inspection) {
    for (int i = 0; i < contacts->count; i++) {
        inspect_overlap(knee, &contacts->all[i], inspection);
        if (contacts->all[i].has_gap)
            inspect_gap(knee, &contacts->all[i], inspection);
    }
    portals_inspect(knee, contacts->portals, inspection);
    landmarks_inspect(knee, contacts->landmark_off_mm, inspection);
}
