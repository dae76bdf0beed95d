// Describes what a cut changed, from the undo log. Call these in this order, before edit_commit.
#pragma once

#include "cut/cut_mesh.h"

void change_update_volume(struct cut_mesh *mesh); // by the triangles that have changed
void change_take_pieces(struct cut_mesh *mesh, struct cut_change *change);
void change_list_ids(struct cut_mesh *mesh, struct cut_change *change);
void change_measure_patches(struct cut_mesh *mesh, struct cut_change *change);
