// Tasks of the library and their pass marks, for the files that answer about courses and attempts.
#pragma once

#include "api/call.h"
#include "store/courses.h"

// NULL: the library has no such task.
const struct task *task_find(const struct api_call *call, const char *name);
// The same; NULL after a refusal.
const struct task *task_need(struct api_call *call, const char *name);
json_t *task_title(const struct api_call *call, const char *name); // null: it is not there

// The pass mark in force: that of the records, or the task file's. False after a refusal.
bool task_mark(struct api_call *call, const struct task *task, struct pass_mark *out);
json_t *task_mark_json(const struct pass_mark *mark);
