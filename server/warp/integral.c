// The integral field of warp/warp.h.
#include "warp/warp_parts.h"

#define GAP_OVER_SKIN 40
#define BETWEEN_SHEETS 2.0   // how much more a surface counts that encloses y
#define FADE_FROM_SHARE 0.7  // of R, from which a surface fades
#define PARTS_OF_RADIUS 15.0 // R over m0, and w1 times R
#define PI 3.14159265358979323846

// ---- one surface --------------------------------------------------------------------------------

// A plane through the closest point.
static void look_at_plane(struct warp_contact *c) {
    double d = c->distance;
    c->sight = (struct warp_sight){.weight = PI / (d * d),
                                   .open = 1,
                                   .weight_slope = vec3_scale(-2 * PI / (d * d * d), c->normal)};
}

// e² = |x̃ − p|²/D² = |x̃ − p|² M/π
static void take_sight(const struct surface_sight *seen, vec3 p, quat turn,
                       struct warp_contact *c) {
    vec3 off = vec3_sub(seen->point, p);
    mat3 by_p = mat3_add_scaled(seen->slide, -1, mat3_identity());
    double square = vec3_dot(off, off);
    vec3 slope = vec3_scale(2 * seen->weight / PI, mat3_apply(mat3_transpose(by_p), off));
    slope = vec3_add_scaled(slope, square / PI, seen->weight_slope);
    c->sight = (struct warp_sight){.weight = seen->weight,
                                   .open = square * seen->weight / PI,
                                   .weight_slope = quat_rotate(turn, seen->weight_slope),
                                   .open_slope = quat_rotate(turn, slope)};
}

bool integral_look(const struct warp_surface *surface, const struct stance *stance, vec3 p,
                   vec3 closest, struct warp_contact *c) {
    struct surface_sight seen;
    if (!(c->distance > TOUCH_MM))
        return false;
    if (!surface->integral || !surface_integral_at(surface->integral, p, closest, &seen)) {
        look_at_plane(c);
        return false;
    }
    take_sight(&seen, p, stance->physical.rotation, c);
    if (surface->other_share)
        return false;
    c->delta = (vec3){0};
    c->delta_gradient = (mat3){0};
    if (!surface->displacement && !stance->is_corrected)
        return true;
    struct changes changes = {.slide = seen.slide, .change = seen.change};
    c->delta = delta_of(stance, 0, seen.point, seen.displacement);
    c->delta_gradient =
        delta_gradient_of(stance, 0, vec3_add(seen.point, seen.displacement), &changes);
    return true;
}

// ---- corrections --------------------------------------------------------------------------------

// m² of one body.
static struct slanted corrected_square(const struct warp_scene *scene, int body, vec3 y) {
    if (!is_corrected(scene, body))
        return (struct slanted){0};
    pose M = scene->correction[body];
    vec3 off = vec3_sub(pose_apply(M, y), y);
    mat3 by_y = mat3_add_scaled(quat_to_mat3(M.rotation), -1, mat3_identity());
    return (struct slanted){vec3_dot(off, off),
                            vec3_scale(2, mat3_apply(mat3_transpose(by_y), off))};
}

// R_k = √(R² + m²)
static struct slanted reach_of(const struct field *field, const struct slanted *square) {
    double reach = sqrt(field->radius_mm * field->radius_mm + square->value);
    return (struct slanted){reach, vec3_scale(0.5 / reach, square->gradient)};
}

double integral_reach(const struct warp_scene *scene, const struct field *field, int body, vec3 y) {
    struct slanted square = corrected_square(scene, body, y);
    return reach_of(field, &square).value;
}

// b = 1/(1 + m²/m0²)
static struct slanted stillness(const struct field *field, const struct slanted *square) {
    double m0 = field->radius_mm / PARTS_OF_RADIUS;
    double b = 1 / (1 + square->value / (m0 * m0));
    return (struct slanted){b, vec3_scale(-b * b / (m0 * m0), square->gradient)};
}

static struct slanted largest_square(const struct warp_scene *scene, const struct field *field,
                                     vec3 y) {
    struct slanted largest = {0};
    for (int i = 0; scene->correction && i < scene->surface_count; i++) {
        if (!field_takes(field, &scene->surfaces[i]))
            continue;
        struct slanted square = corrected_square(scene, scene->surfaces[i].body, y);
        if (square.value > largest.value)
            largest = square;
    }
    return largest;
}

// ---- distances ----------------------------------------------------------------------------------

// χ(d/R_k)
static struct slanted fade_of(const struct warp_contact *c, const struct slanted *reach) {
    double fading, share = c->distance / reach->value;
    double fade = 1 - smoothstep(share, FADE_FROM_SHARE, 1 - FADE_FROM_SHARE, &fading);
    vec3 slope = vec3_add_scaled(c->normal, -share, reach->gradient);
    return (struct slanted){fade, vec3_scale(-fading / reach->value, slope)};
}

// 1 + 2 b (1 − e²)₊²
static struct slanted boost_of(const struct warp_sight *sight, const struct slanted *b) {
    double closed = fmax(1 - sight->open, 0);
    vec3 slope = vec3_scale(BETWEEN_SHEETS * closed * closed, b->gradient);
    slope = vec3_add_scaled(slope, -2 * BETWEEN_SHEETS * b->value * closed, sight->open_slope);
    return (struct slanted){1 + BETWEEN_SHEETS * b->value * closed * closed, slope};
}

// boost (1/D − 1/R_k)₊ χ
static struct slanted open_weight(const struct warp_contact *c, const struct slanted *b,
                                  const struct slanted *reach) {
    const struct warp_sight *sight = &c->sight;
    double R = reach->value, inverse = sqrt(sight->weight / PI), near = inverse - 1 / R;
    struct slanted fade = fade_of(c, reach), boost = boost_of(sight, b);
    if (!(near > 0) || !(fade.value > 0))
        return (struct slanted){0};
    vec3 near_slope = vec3_scale(0.5 * inverse / sight->weight, sight->weight_slope);
    near_slope = vec3_add_scaled(near_slope, 1 / (R * R), reach->gradient);
    vec3 slope = vec3_scale(near * fade.value, boost.gradient);
    slope = vec3_add_scaled(slope, boost.value * fade.value, near_slope);
    slope = vec3_add_scaled(slope, boost.value * near, fade.gradient);
    return (struct slanted){boost.value * near * fade.value, slope};
}

// D'
static struct slanted distance_of(const struct field *field, const struct warp_contact *c,
                                  const struct slanted *square, const struct slanted *reach) {
    double R = reach->value, m0 = field->radius_mm / PARTS_OF_RADIUS, d = c->distance;
    if (!(d > TOUCH_MM))
        return (struct slanted){d, c->normal};
    struct slanted b = stillness(field, square), open = open_weight(c, &b, reach);
    double D = 1 / (open.value + 1 / R), cap = (1 + m0 * m0 / square->value) * d;
    if (!(square->value > 0) || !(cap < D)) {
        vec3 slope = vec3_add_scaled(open.gradient, -1 / (R * R), reach->gradient);
        return (struct slanted){D, vec3_scale(-D * D, slope)};
    }
    double by_square = -d * m0 * m0 / (square->value * square->value);
    return (struct slanted){cap, vec3_add_scaled(vec3_scale(1 + m0 * m0 / square->value, c->normal),
                                                 by_square, square->gradient)};
}

// The skin that the two smallest leave.
static struct slanted skin_of(const struct field *field, const struct slanted *distances,
                              int count) {
    const struct slanted *first = NULL, *second = NULL;
    struct slanted skin = {field->skin_mm, {0}};
    for (int i = 0; i < count; i++) {
        const struct slanted *d = &distances[i];
        if (!first || d->value < first->value) {
            second = first;
            first = d;
        } else if (!second || d->value < second->value) {
            second = d;
        }
    }
    if (!(skin.value > 0) || !second)
        return skin;
    double by_gap, gap = first->value + second->value;
    skin.value = skin_in(field->skin_mm, gap, GAP_OVER_SKIN, &by_gap);
    skin.gradient = vec3_scale(by_gap, vec3_add(first->gradient, second->gradient));
    return skin;
}

// φ, and where it may be 0 the bare distance.
static struct slanted thinned(const struct slanted *d, const struct slanted *skin) {
    double by_d, by_skin, value = thin(d->value, skin->value, &by_d, &by_skin);
    return (struct slanted){
        value, vec3_add_scaled(vec3_scale(by_d, d->gradient), by_skin, skin->gradient)};
}

// 1/φ(D') − 1/φ(R_k)
static struct slanted weigh(const struct slanted *thin_d, const struct slanted *thin_reach) {
    double a = thin_d->value, r = thin_reach->value;
    vec3 slope = vec3_scale(-1 / (a * a), thin_d->gradient);
    return (struct slanted){1 / a - 1 / r,
                            vec3_add_scaled(slope, 1 / (r * r), thin_reach->gradient)};
}

// ---- the blend ----------------------------------------------------------------------------------

struct blend {
    struct slanted distances[WARP_SURFACES_MAX]; // φ(D')
    struct slanted weights[WARP_SURFACES_MAX];   // 0 where y touches
    int touching;
};

static void measure(const struct warp_scene *scene, const struct field *field, vec3 y,
                    const struct warp_contact *contacts, int count, struct blend *out) {
    struct slanted reaches[WARP_SURFACES_MAX];
    out->touching = 0;
    for (int i = 0; i < count; i++) {
        int body = scene->surfaces[contacts[i].surface].body;
        struct slanted square = corrected_square(scene, body, y);
        reaches[i] = reach_of(field, &square);
        out->distances[i] = distance_of(field, &contacts[i], &square, &reaches[i]);
    }
    struct slanted skin = skin_of(field, out->distances, count);
    for (int i = 0; i < count; i++) {
        struct slanted thin_reach = thinned(&reaches[i], &skin);
        out->distances[i] = thinned(&out->distances[i], &skin);
        bool touches = out->distances[i].value <= TOUCH_MM;
        out->weights[i] = touches ? (struct slanted){0} : weigh(&out->distances[i], &thin_reach);
        out->touching += touches;
    }
}

// On surfaces the mean of theirs. Off one, W − Δ = φ Σ ω_k (Δ_k − Δ) to first order in its φ,
// summed over the others; the background's share is of second order.
static void take_touching(const struct blend *blend, const struct warp_contact *contacts, int count,
                          struct warp *out) {
    vec3 sum = {0}, rise = {0}, towards = {0};
    mat3 gradients = {0}, zero = {0};
    for (int i = 0; i < count; i++) {
        if (blend->distances[i].value > TOUCH_MM)
            continue;
        sum = vec3_add(sum, contacts[i].delta);
        gradients = mat3_add_scaled(gradients, 1, contacts[i].delta_gradient);
        towards = blend->distances[i].gradient;
    }
    out->displacement = vec3_scale(1.0 / blend->touching, sum);
    out->gradient = mat3_add_scaled(zero, 1.0 / blend->touching, gradients);
    if (blend->touching > 1)
        return;
    for (int i = 0; i < count; i++)
        rise = vec3_add_scaled(rise, blend->weights[i].value,
                               vec3_sub(contacts[i].delta, out->displacement));
    out->gradient = mat3_add_scaled(out->gradient, 1, mat3_outer(rise, towards));
}

// ω_0', square: the largest m²
static struct slanted background_of(const struct field *field, const struct slanted *square,
                                    const struct slanted *sum) {
    struct slanted b = stillness(field, square), reach = reach_of(field, square);
    double scale = field->radius_mm / PARTS_OF_RADIUS, below = 1 + b.value * sum->value * scale;
    double w0 = field->background_per_mm * field->radius_mm / reach.value;
    double value = w0 * (1 + b.value) / below;
    vec3 slope = vec3_scale(w0 - value * sum->value * scale, b.gradient);
    slope = vec3_add_scaled(slope, -value * b.value * scale, sum->gradient);
    slope = vec3_add_scaled(vec3_scale(1 / below, slope), -value / reach.value, reach.gradient);
    return (struct slanted){value, slope};
}

void integral_blend(const struct warp_scene *scene, const struct field *field, vec3 y,
                    const struct warp_contact *contacts, int count, struct warp *out) {
    struct blend blend;
    struct slanted sum = {0};
    vec3 W = {0};
    measure(scene, field, y, contacts, count, &blend);
    if (blend.touching) {
        take_touching(&blend, contacts, count, out);
        return;
    }
    for (int i = 0; i < count; i++) {
        sum.value += blend.weights[i].value;
        sum.gradient = vec3_add(sum.gradient, blend.weights[i].gradient);
        W = vec3_add_scaled(W, blend.weights[i].value, contacts[i].delta);
    }
    struct slanted largest = largest_square(scene, field, y);
    struct slanted rest = background_of(field, &largest, &sum);
    double whole = sum.value + rest.value;
    if (!(whole > 0))
        return;
    W = vec3_scale(1 / whole, W);
    mat3 gradient = {0};
    for (int i = 0; i < count; i++) {
        const struct slanted *w = &blend.weights[i];
        gradient = mat3_add_scaled(gradient, w->value / whole, contacts[i].delta_gradient);
        vec3 off = vec3_scale(1 / whole, vec3_sub(contacts[i].delta, W));
        surface_add_outer(&gradient, 1, off, w->gradient);
    }
    surface_add_outer(&gradient, -1 / whole, W, rest.gradient);
    out->displacement = W;
    out->gradient = gradient;
}
