// The commands that make a knee a patient's, as a person calls them: on a generated knee, and on
// scanned ones. pathology KNEE, a recipe's folder or a script of this folder that imports a scan.
#include "case/arc.h"
#include "case/case.h"
#include "cut/cut.h"
#include "folder.h"
#include "generate/maxcut.h"
#include "mesh/topology.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>

static const char *knee_path;
static char folder[FOLDER_MAX];
static struct error err;
static const char *const menisci[] = {"meniscus_medial", "meniscus_lateral"};

// ---- commands -----------------------------------------------------------------------------------

// In the test's folder, where the knee is `knee`; the exit status. What it says is in `said`.
static int run(const char *format, ...) {
    char arguments[512], line[1024];
    va_list list;
    va_start(list, format);
    vsnprintf(arguments, sizeof arguments, format, list);
    va_end(list);
    snprintf(line, sizeof line, "cd %s && %s > said 2>&1", folder, arguments);
    int status = system(line);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

#define CASE_TOOL BUILD "/bin/arthron-case "

static void said(char *out, size_t size) {
    char path[FOLDER_MAX + 8];
    snprintf(path, sizeof path, "%s/said", folder);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    out[fread(out, 1, size - 1, file)] = '\0';
    fclose(file);
}

#define assert_run(...)                                                                            \
    do {                                                                                           \
        char output[4096];                                                                         \
        if (run(CASE_TOOL __VA_ARGS__) != 0) {                                                     \
            said(output, sizeof output);                                                           \
            fail_msg("%s", output);                                                                \
        }                                                                                          \
    } while (0)

#define assert_refused(status, words, ...)                                                         \
    do {                                                                                           \
        char output[4096];                                                                         \
        assert_int_equal(run(CASE_TOOL __VA_ARGS__), status);                                      \
        said(output, sizeof output);                                                               \
        if (!strstr(output, words))                                                                \
            fail_msg("\"%s\" does not say \"%s\"", output, words);                                 \
    } while (0)

static struct knee_case *load(const char *name) {
    char path[FOLDER_MAX + 32];
    struct knee_case *knee;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_ok(case_load(path, NULL, &knee, &err));
    return knee;
}

static int make_knee(void) {
    struct stat status;
    folder_make(folder);
    if (stat(knee_path, &status) == 0 && S_ISDIR(status.st_mode))
        return run(CASE_TOOL "generate %s --out knee", knee_path);
    return run("%s knee --unchecked --build " BUILD, knee_path);
}

// ---- tears and plans ----------------------------------------------------------------------------

// The meniscus as a trainee gets it; the volume of its clefts.
static struct topology torn_topology(const struct case_group *group, double *out_clefts_mm3) {
    const struct case_region *tear = &group->lesion.tear;
    struct mesh whole, torn;
    struct cut_mesh *cut;
    case_group_virtual(group, &whole);
    assert_ok(cut_mesh_create(&whole, &cut, &err));
    for (int i = 0; i < tear->part_count; i += CUT_PARTS_MAX) {
        struct cut_change change;
        int count = (int)fmin(tear->part_count - i, CUT_PARTS_MAX);
        assert_int_equal(cut_apply(cut, &tear->parts[i], count, &change, &err), CUT_CHANGED);
        assert_int_equal(change.piece_count, 0);
        cut_change_fini(&change);
    }
    cut_mesh_flatten(cut, &torn, NULL, NULL);
    *out_clefts_mm3 = mesh_volume(&whole) - mesh_volume(&torn);
    struct topology topology = topology_of(&torn);
    mesh_fini(&torn);
    mesh_fini(&whole);
    cut_mesh_destroy(&cut);
    return topology;
}

// The mean share of the arc at which the tear's corners lie.
static double place_of(const struct knee_case *knee, const struct case_group *group,
                       const struct case_region *region) {
    struct mesh mesh;
    struct arc *arc;
    double sum = 0;
    int count = 0;
    case_group_virtual(group, &mesh);
    assert_ok(arc_create(&mesh, knee->joint.T_tibia_joint, &arc, &err));
    for (int i = 0; i < region->part_count; i++)
        for (int v = 0; v < region->parts[i].vertex_count; v++, count++)
            sum += arc_place(arc, region->parts[i].vertices[v]).along;
    arc_destroy(&arc);
    mesh_fini(&mesh);
    return sum / count;
}

static void each_tear_is_where_and_what_it_is_called(void **state) {
    (void)state;
    static const struct {
        const char *kind, *length;
        double least_mm3, most_mm3;
    } rows[] = {{"radial", "", 0.3, 4},
                {"flap", "--length-mm 10", 1, 10},
                {"bucket-handle", "--length-mm 14", 1, 14},
                {"horizontal", "--length-mm 10", 1, 10}};
    for (int i = 0; i < 4; i++) {
        const char *meniscus = menisci[i % 2], *kind = rows[i].kind;
        assert_run("tear knee --kind %s --group %s --at 0.5 --depth-mm 3 %s --out torn", kind,
                   meniscus, rows[i].length);
        struct knee_case *knee = load("torn"), *before = load("knee");
        struct case_group *group = case_group(knee, meniscus);
        double clefts_mm3;
        struct topology was = topology_of(&case_group(before, meniscus)->mesh);
        struct topology is = torn_topology(group, &clefts_mm3);
        assert_true(is.closed && is.manifold && is.oriented);
        assert_int_equal(is.components, 1);
        if (is.genus - was.genus != (strcmp(kind, "bucket-handle") == 0))
            fail_msg("%s of %s: %lld handles", kind, meniscus, (long long)(is.genus - was.genus));
        assert_true(clefts_mm3 > rows[i].least_mm3 && clefts_mm3 < rows[i].most_mm3);
        assert_near(place_of(knee, group, &group->lesion.tear), 0.5, 0.04);
        assert_true(group->lesion.damage.part_count > 0 && group->maxcut);
        assert_int_equal(case_group(knee, menisci[1 - i % 2])->lesion.tear.part_count, 0);
        case_destroy(&knee);
        case_destroy(&before);
    }
}

static double planned_mm3(const struct case_group *group) {
    struct maxcut_report report;
    assert_ok(maxcut_inspect(group, &report, &err));
    assert_true(report.plan_beyond_mm3 < 0.02 * report.plan_mm3);
    return report.plan_mm3;
}

// About the area that it takes in plan, times the height of the inner margin: twice the length
// takes more, and twice the depth too.
static void a_plan_takes_what_was_planned_in_place_of_another(void **state) {
    (void)state;
    static const double sizes[][2] = {{3, 6}, {3, 12}, {5, 12}};
    double last = 10;
    assert_run("tear knee --kind radial --group meniscus_medial --at 0.6 --depth-mm 3 --out torn");
    for (int i = 0; i < 3; i++) {
        assert_run("plan torn --group meniscus_medial --at 0.4 --depth-mm %g --length-mm %g "
                   "--name planned --title \"A plan\" --out planned",
                   sizes[i][0], sizes[i][1]);
        struct knee_case *torn = load("torn"), *planned = load("planned");
        const struct case_lesion *old = &case_group(torn, "meniscus_medial")->lesion;
        const struct case_group *group = case_group(planned, "meniscus_medial");
        double mm3 = planned_mm3(group);
        assert_true(mm3 > 1.15 * last && mm3 < 400);
        last = mm3;
        assert_near(place_of(planned, group, &group->lesion.plan), 0.4, 0.04);
        assert_int_equal(group->lesion.tear.part_count, old->tear.part_count);
        assert_memory_equal(group->lesion.tear.parts, old->tear.parts, sizeof *old->tear.parts);
        assert_string_equal(planned->name, "planned");
        assert_string_equal(planned->title, "A plan");
        case_destroy(&torn);
        case_destroy(&planned);
    }
}

// ---- cavities -----------------------------------------------------------------------------------

// From the joint's origin, x lateral.
static vec3 medial_plateau(const struct knee_case *knee) {
    char text[8192], *line;
    vec3 p;
    assert_run("info knee");
    said(text, sizeof text);
    assert_non_null(line = strstr(text, "\nmedial plateau "));
    assert_int_equal(sscanf(line, "\nmedial plateau %lf %lf %lf", &p.x, &p.y, &p.z), 3);
    p = pose_apply_inverse(knee->joint.T_tibia_joint, p);
    p.x *= knee->joint.side == SIDE_LEFT ? -1 : 1;
    assert_true(p.x < 0);
    return p;
}

static double warp_at(const struct case_group *group, uint32_t v) {
    const float *w = group->warp + 3 * (size_t)v;
    return vec3_length((vec3){(double)w[0], (double)w[1], (double)w[2]});
}

static void a_cavity_is_as_deep_as_asked_and_no_wider(void **state) {
    (void)state;
    struct knee_case *knee = load("knee");
    vec3 at = medial_plateau(knee);
    assert_run(
        "cavity knee --body tibia --at %.3f,%.3f,%.3f --radius-mm 10 --depth-mm 3 --out hollow",
        at.x, at.y, at.z);
    struct knee_case *hollow = load("hollow");
    struct case_group *tibia = case_group(hollow, "tibia"), *femur = case_group(hollow, "femur");
    struct mesh virtual;
    double deepest = 0;
    at.x *= knee->joint.side == SIDE_LEFT ? -1 : 1;
    at = pose_apply(knee->joint.T_tibia_joint, at);
    assert_non_null(tibia->warp);
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++) {
        deepest = fmax(deepest, warp_at(tibia, v));
        bool far = vec3_distance(mesh_vertex(&tibia->mesh, v), at) > 1.5 * 10;
        assert_true(!far || warp_at(tibia, v) == 0);
    }
    assert_near(deepest, 3, 1e-4);
    assert_null(femur->warp);
    case_group_virtual(tibia, &virtual);
    assert_true(mesh_volume(&virtual) < mesh_volume(&tibia->mesh) - 50);
    mesh_fini(&virtual);
    for (int i = 0; i < 2; i++) {
        struct maxcut_report report;
        assert_ok(maxcut_inspect(case_group(hollow, menisci[i]), &report, &err));
        assert_true(report.out_count < 0.01 * report.samples);
    }
    case_destroy(&knee);
    case_destroy(&hollow);
}

static void a_torn_meniscus_is_not_moved_by_a_cavity(void **state) {
    (void)state;
    struct knee_case *knee = load("knee");
    vec3 at = medial_plateau(knee);
    case_destroy(&knee);
    assert_run("tear knee --kind radial --group meniscus_medial --at 0.5 --depth-mm 3 --out torn");
    assert_refused(1, "meniscus_medial has a tear or a plan, which would not follow",
                   "cavity torn --body tibia --at %.3f,%.3f,%.3f --radius-mm 10 --depth-mm 3 "
                   "--out none",
                   at.x, at.y, at.z);
}

// ---- wear ---------------------------------------------------------------------------------------

// The least grade of the vertices within reach of a place.
static double least_grade_near(const struct case_group *group, vec3 at, double reach_mm) {
    double least = CASE_WEAR_MOST;
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++)
        if (vec3_distance(mesh_vertex(&group->mesh, v), at) < reach_mm)
            least = fmin(least, (double)group->wear[v]);
    return least;
}

// Of bone and cartilage alike, and a cavity made after it leaves it.
static void cartilage_is_worn_where_the_command_says(void **state) {
    (void)state;
    struct knee_case *knee = load("knee");
    vec3 at = medial_plateau(knee);
    assert_run("wear knee --body tibia --at %.3f,%.3f,%.3f --radius-mm 12 --grade 3 --out worn",
               at.x, at.y, at.z);
    assert_run(
        "cavity worn --body tibia --at %.3f,%.3f,%.3f --radius-mm 10 --depth-mm 3 --out worn", at.x,
        at.y, at.z);
    struct knee_case *worn = load("worn");
    struct case_group *tibia = case_group(worn, "tibia");
    double most = 0;
    at.x *= knee->joint.side == SIDE_LEFT ? -1 : 1;
    at = pose_apply(knee->joint.T_tibia_joint, at);
    assert_non_null(tibia->wear);
    assert_near(least_grade_near(tibia, at, 3), 3, 1e-6);
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++) {
        bool far = vec3_distance(mesh_vertex(&tibia->mesh, v), at) > 1.5 * 12;
        assert_true(!far || tibia->wear[v] == 0);
        most = fmax(most, (double)tibia->wear[v]);
    }
    assert_near(most, 3, 1e-6);
    assert_null(case_group(worn, "femur")->wear);
    assert_null(case_group(worn, "meniscus_medial")->wear);
    case_destroy(&knee);
    case_destroy(&worn);
}

// ---- ligaments ----------------------------------------------------------------------------------

static void keys_are_what_the_command_says(void **state) {
    (void)state;
    static const double flexion[] = {15, 45, 65, 30, 90}, drawer[] = {6, 3.7}, more[] = {6.9, 4};
    assert_run("ligament knee --ligament mcl --flexion-deg 15,45,65 --valgus-deg 5 "
               "--extra-valgus-deg 10 --out open");
    assert_run("ligament open --ligament acl --flexion-deg \"30 90\" --drawer-mm 6,3.7 "
               "--extra-drawer-mm 6.9,4 --out open");
    struct knee_case *knee = load("open");
    assert_int_equal(knee->torn_count, 2);
    assert_string_equal(knee->torn[0], "mcl");
    assert_string_equal(knee->torn[1], "acl");
    assert_int_equal(knee->key_count, 5);
    for (int i = 0; i < 5; i++) {
        struct joint_angles a = joint_from_pose(&knee->joint, knee->keys[i].physical);
        struct joint_angles b = joint_from_pose(&knee->joint, knee->keys[i].target);
        assert_near(a.flexion_deg, flexion[i], 1e-6);
        assert_near(b.flexion_deg, flexion[i], 1e-6);
        assert_near(a.varus_deg, i < 3 ? -5 : 0, 1e-6);
        assert_near(b.varus_deg, i < 3 ? -15 : 0, 1e-6);
        assert_near(a.drawer_mm, i < 3 ? 0 : drawer[i - 3], 1e-6);
        assert_near(b.drawer_mm, i < 3 ? 0 : drawer[i - 3] + more[i - 3], 1e-6);
        // The other compartment stays in contact; the joint opens by no more than the angle asks.
        assert_true(fabs(a.distraction_mm) < 5 && fabs(b.distraction_mm) < 13);
    }
    case_destroy(&knee);
    assert_refused(1, "mcl is torn already",
                   "ligament open --ligament mcl --flexion-deg 15 --valgus-deg 5 "
                   "--extra-valgus-deg 10 --out none");
}

// ---- what is wrong ------------------------------------------------------------------------------

static void wrong_words_are_refused_and_nothing_is_written(void **state) {
    (void)state;
#define PLACE "--group meniscus_medial --at 0.5 "
#define TEAR "tear knee --kind flap --length-mm 10 --out none "
    assert_refused(2, "depth_mm = 9: must be a number from 1 to 8", TEAR PLACE "--depth-mm 9");
    assert_refused(2, "needs kind, group, at and depth_mm", TEAR PLACE);
    assert_refused(2, "--depth-mm 3: given twice", TEAR PLACE "--depth-mm 3 --depth-mm 3");
    assert_refused(2, "rim_mm = 1: must be a number from 2 to 8",
                   TEAR PLACE "--depth-mm 3 --rim-mm 1");
    assert_refused(1, "femur is no meniscus", TEAR "--at 0.5 --depth-mm 3 --group femur");
    assert_refused(2, "tissue: --group is needed", "tissue knee --label Plica --out none");
    assert_refused(1, "no group plica; a new one needs a path",
                   "tissue knee --group plica --label Plica --out none");
    assert_refused(1, "must stay whole", TEAR "--group meniscus_medial --depth-mm 8 --at 0.9");
    assert_refused(2, "--ligament is needed",
                   "ligament knee --flexion-deg 15 --valgus-deg 5 --extra-valgus-deg 9 --out none");
    assert_refused(2, "one case folder is needed",
                   "plan --group meniscus_medial --at 0.5 --depth-mm 3 --length-mm 5 --out none");
    assert_refused(1, "half of the radius",
                   "cavity knee --body tibia --at 0,0,90 --radius-mm 9 --depth-mm 3 --out none");
    assert_refused(2, "grade = 5: must be a number from 1 to 4",
                   "wear knee --body patella --at 0,0,0 --radius-mm 9 --grade 5 --out none");
    char path[FOLDER_MAX + 8];
    struct stat status;
    snprintf(path, sizeof path, "%s/none", folder);
    assert_int_equal(stat(path, &status), -1);
}

int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_tear_is_where_and_what_it_is_called),
        cmocka_unit_test(a_plan_takes_what_was_planned_in_place_of_another),
        cmocka_unit_test(a_cavity_is_as_deep_as_asked_and_no_wider),
        cmocka_unit_test(a_torn_meniscus_is_not_moved_by_a_cavity),
        cmocka_unit_test(cartilage_is_worn_where_the_command_says),
        cmocka_unit_test(keys_are_what_the_command_says),
        cmocka_unit_test(wrong_words_are_refused_and_nothing_is_written),
    };
    if (argc != 2)
        return 2;
    knee_path = argv[1];
    int made = make_knee();
    if (made == 0)
        made = cmocka_run_group_tests(tests, NULL, NULL);
    else if (made == 77)
        puts("skipped: the scan is not here (ARTHRON_DATA names where it may be)");
    folder_remove(folder);
    return made;
}
