#include "case_knee.h"
#include "check/findings.h"
#include "check/section.h"
#include "check/standing.h"
#include "check/verdict.h"
#include "finding.h"
#include "test.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char around[FOLDER_MAX], folder[FOLDER_MAX + 8]; // the folder of a case, and that around it

static int setup(void **state) {
    (void)state;
    folder_make(around);
    snprintf(folder, sizeof folder, "%s/case", around);
    return mkdir(folder, 0700);
}

static int teardown(void **state) {
    (void)state;
    folder_remove(around);
    return 0;
}

static struct case_check *check_on_grid(struct knee_case *knee, double spacing_mm,
                                        struct scene **out_scene) {
    struct check_settings settings = check_settings_default(true);
    settings.spacing_mm = spacing_mm;
    struct case_check *check;
    struct error err;
    assert_int_equal(check_case(&knee, &settings, &check, out_scene, &err), RESULT_OK);
    assert_null(knee);
    return check;
}

static struct case_check *check_knee(struct knee_case *knee, struct scene **out_scene) {
    return check_on_grid(knee, 4, out_scene);
}

// Boxes of a knee without torn ligaments and without displacements.
static struct knee_case *plain_knee(void) {
    struct knee_case *knee = box_knee();
    knee->torn_count = knee->key_count = knee->rest_count = 0;
    free(case_group(knee, "tibia")->warp);
    case_group(knee, "tibia")->warp = NULL;
    return knee;
}

static void the_grade_of_a_check_is_read_back_for_its_case(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct scene *scene;
    struct error err;
    assert_int_equal(case_save(knee, folder, &err), RESULT_OK);
    uint64_t hash = knee->hash;
    struct case_check *check = check_knee(knee, &scene);
    assert_non_null(scene);
    struct case_grade grade;
    assert_int_equal(grade_read(folder, &grade, &err), RESULT_MISSING);
    assert_int_equal(verdict_save(check, 1763700000, folder, &err), RESULT_OK);
    assert_int_equal(grade_read(folder, &grade, &err), RESULT_OK);
    assert_int_equal(grade.grade, check->grade);
    assert_true(grade.hash == hash && grade.quick);
    assert_string_equal(grade.field, "integral");
    assert_int_equal(grade.reason[0] != '\0', check->grade == GRADE_UNFIT);
    struct knee_case *again;
    assert_int_equal(case_load(folder, NULL, &again, &err), RESULT_OK);
    assert_true(again->hash == hash); // the case has not changed
    case_destroy(&again);
    scene_destroy(&scene);
    check_destroy(&check);
}

static void expect_standing(struct case_standing *standing, uint64_t hash, bool changed,
                            const char *name, enum standing_kind kind) {
    assert_int_equal(standing_refresh(standing, folder, hash), changed);
    assert_int_equal(standing->kind, kind);
    assert_string_equal(standing_name(standing), name);
    assert_false(standing_refresh(standing, folder, hash));
}

static void a_check_that_appears_changes_or_goes_is_noticed(void **state) {
    (void)state;
    char path[FOLDER_MAX + 24], name[32];
    struct error err;
    struct case_standing standing = {0};
    struct case_check *check =
        check_of_none("knee", &(struct check_settings){0}, &(struct error){"no"});
    check->hash = 7;
    snprintf(path, sizeof path, "%s/%s", folder, GRADE_FILE);
    expect_standing(&standing, 7, true, "not checked", STANDING_UNCHECKED);
    for (int grade = GRADE_FIT; grade < GRADE_COUNT; grade++) {
        check->grade = (enum grade)grade;
        assert_int_equal(verdict_save(check, grade, folder, &err), RESULT_OK);
        snprintf(name, sizeof name, "%s", grade_name(check->grade));
        expect_standing(&standing, 7, true, name, STANDING_GRADED);
    }
    assert_string_equal(standing.grade.reason, "files: no");
    check->hash = 8;
    assert_int_equal(verdict_save(check, 9, folder, &err), RESULT_OK);
    expect_standing(&standing, 7, true, "not checked", STANDING_OUTDATED);
    assert_int_equal(truncate(path, 3), 0);
    expect_standing(&standing, 7, true, "not checked", STANDING_UNREADABLE);
    assert_int_equal(unlink(path), 0);
    expect_standing(&standing, 7, true, "not checked", STANDING_UNCHECKED);
    check_destroy(&check);
}

struct shares {
    double last;
    int count;
    int of_overlaps;
    bool within; // a pose, not only at its end
};

static void take_share(void *context, const char *where, double share) {
    struct shares *s = context;
    assert_true(where[0] && share > s->last && share <= 1);
    s->of_overlaps += !strcmp(where, "overlaps");
    assert_true(s->of_overlaps == s->count + 1 || strcmp(where, "overlaps")); // first
    s->within |= strcmp(where, "overlaps") && share < 0.4;
    s->last = share;
    s->count++;
}

static void progress_grows_to_the_whole_with_steps_inside_a_pose(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct shares shares = {0};
    struct check_settings settings = check_settings_default(true);
    settings.spacing_mm = 2;
    settings.progress = take_share;
    settings.context = &shares;
    struct case_check *check;
    struct scene *scene;
    struct error err;
    assert_int_equal(check_case(&knee, &settings, &check, &scene, &err), RESULT_OK);
    int moved = 0;
    for (int i = 0; i < check->pose_count; i++)
        moved += !check->poses[i].is_still;
    assert_true(moved > 0 && shares.count - shares.of_overlaps > moved && shares.within);
    assert_true(shares.of_overlaps > 10);
    assert_float_equal(shares.last, 1, 1e-12);
    scene_destroy(&scene);
    check_destroy(&check);
}

static void surfaces_that_go_into_each_other_make_a_case_unfit(void **state) {
    (void)state;
    struct scene *scene;
    struct case_check *check = check_knee(plain_knee(), &scene);
    assert_null(find_finding(check, FINDING_FAULT, "femur", "faces"));
    assert_non_null(find_finding(check, FINDING_NOTE, "field", "nothing is displaced"));
    int before = check->findings.faults;
    scene_destroy(&scene);
    check_destroy(&check);
    struct knee_case *knee = plain_knee();
    struct case_group *femur = case_group(knee, "femur");
    float *warp = case_group_need_warp(femur);
    for (uint32_t v = 0; v < femur->mesh.vertex_count; v++)
        warp[3 * v + 2] = -2;
    check = check_knee(knee, &scene);
    assert_non_null(
        find_finding(check, FINDING_FAULT, "femur", "faces meniscus_medial over a gap of 0.00"));
    assert_int_equal(check->grade, GRADE_UNFIT);
    assert_true(check->findings.faults > before);
    scene_destroy(&scene);
    check_destroy(&check);
}

static void torn_ligaments_are_looked_at_in_their_keys(void **state) {
    (void)state;
    struct scene *scene;
    struct case_check *check = check_knee(box_knee(), &scene);
    assert_int_equal(check->pose_count, 3 + 2); // quick: 0, 60, 120, and a key of each ligament
    assert_string_equal(check->poses[3].name, "mcl at 15 degrees");
    assert_true(check->poses[3].bones.virtual_mm >= 0);
    assert_int_equal(check->opening_count, 2);
    assert_string_equal(check->openings[0].coordinate, "valgus");
    assert_string_equal(check->openings[1].coordinate, "drawer");
    const struct opening *o = &check->openings[0];
    for (int k = 0; k < o->key_count; k++)
        for (int i = 0; i < OPENING_STEPS; i++)
            if (fabs(o->flexion[i] - o->key_flexion[k]) < 1e-9)
                assert_near(o->shown[i], o->key_target[k], 1e-6);
    assert_true(check->rest_mm < 1e-6);
    scene_destroy(&scene);
    check_destroy(&check);
}

// The ramp from rest to a key is 1.25 times as steep in its middle as it is on the whole.
static void a_ligament_that_opens_too_steeply_makes_a_case_unfit(void **state) {
    (void)state;
    static const struct {
        double held_deg;
        enum finding_level level;
    } rows[] = {{3, FINDING_NOTE}, {2, FINDING_WARNING}, {1, FINDING_FAULT}};
    for (int i = 0; i < 3; i++) {
        struct knee_case *knee = plain_knee();
        quat held = quat_from_axis_angle((vec3){0, 1, 0}, -rows[i].held_deg * RAD_PER_DEG);
        quat shown = quat_from_axis_angle((vec3){0, 1, 0}, -(rows[i].held_deg + 7) * RAD_PER_DEG);
        knee->torn_count = knee->key_count = 1;
        knee->joint.T_femur_joint = knee->joint.T_tibia_joint = pose_identity();
        knee->keys[0] = (struct case_key){0, {held, {0, 0, 0}}, {shown, {0, 0, 0}}};
        struct scene *scene;
        struct case_check *check = check_knee(knee, &scene);
        assert_near(check->poses[check->pose_count - 1].gain, 1.25 * 7 / rows[i].held_deg, 0.02);
        assert_non_null(find_finding(check, rows[i].level, "joint", "mm further for each mm"));
        scene_destroy(&scene);
        check_destroy(&check);
    }
}

static void findings_for_which_there_is_no_room_count_all_the_same(void **state) {
    (void)state;
    static struct case_check check;
    for (int i = 0; i < CHECK_FINDINGS_MAX; i++)
        inspection_note(&check.findings, FINDING_NOTE, "tibia", "%d", i);
    findings_grade(&check);
    assert_int_equal(check.grade, GRADE_FIT);
    for (int i = 1; i <= 3; i++) {
        inspection_note(&check.findings, i < 3 ? FINDING_WARNING : FINDING_FAULT, "femur", "more");
        findings_grade(&check);
        assert_int_equal(check.findings.count, CHECK_FINDINGS_MAX);
        assert_int_equal(check.findings.left_out, i);
        assert_int_equal(check.grade, i < 3 ? GRADE_WARNINGS : GRADE_UNFIT);
    }
}

static void a_case_that_cannot_be_prepared_is_unfit_and_says_why(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    knee->keys[1].physical = knee->keys[0].physical; // two keys at one flexion
    struct scene *scene;
    struct case_check *check = check_knee(knee, &scene);
    assert_null(scene);
    assert_int_equal(check->grade, GRADE_UNFIT);
    assert_non_null(find_finding(check, FINDING_FAULT, "case", "torn ligaments"));
    char *text = verdict_text(check, 0);
    assert_non_null(strstr(text, "\"grade\": \"unfit\""));
    assert_non_null(strstr(text, "1970-01-01T00:00:00Z"));
    free(text);
    check_destroy(&check);
}

static const char good_record[] = "{\"format\":\"arthron-check\",\"version\":1,\"grade\":\"unfit\","
                                  "\"hash\":\"0123456789abcdef\",\"quick\":false,"
                                  "\"settings\":{\"field\":\"smooth\"},\"findings\":["
                                  "{\"level\":\"note\",\"where\":\"a\",\"text\":\"b\"},"
                                  "{\"level\":\"fault\",\"where\":\"femur\",\"text\":\"faces\"}]}";

static void a_record_of_an_unfit_case_gives_the_first_fault(void **state) {
    (void)state;
    struct case_grade grade;
    struct error err;
    write_file(folder, GRADE_FILE, good_record, strlen(good_record));
    assert_int_equal(grade_read(folder, &grade, &err), RESULT_OK);
    assert_int_equal(grade.grade, GRADE_UNFIT);
    assert_true(grade.hash == 0x0123456789abcdef && !grade.quick);
    assert_string_equal(grade.reason, "femur: faces");
}

static const struct broken {
    const char *from, *to;
    enum result result;
    const char *says;
} broken_records[] = {
    {"arthron-check", "arthron-cheque", RESULT_FORMAT, "format"},
    {"\"version\":1", "\"version\":2", RESULT_VERSION, "version"},
    {"\"version\":1", "\"version\":\"1\"", RESULT_VERSION, "version"},
    {"unfit", "splendid", RESULT_INVALID, "grade"},
    {"\"grade\":\"unfit\",", "", RESULT_INVALID, "grade"},
    {"\"grade\":\"unfit\"", "\"grade\":2", RESULT_INVALID, "grade"},
    {"0123456789abcdef", "123456789abcdef", RESULT_INVALID, "hash"},
    {"0123456789abcdef", "-123456789abcdef", RESULT_INVALID, "hash"},
    {"0123456789abcdef", "0123456789ABCDEF", RESULT_INVALID, "hash"},
    {"\"quick\":false", "\"quick\":0", RESULT_INVALID, "quick"},
    {"\"field\":\"smooth\"", "\"field\":[]", RESULT_INVALID, "settings.field"},
    {"smooth", "a name that is longer than the name of any field", RESULT_INVALID,
     "settings.field"},
    {"{\"format\"", "[\"format\"", RESULT_FORMAT, "line 1"},
    {"\"quick\":false", "\"quick\":false,\"quick\":true", RESULT_FORMAT, "line 1"},
    {"}]}", "}]", RESULT_FORMAT, "line 1"},
};

static void write_broken(const struct broken *row) {
    char text[1024];
    const char *at = strstr(good_record, row->from);
    assert_non_null(at);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - good_record), good_record, row->to,
             at + strlen(row->from));
    write_file(folder, GRADE_FILE, text, strlen(text));
}

static void a_broken_record_is_refused_and_says_where(void **state) {
    (void)state;
    struct case_grade grade;
    struct error err;
    for (size_t i = 0; i < sizeof broken_records / sizeof broken_records[0]; i++) {
        const struct broken *row = &broken_records[i];
        write_broken(row);
        if (grade_read(folder, &grade, &err) != row->result || !strstr(err.text, row->says) ||
            !strstr(err.text, GRADE_FILE))
            fail_msg("row %zu: %s", i, err.text);
        assert_int_equal(grade.reason[0], 0);
    }
    write_file(folder, GRADE_FILE, "\xff\xfe", 2);
    assert_int_equal(grade_read(folder, &grade, &err), RESULT_FORMAT);
    write_file(folder, GRADE_FILE, "", 0);
    assert_int_not_equal(grade_read(folder, &grade, &err), RESULT_OK);
}

// Longer than the name of a case may be, and not plain ASCII at its 63rd byte.
static void a_folder_without_a_case_keeps_its_whole_name(void **state) {
    (void)state;
    const char *name = "knees/of-the-third-series/left/after-segmentation-and-smoothing-é/2026";
    struct case_check *check =
        check_of_none(name, &(struct check_settings){0}, &(struct error){"no"});
    char *text = verdict_text(check, 0);
    json_t *root = json_loads(text, 0, NULL);
    assert_string_equal(json_string_value(json_object_get(root, "case")), name);
    json_decref(root);
    free(text);
    check_destroy(&check);
}

// The tissue is two boxes, one of which passes through the other on the way to maxcut.
static void tissue_that_crosses_itself_between_its_ends_makes_a_case_unfit(void **state) {
    (void)state;
    static const double ways[] = {-24, 4};
    for (int i = 0; i < 2; i++) {
        struct knee_case *knee = plain_knee();
        struct case_group *meniscus = case_group(knee, "meniscus_medial");
        struct mesh box;
        struct error err;
        box_mesh((vec3){-15, 1, -13}, (vec3){2, 2, 2}, &box);
        assert_ok(case_add_part(meniscus, "flap", &box, &err));
        mesh_fini(&box);
        float *maxcut = case_group_need_maxcut(meniscus);
        for (uint32_t v = 8; v < 16; v++)
            maxcut[3 * v] = (float)ways[i];
        struct scene *scene;
        struct case_check *check = check_knee(knee, &scene);
        const struct check_finding *found = find_finding(check, FINDING_FAULT, "meniscus_medial",
                                                         "maxcut: at 50 % of the way to it folded");
        assert_int_equal(found != NULL, i == 0);
        assert_null(find_finding(check, FINDING_FAULT, "meniscus_medial", "maxcut: folded"));
        scene_destroy(&scene);
        check_destroy(&check);
    }
}

// Maxcut turns the tissue's front to its back, or moves it a little.
static void a_resection_that_folds_the_space_is_told(void **state) {
    (void)state;
    for (int turns = 0; turns < 2; turns++) {
        struct knee_case *knee = plain_knee();
        struct case_group *meniscus = case_group(knee, "meniscus_medial");
        float *maxcut = case_group_need_maxcut(meniscus);
        for (uint32_t v = 0; v < meniscus->mesh.vertex_count; v++)
            maxcut[3 * v] = turns ? -2 * (meniscus->mesh.positions[3 * v] + 25) : 0.5f;
        struct scene *scene;
        struct case_check *check = check_on_grid(knee, 1, &scene);
        const char *text = "between S' and maxcut";
        assert_int_equal(find_finding(check, FINDING_WARNING, "field", text) != NULL, turns);
        assert_null(find_finding(check, FINDING_NOTE, "field", text));
        assert_non_null(find_finding(check, FINDING_NOTE, "field", "nothing is displaced"));
        assert_true(check->eased->looked > 20);
        scene_destroy(&scene);
        check_destroy(&check);
    }
}

static void a_record_that_is_too_large_is_not_read(void **state) {
    (void)state;
    size_t size = 5 << 20;
    char *bytes = malloc(size);
    memset(bytes, ' ', size);
    write_file(folder, GRADE_FILE, bytes, size);
    free(bytes);
    struct case_grade grade;
    struct error err;
    assert_int_equal(grade_read(folder, &grade, &err), RESULT_LIMIT);
}

static const struct section_cell *cell_at(const struct section *s, double right, double up) {
    int i = (int)lround((right - s->origin[0]) / s->spacing_mm);
    int k = (int)lround((up - s->origin[1]) / s->spacing_mm);
    assert_true(i >= 0 && i < s->size[0] && k >= 0 && k < s->size[1]);
    return &s->cells[i + s->size[0] * k];
}

// In the joint's frame, whose origin is at (0, -5, 10).
static void a_section_shows_what_lies_where(void **state) {
    (void)state;
    struct knee_case *knee = plain_knee();
    struct case_group *meniscus = case_group(knee, "meniscus_medial");
    float *warp = case_group_need_warp(meniscus);
    for (uint32_t v = 0; v < meniscus->mesh.vertex_count; v++)
        warp[3 * v + 2] = -0.5;
    knee->joint.T_femur_joint.rotation = knee->joint.T_tibia_joint.rotation = quat_identity();
    struct scene *scene;
    struct error err;
    assert_int_equal(scene_create(&knee, &scene, &err), RESULT_OK);
    struct check_settings settings = check_settings_default(true);
    struct joint_angles straight = {0};
    struct section s;
    assert_int_equal(section_make(scene, &settings, &straight, SECTION_CORONAL, 0.5, &s, &err),
                     RESULT_OK);
    const struct knee_case *cased = scene_case(scene);
    assert_int_equal(cell_at(&s, 0, 5)->place, PLACE_SOLID);
    assert_string_equal(cased->groups[cell_at(&s, 0, 5)->group].name, "femur");
    assert_string_equal(cased->groups[cell_at(&s, -25, -26)->group].name, "meniscus_medial");
    assert_string_equal(cased->groups[cell_at(&s, 20, -40)->group].name, "tibia");
    assert_int_equal(cell_at(&s, -16, -25)->place, PLACE_FREE);
    assert_false(cell_at(&s, -16, -25)->still);
    assert_true(cell_at(&s, -16, -25)->gain > 0.01f);
    assert_true(cell_at(&s, 20, -28)->still);
    int outlines[2] = {0};
    for (size_t i = 0; i < s.line_count; i++) {
        const struct section_line *line = &s.lines[i];
        bool is_meniscus = !strcmp(cased->groups[line->group].name, "meniscus_medial");
        assert_true(is_meniscus || !line->is_virtual); // what stays has one outline
        outlines[line->is_virtual] += is_meniscus;
        if (is_meniscus)
            assert_true(fabsf(line->from[1] + 26) <= (line->is_virtual ? 3.6f : 3.1f));
    }
    assert_int_equal(outlines[0], outlines[1]);
    assert_true(outlines[0] >= 8);
    section_fini(&s);
    scene_destroy(&scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_grade_of_a_check_is_read_back_for_its_case, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(a_check_that_appears_changes_or_goes_is_noticed, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(progress_grows_to_the_whole_with_steps_inside_a_pose, setup,
                                        teardown),
        cmocka_unit_test(surfaces_that_go_into_each_other_make_a_case_unfit),
        cmocka_unit_test(torn_ligaments_are_looked_at_in_their_keys),
        cmocka_unit_test(a_section_shows_what_lies_where),
        cmocka_unit_test(a_ligament_that_opens_too_steeply_makes_a_case_unfit),
        cmocka_unit_test(findings_for_which_there_is_no_room_count_all_the_same),
        cmocka_unit_test(a_case_that_cannot_be_prepared_is_unfit_and_says_why),
        cmocka_unit_test_setup_teardown(a_record_of_an_unfit_case_gives_the_first_fault, setup,
                                        teardown),
        cmocka_unit_test(a_folder_without_a_case_keeps_its_whole_name),
        cmocka_unit_test(a_resection_that_folds_the_space_is_told),
        cmocka_unit_test(tissue_that_crosses_itself_between_its_ends_makes_a_case_unfit),
        cmocka_unit_test_setup_teardown(a_broken_record_is_refused_and_says_where, setup, teardown),
        cmocka_unit_test_setup_teardown(a_record_that_is_too_large_is_not_read, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
