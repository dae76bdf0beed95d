// An attempt in words, on stdout: for people, and as one JSON object.
#pragma once

#include "task/attempt.h"

// why: why the attempt stands as it does, empty where there is nothing to say.
void tell_text(const struct task *task, const struct attempt *attempt, const char *why);
// The object (jansson); the caller releases it.
struct json_t *tell_object(const struct task *task, const struct attempt *attempt, const char *why);
// For the records, as compact JSON: what the attempt came to, {"goals": [...], "resections": [...]},
// and its errors with their steps, an array. False, and an empty text, where it does not fit.
bool tell_figures(const struct site *site, const struct attempt *attempt, char *out, size_t size);
bool tell_occurrences(const struct site *site, const struct attempt *attempt, char *out,
                      size_t size);
void tell_json(const struct task *task, const struct attempt *attempt, const char *why);
