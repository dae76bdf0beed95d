// A trace file, its checksums put right: made into all that others can read.
#include "export/export.h"

#include "base/check.h"
#include "fuzz/boxes.h"
#include "fuzz/fuzz.h"
#include "review/page.h"
#include "unit/trace_mend.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static bool has_read(enum result result) {
    return result == RESULT_OK || result == RESULT_MISSING || result == RESULT_CORRUPT ||
           result == RESULT_FORMAT;
}

static size_t count_in(const char *text, char what) {
    size_t count = 0;
    for (; *text && *text != '\n'; text++)
        count += *text == what;
    return count;
}

// Each row has a value, or none, for each name.
static void look_at_table(const char *text) {
    size_t columns = count_in(text, ',');
    for (const char *row = text; *row; row = strchr(row, '\n') + 1) {
        CHECK(strchr(row, '\n'));
        CHECK(count_in(row, ',') == columns);
    }
}

static void make_table(const struct export_request *request) {
    char *text;
    size_t size;
    struct error err;
    FILE *file = open_memstream(&text, &size);
    CHECK(file);
    enum result result = export_csv(request, file, &err);
    CHECK(fclose(file) == 0);
    if (has_read(result))
        look_at_table(text);
    free(text);
}

static void make_page(const char *trace) {
    char *text;
    size_t size;
    struct error err;
    bool whole = true;
    FILE *file = open_memstream(&text, &size);
    CHECK(file);
    struct review_source source = {.trace = trace, .case_dir = fuzz_folder()}; // has no case
    enum result result = review_write_page(&source, file, &whole, &err);
    CHECK(fclose(file) == 0);
    CHECK((result == RESULT_OK) == (size > 0));
    free(text);
}

static void make_file(const struct export_request *request, const char *name,
                      enum result (*make)(const struct export_request *, const char *,
                                          struct error *)) {
    char path[320];
    struct stat status;
    struct error err;
    snprintf(path, sizeof path, "%s/%s", fuzz_folder(), name);
    remove(path);
    if (make(request, path, &err) == RESULT_OK)
        CHECK(stat(path, &status) == 0 && status.st_size > 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    uint8_t *mended = alloc(size + 1, 1);
    memcpy(mended, data, size);
    trace_mend(mended, size);
    char trace[320];
    snprintf(trace, sizeof trace, "%s", fuzz_file("a.trace", mended, size));
    struct export_request request = {
        .trace = trace, .from_s = -INFINITY, .to_s = INFINITY, .scene = boxes()};
    make_table(&request);
    make_page(trace);
    make_file(&request, "a.exr", export_exr);
    make_file(&request, "a.glb", export_gltf);
    make_file(&request, "a.mcap", export_mcap);
    free(mended);
    return 0;
}
