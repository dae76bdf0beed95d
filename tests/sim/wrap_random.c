// Random bytes of the programs under test: they follow from the seed too.
#include "sim/threads.h"

#include <string.h>
#include <sys/types.h>

static void fill(uint8_t *out, size_t size) {
    for (size_t i = 0; i < size; i++)
        out[i] = (uint8_t)(random_bits(sim_random()) >> 24);
}

ssize_t __wrap_getrandom(void *out, size_t size, unsigned flags);
ssize_t __wrap_getrandom(void *out, size_t size, unsigned flags) {
    (void)flags;
    fill(out, size);
    return (ssize_t)size;
}

int __wrap_RAND_bytes(unsigned char *out, int size);
int __wrap_RAND_bytes(unsigned char *out, int size) {
    fill(out, (size_t)size);
    return 1;
}
