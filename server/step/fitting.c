#include "step/fitting.h"

#include "base/check.h"
#include "step/apart.h"
#include "step/settings.h"
#include "step/touch.h"

#include <stdlib.h>
#include <string.h>

#define PROBES_MAX 32 // points of new surface whose distance to S'' is measured

struct fitting {
    int rules;
    struct conform *conform;
    vec3 *start;         // S'
    struct mesh touched; // S'' as it was last reported
    struct conform_past *past;
    uint32_t count, room;
};

struct fitting *fitting_create(const struct match_surface *surface, const struct mesh *mesh,
                               int rules) {
    struct fitting *f = alloc(1, sizeof *f);
    f->rules = rules;
    f->conform = conform_create(surface);
    f->start = alloc(mesh->vertex_count, sizeof *f->start);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        f->start[v] = conform_vertex(f->conform, v);
    mesh_copy(&f->touched, mesh);
    return f;
}

void fitting_destroy(struct fitting **fitting) {
    struct fitting *f = *fitting;
    if (!f)
        return;
    for (uint32_t i = 0; i < f->count; i++)
        conform_past_fini(&f->past[i]);
    conform_destroy(&f->conform);
    mesh_fini(&f->touched);
    free(f->past);
    free(f->start);
    free(f);
    *fitting = NULL;
}

void fitting_keep(struct fitting *f, struct kept *k) {
    uint32_t count = f->count;
    conform_keep(f->conform, k);
    kept_count(k, &count, UINT32_MAX / 2);
    kept_holds(k, count <= kept_left(k));
    if (k->reads) {
        f->room = k->bad ? 0 : count;
        f->past = alloc(f->room, sizeof *f->past);
    }
    for (uint32_t i = 0; i < count && !k->bad; i++) {
        conform_past_keep(f->conform, &f->past[i], k);
        f->count = i + 1;
    }
}

vec3 fitting_vertex(const struct fitting *fitting, uint32_t vertex) {
    return conform_vertex(fitting->conform, vertex);
}

static vec3 offset(vec3 place, vec3 start) {
    vec3 by = vec3_sub(place, start);
    return (vec3){touch_rounded(by.x), touch_rounded(by.y), touch_rounded(by.z)};
}

const struct mesh *fitting_touched(const struct fitting *fitting) {
    return &fitting->touched;
}

vec3 fitting_offset(const struct fitting *fitting, uint32_t vertex) {
    return offset(conform_vertex(fitting->conform, vertex), fitting->start[vertex]);
}

void fitting_offsets(const struct fitting *f, double *out) {
    const vec3 *places = conform_vertices(f->conform);
    for (uint32_t v = 0; v < f->touched.vertex_count; v++) {
        vec3 by = offset(places[v], f->start[v]);
        memcpy(out + 3 * (size_t)v, &by, sizeof by);
    }
}

void fitting_place(struct fitting *fitting, uint32_t vertex, vec3 offset) {
    conform_place(fitting->conform, vertex, vec3_add(fitting->start[vertex], offset));
}

// ---- following ----------------------------------------------------------------------------------

static double distance_of(const struct fitting *f, const struct conform_target *target) {
    vec3 probes[PROBES_MAX + 1];
    uint32_t fresh = 0, seen = 0, count = 0;
    for (uint32_t t = 0; t < target->mesh->triangle_count; t++)
        fresh += target->fresh[t];
    uint32_t stride = 1 + fresh / PROBES_MAX;
    for (uint32_t t = 0; t < target->mesh->triangle_count; t++)
        if (target->fresh[t] && seen++ % stride == 0)
            probes[count++] = mesh_corner(target->mesh, t, 0);
    return apart_mm(&f->touched, probes, count);
}

// What the touch is fitted to. The caller releases it.
struct goal {
    struct mesh mesh;
    bool *fresh;
    struct conform_target target;
};

static void begin_goal(const struct fitting *f, const struct cut_mesh *target, uint32_t since,
                       struct goal *out) {
    uint32_t *ids;
    cut_mesh_flatten(target, &out->mesh, NULL, &ids);
    out->fresh = alloc(out->mesh.triangle_count, sizeof *out->fresh);
    for (uint32_t t = 0; t < out->mesh.triangle_count; t++)
        out->fresh[t] = cut_mesh_label(target, ids[t]) > since;
    out->target = (struct conform_target){.mesh = &out->mesh,
                                          .fresh = out->fresh,
                                          .volume_mm3 = cut_mesh_volume(target),
                                          .lays = f->rules >= RULES_TOUCH_LAID,
                                          .quickly = f->rules >= RULES_FITTED_QUICKLY};
    free(ids);
}

static void end_goal(struct goal *goal) {
    free(goal->fresh);
    mesh_fini(&goal->mesh);
}

static struct fitting_report report_of(struct fitting *f, const struct goal *goal) {
    double volume = conform_volume(f->conform);
    const vec3 *places = conform_vertices(f->conform);
    for (uint32_t v = 0; v < f->touched.vertex_count; v++)
        mesh_set_vertex(&f->touched, v, places[v]);
    return (struct fitting_report){volume, volume - goal->target.volume_mm3,
                                   distance_of(f, &goal->target)};
}

void fitting_follow(struct fitting *f, const struct cut_mesh *target, uint32_t since,
                    struct fitting_report *out_report) {
    struct goal goal;
    struct conform_report report;
    begin_goal(f, target, since, &goal);
    conform_to(f->conform, &goal.target, &report);
    for (uint32_t i = 0; i < report.changed_count; i++)
        fitting_place(f, report.changed[i], fitting_offset(f, report.changed[i]));
    if (f->count == f->room) {
        f->room = 2 * f->room + 64;
        f->past = alloc_resize(f->past, f->room, sizeof *f->past);
    }
    conform_past(f->conform, &f->past[f->count++]);
    *out_report = report_of(f, &goal);
    end_goal(&goal);
}

void fitting_follow_as_placed(struct fitting *f, const struct cut_mesh *target, uint32_t since,
                              struct fitting_report *out_report) {
    struct goal goal;
    CHECK(f->count > 0);
    conform_past_fini(&f->past[f->count - 1]);
    conform_past(f->conform, &f->past[f->count - 1]);
    begin_goal(f, target, since, &goal);
    *out_report = report_of(f, &goal);
    end_goal(&goal);
}

uint32_t fitting_count(const struct fitting *fitting) {
    return fitting->count;
}

void fitting_go_back(struct fitting *fitting, uint32_t count) {
    CHECK(count <= fitting->count);
    while (fitting->count > count) {
        conform_take_back(fitting->conform, &fitting->past[--fitting->count]);
        conform_past_fini(&fitting->past[fitting->count]);
    }
}
