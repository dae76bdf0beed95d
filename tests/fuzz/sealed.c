// Encrypted backups. A first byte says whether the rest is a file that somebody hands over, or what
// is done to a good one. Nobody without the passphrase makes a file that is read, and a file that
// is not read leaves nothing behind. Costs of keys are not paid.
#include "base/bytes.h"
#include "base/check.h"
#include "commands/sealed_file.h"
#include "fuzz/fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define PASSPHRASE "a known one"
#define PIECE 65536
#define HEADER (16 + 12 + 16 + 8 + 16)
#define SEALED_PIECE (PIECE + 16)
#define MORE_MAX 70000 // bytes that changes may add to a file

static const size_t sizes[] = {0, 1, PIECE - 1, PIECE, PIECE + 1, 2 * PIECE + 50};
#define SIZES (sizeof sizes / sizeof *sizes)

struct bytes {
    uint8_t *data;
    size_t size;
};

// ---- files --------------------------------------------------------------------------------------

static const char *in_folder(const char *name, char out[320]) {
    snprintf(out, 320, "%s/%s", fuzz_folder(), name);
    return out;
}

static struct bytes read_whole(const char *path) {
    struct bytes file = {alloc(SIZES * PIECE, 1), 0};
    FILE *in = fopen(path, "rbe");
    CHECK(in);
    file.size = fread(file.data, 1, SIZES * PIECE, in);
    fclose(in);
    return file;
}

static enum result unseal(const struct bytes *sealed, char back[320]) {
    char part[320];
    unlink(in_folder("back", back));
    enum result result = sealed_file_read(fuzz_file("sealed", sealed->data, sealed->size),
                                          PASSPHRASE, back, &(struct error){""});
    CHECK((access(back, F_OK) == 0) == (result == RESULT_OK));
    CHECK(access(in_folder("back.part", part), F_OK) != 0);
    return result;
}

// A plain file and the sealed one, made once.
static void good_file(size_t index, const struct bytes **out_plain, const struct bytes **out_good) {
    static struct bytes plain[SIZES], good[SIZES];
    char path[320];
    if (!good[index].data) {
        plain[index] = (struct bytes){alloc(sizes[index] + 1, 1), sizes[index]};
        for (size_t i = 0; i < sizes[index]; i++)
            plain[index].data[i] = (uint8_t)(i * 7 + i / 251);
        unlink(in_folder("good", path));
        enum result made = sealed_file_write(fuzz_file("plain", plain[index].data, sizes[index]),
                                             PASSPHRASE, path, NULL);
        CHECK(made == RESULT_OK);
        good[index] = read_whole(path);
    }
    *out_plain = &plain[index];
    *out_good = &good[index];
}

// ---- changes ------------------------------------------------------------------------------------

static void take_out(struct bytes *file, size_t at, size_t size) {
    size = size < file->size - at ? size : file->size - at;
    memmove(file->data + at, file->data + at + size, file->size - at - size);
    file->size -= size;
}

// A copy of what begins at `from`.
static void put_in(struct bytes *file, size_t room, size_t at, size_t from, size_t size) {
    static uint8_t copy[SEALED_PIECE];
    size = size < file->size - from ? size : file->size - from;
    size = size < room - file->size ? size : room - file->size;
    memcpy(copy, file->data + from, size);
    memmove(file->data + at + size, file->data + at, file->size - at);
    memcpy(file->data + at, copy, size);
    file->size += size;
}

// What is done, where, and how much of it.
static void change(struct bytes *file, size_t room, uint8_t kind, size_t at, uint16_t much) {
    size_t pieces = (file->size - HEADER) / SEALED_PIECE + 1;
    size_t piece = HEADER + at % pieces * SEALED_PIECE;
    at %= file->size;
    piece = piece < file->size ? piece : HEADER;
    if (kind % 6 == 0)
        file->data[at] ^= (uint8_t)much;
    else if (kind % 6 == 1)
        file->size = at;
    else if (kind % 6 == 2)
        take_out(file, at, much);
    else if (kind % 6 == 3)
        put_in(file, room, at, much % file->size, much);
    else if (kind % 6 == 4)
        take_out(file, piece, SEALED_PIECE);
    else
        put_in(file, room, file->size, piece, SEALED_PIECE);
}

// A byte for the size, then six for each change.
static void changed(const uint8_t *data, size_t size) {
    const struct bytes *plain, *good;
    struct reader r = {data, size, 0, false};
    char path[320];
    good_file(read_u8(&r) % SIZES, &plain, &good);
    size_t room = good->size + MORE_MAX;
    struct bytes file = {alloc(room, 1), good->size};
    memcpy(file.data, good->data, good->size);
    for (int i = 0; i < 8 && size - r.used >= 6 && file.size > HEADER; i++) {
        uint8_t kind = read_u8(&r);
        size_t at = read_u8(&r);
        at = at << 16 | read_u16(&r);
        change(&file, room, kind, at, read_u16(&r));
    }
    bool same = file.size == good->size && !memcmp(file.data, good->data, file.size);
    CHECK((unseal(&file, path) == RESULT_OK) == same);
    free(file.data);
    if (!same)
        return;
    struct bytes back = read_whole(path);
    CHECK(back.size == plain->size && !memcmp(back.data, plain->data, back.size));
    free(back.data);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char path[320];
    if (size && data[0] == 'f')
        CHECK(unseal(&(struct bytes){(uint8_t *)data + 1, size - 1}, path) != RESULT_OK);
    else if (size > 1 && data[0] == 'c')
        changed(data + 1, size - 1);
    return 0;
}
