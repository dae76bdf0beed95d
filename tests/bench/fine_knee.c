#include "fine_knee.h"

#include "generate/generate.h"

#include <math.h>
#include <stdio.h>

#define MENISCUS_MM2 5200.0 // over the square of its edges, its triangles

const char *const fine_lesions[FINE_LESIONS] = {"tear-flap", "tear-radial", "tear-horizontal",
                                                "tear-bucket-handle", "tear-arthrosis"};

enum result fine_knee(const char *name, struct knee_case **out_knee, struct error *err) {
    char path[4096];
    struct recipe recipe;
    snprintf(path, sizeof path, "%s/%s", CASES, name);
    enum result result = recipe_load(path, &recipe, err);
    recipe.resolution_mm = 2 * sqrt(MENISCUS_MM2 / FINE_TRIANGLES); // menisci have half of it
    return result == RESULT_OK ? generate_knee(&recipe, out_knee, err) : result;
}
