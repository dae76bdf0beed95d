#include "case/case.h"

#include "case_knee.h"
#include "check/inspect.h"
#include "random.h"
#include "test.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

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

static struct knee_case *load(void) {
    struct knee_case *knee;
    assert_ok(case_load(folder, NULL, &knee, &err));
    return knee;
}

static void assert_same_floats(const float *a, const float *b, size_t count) {
    assert_int_equal(!a, !b);
    if (a)
        assert_memory_equal(a, b, count * sizeof *a);
}

static void assert_same_region(const struct case_region *a, const struct case_region *b) {
    assert_int_equal(a->part_count, b->part_count);
    if (a->part_count)
        assert_memory_equal(a->parts, b->parts, (size_t)a->part_count * sizeof *a->parts);
}

static void assert_same(const struct knee_case *a, const struct knee_case *b) {
    assert_string_equal(a->name, b->name);
    assert_string_equal(a->title, b->title);
    assert_memory_equal(&a->joint.T_femur_joint, &b->joint.T_femur_joint, sizeof(pose));
    assert_memory_equal(&a->joint.T_tibia_joint, &b->joint.T_tibia_joint, sizeof(pose));
    assert_int_equal(a->joint.side, b->joint.side);
    assert_int_equal(a->group_count, b->group_count);
    assert_int_equal(a->portal_count, b->portal_count);
    assert_memory_equal(a->portals, b->portals, sizeof a->portals);
    assert_int_equal(a->patella_key_count, b->patella_key_count);
    assert_memory_equal(a->patella_keys, b->patella_keys, sizeof a->patella_keys);
    assert_int_equal(a->loose_count, b->loose_count);
    assert_memory_equal(a->loose, b->loose, sizeof a->loose);
    assert_int_equal(a->rest_count, b->rest_count);
    assert_memory_equal(a->rest, b->rest, sizeof a->rest);
    assert_int_equal(a->torn_count, b->torn_count);
    assert_memory_equal(a->torn, b->torn, sizeof a->torn);
    assert_int_equal(a->key_count, b->key_count);
    assert_memory_equal(a->keys, b->keys, sizeof a->keys);
    for (int i = 0; i < a->group_count; i++) {
        const struct case_group *g = &a->groups[i], *h = &b->groups[i];
        assert_string_equal(g->name, h->name);
        assert_int_equal(g->body, h->body);
        assert_int_equal(g->cuttable, h->cuttable);
        assert_int_equal(g->part_count, h->part_count);
        assert_memory_equal(g->parts, h->parts, sizeof g->parts);
        assert_int_equal(g->mesh.vertex_count, h->mesh.vertex_count);
        assert_int_equal(g->mesh.triangle_count, h->mesh.triangle_count);
        size_t floats = 3 * (size_t)g->mesh.vertex_count;
        assert_same_floats(g->mesh.positions, h->mesh.positions, floats);
        assert_same_floats(g->warp, h->warp, floats);
        assert_same_floats(g->maxcut, h->maxcut, floats);
        assert_int_equal(g->bridges, h->bridges);
        assert_int_equal(g->other_body, h->other_body);
        assert_same_floats(g->other_share, h->other_share, g->mesh.vertex_count);
        assert_same_region(&g->lesion.tear, &h->lesion.tear);
        assert_same_region(&g->lesion.damage, &h->lesion.damage);
        assert_same_region(&g->lesion.plan, &h->lesion.plan);
        assert_memory_equal(g->mesh.triangles, h->mesh.triangles,
                            3 * sizeof(uint32_t) * g->mesh.triangle_count);
    }
}

static void a_case_comes_back_as_it_was_saved(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    assert_ok(case_save(knee, folder, &err));
    struct knee_case *again = load();
    assert_same(knee, again); // boxes have coordinates that survive the way through metres
    assert_true(knee->hash == again->hash);
    case_destroy(&knee);
    case_destroy(&again);
    assert_null(again);
}

static void assert_format(const char *expected) {
    char *text = read_file(folder, "case.json", NULL);
    assert_memory_equal(text, expected, strlen(expected));
    free(text);
}

static void a_case_with_loose_bodies_has_format_4(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    for (int i = 0; i < CASE_LOOSE_MAX; i++) {
        struct case_loose *loose = &knee->loose[knee->loose_count++];
        *loose = (struct case_loose){
            .body = (enum body)(i % 2), .at = {1, 2, i}, .radii_mm = {6, 1, 2.5}};
        snprintf(loose->name, sizeof loose->name, "piece_%d", i);
    }
    assert_ok(case_save(knee, folder, &err));
    assert_format("{\n  \"format\": 4,");
    struct knee_case *again = load();
    assert_same(knee, again);
    assert_int_equal(case_loose_index(again, "piece_7"), 7);
    assert_int_equal(case_loose_index(again, "piece"), -1);
    case_destroy(&knee);
    case_destroy(&again);
}

// Programs of before scans and landmarks read format 1, and say what format 2 is to them.
static void a_case_with_a_scan_or_landmarks_has_format_2_and_others_have_1(void **state) {
    (void)state;
    static const struct case_landmark notch = {.name = "notch", .body = BODY_FEMUR};
    for (int i = 0; i < 3; i++) {
        struct knee_case *knee = box_knee();
        knee->has_scan = i == 1;
        knee->T_case_scan = pose_identity();
        if (i == 2)
            assert_ok(case_landmark_set(knee, &notch, &err));
        assert_ok(case_save(knee, folder, &err));
        assert_format(i ? "{\n  \"format\": 2," : "{\n  \"format\": 1,");
        struct knee_case *again = load();
        case_destroy(&again);
        case_destroy(&knee);
    }
}

static void how_a_scan_lay_comes_back_and_is_absent_where_there_was_none(void **state) {
    (void)state;
    struct random r = {11};
    struct knee_case *knee = box_knee();
    assert_false(knee->has_scan);
    assert_ok(case_save(knee, folder, &err));
    struct knee_case *without = load();
    assert_false(without->has_scan);
    knee->has_scan = knee->scan_mirrored = true;
    knee->T_case_scan = random_pose(&r, 1500);
    assert_ok(case_save(knee, folder, &err));
    struct knee_case *with = load();
    assert_true(with->has_scan && with->scan_mirrored);
    assert_memory_equal(&with->T_case_scan, &knee->T_case_scan, sizeof(pose));
    case_destroy(&knee);
    case_destroy(&without);
    case_destroy(&with);
}

// Magnitudes from 1e-6 to 1e3 mm.
static void scatter(struct random *r, float *values, size_t count) {
    for (size_t i = 0; i < count; i++)
        values[i] = (float)(random_between(r, -1, 1) * pow(10, random_between(r, -6, 3)));
}

static void the_first_load_rounds_and_later_ones_are_equal_bit_for_bit(void **state) {
    (void)state;
    struct random r = {7};
    struct knee_case *knee = box_knee();
    struct case_group *skin = case_add_group(knee, "skin", BODY_FEMUR);
    struct mesh mesh;
    mesh_init(&mesh, 30000, 10000);
    scatter(&r, mesh.positions, 90000);
    for (uint32_t i = 0; i < 30000; i++)
        mesh.triangles[i] = i;
    assert_ok(case_add_part(skin, "skin", &mesh, &err));
    scatter(&r, case_group_need_warp(skin), 90000);
    assert_ok(case_save(knee, folder, &err));
    struct knee_case *once = load();
    const float *positions = case_group(once, "skin")->mesh.positions;
    for (size_t i = 0; i < 90000; i++)
        assert_near(positions[i], mesh.positions[i], 1.3e-7 * fabsf(mesh.positions[i]));
    assert_ok(case_save(once, folder, &err));
    struct knee_case *twice = load();
    assert_same(once, twice);
    uint64_t hash = once->hash;
    assert_ok(case_save(twice, folder, &err));
    assert_true(twice->hash == hash);
    mesh_fini(&mesh);
    case_destroy(&knee);
    case_destroy(&once);
    case_destroy(&twice);
}

// The JSON chunk, read without the loader.
static json_t *anatomy_json(void) {
    char *bytes = read_file(folder, "anatomy.glb", NULL);
    uint32_t size;
    memcpy(&size, bytes + 12, 4);
    json_t *json = json_loadb(bytes + 20, size, 0, NULL);
    free(bytes);
    assert_non_null(json);
    return json;
}

static void the_file_is_in_metres_with_a_node_for_each_part_and_named_targets(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    assert_ok(case_save(knee, folder, &err));
    json_t *json = anatomy_json();
    static const char *const nodes[] = {"tibia/bone", "tibia/cartilage", "femur", "patella",
                                        "meniscus_medial"};
    for (size_t i = 0; i < 5; i++) {
        const json_t *node = json_array_get(json_object_get(json, "nodes"), i);
        assert_string_equal(json_string_value(json_object_get(node, "name")), nodes[i]);
    }
    double x, y, z;
    const char *target, *generator;
    assert_int_equal(json_unpack(json, "{s:[{s:[F,F,F]}]}", "accessors", "max", &x, &y, &z), 0);
    assert_vec3_near(((vec3){x, y, z}), ((vec3){0.038, 0.025, -0.022}), 1e-8);
    assert_int_equal(
        json_unpack(json, "{s:[{s:{s:[s]}}]}", "meshes", "extras", "targetNames", &target), 0);
    assert_string_equal(target, "warp");
    assert_int_equal(json_unpack(json, "{s:{s:s}}", "asset", "generator", &generator), 0);
    assert_string_equal(generator, "Arthron " ARTHRON_VERSION);
    json_decref(json);
    case_destroy(&knee);
}

static const struct plane slanted[] = {{{0.6, 0.64, 0.48}, 3 - 23.5},
                                       {{-3, 1, 1}, 3 + 59},
                                       {{1, -2, 0.7}, 3 - 36.2},
                                       {{0.1, 0.2, -5}, 2 + 77.5}};

static void a_lesion_comes_back_and_counts_in_the_hash(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    assert_ok(case_save(knee, folder, &err));
    uint64_t hash = knee->hash;
    struct case_lesion *lesion = &case_group(knee, "meniscus_medial")->lesion;
    assert_ok(case_region_add(&lesion->damage, slanted, 4, &err));
    assert_ok(case_save(knee, folder, &err));
    assert_true(knee->hash != hash);
    struct knee_case *once = load();
    assert_true(once->hash == knee->hash);
    const struct case_lesion *loaded = &case_group(once, "meniscus_medial")->lesion;
    assert_int_equal(loaded->tear.part_count, 1);
    assert_int_equal(loaded->damage.part_count, 1);
    assert_int_equal(loaded->plan.part_count, 2);
    assert_near(loaded->plan.parts[0].volume, 6 * 4 * 8, 1e-9);
    for (int i = 0; i < 4; i++) {
        double length = vec3_length(slanted[i].normal);
        struct plane p = loaded->damage.parts[0].planes[i];
        assert_vec3_near(p.normal, vec3_scale(1 / length, slanted[i].normal), 1e-15);
        assert_near(p.offset, slanted[i].offset / length, 1e-14 * fabs(p.offset));
    }
    assert_ok(case_save(once, folder, &err));
    struct knee_case *twice = load();
    assert_same(once, twice);
    case_destroy(&knee);
    case_destroy(&once);
    case_destroy(&twice);
}

static void a_region_takes_32_parts_and_no_more(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct case_region *damage = &case_group(knee, "meniscus_medial")->lesion.damage;
    assert_int_equal(case_region_add(damage, slanted, 3, &err), RESULT_INVALID);
    assert_int_equal(damage->part_count, 0);
    for (int i = 0; i < CASE_REGION_PARTS_MAX; i++)
        assert_ok(case_region_add(damage, slanted, 4, &err));
    assert_int_equal(case_region_add(damage, slanted, 4, &err), RESULT_LIMIT);
    assert_int_equal(damage->part_count, CASE_REGION_PARTS_MAX);
    assert_ok(case_save(knee, folder, &err));
    case_destroy(&knee);
    knee = load();
    assert_int_equal(case_group(knee, "meniscus_medial")->lesion.damage.part_count, 32);
    case_destroy(&knee);
}

static void a_part_added_later_gets_no_displacement(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    const struct case_group *tibia = case_group(knee, "tibia");
    assert_int_equal(tibia->parts[1].first_vertex, 8);
    assert_int_equal(tibia->parts[1].first_triangle, 12);
    for (int i = 24; i < 48; i++)
        assert_true(tibia->warp[i] == 0);
    assert_true(tibia->warp[17] == -3.25f);
    assert_int_equal(tibia->mesh.triangles[36], 8);
    case_destroy(&knee);
}

static void a_part_added_to_a_bridge_later_stays_with_its_body(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct case_group *lcl = case_group(knee, "lcl");
    struct mesh mesh;
    box_mesh((vec3){42, 5, -10}, (vec3){1, 1, 25}, &mesh);
    assert_ok(case_add_part(lcl, "second", &mesh, &err));
    mesh_fini(&mesh);
    for (uint32_t v = 0; v < 16; v++)
        assert_true(lcl->other_share[v] == (v >= 4 && v < 8 ? 0.875f : 0));
    lcl->other_share[9] = 0.3f; // survives its way: it has no unit
    assert_ok(case_save(knee, folder, &err));
    struct knee_case *again = load();
    assert_same(knee, again);
    case_destroy(&knee);
    case_destroy(&again);
}

static void parts_are_refused_by_name_number_and_mesh(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct case_group *tibia = case_group(knee, "tibia");
    struct mesh mesh;
    box_mesh((vec3){0}, (vec3){1, 1, 1}, &mesh);
    static const char *const names[] = {"bone", "", "a/b", "two words"};
    for (int i = 0; i < 4; i++) {
        assert_int_equal(case_add_part(tibia, names[i], &mesh, &err), RESULT_INVALID);
        assert_non_null(strstr(err.text, "group tibia"));
    }
    mesh.positions[4] = NAN;
    assert_int_not_equal(case_add_part(tibia, "new", &mesh, &err), RESULT_OK);
    assert_non_null(strstr(err.text, "part new"));
    mesh.positions[4] = 0;
    static const char *const more[] = {"1", "2", "3", "4", "5", "6"};
    for (int i = 0; i < 6; i++)
        assert_ok(case_add_part(tibia, more[i], &mesh, &err));
    assert_int_equal(case_add_part(tibia, "7", &mesh, &err), RESULT_LIMIT);
    mesh_fini(&mesh);
    case_destroy(&knee);
}

static void the_patella_follows_its_keys_and_stays_past_them(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    vec3 end = knee->patella_keys[1].T_femur_patella.translation;
    assert_vec3_near(case_patella_pose(knee, -20).translation, ((vec3){0, 0, 0}), 0);
    assert_vec3_near(case_patella_pose(knee, 45).translation, vec3_scale(0.5, end), 1e-12);
    assert_near(quat_angle(case_patella_pose(knee, 45).rotation, quat_identity()), 0.55, 1e-12);
    assert_vec3_near(case_patella_pose(knee, 140).translation, end, 0);
    knee->patella_key_count = 0;
    assert_vec3_near(case_patella_pose(knee, 45).translation, ((vec3){0, 0, 0}), 0);
    case_destroy(&knee);
}

static void a_save_that_fails_leaves_the_old_case_whole(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    assert_ok(case_save(knee, folder, &err));
    uint64_t hash = knee->hash;
    // A folder where the first file's temporary name would be.
    char aside[300];
    snprintf(aside, sizeof aside, "%s/anatomy.glb.%d~", folder, (int)getpid());
    assert_int_equal(mkdir(aside, 0777), 0);
    case_group(knee, "tibia")->warp[0] = 1;
    assert_int_equal(case_save(knee, folder, &err), RESULT_IO);
    assert_non_null(strstr(err.text, aside));
    assert_int_equal(rmdir(aside), 0);
    struct knee_case *again = load();
    assert_true(again->hash == hash);
    case_destroy(&again);
    case_destroy(&knee);
}

static void a_folder_is_made_with_its_parents(void **state) {
    (void)state;
    struct knee_case *knee = box_knee(), *again;
    char deep[300], parent[300];
    snprintf(parent, sizeof parent, "%s/a", folder);
    snprintf(deep, sizeof deep, "%s/a/b", folder);
    assert_ok(case_save(knee, deep, &err));
    assert_ok(case_load(deep, NULL, &again, &err));
    case_destroy(&again);
    case_destroy(&knee);
    folder_remove(parent);
}

static void a_title_is_cut_between_characters(void **state) {
    (void)state;
    char title[256] = "x";
    for (int i = 0; i < 100; i++)
        strcat(title, "é");
    struct knee_case *knee = case_create("long", title);
    assert_int_equal(strlen(knee->title), 127);
    case_destroy(&knee);
    knee = case_create("long", title + 1);
    assert_int_equal(strlen(knee->title), 126);
    case_destroy(&knee);
}

static void the_medial_plateau_is_on_top_of_the_tibia_at_the_medial_side(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    knee->joint.T_femur_joint.rotation = knee->joint.T_tibia_joint.rotation = quat_identity();
    vec3 point;
    assert_true(inspect_medial_plateau(knee, &point));
    assert_vec3_near(point, ((vec3){-19, 0, -20}), 1e-5); // the cartilage's upper side
    knee->joint.side = SIDE_LEFT;
    assert_true(inspect_medial_plateau(knee, &point));
    assert_vec3_near(point, ((vec3){19, 0, -22}), 1e-5); // bone
    case_destroy(&knee);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_case_comes_back_as_it_was_saved, make, clear),
        cmocka_unit_test_setup_teardown(a_case_with_loose_bodies_has_format_4, make, clear),
        cmocka_unit_test_setup_teardown(
            a_case_with_a_scan_or_landmarks_has_format_2_and_others_have_1, make, clear),
        cmocka_unit_test_setup_teardown(
            how_a_scan_lay_comes_back_and_is_absent_where_there_was_none, make, clear),
        cmocka_unit_test_setup_teardown(the_first_load_rounds_and_later_ones_are_equal_bit_for_bit,
                                        make, clear),
        cmocka_unit_test_setup_teardown(
            the_file_is_in_metres_with_a_node_for_each_part_and_named_targets, make, clear),
        cmocka_unit_test_setup_teardown(a_lesion_comes_back_and_counts_in_the_hash, make, clear),
        cmocka_unit_test_setup_teardown(a_region_takes_32_parts_and_no_more, make, clear),
        cmocka_unit_test(a_part_added_later_gets_no_displacement),
        cmocka_unit_test_setup_teardown(a_part_added_to_a_bridge_later_stays_with_its_body, make,
                                        clear),
        cmocka_unit_test(parts_are_refused_by_name_number_and_mesh),
        cmocka_unit_test(the_patella_follows_its_keys_and_stays_past_them),
        cmocka_unit_test_setup_teardown(a_save_that_fails_leaves_the_old_case_whole, make, clear),
        cmocka_unit_test_setup_teardown(a_folder_is_made_with_its_parents, make, clear),
        cmocka_unit_test(a_title_is_cut_between_characters),
        cmocka_unit_test(the_medial_plateau_is_on_top_of_the_tibia_at_the_medial_side),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
