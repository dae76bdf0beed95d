#include "scene/played.h"

#include "base/clock.h"
#include "generate/generate.h"

#include <stdio.h>

static enum result make_case(const char *recipe_path, const char *dir, struct knee_case **out_case,
                             struct error *err) {
    struct recipe recipe;
    struct case_limits limits = case_limits_default();
    struct knee_case *made;
    enum result result = recipe_load(recipe_path, &recipe, err);
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &made, err);
    if (result != RESULT_OK)
        return result;
    result = case_save(made, dir, err);
    case_destroy(&made);
    return result == RESULT_OK ? case_load(dir, &limits, out_case, err) : result;
}

enum result played_init(const char *cases, const char *recipe, const char *dir,
                        struct played *out_played, struct error *err) {
    char path[512];
    struct motion_script script;
    struct knee_case *knee;
    *out_played = (struct played){0};
    snprintf(path, sizeof path, "%s/%s", cases, recipe);
    enum result result = make_case(path, dir, &knee, err);
    if (result != RESULT_OK)
        return result;
    snprintf(path, sizeof path, "%s/motions/palpation.ini", cases);
    result = motion_script_load(path, &script, err);
    if (result == RESULT_OK)
        result = motion_plan(knee, &script, &out_played->motion, err);
    if (result == RESULT_OK)
        result = scene_create(&knee, &out_played->scene, err);
    if (result != RESULT_OK) {
        motion_fini(&out_played->motion);
        case_destroy(&knee);
    }
    return result;
}

void played_fini(struct played *played) {
    motion_fini(&played->motion);
    scene_destroy(&played->scene);
}

static void add_sample(struct frame *frame, struct sample sample, size_t row) {
    sample.time_ns = frame->time_ns;
    sample.validity = row % 97 == 96 ? VALIDITY_LOST : VALIDITY_OK;
    frame->samples[frame->count++] = sample;
}

static void frame_of_row(const struct motion *motion, size_t row, struct frame *frame) {
    const struct motion_row *r = &motion->rows[row];
    frame->number = row + 1;
    frame->count = 0;
    add_sample(frame,
               (struct sample){.channel = CHANNEL_JOINT, .kind = SAMPLE_JOINT, .joint = r->joint},
               0);
    for (int i = 0; i < motion->tool_count; i++) {
        enum channel channel = motion->tools[i].channel;
        add_sample(frame,
                   (struct sample){.channel = channel,
                                   .kind = SAMPLE_POSE,
                                   .T_mockup_body = r->tools[i].T_mockup_tip},
                   row + (size_t)i);
        add_sample(frame,
                   (struct sample){.channel = channel,
                                   .kind = SAMPLE_HANDLE,
                                   .handle = {r->tools[i].opening, (uint32_t)row % 3}},
                   0);
    }
}

static enum input_kind kind_at(size_t row) {
    switch (row % 500) {
    case 200:
        return INPUT_PAUSE;
    case 210:
        return INPUT_START;
    case 300:
        return INPUT_EMPTY;
    case 380:
        return INPUT_UNDO;
    case 400:
        return row < 500 ? INPUT_RESET : INPUT_FRAME; // later ones would leave little to score
    default:
        return INPUT_FRAME;
    }
}

struct play {
    struct session *session;
    struct operation *operation;
    struct job_result *pending;
    void (*each)(void *, const struct session_input *, const struct session_output *);
    void *context;
};

static void step(struct play *play, const struct session_input *input) {
    struct session_output output;
    session_step(play->session, input, &output);
    play->each(play->context, input, &output);
    if (!output.job.id)
        return;
    job_result_destroy(&play->pending);
    play->pending = operation_run(play->operation, &output.job);
}

static void land(struct play *play, int64_t time_ns) {
    struct job_result *result = play->pending;
    play->pending = NULL;
    struct session_input input = {
        .kind = INPUT_JOB, .time_ns = time_ns, .job = result->job, .result = result};
    step(play, &input);
    job_result_destroy(&result);
}

void played_run(const struct played *played, const struct session_settings *settings, size_t rows,
                void (*each)(void *context, const struct session_input *input,
                             const struct session_output *output),
                void *context) {
    struct play play = {session_create(played->scene, settings),
                        operation_create(played->scene, settings->rules, instruments_usual()), NULL,
                        each, context};
    struct session_input input = {.kind = INPUT_START};
    step(&play, &input);
    for (size_t row = 0; row < rows && row < played->motion.row_count; row++) {
        input.kind = kind_at(row);
        input.time_ns = (int64_t)((double)NS_PER_S * played->motion.rows[row].t_seconds);
        if (play.pending && row % 3 == 0) // jobs take their time
            land(&play, input.time_ns);
        input.frame.time_ns = input.time_ns;
        frame_of_row(&played->motion, row, &input.frame);
        step(&play, &input);
    }
    input.kind = INPUT_STOP;
    step(&play, &input);
    session_destroy(&play.session);
    operation_destroy(&play.operation);
    job_result_destroy(&play.pending);
}
