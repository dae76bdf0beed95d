#include "step/loose.h"

#include "base/check.h"
#include "base/clock.h"
#include "step/loose_ground.h"

#include <stdlib.h>
#include <string.h>

#define TOLERANCE_MM 0.02 // a body is moved out of what it is deeper in
#define REST_MM 0.1       // and is at rest where it is nearer than so to a surface,
#define REST_COSINE 0.995 // with its side to it
#define SINK_MM_S 40.0    // else it goes there so fast,
#define LAY_PER_S 10.0    // and turns by this share of what is left
#define TOOL_RADIUS_MM 1.0
#define SLIP_MM 3.0 // what a bone takes from a jaw's hold before it slips out
#define LEVER_LEAST 0.1
#define PASSES_MAX 6
#define GRASPED_BEYOND 0.5 // the jaw's tip, of the body's half width
#define SPARED_BEYOND 2.0  // so that a jaw that comes from behind does not push it along
#define OUTSIDE_MM 60.0    // from all bones, where the case has no portal

struct loose_one {
    enum loose_state state;
    int carrier;    // a body, or BODY_COUNT + the instrument that holds it
    pose T_carrier; // T_carrier_loose
    pose T_mockup;  // at the step before
    struct loose_hints hints;
};

struct loose {
    const struct knee_case *knee;
    const struct loose_ground *ground;
    struct loose_one bodies[CASE_LOOSE_MAX];
    double opening[INSTRUMENT_COUNT]; // of each jaw at the step before
};

// ---- the whole ----------------------------------------------------------------------------------

struct loose *loose_create(const struct knee_case *knee, const struct loose_ground *ground) {
    if (!ground)
        return NULL;
    struct loose *loose = alloc(1, sizeof *loose);
    loose->knee = knee;
    loose->ground = ground;
    loose_reset(loose);
    return loose;
}

void loose_destroy(struct loose **loose) {
    free(*loose);
    *loose = NULL;
}

void loose_reset(struct loose *loose) {
    memset(loose->bodies, 0, sizeof loose->bodies);
    memset(loose->opening, 0, sizeof loose->opening);
    for (int i = 0; i < loose->knee->loose_count; i++) {
        struct loose_one *one = &loose->bodies[i];
        one->carrier = loose->knee->loose[i].body;
        one->T_carrier = loose->ground->first[i];
        loose_hints_init(&one->hints);
    }
}

bool loose_has_moved(const struct loose *loose) {
    bool moved = false;
    for (int i = 0; i < loose->knee->loose_count; i++) {
        const struct loose_one *one = &loose->bodies[i];
        const pose *first = &loose->ground->first[i];
        moved |= one->state != LOOSE_LYING || one->carrier != (int)loose->knee->loose[i].body ||
                 vec3_distance(one->T_carrier.translation, first->translation) > 0;
    }
    return moved;
}

static void keep_hints(const struct loose_ground *ground, struct loose_hints *hints,
                       struct kept *k) {
    for (int i = 0; i < ground->count; i++) {
        uint32_t *triangle = &hints->triangle[i];
        kept_bytes(k, triangle, sizeof *triangle);
        kept_holds(k,
                   *triangle == MESH_NONE || *triangle < ground->surfaces[i].mesh.triangle_count);
    }
    kept_bytes(k, hints->distance, sizeof hints->distance);
    kept_bytes(k, hints->at, sizeof hints->at);
}

void loose_keep(struct loose *loose, struct kept *k) {
    for (int i = 0; i < loose->knee->loose_count; i++) {
        struct loose_one *one = &loose->bodies[i];
        int state = (int)one->state;
        kept_int(k, &state, 0, LOOSE_STATE_COUNT - 1);
        one->state = (enum loose_state)state;
        bool is_lying = one->state == LOOSE_LYING;
        kept_int(k, &one->carrier, is_lying ? 0 : BODY_COUNT * (one->state == LOOSE_HELD),
                 (is_lying ? BODY_COUNT : BODY_COUNT + INSTRUMENT_COUNT) - 1);
        kept_pose(k, &one->T_carrier);
        kept_pose(k, &one->T_mockup);
        keep_hints(loose->ground, &one->hints, k);
    }
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        kept_real(k, &loose->opening[i], 0, 1);
}

// ---- one step -----------------------------------------------------------------------------------

struct stepping {
    struct loose *loose;
    const struct loose_tools *tools;
    struct session_output *out;
    double passed_s;
    uint32_t cut, events;
};

static vec3 radii_of(const struct stepping *s, int i) {
    return s->loose->knee->loose[i].radii_mm;
}

static struct loose_contact nearest_to(const struct stepping *s, int i, pose T) {
    return loose_nearest(s->loose->ground, s->cut, s->out->T_mockup_virtual, radii_of(s, i), T,
                         &s->loose->bodies[i].hints);
}

// Out of all surfaces. Between two bones that come together it is moved to the side by steps.
static vec3 freed(const struct stepping *s, int i, pose T) {
    const struct loose_ground *ground = s->loose->ground;
    struct loose_hints *hints = &s->loose->bodies[i].hints;
    bool moved = true;
    for (int pass = 0; moved && pass < PASSES_MAX; pass++) {
        moved = false;
        for (int k = 0; k < ground->count; k++) {
            if (s->cut >> ground->surfaces[k].group & 1)
                continue;
            struct loose_contact c = loose_contact_with(ground, k, s->out->T_mockup_virtual,
                                                        radii_of(s, i), T, -TOLERANCE_MM, hints);
            if (c.gap >= -TOLERANCE_MM)
                continue;
            T.translation = vec3_add_scaled(T.translation, -c.gap, c.normal);
            moved = true;
        }
    }
    return T.translation;
}

static void carry(struct stepping *s, int i, int carrier, pose T_mockup) {
    struct loose_one *one = &s->loose->bodies[i];
    const pose *T_mockup_carrier = carrier < BODY_COUNT
                                       ? &s->out->T_mockup_virtual[carrier]
                                       : &s->out->instruments[carrier - BODY_COUNT].T_mockup_warped;
    one->carrier = carrier;
    one->T_carrier = pose_compose(pose_inverse(*T_mockup_carrier), T_mockup);
    one->T_mockup = T_mockup;
}

static const struct instrument_output *holder_of(const struct stepping *s,
                                                 const struct loose_one *one) {
    return one->carrier >= BODY_COUNT ? &s->out->instruments[one->carrier - BODY_COUNT] : NULL;
}

// With what carries it. A holder that is not seen leaves it where it was.
static void go_along(const struct stepping *s, struct loose_one *one) {
    const struct instrument_output *holder = holder_of(s, one);
    if (one->state == LOOSE_LYING)
        one->T_mockup = pose_compose(s->out->T_mockup_virtual[one->carrier], one->T_carrier);
    else if (one->state == LOOSE_HELD && holder->present)
        one->T_mockup = pose_compose(holder->T_mockup_warped, one->T_carrier);
}

// ---- held ---------------------------------------------------------------------------------------

static bool is_outside(const struct stepping *s, int i, vec3 at) {
    const struct knee_case *knee = s->loose->knee;
    int portal = s->tools->portals[s->loose->bodies[i].carrier - BODY_COUNT];
    if (portal < 0)
        return nearest_to(s, i, s->loose->bodies[i].T_mockup).gap > OUTSIDE_MM;
    const pose *T_mockup_femur = &s->out->T_mockup_virtual[BODY_FEMUR];
    vec3 inwards = quat_rotate(T_mockup_femur->rotation, knee->portals[portal].direction);
    vec3 hole = pose_apply(*T_mockup_femur, knee->portals[portal].position);
    return vec3_dot(vec3_sub(at, hole), inwards) < 0;
}

static void drop_loose(struct stepping *s, int i, pose T_mockup) {
    struct loose_one *one = &s->loose->bodies[i];
    struct loose_contact under = nearest_to(s, i, T_mockup);
    enum body body =
        under.surface < 0 ? BODY_FEMUR : s->loose->ground->surfaces[under.surface].body;
    one->state = LOOSE_LYING;
    carry(s, i, (int)body, T_mockup);
    s->events |= EVENT_DROPPED;
}

// A bone that is in the way presses it out of the jaw.
static void hold(struct stepping *s, int i) {
    struct loose_one *one = &s->loose->bodies[i];
    const struct instrument_output *holder = holder_of(s, one);
    if (!holder->present)
        return;
    pose gripped = one->T_mockup;
    if (is_outside(s, i, gripped.translation)) {
        one->state = LOOSE_OUT;
        s->events |= EVENT_TAKEN_OUT;
        return;
    }
    one->T_mockup.translation = freed(s, i, gripped);
    if (holder->handle.opening > LOOSE_LET_GO_OPENING ||
        vec3_distance(gripped.translation, one->T_mockup.translation) > SLIP_MM)
        drop_loose(s, i, one->T_mockup);
}

// ---- grasping -----------------------------------------------------------------------------------

static bool grasps(const struct stepping *s, int tool) {
    const struct instrument *instrument = &s->tools->instruments->of[tool];
    return instrument->kind == INSTRUMENT_JAW && !instrument->cuts &&
           s->out->instruments[tool].present;
}

// Between the jaws: before the hinge and not farther beyond the tip than `beyond` of its half
// width, within the opening of a jaw that is open. A hand cannot feel it, so a piece that is half
// beside counts.
static bool is_between(const struct stepping *s, int i, int tool, double beyond) {
    const struct instrument *jaw = &s->tools->instruments->of[tool];
    const struct loose_one *one = &s->loose->bodies[i];
    vec3 radii = radii_of(s, i);
    double widest = fmax(radii.x, fmax(radii.y, radii.z)), spare = 0.5 * widest;
    double high = jaw->length_mm * jaw->opening_deg * RAD_PER_DEG;
    vec3 p =
        pose_apply_inverse(s->out->instruments[tool].T_mockup_warped, one->T_mockup.translation);
    return p.z >= -jaw->length_mm && p.z <= beyond * widest &&
           fabs(p.x) <= jaw->width_mm / 2 + spare && p.y >= -widest && p.y <= high + spare;
}

static bool holds_one(const struct stepping *s, int tool) {
    for (int i = 0; i < s->loose->knee->loose_count; i++)
        if (s->loose->bodies[i].state == LOOSE_HELD &&
            s->loose->bodies[i].carrier == BODY_COUNT + tool)
            return true;
    return false;
}

static int between(const struct stepping *s, int tool) {
    double least = INFINITY;
    int nearest = -1;
    for (int i = 0; i < s->loose->knee->loose_count; i++) {
        const struct loose_one *one = &s->loose->bodies[i];
        double away = vec3_distance(one->T_mockup.translation,
                                    s->out->instruments[tool].T_mockup_warped.translation);
        if (one->state != LOOSE_LYING || away >= least || !is_between(s, i, tool, GRASPED_BEYOND))
            continue;
        least = away;
        nearest = i;
    }
    return nearest;
}

// A jaw that closes takes the piece that is nearest to its tip.
static void grasp(struct stepping *s, int tool) {
    double opening = grasps(s, tool) ? s->out->instruments[tool].handle.opening : 0;
    bool closes = s->loose->opening[tool] > LOOSE_HELD_OPENING && opening <= LOOSE_HELD_OPENING;
    s->loose->opening[tool] = opening;
    if (!closes || !grasps(s, tool) || holds_one(s, tool))
        return;
    int i = between(s, tool);
    if (i < 0)
        return;
    s->loose->bodies[i].state = LOOSE_HELD;
    carry(s, i, BODY_COUNT + tool, s->loose->bodies[i].T_mockup);
    s->events |= EVENT_GRASPED;
}

// ---- pushing ------------------------------------------------------------------------------------

static vec3 nearest_on(vec3 a, vec3 b, vec3 p) {
    vec3 way = vec3_sub(b, a);
    double square = vec3_dot(way, way);
    double t = square > 0 ? vec3_dot(vec3_sub(p, a), way) / square : 0;
    return vec3_add_scaled(a, fmin(fmax(t, 0), 1), way);
}

// How much of a way is along the surface.
static vec3 along(vec3 way, const struct loose_contact *under) {
    return under->surface < 0 ? way
                              : vec3_add_scaled(way, -vec3_dot(way, under->normal), under->normal);
}

// Away from a ball at `from`: zero where it does not touch, or only presses it down.
static vec3 pushed(const struct stepping *s, int i, pose T, vec3 from, double radius_mm,
                   const struct loose_contact *under) {
    vec3 none = {0, 0, 0}, away = vec3_sub(T.translation, from);
    vec3 direction = vec3_unit_or(away, under->normal);
    double gap = vec3_length(away) - loose_reach(radii_of(s, i), T.rotation, direction) - radius_mm;
    vec3 side = along(direction, under);
    return gap < 0 && vec3_length(side) >= LEVER_LEAST ? vec3_scale(-gap, side) : none;
}

// By the part of the instrument that is deepest in it.
static vec3 pushed_by(const struct stepping *s, int i, int tool, pose T,
                      const struct loose_contact *under) {
    const struct instrument_body *body = &s->tools->bodies[tool];
    const pose *T_mockup_tip = &s->out->instruments[tool].T_mockup_warped;
    vec3 farthest = {0, 0, 0};
    for (int k = 0; k < body->point_count; k++) {
        const struct avatar_point *a = &body->points[k];
        const struct avatar_point *b = &body->points[k + 1 < body->point_count ? k + 1 : k];
        vec3 from = nearest_on(pose_apply(*T_mockup_tip, a->at), pose_apply(*T_mockup_tip, b->at),
                               T.translation);
        vec3 way = pushed(s, i, T, from, fmax(a->radius_mm, TOOL_RADIUS_MM), under);
        if (vec3_length(way) > vec3_length(farthest))
            farthest = way;
    }
    return farthest;
}

// An open jaw goes round what is between its jaws.
static bool is_spared(const struct stepping *s, int i, int tool) {
    return !s->out->instruments[tool].present ||
           (grasps(s, tool) && s->out->instruments[tool].handle.opening > LOOSE_HELD_OPENING &&
            is_between(s, i, tool, SPARED_BEYOND));
}

static vec3 pushed_by_body(const struct stepping *s, int i, int other, pose T,
                           const struct loose_contact *under) {
    const struct loose_one *one = &s->loose->bodies[other];
    vec3 direction =
        vec3_unit_or(vec3_sub(T.translation, one->T_mockup.translation), (vec3){1, 0, 0});
    return pushed(s, i, T, one->T_mockup.translation,
                  loose_reach(radii_of(s, other), one->T_mockup.rotation, direction), under);
}

static vec3 pushed_by_all(const struct stepping *s, int i, pose T,
                          const struct loose_contact *under) {
    vec3 sum = {0, 0, 0};
    for (int tool = 0; tool < s->tools->instruments->count; tool++)
        if (!is_spared(s, i, tool))
            sum = vec3_add(sum, pushed_by(s, i, tool, T, under));
    for (int other = 0; other < s->loose->knee->loose_count; other++)
        if (other != i && s->loose->bodies[other].state != LOOSE_OUT)
            sum = vec3_add(sum, pushed_by_body(s, i, other, T, under));
    return sum;
}

// ---- lying --------------------------------------------------------------------------------------

// Between two surfaces it cannot turn its side to both.
static bool is_wedged(const struct stepping *s, int i, pose T) {
    const struct loose_ground *ground = s->loose->ground;
    int touched = 0;
    for (int k = 0; k < ground->count; k++)
        if (!(s->cut >> ground->surfaces[k].group & 1))
            touched += loose_contact_with(ground, k, s->out->T_mockup_virtual, radii_of(s, i), T,
                                          REST_MM, &s->loose->bodies[i].hints)
                           .gap <= REST_MM;
    return touched > 1;
}

static bool is_at_rest(const struct stepping *s, int i, const struct loose_contact *under, pose T) {
    vec3 axis = quat_rotate(T.rotation, (vec3){0, 0, 1});
    return under->gap >= -TOLERANCE_MM && under->gap <= REST_MM &&
           (fabs(vec3_dot(axis, under->normal)) >= REST_COSINE || is_wedged(s, i, T));
}

static quat part_of_the_turn(quat from, quat to, double share) {
    return quat_unit((quat){from.w + share * (to.w - from.w), from.x + share * (to.x - from.x),
                            from.y + share * (to.y - from.y), from.z + share * (to.z - from.z)});
}

// Down to the nearest surface, and onto its side.
static pose sunk(const struct stepping *s, const struct loose_contact *under, pose T) {
    double down = fmin(fmax(under->gap, 0), SINK_MM_S * s->passed_s);
    T.translation = vec3_add_scaled(T.translation, -down, under->normal);
    T.rotation = part_of_the_turn(T.rotation, loose_laid(T.rotation, under->normal),
                                  fmin(LAY_PER_S * s->passed_s, 1));
    return T;
}

static void lie(struct stepping *s, int i) {
    pose T = s->loose->bodies[i].T_mockup;
    struct loose_contact under = nearest_to(s, i, T);
    if (under.surface < 0)
        return;
    vec3 push = pushed_by_all(s, i, T, &under);
    if (vec3_length(push) == 0 && is_at_rest(s, i, &under, T))
        return;
    T.translation = vec3_add(T.translation, push);
    under = nearest_to(s, i, T);
    if (under.surface >= 0)
        T = sunk(s, &under, T);
    T.translation = freed(s, i, T);
    under = nearest_to(s, i, T);
    if (under.surface >= 0)
        carry(s, i, (int)s->loose->ground->surfaces[under.surface].body, T);
}

// ---- the step -----------------------------------------------------------------------------------

static void act(struct stepping *s) {
    int count = s->loose->knee->loose_count;
    for (int i = 0; i < count; i++)
        if (s->loose->bodies[i].state == LOOSE_HELD)
            hold(s, i);
    for (int tool = 0; tool < s->tools->instruments->count; tool++)
        grasp(s, tool);
    for (int i = 0; i < count; i++)
        if (s->loose->bodies[i].state == LOOSE_LYING)
            lie(s, i);
}

uint32_t loose_step(struct loose *loose, const struct loose_tools *tools, bool running,
                    int64_t passed_ns, uint32_t cut, struct session_output *out) {
    struct stepping s = {loose, tools, out, (double)passed_ns / NS_PER_S, cut, 0};
    int count = out->loose_count = loose->knee->loose_count;
    for (int i = 0; i < count; i++)
        go_along(&s, &loose->bodies[i]);
    if (running)
        act(&s);
    for (int i = 0; i < count; i++) {
        const struct loose_one *one = &loose->bodies[i];
        out->loose[i] = (struct loose_output){one->state, one->carrier, one->T_mockup};
    }
    return s.events;
}
