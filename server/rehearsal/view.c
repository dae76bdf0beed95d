#include "rehearsal/view.h"

#include <math.h>

#define USUAL_MM 18.0  // from which a scope looks
#define CLEAR_MM 2.0   // inside the bounds of a distance
#define SHARE 0.8      // of what a goal allows off the middle, and of the roll of its picture
#define TREMBLE_MM 0.7 // as far beside the tip, the landmark is seen, too
#define MM_PRICE 0.5   // of each mm nearer or farther than wished
#define OFF_PRICE 8.0  // at the edge of what is allowed
#define ROLL_PRICE 0.1 // of each degree
#define WAY_PRICE 0.1  // of each mm that the tip goes
#define CONE_DEG 60.0  // about the portal's direction
#define STEP_DEG 4.0
#define STEP_MM 3.0 // of the depth
#define DEEPEST_MM 80.0

static const double view_rolls_deg[] = {0, 30, -30, 60, -60, 90, -90};
#define VIEW_ROLL_COUNT ((int)(sizeof view_rolls_deg / sizeof *view_rolls_deg))

struct seeking {
    const struct planner *p;
    const struct goal *goal;
    const struct hand *hand;
    double least_mm, most_mm, wish_mm, off_deg; // of the landmark: how far, and off the middle
    pose T_mockup_virtual[BODY_COUNT];
    int shown_count;
    vec3 shown[SITE_SHOWN_MAX], middle; // in the mock-up's frame
    double radius_mm;
    uint32_t cut;
    double price; // of the best
    struct view best;
};

static double angle_deg(vec3 a, vec3 b) {
    return DEG_PER_RAD * atan2(vec3_length(vec3_cross(a, b)), vec3_dot(a, b));
}

// ---- what is asked ------------------------------------------------------------------------------

static void take_bounds(struct seeking *s, double wish_mm) {
    const struct goal *goal = s->goal;
    s->least_mm = goal->beyond_mm > 0 ? goal->beyond_mm + CLEAR_MM : CLEAR_MM;
    s->most_mm = fmax(goal->within_mm - CLEAR_MM, s->least_mm);
    s->wish_mm = fmin(fmax(wish_mm > 0 ? wish_mm : USUAL_MM, s->least_mm), s->most_mm);
    s->off_deg = SHARE * goal->centre * 0.5 * site_optic(s->p->site)->field_deg;
}

static void take_place(struct seeking *s, const struct spot *spot) {
    struct scene_stance stance;
    scene_stand(s->p->scene, session_settings_default().adaptive, &s->p->plan.joint, &stance);
    for (enum body body = 0; body < BODY_COUNT; body++)
        s->T_mockup_virtual[body] =
            pose_compose(stance.correction[body], stance.T_femur_body[body]);
    const pose *T = &s->T_mockup_virtual[spot->body];
    s->shown_count = spot->shown_count;
    for (int i = 0; i < spot->shown_count; i++)
        s->shown[i] = pose_apply(*T, spot->shown[i]);
    s->middle = pose_apply(*T, spot->middle);
    s->radius_mm = spot->radius_mm;
}

// ---- one tip ------------------------------------------------------------------------------------

static bool is_shown(const struct seeking *s, vec3 tip, vec3 place) {
    return site_sees(s->p->site, s->T_mockup_virtual, tip, s->cut, place, &(struct sight_hint){0});
}

// Noise does not take it out of sight.
static bool is_surely_shown(const struct seeking *s, vec3 tip, vec3 place) {
    static const vec3 sides[] = {{0, 0, 0},  {1, 0, 0}, {-1, 0, 0}, {0, 1, 0},
                                 {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++)
        if (!is_shown(s, vec3_add_scaled(tip, TREMBLE_MM, sides[i]), place))
            return false;
    return true;
}

static void try_place(struct seeking *s, vec3 tip, vec3 axis, double roll_deg, vec3 place) {
    vec3 way = vec3_sub(place, tip);
    double distance = vec3_length(way);
    if (distance < s->least_mm || distance > s->most_mm)
        return;
    double off = angle_deg(axis, way);
    double price = OFF_PRICE * off / s->off_deg + MM_PRICE * fabs(distance - s->wish_mm) +
                   ROLL_PRICE * fabs(roll_deg) + WAY_PRICE * vec3_distance(tip, s->hand->tip);
    if (off > s->off_deg || price >= s->price || !is_surely_shown(s, tip, place) ||
        !plan_is_clear(&s->p->plan, s->hand, tip))
        return;
    s->price = price;
    s->best = (struct view){tip, roll_deg};
}

static void try_tip(struct seeking *s, vec3 tip) {
    double away = vec3_distance(tip, s->middle);
    if (away > s->most_mm + s->radius_mm || away < s->least_mm - s->radius_mm)
        return;
    for (int r = 0; r < VIEW_ROLL_COUNT; r++) {
        double roll = view_rolls_deg[r];
        if (!isnan(s->goal->upright_deg) && fabs(roll) > SHARE * s->goal->upright_deg)
            continue;
        pose T = plan_tool_pose(&s->p->plan, s->hand, tip, RAD_PER_DEG * roll);
        vec3 axis = optic_axis(site_optic(s->p->site), T);
        for (int i = 0; i < s->shown_count; i++)
            try_place(s, tip, axis, roll, s->shown[i]);
    }
}

// ---- all tips -----------------------------------------------------------------------------------

static void try_direction(struct seeking *s, vec3 direction) {
    for (double depth = STEP_MM; depth < DEEPEST_MM; depth += STEP_MM)
        try_tip(s, vec3_add_scaled(s->hand->portal.position, depth, direction));
}

// Rings about the portal's direction.
static void seek(struct seeking *s) {
    vec3 straight = s->hand->portal.direction;
    vec3 aside = vec3_unit_or(vec3_cross(straight, plan_up(&s->p->plan)), (vec3){1, 0, 0});
    try_direction(s, straight);
    for (double ring = STEP_DEG; ring <= CONE_DEG; ring += STEP_DEG) {
        int count = (int)ceil(360 * sin(RAD_PER_DEG * ring) / STEP_DEG);
        for (int i = 0; i < count; i++) {
            vec3 out =
                quat_rotate(quat_from_axis_angle(straight, RAD_PER_DEG * 360.0 * i / count), aside);
            try_direction(s, quat_rotate(quat_from_axis_angle(out, RAD_PER_DEG * ring), straight));
        }
    }
}

bool find_view(struct planner *p, int goal, double wish_mm, struct view *out) {
    struct seeking s = {.p = p,
                        .goal = &p->task->goals[goal],
                        .hand = plan_hand(&p->plan, CHANNEL_SCOPE),
                        .cut = play_attempt(p->play)->cut,
                        .price = INFINITY};
    take_bounds(&s, wish_mm);
    take_place(&s, &site_goal(p->site, goal)->see);
    seek(&s);
    *out = s.best;
    if (s.price < INFINITY)
        return true;
    fail(p->err, RESULT_INVALID, "through the portal %s, from nowhere does the scope show %s",
         s.hand->portal.name, s.goal->see);
    return false;
}
