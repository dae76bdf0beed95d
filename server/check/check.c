#include "check/check.h"

#include "base/check.h"
#include "mesh/topology.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NEAR_JOINT_MM 60
#define PLANES_OFF_MM 10
#define REST_MAX_MM 1e-6
#define TOUCH_MAX_MM 1e-4
#define FLEXION_MAX_DEG 120
#define MOST 0.999

struct check_settings check_settings_default(bool quick) {
    struct session_settings session = session_settings_default();
    return (struct check_settings){
        .field = session.field,
        .adaptive = session.adaptive,
        .spacing_mm = quick ? 1 : 0.5,
        .flexion_step_deg = quick ? 60 : 15,
        .quick = quick,
    };
}

// ---- the space ----------------------------------------------------------------------------------

void check_roles(const struct scene *scene, struct space_surface out_surfaces[CASE_GROUPS_MAX]) {
    const struct knee_case *knee = scene_case(scene);
    for (int i = 0; i < knee->group_count; i++) {
        struct topology t = topology_of(&knee->groups[i].mesh);
        bool is_skin = !strcmp(knee->groups[i].name, "skin");
        out_surfaces[i] =
            (struct space_surface){is_skin ? SPACE_SKIN : SPACE_SOLID, !t.closed || !t.oriented};
    }
}

static bool has_skin(const struct knee_case *knee) {
    for (int i = 0; i < knee->group_count; i++)
        if (!strcmp(knee->groups[i].name, "skin"))
            return true;
    return false;
}

// Directions spread evenly over the sphere, along a spiral.
static void spread(vec3 *out, int count) {
    for (int i = 0; i < count; i++) {
        double z = 1 - (2 * i + 1.0) / count, angle = i * 2.399963229728653, r = sqrt(1 - z * z);
        out[i] = (vec3){r * cos(angle), r * sin(angle), z};
    }
}

static void widen(struct plane *planes, const vec3 *normals, const struct mesh *mesh, pose T,
                  vec3 centre) {
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = pose_apply(T, mesh_vertex(mesh, v));
        if (vec3_distance(p, centre) > NEAR_JOINT_MM)
            continue;
        for (int i = 0; i < CONVEX_PLANES_MAX; i++)
            planes[i].offset = fmax(planes[i].offset, vec3_dot(normals[i], p) + PLANES_OFF_MM);
    }
}

int check_planes(const struct scene *scene, const struct scene_stance *stance,
                 struct plane *out_planes) {
    const struct knee_case *knee = scene_case(scene);
    if (has_skin(knee))
        return 0;
    vec3 normals[CONVEX_PLANES_MAX];
    spread(normals, CONVEX_PLANES_MAX);
    for (int i = 0; i < CONVEX_PLANES_MAX; i++)
        out_planes[i] = (struct plane){normals[i], -INFINITY};
    static const char *const bones[] = {"femur", "tibia", "patella"};
    for (int i = 0; i < knee->group_count; i++)
        for (int b = 0; b < 3; b++)
            if (!strcmp(knee->groups[i].name, bones[b]))
                widen(out_planes, normals, &knee->groups[i].mesh,
                      stance->T_femur_body[knee->groups[i].body], inspect_joint_centre(knee));
    return CONVEX_PLANES_MAX;
}

// ---- one pose -----------------------------------------------------------------------------------

static uint32_t skin_bit(const struct knee_case *knee) {
    uint32_t bits = 0;
    for (int i = 0; i < knee->group_count; i++)
        if (!strcmp(knee->groups[i].name, "skin"))
            bits |= UINT32_C(1) << i;
    return bits;
}

static void include(struct box *box, vec3 p) {
    box->min = (vec3){fmin(box->min.x, p.x), fmin(box->min.y, p.y), fmin(box->min.z, p.z)};
    box->max = (vec3){fmax(box->max.x, p.x), fmax(box->max.y, p.y), fmax(box->max.z, p.z)};
}

// Nothing can be reached beyond: of the skin, or of the planes, which are close to their hull.
static struct box bounds(const struct scene *scene, const struct scene_stance *stance) {
    const struct knee_case *knee = scene_case(scene);
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    double around = NEAR_JOINT_MM + 2 * PLANES_OFF_MM;
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        for (uint32_t v = 0; !strcmp(group->name, "skin") && v < group->mesh.vertex_count; v++)
            include(&box,
                    pose_apply(stance->T_femur_body[group->body], mesh_vertex(&group->mesh, v)));
    }
    for (int i = 0; i < 8 && !has_skin(knee); i++) {
        vec3 corner = {i & 1 ? around : -around, i & 2 ? around : -around,
                       i & 4 ? around : -around};
        include(&box, vec3_add(inspect_joint_centre(knee), corner));
    }
    return box;
}

static struct box common(struct box a, struct box b) {
    return (struct box){{fmax(a.min.x, b.min.x), fmax(a.min.y, b.min.y), fmax(a.min.z, b.min.z)},
                        {fmin(a.max.x, b.max.x), fmin(a.max.y, b.max.y), fmin(a.max.z, b.max.z)}};
}

static enum result walk(const struct check *check, const struct scene *scene,
                        const struct scene_stance *stance, const struct moved *moved,
                        struct check_pose *at, struct error *err) {
    struct space_surface roles[CASE_GROUPS_MAX];
    struct plane planes[CONVEX_PLANES_MAX];
    check_roles(scene, roles);
    struct space_setup setup = {
        .scene = &stance->warp,
        .surfaces = roles,
        .planes = planes,
        .plane_count = check_planes(scene, stance, planes),
        .box = common(moved_box(moved), bounds(scene, stance)),
        .spacing_mm = check->settings.spacing_mm,
    };
    struct space space;
    enum result result = space_init(&setup, &space, err);
    if (result != RESULT_OK)
        return result;
    space_find_pockets(&space);
    size_t count = space_count(&space);
    for (size_t n = 0; n < count; n++)
        at->places[space.places[n]]++;
    field_walk(&stance->warp, &check->settings.field, moved, skin_bit(scene_case(scene)), &space,
               at->field);
    space_fini(&space);
    return RESULT_OK;
}

static enum result look(struct check *check, const struct scene *scene, struct check_pose *at,
                        struct error *err) {
    struct scene_stance stance;
    struct moved moved;
    const struct field *field = &check->settings.field;
    scene_stand(scene, check->settings.adaptive, &at->joint, &stance);
    enum result result = moved_init(&stance.warp, field, &moved, err);
    if (result != RESULT_OK)
        return result;
    at->field = alloc(1, sizeof *at->field);
    at->facing = alloc(1, sizeof *at->facing);
    at->is_still = !moved.query;
    if (!at->is_still) {
        result = walk(check, scene, &stance, &moved, at, err);
        field_touch(&stance.warp, field, &at->touch);
        facing_compare(&stance.warp, skin_bit(scene_case(scene)), at->facing);
    }
    if (at->key >= 0)
        at->bones = ligaments_key(scene, check->settings.adaptive, at->key);
    moved_fini(&moved);
    return result;
}

// ---- all poses ----------------------------------------------------------------------------------

static struct check_pose *add_pose(struct check *check, struct joint_angles joint) {
    CHECK(check->pose_count < CHECK_POSES_MAX);
    struct check_pose *at = &check->poses[check->pose_count++];
    at->joint = joint;
    at->key = -1;
    snprintf(at->name, sizeof at->name, "%.0f degrees", joint.flexion_deg);
    return at;
}

static bool is_first_key(const struct knee_case *knee, int key) {
    for (int i = 0; i < key; i++)
        if (knee->keys[i].ligament == knee->keys[key].ligament)
            return false;
    return true;
}

static void choose_poses(struct check *check, const struct knee_case *knee) {
    for (double f = 0; f <= FLEXION_MAX_DEG; f += check->settings.flexion_step_deg)
        add_pose(check, ligaments_rest(knee, f));
    for (int i = 0; i < knee->key_count; i++) {
        if (check->settings.quick && !is_first_key(knee, i))
            continue;
        struct joint_angles joint = joint_from_pose(&knee->joint, knee->keys[i].physical);
        struct check_pose *at = add_pose(check, joint);
        at->key = i;
        snprintf(at->name, sizeof at->name, "%s at %.0f degrees",
                 knee->torn[knee->keys[i].ligament], joint.flexion_deg);
    }
}

static void keep_worst(struct field_spot *spot, int *which, bool has,
                       const struct field_spot *other, int index, bool lesser) {
    if (has && (*which < 0 || (lesser ? other->value < spot->value : other->value > spot->value))) {
        *spot = *other;
        *which = index;
    }
}

static void sum_up(struct check *check) {
    struct field_figures *all = check->field;
    for (int i = 0; i < check->pose_count; i++) {
        const struct field_figures *f = check->poses[i].field;
        keep_worst(&all->gain, &check->gain_pose, f->looked, &f->gain, i, false);
        keep_worst(&all->jump, &check->jump_pose, f->jumped, &f->jump, i, false);
        keep_worst(&all->fold, &check->fold_pose, field_own_folds(f), &f->fold, i, true);
        keep_worst(&all->filling, &check->filling_pose, f->filled, &f->filling, i, true);
        keep_worst(&all->yielding, &check->yielding_pose, f->yielded, &f->yielding, i, true);
        all->looked += f->looked;
        all->still += f->still;
        all->close += f->close;
        all->folded += f->folded;
        all->yielded += f->yielded;
        all->filled += f->filled;
        all->jumped += f->jumped;
        for (int b = 0; b < GAIN_BINS; b++)
            all->gains[b] += f->gains[b];
    }
}

// ---- findings -----------------------------------------------------------------------------------

static const char *group_of(const struct check *check, int surface) {
    return surface < 0 ? "nothing" : check->groups[surface];
}

static void describe(const struct check *check, const struct field_spot *spot, int index,
                     char out[256]) {
    snprintf(out, 256, "%s, (%.1f %.1f %.1f), between %s and %s", check->poses[index].name,
             spot->place.x, spot->place.y, spot->place.z, group_of(check, spot->nearest[0]),
             group_of(check, spot->nearest[1]));
}

static double share(const struct check *check, uint64_t count) {
    return check->field->looked ? (double)count / (double)check->field->looked : 0;
}

static bool is_filled_at_rest(const struct check *check) {
    for (int i = 0; i < check->pose_count; i++)
        if (check->poses[i].key < 0 && check->poses[i].field->filled)
            return true;
    return false;
}

static void find_folds(struct check *check) {
    const struct field_figures *f = check->field;
    char where[256];
    bool many = share(check, f->folded - f->yielded) > FOLDS_MAX;
    if (f->filled) {
        describe(check, &f->filling, check->filling_pose, where);
        inspection_note(&check->findings,
                        many || is_filled_at_rest(check) ? FINDING_FAULT : FINDING_WARNING, "case",
                        "%.3g %% of the warped space folds for the case's fault, in any field: it "
                        "fills a gap; of %.2f mm %.2f are left at %s",
                        100 * share(check, f->filled), f->filling.gap_mm, f->filling.left_mm,
                        where);
    }
    if (field_own_folds(f)) {
        describe(check, &f->fold, check->fold_pose, where);
        inspection_note(&check->findings, many ? FINDING_FAULT : FINDING_WARNING, "field",
                        "%.3g %% of the warped space folds, det(I + dW) = %.3g at %s",
                        100 * share(check, field_own_folds(f)), f->fold.value, where);
    }
    if (f->yielded) {
        describe(check, &f->yielding, check->yielding_pose, where);
        inspection_note(&check->findings, FINDING_WARNING, "skin",
                        "%.3g %% of the warped space folds against the skin, which gives way, "
                        "det(I + dW) = %.3g at %s",
                        100 * share(check, f->yielded), f->yielding.value, where);
    }
}

static void find_gain(struct check *check) {
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

static void find_jumps(struct check *check, const struct knee_case *knee) {
    const struct field_figures *f = check->field;
    char where[256];
    if (!f->jumped)
        return;
    int surface = f->jump.nearest[0];
    bool cured = check->settings.field.kind != FIELD_SMOOTH && surface >= 0 &&
                 knee->groups[surface].warp && !knee->groups[surface].bridges;
    describe(check, &f->jump, check->jump_pose, where);
    inspection_note(&check->findings, FINDING_WARNING, group_of(check, surface),
                    "is hollow: where its closest point jumps, the displacement jumps by up to "
                    "%.2f mm, at %s%s",
                    f->jump.value, where, cured ? "; not in the field smooth" : "");
}

static void find_touch(struct check *check) {
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

static void gather_pair(const struct check *check, int a, int b, struct pair_worst *out) {
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

static void find_pair(struct check *check, int a, int b) {
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

static void find_ligaments(struct check *check, const struct knee_case *knee) {
    if (knee->torn_count)
        inspection_note(
            &check->findings, check->rest_mm > REST_MAX_MM ? FINDING_FAULT : FINDING_NOTE, "joint",
            "each key is met; at rest the tibia is moved by at most %.2g mm", check->rest_mm);
    for (int i = 0; i < check->pose_count; i++) {
        const struct check_pose *at = &check->poses[i];
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

static void find_left_out(struct check *check) {
    uint64_t places[PLACE_COUNT] = {0}, all = 0;
    for (int i = 0; i < check->pose_count; i++)
        for (int p = 0; p < PLACE_COUNT; p++) {
            places[p] += check->poses[i].places[p];
            all += check->poses[i].places[p];
        }
    const struct field_figures *f = check->field;
    if (all)
        inspection_note(&check->findings, FINDING_NOTE, "space",
                        "%g mm grid near what is displaced, %d poses, %llu places: %llu warped, "
                        "%llu not; left out %llu in solids, %llu outside, %llu in pockets, %llu "
                        "within %.1f mm of a second group",
                        check->settings.spacing_mm, check->pose_count, (unsigned long long)all,
                        (unsigned long long)f->looked, (unsigned long long)f->still,
                        (unsigned long long)places[PLACE_SOLID],
                        (unsigned long long)places[PLACE_OUTSIDE],
                        (unsigned long long)places[PLACE_POCKET], (unsigned long long)f->close,
                        SECOND_GROUP_MM);
}

static void grade(struct check *check) {
    check->grade = check->findings.faults ? GRADE_UNFIT : GRADE_FIT;
    for (int i = 0; i < check->findings.count && check->grade == GRADE_FIT; i++)
        if (check->findings.findings[i].level == FINDING_WARNING)
            check->grade = GRADE_WARNINGS;
}

static void find_all(struct check *check, const struct knee_case *knee) {
    find_left_out(check);
    find_folds(check);
    find_gain(check);
    find_jumps(check, knee);
    find_touch(check);
    for (int a = 0; a < check->group_count; a++)
        for (int b = a + 1; b < check->group_count; b++)
            find_pair(check, a, b);
    find_ligaments(check, knee);
}

// ---- the whole ----------------------------------------------------------------------------------

static struct check *begin(const struct check_settings *settings) {
    struct check *check = alloc(1, sizeof *check);
    check->settings = *settings;
    check->field = alloc(1, sizeof *check->field);
    check->gain_pose = check->fold_pose = check->filling_pose = -1;
    check->yielding_pose = check->jump_pose = -1;
    return check;
}

static enum result look_at_poses(struct check *check, const struct scene *scene,
                                 struct error *err) {
    const struct check_settings *settings = &check->settings;
    choose_poses(check, scene_case(scene));
    enum result result = RESULT_OK;
    for (int i = 0; i < check->pose_count && result == RESULT_OK; i++) {
        if (settings->progress)
            settings->progress(settings->context, check->poses[i].name, i, check->pose_count);
        result = look(check, scene, &check->poses[i], err);
    }
    return result;
}

static enum result look_at_scene(struct check *check, const struct scene *scene,
                                 struct error *err) {
    const struct knee_case *knee = scene_case(scene);
    enum result result = look_at_poses(check, scene, err);
    if (result != RESULT_OK)
        return result;
    sum_up(check);
    if (knee->torn_count)
        check->rest_mm = ligaments_rest_mm(scene, check->settings.adaptive);
    check->opening_count = knee->torn_count;
    for (int i = 0; i < knee->torn_count; i++)
        ligaments_opening(scene, check->settings.adaptive, i, &check->openings[i]);
    find_all(check, knee);
    return RESULT_OK;
}

enum result check_case(struct knee_case **knee, const struct check_settings *settings,
                       struct check **out_check, struct scene **out_scene, struct error *err) {
    struct check *check = begin(settings);
    snprintf(check->case_name, sizeof check->case_name, "%s", (*knee)->name);
    check->hash = (*knee)->hash;
    check->group_count = (*knee)->group_count;
    for (int i = 0; i < check->group_count; i++)
        memcpy(check->groups[i], (*knee)->groups[i].name, CASE_NAME_MAX);
    inspect_case(*knee, &check->findings);
    struct error why;
    *out_scene = NULL;
    enum result result = RESULT_OK;
    if (scene_create(knee, out_scene, &why) != RESULT_OK) {
        inspection_note(&check->findings, FINDING_FAULT, "case", "%s", why.text);
        case_destroy(knee);
    } else {
        result = look_at_scene(check, *out_scene, err);
    }
    grade(check);
    *out_check = check;
    if (result != RESULT_OK) {
        check_destroy(out_check);
        scene_destroy(out_scene);
    }
    return result;
}

struct check *check_of_none(const char *name, const struct check_settings *settings,
                            const struct error *why) {
    struct check *check = begin(settings);
    snprintf(check->case_name, sizeof check->case_name, "%s", name);
    inspection_note(&check->findings, FINDING_FAULT, "files", "%s", why->text);
    grade(check);
    return check;
}

void check_destroy(struct check **check) {
    struct check *c = *check;
    if (!c)
        return;
    for (int i = 0; i < c->pose_count; i++) {
        free(c->poses[i].field);
        free(c->poses[i].facing);
    }
    free(c->field);
    free(c);
    *check = NULL;
}
