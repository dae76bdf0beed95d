// What a person asks of arthron-case import, between its files.
#pragma once

#include "import/import.h"
#include "import/judge.h"

#include <jansson.h>

#define SOURCES_MAX (CASE_GROUPS_MAX * CASE_PARTS_MAX)

struct surface_source {
    char group[CASE_NAME_MAX];
    const char *path;
    double mm_per_unit; // 0: stands before the first --unit
    pose T_common_file;
    bool several;             // a file of several parts, which are split and named
    char part[CASE_NAME_MAX]; // of such a file: the name that was proposed
};

struct body_choice {
    char group[CASE_NAME_MAX];
    enum body body; // BODY_COUNT: none
};

struct import_request {
    const char *name, *title, *side, *axes, *out; // side, axes: NULL: to be judged
    double first_unit, unit;                      // mm; 0 before the first --unit
    double clip_mm;
    bool has_joint;
    pose T_femur_joint; // in the scan's frame, turned as the case
    int source_count, body_count, bridge_count, cuttable_count, portal_count;
    struct surface_source sources[SOURCES_MAX];
    struct body_choice bodies[CASE_GROUPS_MAX], bridges[CASE_GROUPS_MAX];
    int rename_count;
    struct part_rename {
        char from[CASE_NAME_MAX];
        const char *to;
        bool used;
    } renames[CASE_GROUPS_MAX]; // of parts of --parts
    const char *cuttable[CASE_GROUPS_MAX];
    struct case_portal portals[CASE_PORTALS_MAX]; // in the scan's frame, turned as the case
    bool as_json;
    json_t *judged, *specks, *meshes, *covered; // what is said as JSON
};

// Reads all files, judges unit, axes and side, finds the joint's centre, and puts every mesh into
// its group, in the frame of the case, with the joint, the side, the portals and T_case_scan. Says
// what it found and did.
enum result import_scan(struct import_request *request, struct knee_case *knee, struct error *err);
