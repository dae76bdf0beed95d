// What no case may be, and what the check of one names.
#include "case_knee.h"
#include "check/inspect.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static struct error err;
static char folder[FOLDER_MAX];

static int make(void **state) {
    (void)state;
    folder_make(folder);
    return 0;
}

static int clear(void **state) {
    (void)state;
    folder_remove(folder);
    return 0;
}

static void no_tibia(struct knee_case *knee) {
    strcpy(case_group(knee, "tibia")->name, "fibula");
}

static void no_femur(struct knee_case *knee) {
    strcpy(case_group(knee, "femur")->name, "humerus");
}

static void open_meniscus(struct knee_case *knee) {
    case_group(knee, "meniscus_medial")->mesh.triangle_count--;
}

static void turned_meniscus(struct knee_case *knee) {
    struct mesh *mesh = &case_group(knee, "meniscus_medial")->mesh;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t *c = mesh->triangles + 3 * (size_t)t, second = c[1];
        c[1] = c[2];
        c[2] = second;
    }
}

static void twisted_meniscus(struct knee_case *knee) {
    uint32_t *c = case_group(knee, "meniscus_medial")->mesh.triangles, second = c[1];
    c[1] = c[2];
    c[2] = second;
}

static void meniscus_of_two_parts(struct knee_case *knee) {
    struct mesh mesh;
    box_mesh((vec3){0}, (vec3){1, 1, 1}, &mesh);
    assert_ok(case_add_part(case_group(knee, "meniscus_medial"), "more", &mesh, &err));
    mesh_fini(&mesh);
}

static struct case_loose *some_loose(struct knee_case *knee) {
    struct case_loose *loose = &knee->loose[knee->loose_count++];
    *loose = (struct case_loose){.name = "piece", .body = BODY_TIBIA, .radii_mm = {3, 3, 2}};
    return loose;
}

static void loose_body_of_7_mm(struct knee_case *knee) {
    some_loose(knee)->radii_mm.y = 7;
}

static void loose_body_without_size(struct knee_case *knee) {
    some_loose(knee)->radii_mm.z = NAN;
}

static void loose_body_nowhere(struct knee_case *knee) {
    some_loose(knee)->at.x = INFINITY;
}

static void two_loose_bodies_of_one_name(struct knee_case *knee) {
    some_loose(knee);
    some_loose(knee);
}

static void infinite_warp(struct knee_case *knee) {
    case_group(knee, "tibia")->warp[4] = INFINITY;
}

static void warp_of_11_m(struct knee_case *knee) {
    case_group(knee, "tibia")->warp[4] = 11e3f;
}

static void lesion_of_bone(struct knee_case *knee) {
    static const struct plane corner[] = {
        {{-1, 0, 0}, 0}, {{0, -1, 0}, 0}, {{0, 0, -1}, 0}, {{1, 1, 1}, 5}};
    struct case_group *femur = case_group(knee, "femur");
    assert_ok(case_region_add(&femur->lesion.damage, corner, 4, &err));
}

// The meniscus lies there, but S' does not.
static void lesion_beside(struct knee_case *knee) {
    struct case_group *meniscus = case_group(knee, "meniscus_medial");
    float *warp = case_group_need_warp(meniscus);
    for (uint32_t v = 0; v < meniscus->mesh.vertex_count; v++)
        warp[3 * v + 2] = -9;
}

static void empty_group(struct knee_case *knee) {
    case_add_group(knee, "acl", BODY_TIBIA);
}

static void long_direction(struct knee_case *knee) {
    knee->portals[0].direction = (vec3){0, 2, 0};
}

static void falling_keys(struct knee_case *knee) {
    knee->patella_keys[1].flexion_deg = 0;
}

static void bent_joint(struct knee_case *knee) {
    knee->joint.T_tibia_joint.rotation.w = 0;
}

static void share_of_nothing(struct knee_case *knee) {
    case_group(knee, "lcl")->other_share[3] = NAN;
}

static void share_over_one(struct knee_case *knee) {
    case_group(knee, "lcl")->other_share[7] = 1.0000001f;
}

static void bridge_to_itself(struct knee_case *knee) {
    case_group(knee, "lcl")->other_body = BODY_TIBIA;
}
static void bridge_to_be_cut(struct knee_case *k) {
    case_group(k, "lcl")->cuttable = true;
}

static void stretched_rest(struct knee_case *knee) {
    knee->rest[1].rotation.w = 2;
}

static void key_of_nothing(struct knee_case *knee) {
    knee->keys[2].ligament = 2;
}

static void key_before_all(struct knee_case *knee) {
    knee->keys[0].ligament = -1;
}

static void target_nowhere(struct knee_case *knee) {
    knee->keys[1].target.translation.x = INFINITY;
}

static void torn_without_key(struct knee_case *knee) {
    knee->key_count = 2;
}

static void torn_twice(struct knee_case *knee) {
    strcpy(knee->torn[1], "mcl");
}

static void torn_without_name(struct knee_case *knee) {
    knee->torn[1][0] = '\0';
}

static void too_many_keys(struct knee_case *knee) {
    knee->key_count = CASE_KEYS_MAX + 1;
}

static void what_no_case_may_be_is_refused_by_name_and_not_saved(void **state) {
    (void)state;
    static const struct {
        void (*spoil)(struct knee_case *knee);
        enum result code;
        const char *says;
    } rows[] = {
        {loose_body_of_7_mm, RESULT_INVALID, "loose body piece: its radii are not from 1 to 6 mm"},
        {loose_body_without_size, RESULT_INVALID, "loose body piece: its radii"},
        {loose_body_nowhere, RESULT_INVALID, "loose body piece: the place is not finite"},
        {two_loose_bodies_of_one_name, RESULT_INVALID, "there are two loose bodies piece"},
        {no_tibia, RESULT_MISSING, "tibia"},
        {no_femur, RESULT_MISSING, "femur"},
        {open_meniscus, RESULT_INVALID, "meniscus_medial is cuttable but open"},
        {turned_meniscus, RESULT_INVALID, "meniscus_medial is cuttable but inside out"},
        {twisted_meniscus, RESULT_INVALID, "meniscus_medial is cuttable but not oriented"},
        {meniscus_of_two_parts, RESULT_INVALID, "meniscus_medial is cuttable but has 2 parts"},
        {warp_of_11_m, RESULT_INVALID,
         "group tibia: warp of vertex 1 is not finite or beyond 10 m"},
        {infinite_warp, RESULT_INVALID, "group tibia: warp of vertex 1"},
        {empty_group, RESULT_MISSING, "group acl"},
        {lesion_of_bone, RESULT_INVALID, "group femur has lesion.damage but is not cuttable"},
        {lesion_beside, RESULT_INVALID, "meniscus_medial: lesion.tear[0] lies outside the mesh"},
        {long_direction, RESULT_INVALID, "portal anteromedial: direction"},
        {falling_keys, RESULT_INVALID, "patella[1]: flexion_deg"},
        {bent_joint, RESULT_INVALID, "joint.T_tibia_joint"},
        {share_of_nothing, RESULT_INVALID, "group lcl: other_share of vertex 3"},
        {share_over_one, RESULT_INVALID, "group lcl: other_share of vertex 7"},
        {bridge_to_itself, RESULT_INVALID, "group lcl bridges from its body tibia to the same"},
        {bridge_to_be_cut, RESULT_INVALID, "group lcl bridges two bones"},
        {stretched_rest, RESULT_INVALID, "rest[1]"},
        {key_of_nothing, RESULT_INVALID, "key 2: there is no torn ligament 2"},
        {key_before_all, RESULT_INVALID, "key 0: there is no torn ligament -1"},
        {target_nowhere, RESULT_INVALID, "key 1 (mcl)"},
        {torn_without_key, RESULT_INVALID, "the torn ligament acl has no key"},
        {torn_twice, RESULT_INVALID, "two torn ligaments mcl"},
        {torn_without_name, RESULT_INVALID, "torn[1] has no valid name"},
        {too_many_keys, RESULT_LIMIT, "more than"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct knee_case *knee = box_knee();
        rows[i].spoil(knee);
        assert_int_equal(case_save(knee, folder, &err), rows[i].code);
        if (!strstr(err.text, rows[i].says))
            fail_msg("\"%s\" does not say \"%s\"", err.text, rows[i].says);
        struct stat status;
        char path[300];
        snprintf(path, sizeof path, "%s/case.json", folder);
        assert_int_not_equal(stat(path, &status), 0);
        case_destroy(&knee);
    }
}

static void wrong_side(struct knee_case *knee) {
    knee->joint.side = SIDE_LEFT;
}

static void far_portal(struct knee_case *knee) {
    struct mesh mesh;
    box_mesh((vec3){0, 0, 0}, (vec3){60, 60, 90}, &mesh);
    assert_ok(case_add_part(case_add_group(knee, "skin", BODY_FEMUR), "skin", &mesh, &err));
    mesh_fini(&mesh);
}

static void portal_outwards(struct knee_case *knee) {
    knee->portals[0].direction = (vec3){0, 1, 0};
}

static void large_warp(struct knee_case *knee) {
    case_group(knee, "tibia")->warp[3] = 31;
}

static void tibia_above(struct knee_case *knee) {
    struct mesh *mesh = &case_group(knee, "tibia")->mesh;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        mesh->positions[3 * v + 2] += 200;
}

static void knee_in_metres(struct knee_case *knee) {
    for (int i = 0; i < knee->group_count; i++)
        for (uint32_t v = 0; v < 3 * knee->groups[i].mesh.vertex_count; v++)
            knee->groups[i].mesh.positions[v] /= 1000;
}

static void check_names_what_is_wrong_with_a_case_that_loads(void **state) {
    (void)state;
    static const struct {
        void (*spoil)(struct knee_case *knee);
        const char *where, *says;
    } rows[] = {
        {wrong_side, "meniscus_medial", "is the side right"},
        {far_portal, "anteromedial", "10.0 mm off the skin"},
        {portal_outwards, "anteromedial", "away from the joint"},
        {large_warp, "tibia", "warp moves a vertex by 31.0 mm"},
        {tibia_above, "femur", "is z proximal"},
        {knee_in_metres, "tibia", "the unit that would fit is m"},
    };
    static struct inspection inspection;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct knee_case *knee = box_knee();
        struct mesh mesh;
        box_mesh((vec3){25, 0, -16}, (vec3){6, 15, 3}, &mesh);
        assert_ok(case_add_part(case_add_group(knee, "meniscus_lateral", BODY_TIBIA),
                                "meniscus_lateral", &mesh, &err));
        mesh_fini(&mesh);
        inspect_case(knee, &inspection);
        assert_int_equal(inspection.faults, 0);
        rows[i].spoil(knee);
        inspect_case(knee, &inspection);
        bool found = false;
        for (int k = 0; k < inspection.count; k++)
            found |= inspection.findings[k].level == FINDING_FAULT &&
                     strcmp(inspection.findings[k].where, rows[i].where) == 0 &&
                     strstr(inspection.findings[k].text, rows[i].says);
        if (!found)
            fail_msg("no fault of %s says \"%s\"", rows[i].where, rows[i].says);
        case_destroy(&knee);
    }
}
int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_no_case_may_be_is_refused_by_name_and_not_saved, make,
                                        clear),
        cmocka_unit_test(check_names_what_is_wrong_with_a_case_that_loads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
