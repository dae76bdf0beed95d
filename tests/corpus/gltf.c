// Other people's glTF files, good and broken, in place of anatomy.glb: each is read in a process of
// its own under limits of memory and time, and held against the verdict of Khronos' validator.
// `--json` prints the table instead.

#include "case/gltf.h"

#include "case/case.h"
#include "case/files.h"
#include "models.h"
#include "test.h"
#include "unit/case_knee.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#define MEMORY_MAX ((rlim_t)512 << 20)
#define SECONDS_MAX 20

// What the validator calls an error and we take, and why.
static const struct {
    const char *file, *reason;
} passed_over[] = {
    {"accessor/byteoffset_no_bufferview.gltf", "the offset is 0 and no mesh uses the accessor"},
    {"accessor/empty_array.gltf", "a list without entries has nothing to read"},
    {"buffer_view/empty_array.gltf", "a list without entries has nothing to read"},
    {"mesh/bufferview_target_override.gltf", "target tells a graphics card what to do"},
    {"mesh/empty_array.gltf", "a list without entries has nothing to read"},
    {"node/empty_array.gltf", "a list without entries has nothing to read"},
    {"node/empty_children_array.gltf", "a list without entries has nothing to read"},
    {"node/matrix_indecomposable.gltf", "a node without a mesh is passed over"},
    {"node/matrix_trs.gltf", "a node without a mesh is passed over"},
    {"node/rotation_non_unit.gltf", "a node without a mesh is passed over"},
    {"node/unresolved_camera.gltf", "cameras are passed over"},
    {"node/unresolved_skin.gltf", "skins are passed over, and the node has no mesh"},
    {"node/weights_with_no_mesh.gltf", "a node without a mesh is passed over"},
    {"root/extensions_non_objects.gltf", "extensions that are not required are passed over"},
    {"root/extensions_undeclared_wrong_pointer.gltf",
     "extensions that are not required are passed over"},
    {"root/invalid_collection_type.gltf", "samplers are passed over"},
};

struct verdict {
    enum result result;
    uint32_t nodes;
    bool is_a_case;
    char text[384];
};

struct row {
    struct model model;
    struct verdict as_it_is, completed; // completed: in a GLB that lacks nothing else
    bool died;
};

static struct row *rows;
static size_t row_count;
static char folder[FOLDER_MAX];

static struct verdict read_in_child(const uint8_t *bytes, size_t size) {
    struct verdict verdict = {0};
    struct gltf_limits limits = {.nodes = 256, .triangles = 2000000};
    struct gltf *gltf = NULL;
    struct error err = {""};
    verdict.result = gltf_decode(bytes, size, &limits, &gltf, &err);
    if (gltf)
        verdict.nodes = gltf_node_count(gltf);
    gltf_destroy(&gltf);
    memcpy(verdict.text, err.text, sizeof verdict.text);
    struct named_bytes file = {"anatomy.glb", bytes, size};
    struct knee_case *knee = NULL;
    if (files_write(folder, &file, 1, &err) == RESULT_OK)
        verdict.is_a_case = case_load(folder, NULL, &knee, &err) == RESULT_OK;
    case_destroy(&knee);
    return verdict;
}

// False where the process died.
static bool judge(const struct model_bytes *bytes, struct verdict *out_verdict) {
    struct verdict *shared =
        mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(shared != MAP_FAILED);
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
// These map terabytes for themselves.
#if !defined __SANITIZE_ADDRESS__ && !defined __SANITIZE_THREAD__
        setrlimit(RLIMIT_AS, &(struct rlimit){MEMORY_MAX, MEMORY_MAX});
#endif
        setrlimit(RLIMIT_CPU, &(struct rlimit){SECONDS_MAX, SECONDS_MAX});
        *shared = read_in_child(bytes->data, bytes->size);
        _exit(0);
    }
    int status;
    assert_int_equal(pid, waitpid(pid, &status, 0));
    *out_verdict = *shared;
    munmap(shared, sizeof *shared);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static void judge_all(void) {
    rows = calloc(MODELS_MAX, sizeof *rows);
    struct model *models = calloc(MODELS_MAX, sizeof *models);
    row_count = models_find(models);
    for (size_t i = 0; i < row_count; i++) {
        struct model_bytes as_it_is = model_read(&models[i]);
        struct model_bytes completed = model_complete(&as_it_is, models[i].path);
        rows[i].model = models[i];
        rows[i].died = !judge(&as_it_is, &rows[i].as_it_is);
        rows[i].died |= !judge(&completed, &rows[i].completed);
        free(as_it_is.data);
        free(completed.data);
    }
    free(models);
}

// A GLB is judged as it is: a completed one has another container.
static const struct verdict *verdict_of(const struct row *row) {
    size_t length = strlen(row->model.name);
    return strcmp(row->model.name + length - 4, ".glb") == 0 ? &row->as_it_is : &row->completed;
}

static bool is_taken(const struct row *row) {
    return verdict_of(row)->result == RESULT_OK;
}

static const char *reason_for(const char *name) {
    for (size_t i = 0; i < sizeof passed_over / sizeof *passed_over; i++)
        if (strcmp(passed_over[i].file, name) == 0)
            return passed_over[i].reason;
    return NULL;
}

// ---- tests --------------------------------------------------------------------------------------

static void no_file_brings_the_reader_down_or_makes_a_case(void **state) {
    (void)state;
    for (size_t i = 0; i < row_count; i++) {
        const struct row *row = &rows[i];
        if (row->died)
            fail_msg("%s: the reader died", row->model.name);
        if (row->as_it_is.is_a_case || row->completed.is_a_case)
            fail_msg("%s became a case", row->model.name);
        if (row->as_it_is.result != RESULT_OK && !row->as_it_is.text[0])
            fail_msg("%s was refused without a word", row->model.name);
    }
}

static void what_the_validator_calls_an_error_is_refused_or_not_read(void **state) {
    (void)state;
    for (size_t i = 0; i < row_count; i++) {
        const struct row *row = &rows[i];
        const char *reason = reason_for(row->model.name);
        bool wrong = row->model.errors > 0 && is_taken(row);
        if (wrong && !reason)
            fail_msg("%s was taken (%u nodes) in spite of %s", row->model.name,
                     row->completed.nodes, row->model.codes);
        if (!wrong && reason)
            fail_msg("%s is listed but was not taken or has no error", row->model.name);
    }
}

// ---- the table ----------------------------------------------------------------------------------

static void count_rows(size_t counts[2][2]) {
    for (size_t i = 0; i < row_count; i++)
        if (rows[i].model.errors >= 0)
            counts[is_taken(&rows[i])][rows[i].model.errors > 0]++;
}

static json_t *row_json(const struct row *row) {
    const char *reason = reason_for(row->model.name);
    return json_pack(
        "{s:s, s:i, s:s, s:s, s:s, s:s, s:i, s:s*}", "file", row->model.name, "validator_errors",
        row->model.errors, "validator_codes", row->model.codes, "as_it_is",
        row->as_it_is.result == RESULT_OK ? "accepted" : row->as_it_is.text, "completed",
        row->completed.result == RESULT_OK ? "accepted" : row->completed.text, "verdict",
        is_taken(row) ? "accepted" : "refused", "nodes", (int)row->completed.nodes, "reason",
        reason);
}

static void print_json(void) {
    size_t counts[2][2] = {{0}};
    count_rows(counts);
    json_t *files = json_array();
    for (size_t i = 0; i < row_count; i++)
        json_array_append_new(files, row_json(&rows[i]));
    json_t *root =
        json_pack("{s:i, s:i, s:i, s:i, s:o}", "refused_with_errors", (int)counts[0][1],
                  "refused_without", (int)counts[0][0], "accepted_with_errors", (int)counts[1][1],
                  "accepted_without", (int)counts[1][0], "files", files);
    json_dumpf(root, stdout, JSON_INDENT(1));
    puts("");
    json_decref(root);
}

static void print_sums(void) {
    size_t counts[2][2] = {{0}};
    count_rows(counts);
    printf("glTF files with a verdict: with errors %zu refused, %zu accepted; without %zu refused, "
           "%zu accepted\n",
           counts[0][1], counts[1][1], counts[0][0], counts[1][0]);
}

// A case of two boxes, whose manifest says nothing of the anatomy's bytes.
static void write_manifest(void) {
    static const char *const groups[] = {"tibia", "femur"};
    struct knee_case *knee = case_create("corpus", "");
    struct error err;
    for (int i = 0; i < 2; i++) {
        struct mesh mesh;
        box_mesh((vec3){0, 0, i ? 40 : -40}, (vec3){40, 30, 30}, &mesh);
        struct case_group *group = case_add_group(knee, groups[i], i ? BODY_FEMUR : BODY_TIBIA);
        assert_int_equal(RESULT_OK, case_add_part(group, groups[i], &mesh, &err));
        mesh_fini(&mesh);
    }
    assert_int_equal(RESULT_OK, case_save(knee, folder, &err));
    case_destroy(&knee);
    char path[300];
    snprintf(path, sizeof path, "%s/case.json", folder);
    json_t *manifest = json_load_file(path, 0, NULL);
    json_object_del(manifest, "anatomy_xxh3");
    assert_int_equal(0, json_dump_file(manifest, path, 0));
    json_decref(manifest);
    assert_int_equal(RESULT_OK, case_load(folder, NULL, &knee, &err)); // as it stands
    case_destroy(&knee);
}

int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_file_brings_the_reader_down_or_makes_a_case),
        cmocka_unit_test(what_the_validator_calls_an_error_is_refused_or_not_read),
    };
    if (!models_are_here()) {
        printf("skipped: no shared data (ARTHRON_DATA)\n");
        return 77;
    }
    folder_make(folder);
    write_manifest();
    judge_all();
    bool json = argc > 1 && strcmp(argv[1], "--json") == 0;
    if (json)
        print_json();
    else
        print_sums();
    int failed = json ? 0 : cmocka_run_group_tests_name("gltf_corpus", tests, NULL, NULL);
    folder_remove(folder);
    free(rows);
    return failed;
}
