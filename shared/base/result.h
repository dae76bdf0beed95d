// The result of a function that handles outside data (wire, file, device, browser).
// A caller's own bug is not a result: it fails a CHECK (base/check.h).
#pragma once

#include <stddef.h>

enum result {
    RESULT_OK = 0,
    RESULT_INVALID, // a value out of its range, or values that contradict each other
    RESULT_FORMAT,  // bytes or text that are not what they claim to be
    RESULT_LIMIT,   // larger or more than we accept
    RESULT_MISSING, // something named or required is not there
    RESULT_VERSION, // made by a version that we do not read
    RESULT_CORRUPT, // a checksum or hash does not match
    RESULT_REFUSED, // the other side, or a rule of ours, says no
    RESULT_TIMEOUT, // no answer in time
    RESULT_CLOSED,  // the other side has gone
    RESULT_IO,      // the operating system refused
    RESULT_COUNT
};

// A sentence for each value, without a full stop. Never NULL.
const char *result_sentence(enum result result);

// A fault and its place, in words. The caller owns it; it needs no release.
struct error {
    char text[384];
};

// Writes the text (cut at the array's end) and returns `code`, so that a function can end with
// `return fail(err, RESULT_FORMAT, "case.json: ...")`. `err` may be NULL.
enum result fail(struct error *err, enum result code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

// Puts where it happened before the text that is there: "knee/case.json: " + text. Returns `code`.
enum result fail_in(struct error *err, enum result code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

// An error's text. If it begins with a path, only the file's name of it: for remote users.
const char *error_without_folder(const char *text);
