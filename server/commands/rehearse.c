#include "commands/rehearse.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/number.h"
#include "commands/commands.h"
#include "confine/confine.h"
#include "rehearsal/play.h"
#include "rehearsal/rehearsal.h"
#include "runtime/attempt_state.h"
#include "runtime/reply.h"
#include "wire/live.h"

#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define REHEARSAL_CPU_S 60
#define MOMENTS_HZ 25
#define BATCH_MAX (size_t)(8 << 20)

// ---- the other process --------------------------------------------------------------------------

// A batch that grows while the hands play.
struct recording {
    const struct knee_case *knee;
    struct snapshot_maker moments;
    int64_t due_ns;
    arthron_Live item;
    uint8_t *bytes;
    size_t used, room;
};

static void say(struct recording *r) {
    size_t size;
    if (r->room - r->used < LIVE_ITEM_MAX) {
        r->room = 2 * r->room + LIVE_ITEM_MAX;
        r->bytes = alloc_resize(r->bytes, r->room, 1);
    }
    CHECK(live_encode(&r->item, r->bytes + r->used, LIVE_ITEM_MAX, &size) == RESULT_OK);
    r->used += size;
}

static void say_session(struct recording *r, const char *case_name, const struct site *site,
                        int64_t length_ns) {
    r->item = (arthron_Live){.which_message = arthron_Live_session_tag};
    arthron_LiveSession *out = &r->item.message.session;
    out->recorded = true;
    snprintf(out->case_name, sizeof out->case_name, "%s", case_name);
    snprintf(out->own_case, sizeof out->own_case, "%s", case_name);
    out->case_hash = r->knee->hash;
    out->length_ns = length_ns;
    out->strength = (float)session_settings_default().field.strength;
    out->optic_deg = (float)site_optic(site)->tilt_deg;
    out->optic_view_deg = (float)site_optic(site)->field_deg;
    wire_session_instruments_from(site_tools(site), out);
    reply_groups(r->knee, out);
    say(r);
}

static void take_step(void *user, const struct session_input *input,
                      const struct session_output *output) {
    struct recording *r = user;
    (void)input;
    snapshot_step(&r->moments, output);
    if (output->time_ns < r->due_ns)
        return;
    r->due_ns = output->time_ns + NS_PER_S / MOMENTS_HZ;
    r->item = (arthron_Live){.which_message = arthron_Live_moment_tag};
    snapshot_to_wire(&r->moments.now, 0, &r->item.message.moment);
    say(r);
}

static void say_attempt(struct recording *r, const struct session_attempt *attempt) {
    r->item = (arthron_Live){.which_message = arthron_Live_attempt_tag};
    attempt_state(attempt, &r->item.message.attempt);
    say(r);
}

static void say_end(struct recording *r) {
    r->item = (arthron_Live){.which_message = arthron_Live_progress_tag,
                             .message.progress = {.share = 1, .done = true}};
    say(r);
}

// Plays the hands once more, for the pages.
static enum result record(const struct task_file *file, const struct rehearsal *rehearsal,
                          const struct scene *scene, const char *case_name, struct recording *out,
                          struct error *err) {
    const struct task *task = &file->task;
    struct view_optic optic = task_optic(task);
    struct site_pool *pool = site_pool_create();
    struct session_attempt attempt = {
        .number = 1, .pass_time_s = task->pass_time_s, .pass_errors = task->pass_errors};
    enum result result =
        shared_site_take(pool, file, scene, instruments_of_hands(), &optic, &attempt.site, err);
    if (result == RESULT_OK) {
        const struct site *site = shared_site_site(attempt.site);
        double rate_hz = rehearsal->script->rate_hz;
        out->knee = scene_case(scene);
        snapshot_begin(&out->moments, 0, 0);
        say_session(out, case_name, site,
                    (int64_t)((double)rehearsal->motion.row_count / rate_hz * NS_PER_S));
        play_motion(&rehearsal->motion, rate_hz, scene, site, &(struct play_watch){out, take_step},
                    &attempt.attempt);
        say_attempt(out, &attempt);
        say_end(out);
        shared_site_release(&attempt.site);
    }
    site_pool_destroy(&pool);
    return result;
}

static enum result compute(char **argv, struct recording *out, struct error *err) {
    struct task_file *file = alloc(1, sizeof *file);
    struct knee_case *knee = NULL;
    struct scene *scene = NULL;
    struct rehearsal rehearsal = {.goal = -1};
    enum result result = task_read(argv[1], file, err);
    if (result == RESULT_OK)
        result = rehearsal_load(argv[2], &knee, &scene, err);
    if (result == RESULT_OK)
        result = rehearse(&file->task, knee, scene, HANDS_EXPERT, 0, NULL, &rehearsal, err);
    if (result == RESULT_OK && rehearsal.goal >= 0)
        result = RESULT_MISSING;
    if (result == RESULT_OK)
        result = record(file, &rehearsal, scene, argv[3], out, err);
    rehearsal_fini(&rehearsal);
    scene_destroy(&scene);
    case_destroy(&knee);
    free(file);
    return result;
}

int command_rehearse(int argc, char **argv) {
    struct confine_limits limits = {.cpu_s = REHEARSAL_CPU_S};
    struct recording recording = {0};
    struct error err = {""};
    int64_t memory_mb;
    if (argc != 5 || !number_int(argv[4], 1, 1 << 20, &memory_mb)) {
        fputs("arthron-server rehearse: the server alone uses this command\n", stderr);
        return 2;
    }
    limits.memory_mb = (int)memory_mb;
    confine_self(&limits);
    enum result result = compute(argv, &recording, &err);
    int status = confine_answer(result, &err, recording.bytes, recording.used);
    free(recording.bytes);
    return status;
}

// ---- the server ---------------------------------------------------------------------------------

static atomic_bool broken_off;

void rehearse_break_off(void) {
    atomic_store(&broken_off, true);
}

enum result rehearse_apart(const struct rehearse_request *request, uint8_t **out_batch,
                           size_t *out_size, struct error *err) {
    const struct confine_limits limits = {
        .memory_mb = request->memory_mb, .cpu_s = REHEARSAL_CPU_S, .cancelled = &broken_off};
    char memory_mb[16];
    snprintf(memory_mb, sizeof memory_mb, "%d", request->memory_mb);
    const char *const arguments[] = {"arthron-server",   "rehearse", request->task, request->dir,
                                     request->case_name, memory_mb,  NULL};
    return confine_run(arguments, &limits, BATCH_MAX, out_batch, out_size, err);
}
