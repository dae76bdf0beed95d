// What a viewer is shown: the newest bones and instruments, each avatar gone on with the hand from
// the server's last answer (base/extrapolation.h):
//
//     T_mockup_warped = B_now · place(follow(lead, B_sent⁻¹ · T_sent, B_now⁻¹ · T_now))
//
// with B the pose of the body whose surface is nearest, T the tip's, *sent* those of the frame that
// was answered, *now* the newest. No socket, no clock, no thread; only predict_create allocates.
#pragma once

#include "wire/wire.h"

// An answer is good for so long; until it is lost, the avatar is held: it still goes on with it.
// How old answers usually are when they come, up to PREDICT_WAY_MAX_NS, does not count.
#define PREDICT_GOOD_NS (100 * INT64_C(1000000))
#define PREDICT_LOST_NS (1000 * INT64_C(1000000))
#define PREDICT_WAY_MAX_NS (500 * INT64_C(1000000))

#define PREDICT_REMEMBERED 2048 // frames that are sent and not answered: a power of two

struct predict;

struct predict *predict_create(void);
void predict_destroy(struct predict **predict);

// The session changed. knee: NULL where there is no session. With another case's hash all answers
// of before are void.
void predict_session(struct predict *predict, arthron_SessionState state, const char *case_name,
                     uint64_t case_hash, const struct knee_frame *knee);

// Replies to come are those of this connection; each counts its events from 0.
void predict_connection(struct predict *predict, uint64_t connection);

// The newest samples; `sent`: they went to the server under the frame's number, which is above all
// before.
void predict_frame(struct predict *predict, const struct frame *frame, bool sent);

// A decoded reply. False where it was dropped: its frame is forgotten, or older than that of the
// last reply. What it says of events counts all the same.
bool predict_reply(struct predict *predict, const arthron_Reply *reply);

// How far the last reply moved a tip; the largest of its instruments.
double predict_warp_mm(const struct predict *predict);

arthron_SessionState predict_state(const struct predict *predict);

// At the newest frame.
void predict_view(const struct predict *predict, arthron_View *out_view);
