// A trace file, its checksums put right: read, and run again on a knee of boxes.
#include "base/bytes.h"
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "trace/replay.h"
#include "unit/case_knee.h"

#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

// Magic and version, size of the fields, fields, checksum.
static size_t mend_header(uint8_t *data, size_t size) {
    struct reader r = {data, size, 0};
    read_bytes(&r, 10);
    size_t used = 14 + (size_t)read_u32(&r);
    if (r.underflow || used + 8 > size)
        return size;
    struct writer w = {data, size, used};
    write_u64(&w, XXH3_64bits(data, used));
    return w.used;
}

// Size of the payload, type, payload, checksum.
static size_t mend_record(uint8_t *data, size_t size, size_t at) {
    struct reader r = {data, size, at};
    size_t used = 5 + (size_t)read_u32(&r);
    if (r.underflow || used + 8 > size - at)
        return size;
    struct writer w = {data, size, at + used};
    write_u64(&w, XXH3_64bits(data + at, used));
    return w.used;
}

static const struct scene *boxes(void) {
    static struct scene *scene;
    struct knee_case *knee;
    if (!scene) {
        knee = box_knee();
        CHECK(scene_create(&knee, &scene, NULL) == RESULT_OK);
    }
    return scene;
}

static void read_all(const char *path) {
    static struct trace_record record;
    static struct session_output output;
    struct trace_reader *reader;
    struct error err;
    if (trace_reader_create(path, &reader, &err) != RESULT_OK)
        return;
    struct rerun *rerun = rerun_create(boxes(), &trace_reader_header(reader)->settings);
    int64_t time_ns = 0;
    enum result result;
    while ((result = trace_read(reader, &record, &err)) == RESULT_OK) {
        if (record.type != TRACE_STEP)
            continue;
        CHECK(record.input.time_ns >= time_ns);
        CHECK(record.input.kind != INPUT_FRAME || frame_is_valid(&record.input.frame));
        time_ns = record.input.time_ns;
        rerun_step(rerun, &record, &output);
    }
    rerun_destroy(&rerun);
    CHECK(trace_read(reader, &record, &err) == result);
    CHECK(trace_reader_offset(reader) <= trace_reader_size(reader));
    trace_reader_destroy(&reader);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    uint8_t *mended = alloc(size + 1, 1);
    memcpy(mended, data, size);
    for (size_t at = mend_header(mended, size); at < size;)
        at = mend_record(mended, size, at);
    read_all(fuzz_file("a.trace", mended, size));
    free(mended);
    return 0;
}
