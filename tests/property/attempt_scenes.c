#include "attempt_scenes.h"

#include "base/clock.h"

#include <stdio.h>
#include <string.h>

#define NOISE_MM 0.1 // root mean square, along each axis
#define ARM_MM 60.0  // between two markers of a tracked tool: its direction trembles, too

bool trembles;

static double noise_of(double deviation) {
    return trembles ? deviation * random_normal(&noise) : 0;
}

static vec3 noises_of(double deviation) {
    double x = noise_of(deviation), y = noise_of(deviation);
    return (vec3){x, y, noise_of(deviation)};
}

static vec3 held(vec3 p) {
    return vec3_add(p, noises_of(NOISE_MM));
}

static pose held_pose(pose T) {
    vec3 turn = noises_of(NOISE_MM / ARM_MM);
    quat q = quat_from_axis_angle(vec3_unit_or(turn, (vec3){1, 0, 0}), vec3_length(turn));
    return (pose){quat_multiply(q, T.rotation), held(T.translation)};
}

// The largest x up to `high` where f comes down to a value: found at a row's first step.
static double solve(double (*f)(double), double high, double value) {
    static double found;
    double low = high;
    if (output.step > 0)
        return found;
    while (f(low) > value && low > 0)
        low -= 1;
    high = low + 1;
    for (int i = 0; i < 50; i++) {
        found = 0.5 * (low + high);
        *(f(found) > value ? &high : &low) = found;
    }
    return found;
}

// ---- the optic ----------------------------------------------------------------------------------

static double angle_deg(vec3 a, vec3 b) {
    return DEG_PER_RAD * atan2(vec3_length(vec3_cross(a, b)), vec3_dot(a, b));
}

static vec3 before_patella(double away_mm) {
    return vec3_add_scaled(landmark("patella"), away_mm, forward);
}

static bool shows(vec3 scope, vec3 at) {
    return site_sees(site, output.T_mockup_virtual, scope, 0, at, &(struct sight_hint){0});
}

// Of the landmark's places that the scope sees.
static double over_shown(vec3 scope, double (*measure)(vec3 scope, vec3 shown), bool least) {
    const struct spot *spot = &site_goal(site, LAST)->see;
    double best = least ? INFINITY : -INFINITY;
    for (int i = 0; i < spot->shown_count; i++) {
        double now = measure(scope, spot->shown[i]);
        if (shows(scope, spot->shown[i]))
            best = least ? fmin(best, now) : fmax(best, now);
    }
    return best;
}

static double nearest_shown(double away_mm) {
    return over_shown(before_patella(away_mm), vec3_distance, true);
}

static double farthest_shown(double away_mm) {
    return over_shown(before_patella(away_mm), vec3_distance, false);
}

void stand_before(double away_mm) {
    vec3 from = before_patella(away_mm);
    place(SCOPE, held_pose(looking(from, landmark("patella"))));
}

static void within(double inside) {
    stand_before(solve(nearest_shown, 60, 30 - inside));
}

static void beyond(double inside) {
    stand_before(solve(farthest_shown, 60, 25 + inside));
}

static vec3 aside; // where the scope looks

static vec3 looking_aside(vec3 way, double deg) {
    return quat_rotate(quat_from_axis_angle((vec3){0, 0, 1}, deg * RAD_PER_DEG), way);
}

// Of the landmark's places the nearest that is seen.
static vec3 way_to_shown(void) {
    const struct spot *spot = &site_goal(site, LAST)->see;
    vec3 scope = before_patella(AWAY_MM), way = {INFINITY, 0, 0};
    for (int i = 0; i < spot->shown_count; i++) {
        vec3 now = vec3_sub(spot->shown[i], scope);
        if (vec3_length(now) < vec3_length(way) && shows(scope, spot->shown[i]))
            way = now;
    }
    return vec3_unit_or(way, forward);
}

static double off_axis(vec3 scope, vec3 shown) {
    return angle_deg(aside, vec3_sub(shown, scope));
}

static double least_angle(double deg) {
    aside = looking_aside(way_to_shown(), deg);
    return over_shown(before_patella(AWAY_MM), off_axis, true);
}

static void look_past(double deg) {
    vec3 from = before_patella(AWAY_MM);
    vec3 way = looking_aside(way_to_shown(), solve(least_angle, 80, deg));
    place(SCOPE, held_pose(looking(from, vec3_add(from, way))));
}

static void in_picture(double inside) {
    look_past(30 - inside);
}

static void in_its_middle(double inside) {
    look_past(9 - inside);
}

// A condyle comes between, as far as the femur is moved aside.
double femur_mm;

static bool is_any_seen(vec3 scope) {
    return over_shown(scope, vec3_distance, true) < INFINITY;
}

static void not_hidden(double inside) {
    vec3 p = landmark("plateau_medial"), from = vec3_add(p, (vec3){0, 4, 24});
    double low = 0, high = 100;
    for (int i = 0; i < 40 && femur_mm == 0; i++) {
        output.T_mockup_virtual[BODY_FEMUR].translation.x = 0.5 * (low + high);
        *(is_any_seen(from) ? &high : &low) = 0.5 * (low + high);
    }
    femur_mm = femur_mm == 0 ? high : femur_mm;
    output.T_mockup_virtual[BODY_FEMUR].translation.x = femur_mm + inside;
    place(SCOPE, held_pose(looking(from, p)));
}

static void roll(double deg, vec3 from) {
    pose T = looking(from, landmark("patella"));
    T.rotation =
        quat_multiply(T.rotation, quat_from_axis_angle((vec3){0, 0, 1}, deg * RAD_PER_DEG));
    place(SCOPE, held_pose(T));
}

static double off_upright(double deg) {
    vec3 from = before_patella(AWAY_MM), axis = vec3_sub(landmark("patella"), from);
    axis = vec3_unit_or(axis, (vec3){0, 0, 1});
    roll(deg, from);
    quat joint = scene_case(scene)->joint.T_tibia_joint.rotation;
    vec3 proximal = quat_rotate(joint, (vec3){0, 0, 1});
    vec3 up = quat_rotate(output.instruments[SCOPE].T_mockup_tip.rotation, (vec3){0, 1, 0});
    return angle_deg(up, vec3_add_scaled(proximal, -vec3_dot(proximal, axis), axis));
}

static void upright(double inside) {
    bool now = trembles;
    trembles = false;
    double deg = solve(off_upright, 60, 20 - inside);
    trembles = now;
    roll(deg, before_patella(AWAY_MM));
}

// It jumps to and fro.
static void still(double inside) {
    double x = output.time_ns / (400 * NS_PER_MS) % 2 ? 2 - inside : 0;
    vec3 from = before_patella(AWAY_MM);
    place(SCOPE, held_pose(looking(vec3_add(from, (vec3){x, 0, 0}), landmark("patella"))));
}

static void stays(double inside) {
    vec3 from = before_patella(AWAY_MM);
    bool first = !attempt.goals[0].met;
    roll(first ? 0 : 90, first ? from : vec3_add(from, (vec3){3 - inside, 0, 0}));
}

// ---- portals ------------------------------------------------------------------------------------

static vec3 portal(const char *name) {
    const struct knee_case *knee = scene_case(scene);
    for (int i = 0; i < knee->portal_count; i++)
        if (!strcmp(knee->portals[i].name, name))
            return knee->portals[i].position;
    fail_msg("no portal %s", name);
    return forward;
}

// A shaft to the point that passes the middle between both portals, on the medial one's side by
// `inside`.
static pose shaft(vec3 to, double inside) {
    vec3 medial = portal("anteromedial"), lateral = portal("anterolateral");
    vec3 way = vec3_unit_or(vec3_sub(medial, lateral), forward);
    vec3 from = vec3_add_scaled(vec3_lerp(medial, lateral, 0.5), inside, way);
    pose T = looking(from, to);
    T.translation = to;
    return held_pose(T);
}

static void scope_through(double inside) {
    stand_before(AWAY_MM);
    output.instruments[SCOPE].T_mockup_tip = shaft(landmark("notch"), inside);
}

static void on_plateau(int tool, double off_mm, double deep_mm) {
    touch(tool, "tibia", held(landmark("plateau_medial")), off_mm, deep_mm);
}

static void tool_through(double inside) {
    on_plateau(PROBE, 0.5, 0);
    output.instruments[PROBE].T_mockup_tip = shaft(landmark("plateau_medial"), inside);
}

// ---- touching -----------------------------------------------------------------------------------

static void touching(double inside) {
    on_plateau(PROBE, 1 - inside + noise_of(NOISE_MM), 0);
}

static void with_tool(double inside) {
    on_plateau(inside < 0 ? PROBE : SHAVER, 0.9 + noise_of(NOISE_MM), 0);
}

static void reaching(double inside) {
    double mm = site_goal(site, 0)->touch.depth_mm + 3 - inside;
    touch(PROBE, "tibia", held(vec3_add(landmark("plateau_medial"), (vec3){mm, 0, 0})), 0, 0);
}

static void tool_in_view(double inside) {
    vec3 at = landmark("plateau_medial"), from = vec3_add_scaled(at, AWAY_MM, forward);
    vec3 back = {0, -1, 0};
    on_plateau(PROBE, 0, 0);
    place(SCOPE, held_pose(looking(from, vec3_add(from, looking_aside(back, 30 - inside)))));
}

// Along the line on its points, past the last but one, and to where the last one is in reach.
static void following(double inside) {
    const struct site_goal *g = site_goal(site, 0);
    int now = (int)(output.step / 3), last = g->line_count - 1;
    vec3 back = vec3_unit_or(vec3_sub(g->line[last - 1], g->line[last]), forward);
    vec3 at = g->line[now < last - 3 ? now : last];
    if (now >= last - 3)
        at = vec3_add_scaled(at, now < last ? 2.6 : 2 - inside, back);
    touch(PROBE, "meniscus_medial", held(at), 0, 0);
}

// ---- the joint, the resection, loose bodies -----------------------------------------------------

#define NOISE_DEG (DEG_PER_RAD * NOISE_MM / ARM_MM)

static void valgus(double inside) {
    bend(20, 4 + inside + noise_of(NOISE_DEG), 0);
}

static void varus(double inside) {
    bend(20, -4 - inside + noise_of(NOISE_DEG), 0);
}

static void drawer(double inside) {
    bend(90, 0, 5 + inside + noise_of(NOISE_MM));
}

static void flexion(double inside) {
    bend(30 - inside + noise_of(NOISE_DEG), 0, 0);
}

static void bent_enough(double inside) {
    bend(10 + inside + noise_of(NOISE_DEG), 0, 0);
}

static void holding(double inside) {
    bool holds = output.time_ns <= NS_PER_S + (int64_t)(inside * 1e9);
    bend(20, (holds ? 4.5 : 0) + noise_of(NOISE_DEG), 0);
}

// A cut lands every 70 ms, and the noise of its blade is in what it left.
static void landing(int cuts, double under, double over, double rim, double step) {
    output.landed.job = output.step % 7 == 0;
    output.landed.outcome = JOB_DONE;
    output.landed.figures.cuts = (uint32_t)cuts;
    output.landed.figures.quality =
        (struct quality_report){.planned_mm3 = 100,
                                .under_mm3 = under + noise_of(10 * NOISE_MM),
                                .over_mm3 = over + noise_of(10 * NOISE_MM),
                                .rim_mm = rim + noise_of(NOISE_MM),
                                .step_mm = step + noise_of(NOISE_MM)};
}

static void something_cut(double inside) {
    landing(inside >= 0, 0, 0, 3, 0);
}

static void left_over(double inside) {
    landing(1, 20 - inside, 0, 3, 0);
}

static void beyond_plan(double inside) {
    landing(1, 0, 30 - inside, 3, 0);
}

static void rim_left(double inside) {
    landing(1, 0, 0, 3 + inside, 0);
}

static void step_left(double inside) {
    landing(1, 0, 0, 3, 1 - inside);
}

static void taken_out(double inside) {
    loose(0, LOOSE_OUT);
    loose(1, inside < 0 ? LOOSE_HELD : LOOSE_OUT);
}

// ---- errors -------------------------------------------------------------------------------------

static void deep(double inside) {
    on_plateau(PROBE, 0, fmax(0, 1 + inside + noise_of(NOISE_MM)));
}

static void deep_for(double inside) {
    bool holds = output.time_ns <= 300 * NS_PER_MS + (int64_t)(inside * 1e9);
    on_plateau(PROBE, 0, (holds ? 1.5 : 0) + noise_of(NOISE_MM));
}

static void deep_of_tool(double inside) {
    on_plateau(inside < 0 ? SHAVER : PROBE, 0, 1 + noise_of(NOISE_MM));
}

// Where two surfaces are as near.
static void deep_in_group(double inside) {
    vec3 at = held(vec3_add(landmark("plateau_medial"), (vec3){inside, 0, 0}));
    bool on_tibia = at.x >= landmark("plateau_medial").x;
    touch(PROBE, on_tibia ? "tibia" : "meniscus_medial", at, 0, 2);
}

static void shaver_on(bool turns, double off_mm) {
    on_plateau(SHAVER, off_mm + noise_of(NOISE_MM), 0);
    output.instruments[SHAVER].handle_validity = VALIDITY_OK;
    output.instruments[SHAVER].handle.buttons = turns;
}

static void turning(double inside) {
    shaver_on(inside >= 0, 0.9);
}

static void turning_near(double inside) {
    shaver_on(true, 1 - inside);
}

static void fast(double inside) {
    double way = (150 + inside) * 1e-9 * (double)output.time_ns;
    touch(PROBE, "tibia", held(vec3_add(landmark("plateau_medial"), (vec3){way, 0, 0})), 3, 0);
}

static void out_of_view(double inside) {
    tool_in_view(-inside);
    output.instruments[PROBE].warp.nearest_mm = 5;
}

static void unseen_inside(double inside) {
    tool_in_view(-20);
    output.instruments[PROBE].warp.nearest_mm = 15 - inside + noise_of(NOISE_MM);
}

static void dropping(double inside) {
    output.events = output.step % 100 != 50 ? 0 : inside < 0 ? EVENT_GRASPED : EVENT_DROPPED;
    output.events *= output.step < 100;
}

static void cut_beyond(double inside) {
    landing(1, 0, 30 + inside, 3, 0);
}

// ---- the table ----------------------------------------------------------------------------------

#define PATELLA "[goal a]\nsee = patella\nhold_s = 1\n"
#define TOUCH "[goal a]\ntouch = plateau_medial\nhold_s = 0.5\n"
#define RESECT "[goal a]\nresect = meniscus_medial\nhold_s = 0.2\n"
#define DEEP "[error e]\ndeep_mm = 1\nfor_s = 0.3\n"

const struct kind goal_kinds[] = {
    {"hold_s", "[goal a]\nvalgus_deg = 4\nhold_s = 1\n", holding, 0.02, 0.2},
    {"see", PATELLA, in_picture, 0.05, 2},
    {"see", "[goal a]\nsee = plateau_medial\nhold_s = 1\n", not_hidden, 0.1, 2},
    {"centre", PATELLA "centre = 0.3\n", in_its_middle, 0.05, 2},
    {"within_mm", PATELLA "within_mm = 30\n", within, 0.05, 0.7},
    {"beyond_mm", PATELLA "within_mm = 90\nbeyond_mm = 25\n", beyond, 0.05, 0.7},
    {"upright_deg", PATELLA "upright_deg = 20\n", upright, 0.05, 1},
    {"still_mm", PATELLA "still_mm = 2\n", still, 0.05, 0.7},
    {"stay_mm", PATELLA "upright_deg = 20\n[goal b]\nsee = patella\nstay_mm = 3\n", stays, 0.05,
     0.9},
    {"scope_portal", PATELLA "scope_portal = anteromedial\n", scope_through, 0.05, 1},
    {"tool_portal", TOUCH "tool_portal = anteromedial\n", tool_through, 0.05, 1},
    {"touch", TOUCH, touching, 0.05, 0.5},
    {"reach_mm", TOUCH "reach_mm = 3\n", reaching, 0.05, 0.5},
    {"follow", "[goal a]\nfollow = horn_anterior_medial body_medial\nreach_mm = 2\n", following,
     0.05, 0.5},
    {"tool", TOUCH "tool = shaver\n", with_tool, 1, 1},
    {"in_view", TOUCH "in_view = yes\n", tool_in_view, 0.05, 2},
    {"valgus_deg", "[goal a]\nvalgus_deg = 4\n", valgus, 0.05, 0.5},
    {"varus_deg", "[goal a]\nvarus_deg = 4\n", varus, 0.05, 0.5},
    {"drawer_mm", "[goal a]\ndrawer_mm = 5\n", drawer, 0.05, 0.5},
    {"flexion_deg", "[goal a]\nflexion_deg = 10 30\n", flexion, 0.05, 0.5},
    {"flexion_deg", "[goal a]\nflexion_deg = 10 30\n", bent_enough, 0.05, 0.5},
    {"resect", RESECT "rim_mm = 3\n", something_cut, 1, 1},
    {"under_share", RESECT "under_share = 0.2\n", left_over, 0.05, 5},
    {"over_share", RESECT "over_share = 0.3\n", beyond_plan, 0.05, 5},
    {"rim_mm", RESECT "rim_mm = 3\n", rim_left, 0.05, 0.5},
    {"step_mm", RESECT "step_mm = 1\n", step_left, 0.05, 0.5},
    {"take_out", "[goal a]\ntake_out = all\n", taken_out, 1, 1},
    {0}};

const struct kind error_kinds[] = {
    {"for_s", DEEP, deep_for, 0.02, 0.2},
    {"sentinel", DEEP "sentinel = yes\n", deep, 0.05, 0.5},
    {"tool", DEEP "tool = probe\n", deep_of_tool, 1, 1},
    {"groups", DEEP "groups = femur tibia\n", deep_in_group, 0.05, 0.5},
    {"deep_mm", DEEP, deep, 0.05, 0.5},
    {"running", "[error e]\nrunning = yes\nnear_mm = 1\n", turning, 1, 1},
    {"near_mm", "[error e]\nrunning = yes\nnear_mm = 1\n", turning_near, 0.05, 0.5},
    {"speed_mm_s", "[error e]\nspeed_mm_s = 150\nnear_mm = 5\n", fast, 0.5, 6},
    {"unseen", "[error e]\nunseen = yes\n", out_of_view, 0.05, 2},
    {"unseen", "[error e]\nunseen = yes\n", unseen_inside, 0.05, 0.5},
    {"dropped", "[error e]\ndropped = yes\n", dropping, 1, 1},
    {"over_share", "[error e]\nover_share = 0.3\n", cut_beyond, 0.05, 5},
    {0}};
