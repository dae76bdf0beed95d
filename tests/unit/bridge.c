#include "generate/bridge.h"

#include "import/import.h"
#include "case_knee.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static struct error err;

static struct case_group *add_box(struct knee_case *knee, const char *name, enum body body,
                                  vec3 centre, vec3 half) {
    struct mesh mesh;
    box_mesh(centre, half, &mesh);
    struct case_group *group = case_add_group(knee, name, body);
    assert_int_equal(case_add_part(group, name, &mesh, &err), RESULT_OK);
    mesh_fini(&mesh);
    return group;
}

// Blocks of bone above z = 10 and below z = -10, far wider than the strip of 2 by 2 by 40 mm.
static struct knee_case *two_blocks(struct case_group **out_strip, vec3 half) {
    struct knee_case *knee = case_create("blocks", "");
    add_box(knee, "tibia", BODY_TIBIA, (vec3){0, 0, -60}, (vec3){200, 200, 50});
    add_box(knee, "femur", BODY_FEMUR, (vec3){0, 0, 60}, (vec3){200, 200, 50});
    *out_strip = add_box(knee, "strip", BODY_TIBIA, (vec3){0, 0, 0}, half);
    return knee;
}

static float *shares_over(double half_z) {
    struct case_group *strip;
    struct knee_case *knee = two_blocks(&strip, (vec3){1, 1, half_z});
    assert_int_equal(bridge_make(knee, strip, BODY_FEMUR, &err), RESULT_OK);
    assert_true(strip->bridges && strip->other_body == BODY_FEMUR);
    assert_int_equal(case_validate(knee, &err), RESULT_OK);
    float *shares = strip->other_share;
    strip->other_share = NULL;
    case_destroy(&knee);
    return shares;
}

static void a_vertex_between_two_bones_follows_the_nearer_more(void **state) {
    (void)state;
    for (double z = 0; z < 10; z += 1.25) {
        float *shares = shares_over(z);
        for (int v = 0; v < 8; v++)
            assert_near(shares[v], ((v & 4 ? z : -z) + 10) / 20, 1e-7);
        free(shares);
    }
}

static void an_insertion_goes_whole_with_its_bone(void **state) {
    (void)state;
    for (double z = 10; z < 50; z += 7.5) {
        float *shares = shares_over(z);
        for (int v = 0; v < 8; v++)
            assert_true(shares[v] == (v & 4 ? 1 : 0));
        free(shares);
    }
}

static void where_both_bones_are_touched_each_has_half(void **state) {
    (void)state;
    struct knee_case *knee = case_create("blocks", "");
    add_box(knee, "tibia", BODY_TIBIA, (vec3){0, 0, -50}, (vec3){50, 50, 50});
    add_box(knee, "femur", BODY_FEMUR, (vec3){0, 0, 50}, (vec3){50, 50, 50});
    struct case_group *strip = add_box(knee, "strip", BODY_FEMUR, (vec3){0, 0, 1}, (vec3){1, 1, 1});
    assert_int_equal(bridge_make(knee, strip, BODY_TIBIA, &err), RESULT_OK);
    for (int v = 0; v < 8; v++)
        assert_true(strip->other_share[v] == (v & 4 ? 0 : 0.5f)); // of the femur's body
    case_destroy(&knee);
}

static void an_open_bone_has_no_inside(void **state) {
    (void)state;
    struct case_group *strip;
    struct knee_case *knee = two_blocks(&strip, (vec3){1, 1, 15});
    struct case_group *femur = case_group(knee, "femur");
    femur->mesh.triangle_count = femur->parts[0].triangle_count = 11;
    assert_int_equal(bridge_make(knee, strip, BODY_FEMUR, &err), RESULT_OK);
    for (int v = 4; v < 8; v++)
        assert_near(strip->other_share[v], 25.0 / 30, 1e-7); // 25 above the tibia, 5 in the femur
    case_destroy(&knee);
}

static void what_cannot_be_bridged_is_refused(void **state) {
    (void)state;
    struct case_group *strip;
    struct knee_case *knee = two_blocks(&strip, (vec3){1, 1, 15});
    assert_int_equal(bridge_make(knee, strip, BODY_TIBIA, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "group strip: cannot bridge from the tibia to itself"));
    assert_int_equal(bridge_make(knee, strip, BODY_PATELLA, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "group strip: there is no patella"));
    case_add_group(knee, "patella", BODY_PATELLA);
    assert_int_equal(bridge_make(knee, strip, BODY_PATELLA, &err), RESULT_MISSING);
    assert_false(strip->bridges);
    assert_null(strip->other_share);
    case_destroy(&knee);
}

static void ligaments_bridge_by_their_names(void **state) {
    (void)state;
    assert_int_equal(import_default_bridge("acl", BODY_TIBIA), BODY_FEMUR);
    assert_int_equal(import_default_bridge("lcl", BODY_FEMUR), BODY_TIBIA);
    assert_int_equal(import_default_bridge("patellar_ligament", BODY_PATELLA), BODY_TIBIA);
    assert_int_equal(import_default_bridge("patellar_tendon", BODY_TIBIA), BODY_COUNT);
    assert_int_equal(import_default_bridge("meniscus_medial", BODY_TIBIA), BODY_COUNT);
    assert_int_equal(import_default_bridge("skin", BODY_FEMUR), BODY_TIBIA);
    assert_int_equal(import_default_bridge("fat_pad", BODY_FEMUR), BODY_COUNT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_vertex_between_two_bones_follows_the_nearer_more),
        cmocka_unit_test(an_insertion_goes_whole_with_its_bone),
        cmocka_unit_test(where_both_bones_are_touched_each_has_half),
        cmocka_unit_test(an_open_bone_has_no_inside),
        cmocka_unit_test(what_cannot_be_bridged_is_refused),
        cmocka_unit_test(ligaments_bridge_by_their_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
