#include "case_import.h"

#include "base/number.h"
#include "case_commands.h"
#include "check/inspect.h"
#include "generate/bridge.h"
#include "import/cover.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

#define CLIP_DEFAULT_MM 120
#define CLIP_MIN_MM 60
#define CLIP_MAX_MM 900

static const char import_help[] =
    "Usage: arthron-case import --name NAME --group NAME=FILE[@T]... --out DIR [OPTION...]\n"
    "\n"
    "Makes a case from meshes (PLY, OBJ, STL, OFF, VTK, glTF). tibia and femur are needed. Unit,\n"
    "axes and side are judged from the whole knee. The import says how sure it is, and from what.\n"
    "The centre of the joint becomes the origin of the case; `arthron-case info` shows\n"
    "T_case_scan, the transform from the scan.\n"
    "\n"
    "  --group NAME=FILE[@x,y,z,qw,qx,qy,qz]\n"
    "                     a mesh of the group; several of the same NAME are its parts. The pose,\n"
    "                     in mm, takes the file's frame (scaled to mm) to the common frame; x,y,z\n"
    "                     alone is a shift\n"
    "                     Usual names: tibia, femur, patella, meniscus_medial, meniscus_lateral,\n"
    "                     acl, pcl, mcl, lcl, fibula, skin\n"
    "  --parts FILE       a file that holds several parts of the knee. Its components are named "
    "by\n"
    "                     place, size and shape: femur, tibia, patella, fibula, meniscus_medial,\n"
    "                     meniscus_lateral, and part_N for all others. Where the axes are neither\n"
    "                     given nor declared by the file, all are tried; without a patella: RAS\n"
    "  --rename OLD=NEW   another name for a part of --parts\n"
    "  --unit mm|cm|m     unit of the files of the --group options after it. It may be repeated;\n"
    "                     the first one holds for the files before it, too. Default: mm, cm or m,\n"
    "                     by the width of femur and tibia\n"
    "  --axes XYZ         the directions of x, y and z of the common frame, three of R or L "
    "(right,\n"
    "                     left of the patient), A or P (anterior, posterior), S or I (superior,\n"
    "                     inferior). A left-handed frame, such as LAS, is mirrored. Default: by\n"
    "                     femur, tibia and patella, and by what the files declare; else RAS\n"
    "  --side left|right  the side of the knee. Default: by menisci, lcl, mcl and fibula\n"
    "  --clip MM          cuts off what lies farther above or below the joint, 60 to 900. "
    "Default:\n"
    "                     120. Closed meshes are closed again with a cap\n"
    "  --body NAME=BODY   the body that a group moves with: femur, tibia or patella. Default: "
    "tibia\n"
    "                     for *tibia*, *fibula*, meniscus* and ligaments, patella for patella*, "
    "else\n"
    "                     femur\n"
    "  --bridge NAME=BODY the group is a ligament that reaches another bone. Each vertex follows "
    "the\n"
    "                     nearer bone more. Default: acl, pcl, mcl, lcl from tibia to femur,\n"
    "                     patellar_ligament and skin to tibia. NAME=none: no bridge\n"
    "  --cuttable NAME    instruments cut this group: one closed, manifold mesh\n"
    "  --portal NAME=x,y,z,dx,dy,dz\n"
    "                     an entry through the skin and its direction into the joint. Portal and\n"
    "                     joint: RAS, mm, with the scan's origin\n"
    "  --joint x,y,z,qw,qx,qy,qz\n"
    "                     the joint's frame. Default, from the distal 35 mm of the femur:\n"
    "                     not turned, in the middle from left to right, and 0.27 times the width\n"
    "                     above the distal and before the posterior end\n"
    "  --title TEXT       the title that people see\n"
    "  --json             print the report of each mesh as JSON\n"
    "  --name NAME        the name of the case: letters, digits and \"_-.\"\n"
    "\n"
    "Give all bones as they lie in extension. The import repairs each mesh where that is safe.\n"
    "It joins vertices of open edges in one place. (In a file whose triangles share none, as in\n"
    "STL, 0.001 mm count as one place.) It removes bad and duplicate triangles, fins of less\n"
    "than 1 mm2, and components of less than 2 % of the area. It turns triangles outwards. It\n"
    "splits sheets that touch in a vertex or an edge. It moves and fills nothing else. For each\n"
    "mesh it prints what was wrong, what it did, and what remains. Open meshes can be warped and\n"
    "touched, but not cut.\n"
    "\n"
    "It refuses a file that is misread, and a knee of 4 cm or 40 m, with the unit that would\n"
    "fit. It also refuses a case with wrong sizes or places. Then it writes nothing.\n";

// ---- the command line ---------------------------------------------------------------------------

// "NAME=rest": the name into out_name, the rest returned; NULL where it is not that.
static char *split_name(char *text, char *out_name) {
    char *equals = strchr(text, '=');
    if (!equals || equals[1] == '\0')
        return NULL;
    *equals = '\0';
    bool valid = case_name_is_valid(text);
    if (valid)
        memcpy(out_name, text, strlen(text) + 1);
    *equals = '=';
    return valid ? equals + 1 : NULL;
}

static bool parse_unit(const char *text, struct import_request *request) {
    for (int i = 0; i < IMPORT_UNITS; i++) {
        if (strcmp(text, import_units[i].name) == 0) {
            request->unit = import_units[i].mm;
            if (!request->first_unit)
                request->first_unit = request->unit;
            return true;
        }
    }
    return false;
}

// A file's name may hold "@": only what looks like a number after the last one is a pose.
static bool parse_source(char *text, struct import_request *request) {
    struct surface_source *source = &request->sources[request->source_count++];
    char *path = split_name(text, source->group);
    if (!path)
        return false;
    source->path = path;
    source->mm_per_unit = request->unit;
    source->T_common_file = pose_identity();
    char *at = strrchr(path, '@');
    if (!at || !strchr("+-.0123456789", at[1]) || !at[1])
        return true;
    if (at == path || !number_pose(at + 1, &source->T_common_file))
        return false;
    *at = '\0';
    return true;
}

static bool parse_parts(char *text, struct import_request *request) {
    request->sources[request->source_count++] =
        (struct surface_source){.path = text,
                                .mm_per_unit = request->unit,
                                .T_common_file = pose_identity(),
                                .several = true};
    return true;
}

static bool parse_rename(char *text, struct import_request *request) {
    struct part_rename *rename = &request->renames[request->rename_count++];
    rename->to = split_name(text, rename->from);
    return rename->to && case_name_is_valid(rename->to);
}

static bool parse_body(char *text, struct import_request *request) {
    struct body_choice *choice = &request->bodies[request->body_count++];
    const char *body = split_name(text, choice->group);
    return body && body_from_name(body, &choice->body);
}

static bool parse_bridge(char *text, struct import_request *request) {
    struct body_choice *choice = &request->bridges[request->bridge_count++];
    const char *body = split_name(text, choice->group);
    choice->body = BODY_COUNT;
    return body && (strcmp(body, "none") == 0 || body_from_name(body, &choice->body));
}

static bool parse_portal(char *text, struct import_request *request) {
    struct case_portal *portal = &request->portals[request->portal_count++];
    const char *numbers = split_name(text, portal->name);
    double v[6];
    if (!numbers || !parse_numbers(numbers, v, 6))
        return false;
    portal->position = (vec3){v[0], v[1], v[2]};
    portal->direction = vec3_unit_or((vec3){v[3], v[4], v[5]}, (vec3){0});
    return vec3_length(portal->direction) > 0;
}

static bool parse_cuttable(const char *text, struct import_request *request) {
    if (request->cuttable_count == CASE_GROUPS_MAX)
        return false;
    request->cuttable[request->cuttable_count++] = text;
    return true;
}

static bool take_text(int option, const char *text, struct import_request *request) {
    switch (option) {
    case 'n':
        request->name = text;
        return case_name_is_valid(text);
    case 't':
        request->title = text;
        return true;
    case 's':
        request->side = text;
        return strcmp(text, "left") == 0 || strcmp(text, "right") == 0;
    case 'a':
        request->axes = text;
        return import_axes(text, &(struct import_frame){0});
    case 'J':
        request->as_json = true;
        return true;
    default:
        request->out = text;
        return true;
    }
}

static bool take_import_option(int option, char *text, struct import_request *request) {
    switch (option) {
    case 'u':
        return parse_unit(text, request);
    case 'g':
        return request->source_count < SOURCES_MAX && parse_source(text, request);
    case 'P':
        return request->source_count < SOURCES_MAX && parse_parts(text, request);
    case 'R':
        return request->rename_count < CASE_GROUPS_MAX && parse_rename(text, request);
    case 'C':
        return number_double(text, CLIP_MIN_MM, CLIP_MAX_MM, &request->clip_mm);
    case 'b':
        return request->body_count < CASE_GROUPS_MAX && parse_body(text, request);
    case 'B':
        return request->bridge_count < CASE_GROUPS_MAX && parse_bridge(text, request);
    case 'c':
        return parse_cuttable(text, request);
    case 'p':
        return request->portal_count < CASE_PORTALS_MAX && parse_portal(text, request);
    case 'j':
        request->has_joint = true;
        return number_pose(text, &request->T_femur_joint);
    default:
        return take_text(option, text, request);
    }
}

static int refuse_option(const struct option *option, const char *text) {
    static const char *const sides[] = {"left", "right", NULL};
    const char *units[IMPORT_UNITS + 1] = {NULL};
    for (int i = 0; i < IMPORT_UNITS; i++)
        units[i] = import_units[i].name;
    if (option->val == 's')
        return unknown_choice("import", "--side", text, sides);
    if (option->val == 'u')
        return unknown_choice("import", "--unit", text, units);
    return usage_error("import", "--%s %s: not of the form that --help shows, or given too often",
                       option->name, text);
}

// ---- the case -----------------------------------------------------------------------------------

static enum result mark_groups(struct knee_case *knee, const struct import_request *request,
                               struct error *err) {
    for (int i = 0; i < request->body_count; i++)
        if (!case_group(knee, request->bodies[i].group))
            return fail(err, RESULT_MISSING, "--body %s: there is no such group",
                        request->bodies[i].group);
    for (int i = 0; i < request->cuttable_count; i++) {
        struct case_group *group = case_group(knee, request->cuttable[i]);
        if (!group)
            return fail(err, RESULT_MISSING, "--cuttable %s: there is no such group",
                        request->cuttable[i]);
        group->cuttable = true;
    }
    return RESULT_OK;
}

static void say_covered(const struct import_request *request, const struct case_group *group) {
    struct mesh outer;
    case_group_surface(group, &outer);
    uint32_t all = group->mesh.triangle_count, covered = all - outer.triangle_count;
    mesh_fini(&outer);
    if (request->as_json)
        json_array_append_new(request->covered,
                              json_pack("{s:s, s:I, s:I}", "group", group->name, "triangles",
                                        (json_int_t)all, "covered", (json_int_t)covered));
    else
        printf("%s: %d parts, one outer surface: %u of %u triangles are covered by another part\n",
               group->name, group->part_count, covered, all);
}

static enum result cover_groups(struct knee_case *knee, const struct import_request *request,
                                struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < knee->group_count && result == RESULT_OK; i++) {
        result = cover_parts(&knee->groups[i], err);
        if (result == RESULT_OK && knee->groups[i].covered)
            say_covered(request, &knee->groups[i]);
    }
    return result;
}

static enum body bridge_of(const struct import_request *request, const struct case_group *group) {
    for (int i = 0; i < request->bridge_count; i++)
        if (strcmp(request->bridges[i].group, group->name) == 0)
            return request->bridges[i].body;
    return import_default_bridge(group->name, group->body);
}

static enum result bridge_groups(struct knee_case *knee, const struct import_request *request,
                                 struct error *err) {
    for (int i = 0; i < request->bridge_count; i++)
        if (!case_group(knee, request->bridges[i].group))
            return fail(err, RESULT_MISSING, "--bridge %s: there is no such group",
                        request->bridges[i].group);
    enum result result = RESULT_OK;
    for (int i = 0; i < knee->group_count && result == RESULT_OK; i++) {
        enum body other = bridge_of(request, &knee->groups[i]);
        if (other != BODY_COUNT)
            result = bridge_make(knee, &knee->groups[i], other, err);
    }
    return result;
}

static enum result refuse_faults(struct knee_case *knee, struct error *err) {
    static struct inspection inspection;
    inspect_case(knee, &inspection);
    for (int i = 0; i < inspection.count; i++) {
        const struct check_finding *finding = &inspection.findings[i];
        if (finding->level == FINDING_FAULT)
            return fail(err, RESULT_INVALID, "%s: %s", finding->where, finding->text);
        fprintf(stderr, "warning: %s: %s\n", finding->where, finding->text);
    }
    return RESULT_OK;
}

static enum result fill(struct knee_case *knee, struct import_request *request, struct error *err) {
    enum result result = import_scan(request, knee, err);
    if (result == RESULT_OK)
        result = mark_groups(knee, request, err);
    if (result == RESULT_OK)
        result = cover_groups(knee, request, err);
    if (result == RESULT_OK)
        result = bridge_groups(knee, request, err);
    if (result == RESULT_OK)
        result = case_validate(knee, err);
    if (result == RESULT_OK)
        result = refuse_faults(knee, err);
    return result == RESULT_OK ? case_save(knee, request->out, err) : result;
}

// What was given by hand is not to be replaced by proposals.
static void print_next(const struct import_request *request) {
    static const char *const keeps[2][2] = {{"", " --keep portals"},
                                            {" --keep joint", " --keep joint,portals"}};
    printf("saved   %s; next: arthron-case landmarks %s%s --out %s\n", request->out, request->out,
           keeps[request->has_joint][request->portal_count > 0], request->out);
}

static int run_import(struct import_request *request) {
    struct knee_case *knee = case_create(request->name, request->title);
    struct error err;
    request->judged = json_object();
    request->specks = json_array();
    request->meshes = json_array();
    request->covered = json_array();
    enum result result = fill(knee, request, &err);
    case_destroy(&knee);
    json_object_set_new(request->judged, "specks", request->specks);
    json_object_set_new(request->judged, "meshes", request->meshes);
    json_object_set_new(request->judged, "covered", request->covered);
    if (result == RESULT_OK && request->as_json) {
        json_dumpf(request->judged, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
        puts("");
    }
    if (result == RESULT_OK && !request->as_json)
        print_next(request);
    json_decref(request->judged);
    return result == RESULT_OK ? EXIT_OK : failed("import", &err);
}

int command_import(int argc, char **argv) {
    static const struct option options[] = {
        {"unit", required_argument, NULL, 'u'},     {"name", required_argument, NULL, 'n'},
        {"title", required_argument, NULL, 't'},    {"side", required_argument, NULL, 's'},
        {"group", required_argument, NULL, 'g'},    {"parts", required_argument, NULL, 'P'},
        {"rename", required_argument, NULL, 'R'},   {"axes", required_argument, NULL, 'a'},
        {"body", required_argument, NULL, 'b'},     {"bridge", required_argument, NULL, 'B'},
        {"cuttable", required_argument, NULL, 'c'}, {"portal", required_argument, NULL, 'p'},
        {"joint", required_argument, NULL, 'j'},    {"clip", required_argument, NULL, 'C'},
        {"out", required_argument, NULL, 'o'},      {"json", no_argument, NULL, 'J'},
        {"help", no_argument, NULL, 'h'},           {0}};
    static struct import_request request;
    request = (struct import_request){.title = "", .clip_mm = CLIP_DEFAULT_MM};
    int option, which = 0;
    while ((option = getopt_long(argc, argv, "", options, &which)) != -1) {
        if (option == 'h') {
            fputs(import_help, stdout);
            return EXIT_OK;
        }
        if (option == '?')
            return EXIT_USAGE;
        if (!take_import_option(option, optarg, &request))
            return refuse_option(&options[which], optarg);
    }
    if (optind != argc)
        return usage_error("import", "unexpected argument \"%s\"", argv[optind]);
    if (!request.name || !request.source_count || !request.out)
        return usage_error("import", "--name, --group or --parts, and --out are needed");
    return run_import(&request);
}
