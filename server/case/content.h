// What a case is, to the byte: one SHA-256 for the files that make it. In the case's folder
//
//     sha256sum anatomy.glb case.json | sha256sum
//
// gives the same. A check of it (check.json) is no part of it.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stdint.h>

#define CONTENT_HASH_SIZE 65 // 64 hexadecimal digits, small letters
#define CONTENT_FILES 2

extern const char *const content_names[CONTENT_FILES];

struct content_file {
    uint64_t size;
    char hash[CONTENT_HASH_SIZE];
};

bool content_is_hash(const char *text);

// RESULT_MISSING, RESULT_INVALID (no regular file), RESULT_LIMIT, RESULT_IO. The error names the
// path.
enum result content_read_file(const char *path, uint64_t max_bytes, struct content_file *out,
                              struct error *err);

// Of the files in the order of content_names.
void content_hash(const struct content_file files[CONTENT_FILES], char out_hash[CONTENT_HASH_SIZE]);

// Of the files in a folder, of at most the bytes that case_limits_default allows each.
enum result content_read(const char *dir, struct content_file out_files[CONTENT_FILES],
                         struct error *err);
