#include "device/guard.h"

void guard_init(struct guard *guard, double jump_mm) {
    *guard = (struct guard){.jump_mm = jump_mm};
}

void guard_forget(struct guard *guard) {
    guard->taken = guard->caught = (struct history){0};
}

static bool near(pose a, pose b, double limit_mm) {
    return vec3_distance(a.translation, b.translation) <= limit_mm;
}

static bool follows(const struct history *h, double limit_mm, int64_t time_ns, pose p) {
    int newest = (h->next + HISTORY_LENGTH - 1) % HISTORY_LENGTH;
    pose predicted;
    if (near(h->poses[newest], p, limit_mm))
        return true;
    return history_at(h, time_ns, GUARD_PREDICTION_NS, &predicted) == HISTORY_PREDICTED &&
           near(predicted, p, limit_mm);
}

static bool confirmed(struct guard *guard, int64_t time_ns, pose p) {
    if (guard->caught.count && !follows(&guard->caught, guard->jump_mm, time_ns, p))
        guard->caught = (struct history){0};
    history_add(&guard->caught, time_ns, p);
    return guard->caught.count >= GUARD_CONFIRMATIONS;
}

bool guard_takes(struct guard *guard, int64_t time_ns, pose p) {
    if (!guard->taken.count || follows(&guard->taken, guard->jump_mm, time_ns, p)) {
        guard->caught = (struct history){0};
        return history_add(&guard->taken, time_ns, p);
    }
    if (!confirmed(guard, time_ns, p))
        return false;
    guard->taken = guard->caught;
    guard->caught = (struct history){0};
    return true;
}
