#include "check/findings.h"

#include <stdio.h>

#define REST_MAX_MM 1e-6
#define TOUCH_MAX_MM 1e-4
#define MOST 0.999
#define LIGAMENT_GAIN_STEEP 4
#define LIGAMENT_GAIN_MAX 8

static const char *group_of(const struct case_check *check, int surface) {
    return surface < 0 ? "nothing" : check->groups[surface];
}

static void describe(const struct case_check *check, const struct field_spot *spot, int index,
                     char out[256]) {
    snprintf(out, 256, "%s, (%.1f %.1f %.1f), between %s and %s", check->poses[index].name,
             spot->place.x, spot->place.y, spot->place.z, group_of(check, spot->nearest[0]),
             group_of(check, spot->nearest[1]));
}

static double share(const struct case_check *check, uint64_t count) {
    return check->field->looked ? (double)count / (double)check->field->looked : 0;
}

static bool is_filled_at_rest(const struct case_check *check) {
    for (int i = 0; i < check->pose_count; i++)
        if (check->poses[i].key < 0 && check->poses[i].field->filled)
            return true;
    return false;
}

static void find_folds(struct case_check *check) {
    const struct field_figures *f = check->field;
    char where[256];
    bool many = share(check, f->folded) > FOLDS_MAX;
    if (f->filled) {
        describe(check, &f->filling, check->filling_pose, where);
        inspection_note(&check->findings,
                        many || is_filled_at_rest(check) ? FINDING_FAULT : FINDING_WARNING, "case",
                        "%.3g %% of the warped space folds, in any field, because displacements "
                        "close a gap. A gap of %.2f mm becomes %.2f mm at %s",
                        100 * share(check, f->filled), f->filling.gap_mm, f->filling.left_mm,
                        where);
    }
    if (field_own_folds(f)) {
        describe(check, &f->fold, check->fold_pose, where);
        inspection_note(&check->findings, many ? FINDING_FAULT : FINDING_WARNING, "field",
                        "%.3g %% of the warped space folds, det(I + dW) = %.3g at %s",
                        100 * share(check, field_own_folds(f)), f->fold.value, where);
    }
    if (f->faded) {
        describe(check, &f->fading, check->fading_pose, where);
        inspection_note(&check->findings, many ? FINDING_FAULT : FINDING_WARNING,
                        group_of(check, f->fading.nearest[0]),
                        "is displaced by about as much as the field reaches: %.3g %% of the warped "
                        "space folds off it, where nothing else is near, det(I + dW) = %.3g at %s",
                        100 * share(check, f->faded), f->fading.value, where);
    }
}

static void find_eased(struct case_check *check) {
    const struct field_figures *f = check->eased;
    char where[256];
    if (check->eased_pose < 0)
        return;
    const struct field_spot *spot = field_worst_fold(check->poses[check->eased_pose].eased);
    double share = (double)f->folded / (double)f->looked;
    describe(check, spot, check->eased_pose, where);
    inspection_note(&check->findings, share > FOLDS_MAX ? FINDING_WARNING : FINDING_NOTE, "field",
                    "between S' and maxcut, as cuts leave it, %.3g %% of the warped space folds, "
                    "det(I + dW) = %.3g at %s",
                    100 * share, spot->value, where);
}

static void find_gain(struct case_check *check) {
    const struct field_figures *f = check->field;
    char where[256];
    if (!f->looked) {
        inspection_note(&check->findings, FINDING_NOTE, "field", "nothing is displaced");
        return;
    }
    describe(check, &f->gain, check->gain_pose, where);
    inspection_note(&check->findings, FINDING_NOTE, "field",
                    "largest gain %.2f, 99.9 %% within %.2f; the largest at %s", f->gain.value,
                    field_gain_within(f, MOST), where);
}

static void find_jumps(struct case_check *check) {
    const struct field_figures *f = check->field;
    char where[256];
    if (!f->jumped)
        return;
    describe(check, &f->jump, check->jump_pose, where);
    inspection_note(&check->findings, FINDING_WARNING, group_of(check, f->jump.nearest[0]),
                    "is hollow and follows two bones: where its closest point jumps, the "
                    "displacement jumps by up to %.2f mm, at %s",
                    f->jump.value, where);
}

static void find_touch(struct case_check *check) {
    double largest = 0;
    int worst = -1;
    uint64_t count = 0;
    for (int i = 0; i < check->pose_count; i++) {
        const struct touch_figures *t = &check->poses[i].touch;
        count += t->count;
        if (t->count && t->largest_mm >= largest) {
            largest = t->largest_mm;
            worst = i;
        }
    }
    if (worst < 0)
        return;
    const struct touch_figures *t = &check->poses[worst].touch;
    inspection_note(&check->findings, largest > TOUCH_MAX_MM ? FINDING_FAULT : FINDING_NOTE,
                    group_of(check, t->surface),
                    "touched in %llu places, a point is off by at most %.2g mm (%s, %.1f %.1f "
                    "%.1f)",
                    (unsigned long long)count, largest, check->poses[worst].name, t->place.x,
                    t->place.y, t->place.z);
}

// The worst of one pair of groups over all poses, of each kind.
enum { FILLED_AT_REST, FILLED_IN_KEYS, STRAINED, KIND_COUNT };

struct pair_worst {
    int index[KIND_COUNT]; // of the pose, -1: none
    struct facing_spot spot[KIND_COUNT];
    uint64_t count[KIND_COUNT];
};

static double severity(const struct facing_spot *spot, int kind) {
    return (kind == STRAINED ? spot->apart_mm : spot->closed_mm) - spot->gap_mm;
}

static void gather_kind(struct pair_worst *worst, int kind, int index, uint64_t count,
                        const struct facing_spot *spot) {
    if (count &&
        (worst->index[kind] < 0 || severity(spot, kind) > severity(&worst->spot[kind], kind))) {
        worst->index[kind] = index;
        worst->spot[kind] = *spot;
    }
    worst->count[kind] += count;
}

static void gather_pair(const struct case_check *check, int a, int b, struct pair_worst *out) {
    *out = (struct pair_worst){.index = {-1, -1, -1}};
    for (int i = 0; i < check->pose_count; i++) {
        const struct facing_figures *f = check->poses[i].facing;
        int filled = check->poses[i].key < 0 ? FILLED_AT_REST : FILLED_IN_KEYS;
        for (int k = 0; k < f->count; k++) {
            const struct facing_pair *pair = &f->pairs[k];
            if (pair->a != a || pair->b != b)
                continue;
            gather_kind(out, filled, i, pair->filled, &pair->filling);
            gather_kind(out, STRAINED, i, pair->strained, &pair->strain);
        }
    }
}

static void find_pair(struct case_check *check, int a, int b) {
    struct pair_worst worst;
    gather_pair(check, a, b, &worst);
    for (int kind = 0; kind < KIND_COUNT; kind++) {
        const struct facing_spot *s = &worst.spot[kind];
        if (worst.index[kind] < 0)
            continue;
        inspection_note(
            &check->findings, kind == FILLED_AT_REST ? FINDING_FAULT : FINDING_WARNING,
            check->groups[a],
            "faces %s over a gap of %.2f mm, and their displacements %s by %.2f mm "
            "(%s, %.1f %.1f %.1f; %llu vertices)",
            check->groups[b], s->gap_mm, kind == STRAINED ? "differ" : "bring them closer",
            kind == STRAINED ? s->apart_mm : s->closed_mm, check->poses[worst.index[kind]].name,
            s->place.x, s->place.y, s->place.z, (unsigned long long)worst.count[kind]);
    }
}

static void find_ligament_gain(struct case_check *check, const struct check_pose *at) {
    enum finding_level level = at->gain > LIGAMENT_GAIN_MAX     ? FINDING_FAULT
                               : at->gain > LIGAMENT_GAIN_STEEP ? FINDING_WARNING
                                                                : FINDING_NOTE;
    inspection_note(&check->findings, level, "joint",
                    "%s: on the way from rest the shown tibia goes up to %.2f mm further for each "
                    "mm of the mock-up's",
                    at->name, at->gain);
}

static void find_rest(struct case_check *check) {
    if (check->rest_mm > REST_MAX_MM)
        inspection_note(&check->findings, FINDING_FAULT, "joint",
                        "with intact ligaments at rest the shown tibia is moved by %.2g mm; the "
                        "bound is %.2g mm",
                        check->rest_mm, REST_MAX_MM);
    else
        inspection_note(&check->findings, FINDING_NOTE, "joint",
                        "each key is met; at rest the tibia is moved by at most %.2g mm",
                        check->rest_mm);
}

static void find_ligaments(struct case_check *check, const struct knee_case *knee) {
    if (knee->torn_count)
        find_rest(check);
    for (int i = 0; i < check->pose_count; i++) {
        const struct check_pose *at = &check->poses[i];
        if (at->key >= 0)
            find_ligament_gain(check, at);
        double sunk = at->bones.virtual_mm - at->bones.physical_mm;
        if (at->key < 0 || sunk <= SUNK_MM)
            continue;
        inspection_note(&check->findings, sunk > SUNK_MAX_MM ? FINDING_FAULT : FINDING_WARNING,
                        "joint",
                        "%s: the virtual tibia is %.2f mm inside the femur, the mock-up's %.2f mm "
                        "(%.1f %.1f %.1f)",
                        at->name, at->bones.virtual_mm, at->bones.physical_mm, at->bones.place.x,
                        at->bones.place.y, at->bones.place.z);
    }
}

static void find_left_out(struct case_check *check) {
    uint64_t places[PLACE_COUNT] = {0}, all = 0;
    for (int i = 0; i < check->pose_count; i++)
        for (int p = 0; p < PLACE_COUNT; p++) {
            places[p] += check->poses[i].places[p];
            all += check->poses[i].places[p];
        }
    const struct field_figures *f = check->field;
    if (all)
        inspection_note(&check->findings, FINDING_NOTE, "space",
                        "%g mm grid near displaced surfaces, %d poses, %llu places: %llu warped, "
                        "%llu not; left out %llu in solids, %llu outside, %llu in pockets, %llu "
                        "within %.1f mm of a second group",
                        check->settings.spacing_mm, check->pose_count, (unsigned long long)all,
                        (unsigned long long)f->looked, (unsigned long long)f->still,
                        (unsigned long long)places[PLACE_SOLID],
                        (unsigned long long)places[PLACE_OUTSIDE],
                        (unsigned long long)places[PLACE_POCKET], (unsigned long long)f->close,
                        SECOND_GROUP_MM);
}

void findings_grade(struct case_check *check) {
    check->grade = check->findings.faults     ? GRADE_UNFIT
                   : check->findings.warnings ? GRADE_WARNINGS
                                              : GRADE_FIT;
}

void findings_gather(struct case_check *check, const struct knee_case *knee) {
    find_left_out(check);
    find_folds(check);
    find_eased(check);
    find_gain(check);
    find_jumps(check);
    find_touch(check);
    for (int a = 0; a < check->group_count; a++)
        for (int b = a + 1; b < check->group_count; b++)
            find_pair(check, a, b);
    find_ligaments(check, knee);
}
