// The blade moves of a planned resection, as a session makes them.
#pragma once

#include "case/case.h"
#include "cut/blade.h"

struct touch_moves {
    struct blade_move *moves;
    int count, room;
    char group[CASE_NAME_MAX]; // that they cut
};

// Plays cases/motions/resection.ini on the case of a recipe, which it generates; with the folder of
// a case, on that one, which then has the recipe's tears, less deep where it is too narrow. The
// caller frees out_moves->moves and destroys *out_knee.
enum result touch_resection(const char *dir, const char *recipe, struct knee_case **out_knee,
                            struct touch_moves *out_moves, struct error *err);
