// A small body, some of its vertices moved, and cuts with unions of boxes and of half-spaces, on a
// coarse lattice so that faces coincide.
#include "base/check.h"
#include "cutting/bites.h"
#include "cutting/trial.h"
#include "cutting/voxels.h"
#include "fuzz/fuzz.h"
#include "scene/shapes.h"

#include <string.h>

#define CUTS_MAX 8
#define PARTS_MAX 3

struct input {
    const uint8_t *data;
    size_t size;
};

static uint8_t next(struct input *input) {
    if (!input->size)
        return 0;
    input->size--;
    return *input->data++;
}

static double next_in(struct input *input, double unit) {
    return unit * (int8_t)next(input);
}

static vec3 next_vec3(struct input *input, double unit) {
    double x = next_in(input, unit), y = next_in(input, unit);
    return (vec3){x, y, next_in(input, unit)};
}

// ---- the body -----------------------------------------------------------------------------------

static void make_body(uint8_t kind, struct mesh *out) {
    switch (kind % 4) {
    case 0:
        shape_box(out, (vec3){3, 3, 2});
        break;
    case 1:
        shape_sphere(out, 4, 3);
        break;
    case 2:
        shape_torus(out, 5, 2, 10, 6);
        break;
    default:
        lattice_cube(out, 3, 3);
    }
}

// By less than a quarter of an edge: no triangle reaches through another.
static void move_vertices(struct input *input, struct mesh *mesh) {
    for (int i = next(input) % 16; i > 0; i--) {
        uint32_t v = next(input) % mesh->vertex_count;
        vec3 step = next_vec3(input, 0.25 / 128);
        mesh_set_vertex(mesh, v, vec3_add(mesh_vertex(mesh, v), step));
    }
}

// ---- blades -------------------------------------------------------------------------------------

static void make_box(struct input *input, bool is_turned, struct convex *out) {
    pose T = {quat_identity(), next_vec3(input, 0.0625)};
    vec3 half = next_vec3(input, 0.0625);
    if (is_turned) {
        vec3 axis = vec3_unit_or(next_vec3(input, 1), (vec3){0, 0, 1});
        T.rotation = quat_from_axis_angle(axis, next_in(input, 3.0 / 128));
    }
    half = (vec3){fabs(half.x) + 0.0625, fabs(half.y) + 0.0625, fabs(half.z) + 0.0625};
    convex_box(T, half, out);
}

static double next_double(struct input *input) {
    uint8_t bytes[8];
    double value;
    for (int i = 0; i < 8; i++)
        bytes[i] = next(input);
    memcpy(&value, bytes, sizeof value);
    return value;
}

// Small numbers, or any that eight bytes can be.
static bool make_half_spaces(struct input *input, bool is_any, struct convex *out) {
    struct plane planes[80];
    int count = next(input) % 80;
    struct error err;
    for (int i = 0; i < count; i++)
        if (is_any) {
            double x = next_double(input), y = next_double(input), z = next_double(input);
            planes[i] = (struct plane){{x, y, z}, next_double(input)};
        } else {
            vec3 normal = next_vec3(input, 1);
            planes[i] = (struct plane){normal, next_in(input, 0.125) * vec3_length(normal)};
        }
    return convex_create(planes, count, out, &err) == RESULT_OK;
}

static bool make_part(struct input *input, struct convex *out) {
    uint8_t kind = next(input) % 8;
    if (kind > 4)
        return make_half_spaces(input, kind == 7, out);
    make_box(input, kind > 2, out);
    return true;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct input input = {data, size};
    struct random random = {size};
    struct convex parts[PARTS_MAX];
    struct trial trial;
    struct mesh mesh;
    int inside = 0;
    make_body(next(&input), &mesh);
    move_vertices(&input, &mesh);
    trial_init(&trial, &mesh);
    for (int i = 0; i < CUTS_MAX && input.size; i++) {
        int count = 0;
        for (int due = 1 + next(&input) % PARTS_MAX; due > 0; due--)
            count += make_part(&input, &parts[count]);
        if (!count)
            continue;
        trial_cut(&trial, parts, count);
        CHECK(!trial.fault);
        CHECK(trial.outcome != CUT_CHANGED ||
              !trial_points_fault(&trial, parts, count, 6, &random, &inside));
    }
    trial_fini(&trial);
    mesh_fini(&mesh);
    return 0;
}
