// What another server tells, on its way to a page: what comes out is a batch, and bounded.
#include "live/passing.h"

#include "base/check.h"
#include "fuzz/fuzz.h"

#include <stdlib.h>

static int on_find(void *user, const char *station, int likely) {
    (void)user, (void)likely;
    return station[0] % 4 - 1;
}

static bool on_wanted(void *user, uint32_t kind, int station) {
    (void)user;
    return kind != arthron_Live_beat_tag && station < 3;
}

static void on_reply(void *user, const uint8_t *item, size_t size) {
    uint32_t kind;
    (void)user;
    CHECK(passing_first(item, size, &kind) == size && kind == arthron_Live_command_reply_tag);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    int own[16] = {-1, 3, 2, 1};
    struct passing_numbers numbers = {16, own};
    struct passing passing = {&numbers, NULL, on_find, on_wanted, on_reply, 0};
    static uint8_t merged[LIVE_ITEM_MAX];
    uint8_t *out = malloc(PASSING_GROWTH * size + 1);
    size_t out_size, at = 0, whole;
    uint32_t kind;
    passing_take(&passing, data, size, out, &out_size);
    CHECK(out_size <= PASSING_GROWTH * size);
    while ((whole = passing_first(out + at, out_size - at, &kind)))
        at += whole;
    CHECK(at == out_size);
    whole = passing_first(data, size, &kind);
    whole = passing_merge(data, whole, data + whole, size - whole, merged, sizeof merged);
    CHECK(whole == 0 || passing_first(merged, whole, &kind) == whole);
    free(out);
    return 0;
}
