// A trace file, its checksums put right.
#include "trace/trace.h"

#include "base/bytes.h"
#include "base/check.h"
#include "fuzz/fuzz.h"

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

static void read_all(const char *path) {
    static struct trace_record record;
    struct trace_reader *reader;
    struct error err;
    if (trace_reader_create(path, &reader, &err) != RESULT_OK)
        return;
    int64_t time_ns = INT64_MIN;
    enum result result;
    while ((result = trace_read(reader, &record, &err)) == RESULT_OK) {
        if (record.type != TRACE_STEP)
            continue;
        CHECK(record.input.time_ns >= time_ns);
        CHECK(record.input.kind != INPUT_FRAME || frame_is_valid(&record.input.frame));
        time_ns = record.input.time_ns;
    }
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
