#include "import/judge.h"

#include "mesh/mesh.h"

#include <stdio.h>
#include <string.h>

// The middle one of the sides of the box of a bone that need not end at the knee and may be bowed.
#define WHOLE_BONE_MIN_MM 30
#define WHOLE_BONE_MAX_MM 250
#define FAR_MM 100 // between the boxes of a surface and of the bones
#define NEAR_JOINT_MM 60

const struct import_unit import_units[IMPORT_UNITS] = {{"mm", 1}, {"cm", 10}, {"m", 1000}};

// How long the box of a part of a knee is, in mm.
static const struct kind {
    const char *begins;
    double min, max;
} kinds[] = {{"tibia", 10, 700}, {"femur", 10, 700}, {"meniscus", 15, 100}, {"patella", 15, 250},
             {"acl", 8, 100},    {"pcl", 8, 100},    {"mcl", 10, 250},      {"lcl", 10, 250},
             {"skin", 60, 1200}, {"", 4, 1200}};

const char *import_trust_name(enum import_trust trust) {
    static const char *const names[] = {"given", "sure", "likely", "assumed"};
    return names[trust];
}

const struct import_surface *import_main_surface(const struct import_surface *surfaces, int count,
                                                 const char *group) {
    const struct import_surface *found = NULL;
    for (int i = 0; i < count; i++)
        if (strcmp(surfaces[i].group, group) == 0 &&
            (!found || surfaces[i].arrays.triangle_count > found->arrays.triangle_count))
            found = &surfaces[i];
    return found;
}

static vec3 vertex_at(const struct import_surface *surface, uint32_t vertex, double mm_per_unit) {
    const double *p = surface->arrays.positions + 3 * (size_t)vertex;
    vec3 mm = vec3_scale(mm_per_unit, (vec3){p[0], p[1], p[2]});
    return pose_apply(surface->T_common_file, mm);
}

vec3 import_first_vertex(const struct import_surface *surface) {
    return vertex_at(surface, surface->arrays.triangles[0], surface->mm_per_unit);
}

// Of the vertices in use.
static struct box box_of(const struct import_surface *surface, double mm_per_unit) {
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (size_t i = 0; i < 3 * (size_t)surface->arrays.triangle_count; i++) {
        vec3 p = vertex_at(surface, surface->arrays.triangles[i], mm_per_unit);
        box.min = (vec3){fmin(box.min.x, p.x), fmin(box.min.y, p.y), fmin(box.min.z, p.z)};
        box.max = (vec3){fmax(box.max.x, p.x), fmax(box.max.y, p.y), fmax(box.max.z, p.z)};
    }
    return box;
}

// ---- unit ---------------------------------------------------------------------------------------

static double longest_side(struct box box) {
    vec3 side = vec3_sub(box.max, box.min);
    return fmax(side.x, fmax(side.y, side.z));
}

static double middle_side(struct box box) {
    vec3 side = vec3_sub(box.max, box.min);
    return side.x + side.y + side.z - longest_side(box) - fmin(side.x, fmin(side.y, side.z));
}

static bool bone_fits(double middle_mm) {
    return middle_mm >= WHOLE_BONE_MIN_MM && middle_mm <= WHOLE_BONE_MAX_MM;
}

static enum result find_unit(const struct import_surface *femur, const struct import_surface *tibia,
                             double *out_mm, struct import_judgement *out, struct error *err) {
    double width[2] = {middle_side(box_of(femur, 1)), middle_side(box_of(tibia, 1))};
    for (size_t u = 0; u < IMPORT_UNITS; u++) {
        bool fits = true;
        for (int i = 0; i < 2; i++)
            fits &= bone_fits(width[i] * import_units[u].mm);
        if (!fits)
            continue;
        *out_mm = import_units[u].mm;
        out->trust = TRUST_SURE;
        snprintf(out->value, sizeof out->value, "%s", import_units[u].name);
        snprintf(out->why, sizeof out->why, "femur and tibia are %.3g and %.3g %s wide", width[0],
                 width[1], import_units[u].name);
        return RESULT_OK;
    }
    return fail(err, RESULT_INVALID,
                "femur and tibia are %.3g and %.3g wide: neither mm, cm nor m makes them a knee's; "
                "give --unit before each file",
                width[0], width[1]);
}

static const struct kind *kind_of(const char *group) {
    const struct kind *kind = kinds;
    while (strncmp(group, kind->begins, strlen(kind->begins)) != 0)
        kind++;
    return kind;
}

static const char *unit_for(const struct kind *kind, double length_units, double but_mm) {
    for (size_t u = 0; u < IMPORT_UNITS; u++)
        if (import_units[u].mm != but_mm && length_units * import_units[u].mm >= kind->min &&
            length_units * import_units[u].mm <= kind->max)
            return import_units[u].name;
    return NULL;
}

static double gap(double low_a, double high_a, double low_b, double high_b) {
    return fmax(0, fmax(low_b - high_a, low_a - high_b));
}

static double boxes_apart(struct box a, struct box b) {
    return vec3_length((vec3){gap(a.min.x, a.max.x, b.min.x, b.max.x),
                              gap(a.min.y, a.max.y, b.min.y, b.max.y),
                              gap(a.min.z, a.max.z, b.min.z, b.max.z)});
}

static enum result check_against_bones(const struct import_surface *surface, struct box femur,
                                       struct box tibia, struct error *err) {
    const struct kind *kind = kind_of(surface->group);
    struct box box = box_of(surface, surface->mm_per_unit);
    double length = longest_side(box),
           apart = fmin(boxes_apart(box, femur), boxes_apart(box, tibia));
    if (!(length >= kind->min && length <= kind->max)) {
        const char *unit = unit_for(kind, length / surface->mm_per_unit, surface->mm_per_unit);
        return fail(err, RESULT_INVALID,
                    "%s: %s disagrees with the bones: it is %.3g mm long, not %g to %g mm%s%s%s",
                    surface->path, surface->group, length, kind->min, kind->max,
                    unit ? ". Its unit would be " : "", unit ? unit : "",
                    unit ? ": give --unit before it, and again before the next file" : "");
    }
    if (apart > FAR_MM)
        return fail(err, RESULT_INVALID,
                    "%s: %s disagrees with the bones: it lies %.0f mm from them; has it another "
                    "unit, frame or origin?",
                    surface->path, surface->group, apart);
    return RESULT_OK;
}

static void name_given_unit(const struct import_surface *surfaces, int count,
                            struct import_judgement *out) {
    bool same = true;
    for (int i = 1; i < count; i++)
        same &= surfaces[i].mm_per_unit == surfaces[0].mm_per_unit;
    for (size_t u = 0; u < IMPORT_UNITS; u++)
        if (surfaces[0].mm_per_unit == import_units[u].mm)
            snprintf(out->value, sizeof out->value, "%s", same ? import_units[u].name : "several");
}

enum result import_judge_unit(struct import_surface *surfaces, int count,
                              struct import_judgement *out, struct error *err) {
    const struct import_surface *femur = import_main_surface(surfaces, count, "femur");
    const struct import_surface *tibia = import_main_surface(surfaces, count, "tibia");
    *out = (struct import_judgement){.trust = TRUST_GIVEN};
    if (!femur || !tibia)
        return fail(err, RESULT_MISSING, "there is no group %s", tibia ? "femur" : "tibia");
    double mm = femur->mm_per_unit;
    enum result result = RESULT_OK;
    if (mm > 0)
        name_given_unit(surfaces, count, out);
    else
        result = find_unit(femur, tibia, &mm, out, err);
    if (result != RESULT_OK)
        return result;
    for (int i = 0; i < count; i++)
        if (surfaces[i].mm_per_unit <= 0)
            surfaces[i].mm_per_unit = mm;
    struct box boxes[2] = {box_of(femur, femur->mm_per_unit), box_of(tibia, tibia->mm_per_unit)};
    bool bones_fit = bone_fits(middle_side(boxes[0])) && bone_fits(middle_side(boxes[1]));
    for (int i = 0; i < count && bones_fit && result == RESULT_OK; i++)
        result = check_against_bones(&surfaces[i], boxes[0], boxes[1], err);
    return result;
}

// ---- axes ---------------------------------------------------------------------------------------

static double along(vec3 v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

// The mean of the vertices in use: of those within a distance of the lowest one along `up` where
// that has a length.
static vec3 middle_of(const struct import_surface *surface, vec3 up, double within_mm) {
    double lowest = INFINITY, number = 0;
    vec3 sum = {0, 0, 0}, first = import_first_vertex(surface);
    for (int round = 0; round < 2; round++) {
        for (size_t i = 0; i < 3 * (size_t)surface->arrays.triangle_count; i++) {
            uint32_t vertex = surface->arrays.triangles[i];
            vec3 p = vec3_sub(vertex_at(surface, vertex, surface->mm_per_unit), first);
            double height = vec3_dot(up, p);
            if (round == 0) {
                lowest = fmin(lowest, height);
            } else if (height <= lowest + within_mm) {
                sum = vec3_add(sum, p);
                number++;
            }
        }
    }
    return vec3_add(first, vec3_scale(1 / number, sum));
}

// The axis that a direction is nearest to, as a unit vector, and the cosine between them.
static vec3 nearest_axis(vec3 direction, double *out_cosine) {
    int best = 0;
    for (int axis = 1; axis < 3; axis++)
        if (fabs(along(direction, axis)) > fabs(along(direction, best)))
            best = axis;
    double sign = along(direction, best) < 0 ? -1 : 1;
    *out_cosine = fabs(along(direction, best)) / vec3_length(direction);
    return (vec3){best == 0 ? sign : 0, best == 1 ? sign : 0, best == 2 ? sign : 0};
}

static void spell_axes(vec3 right, vec3 front, vec3 up, char out[4]) {
    for (int axis = 0; axis < 3; axis++)
        out[axis] = along(right, axis) > 0   ? 'R'
                    : along(right, axis) < 0 ? 'L'
                    : along(front, axis) > 0 ? 'A'
                    : along(front, axis) < 0 ? 'P'
                    : along(up, axis) > 0    ? 'S'
                                             : 'I';
    out[3] = '\0';
}

// False where the knee does not tell.
static bool axes_of_knee(const struct import_surface *surfaces, int count,
                         struct import_judgement *out) {
    const struct import_surface *femur = import_main_surface(surfaces, count, "femur");
    const struct import_surface *tibia = import_main_surface(surfaces, count, "tibia");
    const struct import_surface *patella = import_main_surface(surfaces, count, "patella");
    if (!femur || !tibia || !patella)
        return false;
    double up_cosine, front_cosine;
    vec3 all = {0, 0, 0};
    vec3 up =
        nearest_axis(vec3_sub(middle_of(femur, all, 0), middle_of(tibia, all, 0)), &up_cosine);
    vec3 forward = vec3_sub(middle_of(patella, all, 0), middle_of(femur, up, NEAR_JOINT_MM));
    forward = vec3_add_scaled(forward, -vec3_dot(forward, up), up);
    vec3 front = nearest_axis(forward, &front_cosine);
    if (!(up_cosine > 0.75 && front_cosine > 0.75))
        return false;
    spell_axes(vec3_cross(front, up), front, up, out->value);
    out->trust = fmin(up_cosine, front_cosine) > 0.85 ? TRUST_SURE : TRUST_LIKELY;
    snprintf(out->why, sizeof out->why,
             "the femur lies above the tibia, %.0f degrees off an axis; the patella before the "
             "femur, %.0f degrees off",
             acos(fmin(1, up_cosine)) * 180 / M_PI, acos(fmin(1, front_cosine)) * 180 / M_PI);
    return true;
}

// What the files declare, all the same: NULL where none does.
static enum result declared_axes(const struct import_surface *surfaces, int count,
                                 const char **out_letters, struct error *err) {
    struct import_frame frame;
    const struct import_surface *first = NULL;
    *out_letters = NULL;
    for (int i = 0; i < count; i++) {
        const char *letters = surfaces[i].arrays.space;
        if (!import_axes(letters, &frame))
            continue;
        if (first && strcmp(letters, first->arrays.space) != 0)
            return fail(err, RESULT_INVALID, "%s declares %s, %s %s: give --axes", first->path,
                        first->arrays.space, surfaces[i].path, letters);
        first = &surfaces[i];
        *out_letters = letters;
    }
    return RESULT_OK;
}

enum result import_judge_axes(const struct import_surface *surfaces, int count,
                              struct import_judgement *out, struct error *err) {
    const char *declared;
    *out = (struct import_judgement){.trust = TRUST_ASSUMED, .value = "RAS"};
    if (declared_axes(surfaces, count, &declared, err) != RESULT_OK)
        return RESULT_INVALID;
    bool judged = axes_of_knee(surfaces, count, out);
    if (judged && declared && strcmp(out->value, declared) != 0)
        return fail(err, RESULT_INVALID,
                    "the files declare the axes %s, the knee lies as in %s: give --axes", declared,
                    out->value);
    if (judged)
        return RESULT_OK;
    snprintf(out->value, sizeof out->value, "%s", declared ? declared : "RAS");
    out->trust = declared ? TRUST_SURE : TRUST_ASSUMED;
    snprintf(out->why, sizeof out->why, "%s",
             declared ? "the files declare them"
                      : "no patella shows the front, or the knee lies aslant");
    return RESULT_OK;
}

// ---- side ---------------------------------------------------------------------------------------

static bool right_of(const struct import_surface *surfaces, int count,
                     const struct import_frame *frame, const char *group, double *out_mm) {
    const struct import_surface *surface = import_main_surface(surfaces, count, group);
    if (surface)
        *out_mm = mat3_apply(frame->R_case_common, middle_of(surface, (vec3){0, 0, 0}, 0)).x;
    return surface != NULL;
}

enum result import_judge_side(const struct import_surface *surfaces, int count,
                              const struct import_frame *frame, struct import_judgement *out,
                              struct error *err) {
    static const struct {
        const char *lateral, *medial, *tells; // tells: of which the place shows the side
    } pairs[] = {{"meniscus_lateral", "meniscus_medial", "meniscus_lateral"},
                 {"lcl", "mcl", "lcl"},
                 {"fibula", "tibia", "fibula"},
                 {"lcl", "tibia", "lcl"},
                 {"tibia", "mcl", "mcl"}};
    const char *by[2] = {NULL, NULL}; // a left, a right knee, by what
    int votes[2] = {0, 0};
    *out = (struct import_judgement){.trust = TRUST_ASSUMED};
    for (size_t i = 0; i < sizeof pairs / sizeof pairs[0]; i++) {
        double lateral, medial;
        if (!right_of(surfaces, count, frame, pairs[i].lateral, &lateral) ||
            !right_of(surfaces, count, frame, pairs[i].medial, &medial) || lateral == medial)
            continue;
        bool right = lateral > medial;
        votes[right]++;
        if (!by[right])
            by[right] = pairs[i].tells;
    }
    if (votes[0] && votes[1])
        return fail(err, RESULT_INVALID,
                    "%s lies as in a left knee, %s as in a right one: are names swapped? give "
                    "--side",
                    by[0], by[1]);
    bool right = votes[1] > 0;
    if (!votes[right])
        return RESULT_OK;
    out->trust = votes[right] > 1 ? TRUST_SURE : TRUST_LIKELY;
    snprintf(out->value, sizeof out->value, "%s", right ? "right" : "left");
    snprintf(out->why, sizeof out->why, "%s lies on the side of a %s knee; %d of such pairs agree",
             by[right], out->value, votes[right]);
    return RESULT_OK;
}
