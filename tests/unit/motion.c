#include "motion/motion.h"

#include "generated.h"
#include "mesh/query.h"
#include "test.h"
#include "unit/motion_scripts.h"
#include "winding.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define REST_MM 20 // before the portal

static struct knee_case *knee; // healthy, right

static int make_knee(void **state) {
    (void)state;
    knee = plain_knee(SIDE_RIGHT, 1.7, 0);
    return 0;
}

static int destroy_knee(void **state) {
    (void)state;
    case_destroy(&knee);
    return 0;
}

// ---- scripts and what they give -----------------------------------------------------------------

static void load_palpation(struct motion_script *out_script) {
    struct error err;
    const char *path = ARTHRON_SOURCE "/cases/motions/palpation.ini";
    if (motion_script_load(path, out_script, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

static void plan_palpation(double tremor_mm, struct motion *out_motion) {
    struct motion_script script;
    load_palpation(&script);
    script.tremor_mm = tremor_mm;
    plan_script(knee, &script, out_motion);
}

// ---- the file's own numbers ---------------------------------------------------------------------

// A row of the file with the columns of a probe and a punch.
struct csv_row {
    double t, joint[6], probe[9], punch[9];
    char touch[64];
};

static void read_row(char *line, struct csv_row *out_row) {
    double *numbers = &out_row->t;
    char *rest, *word = strtok_r(line, ",", &rest);
    for (int i = 0; i < 25; i++, word = strtok_r(NULL, ",", &rest)) {
        assert_non_null(word);
        numbers[i] = strtod(word, NULL);
    }
    assert_non_null(word);
    snprintf(out_row->touch, sizeof out_row->touch, "%s", word);
    assert_null(strtok_r(NULL, ",", &rest));
}

static struct joint_angles row_joint(const struct csv_row *row) {
    const double *j = row->joint;
    return (struct joint_angles){j[0], j[1], j[2], j[3], j[4], j[5]};
}

static void a_probe_that_touches_is_on_the_surface_in_the_pose_of_the_moment(void **state) {
    (void)state;
    struct motion motion;
    plan_palpation(0, &motion);
    char *text = written(&motion), *rest, *line = strtok_r(text, "\n", &rest);
    assert_non_null(strstr(line, "t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,"
                                 "distraction_mm,probe_tx_mm,probe_ty_mm,probe_tz_mm,probe_qw,"));
    struct query *queries[CASE_GROUPS_MAX];
    for (int i = 0; i < knee->group_count; i++)
        assert_int_equal(query_create(&knee->groups[i].mesh, &queries[i], NULL), RESULT_OK);
    int touches = 0;
    while ((line = strtok_r(NULL, "\n", &rest))) {
        struct csv_row row;
        read_row(line, &row);
        if (strcmp(row.touch, "-") == 0)
            continue;
        touches++;
        struct case_group *group = case_group(knee, row.touch);
        assert_non_null(group);
        struct joint_angles joint = row_joint(&row);
        vec3 tip = {row.probe[0], row.probe[1], row.probe[2]};
        vec3 p = pose_apply_inverse(body_pose(knee, &joint, group->body), tip);
        struct closest closest;
        assert_true(query_closest(queries[group - knee->groups], p, 1, MESH_NONE, &closest));
        assert_true(closest.distance < 1e-4);
    }
    assert_true(touches > 300);
    for (int i = 0; i < knee->group_count; i++)
        query_destroy(&queries[i]);
    free(text);
    motion_fini(&motion);
}

// ---- hands --------------------------------------------------------------------------------------

static void a_shaft_always_passes_through_its_portal_and_never_flips(void **state) {
    (void)state;
    for (int tremor = 0; tremor < 2; tremor++) {
        struct motion motion;
        plan_palpation(0.3 * tremor, &motion);
        for (size_t r = 0; r < motion.row_count; r++)
            for (int i = 0; i < motion.tool_count; i++) {
                pose p = motion.rows[r].tools[i].T_mockup_tip;
                quat q = p.rotation;
                assert_near(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z, 1, 1e-9);
                vec3 z = quat_rotate(q, (vec3){0, 0, 1});
                vec3 inward = vec3_sub(p.translation, motion.tools[i].portal);
                assert_true(vec3_length(vec3_cross(z, inward)) < 1e-6);
                assert_true(vec3_dot(z, inward) >= -REST_MM - 1e-9);
                if (r == 0)
                    continue;
                quat before = motion.rows[r - 1].tools[i].T_mockup_tip.rotation;
                assert_true(q.w * before.w + q.x * before.x + q.y * before.y + q.z * before.z >
                            0.99);
            }
        motion_fini(&motion);
    }
}

static void nothing_is_faster_than_the_script_says(void **state) {
    (void)state;
    struct motion_script script;
    load_palpation(&script);
    script.tremor_mm = 0;
    struct motion motion;
    plan_script(knee, &script, &motion);
    double fastest = 0;
    for (size_t r = 1; r < motion.row_count; r++) {
        const struct motion_row *a = &motion.rows[r - 1], *b = &motion.rows[r];
        assert_near(b->t_seconds - a->t_seconds, 0.01, 1e-9);
        double joint = hypot(b->joint.flexion_deg - a->joint.flexion_deg,
                             b->joint.varus_deg - a->joint.varus_deg);
        assert_true(joint * script.rate_hz < 1.001 * script.joint_speed_deg_s);
        for (int i = 0; i < motion.tool_count; i++)
            fastest = fmax(fastest, vec3_distance(a->tools[i].T_mockup_tip.translation,
                                                  b->tools[i].T_mockup_tip.translation) *
                                        script.rate_hz);
    }
    assert_true(fastest > 0.9 * script.speed_mm_s && fastest < 1.05 * script.speed_mm_s);
    motion_fini(&motion);
}

static void no_tip_is_inside_a_bone(void **state) {
    (void)state;
    struct motion motion;
    plan_palpation(0, &motion);
    struct query *queries[BODY_COUNT];
    for (int b = 0; b < BODY_COUNT; b++)
        assert_int_equal(
            query_create(&case_group(knee, body_name((enum body)b))->mesh, &queries[b], NULL),
            RESULT_OK);
    for (size_t r = 0; r < motion.row_count; r += 3)
        for (int i = 0; i < motion.tool_count; i++)
            for (int b = 0; b < BODY_COUNT; b++) {
                pose T = body_pose(knee, &motion.rows[r].joint, (enum body)b);
                vec3 tip = motion.rows[r].tools[i].T_mockup_tip.translation;
                vec3 p = pose_apply_inverse(T, tip);
                struct closest closest;
                assert_true(query_closest(queries[b], p, INFINITY, MESH_NONE, &closest));
                if (closest.distance > 0.05 && closest.distance < 15)
                    assert_false(is_inside(&case_group(knee, body_name((enum body)b))->mesh, p));
            }
    for (int b = 0; b < BODY_COUNT; b++)
        query_destroy(&queries[b]);
    motion_fini(&motion);
}

static void tools_that_are_out_rest_before_their_portals(void **state) {
    (void)state;
    struct motion motion;
    plan_palpation(0.3, &motion);
    const struct motion_row *first = &motion.rows[0], *last = &motion.rows[motion.row_count - 1];
    for (int i = 0; i < motion.tool_count; i++) {
        pose begin = first->tools[i].T_mockup_tip, end = last->tools[i].T_mockup_tip;
        vec3 in = pose_apply(begin, (vec3){0, 0, REST_MM}); // along its shaft
        assert_vec3_near(in, motion.tools[i].portal, 1e-9);
        assert_vec3_near(end.translation, begin.translation, 1e-9);
    }
    motion_fini(&motion);
}

static void a_tremor_has_the_amplitude_and_the_band_asked_for(void **state) {
    (void)state;
    struct motion still, shaking;
    plan_palpation(0, &still);
    plan_palpation(0.2, &shaking);
    assert_int_equal(still.row_count, shaking.row_count);
    int probe = tool_index(&still, CHANNEL_PROBE), crossings = 0, count = 0;
    double sum = 0, before = 0;
    for (size_t r = 0; r < still.row_count; r++) {
        vec3 tip = still.rows[r].tools[probe].T_mockup_tip.translation;
        if (vec3_distance(tip, still.tools[probe].portal) < 16)
            continue;
        vec3 shake = vec3_sub(shaking.rows[r].tools[probe].T_mockup_tip.translation, tip);
        sum += vec3_dot(shake, shake);
        crossings += before * shake.x < 0;
        before = shake.x;
        count++;
    }
    assert_true(count > 1000);
    assert_near(sqrt(sum / count), 0.2, 0.03);
    double frequency = crossings / 2.0 / (count / 100.0);
    assert_true(frequency > 8 && frequency < 12);
    motion_fini(&still);
    motion_fini(&shaking);
}

static void the_same_seed_gives_the_same_bytes_and_another_one_others(void **state) {
    (void)state;
    struct motion_script script;
    load_palpation(&script);
    char *texts[3];
    for (int i = 0; i < 3; i++) {
        script.seed = i == 2 ? 2 : 1;
        struct motion motion;
        plan_script(knee, &script, &motion);
        texts[i] = written(&motion);
        motion_fini(&motion);
    }
    assert_string_equal(texts[0], texts[1]);
    assert_string_not_equal(texts[0], texts[2]);
    for (int i = 0; i < 3; i++)
        free(texts[i]);
}

// ---- scripts ------------------------------------------------------------------------------------

static void the_palpation_script_shows_all_that_a_demo_needs(void **state) {
    (void)state;
    struct motion motion;
    plan_palpation(0.1, &motion);
    int punch = tool_index(&motion, CHANNEL_PUNCH);
    double most_flexion = 0, most_valgus = 0, widest = 0;
    static const char *const names[] = {"tibia", "femur", "meniscus_medial", "meniscus_lateral"};
    int touched[4] = {0};
    for (size_t r = 0; r < motion.row_count; r++) {
        const struct motion_row *row = &motion.rows[r];
        most_flexion = fmax(most_flexion, row->joint.flexion_deg);
        most_valgus = fmax(most_valgus, -row->joint.varus_deg);
        widest = fmax(widest, row->tools[punch].opening);
        for (int i = 0; i < 4; i++)
            touched[i] += row->touch && strcmp(row->touch->name, names[i]) == 0;
    }
    double seconds = motion.rows[motion.row_count - 1].t_seconds;
    assert_true(seconds > 40 && seconds < 62);
    assert_true(most_flexion >= 60 && most_flexion <= 90);
    assert_true(most_valgus > 5);
    assert_near(widest, 1, 1e-9);
    for (int i = 0; i < 4; i++)
        assert_true(touched[i] > 30);
    motion_fini(&motion);
}

static void a_left_knee_plays_the_same_script_mirrored(void **state) {
    (void)state;
    struct knee_case *left = plain_knee(SIDE_LEFT, 1.7, 0);
    struct motion_script script;
    load_palpation(&script);
    script.tremor_mm = 0;
    struct motion on_left, on_right;
    plan_script(left, &script, &on_left);
    plan_script(knee, &script, &on_right);
    assert_int_equal(on_left.row_count, on_right.row_count);
    for (size_t r = 0; r < on_left.row_count; r += 10) {
        vec3 p = on_left.rows[r].tools[0].T_mockup_tip.translation;
        vec3 q = on_right.rows[r].tools[0].T_mockup_tip.translation;
        assert_vec3_near(p, ((vec3){-q.x, q.y, q.z}), 1e-3);
        assert_near(on_left.rows[r].joint.varus_deg, on_right.rows[r].joint.varus_deg, 1e-6);
        assert_near(on_left.rows[r].joint.shift_mm, on_right.rows[r].joint.shift_mm, 1e-3);
    }
    motion_fini(&on_left);
    motion_fini(&on_right);
    case_destroy(&left);
}

static void a_bite_opens_reaches_the_meniscus_and_closes(void **state) {
    (void)state;
    struct motion motion;
    plan_text(knee,
              "[steps]\nflex = 20\nvalgus = 8\napproach = punch anterolateral\n"
              "bite = punch meniscus_medial\n",
              &motion);
    struct query *query;
    assert_int_equal(query_create(&case_group(knee, "meniscus_medial")->mesh, &query, NULL),
                     RESULT_OK);
    double nearest = INFINITY, opening_there = 0;
    for (size_t r = 0; r < motion.row_count; r++) {
        const struct motion_row *row = &motion.rows[r];
        vec3 p = pose_apply_inverse(body_pose(knee, &row->joint, BODY_TIBIA),
                                    row->tools[0].T_mockup_tip.translation);
        struct closest closest;
        assert_true(query_closest(query, p, INFINITY, MESH_NONE, &closest));
        if (closest.distance < nearest - 1e-9) {
            nearest = closest.distance;
            opening_there = row->tools[0].opening;
        }
    }
    assert_true(nearest < 1e-6);
    assert_near(opening_there, 1, 1e-9);
    assert_near(motion.rows[motion.row_count - 1].tools[0].opening, 0, 1e-9);
    query_destroy(&query);
    motion_fini(&motion);
}

static void a_script_that_cannot_be_played_names_its_step(void **state) {
    (void)state;
    static const struct {
        const char *steps, *said;
    } rows[] = {
        {"palpate = tibia 0 0 0 1 1 1\n", "step 1 (palpate): probe is not inside"},
        {"flex = 10\nwithdraw = punch\n", "step 2 (withdraw): punch is not inside"},
        {"approach = probe posterior\n", "step 1 (approach): the case has no portal posterior"},
        {"approach = probe anteromedial\napproach = probe anterolateral\n",
         "step 2 (approach): probe goes through the portal anteromedial already"},
        {"approach = probe anteromedial\npalpate = spleen 0 0 0 1 1 1\n",
         "step 2 (palpate): the case has no group spleen"},
        {"flex = 30\napproach = probe anteromedial\npalpate = tibia -20 -20 -22 -20 -15 -22\n",
         "step 3 (palpate): the shaft through the portal anteromedial would run"},
        {"approach = punch anteromedial\nresect = punch meniscus_medial 3\n",
         "step 2 (resect): meniscus_medial has no planned resection"},
        {"approach = shaver anteromedial\ntrace = shaver spleen\n",
         "step 2 (trace): the case has no group spleen"},
        {"resect = punch meniscus_medial 3\n", "step 1 (resect): punch is not inside"},
        {"look = tibia\n", "step 1 (look): scope is not inside"},
        {"approach = scope anterolateral\nlook = spleen\n",
         "step 2 (look): the case has no group spleen"},
        {"approach = probe anteromedial\npalpate = femur -21.5 0 -10 21.5 0 -10\n",
         "step 2 (palpate): the line leaves the surface"},
        {"approach = probe anteromedial\npalpate = tibia notch spleen 0 1 0\n",
         "step 2 (palpate): the case has no landmark spleen"},
        {"approach = punch anteromedial\nbite = punch meniscus_medial spleen\n",
         "step 2 (bite): the case has no landmark spleen"},
        {"flex = 30\napproach = probe anteromedial\npalpate = tibia pcl_tibia pcl_tibia 3 0 0\n",
         "step 3 (palpate): pcl_tibia cannot be reached: the shaft through the portal anteromedial "
         "would run"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[512];
        snprintf(text, sizeof text, "[steps]\n%s", rows[i].steps);
        struct motion_script script;
        struct motion motion;
        struct error err = {""};
        assert_int_equal(load_text(text, &script, &err), RESULT_OK);
        if (motion_plan(knee, &script, &motion, &err) == RESULT_OK ||
            !strstr(err.text, rows[i].said))
            fail_msg("%s gave \"%s\", not \"%s\"", text, err.text, rows[i].said);
        assert_null(motion.rows);
    }
}

static void a_wrong_script_is_refused_with_line_section_and_key(void **state) {
    (void)state;
    static const struct {
        const char *text, *said;
    } rows[] = {
        {"[steps]\nswim = 3\n", ":2: [steps] swim: unknown key"},
        {"[walk]\nflex = 3\n", ":2: [walk]: unknown section"},
        {"[motion]\ncolour = red\n", "[motion] colour: unknown key"},
        {"[motion]\nrate_hz = 5\n", "[motion] rate_hz = 5: must be a number from 10 to 1000"},
        {"[motion]\nspeed_mm_s = 0\n", "from 1 to 200"},
        {"[motion]\njoint_speed_deg_s = 91\n", "from 1 to 90"},
        {"[motion]\ntremor_mm = -1\n", "from 0 to 2"},
        {"[motion]\ntremor_mm = nan\n", "from 0 to 2"},
        {"[motion]\nseed = -1\n", "[motion] seed = -1: must be a number from 0 to 4294967295"},
        {"[motion]\nrate_hz = 50\nrate_hz = 50\n", ":3: [motion] rate_hz: given twice"},
        {"[motion]\nunreachable = hop\n", "[motion] unreachable = hop: must be refuse or skip"},
        {"[motion]\nunreachable = skip\nunreachable = skip\n", ":3: [motion] unreachable: given"},
        {"[steps]\nflex = 141\n", "[steps] flex = 141: must be DEGREES from 0 to 140"},
        {"[steps]\nvalgus = -16\n", "must be DEGREES from -15 to 15"},
        {"[steps]\ndrawer = 10.5\n", "must be MM from -10 to 10"},
        {"[steps]\ndrawer = 1 2\n", "must be MM from -10 to 10"},
        {"[steps]\napproach = probe\n", "must be INSTRUMENT PORTAL"},
        {"[steps]\napproach = femur anteromedial\n", "must be INSTRUMENT PORTAL"},
        {"[steps]\npalpate = tibia 1 2 3\n", "must be GROUP PLACE PLACE, a place being X Y Z or "},
        {"[steps]\npalpate = tibia 1 2 3 4 5 6 7 8 9\n", "must be GROUP PLACE PLACE"},
        {"[steps]\npalpate = tibia 1 2 3 4 5 6 7 8\n", "must be GROUP PLACE PLACE"},
        {"[steps]\npalpate = tibia notch\n", "must be GROUP PLACE PLACE"},
        {"[steps]\npalpate = tibia notch 1 2 notch\n", "must be GROUP PLACE PLACE"},
        {"[steps]\npalpate = tibia no/tch notch\n", "must be GROUP PLACE PLACE"},
        {"[steps]\nbite = punch meniscus_medial 1 2\n", "must be INSTRUMENT GROUP [PLACE]"},
        {"[steps]\nbite = punch\n", "must be INSTRUMENT GROUP [PLACE]"},
        {"[steps]\nresect = shaver meniscus_medial 3\n", "must be punch GROUP BITES"},
        {"[steps]\nresect = punch meniscus_medial 0\n", "must be punch GROUP BITES from 1 to 100"},
        {"[steps]\ntrace = punch meniscus_medial\n", "must be probe or shaver, and GROUP"},
        {"[steps]\nlook = tibia 1 2\n", "must be GROUP [PLACE]"},
        {"[steps]\ntouch = probe tibia\n", "must be INSTRUMENT GROUP PLACE"},
        {"[steps]\nwait = 61\n", "must be SECONDS from 0 to 60"},
        {"[steps]\nwithdraw = spoon\n", "must be INSTRUMENT"},
        {"[motion]\nseed = 1\n", "[steps] has no step"},
        {"", "[steps] has no step"},
        {"[steps]\nflex\n", ":2: neither a section nor a key"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct motion_script script;
        struct error err = {""};
        if (load_text(rows[i].text, &script, &err) == RESULT_OK || !strstr(err.text, rows[i].said))
            fail_msg("\"%s\" gave \"%s\", not \"%s\"", rows[i].text, err.text, rows[i].said);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_probe_that_touches_is_on_the_surface_in_the_pose_of_the_moment),
        cmocka_unit_test(a_shaft_always_passes_through_its_portal_and_never_flips),
        cmocka_unit_test(nothing_is_faster_than_the_script_says),
        cmocka_unit_test(no_tip_is_inside_a_bone),
        cmocka_unit_test(tools_that_are_out_rest_before_their_portals),
        cmocka_unit_test(a_tremor_has_the_amplitude_and_the_band_asked_for),
        cmocka_unit_test(the_same_seed_gives_the_same_bytes_and_another_one_others),
        cmocka_unit_test(the_palpation_script_shows_all_that_a_demo_needs),
        cmocka_unit_test(a_left_knee_plays_the_same_script_mirrored),
        cmocka_unit_test(a_bite_opens_reaches_the_meniscus_and_closes),
        cmocka_unit_test(a_script_that_cannot_be_played_names_its_step),
        cmocka_unit_test(a_wrong_script_is_refused_with_line_section_and_key),
    };
    return cmocka_run_group_tests(tests, make_knee, destroy_knee);
}
