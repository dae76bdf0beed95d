// Fig. 8 to 10: a knee whose medial ligament is torn opens farther than the mock-up's.
#include "base/check.h"
#include "motion/joint.h"
#include "paper.h"
#include "report/render.h"
#include "samples.h"
#include "scene/torn.h"
#include "warp/warp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PHYSICAL_DEG 6.0 // of valgus: as far as the mock-up's ligaments let it
#define EXTRA_DEG 10.0   // from a key to its target
#define OVER_DEG 12.0    // of valgus: more than any key
#define VARUS_DEG 6.0
#define STEP_DEG 1.0
#define LAST_DEG 90.0
#define SWEEP_COUNT 91
#define TURN_COUNT 73 // of the sweep from varus to over-opened, at TURN_FLEXION_DEG
#define TURN_STEP_DEG 0.25
#define TURN_FLEXION_DEG 45.0 // of a key
#define SHOWN_DEG 45.0        // of Fig. 8 and 9
#define CLEARANCE_MM 0.5
#define HEIGHT_MM 135.0 // of the pictures

static const double key_flexions_deg[] = {45, 15, 65}; // one key: the first

enum { NO_KEY, ONE_KEY, THREE_KEYS, SETS };

static const struct {
    int count;
    const char *name;
} sets[SETS] = {{0, "no key"}, {1, "one key"}, {3, "three keys"}};

// How far the joint is put to the test, in degrees of valgus.
static const struct test {
    const char *name;
    double valgus_deg;
} tests[] = {
    {"opened", PHYSICAL_DEG},  {"half opened", PHYSICAL_DEG / 2},
    {"over-opened", OVER_DEG}, {"rest", 0},
    {"varus", -VARUS_DEG},
};

enum { OPENED, TESTS = sizeof tests / sizeof tests[0] };

static const enum adaptive_kind order[ADAPTIVE_COUNT] = {ADAPTIVE_PAPER, ADAPTIVE_PAPER_NARROW,
                                                         ADAPTIVE_HINGE};

struct curves {
    double extra[TESTS][SWEEP_COUNT]; // of valgus, degrees
    double turned[TURN_COUNT];
    double key_error_mm;
};

struct fig10 {
    struct knee_case *knee;
    struct solid femur, tibia;
    double flexions[SWEEP_COUNT], turns[TURN_COUNT];
    struct joint_angles physical[TESTS][SWEEP_COUNT], turned[TURN_COUNT];
    struct curves curves[ADAPTIVE_COUNT][SETS];
    struct samples touch_off_mm;
};

// ---- the joint ----

static struct joint_angles joint_at(const struct fig10 *fig, double flexion, double valgus) {
    struct joint_hold hold = {.flexion_deg = flexion, .valgus_deg = valgus};
    return motion_joint(fig->knee, &fig->femur, &fig->tibia, &hold);
}

static void make_torn(const struct fig10 *fig, enum adaptive_kind kind, int keys,
                      struct torn *out) {
    torn_start(out, fig->knee->joint);
    for (int i = 0; i < keys; i++)
        torn_add(out, MCL, joint_at(fig, key_flexions_deg[i], PHYSICAL_DEG),
                 joint_at(fig, key_flexions_deg[i], PHYSICAL_DEG + EXTRA_DEG));
    torn_build(out, kind);
}

static enum result make_knee(struct fig10 *fig, struct error *err) {
    enum result result = paper_knee("healthy", &fig->knee, err);
    if (result == RESULT_OK)
        result = solid_init(&fig->femur, &case_group(fig->knee, "femur")->mesh, err);
    if (result == RESULT_OK)
        result = solid_init(&fig->tibia, &case_group(fig->knee, "tibia")->mesh, err);
    return result;
}

// Once for all curves: a pose in contact takes a while to find.
static void sweep(struct fig10 *fig) {
    for (int i = 0; i < SWEEP_COUNT; i++) {
        fig->flexions[i] = STEP_DEG * i;
        for (int t = 0; t < TESTS; t++)
            fig->physical[t][i] = joint_at(fig, fig->flexions[i], tests[t].valgus_deg);
    }
    for (int i = 0; i < TURN_COUNT; i++) {
        fig->turns[i] = -VARUS_DEG + TURN_STEP_DEG * i;
        fig->turned[i] = joint_at(fig, TURN_FLEXION_DEG, fig->turns[i]);
    }
}

// ---- the curves ----

static double extra_valgus(const struct torn *torn, struct joint_angles physical) {
    return -torn_extra(torn, physical).varus_deg;
}

static void take_curves(struct fig10 *fig, enum adaptive_kind kind, int set) {
    struct curves *curves = &fig->curves[kind][set];
    struct torn torn;
    make_torn(fig, kind, sets[set].count, &torn);
    for (int t = 0; t < TESTS; t++)
        for (int i = 0; i < SWEEP_COUNT; i++)
            curves->extra[t][i] = extra_valgus(&torn, fig->physical[t][i]);
    for (int i = 0; i < TURN_COUNT; i++)
        curves->turned[i] = extra_valgus(&torn, fig->turned[i]);
    for (int k = 0; k < sets[set].count; k++) {
        pose seen = torn_seen(&torn, torn.keys[k].T_femur_tibia);
        curves->key_error_mm =
            fmax(curves->key_error_mm, torn_apart(&torn, seen, torn.keys[k].target));
    }
    torn_destroy(&torn);
}

// ---- touch ----

// A point of the tibia's plateau in the key pose, clear of femur and patella, is touched: the
// avatar should be on the virtual tibia, in its target pose.
struct touch {
    const struct fig10 *fig;
    struct query *queries[BODY_COUNT];
    struct warp_surface surfaces[BODY_COUNT];
    pose T_world_body[BODY_COUNT], correction[BODY_COUNT];
};

static enum result touch_init(struct touch *touch, const struct fig10 *fig, struct error *err) {
    enum result result = RESULT_OK;
    *touch = (struct touch){.fig = fig};
    for (int i = 0; i < BODY_COUNT && result == RESULT_OK; i++) {
        const struct mesh *mesh = &case_group(fig->knee, body_name((enum body)i))->mesh;
        result = query_create(mesh, &touch->queries[i], err);
        touch->surfaces[i] =
            (struct warp_surface){.mesh = mesh, .query = touch->queries[i], .body = i};
        touch->correction[i] = pose_identity();
    }
    return result;
}

static void place_bones(struct touch *touch) {
    struct torn torn;
    struct adaptive_warp warp;
    make_torn(touch->fig, ADAPTIVE_HINGE, sets[THREE_KEYS].count, &torn);
    pose A = torn_pose(&torn, joint_at(touch->fig, SHOWN_DEG, PHYSICAL_DEG));
    adaptive_at(torn.adaptive, ADAPTIVE_RAMP_STRAIGHT, A, &warp);
    touch->T_world_body[BODY_FEMUR] = pose_identity();
    touch->T_world_body[BODY_TIBIA] = A;
    touch->T_world_body[BODY_PATELLA] = case_patella_pose(touch->fig->knee, SHOWN_DEG);
    touch->correction[BODY_TIBIA] = warp.correction;
    torn_destroy(&torn);
}

static bool is_clear(const struct touch *touch, vec3 p) {
    struct closest closest;
    for (int i = 0; i < BODY_COUNT; i++)
        if (i != BODY_TIBIA &&
            query_closest(touch->queries[i], pose_apply_inverse(touch->T_world_body[i], p),
                          CLEARANCE_MM, MESH_NONE, &closest))
            return false;
    return true;
}

static void touch_plateau(const struct touch *touch, struct samples *out_off_mm) {
    const struct mesh *mesh = touch->surfaces[BODY_TIBIA].mesh;
    struct warp_scene scene = {touch->surfaces, BODY_COUNT, touch->T_world_body, touch->correction};
    struct field field = field_default(FIELD_INTEGRAL);
    field.skin_mm = 0.1;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = pose_apply(touch->T_world_body[BODY_TIBIA], mesh_vertex(mesh, v));
        struct warp warp;
        struct warp_memory memory;
        if (mesh_vertex(mesh, v).z < -25 || !is_clear(touch, p))
            continue;
        warp_memory_init(&memory);
        warp_point(&scene, &field, p, &memory, &warp);
        vec3 wanted = pose_apply(touch->correction[BODY_TIBIA], p);
        samples_add(out_off_mm, vec3_distance(vec3_add(p, warp.displacement), wanted));
    }
}

static enum result measure_touch(struct fig10 *fig, struct error *err) {
    struct touch touch;
    enum result result = touch_init(&touch, fig, err);
    if (result == RESULT_OK) {
        place_bones(&touch);
        touch_plateau(&touch, &fig->touch_off_mm);
    }
    for (int i = 0; i < BODY_COUNT; i++)
        query_destroy(&touch.queries[i]);
    return result;
}

// ---- figures ----

struct range {
    double least, most;
};

static struct range range_of(const struct fig10 *fig, const double extra[SWEEP_COUNT], double from,
                             double to) {
    struct range range = {INFINITY, -INFINITY};
    for (int i = 0; i < SWEEP_COUNT; i++)
        if (fig->flexions[i] >= from && fig->flexions[i] <= to) {
            range.least = fmin(range.least, extra[i]);
            range.most = fmax(range.most, extra[i]);
        }
    return range;
}

// Between the outer keys.
static struct range opening_of(const struct fig10 *fig, const struct curves *curves) {
    return range_of(fig, curves->extra[OPENED], 15, 65);
}

static void report_all(struct fig10 *fig, struct report *report) {
    for (int kind = 0; kind < ADAPTIVE_COUNT; kind++)
        for (int set = ONE_KEY; set < SETS; set++) {
            const struct curves *curves = &fig->curves[kind][set];
            const char *name = adaptive_name((enum adaptive_kind)kind);
            const char *keys = sets[set].name;
            report_figure(report, curves->key_error_mm, "mm", "fig 10/%s/%s/key error", name, keys);
            for (int t = 0; t < TESTS; t++) {
                struct range range = range_of(fig, curves->extra[t], 15, 65);
                report_figure(report, range.least, "deg", "fig 10/%s/%s/%s/15 to 65/least", name,
                              keys, tests[t].name);
                report_figure(report, range.most, "deg", "fig 10/%s/%s/%s/15 to 65/most", name,
                              keys, tests[t].name);
            }
        }
    report_figure(report, EXTRA_DEG, "deg", "fig 8/key to target");
    report_figure(report, 10, "deg", "fig 8/key to target/paper");
    report_figure(report, samples_max(&fig->touch_off_mm), "mm", "fig 9/touch off/max");
    report_figure(report, (double)fig->touch_off_mm.count, "points", "fig 9/touched");
}

static void write_rows(struct fig10 *fig, struct paper_page *page) {
    paper_rows(page, "Fig. 8 to 10: a torn ligament");
    paper_row(page, "From the key to the target of the torn ligament", "about 10°", "%.0f°",
              EXTRA_DEG);
    for (int i = 0; i < ADAPTIVE_COUNT; i++) {
        enum adaptive_kind kind = order[i];
        struct range range = opening_of(fig, &fig->curves[kind][THREE_KEYS]);
        char what[128];
        snprintf(what, sizeof what, "Extra valgus with three keys, from 15 to 65°, %s",
                 adaptive_name(kind));
        paper_row(page, what, "a picture: smooth", "%.2f to %.2f°", range.least, range.most);
    }
    paper_row(page, "Touch of the tibia in its key pose: error", "none to be seen (Fig. 9)",
              "at most %.1g mm on %zu points", samples_max(&fig->touch_off_mm),
              fig->touch_off_mm.count);
}

// ---- pictures ----

// Femur and tibia from the front; with a target, the tibia there in violet.
static enum result draw(const struct fig10 *fig, pose tibia, const pose *target,
                        struct picture *out_picture, struct error *err) {
    const struct colour bone = {0.94, 0.89, 0.77}, violet = {0.55, 0.25, 0.75};
    struct render_surface surfaces[] = {
        {.mesh = fig->femur.mesh,
         .T_world_mesh = pose_identity(),
         .crease_deg = 40,
         .opacity = 1,
         .colour = bone},
        {.mesh = fig->tibia.mesh,
         .T_world_mesh = tibia,
         .crease_deg = 40,
         .opacity = 1,
         .colour = bone},
        {.mesh = fig->tibia.mesh, .crease_deg = 40, .opacity = 0.5, .colour = violet},
    };
    if (target)
        surfaces[2].T_world_mesh = *target;
    const struct box box = {{-45, -45, -60}, {45, 45, 30}};
    vec3 along = quat_rotate(tibia.rotation, (vec3){0, 0, 1});
    vec3 from = vec3_cross((vec3){1, 0, 0}, vec3_scale(-1, along)); // the shin's front
    struct camera camera = camera_fit(&box, from, along, 0.9, 5);
    camera.distance_mm *= HEIGHT_MM / camera.height_mm; // the same of both pictures
    camera.height_mm = HEIGHT_MM;
    struct render_scene scene = {surfaces, target ? 3 : 2, camera, {1, 1, 1}};
    return render(&scene, 320, 356, out_picture, err);
}

static enum result write_picture(const struct fig10 *fig, struct paper_page *page, bool opened,
                                 struct error *err) {
    struct joint_angles rest = {0}, key = joint_at(fig, SHOWN_DEG, PHYSICAL_DEG),
                        end = joint_at(fig, SHOWN_DEG, PHYSICAL_DEG + EXTRA_DEG);
    pose tibia = joint_to_pose(&fig->knee->joint, opened ? &key : &rest);
    pose target = joint_to_pose(&fig->knee->joint, &end);
    struct picture picture = {0};
    enum result result = draw(fig, tibia, opened ? &target : NULL, &picture, err);
    if (result == RESULT_OK)
        result = paper_picture(page, opened ? "fig8-key" : "fig8-rest", &picture,
                               "Femur and tibia, seen along the front of the shin",
                               opened ? "The key pose at 45°, opened as far as the mock-up lets; "
                                        "violet: the target pose"
                                      : "The rest pose",
                               err);
    picture_fini(&picture);
    return result;
}

// ---- plots ----

static const char *const kind_names[ADAPTIVE_COUNT] = {
    [ADAPTIVE_HINGE] = "hinge, Arthron’s",
    [ADAPTIVE_PAPER] = "Eq. 7 as printed",
    [ADAPTIVE_PAPER_NARROW] = "Eq. 7, narrow",
};
static const enum plot_colour kind_colours[ADAPTIVE_COUNT] = {
    [ADAPTIVE_HINGE] = PLOT_BLUE,
    [ADAPTIVE_PAPER] = PLOT_ORANGE,
    [ADAPTIVE_PAPER_NARROW] = PLOT_PURPLE,
};

// One formula, with no, one and three keys.
static enum result plot_keys(const struct fig10 *fig, enum adaptive_kind kind,
                             struct paper_page *page, struct error *err) {
    const struct curves *curves = fig->curves[kind];
    const struct plot_line lines[] = {
        {"no key", NULL, fig->flexions, curves[NO_KEY].extra[OPENED], SWEEP_COUNT, PLOT_GREY,
         PLOT_SOLID},
        {"one key (45°)", NULL, fig->flexions, curves[ONE_KEY].extra[OPENED], SWEEP_COUNT,
         PLOT_GREEN, PLOT_DASHED},
        {"three keys (15°, 45°, 65°)", NULL, fig->flexions, curves[THREE_KEYS].extra[OPENED],
         SWEEP_COUNT, kind_colours[kind], PLOT_SOLID},
        {"target", NULL, (const double[]){15, 45, 65},
         (const double[]){EXTRA_DEG, EXTRA_DEG, EXTRA_DEG}, 3, PLOT_INK, PLOT_POINTS},
    };
    struct range one = opening_of(fig, &curves[ONE_KEY]);
    struct range three = opening_of(fig, &curves[THREE_KEYS]);
    char title[160], name[64], caption[160];
    snprintf(caption, sizeof caption,
             "From 15° to 65°: %.1f° to %.1f° with one key, %.1f° to %.1f° with three", one.least,
             one.most, three.least, three.most);
    snprintf(title, sizeof title, "Fig. 10: %s", kind_names[kind]);
    snprintf(name, sizeof name, "fig10-%s", adaptive_name(kind));
    struct plot plot = {
        .title = title,
        .description = "Extra valgus over flexion, the joint opened as far as the mock-up lets it, "
                       "with no, one and three keys.",
        .width = 400,
        .height = 320,
        .x = {"flexion, degrees", 0, LAST_DEG},
        .y = {"extra valgus, degrees", -1, 28},
        .lines = lines,
        .line_count = sizeof lines / sizeof lines[0],
    };
    return paper_plot(page, name, &plot, caption, err);
}

static enum result plot_turns(const struct fig10 *fig, struct paper_page *page, struct error *err) {
    struct plot_line lines[ADAPTIVE_COUNT];
    for (int i = 0; i < ADAPTIVE_COUNT; i++) {
        enum adaptive_kind kind = (enum adaptive_kind)i;
        lines[i] = (struct plot_line){kind_names[i],
                                      adaptive_name(kind),
                                      fig->turns,
                                      fig->curves[i][THREE_KEYS].turned,
                                      TURN_COUNT,
                                      kind_colours[i],
                                      kind == ADAPTIVE_HINGE ? PLOT_SOLID : PLOT_DASHED};
    }
    const struct plot_band bands[] = {{"varus", false, -INFINITY, 0},
                                      {"over-opened", false, PHYSICAL_DEG, INFINITY}};
    struct plot plot = {
        .title = "The same, over the mock-up’s valgus at 45° of flexion",
        .description = "Extra valgus over the mock-up's own, with three keys. In varus and at rest "
                       "there should be none, and over-opened no more than the key's.",
        .width = 640,
        .height = 380,
        .x = {"valgus of the mock-up, degrees", -VARUS_DEG, OVER_DEG},
        .y = {.title = "extra valgus, degrees"},
        .lines = lines,
        .line_count = ADAPTIVE_COUNT,
        .bands = bands,
        .band_count = 2,
    };
    return paper_plot(page, "fig10-valgus", &plot,
                      "Three keys. In varus and at rest nothing should open; a key is met at 6°.",
                      err);
}

// ---- the section ----

// What is 0 but for rounding.
static double without_sign(double value) {
    return fabs(value) < 0.005 ? 0 : value;
}

static void write_table(const struct fig10 *fig, FILE *file) {
    fputs("<table>\n<tr><th></th><th class=\"n\">keys</th>", file);
    for (int t = 0; t < TESTS; t++)
        fprintf(file, "<th class=\"n\">%s (%g°)</th>", tests[t].name, tests[t].valgus_deg);
    fputs("</tr>\n", file);
    for (int i = 0; i < ADAPTIVE_COUNT; i++)
        for (int set = ONE_KEY; set < SETS; set++) {
            fprintf(file, "<tr><th>%s</th><td class=\"n\">%d</td>", adaptive_name(order[i]),
                    sets[set].count);
            for (int t = 0; t < TESTS; t++) {
                struct range range = range_of(fig, fig->curves[order[i]][set].extra[t], 15, 65);
                fprintf(file, "<td class=\"n\">%.2f to %.2f</td>", without_sign(range.least),
                        without_sign(range.most));
            }
            fputs("</tr>\n", file);
        }
    fputs("</table>\n", file);
}

static enum result write_section(const struct fig10 *fig, struct paper_page *page,
                                 struct error *err) {
    FILE *file = page->sections;
    fprintf(file,
            "<h2>Fig. 8 to 10: a torn ligament</h2>\n<p>The mock-up opens by %g degrees of valgus, "
            "about the lateral contact. In the key poses at 15, 45 and 65 degrees of flexion the "
            "virtual tibia is to open by %g more. The paper shows the rest pose and the one at 45 "
            "degrees (Fig. 8), that touch is felt where it is seen (Fig. 9), and the course of the "
            "opening (Fig. 10): level without keys, a spike about 45 degrees with one, "
            "&ldquo;sufficiently smooth&rdquo; with three.</p>\n<div class=\"row\">\n",
            PHYSICAL_DEG, EXTRA_DEG);
    enum result result = write_picture(fig, page, false, err);
    if (result == RESULT_OK)
        result = write_picture(fig, page, true, err);
    fputs("</div>\n<p>In Eq. 7 as printed the width comes from the rest pose at 0 degrees of "
          "flexion: it warps at rest, and three keys add up to far more than one wants. With the "
          "width from the rest pose at the key's flexion (narrow) the spike of the paper's Fig. 10 "
          "is "
          "there, and gaps between the keys. Arthron's hinge gives the extra motion by how "
          "far the joint leaves its rest path, whatever the flexion.</p>\n<div class=\"row\">\n",
          file);
    for (int i = 0; i < ADAPTIVE_COUNT && result == RESULT_OK; i++)
        result = plot_keys(fig, order[i], page, err);
    if (result == RESULT_OK)
        result = plot_turns(fig, page, err);
    fputs("</div>\n<p>Extra valgus from 15 to 65 degrees of flexion, least and most; in brackets "
          "the mock-up's own valgus. Wanted: 10, 5, 10, 0, 0.</p>\n",
          file);
    write_table(fig, file);
    return result;
}

static void fig10_fini(struct fig10 *fig) {
    samples_fini(&fig->touch_off_mm);
    solid_fini(&fig->tibia);
    solid_fini(&fig->femur);
    case_destroy(&fig->knee);
}

enum result paper_opening(const struct bench_options *options, struct report *report,
                          struct paper_page *page, struct error *err) {
    (void)options; // nothing here is sampled
    struct fig10 *fig = alloc(1, sizeof *fig);
    enum result result = make_knee(fig, err);
    if (result == RESULT_OK) {
        sweep(fig);
        for (int kind = 0; kind < ADAPTIVE_COUNT; kind++)
            for (int set = NO_KEY; set < SETS; set++)
                take_curves(fig, (enum adaptive_kind)kind, set);
        result = measure_touch(fig, err);
    }
    if (result == RESULT_OK) {
        report_all(fig, report);
        write_rows(fig, page);
    }
    if (result == RESULT_OK && page->dir)
        result = write_section(fig, page, err);
    fig10_fini(fig);
    free(fig);
    return result;
}
