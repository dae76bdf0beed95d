// What a course asks of its trainees, for the files that answer about it.
#pragma once

#include "api/call.h"
#include "store/courses.h"

// The curriculum of the course of the path; the caller frees it. NULL after a refusal, also of a
// trainee who is not in the course.
struct curriculum *curriculum_read(struct api_call *call, const char *course, bool in_force);

json_t *curriculum_task_json(const struct api_call *call, const struct curriculum_task *task);
