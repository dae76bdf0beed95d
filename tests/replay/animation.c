// A session as an animated scene, read without the library that wrote it.
#include "case/gltf.h"
#include "export/export.h"
#include "replay/bites.h"
#include "test.h"
#include "trace/rerun.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char scene_path[FOLDER_MAX + 32];
static json_t *scene_file; // the file's text
static uint8_t *file_bytes;
static const uint8_t *data; // and its numbers
static size_t file_size, data_size;

static struct export_request request_of(const struct scene *scene) {
    return (struct export_request){
        .trace = trace_path, .from_s = -INFINITY, .to_s = INFINITY, .scene = scene};
}

static uint32_t u32_at(const uint8_t *bytes) {
    uint32_t value;
    memcpy(&value, bytes, sizeof value);
    return value;
}

static void close_scene(void) {
    json_decref(scene_file);
    free(file_bytes);
    scene_file = NULL;
    file_bytes = NULL;
}

static void open_scene(void) {
    struct stat status;
    FILE *file = fopen(scene_path, "rbe");
    assert_non_null(file);
    assert_int_equal(fstat(fileno(file), &status), 0);
    file_size = (size_t)status.st_size;
    file_bytes = malloc(file_size);
    assert_int_equal(fread(file_bytes, 1, file_size, file), file_size);
    fclose(file);
    size_t text = u32_at(file_bytes + 12);
    scene_file = json_loadb((const char *)file_bytes + 20, text, 0, NULL);
    assert_non_null(scene_file);
    data = file_bytes + 20 + text + 8;
    data_size = u32_at(file_bytes + 20 + text);
}

static int make(void **state) {
    if (make_bites(state) != 0)
        return -1;
    snprintf(scene_path, sizeof scene_path, "%s.glb", trace_path);
    struct export_request request = request_of(played.scene);
    struct error err = {""};
    if (export_gltf(&request, scene_path, &err) != RESULT_OK)
        return print_error("%s\n", err.text), -1;
    open_scene();
    return 0;
}

static int clear(void **state) {
    close_scene();
    unlink(scene_path);
    return remove_session(state);
}

// ---- reading ------------------------------------------------------------------------------------

static json_t *list(const char *name) {
    json_t *value = json_object_get(scene_file, name);
    assert_true(json_is_array(value));
    return value;
}

static size_t number(const json_t *object, const char *key) {
    json_t *value = json_object_get(object, key);
    return value ? (size_t)json_integer_value(value) : 0; // 0 is left out
}

struct values {
    const uint8_t *first;
    size_t count, axes; // of 4 bytes each
};

// All of it lies in the file.
static struct values values_of(size_t accessor_index) {
    static const char *const types[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    const json_t *accessor = json_array_get(list("accessors"), accessor_index);
    assert_non_null(accessor);
    const json_t *view = json_array_get(list("bufferViews"), number(accessor, "bufferView"));
    const char *type = json_string_value(json_object_get(accessor, "type"));
    size_t axes = 1;
    while (strcmp(types[axes], type) != 0)
        assert_true(++axes < 5);
    size_t component = number(accessor, "componentType");
    assert_true(component == 5125 || component == 5126);
    struct values values = {data + number(view, "byteOffset"), number(accessor, "count"), axes};
    assert_true(number(view, "byteOffset") % 4 == 0 && values.count > 0);
    assert_int_equal(4 * axes * values.count, number(view, "byteLength"));
    assert_true(number(view, "byteOffset") + number(view, "byteLength") <= data_size);
    return values;
}

static double value_at(const struct values *values, size_t i, size_t axis) {
    float value;
    memcpy(&value, values->first + 4 * (i * values->axes + axis), sizeof value);
    return (double)value;
}

static size_t node_named(const char *name) {
    size_t i;
    json_t *node;
    json_array_foreach(
        list("nodes"), i,
        node) if (!strcmp(json_string_value(json_object_get(node, "name")), name)) return i;
    fail_msg("no node %s", name);
    return 0;
}

// Of one node's animation; false where there is none.
static bool curve_of(size_t node, const char *path, struct values *times, struct values *values) {
    const json_t *animation = json_array_get(list("animations"), 0);
    size_t i;
    json_t *channel;
    json_array_foreach(json_object_get(animation, "channels"), i, channel) {
        const json_t *target = json_object_get(channel, "target");
        if (number(target, "node") != node ||
            strcmp(json_string_value(json_object_get(target, "path")), path) != 0)
            continue;
        const json_t *sampler =
            json_array_get(json_object_get(animation, "samplers"), number(channel, "sampler"));
        *times = values_of(number(sampler, "input"));
        *values = values_of(number(sampler, "output"));
        return true;
    }
    return false;
}

// ---- tests --------------------------------------------------------------------------------------

static void every_number_lies_in_the_file_and_every_index_in_its_mesh(void **state) {
    (void)state;
    struct error err = {""};
    if (gltf_check_envelope(file_bytes, file_size, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    for (size_t i = 0; i < json_array_size(list("accessors")); i++)
        values_of(i);
    size_t i;
    json_t *mesh;
    json_array_foreach(list("meshes"), i, mesh) {
        const json_t *primitive = json_array_get(json_object_get(mesh, "primitives"), 0);
        const json_t *attributes = json_object_get(primitive, "attributes");
        struct values positions = values_of(number(attributes, "POSITION"));
        struct values indices = values_of(number(primitive, "indices"));
        assert_true(indices.count % 3 == 0 && positions.axes == 3);
        for (size_t k = 0; k < indices.count; k++)
            assert_true(u32_at(indices.first + 4 * k) < positions.count);
        if (json_object_get(attributes, "TEXCOORD_0"))
            assert_int_equal(values_of(number(attributes, "TEXCOORD_0")).count, positions.count);
        assert_true(number(primitive, "material") < json_array_size(list("materials")));
    }
}

static void times_rise_from_0_and_each_has_its_value(void **state) {
    (void)state;
    const json_t *animation = json_array_get(list("animations"), 0);
    size_t i;
    json_t *sampler;
    json_array_foreach(json_object_get(animation, "samplers"), i, sampler) {
        struct values times = values_of(number(sampler, "input"));
        assert_int_equal(values_of(number(sampler, "output")).count, times.count);
        assert_true(value_at(&times, 0, 0) == 0);
        for (size_t k = 1; k < times.count; k++)
            assert_true(value_at(&times, k, 0) > value_at(&times, k - 1, 0));
    }
}

// At each key of the animation, which is that of a step.
static void compare_with_record(const char *node, bool warped, enum channel channel) {
    struct values times, places, turns, unused, shown;
    assert_true(curve_of(node_named(node), "translation", &times, &places));
    assert_true(curve_of(node_named(node), "rotation", &unused, &turns));
    assert_true(curve_of(node_named(node), "scale", &unused, &shown));
    struct trace_reader *reader;
    struct trace_record record;
    size_t key = 0, present = 0;
    assert_int_equal(trace_reader_create(trace_path, &reader, NULL), RESULT_OK);
    while (key < times.count && trace_read(reader, &record, NULL) == RESULT_OK) {
        const struct session_output *output = &record.output;
        if (record.type != TRACE_STEP ||
            fabs((double)output->time_ns / 1e9 - value_at(&times, key, 0)) > 1e-5)
            continue;
        const struct instrument_output *o =
            &output->instruments[channel - CHANNEL_FIRST_INSTRUMENT];
        pose expected = warped ? o->T_mockup_warped : o->T_mockup_tip;
        if (o->present) {
            present++;
            assert_near(value_at(&places, key, 0) * 1000, expected.translation.x, 1e-4);
            assert_near(value_at(&places, key, 2) * 1000, expected.translation.z, 1e-4);
            double dot = value_at(&turns, key, 0) * expected.rotation.x +
                         value_at(&turns, key, 1) * expected.rotation.y +
                         value_at(&turns, key, 2) * expected.rotation.z +
                         value_at(&turns, key, 3) * expected.rotation.w;
            assert_near(fabs(dot), 1, 1e-6);
        }
        key++;
    }
    trace_reader_destroy(&reader);
    assert_int_equal(key, times.count);
    assert_true(key > 500 && present > 100);
    for (size_t i = 1; i < turns.count; i++) { // no turn the long way round
        double dot = 0;
        for (size_t axis = 0; axis < 4; axis++)
            dot += value_at(&turns, i, axis) * value_at(&turns, i - 1, axis);
        assert_true(dot > -1e-6);
    }
}

static void instruments_move_as_recorded(void **state) {
    (void)state;
    compare_with_record("probe", true, CHANNEL_PROBE);
    compare_with_record("mockup_probe", false, CHANNEL_PROBE);
    compare_with_record("punch", true, CHANNEL_PUNCH);
}

static void turn_back(struct session_output *output) {
    quat *q =
        &output->instruments[CHANNEL_PROBE - CHANNEL_FIRST_INSTRUMENT].T_mockup_warped.rotation;
    if (output->step % 16 < 8)
        *q = (quat){-q->w, -q->x, -q->y, -q->z};
}

// The same rotations, half of them written with the other sign.
static void signs_of_rotations_turn_nothing(void **state) {
    (void)state;
    struct trace_header header = bites_header();
    struct export_request request = request_of(played.scene);
    struct error err = {""};
    close_scene();
    record(&header, 1, turn_back);
    assert_int_equal(export_gltf(&request, scene_path, &err), RESULT_OK);
    open_scene();
    compare_with_record("probe", true, CHANNEL_PROBE);
}

static void break_pose(struct session_output *output) {
    struct instrument_output *probe =
        &output->instruments[CHANNEL_PROBE - CHANNEL_FIRST_INSTRUMENT];
    if (output->step % 16 < 8)
        probe->T_mockup_warped.translation.x = NAN;
    output->T_mockup_virtual[BODY_TIBIA].rotation.w *= output->step % 16 < 8 ? 3 : 1;
}

// glTF knows no numbers that are none, and no rotation that stretches.
static void poses_that_are_none_are_left_out(void **state) {
    (void)state;
    struct trace_header header = bites_header();
    struct export_request request = request_of(played.scene);
    struct error err = {""};
    struct values times, values;
    close_scene();
    record(&header, 1, break_pose);
    assert_int_equal(export_gltf(&request, scene_path, &err), RESULT_OK);
    open_scene();
    assert_true(curve_of(node_named("probe"), "translation", &times, &values));
    for (size_t i = 0; i < values.count; i++)
        assert_true(isfinite(value_at(&values, i, 0)));
    assert_true(curve_of(node_named("bone_tibia"), "rotation", &times, &values));
    for (size_t i = 0; i < values.count; i++)
        assert_near(hypot(hypot(value_at(&values, i, 0), value_at(&values, i, 1)),
                          hypot(value_at(&values, i, 2), value_at(&values, i, 3))),
                    1, 1e-6);
}

static double scale_at(size_t node, double seconds) {
    struct values times, scales;
    if (!curve_of(node, "scale", &times, &scales))
        return 1;
    size_t key = 0;
    while (key + 1 < times.count && value_at(&times, key + 1, 0) <= seconds)
        key++;
    return value_at(&scales, key, 0);
}

// The one node of the medial meniscus that is seen; "meniscus_medial" and "meniscus_medial.N".
static const json_t *seen_at(double seconds) {
    const json_t *seen = NULL;
    size_t i;
    json_t *node;
    json_array_foreach(list("nodes"), i, node) {
        const char *name = json_string_value(json_object_get(node, "name"));
        if (strncmp(name, "meniscus_medial", 15) != 0 || scale_at(i, seconds) == 0)
            continue;
        assert_null(seen);
        seen = node;
    }
    assert_non_null(seen);
    return seen;
}

static size_t indices_of(const json_t *node) {
    const json_t *mesh = json_array_get(list("meshes"), number(node, "mesh"));
    const json_t *primitive = json_array_get(json_object_get(mesh, "primitives"), 0);
    return values_of(number(primitive, "indices")).count;
}

static void tissue_is_seen_as_it_was_cut_and_only_one_of_it(void **state) {
    (void)state;
    struct trace_reader *reader;
    struct trace_record record;
    struct session_output output;
    uint32_t triangles = 0;
    int landings = 0, medial = 0;
    assert_int_equal(trace_reader_create(trace_path, &reader, NULL), RESULT_OK);
    struct rerun *rerun = rerun_create(played.scene, &trace_reader_header(reader)->settings);
    while (strcmp(scene_case(played.scene)->groups[scene_tissue_group(played.scene, medial)].name,
                  "meniscus_medial") != 0)
        medial++;
    while (trace_read(reader, &record, NULL) == RESULT_OK) {
        if (record.type != TRACE_STEP)
            continue;
        rerun_step(rerun, &record, &output);
        const struct landed *landed = &output.landed;
        if (landed->job && landed->outcome == JOB_DONE && landed->tissue == medial) {
            const json_t *node = seen_at((double)output.time_ns / 1e9 + 1e-4);
            assert_int_equal(indices_of(node), 3 * triangles);
            seen_at((double)output.time_ns / 1e9 - 1e-4);
            landings++;
        }
        if (output.job.id)
            triangles = cut_mesh_triangle_count(operation_mesh(rerun_operation(rerun), medial));
    }
    rerun_destroy(&rerun);
    trace_reader_destroy(&reader);
    assert_true(landings > 4);
}

static void a_span_begins_at_0_with_what_was_cut_before(void **state) {
    (void)state;
    struct export_request request = request_of(played.scene);
    struct error err = {""};
    size_t after = indices_of(seen_at(8));
    assert_int_not_equal(after, indices_of(seen_at(0)));
    close_scene();
    request.from_s = 8;
    request.to_s = 9.5;
    assert_int_equal(export_gltf(&request, scene_path, &err), RESULT_OK);
    open_scene();
    struct values times, places;
    assert_true(curve_of(node_named("probe"), "translation", &times, &places));
    assert_true(value_at(&times, 0, 0) == 0);
    assert_near(value_at(&times, times.count - 1, 0), 1.5, 0.05);
    assert_int_equal(indices_of(seen_at(0)), after);
    request.from_s = 1e6;
    request.to_s = 1e7;
    assert_int_equal(export_gltf(&request, scene_path, &err), RESULT_MISSING);
    request = request_of(played.scene);
    assert_int_equal(export_gltf(&request, "/nowhere/a.glb", &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "/nowhere/a.glb"));
}

static void the_program_finds_the_case_that_the_trace_names(void **state) {
    (void)state;
    char line[500];
    snprintf(line, sizeof line, "%s export %s --gltf %s", TRACE_PROGRAM, trace_path, scene_path);
    assert_int_equal(system(line), 0);
    snprintf(line, sizeof line, "%s export %s --case /nowhere --gltf %s 2>&1 | grep -q /nowhere",
             TRACE_PROGRAM, trace_path, scene_path);
    assert_int_equal(system(line), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_number_lies_in_the_file_and_every_index_in_its_mesh),
        cmocka_unit_test(times_rise_from_0_and_each_has_its_value),
        cmocka_unit_test(instruments_move_as_recorded),
        cmocka_unit_test(tissue_is_seen_as_it_was_cut_and_only_one_of_it),
        cmocka_unit_test(a_span_begins_at_0_with_what_was_cut_before),
        cmocka_unit_test(poses_that_are_none_are_left_out),
        cmocka_unit_test(signs_of_rotations_turn_nothing),
        cmocka_unit_test(the_program_finds_the_case_that_the_trace_names),
    };
    return cmocka_run_group_tests_name("animation", tests, make, clear);
}
