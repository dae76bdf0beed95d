// A session as an image: read back bit for bit, and by a program that is not ours.
#include "export/atlas.h"
#include "export/export.h"
#include "export/image.h"
#include "replay/bites.h"
#include "replay/program.h"
#include "replay/roundtrip.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#define WIDTH 1024

static char exr_path[FOLDER_MAX + 32];
static struct exr_parts whole, parts; // of the whole session; that a test looks at
static bool no_oiiotool;

static struct export_request request_of(const struct scene *scene) {
    return (struct export_request){
        .trace = trace_path, .from_s = -INFINITY, .to_s = INFINITY, .scene = scene};
}

static void export_and_read(const struct export_request *request, enum result expected) {
    struct error err = {""};
    enum result result = export_exr(request, exr_path, &err);
    if (result != expected)
        fail_msg("%d: %s", result, err.text);
    if (exr_parts_read(exr_path, &parts, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

static int make(void **state) {
    if (make_bites(state) != 0)
        return -1;
    snprintf(exr_path, sizeof exr_path, "%s.exr", trace_path);
    struct export_request request = request_of(played.scene);
    export_and_read(&request, RESULT_OK);
    whole = parts;
    return 0;
}

static int clear(void **state) {
    exr_parts_fini(&whole);
    unlink(exr_path);
    return remove_session(state);
}

static int take_whole(void **state) {
    (void)state;
    parts = whole;
    return 0;
}

static int drop(void **state) {
    (void)state;
    exr_parts_fini(&parts);
    return 0;
}

static float float_at(const uint32_t *values, size_t i) {
    float value;
    memcpy(&value, &values[i], sizeof value);
    return value;
}

static void every_field_of_every_step_comes_back(void **state) {
    (void)state;
    struct roundtrip trip = {0};
    roundtrip_fields(&parts, trace_path, &trip);
    assert_int_equal(trip.differences, 0);
    assert_int_equal(trip.steps, recorded_steps);
    assert_true(trip.steps > WIDTH && trip.jobs > 2 && trip.landed > 2);
    const struct exr_part *part = exr_part(&parts, "steps");
    assert_int_equal(part->width, WIDTH);
    assert_int_equal(part->height, (trip.steps + WIDTH - 1) / WIDTH);
    assert_int_equal(exr_part(&parts, "jobs")->width, trip.jobs);
    assert_int_equal(exr_values(part, "step", ".low")[trip.steps - 1], trip.steps);
    if (trip.steps < (uint64_t)part->width * part->height)
        assert_int_equal(exr_values(part, "step", ".low")[trip.steps], 0);
}

static uint64_t bits_at(const struct exr_part *part, const char *name, uint64_t i) {
    return (uint64_t)exr_values(part, name, ".high")[i] << 32 | exr_values(part, name, ".low")[i];
}

// Beside its outputs a step has its input, by channel.
static void every_sample_of_every_frame_is_there(void **state) {
    (void)state;
    const struct exr_part *part = exr_part(&parts, "inputs");
    struct trace_reader *reader;
    struct trace_record record;
    uint64_t step = 0, samples = 0;
    assert_non_null(part);
    assert_int_equal(trace_reader_create(trace_path, &reader, NULL), RESULT_OK);
    for (; trace_read(reader, &record, NULL) == RESULT_OK; step += record.type == TRACE_STEP) {
        const struct frame *frame = &record.input.frame;
        if (record.type != TRACE_STEP || record.input.kind != INPUT_FRAME)
            continue;
        assert_true((int64_t)bits_at(part, "frame_time_ns", step) == frame->time_ns);
        for (int i = 0; i < frame->count; i++) {
            const struct sample *s = &frame->samples[i];
            if (s->channel != CHANNEL_PUNCH || s->kind != SAMPLE_POSE)
                continue;
            uint64_t x = image_bits(s->T_mockup_body.translation.x);
            assert_true((int64_t)bits_at(part, "measured_punch_time_ns", step) == s->time_ns);
            assert_true(bits_at(part, "measured_punch_tx_mm", step) == x);
            samples++;
        }
    }
    trace_reader_destroy(&reader);
    assert_true(step == recorded_steps && samples > 500);
}

static void two_floats_together_tell_the_nanosecond(void **state) {
    (void)state;
    const struct exr_part *part = exr_part(&parts, "steps");
    for (uint64_t i = 0; i < recorded_steps; i++) {
        double seconds = (double)float_at(exr_values(part, "t_seconds", ""), i) +
                         (double)float_at(exr_values(part, "t_seconds", ".rest"), i);
        uint64_t time_ns = (uint64_t)exr_values(part, "time_ns", ".high")[i] << 32 |
                           exr_values(part, "time_ns", ".low")[i];
        assert_int_equal(llround(seconds * 1e9), time_ns); // the session starts at 0
    }
}

static void maps_have_the_touch_that_a_replay_has(void **state) {
    (void)state;
    struct roundtrip trip = {0};
    roundtrip_maps(&parts, trace_path, played.scene, &trip);
    assert_int_equal(trip.differences, 0);
    assert_true(trip.maps > 4 && trip.largest_offset_mm > 0.3);
}

static const struct mesh *mesh_of(int tissue) {
    return &scene_case(played.scene)->groups[scene_tissue_group(played.scene, tissue)].mesh;
}

// A texture of the atlas shows on each triangle what its corners have, linear between them.
static void bilinear_filtering_of_the_atlas_is_linear_on_triangles(void **state) {
    (void)state;
    const char *group = scene_case(played.scene)->groups[scene_tissue_group(played.scene, 0)].name;
    const struct mesh *mesh = mesh_of(0);
    const struct exr_part *part = exr_part(&parts, group);
    struct atlas atlas = atlas_of(mesh->triangle_count);
    assert_non_null(part);
    for (uint32_t t = 0; t < mesh->triangle_count; t += 7) {
        static const double weights[3] = {0.2, 0.5, 0.3};
        static const char *const names[3] = {"position.x", "position.y", "position.z"};
        double u = 0, v = 0;
        vec3 place = {0};
        for (int k = 0; k < 3; k++) {
            float uv[2];
            atlas_uv(&atlas, t, k, uv);
            u += weights[k] * (double)uv[0];
            v += weights[k] * (double)uv[1];
            place = vec3_add(place, vec3_scale(weights[k], mesh_corner(mesh, t, k)));
        }
        double x = u * part->width - 0.5, y = v * part->height - 0.5;
        size_t at = (size_t)floor(y) * part->width + (size_t)floor(x);
        double fx = x - floor(x), fy = y - floor(y), shown[3];
        for (int axis = 0; axis < 3; axis++) {
            const uint32_t *values = exr_values(part, names[axis], "");
            shown[axis] = (1 - fy) * ((1 - fx) * (double)float_at(values, at) +
                                      fx * (double)float_at(values, at + 1)) +
                          fy * ((1 - fx) * (double)float_at(values, at + part->width) +
                                fx * (double)float_at(values, at + part->width + 1));
        }
        assert_near(shown[0], place.x, 1e-3);
        assert_near(shown[1], place.y, 1e-3);
        assert_near(shown[2], place.z, 1e-3);
    }
}

// ---- parts of a record --------------------------------------------------------------------------

static int maps_in(const struct exr_parts *of) {
    int count = 0;
    for (int i = 0; i < of->count; i++)
        count += strstr(of->parts[i].name, ".job_") != NULL;
    return count;
}

static int landed_between(double from_s, double to_s) {
    const struct exr_part *landed = exr_part(&whole, "landed");
    int count = 0;
    for (uint32_t x = 0; x < landed->width; x++) {
        double seconds = (double)float_at(exr_values(landed, "t_seconds", ""), x);
        count += float_at(exr_values(landed, "landed_outcome", ""), x) == JOB_DONE &&
                 seconds >= from_s && seconds <= to_s;
    }
    return count;
}

static void a_span_of_time_has_its_steps_and_its_cuts_alone(void **state) {
    (void)state;
    struct export_request request = request_of(played.scene);
    request.from_s = 5;
    request.to_s = 8;
    export_and_read(&request, RESULT_OK);
    const struct exr_part *part = exr_part(&parts, "steps");
    const uint32_t *seconds = exr_values(part, "t_seconds", "");
    assert_true(part->width > 100 && part->height == 1);
    for (uint32_t x = 0; x < part->width; x++)
        assert_true(float_at(seconds, x) >= 5 && float_at(seconds, x) <= 8);
    assert_int_equal(maps_in(&parts), landed_between(5, 8));
    assert_in_range(maps_in(&parts), 1, maps_in(&whole) - 1);
    assert_int_equal(maps_in(&whole), landed_between(0, 1e6));
    request.from_s = request.to_s = 1e6;
    struct error err = {""};
    assert_int_equal(export_exr(&request, exr_path, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "no step in that time"));
}

static void without_a_case_all_but_the_maps_is_there(void **state) {
    (void)state;
    struct export_request request = request_of(NULL);
    export_and_read(&request, RESULT_OK);
    assert_non_null(exr_part(&parts, "landed"));
    for (int i = 0; i < parts.count; i++)
        assert_null(strchr(parts.parts[i].name, '.'));
}

static void what_a_cut_off_record_has_is_written(void **state) {
    (void)state;
    struct stat status;
    assert_int_equal(stat(trace_path, &status), 0);
    char cut[FOLDER_MAX + 32], line[500];
    snprintf(cut, sizeof cut, "%s.cut", trace_path);
    snprintf(line, sizeof line, "head -c %lld %s > %s", (long long)status.st_size / 2, trace_path,
             cut);
    assert_int_equal(system(line), 0);
    struct export_request request = request_of(played.scene);
    request.trace = cut;
    export_and_read(&request, RESULT_MISSING);
    unlink(cut);
    const struct exr_part *part = exr_part(&parts, "steps");
    assert_true(part->height * WIDTH > recorded_steps / 4);
    assert_true(part->height * WIDTH < recorded_steps);
}

static void compare_piece(double from_s, double to_s) {
    char piece[FOLDER_MAX + 32], line[500];
    snprintf(piece, sizeof piece, "%s.piece", trace_path);
    snprintf(line, sizeof line, "%s cut %s --from %f --to %f --out %s", TRACE_PROGRAM, trace_path,
             from_s, to_s, piece);
    assert_int_equal(system(line), 0);
    struct export_request request = request_of(played.scene);
    request.trace = piece;
    export_and_read(&request, RESULT_OK);
    unlink(piece);
    const struct exr_part *last = &parts.parts[parts.count - 1];
    const struct exr_part *expected = exr_part(&whole, last->name);
    assert_non_null(strstr(last->name, ".job_"));
    size_t size = (size_t)expected->width * expected->height * sizeof(uint32_t);
    for (int i = 0; i < expected->channel_count; i++)
        assert_memory_equal(last->channels[i].values, expected->channels[i].values, size);
    exr_parts_fini(&parts);
}

// A piece of a record has no outputs before it begins: what was cut until then is found again.
static void a_piece_has_the_maps_that_the_whole_has(void **state) {
    (void)state;
    const struct exr_part *landed = exr_part(&whole, "landed");
    const uint32_t *seconds = exr_values(landed, "t_seconds", "");
    const uint32_t *outcome = exr_values(landed, "landed_outcome", "");
    int pieces = 0;
    for (uint32_t x = 1; x < landed->width; x++)
        if (float_at(outcome, x) == JOB_DONE && ++pieces)
            compare_piece((double)float_at(seconds, x) - 0.005,
                          (double)float_at(seconds, x) + 0.005);
    assert_true(pieces > 3);
}

static void forge_tissue(struct session_output *output) {
    output->job.tissue = output->job.id ? TISSUES_MAX - 1 : output->job.tissue;
}

static void forge_pose(struct session_output *output) {
    output->job.moves[0].T_mesh_tip[1].rotation.w = output->job.id ? NAN : 0;
}

static void jobs_that_no_session_asks_for_are_refused(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    struct export_request request = request_of(played.scene);
    struct error err = {""};
    record(&header, 100, forge_tissue);
    assert_int_equal(export_exr(&request, exr_path, &err), RESULT_FORMAT);
    record(&header, 100, forge_pose);
    assert_int_equal(export_exr(&request, exr_path, &err), RESULT_FORMAT);
    header.case_hash++;
    record(&header, 0, NULL);
    assert_int_equal(export_exr(&request, exr_path, &err), RESULT_REFUSED);
}

static int files_in_folder(void) {
    char line[300];
    int count = -1;
    snprintf(line, sizeof line, "ls -A $(dirname %s) | wc -l", trace_path);
    FILE *pipe = popen(line, "r");
    assert_int_equal(fscanf(pipe, "%d", &count), 1);
    pclose(pipe);
    return count;
}

// A limit on a file's size does what a full disk does.
static void a_full_disk_is_an_error_and_leaves_no_file(void **state) {
    (void)state;
    struct export_request request = request_of(played.scene);
    int before = files_in_folder();
    fflush(stdout);
    pid_t child = fork();
    if (child == 0) {
        struct error err = {""};
        signal(SIGXFSZ, SIG_IGN);
        setrlimit(RLIMIT_FSIZE, &(struct rlimit){200000, 200000});
        enum result result = export_exr(&request, exr_path, &err);
        _exit(result == RESULT_IO && strstr(err.text, exr_path) ? 0 : 1);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_int_equal(files_in_folder(), before);
    struct error err = {""};
    assert_int_equal(export_exr(&request, "/nowhere/at/all.exr", &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "/nowhere/at/all.exr"));
    request.trace = "/nowhere.trace";
    assert_int_equal(export_exr(&request, exr_path, &err), RESULT_IO);
}

static void the_program_writes_the_same_file(void **state) {
    (void)state;
    char line[800];
    snprintf(line, sizeof line, "%s export %s --exr %s.2 && cmp %s %s.2; s=$?; rm %s.2; exit $s",
             TRACE_PROGRAM, trace_path, exr_path, exr_path, exr_path, exr_path);
    assert_int_equal(system(line), 0);
    snprintf(line, sizeof line, "%s export %s --case /nowhere --exr %s.2 2>&1 | grep -q /nowhere",
             TRACE_PROGRAM, trace_path, exr_path);
    assert_int_equal(system(line), 0); // it has cuts, so it needs the case
}

static void the_record_itself_is_never_written_over(void **state) {
    (void)state;
    static const char *const kinds[] = {"csv", "exr", "gltf"};
    struct stat before, after;
    assert_int_equal(stat(trace_path, &before), 0);
    for (int i = 0; i < 3; i++) {
        char line[500];
        snprintf(line, sizeof line, "%s export %s --%s %s 2>/dev/null; test $? = 2", TRACE_PROGRAM,
                 trace_path, kinds[i], trace_path);
        assert_int_equal(system(line), 0);
    }
    assert_int_equal(stat(trace_path, &after), 0);
    assert_true(before.st_size == after.st_size && before.st_ino == after.st_ino);
}

// ---- another reader -----------------------------------------------------------------------------

static char said[4 << 20];

static void oiiotool(const char *arguments) {
    if (run_program("oiiotool", arguments, said, sizeof said) != 0)
        fail_msg("oiiotool: %s", said);
}

static void says(const char *text) {
    if (!strstr(said, text))
        fail_msg("\"%s\" is not in: %.4000s", text, said);
}

// "Pixel (x, y): value value", as oiiotool prints data.
static const char *pixel_said(uint32_t x, uint32_t y) {
    char text[64];
    snprintf(text, sizeof text, "Pixel (%u, %u): ", x, y);
    says(text);
    return strstr(said, text) + strlen(text);
}

// Leaves in `said` what oiiotool finds in a part of the image.
static void dump(const char *load, const char *rest) {
    char cut[FOLDER_MAX + 48], arguments[500];
    snprintf(cut, sizeof cut, "%s.cut.exr", exr_path);
    snprintf(arguments, sizeof arguments, "%s %s %s -o %s", load, exr_path, rest, cut);
    oiiotool(arguments);
    snprintf(arguments, sizeof arguments, "--native --dumpdata %s", cut);
    oiiotool(arguments);
    unlink(cut);
}

static void oiiotool_reads_the_same(void **state) {
    (void)state;
    if (no_oiiotool)
        skip();
    char cut[FOLDER_MAX + 32];
    const struct exr_part *part = exr_part(&parts, "probe");
    const uint32_t *expected = exr_values(part, "probe_warped_tz_mm", "");
    unsigned first = 0;
    while (isnan(float_at(expected, first)))
        first++;
    assert_true(first + 8 < WIDTH);
    snprintf(cut, sizeof cut, "--subimage probe --ch probe_warped_tz_mm --cut 8x1+%u+0", first);
    dump("", cut);
    for (uint32_t x = 0; x < 8; x++) {
        double value = (double)float_at(expected, first + x);
        assert_near(strtod(pixel_said(x, 0), NULL), value, 1e-6 * fabs(value));
    }
    // Integers go through its floats: 24 bits of them are left.
    dump("-i:native=1:ch=time_ns.high,time_ns.low", "--cut 4x1+700+0 -d uint32");
    part = exr_part(&parts, "steps");
    for (uint32_t x = 0; x < 4; x++) {
        unsigned high, low;
        assert_int_equal(sscanf(pixel_said(x, 0), "%u %u", &high, &low), 2);
        assert_int_equal(high, exr_values(part, "time_ns", ".high")[700 + x]);
        assert_near(low, exr_values(part, "time_ns", ".low")[700 + x], 256);
    }
}

static void oiiotool_lists_channels_and_what_is_said_of_the_session(void **state) {
    (void)state;
    if (no_oiiotool)
        skip();
    char arguments[400];
    snprintf(arguments, sizeof arguments, "--info -v -a %s", exr_path);
    oiiotool(arguments);
    static const char *const texts[] = {
        "arthron:session: \"a7a7a7a7a7a7a7a7a7a7a7a7a7a7a7a7\"",
        "arthron:case: \"arthrosis\"",
        "arthron:station: \"bench 3\"",
        "arthron:names_state: \"0 waiting, 1 running, 2 paused, 3 closed\"",
        "name: \"steps\"",
        "name: \"punch\"",
        "name: \"meniscus_medial.job_",
        "flexion_deg (float)",
        "flexion_deg.high (uint), flexion_deg.low (uint)",
        "compression: \"zips\"",
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        says(texts[i]);
    assert_null(strstr(said, "Amsel")); // who it was does not leave the record
}

#define TEST(f) cmocka_unit_test_setup(f, take_whole)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(every_field_of_every_step_comes_back),
        TEST(every_sample_of_every_frame_is_there),
        TEST(two_floats_together_tell_the_nanosecond),
        TEST(maps_have_the_touch_that_a_replay_has),
        TEST(bilinear_filtering_of_the_atlas_is_linear_on_triangles),
        TEST(oiiotool_lists_channels_and_what_is_said_of_the_session),
        TEST(oiiotool_reads_the_same),
        cmocka_unit_test(the_record_itself_is_never_written_over),
        cmocka_unit_test(the_program_writes_the_same_file), // before another file takes its place
        cmocka_unit_test_teardown(a_span_of_time_has_its_steps_and_its_cuts_alone, drop),
        cmocka_unit_test_teardown(without_a_case_all_but_the_maps_is_there, drop),
        cmocka_unit_test_teardown(what_a_cut_off_record_has_is_written, drop),
        cmocka_unit_test(a_piece_has_the_maps_that_the_whole_has),
        cmocka_unit_test(a_full_disk_is_an_error_and_leaves_no_file),
        cmocka_unit_test(jobs_that_no_session_asks_for_are_refused), // another trace from here on
    };
    no_oiiotool = system("oiiotool --version > /dev/null 2>&1") != 0;
    int failures = cmocka_run_group_tests_name("exr", tests, make, clear);
    if (failures || !no_oiiotool)
        return failures;
    fputs("skipped in part: no oiiotool (Debian's openimageio-tools) to read with\n", stderr);
    return 77;
}
