// Thin tissue: the two sides of it do not pass through one another.
#include "match/conform_parts.h"
#include "match/room.h"

#include <math.h>

#define THIN_MM 0.25
#define PUSH_MM 0.05 // thinner than this it is pushed apart
#define STIFF_MM 0.1
#define LEAST_MM 0.01
#define AGAINST 0.3
#define STEP_MM 1.0
#define SHARE 0.7 // of the thickness that one step may take

static bool shares_corner(const uint32_t *a, int count, const uint32_t *b) {
    for (int i = 0; i < count; i++)
        if (a[i] == b[0] || a[i] == b[1] || a[i] == b[2])
            return true;
    return false;
}

// What is repaired has no thickness yet.
static bool trusts(const struct conform *c, const uint32_t *corners, int count) {
    for (int i = 0; i < count; i++)
        if (c->trust[corners[i]] < 1)
            return false;
    return true;
}

// corners: of a triangle, or of one vertex.
static void touch(struct conform *c, const uint32_t *corners, int count, vec3 normal, double area) {
    vec3 p = {0};
    for (int i = 0; i < count; i++)
        p = vec3_add_scaled(p, 1.0 / count, c->positions[corners[i]]);
    struct soup_search search = {p, vec3_scale(-1, normal), AGAINST, THIN_MM, MESH_NONE};
    struct soup_closest closest;
    if (!soup_closest(&c->self, &search, &closest))
        return;
    const uint32_t *across = c->surface->triangles + 3 * (size_t)c->self.at[closest.index].id;
    double thickness = vec3_dot(normal, vec3_sub(p, closest.point));
    bool repaired = !trusts(c, corners, count) || !trusts(c, across, 3);
    if (repaired || shares_corner(corners, count, across) || thickness < 0)
        return;
    struct contact contact = {.normal = normal, .thickness = higher(thickness, LEAST_MM)};
    for (int i = 0; i < 6; i++)
        contact.slots[i] = MESH_NONE;
    for (int i = 0; i < count; i++) {
        contact.slots[i] = c->slot[corners[i]];
        contact.shares[i] = 1.0 / count;
    }
    for (int i = 0; i < 3; i++) {
        contact.slots[3 + i] = c->slot[across[i]];
        contact.shares[3 + i] = -closest.weights[i];
    }
    double stiff = STIFF_MM / contact.thickness;
    contact.weight = area * stiff * stiff;
    contact.push = higher(0, PUSH_MM - contact.thickness);
    room_for(&c->contacts, &c->contact_room, c->contact_count + 1);
    c->contacts[c->contact_count++] = contact;
}

void conform_find_contacts(struct conform *c) {
    c->contact_count = 0;
    for (uint32_t i = 0; i < c->live_count; i++) {
        const uint32_t *v = c->surface->triangles + 3 * (size_t)c->live[i];
        vec3 corners[3];
        conform_corners(c, c->live[i], corners);
        vec3 area2 = soup_area2(corners);
        touch(c, v, 3, vec3_unit_or(area2, (vec3){0}), 0.25 * vec3_length(area2));
    }
    for (uint32_t i = 0; i < c->active_count; i++) {
        uint32_t v = c->active[i];
        double area2 = 0;
        for (uint32_t k = c->surface->first[v]; k < c->surface->first[v + 1]; k++) {
            const struct opposite *side = &c->surface->opposites[k];
            vec3 corners[3] = {c->positions[v], c->positions[side->from], c->positions[side->to]};
            area2 += vec3_length(soup_area2(corners));
        }
        touch(c, &v, 1, c->normals[v], area2 / 12);
    }
}

// How far the sides of a contact come together.
static double closing(const struct contact *contact, const vec3 *step) {
    double sum = 0;
    for (int i = 0; i < 6; i++)
        if (contact->slots[i] != MESH_NONE)
            sum -= contact->shares[i] * vec3_dot(contact->normal, step[contact->slots[i]]);
    return sum;
}

void conform_limit(struct conform *c, vec3 *step) {
    for (uint32_t i = 0; i < c->active_count; i++) {
        double length = vec3_length(step[i]);
        if (length > STEP_MM)
            step[i] = vec3_scale(STEP_MM / length, step[i]);
        c->reach[i] = 1;
    }
    for (uint32_t k = 0; k < c->contact_count; k++) {
        const struct contact *contact = &c->contacts[k];
        double by = closing(contact, step), most = SHARE * contact->thickness;
        for (int i = 0; by > most && i < 6; i++)
            if (contact->slots[i] != MESH_NONE)
                c->reach[contact->slots[i]] = lower(c->reach[contact->slots[i]], most / by);
    }
    for (uint32_t i = 0; i < c->active_count; i++)
        step[i] = vec3_scale(c->reach[i], step[i]);
}
