// Fig. 7: a hook goes over an arthrosis along a straight line, with the bones of the paper's
// Fig. 4.
#include "base/check.h"
#include "base/clock.h"
#include "motion/joint.h"
#include "paper.h"
#include "report/render.h"
#include "report/rods.h"
#include "samples.h"
#include "scene/probe.h"
#include "warp/avatar.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RECIPE "arthrosis"
#define FLEXION_DEG 20.0
#define VALGUS_DEG 8.0 // opens the medial side for the hook
#define LINE_X -19.0   // through the middle of the cavity, from the back to the front
#define LINE_FROM_Y -21.0
#define LINE_TO_Y 20.0
#define ABOVE_MM 1.0
#define STEP_MM 0.1
#define POSE_COUNT 411
#define HOOK_POINTS 8 // of a whole hook: seven along 49 mm of its shaft
#define HOOK_SPACING_MM 7.0
#define TIMED_ROUNDS 100
#define TIMED_ROUNDS_QUICK 10

static const struct variant {
    const char *name, *label, *key;
    enum field_kind kind;
    double skin_mm;
    enum plot_colour colour;
    enum plot_style style;
} variants[] = {
    {"warped, gaussian in cm (the paper's)", "gaussian", "gaussian, cm", FIELD_GAUSSIAN, 0,
     PLOT_ORANGE, PLOT_SOLID},
    {"warped, integral", "integral", "integral", FIELD_INTEGRAL, 0.1, PLOT_BLUE, PLOT_SOLID},
};

#define VARIANT_COUNT (sizeof variants / sizeof variants[0])
#define SESSIONS_VARIANT 1

struct way {
    double y[POSE_COUNT], height[POSE_COUNT]; // above the plateau's mean, in the tibia's frame
    struct samples gap_off_mm, us;            // its gap to S' less the straight one's to S
    double lowest_mm, steepest;
};

struct fig7 {
    struct knee_case *knee;
    struct query *queries[CASE_GROUPS_MAX];
    struct surface_blocks *blocks[CASE_GROUPS_MAX];
    struct surface_integral *integrals[CASE_GROUPS_MAX];
    struct warp_surface all[CASE_GROUPS_MAX], bones[BODY_COUNT];
    int bone_count;
    pose T_world_body[BODY_COUNT];
    const struct case_group *tibia;
    struct mesh virtual; // the tibia's S'
    struct query *virtual_query;
    double plateau_z;                                                // mean along the line
    double y[POSE_COUNT], physical[POSE_COUNT], patient[POSE_COUNT]; // profiles
    struct way straight, ways[VARIANT_COUNT];
    struct samples whole_us; // of a whole hook, in the sessions' field
};

// ---- the knee ----

static enum result add_surfaces(struct fig7 *fig, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; result == RESULT_OK && i < fig->knee->group_count; i++) {
        const struct case_group *group = &fig->knee->groups[i];
        result = query_create(&group->mesh, &fig->queries[i], err);
        fig->blocks[i] = surface_blocks_create(&group->mesh);
        fig->integrals[i] = surface_integral_create(fig->blocks[i], group->warp);
        fig->all[i] = (struct warp_surface){.mesh = &group->mesh,
                                            .query = fig->queries[i],
                                            .displacement = group->warp,
                                            .body = (int)group->body,
                                            .integral = fig->integrals[i],
                                            .gives_way = case_group_is_skin(group)};
        if (!strcmp(group->name, body_name(group->body)))
            fig->bones[fig->bone_count++] = fig->all[i];
    }
    return result;
}

static enum result open_joint(struct fig7 *fig, struct error *err) {
    struct solid femur = {0}, tibia = {0};
    enum result result = solid_init(&femur, &case_group(fig->knee, "femur")->mesh, err);
    if (result == RESULT_OK)
        result = solid_init(&tibia, &fig->tibia->mesh, err);
    if (result == RESULT_OK) {
        struct joint_hold hold = {.flexion_deg = FLEXION_DEG, .valgus_deg = VALGUS_DEG};
        struct joint_angles angles = motion_joint(fig->knee, &femur, &tibia, &hold);
        fig->T_world_body[BODY_FEMUR] = pose_identity();
        fig->T_world_body[BODY_TIBIA] = joint_to_pose(&fig->knee->joint, &angles);
        fig->T_world_body[BODY_PATELLA] = case_patella_pose(fig->knee, FLEXION_DEG);
    }
    solid_fini(&tibia);
    solid_fini(&femur);
    return result;
}

// The highest point of the surface above (x, y); NaN where there is none.
static double height_at(const struct mesh *mesh, double x, double y) {
    double highest = NAN;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0);
        vec3 ab = vec3_sub(mesh_corner(mesh, t, 1), a), ac = vec3_sub(mesh_corner(mesh, t, 2), a);
        double area = ab.x * ac.y - ab.y * ac.x;
        double u = ((x - a.x) * ac.y - (y - a.y) * ac.x) / area;
        double v = (ab.x * (y - a.y) - ab.y * (x - a.x)) / area;
        if (u >= 0 && v >= 0 && u + v <= 1)
            highest = fmax(highest, a.z + u * ab.z + v * ac.z);
    }
    return highest;
}

static void take_profiles(struct fig7 *fig) {
    for (int i = 0; i < POSE_COUNT; i++) {
        fig->y[i] = LINE_FROM_Y + STEP_MM * i;
        fig->physical[i] = height_at(&fig->tibia->mesh, LINE_X, fig->y[i]);
        fig->patient[i] = height_at(&fig->virtual, LINE_X, fig->y[i]);
        fig->plateau_z += fig->physical[i] / POSE_COUNT;
    }
    for (int i = 0; i < POSE_COUNT; i++) {
        fig->physical[i] -= fig->plateau_z;
        fig->patient[i] -= fig->plateau_z;
    }
}

static enum result make_knee(struct fig7 *fig, struct error *err) {
    enum result result = paper_knee(RECIPE, &fig->knee, err);
    if (result != RESULT_OK)
        return result;
    fig->tibia = case_group(fig->knee, "tibia");
    case_group_virtual(fig->tibia, &fig->virtual);
    result = query_create(&fig->virtual, &fig->virtual_query, err);
    if (result == RESULT_OK)
        result = add_surfaces(fig, err);
    if (result == RESULT_OK)
        result = open_joint(fig, err);
    if (result == RESULT_OK)
        take_profiles(fig);
    return result;
}

// ---- the ways ----

static vec3 on_line(const struct fig7 *fig, int i) {
    return (vec3){LINE_X, fig->y[i], fig->plateau_z + ABOVE_MM};
}

static struct field field_of(const struct variant *variant) {
    struct field field = field_default(variant->kind);
    field.skin_mm = variant->skin_mm;
    return field;
}

static double distance_to(const struct query *query, vec3 p) {
    struct closest closest;
    query_closest(query, p, INFINITY, MESH_NONE, &closest);
    return closest.distance;
}

// In the tibia's frame.
static void add_pose(struct fig7 *fig, struct way *way, int i, vec3 p) {
    const struct query *physical = fig->queries[fig->tibia - fig->knee->groups];
    double gap = distance_to(physical, on_line(fig, i));
    way->y[i] = p.y;
    way->height[i] = p.z - fig->plateau_z;
    way->lowest_mm = fmin(way->lowest_mm, way->height[i]);
    samples_add(&way->gap_off_mm, fabs(distance_to(fig->virtual_query, p) - gap));
}

static void take_way(struct fig7 *fig, const struct variant *variant, struct way *way) {
    struct warp_scene scene = {fig->bones, fig->bone_count, fig->T_world_body, NULL};
    struct field field = field_of(variant);
    pose B = fig->T_world_body[BODY_TIBIA];
    vec3 before = {0};
    struct warp_memory memory;
    warp_memory_init(&memory);
    for (int i = 0; i < POSE_COUNT; i++) {
        struct warp warp;
        vec3 y = pose_apply(B, on_line(fig, i));
        warp_point(&scene, &field, y, &memory, &warp);
        add_pose(fig, way, i, pose_apply_inverse(B, vec3_add(y, warp.displacement)));
        double change = vec3_distance(warp.displacement, before) / STEP_MM;
        way->steepest = i ? fmax(way->steepest, change) : 0;
        before = warp.displacement;
    }
}

// Beside all groups of the case, as in a session.
static void time_way(const struct fig7 *fig, const struct variant *variant, int rounds,
                     struct way *way) {
    struct warp_scene scene = {fig->all, fig->knee->group_count, fig->T_world_body, NULL};
    struct field field = field_of(variant);
    struct warp_memory memory;
    warp_memory_init(&memory);
    for (int round = -1; round < rounds; round++) // the first one warms up
        for (int i = 0; i < POSE_COUNT; i++) {
            struct warp warp;
            vec3 y = pose_apply(fig->T_world_body[BODY_TIBIA], on_line(fig, i));
            int64_t start = clock_now_ns();
            warp_point(&scene, &field, y, &memory, &warp);
            int64_t end = clock_now_ns();
            if (round >= 0)
                samples_add(&way->us, 1e-3 * (double)(end - start));
        }
}

// The hook turned about its portal, so that it touches with its shaft, too (section 6).
static void time_whole(struct fig7 *fig, int rounds) {
    struct warp_scene scene = {fig->all, fig->knee->group_count, fig->T_world_body, NULL};
    struct field field = field_of(&variants[SESSIONS_VARIANT]);
    vec3 portal = fig->knee->portals[0].position;
    struct avatar_point points[HOOK_POINTS] = {0};
    struct avatar_body body = {AVATAR_RIGID, points, HOOK_POINTS};
    struct avatar_memory memory;
    for (int i = 0; i < HOOK_POINTS; i++)
        points[i].at.z = -HOOK_SPACING_MM * i;
    avatar_memory_init(&memory);
    for (int round = -1; round < rounds; round++)
        for (int i = 0; i < POSE_COUNT; i++) {
            struct avatar avatar;
            vec3 tip = pose_apply(fig->T_world_body[BODY_TIBIA], on_line(fig, i));
            vec3 way = vec3_sub(tip, portal);
            pose T_world_tip = probe_aim(portal, way, vec3_length(way));
            int64_t start = clock_now_ns();
            avatar_warp(&scene, &field, &body, portal, T_world_tip, &memory, &avatar);
            int64_t end = clock_now_ns();
            if (round >= 0)
                samples_add(&fig->whole_us, 1e-3 * (double)(end - start));
        }
}

static void measure(struct fig7 *fig, int rounds) {
    for (int i = 0; i < POSE_COUNT; i++)
        add_pose(fig, &fig->straight, i, on_line(fig, i));
    for (size_t k = 0; k < VARIANT_COUNT; k++) {
        take_way(fig, &variants[k], &fig->ways[k]);
        time_way(fig, &variants[k], rounds, &fig->ways[k]);
    }
    time_whole(fig, rounds);
}

// ---- figures ----

// Of the cavity under the line.
static double depth_mm(const struct fig7 *fig) {
    double depth = 0;
    for (int i = 0; i < POSE_COUNT; i++)
        depth = fmax(depth, fig->physical[i] - fig->patient[i]);
    return depth;
}

static void range_of(const double *values, double *out_min, double *out_max) {
    *out_min = INFINITY;
    *out_max = -INFINITY;
    for (int i = 0; i < POSE_COUNT; i++) {
        *out_min = fmin(*out_min, values[i]);
        *out_max = fmax(*out_max, values[i]);
    }
}

static void report_all(struct fig7 *fig, struct report *report, struct paper_page *page) {
    double low, high;
    range_of(fig->physical, &low, &high);
    report_figure(report, depth_mm(fig), "mm", "fig 7/cavity/depth");
    report_figure(report, ABOVE_MM - high, "mm", "fig 7/line above the plateau/least");
    report_figure(report, ABOVE_MM - low, "mm", "fig 7/line above the plateau/most");
    report_figure(report, samples_max(&fig->straight.gap_off_mm), "mm",
                  "fig 7/without a warp/gap off/max");
    report_figure(report, 3, "mm", "fig 7/cavity/depth/paper");
    report_figure(report, 1, "mm", "fig 7/line above the plateau/paper");
    report_figure(report, 100, "us", "fig 7/warp/mean/paper");
    paper_rows(page, "Fig. 7: a hook over a cavity");
    paper_row(page, "Depth of the cavity", "about 3 mm", "%.2f mm", depth_mm(fig));
    paper_row(page, "Height of the straight line above the plateau", "about 1 mm",
              "%.2f to %.2f mm", ABOVE_MM - high, ABOVE_MM - low);
    paper_row(page, "Error of the gap to what is touched, without a warp", "not told",
              "at most %.2f mm", samples_max(&fig->straight.gap_off_mm));
    for (size_t k = 0; k < VARIANT_COUNT; k++) {
        struct way *way = &fig->ways[k];
        const char *key = variants[k].key;
        double down = ABOVE_MM - way->lowest_mm, off = samples_max(&way->gap_off_mm);
        report_figure(report, down, "mm", "fig 7/%s/down", key);
        report_figure(report, samples_mean(&way->gap_off_mm), "mm", "fig 7/%s/gap off/mean", key);
        report_figure(report, off, "mm", "fig 7/%s/gap off/max", key);
        report_figure(report, way->steepest, "times", "fig 7/%s/steepest", key);
        report_figure(report, samples_mean(&way->us), "us", "fig 7/%s/warp/mean", key);
        report_figure(report, samples_quantile(&way->us, 0.5), "us", "fig 7/%s/warp/median", key);
        report_figure(report, samples_quantile(&way->us, 0.99), "us", "fig 7/%s/warp/p99", key);
    }
    report_figure(report, samples_mean(&fig->whole_us), "us", "fig 7/whole hook/warp/mean");
    report_figure(report, samples_quantile(&fig->whole_us, 0.5), "us",
                  "fig 7/whole hook/warp/median");
}

static void write_time(struct paper_page *page, const char *what, struct samples *us) {
    char text[128];
    snprintf(text, sizeof text, "Warp of one pose of %s, mean and median", what);
    paper_row(page, text, "0.1 ms, a mean", "%.4f ms, %.4f ms", samples_mean(us) / 1000,
              samples_quantile(us, 0.5) / 1000);
}

static void write_rows(struct fig7 *fig, struct paper_page *page) {
    for (size_t k = 0; k < VARIANT_COUNT; k++) {
        struct way *way = &fig->ways[k];
        char what[128];
        snprintf(what, sizeof what, "Way %s: how far down, error of the gap", variants[k].name);
        paper_row(page, what, "a picture", "%.2f mm, at most %.2f mm", ABOVE_MM - way->lowest_mm,
                  samples_max(&way->gap_off_mm));
    }
    for (size_t k = 0; k < VARIANT_COUNT; k++) {
        char what[64];
        snprintf(what, sizeof what, "the hook’s tip, %s", variants[k].label);
        write_time(page, what, &fig->ways[k].us);
    }
    write_time(page, "the whole hook in its portal, integral", &fig->whole_us);
}

// ---- the picture ----

static void rods(const struct fig7 *fig, const struct way *way, struct mesh *out_mesh) {
    struct rod lines[POSE_COUNT - 1];
    for (int i = 0; i + 1 < POSE_COUNT; i++)
        lines[i] = (struct rod){{LINE_X, way->y[i], fig->plateau_z + way->height[i]},
                                {LINE_X, way->y[i + 1], fig->plateau_z + way->height[i + 1]}};
    rods_mesh(lines, POSE_COUNT - 1, 0.25, out_mesh);
}

// The medial plateau as it is, or as the patient's, with the ways over it.
static enum result draw(const struct fig7 *fig, bool patient, struct picture *out_picture,
                        struct error *err) {
    const struct colour bone = {0.94, 0.89, 0.77}, green = {0, 0.6, 0.35}, red = {0.84, 0.25, 0};
    struct mesh straight, warped;
    rods(fig, &fig->straight, &straight);
    rods(fig, &fig->ways[SESSIONS_VARIANT], &warped);
    pose at = pose_identity();
    const struct render_surface surfaces[] = {
        {.mesh = patient ? &fig->virtual : &fig->tibia->mesh,
         .T_world_mesh = at,
         .crease_deg = 40,
         .opacity = 1,
         .colour = bone},
        {.mesh = &straight, .T_world_mesh = at, .crease_deg = 90, .opacity = 1, .colour = green},
        {.mesh = &warped, .T_world_mesh = at, .crease_deg = 90, .opacity = 1, .colour = red},
    };
    struct box box = {{-40, -25, -25}, {2, 26, -18}};
    struct render_scene scene = {surfaces,
                                 patient ? 3 : 2,
                                 camera_fit(&box, (vec3){-1, 0.75, 0.75}, (vec3){0, 0, 1}, 1.6, 5),
                                 {1, 1, 1}};
    enum result result = render(&scene, 480, 300, out_picture, err);
    mesh_fini(&straight);
    mesh_fini(&warped);
    return result;
}

static enum result write_picture(const struct fig7 *fig, struct paper_page *page, bool patient,
                                 struct error *err) {
    struct picture picture = {0};
    enum result result = draw(fig, patient, &picture, err);
    if (result == RESULT_OK)
        result = paper_picture(
            page, patient ? "fig7-warped" : "fig7-straight", &picture,
            "The medial plateau of the tibia, with the way of the hook's tip",
            patient
                ? "What the trainee sees: the patient's plateau, and the way that the warp makes "
                  "(red; integral) of the straight one (green)"
                : "What the hand does: the mock-up's plateau, and a straight line above it",
            err);
    picture_fini(&picture);
    return result;
}

// ---- the section ----

static enum result write_plot(const struct fig7 *fig, struct paper_page *page, struct error *err) {
    struct plot_line lines[3 + VARIANT_COUNT] = {
        {"mock-up’s plateau", "mock-up", fig->y, fig->physical, POSE_COUNT, PLOT_GREY, PLOT_SOLID},
        {"patient’s plateau", "patient", fig->y, fig->patient, POSE_COUNT, PLOT_INK, PLOT_SOLID},
        {"without a warp", "straight", fig->straight.y, fig->straight.height, POSE_COUNT,
         PLOT_GREEN, PLOT_DASHED},
    };
    for (size_t k = 0; k < VARIANT_COUNT; k++)
        lines[3 + k] = (struct plot_line){
            variants[k].name, variants[k].label,  fig->ways[k].y,   fig->ways[k].height,
            POSE_COUNT,       variants[k].colour, variants[k].style};
    struct plot plot = {
        .title = "Fig. 7: a straight line over an arthrosis of 3 mm",
        .description = "Height of the hook's tip over its way from the back to the front of the "
                       "medial plateau. Without a warp it stays level; with one it follows the "
                       "patient's cavity.",
        .width = 640,
        .height = 440,
        .x = {"from the back to the front of the plateau, mm", LINE_FROM_Y, LINE_TO_Y},
        .y = {.title = "height above the plateau’s mean, mm"},
        .lines = lines,
        .line_count = 3 + VARIANT_COUNT,
    };
    return paper_plot(page, "fig7-path", &plot,
                      "Height of the hook's tip along its way, in the tibia's frame", err);
}

static enum result write_section(const struct fig7 *fig, struct paper_page *page,
                                 struct error *err) {
    FILE *file = page->sections;
    fprintf(file,
            "<h2>Fig. 7: differing bones</h2>\n<p>The tip of a hook moves on a straight line 1 mm "
            "above the mean of the medial plateau, beside tibia, femur and patella. The patient's "
            "plateau has a cavity of 3 mm. The joint is bent by %g degrees and opened by %g, so "
            "that the hook has room.</p>\n<div class=\"row\">\n",
            FLEXION_DEG, VALGUS_DEG);
    enum result result = write_picture(fig, page, false, err);
    if (result == RESULT_OK)
        result = write_picture(fig, page, true, err);
    fputs("</div>\n", file);
    if (result == RESULT_OK)
        result = write_plot(fig, page, err);
    fputs("<table>\n<tr><th>field</th><th class=\"n\">down, mm</th><th class=\"n\">error of the "
          "gap, mean, mm</th><th class=\"n\">most, mm</th><th class=\"n\">steepest</th></tr>\n",
          file);
    for (size_t k = 0; k < VARIANT_COUNT; k++)
        fprintf(file,
                "<tr><th>%s</th><td class=\"n\">%.2f</td><td class=\"n\">%.3f</td>"
                "<td class=\"n\">%.3f</td><td class=\"n\">%.2f</td></tr>\n",
                variants[k].key, ABOVE_MM - fig->ways[k].lowest_mm,
                samples_mean(&fig->ways[k].gap_off_mm), samples_max(&fig->ways[k].gap_off_mm),
                fig->ways[k].steepest);
    fputs("</table>\n<p>Down: of the straight line, at the lowest place. Error of the gap: of the "
          "warped tip to the patient's plateau, less that of the tip to the mock-up's. Steepest: "
          "largest change of the warp, in mm for each mm of hand. Fields fade from one bone to the "
          "other, so a millimetre above the plateau they give a little less than on it.</p>\n",
          file);
    return result;
}

static void way_fini(struct way *way) {
    samples_fini(&way->gap_off_mm);
    samples_fini(&way->us);
}

static void fig7_fini(struct fig7 *fig) {
    way_fini(&fig->straight);
    samples_fini(&fig->whole_us);
    for (size_t k = 0; k < VARIANT_COUNT; k++)
        way_fini(&fig->ways[k]);
    query_destroy(&fig->virtual_query);
    mesh_fini(&fig->virtual);
    for (int i = 0; i < CASE_GROUPS_MAX; i++) {
        surface_integral_destroy(&fig->integrals[i]);
        surface_blocks_destroy(&fig->blocks[i]);
        query_destroy(&fig->queries[i]);
    }
    case_destroy(&fig->knee);
}

enum result paper_path(const struct bench_options *options, struct report *report,
                       struct paper_page *page, struct error *err) {
    struct fig7 *fig = alloc(1, sizeof *fig);
    enum result result = make_knee(fig, err);
    if (result == RESULT_OK) {
        measure(fig, options->quick ? TIMED_ROUNDS_QUICK : TIMED_ROUNDS);
        report_all(fig, report, page);
        write_rows(fig, page);
    }
    if (result == RESULT_OK && page->dir)
        result = write_section(fig, page, err);
    fig7_fini(fig);
    free(fig);
    return result;
}
