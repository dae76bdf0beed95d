// INI files that a person writes (inih): [section], key = value, read once and never written. Every
// entry goes to a taker; what the taker does not know or like is refused by file, line, section and
// key.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>

// A value instead of the file's: --set section.key=value.
struct setting_override {
    const char *section, *key, *value;
};

// Cuts "section.key=value" in place, at the first dot: "device arm.tool.probe=pointer" is section
// "device arm", key "tool.probe". False where the text is not of that form.
bool setting_split(char *text, struct setting_override *out);

// True where the key is known and its value good.
typedef bool (*setting_taker)(void *user, const char *section, const char *key, const char *value);

// Gives all entries of the file, then the overrides, to the taker, and stops at the first that it
// refuses. RESULT_MISSING: the file cannot be read; RESULT_FORMAT: a line is no entry;
// RESULT_INVALID: an entry was refused.
enum result settings_read(const char *path, const struct setting_override *overrides,
                          int override_count, setting_taker take, void *user, struct error *err);

// The folder of a config file, absolute where it can be had.
void settings_folder(const char *path, char *out_dir, size_t size);

// Value into a text or path of a size; a path is relative to `dir`. False where it is empty or too
// long.
bool setting_text(const char *value, char *out, size_t size);
bool setting_path(const char *dir, const char *value, char *out, size_t size);
