// States of sessions for tests of journals, as bytes: whole, with any place and content.
#pragma once

#include "trace/state.h"

struct trace_header made_header(void);
// Its place is at the offset, its content the number (u32). The caller frees it. One thread.
uint8_t *made_state(uint64_t offset, uint32_t number, size_t *out_size);
