// Texts from outside, before they are kept.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>

// Valid UTF-8 without control characters, from 1 byte to size - 1. what: how the error calls it.
enum result text_check(const char *text, const char *what, size_t size, struct error *err);
