#include "landmarks/landmarks.h"
#include "landmarks/local.h"
#include "mesh/solid.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// By the field's convention: a finger's breadth beside the patellar tendon, about 1 cm above the
// joint line.
static const double usual_beside = 20, usual_above = 8; // mm
static const double beside_from = 15, beside_to = 34, above_from = -4, above_to = 16, grid = 2;
static const double before_bones = 10;                // mm, of a portal where there is no skin
static const double enough = 2.5, away_price = 0.006; // mm of clearance; a mm² off the usual place
static const double room_worth = 0.02, most_room = 8; // of each mm round the place that it leads to
static const double shaft_step = 1;                   // mm between places that are looked at
static const double flexions[] = {20, 45, 70};        // in which instruments work

struct bones {
    const struct knee_case *knee;
    struct local local;
    struct solid solids[BODY_COUNT];
    struct query *skin;
};

static enum result bones_init(struct bones *b, struct knee_case *knee, struct error *err) {
    *b = (struct bones){.knee = knee, .local = local_of(knee)};
    enum result result = RESULT_OK;
    for (enum body body = 0; body < BODY_COUNT && result == RESULT_OK; body++) {
        const struct case_group *bone = case_group(knee, body_name(body));
        if (bone)
            result = solid_init(&b->solids[body], &bone->mesh, err);
    }
    const struct case_group *skin = case_skin(knee);
    if (result == RESULT_OK && skin)
        result = query_create(&skin->mesh, &b->skin, err);
    return result;
}

static void bones_fini(struct bones *b) {
    for (enum body body = 0; body < BODY_COUNT; body++)
        if (b->solids[body].mesh)
            solid_fini(&b->solids[body]);
    query_destroy(&b->skin);
}

static pose body_at(const struct bones *b, enum body body, double flexion_deg) {
    if (body == BODY_PATELLA)
        return case_patella_pose(b->knee, flexion_deg);
    struct joint_angles angles = case_rest(b->knee, flexion_deg);
    return body == BODY_TIBIA ? joint_to_pose(&b->knee->joint, &angles) : pose_identity();
}

// The least distance of the line from all bones, negative inside.
static double clearance(const struct bones *b, vec3 from, vec3 to, double flexion_deg) {
    double length = vec3_distance(from, to), least = INFINITY;
    for (enum body body = 0; body < BODY_COUNT; body++) {
        if (!b->solids[body].mesh)
            continue;
        pose T = body_at(b, body, flexion_deg);
        uint32_t hint = MESH_NONE;
        for (double at = 0; at <= length;) {
            vec3 p = pose_apply_inverse(T, vec3_lerp(from, to, at / length));
            double distance = solid_distance(&b->solids[body], p, &hint);
            least = fmin(least, distance);
            at += fmax(distance - least, shaft_step); // nothing between is nearer than that
        }
    }
    return least;
}

// How far anterior femur and tibia reach at about that place.
static double front_of(const struct bones *b, double x, double z) {
    double front = -INFINITY;
    for (enum body body = BODY_FEMUR; body <= BODY_TIBIA; body++) {
        const struct mesh *mesh = b->solids[body].mesh;
        for (uint32_t v = 0; mesh && v < mesh->vertex_count; v++) {
            vec3 p = to_local(&b->local, mesh_vertex(mesh, v));
            if (fabs(p.x - x) < 20 && fabs(p.z - z) < 30)
                front = fmax(front, p.y);
        }
    }
    return front;
}

// In the skin in front of a place, or where skin may be expected.
static vec3 outside(const struct bones *b, double front, double x, double z) {
    vec3 before = {x, front + before_bones, z};
    struct closest closest;
    if (!b->skin)
        return from_local(&b->local, before);
    before.y = front + 40;
    vec3 p = from_local(&b->local, before);
    return query_closest(b->skin, p, INFINITY, MESH_NONE, &closest) ? closest.point : p;
}

static double worst_clearance(const struct bones *b, vec3 from, vec3 to) {
    double least = INFINITY;
    for (size_t i = 0; i < sizeof flexions / sizeof *flexions; i++)
        least = fmin(least, clearance(b, from, to, flexions[i]));
    return least;
}

// Before the notch, where instruments turn: places between its roof and the plateau.
struct aims {
    vec3 notch;
    double middle_y, joint_line;
};

struct choice {
    double worth, clear;
    vec3 from, aim;
};

// Portals from which the aim is seen.
static void try_aim(const struct bones *b, double side, vec3 aim, double joint_line, double front,
                    struct choice *best) {
    vec3 to = from_local(&b->local, aim);
    double room = worst_clearance(b, to, vec3_add_scaled(to, 1e-3, (vec3){1, 0, 0}));
    double bonus = room_worth * fmin(room, most_room);
    for (double beside = beside_from; beside <= beside_to; beside += grid)
        for (double above = above_from; above <= above_to; above += grid) {
            double off = hypot(beside - usual_beside, above - usual_above);
            double price = away_price * off * off - bonus;
            if (enough - price <= best->worth)
                continue;
            vec3 from = outside(b, front, aim.x + side * beside, joint_line + above);
            double clear = worst_clearance(b, from, to), worth = fmin(clear, enough) - price;
            if (worth > best->worth)
                *best = (struct choice){worth, clear, from, to};
        }
}

static enum result find_portal(const struct bones *b, double side, const struct aims *aims,
                               struct case_portal *portal, double *out_clear_mm,
                               struct error *err) {
    struct choice best = {.worth = -INFINITY};
    double height = aims->notch.z - aims->joint_line;
    double front = front_of(b, aims->notch.x + side * usual_beside, aims->joint_line + usual_above);
    if (!isfinite(front)) {
        vec3 notch = case_landmark(b->knee, "notch")->at;
        return fail(err, RESULT_INVALID,
                    "%s: no bone is near: notch (%.1f %.1f %.1f mm) does not lie in the knee",
                    portal->name, notch.x, notch.y, notch.z);
    }
    for (double y = 3; y <= 21; y += 3)
        for (double share = 0.1; share < 0.8; share += 0.15) {
            vec3 aim = {aims->notch.x, aims->middle_y + y, aims->joint_line + share * height};
            try_aim(b, side, aim, aims->joint_line, front, &best);
        }
    portal->position = best.from;
    portal->direction = vec3_unit_or(vec3_sub(best.aim, best.from), (vec3){0, -1, 0});
    *out_clear_mm = best.clear;
    return RESULT_OK;
}

static enum result find_aims(const struct bones *b, struct aims *out, struct error *err) {
    static const char *const names[] = {"notch", "plateau_medial", "plateau_lateral"};
    vec3 at[3];
    for (int i = 0; i < 3; i++) {
        const struct case_landmark *landmark = case_landmark(b->knee, names[i]);
        if (!landmark)
            return fail(err, RESULT_MISSING,
                        "the landmark %s is not known: give it with arthron-case landmarks "
                        "--landmark",
                        names[i]);
        at[i] = to_local(&b->local, landmark->at);
    }
    *out = (struct aims){at[0], (at[1].y + at[2].y) / 2, (at[1].z + at[2].z) / 2};
    return RESULT_OK;
}

enum result landmarks_find_portals(struct knee_case *knee, double out_clear_mm[2],
                                   struct error *err) {
    static const char *const names[] = {"anterolateral", "anteromedial"};
    struct bones b;
    enum result result = bones_init(&b, knee, err);
    struct aims aims = {0};
    struct case_portal portals[2] = {0};
    if (result == RESULT_OK)
        result = find_aims(&b, &aims, err);
    for (int i = 0; i < 2 && result == RESULT_OK; i++) {
        snprintf(portals[i].name, sizeof portals[i].name, "%s", names[i]);
        result = find_portal(&b, i ? -1 : 1, &aims, &portals[i], &out_clear_mm[i], err);
    }
    if (result == RESULT_OK) {
        memcpy(knee->portals, portals, sizeof portals);
        knee->portal_count = 2;
    }
    bones_fini(&b);
    return result;
}
