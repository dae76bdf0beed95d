#include "warp/warp.h"

#include "base/check.h"
#include "warp/warp_parts.h"

#include <float.h>
#include <string.h>

#define GAP_OVER_SKIN 26

const char *field_name(enum field_kind kind) {
    static const char *const names[] = {"gaussian", "inverse-distance", "smooth", "integral"};
    return (unsigned)kind < sizeof names / sizeof names[0] ? names[kind] : "unknown";
}

bool field_from_name(const char *name, enum field_kind *out_kind) {
    for (int i = 0; i < FIELD_COUNT; i++)
        if (!strcmp(name, field_name((enum field_kind)i))) {
            *out_kind = (enum field_kind)i;
            return true;
        }
    return false;
}

struct field field_default(enum field_kind kind) {
    return (struct field){
        .kind = kind, .unit_mm = 10, .radius_mm = 15, .background_per_mm = 1.0 / 15, .strength = 1};
}

double field_reach(const struct warp_scene *scene, const struct field *field, struct box box) {
    double reach = field->radius_mm;
    if (field->kind != FIELD_INTEGRAL)
        return reach + 1.5 * field->skin_mm;
    for (int i = 0; i < 8; i++) // m² is convex: the largest is in a corner
        for (int k = 0; k < scene->surface_count; k++) {
            vec3 corner = {i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y,
                           i & 4 ? box.max.z : box.min.z};
            reach = fmax(reach, integral_reach(scene, field, scene->surfaces[k].body, corner));
        }
    return reach;
}

bool field_takes(const struct field *field, const struct warp_surface *surface) {
    return field->kind != FIELD_INTEGRAL || !surface->gives_way;
}

void warp_memory_init(struct warp_memory *memory) {
    for (int i = 0; i < WARP_SURFACES_MAX; i++) {
        memory->triangle[i] = MESH_NONE;
        memory->near[i].query = 0;
        memory->near[i].clear = 0;
    }
}

// ---- one surface ----

static vec3 displacement_of(const struct warp_surface *surface, uint32_t vertex) {
    const float *d = surface->displacement + 3 * (size_t)vertex;
    return (vec3){(double)d[0], (double)d[1], (double)d[2]};
}

static vec3 displacement_at(const struct warp_surface *surface, const struct closest *contact) {
    vec3 sum = {0};
    if (!surface->displacement)
        return sum;
    const uint32_t *vertices = surface->mesh->triangles + 3 * (size_t)contact->triangle;
    for (int i = 0; i < 3; i++)
        sum = vec3_add_scaled(sum, contact->weights[i], displacement_of(surface, vertices[i]));
    return sum;
}

bool is_corrected(const struct warp_scene *scene, int body) {
    const pose none = pose_identity();
    return scene->correction && memcmp(&scene->correction[body], &none, sizeof none) != 0;
}

static pose corrected(const struct warp_scene *scene, int body, pose B) {
    return is_corrected(scene, body) ? pose_compose(scene->correction[body], B) : B;
}

struct stance stance_of(const struct warp_scene *scene, int surface) {
    const struct warp_surface *s = &scene->surfaces[surface];
    pose B = scene->T_world_body[s->body], virtual = corrected(scene, s->body, B);
    return (struct stance){B, virtual,
                           s->other_share ? corrected(scene, s->other_body, B) : virtual,
                           is_corrected(scene, s->body), s->other_share != NULL};
}

vec3 delta_of(const struct stance *stance, double other, vec3 x, vec3 u) {
    vec3 at = vec3_add(x, u), target = pose_apply(stance->virtual, at);
    if (other > 0)
        target = vec3_add_scaled(target, other, vec3_sub(pose_apply(stance->other, at), target));
    return vec3_sub(target, pose_apply(stance->physical, x));
}

// G_k = [M_R R_B (∂x + ∂u) − R_B ∂x + (M_other − M_body) B x' ∂share] R_Bᵀ
mat3 delta_gradient_of(const struct stance *stance, double other, vec3 target,
                       const struct changes *changes) {
    mat3 R = quat_to_mat3(stance->physical.rotation), MR = R;
    if (stance->is_corrected)
        MR = quat_to_mat3(stance->virtual.rotation);
    if (stance->is_bridge)
        MR = mat3_add_scaled(MR, other,
                             mat3_add_scaled(quat_to_mat3(stance->other.rotation), -1, MR));
    mat3 moved = mat3_multiply(MR, mat3_add_scaled(changes->slide, 1, changes->change));
    moved = mat3_add_scaled(moved, -1, mat3_multiply(R, changes->slide));
    if (stance->is_bridge) {
        vec3 there = pose_apply(stance->other, target);
        vec3 spread = vec3_sub(there, pose_apply(stance->virtual, target));
        moved = mat3_add_scaled(moved, 1, mat3_outer(spread, changes->other));
    }
    return mat3_multiply(moved, mat3_transpose(R));
}

// ---- its closest point ----

static double other_at(const struct warp_surface *surface, const struct closest *contact) {
    if (!surface->other_share)
        return 0;
    const uint32_t *vertices = surface->mesh->triangles + 3 * (size_t)contact->triangle;
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += contact->weights[i] * (double)surface->other_share[vertices[i]];
    return sum;
}

vec3 warp_of_contact(const struct warp_scene *scene, int surface, const struct closest *contact) {
    const struct warp_surface *s = &scene->surfaces[surface];
    struct stance stance = stance_of(scene, surface);
    return delta_of(&stance, other_at(s, contact), contact->point, displacement_at(s, contact));
}

// Π: how the closest point moves with the query point; and the change of the displacement on it,
// both in the body's frame. On an edge the point only slides along it, in a corner it stays.
static void face_gradients(const struct warp_surface *surface, const struct closest *contact,
                           struct changes *out) {
    const uint32_t *v = surface->mesh->triangles + 3 * (size_t)contact->triangle;
    vec3 a = mesh_vertex(surface->mesh, v[0]);
    vec3 e1 = vec3_sub(mesh_vertex(surface->mesh, v[1]), a);
    vec3 e2 = vec3_sub(mesh_vertex(surface->mesh, v[2]), a);
    vec3 m = vec3_cross(e1, e2);
    double scale = 1 / vec3_dot(m, m);
    out->slide = mat3_add_scaled(mat3_identity(), -scale, mat3_outer(m, m));
    vec3 g1 = vec3_scale(scale, vec3_cross(e2, m)), g2 = vec3_scale(scale, vec3_cross(m, e1));
    if (surface->displacement) {
        vec3 d0 = displacement_of(surface, v[0]);
        vec3 d1 = vec3_sub(displacement_of(surface, v[1]), d0);
        vec3 d2 = vec3_sub(displacement_of(surface, v[2]), d0);
        out->change = mat3_add_scaled(mat3_outer(d1, g1), 1, mat3_outer(d2, g2));
    }
    if (surface->other_share) {
        const float *share = surface->other_share;
        double s0 = (double)share[v[0]];
        out->other =
            vec3_add_scaled(vec3_scale((double)share[v[1]] - s0, g1), (double)share[v[2]] - s0, g2);
    }
}

static void edge_gradients(const struct warp_surface *surface, const struct closest *contact,
                           struct changes *out) {
    const uint32_t *v = surface->mesh->triangles + 3 * (size_t)contact->triangle;
    uint32_t from = v[contact->corner], to = v[(contact->corner + 1) % 3];
    vec3 e = vec3_sub(mesh_vertex(surface->mesh, to), mesh_vertex(surface->mesh, from));
    double scale = 1 / vec3_dot(e, e);
    mat3 zero = {0};
    out->slide = mat3_add_scaled(zero, scale, mat3_outer(e, e));
    if (surface->displacement) {
        vec3 d = vec3_sub(displacement_of(surface, to), displacement_of(surface, from));
        out->change = mat3_add_scaled(zero, scale, mat3_outer(d, e));
    }
    if (surface->other_share) {
        double rise = (double)surface->other_share[to] - (double)surface->other_share[from];
        out->other = vec3_scale(scale * rise, e);
    }
}

static struct changes changes_of(const struct warp_surface *surface,
                                 const struct closest *contact) {
    struct changes changes = {0};
    if (contact->feature == FEATURE_FACE)
        face_gradients(surface, contact, &changes);
    else if (contact->feature == FEATURE_EDGE)
        edge_gradients(surface, contact, &changes);
    return changes;
}

static void take_delta(const struct warp_surface *surface, const struct stance *stance,
                       const struct closest *contact, const struct changes *changes,
                       struct warp_contact *out) {
    double other = other_at(surface, contact);
    vec3 u = displacement_at(surface, contact);
    out->delta = delta_of(stance, other, contact->point, u);
    out->delta_gradient = delta_gradient_of(stance, other, vec3_add(contact->point, u), changes);
}

// Across the face, of any length.
static vec3 face_across(const struct mesh *mesh, uint32_t triangle) {
    vec3 a = mesh_corner(mesh, triangle, 0);
    vec3 e1 = vec3_sub(mesh_corner(mesh, triangle, 1), a);
    vec3 e2 = vec3_sub(mesh_corner(mesh, triangle, 2), a);
    return vec3_cross(e1, e2);
}

// ---- its mean point ----

double smoothstep(double d, double begin, double width, double *out_slope) {
    double t = (d - begin) / width;
    t = t < 0 ? 0 : t < 1 ? t : 1;
    *out_slope = 6 * t * (1 - t) / width;
    return t * t * (3 - 2 * t);
}

// From what the closest point tells to what the mean does.
static void hand_over(const struct warp_surface *surface, const struct stance *stance,
                      const struct field *field, vec3 p, struct warp_contact *c) {
    double slope, begin = fmax(field->radius_mm / 240, field->skin_mm);
    double share = smoothstep(c->distance, fmax(begin, SURFACE_MEAN_NEAREST_MM),
                              field->radius_mm / 120, &slope);
    struct surface_value mean;
    if (!(share > 0) || !surface_mean_at(surface->mean, p, c->distance, &mean))
        return;
    struct changes changes = {.slide = mean.slide, .change = mean.change};
    vec3 target = vec3_add(mean.point, mean.displacement);
    vec3 off = vec3_sub(delta_of(stance, 0, mean.point, mean.displacement), c->delta);
    mat3 gradient = delta_gradient_of(stance, 0, target, &changes), zero = {0};
    gradient =
        mat3_add_scaled(mat3_add_scaled(zero, share, gradient), 1 - share, c->delta_gradient);
    c->delta = vec3_add_scaled(c->delta, share, off);
    c->delta_gradient = mat3_add_scaled(gradient, slope, mat3_outer(off, c->normal));
}

static bool touch_surface(const struct warp_scene *scene, const struct field *field, int index,
                          vec3 y, struct warp_memory *memory, struct warp_contact *out) {
    // A distance that overflows has no weight and no order: out of reach.
    const struct warp_surface *surface = &scene->surfaces[index];
    double reach = field->kind == FIELD_GAUSSIAN   ? DBL_MAX
                   : field->kind == FIELD_INTEGRAL ? integral_reach(scene, field, surface->body, y)
                                                   : field->radius_mm + 1.5 * field->skin_mm;
    if (!field_takes(field, surface))
        return false;
    vec3 p = pose_apply_inverse(scene->T_world_body[surface->body], y);
    struct closest closest;
    if (!query_closest_near(surface->query, p, reach, memory->triangle[index], &memory->near[index],
                            &closest))
        return false;
    memory->triangle[index] = closest.triangle;
    struct stance stance = stance_of(scene, index);
    vec3 away = closest.distance > TOUCH_MM ? vec3_sub(p, closest.point)
                                            : face_across(surface->mesh, closest.triangle);
    out->surface = index;
    out->distance = closest.distance;
    out->normal = quat_rotate(stance.physical.rotation, vec3_unit_or(away, (vec3){0, 0, 0}));
    struct changes changes = changes_of(surface, &closest);
    mat3 R = quat_to_mat3(stance.physical.rotation), zero = {0};
    out->slide = mat3_multiply(mat3_multiply(R, changes.slide), mat3_transpose(R));
    if (field->kind != FIELD_INTEGRAL || !integral_look(surface, &stance, p, closest.point, out))
        take_delta(surface, &stance, &closest, &changes, out);
    if (field->kind == FIELD_SMOOTH && surface->mean)
        hand_over(surface, &stance, field, p, out);
    out->delta = vec3_scale(field->strength, out->delta);
    out->delta_gradient = mat3_add_scaled(zero, field->strength, out->delta_gradient);
    return true;
}

// ---- distances ----

double skin_in(double s, double gap, double gap_over_skin, double *out_by_gap) {
    double u = fmin(gap / (gap_over_skin * s), 2);
    *out_by_gap = (1 - 0.5 * u) / gap_over_skin;
    return s * (u - 0.25 * u * u);
}

double thin(double d, double s, double *out_by_d, double *out_by_s) {
    double t = s > 0 ? fmax(d / s - 1, 0) : 1;
    *out_by_d = t < 1 ? t : 1;
    *out_by_s = t < 1 ? -t - 0.5 * t * t : -1.5;
    return t < 1 ? 0.5 * s * t * t : d - 1.5 * s;
}

static void measure(const struct field *field, const struct warp_contact *contacts, int count,
                    const struct warp_contact *const nearest[2], struct slanted *out) {
    double by_gap = 0, s = field->kind == FIELD_GAUSSIAN ? 0 : field->skin_mm;
    vec3 gap = {0};
    if (s > 0 && nearest[1]) {
        s = skin_in(s, nearest[0]->distance + nearest[1]->distance, GAP_OVER_SKIN, &by_gap);
        gap = vec3_add(nearest[0]->normal, nearest[1]->normal);
    }
    for (int i = 0; i < count; i++) {
        double by_d, by_s;
        out[i].value = thin(contacts[i].distance, s, &by_d, &by_s);
        out[i].gradient = vec3_add_scaled(vec3_scale(by_d, contacts[i].normal), by_s * by_gap, gap);
    }
}

// ---- weights ----

// ω = 1/d − 1/R, which is (R − d)/(R d); 0 where only the skin brings a surface within reach.
static struct slanted inverse_distance(const struct field *field, const struct slanted *d) {
    if (d->value >= field->radius_mm)
        return (struct slanted){0};
    return (struct slanted){1 / d->value - 1 / field->radius_mm,
                            vec3_scale(-1 / (d->value * d->value), d->gradient)};
}

// Eq. 3 over the nearest surface's own weight, exp(−(d² − m²)/(2m)) with m = min d, which leaves
// Eq. 2 as it is and cannot underflow for the nearest.
static struct slanted gaussian(const struct field *field, const struct slanted *at,
                               const struct slanted *nearest) {
    double unit = field->unit_mm, d = at->value / unit, m = nearest->value / unit;
    double value = exp(-(d * d - m * m) / (2 * m));
    vec3 slope = vec3_scale(d / m, at->gradient);
    slope = vec3_add_scaled(slope, -(d * d / (2 * m * m) + 0.5), nearest->gradient);
    return (struct slanted){value, vec3_scale(-value / unit, slope)};
}

static struct slanted weigh(const struct field *field, const struct slanted *d,
                            const struct slanted *nearest) {
    return field->kind == FIELD_GAUSSIAN ? gaussian(field, d, nearest) : inverse_distance(field, d);
}

static double background(const struct field *field) {
    return field->kind == FIELD_GAUSSIAN ? 0 : field->background_per_mm;
}

// ---- the blend ----

// W = Σ ω Δ / S; ∇W = (1/S) Σ (ω G + (Δ − W) ∇ωᵀ)
static void blend(const struct field *field, const struct warp_contact *contacts, int count,
                  const struct slanted *distances, const struct slanted *nearest,
                  struct warp *out) {
    struct slanted weights[WARP_SURFACES_MAX];
    double sum = background(field);
    vec3 W = {0};
    for (int i = 0; i < count; i++) {
        weights[i] = weigh(field, &distances[i], nearest);
        sum += weights[i].value;
        W = vec3_add_scaled(W, weights[i].value, contacts[i].delta);
    }
    if (!(sum > 0))
        return;
    W = vec3_scale(1 / sum, W);
    mat3 gradient = {0};
    for (int i = 0; i < count; i++) {
        gradient = mat3_add_scaled(gradient, weights[i].value / sum, contacts[i].delta_gradient);
        vec3 off = vec3_scale(1 / sum, vec3_sub(contacts[i].delta, W));
        gradient = mat3_add_scaled(gradient, 1, mat3_outer(off, weights[i].gradient));
    }
    out->displacement = W;
    out->gradient = gradient;
}

// Off a surface, W − Δ = φ (Σ ω_k (Δ_k − Δ) − ω_0 Δ) to first order in its φ, summed over the
// others.
static mat3 rise_off(const struct field *field, const struct warp_contact *contacts, int count,
                     const struct slanted *distances, int touched) {
    vec3 delta = contacts[touched].delta, rise = vec3_scale(-background(field), delta);
    for (int i = 0; i < count; i++) {
        if (i == touched)
            continue;
        double weight = weigh(field, &distances[i], &distances[touched]).value;
        rise = vec3_add_scaled(rise, weight, vec3_sub(contacts[i].delta, delta));
    }
    return mat3_outer(rise, distances[touched].gradient);
}

// On surfaces: exactly theirs, the mean where several touch.
static bool take_touching(const struct field *field, const struct warp_contact *contacts, int count,
                          const struct slanted *distances, struct warp *out) {
    vec3 sum = {0};
    mat3 gradients = {0}, zero = {0};
    int touching = 0, touched = 0;
    for (int i = 0; i < count; i++) {
        if (distances[i].value > TOUCH_MM)
            continue;
        sum = vec3_add(sum, contacts[i].delta);
        gradients = mat3_add_scaled(gradients, 1, contacts[i].delta_gradient);
        touching++;
        touched = i;
    }
    if (!touching)
        return false;
    if (touching == 1 && field->kind != FIELD_GAUSSIAN)
        gradients =
            mat3_add_scaled(gradients, 1, rise_off(field, contacts, count, distances, touched));
    out->displacement = vec3_scale(1.0 / touching, sum);
    out->gradient = mat3_add_scaled(zero, 1.0 / touching, gradients);
    return true;
}

static double trust_radius(double nearest, double second) {
    double sum = nearest + second;
    return sum < 0.5 ? 0.5 : sum > 2 ? 2 : sum;
}

// The two nearest, the nearest first; NULL where there are fewer.
static void find_nearest(const struct warp_contact *contacts, int count,
                         const struct warp_contact *out[2]) {
    out[0] = out[1] = NULL;
    for (int i = 0; i < count; i++) {
        const struct warp_contact *c = &contacts[i];
        if (!out[0] || c->distance < out[0]->distance) {
            out[1] = out[0];
            out[0] = c;
        } else if (!out[1] || c->distance < out[1]->distance) {
            out[1] = c;
        }
    }
}

int warp_contacts(const struct warp_scene *scene, const struct field *field, vec3 y,
                  struct warp_memory *memory, struct warp *out,
                  struct warp_contact contacts[WARP_SURFACES_MAX]) {
    CHECK(scene->surface_count <= WARP_SURFACES_MAX);
    int count = 0;
    for (int i = 0; i < scene->surface_count; i++)
        count += touch_surface(scene, field, i, y, memory, &contacts[count]);
    *out = (struct warp){.trust_radius_mm = 2, .nearest = -1, .nearest_mm = INFINITY};
    if (!count)
        return 0;
    const struct warp_contact *nearest[2];
    struct slanted distances[WARP_SURFACES_MAX];
    find_nearest(contacts, count, nearest);
    out->nearest = nearest[0]->surface;
    out->nearest_mm = nearest[0]->distance;
    out->trust_radius_mm =
        trust_radius(out->nearest_mm, nearest[1] ? nearest[1]->distance : INFINITY);
    if (field->kind == FIELD_INTEGRAL) {
        integral_blend(scene, field, y, contacts, count, out);
        return count;
    }
    measure(field, contacts, count, nearest, distances);
    if (!take_touching(field, contacts, count, distances, out))
        blend(field, contacts, count, distances, &distances[nearest[0] - contacts], out);
    return count;
}

void warp_point(const struct warp_scene *scene, const struct field *field, vec3 y,
                struct warp_memory *memory, struct warp *out) {
    struct warp_contact contacts[WARP_SURFACES_MAX];
    warp_contacts(scene, field, y, memory, out, contacts);
}
