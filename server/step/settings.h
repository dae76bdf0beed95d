// Settings of a session: the warp, and how new blends are eased in.
#pragma once

#include "base/instrument.h"
#include "warp/adaptive.h"
#include "warp/avatar.h"

// The shape of an instrument, for contacts away from its tip (warp/avatar.h).
struct instrument_body {
    int point_count; // 1 to AVATAR_POINTS_MAX; the first is the tip
    struct avatar_point points[AVATAR_POINTS_MAX];
};

// Counts in range, places within 300 mm of the tip, radii from 0 to 20 mm, the first at the origin.
bool instrument_body_is_valid(const struct instrument_body *body);

// The rules that a step follows. A changed meaning gets a new number, so that an older trace can be
// run again by its own rules:
//   1  The job of a cut has one move, which grows while another job is under way. A paused session
//      shows no instruments.
//   2  Moves that are made while a job is under way wait, and a job may have several moves. A
//      paused session shows its instruments.
//   3  After a cut the touched surface is fitted to the cut mesh, with an offset for each vertex
//      (match/conform.h), and where touch and sight still differ is measured. Before, it had a
//      blend for each vertex (match/match.h).
//   4  Torn ligaments open along a straighter ramp (warp/adaptive.h).
//   5  A punch that trembles as its jaw closes leaves no film between two moves (cut/blade.h).
//      What a cut changes of the touch is eased in so that a hand that comes back feels no jump.
//   6  A sample is as old as it was when its frame was closed, plus the time since that frame
//      came. So the frame's way, up to 1 s of it, makes no device silent.
//   7  Where nothing of a tissue is left far and wide, its touch lies down on the plateau
//      (match/conform.h). Of tissue that never gives way, what cuts took from it is told as touched
//      where nothing is seen.
//   8  The hold of a sample counts from the last frame that told it as ok. So a device that tells
//      late what it measured, by up to 1 s, or seldom, is not lost.
//   9  The gains and the turn of a discrepancy are of the derivative (step/discrepancy.h), not of
//      differences.
//  10  The integral field adds up the same sums in another order: its last digits are others. Older
//      traces are run again in this order, too, and replay to within those.
//  11  The touched surface is fitted in fewer and rougher steps (match/conform.h).
//  12  A blade that turns is swept in fewer parts, which fit closer (cut/blade.h).
#define RULES_NEWEST 12
#define RULES_WITH_WAITING_MOVES 2
#define RULES_SHOWN_WHILE_PAUSED 2
#define RULES_TOUCH_FITTED 3
#define RULES_WITH_STRAIGHT_RAMP 4
#define RULES_WITHOUT_FILMS 5
#define RULES_EASED_BEHIND 5
#define RULES_WITHOUT_TRAVEL 6
#define RULES_TOUCH_LAID 7
#define RULES_STILL_TOLD 7
#define RULES_HELD_FROM_FRAME 8
#define RULES_BY_DERIVATIVE 9
#define RULES_OTHER_ORDER 10
#define RULES_FITTED_QUICKLY 11
#define RULES_SWEPT_TIGHTLY 12

struct session_settings {
    int rules; // 1 to RULES_NEWEST
    struct field field;
    enum adaptive_kind adaptive;
    enum avatar_mode avatar; // without a portal in the case: tip
    struct instruments instruments;
    struct instrument_body bodies[INSTRUMENT_COUNT];
    int64_t hold_ns; // how long the last sample is used after its device falls silent
    // A cut's new warp is eased in: in one step the displacement at a tip may change by ease_share
    // of the tip's own way, plus ease_mm_s times the time since the last step.
    double ease_share;
    double ease_mm_s;
};

// The newest rules; the integral field with a skin of 0.1 mm, hinge, tip, 100 ms, 0.2, 2 mm/s;
// the usual instruments, all of them straight with a point every 7 mm of the 49 mm behind the tip.
struct session_settings session_settings_default(void);

// What steps of these settings are run by here although their rules were others: no more than last
// digits. NULL: by all of their rules.
const char *settings_digits(const struct session_settings *settings);

// Of torn ligaments, by the rules.
enum adaptive_ramp settings_ramp(const struct session_settings *settings);
