// Pictures of a case with its landmarks and portals.
#pragma once

#include "case/case.h"

#include <stdio.h>

// From the front in extension and at 70 degrees of flexion, and on top of the tibia, as figures of
// a page (report/html.h). The meshes are those of the mock-up (S).
enum result landmarks_pictures(FILE *file, struct knee_case *knee, struct error *err);
