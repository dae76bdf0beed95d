// Knees that cannot be are unfit, and the knee that they are made of is not.
#include "check/bounds.h"
#include "finding.h"
#include "folder.h"
#include "generated.h"

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
    for (int i = 0; i < check->findings.count; i++)
        if (check->findings.findings[i].level == FINDING_FAULT)
            fail_msg("%s: %s", check->findings.findings[i].where, check->findings.findings[i].text);
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
    const double ups[] = {3.5, 20.5}; // over a gap of 0.4 mm
    for (int i = 0; i < 2; i++) {
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

static void a_patella_far_in_front_is_unfit(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    move_body(knee, BODY_PATELLA, (vec3){0, 200, 0});
    expect_unfit(knee, "femur", "does not touch patella");
}

static void a_portal_inside_the_femur_is_unfit(void **state) {
    (void)state;
    struct knee_case *knee = made_knee();
    knee->portals[0].position = (vec3){20, 0, -10};
    expect_unfit(knee, "anterolateral", "mm inside femur");
}

static void scale_group(struct knee_case *knee, const char *name, double factor) {
    struct mesh *mesh = &case_group(knee, name)->mesh;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        mesh_set_vertex(mesh, v, vec3_scale(factor, mesh_vertex(mesh, v)));
}

static void sizes_and_places_that_no_knee_has_are_unfit(void **state) {
    (void)state;
    static const struct {
        const char *group;
        double factor;
        vec3 way;
        const char *text;
    } rows[] = {
        {"femur", 1.6, {0, 0, 0}, "the condyles' width is 12"},
        {"tibia", 1.75, {0, 0, 0}, "the plateau's width is 1"},
        {"tibia", 0.5, {0, 0, 0}, "the plateau's width is 40"},
        {"meniscus_medial", 1e-3, {0, 0, 0}, "the volume is 2.4"},
        {"meniscus_lateral", 2, {0, 0, 0}, "the volume is 19"},
        {"patella", 0.3, {0, 20, 0}, "the height is 1"},
        {"patella", 2.2, {0, 0, 0}, "the width is 9"},
        {"patella", 1, {45, 0, 0}, "the way from the middle of the condyles"},
        {"patella", 1, {0, 0, 100}, "the way from the plateau up to the patella is 3"},
        {"patella", 1, {0, 0, -70}, "the way from the plateau up to the patella is -1"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct knee_case *knee = made_knee();
        scale_group(knee, rows[i].group, rows[i].factor);
        move_group(knee, rows[i].group, rows[i].way);
        expect_unfit(knee, rows[i].group, rows[i].text);
    }
}

static void a_knee_far_from_its_origin_is_told_and_farther_away_unfit(void **state) {
    (void)state;
    const double ways[] = {700, 2300};
    for (int i = 0; i < 2; i++) {
        struct knee_case *knee = made_knee();
        vec3 way = {ways[i], 0, 0};
        for (int k = 0; k < knee->group_count; k++)
            move_group(knee, knee->groups[k].name, way);
        pose T = {{1, 0, 0, 0}, way};
        knee->joint.T_femur_joint = knee->joint.T_tibia_joint = T;
        for (int k = 0; k < knee->portal_count; k++)
            knee->portals[k].position = vec3_add(knee->portals[k].position, way);
        for (int k = 0; k < knee->patella_key_count; k++) {
            pose *key = &knee->patella_keys[k].T_femur_patella;
            *key = pose_compose(T, pose_compose(*key, pose_inverse(T)));
        }
        struct case_check *check = check_knee(knee);
        assert_int_equal(check->grade, i ? GRADE_UNFIT : GRADE_WARNINGS);
        assert_non_null(find_finding(check, i ? FINDING_FAULT : FINDING_WARNING, "joint",
                                     "the way from the origin to the joint is"));
        check_destroy(&check);
    }
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
        cmocka_unit_test(a_patella_far_in_front_is_unfit),
        cmocka_unit_test(a_portal_inside_the_femur_is_unfit),
        cmocka_unit_test(sizes_and_places_that_no_knee_has_are_unfit),
        cmocka_unit_test(a_knee_far_from_its_origin_is_told_and_farther_away_unfit),
        cmocka_unit_test(each_bound_has_a_source_and_tells_a_value_beyond_it),
    };
    return cmocka_run_group_tests_name("check_knee", tests, make_knee, remove_knee);
}
