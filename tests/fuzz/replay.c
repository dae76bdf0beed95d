// Runs a fuzz target without a fuzzer: replay FOLDER COUNT gives it every file of the folder, then
// COUNT mutations of them, which are the same each time.
#include "base/check.h"
#include "base/number.h"
#include "fuzz/fuzz.h"
#include "random.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SEEDS_MAX 256
#define INPUT_MAX (1 << 17)

struct seeds {
    int count;
    struct seed {
        uint8_t *bytes;
        size_t size;
    } seeds[SEEDS_MAX];
};

static int is_file(const struct dirent *entry) {
    return entry->d_name[0] != '.';
}

static struct seed read_seed(const char *path) {
    FILE *file = fopen(path, "rbe");
    CHECK(file);
    struct seed seed = {alloc(INPUT_MAX, 1), 0};
    seed.size = fread(seed.bytes, 1, INPUT_MAX, file);
    fclose(file);
    return seed;
}

// In the order of their names: a folder has no order of its own.
static void read_seeds(const char *folder, struct seeds *out) {
    struct dirent **entries;
    int count = scandir(folder, &entries, is_file, alphasort);
    CHECK(count > 0 && count <= SEEDS_MAX);
    out->count = count;
    for (int i = 0; i < count; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s", folder, entries[i]->d_name);
        out->seeds[i] = read_seed(path);
        free(entries[i]);
    }
    free(entries);
}

static size_t below(struct random *r, size_t limit) {
    return limit ? (size_t)(random_bits(r) % limit) : 0;
}

static void overwrite(struct random *r, struct seed *input) {
    static const uint64_t odd[] = {0,          1,          0x7f,      0x80,
                                   0xff,       0x7fff,     0xffff,    0x7fffffff,
                                   0x80000000, UINT32_MAX, INT64_MAX, UINT64_MAX};
    uint64_t value = odd[below(r, sizeof odd / sizeof *odd)];
    size_t width = (size_t)1 << below(r, 4), at = below(r, input->size);
    for (size_t i = 0; i < width && at + i < input->size; i++)
        input->bytes[at + i] = (uint8_t)(value >> 8 * i);
}

static void take_out(struct random *r, struct seed *input) {
    size_t at = below(r, input->size), size = 1 + below(r, input->size - at);
    memmove(input->bytes + at, input->bytes + at + size, input->size - at - size);
    input->size -= size;
}

static void put_in(struct random *r, struct seed *input, const struct seed *from) {
    size_t begin = below(r, from->size), size = 1 + below(r, from->size - begin);
    size_t at = below(r, input->size + 1);
    if (!from->size || size > INPUT_MAX - input->size)
        return;
    memmove(input->bytes + at + size, input->bytes + at, input->size - at);
    memcpy(input->bytes + at, from->bytes + begin, size);
    input->size += size;
}

static void mutate(struct random *r, struct seed *input, const struct seed *other) {
    uint64_t kind = random_bits(r) % 16;
    if (kind == 0)
        put_in(r, input, other);
    else if (!input->size)
        return;
    else if (kind == 1)
        take_out(r, input);
    else if (kind == 2)
        input->size = below(r, input->size);
    else if (kind < 6)
        overwrite(r, input);
    else if (kind < 11)
        input->bytes[below(r, input->size)] = (uint8_t)random_bits(r);
    else
        input->bytes[below(r, input->size)] ^= (uint8_t)(1 << below(r, 8));
}

static void run(const struct seed *input) {
    uint8_t *exact = malloc(input->size); // so that a sanitizer sees the first byte too many
    CHECK(exact || !input->size);
    memcpy(exact, input->bytes, input->size);
    LLVMFuzzerTestOneInput(exact, input->size);
    free(exact);
}

static void run_mutation(int64_t number, const struct seeds *seeds) {
    static uint8_t bytes[INPUT_MAX];
    struct random r = {(uint64_t)number};
    const struct seed *seed = &seeds->seeds[below(&r, (size_t)seeds->count)];
    struct seed input = {bytes, seed->size};
    memcpy(bytes, seed->bytes, seed->size);
    for (size_t i = 1 + below(&r, 6); i > 0; i--)
        mutate(&r, &input, &seeds->seeds[below(&r, (size_t)seeds->count)]);
    run(&input);
}

int main(int argc, char **argv) {
    static struct seeds seeds;
    int64_t count;
    if (argc != 3 || !number_int(argv[2], 0, INT32_MAX, &count)) {
        fprintf(stderr, "usage: %s FOLDER COUNT\n", argv[0]);
        return 2;
    }
    read_seeds(argv[1], &seeds);
    for (int i = 0; i < seeds.count; i++)
        run(&seeds.seeds[i]);
    for (int64_t i = 0; i < count; i++)
        run_mutation(i, &seeds);
    for (int i = 0; i < seeds.count; i++)
        free(seeds.seeds[i].bytes);
    printf("%d inputs, %lld mutations\n", seeds.count, (long long)count);
    return 0;
}
