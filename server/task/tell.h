// An attempt in words, on stdout: for people, and as one JSON object.
#pragma once

#include "task/attempt.h"

// why: why the attempt stands as it does, empty where there is nothing to say.
void tell_text(const struct task *task, const struct attempt *attempt, const char *why);
// The object (jansson); the caller releases it.
struct json_t *tell_object(const struct task *task, const struct attempt *attempt, const char *why);
void tell_json(const struct task *task, const struct attempt *attempt, const char *why);
