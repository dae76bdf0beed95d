#include "base/chance.h"

#include "base/check.h"

#include <stdbool.h>
#include <sys/random.h>

void chance_fill(void *out, size_t size) {
    bool filled = getrandom(out, size, 0) == (ssize_t)size; // below 256 bytes no signal interrupts
    NEED(filled, "random bytes");
}
