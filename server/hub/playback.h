// A recorded session, played for one page as fast as that takes it: the same messages as of a live
// one, in the order in which things happened. It runs on a thread of its own that comes after all
// else, reads the trace, and runs it again for the meshes. What waits for the page is bounded.
#pragma once

#include "hub/viewer.h"

struct playback;

// ---- the thread of the pages

// What the viewer watches. The viewer's reference.
struct playback *playback_create(struct audience *audience, const struct viewer *viewer);
void playback_leave(struct playback **playback); // it ends soon; the reference is given back
void playback_batch(struct playback *playback, struct batch *batch);

// ---- the usher

struct playback *playback_hold(struct playback *playback);
void playback_release(struct playback **playback);
// Before the start: something about it, or that there will be none.
void playback_tell(struct playback *playback, arthron_Trouble_Kind kind, const char *trouble);
void playback_fail(struct playback *playback, arthron_Trouble_Kind kind, const char *why);
void playback_start(struct playback *playback, sem_t *ended); // posted at its end
bool playback_is_left(const struct playback *playback);
bool playback_has_ended(const struct playback *playback);
void playback_join(struct playback *playback); // one that was started
// While others wait it gives up where its page takes nothing for too long (audience.h).
void playback_others_wait(struct playback *playback, bool wait);
