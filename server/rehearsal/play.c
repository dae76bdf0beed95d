#include "rehearsal/play.h"

#include "base/check.h"
#include "base/clock.h"
#include "step/session.h"

#include <stdlib.h>

// A job takes so long, so the moves of a closing jaw go into few jobs.
#define JOB_NS (100 * NS_PER_MS)

struct play {
    struct session *session;
    struct operation *operation;
    const struct site *site;
    struct attempt attempt;
    struct session_output output; // of the last step
    struct play_watch watch;
    double row_ns;
    size_t played; // rows
    struct job_result *landing;
    int64_t lands_ns;
};

static void step(struct play *play, const struct session_input *input) {
    struct session_output *output = &play->output;
    session_step(play->session, input, output);
    attempt_step(&play->attempt, play->site, output);
    if (play->watch.step)
        play->watch.step(play->watch.user, input, output);
    if (!output->job.id)
        return;
    play->landing = operation_run(play->operation, &output->job);
    play->lands_ns = output->time_ns + JOB_NS;
}

static void land(struct play *play, int64_t time_ns) {
    struct job_result *result = play->landing;
    if (!result || time_ns < play->lands_ns)
        return;
    play->landing = NULL;
    step(play, &(struct session_input){
                   .kind = INPUT_JOB, .time_ns = time_ns, .job = result->job, .result = result});
    job_result_destroy(&result);
}

static void add_sample(struct frame *frame, struct sample sample) {
    sample.time_ns = frame->time_ns;
    frame->samples[frame->count++] = sample;
}

static void add_tool(struct frame *frame, enum channel channel,
                     const struct motion_tool_state *state) {
    bool runs = channel == CHANNEL_SHAVER && state->opening > 0;
    add_sample(frame, (struct sample){.channel = channel,
                                      .kind = SAMPLE_POSE,
                                      .T_mockup_body = state->T_mockup_tip});
    add_sample(frame, (struct sample){.channel = channel,
                                      .kind = SAMPLE_HANDLE,
                                      .handle = {state->opening, runs ? 1 : 0}});
}

static void play_row(struct play *play, const struct motion *motion, size_t row, int64_t time_ns) {
    const struct motion_row *r = &motion->rows[row];
    struct session_input input = {
        .kind = INPUT_FRAME, .time_ns = time_ns, .frame = {.number = row + 1, .time_ns = time_ns}};
    add_sample(&input.frame,
               (struct sample){.channel = CHANNEL_JOINT, .kind = SAMPLE_JOINT, .joint = r->joint});
    for (int i = 0; i < motion->tool_count; i++)
        add_tool(&input.frame, motion->tools[i].channel, &r->tools[i]);
    step(play, &input);
}

struct play *play_create(double rate_hz, const struct scene *scene, const struct site *site,
                         const struct play_watch *watch) {
    struct session_settings settings = session_settings_default();
    settings.instruments = *site_tools(site);
    struct play *play = alloc(1, sizeof *play);
    play->session = session_create(scene, &settings);
    play->operation = operation_create(scene, settings.rules, &settings.instruments);
    play->site = site;
    play->watch = watch ? *watch : (struct play_watch){0};
    play->row_ns = NS_PER_S / rate_hz;
    attempt_init(&play->attempt);
    step(play, &(struct session_input){.kind = INPUT_START});
    return play;
}

void play_destroy(struct play **play) {
    if (!*play)
        return;
    job_result_destroy(&(*play)->landing);
    operation_destroy(&(*play)->operation);
    session_destroy(&(*play)->session);
    free(*play);
    *play = NULL;
}

void play_on(struct play *play, const struct motion *motion) {
    while (play->played < motion->row_count && play->attempt.end == ATTEMPT_RUNS) {
        int64_t time_ns = (int64_t)((double)(play->played + 1) * play->row_ns);
        land(play, time_ns);
        play_row(play, motion, play->played++, time_ns);
    }
}

const struct attempt *play_attempt(const struct play *play) {
    return &play->attempt;
}

size_t play_rows(const struct play *play) {
    return play->played;
}

vec3 play_loose(const struct play *play, int index) {
    return play->output.loose[index].T_mockup_loose.translation;
}

const struct operation *play_operation(const struct play *play) {
    return play->operation;
}

void play_motion(const struct motion *motion, double rate_hz, const struct scene *scene,
                 const struct site *site, const struct play_watch *watch,
                 struct attempt *out_attempt) {
    struct play *play = play_create(rate_hz, scene, site, watch);
    play_on(play, motion);
    *out_attempt = play->attempt;
    attempt_leave(out_attempt, true);
    play_destroy(&play);
}
