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
