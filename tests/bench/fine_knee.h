// Torn menisci as fine as a scan's, for times.
#pragma once

#include "case/case.h"

#define FINE_TRIANGLES 20000 // about so many has a meniscus
#define FINE_LESIONS 5
extern const char *const fine_lesions[FINE_LESIONS]; // recipes of cases/, one for each way to tear

// The caller destroys it.
enum result fine_knee(const char *recipe, struct knee_case **out_knee, struct error *err);
