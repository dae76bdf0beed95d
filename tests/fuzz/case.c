// A case folder: case.json up to the first zero byte, then anatomy.glb.
#include "case/case.h"

#include "base/check.h"
#include "check/inspect.h"
#include "fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const struct case_limits limits = {1 << 20, 20000};
    static struct inspection inspection;
    struct error err;
    struct knee_case *knee;
    size_t manifest, anatomy;
    const uint8_t *rest = fuzz_split(data, size, 0, &manifest, &anatomy);
    fuzz_file("case.json", data, manifest);
    fuzz_file("anatomy.glb", rest, anatomy);
    if (case_load(fuzz_folder(), &limits, &knee, &err) != RESULT_OK)
        return 0;
    CHECK(case_validate(knee, &err) == RESULT_OK);
    inspect_case(knee, &inspection);
    case_destroy(&knee);
    return 0;
}
