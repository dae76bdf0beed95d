#include "task/site.h"

#include "base/check.h"
#include "mesh/solid.h"

#include <stdlib.h>
#include <string.h>

#define FAR_MM 10.0
#define LINE_STEP_MM 1.0
#define LINE_JUMP_MM 4.0 // a line that leaves its surface

struct site {
    const struct task *task;
    const struct knee_case *knee;
    struct instruments tools;
    struct view_optic optic;
    struct site_goal goals[TASK_GOALS_MAX];
    int error_tool[TASK_ERRORS_MAX]; // -1: any but an optic
    uint32_t error_groups[TASK_ERRORS_MAX];
    uint32_t hiding;                    // groups that hide, a bit each
    struct mesh shown[CASE_GROUPS_MAX]; // of those
    struct sight *sights[BODY_COUNT];
    int tissue[CASE_GROUPS_MAX]; // -1: it cannot be cut
};

// Only while a site is made: the solids of the groups near a landmark, each made once.
struct finder {
    struct site *site;
    struct solid solids[CASE_GROUPS_MAX]; // of a NULL mesh: not made yet
};

_Static_assert(CASE_GROUPS_MAX <= SIGHT_MESHES_MAX, "a bit for each group");

// ---- places -------------------------------------------------------------------------------------

static int group_named(const struct knee_case *knee, const char *name) {
    for (int i = 0; i < knee->group_count; i++)
        if (!strcmp(knee->groups[i].name, name))
            return i;
    return -1;
}

static bool is_touchable(const struct case_group *group, enum body body) {
    return group->body == body && !case_group_is_skin(group);
}

// How far a point is from a group, negative inside; INFINITY where it is far away.
static enum result distance_to(struct finder *finder, int index, vec3 at, double *out_mm,
                               struct error *err) {
    const struct case_group *group = &finder->site->knee->groups[index];
    struct solid *solid = &finder->solids[index];
    uint32_t hint = MESH_NONE;
    struct box box = mesh_bounds(&group->mesh);
    *out_mm = INFINITY;
    if (at.x < box.min.x - FAR_MM || at.x > box.max.x + FAR_MM || at.y < box.min.y - FAR_MM ||
        at.y > box.max.y + FAR_MM || at.z < box.min.z - FAR_MM || at.z > box.max.z + FAR_MM)
        return RESULT_OK;
    enum result result = solid->mesh ? RESULT_OK : solid_init(solid, &group->mesh, err);
    if (result == RESULT_OK)
        *out_mm = solid_distance(solid, at, &hint);
    return result;
}

static vec3 shown_vertex(const struct case_group *group, uint32_t vertex) {
    vec3 p = mesh_vertex(&group->mesh, vertex);
    const float *d = group->warp ? group->warp + 3 * (size_t)vertex : NULL;
    return d ? vec3_add(p, (vec3){(double)d[0], (double)d[1], (double)d[2]}) : p;
}

// The axis, 0 to 5 for +x, -x, +y ..., along which a vector points most.
static int axis_of(vec3 v) {
    double most = fmax(fabs(v.x), fmax(fabs(v.y), fabs(v.z)));
    if (fabs(v.x) == most)
        return v.x < 0;
    return fabs(v.y) == most ? 2 + (v.y < 0) : 4 + (v.z < 0);
}

static void show(const struct case_group *group, struct spot *spot) {
    uint32_t nearest[SITE_SHOWN_MAX];
    double least[SITE_SHOWN_MAX];
    for (int i = 0; i < SITE_SHOWN_MAX; i++)
        least[i] = spot->depth_mm + SITE_SHOWN_MM;
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
        vec3 way = vec3_sub(mesh_vertex(&group->mesh, v), spot->at);
        int axis = axis_of(way);
        if (vec3_length(way) >= least[axis])
            continue;
        least[axis] = vec3_length(way);
        nearest[axis] = v;
    }
    for (int i = 0; i < SITE_SHOWN_MAX; i++)
        if (least[i] < spot->depth_mm + SITE_SHOWN_MM)
            spot->shown[spot->shown_count++] = shown_vertex(group, nearest[i]);
    for (int i = 0; i < spot->shown_count; i++)
        spot->middle = vec3_add_scaled(spot->middle, 1.0 / spot->shown_count, spot->shown[i]);
    for (int i = 0; i < spot->shown_count; i++)
        spot->radius_mm = fmax(spot->radius_mm, vec3_distance(spot->middle, spot->shown[i]));
}

static enum result spot_at(struct finder *finder, enum body body, vec3 at, struct spot *out_spot,
                           struct error *err) {
    const struct knee_case *knee = finder->site->knee;
    double least = INFINITY;
    *out_spot = (struct spot){.body = body, .group = -1, .at = at};
    for (int i = 0; i < knee->group_count; i++) {
        double distance;
        if (!is_touchable(&knee->groups[i], body))
            continue;
        enum result result = distance_to(finder, i, at, &distance, err);
        if (result != RESULT_OK)
            return result;
        if (distance >= least)
            continue;
        least = distance;
        out_spot->group = i;
    }
    if (out_spot->group < 0)
        return fail(err, RESULT_INVALID, "the landmark lies beside all surfaces of the %s",
                    body_name(body));
    out_spot->depth_mm = fabs(least);
    show(&knee->groups[out_spot->group], out_spot);
    return RESULT_OK;
}

static enum result find_spot(struct finder *finder, const char *name, struct spot *out_spot,
                             struct error *err) {
    const struct case_landmark *landmark = case_landmark(finder->site->knee, name);
    if (!landmark)
        return fail(err, RESULT_MISSING, "the case has no landmark %s", name);
    return spot_at(finder, landmark->body, landmark->at, out_spot, err);
}

// ---- lines --------------------------------------------------------------------------------------

static enum result add_piece(struct site_goal *g, const struct query *surface, vec3 from, vec3 to,
                             struct error *err) {
    int count = (int)ceil(vec3_distance(from, to) / LINE_STEP_MM) + 1;
    for (int i = g->line_count ? 1 : 0; i <= count; i++) {
        struct closest c;
        if (g->line_count == SITE_LINE_MAX)
            return fail(err, RESULT_INVALID, "the line is longer than %d mm", SITE_LINE_MAX - 1);
        query_closest(surface, vec3_lerp(from, to, (double)i / count), INFINITY, MESH_NONE, &c);
        if (g->line_count && vec3_distance(g->line[g->line_count - 1], c.point) > LINE_JUMP_MM)
            return fail(err, RESULT_INVALID, "the line leaves the surface near %.1f %.1f %.1f",
                        c.point.x, c.point.y, c.point.z);
        g->line[g->line_count++] = c.point;
    }
    return RESULT_OK;
}

static enum result find_line(struct finder *finder, const struct goal *goal, struct site_goal *g,
                             struct error *err) {
    struct query *surface = NULL;
    enum result result = find_spot(finder, goal->follow[0], &g->touch, err);
    vec3 from = g->touch.at;
    if (result == RESULT_OK)
        result = query_create(&finder->site->knee->groups[g->touch.group].mesh, &surface, err);
    for (int i = 1; i < goal->place_count && result == RESULT_OK; i++) {
        struct spot to;
        result = find_spot(finder, goal->follow[i], &to, err);
        if (result == RESULT_OK && to.body != g->touch.body)
            result = fail(err, RESULT_INVALID, "%s lies on another bone", goal->follow[i]);
        if (result == RESULT_OK)
            result = add_piece(g, surface, from, to.at, err);
        from = to.at;
    }
    query_destroy(&surface);
    return result;
}

// ---- goals and errors ---------------------------------------------------------------------------

static enum result find_tool(const struct site *site, const char *name, int *out_tool,
                             struct error *err) {
    for (*out_tool = 0; *out_tool < site->tools.count; ++*out_tool)
        if (!strcmp(site->tools.of[*out_tool].name, name))
            return RESULT_OK;
    return fail(err, RESULT_MISSING, "no instrument is called %s", name);
}

static enum result find_tissue(const struct site *site, const char *name, int *out_tissue,
                               struct error *err) {
    int group = group_named(site->knee, name);
    if (group < 0 || site->tissue[group] < 0)
        return fail(err, RESULT_MISSING, "the case has no group %s that can be cut", name);
    *out_tissue = site->tissue[group];
    return RESULT_OK;
}

static enum result find_loose(const struct site *site, const char *name, uint32_t *out_loose,
                              struct error *err) {
    int index = case_loose_index(site->knee, name);
    *out_loose = index < 0 ? (1u << site->knee->loose_count) - 1 : 1u << index;
    if (index >= 0 || (!strcmp(name, "all") && site->knee->loose_count))
        return RESULT_OK;
    return fail(err, RESULT_MISSING, "the case has no loose body %s", name);
}

static enum result find_portal(const struct site *site, const char *name, int *out_portal,
                               struct error *err) {
    *out_portal = -1;
    if (!name[0])
        return RESULT_OK;
    for (int i = 0; i < site->knee->portal_count; i++)
        if (!strcmp(site->knee->portals[i].name, name))
            *out_portal = i;
    return *out_portal >= 0 ? RESULT_OK
                            : fail(err, RESULT_MISSING, "the case has no portal %s", name);
}

static enum result find_goal(struct finder *finder, int index, struct error *err) {
    struct site *site = finder->site;
    const struct goal *goal = &site->task->goals[index];
    struct site_goal *g = &site->goals[index];
    enum result result = RESULT_OK;
    g->seen_cosine = cos(RAD_PER_DEG * goal->centre * 0.5 * site->optic.field_deg);
    if (goal->see[0])
        result = find_spot(finder, goal->see, &g->see, err);
    if (result == RESULT_OK && goal->touch[0])
        result = find_spot(finder, goal->touch, &g->touch, err);
    if (result == RESULT_OK && goal->place_count)
        result = find_line(finder, goal, g, err);
    if (result == RESULT_OK && (goal->touch[0] || goal->place_count))
        result = find_tool(site, goal->tool, &g->tool, err);
    if (result == RESULT_OK && goal->resect[0])
        result = find_tissue(site, goal->resect, &g->tissue, err);
    if (result == RESULT_OK && goal->take_out[0])
        result = find_loose(site, goal->take_out, &g->loose, err);
    if (result == RESULT_OK)
        result = find_portal(site, goal->scope_portal, &g->scope_portal, err);
    if (result == RESULT_OK)
        result = find_portal(site, goal->tool_portal, &g->tool_portal, err);
    return result == RESULT_OK ? result : fail_in(err, result, "[goal %s]: ", goal->name);
}

static enum result find_goals(struct site *site, struct error *err) {
    struct finder *finder = alloc(1, sizeof *finder);
    finder->site = site;
    enum result result = RESULT_OK;
    for (int i = 0; i < site->task->goal_count && result == RESULT_OK; i++)
        result = find_goal(finder, i, err);
    for (int i = 0; i < CASE_GROUPS_MAX; i++)
        solid_fini(&finder->solids[i]);
    free(finder);
    return result;
}

// A group that the case does not have makes no error.
static enum result find_error(struct site *site, int index, struct error *err) {
    const struct task_error *error = &site->task->errors[index];
    site->error_tool[index] = -1;
    if (error->group_count == 0)
        site->error_groups[index] = UINT32_MAX;
    for (int i = 0; i < error->group_count; i++) {
        int group = group_named(site->knee, error->groups[i]);
        if (group >= 0)
            site->error_groups[index] |= 1u << group;
    }
    if (!error->tool[0] || find_tool(site, error->tool, &site->error_tool[index], err) == RESULT_OK)
        return RESULT_OK;
    return fail_in(err, RESULT_MISSING, "[error %s]: ", error->name);
}

// ---- what hides ---------------------------------------------------------------------------------

static enum result build_sights(struct site *site, struct error *err) {
    uint32_t of_body[BODY_COUNT] = {0};
    for (int i = 0; i < site->knee->group_count; i++) {
        const struct case_group *group = &site->knee->groups[i];
        if (group->bridges || case_group_is_skin(group))
            continue;
        case_group_virtual(group, &site->shown[i]);
        of_body[group->body] |= 1u << i;
        site->hiding |= 1u << i;
    }
    enum result result = RESULT_OK;
    for (enum body body = 0; body < BODY_COUNT && result == RESULT_OK; body++)
        result = sight_create(site->shown, of_body[body], &site->sights[body], err);
    return result;
}

static uint32_t still_hiding(const struct site *site, uint32_t cut) {
    uint32_t groups = site->hiding;
    for (int i = 0; cut && i < site->knee->group_count; i++)
        if (site->tissue[i] >= 0 && (cut >> site->tissue[i] & 1))
            groups &= ~(1u << i);
    return groups;
}

bool site_sees(const struct site *site, const pose T_mockup_virtual[BODY_COUNT], vec3 from,
               uint32_t cut, vec3 to, struct sight_hint *hint) {
    uint32_t hiding = still_hiding(site, cut);
    enum body first = site->knee->groups[hint->mesh].body;
    for (int i = 0; i < BODY_COUNT; i++) {
        enum body body = (first + i) % BODY_COUNT;
        pose T = T_mockup_virtual[body];
        if (!sight_is_clear(site->sights[body], hiding, pose_apply_inverse(T, from),
                            pose_apply_inverse(T, to), SITE_SPARE_MM, hint))
            return false;
    }
    return true;
}

// ---- the whole ----------------------------------------------------------------------------------

struct view_optic task_optic(const struct task *task) {
    struct view_optic optic = view_optic_usual();
    if (!isnan(task->optic_deg))
        optic.tilt_deg = task->optic_deg;
    return optic;
}

static enum result fits_optic(const struct task *task, const struct view_optic *optic,
                              struct error *err) {
    if (isnan(task->optic_deg) || task->optic_deg == optic->tilt_deg)
        return RESULT_OK;
    return fail(err, RESULT_INVALID, "it needs an optic of %g degrees, and this one has %g",
                task->optic_deg, optic->tilt_deg);
}

enum result site_create(const struct task *task, const struct scene *scene,
                        const struct instruments *tools, const struct view_optic *optic,
                        struct site **out_site, struct error *err) {
    struct site *site = alloc(1, sizeof *site);
    site->task = task;
    site->knee = scene_case(scene);
    site->tools = *tools;
    site->optic = *optic;
    memset(site->tissue, 0xff, sizeof site->tissue);
    for (int i = 0; i < scene_tissue_count(scene); i++)
        site->tissue[scene_tissue_group(scene, i)] = i;
    enum result result = fits_optic(task, optic, err);
    if (result == RESULT_OK)
        result = build_sights(site, err);
    if (result == RESULT_OK)
        result = find_goals(site, err);
    for (int i = 0; i < task->error_count && result == RESULT_OK; i++)
        result = find_error(site, i, err);
    if (result != RESULT_OK)
        site_destroy(&site);
    else
        *out_site = site;
    return result == RESULT_OK ? result : fail_in(err, result, "task %s: ", task->name);
}

void site_destroy(struct site **site) {
    if (!*site)
        return;
    for (enum body body = 0; body < BODY_COUNT; body++)
        sight_destroy(&(*site)->sights[body]);
    for (int i = 0; i < CASE_GROUPS_MAX; i++)
        mesh_fini(&(*site)->shown[i]);
    free(*site);
    *site = NULL;
}

const struct task *site_task(const struct site *site) {
    return site->task;
}

const struct site_goal *site_goal(const struct site *site, int goal) {
    return &site->goals[goal];
}

const struct knee_case *site_case(const struct site *site) {
    return site->knee;
}

const struct instruments *site_tools(const struct site *site) {
    return &site->tools;
}

const struct view_optic *site_optic(const struct site *site) {
    return &site->optic;
}

int site_tissue(const struct site *site, int group) {
    return site->tissue[group];
}

bool site_error_concerns(const struct site *site, int error, int tool) {
    int about = site->error_tool[error];
    return about < 0 ? site->tools.of[tool].kind != INSTRUMENT_OPTIC : about == tool;
}

bool site_error_has_group(const struct site *site, int error, int group) {
    return site->error_groups[error] >> group & 1;
}
