#include "attempt_body.h"

#include "base/clock.h"
#include "folder.h"
#include "landmarks/landmarks.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char dir[FOLDER_MAX];
struct scene *scene;
struct task task;
struct site *site;
struct attempt attempt;
struct session_output output;
struct error err;
struct random noise;

#define HEAD                                                                                       \
    "[task]\ntitle = T\nbriefing = Do it.\nlimit_s = 60\n[pass]\ntime_s = 30\nsource = by hand\n"

void begin(const char *text) {
    char path[FOLDER_MAX + 16];
    struct view_optic optic = {.tilt_deg = 0, .field_deg = 60};
    snprintf(path, sizeof path, "%s/one.ini", dir);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "%s%s", HEAD, text);
    assert_int_equal(fclose(file), 0);
    assert_ok(task_load(path, &task, &err));
    site_destroy(&site);
    assert_ok(site_create(&task, scene, instruments_usual(), &optic, &site, &err));
    memset(&output, 0, sizeof output);
    output.state = SESSION_RUNNING;
    for (int i = 0; i < BODY_COUNT; i++)
        output.T_mockup_body[i] = output.T_mockup_virtual[i] = pose_identity();
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        output.instruments[i].warp.nearest = -1;
        output.instruments[i].warp.nearest_mm = INFINITY;
        output.instruments[i].handle_validity = VALIDITY_LOST;
    }
    attempt_init(&attempt);
    noise = (struct random){11};
}

struct attempt_news steps(int count) {
    struct attempt_news all = {0};
    for (int i = 0; i < count; i++) {
        output.step++;
        output.time_ns += STEP_NS;
        struct attempt_news news = attempt_step(&attempt, site, &output);
        all.goals_met |= news.goals_met;
        all.errors |= news.errors;
        all.ended |= news.ended;
    }
    return all;
}

void place(int tool, pose T) {
    output.instruments[tool].present = true;
    output.instruments[tool].T_mockup_tip = output.instruments[tool].T_mockup_warped = T;
}

pose looking(vec3 from, vec3 to) {
    vec3 z = vec3_unit_or(vec3_sub(to, from), (vec3){0, 0, 1}), up = {0, 0, 1};
    vec3 x = vec3_unit_or(vec3_cross(up, z), (vec3){1, 0, 0}), y = vec3_cross(z, x);
    mat3 m = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}};
    return (pose){quat_from_mat3(m), from};
}

vec3 landmark(const char *name) {
    return case_landmark(scene_case(scene), name)->at;
}

int group(const char *name) {
    const struct knee_case *knee = scene_case(scene);
    for (int i = 0; i < knee->group_count; i++)
        if (!strcmp(knee->groups[i].name, name))
            return i;
    fail_msg("no group %s", name);
    return -1;
}

void touch(int tool, const char *name, vec3 at, double off_mm, double deep_mm) {
    place(tool, (pose){quat_identity(), at});
    output.instruments[tool].warp.nearest = group(name);
    output.instruments[tool].warp.nearest_mm = off_mm;
    output.instruments[tool].penetration_mm = deep_mm;
}

const vec3 forward = {0, 1, 0};

void see_patella(double away_mm) {
    vec3 p = landmark("patella");
    place(SCOPE, looking(vec3_add_scaled(p, away_mm, forward), p)); // from its middle
}

void land(double under, double over, double rim, double step) {
    output.landed = (struct landed){.job = 1, .outcome = JOB_DONE};
    output.landed.figures.cuts = 1;
    output.landed.figures.quality = (struct quality_report){
        .planned_mm3 = 100, .under_mm3 = under, .over_mm3 = over, .rim_mm = rim, .step_mm = step};
    steps(1);
    output.landed.job = 0;
}

void bend(double flexion_deg, double valgus_deg, double drawer_mm) {
    const struct knee_case *knee = scene_case(scene);
    struct joint_angles angles = case_rest(knee, flexion_deg);
    angles.varus_deg -= valgus_deg;
    angles.drawer_mm += drawer_mm;
    output.T_mockup_virtual[BODY_TIBIA] = joint_to_pose(&knee->joint, &angles);
}

vec3 trembling(vec3 p) {
    return vec3_add(p, random_in_box(&noise, 0.17)); // 0.1 mm root mean square
}

// ---- the case -----------------------------------------------------------------------------------

void loose(int i, enum loose_state state) {
    output.loose_count = scene_case(scene)->loose_count;
    output.loose[i].state = state;
}

int make_case(void **state) {
    (void)state;
    struct recipe recipe;
    struct knee_case *knee;
    folder_make(dir);
    assert_ok(recipe_load(CASES "/healthy", &recipe, &err));
    recipe.resolution_mm = 3; // soon made
    assert_ok(generate_knee(&recipe, &knee, &err));
    assert_ok(landmarks_find(knee, NULL, &err));
    for (int i = 0; i < 2; i++) {
        struct case_loose *one = &knee->loose[knee->loose_count++];
        *one = (struct case_loose){.body = BODY_TIBIA,
                                   .at = case_landmark(knee, "plateau_medial")->at,
                                   .radii_mm = {3, 3, 2}};
        snprintf(one->name, sizeof one->name, "piece_%d", i + 1);
    }
    assert_ok(scene_create(&knee, &scene, &err));
    return 0;
}

int drop_case(void **state) {
    (void)state;
    site_destroy(&site);
    scene_destroy(&scene);
    folder_remove(dir);
    return 0;
}
