// A file of recorded messages (MCAP, https://mcap.dev/spec): chunks without compression, each with
// an index, and a summary at the end.
#pragma once

#include "base/result.h"

#include <stddef.h>
#include <stdint.h>

struct mcap;

// RESULT_MISSING where the folder is not there, RESULT_IO where no file can be made in it. What
// fails later is told by mcap_finish.
enum result mcap_create(const char *path, const char *library, struct mcap **out_mcap,
                        struct error *err);

// Facts about the whole file; before the first message. `pairs`: names and values in turn.
void mcap_metadata(struct mcap *mcap, const char *name, const char *const *pairs, int pair_count);

// A schema of protobuf: the message's full name, and a FileDescriptorSet that has it. Schemas are
// numbered from 1, channels from 0, as they come. All of them come before the first message.
uint16_t mcap_schema(struct mcap *mcap, const char *name, const uint8_t *data, size_t size);
uint16_t mcap_channel(struct mcap *mcap, uint16_t schema, const char *topic);

// time_ns: since 1970-01-01 UTC.
void mcap_message(struct mcap *mcap, uint16_t channel, uint64_t time_ns, const uint8_t *data,
                  size_t size);

// The file takes its place complete, or there is none. *mcap becomes NULL.
enum result mcap_finish(struct mcap **mcap, struct error *err);
void mcap_abandon(struct mcap **mcap); // no file
