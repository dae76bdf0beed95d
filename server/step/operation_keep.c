#include "base/check.h"
#include "step/operation_parts.h"
#include "step/settings.h"

#include <stdlib.h>

static void keep_cut(struct operated_tissue *t, struct past_cut *cut, struct kept *k) {
    kept_u64(k, &cut->number);
    kept_bytes(k, &cut->stroke, sizeof cut->stroke);
    blade_move_keep(&cut->move, t->instruments, k);
    kept_bytes(k, &cut->before, sizeof cut->before);
    kept_count(k, &cut->fits, t->fitting ? fitting_count(t->fitting) : 0);
}

// In the order in which they were made.
static bool follows(const struct operated_tissue *t, uint32_t i) {
    const struct past_cut *cut = &t->cuts[i];
    return !i || (cut->number > cut[-1].number && cut->fits >= cut[-1].fits);
}

static void keep_cuts(struct operated_tissue *t, uint64_t cuts, struct kept *k) {
    uint32_t count = t->cut_count;
    kept_count(k, &count, UINT32_MAX / 4);
    kept_holds(k, count <= kept_left(k) / sizeof(struct blade_move));
    if (k->reads && !k->bad) {
        t->was_read = true;
        t->cuts = alloc(count, sizeof *t->cuts);
        t->cut_room = count;
    }
    for (uint32_t i = 0; i < count && !k->bad; i++) {
        keep_cut(t, &t->cuts[i], k);
        kept_holds(k, t->cuts[i].number <= cuts && follows(t, i));
        t->cut_count = i + 1;
    }
}

// Of tissue without a cut the figures tell all: refused cuts and jobs that made it whole count.
static void keep_tissue(struct operated_tissue *t, uint64_t cuts, struct kept *k) {
    bool is_cut = t->cut_count;
    kept_flag(k, &is_cut);
    if (!is_cut) {
        kept_bytes(k, &t->now.figures, sizeof t->now.figures);
        return;
    }
    if (k->reads)
        operated_take_over(t);
    tissue_state_keep(&t->now, t->scene, k);
    if (t->fitting)
        fitting_keep(t->fitting, k);
    kept_count(k, &t->fitted_since, UINT32_MAX - 1);
    keep_cuts(t, cuts, k);
}

void operation_keep(struct operation *operation, struct kept *k) {
    kept_u64(k, &operation->cuts);
    kept_int(k, &operation->count, operation->count, operation->count);
    for (int i = 0; i < operation->count && !k->bad; i++) {
        CHECK(operation->tissues[i].rules >= RULES_TOUCH_FITTED);
        keep_tissue(&operation->tissues[i], operation->cuts, k);
    }
}
