#include "metrics/touch.h"

#include <string.h>

const double touch_depth_mm[TOUCH_DEPTHS] = {0.1, 0.5, 1};

void touch_init(struct touch *t) {
    memset(t, 0, sizeof *t);
}

void touch_step(struct touch *t, int64_t time_ns, int nearest, double nearest_mm) {
    t->touching = nearest >= 0 && nearest_mm <= (t->touching ? TOUCH_ENDS_MM : TOUCH_BEGINS_MM);
    if (!t->touching)
        return;
    if (time_ns - t->last_ns > TOUCH_APART_NS)
        t->groups_now = 0;
    t->last_ns = time_ns;
    uint32_t bit = 1u << nearest;
    t->groups[nearest].count += !(t->groups_now & bit);
    t->groups_now |= bit;
}

void touch_pass(struct touch *t, int nearest, double penetration_mm, int64_t passed_ns) {
    if (nearest < 0)
        return;
    struct group_touch *group = &t->groups[nearest];
    if (t->touching)
        group->touching_ns += passed_ns;
    group->deepest_mm = fmax(group->deepest_mm, penetration_mm);
    int depth = TOUCH_DEPTHS - 1;
    while (depth >= 0 && penetration_mm < touch_depth_mm[depth])
        depth--;
    if (depth >= 0)
        group->deep_ns[depth] += passed_ns;
}
