// A recorded session, played for one page as fast as that takes it: the same messages as of a live
// one, in the order in which things happened. It runs on a thread of its own that comes after all
// else, reads the trace, and runs it again for the meshes. What waits for the page is bounded.
#pragma once

#include "live/viewer.h"

struct playback;

// All by the thread of the pages.

// What the viewer watches. The caller owns the reference.
struct playback *playback_create(struct live_server *live, const struct viewer *viewer);
// Queues it behind those that are played. False where there are too many.
bool playback_start(struct playback *playback);
void playback_leave(struct playback **playback); // it ends soon; the reference is given back
void playback_batch(struct playback *playback, struct live_batch *batch);
