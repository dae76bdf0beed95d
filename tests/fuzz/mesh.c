// A surface file; the first byte, 0 to 6 as a letter, names its format.
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "import/import.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const struct case_limits limits = {1 << 20, 20000};
    static const char *const names[] = {"a.ply", "a.obj", "a.stl", "a.off", "a.vtk", "a.glb", "a.gltf"};
    if (!size)
        return 0;
    const char *path = fuzz_file(names[(uint8_t)(data[0] - '0') % 7], data + 1, size - 1);
    struct import_source source = {path, 1, pose_identity(), NULL};
    struct repair_report report;
    struct mesh mesh;
    struct error err;
    if (import_mesh(&source, &limits, &mesh, &report, &err) != RESULT_OK)
        return 0;
    CHECK(mesh_validate(&mesh, &err) == RESULT_OK);
    mesh_fini(&mesh);
    return 0;
}
