#include "generate/add_loose.h"

#include "base/number.h"
#include "generate/loose_places.h"
#include "mesh/query.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double at_most = 100, surface_most = 10;

void add_loose_init(struct add_loose *step) {
    *step = (struct add_loose){.body = BODY_COUNT, .radii_mm = {3.5, 3, 2}};
}

// ---- words --------------------------------------------------------------------------------------

static bool take_vector(const char *value, vec3 *out) {
    double v[3];
    if (number_list(value, 3, v) != 3)
        return false;
    *out = (vec3){v[0], v[1], v[2]};
    return true;
}

static enum result take_loose_place(struct add_loose *step, const char *value, struct error *err) {
    step->has_at = true;
    step->landmark[0] = '\0';
    if (case_name_is_valid(value) && !strchr("-.0123456789", value[0]))
        strcpy(step->landmark, value);
    else if (!take_vector(value, &step->at) || !(vec3_length(step->at) <= at_most))
        return fail(err, RESULT_INVALID,
                    "at: must be a landmark, or three numbers, x y z, within 100 mm of the origin");
    return RESULT_OK;
}

static bool is_radius(double mm) {
    return mm >= CASE_LOOSE_RADIUS_LEAST_MM && mm <= CASE_LOOSE_RADIUS_MOST_MM;
}

enum result add_loose_take(struct add_loose *step, const char *key, const char *value,
                           struct error *err) {
    int64_t count;
    if (strcmp(key, "body") == 0)
        return body_from_name(value, &step->body) && step->body != BODY_PATELLA
                   ? RESULT_OK
                   : fail(err, RESULT_INVALID, "body: must be femur or tibia");
    if (strcmp(key, "at") == 0)
        return take_loose_place(step, value, err);
    if (strcmp(key, "radii_mm") == 0)
        return take_vector(value, &step->radii_mm) && is_radius(step->radii_mm.x) &&
                       is_radius(step->radii_mm.y) && is_radius(step->radii_mm.z)
                   ? RESULT_OK
                   : fail(err, RESULT_INVALID, "radii_mm: must be three numbers from %g to %g",
                          CASE_LOOSE_RADIUS_LEAST_MM, CASE_LOOSE_RADIUS_MOST_MM);
    if (strcmp(key, "count") != 0)
        return fail(err, RESULT_INVALID, "%s: unknown key", key);
    if (!number_int(value, 1, CASE_LOOSE_MAX, &count))
        return fail(err, RESULT_INVALID, "count: must be a number from 1 to %d", CASE_LOOSE_MAX);
    step->count = (int)count;
    return RESULT_OK;
}

enum result add_loose_check(const struct add_loose *step, struct error *err) {
    bool has_place = step->has_at && step->body != BODY_COUNT;
    bool has_none = !step->has_at && step->body == BODY_COUNT;
    if (step->count ? has_none : has_place)
        return RESULT_OK;
    return fail(err, RESULT_MISSING, "needs either count, or body and at");
}

// ---- the step -----------------------------------------------------------------------------------

// In the frame of the body.
static enum result place_of_loose(const struct knee_case *knee, const struct add_loose *step,
                                  vec3 *out_at, struct error *err) {
    const struct case_landmark *landmark = case_landmark(knee, step->landmark);
    vec3 at = step->at;
    if (knee->joint.side == SIDE_LEFT)
        at.x = -at.x;
    *out_at = pose_apply(
        step->body == BODY_TIBIA ? knee->joint.T_tibia_joint : knee->joint.T_femur_joint, at);
    if (!step->landmark[0])
        return RESULT_OK;
    if (!landmark || landmark->body != step->body)
        return fail(err, RESULT_MISSING, "the %s of the case has no landmark %s",
                    body_name(step->body), step->landmark);
    *out_at = landmark->at;
    return RESULT_OK;
}

// On the bone's surface as the patient has it.
static enum result on_surface(struct knee_case *knee, enum body body, vec3 *in_out_at,
                              struct error *err) {
    const struct case_group *bone = case_group(knee, body_name(body));
    struct mesh mesh;
    struct query *query = NULL;
    struct closest closest;
    if (!bone)
        return fail(err, RESULT_MISSING, "the case has no group %s", body_name(body));
    case_group_virtual(bone, &mesh);
    enum result result = query_create(&mesh, &query, err);
    if (result == RESULT_OK && !query_closest(query, *in_out_at, surface_most, MESH_NONE, &closest))
        result = fail(err, RESULT_INVALID, "no surface of the %s lies within %g mm of the place",
                      body_name(body), surface_most);
    if (result == RESULT_OK)
        *in_out_at = closest.point;
    query_destroy(&query);
    mesh_fini(&mesh);
    return result;
}

static enum result add_body(struct knee_case *knee, const char *name, enum body body, vec3 at,
                            vec3 radii_mm, struct error *err) {
    if (!case_name_is_valid(name))
        return fail(err, RESULT_INVALID, "'%s' is no name of letters, digits and \"_-.\"", name);
    if (case_loose_index(knee, name) >= 0)
        return fail(err, RESULT_INVALID, "the case has a loose body %s already", name);
    if (knee->loose_count == CASE_LOOSE_MAX)
        return fail(err, RESULT_LIMIT, "a case has at most %d loose bodies", CASE_LOOSE_MAX);
    struct case_loose *loose = &knee->loose[knee->loose_count++];
    *loose = (struct case_loose){.body = body, .at = at, .radii_mm = radii_mm};
    strcpy(loose->name, name);
    return RESULT_OK;
}

static enum result add_some(struct knee_case *knee, const char *name, const struct add_loose *step,
                            struct error *err) {
    struct loose_place places[CASE_LOOSE_MAX];
    enum result result = loose_places_find(knee, step->radii_mm, step->count, places, err);
    for (int i = 0; i < step->count && result == RESULT_OK; i++) {
        char numbered[CASE_NAME_MAX + 8];
        snprintf(numbered, sizeof numbered, "%s_%d", name, i + 1);
        result = add_body(knee, numbered, places[i].body, places[i].at, step->radii_mm, err);
    }
    return result;
}

enum result add_loose_apply(struct knee_case *knee, const char *name, const struct add_loose *step,
                            struct error *err) {
    vec3 at;
    if (step->count)
        return add_some(knee, name, step, err);
    enum result result = place_of_loose(knee, step, &at, err);
    if (result == RESULT_OK)
        result = on_surface(knee, step->body, &at, err);
    return result == RESULT_OK ? add_body(knee, name, step->body, at, step->radii_mm, err) : result;
}
