// Plays a recorded session for one page, as fast as the page takes it. The page gets the messages
// of a live session, in the order in which things happened. A thread of low priority reads the
// trace and runs it again for the meshes. The messages that wait for the page are bounded.
#pragma once

#include "live/viewer.h"

struct playback;

// Only the web server's thread calls these functions.

// Of the session that the viewer watches. The caller owns the reference.
struct playback *playback_create(struct live_server *live, const struct viewer *viewer);
void playback_start(struct playback *playback);  // when its turn comes
void playback_leave(struct playback **playback); // ends it soon, and releases the reference
// The trace is not here, and another server may have it: this one, or where it is empty, any.
bool playback_is_missing(const struct playback *playback, const char **out_server);
void playback_batch(struct playback *playback, struct live_batch *batch);
