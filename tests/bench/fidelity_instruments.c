// A straight instrument through a portal of the case, clear of everything in the room or with its
// tip on a surface: is what is shown of it in a virtual surface, or off it?
#include "base/check.h"
#include "fidelity.h"
#include "scene/probe.h"
#include "step/session.h"

#include <stdio.h>
#include <stdlib.h>

#define TRIES 16000
#define CLEAR_MM 0.02 // of its points in the room
#define DEPTH_MM 0.05 // more is a false touch
#define OFF_MM 3.0    // the tip, at most, where it does not touch
#define HOVERS_MM 0.1 // more is a touch that is not felt

// The surfaces where they are displaced to.
struct seen {
    struct mesh meshes[CASE_GROUPS_MAX];
    struct query *queries[CASE_GROUPS_MAX];
    struct warp_surface surfaces[CASE_GROUPS_MAX];
    struct warp_scene scene;
};

static enum result seen_init(struct seen *out, const struct anatomy *a, struct error *err) {
    enum result result = RESULT_OK;
    *out = (struct seen){.scene = a->scene};
    out->scene.surfaces = out->surfaces;
    for (int i = 0; result == RESULT_OK && i < a->knee->group_count; i++) {
        out->surfaces[i] = a->surfaces[i];
        if (!a->knee->groups[i].warp)
            continue;
        case_group_virtual(&a->knee->groups[i], &out->meshes[i]);
        result = query_create(&out->meshes[i], &out->queries[i], err);
        out->surfaces[i].mesh = &out->meshes[i];
        out->surfaces[i].query = out->queries[i];
    }
    return result;
}

static void seen_fini(struct seen *seen) {
    for (int i = 0; i < CASE_GROUPS_MAX; i++) {
        query_destroy(&seen->queries[i]);
        mesh_fini(&seen->meshes[i]);
    }
}

struct figures {
    struct samples depth, gap; // of the deepest point; of the tip where it touches in the room
    size_t poses, touching, falsely_in, falsely_off;
};

// Of the body's points.
static double least_gap(const struct warp_scene *scene, uint32_t hollow,
                        const struct instrument_body *body, pose T, int first) {
    double least = INFINITY;
    for (int i = first; i < body->point_count; i++)
        least = fmin(least, anatomy_gap(scene, hollow, pose_apply(T, body->points[i].at)));
    return least;
}

static void look_at_mode(const struct scene_of_lesion *scene, const struct seen *seen,
                         const struct avatar_body *body, const struct instrument_body *points,
                         vec3 portal, pose T, bool touches, struct figures *out) {
    const struct anatomy *a = scene->anatomy;
    struct field field = variant_field(VARIANT_INTEGRAL_SKIN);
    struct avatar_memory memory;
    struct avatar avatar;
    avatar_memory_init(&memory);
    avatar_warp(&a->scene, &field, body, portal, T, &memory, &avatar);
    double gap = least_gap(&seen->scene, a->hollow, points, avatar.T_world_warped, 0);
    double tip = anatomy_gap(&seen->scene, a->hollow, avatar.T_world_warped.translation);
    samples_add(&out->depth, fmax(0, -gap));
    out->poses++;
    out->falsely_in += -gap > DEPTH_MM;
    if (!touches)
        return;
    out->touching++;
    out->falsely_off += tip > HOVERS_MM;
    samples_add(&out->gap, tip);
}

static void report_figures(const struct scene_of_lesion *scene, enum avatar_mode mode,
                           struct figures *f) {
    char what[64];
    const char *name = avatar_mode_name(mode);
    enum variant v = VARIANT_INTEGRAL_SKIN;
    snprintf(what, sizeof what, "%s/false touch", name);
    fidelity_figure(scene, v, what, "share", (double)f->falsely_in / (double)f->poses);
    snprintf(what, sizeof what, "%s/touch not felt", name);
    fidelity_figure(scene, v, what, "share", (double)f->falsely_off / (double)f->touching);
    snprintf(what, sizeof what, "%s/penetration", name);
    fidelity_samples(scene, v, what, "mm", &f->depth);
    snprintf(what, sizeof what, "%s/gap of the tip", name);
    fidelity_samples(scene, v, what, "mm", &f->gap);
}

enum result fidelity_instruments(const struct scene_of_lesion *scene, struct error *err) {
    const struct anatomy *a = scene->anatomy;
    struct figures figures[AVATAR_MODE_COUNT] = {0};
    struct instrument_body points = session_settings_default().bodies[0];
    struct random r = {scene->seed};
    struct seen *seen = alloc(1, sizeof *seen);
    enum result result = seen_init(seen, a, err);
    int tries = scene->fidelity->quick ? TRIES / 20 : TRIES;
    for (int i = 0; result == RESULT_OK && i < tries && a->knee->portal_count; i++) {
        vec3 tip, normal;
        bool touches = i % 2;
        uint64_t which = random_bits(&r) % (uint64_t)a->knee->portal_count;
        vec3 portal = a->knee->portals[which].position;
        if (!fidelity_place(scene, &r, &tip, &normal))
            continue;
        tip = vec3_add_scaled(tip, touches ? 1e-6 : random_between(&r, CLEAR_MM, OFF_MM), normal);
        vec3 way = vec3_sub(tip, portal);
        pose T = probe_aim(portal, way, vec3_length(way));
        if (!anatomy_reaches(&a->scene, a->hollow, tip) ||
            least_gap(&a->scene, a->hollow, &points, T, touches ? 1 : 0) < CLEAR_MM)
            continue;
        for (int m = 0; m < AVATAR_MODE_COUNT; m++) {
            struct avatar_body body = {(enum avatar_mode)m, points.points, points.point_count};
            look_at_mode(scene, seen, &body, &points, portal, T, touches, &figures[m]);
        }
    }
    report_figure(scene->fidelity->report, (double)figures[0].poses, "poses", "%s/instrument poses",
                  scene->name);
    for (int m = 0; m < AVATAR_MODE_COUNT; m++) {
        if (figures[m].poses)
            report_figures(scene, (enum avatar_mode)m, &figures[m]);
        samples_fini(&figures[m].depth);
        samples_fini(&figures[m].gap);
    }
    seen_fini(seen);
    free(seen);
    return result;
}
