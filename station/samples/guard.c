#include "samples/guard.h"

#include "base/clock.h"

#include <string.h>

// Fast reaches of an arm have 3 m/s and 2 g at most; a wrist turns a tool by 1000 degrees a second.
const struct guard_mover guard_hand = {3000, 20000, 17, 300};
const struct guard_mover guard_joint = {3000, 20000, 5, 50}; // a leg that a person moves

enum { STEPS_KNOWN = 3 };                          // tell the source's rate
static const int64_t baseline_ns = 30 * NS_PER_MS; // from which speed is told, or one step

void guard_init(struct guard *guard, const struct guard_mover *mover, double jump_mm,
                double jump_deg) {
    *guard = (struct guard){.jump_mm = jump_mm, .jump_rad = jump_deg * RAD_PER_DEG, .mover = mover};
}

void guard_forget(struct guard *guard) {
    guard->taken = guard->caught = (struct guard_track){0};
    guard->caught_count = 0;
    guard->seen_ns = 0;
}

bool guard_is_catching(const struct guard *guard, int64_t now_ns) {
    return guard->caught_count && now_ns - guard->seen_ns < GUARD_STEP_NS;
}

// ---- a track ------------------------------------------------------------------------------------

static bool is_same(pose a, pose b) {
    return !memcmp(&a, &b, sizeof a);
}

static void keep(struct guard_track *t, int64_t time_ns, pose p) {
    struct history *h = &t->poses;
    int newest = history_place(h, 0);
    t->said_ns = time_ns;
    if (h->count && is_same(h->poses[newest], p))
        return;
    int64_t step_ns = h->count ? time_ns - h->time_ns[newest] : 0;
    if (step_ns > 0 && step_ns < GUARD_STEP_NS) {
        t->steps_ns[t->next_step] = step_ns;
        t->next_step = (t->next_step + 1) % GUARD_STEPS;
    }
    history_add(h, time_ns, p);
}

// The usual time from one of the source's poses to the next; 0: not known.
static int64_t usual_step_ns(const struct guard_track *t) {
    int64_t shortest_ns = GUARD_STEP_NS;
    int known = 0;
    for (int i = 0; i < GUARD_STEPS; i++) {
        known += t->steps_ns[i] > 0;
        if (t->steps_ns[i] && t->steps_ns[i] < shortest_ns)
            shortest_ns = t->steps_ns[i];
    }
    return known >= STEPS_KNOWN ? shortest_ns : 0;
}

// How long the body had for the step to a pose at time_ns.
static int64_t time_of_step(const struct guard_track *t, int64_t time_ns) {
    int64_t since_ns = time_ns - t->poses.time_ns[history_place(&t->poses, 0)];
    int64_t usual_ns = usual_step_ns(t), silent_ns = time_ns - t->said_ns;
    int64_t step_ns = since_ns < usual_ns ? since_ns : usual_ns;
    return step_ns > silent_ns ? step_ns : silent_ns;
}

// Where the last poses point in dt_s. *out_lag_s: how old the speed is that they tell. False: they
// tell none, because the body rested or there is but one.
static bool predict(const struct guard_track *t, int64_t time_ns, double dt_s, pose *out_pose,
                    double *out_lag_s) {
    const struct history *h = &t->poses;
    int newest = history_place(h, 0), back = 1;
    double since_s = (double)(time_ns - h->time_ns[newest]) / NS_PER_S;
    while (back + 1 < h->count &&
           h->time_ns[newest] - h->time_ns[history_place(h, back)] < baseline_ns)
        back++;
    int from = history_place(h, back);
    int64_t span_ns = h->time_ns[newest] - h->time_ns[from];
    if (h->count < 2 || since_s > 2 * dt_s || dt_s * NS_PER_S > GUARD_STEP_NS ||
        span_ns > GUARD_STEP_NS)
        return false;
    *out_lag_s = (double)span_ns / NS_PER_S;
    *out_pose = pose_interpolate(h->poses[from], h->poses[newest], 1 + dt_s / *out_lag_s);
    return true;
}

static bool is_within(pose a, pose b, double mm, double rad) {
    return vec3_distance(a.translation, b.translation) <= mm &&
           quat_angle(a.rotation, b.rotation) <= rad;
}

// quiet_ns: since the source last said anything. While it says what is caught, no time is given for
// a step to there.
static bool follows(const struct guard *g, const struct guard_track *t, int64_t time_ns,
                    int64_t quiet_ns, pose p) {
    const struct guard_mover *m = g->mover;
    int64_t step_ns = time_of_step(t, time_ns), most_ns = 2 * quiet_ns;
    most_ns = most_ns > usual_step_ns(t) ? most_ns : usual_step_ns(t);
    bool has_spoken = step_ns > most_ns;
    double dt_s = (double)step_ns / NS_PER_S, given_s = fmin(dt_s, (double)most_ns / NS_PER_S);
    double lag_s = given_s;
    pose newest = t->poses.poses[history_place(&t->poses, 0)], predicted;
    if (is_within(newest, p, g->jump_mm, g->jump_rad))
        return true;
    if (!has_spoken &&
        !is_within(newest, p, g->jump_mm + m->mm_s * dt_s, g->jump_rad + m->rad_s * dt_s))
        return false;
    if (!predict(t, time_ns, dt_s, &predicted, &lag_s))
        predicted = newest;
    double half_square = given_s * (given_s + lag_s) / 2;
    return is_within(predicted, p, g->jump_mm + m->mm_s2 * half_square,
                     g->jump_rad + m->rad_s2 * half_square);
}

// ---- the guard ----------------------------------------------------------------------------------

static bool confirmed(struct guard *g, int64_t time_ns, int64_t quiet_ns, pose p) {
    if (g->caught_count && !follows(g, &g->caught, time_ns, quiet_ns, p)) {
        g->caught = (struct guard_track){0};
        g->caught_count = 0;
    }
    if (!g->caught_count)
        g->caught_since_ns = time_ns;
    keep(&g->caught, time_ns, p);
    g->caught_count++;
    return g->caught_count >= GUARD_CONFIRMATIONS &&
           time_ns - g->caught_since_ns >= GUARD_CONFIRMATION_NS;
}

bool guard_takes(struct guard *g, int64_t time_ns, pose p) {
    if (time_ns - g->seen_ns > GUARD_MEMORY_NS)
        guard_forget(g);
    else if (time_ns <= g->seen_ns)
        return false;
    int64_t quiet_ns = time_ns - g->seen_ns;
    g->seen_ns = time_ns;
    if (!g->taken.poses.count || follows(g, &g->taken, time_ns, quiet_ns, p))
        keep(&g->taken, time_ns, p);
    else if (confirmed(g, time_ns, quiet_ns, p))
        g->taken = g->caught;
    else
        return false;
    g->caught = (struct guard_track){0};
    g->caught_count = 0;
    return true;
}
