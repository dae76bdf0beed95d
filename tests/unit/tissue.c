// What groups of a case are: by their names, and as a case describes them.
#include "case/tissue.h"

#include "case/manifest.h"
#include "case_knee.h"
#include "check/contact.h"
#include "check/inspect.h"
#include "generate/pathology.h"
#include "mesh/topology.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct error err;

// ---- by name ------------------------------------------------------------------------------------

static void names_say_what_groups_of_older_cases_are(void **state) {
    (void)state;
    static const struct {
        const char *name, *label;
        enum tissue_kind kind;
        enum tissue_side side;
    } rows[] = {
        {"femur", "Femur", TISSUE_BONE, TISSUE_NO_SIDE},
        {"fibula", "Fibula", TISSUE_BONE, TISSUE_NO_SIDE},
        {"cartilage_tibia", "Cartilage tibia", TISSUE_CARTILAGE, TISSUE_NO_SIDE},
        {"meniscus_medial", "Medial meniscus", TISSUE_MENISCUS, TISSUE_MEDIAL},
        {"meniscus_lateral", "Lateral meniscus", TISSUE_MENISCUS, TISSUE_LATERAL},
        {"meniscus", "Meniscus", TISSUE_MENISCUS, TISSUE_NO_SIDE},
        {"acl", "Anterior cruciate ligament", TISSUE_LIGAMENT, TISSUE_NO_SIDE},
        {"lcl", "Lateral collateral ligament", TISSUE_LIGAMENT, TISSUE_LATERAL},
        {"skin", "Skin", TISSUE_SKIN, TISSUE_NO_SIDE},
        {"part_5", "Part 5", TISSUE_OTHER, TISSUE_NO_SIDE},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct case_tissue tissue = tissue_usual(rows[i].name);
        assert_string_equal(tissue.label, rows[i].label);
        assert_int_equal(tissue.kind, rows[i].kind);
        assert_int_equal(tissue.side, rows[i].side);
        assert_int_equal(tissue.colour, tissue_colour(rows[i].kind));
    }
}

static void what_bridges_two_bones_is_a_ligament(void **state) {
    (void)state;
    struct knee_case *knee = case_create("x", "");
    struct case_group *tendon = case_add_group(knee, "part_5", BODY_FEMUR);
    case_group_bridge(tendon, BODY_TIBIA);
    assert_int_equal(tendon->tissue.kind, TISSUE_LIGAMENT);
    struct case_group *skin = case_add_group(knee, "skin", BODY_FEMUR);
    case_group_bridge(skin, BODY_TIBIA);
    assert_int_equal(skin->tissue.kind, TISSUE_SKIN);
    case_destroy(&knee);
}

// ---- in case.json -------------------------------------------------------------------------------

static const char head[] = "{\"format\": 3, \"name\": \"x\", \"side\": \"left\", \"joint\": {"
                           "\"T_femur_joint\": [0, 0, 0, 1, 0, 0, 0],"
                           "\"T_tibia_joint\": [0, 0, 0, 1, 0, 0, 0]}, \"groups\": [{"
                           "\"name\": \"plica\", \"body\": \"femur\"";

static enum result read_keys(const char *keys, struct knee_case **out_knee) {
    char text[1024];
    uint64_t hash;
    int size = snprintf(text, sizeof text, "%s%s}]}", head, keys);
    return manifest_read(text, (size_t)size, out_knee, &hash, &err);
}

static void assert_is_plica(const struct case_tissue *tissue) {
    assert_int_equal(tissue->kind, TISSUE_SYNOVIUM);
    assert_int_equal(tissue->side, TISSUE_MEDIAL);
    assert_int_equal(tissue->colour, 0xe05a00);
    assert_false(tissue->has_zones);
    assert_string_equal(tissue->label, "Plica ½");
}

static void a_description_comes_back_as_it_was_written(void **state) {
    (void)state;
    struct knee_case *knee, *again;
    uint64_t hash;
    assert_ok(read_keys(", \"tissue\": \"synovium\", \"label\": \"Plica ½\", \"colour\": "
                        "\"#E05a00\", \"side\": \"medial\", \"cuttable\": true",
                        &knee));
    assert_is_plica(&knee->groups[0].tissue);
    char *text = manifest_write(knee, 0);
    assert_non_null(strstr(text, "\"format\": 3"));
    assert_null(strstr(text, "zones")); // as of its kind
    assert_ok(manifest_read(text, strlen(text), &again, &hash, &err));
    assert_is_plica(&again->groups[0].tissue);
    free(text);
    case_destroy(&knee);
    case_destroy(&again);
}

static void what_the_name_says_is_not_written(void **state) {
    (void)state;
    static const char *const keys[] = {"tissue", "label", "colour", "\"side\": \"m", "zones"};
    struct knee_case *knee = box_knee();
    char *text = manifest_write(knee, 0);
    assert_non_null(strstr(text, "\"format\": 1"));
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        assert_null(strstr(text, keys[i]));
    free(text);
    case_destroy(&knee);
}

static void a_kind_brings_its_colour_and_only_a_meniscus_has_zones(void **state) {
    (void)state;
    static const struct {
        const char *keys;
        uint32_t colour;
        bool zones;
    } rows[] = {
        {"", 0xdbb3a3, true}, // as all that is cut had before there were descriptions
        {", \"tissue\": \"skin\"", 0xdea88c, false},
        {", \"tissue\": \"meniscus\"", 0xa8c4d6, true},
        {", \"tissue\": \"meniscus\", \"zones\": false, \"colour\": \"#000001\"", 1, false},
        {", \"tissue\": \"other\", \"zones\": true", 0xdbb3a3, true},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct knee_case *knee, *again;
        uint64_t hash;
        assert_ok(read_keys(rows[i].keys, &knee));
        char *text = manifest_write(knee, 0);
        assert_ok(manifest_read(text, strlen(text), &again, &hash, &err));
        for (int k = 0; k < 2; k++) {
            const struct case_tissue *tissue = &(k ? again : knee)->groups[0].tissue;
            assert_int_equal(tissue->colour, rows[i].colour);
            assert_int_equal(tissue->has_zones, rows[i].zones);
        }
        free(text);
        case_destroy(&knee);
        case_destroy(&again);
    }
}

static void a_wrong_description_is_refused_with_its_key(void **state) {
    (void)state;
    static const struct {
        const char *keys, *said;
    } rows[] = {
        {", \"tissue\": \"muscle\"", "groups[0].tissue: neither bone, cartilage"},
        {", \"tissue\": 1", "groups[0].tissue: not a text"},
        {", \"label\": \"\"", "groups[0].label: not 1 to 63 bytes"},
        {", \"label\": \"a\\nb\"", "groups[0].label: not 1 to 63 bytes"},
        {", \"label\": \"0123456789012345678901234567890123456789012345678901234567890123\"",
         "groups[0].label: not 1 to 63 bytes"},
        {", \"colour\": \"red\"", "groups[0].colour: not #rrggbb"},
        {", \"colour\": \"#12345g\"", "groups[0].colour: not #rrggbb"},
        {", \"colour\": \"#1234567\"", "groups[0].colour: not #rrggbb"},
        {", \"side\": \"left\"", "groups[0].side: neither medial, lateral nor none"},
        {", \"zones\": 1", "groups[0].zones: neither true nor false"},
        {", \"color\": \"#123456\"", "groups[0].color: unknown key"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct knee_case *knee = NULL;
        err.text[0] = '\0';
        if (read_keys(rows[i].keys, &knee) == RESULT_OK || !strstr(err.text, rows[i].said))
            fail_msg("%s gave \"%s\", not \"%s\"", rows[i].keys, err.text, rows[i].said);
    }
}

// ---- its readers --------------------------------------------------------------------------------

static bool has_finding(const struct inspection *inspection, const char *where, const char *text) {
    for (int i = 0; i < inspection->count; i++)
        if (!strcmp(inspection->findings[i].where, where) &&
            strstr(inspection->findings[i].text, text))
            return true;
    return false;
}

static bool is_in_contact(const struct contacts *contacts, int group) {
    for (int i = 0; i < contacts->count; i++)
        if (contacts->all[i].a == group || contacts->all[i].b == group)
            return true;
    return false;
}

static void a_check_goes_by_what_groups_are_described_as(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct case_group *group = case_group(knee, "meniscus_medial");
    int index = (int)(group - knee->groups);
    static struct inspection inspection;
    static struct contacts contacts;
    strcpy(group->name, "inner");
    for (int is_meniscus = 0; is_meniscus < 2; is_meniscus++) {
        tissue_set_kind(&group->tissue, is_meniscus ? TISSUE_MENISCUS : TISSUE_OTHER);
        assert_ptr_equal(case_meniscus(knee, TISSUE_MEDIAL), is_meniscus ? group : NULL);
        inspect_case(knee, &inspection);
        assert_int_equal(has_finding(&inspection, "meniscus_medial", "there is no such group"),
                         !is_meniscus);
        assert_ok(contacts_look(knee, NULL, &contacts, &err));
        assert_int_equal(is_in_contact(&contacts, index), is_meniscus);
    }
    case_destroy(&knee);
}

// ---- a step -------------------------------------------------------------------------------------

static void take_step(struct knee_case *knee, const char *name, const char *const words[][2],
                      size_t count) {
    struct pathology step;
    pathology_init(&step, PATHOLOGY_TISSUE, name);
    for (size_t i = 0; i < count; i++)
        assert_ok(pathology_take(&step, words[i][0], words[i][1], &err));
    assert_ok(pathology_check(&step, &err));
    assert_ok(pathology_apply(knee, &step, 0, &err));
}

static struct knee_case *with_plica(enum side side) {
    static const char *const plica[][2] = {
        {"kind", "synovium"}, {"label", "Medial plica"},
        {"side", "medial"},   {"cuttable", "yes"},
        {"body", "femur"},    {"path", "-32 24 6, -27 34 -6, -12 36 -16"},
        {"flat", "0 1 0"},    {"width_mm", "6"},
        {"thickness_mm", "2"}};
    static const char *const frayed[][2] = {{"label", "Frayed ligament"}};
    struct knee_case *knee = box_knee();
    knee->joint.side = side;
    knee->joint.T_femur_joint = knee->joint.T_tibia_joint = pose_identity();
    take_step(knee, "plica", plica, sizeof plica / sizeof *plica);
    take_step(knee, "lcl", frayed, 1);
    return knee;
}

static void a_step_adds_a_tissue_that_can_be_cut_and_describes_another(void **state) {
    (void)state;
    struct knee_case *right = with_plica(SIDE_RIGHT), *left = with_plica(SIDE_LEFT);
    const struct case_group *plica = case_group(right, "plica"),
                            *mirrored = case_group(left, "plica");
    struct topology topology = topology_of(&plica->mesh);
    assert_true(topology.closed && topology.manifold && topology.oriented && plica->cuttable);
    assert_int_equal(plica->tissue.kind, TISSUE_SYNOVIUM);
    assert_string_equal(case_group(right, "lcl")->tissue.label, "Frayed ligament");
    double volume = mesh_volume(&plica->mesh);
    assert_in_range(volume, 200, 400); // π 3 1 mm² along some 34 mm
    assert_near(mesh_volume(&mirrored->mesh), volume, 0.01);
    struct box box = mesh_bounds(&plica->mesh), other = mesh_bounds(&mirrored->mesh);
    assert_near(box.min.x, -other.max.x, 1e-4);
    assert_true(box.max.x < 0); // medial of a right knee
    struct mesh least;
    mesh_copy(&least, &plica->mesh);
    for (size_t i = 0; i < 3 * (size_t)least.vertex_count; i++)
        least.positions[i] += plica->maxcut[i];
    assert_true(mesh_volume(&least) > 0 && mesh_volume(&least) < 0.1 * volume);
    mesh_fini(&least);
    case_destroy(&right);
    case_destroy(&left);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_say_what_groups_of_older_cases_are),
        cmocka_unit_test(what_bridges_two_bones_is_a_ligament),
        cmocka_unit_test(a_description_comes_back_as_it_was_written),
        cmocka_unit_test(what_the_name_says_is_not_written),
        cmocka_unit_test(a_kind_brings_its_colour_and_only_a_meniscus_has_zones),
        cmocka_unit_test(a_wrong_description_is_refused_with_its_key),
        cmocka_unit_test(a_check_goes_by_what_groups_are_described_as),
        cmocka_unit_test(a_step_adds_a_tissue_that_can_be_cut_and_describes_another),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
