// The blades of the instruments that cut (base/instrument.h): the volume that a blade removes as it
// moves from one frame to the next.
//
// The tip's frame: origin at the tip, z along the shaft away from the handle, y the side to which
// an upper jaw opens and a blade's edge looks.
#pragma once

#include "base/instrument.h"
#include "cut/cut.h"

// The number of an instrument's blade in jobs and traces: its channel's, from the punch.
enum { BLADE_PUNCH, BLADE_SHAVER, BLADE_KNIFE, BLADE_MOST = CHANNEL_COUNT - 1 - CHANNEL_PUNCH };

static inline int blade_of_instrument(int instrument) { // from 0, the probe; not of the probe
    return instrument + CHANNEL_FIRST_INSTRUMENT - CHANNEL_PUNCH;
}

static inline int instrument_of_blade(int blade) {
    return blade + CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT;
}

struct blade_move {
    int blade;
    pose T_mesh_tip[2]; // before and after
    double opening[2];  // jaw: 0 closed, 1 open
};

// The convex parts that the move takes, at most CUT_PARTS_MAX:
//   jaw     what the upper jaw sweeps as it closes, where the tip is after the move: nothing while
//           it opens or stands still. If the tip has moved by less than 0.5 mm, from where the jaw
//           was before, so that a hand that trembles leaves no film between two moves
//   burr    swept along the move; where it stands, the burr itself
//   blade   the wedge behind the edge, swept along the move, as wide as its kerf. One that turns is
//           swept in several parts. tightly: in fewer, which fit closer; not under older rules
//           (step/settings.h)
// The number of parts, 0 where the move takes nothing. -1 where a part cannot be made: the error
// says which, why and where. `instruments` have the move's blade, and it cuts.
int blade_parts(const struct instruments *instruments, const struct blade_move *move, bool tightly,
                struct convex out_parts[CUT_PARTS_MAX], struct error *err);

// No point of a part is farther than this from the straight line along which the tip's origin
// moves.
double blade_reach_mm(const struct instrument *instrument);
