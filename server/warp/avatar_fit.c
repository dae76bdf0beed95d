#include "warp/avatar_fit.h"

#include "base/turn.h"

#include <string.h>

#define STEPS_MAX 20
#define HALVINGS_MAX 12
#define STEP_ENOUGH 1e-5 // of v, and of s in mm; the next would be about its square

// ---- how the surfaces around a point pull at it -------------------------------------------------

struct fit_weight fit_weigh(const struct fit *fit, const struct fit_point *p,
                            const struct warp_contact *c) {
    double gap = c->distance - p->radius, near = fmax(gap, 0) + FIT_SOFT_MM;
    double reach = fit->radius_mm - p->radius + FIT_SOFT_MM;
    if (near >= reach)
        return (struct fit_weight){0, 0};
    return (struct fit_weight){1 / near - 1 / reach, gap > 0 ? -1 / (near * near) : 0};
}

static double slack_of(const struct fit_point *p, const struct warp_contact *c) {
    return fmax(c->distance - p->radius - FIT_MARGIN_MM, 0);
}

// A row c = n·f + rest.
struct row {
    vec3 normal;
    double rest;
};

// What does not change with f.
struct spring {
    const struct fit_point *point;
    double cost; // at f = 0, without the rows
    vec3 pull;   // and its force there, backwards
    mat3 stiffness;
    struct row rows[WARP_SURFACES_MAX];
};

// All but the rows: τ Ω |f − H W|² + Σ ω off².
static void wind(const struct fit *fit, const struct fit_point *p, struct spring *out) {
    double sum = 0;
    out->point = p;
    out->cost = 0;
    out->pull = (vec3){0, 0, 0};
    out->stiffness = (mat3){0};
    for (int k = 0; k < p->count; k++) {
        vec3 n = p->contacts[k].normal;
        double weight = fit_weigh(fit, p, &p->contacts[k]).value;
        double off = fit->shown * vec3_dot(n, p->contacts[k].delta);
        sum += FIT_WHOLE * weight;
        out->cost += weight * off * off;
        out->pull = vec3_add_scaled(out->pull, weight * off, n);
        out->stiffness = mat3_add_scaled(out->stiffness, weight, mat3_outer(n, n));
        out->rows[k] = (struct row){n, slack_of(p, &p->contacts[k]) - off};
    }
    vec3 W = vec3_scale(fit->shown, p->warp.displacement);
    out->cost += sum * vec3_dot(W, W);
    out->pull = vec3_add_scaled(out->pull, sum, W);
    for (int i = 0; i < 3; i++)
        out->stiffness.m[i][i] += sum;
}

struct pull {
    double cost;
    vec3 force;     // half of the cost's gradient over f
    mat3 stiffness; // ∂force/∂f
};

// Without h.
static struct pull pull_of(const struct spring *spring, vec3 f) {
    vec3 stiff = mat3_apply(spring->stiffness, f);
    struct pull pull = {spring->cost + vec3_dot(f, stiff) - 2 * vec3_dot(f, spring->pull),
                        vec3_sub(stiff, spring->pull), spring->stiffness};
    for (int k = 0; k < spring->point->count; k++) {
        vec3 n = spring->rows[k].normal;
        double row = vec3_dot(n, f) + spring->rows[k].rest;
        if (row >= 0)
            continue;
        pull.cost += FIT_KEEP_OUT * row * row;
        pull.force = vec3_add_scaled(pull.force, FIT_KEEP_OUT * row, n);
        pull.stiffness = mat3_add_scaled(pull.stiffness, FIT_KEEP_OUT, mat3_outer(n, n));
    }
    return pull;
}

// ---- and how that changes with its place --------------------------------------------------------

// One contact of a point that is displaced by f.
struct fit_contact {
    struct fit_weight weight;
    vec3 e;         // f − H Δ
    double off;     // n·e
    double stiff;   // over `off`: of ω and μ together
    double pull;    // half of the cost's slope over `off`
    bool row_leans; // the row grows with the gap
};

static struct fit_contact touch_of(const struct fit *fit, const struct fit_point *p,
                                   const struct warp_contact *c, vec3 f) {
    struct fit_contact t = {.weight = fit_weigh(fit, p, c),
                            .e = vec3_add_scaled(f, -fit->shown, c->delta)};
    double slack = slack_of(p, c);
    t.off = vec3_dot(c->normal, t.e);
    double row = fmin(t.off + slack, 0);
    t.row_leans = row < 0 && slack > 0;
    t.stiff = t.weight.value + (row < 0 ? FIT_KEEP_OUT : 0);
    t.pull = t.weight.value * t.off + FIT_KEEP_OUT * row;
    return t;
}

struct pull_slopes {
    mat3 place; // ∂force/∂p, f held
    vec3 shown; // ∂force/∂H
};

// ∂n/∂p = (I − n nᵀ − Π)/d: 0 over a face.
static mat3 normal_slope(const struct warp_contact *c) {
    mat3 zero = {0};
    double rank = c->slide.m[0][0] + c->slide.m[1][1] + c->slide.m[2][2];
    if (c->distance <= 1e-6 || rank > 1.5)
        return zero;
    mat3 across = mat3_add_scaled(mat3_identity(), -1, mat3_outer(c->normal, c->normal));
    return mat3_add_scaled(zero, 1 / c->distance, mat3_add_scaled(across, -1, c->slide));
}

static struct pull_slopes pull_slopes_of(const struct fit *fit, const struct fit_point *p, vec3 f) {
    struct pull_slopes out = {0};
    double sum = 0;
    vec3 sum_slope = {0};
    for (int k = 0; k < p->count; k++) {
        const struct warp_contact *c = &p->contacts[k];
        struct fit_contact t = touch_of(fit, p, c, f);
        mat3 turning = normal_slope(c);
        vec3 off_slope = vec3_add_scaled(mat3_apply(turning, t.e), -fit->shown,
                                         mat3_apply_transposed(c->delta_gradient, c->normal));
        double lean = t.weight.slope * t.off + (t.row_leans ? FIT_KEEP_OUT : 0);
        vec3 slope = vec3_add_scaled(vec3_scale(t.stiff, off_slope), lean, c->normal);
        out.place = mat3_add_scaled(out.place, 1, mat3_outer(c->normal, slope));
        out.place = mat3_add_scaled(out.place, t.pull, turning);
        out.shown = vec3_add_scaled(out.shown, -t.stiff * vec3_dot(c->normal, c->delta), c->normal);
        sum += FIT_WHOLE * t.weight.value;
        sum_slope = vec3_add_scaled(sum_slope, FIT_WHOLE * t.weight.slope, c->normal);
    }
    vec3 W = p->warp.displacement, off = vec3_add_scaled(f, -fit->shown, W);
    out.place = mat3_add_scaled(out.place, 1, mat3_outer(off, sum_slope));
    out.place = mat3_add_scaled(out.place, -sum * fit->shown, p->warp.gradient);
    out.shown = vec3_add_scaled(out.shown, -sum, W);
    return out;
}

// ---- the sum over the points, as a function of v and s ------------------------------------------

struct problem {
    const struct axis *axis;
    int count;
    struct spring springs[AVATAR_POINTS_MAX]; // of the points that are heard
};

static void collect(const struct fit *fit, struct problem *out) {
    out->axis = &fit->axis;
    out->count = 0;
    for (int i = 0; i < fit->count; i++)
        if (fit->points[i].heard > 0 && fit->points[i].count > 0)
            wind(fit, &fit->points[i], &out->springs[out->count++]);
}

// Where the axis goes: Q u, its slopes over v[0], v[1], and the second ones: 00, 01, 11.
struct bearing {
    struct turn turn;
    vec3 ahead, slopes[2], bends[3];
    double s;
};

static struct bearing bear(const struct axis *axis, const double q[3]) {
    struct bearing b = {.turn = turn_into(axis->u, axis->e, q), .s = q[2]};
    b.ahead = turn_apply(&b.turn, axis->u);
    turn_slopes(&b.turn, axis->u, b.slopes, b.bends);
    return b;
}

// A point's displacement; its slopes over v[0], v[1], s; the second ones over v. Those over v and s
// are the slopes of Q u; over s alone there is none.
struct course {
    vec3 f, slopes[3], bends[3];
};

static void add_beside(const struct bearing *b, vec3 beside, struct course *out) {
    vec3 slopes[2], bends[3];
    turn_slopes(&b->turn, beside, slopes, bends);
    out->f = vec3_add(out->f, vec3_sub(turn_apply(&b->turn, beside), beside));
    for (int i = 0; i < 2; i++)
        out->slopes[i] = vec3_add(out->slopes[i], slopes[i]);
    for (int i = 0; i < 3; i++)
        out->bends[i] = vec3_add(out->bends[i], bends[i]);
}

// f is 0, exactly, where v and s are.
static struct course course_of(const struct axis *axis, const struct bearing *b,
                               const struct fit_point *p) {
    struct course c;
    double along = p->along + b->s;
    vec3 turned = vec3_scale(p->along, vec3_sub(b->ahead, axis->u));
    c.f = vec3_add_scaled(turned, b->s, b->ahead);
    c.slopes[2] = b->ahead;
    for (int i = 0; i < 2; i++)
        c.slopes[i] = vec3_scale(along, b->slopes[i]);
    for (int i = 0; i < 3; i++)
        c.bends[i] = vec3_scale(along, b->bends[i]);
    if (vec3_dot(p->beside, p->beside) > 0)
        add_beside(b, p->beside, &c);
    return c;
}

// Half of the cost, its gradient, and its second derivatives in two parts.
struct system {
    double cost, gradient[3];
    double stiffness[3][3], bend[3][3]; // positive semidefinite; small near a solution
};

static void add_point(const struct problem *problem, const struct spring *spring,
                      const struct bearing *b, struct system *out) {
    double heard = spring->point->heard;
    struct course course = course_of(problem->axis, b, spring->point);
    struct pull pull = pull_of(spring, course.f);
    vec3 force = vec3_scale(heard, pull.force);
    out->cost += heard * pull.cost;
    for (int i = 0; i < 3; i++) {
        vec3 stiff = vec3_scale(heard, mat3_apply(pull.stiffness, course.slopes[i]));
        out->gradient[i] += vec3_dot(course.slopes[i], force);
        for (int j = 0; j <= i; j++)
            out->stiffness[i][j] += vec3_dot(stiff, course.slopes[j]);
    }
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j <= i; j++)
            out->bend[i][j] += vec3_dot(course.bends[i + j], force);
        out->bend[2][i] += vec3_dot(b->slopes[i], force);
    }
}

// Lower triangles only.
static struct system system_at(const struct problem *problem, const double q[3]) {
    struct system system = {0};
    struct bearing b = bear(problem->axis, q);
    for (int i = 0; i < problem->count; i++)
        add_point(problem, &problem->springs[i], &b, &system);
    return system;
}

// Cholesky in place, of the lower triangle; false where it is not positive definite.
static bool factor(double a[3][3]) {
    for (int j = 0; j < 3; j++)
        for (int i = j; i < 3; i++) {
            for (int k = 0; k < j; k++)
                a[i][j] -= a[i][k] * a[j][k];
            if (i == j && !(a[j][j] > 0))
                return false;
            a[i][j] = i == j ? sqrt(a[j][j]) : a[i][j] / a[j][j];
        }
    return true;
}

static void solve(double factors[3][3], double b[3]) {
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < i; k++)
            b[i] -= factors[i][k] * b[k];
        b[i] /= factors[i][i];
    }
    for (int i = 2; i >= 0; i--) {
        for (int k = i + 1; k < 3; k++)
            b[i] -= factors[k][i] * b[k];
        b[i] /= factors[i][i];
    }
}

// The second derivatives, or where they are not definite what Gauss and Newton take for them.
static bool factor_system(const struct system *system, double out[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[i][j] = system->stiffness[i][j] + system->bend[i][j];
    if (factor(out))
        return true;
    memcpy(out, system->stiffness, sizeof system->stiffness);
    return factor(out);
}

// Along −step, as far as the cost does not rise.
static void advance(const struct problem *problem, const double step[3], double rounding,
                    double q[3], struct system *system) {
    double from[3], cost = system->cost, share = 1;
    memcpy(from, q, sizeof from);
    for (int i = 0; i <= HALVINGS_MAX; i++, share *= 0.5) {
        for (int k = 0; k < 3; k++)
            q[k] = from[k] - share * step[k];
        *system = system_at(problem, q);
        if (system->cost <= cost + rounding)
            return;
    }
}

// ---- slopes -------------------------------------------------------------------------------------

// How the gradient changes with the hand's way, q held. On the way, all that hangs on the axis
// turns with the hand; P goes along u besides, which h and H hang on; and each point goes on in the
// field.
static void add_gradient_slopes(const struct fit *fit, const struct spring *spring,
                                const struct bearing *b, double out[3][6]) {
    const struct axis *axis = &fit->axis;
    const struct fit_point *p = spring->point;
    struct course c = course_of(axis, b, p);
    struct pull pull = pull_of(spring, c.f);
    struct pull_slopes slopes = pull_slopes_of(fit, p, c.f);
    // P's way along u is −u over the hand's way, u × aside over its turn.
    vec3 portal_turn = vec3_cross(axis->u, axis->aside), by_portal = vec3_sub(axis->u, b->ahead);
    vec3 fading = vec3_add_scaled(vec3_scale(p->heard_slope / p->heard, pull.force),
                                  fit->shown_slope, slopes.shown);
    for (int i = 0; i < 3; i++) {
        vec3 J = c.slopes[i], stiff = mat3_apply(pull.stiffness, J);
        vec3 way = mat3_apply_transposed(slopes.place, J);
        vec3 turning = vec3_add(vec3_cross(p->arm, way), vec3_cross(J, pull.force));
        turning = vec3_add(turning, vec3_cross(c.f, stiff));
        double portal = vec3_dot(stiff, by_portal) - vec3_dot(J, fading);
        if (i < 2)
            portal -= vec3_dot(b->slopes[i], pull.force);
        way = vec3_add_scaled(way, -portal, axis->u);
        turning = vec3_add_scaled(turning, portal, portal_turn);
        const double row[6] = {way.x, way.y, way.z, turning.x, turning.y, turning.z};
        for (int k = 0; k < 6; k++)
            out[i][k] += p->heard * row[k];
    }
}

// Where the gradient stays 0: ∂q = −H⁻¹ ∂gradient.
static void find_slope(const struct fit *fit, const struct problem *problem, const double q[3],
                       double factors[3][3], double out[3][6]) {
    double change[3][6] = {0};
    struct bearing b = bear(problem->axis, q);
    for (int i = 0; i < problem->count; i++)
        add_gradient_slopes(fit, &problem->springs[i], &b, change);
    for (int k = 0; k < 6; k++) {
        double column[3] = {-change[0][k], -change[1][k], -change[2][k]};
        solve(factors, column);
        for (int i = 0; i < 3; i++)
            out[i][k] = column[i];
    }
}

// Newton from q = 0.
void fit_find(const struct fit *fit, double q[3], double out_slope[3][6]) {
    struct problem problem;
    double factors[3][3], step[3];
    memset(q, 0, 3 * sizeof *q);
    memset(out_slope, 0, 3 * sizeof *out_slope);
    collect(fit, &problem);
    if (!problem.count)
        return;
    struct system system = system_at(&problem, q);
    double rounding = 1e-12 * system.cost;
    for (int i = 0; i < STEPS_MAX; i++) {
        if (!factor_system(&system, factors))
            return;
        memcpy(step, system.gradient, sizeof step);
        solve(factors, step);
        advance(&problem, step, rounding, q, &system);
        if (fabs(step[0]) + fabs(step[1]) + fabs(step[2]) < STEP_ENOUGH)
            break;
    }
    if (factor_system(&system, factors))
        find_slope(fit, &problem, q, factors, out_slope);
}
