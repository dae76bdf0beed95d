// Goals and errors of a task: once met, once just missed, and with the noise of a tracker. Outputs
// are made here, so that each condition can be met or missed alone.
#include "task/attempt.h"

#include "base/clock.h"
#include "folder.h"
#include "generate/generate.h"
#include "landmarks/landmarks.h"
#include "random.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STEP_NS (10 * NS_PER_MS)
#define PROBE (CHANNEL_PROBE - CHANNEL_FIRST_INSTRUMENT)
#define SHAVER (CHANNEL_SHAVER - CHANNEL_FIRST_INSTRUMENT)
#define SCOPE (CHANNEL_SCOPE - CHANNEL_FIRST_INSTRUMENT)

static char dir[FOLDER_MAX];
static struct scene *scene;
static struct task task;
static struct site *site;
static struct attempt attempt;
static struct session_output output;
static struct error err;
static struct random noise;

#define HEAD                                                                                       \
    "[task]\ntitle = T\nbriefing = Do it.\nlimit_s = 60\n[pass]\ntime_s = 30\nsource = by hand\n"

// A session that runs, all bones at rest, no instrument.
static void begin(const char *text) {
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

static struct attempt_news steps(int count) {
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

static void place(int tool, pose T) {
    output.instruments[tool].present = true;
    output.instruments[tool].T_mockup_tip = output.instruments[tool].T_mockup_warped = T;
}

// Looks from `from` at `to`, y up.
static pose looking(vec3 from, vec3 to) {
    vec3 z = vec3_unit_or(vec3_sub(to, from), (vec3){0, 0, 1}), up = {0, 0, 1};
    vec3 x = vec3_unit_or(vec3_cross(up, z), (vec3){1, 0, 0}), y = vec3_cross(z, x);
    mat3 m = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}};
    return (pose){quat_from_mat3(m), from};
}

static vec3 landmark_of(const struct knee_case *knee, const char *name) {
    return case_landmark(knee, name)->at;
}

static vec3 landmark(const char *name) {
    return landmark_of(scene_case(scene), name);
}

static int group(const char *name) {
    const struct knee_case *knee = scene_case(scene);
    for (int i = 0; i < knee->group_count; i++)
        if (!strcmp(knee->groups[i].name, name))
            return i;
    fail_msg("no group %s", name);
    return -1;
}

// The tip of a tool on a group at a point.
static void touch(int tool, const char *name, vec3 at, double off_mm, double deep_mm) {
    place(tool, (pose){quat_identity(), at});
    output.instruments[tool].warp.nearest = group(name);
    output.instruments[tool].warp.nearest_mm = off_mm;
    output.instruments[tool].penetration_mm = deep_mm;
}

// In front of the patella nothing hides it.
static const vec3 forward = {0, 1, 0};

static void see_patella(double away_mm) {
    vec3 p = landmark("patella");
    place(SCOPE, looking(vec3_add_scaled(p, away_mm, forward), p)); // from its middle
}

static void land(double under, double over, double rim, double step) {
    output.landed = (struct landed){.job = 1, .outcome = JOB_DONE};
    output.landed.figures.cuts = 1;
    output.landed.figures.quality = (struct quality_report){
        .planned_mm3 = 100, .under_mm3 = under, .over_mm3 = over, .rim_mm = rim, .step_mm = step};
    steps(1);
    output.landed.job = 0;
}

// ---- goals --------------------------------------------------------------------------------------

static void a_landmark_is_seen(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nwithin_mm = 45\nbeyond_mm = 25\nhold_s = 0.2\n");
    see_patella(40);
    steps(20);
    assert_int_equal(attempt.goals_met, 0); // not long enough yet
    assert_int_equal(steps(2).goals_met, 1);
    assert_int_equal(attempt.end, ATTEMPT_DONE);
    assert_int_equal(attempt_verdict(&attempt, &task), VERDICT_PASSED);

    attempt_init(&attempt);
    see_patella(70); // too far
    assert_int_equal(steps(50).goals_met, 0);
    see_patella(10); // too near
    assert_int_equal(steps(50).goals_met, 0);
    vec3 p = landmark("patella"), from = vec3_add_scaled(p, 40, forward);
    place(SCOPE, looking(from, vec3_add(from, (vec3){1, 0, 0}))); // beside the picture
    assert_int_equal(steps(50).goals_met, 0);
    output.instruments[SCOPE].present = false;
    assert_int_equal(steps(50).goals_met, 0);
}

static void what_a_bone_hides_is_not_seen(void **state) {
    (void)state;
    begin("[goal a]\nsee = notch\nwithin_mm = 100\nhold_s = 0.1\n");
    vec3 p = landmark("notch");
    place(SCOPE, looking(vec3_add_scaled(p, 60, (vec3){1, 0, 0}), p)); // through a condyle
    assert_int_equal(steps(50).goals_met, 0);
    output.T_mockup_virtual[BODY_TIBIA].translation.z = -60;
    place(SCOPE, looking(vec3_add_scaled(p, 25, (vec3){0, 0.3, -1}), p)); // from below
    assert_int_equal(steps(50).goals_met, 1);
}

static void tissue_that_was_cut_hides_nothing(void **state) {
    (void)state;
    begin("[goal a]\nsee = plateau_medial\nwithin_mm = 100\nhold_s = 0.1\n");
    vec3 p = landmark("plateau_medial");
    output.T_mockup_virtual[BODY_FEMUR].translation.z = 200;
    place(SCOPE, looking(vec3_add_scaled(p, 30, (vec3){-1, 0, 0.05}), p)); // through the meniscus
    assert_int_equal(steps(50).goals_met, 0);
    land(0, 0, 0, 0);
    assert_int_equal(steps(50).goals_met, 1);
}

static void a_picture_has_to_be_upright(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nupright_deg = 20\nhold_s = 0.1\n");
    vec3 p = landmark("patella");
    pose straight = looking(vec3_add_scaled(p, 20, forward), p);
    for (int deg = 0; deg < 360; deg += 15) {
        pose turned = straight;
        quat roll = quat_from_axis_angle((vec3){0, 0, 1}, deg * RAD_PER_DEG);
        turned.rotation = quat_multiply(straight.rotation, roll);
        place(SCOPE, turned);
        attempt_init(&attempt);
        assert_int_equal(steps(20).goals_met, deg <= 15 || deg >= 345);
    }
}

static void a_scope_has_to_be_still(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nstill_mm = 2\nhold_s = 1\n");
    vec3 p = landmark("patella"), from = vec3_add_scaled(p, 20, forward);
    for (int i = 0; i < 40; i++) {
        place(SCOPE, looking(vec3_add_scaled(from, 0.15 * i, (vec3){1, 0, 0}), p));
        assert_int_equal(steps(5).goals_met, 0); // 3 mm in each second
    }
    assert_int_equal(steps(101).goals_met, 1);
}

static void a_landmark_is_touched_in_view(void **state) {
    (void)state;
    begin("[goal a]\ntouch = plateau_medial\nreach_mm = 3\nin_view = yes\nhold_s = 0.2\n");
    vec3 at = landmark("plateau_medial");
    pose seen = looking(vec3_add_scaled(at, 15, (vec3){0, 1, 0.5}), at);
    place(SCOPE, seen);
    touch(PROBE, "tibia", at, 1.1, 0); // not on it
    assert_int_equal(steps(50).goals_met, 0);
    touch(PROBE, "femur", at, 0, 0); // on something else
    assert_int_equal(steps(50).goals_met, 0);
    touch(PROBE, "tibia", vec3_add(at, (vec3){3.1, 0, 0}), 0, 0); // beside it
    assert_int_equal(steps(50).goals_met, 0);
    touch(PROBE, "tibia", vec3_add(at, (vec3){2.9, 0, 0}), 0.9, 0);
    place(SCOPE, looking(seen.translation, vec3_add(seen.translation, forward))); // not in view
    assert_int_equal(steps(50).goals_met, 0);
    place(SCOPE, seen);
    assert_int_equal(steps(21).goals_met, 1);
}

static void a_line_is_followed_from_end_to_end(void **state) {
    (void)state;
    begin("[goal a]\nfollow = horn_anterior_medial body_medial\nreach_mm = 2\n");
    const struct site_goal *g = site_goal(site, 0);
    assert_true(g->line_count > 5);
    touch(PROBE, "meniscus_medial", g->line[g->line_count - 1], 0, 0); // the end first
    assert_int_equal(steps(5).goals_met, 0);
    for (int i = 0; i < g->line_count - 3; i++) {
        touch(PROBE, "meniscus_medial", g->line[i], 0, 0);
        assert_int_equal(steps(1).goals_met, 0);
    }
    touch(PROBE, "meniscus_medial", g->line[g->line_count - 1], 1.5, 0); // in the air
    assert_int_equal(steps(5).goals_met, 0);
    touch(PROBE, "meniscus_medial", g->line[g->line_count - 1], 0, 0);
    assert_int_equal(steps(1).goals_met, 1);
}

static void bend(double flexion_deg, double valgus_deg, double drawer_mm) {
    const struct knee_case *knee = scene_case(scene);
    struct joint_angles angles = case_rest(knee, flexion_deg);
    angles.varus_deg -= valgus_deg;
    angles.drawer_mm += drawer_mm;
    output.T_mockup_virtual[BODY_TIBIA] = joint_to_pose(&knee->joint, &angles);
}

static void a_joint_is_held(void **state) {
    (void)state;
    begin("[goal a]\nvalgus_deg = 4\nflexion_deg = 10 30\nhold_s = 0.1\n"
          "[goal b]\ndrawer_mm = 5\nhold_s = 0.1\n");
    bend(20, 3.9, 0);
    assert_int_equal(steps(50).goals_met, 0);
    bend(31, 5, 0);
    assert_int_equal(steps(50).goals_met, 0);
    bend(29, 4.1, 6);
    assert_int_equal(steps(11).goals_met, 1); // b comes after it
    bend(90, 0, 4.9);
    assert_int_equal(steps(50).goals_met, 0);
    bend(90, 0, 5.1);
    assert_int_equal(steps(11).goals_met, 2);
}

static void a_resection_is_to_plan(void **state) {
    (void)state;
    begin("[goal a]\nresect = meniscus_medial\nunder_share = 0.1\nover_share = 0.2\nrim_mm = 3\n"
          "step_mm = 1\n"
          "hold_s = 0.1\n[error beyond]\nover_share = 0.3\n");
    assert_int_equal(steps(50).goals_met, 0); // nothing was cut
    land(10.1, 0, 5, 0);
    assert_int_equal(steps(50).goals_met, 0);
    land(5, 20.1, 5, 0);
    assert_int_equal(steps(50).goals_met, 0);
    land(5, 15, 2.9, 0);
    assert_int_equal(steps(50).goals_met, 0);
    land(5, 15, 5, 1.1);
    assert_int_equal(steps(50).goals_met, 0);
    assert_int_equal(attempt.errors, 0);
    land(5, 31, 5, 0);
    steps(50);
    assert_int_equal(attempt.errors, 1);
    assert_int_equal(attempt.occurrences[0].tool, -1);
    land(10, 20, 3, 1);
    assert_int_equal(steps(20).goals_met, 1);
    assert_int_equal(attempt_verdict(&attempt, &task), VERDICT_NOT_YET); // by the error
}

static void loose(int i, enum loose_state state) {
    output.loose_count = scene_case(scene)->loose_count;
    output.loose[i].state = state;
}

static void a_loose_body_is_taken_out(void **state) {
    (void)state;
    begin("[goal one]\ntake_out = piece_2\n[goal every]\ntake_out = all\n");
    task.in_order = false;
    loose(0, LOOSE_OUT);
    loose(1, LOOSE_HELD);
    assert_int_equal(steps(100).goals_met, 0); // one is out, and another one in the jaw
    loose(1, LOOSE_OUT);
    assert_int_equal(steps(40).goals_met, 0); // for less than hold_s
    assert_int_equal(steps(20).goals_met, 3);
    assert_true(attempt.end == ATTEMPT_DONE);
}

static void a_loose_body_that_is_dropped_is_an_error(void **state) {
    (void)state;
    begin("[goal a]\ntake_out = all\n[error lost]\ndropped = yes\n");
    loose(0, LOOSE_HELD);
    output.events = EVENT_GRASPED;
    assert_int_equal(steps(1).errors, 0);
    for (int i = 1; i <= 2; i++) {
        output.events = EVENT_DROPPED;
        assert_int_equal(steps(1).errors, 1);
        output.events = 0;
        steps(100);
        assert_int_equal(attempt.errors, i);
    }
    output.events = EVENT_TAKEN_OUT;
    assert_int_equal(steps(1).errors, 0);
}

static void goals_without_order_come_as_they_come(void **state) {
    (void)state;
    begin("[goal a]\nvalgus_deg = 4\nhold_s = 0.1\n[goal b]\ndrawer_mm = 5\nhold_s = 0.1\n");
    bend(20, 0, 6);
    assert_int_equal(steps(50).goals_met, 0);
    task.in_order = false;
    attempt_init(&attempt);
    assert_int_equal(steps(50).goals_met, 2);
    bend(20, 5, 0);
    assert_int_equal(steps(50).goals_met, 1);
    assert_int_equal(attempt.end, ATTEMPT_DONE);
}

// ---- errors -------------------------------------------------------------------------------------

#define FAR_GOAL "[goal never]\nsee = notch\nhold_s = 60\n"

static void an_error_counts_once_for_each_time(void **state) {
    (void)state;
    begin(FAR_GOAL "[error deep]\ntool = probe\ndeep_mm = 1\ngroups = femur tibia\nfor_s = 0.3\n");
    vec3 at = landmark("plateau_medial");
    touch(PROBE, "tibia", at, 0, 0.95); // not deep enough
    steps(100);
    touch(PROBE, "meniscus_medial", at, 0, 3); // deep in something else
    steps(100);
    touch(SHAVER, "tibia", at, 0, 3); // another tool
    steps(100);
    touch(PROBE, "tibia", at, 0, 1.05);
    steps(29); // not for long enough
    touch(PROBE, "tibia", at, 0, 0);
    steps(100);
    assert_int_equal(attempt.errors, 0);
    touch(PROBE, "tibia", at, 0, 1.05);
    steps(200);
    assert_int_equal(attempt.errors, 1);
    touch(PROBE, "tibia", at, 0, 0);
    steps(30); // the same one: it was gone for too short a time
    touch(PROBE, "tibia", at, 0, 1.05);
    steps(100);
    assert_int_equal(attempt.errors, 1);
    touch(PROBE, "tibia", at, 0, 0);
    steps(60);
    touch(PROBE, "tibia", at, 0, 1.05);
    steps(100);
    assert_int_equal(attempt.errors, 2);
    assert_int_equal(attempt.occurrence_count, 2);
    assert_int_equal(attempt.occurrences[0].tool, PROBE);
    assert_int_equal(attempt.occurrences[1].error, 0);
}

static void a_sentinel_error_ends_the_attempt(void **state) {
    (void)state;
    begin(FAR_GOAL "[error deep]\ndeep_mm = 2\nsentinel = yes\nfor_s = 0\n");
    touch(PROBE, "acl", landmark("acl_tibia"), 0, 2.5);
    assert_true(steps(1).ended);
    assert_int_equal(attempt.end, ATTEMPT_SENTINEL);
    assert_int_equal(attempt_verdict(&attempt, &task), VERDICT_NOT_YET);
    struct attempt before = attempt;
    steps(10);
    assert_memory_equal(&before, &attempt, sizeof attempt);
}

static void a_shaver_that_runs_on_cartilage_is_an_error(void **state) {
    (void)state;
    begin(FAR_GOAL "[error runs]\nrunning = yes\nnear_mm = 1\ngroups = femur tibia\n");
    vec3 at = landmark("plateau_medial");
    touch(SHAVER, "tibia", at, 0.9, 0);
    output.instruments[SHAVER].handle_validity = VALIDITY_OK;
    steps(50); // it stands
    output.instruments[SHAVER].handle.buttons = 1;
    touch(SHAVER, "tibia", at, 1.1, 0);
    steps(50); // it runs beside it
    assert_int_equal(attempt.errors, 0);
    touch(SHAVER, "tibia", at, 0.9, 0);
    steps(50);
    assert_int_equal(attempt.errors, 1);
}

static void a_tip_that_works_unseen_is_an_error(void **state) {
    (void)state;
    begin(FAR_GOAL "[error unseen]\nunseen = yes\nfor_s = 2\n");
    vec3 at = landmark("plateau_medial");
    pose seen = looking(vec3_add_scaled(at, 15, (vec3){0, 1, 0.5}), at);
    place(SCOPE, seen);
    touch(PROBE, "tibia", at, 5, 0);
    steps(300);
    assert_int_equal(attempt.errors, 0);
    place(SCOPE, looking(seen.translation, vec3_add(seen.translation, forward)));
    touch(PROBE, "tibia", at, 15.1, 0); // outside the knee
    steps(300);
    touch(PROBE, "tibia", at, 5, 0);
    steps(199);
    assert_int_equal(attempt.errors, 0);
    steps(3);
    assert_int_equal(attempt.errors, 1);
}

static void a_fast_tip_near_bone_is_an_error(void **state) {
    (void)state;
    begin(FAR_GOAL "[error fast]\nspeed_mm_s = 150\nnear_mm = 5\nfor_s = 0.1\n");
    vec3 at = landmark("plateau_medial");
    double speeds[] = {140, 170};
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 100; i++) {
            double way = speeds[k] * 0.01 * i;
            touch(PROBE, "tibia", vec3_add(at, (vec3){way, 0, 0}), 3, 0);
            steps(1);
            assert_true(k == 1 || attempt.errors == 0);
        }
    assert_int_equal(attempt.errors, 1);
}

// ---- noise, pauses, copies ----------------------------------------------------------------------

static vec3 trembling(vec3 p) {
    return vec3_add(p, random_in_box(&noise, 0.17)); // 0.1 mm root mean square
}

// At its very bounds, for a minute: no error comes twice, and no goal is lost again.
static void noise_makes_nothing_flicker(void **state) {
    (void)state;
    begin("[goal near]\ntouch = plateau_medial\nreach_mm = 3\nhold_s = 1\n" FAR_GOAL
          "[error deep]\ntool = probe\ndeep_mm = 1\nfor_s = 0.2\n"
          "[error unseen]\nunseen = yes\nfor_s = 1\n"
          "[error fast]\nspeed_mm_s = 50\nnear_mm = 5\nfor_s = 0.1\n");
    vec3 at = landmark("plateau_medial"), scope = vec3_add_scaled(at, 20, (vec3){0, 1, 0});
    double half = 30 * RAD_PER_DEG; // the field's edge runs through the tip
    vec3 aside = vec3_add(scope, (vec3){20 * tan(half), -20, 0});
    for (int i = 0; i < 5500; i++) {
        touch(PROBE, "tibia", trembling(vec3_add(at, (vec3){0, 0, 3})), 0.5, 0);
        output.instruments[PROBE].penetration_mm = 1 + random_between(&noise, -0.17, 0.17);
        place(SCOPE, looking(trembling(scope), trembling(aside)));
        steps(1);
    }
    assert_int_equal(attempt.goals_met, 1);
    for (int e = 0; e < task.error_count; e++)
        assert_true(attempt.found[e][PROBE].count <= 1);
}

// Half a millimetre inside or outside of a bound, noise changes nothing.
static void noise_beside_a_bound_is_nothing(void **state) {
    (void)state;
    for (int inside = 0; inside < 2; inside++) {
        begin("[goal near]\ntouch = plateau_medial\nreach_mm = 3\nhold_s = 1\n"
              "[error deep]\ntool = probe\ndeep_mm = 1\nfor_s = 0.2\n");
        vec3 at = landmark("plateau_medial");
        double away = inside ? 2.5 : 3.5, deep = inside ? 1.5 : 0.5;
        for (int i = 0; i < 200; i++) {
            touch(PROBE, "tibia", trembling(vec3_add(at, (vec3){away, 0, 0})), 0.5, 0);
            output.instruments[PROBE].penetration_mm = deep + random_between(&noise, -0.17, 0.17);
            steps(1);
        }
        assert_int_equal(attempt.goals_met, inside);
        assert_int_equal(attempt.errors, inside);
    }
}

static void a_pause_does_not_count(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nhold_s = 1\n");
    see_patella(25);
    steps(50);
    output.state = SESSION_PAUSED;
    assert_int_equal(steps(1000).goals_met, 0);
    assert_near(attempt_time_s(&attempt), 0.5, 0.011);
    output.state = SESSION_RUNNING;
    assert_int_equal(steps(52).goals_met, 1);
    assert_near(attempt_time_s(&attempt), 1.0, 0.03);
}

static void who_takes_too_long_does_not_pass(void **state) {
    (void)state;
    begin("[goal a]\nvalgus_deg = 4\nhold_s = 0.1\n");
    for (int late = 0; late < 2; late++) {
        attempt_init(&attempt);
        bend(20, 0, 0);
        steps(2985 + 10 * late);
        bend(20, 5, 0);
        steps(11);
        assert_int_equal(attempt.end, ATTEMPT_DONE);
        assert_int_equal(attempt_verdict(&attempt, &task), late ? VERDICT_NOT_YET : VERDICT_PASSED);
    }
}

static void the_limit_and_the_end_of_a_session_end_it(void **state) {
    (void)state;
    begin(FAR_GOAL);
    steps(6000);
    assert_int_equal(attempt.end, ATTEMPT_RUNS);
    steps(2);
    assert_int_equal(attempt.end, ATTEMPT_TIME_OUT);
    attempt_init(&attempt);
    steps(10);
    output.state = SESSION_CLOSED;
    steps(1);
    assert_int_equal(attempt.end, ATTEMPT_LEFT);
    assert_int_equal(attempt_verdict(&attempt, &task), VERDICT_NOT_YET);
}

// A copy that goes on has the bytes of what was copied, at any step.
static void a_copy_goes_on_with_the_same_bytes(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nhold_s = 0.3\n[goal b]\nvalgus_deg = 4\n" FAR_GOAL
          "[error deep]\ndeep_mm = 1\n");
    struct attempt copy;
    for (int i = 0; i < 400; i++) {
        see_patella(random_between(&noise, 20, 45));
        touch(PROBE, "tibia", trembling(landmark("plateau_medial")), 0.1,
              random_between(&noise, 0, 2));
        bend(20, random_between(&noise, 0, 6), 0);
        if (i % 50 == 0)
            copy = attempt;
        steps(1);
        attempt_step(&copy, site, &output);
        assert_memory_equal(&copy, &attempt, sizeof copy);
    }
    assert_true(attempt.goals_met > 0 && attempt.errors > 0);
}

static void what_a_case_lacks_is_named(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\n");
    const struct {
        const char *see, *tool, *says;
        const char *take_out;
    } rows[] = {{"patela", "probe", "task one: [goal a]: the case has no landmark patela", ""},
                {"", "grasper", "task one: [goal a]: no instrument is called grasper", ""},
                {"", "probe", "task one: [goal a]: the case has no loose body piece", "piece"}};
    struct view_optic optic = view_optic_usual();
    struct site *other;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        snprintf(task.goals[0].see, sizeof task.goals[0].see, "%s", rows[i].see);
        snprintf(task.goals[0].take_out, sizeof task.goals[0].take_out, "%s", rows[i].take_out);
        snprintf(task.goals[0].touch, sizeof task.goals[0].touch, "patella");
        snprintf(task.goals[0].tool, sizeof task.goals[0].tool, "%s", rows[i].tool);
        assert_int_equal(site_create(&task, scene, instruments_usual(), &optic, &other, &err),
                         RESULT_MISSING);
        assert_string_equal(err.text, rows[i].says);
    }
}

// ---- the case -----------------------------------------------------------------------------------

static int make_case(void **state) {
    (void)state;
    struct recipe recipe;
    struct knee_case *knee;
    folder_make(dir);
    assert_ok(recipe_load(CASES "/healthy", &recipe, &err));
    assert_ok(generate_knee(&recipe, &knee, &err));
    assert_ok(landmarks_find(knee, NULL, &err));
    for (int i = 0; i < 2; i++) {
        struct case_loose *one = &knee->loose[knee->loose_count++];
        *one = (struct case_loose){
            .body = BODY_TIBIA, .at = landmark_of(knee, "plateau_medial"), .radii_mm = {3, 3, 2}};
        snprintf(one->name, sizeof one->name, "piece_%d", i + 1);
    }
    assert_ok(scene_create(&knee, &scene, &err));
    return 0;
}

static int drop_case(void **state) {
    (void)state;
    site_destroy(&site);
    scene_destroy(&scene);
    folder_remove(dir);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_landmark_is_seen),
        cmocka_unit_test(what_a_bone_hides_is_not_seen),
        cmocka_unit_test(tissue_that_was_cut_hides_nothing),
        cmocka_unit_test(a_picture_has_to_be_upright),
        cmocka_unit_test(a_scope_has_to_be_still),
        cmocka_unit_test(a_landmark_is_touched_in_view),
        cmocka_unit_test(a_line_is_followed_from_end_to_end),
        cmocka_unit_test(a_joint_is_held),
        cmocka_unit_test(a_resection_is_to_plan),
        cmocka_unit_test(a_loose_body_is_taken_out),
        cmocka_unit_test(a_loose_body_that_is_dropped_is_an_error),
        cmocka_unit_test(goals_without_order_come_as_they_come),
        cmocka_unit_test(an_error_counts_once_for_each_time),
        cmocka_unit_test(a_sentinel_error_ends_the_attempt),
        cmocka_unit_test(a_shaver_that_runs_on_cartilage_is_an_error),
        cmocka_unit_test(a_tip_that_works_unseen_is_an_error),
        cmocka_unit_test(a_fast_tip_near_bone_is_an_error),
        cmocka_unit_test(noise_makes_nothing_flicker),
        cmocka_unit_test(noise_beside_a_bound_is_nothing),
        cmocka_unit_test(a_pause_does_not_count),
        cmocka_unit_test(who_takes_too_long_does_not_pass),
        cmocka_unit_test(the_limit_and_the_end_of_a_session_end_it),
        cmocka_unit_test(a_copy_goes_on_with_the_same_bytes),
        cmocka_unit_test(what_a_case_lacks_is_named),
    };
    return cmocka_run_group_tests_name("attempt", tests, make_case, drop_case);
}
