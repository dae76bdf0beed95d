#include "base/check.h"
#include "rehearsal/forecast.h"
#include "rehearsal/planner.h"
#include "rehearsal/remains.h"

#include <math.h>
#include <stdlib.h>

#define SETTLE_S 0.4

static const struct stance surgeon_stances[] = {{10, 8, 0}, {25, 8, 0},  {45, 8, 0},  {5, 8, 0},
                                                {70, 8, 0}, {10, -8, 0}, {90, -8, 0}, {45, -8, 0}};
#define SURGEON_STANCE_COUNT ((int)(sizeof surgeon_stances / sizeof *surgeon_stances))

// First bites that keep off what is not planned and are worth the time, then what is left.
static const struct care { double beyond_price, least_mm3; } cares[] = {{1.5, 2.5}, {0.7, 1}};
#define CARE_COUNT ((int)(sizeof cares / sizeof *cares))

// A bite at a sample of the plan: so deep does the tip go beyond it, so far is it beside the plane
// of the closed jaws, and so are the jaws turned.
static const double depths_mm[] = {0.5, 2, 3.5}, lifts_mm[] = {0.3, 1.1};
static const double rolls_deg[] = {0, 45, -45, 90, -90, 135, -135, 180};
#define DEPTH_COUNT (sizeof depths_mm / sizeof *depths_mm)
#define LIFT_COUNT (sizeof lifts_mm / sizeof *lifts_mm)
#define ROLL_COUNT (sizeof rolls_deg / sizeof *rolls_deg)
#define TARGETS 40
#define BITES_MAX (TARGETS * DEPTH_COUNT * LIFT_COUNT * ROLL_COUNT)
#define LOOKS 60               // at the most promising bites
#define REACHED 6              // of them that the hand compares
#define ROLL_MM3_PER_DEG 0.005 // what a turn of the jaws has to bring
#define LEAST_BROUGHT_MM3 0.2  // by a bite; with less the hand goes elsewhere

struct bite {
    vec3 tip; // in the mock-up's frame
    double roll_deg, score;
};

struct surgeon {
    struct planner *p;
    const struct goal *goal;
    int index, tissue;
    const struct case_group *group;
    const struct instrument *jaw;
    struct forecast *forecast;
    struct remains remains;
    const struct care *care;
    struct bite bites[BITES_MAX];
    int bite_count;
};

// ---- which bite ---------------------------------------------------------------------------------

static double score_of(const struct surgeon *s, pose T_mesh_tip, double roll_deg) {
    const struct hand *hand = plan_hand(&s->p->plan, CHANNEL_PUNCH);
    struct bite_gain gain = remains_bite(&s->remains, s->jaw, T_mesh_tip);
    double turn = fabs(roll_deg - DEG_PER_RAD * hand->roll);
    return gain.planned_mm3 - s->care->beyond_price * gain.beyond_mm3 - ROLL_MM3_PER_DEG * turn;
}

static pose seen_at(const struct surgeon *s, vec3 tip, double roll_deg) {
    const struct hand *hand = plan_hand(&s->p->plan, CHANNEL_PUNCH);
    pose T = plan_tool_pose(&s->p->plan, hand, tip, RAD_PER_DEG * roll_deg);
    return forecast_tool(s->forecast, CHANNEL_PUNCH, hand->portal.position, T);
}

// As if the touch were the sight.
static void add_bite(struct surgeon *s, vec3 at, double depth, double lift, double roll_deg) {
    const struct plan *plan = &s->p->plan;
    const struct hand *hand = plan_hand(&s->p->plan, CHANNEL_PUNCH);
    vec3 target = pose_apply(forecast_body(s->forecast), at);
    pose T = plan_tool_pose(plan, hand, target, RAD_PER_DEG * roll_deg);
    vec3 tip = vec3_add(target, quat_rotate(T.rotation, (vec3){0, -lift, depth}));
    pose T_mockup_mesh = forecast_body(s->forecast);
    pose T_mesh_tip = pose_compose(pose_inverse(T_mockup_mesh), (pose){T.rotation, tip});
    double score = score_of(s, T_mesh_tip, roll_deg);
    if (score >= s->care->least_mm3)
        s->bites[s->bite_count++] = (struct bite){tip, roll_deg, score};
}

static int by_score(const void *a, const void *b) {
    double x = ((const struct bite *)a)->score, y = ((const struct bite *)b)->score;
    return (x < y) - (x > y);
}

static void find_bites(struct surgeon *s) {
    int left = 0;
    for (int i = 0; i < s->remains.count; i++)
        left += s->remains.is_planned[i] && s->remains.is_there[i];
    int every = left / TARGETS + 1, seen = 0;
    s->bite_count = 0;
    for (int i = 0; i < s->remains.count; i++) {
        if (!s->remains.is_planned[i] || !s->remains.is_there[i] || seen++ % every)
            continue;
        for (size_t d = 0; d < DEPTH_COUNT; d++)
            for (size_t l = 0; l < LIFT_COUNT; l++)
                for (size_t r = 0; r < ROLL_COUNT; r++)
                    add_bite(s, s->remains.points[i], depths_mm[d], lifts_mm[l], rolls_deg[r]);
    }
    qsort(s->bites, (size_t)s->bite_count, sizeof *s->bites, by_score);
}

static void aim_bite(const struct surgeon *s, struct bite *bite) {
    const struct hand *hand = plan_hand(&s->p->plan, CHANNEL_PUNCH);
    bite->tip =
        forecast_aim(s->forecast, &s->p->plan, hand, RAD_PER_DEG * bite->roll_deg, bite->tip);
    bite->score = score_of(s, seen_at(s, bite->tip, bite->roll_deg), bite->roll_deg);
}

// Of the most promising ones, the best that the shaft reaches.
static bool choose(struct surgeon *s, struct bite *out) {
    const struct hand *hand = plan_hand(&s->p->plan, CHANNEL_PUNCH);
    int reached = 0;
    *out = (struct bite){.score = 0};
    for (int i = 0; i < s->bite_count && i < LOOKS && reached < REACHED; i++) {
        struct bite bite = s->bites[i];
        aim_bite(s, &bite);
        if (!plan_bites_at(&s->p->plan, hand, bite.tip))
            continue;
        reached++;
        if (bite.score > out->score)
            *out = bite;
    }
    return out->score >= s->care->least_mm3;
}

// ---- biting -------------------------------------------------------------------------------------

static const struct quality_report *report_of(const struct surgeon *s) {
    return &play_attempt(s->p->play)->resections[s->tissue];
}

static bool attempt_has_cut(const struct surgeon *s) {
    return play_attempt(s->p->play)->cut >> s->tissue & 1;
}

// The hands go on by the script's steps from this one.
static bool go_on(struct surgeon *s, int step) {
    if (!plan_from(s->p, step))
        return false;
    play_on(s->p->play, s->p->plan.motion);
    return true;
}

static bool look_again(struct surgeon *s) {
    struct mesh now;
    const struct operation *operation = play_operation(s->p->play);
    cut_mesh_flatten(operation_mesh(operation, s->tissue), &now, NULL, NULL);
    enum result result = s->remains.count ? remains_take(&s->remains, &now, s->p->err)
                                          : remains_init(&s->remains, s->group, &now, s->p->err);
    mesh_fini(&now);
    forecast_take(s->forecast, operation, &s->p->plan.joint);
    return result == RESULT_OK;
}

static bool bite_at(struct surgeon *s, const struct bite *bite) {
    struct planner *p = s->p;
    int first = p->script->step_count;
    struct motion_step *step = add_named(p->script, MOTION_BITE, CHANNEL_PUNCH, s->goal->resect);
    if (!step)
        return false;
    step->has_place = step->is_free = true;
    step->from.at = pose_apply_inverse(plan_body_pose(&p->plan, s->group->body), bite->tip);
    step->roll_deg = bite->roll_deg;
    return go_on(s, first);
}

static bool is_met(const struct surgeon *s) {
    return play_attempt(s->p->play)->goals[s->index].met;
}

static bool is_enough(const struct surgeon *s) {
    const struct quality_report *report = report_of(s);
    return attempt_has_cut(s) && report->under_mm3 <= s->goal->under_share * report->planned_mm3;
}

static bool find_bite(struct surgeon *s, struct bite *out) {
    if (!look_again(s))
        return false;
    find_bites(s);
    return choose(s, out);
}

// What a bite brought.
static double bite_once(struct surgeon *s) {
    double before = attempt_has_cut(s) ? report_of(s)->under_mm3 : INFINITY;
    struct bite bite;
    if (!find_bite(s, &bite) || !bite_at(s, &bite))
        return 0;
    return before - report_of(s)->under_mm3;
}

// All bites that are worth it.
static void bite_on(struct surgeon *s) {
    bool brings = true;
    while (brings && !is_met(s) && !is_enough(s))
        brings = bite_once(s) > LEAST_BROUGHT_MM3;
}

// Does not move where there is nothing to bite.
static bool stand(struct surgeon *s, const struct stance *stance) {
    struct planner *p = s->p;
    struct plan_mark before = plan_mark(&p->plan);
    struct bite bite;
    int first = p->script->step_count;
    take_out_tools(p);
    hold_joint(p, s->goal, stance);
    add_named(p->script, MOTION_LOOK, CHANNEL_SCOPE, s->goal->resect);
    add_named(p->script, MOTION_APPROACH, CHANNEL_PUNCH, p->portals[1]);
    if (!plan_from(p, first))
        return false;
    s->care = &cares[CARE_COUNT - 1];
    if (find_bite(s, &bite)) {
        play_on(p->play, p->plan.motion);
        return true;
    }
    plan_back(&p->plan, &before);
    p->script->step_count = first;
    return false;
}

static void resect(struct surgeon *s) {
    for (int i = 0; i < SURGEON_STANCE_COUNT && !is_met(s) && !is_enough(s); i++)
        if (stand(s, &surgeon_stances[i]))
            for (s->care = cares; s->care < cares + CARE_COUNT; s->care++)
                bite_on(s);
    int first = s->p->script->step_count;
    add_amount(s->p->script, MOTION_WAIT, s->goal->hold_s + SETTLE_S);
    if (!is_met(s))
        go_on(s, first);
}

bool meet_resection(struct planner *p, int index) {
    struct surgeon *s = alloc(1, sizeof *s);
    s->p = p;
    s->goal = &p->task->goals[index];
    s->index = index;
    s->tissue = site_goal(p->site, index)->tissue;
    int group = scene_tissue_group(p->scene, s->tissue);
    s->group = &scene_case(p->scene)->groups[group];
    s->jaw = &site_tools(p->site)->of[CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT];
    s->forecast = forecast_create(p->scene, group);
    resect(s);
    const struct quality_report *report = report_of(s);
    bool met = is_met(s);
    if (!met)
        fail(p->err, RESULT_INVALID,
             "[goal %s]: of a plan of %.0f mm3, %.0f are still there and %.0f are gone beyond it",
             s->goal->name, report->planned_mm3, report->under_mm3, report->over_mm3);
    forecast_destroy(&s->forecast);
    remains_fini(&s->remains);
    free(s);
    return met;
}
