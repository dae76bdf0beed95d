// The generated cases with torn ligaments, through the adaptive warp as a session has it.
#include "generate/generate.h"
#include "motion/joint.h"
#include "motion/motion.h"
#include "test.h"
#include "warp/adaptive.h"

#include <stdio.h>
#include <string.h>

// That a virtual tibia stays off its femur, also where the mock-up is pushed past the keys; 0.4 at
// rest.
#define CLEAR_MM 0.1

struct patient {
    const char *recipe;
    bool opens_medially, glides;
    struct knee_case *knee;
    struct solid femur, tibia; // of the mock-up
    struct adaptive *adaptive;
};

static struct patient patients[] = {
    {"torn-mcl", .opens_medially = true},
    {"torn-acl", .glides = true},
    {"arthrosis-torn-mcl", .opens_medially = true},
    {"everything", .opens_medially = true, .glides = true},
};

#define PATIENT_COUNT (sizeof patients / sizeof *patients)

static void make_adaptive(struct patient *p) {
    struct adaptive_key keys[CASE_KEYS_MAX];
    struct error err = {""};
    for (int i = 0; i < p->knee->key_count; i++)
        keys[i] = (struct adaptive_key){p->knee->keys[i].ligament, p->knee->keys[i].physical,
                                        p->knee->keys[i].target};
    struct adaptive_setup setup = {.kind = ADAPTIVE_HINGE,
                                   .joint = p->knee->joint,
                                   .rest_count = p->knee->rest_count,
                                   .rest = p->knee->rest,
                                   .key_count = p->knee->key_count,
                                   .keys = keys};
    if (adaptive_create(&setup, &p->adaptive, &err) != RESULT_OK)
        fail_msg("%s: %s", p->recipe, err.text);
}

static int make(void **state) {
    (void)state;
    for (size_t i = 0; i < PATIENT_COUNT; i++) {
        struct patient *p = &patients[i];
        static struct recipe recipe;
        struct error err;
        char path[512];
        snprintf(path, sizeof path, "%s/%s", CASES, p->recipe);
        enum result result = recipe_load(path, &recipe, &err);
        recipe.resolution_mm = 2.4; // quicker
        if (result != RESULT_OK || generate_knee(&recipe, &p->knee, &err) != RESULT_OK) {
            print_error("%s: %s\n", p->recipe, err.text);
            return -1;
        }
        solid_init(&p->femur, &case_group(p->knee, "femur")->mesh, NULL);
        solid_init(&p->tibia, &case_group(p->knee, "tibia")->mesh, NULL);
        make_adaptive(p);
    }
    return 0;
}

static int destroy(void **state) {
    (void)state;
    for (size_t i = 0; i < PATIENT_COUNT; i++) {
        adaptive_destroy(&patients[i].adaptive);
        solid_fini(&patients[i].femur);
        solid_fini(&patients[i].tibia);
        case_destroy(&patients[i].knee);
    }
    return 0;
}

static pose held(const struct patient *p, struct joint_hold hold) {
    struct joint_angles angles = motion_joint(p->knee, &p->femur, &p->tibia, &hold);
    return joint_to_pose(&p->knee->joint, &angles);
}

static pose seen(const struct patient *p, pose A) {
    struct adaptive_warp warp;
    adaptive_at(p->adaptive, ADAPTIVE_RAMP_STRAIGHT, A, &warp);
    return pose_compose(warp.correction, A);
}

// mm, of points around the joint
static double apart(pose a, pose b) {
    double most = 0;
    for (int i = 0; i < 8; i++) {
        vec3 corner = {i & 1 ? 40 : -40, i & 2 ? 40 : -40, i & 4 ? 40 : -40};
        most = fmax(most, vec3_distance(pose_apply(a, corner), pose_apply(b, corner)));
    }
    return most;
}

static void every_key_is_met(void **state) {
    (void)state;
    for (size_t i = 0; i < PATIENT_COUNT; i++) {
        struct patient *p = &patients[i];
        struct error err = {""};
        assert_int_equal(p->knee->torn_count, p->opens_medially + p->glides);
        assert_int_equal(p->knee->key_count, 3 * p->knee->torn_count);
        assert_int_equal(case_validate(p->knee, &err), RESULT_OK);
        if (adaptive_check(p->adaptive, &err) != RESULT_OK)
            fail_msg("%s: %s", p->recipe, err.text);
        for (int k = 0; k < p->knee->key_count; k++)
            assert_near(apart(seen(p, p->knee->keys[k].physical), p->knee->keys[k].target), 0,
                        1e-9);
    }
}

// A ligament is torn on a knee whose rest path leaves the joint's axes: its keys open from there.
static void keys_open_from_the_rest_path(void **state) {
    (void)state;
    struct patient p = {.recipe = "healthy"};
    struct recipe recipe;
    struct error err = {""};
    struct pathology tear = {.kind = PATHOLOGY_LIGAMENT,
                             .name = "mcl",
                             .ligament = {.flexion_deg = {3, {30, 60, 90}},
                                          .valgus_deg = {1, {5}},
                                          .extra_valgus_deg = {1, {6}}}};
    assert_int_equal(recipe_load(CASES "/healthy", &recipe, &err), RESULT_OK);
    recipe.resolution_mm = 3;
    assert_int_equal(generate_knee(&recipe, &p.knee, &err), RESULT_OK);
    for (int i = 0; i <= 4; i++) {
        struct joint_angles key = {30 * i, 0.4 * i, -0.5 * i, 0, 0.2 * i, 0.1 * i};
        p.knee->rest[p.knee->rest_count++] = joint_to_pose(&p.knee->joint, &key);
    }
    assert_int_equal(pathology_apply(p.knee, &tear, 0, &err), RESULT_OK);
    make_adaptive(&p);
    if (adaptive_check(p.adaptive, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    for (int k = 0; k < p.knee->key_count; k++) {
        const struct case_key *key = &p.knee->keys[k];
        struct joint_angles physical = joint_from_pose(&p.knee->joint, key->physical);
        struct joint_angles target = joint_from_pose(&p.knee->joint, key->target);
        assert_near(physical.varus_deg, 0.4 * (k + 1) - 5, 1e-9);
        assert_near(target.varus_deg, 0.4 * (k + 1) - 11, 1e-9);
        assert_near(apart(seen(&p, key->physical), key->target), 0, 1e-9);
    }
    for (int i = 0; i < p.knee->rest_count; i++)
        assert_near(apart(seen(&p, p.knee->rest[i]), p.knee->rest[i]), 0, 1e-9);
    adaptive_destroy(&p.adaptive);
    case_destroy(&p.knee);
}

static void keys_are_what_the_recipe_says(void **state) {
    (void)state;
    static const double flexion[] = {15, 45, 65, 30, 60, 90};
    static const double drawer[] = {6, 4.7, 3.7}, more[] = {6.9, 4.7, 4};
    struct knee_case *knee = patients[3].knee;
    assert_string_equal(knee->torn[0], "mcl");
    assert_string_equal(knee->torn[1], "acl");
    for (int i = 0; i < 6; i++) {
        struct joint_angles a = joint_from_pose(&knee->joint, knee->keys[i].physical);
        struct joint_angles b = joint_from_pose(&knee->joint, knee->keys[i].target);
        assert_near(a.flexion_deg, flexion[i], 1e-9);
        assert_near(b.flexion_deg, flexion[i], 1e-9);
        assert_near(a.varus_deg, i < 3 ? -5 : 0, 1e-9);
        assert_near(b.varus_deg, i < 3 ? -15 : 0, 1e-9);
        assert_near(a.drawer_mm, i < 3 ? 0 : drawer[i - 3], 1e-9);
        assert_near(b.drawer_mm, i < 3 ? 0 : drawer[i - 3] + more[i - 3], 1e-9);
    }
}

static void nothing_is_moved_at_rest(void **state) {
    (void)state;
    for (size_t i = 0; i < PATIENT_COUNT; i++)
        for (int tenth = 0; tenth <= 1200; tenth++) {
            pose rest = held(&patients[i], (struct joint_hold){.flexion_deg = tenth / 10.0});
            assert_near(apart(seen(&patients[i], rest), rest), 0, 1e-9);
        }
}

static void one_ligament_does_not_open_the_other(void **state) {
    (void)state;
    struct patient *p = &patients[3];
    for (int k = 0; k < p->knee->key_count; k++) {
        struct adaptive_warp warp;
        adaptive_at(p->adaptive, ADAPTIVE_RAMP_STRAIGHT, p->knee->keys[k].physical, &warp);
        int own = p->knee->keys[k].ligament;
        assert_near(warp.opening[own], 1, 1e-9);
        assert_near(warp.share[!own], 0, 1e-9);
    }
    for (double flexion = 0; flexion <= 120; flexion += 7.5) {
        struct adaptive_warp valgus, drawer;
        adaptive_at(p->adaptive, ADAPTIVE_RAMP_STRAIGHT,
                    held(p, (struct joint_hold){flexion, 5, 0, 0}), &valgus);
        adaptive_at(p->adaptive, ADAPTIVE_RAMP_STRAIGHT,
                    held(p, (struct joint_hold){flexion, 0, 0, 6}), &drawer);
        assert_near(valgus.opening[0], 1, 0.01); // the keys say 5 degrees at every flexion
        assert_near(valgus.share[1], 0, 1e-4);
        assert_near(drawer.share[0], 0, 1e-4);
        assert_true(drawer.opening[1] > 0.99 && drawer.opening[1] < 1.7); // 6 down to 3.7 mm
    }
}

static void two_torn_ligaments_give_way_together(void **state) {
    (void)state;
    struct patient *p = &patients[3];
    pose both = held(p, (struct joint_hold){30, 5, 0, 6});
    struct joint_angles a = joint_from_pose(&p->knee->joint, both);
    struct joint_angles b = joint_from_pose(&p->knee->joint, seen(p, both));
    assert_near(b.varus_deg - a.varus_deg, -10, 0.1);
    assert_near(b.drawer_mm - a.drawer_mm, 6.9, 0.2);
}

static void the_stress_motion_takes_each_ligament_to_its_end_and_not_past_it(void **state) {
    (void)state;
    struct patient *p = &patients[3];
    struct motion_script script;
    struct motion motion;
    struct error err = {""};
    if (motion_script_load(CASES "/motions/stress.ini", &script, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    script.rate_hz = 20; // quicker
    if (motion_plan(p->knee, &script, &motion, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    double most[2] = {0};
    for (size_t i = 0; i < motion.row_count; i++) {
        struct adaptive_warp warp;
        adaptive_at(p->adaptive, ADAPTIVE_RAMP_STRAIGHT,
                    joint_to_pose(&p->knee->joint, &motion.rows[i].joint), &warp);
        for (int ligament = 0; ligament < 2; ligament++)
            most[ligament] = fmax(most[ligament], warp.opening[ligament]);
    }
    assert_near(most[0], 1, 1e-3);
    assert_near(most[1], 1, 1e-3);
    motion_fini(&motion);
}

// ---- what the trainee sees ----------------------------------------------------------------------

struct virtual_bones {
    struct mesh femur_mesh, tibia_mesh;
    struct solid femur, tibia;
};

static void bones_init(struct virtual_bones *bones, struct knee_case *knee) {
    case_group_virtual(case_group(knee, "femur"), &bones->femur_mesh);
    case_group_virtual(case_group(knee, "tibia"), &bones->tibia_mesh);
    solid_init(&bones->femur, &bones->femur_mesh, NULL);
    solid_init(&bones->tibia, &bones->tibia_mesh, NULL);
}

static void bones_fini(struct virtual_bones *bones) {
    solid_fini(&bones->femur);
    solid_fini(&bones->tibia);
    mesh_fini(&bones->femur_mesh);
    mesh_fini(&bones->tibia_mesh);
}

static double gap(const struct mesh *mesh, const struct solid *solid, pose T_solid_mesh) {
    double least = INFINITY;
    uint32_t hint = MESH_NONE;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = pose_apply(T_solid_mesh, mesh_vertex(mesh, v));
        vec3 at = mesh_vertex(mesh, v);
        if (hypot(at.y, at.z) < 32) // of the flexion axis
            least = fmin(least, solid_distance(solid, p, &hint));
    }
    return least;
}

// The least of both bones' vertices from the other bone; negative inside.
static double bones_gap(const struct virtual_bones *bones, pose T_femur_tibia) {
    return fmin(gap(&bones->tibia_mesh, &bones->femur, T_femur_tibia),
                gap(&bones->femur_mesh, &bones->tibia, pose_inverse(T_femur_tibia)));
}

static void the_virtual_tibia_stays_out_of_the_femur(void **state) {
    (void)state;
    for (size_t i = 0; i < PATIENT_COUNT; i++) {
        struct patient *p = &patients[i];
        struct virtual_bones bones;
        bones_init(&bones, p->knee);
        for (double flexion = 0; flexion <= 120; flexion += 24)
            for (int way = 1; way <= 4; way++) {
                bool valgus = p->opens_medially, drawer = p->glides;
                struct joint_hold hold = {.flexion_deg = flexion,
                                          .valgus_deg = valgus * 8 * way / 4.0,
                                          .drawer_mm = drawer * 10 * way / 4.0};
                double clear = bones_gap(&bones, seen(p, held(p, hold)));
                if (!(clear > CLEAR_MM))
                    fail_msg("%s: %g mm at %g degrees of flexion, valgus %g, drawer %g", p->recipe,
                             clear, hold.flexion_deg, hold.valgus_deg, hold.drawer_mm);
            }
        bones_fini(&bones);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_key_is_met),
        cmocka_unit_test(keys_open_from_the_rest_path),
        cmocka_unit_test(keys_are_what_the_recipe_says),
        cmocka_unit_test(nothing_is_moved_at_rest),
        cmocka_unit_test(one_ligament_does_not_open_the_other),
        cmocka_unit_test(two_torn_ligaments_give_way_together),
        cmocka_unit_test(the_stress_motion_takes_each_ligament_to_its_end_and_not_past_it),
        cmocka_unit_test(the_virtual_tibia_stays_out_of_the_femur),
    };
    return cmocka_run_group_tests(tests, make, destroy);
}
