// What a page is told of the config's cases. Their files may change while the server runs: each is
// read again when it did, and kept otherwise. From any threads; a case that is read keeps the
// others waiting.
#pragma once

#include "api/api.h"

#include <jansson.h>

struct case_summaries;

struct case_summaries *case_summaries_create(const struct api_case *cases, int count);
void case_summaries_destroy(struct case_summaries **summaries); // NULL inside is fine

// A new object, as CASE in docs/API.md. out_hash: empty where the case cannot be read.
json_t *case_summary(struct case_summaries *summaries, int index, char out_hash[17]);
