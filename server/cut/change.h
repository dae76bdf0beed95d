// What a cut has done to a mesh, told from what the undo log remembers.
#pragma once

#include "cut/tissue.h"

// Before tissue_commit. Pieces are left as they are.
void change_gather(struct cut_mesh *mesh, struct cut_change *change);
