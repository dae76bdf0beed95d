#include "landmarks/landmarks.h"

#include "folder.h"
#include "generate/shape.h"
#include "generate/tube.h"
#include "generated.h"
#include "mesh/solid.h"
#include "scene/moved_knee.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct knee_case *made(enum side side, double size) {
    struct recipe recipe = {.name = "test",
                            .title = "Test",
                            .side = side,
                            .size = size,
                            .resolution_mm = 2.4,
                            .meniscus_medial_cm3 = 2.4,
                            .meniscus_lateral_cm3 = 2.4};
    struct knee_case *knee;
    struct error err;
    if (generate_knee(&recipe, &knee, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return knee;
}

// A frame that is some degrees and millimetres off, as an import guesses it.
static void spoil_joint(struct knee_case *knee) {
    vec3 axis = vec3_unit_or((vec3){0, 1, -0.7}, (vec3){0});
    pose off = {quat_from_axis_angle(axis, 8 * RAD_PER_DEG), {2, -4, 5}};
    knee->joint.T_femur_joint = pose_compose(knee->joint.T_femur_joint, off);
    knee->joint.T_tibia_joint = knee->joint.T_femur_joint;
}

static vec3 found(const struct knee_case *knee, const char *name) {
    const struct case_landmark *landmark = case_landmark(knee, name);
    if (!landmark)
        fail_msg("no landmark %s", name);
    return landmark->at;
}

// In the right knee of size 1 that the recipe's shapes describe.
static vec3 as_described(const struct knee_case *knee, const char *name, double size) {
    vec3 p = vec3_scale(1 / size, found(knee, name));
    return (vec3){knee->joint.side == SIDE_LEFT ? -p.x : p.x, p.y, p.z};
}

static void assert_place(vec3 a, vec3 b, double within, const char *what) {
    if (!(vec3_distance(a, b) < within))
        fail_msg("%s: %.2f %.2f %.2f is %.2f mm from %.2f %.2f %.2f", what, a.x, a.y, a.z,
                 vec3_distance(a, b), b.x, b.y, b.z);
}

static void find_all(struct knee_case *knee) {
    struct error err;
    if (landmarks_find(knee, NULL, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

// ---- the joint ----------------------------------------------------------------------------------

static void the_fit_finds_the_axis_that_the_condyles_were_made_round(void **state) {
    (void)state;
    static const double sizes[] = {0.8, 1, 1.2};
    for (int i = 0; i < 3; i++) {
        struct knee_case *knee = made(i % 2 ? SIDE_LEFT : SIDE_RIGHT, sizes[i]);
        double lateral = i % 2 ? -1 : 1, size = sizes[i];
        struct joint_fit fit;
        struct error err;
        spoil_joint(knee);
        assert_int_equal(landmarks_fit_joint(knee, &fit, &err), RESULT_OK);
        for (int side = 0; side < COMPARTMENT_COUNT; side++) {
            double x = (side == COMPARTMENT_LATERAL ? 1 : -1) * lateral * SHAPE_CONDYLE_X * size;
            assert_place(fit.condyles[side].centre, (vec3){x, 0, 0}, 0.5, "a condyle's centre");
            assert_true(fabs(fit.condyles[side].radius_mm - SHAPE_CONDYLE_RADIUS * size) < 0.5);
            assert_true(fit.condyles[side].rms_mm < 0.1);
        }
        vec3 axis = quat_rotate(fit.T_femur_joint.rotation, (vec3){1, 0, 0});
        assert_true(axis.x > cos(0.5 * RAD_PER_DEG));
        assert_place(fit.T_femur_joint.translation, (vec3){0}, 0.5, "the joint's centre");
        assert_true(fabs(fit.turned_deg - 8) < 0.5 &&
                    fabs(fit.moved_mm - hypot(hypot(2, 4), 5)) < 0.5);
        case_destroy(&knee);
    }
}

static void a_femur_without_condyles_is_refused(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct joint_fit fit;
    struct error err;
    knee->joint.T_femur_joint.rotation = quat_from_axis_angle((vec3){0, 1, 0}, 3.1415926);
    assert_int_equal(landmarks_fit_joint(knee, &fit, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "posterior condyles"));
    case_destroy(&knee);
}

static void condyles_that_are_not_round_are_refused(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct mesh *femur = &case_group(knee, "femur")->mesh;
    struct joint_fit fit;
    struct error err;
    for (uint32_t v = 0; v < femur->vertex_count; v++) {
        vec3 p = mesh_vertex(femur, v);
        double wave = 1 + 0.25 * sin(6 * atan2(p.y, p.z));
        if (hypot(p.y, p.z) < 30)
            mesh_set_vertex(femur, v, (vec3){p.x, wave * p.y, wave * p.z});
    }
    assert_int_equal(landmarks_fit_joint(knee, &fit, &err), RESULT_INVALID);
    case_destroy(&knee);
}

// ---- places -------------------------------------------------------------------------------------

// As server/generate/tube.c draws the menisci: the middle of the C at a share of its way.
static vec3 drawn_meniscus(bool lateral, double along) {
    double angle = lateral ? 142 - 288 * along : 130 - 270 * along;
    double c = cos(angle * RAD_PER_DEG), s = sin(angle * RAD_PER_DEG);
    double width = (lateral ? 9 : 9.5) * c * c + (lateral ? 11 : 12) * s * s;
    width *= 1 - 0.3 * pow(2 * along - 1, 4);
    double outer = hypot(16 * c, (lateral ? 20 : 20.5) * s), scale = 1 - 0.5 * width / outer;
    double x = (lateral ? 21 : -21) + (lateral ? 1 : -1) * scale * 16 * c;
    double y = -1 + scale * (lateral ? 20 : 20.5) * s;
    return (vec3){x, y, shape_plateau(x, y) + 1.2};
}

// The deepest place of the trochlea's groove: the femur's most anterior one in the middle.
static vec3 drawn_trochlea(void) {
    vec3 best = {0};
    for (double z = 0; z < 20; z += 0.05) {
        double low = 15, high = 45;
        for (int i = 0; i < 30; i++) {
            double middle = (low + high) / 2;
            *(shape_femur((vec3){0, middle, z}) < 0 ? &low : &high) = middle;
        }
        if (low > best.y)
            best = (vec3){0, low, z};
    }
    return best;
}

// By its name: "acl_femur" is the femur's, "acl_tibia" the tibia's, as are all of the menisci.
static enum body body_of(const char *name) {
    if (strcmp(name, "patella") == 0)
        return BODY_PATELLA;
    bool femur = strstr(name, "_femur") || strstr(name, "condyle") || strcmp(name, "notch") == 0 ||
                 strcmp(name, "trochlea") == 0;
    return femur ? BODY_FEMUR : BODY_TIBIA;
}

static void check_places(const struct knee_case *knee, double size) {
    static const struct {
        const char *name;
        double along;
    } menisci[] = {{"root_anterior", 0},
                   {"horn_anterior", 0.15},
                   {"body", 0.5},
                   {"horn_posterior", 0.85},
                   {"root_posterior", 1}};
    for (int lateral = 0; lateral < 2; lateral++) {
        double side = lateral ? 1 : -1;
        const char *word = lateral ? "lateral" : "medial";
        char name[CASE_NAME_MAX];
        snprintf(name, sizeof name, "condyle_%s", word);
        assert_place(as_described(knee, name, size),
                     (vec3){side * SHAPE_CONDYLE_X, 0, -SHAPE_CONDYLE_RADIUS}, 0.7, name);
        snprintf(name, sizeof name, "plateau_%s", word);
        assert_place(as_described(knee, name, size),
                     (vec3){side * 21, -1, shape_plateau(side * 21, -1)}, 2, name);
        for (int i = 0; i < 5; i++) {
            snprintf(name, sizeof name, "%s_%s", menisci[i].name, word);
            assert_place(as_described(knee, name, size), drawn_meniscus(lateral, menisci[i].along),
                         3.5, name);
        }
    }
    for (int i = 0; i < LIGAMENT_COUNT; i++) {
        if (strcmp(ligaments[i].name, "acl") != 0 && strcmp(ligaments[i].name, "pcl") != 0)
            continue;
        char name[CASE_NAME_MAX];
        snprintf(name, sizeof name, "%s_femur", ligaments[i].name);
        assert_place(as_described(knee, name, size), ligaments[i].path[0], 3, name);
        snprintf(name, sizeof name, "%s_tibia", ligaments[i].name);
        assert_place(as_described(knee, name, size), ligaments[i].path[3], 3, name);
    }
    vec3 notch = as_described(knee, "notch", size);
    assert_true(fabs(notch.x) < 0.7 && fabs(shape_femur(notch)) < 0.5 && notch.z > -20);
    assert_place(as_described(knee, "trochlea", size), drawn_trochlea(), 1.5, "trochlea");
    assert_true(shape_patella(vec3_add(as_described(knee, "patella", size), (vec3){0, 1, 0})) < -6);
}

static void landmarks_are_where_the_recipe_put_them(void **state) {
    (void)state;
    static const double sizes[] = {0.85, 1, 1.15};
    for (int i = 0; i < 3; i++) {
        struct knee_case *knee = made(i % 2 ? SIDE_LEFT : SIDE_RIGHT, sizes[i]);
        spoil_joint(knee);
        find_all(knee);
        check_places(knee, sizes[i]);
        for (int k = 0; k < knee->landmark_count; k++)
            assert_int_equal(knee->landmarks[k].body, body_of(knee->landmarks[k].name));
        case_destroy(&knee);
    }
}

static void landmarks_go_with_a_knee_that_is_moved_or_mirrored(void **state) {
    (void)state;
    vec3 axis = vec3_unit_or((vec3){1, 2, -0.5}, (vec3){0});
    pose T = {quat_from_axis_angle(axis, 1.1), {900, -1200, 300}};
    for (int mirror = 0; mirror < 2; mirror++) {
        struct knee_case *knee = made(SIDE_RIGHT, 1), *moved = made(SIDE_RIGHT, 1);
        find_all(knee);
        move_knee(moved, T, mirror);
        find_all(moved);
        assert_int_equal(moved->landmark_count, knee->landmark_count);
        for (int i = 0; i < knee->landmark_count; i++) {
            const struct case_landmark *l = &knee->landmarks[i];
            assert_place(found(moved, l->name), moved_point(l->at, T, mirror), 0.05, l->name);
        }
        case_destroy(&knee);
        case_destroy(&moved);
    }
}

static void a_landmark_by_hand_stays(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct error err;
    struct case_landmark given = {
        .name = "notch", .body = BODY_TIBIA, .at = {1, 2, 3}, .by_hand = true};
    assert_int_equal(case_landmark_set(knee, &given, &err), RESULT_OK);
    find_all(knee);
    assert_place(found(knee, "notch"), given.at, 1e-12, "notch");
    find_all(knee); // again: nothing is there twice
    for (int i = 0; i < knee->landmark_count; i++)
        assert_ptr_equal(case_landmark(knee, knee->landmarks[i].name), &knee->landmarks[i]);
    case_destroy(&knee);
}

static void feet_of_ligaments_without_a_mesh_are_proposed(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    for (int i = 0; i < knee->group_count; i++)
        if (strcmp(knee->groups[i].name, "acl") == 0 || strcmp(knee->groups[i].name, "pcl") == 0)
            knee->groups[i].name[0] = 'x';
    find_all(knee);
    for (int i = 0; i < 2; i++) {
        assert_place(found(knee, i ? "pcl_tibia" : "acl_tibia"), ligaments[i].path[3], 8, "foot");
        assert_place(found(knee, i ? "pcl_femur" : "acl_femur"), ligaments[i].path[0], 8, "foot");
    }
    assert_true(case_landmark(knee, "acl_tibia")->error_mm >= 3);
    case_destroy(&knee);
}

// ---- paths --------------------------------------------------------------------------------------

// The deepest that a vertex of one mesh lies inside the other.
static double overlap(const struct mesh *mesh, const struct solid *solid, pose T_mesh_solid) {
    double least = INFINITY;
    uint32_t hint = MESH_NONE;
    for (uint32_t v = 0; v < mesh->vertex_count; v += 2)
        least = fmin(
            least,
            solid_distance(solid, pose_apply_inverse(T_mesh_solid, mesh_vertex(mesh, v)), &hint));
    return -least;
}

// About an axis that is some millimetres off, the femur goes into the tibia as the knee bends.
static void the_path_keeps_bones_apart_where_the_axis_does_not(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_LEFT, 1);
    struct path_fit fit = {0};
    struct solid tibia, patella;
    struct error err;
    knee->patella_key_count = 0;
    knee->joint.T_femur_joint.translation = (vec3){0, 6, -3};
    knee->joint.T_tibia_joint = knee->joint.T_femur_joint;
    assert_int_equal(solid_init(&tibia, &case_group(knee, "tibia")->mesh, &err), RESULT_OK);
    assert_int_equal(solid_init(&patella, &case_group(knee, "patella")->mesh, &err), RESULT_OK);
    assert_int_equal(landmarks_fit_rest(knee, &fit, &err), RESULT_OK);
    assert_true(isnan(fit.points[3].patella_gap_mm)); // the patella's path is not asked for
    assert_int_equal(landmarks_fit_patella(knee, &fit, &err), RESULT_OK);
    const struct mesh *femur = &case_group(knee, "femur")->mesh;
    double worst_axis = 0;
    for (double flexion = 0; flexion <= 120; flexion += 12) {
        struct joint_angles axis = {.flexion_deg = flexion}, rest = case_rest(knee, flexion);
        worst_axis = fmax(worst_axis, overlap(femur, &tibia, joint_to_pose(&knee->joint, &axis)));
        assert_true(overlap(femur, &tibia, joint_to_pose(&knee->joint, &rest)) < -0.25);
        assert_true(overlap(femur, &tibia, joint_to_pose(&knee->joint, &rest)) > -0.6);
        pose T = case_patella_pose(knee, flexion);
        assert_true(overlap(femur, &patella, T) < -0.2 && overlap(femur, &patella, T) > -0.8);
        double turned = quat_angle(quat_identity(), T.rotation) * DEG_PER_RAD;
        assert_true(fabs(turned - flexion / 2) < 1e-6);
        double below = quat_rotate(T.rotation, (vec3){0, 1, 0}).z; // its front turns distally
        assert_true(fabs(below + sin(flexion / 2 * RAD_PER_DEG)) < 0.02);
    }
    assert_true(worst_axis > 2);
    for (int i = 0; i < fit.count; i++)
        for (int side = 0; side < COMPARTMENT_COUNT; side++)
            assert_true(fabs(fit.points[i].gap_mm[side] - SHAPE_CONTACT_GAP) < 0.1);
    solid_fini(&tibia);
    solid_fini(&patella);
    case_destroy(&knee);
}

// Of a scan whose bones nearly touch: tibia and patella come 0.4 mm nearer to the femur.
static void gaps_that_are_too_small_are_opened(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct mesh *tibia_mesh = &case_group(knee, "tibia")->mesh;
    struct mesh *patella_mesh = &case_group(knee, "patella")->mesh;
    const struct mesh *femur = &case_group(knee, "femur")->mesh;
    struct path_fit fit = {0};
    struct solid tibia, patella;
    struct error err;
    for (uint32_t v = 0; v < tibia_mesh->vertex_count; v++)
        mesh_set_vertex(tibia_mesh, v, vec3_add(mesh_vertex(tibia_mesh, v), (vec3){0, 0, 0.4}));
    for (uint32_t v = 0; v < patella_mesh->vertex_count; v++)
        mesh_set_vertex(patella_mesh, v,
                        vec3_add(mesh_vertex(patella_mesh, v), (vec3){0, -0.4, 0}));
    assert_ok(landmarks_fit_rest(knee, &fit, &err));
    assert_ok(landmarks_fit_patella(knee, &fit, &err));
    assert_ok(solid_init(&tibia, tibia_mesh, &err));
    assert_ok(solid_init(&patella, patella_mesh, &err));
    for (double flexion = 0; flexion <= 120; flexion += 40) {
        struct joint_angles rest = case_rest(knee, flexion);
        double gap = -overlap(femur, &tibia, joint_to_pose(&knee->joint, &rest));
        double patella_gap = -overlap(femur, &patella, case_patella_pose(knee, flexion));
        assert_true(gap > 0.15 && gap < 0.35);
        assert_true(patella_gap > 0.2 && patella_gap < 0.5);
    }
    solid_fini(&tibia);
    solid_fini(&patella);
    case_destroy(&knee);
}

static void portals_are_in_the_skin_with_a_clear_way_to_the_notch(void **state) {
    (void)state;
    for (int side = 0; side < 2; side++) {
        struct knee_case *knee = made(side ? SIDE_LEFT : SIDE_RIGHT, 1);
        double clear[2], lateral = side ? -1 : 1;
        struct solid skin, femur;
        struct error err;
        knee->portal_count = 0;
        find_all(knee);
        assert_int_equal(landmarks_find_portals(knee, clear, &err), RESULT_OK);
        assert_int_equal(knee->portal_count, 2);
        assert_int_equal(solid_init(&skin, &case_group(knee, "skin")->mesh, &err), RESULT_OK);
        assert_int_equal(solid_init(&femur, &case_group(knee, "femur")->mesh, &err), RESULT_OK);
        for (int i = 0; i < 2; i++) {
            const struct case_portal *portal = &knee->portals[i];
            uint32_t hint = MESH_NONE;
            assert_string_equal(portal->name, i ? "anteromedial" : "anterolateral");
            assert_true((i ? -1 : 1) * lateral * portal->position.x > 8);
            assert_true(portal->position.y > 30 && portal->direction.y < -0.7);
            assert_true(fabs(solid_distance(&skin, portal->position, &hint)) < 0.01);
            vec3 inside = vec3_add_scaled(portal->position, 40, portal->direction);
            assert_true(solid_depth(&femur, portal->position, inside) == 0);
            assert_true(clear[i] > 1);
        }
        solid_fini(&skin);
        solid_fini(&femur);
        case_destroy(&knee);
    }
}

// A patella that covers the whole front: every way leads through it, and the clearance says how
// deep.
static void portals_that_no_free_way_leads_from_are_told(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct mesh *patella = &case_group(knee, "patella")->mesh;
    struct error err;
    double clear[2];
    for (uint32_t v = 0; v < patella->vertex_count; v++) {
        vec3 p = mesh_vertex(patella, v);
        mesh_set_vertex(patella, v, (vec3){4 * p.x, p.y, 4 * p.z - 60});
    }
    knee->patella_key_count = 0;
    find_all(knee);
    assert_ok(landmarks_find_portals(knee, clear, &err));
    assert_true(clear[0] < -2 && clear[1] < -2);
    case_destroy(&knee);
}

// ---- files --------------------------------------------------------------------------------------

static void landmarks_are_kept_in_the_case(void **state) {
    (void)state;
    char folder[FOLDER_MAX];
    struct knee_case *knee = made(SIDE_RIGHT, 1), *again;
    struct error err;
    folder_make(folder);
    find_all(knee);
    knee->landmarks[3].by_hand = true;
    assert_int_equal(case_save(knee, folder, &err), RESULT_OK);
    assert_int_equal(case_load(folder, NULL, &again, &err), RESULT_OK);
    assert_int_equal(again->landmark_count, knee->landmark_count);
    for (int i = 0; i < knee->landmark_count; i++) {
        const struct case_landmark *a = &knee->landmarks[i], *b = &again->landmarks[i];
        assert_string_equal(a->name, b->name);
        assert_int_equal(a->body, b->body);
        assert_int_equal(a->by_hand, b->by_hand);
        assert_true(a->error_mm == b->error_mm);
        assert_place(a->at, b->at, 1e-12, a->name);
    }
    case_destroy(&knee);
    case_destroy(&again);
    folder_remove(folder);
}

static void a_case_with_a_bad_landmark_is_refused(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct error err;
    find_all(knee);
    knee->landmarks[1].at.y = NAN;
    assert_int_equal(case_validate(knee, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, knee->landmarks[1].name));
    knee->landmarks[1].at.y = 0;
    strcpy(knee->landmarks[1].name, knee->landmarks[0].name);
    assert_int_equal(case_validate(knee, &err), RESULT_INVALID);
    case_destroy(&knee);
}

// As a scan of which the tibia is 40 mm to the side.
static void a_tibia_that_lies_beside_the_femur_has_no_plateau(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct mesh *tibia = &case_group(knee, "tibia")->mesh;
    struct landmarks_notes notes = {0};
    double clear[2];
    struct error err;
    for (int i = 0; i < knee->group_count; i++)
        if (strcmp(knee->groups[i].name, "acl") == 0 || strcmp(knee->groups[i].name, "pcl") == 0)
            knee->groups[i].name[0] = 'x';
    for (uint32_t v = 0; v < tibia->vertex_count; v++)
        mesh_set_vertex(tibia, v, vec3_add(mesh_vertex(tibia, v), (vec3){50, 0, 0}));
    assert_ok(landmarks_find(knee, &notes, &err));
    assert_null(case_landmark(knee, "plateau_medial"));
    assert_non_null(case_landmark(knee, "notch"));
    assert_non_null(strstr(notes.texts[0], "plateau_medial is not found"));
    assert_int_equal(landmarks_find_portals(knee, clear, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "plateau_medial is not known"));
    case_destroy(&knee);
}

static void a_meniscus_that_is_no_c_is_named(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct landmarks_notes notes = {0};
    struct error err;
    tissue_set_kind(&case_group(knee, "meniscus_medial")->tissue, TISSUE_OTHER);
    case_group(knee, "patella")->tissue = tissue_usual("meniscus_medial");
    assert_ok(landmarks_find(knee, &notes, &err));
    assert_int_equal(notes.count, 1);
    assert_non_null(strstr(notes.texts[0], "patella are found: not a C in plan"));
    case_destroy(&knee);
}

static double to_vertices(const struct mesh *mesh, vec3 p) {
    double least = INFINITY;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        least = fmin(least, vec3_distance(p, mesh_vertex(mesh, v)));
    return least;
}

static void leave_out_roof(struct mesh *femur, double front) {
    uint32_t kept = 0;
    for (uint32_t t = 0; t < femur->triangle_count; t++) {
        vec3 p = mesh_corner(femur, t, 0);
        if (fabs(p.x) < 10 && p.y < front && p.z > -14)
            continue;
        memmove(femur->triangles + 3 * (size_t)kept, femur->triangles + 3 * (size_t)t,
                3 * sizeof *femur->triangles);
        kept++;
    }
    femur->triangle_count = kept;
}

// As a scan of the cartilage alone.
static void the_notch_of_a_sheet_is_where_its_roof_begins(void **state) {
    (void)state;
    for (double front = 6; front <= 12; front += 3) {
        struct knee_case *knee = made(SIDE_RIGHT, 1);
        struct mesh *femur = &case_group(knee, "femur")->mesh;
        leave_out_roof(femur, front);
        find_all(knee);
        vec3 notch = case_landmark(knee, "notch")->at;
        assert_true(notch.y > front - 3 && notch.y < front + 3);
        assert_true(to_vertices(femur, notch) < 2);
        case_destroy(&knee);
    }
}

// A shaft does not come so steeply through a portal that the scope looks up into it.
static void the_notch_of_a_high_roof_is_where_it_comes_down(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct mesh *femur = &case_group(knee, "femur")->mesh;
    for (uint32_t v = 0; v < femur->vertex_count; v++) {
        vec3 p = mesh_vertex(femur, v);
        if (fabs(p.x) < 8 && p.y > -12 && p.y < 9 && p.z > -14 && p.z < 8)
            mesh_set_vertex(femur, v, vec3_add(p, (vec3){0, 0, 15}));
    }
    find_all(knee);
    vec3 notch = case_landmark(knee, "notch")->at;
    assert_true(notch.y > 8 && notch.z < -3);
    assert_true(to_vertices(femur, notch) < 3);
    case_destroy(&knee);
}

// As a sheet of a scan that ends below the axis.
static void a_femur_of_posterior_condyles_alone_has_no_rest_path(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct mesh *femur = &case_group(knee, "femur")->mesh;
    struct path_fit fit = {0};
    struct error err;
    uint32_t kept = 0;
    for (uint32_t t = 0; t < femur->triangle_count; t++) {
        vec3 p = mesh_corner(femur, t, 0);
        if (p.y < -14 && p.z > -9 && p.z < 20) {
            memmove(femur->triangles + 3 * (size_t)kept, femur->triangles + 3 * (size_t)t,
                    3 * sizeof *femur->triangles);
            kept++;
        }
    }
    femur->triangle_count = kept;
    assert_int_equal(landmarks_fit_rest(knee, &fit, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "degrees of flexion"));
    case_destroy(&knee);
}

static void a_notch_far_from_the_bones_gives_no_portals(void **state) {
    (void)state;
    struct knee_case *knee = made(SIDE_RIGHT, 1);
    struct case_landmark far = {.name = "notch", .at = {200, 0, 0}, .by_hand = true};
    int portal_count = knee->portal_count;
    double clear[2];
    struct error err;
    assert_ok(case_landmark_set(knee, &far, &err));
    find_all(knee);
    assert_non_null(case_group(knee, "skin"));
    assert_int_equal(landmarks_find_portals(knee, clear, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "notch (200.0 0.0 0.0 mm)"));
    assert_int_equal(knee->portal_count, portal_count);
    case_destroy(&knee);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_fit_finds_the_axis_that_the_condyles_were_made_round),
        cmocka_unit_test(a_femur_without_condyles_is_refused),
        cmocka_unit_test(condyles_that_are_not_round_are_refused),
        cmocka_unit_test(landmarks_are_where_the_recipe_put_them),
        cmocka_unit_test(landmarks_go_with_a_knee_that_is_moved_or_mirrored),
        cmocka_unit_test(a_landmark_by_hand_stays),
        cmocka_unit_test(feet_of_ligaments_without_a_mesh_are_proposed),
        cmocka_unit_test(the_path_keeps_bones_apart_where_the_axis_does_not),
        cmocka_unit_test(gaps_that_are_too_small_are_opened),
        cmocka_unit_test(portals_are_in_the_skin_with_a_clear_way_to_the_notch),
        cmocka_unit_test(portals_that_no_free_way_leads_from_are_told),
        cmocka_unit_test(a_tibia_that_lies_beside_the_femur_has_no_plateau),
        cmocka_unit_test(a_meniscus_that_is_no_c_is_named),
        cmocka_unit_test(a_femur_of_posterior_condyles_alone_has_no_rest_path),
        cmocka_unit_test(the_notch_of_a_sheet_is_where_its_roof_begins),
        cmocka_unit_test(the_notch_of_a_high_roof_is_where_it_comes_down),
        cmocka_unit_test(a_notch_far_from_the_bones_gives_no_portals),
        cmocka_unit_test(landmarks_are_kept_in_the_case),
        cmocka_unit_test(a_case_with_a_bad_landmark_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
