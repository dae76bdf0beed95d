// Whether the system gives enough for one more session. What is left is kept for the sessions that
// run, for the local console and for instructors.
#pragma once

#include "base/result.h"

// RESULT_LIMIT says what is missing, and what to do.
enum result resources_allow_session(struct error *err);
