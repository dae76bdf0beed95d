#include "case/content.h"
#include "case_commands.h"
#include "case_keys.h"
#include "check/inspect.h"
#include "mesh/topology.h"

#include <getopt.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>

static const char info_help[] =
    "Usage: arthron-case info DIR [--json]\n"
    "\n"
    "Prints name, side and hash of a case, the SHA-256 of its content, by which a server's config\n"
    "can name it, and its\n"
    "  groups      triangles, box, volume, topology, largest displacements by warp and maxcut\n"
    "  lesions     the convex parts of each region and their volume, also beyond the meniscus\n"
    "  ligaments   of torn ones the flexion of each key, where the mock-up holds the joint, and "
    "how\n"
    "              much further the patient's joint goes\n"
    "  scan        T_case_scan, which takes mm of an imported scan to the case, as\n"
    "              x,y,z,qw,qx,qy,qz\n"
    "  portals, the centre of the joint, and a point on top of the medial tibial plateau\n"
    "Lengths are in mm, in the frame of the femur at rest: x to the patient's right, y anterior,\n"
    "z proximal.\n";

// The regions of a lesion, as the manifest names them.
static const struct {
    const char *name;
    size_t offset; // in struct case_lesion
} regions[] = {{"tear", offsetof(struct case_lesion, tear)},
               {"damage", offsetof(struct case_lesion, damage)},
               {"plan", offsetof(struct case_lesion, plan)}};

#define REGION_COUNT (sizeof regions / sizeof *regions)

static const struct case_region *region_of(const struct case_group *group, size_t region) {
    return (const struct case_region *)((const char *)&group->lesion + regions[region].offset);
}

// Of all parts; where they overlap, twice.
static double region_volume(const struct case_region *region) {
    double volume = 0;
    for (int i = 0; i < region->part_count; i++)
        volume += region->parts[i].volume;
    return volume;
}

static const char *side_name(enum side side) {
    return side == SIDE_LEFT ? "left" : "right";
}

// ---- JSON ---------------------------------------------------------------------------------------

static json_t *vector(vec3 v) {
    return json_pack("[f, f, f]", v.x, v.y, v.z);
}

static json_t *pose_array(pose p) {
    return json_pack("[f, f, f, f, f, f, f]", p.translation.x, p.translation.y, p.translation.z,
                     p.rotation.w, p.rotation.x, p.rotation.y, p.rotation.z);
}

static json_t *topology_object(const struct topology *t) {
    return json_pack(
        "{s:i, s:i, s:i, s:i, s:i, s:i, s:b, s:b, s:b, s:I}", "components", (int)t->components,
        "open_edges", (int)t->open_edges, "non_manifold_edges", (int)t->non_manifold_edges,
        "non_manifold_vertices", (int)t->non_manifold_vertices, "flipped_edges",
        (int)t->flipped_edges, "unused_vertices", (int)t->unused_vertices, "closed", (int)t->closed,
        "manifold", (int)t->manifold, "oriented", (int)t->oriented, "genus", (json_int_t)t->genus);
}

static json_t *parts_array(const struct case_group *group) {
    json_t *array = json_array();
    for (int i = 0; i < group->part_count; i++)
        json_array_append_new(array, json_pack("{s:s, s:i, s:i}", "name", group->parts[i].name,
                                               "vertices", (int)group->parts[i].vertex_count,
                                               "triangles", (int)group->parts[i].triangle_count));
    return array;
}

static json_t *lesion_object(const struct case_group *group) {
    json_t *object = json_object();
    for (size_t i = 0; i < REGION_COUNT; i++) {
        const struct case_region *region = region_of(group, i);
        json_object_set_new(object, regions[i].name,
                            json_pack("{s:i, s:f}", "parts", region->part_count, "parts_mm3",
                                      region_volume(region)));
    }
    return object;
}

static json_t *group_object(const struct case_group *group) {
    struct topology t = topology_of(&group->mesh);
    struct box box = mesh_bounds(&group->mesh);
    char colour[8];
    snprintf(colour, sizeof colour, "#%06x", (unsigned)group->tissue.colour & 0xffffff);
    return json_pack(
        "{s:s, s:s, s:s, s:s, s:s, s:b, s:s, s:b, s:o, s:i, s:i, s:{s:o, s:o}, s:o, s:f, s:f, s:f, "
        "s:f, s:o, s:o, s:s?}",
        "name", group->name, "tissue", tissue_kind_name(group->tissue.kind), "label",
        group->tissue.label, "colour", colour, "side", tissue_side_name(group->tissue.side),
        "zones", (int)group->tissue.has_zones, "body", body_name(group->body), "cuttable",
        (int)group->cuttable, "parts", parts_array(group), "vertices",
        (int)group->mesh.vertex_count, "triangles", (int)group->mesh.triangle_count, "box", "min",
        vector(box.min), "max", vector(box.max), "volume_mm3",
        t.closed && t.oriented ? json_real(mesh_volume(&group->mesh)) : json_null(), "area_mm2",
        mesh_area(&group->mesh), "warp_max_mm", inspect_largest(group, group->warp),
        "maxcut_max_mm", inspect_largest(group, group->maxcut), "worst_wear",
        inspect_worst_wear(group), "lesion", lesion_object(group), "topology", topology_object(&t),
        "bridges", group->bridges ? body_name(group->other_body) : NULL);
}

static int print_json(struct knee_case *knee, const char *content) {
    json_t *groups = json_array(), *portals = json_array();
    for (int i = 0; i < knee->group_count; i++)
        json_array_append_new(groups, group_object(&knee->groups[i]));
    for (int i = 0; i < knee->portal_count; i++)
        json_array_append_new(portals, json_pack("{s:s, s:o, s:o}", "name", knee->portals[i].name,
                                                 "position", vector(knee->portals[i].position),
                                                 "direction", vector(knee->portals[i].direction)));
    char hash[17];
    snprintf(hash, sizeof hash, "%016" PRIx64, knee->hash);
    vec3 plateau;
    bool found = inspect_medial_plateau(knee, &plateau);
    json_t *root = json_pack(
        "{s:s, s:s, s:s, s:s, s:s, s:{s:o, s:o}, s:o, s:o, s:o, s:o, s:i, s:i, s:o}", "name",
        knee->name, "title", knee->title, "side", side_name(knee->joint.side), "hash", hash,
        "sha256", content, "joint", "T_femur_joint", pose_array(knee->joint.T_femur_joint),
        "T_tibia_joint", pose_array(knee->joint.T_tibia_joint), "joint_centre",
        vector(inspect_joint_centre(knee)), "medial_plateau", found ? vector(plateau) : json_null(),
        "groups", groups, "portals", portals, "patella_keys", knee->patella_key_count, "rest_poses",
        knee->rest_count, "torn", keys_array(knee));
    if (knee->has_scan)
        json_object_set_new(root, "scan",
                            json_pack("{s:b, s:o}", "mirrored", (int)knee->scan_mirrored,
                                      "T_case_scan", pose_array(knee->T_case_scan)));
    int bad = json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    json_decref(root);
    puts("");
    return bad ? EXIT_FAULT : EXIT_OK;
}

// ---- text ---------------------------------------------------------------------------------------

static void print_group(const struct case_group *group) {
    struct topology t = topology_of(&group->mesh);
    struct box box = mesh_bounds(&group->mesh);
    printf("%-17s %-8s %5d %9u ", group->name, body_name(group->body), group->part_count,
           group->mesh.triangle_count);
    if (t.closed && t.oriented)
        printf("%9.0f ", mesh_volume(&group->mesh));
    else
        printf("%9s ", "-");
    char bridge[32] = "";
    if (group->bridges)
        snprintf(bridge, sizeof bridge, ", to %s", body_name(group->other_body));
    printf("%6.2f %6.2f  %s%s%s%s%s  [%.1f %.1f %.1f] to [%.1f %.1f %.1f]\n",
           inspect_largest(group, group->warp), inspect_largest(group, group->maxcut),
           t.closed ? "closed" : "open", t.manifold ? "" : ", not manifold",
           t.oriented ? "" : ", not oriented", group->cuttable ? ", cuttable" : "", bridge,
           box.min.x, box.min.y, box.min.z, box.max.x, box.max.y, box.max.z);
}

static void print_lesion(const struct case_group *group) {
    for (size_t i = 0; i < REGION_COUNT; i++) {
        const struct case_region *region = region_of(group, i);
        if (region->part_count > 0)
            printf("%-6s %-17s %d parts of %.1f mm3 together\n", regions[i].name, group->name,
                   region->part_count, region_volume(region));
    }
}

static void print_wear(const struct case_group *group) {
    if (group->wear)
        printf("wear   %-17s grade %.1f at worst\n", group->name, inspect_worst_wear(group));
}

// Where the case's origin lies in the scan.
static void print_scan(const struct knee_case *knee) {
    pose T = knee->T_case_scan;
    vec3 origin = pose_apply_inverse(T, (vec3){0, 0, 0});
    if (knee->scan_mirrored)
        origin.x = -origin.x;
    printf("T_case_scan %.6f,%.6f,%.6f,%.9g,%.9g,%.9g,%.9g%s\n", T.translation.x, T.translation.y,
           T.translation.z, T.rotation.w, T.rotation.x, T.rotation.y, T.rotation.z,
           knee->scan_mirrored ? " after a change of the sign of x" : "");
    printf("origin of the case in the scan %.3f %.3f %.3f mm\n", origin.x, origin.y, origin.z);
}

static int print_info_text(struct knee_case *knee, const char *content) {
    vec3 centre = inspect_joint_centre(knee), plateau;
    printf("%s (%s knee)%s%s\nhash %016" PRIx64 "\nsha256 %s\n", knee->name,
           side_name(knee->joint.side), knee->title[0] ? ": " : "", knee->title, knee->hash,
           content);
    printf("joint centre %.1f %.1f %.1f\n", centre.x, centre.y, centre.z);
    if (inspect_medial_plateau(knee, &plateau))
        printf("medial plateau %.1f %.1f %.1f\n", plateau.x, plateau.y, plateau.z);
    if (knee->has_scan)
        print_scan(knee);
    printf("\n%-17s %-8s %5s %9s %9s %6s %6s  surface, box in mm\n", "group", "body", "parts",
           "triangles", "mm3", "warp", "maxcut");
    for (int i = 0; i < knee->group_count; i++)
        print_group(&knee->groups[i]);
    for (int i = 0; i < knee->group_count; i++)
        print_lesion(&knee->groups[i]);
    for (int i = 0; i < knee->group_count; i++)
        print_wear(&knee->groups[i]);
    for (int i = 0; i < knee->key_count; i++)
        print_key(knee, i);
    if (knee->rest_count)
        printf("rest path of %d poses\n", knee->rest_count);
    for (int i = 0; i < knee->portal_count; i++)
        printf("portal %-17s %.1f %.1f %.1f\n", knee->portals[i].name, knee->portals[i].position.x,
               knee->portals[i].position.y, knee->portals[i].position.z);
    return EXIT_OK;
}

int command_info(int argc, char **argv) {
    static const struct option options[] = {
        {"json", no_argument, NULL, 'j'}, {"help", no_argument, NULL, 'h'}, {0}};
    bool json = false;
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        if (option == 'h') {
            fputs(info_help, stdout);
            return EXIT_OK;
        }
        if (option != 'j')
            return EXIT_USAGE;
        json = true;
    }
    if (optind + 1 != argc)
        return usage_error("info", "one case folder is needed");
    struct knee_case *knee;
    struct content_file files[CONTENT_FILES];
    char content[CONTENT_HASH_SIZE];
    struct error err;
    if (content_read(argv[optind], files, &err) != RESULT_OK ||
        case_load(argv[optind], NULL, &knee, &err) != RESULT_OK)
        return failed("info", &err);
    content_hash(files, content);
    int status = json ? print_json(knee, content) : print_info_text(knee, content);
    case_destroy(&knee);
    return status;
}
