#include "export/tracks.h"

#include "base/check.h"

#include <stdlib.h>

static void make_room(struct tracks *t) {
    if (t->count < t->room)
        return;
    t->room = t->room ? 2 * t->room : 1024;
    t->seconds = alloc_resize(t->seconds, t->room, sizeof *t->seconds);
    for (int i = 0; i < TRACK_COUNT; i++) {
        if (t->poses[i])
            t->poses[i] = alloc_resize(t->poses[i], t->room, sizeof(pose));
        if (t->shown[i])
            t->shown[i] = alloc_resize(t->shown[i], t->room, sizeof(bool));
    }
}

// What is not known now stays where it was; a record may hold what no reader of scenes takes.
static void take_pose(struct tracks *t, int track, pose here, bool known) {
    pose last = {.rotation = quat_identity()};
    if (t->count)
        last = t->poses[track][t->count - 1];
    t->poses[track][t->count] = known && pose_is_valid(here) ? here : last;
}

static void take_instrument(struct tracks *t, int i, const struct instrument_output *from) {
    if (!t->poses[TRACK_WARPED + i])
        return;
    t->shown[TRACK_WARPED + i][t->count] = t->shown[TRACK_HAND + i][t->count] = from->present;
    take_pose(t, TRACK_WARPED + i, from->T_mockup_warped, from->present);
    take_pose(t, TRACK_HAND + i, from->T_mockup_tip, from->present);
}

static void take_loose(struct tracks *t, int i, const struct loose_output *from) {
    bool inside = from->state != LOOSE_OUT;
    t->shown[TRACK_LOOSE + i][t->count] = inside;
    take_pose(t, TRACK_LOOSE + i, from->T_mockup_loose, inside);
}

static void take_key(struct tracks *t, const struct session_output *output, float seconds) {
    make_room(t);
    t->seconds[t->count] = seconds;
    for (int i = 0; i < BODY_COUNT; i++) {
        take_pose(t, TRACK_VIRTUAL + i, output->T_mockup_virtual[i], true);
        take_pose(t, TRACK_PHYSICAL + i, output->T_mockup_body[i], true);
    }
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        take_instrument(t, i, &output->instruments[i]);
    for (int i = 0; i < output->loose_count; i++)
        take_loose(t, i, &output->loose[i]);
    t->count++;
}

static bool is_there(int track, const struct contents *contents) {
    if (track >= TRACK_LOOSE)
        return track - TRACK_LOOSE < contents->header.loose_count;
    return track < TRACK_WARPED || contents->present[(track - TRACK_WARPED) % INSTRUMENT_COUNT];
}

// The first room, so that those that there are can be told from others.
static void begin(struct tracks *t, const struct contents *contents) {
    *t = (struct tracks){0};
    for (int i = 0; i < TRACK_COUNT; i++) {
        if (!is_there(i, contents))
            continue;
        t->poses[i] = alloc(1, sizeof(pose));
        t->shown[i] = i >= TRACK_WARPED ? alloc(1, sizeof(bool)) : NULL;
    }
}

static bool on_track_step(void *user, const struct trace_record *record, double seconds) {
    struct tracks *t = user;
    if (t->count == 0)
        t->first_s = seconds;
    float since = (float)(seconds - t->first_s);
    if (t->count == 0 || (double)since >= (double)t->seconds[t->count - 1] + TRACK_KEY_S)
        take_key(t, &record->output, since);
    return true;
}

enum result tracks_create(struct walk *walk, const struct contents *contents, struct tracks *t,
                          struct error *err) {
    begin(t, contents);
    enum result result = walk_run(walk, contents, on_track_step, t, err);
    if (result == RESULT_OK && t->count == 0)
        result = fail(err, RESULT_MISSING, "%s has no step in that time", walk->request->trace);
    if (result != RESULT_OK)
        tracks_fini(t);
    return result;
}

void tracks_fini(struct tracks *t) {
    free(t->seconds);
    for (int i = 0; i < TRACK_COUNT; i++) {
        free(t->poses[i]);
        free(t->shown[i]);
    }
    *t = (struct tracks){0};
}
