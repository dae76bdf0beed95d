// Knees that cannot be are unfit, and the knee that they are made of is not.
#include "check/bounds.h"
#include "finding.h"
#include "folder.h"
#include "generate/pathology.h"
#include "generated.h"
#include "landmarks/landmarks.h"

#include <string.h>

static struct case_check *check_knee(struct knee_case *knee) {
    struct check_settings settings = check_settings_default(true);
    settings.spacing_mm = 4;
    struct case_check *check;
    struct scene *scene;
    struct error err;
    assert_ok(check_case(&knee, &settings, &check, &scene, &err));
    scene_destroy(&scene);
    return check;
}

static void move_group(struct knee_case *knee, const char *name, vec3 way) {
    struct mesh *mesh = &case_group(knee, name)->mesh;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        mesh_set_vertex(mesh, v, vec3_add(mesh_vertex(mesh, v), way));
}

static void move_body(struct knee_case *knee, enum body body, vec3 way) {
    for (int i = 0; i < knee->group_count; i++)
        if (knee->groups[i].body == body)
            move_group(knee, knee->groups[i].name, way);
}

static char folder[FOLDER_MAX];

// To load a knee takes far less time than to make one.
static int make_knee(void **state) {
    (void)state;
    struct knee_case *knee = plain_knee(SIDE_RIGHT, 3, 0);
    struct error err;
    folder_make(folder);
    assert_ok(landmarks_find(knee, NULL, &err));
    assert_ok(case_save(knee, folder, &err));
    case_destroy(&knee);
    return 0;
}

static int remove_knee(void **state) {
    (void)state;
    folder_remove(folder);
    return 0;
}

static struct knee_case *made_knee(void) {
    struct knee_case *knee;
    struct error err;
    assert_ok(case_load(folder, NULL, &knee, &err));
    return knee;
}

static void expect_unfit(struct knee_case *knee, const char *where, const char *text) {
    struct case_check *check = check_knee(knee);
    if (check->grade != GRADE_UNFIT || !find_finding(check, FINDING_FAULT, where, text)) {
        for (int i = 0; i < check->findings.count; i++)
            print_message("%d %s: %s\n", check->findings.findings[i].level,
                          check->findings.findings[i].where, check->findings.findings[i].text);
        fail_msg("no fault of %s: %s", where, text);
    }
    check_destroy(&check);
}

static void a_knee_as_it_should_be_has_no_fault_and_its_gaps_are_told(void **state) {
    (void)state;
    struct case_check *check = check_knee(made_knee());
    struct knee_case *made = made_knee();
    assert_true(made->landmark_count == 21);
    for (int i = 0; i < check->findings.count; i++)
        if (check->findings.findings[i].level == FINDING_FAULT ||
            case_landmark(made, check->findings.findings[i].where))
            fail_msg("%s: %s", check->findings.findings[i].where, check->findings.findings[i].text);
    case_destroy(&made);
    const struct contact *contact = &check->contacts.all[0]; // femur and tibia
    assert_string_equal(check->groups[contact->a], "femur");
    assert_string_equal(check->groups[contact->b], "tibia");
    for (int i = 0; i < CONTACT_FLEXIONS; i++) {
        assert_near(contact->states[i].gap.mm, 0.4, 0.2); // as the shapes are made
        assert_near(contact->states[i].overlap.depth_mm, 0, 0);
    }
    check_destroy(&check);
}

static void a_tibia_in_the_femur_or_far_below_is_unfit(void **state) {
    (void)state;
    const double ups[] = {3.5, 20.5, 60.5}; // over a gap of 0.4 mm
    for (int i = 0; i < 3; i++) {
        struct knee_case *knee = made_knee();
        move_body(knee, BODY_TIBIA, (vec3){0, 0, ups[i]});
        expect_unfit(knee, "femur", "overlaps with tibia");
    }
    struct knee_case *knee = made_knee();
    move_body(knee, BODY_TIBIA, (vec3){0, 0, -300});
    expect_unfit(knee, "femur", "does not touch tibia: at");
}

static void the_depth_of_a_tibia_in_the_femur_is_told_at_each_flexion(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    move_group(knee, "tibia", (vec3){0, 0, 1.4});
    struct case_check *check = check_knee(knee);
    const struct check_finding *found =
        find_finding(check, FINDING_WARNING, "femur", "overlaps with tibia");
    assert_non_null(found);
    assert_non_null(strstr(found->text, "degrees"));
    for (int i = 0; i < CONTACT_FLEXIONS; i++)
        assert_near(check->contacts.all[0].states[i].overlap.depth_mm, 1, 0.25);
    check_destroy(&check);
}

static void menisci_far_too_high_are_unfit(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    move_group(knee, "meniscus_medial", (vec3){0, 0, 100});
    move_group(knee, "meniscus_lateral", (vec3){0, 0, 100});
    expect_unfit(knee, "tibia", "does not touch meniscus_medial");
}

static void a_patella_far_in_front_or_in_the_femur_is_unfit(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    move_body(knee, BODY_PATELLA, (vec3){0, 200, 0});
    expect_unfit(knee, "femur", "does not touch patella");
    knee = made_knee();
    move_body(knee, BODY_PATELLA, (vec3){0, -8, 0});
    expect_unfit(knee, "femur", "overlaps with patella");
}

// With the axis 5 mm too low, all is well in extension.
static void bones_that_collide_in_deep_flexion_alone_are_unfit(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    knee->joint.T_femur_joint.translation.z -= 5;
    knee->joint.T_tibia_joint.translation.z -= 5;
    struct case_check *check = check_knee(knee);
    const struct check_finding *found =
        find_finding(check, FINDING_FAULT, "femur", "overlaps with tibia");
    assert_non_null(found);
    assert_non_null(strstr(found->text, "at 120 degrees"));
    assert_near(check->contacts.all[0].states[0].overlap.depth_mm, 0, 0);
    check_destroy(&check);
}

static void turn_groups(struct knee_case *knee, quat turn) {
    for (int i = 0; i < knee->group_count; i++) {
        struct mesh *mesh = &knee->groups[i].mesh;
        for (uint32_t v = 0; v < mesh->vertex_count; v++)
            mesh_set_vertex(mesh, v, quat_rotate(turn, mesh_vertex(mesh, v)));
    }
}

static void a_knee_laid_on_its_side_or_called_by_the_other_side_is_unfit(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    turn_groups(knee, quat_from_axis_angle((vec3){0, 1, 0}, 90 * RAD_PER_DEG));
    expect_unfit(knee, "femur", "does not lie above the tibia");
    knee = made_knee();
    turn_groups(knee, quat_from_axis_angle((vec3){0, 0, 1}, 180 * RAD_PER_DEG));
    expect_unfit(knee, "patella", "does not lie before the femur");
    knee = made_knee();
    knee->joint.side = SIDE_LEFT;
    expect_unfit(knee, "meniscus_medial", "lies lateral of meniscus_lateral");
}

static void a_portal_inside_the_femur_is_unfit(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    knee->portals[0].position = (vec3){20, 0, -10};
    expect_unfit(knee, "anterolateral", "mm inside femur");
}

// From the side the condyle is in the way; from above the trochlea leaves little room.
static void a_portal_without_a_way_to_the_notch_is_unfit(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    knee->portals[0].position = (vec3){60, -5, -18};
    knee->portals[0].direction = (vec3){-1, 0, 0};
    strcpy(knee->portals[0].name, "al"); // any name but those from behind and from above
    expect_unfit(knee, "al", "no straight way from the portal to the notch");
    knee = made_knee();
    knee->portals[1].position = (vec3){-30, 45, 0};
    struct case_check *check = check_knee(knee);
    const struct check_finding *found =
        find_finding(check, FINDING_WARNING, "anteromedial", "an instrument needs 2 mm");
    assert_non_null(found);
    assert_non_null(strstr(found->text, "arthron-case landmarks"));
    check_destroy(&check);
}

static void a_portal_whose_way_cannot_be_examined_is_told(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    knee->landmark_count = 0;
    move_group(knee, "tibia", (vec3){50, 0, 0}); // no plateau below the medial condyle
    strcpy(knee->portals[1].name, "superomedial");
    struct case_check *check = check_knee(knee);
    assert_non_null(find_finding(check, FINDING_NOTE, "anterolateral", "is not examined"));
    assert_null(find_finding(check, FINDING_NOTE, "superomedial", "is not examined"));
    check_destroy(&check);
}

static struct case_landmark *landmark(struct knee_case *knee, const char *name) {
    const struct case_landmark *found = case_landmark(knee, name);
    assert_non_null(found);
    return &knee->landmarks[found - knee->landmarks];
}

static void landmarks_that_are_not_where_their_names_say_make_a_case_unfit(void **state) {
    (void)state;
    static const struct {
        const char *name, *exchanged; // NULL: moved
        vec3 way;
        const char *text;
    } rows[] = {
        {"notch", NULL, {0, 0, -60}, "mm off the femur"},
        {"body_lateral", NULL, {0, 0, 20}, "mm off the lateral meniscus"},
        {"condyle_medial", "condyle_lateral", {0}, "to the lateral side"},
        {"plateau_lateral", "plateau_medial", {0}, "to the medial side"},
        {"horn_anterior_medial", "horn_posterior_medial", {0}, "lies behind body_medial"},
        {"root_anterior_lateral", "root_posterior_lateral", {0}, "are the two exchanged?"},
        {"trochlea", "patella", {0}, "is on the patella, not on the femur"},
    };
    struct knee_case *knee = made_knee();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct case_landmark *a = landmark(knee, rows[i].name), kept = *a;
        a->at = vec3_add(a->at, rows[i].way);
        if (rows[i].exchanged) {
            struct case_landmark *b = landmark(knee, rows[i].exchanged);
            a->at = b->at;
            a->body = b->body;
            b->at = kept.at;
            b->body = kept.body;
        }
    }
    struct case_check *check = check_knee(knee);
    assert_int_equal(check->grade, GRADE_UNFIT);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        if (!find_finding(check, FINDING_FAULT, rows[i].name, rows[i].text))
            fail_msg("no fault of %s: %s", rows[i].name, rows[i].text);
    check_destroy(&check);
}

static void a_landmark_somewhat_off_its_surface_is_told(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    landmark(knee, "condyle_medial")->at.z -= 7;
    struct case_check *check = check_knee(knee);
    assert_int_equal(check->grade, GRADE_WARNINGS);
    assert_non_null(find_finding(check, FINDING_WARNING, "condyle_medial", "mm off the femur"));
    check_destroy(&check);
}

static void scale_group(struct knee_case *knee, const char *name, double factor) {
    struct mesh *mesh = &case_group(knee, name)->mesh;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        mesh_set_vertex(mesh, v, vec3_scale(factor, mesh_vertex(mesh, v)));
}

// Several on one knee, where one does not change the other.
static void sizes_and_places_that_no_knee_has_are_unfit(void **state) {
    (void)state;
    static const struct {
        int knee;
        const char *group;
        double factor;
        vec3 way;
        const char *text;
    } rows[] = {
        {0, "femur", 1.6, {0, 0, 0}, "the condyles' width is 12"},
        {0, "meniscus_medial", 1e-3, {0, 0, 0}, "the volume is 2.4"}, // in metres
        {0, "patella", 0.3, {0, 20, 0}, "the height is 1"},
        {1, "tibia", 1.75, {0, 0, 0}, "the plateau's width is 1"},
        {1, "meniscus_lateral", 2, {0, 0, 0}, "the volume is 19"},
        {1, "patella", 2.2, {0, 0, 0}, "the width is 9"},
        {2, "tibia", 0.5, {0, 0, 0}, "the plateau's width is 40"},
        {2, "patella", 1, {45, 0, 0}, "the way from the middle of the condyles"},
        {3, "patella", 1, {0, 0, 100}, "the way from the plateau up to the patella is 3"},
        {4, "patella", 1, {0, 0, -70}, "the way from the plateau up to the patella is -1"},
    };
    size_t count = sizeof rows / sizeof rows[0];
    for (int number = 0; number <= rows[count - 1].knee; number++) {
        struct knee_case *knee = made_knee();
        for (size_t i = 0; i < count; i++)
            if (rows[i].knee == number) {
                scale_group(knee, rows[i].group, rows[i].factor);
                move_group(knee, rows[i].group, rows[i].way);
            }
        struct case_check *check = check_knee(knee);
        assert_int_equal(check->grade, GRADE_UNFIT);
        for (size_t i = 0; i < count; i++)
            if (rows[i].knee == number &&
                !find_finding(check, FINDING_FAULT, rows[i].group, rows[i].text))
                fail_msg("no fault of %s: %s", rows[i].group, rows[i].text);
        check_destroy(&check);
    }
}

static pose seen_from(pose T, pose p) {
    return pose_compose(T, pose_compose(p, pose_inverse(T)));
}

// All of the case in another frame.
static void shift(struct knee_case *knee, vec3 way) {
    pose T = {{1, 0, 0, 0}, way};
    for (int i = 0; i < knee->group_count; i++)
        move_group(knee, knee->groups[i].name, way);
    knee->joint.T_femur_joint = pose_compose(T, knee->joint.T_femur_joint);
    knee->joint.T_tibia_joint = pose_compose(T, knee->joint.T_tibia_joint);
    for (int i = 0; i < knee->portal_count; i++)
        knee->portals[i].position = vec3_add(knee->portals[i].position, way);
    for (int i = 0; i < knee->landmark_count; i++)
        knee->landmarks[i].at = vec3_add(knee->landmarks[i].at, way);
    for (int i = 0; i < knee->patella_key_count; i++) {
        pose *key = &knee->patella_keys[i].T_femur_patella;
        *key = seen_from(T, *key);
    }
    for (int i = 0; i < knee->rest_count; i++)
        knee->rest[i] = seen_from(T, knee->rest[i]);
    for (int i = 0; i < knee->key_count; i++) {
        knee->keys[i].physical = seen_from(T, knee->keys[i].physical);
        knee->keys[i].target = seen_from(T, knee->keys[i].target);
    }
}

static void a_knee_far_from_its_origin_is_told_and_farther_away_unfit(void **state) {
    (void)state;
    const double ways[] = {700, 2300};
    for (int i = 0; i < 2; i++) {
        struct knee_case *knee = made_knee();
        shift(knee, (vec3){ways[i], 0, 0});
        struct case_check *check = check_knee(knee);
        assert_int_equal(check->grade, i ? GRADE_UNFIT : GRADE_WARNINGS);
        assert_non_null(find_finding(check, i ? FINDING_FAULT : FINDING_WARNING, "joint",
                                     "the way from the origin to the joint is"));
        check_destroy(&check);
    }
}

// A knee of which there is much to say: bone in bone, a cavity, a torn ligament, a poor portal and
// a poor landmark.
static struct knee_case *poor_knee(vec3 way) {
    struct pathology steps[] = {
        {.kind = PATHOLOGY_CAVITY,
         .name = "plateau",
         .cavity = {.place = {.body = BODY_TIBIA, .at = {-20, 5, -22}},
                    .radius_mm = 9,
                    .depth_mm = 3}},
        {.kind = PATHOLOGY_LIGAMENT,
         .name = "mcl",
         .ligament = {{2, {30, 60}}, .valgus_deg = {1, {5}}, .extra_valgus_deg = {1, {6}}}},
    };
    struct knee_case *knee = made_knee();
    struct error err;
    for (int i = 0; i < 2; i++)
        assert_ok(pathology_apply(knee, &steps[i], 0, &err));
    move_group(knee, "tibia", (vec3){0, 0, 1.4});
    landmark(knee, "condyle_medial")->at.z -= 7;
    knee->portals[1].position = (vec3){-30, 45, 0};
    shift(knee, way);
    return knee;
}

static void assert_same_findings(const struct case_check *near, const struct case_check *far) {
    const struct inspection *a = &near->findings, *b = &far->findings;
    int k = 0;
    for (int i = 0; i < b->count; i++) {
        if (strstr(b->findings[i].text, "the way from the origin to the joint is"))
            continue;
        assert_true(k < a->count);
        assert_int_equal(b->findings[i].level, a->findings[k].level);
        if (a->findings[k].level != FINDING_NOTE) // a touch is off where rounding is worst
            assert_string_equal(b->findings[i].where, a->findings[k].where);
        assert_memory_equal(b->findings[i].text, a->findings[k].text, 12);
        k++;
    }
    assert_int_equal(k, a->count);
}

static void a_knee_that_is_moved_by_one_and_a_half_metres_gets_the_same_findings(void **state) {
    (void)state;
    struct case_check *near = check_knee(poor_knee((vec3){0, 0, 0}));
    struct case_check *far = check_knee(poor_knee((vec3){1200, -700, 560}));
    assert_true(near->findings.count > 10);
    assert_same_findings(near, far);
    assert_int_equal(near->contacts.count, far->contacts.count);
    for (int i = 0; i < near->contacts.count; i++)
        for (int k = 0; k < near->contacts.all[i].count; k++) {
            const struct contact_state *a = &near->contacts.all[i].states[k];
            const struct contact_state *b = &far->contacts.all[i].states[k];
            assert_near(a->overlap.depth_mm, b->overlap.depth_mm, 0.02);
            if (isfinite(a->gap.mm))
                assert_near(a->gap.mm, b->gap.mm, 1e-3);
        }
    check_destroy(&near);
    check_destroy(&far);
}

static void each_bound_has_a_source_and_tells_a_value_beyond_it(void **state) {
    (void)state;
    for (int id = 0; id < BOUND_COUNT; id++) {
        const struct bound *b = bound_of((enum bound_id)id);
        assert_true(strlen(b->source) > 20 && strlen(b->what) > 5);
        assert_true(b->fault_least <= b->least && b->least < b->most && b->most < b->fault_most);
        assert_int_equal(bound_level((enum bound_id)id, b->most), FINDING_NOTE);
        assert_int_equal(bound_level((enum bound_id)id, b->most + 1e-6), FINDING_WARNING);
        assert_int_equal(bound_level((enum bound_id)id, b->fault_most + 1e-6), FINDING_FAULT);
        assert_int_equal(bound_level((enum bound_id)id, NAN), FINDING_FAULT);
        char text[384];
        bound_text((enum bound_id)id, b->most + 1, text, sizeof text);
        assert_true(strlen(text) < 380 && strstr(text, b->source));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_knee_as_it_should_be_has_no_fault_and_its_gaps_are_told),
        cmocka_unit_test(a_tibia_in_the_femur_or_far_below_is_unfit),
        cmocka_unit_test(the_depth_of_a_tibia_in_the_femur_is_told_at_each_flexion),
        cmocka_unit_test(menisci_far_too_high_are_unfit),
        cmocka_unit_test(a_patella_far_in_front_or_in_the_femur_is_unfit),
        cmocka_unit_test(bones_that_collide_in_deep_flexion_alone_are_unfit),
        cmocka_unit_test(a_knee_laid_on_its_side_or_called_by_the_other_side_is_unfit),
        cmocka_unit_test(a_portal_inside_the_femur_is_unfit),
        cmocka_unit_test(a_portal_without_a_way_to_the_notch_is_unfit),
        cmocka_unit_test(a_portal_whose_way_cannot_be_examined_is_told),
        cmocka_unit_test(landmarks_that_are_not_where_their_names_say_make_a_case_unfit),
        cmocka_unit_test(a_landmark_somewhat_off_its_surface_is_told),
        cmocka_unit_test(sizes_and_places_that_no_knee_has_are_unfit),
        cmocka_unit_test(a_knee_far_from_its_origin_is_told_and_farther_away_unfit),
        cmocka_unit_test(a_knee_that_is_moved_by_one_and_a_half_metres_gets_the_same_findings),
        cmocka_unit_test(each_bound_has_a_source_and_tells_a_value_beyond_it),
    };
    return cmocka_run_group_tests_name("check_knee", tests, make_knee, remove_knee);
}
