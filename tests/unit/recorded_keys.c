#include "case/recorded_keys.h"

#include "case_knee.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct error err;
static char folder[FOLDER_MAX];
static struct knee_case *knee;
static struct recorded_keys record;

static int make(void **state) {
    (void)state;
    folder_make(folder);
    knee = box_knee();
    knee->rest_count = knee->torn_count = knee->key_count = 0;
    record = (struct recorded_keys){0};
    return 0;
}

static int clear(void **state) {
    (void)state;
    case_destroy(&knee);
    folder_remove(folder);
    return 0;
}

static pose at(double flexion, double valgus) {
    struct joint_angles angles = {.flexion_deg = flexion, .varus_deg = -valgus};
    return joint_to_pose(&knee->joint, &angles);
}

static double flexion_of(pose p) {
    return joint_from_pose(&knee->joint, p).flexion_deg;
}

static double valgus_of(pose p) {
    return -joint_from_pose(&knee->joint, p).varus_deg;
}

static void physical(const char *ligament, double flexion, double valgus) {
    assert_ok(recorded_keys_physical(knee, &record, ligament, at(flexion, valgus), &err));
}

static int target(const char *ligament, double flexion, double valgus) {
    int key = -1;
    assert_ok(recorded_keys_target(knee, &record, ligament, at(flexion, valgus), &key, &err));
    return key;
}

static void targets_find_the_poses_that_wait_for_them(void **state) {
    (void)state;
    physical("mcl", 15, 5);
    physical("mcl", 45, 5.5);
    physical("lcl", 16, -4);
    assert_int_equal(record.count, 3);
    assert_int_equal(knee->key_count, 0);
    int second = target("mcl", 43, 14); // the technician's order is his
    int third = target("lcl", 14, -12);
    int first = target("mcl", 16.5, 15);
    assert_int_equal(record.count, 0);
    assert_int_equal(knee->key_count, 3);
    assert_int_equal(knee->torn_count, 2);
    assert_string_equal(knee->torn[knee->keys[second].ligament], "mcl");
    assert_string_equal(knee->torn[knee->keys[third].ligament], "lcl");
    assert_int_equal(knee->keys[first].ligament, knee->keys[second].ligament);
    assert_near(flexion_of(knee->keys[second].physical), 45, 1e-9);
    assert_near(valgus_of(knee->keys[second].target), 14, 1e-9);
    assert_near(flexion_of(knee->keys[first].physical), 15, 1e-9);
    assert_near(flexion_of(knee->keys[first].target), 16.5, 1e-9);
    assert_ok(case_validate(knee, &err));
}

static void a_target_without_its_pose_is_refused_and_nothing_changes(void **state) {
    (void)state;
    int key;
    physical("mcl", 30, 5);
    assert_int_equal(recorded_keys_target(knee, &record, "mcl", at(35.5, 15), &key, &err),
                     RESULT_MISSING);
    assert_non_null(strstr(err.text, "mcl has no physical pose within 5 degrees of 35.5"));
    assert_int_equal(recorded_keys_target(knee, &record, "mcl", at(30, 5.5), &key, &err),
                     RESULT_INVALID);
    assert_non_null(strstr(err.text, "push on"));
    assert_int_equal(recorded_keys_target(knee, &record, "acl", at(30, 15), &key, &err),
                     RESULT_MISSING);
    assert_int_equal(record.count, 1);
    assert_int_equal(knee->torn_count, 0);
    assert_int_equal(knee->key_count, 0);
}

static void a_new_recording_replaces_the_old_one(void **state) {
    (void)state;
    physical("mcl", 30, 5);
    physical("mcl", 30.6, 6); // the same place
    assert_int_equal(record.count, 1);
    int key = target("mcl", 31, 15);
    assert_near(valgus_of(knee->keys[key].physical), 6, 1e-9);
    assert_int_equal(target("mcl", 29, 17), key); // no pose waits: a better target of the key
    assert_near(valgus_of(knee->keys[key].target), 17, 1e-9);
    assert_near(valgus_of(knee->keys[key].physical), 6, 1e-9);
    physical("mcl", 30.2, 4); // both anew
    assert_int_equal(target("mcl", 30, 12), key);
    assert_near(valgus_of(knee->keys[key].physical), 4, 1e-9);
    assert_int_equal(knee->key_count, 1);
    physical("mcl", 32, 5); // another key
    assert_int_equal(target("mcl", 32, 12), 1);
    assert_int_equal(knee->torn_count, 1);
}

static void the_rest_path_rises_in_flexion(void **state) {
    (void)state;
    static const double flexions[] = {60, 0, 120, 30, 60.5};
    for (int i = 0; i < 5; i++)
        assert_ok(recorded_keys_rest(knee, at(flexions[i], 0.1 * i), &err));
    assert_int_equal(knee->rest_count, 4);
    static const double sorted[] = {0, 30, 60.5, 120};
    for (int i = 0; i < 4; i++)
        assert_near(flexion_of(knee->rest[i]), sorted[i], 1e-9);
    assert_near(valgus_of(knee->rest[2]), 0.4, 1e-9);
}

// Closer than a degree no two are taken (warp/adaptive.h): a case that had them could not be
// served.
static void what_is_recorded_between_two_replaces_both(void **state) {
    (void)state;
    static const double flexions[] = {10, 11.5, 30, 10.8};
    for (int i = 0; i < 4; i++)
        assert_ok(recorded_keys_rest(knee, at(flexions[i], 0.1 * i), &err));
    assert_int_equal(knee->rest_count, 2);
    assert_near(flexion_of(knee->rest[0]), 10.8, 1e-9);
    assert_near(flexion_of(knee->rest[1]), 30, 1e-9);
    for (int i = 0; i < 4; i++) {
        physical("lcl", flexions[i], -4);
        target("lcl", flexions[i], -9);
        physical("mcl", flexions[i], 5);
        target("mcl", flexions[i], 15);
    }
    assert_int_equal(knee->key_count, 4);
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < i; k++)
            if (knee->keys[i].ligament == knee->keys[k].ligament)
                assert_true(fabs(flexion_of(knee->keys[i].physical) -
                                 flexion_of(knee->keys[k].physical)) > 1);
    physical("mcl", 11, 6);
    int key = target("mcl", 11, 16); // and says where the key is now
    assert_near(flexion_of(knee->keys[key].physical), 11, 1e-9);
    assert_near(valgus_of(knee->keys[key].target), 16, 1e-9);
    assert_ok(case_validate(knee, &err));
}

static void more_than_a_case_holds_is_refused(void **state) {
    (void)state;
    int key;
    for (int i = 0; i < CASE_KEYS_MAX; i++) {
        assert_ok(recorded_keys_rest(knee, at(2 * i, 0), &err));
        physical("mcl", 2 * i, 5);
    }
    assert_int_equal(recorded_keys_rest(knee, at(70, 0), &err), RESULT_LIMIT);
    assert_int_equal(recorded_keys_physical(knee, &record, "acl", at(0, 0), &err), RESULT_LIMIT);
    for (int i = 0; i < CASE_KEYS_MAX; i++)
        target("mcl", 2 * i, 9);
    physical("mcl", 70, 5);
    assert_int_equal(recorded_keys_target(knee, &record, "mcl", at(70, 9), &key, &err),
                     RESULT_LIMIT);
    knee->key_count = 0;
    for (int i = 0; i < CASE_LIGAMENTS_MAX; i++) {
        snprintf(knee->torn[i], CASE_NAME_MAX, "l%d", i);
        knee->keys[knee->key_count++] = (struct case_key){i, at(10, 5), at(10, 9)};
    }
    knee->torn_count = CASE_LIGAMENTS_MAX;
    assert_int_equal(recorded_keys_target(knee, &record, "mcl", at(70, 9), &key, &err),
                     RESULT_LIMIT);
    assert_int_equal(knee->key_count, CASE_LIGAMENTS_MAX);
    assert_int_equal(recorded_keys_physical(knee, &record, "a b", at(0, 0), &err), RESULT_INVALID);
    assert_int_equal(recorded_keys_physical(knee, &record, "", at(0, 0), &err), RESULT_INVALID);
}

static bool file_is_there(void) {
    char path[300];
    snprintf(path, sizeof path, "%s/recorded.json", folder);
    return access(path, F_OK) == 0;
}

static void waiting_poses_come_back_and_the_last_removes_their_file(void **state) {
    (void)state;
    struct recorded_keys again;
    assert_ok(recorded_keys_load(folder, &again, &err));
    assert_int_equal(again.count, 0);
    physical("mcl", 15.123, 5);
    physical("acl", 30, 0.1);
    assert_ok(recorded_keys_save(folder, &record, &err));
    assert_true(file_is_there());
    assert_ok(recorded_keys_load(folder, &again, &err));
    assert_int_equal(again.count, 2);
    for (int i = 0; i < 2; i++) {
        assert_string_equal(again.waiting[i].ligament, record.waiting[i].ligament);
        assert_memory_equal(&again.waiting[i].physical, &record.waiting[i].physical, sizeof(pose));
    }
    assert_ok(recorded_keys_save(folder, &(struct recorded_keys){0}, &err));
    assert_false(file_is_there());
    assert_ok(recorded_keys_save(folder, &(struct recorded_keys){0}, &err));
}

static void a_file_at_fault_is_refused_by_name_and_key(void **state) {
    (void)state;
    static const struct {
        const char *text, *says;
    } rows[] = {
        {"", "recorded.json: line"},
        {"[]", "recorded.json: format"},
        {"{\"format\":2,\"physical\":[]}", "format: not 1"},
        {"{\"format\":1}", "physical: not a list"},
        {"{\"format\":1,\"physical\":{}}", "physical: not a list"},
        {"{\"format\":1,\"physical\":[5]}", "physical[0].ligament"},
        {"{\"format\":1,\"physical\":[{\"ligament\":\"a/b\"}]}", "physical[0].ligament"},
        {"{\"format\":1,\"physical\":[{\"ligament\":\"mcl\"}]}", "physical[0].T_femur_tibia"},
        {"{\"format\":1,\"physical\":[{\"ligament\":\"mcl\",\"T_femur_tibia\":[0,0,0,2,0,0,0]}]}",
         "physical[0].T_femur_tibia"},
        {"{\"format\":1,\"physical\":[{\"ligament\":\"mcl\",\"T_femur_tibia\":[0,0,0,1,0,0]}]}",
         "physical[0].T_femur_tibia"},
        {"{\"format\":1,\"physical\":[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,"
         "0,0,0]}",
         "physical: not a list of at most 32"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        write_file(folder, "recorded.json", rows[i].text, strlen(rows[i].text));
        if (recorded_keys_load(folder, &record, &err) == RESULT_OK ||
            !strstr(err.text, rows[i].says))
            fail_msg("%s gave \"%s\", not \"%s\"", rows[i].text, err.text, rows[i].says);
    }
}

#define row(test) cmocka_unit_test_setup_teardown(test, make, clear)

int main(void) {
    const struct CMUnitTest tests[] = {
        row(targets_find_the_poses_that_wait_for_them),
        row(a_target_without_its_pose_is_refused_and_nothing_changes),
        row(a_new_recording_replaces_the_old_one),
        row(the_rest_path_rises_in_flexion),
        row(what_is_recorded_between_two_replaces_both),
        row(more_than_a_case_holds_is_refused),
        row(waiting_poses_come_back_and_the_last_removes_their_file),
        row(a_file_at_fault_is_refused_by_name_and_key),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
