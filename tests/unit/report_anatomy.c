#include "case_knee.h"
#include "report/anatomy.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

#define WIDTH 320
#define HEIGHT 240

static struct picture draw(const struct knee_case *knee, const struct anatomy_view *view) {
    struct picture picture;
    struct error err;
    assert_int_equal(anatomy_picture(knee, view, WIDTH, HEIGHT, &picture, &err), RESULT_OK);
    return picture;
}

static struct picture draw_usual(const struct knee_case *knee, enum viewpoint view) {
    struct anatomy_view usual = {.view = view};
    anatomy_choose(knee, view, usual.shown);
    return draw(knee, &usual);
}

// ---- which colour, in whatever light ----

struct counts {
    int red, yellow, blue; // tear, plan, meniscus
};

static struct counts count(const struct picture *picture) {
    struct counts counts = {0};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int r = picture->rgb[3 * i], g = picture->rgb[3 * i + 1], b = picture->rgb[3 * i + 2];
        counts.red += r > 3 * g;
        counts.yellow += r > 1.6 * b && r < 1.4 * g;
        counts.blue += b > 1.15 * r;
    }
    return counts;
}

static void show(struct knee_case *knee, const char *name, struct anatomy_view *view) {
    view->shown[case_group(knee, name) - knee->groups] = true;
}

static void add_wall(struct knee_case *knee, vec3 centre, vec3 half) {
    struct mesh mesh;
    struct case_group *group = case_add_group(knee, "mcl", BODY_FEMUR);
    box_mesh(centre, half, &mesh);
    assert_int_equal(case_add_part(group, "mcl", &mesh, NULL), RESULT_OK);
    mesh_fini(&mesh);
}

// ---- tests ----

static void lesions_are_painted_where_they_are_and_as_large(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct picture picture = draw_usual(knee, VIEWPOINT_TOP);
    struct counts counts = count(&picture);
    int all = counts.red + counts.yellow + counts.blue;
    // of the upper side of 12 by 30 mm, 4 by 4 and 2 by 8, of which 2 by 4 twice
    assert_near((double)counts.yellow / all, 24.0 / 360, 0.01);
    struct case_region *tear = &case_group(knee, "meniscus_medial")->lesion.tear;
    struct case_region *plan = &case_group(knee, "meniscus_medial")->lesion.plan, none = *tear;
    *tear = *plan; // the tear shows above the plan
    struct picture torn = draw_usual(knee, VIEWPOINT_TOP);
    assert_near(count(&torn).red, counts.yellow, 0.1 * counts.yellow);
    *tear = none;
    picture_fini(&picture);
    picture_fini(&torn);
    case_destroy(&knee);
}

static void what_is_shown_is_the_patient(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct case_group *meniscus = case_group(knee, "meniscus_medial");
    float *warp = case_group_need_warp(meniscus);
    for (uint32_t v = 0; v < meniscus->mesh.vertex_count; v++)
        warp[3 * v + 1] = 4;
    struct picture displaced = draw_usual(knee, VIEWPOINT_TOP);
    for (uint32_t v = 0; v < meniscus->mesh.vertex_count; v++)
        meniscus->mesh.positions[3 * v + 1] += warp[3 * v + 1];
    memset(warp, 0, 3 * sizeof *warp * meniscus->mesh.vertex_count);
    struct picture moved = draw_usual(knee, VIEWPOINT_TOP);
    assert_memory_equal(displaced.rgb, moved.rgb, 3 * WIDTH * HEIGHT);
    picture_fini(&displaced);
    picture_fini(&moved);
    case_destroy(&knee);
}

static void each_view_is_from_where_it_says(void **state) {
    (void)state;
    const struct {
        enum side side;
        enum viewpoint hidden, seen;
        vec3 centre, half;
    } walls[] = {
        {SIDE_RIGHT, VIEWPOINT_LATERAL, VIEWPOINT_MEDIAL, {55, 0, 0}, {2, 90, 90}},
        {SIDE_RIGHT, VIEWPOINT_MEDIAL, VIEWPOINT_LATERAL, {-55, 0, 0}, {2, 90, 90}},
        {SIDE_LEFT, VIEWPOINT_MEDIAL, VIEWPOINT_LATERAL, {55, 0, 0}, {2, 90, 90}},
        {SIDE_RIGHT, VIEWPOINT_FRONT, VIEWPOINT_BACK, {0, 57, 0}, {90, 2, 90}},
        {SIDE_RIGHT, VIEWPOINT_BACK, VIEWPOINT_FRONT, {0, -57, 0}, {90, 2, 90}},
    };
    for (size_t i = 0; i < sizeof walls / sizeof walls[0]; i++) {
        struct knee_case *knee = box_knee();
        knee->joint.side = walls[i].side;
        add_wall(knee, walls[i].centre, walls[i].half);
        struct anatomy_view view = {.view = walls[i].hidden};
        show(knee, "meniscus_medial", &view);
        show(knee, "mcl", &view);
        struct picture hidden = draw(knee, &view);
        view.view = walls[i].seen;
        struct picture seen = draw(knee, &view);
        assert_int_equal(count(&hidden).blue, 0);
        assert_true(count(&seen).blue > 50);
        picture_fini(&hidden);
        picture_fini(&seen);
        case_destroy(&knee);
    }
}

static void pose_mesh(struct case_group *group, pose T) {
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++)
        mesh_set_vertex(&group->mesh, v, pose_apply(T, mesh_vertex(&group->mesh, v)));
    free(group->warp);
    group->warp = NULL;
}

static void a_bent_knee_has_tibia_and_patella_where_the_joint_puts_them(void **state) {
    (void)state;
    struct joint_angles angles = {.flexion_deg = 50};
    struct knee_case *knee = box_knee(), *posed = box_knee();
    struct case_group *tibia = case_group(posed, "tibia"), *patella = case_group(posed, "patella");
    pose_mesh(tibia, joint_to_pose(&posed->joint, &angles));
    pose_mesh(patella, case_patella_pose(posed, 50));
    pose_mesh(case_group(knee, "tibia"), pose_identity());
    struct anatomy_view bent = {.view = VIEWPOINT_MEDIAL, .flexion_deg = 50},
                        straight = {VIEWPOINT_MEDIAL};
    show(posed, "tibia", &bent);
    show(posed, "patella", &bent);
    memcpy(straight.shown, bent.shown, sizeof bent.shown);
    struct picture a = draw(knee, &bent), b = draw(posed, &straight);
    int differ = 0;
    for (int i = 0; i < 3 * WIDTH * HEIGHT; i++)
        differ += abs(a.rgb[i] - b.rgb[i]) > 3;
    assert_true(differ < 300); // a rounding here and there, at edges
    picture_fini(&a);
    picture_fini(&b);
    case_destroy(&knee);
    case_destroy(&posed);
}

static bool is_shown(struct knee_case *knee, const bool *shown, const char *name) {
    return shown[case_group(knee, name) - knee->groups];
}

static void the_usual_choice_hides_what_hides_the_rest(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    add_wall(knee, (vec3){0}, (vec3){9, 9, 9});
    case_add_group(knee, "skin", BODY_FEMUR);
    bool front[CASE_GROUPS_MAX], top[CASE_GROUPS_MAX];
    anatomy_choose(knee, VIEWPOINT_FRONT, front);
    anatomy_choose(knee, VIEWPOINT_TOP, top);
    const char *const names[] = {"tibia", "meniscus_medial", "femur", "patella", "mcl", "skin"};
    for (int i = 0; i < 6; i++) {
        assert_int_equal(is_shown(knee, front, names[i]), i < 5);
        assert_int_equal(is_shown(knee, top, names[i]), i < 2);
    }
    case_destroy(&knee);
}

static uint8_t blue_in_the_middle(const struct knee_case *knee, const struct anatomy_view *view) {
    struct picture picture = draw(knee, view);
    uint8_t blue = picture.rgb[3 * (HEIGHT / 2 * WIDTH + WIDTH / 2) + 2];
    picture_fini(&picture);
    return blue;
}

static void skin_is_seen_through(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct mesh mesh;
    box_mesh((vec3){-50, 0, 15}, (vec3){2, 10, 10}, &mesh);
    assert_int_equal(case_add_part(case_add_group(knee, "skin", BODY_FEMUR), "skin", &mesh, NULL),
                     RESULT_OK);
    struct anatomy_view skin = {.view = VIEWPOINT_MEDIAL}, bone = skin, both = skin;
    show(knee, "skin", &skin);
    show(knee, "femur", &bone);
    show(knee, "skin", &both);
    show(knee, "femur", &both);
    uint8_t before_white = blue_in_the_middle(knee, &skin);
    uint8_t before_bone = blue_in_the_middle(knee, &both), alone = blue_in_the_middle(knee, &bone);
    assert_true(before_bone + 5 < alone);
    assert_true(alone + 5 < before_white);
    assert_true(before_white < 250);
    mesh_fini(&mesh);
    case_destroy(&knee);
}

static void nothing_to_show_is_an_error(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct anatomy_view nothing = {.view = VIEWPOINT_TOP};
    struct picture picture;
    struct error err;
    assert_int_equal(anatomy_picture(knee, &nothing, WIDTH, HEIGHT, &picture, &err),
                     RESULT_MISSING);
    assert_non_null(strstr(err.text, "no group"));
    case_destroy(&knee);
}

static void views_have_names(void **state) {
    (void)state;
    for (int i = 0; i < VIEWPOINT_COUNT; i++) {
        enum viewpoint view = VIEWPOINT_COUNT;
        assert_true(viewpoint_from_name(viewpoint_name((enum viewpoint)i), &view));
        assert_int_equal(view, i);
    }
    enum viewpoint view;
    assert_false(viewpoint_from_name("below", &view));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lesions_are_painted_where_they_are_and_as_large),
        cmocka_unit_test(what_is_shown_is_the_patient),
        cmocka_unit_test(each_view_is_from_where_it_says),
        cmocka_unit_test(a_bent_knee_has_tibia_and_patella_where_the_joint_puts_them),
        cmocka_unit_test(the_usual_choice_hides_what_hides_the_rest),
        cmocka_unit_test(skin_is_seen_through),
        cmocka_unit_test(nothing_to_show_is_an_error),
        cmocka_unit_test(views_have_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
