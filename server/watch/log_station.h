// Whom a line of the log is about.
#pragma once

#include <stddef.h>

// The name in a text that begins with "station NAME: ", not terminated; NULL: it begins otherwise.
const char *log_station(const char *text, size_t *out_size);
