#include "check/check.h"

#include "base/check.h"
#include "check/eased.h"
#include "check/findings.h"
#include "mesh/topology.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NEAR_JOINT_MM 60
#define PLANES_OFF_MM 10
#define FLEXION_MAX_DEG 120
#define EASED_EVERY_DEG 60 // of what lies between S' and S'_max, and on a coarser grid
#define EASED_COARSER 2

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
        const struct mesh *whole = &knee->groups[i].mesh;
        struct topology t = topology_of(whole);
        bool is_skin = case_group_is_skin(&knee->groups[i]);
        out_surfaces[i] = (struct space_surface){is_skin ? SPACE_SKIN : SPACE_SOLID,
                                                 !t.closed || !t.oriented, whole};
    }
}

static bool has_skin(const struct knee_case *knee) {
    for (int i = 0; i < knee->group_count; i++)
        if (case_group_is_skin(&knee->groups[i]))
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
        if (case_group_is_skin(&knee->groups[i]))
            bits |= UINT32_C(1) << i;
    return bits;
}

// Nothing can be reached beyond: of the skin, or of the planes, which are close to their hull.
static struct box bounds_of_stance(const struct scene *scene, const struct scene_stance *stance) {
    const struct knee_case *knee = scene_case(scene);
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    double around = NEAR_JOINT_MM + 2 * PLANES_OFF_MM;
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        for (uint32_t v = 0; case_group_is_skin(group) && v < group->mesh.vertex_count; v++)
            box_include(
                &box, pose_apply(stance->T_femur_body[group->body], mesh_vertex(&group->mesh, v)));
    }
    for (int i = 0; i < 8 && !has_skin(knee); i++) {
        vec3 corner = {i & 1 ? around : -around, i & 2 ? around : -around,
                       i & 4 ? around : -around};
        box_include(&box, vec3_add(inspect_joint_centre(knee), corner));
    }
    return box;
}

static struct box common(struct box a, struct box b) {
    return (struct box){{fmax(a.min.x, b.min.x), fmax(a.min.y, b.min.y), fmax(a.min.z, b.min.z)},
                        {fmin(a.max.x, b.max.x), fmin(a.max.y, b.max.y), fmin(a.max.z, b.max.z)}};
}

// A part of the check, from one share of it to another.
struct stage {
    const struct check_settings *settings;
    const char *what;
    double from, to;
};

static void tell_progress(void *context, double share) {
    const struct stage *stage = context;
    stage->settings->progress(stage->settings->context, stage->what,
                              (1 - share) * stage->from + share * stage->to);
}

struct walk {
    const struct scene_stance *stance;
    const struct warp_scene *aimed; // as field_walk
    const struct moved *moved;
    double spacing_mm;
};

static enum result walk_space(const struct case_check *check, const struct scene *scene,
                              const struct walk *walk, const struct progress *progress,
                              uint64_t places[PLACE_COUNT], struct field_figures *figures,
                              struct error *err) {
    struct space_surface roles[CASE_GROUPS_MAX];
    struct plane planes[CONVEX_PLANES_MAX];
    check_roles(scene, roles);
    struct space_setup setup = {
        .scene = &walk->stance->warp,
        .surfaces = roles,
        .planes = planes,
        .plane_count = check_planes(scene, walk->stance, planes),
        .box = common(moved_box(walk->moved), bounds_of_stance(scene, walk->stance)),
        .spacing_mm = walk->spacing_mm,
    };
    struct space space;
    enum result result = space_init(&setup, &space, err);
    if (result != RESULT_OK)
        return result;
    space_find_pockets(&space);
    size_t count = space_count(&space);
    for (size_t n = 0; n < count; n++)
        places[space.places[n]]++;
    field_walk(&walk->stance->warp, walk->aimed, &check->settings.field, walk->moved, &space,
               progress, figures);
    space_fini(&space);
    return RESULT_OK;
}

static enum result look_eased(const struct case_check *check, const struct scene *scene,
                              const struct eased *eased, const struct scene_stance *stance,
                              struct check_pose *at, struct error *err) {
    struct warp_scene aimed, changed;
    struct moved moved;
    uint64_t places[PLACE_COUNT] = {0};
    eased_stand(eased, stance, &aimed, &changed);
    enum result result = moved_init(&changed, &check->settings.field, &moved, err);
    if (result != RESULT_OK || !moved.query)
        return result;
    at->eased = alloc(1, sizeof *at->eased);
    struct walk way = {stance, &aimed, &moved, EASED_COARSER * check->settings.spacing_mm};
    result = walk_space(check, scene, &way, NULL, places, at->eased, err);
    moved_fini(&moved);
    return result;
}

static enum result look_around(struct case_check *check, const struct scene *scene,
                               const struct eased *eased, const struct progress *progress,
                               struct check_pose *at, struct error *err) {
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
        struct walk way = {&stance, NULL, &moved, check->settings.spacing_mm};
        result = walk_space(check, scene, &way, progress, at->places, at->field, err);
        field_touch(&stance.warp, field, &at->touch);
        facing_compare(&stance.warp, skin_bit(scene_case(scene)), at->facing);
    }
    if (at->key >= 0) {
        at->bones = ligaments_key(scene, check->settings.adaptive, at->key);
        at->gain = ligaments_gain(scene, check->settings.adaptive, at->key);
    }
    moved_fini(&moved);
    if (result == RESULT_OK && eased && at->key < 0 &&
        fmod(at->joint.flexion_deg, EASED_EVERY_DEG) == 0)
        result = look_eased(check, scene, eased, &stance, at, err);
    return result;
}

// ---- all poses ----------------------------------------------------------------------------------

static struct check_pose *add_pose(struct case_check *check, struct joint_angles joint) {
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

static void choose_poses(struct case_check *check, const struct knee_case *knee) {
    for (double f = 0; f <= FLEXION_MAX_DEG; f += check->settings.flexion_step_deg)
        add_pose(check, case_rest(knee, f));
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

static void sum_up_eased(struct case_check *check) {
    const struct field_spot *worst = NULL;
    for (int i = 0; i < check->pose_count; i++) {
        const struct field_figures *f = check->poses[i].eased;
        if (!f)
            continue;
        field_counts_add(check->eased, f);
        const struct field_spot *spot = field_worst_fold(f);
        if (spot && (!worst || spot->value < worst->value)) {
            worst = spot;
            check->eased_pose = i;
        }
    }
}

static void sum_up(struct case_check *check) {
    struct field_figures *all = check->field;
    for (int i = 0; i < check->pose_count; i++) {
        const struct field_figures *f = check->poses[i].field;
        keep_worst(&all->gain, &check->gain_pose, f->looked, &f->gain, i, false);
        keep_worst(&all->jump, &check->jump_pose, f->jumped, &f->jump, i, false);
        keep_worst(&all->fold, &check->fold_pose, field_own_folds(f), &f->fold, i, true);
        keep_worst(&all->filling, &check->filling_pose, f->filled, &f->filling, i, true);
        keep_worst(&all->fading, &check->fading_pose, f->faded, &f->fading, i, true);
        field_counts_add(all, f);
    }
    sum_up_eased(check);
}

// ---- the whole ----------------------------------------------------------------------------------

static struct case_check *begin(const struct check_settings *settings, const char *case_or_folder) {
    struct case_check *check = alloc(1, sizeof *check);
    check->settings = *settings;
    check->case_or_folder = strdup(case_or_folder);
    CHECK(check->case_or_folder);
    check->field = alloc(1, sizeof *check->field);
    check->eased = alloc(1, sizeof *check->eased);
    check->gain_pose = check->fold_pose = check->filling_pose = -1;
    check->fading_pose = check->jump_pose = check->eased_pose = -1;
    return check;
}

static enum result count_moved(const struct case_check *check, const struct scene *scene,
                               int *out_count, struct error *err) {
    *out_count = 0;
    for (int i = 0; i < check->pose_count; i++) {
        struct scene_stance stance;
        struct moved moved;
        scene_stand(scene, check->settings.adaptive, &check->poses[i].joint, &stance);
        enum result result = moved_init(&stance.warp, &check->settings.field, &moved, err);
        if (result != RESULT_OK)
            return result;
        *out_count += moved.query != NULL;
        moved_fini(&moved);
    }
    return RESULT_OK;
}

// About how much of the time the look at overlaps takes where something is displaced.
static double overlaps_share(const struct check_settings *settings) {
    return settings->quick ? 0.3 : 0.05;
}

// Poses at which nothing is displaced cost next to nothing, and count for none.
static enum result look_at_poses(struct case_check *check, const struct scene *scene,
                                 struct error *err) {
    const struct check_settings *settings = &check->settings;
    choose_poses(check, scene_case(scene));
    struct stage stage = {.settings = settings};
    const struct progress progress = {tell_progress, &stage};
    struct eased *eased = eased_create(scene);
    double first = overlaps_share(settings);
    int before = 0, count = 0; // of poses where something is displaced
    enum result result = settings->progress ? count_moved(check, scene, &count, err) : RESULT_OK;
    for (int i = 0; i < check->pose_count && result == RESULT_OK; i++) {
        stage.what = check->poses[i].name;
        stage.from = first + (1 - first) * before / fmax(count, 1);
        stage.to = first + (1 - first) * (before + 1) / fmax(count, 1);
        result = look_around(check, scene, eased, settings->progress ? &progress : NULL,
                             &check->poses[i], err);
        before += !check->poses[i].is_still;
    }
    eased_destroy(&eased);
    return result;
}

static enum result look_at_scene(struct case_check *check, const struct scene *scene,
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
    findings_gather(check, knee);
    return RESULT_OK;
}

static enum result look_at_knee(struct case_check *check, struct knee_case *knee,
                                struct error *err) {
    const struct check_settings *settings = &check->settings;
    struct stage stage = {settings, "overlaps", 0, overlaps_share(settings)};
    const struct progress progress = {tell_progress, &stage};
    inspect_case(knee, &check->findings);
    enum result result =
        contacts_look(knee, settings->progress ? &progress : NULL, &check->contacts, err);
    if (result == RESULT_OK)
        contacts_inspect(knee, &check->contacts, &check->findings);
    return result;
}

enum result check_case(struct knee_case **knee, const struct check_settings *settings,
                       struct case_check **out_check, struct scene **out_scene, struct error *err) {
    struct case_check *check = begin(settings, (*knee)->name);
    check->hash = (*knee)->hash;
    check->group_count = (*knee)->group_count;
    for (int i = 0; i < check->group_count; i++) {
        memcpy(check->groups[i], (*knee)->groups[i].name, CASE_NAME_MAX);
        check->group_colours[i] = (*knee)->groups[i].tissue.colour;
    }
    struct error why;
    *out_scene = NULL;
    enum result result = look_at_knee(check, *knee, err);
    if (result == RESULT_OK && scene_create(knee, out_scene, &why) != RESULT_OK) {
        inspection_note(&check->findings, FINDING_FAULT, "case", "%s", why.text);
        case_destroy(knee);
    } else if (result == RESULT_OK) {
        result = look_at_scene(check, *out_scene, err);
    }
    findings_grade(check);
    *out_check = check;
    if (result != RESULT_OK) {
        check_destroy(out_check);
        scene_destroy(out_scene);
    }
    return result;
}

struct case_check *check_of_none(const char *folder, const struct check_settings *settings,
                                 const struct error *why) {
    struct case_check *check = begin(settings, folder);
    inspection_note(&check->findings, FINDING_FAULT, "files", "%s", why->text);
    findings_grade(check);
    return check;
}

void check_destroy(struct case_check **check) {
    struct case_check *c = *check;
    if (!c)
        return;
    for (int i = 0; i < c->pose_count; i++) {
        free(c->poses[i].field);
        free(c->poses[i].eased);
        free(c->poses[i].facing);
    }
    free(c->case_or_folder);
    free(c->field);
    free(c->eased);
    free(c);
    *check = NULL;
}
