// The moving parts of a session, thinned out for an animation.
#pragma once

#include "export/contents.h"

// A key is taken where the last one is at least so long ago.
#define TRACK_KEY_S 0.0155

enum {
    TRACK_VIRTUAL = 0,           // + enum body
    TRACK_PHYSICAL = BODY_COUNT, // + enum body
    TRACK_WARPED = 2 * BODY_COUNT,
    TRACK_HAND = TRACK_WARPED + INSTRUMENT_COUNT,
    TRACK_LOOSE = TRACK_HAND + INSTRUMENT_COUNT, // + a loose body of the case
    TRACK_COUNT = TRACK_LOOSE + CASE_LOOSE_MAX
};

struct tracks {
    double first_s;           // of the session: where the animation begins
    uint32_t count, room;     // keys
    float *seconds;           // since first_s, rising
    pose *poses[TRACK_COUNT]; // T_mockup_X; NULL: an instrument that never came, or no such loose
                              // body
    bool *shown[TRACK_COUNT]; // NULL: always; where it is false the pose is the last known
};

// One pass. RESULT_MISSING where there is no step in the time asked for.
enum result tracks_create(struct walk *walk, const struct contents *contents,
                          struct tracks *out_tracks, struct error *err);
void tracks_fini(struct tracks *tracks);
