#include "warp/warp.h"

#include "base/check.h"

#include <float.h>
#include <string.h>

#define TOUCH_MM 1e-6

const char *field_name(enum field_kind kind) {
    static const char *const names[FIELD_COUNT] = {"gaussian", "inverse-distance"};
    return (unsigned)kind < FIELD_COUNT ? names[kind] : "unknown";
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
    return (struct field){.kind = kind, .unit_mm = 10, .radius_mm = 12, .background_per_mm = 0.05};
}

void warp_memory_init(struct warp_memory *memory) {
    for (int i = 0; i < WARP_SURFACES_MAX; i++)
        memory->triangle[i] = MESH_NONE;
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

static pose body_pose(const struct warp_scene *scene, int surface) {
    return scene->T_world_body[scene->surfaces[surface].body];
}

static pose corrected_pose(const struct warp_scene *scene, int surface) {
    pose B = body_pose(scene, surface);
    return scene->correction ? pose_compose(scene->correction[scene->surfaces[surface].body], B)
                             : B;
}

vec3 warp_of_contact(const struct warp_scene *scene, int surface, const struct closest *contact) {
    vec3 moved = displacement_at(&scene->surfaces[surface], contact);
    vec3 target = pose_apply(corrected_pose(scene, surface), vec3_add(contact->point, moved));
    return vec3_sub(target, pose_apply(body_pose(scene, surface), contact->point));
}

// Π: how the closest point moves with the query point; and the change of the displacement on it,
// both in the body's frame. On an edge the point only slides along it, in a corner it stays.
static void face_gradients(const struct warp_surface *surface, const struct closest *contact,
                           mat3 *out_slide, mat3 *out_change) {
    const uint32_t *v = surface->mesh->triangles + 3 * (size_t)contact->triangle;
    vec3 a = mesh_vertex(surface->mesh, v[0]);
    vec3 e1 = vec3_sub(mesh_vertex(surface->mesh, v[1]), a);
    vec3 e2 = vec3_sub(mesh_vertex(surface->mesh, v[2]), a);
    vec3 m = vec3_cross(e1, e2);
    double scale = 1 / vec3_dot(m, m);
    *out_slide = mat3_add_scaled(mat3_identity(), -scale, mat3_outer(m, m));
    if (!surface->displacement)
        return;
    vec3 d0 = displacement_of(surface, v[0]);
    vec3 g1 = vec3_scale(scale, vec3_cross(e2, m)), g2 = vec3_scale(scale, vec3_cross(m, e1));
    vec3 d1 = vec3_sub(displacement_of(surface, v[1]), d0);
    vec3 d2 = vec3_sub(displacement_of(surface, v[2]), d0);
    *out_change = mat3_add_scaled(mat3_outer(d1, g1), 1, mat3_outer(d2, g2));
}

static void edge_gradients(const struct warp_surface *surface, const struct closest *contact,
                           mat3 *out_slide, mat3 *out_change) {
    const uint32_t *v = surface->mesh->triangles + 3 * (size_t)contact->triangle;
    uint32_t from = v[contact->corner], to = v[(contact->corner + 1) % 3];
    vec3 e = vec3_sub(mesh_vertex(surface->mesh, to), mesh_vertex(surface->mesh, from));
    double scale = 1 / vec3_dot(e, e);
    mat3 zero = {0};
    *out_slide = mat3_add_scaled(zero, scale, mat3_outer(e, e));
    if (!surface->displacement)
        return;
    vec3 d = vec3_sub(displacement_of(surface, to), displacement_of(surface, from));
    *out_change = mat3_add_scaled(zero, scale, mat3_outer(d, e));
}

// G_k = [M_R R_B (Π + G_F) − R_B Π] R_Bᵀ
static void differentiate(const struct warp_scene *scene, int surface,
                          const struct closest *contact, struct warp_contact *out) {
    mat3 slide = {0}, change = {0};
    if (contact->feature == FEATURE_FACE)
        face_gradients(&scene->surfaces[surface], contact, &slide, &change);
    else if (contact->feature == FEATURE_EDGE)
        edge_gradients(&scene->surfaces[surface], contact, &slide, &change);
    mat3 R = quat_to_mat3(body_pose(scene, surface).rotation), back = mat3_transpose(R);
    mat3 MR = quat_to_mat3(corrected_pose(scene, surface).rotation);
    mat3 moved = mat3_multiply(MR, mat3_add_scaled(slide, 1, change));
    mat3 slid = mat3_multiply(R, slide);
    out->delta_gradient = mat3_multiply(mat3_add_scaled(moved, -1, slid), back);
    out->slide = mat3_multiply(slid, back);
}

// Across the face, of any length.
static vec3 face_across(const struct mesh *mesh, uint32_t triangle) {
    vec3 a = mesh_corner(mesh, triangle, 0);
    vec3 e1 = vec3_sub(mesh_corner(mesh, triangle, 1), a);
    vec3 e2 = vec3_sub(mesh_corner(mesh, triangle, 2), a);
    return vec3_cross(e1, e2);
}

static bool touch_surface(const struct warp_scene *scene, int index, vec3 y, double reach,
                          struct warp_memory *memory, struct warp_contact *out) {
    const struct warp_surface *surface = &scene->surfaces[index];
    pose B = body_pose(scene, index);
    vec3 p = pose_apply_inverse(B, y);
    struct closest closest;
    if (!query_closest(surface->query, p, reach, memory->triangle[index], &closest))
        return false;
    memory->triangle[index] = closest.triangle;
    vec3 away = closest.distance > TOUCH_MM ? vec3_sub(p, closest.point)
                                            : face_across(surface->mesh, closest.triangle);
    out->surface = index;
    out->distance = closest.distance;
    out->normal = quat_rotate(B.rotation, vec3_unit_or(away, (vec3){0, 0, 0}));
    out->delta = warp_of_contact(scene, index, &closest);
    differentiate(scene, index, &closest, out);
    return true;
}

// ---- weights ----

struct weight {
    double value;
    vec3 gradient;
};

// ω = 1/d − 1/R, which is (R − d)/(R d).
static struct weight inverse_distance(const struct field *field, const struct warp_contact *c) {
    return (struct weight){1 / c->distance - 1 / field->radius_mm,
                           vec3_scale(-1 / (c->distance * c->distance), c->normal)};
}

// Eq. 3 over the nearest surface's own weight, exp(−(d² − m²)/(2m)) with m = min d, which leaves
// Eq. 2 as it is and cannot underflow for the nearest.
static struct weight gaussian(const struct field *field, const struct warp_contact *c,
                              const struct warp_contact *nearest) {
    double unit = field->unit_mm, d = c->distance / unit, m = nearest->distance / unit;
    double value = exp(-(d * d - m * m) / (2 * m));
    vec3 slope = vec3_scale(d / m, c->normal);
    slope = vec3_add_scaled(slope, -(d * d / (2 * m * m) + 0.5), nearest->normal);
    return (struct weight){value, vec3_scale(-value / unit, slope)};
}

static struct weight weigh(const struct field *field, const struct warp_contact *c,
                           const struct warp_contact *nearest) {
    return field->kind == FIELD_GAUSSIAN ? gaussian(field, c, nearest) : inverse_distance(field, c);
}

// ---- the blend ----

// W = Σ ω Δ / S; ∇W = (1/S) Σ (ω G + (Δ − W) ∇ωᵀ)
static void blend(const struct field *field, const struct warp_contact *contacts, int count,
                  const struct warp_contact *nearest, struct warp *out) {
    struct weight weights[WARP_SURFACES_MAX];
    double sum = field->kind == FIELD_INVERSE_DISTANCE ? field->background_per_mm : 0;
    vec3 W = {0};
    for (int i = 0; i < count; i++) {
        weights[i] = weigh(field, &contacts[i], nearest);
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

// On surfaces: exactly theirs, the mean where several touch.
static bool take_touching(const struct warp_contact *contacts, int count, struct warp *out) {
    vec3 sum = {0};
    mat3 gradients = {0};
    int touching = 0;
    for (int i = 0; i < count; i++) {
        if (contacts[i].distance > TOUCH_MM)
            continue;
        sum = vec3_add(sum, contacts[i].delta);
        gradients = mat3_add_scaled(gradients, 1, contacts[i].delta_gradient);
        touching++;
    }
    if (!touching)
        return false;
    mat3 zero = {0};
    out->displacement = vec3_scale(1.0 / touching, sum);
    out->gradient = mat3_add_scaled(zero, 1.0 / touching, gradients);
    return true;
}

static double trust_radius(double nearest, double second) {
    double sum = nearest + second;
    return sum < 0.5 ? 0.5 : sum > 2 ? 2 : sum;
}

int warp_contacts(const struct warp_scene *scene, const struct field *field, vec3 y,
                  struct warp_memory *memory, struct warp *out,
                  struct warp_contact contacts[WARP_SURFACES_MAX]) {
    CHECK(scene->surface_count <= WARP_SURFACES_MAX);
    // A distance that overflows has no weight and no order: out of reach.
    double reach = field->kind == FIELD_INVERSE_DISTANCE ? field->radius_mm : DBL_MAX;
    const struct warp_contact *nearest = NULL;
    double second = INFINITY;
    int count = 0;
    *out = (struct warp){.nearest = -1, .nearest_mm = INFINITY};
    for (int i = 0; i < scene->surface_count; i++) {
        struct warp_contact *c = &contacts[count];
        if (!touch_surface(scene, i, y, reach, memory, c))
            continue;
        count++;
        if (c->distance < out->nearest_mm) {
            second = out->nearest_mm;
            out->nearest_mm = c->distance;
            out->nearest = i;
            nearest = c;
        } else if (c->distance < second) {
            second = c->distance;
        }
    }
    out->trust_radius_mm = trust_radius(out->nearest_mm, second);
    if (count && !take_touching(contacts, count, out))
        blend(field, contacts, count, nearest, out);
    return count;
}

void warp_point(const struct warp_scene *scene, const struct field *field, vec3 y,
                struct warp_memory *memory, struct warp *out) {
    struct warp_contact contacts[WARP_SURFACES_MAX];
    warp_contacts(scene, field, y, memory, out, contacts);
}
