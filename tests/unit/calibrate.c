// The kernels of calibration against truths made up in the test, and against a real recording of a
// pointer that was turned on each of eight landmarks of a block.
#include "calibrate/encoder.h"
#include "calibrate/landmarks.h"
#include "calibrate/noise.h"
#include "calibrate/pivot.h"
#include "drivers/recording.h"
#include "random.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define POSES 400
#define LANDMARKS 8

static vec3 normal_vector(struct random *r, double sigma) {
    double x = sigma * random_normal(r), y = sigma * random_normal(r);
    return (vec3){x, y, sigma * random_normal(r)};
}

// ---- pivot --------------------------------------------------------------------------------------

// Tools turned about `point` by tilts of up to `tilt` rad about two axes and any spin about z.
static void make_pivot(struct random *r, vec3 tip, vec3 point, double tilt_x, double tilt_y,
                       double spin, double sigma, pose *out_poses) {
    quat start = random_pose(r, 1).rotation;
    for (int i = 0; i < POSES; i++) {
        quat x = quat_from_axis_angle((vec3){1, 0, 0}, random_between(r, -tilt_x, tilt_x));
        quat y = quat_from_axis_angle((vec3){0, 1, 0}, random_between(r, -tilt_y, tilt_y));
        quat z = quat_from_axis_angle((vec3){0, 0, 1}, random_between(r, -spin, spin));
        out_poses[i].rotation = quat_multiply(start, quat_multiply(x, quat_multiply(y, z)));
        vec3 at = vec3_sub(point, quat_rotate(out_poses[i].rotation, tip));
        out_poses[i].translation = vec3_add(at, normal_vector(r, sigma));
    }
}

static void a_tip_is_found_exactly_where_nothing_trembles(void **state) {
    (void)state;
    struct random r = {1};
    pose poses[POSES];
    for (int i = 0; i < 50; i++) {
        vec3 tip = random_in_box(&r, 200), point = random_in_box(&r, 1000);
        struct pivot pivot;
        make_pivot(&r, tip, point, 0.5, 0.5, 3, 0, poses);
        assert_int_equal(pivot_calibrate(poses, POSES, &pivot, NULL), RESULT_OK);
        assert_vec3_near(pivot.tip_mm, tip, 1e-8);
        assert_vec3_near(pivot.point_mm, point, 1e-8);
        assert_true(pivot.rms_mm < 1e-8 && pivot.max_mm < 1e-8);
    }
}

static void a_tip_is_found_within_what_noise_allows_and_the_residual_is_the_noise(void **state) {
    (void)state;
    struct random r = {2};
    pose poses[POSES];
    for (int i = 0; i < 50; i++) {
        vec3 tip = random_in_box(&r, 150), point = random_in_box(&r, 500);
        double sigma = random_between(&r, 0.05, 0.5);
        struct pivot pivot;
        make_pivot(&r, tip, point, 0.5, 0.5, 1, sigma, poses);
        assert_int_equal(pivot_calibrate(poses, POSES, &pivot, NULL), RESULT_OK);
        double expected = sigma / (pivot.turn_deg * RAD_PER_DEG * sqrt(POSES));
        assert_true(vec3_distance(pivot.tip_mm, tip) < 5 * expected);
        assert_near(pivot.rms_mm, sqrt(3) * sigma, 0.15 * sqrt(3) * sigma);
        assert_true(pivot.max_mm >= pivot.rms_mm);
    }
}

static void the_residual_is_the_least_of_all_tips(void **state) {
    (void)state;
    struct random r = {3};
    pose poses[POSES];
    struct pivot pivot;
    make_pivot(&r, (vec3){0, 10, 150}, (vec3){0}, 0.4, 0.4, 1, 0.3, poses);
    assert_int_equal(pivot_calibrate(poses, POSES, &pivot, NULL), RESULT_OK);
    for (int i = 0; i < 100; i++) {
        vec3 tip = vec3_add_scaled(pivot.tip_mm, 0.05, random_direction(&r));
        vec3 point = vec3_add_scaled(pivot.point_mm, 0.05, random_direction(&r));
        double sum = 0;
        for (int k = 0; k < POSES; k++)
            sum += pow(vec3_distance(pose_apply(poses[k], tip), point), 2);
        assert_true(sqrt(sum / POSES) > pivot.rms_mm);
    }
}

static void poses_that_do_not_turn_enough_are_refused(void **state) {
    (void)state;
    static const struct {
        const char *what;
        double tilt_x, tilt_y, spin;
    } rows[] = {
        {"none", 0, 0, 0},
        {"only a little", 0.05, 0.05, 0.05},
        {"about the shaft only", 0, 0, 3},
        {"forward and back only", 0.8, 0, 0},
        {"hardly to the side", 0.8, 0.04, 0},
    };
    struct random r = {4};
    pose poses[POSES];
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        for (double sigma = 0; sigma < 0.5; sigma += 0.2) {
            struct pivot pivot;
            struct error err = {{0}};
            make_pivot(&r, (vec3){5, 5, 120}, (vec3){9, 9, 9}, rows[i].tilt_x, rows[i].tilt_y,
                       rows[i].spin, sigma, poses);
            if (pivot_calibrate(poses, POSES, &pivot, &err) != RESULT_INVALID)
                fail_msg("%s was taken", rows[i].what);
            assert_non_null(strstr(err.text, "second axis"));
        }
    struct pivot pivot;
    assert_int_equal(pivot_calibrate(poses, PIVOT_POSES_MIN - 1, &pivot, NULL), RESULT_MISSING);
}

// ---- landmarks ----------------------------------------------------------------------------------

static void a_motion_is_found_exactly_from_three_points_or_more(void **state) {
    (void)state;
    struct random r = {5};
    for (int i = 0; i < 200; i++) {
        vec3 a[LANDMARKS], b[LANDMARKS];
        double residuals[LANDMARKS];
        int count = 3 + i % (LANDMARKS - 2);
        pose T_a_b = random_pose(&r, 500);
        for (int k = 0; k < count; k++) {
            b[k] = random_in_box(&r, 200);
            a[k] = pose_apply(T_a_b, b[k]);
        }
        struct registration found;
        assert_int_equal(landmarks_register(a, b, count, &found, residuals, NULL), RESULT_OK);
        assert_true(quat_angle(found.T_a_b.rotation, T_a_b.rotation) < 1e-6);
        for (int k = 0; k < count; k++)
            assert_vec3_near(pose_apply(found.T_a_b, b[k]), a[k], 1e-8);
        assert_true(found.rms_mm < 1e-8 && found.max_mm < 1e-8);
    }
}

static void no_motion_near_the_one_found_fits_better(void **state) {
    (void)state;
    struct random r = {6};
    vec3 a[LANDMARKS], b[LANDMARKS];
    double residuals[LANDMARKS];
    pose T_a_b = random_pose(&r, 500);
    for (int k = 0; k < LANDMARKS; k++) {
        b[k] = random_in_box(&r, 80);
        a[k] = vec3_add(pose_apply(T_a_b, b[k]), normal_vector(&r, 0.5));
    }
    struct registration found;
    assert_int_equal(landmarks_register(a, b, LANDMARKS, &found, residuals, NULL), RESULT_OK);
    double sum = 0;
    for (int k = 0; k < LANDMARKS; k++) {
        assert_near(residuals[k], vec3_distance(pose_apply(found.T_a_b, b[k]), a[k]), 1e-12);
        sum += residuals[k] * residuals[k];
    }
    assert_near(found.rms_mm, sqrt(sum / LANDMARKS), 1e-12);
    for (int i = 0; i < 200; i++) {
        quat turn = quat_from_axis_angle(random_direction(&r), 0.002);
        pose other = {quat_multiply(turn, found.T_a_b.rotation), found.T_a_b.translation};
        other.translation = vec3_add_scaled(other.translation, 0.05, random_direction(&r));
        double worse = 0;
        for (int k = 0; k < LANDMARKS; k++)
            worse += pow(vec3_distance(pose_apply(other, b[k]), a[k]), 2);
        assert_true(worse > sum);
    }
}

static void a_mirrored_set_is_never_fitted_by_a_reflection(void **state) {
    (void)state;
    struct random r = {7};
    vec3 a[LANDMARKS], b[LANDMARKS];
    double residuals[LANDMARKS];
    for (int k = 0; k < LANDMARKS; k++) {
        a[k] = random_in_box(&r, 80);
        b[k] = (vec3){-a[k].x, a[k].y, a[k].z};
    }
    struct registration found;
    assert_int_equal(landmarks_register(a, b, LANDMARKS, &found, residuals, NULL), RESULT_OK);
    assert_near(mat3_determinant(quat_to_mat3(found.T_a_b.rotation)), 1, 1e-12);
    assert_true(found.rms_mm > 5);
}

static void the_landmark_that_was_missed_has_the_largest_residual(void **state) {
    (void)state;
    struct random r = {8};
    for (int wrong = 0; wrong < LANDMARKS; wrong++) {
        vec3 a[LANDMARKS], b[LANDMARKS];
        double residuals[LANDMARKS];
        pose T_a_b = random_pose(&r, 500);
        for (int k = 0; k < LANDMARKS; k++) { // corners of a box
            b[k] = (vec3){k & 1 ? 40 : -40, k & 2 ? 30 : -30, k & 4 ? 50 : -50};
            a[k] = vec3_add(pose_apply(T_a_b, b[k]), normal_vector(&r, 0.1));
        }
        a[wrong] = vec3_add_scaled(a[wrong], 10, random_direction(&r));
        struct registration found;
        assert_int_equal(landmarks_register(a, b, LANDMARKS, &found, residuals, NULL), RESULT_OK);
        for (int k = 0; k < LANDMARKS; k++)
            assert_true(residuals[k] <= residuals[wrong]);
        assert_near(found.max_mm, residuals[wrong], 1e-12);
    }
}

static void points_on_a_line_or_in_one_place_are_refused(void **state) {
    (void)state;
    struct random r = {9};
    vec3 line[LANDMARKS], heap[LANDMARKS], good[LANDMARKS];
    double residuals[LANDMARKS];
    vec3 along = random_direction(&r);
    struct registration found;
    for (int k = 0; k < LANDMARKS; k++) {
        line[k] = vec3_add(vec3_scale(30 * k, along), normal_vector(&r, 0.5));
        heap[k] = normal_vector(&r, 0.5);
        good[k] = random_in_box(&r, 80);
    }
    const vec3 *const bad[] = {line, heap};
    for (int i = 0; i < 2; i++) {
        assert_int_equal(landmarks_register(bad[i], good, LANDMARKS, &found, residuals, NULL),
                         RESULT_INVALID);
        assert_int_equal(landmarks_register(good, bad[i], LANDMARKS, &found, residuals, NULL),
                         RESULT_INVALID);
    }
    assert_int_equal(landmarks_register(good, good, 2, &found, residuals, NULL), RESULT_MISSING);
}

// ---- encoders, noise ----------------------------------------------------------------------------

static void an_encoders_zero_and_scale_come_back(void **state) {
    (void)state;
    struct random r = {10};
    for (int i = 0; i < 100; i++) {
        double scale = random_between(&r, 0.01, 0.1) * (i % 2 ? 1 : -1);
        double offset = random_between(&r, -90, 90), readings[6], values[6];
        for (int k = 0; k < 6; k++) {
            values[k] = 25 * k;
            readings[k] = (values[k] - offset) / scale;
        }
        struct encoder_fit fit;
        assert_int_equal(encoder_calibrate(readings, values, 6, &fit, NULL), RESULT_OK);
        assert_near(fit.scale, scale, 1e-12);
        assert_near(fit.offset, offset, 1e-9);
        values[3] += 4;
        assert_int_equal(encoder_calibrate(readings, values, 6, &fit, NULL), RESULT_OK);
        assert_true(fit.max > 2 && fit.max < 4 && fit.rms < fit.max);
    }
}

static void an_encoder_that_stands_still_is_refused(void **state) {
    (void)state;
    double still[] = {2048, 2049, 2047, 2048}, values[] = {0, 30, 60, 90};
    double wild[] = {0, 100, NAN, 300};
    struct encoder_fit fit;
    assert_int_equal(encoder_calibrate(still, values, 4, &fit, NULL), RESULT_INVALID);
    assert_int_equal(encoder_calibrate(wild, values, 4, &fit, NULL), RESULT_INVALID);
    assert_int_equal(encoder_calibrate(still, values, 1, &fit, NULL), RESULT_MISSING);
}

static void noise_is_measured_on_a_moving_point(void **state) {
    (void)state;
    struct random r = {11};
    vec3 points[POSES], steady[POSES];
    vec3 velocity = vec3_scale(0.7, random_direction(&r));
    for (int i = 0; i < POSES; i++) {
        steady[i] = vec3_scale(i, velocity);
        points[i] = vec3_add(steady[i], normal_vector(&r, 0.2));
    }
    assert_near(noise_of_points(points, POSES), 0.2, 0.02);
    assert_near(noise_of_points(steady, POSES), 0, 1e-9);
    assert_near(noise_of_points(points, 2), 0, 0);
}

// ---- a real pointer on eight landmarks ----------------------------------------------------------

struct pointer {
    int count;
    double *t_seconds;
    pose *T_block_pointer;
};

static void read_pointer(struct pointer *out) {
    const char *data = getenv("ARTHRON_DATA") ? getenv("ARTHRON_DATA") : DATA;
    struct recording pointer, block;
    char path[4096];
    snprintf(path, sizeof path, "%s/tracker/stylus_landmarks.csv", data);
    if (access(path, R_OK)) {
        printf("skipped: %s is not there\n", path);
        exit(77);
    }
    assert_int_equal(recording_read(path, CHANNEL_PROBE, &pointer, NULL), RESULT_OK);
    snprintf(path, sizeof path, "%s/tracker/stylus_landmarks_reference.csv", data);
    assert_int_equal(recording_read(path, CHANNEL_PROBE, &block, NULL), RESULT_OK);
    assert_int_equal(pointer.row_count, block.row_count);
    out->count = pointer.row_count;
    out->t_seconds = calloc((size_t)out->count, sizeof *out->t_seconds);
    out->T_block_pointer = calloc((size_t)out->count, sizeof *out->T_block_pointer);
    for (int i = 0; i < out->count; i++) {
        out->t_seconds[i] = pointer.t_seconds[i];
        out->T_block_pointer[i] = pose_compose(pose_inverse(block.tools[0].states[i].pose),
                                               pointer.tools[0].states[i].pose);
    }
    recording_fini(&pointer);
    recording_fini(&block);
}

static void release_pointer(struct pointer *pointer) {
    free(pointer->t_seconds);
    free(pointer->T_block_pointer);
}

// Stretches of 3 s in which the pointer turns about one point: each landmark once.
static int find_dwells(const struct pointer *p, struct pivot dwells[LANDMARKS + 4]) {
    int count = 0;
    for (int from = 0, to = 0; from < p->count && count < LANDMARKS + 4; from++) {
        while (to < p->count && p->t_seconds[to] < p->t_seconds[from] + 3)
            to++;
        struct pivot pivot;
        if (pivot_calibrate(p->T_block_pointer + from, to - from, &pivot, NULL) != RESULT_OK ||
            pivot.rms_mm > 0.5)
            continue;
        struct pivot *last = &dwells[count - 1];
        if (!count || vec3_distance(last->point_mm, pivot.point_mm) > 10)
            dwells[count++] = pivot;
        else if (pivot.turn_deg > last->turn_deg)
            *last = pivot;
    }
    return count;
}

static void the_pointers_tip_is_the_same_on_all_eight_landmarks(void **state) {
    (void)state;
    struct pointer pointer;
    struct pivot dwells[LANDMARKS + 4];
    read_pointer(&pointer);
    int count = find_dwells(&pointer, dwells);
    release_pointer(&pointer);
    assert_int_equal(count, LANDMARKS);
    for (int i = 0; i < LANDMARKS; i++) {
        printf("landmark %d: tip %.2f %.2f %.2f, at %.2f %.2f %.2f, rms %.2f mm, turn %.1f deg\n",
               i + 1, dwells[i].tip_mm.x, dwells[i].tip_mm.y, dwells[i].tip_mm.z,
               dwells[i].point_mm.x, dwells[i].point_mm.y, dwells[i].point_mm.z, dwells[i].rms_mm,
               dwells[i].turn_deg);
        for (int k = 0; k < i; k++)
            assert_true(vec3_distance(dwells[i].tip_mm, dwells[k].tip_mm) < 2);
    }
}

static void the_eight_landmarks_register_onto_themselves_under_a_known_motion(void **state) {
    (void)state;
    struct random r = {12};
    struct pointer pointer;
    struct pivot dwells[LANDMARKS + 4];
    vec3 block[LANDMARKS], moved[LANDMARKS];
    double residuals[LANDMARKS];
    read_pointer(&pointer);
    assert_int_equal(find_dwells(&pointer, dwells), LANDMARKS);
    release_pointer(&pointer);
    for (int i = 0; i < 50; i++) {
        pose T_moved_block = random_pose(&r, 300);
        for (int k = 0; k < LANDMARKS; k++) {
            block[k] = dwells[k].point_mm;
            moved[k] = vec3_add(pose_apply(T_moved_block, block[k]), normal_vector(&r, 0.3));
        }
        struct registration found;
        assert_int_equal(landmarks_register(moved, block, LANDMARKS, &found, residuals, NULL),
                         RESULT_OK);
        assert_true(quat_angle(found.T_a_b.rotation, T_moved_block.rotation) < 0.02);
        assert_true(found.rms_mm < 1 && found.rms_mm > 0.1);
        for (int k = 0; k < LANDMARKS; k++)
            assert_true(vec3_distance(pose_apply(found.T_a_b, block[k]),
                                      pose_apply(T_moved_block, block[k])) < 1);
    }
}

int main(int argc, char **argv) {
    (void)argv;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tip_is_found_exactly_where_nothing_trembles),
        cmocka_unit_test(a_tip_is_found_within_what_noise_allows_and_the_residual_is_the_noise),
        cmocka_unit_test(the_residual_is_the_least_of_all_tips),
        cmocka_unit_test(poses_that_do_not_turn_enough_are_refused),
        cmocka_unit_test(a_motion_is_found_exactly_from_three_points_or_more),
        cmocka_unit_test(no_motion_near_the_one_found_fits_better),
        cmocka_unit_test(a_mirrored_set_is_never_fitted_by_a_reflection),
        cmocka_unit_test(the_landmark_that_was_missed_has_the_largest_residual),
        cmocka_unit_test(points_on_a_line_or_in_one_place_are_refused),
        cmocka_unit_test(an_encoders_zero_and_scale_come_back),
        cmocka_unit_test(an_encoder_that_stands_still_is_refused),
        cmocka_unit_test(noise_is_measured_on_a_moving_point),
    };
    const struct CMUnitTest recorded[] = {
        cmocka_unit_test(the_pointers_tip_is_the_same_on_all_eight_landmarks),
        cmocka_unit_test(the_eight_landmarks_register_onto_themselves_under_a_known_motion),
    };
    // A program of its own for what needs the recording, so that only that is skipped.
    return argc > 1 ? cmocka_run_group_tests(recorded, NULL, NULL)
                    : cmocka_run_group_tests(tests, NULL, NULL);
}
