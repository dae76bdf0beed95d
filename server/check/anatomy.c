#include "check/anatomy.h"

#include "check/bounds.h"
#include "mesh/topology.h"

#include <math.h>

#define CONDYLES_MM 35 // from the distal end of the femur
#define PLATEAU_MM 15  // from the proximal end of the tibia

// In the joint's frame, which all bodies share at rest: x to the right, z proximal. Of the vertices
// from low to high.
static struct box box_between(const struct knee_case *knee, const struct mesh *mesh, double low,
                              double high) {
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = pose_apply_inverse(knee->joint.T_femur_joint, mesh_vertex(mesh, v));
        if (p.z >= low && p.z <= high)
            box_include(&box, p);
    }
    return box;
}

static struct box whole_box(const struct knee_case *knee, const struct mesh *mesh) {
    return box_between(knee, mesh, -INFINITY, INFINITY);
}

static struct box condyles_of(struct knee_case *knee) {
    const struct mesh *femur = &case_group(knee, "femur")->mesh;
    double end = whole_box(knee, femur).min.z;
    return box_between(knee, femur, end, end + CONDYLES_MM);
}

static void inspect_widths(struct knee_case *knee, struct inspection *out) {
    const struct mesh *tibia = &case_group(knee, "tibia")->mesh;
    double top = whole_box(knee, tibia).max.z;
    struct box condyles = condyles_of(knee);
    struct box plateau = box_between(knee, tibia, top - PLATEAU_MM, top);
    bound_inspect(out, BOUND_CONDYLES, "femur", condyles.max.x - condyles.min.x);
    bound_inspect(out, BOUND_PLATEAU, "tibia", plateau.max.x - plateau.min.x);
}

static void inspect_menisci(struct knee_case *knee, struct inspection *out) {
    for (enum tissue_side side = TISSUE_MEDIAL; side <= TISSUE_LATERAL; side++) {
        const struct case_group *meniscus = case_meniscus(knee, side);
        if (meniscus && topology_of(&meniscus->mesh).closed)
            bound_inspect(out, BOUND_MENISCUS_VOLUME, meniscus->name,
                          mesh_volume(&meniscus->mesh) / 1000);
    }
}

static void inspect_patella(struct knee_case *knee, struct inspection *out) {
    const struct case_group *patella = case_group(knee, "patella");
    vec3 plateau;
    if (!patella)
        return;
    struct box box = whole_box(knee, &patella->mesh), condyles = condyles_of(knee);
    double height = box.max.z - box.min.z, width = condyles.max.x - condyles.min.x;
    double aside = fabs(box.min.x + box.max.x - condyles.min.x - condyles.max.x) / 2;
    bound_inspect(out, BOUND_PATELLA_HEIGHT, "patella", height);
    bound_inspect(out, BOUND_PATELLA_WIDTH, "patella", box.max.x - box.min.x);
    bound_inspect(out, BOUND_PATELLA_ASIDE, "patella", aside / width);
    if (!inspect_medial_plateau(knee, &plateau))
        return;
    vec3 at = pose_apply_inverse(knee->joint.T_tibia_joint, plateau);
    bound_inspect(out, BOUND_PATELLA_ABOVE, "patella", (box.min.z - at.z) / height);
}

void anatomy_inspect(struct knee_case *knee, struct inspection *inspection) {
    inspect_widths(knee, inspection);
    inspect_menisci(knee, inspection);
    inspect_patella(knee, inspection);
    bound_inspect(inspection, BOUND_ORIGIN, "joint",
                  vec3_length(knee->joint.T_femur_joint.translation));
}
