// Parts of one group as one outer surface: cartilage on its bone.
//
// Where two parts meet, their walls bound a void that no instrument enters. They would be touched
// there, and the warp would count them as a second and third sheet below the cartilage. So they are
// marked as covered: nothing is moved, and the parts stay closed.
#pragma once

#include "case/case.h"

// Between parts that are nearer there is no room for an instrument.
#define COVER_GAP_MM 0.5

// Marks the vertices of closed parts all of whose triangles lie within another closed part, face
// one within COVER_GAP_MM, or lie below an open sheet as cartilage is thick (group->covered). A
// group of one part has none. Of triangles of two parts in one place that face the same way, those
// of the earlier part stay. The surface that is left has the distance of the whole from everywhere
// outside but in those voids. RESULT_IO as query_create.
enum result cover_parts(struct case_group *group, struct error *err);
