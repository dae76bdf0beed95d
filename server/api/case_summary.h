// Summaries of the config's cases for pages. The files may change while the server runs: after a
// change a thread of low priority reads the case again. Any thread may call, and waits for no
// reading: until then the summary says that the case is being read.
#pragma once

#include "api/api.h"

#include <jansson.h>

struct case_summaries;

// check: as in api_config
struct case_summaries *case_summaries_create(const struct api_case *cases, int count,
                                             case_checker check);
void case_summaries_destroy(struct case_summaries **summaries); // NULL inside is fine

// A new object, as CASE in docs/API.md. out_hash: empty if the case cannot be read.
json_t *case_summary(struct case_summaries *summaries, int index, char out_hash[17]);

// The case's hash. RESULT_TIMEOUT: it is being read. RESULT_MISSING: it cannot be read.
enum result case_summary_hash(struct case_summaries *summaries, int index, uint64_t *out_hash);
