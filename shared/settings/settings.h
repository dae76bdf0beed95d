// INI files that a person writes (inih): [section], key = value, read once and never written.
//
// A program describes the sections and keys that it knows in tables. They say where a value goes
// and which values are good, so that a refusal can say so too: the range, the choices, the nearest
// name.
//
//     static const char *const starts[] = {"auto", "command", NULL};
//     static const struct setting_key station_keys[] = {
//         {"case", SETTING_TEXT, SETTING_IN(struct place, case_name)},
//         {"port", SETTING_INTEGER, SETTING_IN(struct place, port), .low = 1, .high = 65535},
//         {"start", SETTING_CHOICE, SETTING_IN(struct place, start), .choices = starts},
//         {"contact.", .take = take_contact, .wanted = "a button from 0 to 31"},
//         {0}};
//     static const struct setting_section sections[] = {
//         {"station NAME", station_keys, place_named}, {0}};
//
// A section or key that is given twice is refused, and so is a line that inih would cut.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>

enum setting_kind {
    SETTING_OTHER,   // the key's own `take` reads it
    SETTING_TEXT,    // char[size], not empty
    SETTING_PATH,    // char[size], not empty; a relative one begins at the file's folder
    SETTING_INTEGER, // int, from low to high
    SETTING_NUMBER,  // double, from low to high
    SETTING_SWITCH,  // bool: yes or no
    SETTING_CHOICE,  // int or enum: the index in `choices`
};

struct setting_key {
    const char *name; // "port"; "contact." stands for contact.ANYTHING, "*" for any key
    enum setting_kind kind;
    size_t offset, size; // of the member in the section's struct: SETTING_IN
    double low, high;
    const char *const *choices; // ended by NULL

    // SETTING_OTHER. `target` is what the section's `find` returned; `rest` is what follows the "."
    // or stands for the "*", else "". False: the value is not good, and the error says `wanted`.
    bool (*take)(void *target, const char *rest, const char *value);
    const char *wanted; // "up to 8 names": completes "must be"
};

#define SETTING_IN(type, member) offsetof(type, member), sizeof(((type *)NULL)->member)

struct setting_section {
    // "server"; "station NAME" stands for [station ANYTHING]: all behind the first blank is a name
    // that the file chooses, and what stands there in the table is only shown.
    const char *name;
    const struct setting_key *keys; // ended by a NULL name

    // Where values of the section go. `name` is the one that the file chose, else "". NULL: there
    // can be no such section, and *err says why.
    void *(*find)(void *user, const char *name, struct error *err);
};

// A value instead of the file's: --set section.key=value.
struct setting_override {
    const char *section, *key, *value;
};

// Cuts "section.key=value" in place, at the first dot: "device arm.tool.probe=pointer" is section
// "device arm", key "tool.probe". False where the text is not of that form.
bool setting_split(char *text, struct setting_override *out);

// Reads all entries of the file, then the overrides, and stops at the first that is refused; the
// error names the file and the line, or --set. RESULT_MISSING: the file cannot be read;
// RESULT_FORMAT: a line is no entry; RESULT_INVALID: an entry was refused.
enum result settings_load(const char *path, const struct setting_override *overrides,
                          int override_count, const struct setting_section *sections, void *user,
                          struct error *err);

// The same for a file's text in memory, of at least one byte, without overrides; path: where it
// comes from, for errors and paths in it.
enum result settings_load_text(const char *path, const char *text, size_t size,
                               const struct setting_section *sections, void *user,
                               struct error *err);

// The same for a program that has no tables: true where the key is known and its value good.
typedef bool (*setting_taker)(void *user, const char *section, const char *key, const char *value);
enum result settings_read(const char *path, const struct setting_override *overrides,
                          int override_count, setting_taker take, void *user, struct error *err);

// The folder of a config file, absolute where it can be had.
void settings_folder(const char *path, char *out_dir, size_t size);

// Value into a text or path of a size; a path is relative to `dir`. False where it is empty or too
// long.
bool setting_text(const char *value, char *out, size_t size);
bool setting_path(const char *dir, const char *value, char *out, size_t size);
