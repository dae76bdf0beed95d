// Takes crossings out of S'' again, and brings its volume to the wanted one.
#include "match/conform_parts.h"

#include <math.h>
#include <string.h>

#define SOFT 0.03 // stiffness of the last steps
#define ROUNDS 12
#define REFITS 4
#define HALVINGS 4
#define BACK_ROUNDS 10
#define SETTLE_ROUNDS 6

void conform_advance(struct conform *c, double stiffness, const struct conform_goal *goal) {
    conform_find_rows(c, stiffness);
    for (uint32_t i = 0; i < c->active_count; i++)
        c->bent[i] = vec3_scale(-1, c->gradient[i]);
    conform_solve(c, c->bent, c->step);
    conform_limit(c, c->step);
    for (uint32_t i = 0; i < c->active_count; i++) {
        vec3 *p = &c->positions[c->active[i]];
        *p = vec3_add(*p, c->step[i]);
    }
    if (goal)
        conform_settle(c, goal->live_mm3, goal->tolerance_mm3);
}

// The neighbours of what is tied, ring by ring.
static void spread(struct conform *c, int rings) {
    for (int ring = 0; ring < rings; ring++) {
        uint32_t count = 0;
        for (uint32_t i = 0; i < c->active_count; i++) {
            uint32_t v = c->active[i];
            bool beside = false;
            for (uint32_t k = c->surface->first[v]; k < c->surface->first[v + 1]; k++)
                beside = beside || c->tied[c->surface->opposites[k].from];
            if (beside && !c->tied[v])
                c->queue[count++] = v;
        }
        for (uint32_t i = 0; i < count; i++)
            c->tied[c->queue[i]] = 1;
    }
}

static void trust_all(struct conform *c) {
    for (uint32_t i = 0; i < c->near_count; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t v = c->surface->triangles[3 * (size_t)c->near[i] + (size_t)k];
            c->trust[v] = 1;
            c->bend[v] = 0;
        }
}

// From round to round more of S'' is more of a membrane.
static void soften(struct conform *c, int round) {
    static const double trust[] = {0.1, 0.03, 0.01}, bend[] = {0.2, 0.6, 2};
    int level = round < 3 ? 0 : round < 6 ? 1 : 2;
    spread(c, round < 3 ? 1 : round - 1);
    for (uint32_t i = 0; i < c->active_count; i++) {
        uint32_t v = c->active[i];
        if (!c->tied[v] && round < 9)
            continue;
        c->trust[v] = lower(c->trust[v], trust[level]);
        c->bend[v] = higher(c->bend[v], bend[level]);
    }
}

static void keep(struct conform *c) {
    for (uint32_t i = 0; i < c->active_count; i++)
        c->kept[c->active[i]] = c->positions[c->active[i]];
}

static void take_kept(struct conform *c) {
    for (uint32_t i = 0; i < c->active_count; i++)
        c->positions[c->active[i]] = c->kept[c->active[i]];
}

// The fit again, where smoothing has left S'' off T; a part that would cross takes less of it.
static bool refit(struct conform *c, const struct conform_goal *goal) {
    keep(c);
    conform_advance(c, SOFT, goal);
    uint32_t crossings = conform_cross(c);
    for (int i = 0; crossings && i < HALVINGS; i++) {
        spread(c, 1);
        for (uint32_t k = 0; k < c->active_count; k++) {
            uint32_t v = c->active[k];
            if (c->tied[v])
                c->positions[v] = vec3_lerp(c->kept[v], c->positions[v], 0.5);
        }
        crossings = conform_cross(c);
    }
    if (crossings)
        take_kept(c);
    return !crossings;
}

uint32_t conform_go_back(struct conform *c) {
    uint32_t count = 0;
    keep(c);
    for (uint32_t i = 0; i < c->active_count; i++)
        c->factor[c->active[i]] = 1;
    for (int round = 0; round < BACK_ROUNDS && conform_cross(c); round++) {
        spread(c, 1 + round / 2);
        for (uint32_t i = 0; i < c->active_count; i++) {
            uint32_t v = c->active[i];
            if (!c->tied[v] && round < BACK_ROUNDS - 1)
                continue;
            c->factor[v] = round < BACK_ROUNDS / 2 ? 0.5 * c->factor[v] : 0;
            c->positions[v] =
                c->factor[v] > 0 ? vec3_lerp(c->before[v], c->kept[v], c->factor[v]) : c->before[v];
        }
    }
    for (uint32_t i = 0; i < c->active_count; i++)
        count += c->factor[c->active[i]] < 1;
    return count;
}

// What would cross for the sake of the volume stays where it is.
static void settle(struct conform *c, const struct conform_goal *goal) {
    keep(c);
    conform_find_rows(c, SOFT);
    for (int round = 0; round < SETTLE_ROUNDS; round++) {
        conform_settle(c, goal->live_mm3, goal->tolerance_mm3);
        if (!conform_cross(c))
            return;
        take_kept(c);
        spread(c, 1 + round);
        for (uint32_t i = 0; i < c->active_count; i++)
            if (c->tied[c->active[i]])
                c->trust[c->active[i]] = 0;
    }
}

void conform_untangle(struct conform *c, const struct conform_goal *goal,
                      struct conform_report *out_report) {
    uint32_t crossings = conform_cross(c);
    out_report->crossings_first = crossings;
    for (int round = 0; crossings && round < ROUNDS; round++) {
        soften(c, round);
        conform_advance(c, SOFT, NULL); // soft parts would take all of the volume
        crossings = conform_cross(c);
        out_report->repairs++;
    }
    trust_all(c);
    if (crossings)
        out_report->reverted_count = conform_go_back(c);
    else
        for (int i = 0; out_report->repairs && i < REFITS && refit(c, goal); i++)
            ;
    settle(c, goal);
    trust_all(c);
}
