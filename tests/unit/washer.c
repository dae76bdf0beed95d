#include "unit/washer.h"

#include "test.h"

#include <string.h>

// ---- part of a washer ---------------------------------------------------------------------------

const struct washer washer_usual = {8, 17, 4, 2.356194490192345};

vec3 washer_point(double angle, double r, double z) {
    return (vec3){r * sin(angle), -r * cos(angle), z};
}

static void add_quad(struct mesh *mesh, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    const uint32_t corners[6] = {a, b, c, a, c, d};
    memcpy(mesh->triangles + 3 * (size_t)mesh->triangle_count, corners, sizeof corners);
    mesh->triangle_count += 2;
}

void washer_mesh(const struct washer *w, pose T_mesh_washer, struct mesh *out_mesh) {
    enum { RINGS = 541 };
    mesh_init(out_mesh, 4 * RINGS, 8 * (RINGS - 1) + 4);
    out_mesh->triangle_count = 0;
    for (uint32_t i = 0; i < RINGS; i++) {
        double angle = w->half * (2.0 * i / (RINGS - 1) - 1);
        for (uint32_t k = 0; k < 4; k++) {
            vec3 p = washer_point(angle, k == 0 || k == 3 ? w->inner : w->outer,
                                  k < 2 ? -w->height / 2 : w->height / 2);
            mesh_set_vertex(out_mesh, 4 * i + k, pose_apply(T_mesh_washer, p));
        }
    }
    for (uint32_t i = 0; i + 1 < RINGS; i++)
        for (uint32_t k = 0; k < 4; k++) {
            uint32_t l = (k + 1) % 4;
            add_quad(out_mesh, 4 * i + k, 4 * i + 4 + k, 4 * i + 4 + l, 4 * i + l);
        }
    uint32_t last = 4 * (RINGS - 1);
    add_quad(out_mesh, 0, 1, 2, 3);
    add_quad(out_mesh, last + 3, last + 2, last + 1, last);
}

double washer_third(const struct washer *w, int across) {
    return w->inner + across * (w->outer - w->inner) / 3;
}

// ---- a plan and a session on it -----------------------------------------------------------------

void washer_scene_begin(struct washer_scene *s, const struct washer *washer, pose T_mesh_washer,
                        struct quality_setting setting) {
    s->T_mesh_washer = T_mesh_washer;
    washer_mesh(washer, T_mesh_washer, &s->tissue);
    setting.tissue = &s->tissue;
    setting.anterior = quat_rotate(T_mesh_washer.rotation, (vec3){1, 0, 0});
    setting.up = quat_rotate(T_mesh_washer.rotation, (vec3){0, 0, 1});
    s->plan = quality_plan_create(&setting);
    s->quality = quality_create(s->plan);
}

void washer_scene_end(struct washer_scene *s) {
    quality_destroy(&s->quality);
    quality_plan_destroy(&s->plan);
    assert_null(s->quality);
    assert_null(s->plan);
    mesh_fini(&s->tissue);
}

struct quality_report quality_of(const struct washer_scene *s) {
    struct quality_report report;
    quality_report(s->quality, &report);
    return report;
}

double zones_sum(const struct zone_volumes *volumes) {
    double sum = 0;
    for (int i = 0; i < ZONE_ALONG_COUNT; i++)
        for (int k = 0; k < ZONE_ACROSS_COUNT; k++)
            sum += volumes->mm3[i][k];
    return sum;
}

struct convex convex_box(pose T_mesh_box, vec3 low, vec3 high) {
    const double sides[6][4] = {{1, 0, 0, high.x},  {-1, 0, 0, -low.x}, {0, 1, 0, high.y},
                                {0, -1, 0, -low.y}, {0, 0, 1, high.z},  {0, 0, -1, -low.z}};
    struct plane planes[6];
    for (int i = 0; i < 6; i++) {
        vec3 n = quat_rotate(T_mesh_box.rotation, (vec3){sides[i][0], sides[i][1], sides[i][2]});
        planes[i] = (struct plane){n, sides[i][3] + vec3_dot(n, T_mesh_box.translation)};
    }
    struct convex convex;
    struct error err;
    if (convex_create(planes, 6, &convex, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return convex;
}

void convex_mesh(const struct convex *convex, struct mesh *out_mesh) {
    uint32_t triangles = 0;
    for (int f = 0; f < convex->plane_count; f++)
        triangles += (uint32_t)(convex->first_corner[f + 1] - convex->first_corner[f] - 2);
    mesh_init(out_mesh, (uint32_t)convex->vertex_count, triangles);
    for (int v = 0; v < convex->vertex_count; v++)
        mesh_set_vertex(out_mesh, (uint32_t)v, convex->vertices[v]);
    uint32_t *t = out_mesh->triangles;
    for (int f = 0; f < convex->plane_count; f++) {
        const uint8_t *corners = convex->corners + convex->first_corner[f];
        int count = convex->first_corner[f + 1] - convex->first_corner[f];
        for (int i = 2; i < count; i++) {
            *t++ = corners[0];
            *t++ = corners[i - 1];
            *t++ = corners[i];
        }
    }
}

void zones_add_mesh(const struct quality_plan *plan, const struct mesh *mesh, double times,
                    struct zone_volumes *volumes) {
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 c[3] = {mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1), mesh_corner(mesh, t, 2)};
        quality_add_triangle(plan, c, times, volumes);
    }
}
