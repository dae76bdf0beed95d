// The cases that ship, made in memory: torn ligaments meet their keys and rest at rest, and the
// space around folds nowhere.
#include "base/check.h"
#include "check/field.h"
#include "fidelity.h"
#include "generate/generate.h"
#include "harmonic.h"
#include "step/session.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define AROUND_JOINT_MM 40.0 // corners of a box, at which two poses are compared
#define FINE_BOX_MM 6.0
#define FINE_MM 0.25
#define SAME_PLACE_MM 1.0

struct shipped {
    struct fidelity *fidelity;
    const struct scene *scene;
    const struct knee_case *knee;
    uint32_t hollow;
    size_t nodes, left_out;
    // Of the folds: with one surface in reach, off which the field fades; where a gap is filled;
    // where the harmonic displacement does not fold.
    size_t folds, fading, filled, beyond;
    size_t harmonic_folds; // of the harmonic displacement
    double key_error_mm, rest_mm;
    char pose[96]; // at which is being looked
};

// ---- torn ligaments ----

static double apart(const struct knee_case *knee, pose a, pose b) {
    double most = 0;
    for (int i = 0; i < 8; i++) {
        const double r = AROUND_JOINT_MM;
        vec3 corner = {i & 1 ? r : -r, i & 2 ? r : -r, i & 4 ? r : -r};
        vec3 p = pose_apply(knee->joint.T_tibia_joint, corner);
        most = fmax(most, vec3_distance(pose_apply(a, p), pose_apply(b, p)));
    }
    return most;
}

static struct joint_angles angles_of(const struct knee_case *knee, pose T_femur_tibia) {
    return joint_from_pose(&knee->joint, T_femur_tibia);
}

static pose seen(const struct scene_stance *stance) {
    return pose_compose(stance->correction[BODY_TIBIA], stance->T_femur_body[BODY_TIBIA]);
}

static void look_at_keys(struct shipped *s) {
    struct scene_stance stance;
    for (int i = 0; i < s->knee->key_count; i++) {
        struct joint_angles angles = angles_of(s->knee, s->knee->keys[i].physical);
        scene_stand(s->scene, ADAPTIVE_HINGE, &angles, &stance);
        s->key_error_mm =
            fmax(s->key_error_mm, apart(s->knee, seen(&stance), s->knee->keys[i].target));
    }
}

// A rest path of the case is met in its keys; without one the joint rests all along its axis.
static void look_at_rest(struct shipped *s) {
    struct scene_stance stance;
    int count = s->knee->rest_count ? s->knee->rest_count : 1201;
    for (int i = 0; i < count; i++) {
        struct joint_angles angles = {.flexion_deg = 0.1 * i};
        if (s->knee->rest_count)
            angles = angles_of(s->knee, s->knee->rest[i]);
        scene_stand(s->scene, ADAPTIVE_HINGE, &angles, &stance);
        s->rest_mm =
            fmax(s->rest_mm, apart(s->knee, seen(&stance), stance.T_femur_body[BODY_TIBIA]));
    }
}

// ---- folds ----

static bool is_folded(mat3 gradient) {
    return mat3_determinant(mat3_add_scaled(mat3_identity(), 1, gradient)) <= 0;
}

// -1: none.
static int nearest_but(const struct warp_contact *contacts, int count, int but) {
    int nearest = -1;
    for (int i = 0; i < count; i++)
        if (i != but && (nearest < 0 || contacts[i].distance < contacts[nearest].distance))
            nearest = i;
    return nearest;
}

// As the check of a case tells them apart.
static void add_fold(struct shipped *s, const struct warp_contact *contacts, int count, vec3 y) {
    int first = nearest_but(contacts, count, -1), second = nearest_but(contacts, count, first);
    double gap, left;
    s->folds++;
    if (second < 0) {
        s->fading++;
        return;
    }
    const struct warp_contact *a = &contacts[first], *b = &contacts[second];
    if (field_gap(a, b, y, &gap, &left))
        s->filled += left <= (1 - FILLED_SHARE) * gap;
}

// A gap that is narrower than the grid is looked at once more, on a finer one around the place,
// with the values of the whole on its border.
static bool harmonic_folds_near(const struct harmonic_setup *setup, const struct harmonic *whole,
                                vec3 y) {
    const vec3 around = {FINE_BOX_MM, FINE_BOX_MM, FINE_BOX_MM};
    struct harmonic_setup fine = *setup;
    struct harmonic space;
    bool folds = false;
    fine.box = (struct box){vec3_sub(y, around), vec3_add(y, around)};
    fine.spacing_mm = FINE_MM;
    fine.around = whole;
    harmonic_solve(&fine, &space);
    for (uint32_t i = 0; !folds && i < space.count; i++) {
        mat3 gradient;
        folds = vec3_distance(harmonic_place(&space, i), y) <= SAME_PLACE_MM &&
                harmonic_gradient(&space, i, &gradient) && is_folded(gradient);
    }
    harmonic_fini(&space);
    return folds;
}

// Where, between what, and whether the harmonic displacement folds there too.
static void tell_fold(const struct shipped *s, const struct warp_contact *contacts, int count,
                      vec3 y, double determinant, bool harmonic_folds) {
    int first = nearest_but(contacts, count, -1), second = nearest_but(contacts, count, first);
    char name[128], text[400], beside[2][80];
    const int two[2] = {first, second};
    for (int i = 0; i < 2; i++) {
        const struct warp_contact *c = two[i] < 0 ? NULL : &contacts[two[i]];
        beside[i][0] = '\0';
        if (c)
            snprintf(beside[i], sizeof beside[i], ", %.2f mm from %s", c->distance,
                     s->knee->groups[c->surface].name);
    }
    snprintf(name, sizeof name, "shipped/%s/fold %zu", s->knee->name, s->folds);
    snprintf(text, sizeof text, "%.3g at (%.1f %.1f %.1f), %s%s%s; the harmonic %s", determinant,
             y.x, y.y, y.z, s->pose, beside[0], beside[1],
             harmonic_folds ? "folds there too" : "does not fold there");
    report_text(s->fidelity->report, name, text);
}

static void look_at_node(struct shipped *s, const struct harmonic_setup *setup,
                         const struct harmonic *space, uint32_t node) {
    struct session_settings settings = session_settings_default();
    struct warp_contact contacts[WARP_SURFACES_MAX];
    struct warp_memory memory;
    struct warp warp;
    mat3 gradient;
    vec3 y = harmonic_place(space, node);
    bool harmonic_folds = harmonic_gradient(space, node, &gradient) && is_folded(gradient);
    warp_memory_init(&memory);
    int count = warp_contacts(setup->scene, &settings.field, y, &memory, &warp, contacts);
    double determinant = mat3_determinant(mat3_add_scaled(mat3_identity(), 1, warp.gradient));
    s->nodes++;
    s->harmonic_folds += harmonic_folds;
    if (determinant > 0)
        return;
    add_fold(s, contacts, count, y);
    harmonic_folds = harmonic_folds || harmonic_folds_near(setup, space, y);
    s->beyond += !harmonic_folds;
    tell_fold(s, contacts, count, y, determinant, harmonic_folds);
}

// Nothing moves farther from what is displaced.
static struct box within_reach(const struct warp_scene *scene, struct box box) {
    struct session_settings settings = session_settings_default();
    double reach = field_reach(scene, &settings.field, box);
    vec3 around = {reach, reach, reach};
    return (struct box){vec3_sub(box.min, around), vec3_add(box.max, around)};
}

static void look_for_folds(struct shipped *s, const struct joint_angles *angles) {
    struct scene_stance stance;
    struct hull hull;
    struct box box;
    struct harmonic space;
    scene_stand(s->scene, ADAPTIVE_HINGE, angles, &stance);
    if (!(anatomy_largest(&stance.warp, &box) > 1e-3))
        return;
    anatomy_hull(&stance.warp, &hull);
    struct harmonic_setup setup = {.scene = &stance.warp,
                                   .hollow = s->hollow,
                                   .box = within_reach(&stance.warp, box),
                                   .spacing_mm = s->fidelity->quick ? 2.5 : 1,
                                   .is_within = hull_holds,
                                   .context = &hull};
    harmonic_solve(&setup, &space);
    for (uint32_t i = 0; i < space.count; i++) {
        if (anatomy_reaches(&stance.warp, s->hollow, harmonic_place(&space, i)))
            look_at_node(s, &setup, &space, i);
        else
            s->left_out++;
    }
    harmonic_fini(&space);
}

// Over flexion at rest, and as each torn ligament's keys hold the joint.
static void walk(struct shipped *s) {
    for (int flexion = 0; flexion <= 90; flexion += s->fidelity->quick ? 60 : 30) {
        snprintf(s->pose, sizeof s->pose, "%d degrees", flexion);
        look_for_folds(s, &(struct joint_angles){.flexion_deg = flexion});
    }
    for (int i = 0; i < s->knee->key_count; i += s->fidelity->quick ? 3 : 1) {
        struct joint_angles angles = angles_of(s->knee, s->knee->keys[i].physical);
        snprintf(s->pose, sizeof s->pose, "%s at %.0f degrees",
                 s->knee->torn[s->knee->keys[i].ligament], angles.flexion_deg);
        look_for_folds(s, &angles);
    }
}

// ---- recipes ----

static void report_shipped(const struct shipped *s) {
    struct report *report = s->fidelity->report;
    const char *name = s->knee->name;
    report_figure(report, (double)s->nodes, "nodes", "shipped/%s/reached", name);
    report_figure(report, (double)s->left_out, "nodes", "shipped/%s/left out", name);
    report_figure(report, (double)s->folds, "nodes", "shipped/%s/folds", name);
    report_figure(report, (double)s->filled, "nodes", "shipped/%s/folds/in filled gaps", name);
    report_figure(report, (double)s->fading, "nodes", "shipped/%s/folds/fading", name);
    report_figure(report, (double)(s->folds - s->fading - s->filled), "nodes",
                  "shipped/%s/folds/others", name);
    report_figure(report, (double)s->harmonic_folds, "nodes", "shipped/%s/folds/harmonic", name);
    report_figure(report, (double)s->beyond, "nodes", "shipped/%s/folds/beyond harmonic", name);
    if (!s->knee->key_count)
        return;
    report_figure(report, s->key_error_mm, "mm", "shipped/%s/key error", name);
    report_figure(report, s->rest_mm, "mm", "shipped/%s/rest warp", name);
}

static bool displaces(const struct recipe *recipe) {
    bool found = false;
    for (int i = 0; i < recipe->step_count; i++)
        found |= recipe->steps[i].kind == PATHOLOGY_CAVITY ||
                 recipe->steps[i].kind == PATHOLOGY_LIGAMENT;
    return found;
}

static enum result measure_recipe(struct fidelity *f, const char *path, struct error *err) {
    struct recipe recipe;
    struct knee_case *knee;
    struct scene *scene;
    enum result result = recipe_load(path, &recipe, err);
    if (result == RESULT_OK && !displaces(&recipe))
        return RESULT_OK;
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &knee, err);
    if (result != RESULT_OK)
        return result;
    result = scene_create(&knee, &scene, err);
    if (result != RESULT_OK) {
        case_destroy(&knee);
        return result;
    }
    struct shipped s = {.fidelity = f, .scene = scene, .knee = scene_case(scene)};
    for (int i = 0; i < s.knee->group_count; i++)
        s.hollow |= case_group_is_skin(&s.knee->groups[i]) ? 1u << i : 0;
    look_at_keys(&s);
    look_at_rest(&s);
    walk(&s);
    report_shipped(&s);
    f->key_error_mm = fmax(f->key_error_mm, s.key_error_mm);
    f->rest_mm = fmax(f->rest_mm, s.rest_mm);
    f->folds += s.beyond;
    scene_destroy(&scene);
    return RESULT_OK;
}

static int is_recipe(const struct dirent *entry) {
    char path[512];
    snprintf(path, sizeof path, CASES "/%s/recipe.ini", entry->d_name);
    FILE *file = fopen(path, "re");
    if (file)
        fclose(file);
    return file != NULL;
}

enum result fidelity_shipped(struct fidelity *f, struct error *err) {
    struct dirent **entries;
    int count = scandir(CASES, &entries, is_recipe, alphasort);
    if (count <= 0)
        return fail(err, RESULT_MISSING, "no recipes in " CASES);
    enum result result = RESULT_OK;
    for (int i = 0; i < count; i++) {
        char path[512];
        snprintf(path, sizeof path, CASES "/%s", entries[i]->d_name);
        if (result == RESULT_OK)
            result = measure_recipe(f, path, err);
        free(entries[i]);
    }
    free(entries);
    return result;
}
