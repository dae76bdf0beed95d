#include "case_import.h"
#include "case_import_clip.h"
#include "case_import_report.h"
#include "case_read_surface.h"
#include "import/split.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

// What is left out of a file of several parts.
struct left_out {
    int surface; // one of the file's
    uint32_t count;
    struct import_speck specks[IMPORT_SPECKS_MAX];
};

struct scan {
    struct import_surface surfaces[SOURCES_MAX]; // as the request's sources
    struct import_frame frame;
    int left_out_count;
    struct left_out left_out[SOURCES_MAX];
};

// ---- what is judged -----------------------------------------------------------------------------

static void say_judged(struct import_request *request, const char *what,
                       const struct import_judgement *judged) {
    const char *trust = import_trust_name(judged->trust);
    if (request->as_json)
        json_object_set_new(request->judged, what,
                            json_pack("{s:s, s:s, s:s}", "value", judged->value, "trust", trust,
                                      "why", judged->why));
    else
        printf("%-7s %s, %s%s%s\n", what, judged->value, trust, judged->why[0] ? ": " : "",
               judged->why);
}

static enum result judge_axes(struct import_request *request, struct scan *scan,
                              struct error *err) {
    struct import_judgement judged = {.trust = TRUST_GIVEN};
    enum result result = RESULT_OK;
    if (request->axes)
        snprintf(judged.value, sizeof judged.value, "%s", request->axes);
    else
        result = import_judge_axes(scan->surfaces, request->source_count, &judged, err);
    if (result != RESULT_OK)
        return result;
    import_axes(judged.value, &scan->frame);
    say_judged(request, "axes", &judged);
    return RESULT_OK;
}

// A side that is given stands, unless everything else says that it is the other one.
static enum result judge_side(struct import_request *request, const struct scan *scan,
                              enum side *out_side, struct error *err) {
    struct import_judgement judged;
    enum result result =
        import_judge_side(scan->surfaces, request->source_count, &scan->frame, &judged, err);
    if (result != RESULT_OK && !request->side)
        return result;
    if (result == RESULT_OK && !judged.value[0] && !request->side)
        return fail(err, RESULT_MISSING,
                    "nothing tells the side (both menisci, lcl and mcl, or the fibula would): "
                    "give --side");
    if (result == RESULT_OK && request->side && judged.value[0] &&
        strcmp(request->side, judged.value) != 0)
        return fail(err, RESULT_INVALID,
                    "--side %s: %s; are names swapped, or is the scan mirrored (--axes LAS)?",
                    request->side, judged.why);
    if (request->side) {
        judged = (struct import_judgement){.trust = TRUST_GIVEN};
        snprintf(judged.value, sizeof judged.value, "%s", request->side);
    }
    *out_side = strcmp(judged.value, "left") == 0 ? SIDE_LEFT : SIDE_RIGHT;
    say_judged(request, "side", &judged);
    return RESULT_OK;
}

static enum result judge_unit(struct import_request *request, struct scan *scan,
                              struct error *err) {
    struct import_judgement judged;
    enum result result = import_judge_unit(scan->surfaces, request->source_count, &judged, err);
    if (result == RESULT_OK)
        say_judged(request, "unit", &judged);
    return result;
}

// ---- the joint's centre -------------------------------------------------------------------------

static struct import_source source_of(const struct scan *scan, int i) {
    const struct import_surface *surface = &scan->surfaces[i];
    return (struct import_source){surface->path, surface->mm_per_unit, surface->T_common_file,
                                  &scan->frame};
}

// Of the femur alone, in a case that is thrown away.
static enum result estimate_centre(const struct import_request *request, const struct scan *scan,
                                   vec3 *out_centre, struct error *err) {
    struct knee_case *knee = case_create("scan", "");
    struct case_group *femur = case_add_group(knee, "femur", BODY_FEMUR);
    enum result result = RESULT_OK;
    for (int i = 0; i < request->source_count && result == RESULT_OK; i++) {
        struct import_source source = source_of(scan, i);
        struct mesh mesh;
        struct repair_report repair;
        char part[CASE_NAME_MAX];
        if (strcmp(scan->surfaces[i].group, "femur") != 0)
            continue;
        snprintf(part, sizeof part, "%d", i);
        result = import_make(&source, &scan->surfaces[i].arrays, &mesh, &repair, err);
        if (result == RESULT_OK)
            result = case_add_part(femur, part, &mesh, err);
        mesh_fini(&mesh);
    }
    if (result == RESULT_OK)
        *out_centre = import_estimate_joint(knee).translation;
    case_destroy(&knee);
    return result;
}

static void say_origin(struct import_request *request, const struct import_frame *frame) {
    vec3 origin = vec3_add(frame->vertex, frame->centre);
    const char *from = request->has_joint ? "--joint" : "the middle between the posterior condyles";
    if (request->as_json)
        json_object_set_new(
            request->judged, "origin",
            json_pack("{s:[f,f,f], s:s}", "RAS_mm", origin.x, origin.y, origin.z, "why", from));
    else
        printf("origin  %.3f %.3f %.3f mm of the scan (RAS): %s\n", origin.x, origin.y, origin.z,
               from);
}

static enum result find_frame(struct import_request *request, struct scan *scan,
                              struct knee_case *knee, struct error *err) {
    struct import_frame *frame = &scan->frame;
    const struct import_surface *femur =
        import_main_surface(scan->surfaces, request->source_count, "femur");
    frame->vertex = mat3_apply(frame->R_case_common, import_first_vertex(femur));
    vec3 centre = {0, 0, 0};
    enum result result = RESULT_OK;
    if (request->has_joint)
        centre = import_shift(frame, request->T_femur_joint.translation);
    else
        result = estimate_centre(request, scan, &centre, err);
    if (result != RESULT_OK)
        return result;
    import_set_centre(frame, centre);
    knee->joint.T_femur_joint = pose_identity();
    if (request->has_joint)
        knee->joint.T_femur_joint.rotation = request->T_femur_joint.rotation;
    knee->joint.T_tibia_joint = knee->joint.T_femur_joint; // one frame for all bodies at rest
    knee->has_scan = true;
    knee->T_case_scan = import_frame_pose(frame, &knee->scan_mirrored);
    knee->portal_count = request->portal_count;
    for (int i = 0; i < request->portal_count; i++) {
        knee->portals[i] = request->portals[i];
        knee->portals[i].position = import_shift(frame, request->portals[i].position);
    }
    say_origin(request, frame);
    return RESULT_OK;
}

static void say_speck(struct import_request *request, const struct scan *scan,
                      const struct knee_case *knee, const struct import_surface *surface,
                      const struct import_speck *speck) {
    vec3 mm = vec3_scale(surface->mm_per_unit, speck->centre);
    vec3 p = import_to_case(&scan->frame, pose_apply(surface->T_common_file, mm));
    vec3 in_scan = import_in_scan(knee, p);
    if (request->as_json)
        json_array_append_new(request->specks,
                              json_pack("{s:s, s:I, s:[f,f,f], s:[f,f,f]}", "file", surface->path,
                                        "triangles", (json_int_t)speck->triangles, "centre_mm", p.x,
                                        p.y, p.z, "scan_mm", in_scan.x, in_scan.y, in_scan.z));
    else
        printf("speck   %u triangles at %.1f %.1f %.1f mm; in the scan at %.1f %.1f %.1f\n",
               speck->triangles, p.x, p.y, p.z, in_scan.x, in_scan.y, in_scan.z);
}

static void say_left_out(struct import_request *request, const struct scan *scan,
                         const struct knee_case *knee) {
    json_int_t specks = 0;
    for (int i = 0; i < scan->left_out_count; i++) {
        const struct left_out *left_out = &scan->left_out[i];
        for (uint32_t k = 0; k < left_out->count && k < IMPORT_SPECKS_MAX; k++)
            say_speck(request, scan, knee, &scan->surfaces[left_out->surface],
                      &left_out->specks[k]);
        if (left_out->count > IMPORT_SPECKS_MAX && !request->as_json)
            printf("        and %u more\n", left_out->count - IMPORT_SPECKS_MAX);
        specks += left_out->count;
    }
    if (request->as_json)
        json_object_set_new(request->judged, "speck_count", json_integer(specks));
}

// ---- meshes to groups ---------------------------------------------------------------------------

static enum body body_of(const struct import_request *request, const char *group) {
    for (int i = 0; i < request->body_count; i++)
        if (strcmp(request->bodies[i].group, group) == 0)
            return request->bodies[i].body;
    return import_default_body(group);
}

// The only mesh of a group bears the group's name, others that of their file, or that which was
// proposed for them in it.
static void part_name(const struct import_request *request, const struct surface_source *source,
                      char *out_name) {
    int same = 0;
    for (int i = 0; i < request->source_count; i++)
        same += strcmp(request->sources[i].group, source->group) == 0;
    const char *slash = strrchr(source->path, '/');
    const char *base = slash ? slash + 1 : source->path, *dot = strrchr(base, '.');
    int length = dot ? (int)(dot - base) : (int)strlen(base);
    snprintf(out_name, CASE_NAME_MAX, "%.*s", length, base);
    for (char *c = out_name; *c; c++)
        if (!isalnum((unsigned char)*c) && !strchr("_-.", *c))
            *c = '_';
    if (same == 1 || source->part[0])
        snprintf(out_name, CASE_NAME_MAX, "%s", same == 1 ? source->group : source->part);
}

static void say_mesh(struct import_request *request, const struct import_said *said) {
    if (request->as_json)
        json_array_append_new(request->meshes, import_json(said));
    else
        import_print(said);
}

static enum result clip_mesh(const struct surface_source *from, double distance_mm,
                             struct mesh *mesh, struct clip_report *out_report, struct error *err) {
    enum result result = import_clip(mesh, distance_mm, out_report, err);
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", from->path);
}

static enum result add_mesh(struct import_request *request, struct knee_case *knee,
                            const struct scan *scan, int i, struct error *err) {
    const struct surface_source *from = &request->sources[i];
    struct import_source source = source_of(scan, i);
    struct case_group *group = case_group(knee, from->group);
    if (!group)
        group = case_add_group(knee, from->group, body_of(request, from->group));
    if (!group)
        return fail(err, RESULT_LIMIT, "more than %d groups", CASE_GROUPS_MAX);
    struct mesh mesh;
    struct repair_report repair;
    struct clip_report clip = {0};
    enum result result = import_make(&source, &scan->surfaces[i].arrays, &mesh, &repair, err);
    if (result == RESULT_OK)
        result = clip_mesh(from, request->clip_mm, &mesh, &clip, err);
    if (result != RESULT_OK) {
        mesh_fini(&mesh);
        return fail_in(err, result, "--group %s: ", from->group);
    }
    if (clip.plane_count)
        repair_look(&mesh, &repair);
    char part[CASE_NAME_MAX];
    part_name(request, from, part);
    result = case_add_part(group, part, &mesh, err);
    if (result == RESULT_OK)
        say_mesh(request,
                 &(struct import_said){from->group, from->path, &mesh, &repair, &clip, knee});
    mesh_fini(&mesh);
    return result;
}

// All parts of a bone together.
static enum result check_bones(const struct import_request *request, const struct scan *scan,
                               struct knee_case *knee, struct error *err) {
    static const char *const bones[] = {"tibia", "femur"};
    enum result result = RESULT_OK;
    for (int i = 0; i < 2 && result == RESULT_OK; i++) {
        const struct import_surface *main =
            import_main_surface(scan->surfaces, request->source_count, bones[i]);
        result = import_check_bone(case_group(knee, bones[i]), main->mm_per_unit, err);
        if (result != RESULT_OK)
            fail_in(err, result, "%s: ", main->path);
    }
    return result;
}

static const char *name_of(struct import_request *request, const char *proposed) {
    for (int i = 0; i < request->rename_count; i++) {
        if (strcmp(request->renames[i].from, proposed) != 0)
            continue;
        request->renames[i].used = true;
        return request->renames[i].to;
    }
    return proposed;
}

static enum result check_renames(const struct import_request *request, struct error *err) {
    char names[256] = "";
    for (int i = 0; i < request->source_count; i++)
        if (request->sources[i].part[0])
            snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s",
                     names[0] ? ", " : "", request->sources[i].part);
    for (int i = 0; i < request->rename_count; i++)
        if (!request->renames[i].used)
            return fail(err, RESULT_MISSING, "--rename %s: there is no such part; %s%s",
                        request->renames[i].from, names[0] ? "there are " : "--parts names parts",
                        names);
    return RESULT_OK;
}

// Each part becomes a source of its own; the first one takes the place of the file.
static enum result take_parts(struct import_request *request, struct scan *scan, int i,
                              const struct import_arrays *arrays, struct error *err) {
    struct import_frame frame;
    static struct import_parts parts;
    enum result result = import_split(arrays, &parts, err);
    if (!import_axes(request->axes ? request->axes : arrays->space, &frame)) {
        char letters[4];
        import_guess_axes(&parts, letters);
        import_axes(letters, &frame);
    }
    if (result == RESULT_OK)
        result = import_name_parts(&parts, &frame, request->side, err);
    if (result == RESULT_OK && request->source_count + parts.count - 1 > SOURCES_MAX)
        result = fail(err, RESULT_LIMIT, "more than %d meshes", SOURCES_MAX);
    for (int k = 0; k < parts.count && result == RESULT_OK; k++) {
        int at = k == 0 ? i : request->source_count++;
        request->sources[at] = request->sources[i];
        snprintf(request->sources[at].group, CASE_NAME_MAX, "%s", name_of(request, parts.names[k]));
        snprintf(request->sources[at].part, CASE_NAME_MAX, "%s", parts.names[k]);
        scan->surfaces[at] = scan->surfaces[i];
        scan->surfaces[at].group = request->sources[at].group;
        scan->surfaces[at].arrays = parts.parts[k];
        parts.parts[k] = (struct import_arrays){0};
    }
    if (!request->as_json && result == RESULT_OK)
        printf("parts   %d of %s, named by place and size; left out: %u specks, %u triangles with "
               "a repeated corner\n",
               parts.count, request->sources[i].path, parts.left_out, arrays->dropped);
    struct left_out *left_out = &scan->left_out[scan->left_out_count++];
    *left_out = (struct left_out){.surface = i, .count = parts.left_out};
    memcpy(left_out->specks, parts.specks, sizeof left_out->specks);
    import_parts_fini(&parts);
    return result;
}

static enum result read_surface(struct import_request *request, struct scan *scan, int i,
                                struct error *err) {
    const struct surface_source *source = &request->sources[i];
    struct import_surface *surface = &scan->surfaces[i];
    double mm = source->mm_per_unit > 0 ? source->mm_per_unit : request->first_unit;
    *surface = (struct import_surface){.group = source->group,
                                       .path = source->path,
                                       .mm_per_unit = mm,
                                       .T_common_file = source->T_common_file};
    enum result result = read_surface_apart(source->path, &surface->arrays, err);
    if (result != RESULT_OK)
        return source->several ? fail_in(err, result, "--parts: ")
                               : fail_in(err, result, "--group %s: ", source->group);
    if (!source->several)
        return RESULT_OK;
    struct import_arrays arrays = surface->arrays;
    surface->arrays = (struct import_arrays){0};
    result = take_parts(request, scan, i, &arrays, err);
    import_arrays_fini(&arrays);
    return result == RESULT_OK ? result : fail_in(err, result, "--parts %s: ", source->path);
}

static enum result read_surfaces(struct import_request *request, struct scan *scan,
                                 struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0, files = request->source_count; i < files && result == RESULT_OK; i++)
        result = read_surface(request, scan, i, err);
    return result == RESULT_OK ? check_renames(request, err) : result;
}

enum result import_scan(struct import_request *request, struct knee_case *knee, struct error *err) {
    static struct scan scan;
    scan = (struct scan){0};
    enum result result = read_surfaces(request, &scan, err);
    if (result == RESULT_OK)
        result = judge_unit(request, &scan, err);
    if (result == RESULT_OK)
        result = judge_axes(request, &scan, err);
    if (result == RESULT_OK)
        result = judge_side(request, &scan, &knee->joint.side, err);
    if (result == RESULT_OK)
        result = find_frame(request, &scan, knee, err);
    if (result == RESULT_OK)
        say_left_out(request, &scan, knee);
    for (int i = 0; i < request->source_count && result == RESULT_OK; i++)
        result = add_mesh(request, knee, &scan, i, err);
    if (result == RESULT_OK)
        result = check_bones(request, &scan, knee, err);
    for (int i = 0; i < request->source_count; i++)
        import_arrays_fini(&scan.surfaces[i].arrays);
    return result;
}
