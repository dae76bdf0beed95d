// A trace file, its checksums put right: read, scored, and run again on a knee of boxes.
#include "base/check.h"
#include "fuzz/boxes.h"
#include "fuzz/fuzz.h"
#include "metrics/metrics.h"
#include "trace/replay.h"
#include "trace/state.h"
#include "unit/trace_mend.h"

#include <stdlib.h>
#include <string.h>

static void look(void *context, const struct metric_value *value) {
    const struct metric_kind *kind = &metric_kinds[value->metric];
    CHECK(value->group < CASE_GROUPS_MAX && value->tissue < TISSUES_MAX);
    CHECK(strcmp(kind->unit, "s") != 0 || !(value->value < 0));
    ++*(int *)context;
}

static void read_all(const char *path) {
    static struct trace_record record;
    static struct session_output output;
    static struct metrics metrics;
    int figures = 0;
    struct trace_reader *reader;
    struct error err;
    if (trace_reader_create(path, &reader, &err) != RESULT_OK)
        return;
    struct rerun *rerun = rerun_create(boxes(), &trace_reader_header(reader)->settings);
    int64_t time_ns = 0;
    enum result result;
    metrics_init(&metrics, instruments_usual(), view_optic_usual());
    while ((result = trace_read(reader, &record, &err)) == RESULT_OK) {
        CHECK(record.type != TRACE_REMARK || remark_is_valid(&record.remark));
        CHECK(record.type != TRACE_MARKER || marker_is_valid(&record.marker));
        CHECK(record.type != TRACE_BEGUN || trace_attempt_is_valid(&record.begun));
        CHECK(record.type != TRACE_ENDED || trace_outcome_is_valid(&record.ended));
        if (record.state && rerun_take_over(rerun, record.state, &err) == RESULT_OK)
            time_ns = record.state->place.time_ns;
        if (!record_is_input(&record))
            continue;
        CHECK(record.input.time_ns >= time_ns);
        CHECK(record.input.kind != INPUT_FRAME || frame_is_valid(&record.input.frame));
        time_ns = record.input.time_ns;
        rerun_step(rerun, &record, &output);
        if (record.type == TRACE_STEP)
            metrics_step(&metrics, &record.input, &record.output);
    }
    metrics_each(&metrics, NULL, look, &figures);
    CHECK(figures > 0);
    rerun_destroy(&rerun);
    CHECK(trace_read(reader, &record, &err) == result);
    uint64_t left_out;
    while (result != RESULT_CLOSED && trace_skip_damage(reader, &left_out, &err) == RESULT_OK) {
        CHECK(left_out > 0);
        while ((result = trace_read(reader, &record, &err)) == RESULT_OK)
            continue;
    }
    CHECK(trace_reader_offset(reader) <= trace_reader_size(reader));
    trace_reader_destroy(&reader);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    uint8_t *mended = alloc(size + 1, 1);
    memcpy(mended, data, size);
    trace_mend(mended, size);
    read_all(fuzz_file("a.trace", mended, size));
    free(mended);
    return 0;
}
