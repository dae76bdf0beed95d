#include "case/manifest.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

static json_t *numbers(int count, const double *values) {
    json_t *array = json_array();
    for (int i = 0; i < count; i++)
        json_array_append_new(array, json_real(values[i]));
    return array;
}

static json_t *vector(vec3 v) {
    return numbers(3, (double[]){v.x, v.y, v.z});
}

static json_t *pose_array(pose p) {
    return numbers(7, (double[]){p.translation.x, p.translation.y, p.translation.z, p.rotation.w,
                                 p.rotation.x, p.rotation.y, p.rotation.z});
}

static json_t *write_region(const struct case_region *region) {
    json_t *parts = json_array();
    for (int i = 0; i < region->part_count; i++) {
        json_t *planes = json_array();
        for (int k = 0; k < region->parts[i].plane_count; k++) {
            struct plane p = region->parts[i].planes[k];
            double row[] = {p.normal.x, p.normal.y, p.normal.z, p.offset};
            json_array_append_new(planes, numbers(4, row));
        }
        json_array_append_new(parts, planes);
    }
    return parts;
}

static void write_lesion(json_t *group_object, const struct case_lesion *lesion) {
    if (lesion->tear.part_count + lesion->damage.part_count + lesion->plan.part_count > 0)
        json_object_set_new(group_object, "lesion",
                            json_pack("{s:o, s:o, s:o}", "tear", write_region(&lesion->tear),
                                      "damage", write_region(&lesion->damage), "plan",
                                      write_region(&lesion->plan)));
}

// What differs from `usual`; zones where they are not as the kind's.
static void write_tissue(json_t *group_object, const struct case_tissue *tissue,
                         const struct case_tissue *usual) {
    char colour[8];
    struct case_tissue absent = *usual;
    if (tissue->kind != usual->kind) {
        json_object_set_new(group_object, "tissue", json_string(tissue_kind_name(tissue->kind)));
        tissue_set_kind(&absent, tissue->kind);
    }
    if (strcmp(tissue->label, absent.label) != 0)
        json_object_set_new(group_object, "label", json_string(tissue->label));
    snprintf(colour, sizeof colour, "#%06x", (unsigned)tissue->colour & 0xffffff);
    if (tissue->colour != absent.colour)
        json_object_set_new(group_object, "colour", json_string(colour));
    if (tissue->side != absent.side)
        json_object_set_new(group_object, "side", json_string(tissue_side_name(tissue->side)));
    if (tissue->has_zones != absent.has_zones)
        json_object_set_new(group_object, "zones", json_boolean(tissue->has_zones));
}

static bool is_described(const struct case_group *group) {
    const struct case_tissue usual = case_group_usual(group), *tissue = &group->tissue;
    return tissue->kind != usual.kind || tissue->colour != usual.colour ||
           tissue->side != usual.side || tissue->has_zones != usual.has_zones ||
           strcmp(tissue->label, usual.label) != 0;
}

static int format_of(const struct knee_case *knee) {
    if (knee->loose_count)
        return 4;
    for (int i = 0; i < knee->group_count; i++)
        if (is_described(&knee->groups[i]))
            return 3;
    return knee->has_scan || knee->landmark_count ? 2 : 1;
}

static json_t *write_groups(const struct knee_case *knee) {
    json_t *array = json_array();
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        json_t *object = json_pack("{s:s, s:s, s:b}", "name", group->name, "body",
                                   body_name(group->body), "cuttable", (int)group->cuttable);
        if (group->bridges)
            json_object_set_new(object, "bridges", json_string(body_name(group->other_body)));
        const struct case_tissue usual = case_group_usual(group);
        write_tissue(object, &group->tissue, &usual);
        write_lesion(object, &group->lesion);
        json_array_append_new(array, object);
    }
    return array;
}

static json_t *write_portals(const struct knee_case *knee) {
    json_t *array = json_array();
    for (int i = 0; i < knee->portal_count; i++) {
        const struct case_portal *portal = &knee->portals[i];
        json_array_append_new(array, json_pack("{s:s, s:o, s:o}", "name", portal->name, "position",
                                               vector(portal->position), "direction",
                                               vector(portal->direction)));
    }
    return array;
}

static json_t *write_landmarks(const struct knee_case *knee) {
    json_t *array = json_array();
    for (int i = 0; i < knee->landmark_count; i++) {
        const struct case_landmark *landmark = &knee->landmarks[i];
        json_array_append_new(array, json_pack("{s:s, s:s, s:o, s:f, s:s}", "name", landmark->name,
                                               "body", body_name(landmark->body), "at",
                                               vector(landmark->at), "error_mm", landmark->error_mm,
                                               "by", landmark->by_hand ? "hand" : "proposal"));
    }
    return array;
}

static json_t *write_loose(const struct knee_case *knee) {
    json_t *array = json_array();
    for (int i = 0; i < knee->loose_count; i++) {
        const struct case_loose *loose = &knee->loose[i];
        json_array_append_new(array, json_pack("{s:s, s:s, s:o, s:o}", "name", loose->name, "body",
                                               body_name(loose->body), "at", vector(loose->at),
                                               "radii_mm", vector(loose->radii_mm)));
    }
    return array;
}

static json_t *write_patella(const struct knee_case *knee) {
    json_t *array = json_array();
    for (int i = 0; i < knee->patella_key_count; i++) {
        const struct patella_key *key = &knee->patella_keys[i];
        json_array_append_new(array,
                              json_pack("{s:f, s:o}", "flexion_deg", key->flexion_deg,
                                        "T_femur_patella", pose_array(key->T_femur_patella)));
    }
    return array;
}

static json_t *write_rest(const struct knee_case *knee) {
    json_t *array = json_array();
    for (int i = 0; i < knee->rest_count; i++)
        json_array_append_new(array, pose_array(knee->rest[i]));
    return array;
}

static json_t *write_torn(const struct knee_case *knee) {
    json_t *array = json_array();
    for (int i = 0; i < knee->torn_count; i++) {
        json_t *keys = json_array();
        for (int k = 0; k < knee->key_count; k++)
            if (knee->keys[k].ligament == i)
                json_array_append_new(keys, json_pack("{s:o, s:o}", "physical",
                                                      pose_array(knee->keys[k].physical), "target",
                                                      pose_array(knee->keys[k].target)));
        json_array_append_new(array,
                              json_pack("{s:s, s:o}", "ligament", knee->torn[i], "keys", keys));
    }
    return array;
}

char *manifest_write(const struct knee_case *knee, uint64_t anatomy_hash) {
    char hash[17];
    snprintf(hash, sizeof hash, "%016" PRIx64, anatomy_hash);
    json_t *joint = json_pack("{s:o, s:o}", "T_femur_joint", pose_array(knee->joint.T_femur_joint),
                              "T_tibia_joint", pose_array(knee->joint.T_tibia_joint));
    json_t *root =
        json_pack("{s:i, s:s, s:s, s:s, s:s, s:o, s:o, s:o, s:o, s:o, s:o}", "format",
                  format_of(knee), "name", knee->name, "title", knee->title, "side",
                  knee->joint.side == SIDE_LEFT ? "left" : "right", "anatomy_xxh3", hash, "joint",
                  joint, "groups", write_groups(knee), "portals", write_portals(knee), "rest",
                  write_rest(knee), "torn", write_torn(knee), "patella", write_patella(knee));
    if (root && knee->has_scan)
        json_object_set_new(root, "scan",
                            json_pack("{s:b, s:o}", "mirrored", (int)knee->scan_mirrored,
                                      "T_case_scan", pose_array(knee->T_case_scan)));
    if (root && knee->landmark_count)
        json_object_set_new(root, "landmarks", write_landmarks(knee));
    if (root && knee->loose_count)
        json_object_set_new(root, "loose", write_loose(knee));
    char *text = root ? json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(17)) : NULL;
    json_decref(root);
    return text;
}
