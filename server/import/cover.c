#include "import/cover.h"

#include "base/check.h"
#include "mesh/solid.h"
#include "mesh/topology.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LOOK_MM 1     // between the places of a triangle that are looked at
#define LOOKS_MAX 200 // along an edge
#define MEET_MM 1e-4  // nearer is there
#define THICK_MM 6 // the thickest cartilage (Eckstein et al., Osteoarthritis Cartilage 9:101-111)
#define STEPS_MAX 256 // of a ray that grazes a surface

struct cover_part {
    struct mesh mesh;
    struct solid solid;
    bool closed;
};

struct cover {
    const struct case_group *group;
    struct cover_part parts[CASE_PARTS_MAX];
    uint32_t hints[CASE_PARTS_MAX];
};

static void copy_part(const struct case_group *group, const struct case_part *part,
                      struct mesh *out) {
    mesh_init(out, part->vertex_count, part->triangle_count);
    memcpy(out->positions, group->mesh.positions + 3 * (size_t)part->first_vertex,
           3 * (size_t)part->vertex_count * sizeof *out->positions);
    const uint32_t *from = group->mesh.triangles + 3 * (size_t)part->first_triangle;
    for (size_t i = 0; i < 3 * (size_t)part->triangle_count; i++)
        out->triangles[i] = from[i] - part->first_vertex;
}

static enum result cover_init(struct cover *cover, const struct case_group *group,
                              struct error *err) {
    *cover = (struct cover){.group = group};
    for (int i = 0; i < group->part_count; i++) {
        struct cover_part *part = &cover->parts[i];
        copy_part(group, &group->parts[i], &part->mesh);
        struct topology t = topology_of(&part->mesh);
        part->closed = t.closed && t.oriented;
        cover->hints[i] = MESH_NONE;
        enum result result = solid_init(&part->solid, &part->mesh, err);
        if (result != RESULT_OK)
            return result;
    }
    return RESULT_OK;
}

static void cover_fini(struct cover *cover) {
    for (int i = 0; i < CASE_PARTS_MAX; i++) {
        if (cover->parts[i].solid.mesh)
            solid_fini(&cover->parts[i].solid);
        mesh_fini(&cover->parts[i].mesh);
    }
}

// ---- one place ----------------------------------------------------------------------------------

static bool is_in_box(struct box box, vec3 p, double margin) {
    return p.x >= box.min.x - margin && p.x <= box.max.x + margin && p.y >= box.min.y - margin &&
           p.y <= box.max.y + margin && p.z >= box.min.z - margin && p.z <= box.max.z + margin;
}

// From p along the unit vector n: the way to a part, at most `most`, and whether its back is met.
static bool meets(const struct cover_part *part, vec3 p, vec3 n, double most, uint32_t *hint,
                  double *out_way, bool *out_back) {
    double way = 0;
    struct closest closest;
    for (int step = 0; step < STEPS_MAX && way <= most; step++) {
        if (!query_closest(part->solid.query, vec3_add_scaled(p, way, n), most - way + MEET_MM,
                           *hint, &closest))
            return false;
        *hint = closest.triangle;
        *out_way = way;
        *out_back = vec3_dot(part->solid.face_normals[closest.triangle], n) > 0;
        if (closest.distance <= MEET_MM)
            return true;
        way += closest.distance;
    }
    return false;
}

// Whether another part hides a place of part `own`, whose surface faces n there. A scan that
// crosses itself can tell the inside wrongly, so the way out must meet the part's back as well.
static bool hides(struct cover *cover, int other, int own, vec3 p, vec3 n) {
    const struct cover_part *part = &cover->parts[other];
    uint32_t *hint = &cover->hints[other];
    double size = vec3_distance(part->solid.box.min, part->solid.box.max), way;
    bool back;
    if (!is_in_box(part->solid.box, p, 2 * COVER_GAP_MM))
        return false;
    if (meets(part, p, n, COVER_GAP_MM, hint, &way, &back))
        return !back || way > MEET_MM || other < own;
    struct closest closest;
    return query_closest(part->solid.query, p, INFINITY, *hint, &closest) &&
           solid_signed(&part->solid, p, &closest) < 0 &&
           meets(part, p, n, size, hint, &way, &back) && back;
}

// An open sheet over a bone: the surface of cartilage alone.
static bool is_over(struct cover *cover, int sheet, vec3 p, vec3 n) {
    const struct cover_part *part = &cover->parts[sheet];
    double way;
    bool back;
    return is_in_box(part->solid.box, p, THICK_MM) &&
           meets(part, p, n, THICK_MM, &cover->hints[sheet], &way, &back) && back;
}

static bool is_hidden(struct cover *cover, int own, vec3 p, vec3 n) {
    for (int i = 0; i < cover->group->part_count; i++)
        if (i != own &&
            (cover->parts[i].closed ? hides(cover, i, own, p, n) : is_over(cover, i, p, n)))
            return true;
    return false;
}

// ---- triangles and vertices ---------------------------------------------------------------------

static bool is_triangle_hidden(struct cover *cover, int own, uint32_t triangle) {
    const struct cover_part *part = &cover->parts[own];
    vec3 a = mesh_corner(&part->mesh, triangle, 0), b = mesh_corner(&part->mesh, triangle, 1),
         c = mesh_corner(&part->mesh, triangle, 2), n = part->solid.face_normals[triangle];
    double longest = fmax(vec3_distance(a, b), fmax(vec3_distance(b, c), vec3_distance(c, a)));
    int looks = (int)fmin(ceil(longest / LOOK_MM), LOOKS_MAX);
    for (int i = 0; i <= looks; i++)
        for (int k = 0; k <= looks - i; k++) {
            double u = (double)i / looks, v = (double)k / looks;
            vec3 p = vec3_add_scaled(vec3_add_scaled(vec3_scale(1 - u - v, a), u, b), v, c);
            if (!is_hidden(cover, own, p, n))
                return false;
        }
    return true;
}

// A triangle with a bare corner stays, so what is covered begins one triangle inside its border.
static void cover_part(struct cover *cover, int own, float *covered) {
    const struct mesh *mesh = &cover->parts[own].mesh;
    bool *bare = alloc(mesh->vertex_count, sizeof *bare);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *v = mesh->triangles + 3 * (size_t)t;
        if ((bare[v[0]] && bare[v[1]] && bare[v[2]]) || is_triangle_hidden(cover, own, t))
            continue;
        bare[v[0]] = bare[v[1]] = bare[v[2]] = true;
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        covered[v] = bare[v] ? 0 : 1;
    free(bare);
}

enum result cover_parts(struct case_group *group, struct error *err) {
    if (group->part_count < 2 || group->cuttable)
        return RESULT_OK;
    struct cover cover;
    enum result result = cover_init(&cover, group, err);
    for (int i = 0; i < group->part_count && result == RESULT_OK; i++)
        if (cover.parts[i].closed)
            cover_part(&cover, i, case_group_need_covered(group) + group->parts[i].first_vertex);
    cover_fini(&cover);
    bool any = false;
    for (uint32_t v = 0; group->covered && v < group->mesh.vertex_count; v++)
        any |= group->covered[v] > 0;
    if (!any) {
        free(group->covered);
        group->covered = NULL;
    }
    return result;
}
