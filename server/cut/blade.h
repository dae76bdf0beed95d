// The blades of the instruments: the volume that a blade removes as it moves from one frame to the
// next.
//
// The tip's frame: origin at the tip, z along the shaft away from the handle, y the side to which a
// punch's upper jaw opens and a knife's edge looks.
#pragma once

#include "cut/cut.h"

enum blade_kind { BLADE_PUNCH, BLADE_SHAVER, BLADE_KNIFE, BLADE_COUNT };

const char *blade_name(enum blade_kind kind); // "punch", "shaver", "knife"

struct blade_move {
    enum blade_kind kind;
    pose T_mesh_tip[2]; // before and after
    double opening[2];  // punch: 0 closed, 1 open
};

// The convex parts that the move takes, at most CUT_PARTS_MAX:
//   punch   what the upper jaw sweeps as it closes, where the tip is after the move: nothing while
//           it opens or stands still. If the tip has moved by less than 0.5 mm, from where the jaw
//           was before, so that a hand that trembles leaves no film between two moves
//   shaver  the burr, swept along the move; where it stands, the burr itself
//   knife   the wedge behind the edge, swept along the move, as wide as its kerf
// The number of parts, 0 where the move takes nothing. -1 where a part cannot be made: the error
// says which, why and where.
int blade_parts(const struct blade_move *move, struct convex out_parts[CUT_PARTS_MAX],
                struct error *err);

// No point of a part is farther than this from the straight line along which the tip's origin
// moves.
double blade_reach_mm(enum blade_kind kind);
