#include "generate/generate.h"

#include "folder.h"
#include "mesh/query.h"
#include "mesh/topology.h"
#include "test.h"
#include "winding.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct recipe standard = {.name = "test",
                                       .title = "Test",
                                       .size = 1,
                                       .resolution_mm = 1.7,
                                       .meniscus_medial_cm3 = 2.4,
                                       .meniscus_lateral_cm3 = 2.4};

static struct knee_case *generate(const struct recipe *recipe) {
    struct knee_case *knee;
    struct error err;
    if (generate_knee(recipe, &knee, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return knee;
}

static struct knee_case *healthy; // the standard recipe's

static int make_healthy(void **state) {
    (void)state;
    healthy = generate(&standard);
    return 0;
}

static int destroy_healthy(void **state) {
    (void)state;
    case_destroy(&healthy);
    return 0;
}

static const struct mesh *mesh_of(struct knee_case *knee, const char *name) {
    struct case_group *group = case_group(knee, name);
    assert_non_null(group);
    return &group->mesh;
}

static double smallest_angle_deg(const struct mesh *mesh, uint32_t triangle) {
    double smallest = 180;
    for (int i = 0; i < 3; i++) {
        vec3 p = mesh_corner(mesh, triangle, i);
        vec3 u = vec3_sub(mesh_corner(mesh, triangle, (i + 1) % 3), p);
        vec3 v = vec3_sub(mesh_corner(mesh, triangle, (i + 2) % 3), p);
        double angle = atan2(vec3_length(vec3_cross(u, v)), vec3_dot(u, v)) * DEG_PER_RAD;
        smallest = fmin(smallest, angle);
    }
    return smallest;
}

static void assert_sound(struct knee_case *knee) {
    for (int i = 0; i < knee->group_count; i++) {
        const struct mesh *mesh = &knee->groups[i].mesh;
        struct topology t = topology_of(mesh);
        if (!t.closed || !t.manifold || !t.oriented || t.components != 1 || t.genus != 0 ||
            t.unused_vertices != 0 || mesh_volume(mesh) <= 0)
            fail_msg("%s: closed %d manifold %d oriented %d components %u genus %d, %g mm3",
                     knee->groups[i].name, t.closed, t.manifold, t.oriented, t.components,
                     (int)t.genus, mesh_volume(mesh));
    }
}

// The least distance of a's vertices from b's surface; negative where one of them is inside.
static double clearance(const struct mesh *a, const struct mesh *b, pose T_b_a) {
    struct query *query;
    assert_int_equal(query_create(b, &query, NULL), RESULT_OK);
    double least = INFINITY;
    uint32_t hint = MESH_NONE;
    for (uint32_t v = 0; v < a->vertex_count; v++) {
        vec3 p = pose_apply(T_b_a, mesh_vertex(a, v));
        struct closest closest;
        // Surfaces that cross have vertices near the crossing.
        if (!query_closest(query, p, fmin(fmax(least, 0), 2), hint, &closest))
            continue;
        hint = closest.triangle;
        least = fmin(least, is_inside(b, p) ? -closest.distance : closest.distance);
    }
    query_destroy(&query);
    return least;
}

static pose tibia_at(const struct knee_case *knee, double flexion_deg) {
    struct joint_angles angles = {.flexion_deg = flexion_deg};
    return joint_to_pose(&knee->joint, &angles);
}

// ---- the healthy knee ---------------------------------------------------------------------------

static void every_group_is_one_closed_manifold_oriented_ball(void **state) {
    (void)state;
    assert_int_equal(healthy->group_count, 10);
    assert_sound(healthy);
}

static void triangles_are_well_shaped(void **state) {
    (void)state;
    for (int i = 0; i < healthy->group_count; i++) {
        const struct mesh *mesh = &healthy->groups[i].mesh;
        uint32_t slivers = 0;
        double least = 180;
        for (uint32_t t = 0; t < mesh->triangle_count; t++) {
            double angle = smallest_angle_deg(mesh, t);
            least = fmin(least, angle);
            slivers += angle < 20;
        }
        if (least < 2 || slivers > 0.06 * mesh->triangle_count)
            fail_msg("%s: %u of %u below 20 degrees, the least %.1f", healthy->groups[i].name,
                     slivers, mesh->triangle_count, least);
    }
}

static void menisci_have_the_volume_of_the_recipe(void **state) {
    (void)state;
    assert_near(mesh_volume(mesh_of(healthy, "meniscus_medial")), 2400, 5);
    assert_near(mesh_volume(mesh_of(healthy, "meniscus_lateral")), 2400, 5);
    assert_true(case_group(healthy, "meniscus_medial")->cuttable);
    assert_true(case_group(healthy, "meniscus_lateral")->cuttable);
}

// Knee A (left, male) and knee B (right, a young woman), from segmented MRI: femur 81 and 69 mm
// wide, 65 and 64 mm deep, tibia 80 and 72 mm wide, patella 44 and 43 mm wide, 39 and 34 mm
// high, 15.9 and 13.5 cm3, menisci 36 to 42 mm long.
static void sizes_are_those_of_real_knees(void **state) {
    (void)state;
    static const struct {
        const char *group;
        int axis;
        double low, high;
    } rows[] = {
        {"femur", 0, 70, 85},
        {"femur", 1, 58, 68},
        {"femur", 2, 80, 110},
        {"tibia", 0, 70, 85},
        {"tibia", 1, 45, 60},
        {"patella", 0, 38, 48},
        {"patella", 1, 15, 30},
        {"patella", 2, 32, 44},
        {"meniscus_medial", 0, 24, 36},
        {"meniscus_medial", 1, 36, 46},
        {"meniscus_lateral", 0, 24, 38},
        {"meniscus_lateral", 1, 32, 44},
        {"acl", 2, 20, 36},
        {"mcl", 2, 50, 100},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct box box = mesh_bounds(mesh_of(healthy, rows[i].group));
        vec3 size = vec3_sub(box.max, box.min);
        double value = rows[i].axis == 0 ? size.x : rows[i].axis == 1 ? size.y : size.z;
        if (value < rows[i].low || value > rows[i].high)
            fail_msg("%s axis %d: %g mm", rows[i].group, rows[i].axis, value);
    }
    double patella = mesh_volume(mesh_of(healthy, "patella"));
    assert_true(patella > 13000 && patella < 18000);
}

static void femur_and_tibia_stay_in_contact_and_apart_over_flexion(void **state) {
    (void)state;
    const struct mesh *femur = mesh_of(healthy, "femur"), *tibia = mesh_of(healthy, "tibia");
    for (int flexion = 0; flexion <= 120; flexion += 15) {
        pose T = tibia_at(healthy, flexion);
        double gap = clearance(femur, tibia, pose_inverse(T));
        assert_true(gap > 0.3 && gap < 0.45);
        assert_true(clearance(tibia, femur, T) > 0.3);
    }
}

static void menisci_lie_on_the_tibia_and_under_the_femur(void **state) {
    (void)state;
    static const char *const names[] = {"meniscus_medial", "meniscus_lateral"};
    for (int i = 0; i < 2; i++) {
        const struct mesh *meniscus = mesh_of(healthy, names[i]);
        double gap = clearance(meniscus, mesh_of(healthy, "tibia"), pose_identity());
        assert_true(gap > 0.1 && gap < 0.25);
        for (int flexion = 0; flexion <= 120; flexion += 15) {
            gap = clearance(meniscus, mesh_of(healthy, "femur"), tibia_at(healthy, flexion));
            assert_true(gap > 0.2 && gap < 0.5);
        }
    }
}

static void the_patella_glides_on_the_femur_and_never_enters_it(void **state) {
    (void)state;
    const struct mesh *patella = mesh_of(healthy, "patella"), *femur = mesh_of(healthy, "femur");
    for (double flexion = 0; flexion <= 120; flexion += 7.5) {
        pose T_femur_patella = case_patella_pose(healthy, flexion);
        double gap = clearance(patella, femur, T_femur_patella);
        assert_true(gap > 0.2 && gap < 0.8);
        pose T_tibia_patella =
            pose_compose(pose_inverse(tibia_at(healthy, flexion)), T_femur_patella);
        assert_true(clearance(patella, mesh_of(healthy, "tibia"), T_tibia_patella) > 0);
    }
    assert_vec3_near(case_patella_pose(healthy, 0).translation, ((vec3){0}), 1e-9);
}

static void ligaments_go_over_from_the_tibia_to_the_femur(void **state) {
    (void)state;
    static const char *const names[] = {"acl", "pcl", "mcl", "lcl"};
    const struct mesh *tibia = mesh_of(healthy, "tibia"), *femur = mesh_of(healthy, "femur");
    for (int i = 0; i < 4; i++) {
        const struct case_group *ligament = case_group(healthy, names[i]);
        assert_true(ligament->bridges);
        assert_int_equal(ligament->body, BODY_TIBIA);
        assert_int_equal(ligament->other_body, BODY_FEMUR);
        double least = 1, most = 0;
        for (uint32_t v = 0; v < ligament->mesh.vertex_count; v++) {
            double share = ligament->other_share[v];
            vec3 p = mesh_vertex(&ligament->mesh, v);
            least = fmin(least, share);
            most = fmax(most, share);
            if (v % 37 != 0)
                continue; // looking at every triangle takes long
            if (is_inside(tibia, p))
                assert_true(share == 0);
            if (is_inside(femur, p))
                assert_true(share == 1);
        }
        assert_true(least == 0 && most > 0.9);
    }
    assert_false(case_group(healthy, "meniscus_medial")->bridges);
    assert_true(case_group(healthy, "skin")->bridges); // it goes along with both
}

static void portals_lie_in_the_skin_and_lead_inside(void **state) {
    (void)state;
    const struct mesh *skin = mesh_of(healthy, "skin");
    struct query *query;
    assert_int_equal(query_create(skin, &query, NULL), RESULT_OK);
    assert_int_equal(healthy->portal_count, 2);
    for (int i = 0; i < 2; i++) {
        const struct case_portal *portal = &healthy->portals[i];
        struct closest closest;
        assert_true(query_closest(query, portal->position, 1, MESH_NONE, &closest));
        assert_true(closest.distance < 1e-6);
        assert_near(vec3_length(portal->direction), 1, 1e-12);
        bool anterolateral = strcmp(portal->name, "anterolateral") == 0;
        assert_true(anterolateral == (portal->position.x > 0));
        assert_true(is_inside(skin, vec3_add_scaled(portal->position, 5, portal->direction)));
    }
    query_destroy(&query);
}

static void the_skin_holds_the_extended_knee(void **state) {
    (void)state;
    const struct mesh *skin = mesh_of(healthy, "skin");
    for (int i = 0; i < healthy->group_count; i++) {
        const struct mesh *mesh = &healthy->groups[i].mesh;
        for (uint32_t v = 0; mesh != skin && v < mesh->vertex_count; v += 37)
            assert_true(is_inside(skin, mesh_vertex(mesh, v)));
    }
}

// ---- recipes ------------------------------------------------------------------------------------

static void a_left_knee_mirrors_a_right_one(void **state) {
    (void)state;
    struct recipe recipe = standard;
    recipe.side = SIDE_LEFT;
    struct knee_case *left = generate(&recipe);
    for (int i = 0; i < left->group_count; i++) {
        const struct mesh *a = &left->groups[i].mesh, *b = &healthy->groups[i].mesh;
        assert_int_equal(a->vertex_count, b->vertex_count);
        for (uint32_t v = 0; v < a->vertex_count; v++) {
            vec3 p = mesh_vertex(a, v), q = mesh_vertex(b, v);
            assert_true(p.x == -q.x && p.y == q.y && p.z == q.z);
        }
        assert_near(mesh_volume(a), mesh_volume(b), 1e-6 * mesh_volume(b));
    }
    assert_int_equal(left->joint.side, SIDE_LEFT);
    assert_near(left->portals[0].position.x, -healthy->portals[0].position.x, 1e-5);
    pose p = case_patella_pose(left, 60), q = case_patella_pose(healthy, 60);
    vec3 on_left = pose_apply(p, (vec3){-10, 40, 20}), on_right = pose_apply(q, (vec3){10, 40, 20});
    assert_vec3_near(on_left, ((vec3){-on_right.x, on_right.y, on_right.z}), 1e-9);
    assert_sound(left);
    case_destroy(&left);
}

static void every_parameter_at_its_bounds_gives_a_sound_knee(void **state) {
    (void)state;
    struct recipe coarse = standard;
    coarse.resolution_mm = 3;
    struct recipe rows[8];
    for (size_t i = 0; i < 8; i++)
        rows[i] = coarse;
    rows[0].size = 0.8;
    rows[1].size = 1.2;
    rows[2].resolution_mm = 1.2;
    rows[4].meniscus_medial_cm3 = 1.4;
    rows[5].meniscus_medial_cm3 = 2.5;
    rows[6].meniscus_lateral_cm3 = 1.4;
    rows[7].meniscus_lateral_cm3 = 2.5;
    for (size_t i = 0; i < 8; i++) {
        struct knee_case *knee = generate(&rows[i]);
        assert_sound(knee);
        double cube = pow(rows[i].size, 3);
        double medial = mesh_volume(mesh_of(knee, "meniscus_medial"));
        assert_near(medial, 1000 * cube * rows[i].meniscus_medial_cm3, 10);
        for (int flexion = 0; flexion <= 120; flexion += 60) {
            pose T = tibia_at(knee, flexion);
            const struct mesh *femur = mesh_of(knee, "femur");
            assert_true(clearance(femur, mesh_of(knee, "tibia"), pose_inverse(T)) > 0.2);
            assert_true(
                clearance(mesh_of(knee, "patella"), femur, case_patella_pose(knee, flexion)) > 0.1);
            assert_true(clearance(mesh_of(knee, "meniscus_medial"), femur, T) > 0.05);
            assert_true(clearance(mesh_of(knee, "meniscus_lateral"), femur, T) > 0.05);
        }
        case_destroy(&knee);
    }
}

static char *read_all(const char *folder, const char *name, size_t *out_size) {
    char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    char *bytes = malloc(1 << 24);
    *out_size = fread(bytes, 1, 1 << 24, file);
    fclose(file);
    remove(path);
    return bytes;
}

static void the_same_recipe_gives_the_same_bytes(void **state) {
    (void)state;
    char folders[2][FOLDER_MAX];
    struct error err;
    for (int i = 0; i < 2; i++) {
        folder_make(folders[i]);
        struct knee_case *knee = generate(&standard);
        if (case_save(knee, folders[i], &err) != RESULT_OK)
            fail_msg("%s", err.text);
        case_destroy(&knee);
    }
    static const char *const names[] = {"case.json", "anatomy.glb"};
    for (int i = 0; i < 2; i++) {
        size_t a_size, b_size;
        char *a = read_all(folders[0], names[i], &a_size);
        char *b = read_all(folders[1], names[i], &b_size);
        assert_true(a_size > 1000 && a_size == b_size);
        assert_memory_equal(a, b, a_size);
        free(a);
        free(b);
    }
    folder_remove(folders[0]);
    folder_remove(folders[1]);
}

// ---- cavities -----------------------------------------------------------------------------------

static const struct pathology plateau_cavity = {PATHOLOGY_CAVITY, "plateau",
                                                .cavity = {{BODY_TIBIA, {-19, 6, -22}, ""}, 9, 3}};

static void displace(const struct case_group *group, struct mesh *out_mesh) {
    mesh_copy(out_mesh, &group->mesh);
    for (size_t i = 0; group->warp && i < 3 * (size_t)group->mesh.vertex_count; i++)
        out_mesh->positions[i] += group->warp[i];
}

static vec3 normal_of(const struct mesh *mesh, uint32_t t) {
    vec3 a = mesh_corner(mesh, t, 0), b = mesh_corner(mesh, t, 1), c = mesh_corner(mesh, t, 2);
    return vec3_unit_or(vec3_cross(vec3_sub(b, a), vec3_sub(c, a)), (vec3){0});
}

static void a_cavity_is_as_deep_as_asked_and_folds_nothing(void **state) {
    (void)state;
    struct recipe recipe = standard;
    recipe.steps[recipe.step_count++] = plateau_cavity;
    struct knee_case *knee = generate(&recipe);
    const struct case_group *tibia = case_group(knee, "tibia");
    assert_non_null(tibia->warp);
    double deepest = 0;
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++) {
        const float *w = tibia->warp + 3 * (size_t)v;
        deepest = fmax(deepest, vec3_length((vec3){(double)w[0], (double)w[1], (double)w[2]}));
    }
    assert_near(deepest, 3, 1e-4);
    struct mesh displaced;
    displace(tibia, &displaced);
    for (uint32_t t = 0; t < displaced.triangle_count; t++)
        assert_true(vec3_dot(normal_of(&displaced, t), normal_of(&tibia->mesh, t)) > 0.2);
    mesh_fini(&displaced);
    case_destroy(&knee);
}

static void a_meniscus_above_a_cavity_sinks_with_its_tibia(void **state) {
    (void)state;
    struct recipe recipe = standard;
    recipe.steps[recipe.step_count++] = plateau_cavity;
    recipe.steps[0].cavity.place.at = (vec3){-24, 14, -22};
    struct knee_case *knee = generate(&recipe);
    struct mesh tibia, meniscus;
    displace(case_group(knee, "tibia"), &tibia);
    displace(case_group(knee, "meniscus_medial"), &meniscus);
    assert_non_null(case_group(knee, "meniscus_medial")->warp);
    assert_null(case_group(knee, "meniscus_lateral")->warp);
    double gap = clearance(&meniscus, &tibia, pose_identity());
    assert_true(gap > 0 && gap < 0.25);
    assert_true(clearance(&tibia, &meniscus, pose_identity()) > 0);
    mesh_fini(&tibia);
    mesh_fini(&meniscus);
    case_destroy(&knee);
}

static void a_cavity_far_from_its_bone_is_refused(void **state) {
    (void)state;
    struct recipe recipe = standard;
    recipe.resolution_mm = 3;
    recipe.steps[recipe.step_count++] = plateau_cavity;
    recipe.steps[0].cavity.place.at = (vec3){-19, 6, 40};
    struct knee_case *knee;
    struct error err;
    assert_int_equal(generate_knee(&recipe, &knee, &err), RESULT_INVALID);
    assert_null(knee);
    assert_non_null(strstr(err.text, "[cavity plateau]"));
}

static enum result hollow_at(const char *place, struct knee_case *knee, struct error *err) {
    struct pathology step;
    pathology_init(&step, PATHOLOGY_CAVITY, "");
    assert_int_equal(pathology_take(&step, "body", "tibia", NULL), RESULT_OK);
    assert_int_equal(pathology_take(&step, "radius_mm", "9", NULL), RESULT_OK);
    assert_int_equal(pathology_take(&step, "depth_mm", "3", NULL), RESULT_OK);
    assert_int_equal(pathology_take(&step, "at", place, NULL), RESULT_OK);
    assert_int_equal(pathology_check(&step, NULL), RESULT_OK);
    return pathology_apply(knee, &step, 0, err);
}

static void a_cavity_at_a_landmark_is_where_its_numbers_say(void **state) {
    (void)state;
    struct recipe recipe = standard;
    struct error err;
    recipe.resolution_mm = 3;
    struct knee_case *named = generate(&recipe), *numbered = generate(&recipe);
    vec3 at = {19, 6, -22};
    if (named->joint.side == SIDE_LEFT)
        at.x = -at.x;
    struct case_landmark landmark = {
        .name = "here", .body = BODY_TIBIA, .at = pose_apply(named->joint.T_tibia_joint, at)};
    assert_int_equal(case_landmark_set(named, &landmark, NULL), RESULT_OK);
    assert_int_equal(hollow_at("here", named, &err), RESULT_OK);
    assert_int_equal(hollow_at("19 6 -22", numbered, &err), RESULT_OK);
    const struct case_group *a = case_group(named, "tibia"), *b = case_group(numbered, "tibia");
    assert_memory_equal(a->warp, b->warp, 3 * a->mesh.vertex_count * sizeof *a->warp);
    assert_int_equal(hollow_at("there", named, &err), RESULT_MISSING);
    assert_string_equal(err.text, "the case has no landmark there");
    landmark.body = BODY_FEMUR;
    assert_int_equal(case_landmark_set(named, &landmark, NULL), RESULT_OK);
    assert_int_equal(hollow_at("here", named, &err), RESULT_INVALID);
    assert_string_equal(err.text, "here is a landmark of the femur, not of the tibia");
    case_destroy(&named);
    case_destroy(&numbered);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_group_is_one_closed_manifold_oriented_ball),
        cmocka_unit_test(triangles_are_well_shaped),
        cmocka_unit_test(menisci_have_the_volume_of_the_recipe),
        cmocka_unit_test(sizes_are_those_of_real_knees),
        cmocka_unit_test(femur_and_tibia_stay_in_contact_and_apart_over_flexion),
        cmocka_unit_test(menisci_lie_on_the_tibia_and_under_the_femur),
        cmocka_unit_test(the_patella_glides_on_the_femur_and_never_enters_it),
        cmocka_unit_test(ligaments_go_over_from_the_tibia_to_the_femur),
        cmocka_unit_test(portals_lie_in_the_skin_and_lead_inside),
        cmocka_unit_test(the_skin_holds_the_extended_knee),
        cmocka_unit_test(a_left_knee_mirrors_a_right_one),
        cmocka_unit_test(every_parameter_at_its_bounds_gives_a_sound_knee),
        cmocka_unit_test(the_same_recipe_gives_the_same_bytes),
        cmocka_unit_test(a_cavity_is_as_deep_as_asked_and_folds_nothing),
        cmocka_unit_test(a_meniscus_above_a_cavity_sinks_with_its_tibia),
        cmocka_unit_test(a_cavity_far_from_its_bone_is_refused),
        cmocka_unit_test(a_cavity_at_a_landmark_is_where_its_numbers_say),
    };
    return cmocka_run_group_tests(tests, make_healthy, destroy_healthy);
}
