// Reads the entries of an INI file, one by one, with inih. Refuses entries that inih would accept
// silently: sections and keys given twice, lines that are cut, values that go on in the next line.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>

// False: refused, and *err says why, without file and line.
typedef bool (*entry_taker)(void *user, const char *section, const char *key, const char *value,
                            struct error *err);

// Results and the rest of the error as settings_load has them.
enum result entries_read(const char *path, entry_taker take, void *user, struct error *err);
// The same for a file's text in memory, of at least one byte; path: for errors.
enum result entries_read_text(const char *path, const char *text, size_t size, entry_taker take,
                              void *user, struct error *err);
