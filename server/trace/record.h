// Bytes of a header and of records, for this room only. FORMAT.md describes them field by field.
#pragma once

#include "trace/trace.h"

// Before and after a payload: u32 size and u8 type; u64 checksum.
#define RECORD_PREFIX 5
#define RECORD_CHECKSUM 8
#define RECORD_PAYLOAD_MAX 8192
#define RECORD_MAX (RECORD_PREFIX + RECORD_PAYLOAD_MAX + RECORD_CHECKSUM)

// Before and after the fields of a header: magic, u16 version and u32 size; u64 checksum.
#define HEADER_MAGIC "ARTHRTRC"
#define HEADER_PREFIX 14
#define HEADER_FIELDS_MAX 8192
#define HEADER_MAX (HEADER_PREFIX + HEADER_FIELDS_MAX + RECORD_CHECKSUM)

// Each returns the size of the whole. `out` holds HEADER_MAX or RECORD_MAX bytes.
size_t header_encode(const struct trace_header *header, uint8_t *out);
size_t record_encode_step(const struct session_input *input, const struct session_output *output,
                          uint8_t *out);
size_t record_encode_gap(uint64_t missing, uint8_t *out);
size_t record_encode_end(uint64_t records, uint64_t missing, uint8_t *out);

// What the first bytes say about the rest. RESULT_FORMAT, RESULT_VERSION, RESULT_LIMIT.
enum result header_decode_prefix(const uint8_t *prefix, size_t *out_rest, struct error *err);
enum result record_decode_prefix(const uint8_t *prefix, size_t *out_rest, struct error *err);

// The whole, prefix and checksum included. RESULT_CORRUPT, RESULT_FORMAT.
enum result header_decode(const uint8_t *data, size_t size, struct trace_header *out_header,
                          struct error *err);
enum result record_decode(const uint8_t *data, size_t size, struct trace_record *out_record,
                          struct error *err);
