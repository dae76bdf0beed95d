// Takes crossings out of S'' again, and brings its volume to the wanted one.
#include "match/conform_parts.h"

#include <math.h>
#include <string.h>

#define ROUNDS 9
#define REFITS 4
#define HALVINGS 5
#define BACK_ROUNDS 5 // after the halvings
#define SETTLE_ROUNDS 12
#define STILL_MM 0.02 // a step as short changes nothing

void conform_advance(struct conform *c, const struct conform_pass *pass,
                     const struct conform_goal *goal) {
    conform_find_rows(c, pass);
    for (uint32_t i = 0; i < c->active_count; i++)
        c->bent[i] = vec3_scale(-1, c->gradient[i]);
    conform_solve(c, c->bent, pass->energy, c->step);
    conform_limit(c, c->step);
    for (uint32_t i = 0; i < c->active_count; i++) {
        vec3 *p = &c->positions[c->active[i]];
        *p = vec3_add(*p, c->step[i]);
    }
    if (goal)
        conform_settle(c, goal->live_mm3, goal->tolerance_mm3);
}

void conform_spread(struct conform *c, int rings) {
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
    conform_spread(c, round < 3 ? 1 : round - 1);
    for (uint32_t i = 0; i < c->active_count; i++) {
        uint32_t v = c->active[i];
        if (!c->tied[v])
            continue;
        c->trust[v] = lower(c->trust[v], trust[level]);
        c->bend[v] = higher(c->bend[v], bend[level]);
    }
}

static void take_as_sound(struct conform *c) {
    for (uint32_t i = 0; i < c->active_count; i++)
        c->sound[c->active[i]] = c->positions[c->active[i]];
}

uint32_t conform_go_back(struct conform *c, int halvings) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < c->active_count; i++) {
        c->kept[c->active[i]] = c->positions[c->active[i]];
        c->factor[c->active[i]] = 1;
    }
    for (int round = 0; round < halvings + BACK_ROUNDS && conform_cross(c); round++) {
        conform_spread(c, 1 + round / 2);
        for (uint32_t i = 0; i < c->active_count; i++) {
            uint32_t v = c->active[i];
            if (!c->tied[v] && round < halvings + BACK_ROUNDS - 1)
                continue;
            c->factor[v] = round < halvings ? 0.5 * c->factor[v] : 0;
            c->positions[v] =
                c->factor[v] > 0 ? vec3_lerp(c->sound[v], c->kept[v], c->factor[v]) : c->sound[v];
        }
    }
    for (uint32_t i = 0; i < c->active_count; i++)
        count += c->factor[c->active[i]] < 1;
    take_as_sound(c);
    return count;
}

// The fit again, where smoothing has left S'' off T; a part that would cross takes less of it.
// False: it is at its end.
static bool refit(struct conform *c, const struct conform_goal *goal) {
    double longest = 0;
    conform_advance(c, &c->plan->soft, goal);
    for (uint32_t i = 0; i < c->active_count; i++)
        longest = higher(longest, vec3_length(c->step[i]));
    return conform_go_back(c, HALVINGS) < c->active_count && longest > STILL_MM;
}

static bool is_reached(const struct conform *c, const struct conform_goal *goal) {
    return fabs(goal->live_mm3 - conform_live_volume(c)) <= goal->tolerance_mm3;
}

// What would cross for the sake of the volume stays where it is.
static void settle(struct conform *c, const struct conform_goal *goal) {
    if (is_reached(c, goal))
        return;
    conform_find_rows(c, &c->plan->soft);
    for (int round = 0; round < SETTLE_ROUNDS; round++) {
        conform_settle(c, goal->live_mm3, goal->tolerance_mm3);
        uint32_t back = conform_go_back(c, 0);
        if (back == c->active_count || (!back && is_reached(c, goal)))
            return;
        for (uint32_t i = 0; i < c->active_count; i++)
            if (c->factor[c->active[i]] < 1)
                c->trust[c->active[i]] = 0;
    }
}

void conform_untangle(struct conform *c, const struct conform_goal *goal,
                      struct conform_report *out_report) {
    uint32_t crossings = conform_cross(c);
    out_report->crossings_first = crossings;
    for (int round = 0; crossings && round < ROUNDS; round++) {
        soften(c, round);
        conform_advance(c, &c->plan->soft, NULL); // soft parts would take all of the volume
        crossings = conform_cross(c);
        out_report->repairs++;
    }
    trust_all(c);
    out_report->reverted_count = crossings ? conform_go_back(c, HALVINGS) : 0;
    take_as_sound(c);
    for (int i = 0; out_report->repairs && i < REFITS && refit(c, goal); i++)
        ;
    settle(c, goal);
    trust_all(c);
}
