#include "runtime/late_frames.h"

#include <math.h>
#include <stddef.h>

static bool is_handle(const struct sample *sample) {
    return sample->kind == SAMPLE_HANDLE && sample->channel >= CHANNEL_FIRST_INSTRUMENT &&
           sample->validity != VALIDITY_LOST;
}

// ---- handles ------------------------------------------------------------------------------------

// The nearest frame before (step -1) or after (step 1) that told of this handle.
static const struct handle *neighbour(const struct handle_told *told, uint64_t number, int step) {
    for (uint64_t i = 1; i < LATE_HANDLES && (step > 0 || i < number); i++) {
        uint64_t other = step > 0 ? number + i : number - i;
        if (told[other % LATE_HANDLES].number == other)
            return &told[other % LATE_HANDLES].handle;
    }
    return NULL;
}

static void remember(struct late_frames *late, uint64_t number, const struct sample *sample) {
    int instrument = (int)sample->channel - CHANNEL_FIRST_INSTRUMENT;
    late->handles[instrument][number % LATE_HANDLES] = (struct handle_told){number, sample->handle};
}

// What lies between two neighbours is told by them; what lies beyond both is told by this alone.
static void keep_handle(struct late_frames *late, uint64_t number, const struct sample *sample) {
    int instrument = (int)sample->channel - CHANNEL_FIRST_INSTRUMENT;
    const struct handle *before = neighbour(late->handles[instrument], number, -1);
    const struct handle *after = neighbour(late->handles[instrument], number, 1);
    const struct handle *now = &sample->handle;
    struct late_handle *kept = &late->late[instrument];
    if (!after)
        return;
    if (!before)
        before = after;
    uint32_t pressed = now->buttons & ~before->buttons & ~after->buttons;
    uint32_t released = ~now->buttons & before->buttons & after->buttons;
    bool closed = now->opening < fmin(before->opening, after->opening);
    bool opened = now->opening > fmax(before->opening, after->opening);
    remember(late, number, sample);
    if (!pressed && !released && !closed && !opened)
        return;
    kept->pressed |= pressed;
    kept->released |= released;
    if (closed || (opened && !kept->has_opening)) {
        kept->opening = kept->has_opening ? fmin(kept->opening, now->opening) : now->opening;
        kept->has_opening = true;
    }
    if (sample->time_ns > kept->time_ns)
        kept->time_ns = sample->time_ns;
}

static void change_handle(const struct late_handle *kept, struct handle *handle) {
    handle->buttons = (handle->buttons | kept->pressed) & ~(kept->released & ~kept->pressed);
    if (kept->has_opening)
        handle->opening = kept->opening;
}

// ---- samples that are newer ---------------------------------------------------------------------

static bool is_same(const struct sample *a, const struct sample *b) {
    return a->channel == b->channel && a->kind == b->kind;
}

static void keep_newer(struct late_frames *late, const struct sample *sample) {
    int i = 0;
    while (i < late->count && !is_same(&late->newer[i], sample))
        i++;
    if (i == FRAME_SAMPLES_MAX)
        return;
    if (i < late->count && late->newer[i].time_ns >= sample->time_ns)
        return;
    late->newer[i] = *sample;
    late->count += i == late->count;
}

static struct sample *find_sample(struct frame *frame, const struct sample *like) {
    for (int i = 0; i < frame->count; i++)
        if (is_same(&frame->samples[i], like))
            return &frame->samples[i];
    return NULL;
}

// A frame that names the channel itself says what is so now.
static void add_newer(struct late_frames *late, struct frame *frame, int64_t hold_ns) {
    for (int i = 0; i < late->count; i++) {
        const struct sample *sample = &late->newer[i];
        if (!find_sample(frame, sample) && frame->count < FRAME_SAMPLES_MAX &&
            frame->time_ns - sample->time_ns <= hold_ns)
            frame->samples[frame->count++] = *sample;
    }
    late->count = 0;
}

// ---- frames -------------------------------------------------------------------------------------

void late_frames_keep(struct late_frames *late, const struct frame *frame) {
    for (int i = 0; i < frame->count; i++) {
        const struct sample *sample = &frame->samples[i];
        if (sample->validity == VALIDITY_LOST)
            continue;
        if (sample->time_ns > late->told_ns[sample->channel][sample->kind])
            keep_newer(late, sample);
        else if (is_handle(sample))
            keep_handle(late, frame->number, sample);
    }
}

static void note(struct late_frames *late, const struct frame *frame) {
    for (int i = 0; i < frame->count; i++) {
        const struct sample *sample = &frame->samples[i];
        late->told_ns[sample->channel][sample->kind] = sample->time_ns;
        if (is_handle(sample))
            remember(late, frame->number, sample);
    }
}

void late_frames_merge(struct late_frames *late, struct frame *frame, int64_t hold_ns) {
    note(late, frame);
    add_newer(late, frame, hold_ns);
    for (int i = 0; i < frame->count; i++) {
        struct sample *sample = &frame->samples[i];
        if (!is_handle(sample))
            continue;
        struct late_handle *kept = &late->late[sample->channel - CHANNEL_FIRST_INSTRUMENT];
        if (kept->time_ns && frame->time_ns - kept->time_ns <= hold_ns)
            change_handle(kept, &sample->handle);
        *kept = (struct late_handle){0};
    }
}
