#include "device/guard.h"

void guard_init(struct guard *guard, double jump_mm, double jump_deg) {
    *guard = (struct guard){.jump_mm = jump_mm, .jump_rad = jump_deg * RAD_PER_DEG};
}

void guard_forget(struct guard *guard) {
    guard->taken = guard->caught = (struct history){0};
}

bool guard_is_catching(const struct guard *guard, int64_t now_ns) {
    return guard->caught.count && now_ns - guard->seen_ns < GUARD_PREDICTION_NS;
}

static bool near(const struct guard *guard, pose a, pose b) {
    return vec3_distance(a.translation, b.translation) <= guard->jump_mm &&
           quat_angle(a.rotation, b.rotation) <= guard->jump_rad;
}

static bool follows(const struct guard *guard, const struct history *h, int64_t time_ns, pose p) {
    int newest = (h->next + HISTORY_LENGTH - 1) % HISTORY_LENGTH;
    pose predicted;
    if (near(guard, h->poses[newest], p))
        return true;
    return history_at(h, time_ns, GUARD_PREDICTION_NS, &predicted) == HISTORY_PREDICTED &&
           near(guard, predicted, p);
}

static bool confirmed(struct guard *guard, int64_t time_ns, pose p) {
    if (guard->caught.count && !follows(guard, &guard->caught, time_ns, p))
        guard->caught = (struct history){0};
    if (!guard->caught.count)
        guard->caught_since_ns = time_ns;
    history_add(&guard->caught, time_ns, p);
    return guard->caught.count >= GUARD_CONFIRMATIONS &&
           time_ns - guard->caught_since_ns >= GUARD_CONFIRMATION_NS;
}

bool guard_takes(struct guard *guard, int64_t time_ns, pose p) {
    if (time_ns - guard->seen_ns > GUARD_MEMORY_NS)
        guard_forget(guard);
    guard->seen_ns = time_ns;
    if (!guard->taken.count || follows(guard, &guard->taken, time_ns, p)) {
        guard->caught = (struct history){0};
        return history_add(&guard->taken, time_ns, p);
    }
    if (!confirmed(guard, time_ns, p))
        return false;
    guard->taken = guard->caught;
    guard->caught = (struct history){0};
    return true;
}
