#include "loose.h"

#include "base/clock.h"
#include "generate/generate.h"
#include "landmarks/landmarks.h"
#include "samples.h"
#include "step/session.h"

#include <stdio.h>
#include <time.h>

#define STEPS 600
#define SETTLED 100
#define APART_MM 3.0 // from the middle of a plateau: four of them push each other, too
#define FLEXION_MOST_DEG 60.0

static double thread_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
}

static void add_loose(struct knee_case *knee) {
    static const char *const plateaus[] = {"plateau_medial", "plateau_lateral"};
    for (int i = 0; i < CASE_LOOSE_MAX; i++) {
        struct case_loose *loose = &knee->loose[knee->loose_count++];
        vec3 at = case_landmark(knee, plateaus[i / 4])->at;
        at.x += i & 1 ? APART_MM : -APART_MM;
        at.y += i & 2 ? APART_MM : -APART_MM;
        *loose = (struct case_loose){.body = BODY_TIBIA, .at = at, .radii_mm = {3.5, 3, 2}};
        snprintf(loose->name, sizeof loose->name, "loose_%d", i + 1);
    }
}

static enum result make_scene(bool loose, struct scene **out_scene, struct error *err) {
    struct recipe recipe;
    struct knee_case *knee = NULL;
    enum result result = recipe_load(CASES "/healthy", &recipe, err);
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &knee, err);
    if (result == RESULT_OK)
        result = landmarks_find(knee, NULL, err);
    if (result == RESULT_OK && loose)
        add_loose(knee);
    if (result == RESULT_OK)
        result = scene_create(&knee, out_scene, err);
    case_destroy(&knee);
    return result;
}

// The joint flexes and extends and presses 3 degrees of varus and valgus on the plateaus, while a
// probe stirs.
static void input_of(int i, struct session_input *input) {
    double turn = 2 * M_PI * i / STEPS, flexion = FLEXION_MOST_DEG * (1 - cos(turn)) / 2;
    int64_t time_ns = (i + 2) * 10 * NS_PER_MS;
    *input = (struct session_input){
        .kind = INPUT_FRAME,
        .time_ns = time_ns,
        .frame = {.number = (uint64_t)i + 1, .time_ns = time_ns, .count = 2}};
    input->frame.samples[0] =
        (struct sample){.channel = CHANNEL_JOINT,
                        .kind = SAMPLE_JOINT,
                        .time_ns = time_ns,
                        .joint = {.flexion_deg = flexion, .varus_deg = 3 * sin(5 * turn)}};
    vec3 tip = {-20 + 5 * sin(7 * turn), 10 + 5 * cos(7 * turn), -20};
    input->frame.samples[1] = (struct sample){.channel = CHANNEL_PROBE,
                                              .kind = SAMPLE_POSE,
                                              .time_ns = time_ns,
                                              .T_mockup_body = {quat_identity(), tip}};
}

static void run(struct scene *scene, struct samples *out_us) {
    struct session_settings settings = session_settings_default();
    struct session *session = session_create(scene, &settings);
    struct session_input input = {.kind = INPUT_START, .time_ns = 10 * NS_PER_MS};
    struct session_output output;
    session_step(session, &input, &output);
    for (int i = 0; i < STEPS; i++) {
        input_of(i, &input);
        double begin_us = thread_us();
        session_step(session, &input, &output);
        if (i >= SETTLED)
            samples_add(out_us, thread_us() - begin_us);
    }
    session_destroy(&session);
}

static enum result time_steps(bool loose, struct samples *out_us, struct error *err) {
    struct scene *scene = NULL;
    enum result result = make_scene(loose, &scene, err);
    if (result == RESULT_OK)
        run(scene, out_us);
    scene_destroy(&scene);
    return result;
}

enum result loose_measure(struct report *report, struct error *err) {
    struct samples with = {0}, without = {0};
    enum result result = time_steps(true, &with, err);
    if (result == RESULT_OK)
        result = time_steps(false, &without, err);
    if (result == RESULT_OK) {
        double plain_us = samples_quantile(&without, 0.5);
        report_figure(report, plain_us, "us", "loose/plain step");
        report_figure(report, samples_quantile(&with, 0.5), "us", "loose/step with eight wedged");
        report_figure(report, samples_quantile(&with, 0.99), "us",
                      "loose/step with eight wedged, p99");
        report_mark(report, "loose_p99_over_plain", samples_quantile(&with, 0.99) / plain_us, "",
                    10, BETTER_LOW);
    }
    samples_fini(&with);
    samples_fini(&without);
    return result;
}
