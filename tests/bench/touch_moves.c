#include "touch_moves.h"

#include "base/check.h"
#include "base/clock.h"
#include "generate/generate.h"
#include "motion/motion.h"
#include "paper.h"
#include "step/operation.h"
#include "step/session.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LEAST_DEPTH_TENTHS 6

static void add_sample(struct frame *frame, struct sample sample) {
    sample.time_ns = frame->time_ns;
    frame->samples[frame->count++] = sample;
}

static struct frame frame_of(const struct motion *motion, size_t row) {
    const struct motion_row *r = &motion->rows[row];
    struct frame frame = {.number = row + 1, .time_ns = (int64_t)(NS_PER_S * r->t_seconds)};
    add_sample(&frame,
               (struct sample){.channel = CHANNEL_JOINT, .kind = SAMPLE_JOINT, .joint = r->joint});
    for (int i = 0; i < motion->tool_count; i++) {
        struct sample tip = {.channel = motion->tools[i].channel, .kind = SAMPLE_POSE};
        struct sample handle = {.channel = motion->tools[i].channel, .kind = SAMPLE_HANDLE};
        tip.T_mockup_body = r->tools[i].T_mockup_tip;
        handle.handle.opening = r->tools[i].opening;
        add_sample(&frame, tip);
        add_sample(&frame, handle);
    }
    return frame;
}

static void note(struct touch_moves *moves, const struct job *job) {
    for (int i = 0; job->kind == JOB_CUT && i < job->move_count; i++) {
        if (moves->count == moves->room) {
            moves->room = 2 * moves->room + 64;
            moves->moves =
                alloc_resize(moves->moves, (unsigned long)moves->room, sizeof *moves->moves);
        }
        moves->moves[moves->count++] = job->moves[i];
    }
}

static void play(const struct scene *scene, const struct motion *motion, struct touch_moves *out) {
    struct session_settings settings = session_settings_default();
    struct session *session = session_create(scene, &settings);
    struct operation *operation = operation_create(scene, settings.rules, instruments_usual());
    struct session_output output;
    session_step(session, &(struct session_input){.kind = INPUT_START}, &output);
    for (size_t row = 0; row < motion->row_count; row++) {
        struct session_input input = {.kind = INPUT_FRAME, .frame = frame_of(motion, row)};
        input.time_ns = input.frame.time_ns;
        session_step(session, &input, &output);
        while (output.job.id) {
            const struct case_group *group =
                &scene_case(scene)->groups[scene_tissue_group(scene, output.job.tissue)];
            snprintf(out->group, sizeof out->group, "%s", group->name);
            note(out, &output.job);
            struct job_result *result = operation_run(operation, &output.job);
            input = (struct session_input){
                .kind = INPUT_JOB, .time_ns = input.time_ns, .job = result->job, .result = result};
            session_step(session, &input, &output);
            job_result_destroy(&result);
        }
    }
    session_destroy(&session);
    operation_destroy(&operation);
}

// ---- the lesions of a recipe, on another knee
// ----------------------------------------------------

// depth: of the tears, as a share of the recipe's.
static enum result make_alike(const char *dir, const struct recipe *recipe, double depth,
                              struct knee_case **out_knee, struct error *err) {
    enum result result = case_load(dir, NULL, out_knee, err);
    for (int i = 0; result == RESULT_OK && i < recipe->step_count; i++) {
        struct pathology step = recipe->steps[i];
        if (step.kind == PATHOLOGY_TEAR)
            step.tear.tear.depth_mm *= depth;
        result = pathology_apply(*out_knee, &step, recipe->rim_mm, err);
    }
    if (result != RESULT_OK)
        case_destroy(out_knee);
    return result;
}

// A narrow meniscus has no room for a tear as deep: then as deep as it has.
static enum result make_knee(const char *dir, const char *name, struct knee_case **out_knee,
                             struct error *err) {
    char path[4096];
    struct recipe recipe;
    if (!dir)
        return paper_knee(name, out_knee, err);
    snprintf(path, sizeof path, "%s/%s", CASES, name);
    enum result result = recipe_load(path, &recipe, err);
    if (result != RESULT_OK)
        return result;
    for (int tenths = 10; tenths >= LEAST_DEPTH_TENTHS; tenths--) {
        result = make_alike(dir, &recipe, 0.1 * tenths, out_knee, err);
        if (result != RESULT_INVALID)
            break;
    }
    return result;
}

enum result touch_resection(const char *dir, const char *recipe, struct knee_case **out_knee,
                            struct touch_moves *out_moves, struct error *err) {
    struct motion_script script;
    struct motion motion = {0};
    struct scene *scene = NULL;
    struct knee_case *played = NULL;
    *out_moves = (struct touch_moves){0};
    *out_knee = NULL;
    enum result result = make_knee(dir, recipe, out_knee, err);
    if (result == RESULT_OK)
        result = make_knee(dir, recipe, &played, err);
    if (result == RESULT_OK)
        result = motion_script_load(CASES "/motions/resection.ini", &script, err);
    if (result == RESULT_OK)
        result = motion_plan(played, &script, &motion, err);
    if (result == RESULT_OK)
        result = scene_create(&played, &scene, err);
    if (result == RESULT_OK)
        play(scene, &motion, out_moves);
    motion_fini(&motion);
    scene_destroy(&scene);
    case_destroy(&played);
    if (result != RESULT_OK)
        case_destroy(out_knee);
    return result;
}
