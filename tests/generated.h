// Knees that tests make from recipes.
#pragma once

#include "generate/generate.h"
#include "test.h"

// Of a recipe's folder. The test fails where it cannot be made; the caller destroys it.
static inline struct knee_case *generated_knee(const char *recipe_dir) {
    struct recipe recipe;
    struct knee_case *knee;
    struct error err;
    if (recipe_load(recipe_dir, &recipe, &err) != RESULT_OK ||
        generate_knee(&recipe, &knee, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return knee;
}

// A healthy knee. rim_mm: of the maxcut, 0: none.
static inline struct knee_case *plain_knee(enum side side, double resolution_mm, double rim_mm) {
    struct recipe recipe = {.name = "test",
                            .title = "Test",
                            .side = side,
                            .size = 1,
                            .resolution_mm = resolution_mm,
                            .meniscus_medial_cm3 = 2.4,
                            .meniscus_lateral_cm3 = 2.4,
                            .rim_mm = rim_mm};
    struct knee_case *knee;
    struct error err;
    if (generate_knee(&recipe, &knee, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return knee;
}
