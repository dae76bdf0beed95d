// Bytes of a header and of records, for this room only. FORMAT.md describes them field by field.
#pragma once

#include "trace/chain.h"

// Before a payload: u32 size and u8 type. After it: a checksum.
#define RECORD_PREFIX 5
#define RECORD_PAYLOAD_MAX 10240
#define TOUCH_PREFIX 17 // before the bytes of a part
#define TOUCH_PART_MAX (8192 - TOUCH_PREFIX)
#define STATE_PREFIX 8 // too
#define STATE_PART_MAX (8192 - STATE_PREFIX)
#define RECORD_MAX (RECORD_PREFIX + RECORD_PAYLOAD_MAX + TRACE_HASH_SIZE)

// Before the fields of a header: magic, u16 version and u32 size. After them: a checksum.
#define HEADER_MAGIC "ARTHRTRC"
#define HEADER_PREFIX 14
#define HEADER_FIELDS_MAX 8192
#define HEADER_MAX (HEADER_PREFIX + HEADER_FIELDS_MAX + TRACE_HASH_SIZE)

// Times are added and subtracted: this keeps them from overflowing for 73 years of either sign.
#define TIME_MAX_NS (INT64_MAX / 4)

static inline bool time_is_sane(int64_t time_ns) {
    return time_ns >= -TIME_MAX_NS && time_ns <= TIME_MAX_NS;
}

// Times of day, since 1970: a session's length is added to them.
static inline bool utc_is_sane(int64_t utc_ns) {
    return utc_ns >= 0 && utc_ns <= INT64_MAX / 2;
}

// The content of an end record. Without a signature both sizes are 0.
struct trace_end {
    uint64_t records, missing;
    size_t certificate_size, signature_size;
    uint8_t certificate[TRACE_CERTIFICATE_MAX]; // X.509, DER
    uint8_t signature[TRACE_SIGNATURE_MAX];
};

// The bytes of a step depend on these.
struct trace_layout {
    unsigned version;
    int rules;     // of the header's settings
    int described; // instruments, as there
    int loose;     // of the header's loose bodies
};
struct trace_layout layout_of(const struct trace_header *header, unsigned version);

// Each returns the size of the whole record and adds the record to the chain; chain NULL: zeros are
// in the place of its hash. `out` holds HEADER_MAX or RECORD_MAX bytes.
size_t header_encode(const struct trace_header *header, struct chain *chain, uint8_t *out);
size_t record_encode_step(const struct session_input *input, bool job_done,
                          const struct session_output *output, int rules, struct chain *chain,
                          uint8_t *out);
size_t record_encode_past(const struct session_input *input, bool job_done, struct chain *chain,
                          uint8_t *out);
size_t record_encode_gap(uint64_t missing, struct chain *chain, uint8_t *out);
size_t record_encode_resume(int64_t utc_ns, struct chain *chain, uint8_t *out);
size_t record_encode_fault(int64_t utc_ns, struct chain *chain, uint8_t *out);
size_t record_encode_remark(const struct remark *remark, struct chain *chain, uint8_t *out);
size_t record_encode_marker(const struct marker *marker, struct chain *chain, uint8_t *out);
size_t record_encode_begun(const struct trace_attempt *attempt, struct chain *chain, uint8_t *out);
size_t record_encode_ended(const struct trace_outcome *outcome, struct chain *chain, uint8_t *out);
size_t record_encode_touch(const struct trace_touch_part *part, struct chain *chain, uint8_t *out);
size_t record_encode_state(const struct trace_state_part *part, struct chain *chain, uint8_t *out);
// Of a record of TRACE_TAKEN.
size_t record_encode_taken(const struct trace_record *record, int rules, struct chain *chain,
                           uint8_t *out);
size_t record_encode_end(const struct trace_end *end, struct chain *chain, uint8_t *out);

// The version, and the number of bytes after the prefix. RESULT_FORMAT, RESULT_VERSION,
// RESULT_LIMIT.
enum result header_decode_prefix(const uint8_t *prefix, unsigned *out_version, size_t *out_rest,
                                 struct error *err);
enum result record_decode_prefix(const uint8_t *prefix, unsigned version, size_t *out_rest,
                                 struct error *err);

// At the end of a header or record.
size_t checksum_size(unsigned version);
// Continues the chain by the checksum in the file even if it is wrong, so that a sound record after
// a damaged one still matches.
bool checksum_matches(const uint8_t *data, size_t size, unsigned version, struct chain *chain);

// The whole, prefix and checksum included. RESULT_CORRUPT, RESULT_FORMAT. *out_end is set where the
// record is an end.
enum result header_decode(const uint8_t *data, size_t size, unsigned version, struct chain *chain,
                          struct trace_header *out_header, struct error *err);
// The same without a look at the checksum.
enum result header_decode_bare(const uint8_t *data, size_t size, unsigned version,
                               struct trace_header *out_header, struct error *err);
enum result record_decode(const uint8_t *data, size_t size, struct trace_layout layout,
                          struct chain *chain, struct trace_record *out_record,
                          struct trace_end *out_end, struct error *err);
// The same for prefix and payload of one that was not damaged or has no hash.
enum result record_decode_bare(const uint8_t *data, size_t size, struct trace_layout layout,
                               struct trace_record *out_record, struct trace_end *out_end,
                               struct error *err);

// The signed message: out_message holds TRACE_SEAL_SIZE bytes.
void seal_message(const uint8_t hash[TRACE_HASH_SIZE], uint64_t records, uint64_t missing,
                  uint8_t *out_message);
