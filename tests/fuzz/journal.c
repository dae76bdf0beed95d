// The records of a journal, as they come from other servers: what is taken is in its ranges, and is
// taken again as it is packed.
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "trace/part.h"

static void look(const struct trace_record *record) {
    CHECK(record->type != TRACE_REMARK || remark_is_valid(&record->remark));
    CHECK(record->type != TRACE_MARKER || marker_is_valid(&record->marker));
    CHECK(record->type != TRACE_BEGUN || trace_attempt_is_valid(&record->begun));
    CHECK(record->type != TRACE_ENDED || trace_outcome_is_valid(&record->ended));
    CHECK(record->type != TRACE_PAST || input_is_command(record->input.kind));
    CHECK(record->type != TRACE_TAKEN ||
          (record->output.job.id && record->output.job.tissue < TISSUES_MAX &&
           record->output.job.move_count <= JOB_MOVES_MAX));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct trace_record record, again;
    static uint8_t packed[TRACE_PACKED_MAX];
    struct error err;
    size_t at = 0;
    enum result result;
    while ((result = trace_record_unpack(data, size, RULES_NEWEST, &at, &record, &err)) ==
           RESULT_OK) {
        size_t end = 0;
        look(&record);
        size_t bytes = trace_record_pack(&record, RULES_NEWEST, packed);
        CHECK(bytes <= sizeof packed);
        CHECK(trace_record_unpack(packed, bytes, RULES_NEWEST, &end, &again, &err) == RESULT_OK);
        CHECK(end == bytes && again.type == record.type);
    }
    CHECK(result == RESULT_CLOSED ? at >= size : result == RESULT_FORMAT);
    return 0;
}
