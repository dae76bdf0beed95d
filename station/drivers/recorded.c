// Plays a motion file, the recording of one tool or a sequence metafile in its own time.
//
//   file              the table or the metafile (drivers/recording.h)
//   channel           the tool's channel, for a recording of one tool
//   tool.CHANNEL      its transform in a metafile
//   loop              yes: from the start again at the end; no: silent then. yes
//   T_mockup_tracker  where the file's frame lies in the mock-up's
//   tip.CHANNEL       T_tool_tip

#include "base/check.h"
#include "base/clock.h"
#include "drivers/drivers.h"
#include "drivers/options.h"
#include "drivers/recording.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct recorded {
    struct recording recording;
    bool loop;
    pose T_mockup_tracker, T_tool_tip[CHANNEL_COUNT];
    int row;          // the next one
    int64_t start_ns; // when the first row was or will be
};

static enum result read_file(struct recorded *d, const struct device_config *config,
                             const char *file, enum channel unnamed, struct error *err) {
    struct recording_tools tools = {.unnamed = unnamed};
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        char key[64];
        snprintf(key, sizeof key, "tool.%s", channel_name((enum channel)i));
        const char *name = option_text(config, key);
        if (!name)
            continue;
        if (i == CHANNEL_JOINT || unnamed != CHANNEL_COUNT)
            return option_fail(config, key, err, RESULT_INVALID,
                               i == CHANNEL_JOINT ? "the joint is not a tool"
                                                  : "the channel is given");
        if (!*name || strlen(name) >= RECORDING_NAME_MAX)
            return option_fail(config, key, err, RESULT_INVALID, "a name has 1 to %d bytes",
                               RECORDING_NAME_MAX - 1);
        strcpy(tools.names[i], name);
    }
    enum result result = recording_read_tools(file, &tools, &d->recording, err);
    return result == RESULT_OK ? RESULT_OK
                               : fail_in(err, result, "[device %s] file: ", config->name);
}

static enum result configure_recorded(struct recorded *d, const struct device_config *config,
                                      struct error *err) {
    static const char *const keys[] = {"file", "channel",          "loop", "tool.",
                                       "tip.", "T_mockup_tracker", NULL};
    char file[OPTION_TEXT_MAX];
    enum channel channel;
    enum result result = options_check(config, keys, err);
    if (result == RESULT_OK)
        result = option_required(config, "file", file, err);
    if (result == RESULT_OK)
        result = option_channel(config, "channel", CHANNEL_COUNT, &channel, err);
    if (result == RESULT_OK && channel == CHANNEL_JOINT)
        result = option_fail(config, "channel", err, RESULT_INVALID, "the joint is not a tool");
    if (result == RESULT_OK)
        result = option_switch(config, "loop", true, &d->loop, err);
    if (result == RESULT_OK)
        result = option_pose(config, "T_mockup_tracker", &d->T_mockup_tracker, err);
    if (result == RESULT_OK)
        result = option_poses(config, "tip", d->T_tool_tip, err);
    return result == RESULT_OK ? read_file(d, config, file, channel, err) : result;
}

static enum result recorded_create(const struct device_config *config, void **out_device,
                                   struct device_outputs *out_outputs, struct error *err) {
    struct recorded *d = alloc(1, sizeof *d);
    enum result result = configure_recorded(d, config, err);
    if (result != RESULT_OK) {
        recording_fini(&d->recording);
        free(d);
        return result;
    }
    if (d->recording.joints)
        outputs_add(out_outputs, CHANNEL_JOINT, SAMPLE_JOINT);
    for (int i = 0; i < d->recording.tool_count; i++) {
        outputs_add(out_outputs, d->recording.tools[i].channel, SAMPLE_POSE);
        if (d->recording.tools[i].has_opening)
            outputs_add(out_outputs, d->recording.tools[i].channel, SAMPLE_HANDLE);
        if (d->recording.tools[i].has_force)
            outputs_add(out_outputs, d->recording.tools[i].channel, SAMPLE_FORCE);
    }
    *out_device = d;
    return RESULT_OK;
}

static void add_tool(const struct recorded *d, int tool, int64_t time_ns,
                     struct device_reading *reading) {
    const struct recording_tool *t = &d->recording.tools[tool];
    const struct recording_state *state = &t->states[d->row];
    pose T_mockup_tool = pose_compose(d->T_mockup_tracker, state->pose);
    reading->samples[reading->count++] = (struct sample){
        .channel = t->channel,
        .kind = SAMPLE_POSE,
        .validity = state->valid ? VALIDITY_OK : VALIDITY_LOST,
        .time_ns = time_ns,
        .T_mockup_body = pose_compose(T_mockup_tool, d->T_tool_tip[t->channel]),
    };
    if (t->has_opening)
        reading->samples[reading->count++] = (struct sample){
            .channel = t->channel,
            .kind = SAMPLE_HANDLE,
            .time_ns = time_ns,
            .handle = {.opening = state->opening},
        };
    if (t->has_force)
        reading->samples[reading->count++] = (struct sample){
            .channel = t->channel,
            .kind = SAMPLE_FORCE,
            .time_ns = time_ns,
            .force_n = state->force_n,
        };
}

// A recording begins anew at most a second after its end.
static int64_t pause_before(const struct recording *r, int row) {
    return row ? (int64_t)((r->t_seconds[row] - r->t_seconds[row - 1]) * NS_PER_S) : NS_PER_S;
}

static enum result recorded_poll(void *device, struct device_reading *reading, struct error *err) {
    struct recorded *d = device;
    const struct recording *r = &d->recording;
    if (d->row == r->row_count && d->loop) {
        d->row = 0;
        d->start_ns += (int64_t)(recording_period(r) * NS_PER_S);
    }
    if (d->row == r->row_count) {
        wait_until(INT64_MAX);
        return fail(err, RESULT_TIMEOUT, "the recording has ended");
    }
    int64_t time_ns = d->start_ns + (int64_t)((r->t_seconds[d->row] - r->t_seconds[0]) * NS_PER_S);
    int64_t back_ns = time_ns - due_within(time_ns, pause_before(r, d->row) + NS_PER_MS);
    d->start_ns -= back_ns; // the clock went back
    time_ns -= back_ns;
    if (!wait_until(time_ns))
        return RESULT_OK;
    if (r->joints)
        reading->samples[reading->count++] = (struct sample){
            .channel = CHANNEL_JOINT,
            .kind = SAMPLE_JOINT,
            .time_ns = time_ns,
            .joint = r->joints[d->row],
        };
    for (int i = 0; i < r->tool_count; i++)
        add_tool(d, i, time_ns, reading);
    d->row++;
    return RESULT_OK;
}

static enum result recorded_open(void *device, struct error *err) {
    (void)err;
    struct recorded *d = device;
    d->row = 0;
    d->start_ns = clock_now_ns();
    return RESULT_OK;
}

static void recorded_close(void *device) {
    (void)device;
}

static void recorded_destroy(void *device) {
    struct recorded *d = device;
    recording_fini(&d->recording);
    free(d);
}

const struct device_driver recorded_driver = {
    "recorded", recorded_create, recorded_open, recorded_poll, recorded_close, recorded_destroy,
};
