#include "case/library_memory.h"

#include "base/check.h"

#include <jansson.h>
#include <stdlib.h>

static void *allocate(size_t size) {
    return alloc(1, size);
}

void json_uses_our_memory(void) {
    json_set_alloc_funcs(allocate, free);
}
