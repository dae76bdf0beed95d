// Arrays that grow and keep their memory.
#pragma once

#include "base/check.h"

#include <stdint.h>

// Memory for at least `need` items, those that are there kept.
#define room_for(array, room, need)                                                                \
    do {                                                                                           \
        if ((need) > *(room)) {                                                                    \
            *(room) = 2 * (need) + 64;                                                             \
            *(array) = alloc_resize(*(array), *(room), sizeof **(array));                          \
        }                                                                                          \
    } while (0)
